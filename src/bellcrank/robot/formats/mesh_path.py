"""Finding the mesh files that a URDF names, and the files that mesh files name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from bellcrank.files.access import ALLOW, FileAccess
from bellcrank.messages import file_name_here

PACKAGE = "package.xml"  # the file that makes a folder a ROS package


def find_mesh(mesh: str, source: Path, access: FileAccess) -> Path | None:
    """The mesh file that a URDF names: package://… and model://… below a folder above the URDF, others relative to it;
    None where the file is missing or may not be read.

    A file that `access` does not allow must be in a ROS package, that of the URDF or one named by package://, in a
    folder above the URDF. Absolute paths, as xacro writes them, are allowed where relative ones are. Where only the
    files of a folder may be read (those of a saved run), paths relative to a URDF in that folder are tried too.
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
    """A remark in brackets on where meshes that were not found were looked for, if one of them may be elsewhere."""
    for mesh in meshes:
        kind = mesh.partition("://")[0]
        if access.held or kind in ("package", "model") or not access.allows(source.resolve().parent / _inside(mesh)):
            where = "in the folder of the run" if access.held else "near the URDF and in ROS packages above it"
            return f" (looked for {where}; {ALLOW})"
    return ""


def find_beside(name: str, path: Path, access: FileAccess) -> Path | None:
    """The file that a mesh file names, below the parent of the mesh file's folder; None where it is missing or may not
    be read.
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
    """A mesh's name without its scheme."""
    kind, separator, rest = mesh.partition("://")
    return mesh if not separator else rest.lstrip("/") if kind in ("package", "model") else rest


def _places(mesh: str, source: Path) -> Iterator[tuple[Path, Path | None]]:
    """The paths at which a mesh may be, each with the folder that has to be a ROS package."""
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
