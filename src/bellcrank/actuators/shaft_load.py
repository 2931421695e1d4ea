"""The load at a motor's shaft behind a gear, as formulas of numbers or arrays; actuator.py explains them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bellcrank.numerics import floats

Array = NDArray[np.float64]


def motoring(load: Array, velocity: Array) -> NDArray[np.bool_]:
    """Whether a load takes power, as the one that a joint at rest holds does: load · velocity >= 0.

    The velocity is 0 where the joint rests for a finite time; at another zero it has the sign of one of its sides, as
    the samples of sizing/one_sided.py have it.
    """
    return floats(np.sign(load) * velocity >= 0.0)  # type: ignore[return-value]


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
    through_gear = np.where(motoring(load, velocity), 1.0 / (ratio * efficiency), efficiency / ratio)
    return np.asarray(load * through_gear + inertia * ratio * acceleration)
