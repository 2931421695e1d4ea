"""What a run is made of: its events, the solver's statistics, and the histories of joints and frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Latch:
    """A lock that closed, as a plastic impact that keeps constraints closed: velocity (nv,) after it, the impulse of the
    lock in `unit` (N m s or N s at a joint), the impulses of the constraints (rows,) as the multipliers' names say, times
    s, and the kinetic energy lost, J.
    """

    velocity: Array
    impulse: float
    unit: str
    constraint_impulses: Array
    energy_lost: float


@dataclass(frozen=True, eq=False)
class Event:
    """An event of a scene: time (s), position (nq,) and velocity (nv,) there, before any impact; `stopped`: it ended
    the run; multipliers (rows,) of constraints there; `latch`: what its lock did, None where it has none.
    """

    name: str
    time: float
    position: Array
    velocity: Array
    stopped: bool
    multipliers: Array = field(default_factory=lambda: np.zeros(0))
    latch: Latch | None = None

    @property
    def impulse(self) -> float:
        """The impulse of its lock, in latch.unit; 0 without one."""
        return 0.0 if self.latch is None else self.latch.impulse

    @property
    def energy_lost(self) -> float:
        """What its lock took out, J; 0 without one."""
        return 0.0 if self.latch is None else self.latch.energy_lost


@dataclass(frozen=True)
class Unresolved:
    """An event of which crossings may have been missed: its name, in how many steps of the solver, and when first, s;
    as its function oscillates so fast, or, `undefined`, as it is not a number there.
    """

    event: str
    steps: int
    first: float
    undefined: bool = False


@dataclass(frozen=True)
class Statistics:
    """What the solver did: accepted and rejected steps, evaluations of the right-hand side and of its Jacobian, LU
    factorisations, the time in the stepping alone (s), events that may have crossings that were not found, the longest
    step (s; None where it is not known), and how many events of a name happened that the run does not keep: of more
    than 100,000, each name keeps at least its first 100 and its last.
    """

    steps: int
    rejected: int
    evaluations: int
    jacobians: int
    factorisations: int
    kernel_time: float
    unresolved: tuple[Unresolved, ...] = ()
    longest_step: float | None = None
    omitted_events: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class ConstraintHistory:
    """One constraint over time: its multipliers (n, k), forces on the body of its first frame as `labels` (k) say, and how
    far positions (n,) m or rad, and velocities (n,) m/s or rad/s, are from closing it; `relative` (n,): positions, with
    lengths as shares of the mechanism's own.
    """

    labels: tuple[str, ...]
    multipliers: Array
    residual: Array
    velocity_residual: Array
    relative: Array


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
