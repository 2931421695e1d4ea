"""`bellcrank completion`: the script with which a shell completes commands, options, names of robots and files."""

from __future__ import annotations

import argparse

_INSTRUCTIONS = """Add to ~/.bashrc: eval "$(bellcrank completion bash)"
Or to ~/.zshrc, after compinit: eval "$(bellcrank completion zsh)"
"""
_NAMED = {"ROBOT", "SCENE", "RUN", "FILE", "ROBOT_OR_SCENE"}  # positional arguments that are a name or a file
_PLACES = {"FILE", "DIR", "FOLDER"}
_BASH = """
_bellcrank_names() {{
  compgen -W "{names}" -- "$1"
  compgen -f -- "$1"
}}
"""
_ZSH = """
_bellcrank_names() {{
  _alternative 'names:name:({names})' 'files:file:_files'
}}
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The shell."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = _INSTRUCTIONS
    parser.add_argument("shell", choices=("bash", "zsh", "tcsh"), help="the shell")


def run(arguments: argparse.Namespace) -> int:
    """Print the script."""
    import shtab

    from bellcrank.commands.parser import parser
    from bellcrank.robot import catalog
    from bellcrank.scene.robot_config import names

    everything = parser([], whole=True)
    _complete(everything)
    known = " ".join(sorted({*names(), *catalog.names()}))
    preamble = {"bash": _BASH.format(names=known), "zsh": _ZSH.format(names=known)}.get(arguments.shell, "")
    print(shtab.complete(everything, shell=arguments.shell, preamble=preamble))
    return 0


def _complete(parser: argparse.ArgumentParser) -> None:
    """Say of each argument whether it is a name of a robot or scene, or a place in the file system."""
    import shtab

    named = {"bash": "_bellcrank_names", "zsh": "_bellcrank_names", "tcsh": "f"}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for sub in action.choices.values():
                _complete(sub)
            continue
        if isinstance(action.choices, dict):  # which shtab takes for commands
            action.choices = list(action.choices)
        metavar = action.metavar if isinstance(action.metavar, str) else (action.dest or "").upper()
        if not action.option_strings and metavar in _NAMED:
            action.complete = named  # type: ignore[attr-defined]
        elif metavar in _PLACES:
            action.complete = shtab.DIRECTORY if metavar != "FILE" else shtab.FILE  # type: ignore[attr-defined]
