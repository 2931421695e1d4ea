"""The symbols of outputs and events: those of a scene, and the solution of its equations of motion over them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols


class Reactions(Protocol):
    """The constraint forces of a scene, as expressions."""

    def of(self, name: str) -> casadi.SX:
        """The multipliers of one constraint, N or N m, in the order of its labels."""
        ...

    @property
    def closeness(self) -> casadi.SX:
        """σ_min/σ_max of J M⁻¹ᐟ²: 0 where the constraints are singular."""
        ...


@dataclass(frozen=True, kw_only=True)
class EquationSymbols:
    """The symbols of a scene and the solution of its equations of motion over them.

    Attributes:
        symbols: Time, position, velocity, signals and parameters, and the kinematics.
        acceleration: v̇ (nv).
        joint_torque: The sum of the scene's forces at the joints (nv), without gravity, N m or N.
        kinetic: Kinetic energy, J.
        potential: Potential energy of gravity and springs, J.
        reactions: The constraint forces; None for a scene without constraints.
        work: The work W since the start, J.
    """

    symbols: Symbols
    acceleration: casadi.SX
    joint_torque: casadi.SX
    kinetic: casadi.SX
    potential: casadi.SX
    reactions: Reactions | None
    work: casadi.SX

    def multipliers(self, constraint: str) -> casadi.SX:
        """The multipliers of one constraint, N or N m, in the order of its labels."""
        assert self.reactions is not None  # outputs and events name constraints of the scene only
        return self.reactions.of(constraint)

    @property
    def closeness(self) -> casadi.SX:
        """σ_min/σ_max of J M⁻¹ᐟ²: 0 where the constraints are singular."""
        assert self.reactions is not None
        return self.reactions.closeness
