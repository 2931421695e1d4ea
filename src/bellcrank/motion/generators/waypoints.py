"""Motions through given postures by a quintic spline, whose fourth derivative is continuous; and rest at a posture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.motion.coordinates import continuous, from_rates
from bellcrank.motion.generators.closed_form import ClosedForm, Rest, Side, States
from bellcrank.motion.limit_checks import LONGEST, check_size, check_times, limit_notes
from bellcrank.motion.motion import Motion
from bellcrank.motion.sampled.quintic_splines import FEWEST, QuinticSpline, too_close
from bellcrank.robot.model.joints import JointLike

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot


@arguments.named
def waypoints(
    robot: Robot,
    times: Sequence[float] | Array,
    positions: Sequence[Mapping[str, float] | Sequence[float] | Array] | Array,
    samples: int = 1001,
    name: str = "waypoints",
) -> Motion:
    """Move through given postures, from rest to rest.

    The interpolation is the quintic spline with simple knots at the waypoints: four times continuously differentiable,
    each polynomial of degree 5 (C. de Boor, A Practical Guide to Splines). Velocity and acceleration are 0 at both
    ends.

    Args:
        robot: The robot.
        times: Increasing times (k,), s, k >= 2.
        positions: One posture a time: (nq,) in rad or m, or joint positions by name (other joints are neutral).
        samples: Least number of rows; every waypoint is a row.
        name: Name of the motion.

    Returns:
        The motion.

    Raises:
        InputError: An argument is wrong, or times lie too close together.

    Example:
        >>> import bellcrank as bc
        >>> motion = bc.waypoints(bc.load_robot("planar_2r"), [0.0, 1.0, 3.0], [{}, {"elbow": 1.0}, {}], samples=101)
        >>> motion.at(1.0)[0]
        array([0., 1.])
    """
    title = f"motion '{arguments.text('name', name, empty=True)}'"
    arguments.robot(robot)
    knots = checked_times(title, times, "waypoint")
    if isinstance(positions, np.ndarray) and positions.ndim:
        positions = list(positions)
    if not isinstance(positions, Sequence) or isinstance(positions, (str, bytes)):
        arguments.refuse("positions", "a list of postures, one a time", positions, title)
    if len(positions) != len(knots):
        raise InputError(f"{title}: {len(knots)} times but {len(positions)} positions; expected one position a time")
    if any(point is None for point in positions):
        arguments.refuse("positions", "a list of postures, one a time", None, title)
    points = np.stack([np.asarray(robot.posture(point), dtype=np.float64) for point in positions])
    check_size(title, "position", points)
    time = spread(knots, checked_samples(title, samples))
    try:
        curve = _SplineCurve(tuple(robot.joints), knots, points, rest=True)
    except InputError as error:
        raise InputError(f"{title}: {error}") from None
    form = ClosedForm(float(knots[0]), float(knots[-1]), curve)
    notes = limit_notes(robot, name, time, (states := curve.rows(time))[0])
    return Motion(robot.joints, time, *states, name, notes, forms=(form,))


@arguments.named
def dwell(
    robot: Robot,
    position: Mapping[str, float] | Array | Sequence[float],
    duration: float,
    name: str = "dwell",
) -> Motion:
    """Rest at a posture.

    Args:
        robot: The robot.
        position: Joint positions by name, or (nq,), rad or m.
        duration: Time at rest, s.
        name: Name of the motion.

    Returns:
        The motion, of two rows.

    Raises:
        InputError: An argument is wrong.

    Example:
        >>> import bellcrank as bc
        >>> bc.dwell(bc.load_robot("planar_2r"), {"elbow": 1.0}, 2.0).duration
        2.0
    """
    title = f"motion '{arguments.text('name', name, empty=True)}'"
    duration = arguments.number("duration", duration, "s", above=0.0, most=LONGEST, where=title)
    arguments.robot(robot)
    if position is None:
        arguments.refuse("position", "a posture: a mapping of joints to numbers, or a list of them", position, title)
    q = np.asarray(robot.posture(position), dtype=np.float64)
    rest = np.zeros((2, robot.nv))
    time = np.array([0.0, duration])
    form, notes = ClosedForm(0.0, duration, Rest(q, duration, robot.nv)), limit_notes(robot, name, time, q[None])
    return Motion(robot.joints, time, np.stack([q, q]), rest, rest, name, notes, forms=(form,))


def interpolate(
    joints: Sequence[JointLike], knots: Array, points: Array, times: Array, rest: bool
) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration at `times` of the quintic spline through `points` (k, nq) at
    `knots` (k,).

    With `rest` velocity and acceleration are zero at both ends; without, the ends are not-a-knot (nothing is
    assumed), and fewer than six points take the polynomial through all of them. Rotation numbers are
    normalised.
    """
    return _SplineCurve(tuple(joints), knots, points, rest).rows(times)


class _SplineCurve:
    """The curve of `interpolate`; its time begins with 0 s at the first knot."""

    def __init__(self, joints: tuple[JointLike, ...], knots: Array, points: Array, rest: bool) -> None:
        self.joints, self.knots, self.points, self.rest = joints, knots, points, rest
        self.spline = _spline(knots, points * continuous(joints, points), rest)

    @property
    def duration(self) -> float:
        """The time from the first knot to the last, s."""
        return float(self.knots[-1] - self.knots[0])

    def at(self, time: Array, side: Side) -> States:
        """The states at times (m,), s, after the first knot; they have no jumps."""
        return self.rows(self.knots[0] + time)

    def rows(self, times: Array) -> States:
        """The states at times (m,), s; at the knots the positions are the points."""
        q, v, a = from_rates(self.joints, *(self.spline(times, order) for order in (0, 1, 2)))
        place = np.searchsorted(self.knots, times)
        hit = self.knots[np.minimum(place, len(self.knots) - 1)] == times
        q[hit] = self.points[place[hit]]
        if self.rest:
            for row in (times == self.knots[0], times == self.knots[-1]):
                v[row] = a[row] = 0.0
        return q, v, a


def derivative(knots: Array, values: Array) -> Array:
    """Derivative (k, m) at the knots of the quintic not-a-knot spline through `values` (k, m)."""
    return _spline(knots, values, rest=False)(knots, 1)


def second_derivatives(knots: Array, values: Array) -> tuple[Array, Array]:
    """First and second derivative (k,) at the knots of the quintic not-a-knot spline through `values` (k,)."""
    spline = _spline(knots, values[:, None], rest=False)
    return spline(knots, 1)[:, 0], spline(knots, 2)[:, 0]


def _spline(knots: Array, values: Array, rest: bool) -> QuinticSpline | _Through:
    if rest or len(knots) >= FEWEST:
        return QuinticSpline.through(knots, values, rest)
    try:
        return _Through(knots, values)
    except np.linalg.LinAlgError:
        raise too_close(knots) from None


class _Through:
    """The polynomial through all of a few points, differentiable any number of times."""

    def __init__(self, knots: Array, values: Array) -> None:
        self.origin, self.scale = knots[0], knots[-1] - knots[0]
        u = (knots - self.origin) / self.scale
        self.coefficients = np.linalg.solve(np.vander(u, increasing=True), values)

    def __call__(self, times: Array, order: int = 0) -> Array:
        u = (times - self.origin) / self.scale
        c = np.polynomial.polynomial.polyder(self.coefficients, order) / self.scale**order
        return np.asarray(np.polynomial.polynomial.polyval(u, c).T, dtype=np.float64)


def spread(knots: Array, samples: int) -> Array:
    """At least `samples` times, evenly spaced between each two knots and including every knot."""
    parts = []
    for begin, end in pairwise(knots.tolist()):
        steps = max(1, int(np.ceil((samples - 1) * (end - begin) / (knots[-1] - knots[0]) - 1e-9)))
        parts.append(begin + (end - begin) * (np.arange(steps) / steps))
    return np.concatenate([*parts, knots[-1:]])


def checked_times(title: str, times: Any, what: str) -> Array:
    """Times as an increasing, finite (k,) array, k >= 2; InputError otherwise."""
    knots = arguments.as_array("times", times, "increasing numbers (s)", title)
    if knots.ndim != 1 or len(knots) < 2:
        raise InputError(f"{title}: at least 2 times are needed, got shape {knots.shape}")
    if not np.all(np.isfinite(knots)):
        raise InputError(f"{title}: time {int(np.argmin(np.isfinite(knots)))} is not finite")
    check_times(title, knots)
    if np.any(np.diff(knots) <= 0.0):
        k = int(np.argmax(np.diff(knots) <= 0.0))
        raise InputError(
            f"{title}: time must increase from {what} to {what}, but {knots[k + 1]:g} s follows {knots[k]:g} s"
        )
    return knots


def checked_samples(title: str, samples: Any) -> int:
    """A number of samples of at least 2; InputError otherwise."""
    return arguments.whole("samples", samples, least=2, most=10_000_000, where=title)
