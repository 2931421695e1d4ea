"""Motions along paths in space: a frame of the robot drawn along a circle or a straight line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank import arguments
from bellcrank.errors import InputError
from bellcrank.motion.continuation import Curve
from bellcrank.motion.coordinates import Array, JointLike
from bellcrank.motion.frame_task import check_plane, frame_task
from bellcrank.motion.inverse_kinematics import NEAR_SINGULAR, follow
from bellcrank.motion.motion import Motion, dwell, join, limit_notes
from bellcrank.motion.profile import Profile
from bellcrank.motion.profile import profile as make_profile
from bellcrank.motion.rotations import from_rpy
from bellcrank.motion.waypoints import checked_samples, waypoints
from bellcrank.numerics import length as length_of
from bellcrank.numerics import svd, unit

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot

__all__ = ["circle", "dwell", "join", "line", "waypoints"]

Vector = Sequence[float] | Array
Posture = Mapping[str, float] | Sequence[float] | Array
Orientation = str | Sequence[float] | Sequence[Sequence[float]] | Array
Limits = tuple[float | None, float | None, float | None, float | None]
AXES = ("x", "y", "z")
FARTHEST = 1e9  # m, and turns: beyond, a double cannot tell 0.1 µm


@dataclass(frozen=True)
class FramePath:
    """Where a frame goes, and when: a curve in the world over its length, its timing, the orientation wanted, the
    number of rows, and which coordinates of the position it prescribes.
    """

    name: str
    frame: str
    curve: Curve
    timing: Profile
    orientation: Orientation | None
    samples: int
    coordinates: tuple[str, ...]


def circle(
    robot: Robot,
    frame: str,
    center: Vector,
    radius: float,
    duration: float | None = None,
    start: Posture | None = None,
    samples: int = 1001,
    profile: str = "constant",
    normal: Vector = (0.0, 0.0, 1.0),
    turns: float = 1.0,
    orientation: Orientation | None = None,
    speed: float | None = None,
    acceleration: float | None = None,
    jerk: float | None = None,
    coordinates: Sequence[str] = AXES,
    name: str = "circle",
) -> Motion:
    """Draw a frame along a circle (center (3,), radius in m, world frame), from the branch of the `start`
    posture.

    The circle starts at center + radius e1, e1 the world's x direction made perpendicular to the normal (y
    where the normal is along x), and runs counter-clockwise about the normal, clockwise for negative `turns`.
    Time comes from `duration` (s) or the limits `speed`, `acceleration`, `jerk` along the path (m/s, m/s²,
    m/s³) and the profile (see `bellcrank.motion.profile`); with "constant" the rows lie at equal angles.
    `orientation`: None (free), "hold" (as in the start posture), rpy (3,) in rad, or a rotation matrix (3,
    3), frame to world. `coordinates` are those of the frame's position (world) that the path prescribes, the
    others are free. With joints to spare the posture is the one nearest to `start`. Raises InputError, and
    UnreachableError naming time, pose and by how much.
    """
    arguments.robot(robot)
    timing = (duration, speed, acceleration, jerk)
    path = circle_path(frame, center, radius, normal, turns, timing, profile, orientation, samples, coordinates, name)
    return _along(robot, path, _posture(robot, start))


def circle_path(
    frame: str,
    center: Vector,
    radius: float,
    normal: Vector,
    turns: float,
    timing: Limits,
    profile: str,
    orientation: Orientation | None,
    samples: int,
    coordinates: Sequence[str],
    name: str,
) -> FramePath:
    """The path of `circle`, with `timing` its duration, speed, acceleration and jerk. Raises InputError."""
    title = f"motion '{arguments.text('name', name, empty=True)}'"
    frame = arguments.text("frame", frame, "the name of a frame", where=title)
    middle = arguments.vector("center", center, 3, "m", most=FARTHEST, where=title)
    radius = arguments.number("radius", radius, "m", above=0.0, most=FARTHEST, where=title)
    turns = arguments.number("turns", turns, least=-FARTHEST, most=FARTHEST, where=title)
    if turns == 0.0:
        raise InputError(f"{title}: turns must not be 0; use dwell to stand still")
    axis = arguments.vector("normal", normal, 3, most=arguments.LARGEST, where=title)
    if length_of(axis) < 1e-12:
        raise InputError(f"{title}: normal must not be zero")
    axis = unit(axis, f"{title}: normal is")
    e1 = np.eye(3)[0] - axis[0] * axis
    if np.linalg.norm(e1) < 1e-6:
        e1 = np.eye(3)[1] - axis[1] * axis
    e1 = e1 / np.linalg.norm(e1)
    e2 = np.cross(axis, e1) * np.sign(turns)
    times = make_profile(profile, 2.0 * np.pi * radius * abs(turns), *timing)

    def curve(s: Array) -> tuple[Array, Array, Array]:
        cos, sin = np.cos(s / radius)[:, None], np.sin(s / radius)[:, None]
        outward = cos * e1 + sin * e2
        return middle + radius * outward, cos * e2 - sin * e1, -outward / radius

    return FramePath(name, frame, curve, times, orientation, checked_samples(title, samples), _axes(title, coordinates))


def line(
    robot: Robot,
    frame: str,
    end: Vector,
    duration: float | None = None,
    start: Posture | None = None,
    samples: int = 1001,
    profile: str = "quintic",
    begin: Vector | None = None,
    orientation: Orientation | None = None,
    speed: float | None = None,
    acceleration: float | None = None,
    jerk: float | None = None,
    coordinates: Sequence[str] = AXES,
    name: str = "line",
) -> Motion:
    """Draw a frame along the straight line to `end` (3,) in m, world frame, from where the `start` posture
    has it.

    With `begin` (3,) the line starts there, and `start` only selects the branch. The other arguments, the
    posture with joints to spare, and the errors are those of `circle`.
    """
    arguments.robot(robot)
    posture = _posture(robot, start)
    arguments.text("frame", frame, "the name of a frame")
    here = robot.frame_pose(frame, posture)[0]
    timing = (duration, speed, acceleration, jerk)
    path = line_path(frame, here, end, begin, timing, profile, orientation, samples, coordinates, name)
    return _along(robot, path, posture)


def line_path(
    frame: str,
    here: Array,
    end: Vector,
    begin: Vector | None,
    timing: Limits,
    profile: str,
    orientation: Orientation | None,
    samples: int,
    coordinates: Sequence[str],
    name: str,
) -> FramePath:
    """The path of `line`, from `here` (3,) m where `begin` is None; `timing` as in `circle_path`. Raises InputError."""
    title = f"motion '{arguments.text('name', name, empty=True)}'"
    last = arguments.vector("end", end, 3, "m", most=FARTHEST, where=title)
    first = here if begin is None else arguments.vector("begin", begin, 3, "m", most=FARTHEST, where=title)
    length = float(np.linalg.norm(last - first))
    if length < 1e-9:
        raise InputError(f"{title}: the line begins where it ends; use dwell to stand still")
    direction = (last - first) / length
    times = make_profile(profile, length, *timing)

    def curve(s: Array) -> tuple[Array, Array, Array]:
        return first + s[:, None] * direction, np.tile(direction, (len(s), 1)), np.zeros((len(s), 3))

    return FramePath(name, frame, curve, times, orientation, checked_samples(title, samples), _axes(title, coordinates))


def _along(robot: Robot, path: FramePath, start: Array) -> Motion:
    title, frame, curve, name = f"motion '{path.name}'", path.frame, path.curve, path.name
    time, s, speed, growth = path.timing.rows(path.samples)
    rotation = wanted_rotation(path, robot.frame_pose(frame, start)[1])
    task = frame_task(robot, frame, start, rotation, title, path.coordinates)
    check_plane(task, curve(s)[0], time, title)
    found = follow(task, curve, s, time, title)
    velocity, acceleration = np.zeros((len(s), robot.nv)), np.zeros((len(s), robot.nv))
    single: list[JointLike] = [joint for joint in robot.joints if joint.nq == 1]
    rows, columns = [joint.q for joint in single], [joint.v for joint in single]
    first, second = found.first[:, rows], found.second[:, rows]
    velocity[:, columns] = first * speed[:, None]
    acceleration[:, columns] = second * (speed * speed)[:, None] + first * growth[:, None]
    notes = limit_notes(robot, name, time, found.position)
    worst = int(np.argmin(found.condition))
    if found.condition[worst] < NEAR_SINGULAR:
        notes += (
            f"{title} passes near a singular posture at {time[worst]:.6g} s: the smallest singular value of "
            f"the Jacobian of frame '{frame}' is {found.condition[worst]:.2g} of the largest; small changes "
            "of the path change the speeds much",
        )
    return Motion(robot.joints, time, found.position, velocity, acceleration, name, notes)


def _posture(robot: Robot, start: Posture | None) -> Array:
    return np.array(robot.posture({} if start is None else start), dtype=np.float64)


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
