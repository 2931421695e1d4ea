"""The base class of constraints: residuals as expressions, and multipliers with names, units and a meaning."""

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
    """What the entries of a scene file may refer to: the robot, motions and parameters by name."""

    robot: Robot
    motions: Mapping[str, Any]
    motion_of: Callable[[str], Motion]
    parameters: Mapping[str, Any]


class Residual(NamedTuple):
    """What a constraint keeps at zero.

    Attributes:
        position: The position residual φ(q, t, u, p), holonomic.
        velocity: The velocity residual ψ(q, v, t, u, p), linear in v and not the derivative of a φ: non-holonomic.
    """

    position: casadi.SX
    velocity: casadi.SX


@dataclass(frozen=True)
class Constraint(Element):
    """A constraint of a scene.

    Its multipliers λ enter M v̇ = f + Jᵀ λ with the rows J = ∂φ̇/∂v and ∂ψ/∂v. `labels` name them: forces and moments on
    the body of the first frame, with their axes and units.
    """

    owner: ClassVar[str] = "constraint"

    @classmethod
    def read(cls, name: str, read: Fields, context: ReadContext) -> Self:
        """The constraint of an entry of the list `constraints`. Raises InputError naming file and key."""
        raise NotImplementedError

    def residual(self, symbols: Symbols) -> Residual:
        """Its residuals. The multipliers have the same order, those of `position` first."""
        raise NotImplementedError

    def lever_velocities(self, symbols: Symbols) -> casadi.SX:
        """Velocities, m/s, whose derivatives by joint velocities are lever arms, besides those of its rows.

        They give the length scale of the mechanism; most constraints have none.
        """
        import casadi

        return casadi.SX(0, 1)

    def lengths(self, symbols: Symbols) -> casadi.SX:
        """Its own lengths, m, which give the length scale of the mechanism too; most constraints have none."""
        import casadi

        return casadi.SX(0, 1)

    def alignment_cosine(self, symbols: Symbols) -> casadi.SX:
        """The cosine of the angle between its two sides (1) where the residual also vanishes at 180 deg; else none (0)."""
        import casadi

        return casadi.SX(0, 1)

    def alignment_residual(self, symbols: Symbols) -> casadi.SX:
        """A residual that vanishes only where `alignment_cosine` is 1, for the search of a start from any angle below 180 deg."""
        import casadi

        return casadi.SX(0, 1)
