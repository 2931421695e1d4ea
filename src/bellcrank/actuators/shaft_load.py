"""The load at a motor's shaft behind a gear, as formulas of numbers or arrays; actuator.py explains them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STANDSTILL = 1e-6  # rad/s of the shaft: slower counts as at rest, so that rounding does not decide the flow of power


def shaft_torque(
    load: Array, motion: tuple[Array, Array], ratio: Array | float, efficiency: Array | float, inertia: Array | float
) -> Array:
    """The torque at the shaft, N m.

    Args:
        load: Joint torque without the reflected inertia of rotor and gear, N m (N).
        motion: Joint velocity, rad/s (m/s), and acceleration, rad/s² (m/s²).
        ratio: Motor angle over joint angle.
        efficiency: Of the gear; NaN where unknown.
        inertia: Of rotor and gear at the shaft, kg m²; NaN where unknown.

    Returns:
        Torque; NaN where a figure is unknown.
    """
    velocity, acceleration = motion
    motoring = (load * velocity >= 0.0) | (ratio * np.abs(velocity) <= STANDSTILL)
    through_gear = np.where(motoring, 1.0 / (ratio * efficiency), efficiency / ratio)
    return np.asarray(load * through_gear + inertia * ratio * acceleration)
