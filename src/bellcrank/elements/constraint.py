"""What constraints have in common: residuals as expressions, and multipliers with names, units and a meaning."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from bellcrank.elements.element import Part

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols


class Residual(NamedTuple):
    """What a constraint keeps at zero: `position` φ(q, t, u, p), and `velocity` ψ(q, v, t, u, p), linear in v, which is
    the derivative of no φ (non-holonomic).
    """

    position: casadi.SX
    velocity: casadi.SX


@dataclass(frozen=True)
class Constraint(Part):
    """A constraint of a scene. Its multipliers λ stand in M v̇ = f + Jᵀλ with J = ∂φ̇/∂v, ∂ψ/∂v; `labels` say what each is:
    a force or moment on the body of the first frame, its axes, its unit.
    """

    owner: ClassVar[str] = "constraint"

    def residual(self, symbols: Symbols) -> Residual:
        """Its residuals; multipliers come in the same order, those of `position` first."""
        raise NotImplementedError

    def reach(self, symbols: Symbols) -> casadi.SX:
        """Velocities, m/s, whose derivatives by joint rates are lever arms of what it closes, besides those of its
        rows; none as a rule.
        """
        import casadi

        return casadi.SX(0, 1)

    def lengths(self, symbols: Symbols) -> casadi.SX:
        """Lengths of its own, m, which say how large what it closes is; none as a rule."""
        import casadi

        return casadi.SX(0, 1)

    def alignment_cosine(self, symbols: Symbols) -> casadi.SX:
        """The cosine of the angle between its sides (1), where its rows vanish at half a turn too; else none (0)."""
        import casadi

        return casadi.SX(0, 1)

    def alignment_residual(self, symbols: Symbols) -> casadi.SX:
        """What vanishes where `alignment_cosine` is 1 and nowhere else, and leads there from any angle below half a turn."""
        import casadi

        return casadi.SX(0, 1)
