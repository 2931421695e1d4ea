"""The versions and the machine that a report was made with."""

from __future__ import annotations

import datetime
import os
import platform
from importlib import metadata

from bellcrank.codegen.llvm import processor
from bellcrank.version import version

PACKAGES = ("pin", "casadi", "llvmlite", "numpy")


def made_with() -> tuple[tuple[str, str], ...]:
    """(name, value) of the versions of bellcrank and its main dependencies, the machine and the date."""
    return (
        ("bellcrank", version()),
        ("with", ", ".join(f"{name} {metadata.version(name)}" for name in PACKAGES)),
        ("Python", f"{platform.python_version()} on {platform.system()} {platform.machine()}"),
        ("processor", f"{processor()}, {os.cpu_count()} threads"),
        ("written on", datetime.date.today().isoformat()),
    )


def about(made: tuple[tuple[str, str], ...]) -> tuple[str, str]:
    """The version of bellcrank, and the date."""
    named = dict(made)
    return f"bellcrank {named['bellcrank']}", named["written on"]
