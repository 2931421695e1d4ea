"""The page of the command line, from the parsers of the commands."""

from __future__ import annotations

import argparse

from bellcrank.commands.parser import Parser
from bellcrank.commands.parser import parser as whole_parser

HEAD = """# Command line reference

Made from the command line's own parsers; `bellcrank COMMAND --help` prints the same.

| exit code | meaning |
|---|---|
| 0 | success |
| 1 | the answer is no: a limit is exceeded, a run ended early or has warnings, a check found errors |
| 2 | invalid input, explained in one line |
| 70 | an error in bellcrank itself; please report it |
| 128 + n | interrupted by signal n (130: Ctrl-C, 143: SIGTERM, 129: SIGHUP); what was computed is kept |
"""


def commands() -> dict[str, argparse.ArgumentParser]:
    """The parser of each command by name."""
    names = _subparsers(whole_parser([])).choices
    parsers = {name: _subparsers(whole_parser([name])).choices[name] for name in names}
    for parser in parsers.values():
        assert isinstance(parser, Parser)
        parser.restore_help()
    return parsers


def page() -> str:
    """The page as Markdown."""
    lines = [HEAD]
    for name, parser in commands().items():
        lines += [f"\n## bellcrank {name}\n", f"{parser.description}\n", f"```text\n{_usage(name, parser)}\n```\n"]
        lines += ["| argument | meaning |", "|---|---|"]
        lines += [_row(action) for action in parser._actions if not isinstance(action, argparse._HelpAction)]
    return "\n".join([*lines, ""])


def _subparsers(parser: argparse.ArgumentParser) -> argparse._SubParsersAction[argparse.ArgumentParser]:
    return next(action for action in parser._actions if isinstance(action, argparse._SubParsersAction))


def _usage(name: str, parser: argparse.ArgumentParser) -> str:
    """The command with what it requires."""
    words = ["bellcrank", name]
    for action in parser._actions:
        given = action.metavar if isinstance(action.metavar, str) else action.dest.upper()
        if action.option_strings:
            words += [f"{action.option_strings[0]} {given}"] if action.required else []
        else:
            words.append({"*": f"[{given} ...]", "?": f"[{given}]", "+": f"{given} ..."}.get(str(action.nargs), given))
    return " ".join([*words, "[options]"])


def _row(action: argparse.Action) -> str:
    metavar = action.metavar if isinstance(action.metavar, str) else action.dest.upper()
    if not action.option_strings:
        name = metavar
    else:
        name = ", ".join(action.option_strings)
        name += f" {metavar}" if action.nargs != 0 else ""
    meaning = (action.help or "").replace("%%", "%").replace("|", "\\|")
    name = name.replace("|", "\\|")  # in a cell of a table
    return f"| `{name}` | {meaning[:1].upper() + meaning[1:]} |"
