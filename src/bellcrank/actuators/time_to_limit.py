"""The time from the ambient temperature until the winding reaches a limit, over a cycle that repeats."""

from __future__ import annotations

import numpy as np

from bellcrank.actuators.product_arrays import Array
from bellcrank.actuators.thermal import HeatCycle, Kernel, Rates, ThermalModel
from bellcrank.actuators.thermal_cycle import (
    MOST_DOUBLINGS,
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
        ...                      winding_resistance=0.74 * one, housing_resistance=8.96 * one, ambient=25.0 * one)
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
        with np.errstate(all="ignore"):
            cycles, winding, housing = _cycles_below(model, heat, rise)
            inside = _time_in_cycle(model, heat, np.stack([winding, housing]), rise)
        time[reached] = cycles * heat.period + inside
    return time


def _cycles_below(model: ThermalModel, heat: HeatCycle, rise: Array) -> tuple[Array, Array, Array]:
    """The number of cycles before that in which a rise is first reached, and the state at the start of that cycle.

    Peaks grow from cycle to cycle, so the number is found bit by bit.
    """

    def below(winding: Array, housing: Array) -> Array:
        return np.asarray(peak_rise(model, heat, winding, housing)[0] < rise)  # overflow is not below

    zero = np.zeros_like(rise)
    maps = [cycle_map(model, heat)]
    while len(maps) < MOST_DOUBLINGS and below(maps[-1].winding, maps[-1].housing).any():
        maps.append(maps[-1].doubled())
    some = below(zero, zero)  # the limit is not reached in the first cycle
    cycles, winding, housing = zero, zero, zero
    for exponent in reversed(range(len(maps))):
        later = maps[exponent].apply(winding, housing)
        still = below(*later)
        winding, housing = np.where(still, later[0], winding), np.where(still, later[1], housing)
        cycles = cycles + np.where(still, 2.0**exponent, 0.0)
    last = maps[0].apply(winding, housing)
    return np.where(some, cycles + 1.0, 0.0), np.where(some, last[0], zero), np.where(some, last[1], zero)


def _time_in_cycle(model: ThermalModel, heat: HeatCycle, state: Array, rise: Array) -> Array:
    """When the winding first reaches a rise in a cycle that starts from a state (2, m), s after the cycle's start."""
    open_ = np.ones(len(rise), dtype=bool)
    found = np.full_like(rise, np.inf)
    start = 0.0
    for (rates, kernel), duration in zip(intervals(model, heat), heat.duration, strict=True):
        slope = np.stack(rates.slope(*state))
        end = state + np.stack(kernel.step((slope[0], slope[1])))
        top = extremum_times(kernel, rates, slope)[0]
        until = np.where((slope[0] > 0.0) & (rates.slope(*end)[0] < 0.0), top, duration)  # rises until then
        highest = state[0] + Kernel.of(rates, until).step((slope[0], slope[1]))[0]
        crosses = open_ & (highest >= rise)
        if crosses.any():
            found = np.where(crosses, start + _crossing(rates, state[0], slope, until, rise), found)
            open_ &= ~crosses
            if not open_.any():
                break
        state, start = end, start + duration
    return found


def _crossing(rates: Rates, winding: Array, slope: Array, until: Array, rise: Array) -> Array:
    """The time in an interval, at most `until`, at which the rising winding reaches a rise."""
    low, high = np.zeros_like(rise), np.array(until)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        above = winding + Kernel.of(rates, middle).step((slope[0], slope[1]))[0] >= rise
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return high
