"""`bellcrank completion`: the script with which a shell completes commands, options, names of robots and files."""

from __future__ import annotations

import argparse

_INSTRUCTIONS = """Add to ~/.bashrc: eval "$(bellcrank completion bash)"
Or to ~/.zshrc, after compinit: eval "$(bellcrank completion zsh)"
Or to ~/.config/fish/config.fish: bellcrank completion fish | source
Or to ~/.tcshrc: bellcrank completion tcsh > ~/.bellcrank.tcsh; source ~/.bellcrank.tcsh
"""
_NAMED = {"ROBOT", "SCENE", "RUN"}  # a bundled name or a file
_FILES = {"FILE", "PAGE", "FILE|NAME", "DIR|FILE", "ID|FILE"}
_FOLDERS = {"DIR"}
_NAMES_FUNCTION = {
    "bash": """
_bellcrank_names() {{
  compgen -W "{names}" -- "$1"
  compgen -f -- "$1"
}}
""",
    "zsh": """
_bellcrank_names() {{
  _alternative 'names:name:({names})' 'files:file:_files'
}}
""",
    "fish": """
function _bellcrank_names
  printf '%s\\n' {names}
  __fish_complete_path (commandline -ct)
end
""",
}
_NAMES_CALL = {"bash": "_bellcrank_names", "zsh": "_bellcrank_names", "fish": "(_bellcrank_names)", "tcsh": "f"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The shell."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = _INSTRUCTIONS
    parser.add_argument("shell", choices=("bash", "zsh", "fish", "tcsh"), help="the shell")


def run(arguments: argparse.Namespace) -> int:
    """Print the script."""
    import shtab

    from bellcrank.commands.parser import parser
    from bellcrank.robot import catalog
    from bellcrank.scene.robot_config import names

    everything = parser([], whole=True)
    _complete(everything, _option_values())
    known = " ".join(sorted({*names(), *catalog.names()}))
    preamble = _NAMES_FUNCTION.get(arguments.shell, "").format(names=known)
    print(shtab.complete(everything, shell=arguments.shell, preamble=preamble))
    return 0


def _option_values() -> dict[str, list[str]]:
    """The words that an option takes, where the command checks them after the parser."""
    from typing import get_args

    from bellcrank.actuators.gear import GearKind
    from bellcrank.actuators.motor import MotorKind
    from bellcrank.scene.settings import SOLVERS
    from bellcrank.scene.study import METHODS

    kinds = [kind for kind in (*get_args(MotorKind), *get_args(GearKind)) if kind != "direct"]
    return {
        "--solver": list(SOLVERS),
        "--method": list(METHODS),
        "--kind": kinds,
        "--at": ["equilibrium", "steady", "start"],
    }


def _complete(parser: argparse.ArgumentParser, values: dict[str, list[str]]) -> None:
    """Say of each argument whether it is one of some words, a name of a robot or scene, a file or a folder."""
    import shtab

    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for sub in action.choices.values():
                _complete(sub, values)
            continue
        if isinstance(action.choices, dict):  # which shtab takes for commands
            action.choices = list(action.choices)
        metavar = action.metavar if isinstance(action.metavar, str) else (action.dest or "").upper()
        option = action.option_strings[-1] if action.option_strings else ""
        if option in values and metavar != "S":  # `replay --at` is a time
            action.choices = values[option]
        elif metavar in _NAMED or (metavar == "FILE" and not option):
            action.complete = _NAMES_CALL  # type: ignore[attr-defined]
        elif metavar in _FILES:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
        elif metavar in _FOLDERS:
            action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
