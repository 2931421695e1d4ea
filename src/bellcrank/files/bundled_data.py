"""Where bundled data lies: bellcrank's own (robots in ``urdf``, their configurations in ``robots``), and the package
example-robot-data.
"""

from __future__ import annotations

import sys
from pathlib import Path

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name

FOLDERS = ("urdf", "robots")
EXAMPLES = Path("cmeel.prefix", "share", "example-robot-data", "robots")  # below a site-packages folder


def folder(name: str) -> Path:
    """The folder of bundled ``urdf`` or ``robots`` files, in an installed package or in a source checkout.

    Raises InputError for another name, or where the installation lacks the folder.
    """
    if name not in FOLDERS:
        raise InputError(unknown_name("data folder", name, FOLDERS))
    package = Path(__file__).resolve().parent.parent
    for candidate in (package / "share" / name, package.parent.parent / name):
        if candidate.is_dir():
            return candidate
    raise InputError(
        f"this installation of bellcrank lacks its folder '{name}' (looked beside {package}); install it again"
    )


def example_folders() -> list[Path]:
    """The folders of example-robot-data that the import path offers (none where it is not installed)."""
    return [root for entry in dict.fromkeys(sys.path) if (root := Path(entry or ".") / EXAMPLES).is_dir()]
