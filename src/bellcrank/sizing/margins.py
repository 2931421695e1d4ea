"""The criteria of a motor and gear: the fraction of each limit that the worst case leaves.

A new criterion is one entry of `margins`; tables, files and plots show all of them. A margin is None where a figure of
the motor or gear that it needs is unknown; `unknown_margins` says which.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.short_time_region import PEAK

PHRASES = {
    "efficiency": "the gear's efficiency",
    "rotor_inertia": "the rotor inertia",
    "gear_inertia": "the gear's inertia",
    "peak_torque": "the peak torque",
    "max_speed": "the largest speed",
}
# The least margin of a limit that is kept: a motion that is planned up to a limit meets it to about 1e-5.
LEAST_MARGIN = -2e-5


def margins(
    actuator: Actuator,
    *,
    peak_torque: float | None,
    continuous_use: float | None,
    speed: float,
    curve_use: float | None,
) -> dict[str, float | None]:
    """Margins by criterion: 1 minus use over limit, negative where a limit is exceeded, None where one is unknown.

    `peak_torque` is at the motor shaft, N m, and is multiplied by the actuator's safety factor; `continuous_use` is the
    largest `continuous_use` of a cycle; `speed` is the shaft's, rad/s; `curve_use` is the largest share of those limits
    of torque over speed that are known. Where the peak torque is not stated, the rated torque, which is not above it,
    shows that a smaller load is inside; the margin is then a lower bound.
    """
    missing, speed_limit = actuator.unknown_limits, actuator.max_speed
    peak = _peak_margin(actuator, peak_torque)
    curve = None
    if curve_use is not None and (curve_use > 1.0 or not missing):
        curve = 1.0 - curve_use
    elif missing == (PEAK,) and peak is not None:
        curve = peak if curve_use is None else min(peak, 1.0 - curve_use)
    return {
        "peak torque": peak,
        "rated torque": None if continuous_use is None else 1.0 - continuous_use,
        "speed": None if speed_limit is None else 1.0 - speed / speed_limit,
        "torque-speed curve": curve,
    }


def _peak_margin(actuator: Actuator, torque: float | None) -> float | None:
    """The margin of the largest torque against the peak torque, or a lower bound of it; None where it is unknown."""
    if torque is None:
        return None
    if actuator.peak_torque is not None:
        return 1.0 - actuator.safety_factor * torque / actuator.peak_torque
    if actuator.rated_torque is not None and actuator.safety_factor * torque <= actuator.rated_torque:
        return 1.0 - actuator.safety_factor * torque / actuator.rated_torque
    return None


def continuous_use(actuator: Actuator, cycles: Iterable[tuple[float | None, float]]) -> float | None:
    """The largest share of the continuous torque at the mean speed, with the safety factor, over cycles given by RMS
    shaft torque, N m, and mean shaft speed, rad/s; None where one is unknown.
    """
    uses = []
    for torque, speed in cycles:
        limit = actuator.continuous_torque(speed)
        if torque is None or limit is None:
            return None
        uses.append(actuator.safety_factor * torque / limit)
    return max(uses)


def unknown_margins(actuator: Actuator, found: Mapping[str, float | None]) -> dict[str, str]:
    """What is missing for each margin that is None, in words."""
    missing = {
        "peak torque": (*actuator.unknown_of_torque, *(("peak_torque",) if actuator.peak_torque is None else ())),
        "rated torque": actuator.unknown_of_torque or ("the continuous torque at the mean speed",),
        "speed": ("max_speed",),
        "torque-speed curve": actuator.unknown_of_torque or actuator.unknown_limits,
    }
    return {
        name: ", ".join(PHRASES.get(what, what) for what in missing[name])
        for name, margin in found.items()
        if margin is None
    }
