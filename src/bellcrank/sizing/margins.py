"""The criteria of a motor and gear: the fraction of each limit that the worst case leaves.

A new criterion is one entry of `margins`; tables, files and plots show all of them.
"""

from __future__ import annotations

from bellcrank.actuators.actuator import Actuator


def margins(
    actuator: Actuator, *, peak_torque: float, rms_torque: float, speed: float, curve_use: float
) -> dict[str, float]:
    """Margins by criterion: 1 minus use over limit, negative where a limit is exceeded.

    Torques are at the motor shaft, N m, and are multiplied by the actuator's safety factor; `speed` is the shaft's,
    rad/s; `curve_use` is the largest torque over that of the torque-speed curve at the same speed.
    """
    factor = actuator.safety_factor
    return {
        "peak torque": 1.0 - factor * peak_torque / actuator.peak_torque,
        "rated torque": 1.0 - factor * rms_torque / actuator.rated_torque,
        "speed": 1.0 - speed / actuator.max_speed,
        "torque-speed curve": 1.0 - curve_use,
    }
