"""The base class of constraints: residuals as expressions, and multipliers with names and units."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

from bellcrank.elements.element import Element

if TYPE_CHECKING:
    import casadi

    from bellcrank.config.fields import Fields
    from bellcrank.elements.symbols import Symbols
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import Robot


@dataclass(frozen=True)
class ReadContext:
    """The robot, and the motions and parameters by name, to which the entries of a scene file may refer."""

    robot: Robot
    motions: Mapping[str, Any]
    motion_of: Callable[[str], Motion]
    parameters: Mapping[str, Any]


class Residual(NamedTuple):
    """The residuals of a constraint, which the solver keeps at zero.

    Attributes:
        position: The position residual φ(q, t, u, p) (holonomic).
        velocity: The velocity residual ψ(q, v, t, u, p), linear in v and not the derivative of a φ (non-holonomic).
    """

    position: casadi.SX
    velocity: casadi.SX


@dataclass(frozen=True)
class Constraint(Element):
    """A constraint of a scene.

    Its multipliers λ enter M v̇ = f + Jᵀ λ with the rows J = ∂φ̇/∂v and ∂ψ/∂v. They are forces and moments on the body of
    the first frame; `labels` gives their names, axes and units.
    """

    owner: ClassVar[str] = "constraint"

    @classmethod
    def read(cls, name: str, read: Fields, context: ReadContext) -> Self:
        """Read the constraint from an entry of the list `constraints`. Raises InputError naming file and key."""
        raise NotImplementedError

    def residual(self, symbols: Symbols) -> Residual:
        """The residuals. The multipliers are in the same order, those of `position` first."""
        raise NotImplementedError

    def lever_velocities(self, symbols: Symbols) -> casadi.SX:
        """Additional velocities, m/s, whose derivatives with respect to joint velocities are lever arms.

        The length scale of the mechanism is computed from them and from the rows of the Jacobian. Most constraints have
        none.
        """
        import casadi

        return casadi.SX(0, 1)

    def lengths(self, symbols: Symbols) -> casadi.SX:
        """Lengths, m, that also enter the length scale of the mechanism. Most constraints have none."""
        import casadi

        return casadi.SX(0, 1)

    def alignment_cosine(self, symbols: Symbols) -> casadi.SX:
        """The cosine of the angle between the two sides (1), for a residual that also vanishes at 180 deg; else (0)."""
        import casadi

        return casadi.SX(0, 1)

    def alignment_residual(self, symbols: Symbols) -> casadi.SX:
        """A residual that vanishes only where `alignment_cosine` is 1; the search for a consistent start uses it."""
        import casadi

        return casadi.SX(0, 1)
