"""`bellcrank robots`: the names that commands and `load_robot`, `load_robot_config` and `load_scene` take."""

from __future__ import annotations

import argparse
from pathlib import Path

from bellcrank.robot import catalog

# A configuration is for a command where it has one of these keys.
USES = {"size": ("motions",), "simulate": ("initial", "forces", "control", "base", "simulate")}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """No arguments."""


def run(arguments: argparse.Namespace) -> int:
    """Print configurations and scenes with the commands that they are for, then URDFs, by name."""
    from bellcrank.scene.robot_config import names

    print("robot configurations and scenes:")
    for name, path in names().items():
        title, uses = title_and_uses(path)
        print(f"  {name:20} {uses:16} {title}")
    print("URDFs (bundled, and from example-robot-data):")
    for name, path in sorted(catalog.names().items()):
        print(f"  {name:28} {path.name}")
    return 0


def title_and_uses(path: Path) -> tuple[str, str]:
    """The title of a configuration, and the commands that it is for."""
    from bellcrank.config.yaml_file import read_yaml

    data = read_yaml(path)
    uses = [command for command, keys in USES.items() if not data.keys().isdisjoint(keys)]
    return str(data.get("name", path.stem)), ", ".join(uses)
