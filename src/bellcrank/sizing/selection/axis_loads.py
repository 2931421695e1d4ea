"""What each motor's axis must deliver along each cycle, and how the masses of actuators change it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Axis:
    """What a motor and gear drive: a joint, or one motor coordinate of a coupled transmission.

    Attributes:
        name: The joint's name, or the motor's name in a coupled transmission.
        kind: "rotary" or "linear"; units of the axis are rad, N m or m, N.
        joints: Names of the joints that it moves (one, but for coupled transmissions).
        mount: Name of the link or frame that carries the motor and gear.
        included: The part of an actuator that the robot's URDF contains already; `AxisLoads.with_masses` replaces it.
    """

    name: str
    kind: Literal["rotary", "linear"]
    joints: tuple[str, ...]
    mount: str
    included: AddedMass = field(default_factory=lambda: AddedMass())


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadCycle:
    """One duty cycle of all k axes: motions and pauses, each sampled once, however often it is repeated.

    The n samples are those of the cycle's different parts, one part after the other. Sums with `weight` are integrals
    over the whole cycle with all repeats; what depends on the order (temperature) follows `sequence`.

    Attributes:
        name: "duty", or the name of the motion that repeats.
        duration: s.
        time: Times (n,), s, at which each sample occurs first.
        weight: Weights (n,), s, of integrals over the cycle; they sum to `duration`, and may be 0 (ends of intervals).
        interval: Number (n,) of the interval that each time belongs to, from 0; heat is averaged over intervals.
        sequence: (first interval, interval after the last, passes) of each part in the order of the cycle; a part may
            occur several times.
        torque: Torque (n, k) at the axis that the actuator must deliver, without the actuator's own inertia.
        static_torque: Torque (n, k) that holds the axis at rest in the posture of each sample.
        speed: Speed (n, k).
        acceleration: Acceleration (n, k).
        position: Position (n, k).
        axial_force: |Force| (n, k) of the joint's wrench along its axis, N; NaN for coupled axes.
        tilting_moment: |Moment| (n, k) of the joint's wrench across its axis, N m, on a prismatic joint the whole
            moment; NaN for coupled axes.
        inertia: Inertia (n, k) of the load felt at the axis, kg m² or kg.
    """

    name: str
    duration: float
    time: Array
    weight: Array
    interval: NDArray[np.intp]
    sequence: tuple[tuple[int, int, int], ...]
    torque: Array
    static_torque: Array
    speed: Array
    acceleration: Array
    position: Array
    axial_force: Array
    tilting_moment: Array
    inertia: Array

    @property
    def interval_duration(self) -> Array:
        """The time (p,), s, that one pass of each of the p intervals takes."""
        passes = np.zeros(int(self.interval.max()) + 1)
        for first, end, count in self.sequence:
            passes[first:end] += count
        return np.bincount(self.interval, self.weight, len(passes)) / passes

    def interval_mean(self, values: Array) -> Array:
        """The mean (p, …) over each interval of values (n, …) at the samples."""
        total = np.zeros((int(self.interval.max()) + 1, *values.shape[1:]))
        shape = (-1, *(1,) * (values.ndim - 1))
        np.add.at(total, self.interval, values * self.weight.reshape(shape))
        return total / np.bincount(self.interval, self.weight, len(total)).reshape(shape)


@dataclass(frozen=True, kw_only=True, eq=False)
class AddedMass:
    """What an actuator adds at the mount of its axis: point mass, and the inertia of its body as a cylinder.

    Attributes:
        mass: kg.
        axial_inertia: About the joint's axis, kg m².
        transverse_inertia: About an axis across it, kg m².
    """

    mass: float = 0.0
    axial_inertia: float = 0.0
    transverse_inertia: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class AxisLoads:
    """The cycles of a mechanism, and their change with the masses of its actuators.

    Loads are linear in the added masses and inertias, so a change needs no inverse dynamics.

    Attributes:
        axes: The k axes.
        cycles: The cycles with the masses that the robot's URDF contains.
        influence: (k, k) whether the mass at the mount of axis j (column) changes the load of axis i (row).
    """

    axes: tuple[Axis, ...]
    cycles: tuple[LoadCycle, ...]
    influence: NDArray[np.bool_]

    def with_masses(self, added: Mapping[str, AddedMass]) -> tuple[LoadCycle, ...]:
        """The cycles with actuators of these masses at the mounts of their axes, by the name of the axis.

        They replace what the URDF contains (`Axis.included`); an axis that is not named keeps that, so an actuator of
        unknown mass is left out of `added`.
        """
        raise NotImplementedError
