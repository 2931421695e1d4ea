"""Temperatures of a cycle that repeats for ever: the fixed point of the cycle's affine map, its peaks, and runaway.

Over one cycle the temperatures above the ambient change by x → Φ x + g. Φ has positive entries, because heat raises
temperatures, so its largest eigenvalue is real, and it is the spectral radius ρ. For ρ < 1 every start ends in the
periodic state x* = (I - Φ)^{-1} g; for ρ >= 1 the temperatures rise without end: thermal runaway. Ψ = Φ - I is computed
without a difference, so that ρ - 1 and x* are accurate for cycles that are short against the time constants.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.product_arrays import Array
from bellcrank.actuators.thermal import HeatCycle, ThermalModel
from bellcrank.actuators.thermal_path import CyclePath

CHUNK = 2**18  # motors times intervals at a time: about 50 MB of arrays


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


def _known(model: ThermalModel, heat: HeatCycle) -> NDArray[np.bool_]:
    """Whether all figures of a motor (m,) and its losses are known."""
    figures = sum(getattr(model, field.name) for field in fields(model))
    return np.asarray(~np.isnan(figures + heat.copper_loss.sum(axis=1) + heat.friction_loss.sum(axis=1)))
