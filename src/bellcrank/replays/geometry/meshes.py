"""Meshes of a robot: read from files, simplified without visible loss, and cached.

All surfaces of a robot are simplified with the same tolerance: the smallest of an increasing sequence, which begins at
a small share of the robot's size, that brings the number of faces down to BUDGET.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Literal
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from bellcrank.arrays import Array
from bellcrank.codegen import cache as disk
from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess, read_bytes
from bellcrank.replays.geometry.mesh_files import (
    MOST_FACES,
    MOST_PARTS,
    MeshError,
    ReadReferenced,
    check_collada,
    collada_triangles,
    mtl_textures,
    obj_libraries,
    obj_triangles,
    stl_triangles,
    too_many,
)
from bellcrank.replays.geometry.mesh_simplification import Simplifier, weld
from bellcrank.replays.geometry.shapes import Colour, Mesh
from bellcrank.robot.formats.mesh_path import find_beside

# ---- Mesh files (STL, OBJ, COLLADA) as triangles, one part for each colour.


@dataclass(frozen=True, eq=False)
class ColouredTriangles:
    """Triangles of one colour (None: unknown): vertices (k, 3) in the file's unit (COLLADA: m), faces (m, 3)."""

    vertices: Array
    faces: NDArray[np.int64]
    colour: Colour | None = None


def read_parts(data: bytes, suffix: str, read_referenced: ReadReferenced) -> tuple[ColouredTriangles, ...]:
    """The parts of a mesh file, by its suffix (.stl, .obj, .dae): one for each colour, each with at least one triangle.

    As in RViz and Pinocchio, the unit of a COLLADA file is applied and its up axis is not. Raises MeshError if the file
    is of another kind, empty, broken or too large, or holds numbers that are not finite.
    """
    kind, found = suffix.lower().removeprefix("."), dict[Colour | None, list[Array]]()
    if kind not in ("stl", "obj", "dae"):
        raise MeshError(f"is of the kind '{suffix[:10]}'; only .stl, .obj and .dae are read")
    count = parts = 0
    try:
        if kind == "dae":
            primitives = collada_triangles(data, read_referenced)
        else:
            primitives = stl_triangles(data) if kind == "stl" else obj_triangles(data, read_referenced)
        with warnings.catch_warnings(action="ignore"):
            for corners, colour in primitives:
                count, parts = count + len(corners), parts + 1
                if count > MOST_FACES or parts > MOST_PARTS:
                    raise too_many()
                if corners.shape[1:] != (3, 3):
                    raise MeshError("is broken (a vertex does not have three numbers)")
                if not np.abs(corners).max(initial=0.0) < 1e15:  # also where there is a NaN
                    raise MeshError("holds numbers that are not finite")
                if len(corners):
                    found.setdefault(colour, []).append(corners)
    except MeshError:
        raise
    except Exception as error:  # an invalid file may raise anything
        raise MeshError(f"is broken ({str(error)[:80]})") from None
    if not found:
        raise MeshError(f"holds no triangle: it is empty, truncated or no {kind.upper()} file")
    soup = {colour: np.concatenate(corners).reshape(-1, 3) for colour, corners in found.items()}
    return tuple(
        ColouredTriangles(points, np.arange(len(points)).reshape(-1, 3), colour) for colour, points in soup.items()
    )


def named_files(data: bytes, suffix: str) -> tuple[str, ...]:
    """The files that a mesh file refers to: material files (of .obj) and textures (of .mtl, .dae). Raises MeshError."""
    kind = suffix.lower()
    if kind == ".dae":
        return check_collada(data)
    return obj_libraries(data) if kind == ".obj" else mtl_textures(data) if kind == ".mtl" else ()


Detail = Literal["reduced", "full"]
Tolerances = tuple[float, ...]  # m, increasing
Progress = Callable[[float], None]

BUDGET = 30_000  # faces drawn at once: what software rendering shows smoothly
FIRST_TOLERANCE = 2e-4  # of the robot's size: a tenth of a pixel if the robot fills 500 pixels
LEAST_FACTOR, MOST_FACTOR, MOST_STEPS = 2**0.25, 2.0, 32  # from one tolerance to the next
STEP_TIME = 0.2  # approximate time for a tolerance, relative to the one before
MOST_BYTES = 200 * 2**20  # of one file
MODULES = ("meshes", "mesh_files", "shapes", "mesh_simplification")  # on which the cached meshes depend


@dataclass(frozen=True, eq=False)
class MeshPart:
    """The part of a mesh file with one colour (None: the file gives none); `written` counts its faces in the file."""

    mesh: Mesh
    colour: Colour | None
    written: int


@dataclass(frozen=True, eq=False)
class Meshes:
    """The parts of mesh files, why other files have none, and the tolerance (m; 0: not simplified) of all surfaces."""

    parts: Mapping[Path, tuple[MeshPart, ...]]
    failures: Mapping[Path, str]
    tolerance: float


def load_meshes(
    uses: Mapping[Path, Sequence[float]],
    size: float,
    detail: Detail = "reduced",
    progress: Progress = lambda share: None,
    access: FileAccess | None = None,
) -> Meshes:
    """The meshes of files for a robot of a `size` (m); `uses` gives the scales (m per file unit) of each file.

    Vertices are in the file's unit, without duplicates. Files with the same content share their meshes. A file that
    cannot be drawn raises nothing; it is listed in the failures. `progress` is called with the completed share of what
    is not in the cache. `access` says which files the mesh files may name; default: those near each file.
    """
    files: dict[str, _File] = {}
    keys: dict[Path, str] = {}
    failures: dict[Path, str] = {}
    for path, scales in uses.items():
        try:
            file = _File(path, FileAccess.of(path) if access is None else access)
        except MeshError as error:
            failures[path] = str(error)
            continue
        keys[path] = file.key
        files.setdefault(file.key, file).scales.extend(scales)
    plan = "plan-" + disk.digest(_version(), detail, repr(size), *(repr((f.key, f.scales)) for f in files.values()))
    tolerances = _cached_tolerances(plan)
    if tolerances is None:
        tolerances = _choose_tolerances(files.values(), size, progress) if detail == "reduced" else ()
        disk.store(plan, json.dumps(tolerances).encode())
    parts: dict[Path, tuple[MeshPart, ...]] = {}
    made: dict[str, tuple[MeshPart, ...]] = {}
    for key, file in files.items():
        made[key] = _cached_parts(file, tolerances) or _simplified_parts(file, tolerances)
        progress(len(made) / len(files))
    for path, key in keys.items():
        if made[key]:
            parts[path] = made[key]
        else:
            failures[path] = files[key].failure
    return Meshes(parts, failures, tolerances[-1] if tolerances else 0.0)


class _File:
    """The content of a mesh file and, once needed, its surfaces."""

    def __init__(self, path: Path, access: FileAccess) -> None:
        self.access = access
        self.path, self.scales, self.failure = path, list[float](), ""
        self._referenced: dict[Path, bytes] = {}
        self.data = _content(path)
        self._surfaces: list[tuple[Simplifier, Colour | None, int]] | None = None
        self._steps = 0
        self.key = disk.digest(self.data, path.suffix.lower(), *self._named(self.data, path.suffix))

    def _named(self, data: bytes, suffix: str) -> Iterable[bytes]:
        """The contents of the files that a file refers to, and of those that these refer to."""
        for name in named_files(data, suffix):
            content = self.read_referenced(name)
            yield content or b""
            if content is not None and name.lower().endswith(".mtl"):
                yield from self._named(content, ".mtl")

    def read_referenced(self, name: str) -> bytes | None:
        """The content of a file that this one refers to; None if there is none, or beyond MOST_BYTES in total."""
        path = find_beside(name, self.path, self.access)
        try:
            if path is not None and path not in self._referenced:
                self._referenced[path] = _content(path, MOST_BYTES - sum(map(len, self._referenced.values())))
            return None if path is None else self._referenced[path]
        except MeshError:
            return None

    def surfaces(self, tolerances: Tolerances) -> list[tuple[Simplifier, Colour | None, int]]:
        """The surface of each part after these tolerances, its colour and its faces in the file; empty on failure."""
        if self._surfaces is None:
            self._surfaces = []
            try:
                for part in read_parts(self.data, self.path.suffix, self.read_referenced):
                    vertices, faces = weld(part.vertices, part.faces)
                    if len(faces):
                        self._surfaces.append((Simplifier(vertices, faces), part.colour, len(part.faces)))
                if not self._surfaces:
                    self.failure = "holds no triangle with an area"
            except MeshError as error:
                self.failure = str(error)
        for tolerance in tolerances[self._steps :]:
            for surface, _, _ in self._surfaces:
                surface.reduce(tolerance / self.scale)
        self._steps = max(self._steps, len(tolerances))
        return self._surfaces

    @property
    def scale(self) -> float:
        """The largest scale at which the file is used."""
        return max(self.scales)


def _content(path: Path, most: int = MOST_BYTES) -> bytes:
    try:
        return read_bytes(path, most)
    except InputError as error:
        raise MeshError(str(error).removeprefix(f"{path}: ")) from None


def _choose_tolerances(files: Collection[_File], size: float, progress: Progress) -> Tolerances:
    """Increasing tolerances up to the first one with no more than BUDGET faces."""
    tolerances: Tolerances = (size * FIRST_TOLERANCE,)
    total = sum(len(file.data) for file in files)
    while len(tolerances) < MOST_STEPS:
        drawn, read = 0, 0
        for file in files:
            drawn += sum(len(surface.faces) * len(file.scales) for surface, _, _ in file.surfaces(tolerances))
            read += len(file.data)
            progress(1.0 - STEP_TIME ** (len(tolerances) - 1) * (1.0 - (1.0 - STEP_TIME) * read / max(total, 1)))
        if drawn <= BUDGET:
            break
        # the number of faces is about inverse to the tolerance: go half of the way there, in logarithms
        tolerances += (tolerances[-1] * min(max((drawn / BUDGET) ** 0.5, LEAST_FACTOR), MOST_FACTOR),)
    return tolerances


def _simplified_parts(file: _File, tolerances: Tolerances) -> tuple[MeshPart, ...]:
    """The parts of a file after these tolerances, also stored in the cache; none on failure."""
    parts = []
    for surface, colour, written in file.surfaces(tolerances):
        vertices, faces = surface.surface()
        parts.append(MeshPart(Mesh(vertices.astype(np.float32), faces.astype(np.int32)), colour, written))
    if parts:
        arrays: dict[str, np.ndarray] = {}
        for k, part in enumerate(parts):
            colour_numbers = np.array(part.colour or (), dtype=np.float64)
            arrays |= {f"v{k}": part.mesh.vertices, f"f{k}": part.mesh.faces, f"c{k}": colour_numbers}
        arrays["written"] = np.array([part.written for part in parts])
        buffer = BytesIO()
        np.savez(buffer, allow_pickle=False, **arrays)
        disk.store(_parts_key(file, tolerances), buffer.getvalue())
    return tuple(parts)


def _cached_parts(file: _File, tolerances: Tolerances) -> tuple[MeshPart, ...]:
    """The parts of a file after these tolerances from the cache; none if they are not there."""
    raw = disk.load(_parts_key(file, tolerances))
    if raw is None:
        return ()
    try:
        with np.load(BytesIO(raw), allow_pickle=False) as arrays:
            parts = []
            for k, written in enumerate(arrays["written"].tolist()):
                mesh = Mesh(arrays[f"v{k}"], arrays[f"f{k}"])
                colour = tuple(arrays[f"c{k}"].tolist())
                parts.append(MeshPart(mesh, colour if len(colour) == 4 else None, written))
            return tuple(parts)
    except (ValueError, KeyError, OSError, BadZipFile):
        return ()


def _cached_tolerances(plan: str) -> Tolerances | None:
    stored = disk.load_data(plan, [float])
    return None if stored is None else tuple(float(step) for step in stored)


def _parts_key(file: _File, tolerances: Tolerances) -> str:
    return "mesh-" + disk.digest(_version(), file.key, repr(file.scale), repr(tolerances))


@cache
def _version() -> str:
    """A digest of the modules on which the meshes in the cache depend."""
    folder = Path(__file__).parent
    return disk.digest(*((folder / f"{m}.py").read_bytes() for m in MODULES))
