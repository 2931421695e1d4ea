"""The parser of the command line: every command, its summary and, where they are needed, its arguments."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from bellcrank.messages import unknown_name
from bellcrank.version import version

COMMANDS = {
    "size": "size the motors of a robot over its motions",
    "select": "choose the motor and gear of each joint from a catalogue",
    "judge": "compare the motors and gears that a robot configuration names with their loads",
    "fastest": "find the fastest motion along a path within the limits of joints and motors",
    "simulate": "simulate a scene, and check the accuracy of the result",
    "sweep": "simulate a scene for many values of its parameters",
    "optimise": "find the best values of parameters of a scene within bounds and limits",
    "synthesise": "find a linkage whose coupler passes given points, or whose output is a given function",
    "modes": "linearise a scene, and list, show and write its modes",
    "replay": "write the replay of a run or a sizing as one HTML page",
    "report": "write the report of a run or a sizing as one HTML page: verdict, tables, pictures, replay",
    "plot": "draw a run, a scene or a sizing",
    "check": "find errors in robot files, and whether the loops of a mechanism close",
    "catalogue": "list, show and check motors and gears to choose from",
    "robots": "list the names of robots, robot configurations and scenes",
    "demo": "write a gallery of pages of bundled robots and scenes",
    "doctor": "print versions, processor, cache, browser and extras, and what is wrong",
    "completion": "print the script with which a shell completes commands",
}
ALIASES = {  # names of the Python functions
    "fastest": ("time-optimal", "time_optimal"), "modes": ("linearise", "linearize"),
    "check": ("check-urdf", "check_urdf"),
}  # fmt: skip
OVERVIEW = """bellcrank {version}: size the motors of robots, and simulate robots, from a URDF, MJCF or SDFormat file

  bellcrank size ur5             what each motor must deliver over a motion, against its data sheet
  bellcrank select ur5           which motors and gears of a catalogue do it
  bellcrank fastest ur5          the shortest cycle that the motors allow
  bellcrank simulate four_bar    how a robot, linkage or rolling body moves, and how exact that is
  bellcrank replay four_bar      the motion as one page for any browser
  bellcrank demo                 all of this at a glance: a gallery of pages, in a few seconds
  bellcrank doctor               whether everything that it needs is here
`bellcrank --help` lists every command, `bellcrank COMMAND --help` explains one, `bellcrank robots` lists robots."""


class Parser(argparse.ArgumentParser):
    """A parser that suggests the nearest word where one is not known, and may keep options for --help-all."""

    kept: Mapping[argparse.Action, str | None] = MappingProxyType({})

    def shorten_help(self, main: Sequence[str]) -> None:
        """Leave out of --help, but not of --help-all, all options but the main ones, which come first."""
        self.add_argument("--help-all", action=_HelpAll, nargs=0, help=f"list all {len(self._actions)} options")
        first = [action for action in self._actions if not action.option_strings]
        chosen = {name: action for action in self._actions for name in action.option_strings}
        shown = [*first, *(chosen[name] for name in main), chosen["--help"], chosen["--help-all"]]
        self.kept = {action: action.help for action in self._actions if action not in shown}
        for action in self.kept:
            action.help = argparse.SUPPRESS
        for group in self._action_groups:
            group._group_actions.sort(key=lambda action: shown.index(action) if action in shown else len(shown))
        self._actions.sort(key=lambda action: shown.index(action) if action in shown else len(shown))

    def restore_help(self) -> None:
        """Show again what `shorten_help` left out."""
        for action, text in self.kept.items():
            action.help = text

    def _check_value(self, action: argparse.Action, value: object) -> None:
        if action.choices is not None and value not in action.choices:
            kind = "command" if isinstance(action, argparse._SubParsersAction) else "value"
            raise argparse.ArgumentError(action, unknown_name(kind, str(value), map(str, action.choices)))


class _HelpAll(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: object, **__: object) -> None:
        assert isinstance(parser, Parser)
        parser.restore_help()
        parser.print_help()
        parser.exit()


def overview() -> str:
    """What bellcrank can do, in ten lines."""
    return OVERVIEW.format(version=version())


class _Version(argparse.Action):
    """Prints the version; it is looked up only then, which takes 20 ms."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object, **__: object) -> None:
        parser._print_message(f"bellcrank {version()}\n", sys.stdout)
        parser.exit()


def parser(given: list[str], *, whole: bool = False) -> argparse.ArgumentParser:
    """The parser of all commands. Only the given command has its arguments, or all of them have with `whole`."""
    made = Parser(
        prog="bellcrank",
        description="Size the motors of robots, and simulate robots, from a URDF, MJCF or SDFormat file.",
        epilog="Exit codes: 0: success; 1: a limit is exceeded, a check failed or a run ended early; 2: invalid input, "
        "explained in one line; 128 + n: interrupted by signal n.",
    )
    made.add_argument("--version", action=_Version, nargs=0, help="show program's version number and exit")
    commands = made.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, module in _modules(given).items():
        summary = COMMANDS.get(name) or importlib.import_module(module).SUMMARY
        names = ALIASES.get(name, ())
        asked = bool(given) and given[0] in (name, *names)
        description = summary[0].upper() + summary[1:] + "."
        sub = commands.add_parser(name, help=summary, description=description, aliases=names if asked else ())
        if whole or asked:  # only this command's module is loaded, so that help is quick
            loaded = importlib.import_module(module)
            loaded.add_arguments(sub)
            sub.set_defaults(module=module)
            if not whole and (main := getattr(loaded, "MAIN_OPTIONS", ())):
                sub.shorten_help(main)
    return made


def _modules(given: list[str]) -> dict[str, str]:
    """Module of each subcommand by name: bellcrank's own and, unless one of these is given, those that other packages
    add through the entry point group "bellcrank.commands".
    """
    own = {name: f"bellcrank.commands.{name}" for name in COMMANDS}
    if given[:1] and (given[0] in own or any(given[0] in names for names in ALIASES.values())):
        return own  # searching for entry points takes time
    from importlib.metadata import entry_points

    added = {entry.name: entry.value for entry in entry_points(group="bellcrank.commands")}
    return own | {name: added[name] for name in sorted(added) if name not in own}
