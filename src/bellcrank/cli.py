"""The command `bellcrank`. Each subcommand is a module with the functions `add_arguments` and `run`."""

from __future__ import annotations

import os
import sys
import threading
from typing import TYPE_CHECKING

from bellcrank.terminal import interruption
from bellcrank.version import version

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

_COMMANDS = {
    "size": "size the motors of a robot over its motions",
    "select": "choose the motor and gear of each joint from a catalogue",
    "fastest": "find the fastest motion along a path within the limits of joints and motors",
    "simulate": "simulate a scene, and check the accuracy of the result",
    "sweep": "simulate a scene for many values of its parameters",
    "replay": "write the replay of a run or a sizing as one HTML page",
    "report": "write the report of a run or a sizing as one HTML page: verdict, tables, pictures, replay",
    "plot": "draw a run, a scene or a sizing",
    "check": "find errors in URDF files",
    "catalogue": "list, show and check motors and gears to choose from",
    "robots": "list the names of robots, robot configurations and scenes",
    "demo": "write a gallery of pages of bundled robots and scenes",
    "doctor": "print versions, processor, cache, browser and extras, and what is wrong",
    "completion": "print a script that completes commands in a shell",
}


def _modules(given: list[str]) -> dict[str, str]:
    """Module of each subcommand by name: bellcrank's own and, unless one of these is given, those that other packages
    add through the entry point group "bellcrank.commands".
    """
    own = {name: f"bellcrank.commands.{name}" for name in _COMMANDS}
    if given[:1] and given[0] in own:
        return own  # searching for entry points takes time
    from importlib.metadata import entry_points

    added = {entry.name: entry.value for entry in entry_points(group="bellcrank.commands")}
    return own | {name: added[name] for name in sorted(added) if name not in own}


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


def _parser(given: list[str]) -> argparse.ArgumentParser:
    """The parser of all commands; only the given command has its arguments."""
    import argparse
    import importlib

    parser = argparse.ArgumentParser(
        prog="bellcrank",
        description="Size motors and simulate robots from a URDF.",
        epilog="Exit codes: 0: success; 1: a limit is exceeded, a check failed or a run ended early; 2: invalid input, "
        "explained in one line; 128 + n: interrupted by signal n.",
    )
    parser.add_argument("--version", action="version", version=f"bellcrank {version()}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, module in _modules(given).items():
        summary = _COMMANDS.get(name) or importlib.import_module(module).SUMMARY
        sub = commands.add_parser(name, help=summary, description=summary[0].upper() + summary[1:] + ".")
        if given[:1] == [name]:  # only this command's module is loaded, so that help is quick
            importlib.import_module(module).add_arguments(sub)
            sub.set_defaults(module=module)
    return parser


def _run(given: list[str]) -> int:
    """Run a command. Control characters in what it prints, which names in files may contain, are escaped."""
    from bellcrank.terminal.streams import printable_streams

    with printable_streams():
        return _command(given)


def _command(given: list[str]) -> int:
    """Run a command and turn errors into messages and exit codes."""
    import importlib
    import traceback

    from bellcrank.errors import BellcrankError
    from bellcrank.text import ERRORS, one_line

    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors=ERRORS)  # a terminal without ² shows \xb2; files contain ²
    try:
        parsed = _parser(given).parse_args(given)
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
