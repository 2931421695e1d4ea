"""Temperatures of a cycle that repeats for ever: the fixed point of the cycle's affine map, its peaks, and runaway.

Over one cycle the temperatures above the ambient change by x → Φ x + g. Φ has positive entries, because heat raises
temperatures, so its largest eigenvalue is real, and it is the spectral radius ρ. For ρ < 1 every start ends in the
periodic state x* = (I - Φ)^{-1} g; for ρ >= 1 the temperatures rise without end: thermal runaway. Ψ = Φ - I is computed
without a difference, so that ρ - 1 and x* are accurate for cycles that are short against the time constants.

From the ambient temperature each cycle is warmer than the one before at each of its moments (Φ and g have no negative
entries). Hence the cycle in which a limit is first reached is found by bisection over powers of the map.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.electrical import resistance_factor
from bellcrank.actuators.product_arrays import Array
from bellcrank.actuators.thermal import HeatCycle, Kernel, Rates, ThermalModel

CHUNK = 4096  # motors at a time, and
KEPT = 2**20  # motors times intervals at a time, whose matrices are kept in memory
BLOCK = 16384  # entries of an array at a time: they stay in the processor's cache
MOST_DOUBLINGS = 62  # of the cycle's map: more cycles than that would take longer than the age of the universe

Interval = tuple[Rates, Kernel]


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
    def runaway(self) -> NDArray[np.bool_]:
        """Whether the temperatures rise without end (m,); False where unknown."""
        return np.asarray(self.growth >= 0.0)

    @property
    def spectral_radius(self) -> Array:
        """Of the cycle's map (m,)."""
        return 1.0 + self.growth


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
        largest = np.where(mean < 0.0, (ww * hh - wh * hw) / (mean - gap), mean + gap)
        overflows = np.isnan(largest) & ~np.isnan(self.shift[0])
        return np.where(overflows, np.inf, largest)

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


def intervals(model: ThermalModel, heat: HeatCycle) -> list[Interval]:
    """The system and K of every interval, in their order, computed in blocks that stay in the processor's cache."""
    copper, friction = (np.ascontiguousarray(loss.T) for loss in (heat.copper_loss, heat.friction_loss))
    count, found = max(BLOCK // max(copper.shape[1], 1), 1), []
    for first in range(0, len(copper), count):
        part = slice(first, first + count)
        with np.errstate(all="ignore"):
            rates = Rates.of(model, copper[part], friction[part])
            kernel = Kernel.of(rates, heat.duration[part, None])
        found += [
            (
                rates._replace(copper=rates.copper[k], friction=rates.friction[k]),
                Kernel(*(entry[k] for entry in kernel)),
            )
            for k in range(len(rates.copper))
        ]
    return found


def cycle_map(model: ThermalModel, steps: list[Interval]) -> CycleMap:
    """The map of the temperatures over one cycle.

    Args:
        model: Models of m motors.
        steps: `intervals` of the cycle.

    Returns:
        The map; NaN where a figure is unknown.
    """
    # Three states at once: from the ambient under the heat, and unit changes of winding and housing without it.
    changes = np.zeros((2, 3, len(model.ambient)))
    start = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])[..., None]
    heated = np.array([1.0, 0.0, 0.0])[:, None]
    factor = heated * resistance_factor(model.ambient)
    with np.errstate(all="ignore"):
        for rates, kernel in steps:
            rates = rates._replace(factor=factor, friction=heated * rates.friction)
            changes += kernel.step(rates.slope(start + changes))
    return CycleMap(changes[:, 1:], changes[:, 0])


def periodic_temperatures(model: ThermalModel, heat: HeatCycle) -> PeriodicTemperatures:
    """The temperatures of a cycle that repeats for ever.

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
    count = min(CHUNK, max(KEPT // len(heat.duration), 1))
    parts = [slice(first, first + count) for first in range(0, size, count)] or [slice(0, 0)]
    found = [_periodic(model[part], heat[part]) for part in parts]
    return PeriodicTemperatures(
        **{
            field.name: np.concatenate([getattr(one, field.name) for one in found])
            for field in fields(PeriodicTemperatures)
        }
    )


def _periodic(model: ThermalModel, heat: HeatCycle) -> PeriodicTemperatures:
    steps = intervals(model, heat)
    with np.errstate(all="ignore"):
        over_cycle = cycle_map(model, steps)
        growth = over_cycle.growth
        settles = growth < 0.0
        start = np.where(settles, over_cycle.fixed_point, np.nan)
        rises = np.where(growth >= 0.0, np.inf, np.concatenate([start, peak_rise(steps, start)]))
    return PeriodicTemperatures(
        **dict(
            zip(("winding_start", "housing_start", "winding_peak", "housing_peak"), model.ambient + rises, strict=True)
        ),
        growth=growth,
    )


def peak_rise(steps: list[Interval], state: Array) -> Array:
    """The largest temperatures above the ambient over one cycle, inside its intervals too.

    Inside an interval a temperature has at most one extremum, because its slope is a sum of two exponentials: a largest
    value exactly where the slope is positive at the start and negative at the end.

    Args:
        steps: `intervals` of the cycle.
        state: Winding and housing above the ambient at the start (2, m), K.

    Returns:
        The largest of winding and housing (2, m), K.
    """
    peak = state.copy()
    with np.errstate(all="ignore"):
        for rates, kernel in steps:
            slope = rates.slope(state)
            end = state + kernel.step(slope)
            np.maximum(peak, end, out=peak)
            inside = (slope > 0.0) & (rates.slope(end) < 0.0)
            which = np.flatnonzero(inside.any(axis=0))
            if len(which):
                top = _extrema(rates.taken(which), kernel.taken(which), state[:, which], slope[:, which])
                peak[:, which] = np.where(inside[:, which], np.maximum(peak[:, which], top), peak[:, which])
            state = end
    return peak


def extremum_times(kernel: Kernel, rates: Rates, slope: Array) -> Array:
    """When the slopes of winding and housing are zero: tanh(s t) = -s x'(0) / (M x'(0)), (2, m), s."""
    winding = kernel.half_difference * slope[0] + rates.winding * slope[1]
    housing = rates.exchange * slope[0] - kernel.half_difference * slope[1]
    with np.errstate(all="ignore"):
        times = np.arctanh(-kernel.half_gap * slope / np.stack([winding, housing])) / kernel.half_gap
    return np.asarray(times)


def _extrema(rates: Rates, kernel: Kernel, state: Array, slope: Array) -> Array:
    """The extreme values of winding and housing where their slopes are zero."""
    times = extremum_times(kernel, rates, slope)
    return np.asarray(state + np.stack([Kernel.of(rates, times[body]).step(slope)[body] for body in (0, 1)]))
