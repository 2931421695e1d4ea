"""The command `bellcrank`: each subcommand is a module with `add_arguments` and `run`."""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import os
import sys
import traceback
from collections.abc import Sequence

from bellcrank import __version__
from bellcrank.errors import BellcrankError
from bellcrank.locale_text import ERRORS, one_line
from bellcrank.printable import printable_streams

_COMMANDS = {
    "size": "size the motors of a robot over its motions",
    "simulate": "integrate a scene's motion, and certify it",
    "sweep": "run a scene for many values of its parameters",
    "replay": "show a run or a sizing as one page that opens in any browser",
    "report": "put a run or a sizing on one page: verdict, tables, pictures, replay",
    "plot": "draw a run or a scene as PNG",
    "verify": "compare compiled equations with a textbook's",
    "check": "say what is wrong with a URDF before it bites",
    "robots": "list the robots and cards that can be named",
    "bench": "measure time against error beside hand-written C and other tools",
}


def _module(name: str) -> str:
    return f"bellcrank.commands.{name}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns 0 (done, or all well), 1 (the answer is no) or 2 (bad input).

    What it prints shows the control characters that names in files may hold, and does not send them to a terminal.
    """
    with printable_streams():
        return _run(arguments)


def _run(arguments: Sequence[str] | None) -> int:
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors=ERRORS)  # a terminal without ² shows \xb2, and the files have it
    given = list(sys.argv[1:] if arguments is None else arguments)
    parser = argparse.ArgumentParser(
        prog="bellcrank",
        description="Size motors and simulate robots from a URDF.",
        epilog="exit codes: 0 done, 1 the answer is no, 2 bad input",
    )
    parser.add_argument("--version", action="version", version=f"bellcrank {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, summary in _COMMANDS.items():
        sub = commands.add_parser(name, help=summary, description=summary[0].upper() + summary[1:] + ".")
        if given[:1] == [name]:  # only the chosen command's module is loaded, so that help is quick
            importlib.import_module(_module(name)).add_arguments(sub)
    try:
        parsed = parser.parse_args(given)
        status: int = importlib.import_module(_module(parsed.command)).run(parsed)
        sys.stdout.flush()
        return status
    except BellcrankError as error:
        print(f"bellcrank: {one_line(str(error))}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("bellcrank: interrupted", file=sys.stderr)
        return 130
    except MemoryError as error:
        why = f": {one_line(str(error))}" if str(error) else ""
        print(f"bellcrank: out of memory{why}; ask for less", file=sys.stderr)
        return 2
    except BrokenPipeError:  # the reader of a pipe has gone: nobody is left to tell
        _forget_output()
        return 0
    except OSError as error:
        where = f": {error.filename}" if error.filename else ""
        print(f"bellcrank: {one_line(f'{error.strerror or error}{where}')}", file=sys.stderr)
        _forget_output()
        return 2
    except Exception:  # 1 means "the answer is no", so a fault of ours needs a number of its own
        traceback.print_exc()
        print("bellcrank: this is a fault of bellcrank; please report it with the lines above", file=sys.stderr)
        return 70


def _forget_output() -> None:
    """Drop what a failed standard output still holds, so that the interpreter does not fail on it again."""
    with contextlib.suppress(io.UnsupportedOperation):  # a text in memory holds nothing back
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
