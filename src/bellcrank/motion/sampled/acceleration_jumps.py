"""Jumps of acceleration between the samples of a motion, detected from the samples.

Between two samples h apart the acceleration a(t) has a known mean and first moment:

    ∫ a dt = v1 − v0,      ∫ (h − t) a dt = p1 − p0 − h v0.

The quintic Hermite polynomial has the acceleration a0 + (a1 − a0) s + s (1 − s) (α + β (s − ½)), s = t/h, with
α = 6 ((v1 − v0)/h − (a0 + a1)/2) and β = −120 r/h², r = p1 − p0 − h (v0 + v1)/2 + h² (a1 − a0)/12. For smooth motions α
and β follow from the neighbouring accelerations. Where they do not, and a jump at one time between the curves from
either side satisfies both integrals, the jump is accepted: two equations and one unknown time, which only a real jump
satisfies. A jump that explains most of what the quintic adds is accepted too, and a cubic over the step makes up for
what it misses. Positions and velocities are met in every case.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.motion.motion import Motion
from bellcrank.motion.sampled.file_checks import typical_noise

AT_END = 1e-3  # of the step: a jump this close to a sample is at the sample
DEVIATION = 1e-3  # of a joint's largest acceleration: a smaller deviation from what the neighbours predict is smooth
EXCESS = 5e-3  # of a joint's largest acceleration: the quintic may exceed the samples by this
MISFIT = 4e-3  # of a jump: the two integrals agree with one time of the jump to this (a ramp is 4e-2 away)
EXACT = 1e-6  # of a jump: only a real jump fits so well
RISE = 6.0  # times the deviation of the steps beside it: a jump stands out by this
MANY = 200  # steps of one joint that deviate: more than this are noise
TOGETHER = 5e-3  # of the step: joints that jump this close to each other jump at one time
EQUAL = 1e-9  # of a joint's largest acceleration: limits that differ by less are one
RETURN = 5e-4  # of a joint's largest acceleration, times h²: by how much a step may lead a moved position back
EDGES = np.linspace(0.0, 1.0, 17)


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


@dataclass
class _Column:
    """One joint: its acceleration at the samples, how far each position is moved within rounding, and the parts of the
    steps with jumps.
    """

    acceleration: Array
    shift: Array
    parts: dict[int, list[Parabola]] = field(default_factory=dict)


def with_jumps(motion: Motion, rounding: float = 0.0, steps: Mapping[int, Sequence[int]] | None = None) -> Motion:
    """The motion with two rows of one time wherever the acceleration of a one-degree-of-freedom joint jumps.

    Positions are known to ± `rounding` (rad or m), and may change by that, so that rounding makes no accelerations.
    `steps` says, by the joint's place in the velocity, after which rows a jump may be; left out, after any.
    """
    h = np.diff(motion.time)
    columns = {}
    position = motion.position.copy()
    for joint in motion.joints:
        if joint.nv == 1:
            rows = (motion.position[:, joint.q], motion.velocity[:, joint.v], motion.acceleration[:, joint.v])
            columns[joint.v] = column = _column(h, *rows, rounding, None if steps is None else steps.get(joint.v, ()))
            position[:, joint.q] += column.shift
    if not any(column.parts or column.shift.any() for column in columns.values()):
        return motion
    return _with_rows(replace(motion, position=position), h, columns)


def _column(h: Array, p: Array, v: Array, a: Array, rounding: float, steps: Sequence[int] | None) -> _Column:
    """The jumps of one joint, from its positions, velocities and accelerations (n,) at samples h (n − 1,) s apart."""
    positive = h > 0.0
    step = np.where(positive, h, 1.0)
    r = np.where(positive, np.diff(p) - 0.5 * h * (v[1:] + v[:-1]) + h * h * np.diff(a) / 12.0, 0.0)
    doubt = typical_noise(r, 4.0 * rounding)
    settled = np.where(np.abs(r) <= doubt, r, 0.0)
    change, r = np.diff(p) - settled, r - settled
    quintic = _Quintic(a, 6.0 * (np.diff(v) / step - 0.5 * (a[1:] + a[:-1])), -120.0 * r / step**2)
    deviation, beside = _deviation(h, a, quintic.alpha, quintic.beta)
    scale = float(np.abs(a).max(initial=0.0))
    over = quintic.excess()
    found = _Column(a, np.zeros_like(p))
    for k in _candidates(positive, deviation, beside, scale, steps):
        distinct = deviation[k] > RISE * beside[k]
        most = 0.5 * float(over[k]) if distinct and over[k] > EXCESS * scale else 0.0
        integrals_wanted = (v[k + 1] - v[k], p[k + 1] - p[k] - h[k] * v[k])
        parts = fitted_jump(quintic.step(k, h, integrals_wanted), doubt * distinct, MISFIT if distinct else EXACT, most)
        if parts is not None:
            found.parts[k] = parts
            taken = h[k] * v[k] + integrals(float(h[k]), parts)[1]
            change[k] = taken if abs(taken - (p[k + 1] - p[k])) <= doubt else p[k + 1] - p[k]
    _shift_positions(found, change - np.diff(p), RETURN * scale * h**2, rounding)
    return found


def _candidates(
    positive: Mask, deviation: Array, beside: Array, scale: float, steps: Sequence[int] | None
) -> list[int]:
    """The steps in which a jump may be."""
    candidates = positive & (deviation > DEVIATION * scale)
    if steps is not None:
        allowed = np.zeros(len(positive), dtype=bool)
        allowed[list(steps)] = True
        candidates &= allowed
    if np.count_nonzero(candidates) > MANY:  # noise: only what stands out of it
        candidates &= deviation > RISE * beside
    found: list[int] = np.flatnonzero(candidates).tolist()
    return found


def _shift_positions(found: _Column, drift: Array, most_back: Array, rounding: float) -> None:
    """Move the positions (n,) within rounding so that they agree with the jumps; `drift` (n − 1,) is by how much the
    change over each step is moved, `most_back` by how much a step may lead a moved position back.
    """
    if not drift.any():
        return
    most_back[list(found.parts)] = 0.0
    for k, (moved, most) in enumerate(zip(drift.tolist(), most_back.tolist(), strict=True)):
        shift = found.shift[k] + moved
        found.shift[k + 1] = shift - min(max(shift, -most), most)
    if np.abs(found.shift).max() > 4.0 * rounding:
        found.shift[:] = 0.0


@dataclass(frozen=True)
class _Quintic:
    """The acceleration of the quintic over each step (n − 1,); samples a (n,), α and β as in the module docstring."""

    a: Array
    alpha: Array
    beta: Array

    def excess(self) -> Array:
        """By how much the quintic leaves the range of the two samples (n − 1,)."""
        a, s = self.a, EDGES[:, None]
        shape = a[:-1] + np.diff(a) * s + s * (1.0 - s) * (self.alpha + self.beta * (s - 0.5))
        return np.asarray(
            np.maximum(shape.max(axis=0) - np.maximum(a[1:], a[:-1]), np.minimum(a[1:], a[:-1]) - shape.min(axis=0))
        )

    def step(self, k: int, h: Array, wanted: tuple[float, float]) -> Step:
        """What the samples say of step k, whose acceleration has the integrals `wanted`."""
        a, alpha, beta = self.a, self.alpha, self.beta
        before, after = [(0.0, 0.0)], [(0.0, 0.0)]
        if k > 0 and h[k - 1] > 0.0:
            j, length = k - 1, h[k - 1]
            slope, bend = a[k] - a[j] - alpha[j] - 0.5 * beta[j], -2.0 * alpha[j] - 3.0 * beta[j]
            before += [((a[k] - a[j]) / length, 0.0), (slope / length, bend / length**2)]
        if k + 1 < len(h) and h[k + 1] > 0.0:
            j, length = k + 1, h[k + 1]
            slope, bend = a[j + 1] - a[j] + alpha[j] - 0.5 * beta[j], -2.0 * alpha[j] + 3.0 * beta[j]
            after += [((a[j + 1] - a[j]) / length, 0.0), (slope / length, bend / length**2)]
        return Step(
            h=float(h[k]),
            ends=(float(a[k]), float(a[k + 1])),
            before=before,
            after=after,
            around=_range(h, a, k),
            integrals=wanted,
        )


def _deviation(h: Array, a: Array, alpha: Array, beta: Array) -> tuple[Array, Array]:
    """How far the acceleration within each step (n − 1,) is from what neighbouring samples (n,) say, on the side that
    says it best, as beside a jump only one side is informative; and the larger of the same two steps beside it, each by
    the samples of its own side: where a motion is smooth, both are of one size.
    """
    step = np.where(h > 0.0, h, 1.0)
    known = np.zeros(len(a), dtype=bool)  # second derivatives of the acceleration at samples
    known[1:-1] = (h[1:] > 0.0) & (h[:-1] > 0.0)
    bend = np.zeros(len(a))
    bend[1:-1] = np.where(known[1:-1], 2.0 * np.diff(np.diff(a) / step) / (step[1:] + step[:-1]), 0.0)
    both = known[1:] & known[:-1]
    third = np.where(both, np.diff(bend) / step, 0.0)
    before, after = np.append(0.0, third[:-1]), np.append(third[1:], 0.0)
    sides = [
        (np.where(known[:-1], bend[:-1] + 0.5 * step * before, 0.0), before, known[:-1]),
        (np.where(known[1:], bend[1:] - 0.5 * step * after, 0.0), after, known[1:]),
        (0.5 * (bend[1:] + bend[:-1]), third, both),
    ]
    off = [
        np.where(
            there,
            0.25 * np.abs(alpha + 0.5 * step**2 * second) + 0.05 * np.abs(beta + step**3 * slope / 6.0),
            np.inf,
        )
        for second, slope, there in sides
    ]
    off.append(np.where(known[1:] | known[:-1], np.inf, 0.25 * np.abs(alpha) + 0.05 * np.abs(beta)))
    least = np.minimum.reduce(off)
    left, right = (np.where(np.isfinite(side), side, least) for side in off[:2])
    beside = np.maximum(np.append(0.0, left[:-1]), np.append(right[1:], 0.0))
    return np.asarray(least), np.asarray(beside)


def _range(h: Array, a: Array, k: int) -> tuple[float, float]:
    """Smallest and largest acceleration of the samples around step k, not beyond another jump."""
    first = k - 1 if k > 0 and h[k - 1] > 0.0 else k
    last = k + 2 if k + 1 < len(h) and h[k + 1] > 0.0 else k + 1
    around = a[first : last + 1]
    return float(around.min()), float(around.max())


def _with_rows(motion: Motion, h: Array, columns: dict[int, _Column]) -> Motion:
    """The motion with the rows that the parts need: two where the acceleration of a joint jumps, one where it bends."""
    before, after = motion.acceleration.copy(), motion.acceleration.copy()  # limits at the samples
    inner: dict[int, list[float]] = {}
    for k in sorted({k for column in columns.values() for k in column.parts}):
        here = {v: column.parts[k] for v, column in columns.items() if k in column.parts}
        inner[k] = _settle_together(float(h[k]), here)
        for v, parts in here.items():
            after[k, v] = next(part for part in reversed(parts) if part.begin <= 0.0).at(0.0)
            before[k + 1, v] = next(part for part in reversed(parts) if part.begin < h[k]).at(float(h[k]))
            columns[v].parts[k] = parts
    twin = np.append(h == 0.0, False)  # the first of two rows of one time
    second = np.insert(h == 0.0, 0, False)
    only_before, only_after = twin.copy(), second.copy()
    only_before[-1] = only_after[0] = True
    small = EQUAL * np.abs(motion.acceleration).max(axis=0)
    rows = []
    for k in range(len(motion)):
        state = (motion.time[k], motion.position[k], motion.velocity[k])
        if only_before[k]:
            rows.append((*state, before[k]))
        elif only_after[k] or np.all(np.abs(after[k] - before[k]) <= small):
            rows.append((*state, after[k]))
        else:
            rows += [(*state, before[k]), (*state, after[k])]
        if inner.get(k):
            rows += _inner_rows(motion, k, float(h[k]), inner[k], columns, small)
    time, position, velocity, acceleration = (np.array(part) for part in zip(*rows, strict=True))
    return replace(motion, time=time, position=position, velocity=velocity, acceleration=acceleration)


def _settle_together(h: float, columns: dict[int, list[Parabola]]) -> list[float]:
    """Times within a step at which rows are needed; begins of parts that are close to each other are made one, as
    joints that move each other jump together. The parts are moved in place.
    """
    begins = sorted(part.begin for parts in columns.values() for part in parts[1:])
    ends = [place for place in (0.0, h) if any(abs(begin - place) <= AT_END * h for begin in begins)]
    places: list[float] = []
    for begin in begins:
        if all(abs(begin - place) > TOGETHER * h for place in (*ends, *places)):
            places.append(begin)
    for parts in columns.values():
        for j, part in enumerate(parts[1:], 1):
            parts[j] = replace(part, begin=min((*ends, *places), key=lambda place: abs(place - part.begin)))
    return places


def _inner_rows(
    motion: Motion, k: int, h: float, places: list[float], columns: dict[int, _Column], small: Array
) -> list[tuple[float, Array, Array, Array]]:
    """Rows (time, position, velocity, acceleration) within step k at these times after its start, two where there is a
    jump of more than `small` (nv,).
    """
    begin = float(motion.time[k])
    q, v, a = motion.at(begin + np.array(places))
    sides = (a.copy(), a.copy())
    for joint in motion.joints:
        if joint.nv != 1 or k not in columns[joint.v].parts:
            continue
        parts = columns[joint.v].parts[k]
        start, end = ((motion.position[row, joint.q], motion.velocity[row, joint.v]) for row in (k, k + 1))
        for j, time in enumerate(places):
            q[j, joint.q], v[j, joint.v], sides[0][j, joint.v], sides[1][j, joint.v] = _state(
                h, time, start, end, parts
            )
    rows = []
    for j, time in enumerate(places):
        for side in sides[: 1 if np.all(np.abs(sides[1][j] - sides[0][j]) <= small) else 2]:
            rows.append((begin + time, q[j], v[j], side[j]))
    return rows


def _state(
    h: float, time: float, start: tuple[float, float], end: tuple[float, float], parts: list[Parabola]
) -> tuple[float, float, float, float]:
    """Position, velocity and acceleration before and after a time within a step, of the parts' acceleration; what its
    integrals miss at the end is made up by a cubic that is 0 at both ends.
    """
    speed, place = integrals(h, parts)
    missing_speed, missing_place = end[1] - start[1] - speed, end[0] - start[0] - h * start[1] - place
    speed, place = integrals(h, parts, time)
    p, v = start[0] + start[1] * time + place, start[1] + speed
    before = next(part for part in reversed(parts) if part.begin < time).at(time)
    after = next(part for part in reversed(parts) if part.begin <= time).at(time)
    # acceleration s (1 − s) (α + β (s − ½)) with ∫ = α/6 and ∫ (1 − s) = α/12 − β/120, its integrals and second ones
    s = time / h
    alpha = 6.0 * missing_speed / h
    beta = 10.0 * alpha - 120.0 * missing_place / (h * h)
    extra = s * (1.0 - s) * (alpha + beta * (s - 0.5))
    c1, c2, c3 = alpha - 0.5 * beta, 1.5 * beta - alpha, -beta  # of s, s², s³
    v += h * s * s * (c1 / 2.0 + s * (c2 / 3.0 + s * c3 / 4.0))
    p += h * h * s**3 * (c1 / 6.0 + s * (c2 / 12.0 + s * c3 / 20.0))
    return p, v, before + extra, after + extra
