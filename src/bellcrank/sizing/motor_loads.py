"""The loads at the axes of motors where coupled transmissions take the places of joints: θ = C q, τ_axis = C⁻ᵀ τ.

Source: Tsai, Robot Analysis (1999), 7.4, as in actuators/coupled_transmission.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.closed_inverse_dynamics import Linkage
from bellcrank.sizing.coupled_axes import AxisCoordinates, of_axes
from bellcrank.sizing.joint_loads import JointLoads

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MotorLoads(JointLoads):
    """What the motors must overcome at their axes; `actuators` are by axis, the joint or the motor of a transmission.

    Reactions are those of joints, and 0 here.
    """

    coordinates: AxisCoordinates

    @cached_property
    def _force(self) -> Array:
        """C⁻ᵀ (k, k)."""
        return np.asarray(np.linalg.inv(self.coordinates.matrix).T)

    @property
    def joint_names(self) -> list[str]:
        """Names of the axes."""
        return list(self.coordinates.mounted_at)

    def moving(self, values: Array) -> Array:
        """The axes' coordinates (n, k) of values of the joints' coordinates (n, k): positions, or their derivatives."""
        return of_axes(self.coordinates.matrix, values)

    def nominal_torque(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Torques (n, k) at the axes with the nominal masses."""
        return np.asarray(super().nominal_torque(t, q, v, a) @ self._force.T)

    def link_torques(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """The part (n, links, k) of the torques at the axes that each link's mass and inertia cause."""
        return np.asarray(super().link_torques(t, q, v, a) @ self._force.T)

    def reactions(self, t: Array, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """Zeros (n, k): an axis that moves several joints has no wrench."""
        nothing = np.zeros((len(q), len(self.joints)))
        return {"peak_bearing_force": nothing, "peak_tilting_moment": nothing}

    def inertia(self, t: Array, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """The diagonal of P M Pᵀ (n, k) without the actuators' rotors; P (k, nv) gives the torques of joint forces."""
        if isinstance(self.mechanism, Linkage):
            shares = self.mechanism.force_maps(t, q)[0]
        else:
            shares = np.eye(self.mechanism.robot.nv)[self.columns]
        mass = self.mechanism.equations.mass_matrix(q)
        mass[:, self.columns, self.columns] -= self.rotor_inertia
        shares = self._force @ shares
        return {"largest_inertia": np.asarray(((shares @ mass) * shares).sum(axis=-1))}
