"""Temperatures of a cycle that repeats for ever: the fixed point of the cycle's affine map, its peaks, and runaway.

Over one cycle the temperatures above the ambient change by x → Φ x + g. Φ has positive entries, because heat raises
temperatures, so its largest eigenvalue is real, and it is the spectral radius ρ. For ρ < 1 every start ends in the
periodic state x* = (I - Φ)^{-1} g; for ρ >= 1 the temperatures rise without end: thermal runaway. Ψ = Φ - I is computed
without a difference, so that ρ - 1 and x* are accurate for cycles that are short against the time constants.

From the ambient temperature each cycle is warmer than the one before at each of its moments (Φ and g have no negative
entries). Hence the cycle in which a limit is first reached is found by bisection over powers of the map.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.electrical import resistance_factor
from bellcrank.actuators.product_arrays import Array
from bellcrank.actuators.thermal import HeatCycle, Kernel, Rates, ThermalModel

CHUNK = 4096  # motors at a time, and
BLOCK = 16384  # entries of an array at a time: they stay in the processor's cache
MOST_DOUBLINGS = 62  # of the cycle's map: more cycles than that would take longer than the age of the universe


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


@dataclass(frozen=True, kw_only=True, eq=False)
class CycleMap:
    """The map x → x + Ψ x + g of the temperatures (winding, housing) above the ambient over one cycle, (m,) each.

    Attributes:
        ww: Entry of Ψ: winding on winding.
        wh: Housing on winding.
        hw: Winding on housing.
        hh: Housing on housing.
        winding: Entry of g, K.
        housing: Entry of g, K.
    """

    ww: Array
    wh: Array
    hw: Array
    hh: Array
    winding: Array
    housing: Array

    def __getitem__(self, index: Any) -> Self:
        return type(self)(**{field.name: getattr(self, field.name)[index] for field in fields(self)})

    @property
    def growth(self) -> Array:
        """Spectral radius of I + Ψ less 1, from the eigenvalues of Ψ without cancellation near 0."""
        mean, half = 0.5 * (self.ww + self.hh), 0.5 * (self.ww - self.hh)
        gap = np.sqrt(half * half + self.wh * self.hw)
        largest = np.where(mean < 0.0, self._determinant / (mean - gap), mean + gap)
        return np.where(~np.isnan(self.winding) & np.isnan(largest), np.inf, largest)

    @property
    def fixed_point(self) -> tuple[Array, Array]:
        """The temperatures above the ambient that return to themselves, -Ψ^{-1} g."""
        determinant = self._determinant
        return (
            (self.wh * self.housing - self.hh * self.winding) / determinant,
            (self.hw * self.winding - self.ww * self.housing) / determinant,
        )

    @property
    def _determinant(self) -> Array:
        return self.ww * self.hh - self.wh * self.hw

    def apply(self, winding: Array, housing: Array) -> tuple[Array, Array]:
        """Temperatures above the ambient a cycle later."""
        return (
            winding + (self.ww * winding + self.wh * housing + self.winding),
            housing + (self.hw * winding + self.hh * housing + self.housing),
        )

    def doubled(self) -> CycleMap:
        """The map over two cycles: Ψ becomes 2 Ψ + Ψ²."""
        winding, housing = self.apply(self.winding, self.housing)
        both = 2.0 + self.ww + self.hh
        return CycleMap(
            ww=self.ww * (2.0 + self.ww) + self.wh * self.hw,
            wh=self.wh * both,
            hw=self.hw * both,
            hh=self.hh * (2.0 + self.hh) + self.wh * self.hw,
            winding=winding,
            housing=housing,
        )


def intervals(model: ThermalModel, heat: HeatCycle) -> Iterator[tuple[Rates, Kernel]]:
    """The system and K of every interval, in their order, computed in blocks that stay in the processor's cache."""
    count = max(BLOCK // max(len(heat.copper_loss), 1), 1)
    for first in range(0, len(heat.duration), count):
        part = slice(first, first + count)
        copper, friction = (np.ascontiguousarray(loss[:, part].T) for loss in (heat.copper_loss, heat.friction_loss))
        rates = Rates.of(model, copper, friction)
        kernel = Kernel.of(rates, heat.duration[part, None])
        for k in range(len(copper)):
            yield (
                rates._replace(copper=rates.copper[k], friction=rates.friction[k]),
                Kernel(*(entry[k] for entry in kernel)),
            )


def cycle_map(model: ThermalModel, heat: HeatCycle) -> CycleMap:
    """The map of the temperatures over one cycle.

    Args:
        model: Models of m motors.
        heat: Losses of the m motors over the cycle.

    Returns:
        The map; NaN where a figure is unknown.
    """
    # Three states at once: from the ambient under the heat, and unit changes of winding and housing without it.
    changes = np.zeros((2, 3, len(heat.copper_loss)))
    start = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])[..., None]
    heated = np.array([1.0, 0.0, 0.0])[:, None]
    factor = heated * resistance_factor(model.ambient)
    with np.errstate(all="ignore"):
        for rates, kernel in intervals(model, heat):
            rates = rates._replace(factor=factor, friction=heated * rates.friction)
            winding, housing = kernel.step(rates.slope(*(start + changes)))
            changes[0] += winding
            changes[1] += housing
    (g_w, ww, wh), (g_h, hw, hh) = changes
    return CycleMap(ww=ww, wh=wh, hw=hw, hh=hh, winding=g_w, housing=g_h)


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
        ...                      winding_resistance=0.74 * one, housing_resistance=8.96 * one, ambient=25.0 * one)
        >>> on_and_off = HeatCycle(duration=np.array([30.0, 30.0]), copper_loss=np.array([[110.4, 0.0]]),
        ...                        friction_loss=np.zeros((1, 2)))
        >>> bool(periodic_temperatures(model, on_and_off).runaway[0])
        True
    """
    size = len(heat.copper_loss)
    parts = [slice(first, first + CHUNK) for first in range(0, size, CHUNK)] or [slice(0, 0)]
    found = [_periodic(model[part], heat[part]) for part in parts]
    return PeriodicTemperatures(
        **{
            field.name: np.concatenate([getattr(one, field.name) for one in found])
            for field in fields(PeriodicTemperatures)
        }
    )


def _periodic(model: ThermalModel, heat: HeatCycle) -> PeriodicTemperatures:
    with np.errstate(all="ignore"):
        over_cycle = cycle_map(model, heat)
        growth = over_cycle.growth
        settles = growth < 0.0
        winding, housing = (np.where(settles, value, np.nan) for value in over_cycle.fixed_point)
        peaks = peak_rise(model, heat, winding, housing)
    rises = [np.where(growth >= 0.0, np.inf, value) for value in (winding, housing, *peaks)]
    return PeriodicTemperatures(
        winding_start=model.ambient + rises[0],
        housing_start=model.ambient + rises[1],
        winding_peak=model.ambient + rises[2],
        housing_peak=model.ambient + rises[3],
        growth=growth,
    )


def peak_rise(model: ThermalModel, heat: HeatCycle, winding: Array, housing: Array) -> tuple[Array, Array]:
    """The largest temperatures above the ambient over one cycle, inside its intervals too.

    Inside an interval a temperature has at most one extremum, because its slope is a sum of two exponentials: a largest
    value exactly where the slope is positive at the start and negative at the end.

    Args:
        model: Models of m motors.
        heat: Losses of the m motors over the cycle.
        winding: Winding above the ambient at the start (m,), K.
        housing: Housing above the ambient at the start (m,), K.

    Returns:
        The largest of winding and housing (m,), K.
    """
    state = np.stack([winding, housing])
    peak = state.copy()
    with np.errstate(all="ignore"):
        for rates, kernel in intervals(model, heat):
            slope = np.stack(rates.slope(*state))
            end = state + np.stack(kernel.step((slope[0], slope[1])))
            np.maximum(peak, end, out=peak)
            inside = (slope > 0.0) & (np.stack(rates.slope(*end)) < 0.0)
            if inside.any():
                top = np.stack(_extrema(rates, kernel, state, slope))
                peak = np.where(inside, np.maximum(peak, top), peak)
            state = end
    return peak[0], peak[1]


def extremum_times(kernel: Kernel, rates: Rates, slope: Array) -> Array:
    """When the slopes of winding and housing are zero: tanh(s t) = -s x'(0) / (M x'(0)), (2, m), s."""
    winding = kernel.half_difference * slope[0] + rates.winding * slope[1]
    housing = rates.exchange * slope[0] - kernel.half_difference * slope[1]
    with np.errstate(all="ignore"):
        times = np.arctanh(-kernel.half_gap * slope / np.stack([winding, housing])) / kernel.half_gap
    return np.asarray(times)


def _extrema(rates: Rates, kernel: Kernel, state: Array, slope: Array) -> tuple[Array, Array]:
    """The extreme values of winding and housing where their slopes are zero."""
    times = extremum_times(kernel, rates, slope)
    winding = state[0] + Kernel.of(rates, times[0]).step((slope[0], slope[1]))[0]
    housing = state[1] + Kernel.of(rates, times[1]).step((slope[0], slope[1]))[1]
    return winding, housing
