"""The states of many designs along a motion: those of one motion that all share, or motions of their own."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from bellcrank.arrays import Array, Indices
from bellcrank.cached_values import cached_property
from bellcrank.motion.motion import Motion
from bellcrank.motion.sampled.hermite import quintic
from bellcrank.sizing.loads.motion_grid import Grid
from bellcrank.sizing.loads.one_sided_limits import STILL, Sides

Whole = Indices
States = tuple[Array, Array, Array]  # q, v, a


class MotionStates(Protocol):
    """The states of designs. Times are those of one motion, on whose time each takes a factor, or of motions of their
    own (sizing/loads/waypoint_states.py). Speeds are one-sided (sizing/loads/one_sided_limits.py).
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
