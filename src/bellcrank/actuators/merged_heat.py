"""Heat cycles with fewer intervals: neighbours that are short against the winding's time constant become one.

The copper loss P of a merged interval is the mean P̄. The energy that the winding has got in excess,
D(t) = ∫ (P - P̄) r du from the start of the interval, with r the copper's resistance over that at 25 °C, is 0 again at
its end, so the winding's temperature differs by D/C_w to first order. The error also leaves a trace in the losses of
later intervals, because warm copper heats more; in the end it is larger by 1/(1 - α P̄ (R_wh + R_ha)), the same factor
as for any temperature rise (derived here). The bound is twice that with the largest D of the cycle; it is infinite for
peaks above 400 °C, where a part of the cycle may run away although the cycle settles, and first order says little.
"""

from __future__ import annotations

import numpy as np

from bellcrank import arguments
from bellcrank.actuators.copper import COPPER, resistance_factor
from bellcrank.actuators.product_arrays import Array
from bellcrank.actuators.thermal import HeatCycle, ThermalModel
from bellcrank.actuators.thermal_cycle import PeriodicTemperatures, periodic_temperatures

HOTTEST = 400.0  # °C
ROWS = 128  # motors at a time: their losses stay in the processor's cache


def merged(heat: HeatCycle, longest: float) -> tuple[HeatCycle, Array, Array]:
    """A cycle in which neighbouring intervals are joined while they last at most `longest` together.

    Args:
        heat: The cycle of m motors.
        longest: s; a longer interval stays as it is.

    Returns:
        The cycle with mean losses, and the largest energies (m,), J, by which copper loss at 25 °C and friction loss
        differ within a joined interval.

    Raises:
        InputError: For a duration that is not above 0.
    """
    longest = arguments.number("longest", longest, "s", above=0.0)
    starts, lasted = [0], 0.0
    for k, duration in enumerate(heat.duration.tolist()):
        if lasted + duration > longest and k > starts[-1]:
            starts.append(k)
            lasted = 0.0
        lasted += duration
    ends = np.append(starts[1:], len(heat.duration)).astype(np.intp) - 1
    sizes = np.diff([*starts, len(heat.duration)])
    durations = np.add.reduceat(heat.duration, starts)
    lasted_in = np.cumsum(heat.duration) - np.repeat(np.cumsum(durations) - durations, sizes)
    means, excesses = np.empty((2, len(heat.copper_loss), len(starts))), np.empty((2, len(heat.copper_loss)))
    for first in range(0, len(heat.copper_loss), ROWS):
        rows = slice(first, first + ROWS)
        for kind, loss in enumerate((heat.copper_loss[rows], heat.friction_loss[rows])):
            energy = np.cumsum(loss * heat.duration, axis=1)
            before = np.concatenate([np.zeros((len(energy), 1)), energy[:, ends[:-1]]], axis=1)
            with np.errstate(invalid="ignore", divide="ignore"):
                mean = np.where(durations > 0.0, (energy[:, ends] - before) / durations, loss[:, starts])
            excess = energy - np.repeat(before, sizes, axis=1) - np.repeat(mean, sizes, axis=1) * lasted_in
            means[kind, rows], excesses[kind, rows] = np.maximum(mean, 0.0), np.abs(excess).max(axis=1)
    return HeatCycle(duration=durations, copper_loss=means[0], friction_loss=means[1]), excesses[0], excesses[1]


def merged_temperatures(model: ThermalModel, heat: HeatCycle, longest: float) -> tuple[PeriodicTemperatures, Array]:
    """The temperatures of a cycle that repeats for ever, with its short intervals joined.

    Args:
        model: Models of m motors.
        heat: Losses of the m motors over the cycle.
        longest: Duration of joined intervals, s; a hundredth of the winding's time constant is plenty.

    Returns:
        The temperatures, and the bound (m,), K, of the error of their peaks.

    Example:
        >>> import numpy as np
        >>> from bellcrank.actuators.merged_heat import merged_temperatures
        >>> from bellcrank.actuators.thermal import HeatCycle, ThermalModel
        >>> one = np.ones(1)
        >>> model = ThermalModel(winding_capacity=5.568 * one, housing_capacity=108.036 * one,
        ...                      winding_resistance=0.74 * one, housing_resistance=8.96 * one,
        ...                      friction_share=one, ambient=25.0 * one)
        >>> loss = np.array([[20.0, 0.0] * 100])
        >>> heat = HeatCycle(duration=np.full(200, 0.01), copper_loss=loss, friction_loss=0.0 * loss)
        >>> found, error = merged_temperatures(model, heat, 0.1)
        >>> round(float(found.winding_peak[0]), 1), round(float(error[0]), 2)
        (181.0, 0.09)
    """
    short, copper, friction = merged(heat, longest)
    found = periodic_temperatures(model, short)
    resistance = model.winding_resistance + model.housing_resistance
    mean = (short.copper_loss * short.duration).sum(axis=1) / short.period
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        jump = copper * resistance_factor(found.winding_peak) / model.winding_capacity
        jump = jump + friction / model.housing_capacity
        margin = 1.0 - COPPER * mean * resistance
        bounded = (margin > 0.0) & (found.winding_peak <= HOTTEST)
        error = np.where(bounded, 2.0 * jump / margin, np.where(np.isnan(found.winding_peak), np.nan, np.inf))
    return found, error
