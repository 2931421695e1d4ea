"""Constraints that close loops with a joint between two frames: universal, prismatic and planar."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Self

from bellcrank.config.fields import Fields
from bellcrank.elements.constraint import ReadContext, Residual
from bellcrank.elements.loop_constraints import Hinge, Loop, Weld, perpendicular, read_direction, read_sides
from bellcrank.robot.robot import Robot

if TYPE_CHECKING:
    from bellcrank.elements.symbols import Symbols


AXES = {"axis": (1.0, 0.0, 0.0), "axis_2": (0.0, 1.0, 0.0)}  # of a universal joint, by key


@dataclass(frozen=True)
class Universal(Loop):
    """A universal joint: the origins of two frames coincide, and `axis` of a is perpendicular to `axis_2` of b.

    φ = a − b (m, world axes), then k·l, where k is the axis of a and l that of b, each fixed in its own frame. The
    multipliers are the force on the body of frame a in world axes, N, and the moment on it about k × l, N m.
    """

    axis: tuple[float, ...]
    axis_2: tuple[float, ...]
    kind: ClassVar[str] = "universal"

    @classmethod
    def read(cls, name: str, read: Fields, context: ReadContext) -> Self:
        """Read the constraint from its entry. Raises InputError naming file and key."""
        given = [read_direction(read, key, usual) for key, usual in AXES.items()]
        return cls(name, read, *read_sides(read, context.robot), *given)

    def residual(self, symbols: Symbols) -> Residual:
        """Four rows."""
        import casadi

        a, b = self.sides(symbols)
        cosine = casadi.dot(a.rotation @ casadi.DM(self.axis), b.rotation @ casadi.DM(self.axis_2))
        return Residual(casadi.vertcat(a.position - b.position, cosine), casadi.SX(0, 1))

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """Force components in world axes, and a moment."""
        return (*(f"{c} [N]" for c in "xyz"), "moment [N m]")


@dataclass(frozen=True)
class Prismatic(Weld):
    """A slider: two frames have the same orientation, and the origin of a lies on the line through b along `axis`.

    φ = n₁·(a − b) and n₂·(a − b) (m), where n₁ and n₂ are perpendicular to the axis and fixed in b, then half the
    vector part of Rᵦᵀ Rₐ − Rₐᵀ Rᵦ (axes of b). The multipliers are forces along n₁ and n₂, N, and the moment on the
    body of frame a in the axes of b, N m.
    """

    axis: tuple[float, ...]
    kind: ClassVar[str] = "prismatic"
    alignment_rows: ClassVar[int] = 9

    @classmethod
    def read(cls, name: str, read: Fields, context: ReadContext) -> Self:
        """Read the constraint from its entry. Raises InputError naming file and key."""
        return cls(name, read, *read_sides(read, context.robot), read_direction(read, "axis", (1.0, 0.0, 0.0)))

    def residual(self, symbols: Symbols) -> Residual:
        """Five rows."""
        import casadi

        a, b = self.sides(symbols)
        across = [casadi.dot(b.rotation @ casadi.DM(n), a.position - b.position) for n in perpendicular(self.axis)]
        turned = super().residual(symbols).position[3:]
        return Residual(casadi.vertcat(*across, turned), casadi.SX(0, 1))

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """Two forces, and moment components."""
        return ("force 1 [N]", "force 2 [N]", *(f"r{c} [N m]" for c in "xyz"))


@dataclass(frozen=True)
class Planar(Hinge):
    """A plane: the normals `axis` of two frames coincide, and the origin of a lies in the plane through b.

    φ = k·(a − b) (m), where k is the normal of b, then n₁·l and n₂·l, where l is the normal of a, and n₁ and n₂ are
    perpendicular to k. The multipliers are the force along k, N, and moments on the body of frame a about l × n₁ and
    l × n₂, N m. `alignment_cosine` excludes the solution with opposed normals.
    """

    kind: ClassVar[str] = "planar"

    def residual(self, symbols: Symbols) -> Residual:
        """Three rows."""
        import casadi

        a, b = self.sides(symbols)
        normal = b.rotation @ casadi.DM(self.axis)
        turned = super().residual(symbols).position[3:]
        return Residual(casadi.vertcat(casadi.dot(normal, a.position - b.position), turned), casadi.SX(0, 1))

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """A force, and two moments."""
        return ("force [N]", "moment 1 [N m]", "moment 2 [N m]")
