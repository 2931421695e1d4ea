"""Jumps of acceleration between the samples of a motion, found from what the samples say of each other.

Between two samples h apart the acceleration a(t) has a known mean and first moment:

    ∫ a dt = v1 − v0,      ∫ (h − t) a dt = p1 − p0 − h v0.

The quintic Hermite polynomial has the acceleration a0 + (a1 − a0) s + s (1 − s) (α + β (s − ½)), s = t/h, with
α = 6 ((v1 − v0)/h − (a0 + a1)/2) and β = −120 r/h², r = p1 − p0 − h (v0 + v1)/2 + h² (a1 − a0)/12. For smooth motions α
and β follow from the neighbouring accelerations; where they do not, and a jump between the two neighbouring lines at
one time satisfies both integrals, the jump is taken. Both equations and one unknown time: a jump that is not there
does not satisfy them. Where nothing does and the quintic exceeds what the samples say, the acceleration of least range
is taken: it takes the smallest and the largest neighbouring sample in turn (the bang-bang solution of the moment
problem, A. A. Markov; M. G. Krein, A. A. Nudel'man, The Markov Moment Problem and Extremal Problems, 1977).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bellcrank.motion.coordinates import Array
from bellcrank.motion.motion import Motion
from bellcrank.motion.smooth_pieces import typical_noise

SURPRISE = 1e-3  # of a joint's largest acceleration: less than this from what the neighbours say is smooth
EXCESS = 5e-3  # of a joint's largest acceleration: the quintic may exceed the samples by this without more questions
MISFIT = 4e-3  # of a jump: the two integrals agree with one time of the jump to this (a ramp is 4e-2 away)
WIDER = (
    0.0,
    0.002,
    0.005,
    0.01,
    0.03,
    0.1,
    0.3,
)  # of the samples' range: derived speeds that are a little off need some
AT_END = 1e-3  # of the step: a jump this close to a sample is at the sample
BACK = 5e-4  # of a joint's largest acceleration, times h²: how far a step may lead a moved position back
EDGES = np.linspace(0.0, 1.0, 17)


@dataclass(frozen=True)
class Node:
    """Where, within a step, the acceleration changes its line: s after its start, and the limits on both sides."""

    time: float
    before: float
    after: float


@dataclass
class _Column:
    """One joint: its acceleration at the samples, how far each position is moved within rounding, and the nodes of the
    steps with jumps.
    """

    acceleration: Array
    shift: Array
    nodes: dict[int, list[Node]] = field(default_factory=dict)


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
    if not any(column.nodes or column.shift.any() for column in columns.values()):
        return motion
    return _with_rows(replace(motion, position=position), h, columns)


def _column(h: Array, p: Array, v: Array, a: Array, rounding: float, steps: Sequence[int] | None) -> _Column:
    there = h > 0.0
    if steps is not None:
        doubtful = np.zeros(len(h), dtype=bool)
        doubtful[list(steps)] = True
    else:
        doubtful = there
    step = np.where(there, h, 1.0)
    r = np.where(there, np.diff(p) - 0.5 * h * (v[1:] + v[:-1]) + h * h * np.diff(a) / 12.0, 0.0)
    doubt = typical_noise(r, 4.0 * rounding)
    settled = np.where(np.abs(r) <= doubt, r, 0.0)
    change, r = np.diff(p) - settled, r - settled
    alpha = 6.0 * (np.diff(v) / step - 0.5 * (a[1:] + a[:-1]))
    beta = -120.0 * r / step**2
    expected_alpha, expected_beta = _expected(h, a)
    surprise = 0.25 * np.abs(alpha - expected_alpha) + 0.05 * np.abs(beta - expected_beta)
    scale = float(np.abs(a).max(initial=0.0))
    s = EDGES[:, None]
    shape = a[:-1] + np.diff(a) * s + s * (1.0 - s) * (alpha + beta * (s - 0.5))
    over = np.maximum(shape.max(axis=0) - np.maximum(a[1:], a[:-1]), np.minimum(a[1:], a[:-1]) - shape.min(axis=0))
    found = _Column(a, np.zeros_like(p))
    for k in np.flatnonzero(doubtful & there & (surprise > SURPRISE * scale)).tolist():
        wanted = (v[k + 1] - v[k], p[k + 1] - p[k] - h[k] * v[k])
        nodes = _jump(float(h[k]), _lines(h, a, k), wanted, doubt)
        if nodes is None and over[k] > EXCESS * scale:
            low, high = _range(h, a, k)
            for wider in WIDER:
                reach = (low - wider * (high - low), high + wider * (high - low))
                if nodes is None and wider * (high - low) < 0.5 * over[k]:  # else the quintic is the better guess
                    nodes = _least_range(float(h[k]), *reach, float(a[k]), float(a[k + 1]), wanted, doubt)
        if nodes is not None:
            found.nodes[k] = nodes
            taken = h[k] * v[k] + _integrals(float(h[k]), float(a[k]), float(a[k + 1]), nodes)[1]
            change[k] = taken if abs(taken - (p[k + 1] - p[k])) <= doubt else p[k + 1] - p[k]
    drift = change - np.diff(p)
    if drift.any():
        back = BACK * scale * h**2
        back[list(found.nodes)] = 0.0
        for k, (moved, most) in enumerate(zip(drift.tolist(), back.tolist(), strict=True)):
            shift = found.shift[k] + moved
            found.shift[k + 1] = shift - min(max(shift, -most), most)
        if np.abs(found.shift).max() > 4.0 * rounding:
            found.shift[:] = 0.0
    return found


def _expected(h: Array, a: Array) -> tuple[Array, Array]:
    """α and β (n − 1,) of each step as the neighbouring accelerations (n,) say; 0 where there are none."""
    n = len(h)
    bend = np.zeros(n + 1)  # second derivative of the acceleration at inner samples
    known = np.zeros(n + 1, dtype=bool)
    known[1:-1] = (h[1:] > 0.0) & (h[:-1] > 0.0)
    step = np.where(h > 0.0, h, 1.0)
    slope = np.diff(a) / step
    bend[1:-1] = np.where(known[1:-1], 2.0 * np.diff(slope) / (step[1:] + step[:-1]), 0.0)
    count = known[1:].astype(float) + known[:-1]
    mean = (bend[1:] + bend[:-1]) / np.maximum(count, 1.0)
    both = known[1:] & known[:-1]
    apart = np.ones(n)  # between the middles of three samples each
    apart[1:-1] = (step[2:] + step[1:-1] + step[:-2]) / 3.0
    third = np.where(both, (bend[1:] - bend[:-1]) / apart, 0.0)
    return -0.5 * step**2 * mean, -(step**3) * third / 6.0


def _lines(h: Array, a: Array, k: int) -> list[tuple[float, float, float, float]]:
    """Lines (value, slope) from before and from after step k: level ones, and those through one more sample each."""
    before = (a[k] - a[k - 1]) / h[k - 1] if k > 0 and h[k - 1] > 0.0 else 0.0
    after = (a[k + 2] - a[k + 1]) / h[k + 1] if k + 1 < len(h) and h[k + 1] > 0.0 else 0.0
    pairs = {(0.0, 0.0), (before, 0.0), (0.0, after), (before, after)}
    return [(float(a[k]), float(b), float(a[k + 1]), float(c)) for b, c in sorted(pairs)]


def _range(h: Array, a: Array, k: int) -> tuple[float, float]:
    """Smallest and largest acceleration of the samples around step k, not beyond another jump."""
    first = k - 1 if k > 0 and h[k - 1] > 0.0 else k
    last = k + 2 if k + 1 < len(h) and h[k + 1] > 0.0 else k + 1
    around = a[first : last + 1]
    return float(around.min()), float(around.max())


def _integrals(h: float, first: float, last: float, nodes: list[Node]) -> tuple[float, float]:
    """∫ a dt and ∫ (h − t) a dt over a step of the acceleration that is linear between its nodes."""
    speed = place = begin = 0.0
    value = first
    for node in [*nodes, Node(h, last, last)]:
        d = node.time - begin
        place += speed * d + d * d * (2.0 * value + node.before) / 6.0
        speed += 0.5 * d * (value + node.before)
        begin, value = node.time, node.after
    return speed, place


def _jump(
    h: float, lines: list[tuple[float, float, float, float]], wanted: tuple[float, float], doubt: float
) -> list[Node] | None:
    """One node between two lines that has both integrals, the one that fits best; None where none fits."""
    best: tuple[float, list[Node]] | None = None
    for first, rise, last, fall in lines:
        # from before: first + rise t; from after: last − fall (h − t); their difference integrated up to the jump
        whole = last * h - 0.5 * fall * h * h
        quadratic = [0.5 * (rise - fall), first - last + fall * h, whole - wanted[0]]
        corner = (last - fall * h - first) / (rise - fall) if rise != fall else -1.0
        roots = np.roots(quadratic) if any(quadratic[:2]) else np.zeros(0)
        for time in [*(float(root.real) for root in roots if abs(root.imag) <= 1e-6 * h), corner]:
            if not -AT_END * h <= time <= (1.0 + AT_END) * h:
                continue
            time = min(max(time, 0.0), h)
            node = Node(time, first + rise * time, last - fall * (h - time))
            nodes = [node] if time > 0.0 else [Node(0.0, first, node.after)]
            if time == h:
                nodes = [Node(h, node.before, last)]
            speed, place = _integrals(h, first, last, nodes)
            size = max(abs(node.after - node.before), abs(node.before - first), abs(last - node.after), 1e-300)
            gap = max(abs(speed - wanted[0]) / h, max(abs(place - wanted[1]) - doubt, 0.0) / (h * h)) / size
            if gap <= MISFIT and (best is None or gap < best[0]):
                best = gap, nodes
    return None if best is None else best[1]


def _least_range(
    h: float, low: float, high: float, first: float, last: float, wanted: tuple[float, float], doubt: float
) -> list[Node] | None:
    """The acceleration that is low, high, low and has both integrals; None where none within the range has them."""
    if high <= low:
        return None
    share = (wanted[0] / h - low) / (high - low)  # of the step for which it is high
    if not 1e-9 <= share <= 1.0 - 1e-9:
        return None
    centre = 1.0 - (wanted[1] / (h * h) - 0.5 * low) / ((high - low) * share)
    slack = doubt / (h * h * (high - low) * share) + 1e-6
    if not 0.5 * share - slack <= centre <= 1.0 - 0.5 * share + slack:
        return None
    begin = min(max(centre - 0.5 * share, 0.0), 1.0 - share)
    begin, end = (0.0 if begin < AT_END else begin), (1.0 if begin + share > 1.0 - AT_END else begin + share)
    nodes = [Node(0.0, first, high if begin == 0.0 else low)]
    nodes += [Node(begin * h, low, high)] if begin > 0.0 else []
    nodes += [Node(end * h, high, low)] if end < 1.0 else []
    nodes.append(Node(h, low if end < 1.0 else high, last))
    return nodes


def _with_rows(motion: Motion, h: Array, columns: dict[int, _Column]) -> Motion:
    """The motion with the rows that the nodes need: two where the acceleration of a joint jumps, one at a corner."""
    before, after = motion.acceleration.copy(), motion.acceleration.copy()  # limits at the samples
    inner: dict[int, list[float]] = {}
    for v, column in columns.items():
        for k, nodes in column.nodes.items():
            for node in nodes:
                if node.time <= AT_END * h[k]:
                    after[k, v] = node.after
                elif node.time >= (1.0 - AT_END) * h[k]:
                    before[k + 1, v] = node.before
                else:
                    inner.setdefault(k, []).append(node.time)
    twin = np.append(h == 0.0, False)  # the first of two rows of one time
    second = np.insert(h == 0.0, 0, False)
    only_before, only_after = twin.copy(), second.copy()
    only_before[-1] = only_after[0] = True
    rows = []
    for k in range(len(motion)):
        state = (motion.time[k], motion.position[k], motion.velocity[k])
        if only_before[k]:
            rows.append((*state, before[k]))
        elif only_after[k] or np.array_equal(before[k], after[k]):
            rows.append((*state, after[k]))
        else:
            rows += [(*state, before[k]), (*state, after[k])]
        if k in inner:
            rows += _inner_rows(motion, k, float(h[k]), inner[k], columns)
    time, position, velocity, acceleration = (np.array(part) for part in zip(*rows, strict=True))
    return replace(motion, time=time, position=position, velocity=velocity, acceleration=acceleration)


def _inner_rows(
    motion: Motion, k: int, h: float, times: list[float], columns: dict[int, _Column]
) -> list[tuple[float, Array, Array, Array]]:
    """Rows (time, position, velocity, acceleration) within step k, two a time, at the distinct ones of these times."""
    places: list[float] = []
    for time in sorted(times):
        if not places or time - places[-1] > AT_END * h:
            places.append(time)
    begin = float(motion.time[k])
    q, v, a = motion.at(begin + np.array(places))
    sides = (a.copy(), a.copy())
    for joint in motion.joints:
        if joint.nv != 1 or k not in columns[joint.v].nodes:
            continue
        nodes = [_moved(node, places, h) for node in columns[joint.v].nodes[k]]
        start, end = ((motion.position[row, joint.q], motion.velocity[row, joint.v]) for row in (k, k + 1))
        first, last = float(motion.acceleration[k, joint.v]), float(motion.acceleration[k + 1, joint.v])
        for j, time in enumerate(places):
            q[j, joint.q], v[j, joint.v], sides[0][j, joint.v], sides[1][j, joint.v] = _state(
                h, time, (*start, first), (*end, last), nodes
            )
    rows = []
    for j, time in enumerate(places):
        for side in sides[: 1 if np.array_equal(sides[0][j], sides[1][j]) else 2]:
            rows.append((begin + time, q[j], v[j], side[j]))
    return rows


def _moved(node: Node, places: list[float], h: float) -> Node:
    """The node at the nearest of the times that rows stand at."""
    return replace(node, time=min([0.0, *places, h], key=lambda place: abs(place - node.time)))


def _state(
    h: float, time: float, start: tuple[float, float, float], end: tuple[float, float, float], nodes: list[Node]
) -> tuple[float, float, float, float]:
    """Position, velocity and acceleration before and after a time within a step, of the acceleration that is linear
    between its nodes; what its integrals miss at the end is made up by the quintic of least degree, zero at both ends.
    """
    p, v, begin, value = start[0], start[1], 0.0, start[2]
    nodes = [*nodes, Node(h, end[2], end[2])]
    speed, place = _integrals(h, start[2], end[2], nodes[:-1])
    missing_speed, missing_place = end[1] - v - speed, end[0] - p - h * v - place
    before = after = value
    for node in nodes:
        d = min(node.time, time) - begin
        slope = (node.before - value) / (node.time - begin) if node.time > begin else 0.0
        p += v * d + d * d * (0.5 * value + slope * d / 6.0)
        v += d * (value + 0.5 * slope * d)
        before = after = value + slope * d
        if node.time >= time:
            after = node.after if node.time == time else after
            break
        begin, value = node.time, node.after
    # acceleration s (1 − s) (α + β (s − ½)) with ∫ = α/6 and ∫ (1 − s) = α/12 − β/120, its integrals and second ones
    s = time / h
    alpha = 6.0 * missing_speed / h
    beta = 10.0 * alpha - 120.0 * missing_place / (h * h)
    extra = s * (1.0 - s) * (alpha + beta * (s - 0.5))
    c1, c2, c3 = alpha - 0.5 * beta, 1.5 * beta - alpha, -beta  # of s, s², s³
    v += h * s * s * (c1 / 2.0 + s * (c2 / 3.0 + s * c3 / 4.0))
    p += h * h * s**3 * (c1 / 6.0 + s * (c2 / 12.0 + s * c3 / 20.0))
    return p, v, before + extra, after + extra
