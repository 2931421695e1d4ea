"""Motions that draw a frame along a path of straight lines and arcs, in the time that limits of the frame allow.

At a point with a blend the frame passes the corner without a stop (`blends.py`), elsewhere it stops. On a straight line
speed y, acceleration u and jerk w along the path are those of the frame. On an arc of radius R its acceleration is
√(u² + y⁴/R²) and its jerk at most |w| + y³/R² + 3 y |u|/R. There y⁴/R² and u² get a half of the square of the limit
each, and the three terms of the jerk a third each. In a blend the path speed is constant and the frame's acceleration
and jerk are |x''| y² and |x'''| y³.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.motion.generators.blends import MOST_BENT, STEEPEST, Section, Segment, blended, straight, timing
from bellcrank.motion.generators.path import AXES, FARTHEST, FramePath, Orientation, PathOptions, Posture, Vector
from bellcrank.motion.kinematics.path_inverse_kinematics import follow_paths, start_posture
from bellcrank.motion.motion import Motion

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot

PROFILES = ("trapezoid", "s_curve")
SAME = 1e-9  # m: points closer than this are the same
FLAT = 1e-9  # sine of the angle below which three points lie on a line


@dataclass(frozen=True)
class PathPoint:
    """A point (3,) m that a path leads to: straight, or on the arc through `via`; `blend` None: that of the path."""

    to: Vector
    via: Vector | None = None
    blend: float | None = None


@dataclass(frozen=True)
class Polyline:
    """Lines and arcs to points, from `begin` (3,) m or, where that is None, from the frame; `blend` in m."""

    points: tuple[PathPoint, ...]
    begin: Vector | None = None
    blend: float = 0.0

    def paths(self, options: PathOptions, here: Array) -> tuple[FramePath, ...]:
        """The paths from stop to stop, for a frame that is `here` (3,) m at the start. Raises InputError."""
        title = options.title
        if options.profile not in PROFILES:
            arguments.one_of("profile", options.profile, PROFILES, where=title)
        limits = _limits(options, title)
        segments, curvatures = self._segments(here, title)
        blends = [self._blend(k, title) for k in range(len(segments) - 1)]
        found, first = [], 0
        for last in [k for k, blend in enumerate(blends) if blend == 0.0] + [len(segments) - 1]:
            own = slice(first, last + 1)
            path = blended(segments[own], blends[first:last], title, "m", first + 1)
            profile = timing(options.profile, _sections(path.segments, path.blends, curvatures[own], limits), title)
            alone = replace(options, duration=None, profile="constant", speed=1.0, acceleration=None, jerk=None)
            found.append(replace(alone.path(path, path.length), timing=profile, knots=path.knots))
            first = last + 1
        return tuple(found)

    def _blend(self, k: int, title: str) -> float:
        own = self.points[k].blend
        return arguments.number("blend", self.blend if own is None else own, "m", least=0.0, most=FARTHEST, where=title)

    def _segments(self, here: Array, title: str) -> tuple[list[Segment], list[float]]:
        """The segments and their curvatures, 1/m."""
        begin = here
        if self.begin is not None:
            begin = arguments.vector("begin", self.begin, 3, "m", most=FARTHEST, where=title)
        segments, curvatures = [], []
        for number, point in enumerate(self.points, start=1):
            place = f"{title}: point {number}"
            end = arguments.vector("points", point.to, 3, "m", most=FARTHEST, where=place)
            if np.linalg.norm(end - begin) < SAME:
                raise InputError(f"{place} is where the path is already; leave it out, or use a dwell for a pause")
            if point.via is None:
                segments.append(straight(begin, end))
                curvatures.append(0.0)
            else:
                via = arguments.vector("via", point.via, 3, "m", most=FARTHEST, where=place)
                segment, radius = arc(begin, via, end, place)
                segments.append(segment)
                curvatures.append(1.0 / radius)
            begin = end
        return segments, curvatures


@arguments.named
def tool_path(
    robot: Robot,
    frame: str,
    points: Sequence[Any],
    *,
    acceleration: float,
    speed: float | None = None,
    jerk: float | None = None,
    blend: float = 0.0,
    profile: str = "s_curve",
    start: Posture | None = None,
    begin: Vector | None = None,
    orientation: Orientation | None = None,
    coordinates: Sequence[str] = AXES,
    samples: int = 1001,
    name: str = "tool_path",
) -> Motion:
    """Move a frame along straight lines and arcs, past corners with blends, in the time that limits of the frame allow.

    Args:
        robot: The robot.
        frame: Name of the frame that moves.
        points: Points (3,) in the world, m, to which straight lines lead; or mappings with "to", and "via" for the arc
            through that point, and "blend" for a blend at this point.
        acceleration: Largest acceleration of the frame's origin, m/s².
        speed: Largest speed of the frame's origin, m/s.
        jerk: Largest jerk of the frame's origin, m/s³, for the profile "s_curve".
        blend: Distance before and behind each inner point, along the path, between which the frame cuts the corner
            without a stop, at a constant path speed; it passes the point at a distance of at most 5/16 of it. 0: it
            stops there.
        profile: "trapezoid" (constant acceleration) or "s_curve" (limited jerk).
        start: Start posture, as in `circle`.
        begin: Begin (3,) of the path in the world, m; left out, the frame's position in the start posture.
        orientation: Orientation of the frame, as in `circle`.
        coordinates: Coordinates of the frame's position (world) that the path prescribes; the others are free.
        samples: Least number of rows between stops.
        name: Name of the motion.

    Returns:
        The motion; its velocities and accelerations are exact derivatives along the path.

    Raises:
        InputError: An argument is wrong, two points that follow each other are the same, three points of an arc lie on
            a line, or a blend takes more than half of a line or arc.
        UnreachableError: The path leaves the robot's reach or meets a singular posture.

    Example:
        >>> import bellcrank as bc
        >>> arm = bc.load_robot("planar_2r")
        >>> corner = [(1.2, 0.8, 0.0), (0.8, 0.8, 0.0)]
        >>> motion = bc.tool_path(arm, "tip", corner, begin=(1.2, 0.4, 0.0), start={"elbow": 1.0}, blend=0.1,
        ...                       speed=0.5, acceleration=4.0, jerk=60.0)
        >>> arm.frame_pose("tip", motion.position[-1])[0].round(9)
        array([0.8, 0.8, 0. ])
    """
    arguments.robot(robot)
    options = PathOptions(
        name=name,
        frame=frame,
        profile=arguments.text("profile", profile, "the name of a profile"),
        speed=speed,
        acceleration=acceleration,
        jerk=jerk,
        orientation=orientation,
        samples=samples,
        coordinates=coordinates,
    )
    line = Polyline(_points(points, options.title), begin, blend)
    posture = start_posture(robot, start)
    here = robot.frame_pose(arguments.text("frame", frame, "the name of a frame", where=options.title), posture)[0]
    return follow_paths(robot, line.paths(options, here), posture)


def arc(begin: Array, via: Array, end: Array, place: str) -> tuple[Segment, float]:
    """The arc from a point through another one to a third (3,) m, and its radius, m. Raises InputError."""
    u, w = via - begin, end - begin
    cross = np.cross(u, w)
    square = float(cross @ cross)
    if np.sqrt(square) <= FLAT * np.linalg.norm(u) * np.linalg.norm(w) or np.linalg.norm(end - via) < SAME:
        raise InputError(f"{place}: the three points of the arc lie on a line; leave 'via' out for a straight line")
    center = begin + (np.cross(cross, u) * (w @ w) + np.cross(w, cross) * (u @ u)) / (2.0 * square)
    radius = float(np.linalg.norm(begin - center))
    if radius > FARTHEST:
        raise InputError(f"{place}: the arc has a radius of {radius:.3g} m; leave 'via' out for a straight line")
    e1 = (begin - center) / radius
    e2 = np.cross(cross / np.sqrt(square), e1)  # the way on which `via` comes before `end`
    angle = float(np.arctan2((end - center) @ e2, (end - center) @ e1)) % (2.0 * np.pi)

    def curve(s: Array) -> tuple[Array, Array, Array]:
        cos, sin = np.cos(s / radius)[:, None], np.sin(s / radius)[:, None]
        outward = cos * e1 + sin * e2
        return center + radius * outward, cos * e2 - sin * e1, -outward / radius

    return Segment(begin, end, radius * angle, curve), radius


def _points(points: object, title: str) -> tuple[PathPoint, ...]:
    expected = "a list of points: 3 numbers (m), or mappings with to, via, blend"
    given = list(points) if isinstance(points, np.ndarray) and points.ndim == 2 else points
    found = []
    for number, point in enumerate(arguments.several("points", given, object, "points", where=title), start=1):
        if not isinstance(point, Mapping):
            found.append(PathPoint(point))  # type: ignore[arg-type]
            continue
        for key in point:
            if key not in ("to", "via", "blend"):
                raise InputError(f"{title}: point {number}: {unknown_name('key', str(key), ('to', 'via', 'blend'))}")
        if "to" not in point:
            arguments.refuse("points", expected, point, title)
        found.append(PathPoint(**point))
    if not found:
        arguments.refuse("points", expected, points, title)
    return tuple(found)


def _limits(options: PathOptions, title: str) -> Section:
    """Speed, acceleration and jerk of the frame."""
    given = {"speed": options.speed, "acceleration": options.acceleration, "jerk": options.jerk}
    units = {"speed": "m/s", "acceleration": "m/s²", "jerk": "m/s³"}
    if options.profile == "trapezoid" and options.jerk is not None:
        raise InputError(f"{title}: profile 'trapezoid' cannot keep a limit of jerk: choose s_curve, or leave it out")
    for key in ("acceleration", "jerk") if options.profile == "s_curve" else ("acceleration",):
        if given[key] is None:
            raise InputError(
                f"{title}: profile '{options.profile}' needs a limit of {key}: give '{key}' ({units[key]})"
            )
    numbers = {
        key: arguments.number(key, value, units[key], above=0.0, most=1e30, where=title)
        for key, value in given.items()
        if value is not None
    }
    return Section(length=0.0, **numbers)  # type: ignore[arg-type]


def _sections(
    segments: Sequence[Segment], blends: Sequence[float], curvatures: Sequence[float], limits: Section
) -> list[Section]:
    v, a, j = limits.speed, limits.acceleration, limits.jerk
    r = [0.0, *blends, 0.0]
    sections = []
    for k, (segment, bend) in enumerate(zip(segments, curvatures, strict=True)):
        own = replace(limits, length=segment.length - r[k] - r[k + 1])
        if bend > 0.0:
            y = min(v, np.sqrt(a / bend / np.sqrt(2.0)), np.cbrt(j / 3.0 / bend**2))
            growth = min(a / np.sqrt(2.0), j / (9.0 * y * bend))
            own = replace(own, speed=float(y), acceleration=float(growth), jerk=j / 3.0)
        sections.append(own)
        if k + 1 < len(segments):
            before, after, width = segments[k], segments[k + 1], 2.0 * r[k + 1]
            ends = before.curve(np.array([before.length]))[1][0], after.curve(np.zeros(1))[1][0]
            both = bend + curvatures[k + 1]
            turn = min(2.0, float(np.linalg.norm(ends[1] - ends[0])) + r[k + 1] * both)
            largest = max(bend, curvatures[k + 1])
            second = largest + turn * STEEPEST / width
            third = largest**2 + 3.0 * both * STEEPEST / width + turn * MOST_BENT / width**2
            y = v if second == 0.0 else min(v, np.sqrt(a / second), np.cbrt(j / third))
            sections.append(Section(length=width, speed=float(y), even=True))
    return sections
