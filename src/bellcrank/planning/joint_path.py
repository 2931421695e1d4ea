"""Paths of joints: positions over a path parameter, without time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array, Indices
from bellcrank.errors import InputError
from bellcrank.motion.coordinates import continuous, from_rates
from bellcrank.motion.generators.blends import blended, straight
from bellcrank.motion.motion import AT_REST
from bellcrank.motion.sampled.quintic_splines import QuinticSpline
from bellcrank.robot.model.joints import JointLike, one_degree_columns, quaternion_part, require_one_degree

if TYPE_CHECKING:
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import Robot

Spline = Callable[[Array, int], Array]
POINTS = 401  # of a path that is taken from a motion, to begin with
MOST_POINTS = 6401
STILL = 1e-9  # of the largest rate of a joint: smaller ones are rounding, as of a joint that a linkage holds still
BISECTIONS = 60
THIRD = 1e-6  # of a path with blends: step of the differences that give its third derivative
DEVIATION = 1e-8  # rad or m: by which a path may differ from the motion that it is taken from


@dataclass(frozen=True, eq=False)
class JointPath:
    """Positions of a robot's joints over a path parameter s from 0 to `length`, twice continuously differentiable.

    Attributes:
        joints: The robot's joints.
        length: The end of the path parameter.
        spline: Called with s (n,) and the order 0 to 3: positions (n, nq), or velocities, accelerations or
            jerks (n, nv) of a motion along the path at ds/dt = 1. The jerk of a joint of several degrees of freedom is
            not defined: NaN.
        knots: Values of s at which the third derivative may jump, the ends included.
        deviation: By how much the path differs from the motion that it is taken from, rad or m.

    Example:
        >>> import bellcrank as bc
        >>> path = bc.joint_path(bc.load_robot("planar_2r"), [{}, {"elbow": 1.0}, {"shoulder": 0.5}])
        >>> path.length, path.at([0.0])[0]
        (2.118033988749895, array([[0., 0.]]))
    """

    joints: tuple[JointLike, ...]
    length: float
    spline: Spline = field(repr=False)
    knots: Array = field(repr=False)
    deviation: float = 0.0

    def at(self, s: Array | Sequence[float]) -> tuple[Array, Array, Array]:
        """Positions, and their first and second derivatives with respect to s.

        Args:
            s: Path parameters (n,), between 0 and the length.

        Returns:
            Positions, first and second derivatives, (n, nq) each, in rad or m.

        Raises:
            InputError: A parameter lies outside the path.

        Example:
            >>> import bellcrank as bc
            >>> path = bc.joint_path(bc.load_robot("planar_2r"), [{}, {"elbow": 1.0}])
            >>> path.at([0.5])[0].round(6)
            array([[0. , 0.5]])
        """
        places = arguments.vector("s", s, None)
        if places.size and (places.min() < 0.0 or places.max() > self.length):
            raise InputError(f"s must lie between 0 and {self.length:g}, got {places.min():g} to {places.max():g}")
        return self.spline(places, 0), self.spline(places, 1), self.spline(places, 2)

    def turning_points(self) -> Array:
        """Values of s strictly inside the path at which a joint changes its direction.

        Returns:
            Path parameters (n,), rising.

        Example:
            >>> import bellcrank as bc
            >>> path = bc.joint_path(bc.load_robot("planar_2r"), [{}, {"elbow": 1.0}, {}])
            >>> path.turning_points().round(6)
            array([1.])
        """
        s = np.linspace(0.0, self.length, 50 * max(20, len(self.knots)) + 1)
        rate = self.spline(s, 1)
        still = np.abs(rate) <= STILL * np.max(np.abs(rate), initial=0.0)
        turns = (rate[:-1] * rate[1:] < 0.0) & ~(still[:-1] & still[1:])
        interval, column = np.nonzero(turns)
        found = [self._roots(column, s[interval], s[interval + 1])]
        for k in range(rate.shape[1]):
            inside = np.flatnonzero(rate[1:-1, k] == 0.0) + 1
            found.append(s[inside[rate[inside - 1, k] * rate[inside + 1, k] < 0.0]])
        roots = np.unique(np.concatenate(found))
        return np.asarray(roots[(roots > 0.0) & (roots < self.length)])

    def _roots(self, column: Indices, low: Array, high: Array) -> Array:
        """The places (m,) between low and high at which joints change their directions, by bisection."""
        rows = np.arange(len(column))
        before = self.spline(low, 1)[rows, column]
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            here = self.spline(middle, 1)[rows, column] * before > 0.0
            low, high = np.where(here, middle, low), np.where(here, high, middle)
        return np.asarray(0.5 * (low + high))


@arguments.named
def joint_path(
    robot: Robot,
    positions: Sequence[Mapping[str, float] | Sequence[float] | Array] | Array,
    parameters: Sequence[float] | Array | None = None,
    blend: float = 0.0,
) -> JointPath:
    """A path through given postures: the natural cubic spline; or straight lines whose corners are cut by blends.

    Args:
        robot: The robot; each of its joints has one degree of freedom.
        positions: Two postures or more: joint positions by name (other joints are neutral), or (nq,), rad or m.
        parameters: Increasing values of the path parameter at the postures, the first 0; by default the sum of the
            straight distances between postures.
        blend: Distance before and behind each inner posture, in joint space (rad and m), between which the path leaves
            the straight lines and cuts the corner; it misses the posture by at most 5/16 of it. 0: the spline.

    Returns:
        The path.

    Raises:
        InputError: An argument is wrong, two postures that follow each other are the same, a joint has several
            degrees of freedom, or a blend takes more than half of the line between two postures.

    Example:
        >>> import bellcrank as bc
        >>> bc.joint_path(bc.load_robot("planar_2r"), [{}, {"elbow": 1.0}]).length
        1.0
    """
    from scipy.interpolate import CubicSpline

    arguments.robot(robot)
    joints = one_degree_joints(robot)
    given = list(positions) if isinstance(positions, np.ndarray) and positions.ndim else positions
    listed = arguments.several("positions", given, object, "two postures or more")
    if len(listed) < 2:
        arguments.refuse("positions", "two postures or more", given)
    points = np.stack([np.asarray(robot.posture(point), dtype=np.float64) for point in listed])  # type: ignore[arg-type]
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if np.any(steps == 0.0):
        k = int(np.argmin(steps))
        raise InputError(f"positions {k} and {k + 1} are the same; a path needs a distance between them")
    blend = arguments.number("blend", blend, "rad or m", least=0.0, most=1e9)
    if blend > 0.0:
        if parameters is not None:
            raise InputError("argument 'blend': it goes with straight lines, which take no 'parameters'")
        return _with_blends(joints, points, blend)
    if parameters is None:
        knots = np.concatenate([[0.0], np.cumsum(steps)])
    else:
        knots = arguments.increasing("parameters", parameters, count=2)
        if len(knots) != len(points) or knots[0] != 0.0:
            arguments.refuse("parameters", f"{len(points)} numbers that begin with 0", parameters)
    spline = CubicSpline(knots, points, bc_type="natural")
    return JointPath(joints, float(knots[-1]), lambda s, order: np.asarray(spline(s, order)), knots)


def _with_blends(joints: tuple[JointLike, ...], points: Array, blend: float) -> JointPath:
    lines = [straight(a, b) for a, b in pairwise(points)]
    path = blended(lines, [blend] * (len(lines) - 1), "path of joints", "rad or m", 2)
    step = THIRD * path.length

    def spline(s: Array, order: int) -> Array:
        s = np.asarray(s)
        if order < 3:
            return path(s)[order]
        low, high = np.clip(s - step, 0.0, path.length), np.clip(s + step, 0.0, path.length)
        return (path(high)[2] - path(low)[2]) / (high - low)[:, None]

    return JointPath(joints, path.length, spline, path.knots)


def one_degree_joints(robot: Robot) -> tuple[JointLike, ...]:
    """The robot's joints. Raises InputError where one has several degrees of freedom."""
    return tuple(require_one_degree(joint, "a path of joints") for joint in robot.joints)


def paths_of_motion(motion: Motion) -> tuple[JointPath, ...]:
    """The paths that a motion follows, from rest to rest: the motion without its timing and its pauses. It also rests
    for a moment where it turns around, and there a path ends.

    Positions are interpolated over the length of the curve in joint space by the quintic spline through so many points
    that the path differs from the motion by less than 1e-8 rad or m where that is possible. Rotations of joints of
    several degrees of freedom are interpolated by their coordinates, which are then normalised.

    Raises:
        InputError: The motion does not move.
    """
    time, speed = _speeds(motion)
    peak = float(speed.max())
    if peak == 0.0:
        raise InputError(f"motion '{motion.name}' does not move; there is no path to follow")
    moving = speed > AT_REST * peak
    edges = np.flatnonzero(np.diff(moving.astype(int)))
    bounds = [0, *(edges + 1).tolist(), len(time)]
    paths = []
    for begin, end in pairwise(bounds):
        if moving[begin]:
            first, last = max(0, begin - 1), min(len(time) - 1, end)
            turns = _turns(motion, time[first : last + 1], speed[first : last + 1], AT_REST * peak)
            edges_here = [float(time[first]), *turns, float(time[last])]
            paths += [_path_between(motion, a, b) for a, b in pairwise(edges_here)]
    return tuple(paths)


def _turns(motion: Motion, time: Array, speed: Array, rest: float) -> list[float]:
    """The times (n,) at which the motion rests for a moment: the zeros among the minima of its speed."""

    def at(t: float) -> float:
        return float(np.linalg.norm(motion.at(t)[1]))

    found = []
    low = np.flatnonzero((speed[1:-1] <= speed[:-2]) & (speed[1:-1] <= speed[2:])) + 1
    for k in low.tolist():
        span = float(time[k + 1] - time[k - 1])
        if speed[k] > 0.9 * max(speed[k - 1], speed[k + 1]):
            continue  # a motion that turns around has the speed |a (t - t0)|, which falls faster
        from scipy.optimize import minimize_scalar  # seldom needed, and imported in a third of a second

        best = minimize_scalar(at, bounds=(time[k - 1], time[k + 1]), method="bounded", options={"xatol": 1e-12 * span})
        if best.fun <= rest and time[k - 1] < best.x < time[k + 1]:
            found.append(float(best.x))
    return found


def _speeds(motion: Motion) -> tuple[Array, Array]:
    """Times between and at the rows, and the length of the velocity there."""
    step = np.diff(motion.time)
    parts = [motion.time[:-1] + share * step for share in (0.0, 0.25, 0.5, 0.75)]
    time = np.unique(np.concatenate([*parts, motion.time[-1:]]))
    return time, np.linalg.norm(motion.at(time)[1], axis=1)


def _path_between(motion: Motion, begin: float, end: float) -> JointPath:
    count = POINTS
    while True:
        path = _interpolated(motion, begin, end, count)
        if path.deviation <= DEVIATION or count >= MOST_POINTS:
            return path
        count = 2 * count - 1


def _rising(x: Array, y: Array) -> Callable[[Array], Array]:
    """The cubic interpolant of rising values (n,) that rises between them too.

    As SciPy's PchipInterpolator, which needs 0.3 s to import: F. N. Fritsch, J. Butland, A method for constructing
    local monotone piecewise cubic interpolants, SIAM J. Sci. Stat. Comput. 5 (1984) 300, weighted by the widths.
    """
    h = np.diff(x)
    secant = np.diff(y) / h
    slope = np.full(len(x), secant[0])
    if len(x) > 2:
        w, v = 2.0 * h[1:] + h[:-1], h[1:] + 2.0 * h[:-1]
        slope[1:-1] = (w + v) / (w / secant[:-1] + v / secant[1:])
        for end, (a, b), (left, right) in ((0, h[:2], secant[:2]), (-1, h[:-3:-1], secant[:-3:-1])):
            slope[end] = max(((2.0 * a + b) * left - a * right) / (a + b), 0.0)

    def at(places: Array) -> Array:
        k = np.clip(np.searchsorted(x, places, side="right") - 1, 0, len(h) - 1)
        t = places - x[k]
        second = (3.0 * secant[k] - 2.0 * slope[k] - slope[k + 1]) / h[k]
        third = (slope[k] + slope[k + 1] - 2.0 * secant[k]) / h[k] ** 2
        return np.asarray(y[k] + t * (slope[k] + t * (second + t * third)))

    return at


def _interpolated(motion: Motion, begin: float, end: float, count: int) -> JointPath:
    fine = np.linspace(begin, end, 8 * count + 1)
    speed = np.linalg.norm(motion.at(fine)[1], axis=1)
    travelled = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2.0 * np.diff(fine))])
    rising = np.concatenate([[True], np.diff(travelled) > 0.0])
    when = _rising(travelled[rising], fine[rising])
    share = (1.0 - np.cos(np.linspace(0.0, np.pi, count))) / 2.0  # dense at the ends, where the path may bend most
    places = travelled[-1] * (0.2 * share + 0.8 * np.linspace(0.0, 1.0, count))
    times = np.clip(when(places), begin, end)
    times[0], times[-1] = begin, end
    through = motion.at(times)[0]
    through *= continuous(motion.joints, through)
    spline = QuinticSpline.through(places, through, rest=False)

    positions, rates = one_degree_columns(motion.joints)

    def at(s: Array, order: int) -> Array:
        if all(joint.nq == 1 for joint in motion.joints):
            return spline(s, order)
        if order > 2:
            third = np.full((len(s), sum(joint.nv for joint in motion.joints)), np.nan)
            third[:, rates] = spline(s, order)[:, positions]
            return third
        return from_rates(motion.joints, *(spline(s, k) for k in (0, 1, 2)))[order]

    between = (places[1:] + places[:-1]) / 2.0
    exact, found = motion.at(np.clip(when(between), begin, end))[0], at(between, 0)
    for joint in motion.joints:
        if (part := quaternion_part(joint)) is not None:  # q and -q are one rotation
            exact[:, part] *= np.where(np.sum(exact[:, part] * found[:, part], axis=1) < 0.0, -1.0, 1.0)[:, None]
    deviation = float(np.max(np.abs(found - exact)))
    return JointPath(tuple(motion.joints), float(places[-1]), at, np.array([0.0, places[-1]]), deviation)
