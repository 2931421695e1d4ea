"""Where the files that ship with bellcrank lie: robots in ``urdf``, their cards in ``robots``."""

from __future__ import annotations

from pathlib import Path

from bellcrank.errors import InputError, among

FOLDERS = ("urdf", "robots")


def folder(name: str) -> Path:
    """The folder of shipped ``urdf`` or ``robots`` files, in an installed package or in a source checkout.

    Raises InputError for another name, or where the installation lacks the folder.
    """
    if name not in FOLDERS:
        raise InputError(among("data folder", name, FOLDERS))
    package = Path(__file__).resolve().parent.parent
    for candidate in (package / "share" / name, package.parent.parent / name):
        if candidate.is_dir():
            return candidate
    raise InputError(
        f"this installation of bellcrank lacks its folder '{name}' (looked beside {package}); install it again"
    )
