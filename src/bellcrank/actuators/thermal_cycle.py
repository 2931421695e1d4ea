"""Temperatures of a cycle that repeats indefinitely: the fixed point of the cycle's affine map, its peaks, and runaway.

Over one cycle the temperatures above the ambient change by x → Φ x + g. Φ has positive entries, because heat raises
temperatures, so its largest eigenvalue is real, and it is the spectral radius ρ. For ρ < 1 every start ends in the
periodic state x* = (I - Φ)^{-1} g; for ρ >= 1 the temperatures rise without end: thermal runaway. Ψ = Φ - I is computed
without a difference, so that ρ - 1 and x* are accurate for cycles that are short against the time constants.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from bellcrank.actuators.thermal import HeatCycle, Kernel, Rates, ThermalModel, extremum_times
from bellcrank.arrays import Array, Mask

FEW = 256  # motors times blocks at once: below it a call of NumPy takes the time, not its arithmetic
CHUNK = 2**18  # motors times intervals at a time: about 50 MB of arrays
HALVINGS = 80  # of the time inside an interval
MOST_DOUBLINGS = 62  # of the cycle's map: more cycles would take longer than the age of the universe


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


@dataclass(frozen=True, kw_only=True, eq=False)
class PeriodicTemperatures:
    """Temperatures of m motors in the periodic state, °C; infinite on thermal runaway, NaN where unknown.

    Attributes:
        winding_start: Of the winding at the start of the cycle (m,).
        housing_start: Of the housing at the start of the cycle (m,).
        winding_peak: Largest of the winding over the cycle (m,), inside intervals too.
        housing_peak: Largest of the housing over the cycle (m,).
        growth: Spectral radius of the cycle's map less 1 (m,): below 0 the cycle settles.
    """

    winding_start: Array
    housing_start: Array
    winding_peak: Array
    housing_peak: Array
    growth: Array

    @property
    def runaway(self) -> Mask:
        """Whether the temperatures rise without end (m,); False where unknown."""
        return np.asarray(self.growth >= 0.0)

    @property
    def spectral_radius(self) -> Array:
        """Of the cycle's map (m,)."""
        return 1.0 + self.growth


def periodic_temperatures(model: ThermalModel, heat: HeatCycle) -> PeriodicTemperatures:
    """The temperatures of a cycle that repeats indefinitely.

    Args:
        model: Models of m motors.
        heat: Losses of the m motors over the cycle.

    Returns:
        Peaks and start of the periodic state; NaN where a figure is unknown.

    Example:
        >>> import numpy as np
        >>> from bellcrank.actuators.thermal import HeatCycle, ThermalModel
        >>> from bellcrank.actuators.thermal_cycle import periodic_temperatures
        >>> one = np.ones(1)
        >>> model = ThermalModel(winding_capacity=5.568 * one, housing_capacity=108.036 * one,
        ...                      winding_resistance=0.74 * one, housing_resistance=8.96 * one,
        ...                      friction_share=one, ambient=25.0 * one)
        >>> on_and_off = HeatCycle(duration=np.array([30.0, 30.0]), copper_loss=np.array([[110.4, 0.0]]),
        ...                        friction_loss=np.zeros((1, 2)))
        >>> bool(periodic_temperatures(model, on_and_off).runaway[0])
        True
    """
    size = len(heat.copper_loss)
    count = max(CHUNK // len(heat.duration), 1)
    parts = [slice(first, first + count) for first in range(0, size, count)] or [slice(0, 0)]
    found = [_periodic(model[part], heat[part]) for part in parts]
    return PeriodicTemperatures(
        **{
            field.name: np.concatenate([getattr(one, field.name) for one in found])
            for field in fields(PeriodicTemperatures)
        }
    )


def _periodic(model: ThermalModel, heat: HeatCycle) -> PeriodicTemperatures:
    with np.errstate(all="ignore"):
        path = CyclePath.of(model, heat)
        growth = np.where(_known(model, heat) & np.isnan(path.map.growth), np.inf, path.map.growth)  # overflow
        settles = growth < 0.0
        start = np.where(settles, path.map.fixed_point, np.nan)
        rises = np.where(growth >= 0.0, np.inf, np.concatenate([start, path.highest(start).max(axis=1)]))
    return PeriodicTemperatures(
        **dict(
            zip(("winding_start", "housing_start", "winding_peak", "housing_peak"), model.ambient + rises, strict=True)
        ),
        growth=growth,
    )


def _known(model: ThermalModel, heat: HeatCycle) -> Mask:
    """Whether all figures of a motor (m,) and its losses are known."""
    figures = sum(getattr(model, field.name) for field in fields(model))
    return np.asarray(~np.isnan(figures + heat.copper_loss.sum(axis=1) + heat.friction_loss.sum(axis=1)))


# ---- The time from the ambient temperature until the winding reaches a limit, over a cycle that repeats.
#
# From the ambient temperature each cycle is warmer than the one before at each of its moments, because its map has no
# negative entries. Hence the cycle in which a limit is first reached is found by bisection over powers of the map.


def time_to_limit(model: ThermalModel, heat: HeatCycle, limit: Array) -> Array:
    """The time from the ambient temperature until the winding first reaches a limit, exact inside the interval.

    Args:
        model: Models of m motors.
        heat: Losses of the m motors over the cycle, which repeats.
        limit: Winding temperature (m,), °C.

    Returns:
        Times (m,), s: 0 where the ambient is not below the limit, infinite where it is never reached, NaN unknown.

    Example:
        >>> import numpy as np
        >>> from bellcrank.actuators.thermal import HeatCycle, ThermalModel
        >>> from bellcrank.actuators.thermal_cycle import time_to_limit
        >>> one = np.ones(1)
        >>> model = ThermalModel(winding_capacity=5.568 * one, housing_capacity=108.036 * one,
        ...                      winding_resistance=0.74 * one, housing_resistance=8.96 * one,
        ...                      friction_share=one, ambient=25.0 * one)
        >>> on_and_off = HeatCycle(duration=np.array([30.0, 30.0]), copper_loss=np.array([[110.4, 0.0]]),
        ...                        friction_loss=np.zeros((1, 2)))
        >>> round(float(time_to_limit(model, on_and_off, 130.0 * one)[0]), 1)
        10.7
    """
    rise = np.asarray(limit - model.ambient)
    settled = periodic_temperatures(model, heat)
    with np.errstate(invalid="ignore"):
        reached = np.flatnonzero((settled.winding_peak > limit) & (rise > 0.0))
    time = np.where(np.isnan(settled.winding_peak + rise), np.nan, np.where(rise <= 0.0, 0.0, np.inf))
    if len(reached):
        with np.errstate(all="ignore"):
            path = CyclePath.of(model[reached], heat[reached])
            cycles, start = _cycles_below(path, rise[reached])
            time[reached] = cycles * heat.period + _time_in_cycle(path, heat.duration, start, rise[reached])
    return time


def _cycles_below(path: CyclePath, rise: Array) -> tuple[Array, Array]:
    """The number (m,) of cycles before that in which a rise is first reached, and the state (2, m) at its start.

    Peaks grow from cycle to cycle, so the number is found bit by bit.
    """

    def below(start: Array) -> Mask:
        return np.asarray(path.highest(start)[0].max(axis=0) < rise)  # overflow is not below

    cycles, start = np.zeros_like(rise), np.zeros((2, len(rise)))
    some = below(start)  # the limit is not reached in the first cycle
    powers = [path.map]
    while len(powers) < MOST_DOUBLINGS and below(powers[-1].shift).any():
        powers.append(powers[-1].doubled())
    for exponent in reversed(range(len(powers))):
        later = powers[exponent].apply(start)
        still = below(later)
        start, cycles = np.where(still, later, start), cycles + np.where(still, 2.0**exponent, 0.0)
    return np.where(some, cycles + 1.0, 0.0), np.where(some, path.map.apply(start), 0.0)


def _time_in_cycle(path: CyclePath, durations: Array, start: Array, rise: Array) -> Array:
    """When the winding first reaches a rise in a cycle that starts from a state (2, m), s after the cycle's start."""
    reached = ~(path.highest(start)[0] < rise)  # overflow is not below
    interval, motor = np.argmax(reached, axis=0), np.arange(len(rise))
    rates = path.rates.taken(interval, motor)
    state = path.states(start)[:, interval, motor]
    slope, duration = rates.slope(state), durations[interval]
    top = extremum_times(rates, slope)[0]
    low = np.zeros_like(rise)
    high = np.where((slope[0] > 0.0) & (top > 0.0) & (top < duration), top, duration)  # of the highest temperature
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        below = state[0] + Kernel.of(rates, middle).step(slope)[0] < rise
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    before = np.concatenate([[0.0], np.cumsum(durations)])[interval]
    return np.where(reached.any(axis=0), before + high, np.inf)
