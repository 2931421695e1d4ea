"""`bellcrank robots`: every name that `bellcrank size` and `load_robot` take."""

from __future__ import annotations

import argparse

from bellcrank import shipped
from bellcrank.urdf import catalog


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """No arguments."""


def run(arguments: argparse.Namespace) -> int:
    """Print the robot cards and the URDFs, by name."""
    cards = sorted(path.stem for path in shipped.folder("robots").glob("*.yaml"))
    print("robot cards (URDF, motions and drives):")
    print("  " + ", ".join(cards))
    print("URDFs (bellcrank's own and example-robot-data's):")
    for name, path in sorted(catalog.names().items()):
        print(f"  {name:28} {path.name}")
    return 0
