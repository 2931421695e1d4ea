"""States of an element besides the robot's positions and velocities: rotors of drives, currents, integrators.

They follow q and v in the state x, and have rates of their own. Each element that has some names them, gives their
rates, and their values at the start of a run as functions of the posture and the velocity there.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class AuxiliaryStates:
    """The states of one element.

    Attributes:
        name: Of the element.
        labels: The name and unit of each, such as "rotor position [rad]".
    """

    name: str
    labels: tuple[str, ...]

    @property
    def size(self) -> int:
        """How many they are."""
        return len(self.labels)
