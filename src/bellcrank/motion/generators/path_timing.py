"""Timing of a path of sections: the speed is constant in blends and changes between them.

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

from bellcrank.errors import InputError
from bellcrank.motion.generators.profile import Profile
from bellcrank.motion.magnitude_limits import LONGEST

Pieces = list[tuple[float, float, float]]  # duration, acceleration at the beginning, jerk
SHORT = 1e-12  # of the whole time: shorter pieces are left out


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
