"""Where a mesh file lies that a URDF names, and a file that a mesh file names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from bellcrank.files.access import ALLOW, FileAccess
from bellcrank.text import file_name_here

PACKAGE = "package.xml"  # what a folder holds that is a ROS package


def find_mesh(mesh: str, source: Path, access: FileAccess) -> Path | None:
    """The mesh file of a URDF: package://… and model://… below a folder above it, else beside it; None where it is
    missing or may not be read.

    What `access` does not allow must lie in a ROS package, that of the URDF or one named by package://, in a folder
    above the URDF. Absolute paths, as xacro writes them, are allowed where relative ones are. Where only the files of a
    folder are read, those of a saved run, a URDF in that folder is thought of, too.
    """
    sources = (source, access.folder / source.name) if access.held else (source,)
    try:
        for path, package in (place for each in sources for place in _places(mesh, each)):
            if access.held:
                found = access.allows(path) and path.is_file()
            else:
                found = path.is_file() and (access.allows(path) or _holds(package, path))
            if found:
                return path
    except (OSError, RuntimeError, ValueError):  # a name too long, or with a zero in it
        return None
    return None


def looked_for(meshes: Iterable[str], source: Path, access: FileAccess) -> str:
    """What to say of meshes that were not found, in brackets, where one of them may lie beyond what is looked at."""
    for mesh in meshes:
        kind = mesh.partition("://")[0]
        if access.held or kind in ("package", "model") or not access.allows(source.resolve().parent / _inside(mesh)):
            where = "in the folder of the run" if access.held else "near the URDF and in ROS packages above it"
            return f" (looked for {where}; {ALLOW})"
    return ""


def find_beside(name: str, path: Path, access: FileAccess) -> Path | None:
    """The file that a mesh file names: below the folder above the mesh file's; None where it is missing or may not be
    read.
    """
    plain, near = name.removeprefix("file://").replace("\\", "/"), FileAccess.of(path)
    for candidate in (plain, plain.rpartition("/")[2]):
        try:
            found = (path.parent / candidate).resolve()
            allowed = access.allows(found) or (not access.held and _holds(_package_of(path), found))
            if candidate and allowed and near.allows(found) and found.is_file():
                return found
        except (OSError, RuntimeError, ValueError):
            continue
    return None


def _inside(mesh: str) -> str:
    """What a mesh's name says without its kind."""
    kind, separator, rest = mesh.partition("://")
    return mesh if not separator else rest.lstrip("/") if kind in ("package", "model") else rest


def _places(mesh: str, source: Path) -> Iterator[tuple[Path, Path | None]]:
    """Where a mesh may lie, and the folder there that would have to be a ROS package."""
    folder, mesh = source.resolve().parent, file_name_here(mesh)
    kind, separator, _ = mesh.partition("://")
    rest = _inside(mesh)
    if not separator or kind == "file":
        yield folder / rest, _package_of(source.resolve())
    elif kind in ("package", "model"):
        package, _, inside = rest.partition("/")
        if package in ("", ".", "..") or not inside:
            return
        for up in (folder, *folder.parents):
            yield up / rest, up / package
            if up.name == package:
                yield up / inside, up


def _package_of(path: Path) -> Path | None:
    """The ROS package that a file lies in."""
    return next((up for up in path.parents if (up / PACKAGE).is_file()), None)


def _holds(package: Path | None, path: Path) -> bool:
    """Whether a folder is a ROS package and a file lies in it, links followed, under no hidden name."""
    if package is None or not (package / PACKAGE).is_file():
        return False
    found, folder = path.resolve(), package.resolve()
    return found.is_relative_to(folder) and not any(p.startswith(".") for p in found.relative_to(folder).parts)
