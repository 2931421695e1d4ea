"""The build backend: scikit-build-core's, whose wheel is kept in build/wheels and used again while nothing it is made
of changes. Compiling takes minutes, and `pip install .` would do it anew each time.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

from scikit_build_core import build as backend
from scikit_build_core.build import (  # noqa: F401  the hooks that stay as they are
    build_editable,
    build_sdist,
    get_requires_for_build_editable,
    get_requires_for_build_sdist,
    get_requires_for_build_wheel,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "build" / "wheels"
MADE_OF = ("pyproject.toml", "LICENSE", "README.md", "src", "urdf", "robots")
TOOLS = ("scikit-build-core", "nanobind", "libpinocchio", "cmeel-eigen", "casadi")
SETTINGS = ("CC", "CXX", "CFLAGS", "CXXFLAGS", "CPPFLAGS", "LDFLAGS", "CMAKE_ARGS", "MACOSX_DEPLOYMENT_TARGET")


def build_wheel(
    wheel_directory: str,
    config_settings: Mapping[str, list[str] | str] | None = None,
    metadata_directory: str | None = None,
) -> str:
    """Put the wheel into a folder, and return its name (PEP 517)."""
    kept = KEPT / _digest(config_settings)
    for wheel in kept.glob("*.whl"):
        shutil.copy2(wheel, wheel_directory)
        return wheel.name
    say("bellcrank: compiling its C++, which takes some minutes, once; the wheel is kept in build/wheels")
    name = backend.build_wheel(wheel_directory, dict(config_settings or {}), metadata_directory)
    try:
        _keep(Path(wheel_directory, name), kept)
    except OSError as error:  # such as a checkout that cannot be written
        print(f"the wheel is not kept for the next install: {error}", file=sys.stderr)
    return name


def say(text: str) -> None:
    """Write a line to the terminal where there is one: pip does not show what a build prints, except with -v."""
    try:
        with Path("/dev/tty").open("w", encoding="utf-8") as terminal:
            terminal.write(f"\n{text}\n")
    except OSError:  # no terminal
        print(text, file=sys.stderr)


def _keep(wheel: Path, kept: Path) -> None:
    """Keep a wheel, in place of older ones for the same Python."""
    tag = wheel.name.split("-")[2]
    for older in KEPT.glob(f"*/*-{tag}-*.whl"):
        shutil.rmtree(older.parent)
    kept.mkdir(parents=True, exist_ok=True)
    temporary = kept / f"{wheel.name}.{os.getpid()}"
    shutil.copy2(wheel, temporary)
    os.replace(temporary, kept / wheel.name)


def _digest(config_settings: Mapping[str, list[str] | str] | None) -> str:
    """The SHA-256 of all that a wheel is made of and with."""
    found = hashlib.sha256()
    for text in (
        sys.version,
        platform.platform(),
        repr(sorted((config_settings or {}).items())),
        *(f"{name} {importlib.metadata.version(name)}" for name in TOOLS),
        *(f"{name}={os.environ.get(name, '')}" for name in SETTINGS),
        _compiler(),
    ):
        found.update(text.encode() + b"\0")
    for path in _sources():
        found.update(str(path.relative_to(ROOT)).encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return found.hexdigest()


def _sources() -> Iterator[Path]:
    """The files that a wheel is made of, in the order of their names."""
    for name in MADE_OF:
        path = ROOT / name
        for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
            if file.is_file() and file.suffix not in (".pyc", ".so"):
                yield file


def _compiler() -> str:
    """The version of the compiler that CMake takes; "" where it cannot be asked."""
    try:
        asked = [os.environ.get("CXX", "c++"), "--version"]
        return subprocess.run(asked, capture_output=True, text=True, check=True, timeout=60).stdout
    except (OSError, subprocess.SubprocessError):
        return ""
