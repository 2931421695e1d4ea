"""Histories of one constraint, joint or frame of a run."""

from __future__ import annotations

from dataclasses import dataclass

from bellcrank.arrays import Array


@dataclass(frozen=True, eq=False, kw_only=True)
class ConstraintHistory:
    """One constraint over time.

    Attributes:
        labels: The rows (k,) with the units of their multipliers, such as "x [N]".
        multipliers: Lagrange multipliers (n, k): forces on the body of the constraint's first frame.
        residual: Largest position residual (n,), m or rad.
        velocity_residual: Largest velocity residual (n,), m/s or rad/s.
        relative: Largest position residual (n,), with lengths as shares of the mechanism's characteristic length.
    """

    labels: tuple[str, ...]
    multipliers: Array
    residual: Array
    velocity_residual: Array
    relative: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class JointHistory:
    """One joint over time: (n,) each for a joint with one degree of freedom, otherwise (n, nq) or (n, nv).

    Attributes:
        position: rad or m.
        velocity: rad/s or m/s.
        acceleration: rad/s² or m/s².
        torque: Torque of all forces of the scene at this joint, N m or N.
        actuator_torque: The part of it that actuators and controllers apply; the rest comes from springs, dampers,
            friction and wrenches.
    """

    position: Array
    velocity: Array
    acceleration: Array
    torque: Array
    actuator_torque: Array


@dataclass(frozen=True, eq=False)
class FrameHistory:
    """One frame over time, in world axes.

    Attributes:
        position: Position (n, 3) of its origin, m.
        rotation: Rotation (n, 3, 3) from the frame's axes to those of the world.
        velocity: Velocity (n, 3) of its origin, m/s.
        angular_velocity: Angular velocity (n, 3), rad/s.
    """

    position: Array
    rotation: Array
    velocity: Array
    angular_velocity: Array
