"""What a run is made of: its events, the solver's statistics, and the histories of joints and frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Event:
    """An event of a scene: time (s), position (nq,) and velocity (nv,) there; `stopped`: it ended the run."""

    name: str
    time: float
    position: Array
    velocity: Array
    stopped: bool


@dataclass(frozen=True)
class Statistics:
    """What the solver did: accepted and rejected steps, evaluations of the right-hand side and of its Jacobian, LU
    factorisations, and the time in the stepping alone (s).
    """

    steps: int
    rejected: int
    evaluations: int
    jacobians: int
    factorisations: int
    kernel_time: float


@dataclass(frozen=True, eq=False)
class JointHistory:
    """One joint over time: position, velocity, acceleration and torque, (n,) each for a joint with one degree of
    freedom (rad or m, …, N m or N). `actuator_torque` is the motors' and controllers' part of the torque; the rest
    comes from springs, dampers, friction and wrenches.
    """

    position: Array
    velocity: Array
    acceleration: Array
    torque: Array
    actuator_torque: Array


@dataclass(frozen=True, eq=False)
class FrameHistory:
    """One frame over time, world axes: position (n, 3) m, rotation (n, 3, 3), velocity (n, 3) m/s of its origin, and
    angular velocity (n, 3) rad/s.
    """

    position: Array
    rotation: Array
    velocity: Array
    angular_velocity: Array
