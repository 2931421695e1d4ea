"""The option --trust of commands that read files which name others."""

from __future__ import annotations

import argparse


def add_trust(parser: argparse.ArgumentParser) -> None:
    """The folders whose files may be named."""
    parser.add_argument(
        "--trust",
        action="append",
        default=[],
        metavar="DIR",
        help="read files that the scene, robot or run names from this folder, too, and from those below it; may be "
        "repeated",
    )
