"""The temperatures along one cycle as an affine function of those at its start, and the map over the whole cycle."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bellcrank.actuators.thermal import HeatCycle, ThermalModel
from bellcrank.actuators.thermal_interval import Kernel, Rates, extremum_times
from bellcrank.arrays import Array

FEW = 256  # motors times blocks at once: below it a call of NumPy takes the time, not its arithmetic


@dataclass(frozen=True, eq=False)
class CycleMap:
    """The map x → x + Ψ x + g of the state (winding, housing) above the ambient over one cycle, for m motors.

    Attributes:
        matrix: Ψ (2, 2, m).
        shift: g (2, m), K.
    """

    matrix: Array
    shift: Array

    @property
    def growth(self) -> Array:
        """Spectral radius of I + Ψ less 1 (m,), from the eigenvalues of Ψ without cancellation near 0."""
        (ww, wh), (hw, hh) = self.matrix
        mean, half = 0.5 * (ww + hh), 0.5 * (ww - hh)
        gap = np.sqrt(half * half + wh * hw)
        return np.asarray(np.where(mean < 0.0, (ww * hh - wh * hw) / (mean - gap), mean + gap))

    @property
    def fixed_point(self) -> Array:
        """The state (2, m) that returns to itself, -Ψ^{-1} g."""
        (ww, wh), (hw, hh) = self.matrix
        winding, housing = self.shift
        return np.asarray(np.stack([wh * housing - hh * winding, hw * winding - ww * housing]) / (ww * hh - wh * hw))

    def apply(self, state: Array) -> Array:
        """The state (2, m) a cycle later."""
        return np.asarray(state + (np.einsum("ijm,jm->im", self.matrix, state) + self.shift))

    def doubled(self) -> CycleMap:
        """The map over two cycles: Ψ becomes 2 Ψ + Ψ²."""
        squared = np.einsum("ijm,jkm->ikm", self.matrix, self.matrix)
        return CycleMap(2.0 * self.matrix + squared, self.apply(self.shift))


@dataclass(frozen=True, eq=False)
class CyclePath:
    """States of m motors at the ends of the n intervals of a cycle, for every start.

    Attributes:
        rates: The linear systems of the intervals; losses (n, m).
        basis: Temperatures (2, 3, n + 1, m) above the ambient from three starts: under the heat from the ambient, and
            without heat from 1 K of the winding and from 1 K of the housing.
        map: The map over the cycle.
    """

    rates: Rates
    basis: Array
    map: CycleMap

    @classmethod
    def of(cls, model: ThermalModel, heat: HeatCycle) -> CyclePath:
        """The path of a cycle; NaN where a figure is unknown, and not finite where numbers overflow.

        Of few motors, blocks of intervals are followed at once and joined afterwards: the state is affine in its start.
        """
        rates = model.rates(np.ascontiguousarray(heat.copper_loss.T), np.ascontiguousarray(heat.friction_loss.T))
        kernel = Kernel.of(rates, heat.duration[:, None])
        count, size = len(heat.duration), len(model.ambient)
        blocks = max(min(math.isqrt(count), FEW // max(size, 1)), 1)
        length = -(-count // blocks)

        def in_blocks(entry: Array) -> Array:
            """Entries (n, m) by their place in a block, (length, 1, blocks, m); 0 fills the last block."""
            filled = np.zeros((blocks * length, size))
            filled[:count] = entry
            return np.ascontiguousarray(filled.reshape(blocks, length, size).swapaxes(0, 1))[:, None]

        heated = np.array([1.0, 0.0, 0.0])[:, None, None]
        copper, friction, *entries = map(in_blocks, (rates.copper, rates.friction, *kernel))
        factor = heated * rates.factor
        starts = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])[..., None]
        changes = np.zeros((2, 3, length + 1, blocks, size))  # since the start of each block
        for k in range(length):
            one = rates._replace(copper=copper[k], friction=heated * friction[k], factor=factor)
            step = Kernel(*(entry[k] for entry in entries)).step(one.slope(starts[..., None] + changes[:, :, k]))
            np.add(changes[:, :, k], step, out=changes[:, :, k + 1])
        before, change = np.empty((2, 3, 1, blocks, size)), np.zeros((2, 3, size))
        for block in range(blocks):  # one after the other, each as a map
            before[:, :, 0, block] = starts + change
            change = change + _from(starts + change, changes[:, :, -1, block])
        basis = np.empty((2, 3, blocks * length + 1, size))
        basis[:, :, 0] = starts
        along = before + _from(before, changes[:, :, 1:])
        basis[:, :, 1:] = along.swapaxes(2, 3).reshape(2, 3, blocks * length, size)
        return cls(rates, basis[:, :, : count + 1], CycleMap(change[:, 1:], change[:, 0]))

    def states(self, start: Array) -> Array:
        """The states (2, n + 1, m) at the ends of the intervals from a start (2, m)."""
        return np.asarray(self.basis[:, 0] + self.basis[:, 1] * start[0] + self.basis[:, 2] * start[1])

    def highest(self, start: Array) -> Array:
        """The largest temperatures (2, n, m) above the ambient over each interval, inside it too, from a start (2, m).

        Inside an interval a temperature has at most one extremum, because its slope is a sum of two exponentials: a
        largest value exactly where the slope is positive at the start and negative at the end.
        """
        states = self.states(start)
        slope = self.rates.slope(states[:, :-1])
        turns = (slope > 0.0) & (self.rates.slope(states[:, 1:]) < 0.0)
        highest = np.maximum(states[:, :-1], states[:, 1:])
        for body in (0, 1):
            interval, motor = np.nonzero(turns[body])
            if len(interval):
                rates, rise = self.rates.taken(interval, motor), slope[:, interval, motor]
                top = (
                    states[body, interval, motor] + Kernel.of(rates, extremum_times(rates, rise)[body]).step(rise)[body]
                )
                highest[body, interval, motor] = np.fmax(highest[body, interval, motor], top)
        return np.asarray(highest)


def _from(states: Array, changes: Array) -> Array:
    """The changes (2, 3, ...) from three states, the first of them heated, by the changes (2, 3, ...) of the basis."""
    moved = changes[:, None, 1] * states[0] + changes[:, None, 2] * states[1]
    moved[:, 0] += changes[:, 0]
    return np.asarray(moved)
