"""The states of many designs along a motion: those of one motion that all share, or motions of their own.

Between two waypoints the spline (motion/generators/waypoints.py) is the quintic of its values and first two derivatives
there. The grid of a design is divided at its own reversals, and as that of the scene's motion where torques change fast
there. Its integrals are compared with those of Simpson's rule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from bellcrank.arrays import Array, Indices, Mask
from bellcrank.cached_values import cached_property
from bellcrank.motion.generators.waypoints import interpolate
from bellcrank.motion.motion import Motion
from bellcrank.motion.sampled.quintic_splines import quintic, quintic_powers
from bellcrank.robot.model.joints import JointLike
from bellcrank.sizing.loads.motion_grid import BISECTIONS, FINEST, NODES, STILL, WEIGHTS, Grid, Sides, divided
from bellcrank.sizing.loads.series_maxima import MaximaSearch

Whole = Indices
States = tuple[Array, Array, Array]  # q, v, a
SIMPSON = np.array([1.0, 0.0, 4.0, 0.0, 1.0]) / 6.0  # at NODES
PARTS = 16  # between two waypoints, at least: torques change there as fast as the spline
FINE = 0.25  # of a motion's longest parts: shorter ones of the scene's grid, where torques change fast, are kept
# Of an integral: by how much Simpson's rule may be off. Its error is of order 4, that of the grid's rule of order 6:
# where the former is 1e-6, the latter is about 1e-9.
SETTLED = 1e-6


class MotionStates(Protocol):
    """The states of designs. Times are those of one motion, on whose time each takes a factor, or of motions of their
    own (sizing/loads/design_states.py). Speeds are one-sided (sizing/loads/motion_grid.py).
    """

    @property
    def duration(self) -> Array:
        """The durations (n,), s."""

    def on_grid(self, design: int) -> Grid:
        """The points along the motion of a design, with its states."""

    def between(self, designs: Whole, times: Array) -> States:
        """The states (m, …) of some designs (m,) at times (m,)."""


@dataclass(frozen=True, eq=False)
class SharedStates:
    """One motion of all designs, with its grid; `stretch` (n,) are the factors on its time."""

    motion: Motion
    grid: Grid
    stretch: Array

    @property
    def duration(self) -> Array:
        """As in MotionStates."""
        return self.stretch * self.motion.duration

    def on_grid(self, design: int) -> Grid:
        """As in MotionStates."""
        stretch, grid = self.stretch[design], self.grid
        return replace(grid, velocity=grid.velocity / stretch, acceleration=grid.acceleration / stretch**2)

    def between(self, designs: Whole, times: Array) -> States:
        """The states at times."""
        q, v, a = self.grid.at(self.motion, times)
        stretch = self.stretch[designs, None]
        return q, v / stretch, a / stretch**2


@dataclass(frozen=True, eq=False, kw_only=True)
class OwnStates:
    """Motions of several designs with rows at the times of one motion, whose joints all have one degree of freedom.

    Attributes:
        motion: The motion, with its grid.
        grid: Points along it.
        position: Positions (d, n, nq) at its rows.
        velocity: Velocities (d, n, nv).
        acceleration: Accelerations (d, n, nv).
        stretch: The factors (d,) on its time.
    """

    motion: Motion
    grid: Grid
    position: Array
    velocity: Array
    acceleration: Array
    stretch: Array
    _sides: dict[int, Sides] = field(default_factory=dict, init=False, repr=False)

    @property
    def duration(self) -> Array:
        """As in MotionStates."""
        return self.stretch * self.motion.duration

    @cached_property
    def _rows(self) -> tuple[Whole, Whole, Whole]:
        """The interval of each point of the grid, and which points are rows, with the numbers of the rows.

        At a jump the row is the one whose acceleration the grid has.
        """
        time, grid = self.motion.time, self.grid
        step = np.clip(np.searchsorted(time, grid.time, side="right") - 1, 0, len(time) - 2)
        row = np.searchsorted(time, grid.time)
        row = np.clip(row, 0, len(time) - 1)
        other = np.minimum(row + 1, len(time) - 1)
        takes_other = (time[other] == grid.time) & (self.motion.acceleration[row] != grid.acceleration).any(axis=1)
        row = np.where(takes_other, other, row)
        points = np.flatnonzero(time[row] == grid.time)
        return step, points, row[points]

    def on_grid(self, design: int) -> Grid:
        """As in MotionStates."""
        step, points, rows = self._rows
        own = self.position[design], self.velocity[design], self.acceleration[design]
        found = quintic(self.motion.time, *own, self.grid.time, step)
        for values, exact in zip(found, own, strict=True):
            values[points] = exact[rows]
        first = np.flatnonzero(np.diff(self.grid.part, prepend=-1))
        sides = Sides.of(float(self.motion.time[0]), self.grid.sides.end, first, found[1])
        self._sides[design] = sides
        moves = np.any(self.grid.velocity, axis=1, keepdims=True) | np.any(
            self.grid.acceleration, axis=1, keepdims=True
        )
        stretch = self.stretch[design]
        velocity = sides.of_velocity(self.grid.force_time, found[1])
        return replace(
            self.grid,
            position=found[0],
            velocity=moves * velocity / stretch,
            acceleration=moves * found[2] / stretch**2,
        )

    def between(self, designs: Whole, times: Array) -> States:
        """The states at times."""
        time, count = self.motion.time, len(self.motion.time)
        step = np.clip(np.searchsorted(time, times, side="right") - 1, 0, count - 2)
        many = [each.reshape(-1, each.shape[2]) for each in (self.position, self.velocity, self.acceleration)]
        place = designs * count + step
        q, v, a = quintic_at(time[step], time[step + 1], many, times, place)
        slow = np.asarray(np.abs(v) <= STILL).any(axis=1)
        for design in np.unique(designs[slow]):
            here = designs == design
            if design not in self._sides:
                self.on_grid(int(design))
            v[here] = self._sides[int(design)].of_velocity(times[here], v[here])
        stretch = self.stretch[designs, None]
        return q, v / stretch, a / stretch**2


def quintic_at(low: Array, high: Array, values: list[Array], times: Array, place: Whole) -> States:
    """The quintics (m, k) between rows `place` and `place` + 1 of values, first and second derivatives (n, k)."""
    knots = np.stack([low, high], axis=1).ravel()
    both = np.stack([place, place + 1], axis=1).ravel()
    return quintic(knots, values[0][both], values[1][both], values[2][both], times, 2 * np.arange(len(times)))


@dataclass(frozen=True, eq=False)
class OwnGrid(Grid):
    """A grid with the weights (n,), s, of Simpson's rule at its points."""

    simpson: Array

    def settled(self, rows: Array) -> bool:
        """Whether both rules give the same integrals of the squares of rows (k, n)."""
        sums, others = (np.add.reduce(weight * rows**2, axis=1) for weight in (self.weight, self.simpson))
        return bool((np.abs(sums - others) <= SETTLED * np.maximum(sums, 1e-6 * sums.max(initial=0.0))).all())


class WaypointStates:
    """Designs (d) of a motion from rest to rest of joints that all have one degree of freedom (MotionStates).

    Args:
        joints: The joints.
        base: A grid of the scene's motion.
        waypoints: Its times (k,), s.
        knots: The times (d, k) of designs, s.
        points: Their postures (d, k, n).
        factor: The factors (d,) on these times.
        losses: Whether gears lose power: where it changes its direction, integrals need all parts of the base.
    """

    def __init__(
        self,
        joints: Sequence[JointLike],
        base: Grid,
        waypoints: Array,
        knots: Array,
        points: Array,
        factor: Array,
        losses: bool,
    ) -> None:
        rows = [np.empty(points.shape) for _ in range(3)]
        for d in range(len(knots)):
            for whole, own in zip(rows, interpolate(joints, knots[d], points[d], knots[d], rest=True), strict=True):
                whole[d] = own
        for order in (1, 2):
            rows[order] /= factor[:, None, None] ** order
        # `steps` (d, k − 1) are the times from each waypoint to the next, s.
        self.knots = knots[:, :1] + factor[:, None] * (knots - knots[:, :1])
        self.steps = np.diff(self.knots, axis=1)
        q, v, a = rows
        h = self.steps[:, :, None]
        begin, end = ((h * v[:, part], h * h * a[:, part]) for part in (slice(-1), slice(1, None)))
        powers = quintic_powers(q[:, :-1], np.diff(q, axis=1), begin, end)
        self._powers = np.stack(powers).reshape(6, -1, points.shape[2])
        length = np.diff(base.sides.end, prepend=waypoints[0])
        fine = losses | (length < FINE / FINEST * (waypoints[-1] - waypoints[0]))
        between = waypoints[:-1, None] + np.diff(waypoints)[:, None] * np.arange(PARTS) / PARTS
        given = [between.ravel(), waypoints, base.sides.end[fine], (base.sides.end - length)[fine]]
        self._base = np.unique(np.concatenate(given)), waypoints
        self._grids: dict[int, OwnGrid] = {}

    @property
    def duration(self) -> Array:
        """As in MotionStates."""
        return np.asarray(self.knots[:, -1] - self.knots[:, 0])

    # ---- grids

    @cached_property
    def _edges(self) -> list[tuple[Array, Mask]]:
        return self._with_reversals([self._mapped(own) for own in self.knots])

    def _mapped(self, own: Array) -> Array:
        """Edges (m,) of parts at a design's times of the waypoints."""
        found = np.interp(*self._base, own)
        return np.append(divided(found[:-1], np.diff(found), float(own[-1] - own[0])), own[-1])

    def _with_reversals(self, each: list[Array]) -> list[tuple[Array, Mask]]:
        """Edges of each design, and which of them are reversals, or ends of rest."""
        design = np.repeat(np.arange(len(each)), list(map(len, each)))
        time = np.concatenate(each)
        speed = self._at(design, time)[1]
        speed[np.abs(speed) <= STILL] = 0.0
        inner = (design[1:-1] == design[:-2]) & (design[1:-1] == design[2:])
        stop = (speed[1:-1] == 0.0) & ((speed[:-2] != 0.0) | (speed[2:] != 0.0))
        stops = np.flatnonzero(inner & stop.any(axis=1)) + 1
        row, column = np.nonzero((speed[:-1] * speed[1:] < 0.0) & (design[1:] == design[:-1])[:, None])
        low, high, of = time[row].copy(), time[row + 1].copy(), design[row]
        for _ in range(BISECTIONS if row.size else 0):
            middle = 0.5 * (low + high)
            before = self._at(of, middle)[1][np.arange(len(row)), column] * speed[row, column] > 0.0
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        found = []
        for d, edges in enumerate(each):
            kinks = np.concatenate([low[of == d], time[stops[design[stops] == d]]])
            whole = np.unique(np.concatenate([edges, kinks]))
            found.append((whole, np.isin(whole, kinks)))
        return found

    def _grid(self, d: int) -> OwnGrid:
        """The grid of a design, with points of weight 0 at rest before and after the motion."""
        edges, kinks = self._edges[d]
        low, length, size = edges[:-1], np.diff(edges), len(NODES)
        time = (low[:, None] + length[:, None] * NODES).ravel()
        time[size - 1 :: size] = edges[1:]
        force_time = time.copy()
        force_time[size - 1 :: size] = np.nextafter(edges[1:], -np.inf)
        weight, simpson = ((length[:, None] * each).ravel() for each in (WEIGHTS, SIMPSON))
        part = np.repeat(np.arange(len(low)), size)
        smooth = np.flatnonzero(~kinks[1:-1]) * size + size  # both sides of an edge without a reversal are alike
        simpson[smooth - 1] += simpson[smooth]
        keep = np.delete(np.arange(len(time)), smooth)
        q, v, a = self._at(d, time[keep])
        sides = Sides.of(float(edges[0]), edges[1:], np.flatnonzero(np.diff(part[keep], prepend=-1)), v)
        v = sides.of_velocity(force_time[keep], v)
        rest = np.arange(-1, len(keep) + 1).clip(0, len(keep) - 1)  # one more point at both ends
        keep, moves = keep[rest], np.ones(len(rest))
        moves[[0, -1]] = 0.0
        return OwnGrid(
            time=time[keep],
            force_time=force_time[keep],
            position=q[rest],
            velocity=moves[:, None] * v[rest],
            acceleration=moves[:, None] * a[rest],
            weight=moves * weight[keep],
            part=part[keep],
            sides=sides,
            simpson=moves * simpson[keep],
        )

    def on_grid(self, design: int) -> Grid:
        """As in MotionStates."""
        if design not in self._grids:
            self._grids[design] = self._grid(design)
        return self._grids[design]

    # ---- states

    def _at(self, designs: Whole | int, times: Array) -> States:
        """The states at times (m,) of designs (m,), or of one."""
        return self.at_places(designs, *self.places(designs, times))

    def places(self, designs: Whole | int, times: Array) -> tuple[Whole, Array]:
        """The waypoints (m,) before times (m,) of designs (m,), or of one, and the shares of the way to the next."""
        step = (times[:, None] >= self.knots[designs, 1:-1]).sum(axis=1)
        return step, (times - self.knots[designs, step]) / self.steps[designs, step]

    def at_places(self, designs: Whole | int, step: Whole, share: Array) -> States:
        """The states at places (m,) of designs (m,), or of one."""
        h, s = self.steps[designs, step][:, None], share[:, None]
        c0, c1, c2, c3, c4, c5 = self._powers[:, designs * self.steps.shape[1] + step]
        q = c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))))
        v = c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
        a = 2.0 * c2 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))
        return q, v / h, a / (h * h)

    def between(self, designs: Whole, times: Array) -> States:
        """As in MotionStates."""
        q, v, a = self._at(designs, times)
        slow = np.asarray(np.abs(v) <= STILL).any(axis=1)
        for design in np.unique(designs[slow]):
            here = designs == design
            v[here] = self.on_grid(int(design)).sides.of_velocity(times[here], v[here])
        return q, v, a

    def extremes(self, q: Sequence[int], v: Sequence[int]) -> dict[str, Array]:
        """Of coordinates q (k) and v (k) of each design (d, k): peak |speed|, highest position, lowest times −1."""
        count, k = len(self.knots), len(v)
        search = MaximaSearch(count, 3 * k)
        for d in range(count):
            grid = self.on_grid(d)
            table = np.concatenate([np.abs(grid.velocity[:, v]), grid.position[:, q], -grid.position[:, q]], axis=1).T
            search.add(d, grid.time, np.ascontiguousarray(table))

        def values(designs: Whole, series: Whole, times: Array) -> Array:
            position, velocity, _ = self._at(designs, times)
            kind, place = np.divmod(series, k)
            here, each = np.arange(len(times)), np.array([1.0, 1.0, -1.0])[kind]
            speed, value = np.abs(velocity[here, np.array(v)[place]]), each * position[here, np.array(q)[place]]
            return np.asarray(np.where(kind == 0, speed, value))

        largest = search.largest(values).value
        return dict(zip(("peak", "highest", "lowest"), largest.reshape(count, 3, k).transpose(1, 0, 2), strict=True))
