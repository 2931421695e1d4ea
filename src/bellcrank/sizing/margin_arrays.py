"""Margins of actuators in many designs: the criteria of sizing/margins.py for arrays, NaN where one is unknown."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.actuator_designs import ActuatorDesigns
from bellcrank.actuators.short_time_region import PEAK

Array = NDArray[np.float64]


def margin_arrays(
    actuators: ActuatorDesigns, k: int, peaks: Mapping[str, Array], rms: Array, mean_speed: Array
) -> dict[str, Array]:
    """The margins (n,) of the k-th actuator by criterion.

    Args:
        actuators: The actuators of the designs.
        k: Which of them.
        peaks: Peaks (n,) over all motions: "torque" at the shaft, N m, "speed" of the shaft, rad/s, and "curve", the
            share of the torque-speed curve that is used. Without "torque" and "curve" these are unknown.
        rms: RMS shaft torques (n, motions), N m; NaN where unknown.
        mean_speed: Mean shaft speeds (n, motions), rad/s.

    Returns:
        Margins by the names of `margins`.
    """
    one, ratings = actuators.actuators[k], {name: values[:, k] for name, values in actuators.ratings.items()}
    unknown = np.full(len(rms), np.nan)
    torque, curve_use = peaks.get("torque", unknown), peaks.get("curve", unknown)
    peak = 1.0 - ratings["safety_factor"] * torque / ratings["peak_torque"]
    if one.peak_torque is None:
        lower_bound = 1.0 - ratings["safety_factor"] * torque / ratings["rated_torque"]
        peak = np.where(lower_bound >= 0.0, lower_bound, np.nan)
    curve = np.where(np.isnan(curve_use) | ((curve_use <= 1.0) & bool(one.unknown_limits)), np.nan, 1.0 - curve_use)
    if one.unknown_limits == (PEAK,):
        both = np.where(np.isnan(curve_use), peak, np.minimum(peak, 1.0 - curve_use))
        curve = np.where(np.isnan(curve) & ~np.isnan(peak), both, curve)
    used = ratings["safety_factor"][:, None] * rms / _continuous(one, ratings["rated_torque"], mean_speed)
    return {
        "peak torque": peak,
        "rated torque": 1.0 - used.max(axis=1),
        "speed": 1.0 - peaks["speed"] / ratings["max_speed"],
        "torque-speed curve": curve,
    }


def _continuous(one: Actuator, rated: Array, speed: Array) -> Array:
    """The continuous torques (n, motions) at shaft speeds (n, motions); NaN where unknown."""
    if type(one) is Actuator:
        return np.broadcast_to(rated[:, None], speed.shape)
    every, place = np.unique(speed, return_inverse=True)
    found = [one.continuous_torque(float(each)) for each in every]
    return np.array([np.nan if torque is None else torque for torque in found])[place].reshape(speed.shape)
