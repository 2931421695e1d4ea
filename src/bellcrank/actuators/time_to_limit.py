"""The time from the ambient temperature until the winding reaches a limit, over a cycle that repeats."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.product_arrays import Array
from bellcrank.actuators.thermal import HeatCycle, Kernel, Rates, ThermalModel
from bellcrank.actuators.thermal_cycle import (
    MOST_DOUBLINGS,
    CycleMap,
    Interval,
    cycle_map,
    extremum_times,
    intervals,
    peak_rise,
    periodic_temperatures,
)

HALVINGS = 80  # of the time inside an interval


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
        model, heat, rise = model[reached], heat[reached], rise[reached]
        steps = intervals(model, heat)
        with np.errstate(all="ignore"):
            cycles, state = _cycles_below(cycle_map(model, steps), steps, rise)
            time[reached] = cycles * heat.period + _time_in_cycle(steps, heat.duration, state, rise)
    return time


def _cycles_below(over_cycle: CycleMap, steps: list[Interval], rise: Array) -> tuple[Array, Array]:
    """The number (m,) of cycles before that in which a rise is first reached, and the state (2, m) at its start.

    Peaks grow from cycle to cycle, so the number is found bit by bit.
    """

    def below(state: Array) -> NDArray[np.bool_]:
        return np.asarray(peak_rise(steps, state)[0] < rise)  # overflow is not below

    cycles, state = np.zeros_like(rise), np.zeros((2, len(rise)))
    some = below(state)  # the limit is not reached in the first cycle
    powers = [over_cycle]
    while len(powers) < MOST_DOUBLINGS and below(powers[-1].shift).any():
        powers.append(powers[-1].doubled())
    for exponent in reversed(range(len(powers))):
        later = powers[exponent].apply(state)
        still = below(later)
        state, cycles = np.where(still, later, state), cycles + np.where(still, 2.0**exponent, 0.0)
    return np.where(some, cycles + 1.0, 0.0), np.where(some, over_cycle.apply(state), 0.0)


def _time_in_cycle(steps: list[Interval], durations: Array, state: Array, rise: Array) -> Array:
    """When the winding first reaches a rise in a cycle that starts from a state (2, m), s after the cycle's start."""
    found = np.full_like(rise, np.inf)
    start = 0.0
    for (rates, kernel), duration in zip(steps, durations.tolist(), strict=True):
        slope = rates.slope(state)
        end = state + kernel.step(slope)
        turns = (slope[0] > 0.0) & (rates.slope(end)[0] < 0.0)
        until = np.where(turns, extremum_times(kernel, rates, slope)[0], duration)  # of the highest temperature
        reached = state[0] + Kernel.of(rates, until).step(slope)[0] >= rise
        first = np.flatnonzero(reached & np.isinf(found))
        if len(first):
            found[first] = start + _crossing(
                rates.taken(first), slope[:, first], until[first], (rise - state[0])[first]
            )
        state, start = end, start + duration
    return found


def _crossing(rates: Rates, slope: Array, until: Array, rise: Array) -> Array:
    """The time in an interval, at most `until`, after which the winding is warmer by a rise than at its start."""
    low, high = np.zeros_like(rise), np.array(until)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        above = Kernel.of(rates, middle).step(slope)[0] >= rise
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return high
