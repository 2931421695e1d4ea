"""The axes that motors drive: their joints, or with coupled transmissions several of them each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.coupled_transmission import CoupledTransmission
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.mechanism import Mechanism
from bellcrank.sizing.coupled_axes import AxisCoordinates, axis_coordinates, of_axes

Array = NDArray[np.float64]


class DrivenAxis(NamedTuple):
    """An axis: its name, that of a joint or of a motor, the column of its coordinate, and that of its torque."""

    name: str
    column: int
    torque: int


@dataclass(frozen=True, eq=False)
class DrivenAxes:
    """The axes of a mechanism's k motors, θ = C q of their joints, with torques C⁻ᵀ τ (see `CoupledTransmission`).

    Attributes:
        mechanism: The mechanism.
        transmissions: Its coupled transmissions.
    """

    mechanism: Mechanism
    transmissions: Sequence[CoupledTransmission] = ()

    @cached_property
    def axes(self) -> tuple[DrivenAxis, ...]:
        """The axes, in the order of the motors' joints."""
        motors, first = self.mechanism.motors, self.mechanism.robot.nv
        if not self.transmissions:
            return tuple(DrivenAxis(joint.name, joint.v, k) for k, joint in enumerate(motors))
        return tuple(
            DrivenAxis(name, first + k, len(motors) + k) for k, name in enumerate(self._coordinates.mounted_at)
        )

    def with_coordinates(self, rates: Array) -> Array:
        """Derivatives (n, nv) of the joints' coordinates, with those of all axes after them where some are coupled."""
        if not self.transmissions:
            return rates
        columns = [joint.v for joint in self.mechanism.motors]
        return np.concatenate([rates, of_axes(self._coordinates.matrix, rates[:, columns])], axis=1)

    def with_torques(self, torques: Array) -> Array:
        """Torques (..., k) of the joints, with those at all axes after them where some are coupled."""
        if not self.transmissions:
            return torques
        return np.concatenate([torques, torques @ self._inverse], axis=-1)

    @cached_property
    def _coordinates(self) -> AxisCoordinates:
        return axis_coordinates(self.mechanism, self.transmissions)

    @cached_property
    def _inverse(self) -> Array:
        return np.asarray(np.linalg.inv(self._coordinates.matrix))
