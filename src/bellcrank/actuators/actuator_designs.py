"""The actuators of several joints in many designs, whose ratings differ from design to design.

An actuator that is given by its ratings becomes a column of arrays, to which the formulas of actuator.py apply for all
designs at once. An actuator of a catalogue's motor and gear is the same in all designs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.shaft_load import shaft_torque
from bellcrank.actuators.torque_speed_curve import share_of_curves

Array = NDArray[np.float64]
Index = Any  # what selects designs or joints: numbers, or arrays of them
RATINGS = {  # what may differ, with its unit
    "ratio": "",
    "rated_torque": "N m",
    "peak_torque": "N m",
    "rated_speed": "rad/s",
    "max_speed": "rad/s",
    "efficiency": "",
    "rotor_inertia": "kg m^2",
    "gear_inertia": "kg m^2",
    "safety_factor": "",
}


@dataclass(frozen=True, eq=False)
class ActuatorDesigns:
    """Actuators of k joints in n designs.

    Attributes:
        actuators: The actuators of the k joints as they are without changes.
        ratings: Arrays (n, k) of the names of `RATINGS`; NaN where unknown.
        speeds: The speeds (m, n, k), rad/s, of the points of the torque-speed curves.
        torques: Their torques (m, n, k), N m.
    """

    actuators: tuple[Actuator, ...]
    ratings: Mapping[str, Array]
    speeds: Array
    torques: Array

    @classmethod
    def of(cls, actuators: Sequence[Actuator], changes: Mapping[tuple[int, str], Array], designs: int) -> Self:
        """The actuators with ratings (n,) by the number of the joint and the name of the rating."""
        ratings = {
            name: np.tile([_known(getattr(one, name)) for one in actuators], (designs, 1)).reshape(designs, -1)
            for name in RATINGS
        }
        for (joint, name), values in changes.items():
            ratings[name][:, joint] = values
        most = max((len(one.curve) for one in actuators if one.curve is not None), default=3)
        speeds, torques = (np.full((max(most, 3), designs, len(actuators)), np.nan) for _ in range(2))
        for k, one in enumerate(actuators):
            if one.curve is not None:
                points = np.array([*one.curve, *[one.curve[-1]] * (len(speeds) - len(one.curve))])
                speeds[:, :, k], torques[:, :, k] = points[:, :1], points[:, 1:]
                continue
            rated, largest, peak = (ratings[name][:, k] for name in ("rated_speed", "max_speed", "peak_torque"))
            speeds[0, :, k], speeds[1, :, k], speeds[2:, :, k] = 0.0, rated, largest
            torques[:2, :, k], torques[2:, :, k] = peak, np.where(largest > rated, 0.0, peak)
        return cls(tuple(actuators), ratings, speeds, torques)

    def only(self, joints: Sequence[int]) -> Self:
        """Those of some of the joints, by number."""
        of = list(joints)
        ratings = {name: values[:, of] for name, values in self.ratings.items()}
        return type(self)(tuple(self.actuators[k] for k in of), ratings, self.speeds[:, :, of], self.torques[:, :, of])

    def shaft_torque(self, designs: Index, joints: Index, load: Array, motion: tuple[Array, Array]) -> Array:
        """The shaft torque, N m, of loads at the joints; `designs` and `joints` (numbers) broadcast with the loads."""
        rating = {name: self.ratings[name][designs, joints] for name in ("ratio", "efficiency")}
        inertia = self.ratings["rotor_inertia"][designs, joints] + self.ratings["gear_inertia"][designs, joints]
        found = shaft_torque(load, motion, rating["ratio"], rating["efficiency"], inertia)
        for k, one in enumerate(self.actuators):
            if type(one) is not Actuator and (here := np.broadcast_to(joints == k, load.shape)).any():
                velocity, acceleration = (np.broadcast_to(x, load.shape)[here] for x in motion)
                found[here] = one.shaft_torque(load[here], velocity, acceleration)
        return found

    def curve_use(self, designs: Index, joints: Index, torque: Array, velocity: Array) -> Array:
        """The share of the limits of torque over speed that is used, with the safety factor, as `Actuator.curve_use`.

        `torque` is at the shaft, `velocity` at the joint.
        """
        used = self.ratings["safety_factor"][designs, joints] * torque
        speed = self.ratings["ratio"][designs, joints] * velocity
        found = share_of_curves(self.speeds[:, designs, joints], self.torques[:, designs, joints], used, speed)
        for k, one in enumerate(self.actuators):
            if type(one) is not Actuator and (here := np.broadcast_to(joints == k, torque.shape)).any():
                found[here] = one.curve_use(used[here], np.broadcast_to(speed, torque.shape)[here])
        return found


def _known(value: float | None) -> float:
    return np.nan if value is None else value
