"""The folders of bundled data: `urdf`, `robots` (scenes and configurations), and example-robot-data."""

from __future__ import annotations

import sys
from pathlib import Path

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name

FOLDERS = ("urdf", "robots")
EXAMPLES = Path("cmeel.prefix", "share", "example-robot-data", "robots")  # below a site-packages folder


def folder(name: str) -> Path:
    """The folder `urdf` or `robots` of an installed package or a source checkout.

    Raises InputError for another name, or where the folder is missing.
    """
    if name not in FOLDERS:
        raise InputError(unknown_name("data folder", name, FOLDERS))
    package = Path(__file__).resolve().parent.parent
    for candidate in (package / "share" / name, package.parent.parent / name):
        if candidate.is_dir():
            return candidate
    raise InputError(
        f"this installation of bellcrank lacks its folder '{name}' (expected beside {package}); reinstall it"
    )


def example_folders() -> list[Path]:
    """The folders of example-robot-data on the import path; empty where it is not installed."""
    return [root for entry in dict.fromkeys(sys.path) if (root := Path(entry or ".") / EXAMPLES).is_dir()]
