"""What each motor's axis must deliver along each cycle, and how the masses of actuators change it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
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
        mount: Name of the link that carries the motor and gear.
        static_torque: Largest torque at rest over all postures of the cycles, N m or N.
    """

    name: str
    kind: Literal["rotary", "linear"]
    joints: tuple[str, ...]
    mount: str
    static_torque: float


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadCycle:
    """One duty cycle of all k axes at n times: motions, repeats and pauses in their order.

    Attributes:
        name: "duty", or the name of the motion that repeats.
        duration: s.
        time: Times (n,), s.
        weight: Weights (n,), s, of integrals over the cycle; they sum to `duration`, and may be 0 (ends of intervals).
        interval: Number (n,) of the interval that each time belongs to, from 0; heat is averaged over intervals.
        torque: Torque (n, k) at the axis that the actuator must deliver, without the actuator's own inertia.
        speed: Speed (n, k).
        acceleration: Acceleration (n, k).
        position: Position (n, k).
        bearing_force: |Force| (n, k) of the joint's wrench along its axis, N; NaN for coupled axes.
        tilting_moment: |Moment| (n, k) of the joint's wrench across its axis, N m; NaN for coupled axes.
        inertia: Inertia (n, k) of the load felt at the axis, kg m² or kg.
    """

    name: str
    duration: float
    time: Array
    weight: Array
    interval: NDArray[np.intp]
    torque: Array
    speed: Array
    acceleration: Array
    position: Array
    bearing_force: Array
    tilting_moment: Array
    inertia: Array


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
    """The cycles of a mechanism without its actuators' masses, and their change with these.

    Loads are linear in the added masses and inertias, so a change needs no inverse dynamics.

    Attributes:
        axes: The k axes.
        cycles: The cycles without actuator masses.
        influence: (k, k) whether the mass at the mount of axis j (column) changes the load of axis i (row).
    """

    axes: tuple[Axis, ...]
    cycles: tuple[LoadCycle, ...]
    influence: NDArray[np.bool_]

    def with_masses(self, added: Mapping[str, AddedMass]) -> tuple[LoadCycle, ...]:
        """The cycles with actuators of these masses at the mounts of their axes, by the name of the axis."""
        raise NotImplementedError
