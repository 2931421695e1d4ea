"""Paths in space along which a frame of a robot is drawn: circles and straight lines, with their timing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.motion.generators.profile import Profile
from bellcrank.motion.generators.profile import profile as make_profile
from bellcrank.motion.generators.waypoints import checked_samples
from bellcrank.motion.kinematics.continuation import Curve
from bellcrank.motion.kinematics.rotations import from_rpy
from bellcrank.numerics import length as length_of
from bellcrank.numerics import svd, unit

if TYPE_CHECKING:
    pass

Vector = Sequence[float] | Array
Posture = Mapping[str, float] | Sequence[float] | Array
Orientation = str | Sequence[float] | Sequence[Sequence[float]] | Array
AXES = ("x", "y", "z")
FARTHEST = 1e9  # m, and turns: beyond, a double cannot tell 0.1 µm


@dataclass(frozen=True, kw_only=True)
class FramePath:
    """A path of a frame: a curve in the world over its length, its timing, the orientation wanted, the number of rows,
    and the coordinates of the position that it prescribes. `turn` (3, 3) is a rotation on top of the orientation.
    """

    name: str
    frame: str
    curve: Curve
    timing: Profile
    orientation: Orientation | None
    samples: int
    coordinates: tuple[str, ...]
    knots: Array | None = None  # lengths at which there is a row
    turn: Array | None = None

    def rows(self) -> tuple[Array, Array, Array, Array]:
        """Time, length, speed and acceleration of the rows."""
        return self.timing.rows(self.samples, self.knots)


@dataclass(frozen=True)
class Placement:
    """Where a path lies as a whole: turned by `yaw` (rad) about the world's z axis, then moved by `offset` (3,) m."""

    offset: tuple[float, ...] = (0.0, 0.0, 0.0)
    yaw: float = 0.0

    def moved(self, path: FramePath) -> FramePath:
        """A path there, with the orientation that it asks for."""
        turn, inner = from_rpy(np.array([0.0, 0.0, self.yaw])), path.curve

        def curve(s: Array) -> tuple[Array, Array, Array]:
            position, first, second = inner(s)
            return position @ turn.T + np.array(self.offset), first @ turn.T, second @ turn.T

        return replace(path, curve=curve, turn=turn)


@dataclass(frozen=True, kw_only=True)
class PathOptions:
    """What circles and lines have in common: the arguments of `circle`, which describes them.

    `coordinates` None prescribes all of the position.
    """

    name: str
    frame: str
    profile: str
    duration: float | None = None
    speed: float | None = None
    acceleration: float | None = None
    jerk: float | None = None
    orientation: Orientation | None = None
    samples: int = 1001
    coordinates: Sequence[str] | None = None

    @property
    def title(self) -> str:
        """What messages begin with. Raises InputError where the name is no text."""
        return f"motion '{arguments.text('name', self.name, empty=True)}'"

    def path(self, curve: Curve, length: float) -> FramePath:
        """The path along a curve of this length, m. Raises InputError."""
        title = self.title
        frame = arguments.text("frame", self.frame, "the name of a frame", where=title)
        timing = make_profile(self.profile, length, self.duration, self.speed, self.acceleration, self.jerk)
        samples = checked_samples(title, self.samples)
        coordinates = AXES if self.coordinates is None else _axes(title, self.coordinates)
        return FramePath(
            name=self.name,
            frame=frame,
            curve=curve,
            timing=timing,
            orientation=self.orientation,
            samples=samples,
            coordinates=coordinates,
        )


@dataclass(frozen=True)
class Circle:
    """A circle in the world: center (3,) and radius in m, normal (3,), and the number of turns, negative: clockwise."""

    center: Vector
    radius: float
    normal: Vector = (0.0, 0.0, 1.0)
    turns: float = 1.0

    def path(self, options: PathOptions) -> FramePath:
        """The path along the circle. Raises InputError."""
        title = options.title
        center = arguments.vector("center", self.center, 3, "m", most=FARTHEST, where=title)
        radius = arguments.number("radius", self.radius, "m", above=0.0, most=FARTHEST, where=title)
        turns = arguments.number("turns", self.turns, least=-FARTHEST, most=FARTHEST, where=title)
        if turns == 0.0:
            raise InputError(f"{title}: turns must not be 0; use dwell for a motion at rest")
        axis = arguments.vector("normal", self.normal, 3, most=arguments.LARGEST, where=title)
        if length_of(axis) < 1e-12:
            raise InputError(f"{title}: normal must not be zero")
        axis = unit(axis, f"{title}: normal is")
        e1 = np.eye(3)[0] - axis[0] * axis
        if np.linalg.norm(e1) < 1e-6:
            e1 = np.eye(3)[1] - axis[1] * axis
        e1 = e1 / np.linalg.norm(e1)
        e2 = np.cross(axis, e1) * np.sign(turns)

        def curve(s: Array) -> tuple[Array, Array, Array]:
            cos, sin = np.cos(s / radius)[:, None], np.sin(s / radius)[:, None]
            outward = cos * e1 + sin * e2
            return center + radius * outward, cos * e2 - sin * e1, -outward / radius

        return options.path(curve, 2.0 * np.pi * radius * abs(turns))


@dataclass(frozen=True)
class Line:
    """A straight line in the world to `end` (3,) m, from `begin` (3,) m or, where that is None, from the frame."""

    end: Vector
    begin: Vector | None = None

    def path(self, options: PathOptions, here: Array) -> FramePath:
        """The path along the line, for a frame that is `here` (3,) m at the start. Raises InputError."""
        title = options.title
        last = arguments.vector("end", self.end, 3, "m", most=FARTHEST, where=title)
        first = here
        if self.begin is not None:
            first = arguments.vector("begin", self.begin, 3, "m", most=FARTHEST, where=title)
        length = float(np.linalg.norm(last - first))
        if length < 1e-9:
            raise InputError(f"{title}: the line begins where it ends; use dwell for a motion at rest")
        direction = (last - first) / length

        def curve(s: Array) -> tuple[Array, Array, Array]:
            return first + s[:, None] * direction, np.tile(direction, (len(s), 1)), np.zeros((len(s), 3))

        return options.path(curve, length)


def _axes(title: str, coordinates: Sequence[str]) -> tuple[str, ...]:
    """The coordinates that a path prescribes, in the order x, y, z."""
    expected = "some of x, y, z, each once"
    if isinstance(coordinates, str):
        coordinates = list(coordinates)
    listed = arguments.several("coordinates", coordinates, str, expected, where=title)
    found = tuple(axis for axis in AXES if axis in listed)
    if not found or len(found) != len(listed):
        raise InputError(f"{title}: coordinates must be {expected}, got {', '.join(listed)[:200]!r}")
    return found


def wanted_rotation(path: FramePath, held: Array) -> Array | None:
    """The rotation matrix (3, 3) that a path asks for, frame to world, or None; `held` is the present one."""
    found = _own_rotation(path, held)
    return found if found is None or path.turn is None else np.asarray(path.turn @ found)


def _own_rotation(path: FramePath, held: Array) -> Array | None:
    """The same before the path is placed."""
    title, orientation = f"motion '{path.name}'", path.orientation
    if orientation is None:
        return None
    if isinstance(orientation, str):
        if orientation != "hold":
            arguments.refuse("orientation", "'hold', rpy or a rotation matrix", orientation, title)
        return np.array(held)
    given = arguments.as_array("orientation", orientation, "numbers (rpy or a matrix) or 'hold'", title)
    if given.shape == (3,) and np.all(np.isfinite(given)):
        return from_rpy(given)
    if given.shape != (3, 3) or not np.all(np.isfinite(given)):
        raise InputError(f"{title}: orientation must be rpy (3 numbers) or a 3 x 3 matrix, got shape {given.shape}")
    u, _, vt = svd(given, f"{title}: the orientation is")
    nearest = np.asarray(u @ vt)
    if np.max(np.abs(nearest - given)) > 1e-6 or np.linalg.det(nearest) < 0.0:
        raise InputError(f"{title}: the orientation matrix is not a rotation (orthonormal, determinant 1)")
    return nearest
