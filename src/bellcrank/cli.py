"""The command `bellcrank`. Each subcommand is a module with the functions `add_arguments` and `run`."""

from __future__ import annotations

import os
import sys
import threading
from typing import TYPE_CHECKING

from bellcrank.terminal import interruption

if TYPE_CHECKING:
    from collections.abc import Sequence

# BLAS would divide small products among threads, whose waiting costs more than it gains; what is large has threads of
# its own. To be set before NumPy is imported.
_BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code.

    Exit code 0: success; 1: a limit is exceeded, a check failed or a run ended early; 2: invalid input, explained in
    one line; 128 + n: interrupted by signal n (2: Ctrl-C, 15: SIGTERM).

    Without `arguments`, those of the process are used, and its signals and standard streams are handled too. A signal
    ends the process even while threads do what cannot be stopped, such as compiling.
    """
    if arguments is not None:
        return _run(list(arguments))
    status = 130
    for name in _BLAS_THREADS:
        os.environ.setdefault(name, "1")
    with interruption.handled():  # before anything else is imported, which takes time
        try:
            status = _run_on_streams(sys.argv[1:])
        except KeyboardInterrupt:
            _interrupted()
    asked = interruption.exit_status()
    if asked is not None and any(not it.daemon for it in threading.enumerate() if it is not threading.main_thread()):
        os._exit(asked)
    return asked or status


def _run_on_streams(given: list[str]) -> int:
    """Run a command with the process's standard streams, and report where these cannot be written to."""
    from bellcrank.terminal.streams import standard_streams

    with standard_streams() as output:
        try:
            status = _run(given)
            sys.stdout.flush()
        except SystemExit as stop:  # argparse has printed its message
            status = stop.code if isinstance(stop.code, int) else 0
        except KeyboardInterrupt:
            status = _interrupted()
        if output.failure is not None:
            print(f"bellcrank: standard output: {output.failure.strerror}", file=sys.stderr)
            status = status or 2
    return status


def _interrupted() -> int:
    print(f"bellcrank: interrupted{interruption.signal_name()}", file=sys.stderr)
    return interruption.exit_status() or 130


def _run(given: list[str]) -> int:
    """Run a command. Control characters in what it prints, which names in files may contain, are escaped."""
    from bellcrank.terminal.streams import printable_streams

    with printable_streams():
        return _command(given)


def _command(given: list[str]) -> int:
    """Run a command and turn errors into messages and exit codes."""
    import importlib
    import traceback

    from bellcrank.commands.parser import overview, parser
    from bellcrank.errors import BellcrankError
    from bellcrank.messages import ERRORS, one_line

    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors=ERRORS)  # a terminal without ² shows \xb2; files contain ²
    try:
        if not given:
            print(overview())
            return 0
        parsed = parser(given).parse_args(given)
        status: int = importlib.import_module(parsed.module).run(parsed)
        sys.stdout.flush()
        return status
    except BellcrankError as error:
        print(f"bellcrank: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return _interrupted()
    except MemoryError as error:
        why = f": {one_line(str(error))}" if str(error) else ""
        print(f"bellcrank: out of memory{why}; reduce the size of the problem", file=sys.stderr)
        return 2
    except OSError as error:
        where = f": {error.filename}" if error.filename else ""
        print(f"bellcrank: {one_line(f'{error.strerror or error}{where}')}", file=sys.stderr)
        return 2
    except Exception:  # a fault of bellcrank must not look like exit code 1
        if interruption.exit_status() is not None:  # what libraries turn the signal into
            return _interrupted()
        traceback.print_exc()
        print("bellcrank: this is a fault of bellcrank; please report it with the lines above", file=sys.stderr)
        return 70
