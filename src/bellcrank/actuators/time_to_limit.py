"""The time from the ambient temperature until the winding reaches a limit, over a cycle that repeats.

From the ambient temperature each cycle is warmer than the one before at each of its moments, because its map has no
negative entries. Hence the cycle in which a limit is first reached is found by bisection over powers of the map.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.product_arrays import Array
from bellcrank.actuators.thermal import HeatCycle, ThermalModel
from bellcrank.actuators.thermal_cycle import periodic_temperatures
from bellcrank.actuators.thermal_interval import Kernel, extremum_times
from bellcrank.actuators.thermal_path import CyclePath

HALVINGS = 80  # of the time inside an interval
MOST_DOUBLINGS = 62  # of the cycle's map: more cycles would take longer than the age of the universe


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
        >>> from bellcrank.actuators.time_to_limit import time_to_limit
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

    def below(start: Array) -> NDArray[np.bool_]:
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
