"""`bellcrank robots`: every name that `bellcrank size`, `bellcrank simulate` and `load_robot` take."""

from __future__ import annotations

import argparse
from pathlib import Path

from bellcrank.robot import catalog

# A configuration is meant for a command where it has one of these keys.
USES = {"size": ("motions",), "simulate": ("initial", "forces", "control", "base", "simulate")}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """No arguments."""


def run(arguments: argparse.Namespace) -> int:
    """Print configurations and scenes with what they are for, then the URDFs, by name."""
    from bellcrank.scene.robot_config import names

    print("robot configurations and scenes:")
    for name, path in names().items():
        title, uses = _facts(path)
        print(f"  {name:20} {uses:16} {title}")
    print("URDFs (bellcrank's own and example-robot-data's):")
    for name, path in sorted(catalog.names().items()):
        print(f"  {name:28} {path.name}")
    return 0


def _facts(path: Path) -> tuple[str, str]:
    """What a configuration calls itself, and the commands that it is for."""
    from bellcrank.config.yaml_file import read_yaml

    data = read_yaml(path)
    uses = [command for command, keys in USES.items() if not data.keys().isdisjoint(keys)]
    return str(data.get("name", path.stem)), ", ".join(uses)
