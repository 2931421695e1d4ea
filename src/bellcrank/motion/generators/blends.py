"""Paths of segments whose corners are rounded by blends with a continuous third derivative, and their timing.

A blend begins at a distance r before the corner P and ends at the distance r behind it. Over its length 2 r the first
segment A slows down to rest at the corner while the second one B sets off from it, and the path is their sum:

    x(s) = A(a(s)) + B(b(s)) − P,    a' = 1 − h(σ),  b' = h(σ),  h = 10 σ³ − 15 σ⁴ + 6 σ⁵,  σ = (s − s_P + r) / (2 r).

h, h' and h'' vanish at the beginning, and 1 − h, h' and h'' at the end, so that the path continues both segments with
their derivatives up to the third. |x'| is at most 1 where the segments are parameterised by their length. At σ = 1/2
the path is within 5/16 r of the corner; between straight segments of directions e and f it is 5/32 r |f − e| away.
(Sums of the motions along two segments are the usual way to pass a corner: L. Biagiotti, C. Melchiorri, Trajectory
Planning for Automatic Machines and Robots, 8.11; the polynomial is ours.)

Each section has its own limits of speed, acceleration and jerk along the path. The speeds at the borders are the
largest from which the speeds at the neighbouring borders are reached (passes forward and backward). Within a section
the speed rises to a peak and falls, with constant acceleration or in seven pieces of constant jerk, as between speeds
that are not 0 in L. Biagiotti, C. Melchiorri, Trajectory Planning for Automatic Machines and Robots, 3.2.3 and 3.4.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf, isfinite, sqrt

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.motion.generators.profile import Profile
from bellcrank.motion.limit_checks import LONGEST

SHORTEST = 1e-9  # of a segment: the third derivative of a shorter blend overflows
HALF = 0.5 * (1.0 + 1e-9)  # of a segment: a longer blend would meet the next one
STEEPEST, MOST_BENT = 15.0 / 8.0, 10.0 / sqrt(3.0)  # largest h' and |h''|
Pieces = list[tuple[float, float, float]]  # duration, acceleration at the beginning, jerk
SHORT = 1e-12  # of the whole time: shorter pieces are left out


@dataclass(frozen=True, eq=False)
class Segment:
    """A segment from `begin` to `end` (m,) of a length; `curve` takes lengths (n,) and gives positions (n, m) and their
    first and second derivatives with respect to the length.
    """

    begin: Array
    end: Array
    length: float
    curve: Callable[[Array], tuple[Array, Array, Array]]


@dataclass(frozen=True, eq=False)
class BlendedPath:
    """Segments one after the other, with a blend around each corner between two of them.

    `blends` are the distances r from the corners at which the blends begin and end.
    """

    segments: tuple[Segment, ...]
    blends: tuple[float, ...]

    @property
    def corners(self) -> Array:
        """The path parameters of begin, corners and end."""
        return np.concatenate([[0.0], np.cumsum([segment.length for segment in self.segments])])

    @property
    def length(self) -> float:
        """The end of the path parameter."""
        return float(self.corners[-1])

    @property
    def knots(self) -> Array:
        """Path parameters of begin and end of the path and of all blends: the fourth derivative jumps there."""
        corners, r = self.corners[1:-1], np.array(self.blends)
        return np.unique(np.concatenate([[0.0], corners - r, corners + r, [self.length]]))

    def __call__(self, s: Array) -> tuple[Array, Array, Array]:
        """Positions (n, m) at path parameters (n,), and their first and second derivatives."""
        parts = [np.empty((len(s), len(self.segments[0].begin))) for _ in range(3)]
        corners, r = self.corners, np.array(self.blends)
        piece = np.searchsorted(np.column_stack([corners[1:-1] - r, corners[1:-1] + r]).ravel(), s, side="right")
        for k in np.unique(piece).tolist():  # segments and blends by turns
            inside, number = piece == k, k // 2
            if k % 2 == 0:
                values = self.segments[number].curve(s[inside] - corners[number])
            else:
                before, after = self.segments[number : number + 2]
                values = _blend(before, after, self.blends[number], s[inside] - corners[number + 1])
            for part, value in zip(parts, values, strict=True):
                part[inside] = value
        return parts[0], parts[1], parts[2]

    def derivative(self, s: Array, order: int) -> Array:
        """Positions or derivatives (n, m) of an order up to 3, of a path whose segments are straight."""
        if order < 3:
            return self(s)[order]
        third = np.zeros((len(s), len(self.segments[0].begin)))
        for before, after, r, corner in zip(
            self.segments, self.segments[1:], self.blends, self.corners[1:-1].tolist(), strict=False
        ):
            x = (s - corner + r) / (2.0 * r)
            bend = np.where((x > 0.0) & (x < 1.0), 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x), 0.0) / (2.0 * r) ** 2
            turn = (after.end - after.begin) / after.length - (before.end - before.begin) / before.length
            third += bend[:, None] * turn
        return third


def blended(segments: Sequence[Segment], blends: Sequence[float], title: str, unit: str, first: int = 1) -> BlendedPath:
    """The path of segments with a blend at each corner between them. Raises InputError where a blend takes more than
    half of a segment; `title` is what the message begins with, `unit` the lengths' unit, `first` the number of the
    first corner.
    """
    for k, radius in enumerate(blends):
        for segment, side in ((segments[k], "before"), (segments[k + 1], "behind")):
            if radius > HALF * segment.length:
                most = 0.5 * segment.length
                raise InputError(
                    f"{title}: the blend of {radius:g} {unit} at point {k + first} is longer than half of the segment "
                    f"{side} it, which is {segment.length:.6g} {unit} long; choose at most {most:.6g} {unit} there"
                )
            if 0.0 < radius < SHORTEST * segment.length:
                least = SHORTEST * segment.length
                raise InputError(
                    f"{title}: the blend of {radius:g} {unit} at point {k + first} is shorter than {SHORTEST:g} of the "
                    f"segment {side} it; choose 0, which stops there, or at least {least:.3g} {unit}"
                )
    return BlendedPath(tuple(segments), tuple(float(radius) for radius in blends))


def straight(begin: Array, end: Array) -> Segment:
    """The straight segment between two different points (m,)."""
    length = float(np.linalg.norm(end - begin))
    return Segment(begin, end, length, _Straight(begin, (end - begin) / length))


@dataclass(frozen=True, eq=False)
class _Straight:
    """The curve of a straight segment from `begin` (m,) in a direction (m,)."""

    begin: Array
    direction: Array

    def __call__(self, s: Array) -> tuple[Array, Array, Array]:
        along = np.tile(self.direction, (len(s), 1))
        return self.begin + s[:, None] * self.direction, along, np.zeros_like(along)


def _blend(first: Segment, second: Segment, radius: float, s: Array) -> tuple[Array, Array, Array]:
    """The blend at path parameters s (n,) from the corner, within ± radius."""
    x = (s + radius) / (2.0 * radius)
    h = x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
    slope = 30.0 * (x * (1.0 - x)) ** 2 / (2.0 * radius)
    gone = 2.0 * radius * x**4 * (2.5 - 3.0 * x + x * x)  # ∫ h ds
    a, a1, a2 = first.curve(first.length + s - gone)
    b, b1, b2 = second.curve(gone)
    h, slope = h[:, None], slope[:, None]
    return (
        a + b - second.begin,
        a1 * (1.0 - h) + b1 * h,
        a2 * (1.0 - h) ** 2 + b2 * h * h + (b1 - a1) * slope,
    )


@dataclass(frozen=True, kw_only=True)
class Section:
    """A section of a path, and the largest speed, acceleration and jerk along it; `even`: the speed does not change."""

    length: float
    speed: float = inf
    acceleration: float = inf
    jerk: float = inf
    even: bool = False


def timing(kind: str, sections: Sequence[Section], title: str = "path") -> Profile:
    """The profile over sections, from rest to rest. Each section that is not even has a limit of acceleration, and of
    jerk for the kind "s_curve". Raises InputError where limits are so small that nothing moves; `title` begins it.
    """
    used = [section for section in sections if section.length > 0.0]
    speeds = _border_speeds(used)
    pieces: Pieces = []
    for section, (begin, end) in zip(used, pairwise(speeds), strict=True):
        peak = begin if section.even else _peak(begin, end, section)
        if not section.length / LONGEST < peak:
            raise InputError(
                f"{title}: the limits of speed, acceleration and jerk are so small that the motion takes more than "
                f"{LONGEST:g} s; give larger ones"
            )
        if section.even:
            pieces.append((section.length / begin, 0.0, 0.0))
            continue
        rest = section.length - _way(begin, peak, section) - _way(peak, end, section)
        pieces += [*_change(begin, peak, section), (max(0.0, rest) / peak, 0.0, 0.0), *_change(peak, end, section)]
    return _profile(kind, pieces, sum(section.length for section in used))


def _peak(begin: float, end: float, section: Section) -> float:
    """The largest speed in a section between speeds at its ends."""

    def way(speed: float) -> float:
        return _way(begin, speed, section) + _way(speed, end, section)

    return _largest(way, section.length, max(begin, end), section.speed)


def _border_speeds(sections: Sequence[Section]) -> list[float]:
    caps = [min(a.speed, b.speed) for a, b in pairwise(sections)]
    speeds = [0.0, *caps, 0.0]
    for k, section in enumerate(sections):
        speeds[k + 1] = min(speeds[k + 1], _reached(speeds[k], section))
    for k in range(len(sections) - 1, -1, -1):
        speeds[k] = min(speeds[k], _reached(speeds[k + 1], sections[k]))
    return speeds


def _reached(speed: float, section: Section) -> float:
    """The largest speed at one end of a section with a speed at its other end."""
    if section.even:
        return speed
    return _largest(lambda v: _way(speed, v, section), section.length, speed, section.speed)


def _largest(way: Callable[[float], float], length: float, low: float, high: float) -> float:
    """The largest speed from `low` to `high` whose way, which increases with it, is within a length."""
    if isfinite(high) and way(high) <= length:
        return max(low, high)
    if not isfinite(high):
        high = max(low, 1e-3 * length)
        while way(high) <= length:
            high *= 2.0
    for _ in range(200):
        middle = (low + high) / 2.0
        if middle in (low, high):
            break
        low, high = (middle, high) if way(middle) <= length else (low, middle)
    return low


def _ramp(change: float, section: Section) -> tuple[float, float]:
    """The times of a ramp of acceleration and of constant acceleration, for a change of speed."""
    if not isfinite(section.jerk):
        return 0.0, change / section.acceleration
    ramp = min(section.acceleration / section.jerk, sqrt(change / section.jerk))
    return ramp, max(0.0, change / (section.jerk * ramp) - ramp) if ramp > 0.0 else 0.0


def _way(begin: float, end: float, section: Section) -> float:
    ramp, flat = _ramp(abs(end - begin), section)
    return (begin + end) / 2.0 * (2.0 * ramp + flat)


def _change(begin: float, end: float, section: Section) -> Pieces:
    change = end - begin
    ramp, flat = _ramp(abs(change), section)
    if 2.0 * ramp + flat <= 0.0:
        return []
    top = change / (ramp + flat)
    jerk = top / ramp if ramp > 0.0 else 0.0
    first = 0.0 if ramp > 0.0 else top
    return [(ramp, first, jerk), (flat, top, 0.0), (ramp, top, -jerk)]


def _profile(kind: str, pieces: Pieces, distance: float) -> Profile:
    whole = sum(piece[0] for piece in pieces)
    breaks, rows, s, v = [0.0], [], 0.0, 0.0
    for span, acceleration, jerk in pieces:
        if span <= SHORT * whole:
            continue
        rows.append([s, v, acceleration / 2.0, jerk / 6.0, 0.0, 0.0])
        s += span * (v + span * (acceleration / 2.0 + span * jerk / 6.0))
        v = max(0.0, v + span * (acceleration + span * jerk / 2.0))
        breaks.append(breaks[-1] + span)
    return Profile(kind, distance, np.array(breaks), np.array(rows))
