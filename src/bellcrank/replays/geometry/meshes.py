"""Mesh files as triangles to draw: read, simplified as far as the eye does not see, and kept in the cache.

All surfaces of a robot are simplified by the same length: the least of a ladder that brings the faces drawn to BUDGET
or fewer, beginning at a small share of the robot's size.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Literal
from zipfile import BadZipFile

import numpy as np

from bellcrank.codegen import cache as disk
from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess, read_bytes
from bellcrank.replays.film.film import Mesh
from bellcrank.replays.geometry.colours import Colour
from bellcrank.replays.geometry.mesh_files import named_files, read_parts
from bellcrank.replays.geometry.simplify import Simplifier, weld
from bellcrank.replays.geometry.triangle_files import MeshError
from bellcrank.robot.mesh_path import find_beside

Detail = Literal["reduced", "full"]
Ladder = tuple[float, ...]
Progress = Callable[[float], None]

BUDGET = 30_000  # faces drawn at once: what software rendering shows smoothly
UNSEEN = 2e-4  # of the robot's size: a tenth of a pixel where the robot fills 500 of them
LEAST_STEP, MOST_STEP, STEPS = 2**0.25, 2.0, 32  # the ladder of tolerances
LATER = 0.2  # about how long a step of the ladder takes, of the one before
MOST_BYTES = 200 * 2**20  # of one file
MODULES = ("meshes", "mesh_files", "triangle_files", "collada_limits", "colours", "simplify")  # that make the meshes


@dataclass(frozen=True, eq=False)
class Piece:
    """What a mesh file has of one colour (None: the file gives none), and how many faces it had as written."""

    mesh: Mesh
    colour: Colour | None
    written: int


@dataclass(frozen=True, eq=False)
class Meshes:
    """The pieces of mesh files, why others have none, and the length (m; 0: as written) that surfaces were shifted."""

    pieces: Mapping[Path, tuple[Piece, ...]]
    failures: Mapping[Path, str]
    shift: float


def load_meshes(
    uses: Mapping[Path, Sequence[float]],
    size: float,
    detail: Detail = "reduced",
    progress: Progress = lambda share: None,
    access: FileAccess | None = None,
) -> Meshes:
    """The meshes of files, each used at these scales (m to the file's unit), of a robot of `size` (m).

    Vertices are in the file's own unit, each place one vertex. Files of the same content share their meshes.
    A file that cannot be drawn raises nothing, it is among the failures. `progress` hears the share that is done of
    what is not in the cache. `access` says which files the mesh files may name, by default those near each.
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
    ladder = _stored_ladder(plan)
    if ladder is None:
        ladder = _climbed(files.values(), size, progress) if detail == "reduced" else ()
        disk.store(plan, json.dumps(ladder).encode())
    pieces: dict[Path, tuple[Piece, ...]] = {}
    made: dict[str, tuple[Piece, ...]] = {}
    for key, file in files.items():
        made[key] = _stored_pieces(file, ladder) or _made(file, ladder)
        progress(len(made) / len(files))
    for path, key in keys.items():
        if made[key]:
            pieces[path] = made[key]
        else:
            failures[path] = files[key].failure
    return Meshes(pieces, failures, ladder[-1] if ladder else 0.0)


class _File:
    """A mesh file's content and, once needed, its surfaces, simplified to the end of a ladder."""

    def __init__(self, path: Path, access: FileAccess) -> None:
        self.access = access
        self.path, self.scales, self.failure = path, list[float](), ""
        self._beside: dict[Path, bytes] = {}
        self.data = _content(path)
        self._surfaces: list[tuple[Simplifier, Colour | None, int]] | None = None
        self._steps = 0
        self.key = disk.digest(self.data, path.suffix.lower(), *self._named(self.data, path.suffix))

    def _named(self, data: bytes, suffix: str) -> Iterable[bytes]:
        """What the files hold that a file names, and those that they name."""
        for name in named_files(data, suffix):
            content = self.beside(name)
            yield content or b""
            if content is not None and name.lower().endswith(".mtl"):
                yield from self._named(content, ".mtl")

    def beside(self, name: str) -> bytes | None:
        """What a file holds that this one names, or None; also where these hold more than MOST_BYTES together."""
        path = find_beside(name, self.path, self.access)
        try:
            if path is not None and path not in self._beside:
                self._beside[path] = _content(path, MOST_BYTES - sum(map(len, self._beside.values())))
            return None if path is None else self._beside[path]
        except MeshError:
            return None

    def surfaces(self, ladder: Ladder) -> list[tuple[Simplifier, Colour | None, int]]:
        """Each part's surface at the end of a ladder (m), its colour and how many faces it had; empty on failure."""
        if self._surfaces is None:
            self._surfaces = []
            try:
                for part in read_parts(self.data, self.path.suffix, self.beside):
                    vertices, faces = weld(part.vertices, part.faces)
                    if len(faces):
                        self._surfaces.append((Simplifier(vertices, faces), part.colour, len(part.faces)))
                if not self._surfaces:
                    self.failure = "holds no triangle that has an area"
            except MeshError as error:
                self.failure = str(error)
        for step in ladder[self._steps :]:
            for surface, _, _ in self._surfaces:
                surface.reduce(step / self.scale)
        self._steps = max(self._steps, len(ladder))
        return self._surfaces

    @property
    def scale(self) -> float:
        return max(self.scales)


def _content(path: Path, most: int = MOST_BYTES) -> bytes:
    try:
        return read_bytes(path, most)
    except InputError as error:
        raise MeshError(str(error).removeprefix(f"{path}: ")) from None


def _climbed(files: Collection[_File], size: float, progress: Progress) -> Ladder:
    """The ladder up to the first tolerance that brings the faces drawn into the budget."""
    ladder: Ladder = (size * UNSEEN,)
    total = sum(len(file.data) for file in files)
    while len(ladder) < STEPS:
        drawn, read = 0, 0
        for file in files:
            drawn += sum(len(surface.faces) * len(file.scales) for surface, _, _ in file.surfaces(ladder))
            read += len(file.data)
            progress(1.0 - LATER ** (len(ladder) - 1) * (1.0 - (1.0 - LATER) * read / max(total, 1)))
        if drawn <= BUDGET:
            break
        # faces go about as the inverse of the tolerance; half of the way there (in logarithms) at a time
        ladder += (ladder[-1] * min(max((drawn / BUDGET) ** 0.5, LEAST_STEP), MOST_STEP),)
    return ladder


def _made(file: _File, ladder: Ladder) -> tuple[Piece, ...]:
    """The pieces of a file at the end of a ladder, also put into the cache; none on failure."""
    pieces = []
    for surface, colour, written in file.surfaces(ladder):
        vertices, faces = surface.surface()
        pieces.append(Piece(Mesh(vertices.astype(np.float32), faces.astype(np.int32)), colour, written))
    if pieces:
        arrays: dict[str, np.ndarray] = {}
        for k, piece in enumerate(pieces):
            colour_numbers = np.array(piece.colour or (), dtype=np.float64)
            arrays |= {f"v{k}": piece.mesh.vertices, f"f{k}": piece.mesh.faces, f"c{k}": colour_numbers}
        arrays["written"] = np.array([piece.written for piece in pieces])
        buffer = BytesIO()
        np.savez(buffer, allow_pickle=False, **arrays)
        disk.store(_pieces_key(file, ladder), buffer.getvalue())
    return tuple(pieces)


def _stored_pieces(file: _File, ladder: Ladder) -> tuple[Piece, ...]:
    """What the cache has of a file at the end of a ladder; none where it has nothing."""
    raw = disk.load(_pieces_key(file, ladder))
    if raw is None:
        return ()
    try:
        with np.load(BytesIO(raw), allow_pickle=False) as arrays:
            pieces = []
            for k, written in enumerate(arrays["written"].tolist()):
                mesh = Mesh(arrays[f"v{k}"], arrays[f"f{k}"])
                colour = tuple(arrays[f"c{k}"].tolist())
                pieces.append(Piece(mesh, colour if len(colour) == 4 else None, written))
            return tuple(pieces)
    except (ValueError, KeyError, OSError, BadZipFile):
        return ()


def _stored_ladder(plan: str) -> Ladder | None:
    stored = disk.load_data(plan, [float])
    return None if stored is None else tuple(float(step) for step in stored)


def _pieces_key(file: _File, ladder: Ladder) -> str:
    return "mesh-" + disk.digest(_version(), file.key, repr(file.scale), repr(ladder))


@cache
def _version() -> str:
    """What the meshes in the cache depend on besides the files: the modules that make them."""
    folder = Path(__file__).parent
    return disk.digest(*((folder / f"{m}.py").read_bytes() for m in MODULES))
