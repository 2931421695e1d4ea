"""Points along a motion at which loads are evaluated and integrated.

The time between the rows of a motion is divided into parts: at the reversals of every joint, where friction and the
losses of a gear jump; at the rows of force tables, where forces may jump; further where torques change fast
(friction, stiff springs), until halving a part no longer changes the integral of their squares; and where a torque
changes its sign, at which the losses of a gear do. Integrals are Gauss-Legendre sums over the three inner points of
each part. Speeds at the ends of parts are one-sided limits (below). A mechanism that is at
rest where a motion begins or ends rests before and after it too: there a point without acceleration is added.

The efficiency of a gear depends on the direction of power, τ q̇ at its output, so the shaft torque jumps where q̇ passes
through zero: there its two limits count, each with the sign that q̇ has on its side and the acceleration of that side.
A sample's speed is therefore 0 only where the joint rests for a finite time. At any other zero the speed is a share
`ONE_SIDE` of that elsewhere in the part of the motion to which the sample belongs; the first sample of a motion belongs
to the part after it, the last one to the part before it. Whoever asks for the direction of power takes the sign of τ q̇
and needs no tolerance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np

from bellcrank.arrays import Array, Indices
from bellcrank.motion.motion import Motion

STILL = 1e-9  # rad/s or m/s: the sign of a slower speed is rounding, unless it comes to rest steadily
LASTING = 1e-6  # of a motion's duration: shorter stretches of slower speeds are reversals, not rest
ONE_SIDE = 1e-30  # so small that neither forces nor powers change
Torque = Callable[[Array, Array, Array, Array], Array]  # (t, q, v, a) -> (n, k)
FINEST = 300  # parts of a whole motion that the grid has at least
GAUSS = 0.5 * np.sqrt(0.6)  # of a part, from its middle: the outer points of Gauss and Legendre's rule
NODES = np.array([0.0, 0.5 - GAUSS, 0.5, 0.5 + GAUSS, 1.0])
WEIGHTS = np.array([0.0, 5.0, 8.0, 5.0, 0.0]) / 18.0
HALVINGS = 16  # of a part, at most
SETTLED = 2e-11  # of the whole integral of a squared torque: a part that halving changes by less is fine enough
NOISE = 1e-12  # of the largest integral of a squared torque: smaller ones need not settle
MOST_PARTS = 30_000  # of a motion's grid that halving may lead to
BISECTIONS = 40  # of the part in which a velocity changes sign
CUTS = 14  # bisections of the part in which a torque does: what is left weighs (2^-14)^3 of the part's integral
BESIDE = 1e-3  # of a part: zeros closer to its ends, or jumps there, change its integral by the third power of it
ROUNDED = 1e-9  # of a torque's largest value: signs of smaller ones are rounding
BLOCK_NUMBERS = 1_000_000  # of one quantity, in memory at a time
LEAST_BLOCK = 9  # states that are evaluated together, at least


@dataclass(frozen=True, eq=False)
class Sides:
    """The parts of a motion in which no speed changes its sign.

    Attributes:
        end: Ends (m,) of the parts, s.
        velocity: The velocity of largest size (m, nv) of each coordinate in each part; 0 where it rests.
    """

    end: Array
    velocity: Array

    @classmethod
    def of(cls, begin: float, end: Array, first: Indices, velocity: Array) -> Self:
        """Parts between times `begin` and `end` (m,), s, from velocities (n, nv) of which those of a part begin at
        `first` (m,). A joint rests where all of its speeds in parts of a finite time are below `STILL`; a shorter
        stretch belongs to the part before it, at the start of the motion to the one after it. A joint that comes to
        rest softly, or sets off so, has smaller speeds with a direction for some time: it moves as long as its speeds
        fall from part to part and keep their sign.
        """
        most, least = (pick.reduceat(velocity, first, axis=0) for pick in (np.maximum, np.minimum))
        found = np.where(most >= -least, most, least)
        still = np.abs(found) <= STILL
        raw = found.copy()
        found[still] = 0.0
        edges = np.concatenate([[begin], end])
        for column in np.flatnonzero(still.any(axis=0) & ~still.all(axis=0)):
            change = np.diff(still[:, column].astype(int), prepend=0, append=0)
            for low, high in zip(np.flatnonzero(change > 0), np.flatnonzero(change < 0), strict=True):
                if edges[high] - edges[low] <= LASTING * (edges[-1] - edges[0]):
                    found[low:high, column] = found[low - 1 if low else high, column]
                    continue
                before = _soft(raw[low - 1 : high, column]) if low else 0
                after = _soft(raw[low : high + 1, column][::-1]) if high < len(found) else 0
                found[low : low + before, column] = raw[low : low + before, column]
                found[high - after : high, column] = raw[high - after : high, column]
        return cls(end, found)

    def of_velocity(self, time: Array, velocity: Array) -> Array:
        """Velocities (n, nv) at times (n,), s, with the sign of their side; the part after a time counts, so a limit
        from before belongs to a time just before.
        """
        if not (small := np.abs(velocity) <= STILL).any():
            return velocity
        part = np.minimum(np.searchsorted(self.end, time, side="right"), len(self.end) - 1)
        return np.where(small, ONE_SIDE * self.velocity[part], velocity)


def _soft(speed: Array) -> int:
    """How many of the speeds after the first one fall steadily and keep its sign."""
    steady = (speed[1:] * speed[:-1] > 0.0) & (np.abs(speed[1:]) < np.abs(speed[:-1]))
    return int(len(steady) if steady.all() else np.argmin(steady))


@dataclass(frozen=True, eq=False)
class Grid:
    """Points along a motion: times (n,), s, states q (n, nq), v and a (n, nv), and integration weights (n,), s.

    `force_time` (n,) is the time at which forces are evaluated: just before `time` where a part ends, so that a force
    that jumps there has its limit from before. `part` (n,) numbers the part of each point, from 0. `sides` are those of
    the velocities.
    """

    time: Array
    force_time: Array
    position: Array
    velocity: Array
    acceleration: Array
    weight: Array
    part: Indices
    sides: Sides

    def at(self, motion: Motion, time: Array) -> tuple[Array, Array, Array]:
        """The states q (m, nq), v and a (m, nv) of the motion at times (m,), with one-sided speeds."""
        q, v, a = motion.at(time)
        return q, self.sides.of_velocity(time, v), a


def grid_along(
    motion: Motion, probes: Array | None = None, breaks: Array | None = None, torque: Torque | None = None
) -> Grid:
    """The grid of a motion. It holds both limits of every jump of acceleration, and of forces at `breaks` (s).

    `probes` are further times (s) at which loads are evaluated, such as those next to a reversal; their weight is 0.
    Parts are halved where `torque` changes too fast for them, and end where it changes its sign: there the losses of a
    gear do, so that motor torques bend.
    """
    edges, _ = _edges(motion, np.zeros(0) if breaks is None else breaks)
    low, high = edges[:-1], edges[1:]
    if torque is not None:
        low, high = _cut_at_zeros(motion, torque, *_halved(motion, torque, low, high))
    grid = _with_rest(motion, _grid(motion, low, high))
    return grid if probes is None else with_probes(motion, grid, probes)


def coarse_grid_along(motion: Motion, breaks: Array, loads: Torque, torque: Torque | None = None) -> Grid:
    """As `grid_along`, with neighbouring parts merged where that does not change the integrals of the squared `loads`
    (torques, but also speeds and accelerations), across a motion's rows, down to about `FINEST` parts. Parts end where
    `torque` changes its sign, if it is given.
    """
    edges, kinks = _edges(motion, breaks)
    low, high = _halved(motion, loads, *_merged(motion, loads, edges[:-1], edges[1:], kinks))
    if torque is not None:
        low, high = _cut_at_zeros(motion, torque, low, high)
    grid = _grid(motion, low, high)
    smooth = np.flatnonzero(~np.isin(low[1:], kinks)) + 1  # both sides of their first edge are alike
    keep = np.delete(np.arange(len(grid.time)), smooth * len(NODES))
    kept = {one.name: getattr(grid, one.name)[keep] for one in fields(Grid) if one.name != "sides"}
    return _with_rest(motion, replace(grid, **kept))


def motion_sides(motion: Motion) -> Sides:
    """The sides of the speeds of a motion."""
    edges, _ = _edges(motion, np.zeros(0))
    return _grid(motion, edges[:-1], edges[1:]).sides


def _grid(motion: Motion, low: Array, high: Array) -> Grid:
    """The points of parts (m,)."""
    length, last = high - low, len(NODES) - 1
    time = (low[:, None] + length[:, None] * NODES).ravel()
    weight = (length[:, None] * WEIGHTS).ravel()
    part = np.repeat(np.arange(len(low)), len(NODES))
    force_time = time.copy()
    time[last :: last + 1] = high
    force_time[last :: last + 1] = np.nextafter(high, -np.inf)
    position, velocity, acceleration = motion.at(time)
    # A part that starts (ends) at a row of the motion takes that row's limit from after (before) a jump.
    for place, edge, side in ((0, low, "right"), (last, high, "left")):
        row = np.searchsorted(motion.time, edge, side="right" if side == "right" else "left")
        row = np.clip(row - 1 if side == "right" else row, 0, len(motion.time) - 1)
        at_row = motion.time[row] == edge
        points = np.arange(len(low))[at_row] * len(NODES) + place
        position[points], velocity[points] = motion.position[row[at_row]], motion.velocity[row[at_row]]
        acceleration[points] = motion.acceleration[row[at_row]]
    sides = Sides.of(float(low[0]), high, np.arange(len(low)) * len(NODES), velocity)
    velocity = sides.of_velocity(force_time, velocity)
    return Grid(time, force_time, position, velocity, acceleration, weight, part, sides)


def _with_rest(motion: Motion, grid: Grid) -> Grid:
    """The grid with points of weight 0 before and after the motion, at rest, where it begins and ends at rest."""
    first, last = (int(np.abs(motion.velocity[row]).max(initial=0.0) <= STILL) for row in (0, -1))
    added: dict[str, Any] = {}
    for one in fields(Grid):
        if one.name != "sides":
            values = getattr(grid, one.name)
            ends = [np.repeat(values[:1], first, axis=0), np.repeat(values[-1:], last, axis=0)]
            if one.name in ("velocity", "acceleration"):
                ends = [0.0 * end for end in ends]
            added[one.name] = np.concatenate([ends[0], values, ends[1]])
    return replace(grid, **added)


def with_probes(motion: Motion, grid: Grid, probes: Array) -> Grid:
    """The grid of a motion with further times (s) of weight 0."""
    probes = np.unique(probes)
    probes = probes[~np.isin(probes, grid.time)]
    if not probes.size:
        return grid
    at = np.searchsorted(grid.time, probes)
    position, velocity, acceleration = (
        np.insert(old, at, new, axis=0)
        for old, new in zip((grid.position, grid.velocity, grid.acceleration), grid.at(motion, probes), strict=True)
    )
    return replace(
        grid,
        time=np.insert(grid.time, at, probes),
        force_time=np.insert(grid.force_time, at, probes),
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        weight=np.insert(grid.weight, at, 0.0),
        part=np.insert(grid.part, at, grid.part[at - 1]),
    )


def _edges(motion: Motion, breaks: Array) -> tuple[Array, Array]:
    """Edges (m + 1,), s, of the parts: the motion's rows, divided further, breaks, and reversals of any joint; and
    those at which loads or their slopes jump: breaks, reversals, ends of rest and jumps of acceleration.
    """
    starts = np.flatnonzero(np.diff(motion.time) > 0.0)
    inner = divided(motion.time[starts], motion.time[starts + 1] - motion.time[starts], motion.duration)
    breaks = breaks[(breaks > motion.time[0]) & (breaks < motion.time[-1])]
    edges = np.unique(np.concatenate([inner, motion.time, breaks]))
    speed = motion.at(edges)[1]
    speed[np.abs(speed) <= STILL] = 0.0
    stops = edges[1:-1][((speed[1:-1] == 0.0) & ((speed[:-2] != 0.0) | (speed[2:] != 0.0))).any(axis=1)]
    row, column = np.nonzero(speed[:-1] * speed[1:] < 0.0)
    low, high = edges[row].copy(), edges[row + 1].copy()
    for _ in range(BISECTIONS if row.size else 0):
        middle = 0.5 * (low + high)
        before = motion.at(middle)[1][np.arange(len(row)), column] * speed[row, column] > 0.0
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    jumps = motion.time[1:][np.diff(motion.time) == 0.0]
    return np.unique(np.concatenate([edges, low])), np.unique(np.concatenate([breaks, low, stops, jumps]))


def divided(begin: Array, length: Array, duration: float) -> Array:
    """Where parts begin, s, of intervals from `begin` (m,), s, whose `length` (m,), s, is divided so that a motion has
    at least `FINEST` parts.
    """
    count = np.maximum(1, np.ceil(FINEST * length / duration - 1e-9)).astype(int)
    place = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return np.asarray(np.repeat(begin, count) + place * np.repeat(length / count, count))


def _halved(motion: Motion, torque: Torque, low: Array, high: Array) -> tuple[Array, Array]:
    """The parts, halved until the Gauss-Legendre sum of each squared torque over a part is that over its halves."""

    sums = _squares(motion, torque, low, high)
    enough = _settled(sums)
    done: list[tuple[Array, Array]] = []
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        left, right = _squares(motion, torque, low, middle), _squares(motion, torque, middle, high)
        coarse = (np.abs(left + right - sums) > enough).any(axis=1) & (low < middle) & (middle < high)
        done.append((low[~coarse], high[~coarse]))
        low, middle, high = low[coarse], middle[coarse], high[coarse]
        if not len(low) or sum(len(part) for part, _ in done) + 2 * len(low) > MOST_PARTS:
            break
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        sums = np.concatenate([left[coarse], right[coarse]])
    done.append((low, high))
    low, high = (np.concatenate([part[k] for part in done]) for k in (0, 1))
    order = np.argsort(low)
    return low[order], high[order]


def _cut_at_zeros(motion: Motion, torque: Torque, low: Array, high: Array) -> tuple[Array, Array]:
    """The parts, cut where a torque changes its sign between two of their nodes by more than rounding."""
    time = (low[:, None] + (high - low)[:, None] * NODES).ravel()
    values = _in_blocks(motion, torque, time)
    largest = np.abs(values).max(axis=0, initial=0.0)
    noise = np.where(largest > NOISE * largest.max(initial=0.0), ROUNDED * largest, np.inf)
    before, after = values[:-1], values[1:]
    crosses = ((before > 0.0) != (after > 0.0)) & (np.maximum(np.abs(before), np.abs(after)) > noise)
    crosses &= (np.diff(time) > 0.0)[:, None]
    row, column = np.nonzero(crosses)
    left, right, positive = time[row], time[row + 1], values[row, column] > 0.0
    for _ in range(CUTS if row.size else 0):
        middle = 0.5 * (left + right)
        same = (_in_blocks(motion, torque, middle)[np.arange(len(row)), column] > 0.0) == positive
        left, right = np.where(same, middle, left), np.where(same, right, middle)
    zeros, part = 0.5 * (left + right), row // len(NODES)
    aside = np.minimum(zeros - low[part], high[part] - zeros) > BESIDE * (high - low)[part]
    edges = np.unique(np.concatenate([low, high, zeros[aside]]))
    return edges[:-1], edges[1:]


def _in_blocks(motion: Motion, torque: Torque, time: Array) -> Array:
    """Torques (n, k) at times (n,)."""
    return np.concatenate([torque(time[part], *motion.at(time[part])) for part in blocks(motion, len(time))])


def _merged(motion: Motion, loads: Torque, low: Array, high: Array, kinks: Array) -> tuple[Array, Array]:
    """The parts, neighbours merged where the Gauss-Legendre sum of each squared load over both is that over each."""
    high = high.copy()
    sums = _squares(motion, loads, low, high)
    enough, longest = _settled(sums), motion.duration / FINEST * (1.0 + 1e-9)
    for turn in range(2 * HALVINGS):
        first = np.arange(turn % 2, len(low) - 1, 2)
        first = first[(high[first + 1] - low[first] <= longest) & ~np.isin(high[first], kinks)]
        if not first.size:
            continue
        both = _squares(motion, loads, low[first], high[first + 1])
        same = (np.abs(both - sums[first] - sums[first + 1]) <= enough).all(axis=1)
        first = first[same]
        sums[first], high[first] = both[same], high[first + 1]
        low, high, sums = np.delete(low, first + 1), np.delete(high, first + 1), np.delete(sums, first + 1, axis=0)
    return low, high


def _squares(motion: Motion, loads: Torque, low: Array, high: Array) -> Array:
    """The Gauss-Legendre sums (m, k) of each squared load over parts (m,)."""
    found = []
    for part in blocks(motion, len(low)):
        begin, length = low[part], (high - low)[part]
        time = (begin[:, None] + length[:, None] * NODES[1:-1]).ravel()
        values = loads(time, *motion.at(time)).reshape(len(begin), 3, -1)
        found.append(length[:, None] * np.einsum("j,njk->nk", WEIGHTS[1:-1], values**2))
    return np.concatenate(found)


def _settled(sums: Array) -> Array:
    """The change (k,) of a part's integral of each squared load, from all of their sums (m, k), that is too small."""
    whole = sums.sum(axis=0)
    return np.asarray(SETTLED * np.maximum(whole, NOISE * whole.max(initial=0.0) + 1e-300))


def reversal_times(motion: Motion, rough: Sequence[tuple[int, float]]) -> Array:
    """Times just before and after velocities change sign: 0.3, 1, … 100 friction widths away in speed.

    `rough` holds pairs of a velocity coordinate and the width of its friction, rad/s or m/s.
    """
    found = []
    for column, width in rough:
        speed = motion.velocity[:, column]
        for k in np.flatnonzero((speed[:-1] * speed[1:] < 0.0) & (np.diff(motion.time) > 0.0)):
            low, high = float(motion.time[k]), float(motion.time[k + 1])
            rate = (speed[k + 1] - speed[k]) / (high - low)
            zero = low - speed[k] / rate
            for factor in (0.3, 1.0, 3.0, 10.0, 30.0, 100.0):
                offset = factor * width / abs(rate)
                found += [zero - offset, zero + offset]
        found = [time for time in found if motion.time[0] < time < motion.time[-1]]
    return np.array(found, dtype=np.float64)


def blocks(motion: Motion, count: int) -> Iterator[slice]:
    """Parts of `count` states of a motion's robot that are evaluated together."""
    step = max(LEAST_BLOCK, BLOCK_NUMBERS // max(1, motion.nv))
    return (slice(first, first + step) for first in range(0, count, step))


def root_mean_square(weight: Array, rows: Array, duration: float, more: Array | float = 0.0) -> Array:
    """The RMS (k,) of rows (k, n) with weights (n,), s, over a duration, s; its rounding does not depend on BLAS, and
    squares do not overflow. `more` (k,) is added to the integrals of squares.
    """
    size = np.abs(rows).max(axis=1, initial=0.0)
    size = np.where(size > 1e100, size, 1.0)
    whole = np.add.reduce(weight * (rows / size[:, None]) ** 2, axis=1) + more / size / size
    return np.asarray(size * np.sqrt(np.maximum(whole, 0.0) / duration))
