"""Fitting one jump of the acceleration to what the samples say of the step between two of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

AT_END = 1e-3  # of the step: a jump this close to a sample is at the sample


@dataclass(frozen=True)
class Parabola:
    """The acceleration in a part of a step: c0 + c1 t + c2 t² from `begin` on, t and `begin` in s from the step's
    start.
    """

    begin: float
    c0: float
    c1: float = 0.0
    c2: float = 0.0

    def at(self, t: float) -> float:
        """Acceleration."""
        return self.c0 + t * (self.c1 + t * self.c2)

    def integrals(self, begin: float, end: float) -> tuple[float, float]:
        """∫ a dt and ∫ (end − t) a dt from begin to end."""
        b, e = begin, end
        first = (e * (self.c0 + e * (self.c1 / 2.0 + e * self.c2 / 3.0))) - (
            b * (self.c0 + b * (self.c1 / 2.0 + b * self.c2 / 3.0))
        )
        until = b * (self.c0 + b * (self.c1 / 2.0 + b * self.c2 / 3.0))
        second = e * e * (self.c0 / 2.0 + e * (self.c1 / 6.0 + e * self.c2 / 12.0))
        second -= b * b * (self.c0 / 2.0 + b * (self.c1 / 6.0 + b * self.c2 / 12.0))
        return first, second - until * (e - b)


def integrals(h: float, parts: list[Parabola], until: float | None = None) -> tuple[float, float]:
    """∫ a dt and ∫ (end − t) a dt of the parts, up to `until` (s after the step's start), or the step's end."""
    end = h if until is None else until
    speed = place = 0.0
    for part, following in zip(parts, [*(later.begin for later in parts[1:]), h], strict=True):
        first, last = min(part.begin, end), min(following, end)
        change, moved = part.integrals(first, last)
        place += speed * (last - first) + moved
        speed += change
    return speed, place


@dataclass(frozen=True, kw_only=True)
class Step:
    """What the samples say of a step of h s: the accelerations at both `ends`; slopes and second derivatives that the
    acceleration may have at its beginning (`before`) and end (`after`); the range of the accelerations `around`; and
    both integrals of the acceleration.
    """

    h: float
    ends: tuple[float, float]
    before: list[tuple[float, float]]
    after: list[tuple[float, float]]
    around: tuple[float, float]
    integrals: tuple[float, float]


def fitted_jump(step: Step, doubt: float, misfit: float, most: float) -> list[Parabola] | None:
    """The two parabolas, one from either end of the step, that meet both integrals best, with a jump between them.

    The second integral is known to ± `doubt`. None where no pair fits to `misfit` of its jump, nor so well that making
    up for what it misses takes less acceleration than `most`.
    """
    h, ends, wanted = step.h, step.ends, step.integrals
    best: tuple[float, list[Parabola]] | None = None
    low_bound, high_bound = step.around
    beyond = 0.25 * (high_bound - low_bound)
    for (rise, bend), (fall, curve) in product(step.before, step.after):
        left = Parabola(0.0, ends[0], rise, 0.5 * bend)
        right = Parabola(0.0, ends[1] - fall * h + 0.5 * curve * h * h, fall - curve * h, 0.5 * curve)
        gap = [left.c2 - right.c2, left.c1 - right.c1, left.c0 - right.c0]
        times = [*_roots(gap), *_roots([gap[0] / 3.0, gap[1] / 2.0, gap[2], right.integrals(0.0, h)[0] - wanted[0]])]
        for time in times:
            if not -0.05 * h <= time <= 1.05 * h:
                continue
            time = 0.0 if time < AT_END * h else h if time > (1.0 - AT_END) * h else time
            low, high = sorted((left.at(time), right.at(time)))
            if not low_bound - beyond <= low <= high <= high_bound + beyond:
                continue
            parts = [left, replace(right, begin=time)]
            speed, place = integrals(h, parts)
            size = max(high - low, abs(left.at(time) - ends[0]), abs(ends[1] - right.at(time)), 1e-300)
            missed = abs(speed - wanted[0]) / h, max(abs(place - wanted[1]) - doubt, 0.0) / (h * h)
            miss = max(missed)
            fits = miss <= misfit * size or 1.5 * missed[0] + 6.0 * missed[1] < most
            if fits and (best is None or miss < best[0]):
                best = miss, parts
    return None if best is None else best[1]


def _roots(coefficients: list[float]) -> list[float]:
    """Real roots of a polynomial, highest power first."""
    while coefficients and coefficients[0] == 0.0:
        coefficients = coefficients[1:]
    return [float(root.real) for root in np.roots(coefficients) if abs(root.imag) <= 1e-6 * abs(root)]
