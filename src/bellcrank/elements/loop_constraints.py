"""Constraints that close loops between two frames: point, hinge, weld, distance, universal, prismatic and planar."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from bellcrank.config.fields import Fields
from bellcrank.elements.constraint import Constraint, ReadContext, Residual
from bellcrank.elements.element import POSITIVE, Settable, read_frame
from bellcrank.numerics import LARGEST, length
from bellcrank.robot.robot import Robot

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import FrameSymbols, Symbols


WORLD = "world"
AXES = {"axis": (1.0, 0.0, 0.0), "axis_2": (0.0, 1.0, 0.0)}  # of a universal joint, by key


@dataclass(frozen=True)
class Loop(Constraint):
    """A constraint between two frames; `frame_b: world` is a frame fixed at `point` (m), with the world's axes.

    `at_a` and `at_b` are the placements of the two sides in their frames: origin (3), m, then rotation (9) by rows.
    None means the frame itself.
    """

    frame_a: str
    frame_b: str
    point: tuple[float, ...]
    at_a: tuple[float, ...] | None = field(default=None, kw_only=True)
    at_b: tuple[float, ...] | None = field(default=None, kw_only=True)

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames of its two sides."""
        return (self.frame_a,) if self.frame_b == WORLD else (self.frame_a, self.frame_b)

    @property
    def settable(self) -> dict[str, Settable]:
        """The fixed point can be set."""
        return {f"point.{c}": Settable("m") for c in "xyz"} if self.frame_b == WORLD else {}

    def sides(self, symbols: Symbols) -> tuple[FrameSymbols, FrameSymbols]:
        """The placements and velocities of both sides in the world."""
        import casadi

        from bellcrank.elements.symbols import FrameSymbols

        a = _placed(symbols.frame(self.frame_a), self.at_a)
        if self.frame_b != WORLD:
            return a, _placed(symbols.frame(self.frame_b), self.at_b)
        rest = casadi.SX(3, 1)
        return a, _placed(FrameSymbols(self.vector(symbols, "point"), casadi.SX.eye(3), rest, rest), self.at_b)


def read_sides(read: Fields, robot: Robot) -> tuple[str, str, tuple[float, ...]]:
    """Read frame_a, frame_b and, for `frame_b: world`, the point (m). Raises InputError naming file and key."""
    a = read_frame(read, robot, "frame_a")
    fixed = read.text("frame_b") == WORLD
    b = WORLD if fixed else read_frame(read, robot, "frame_b")
    if not fixed and "point" in read:
        raise read.error("point", "'point' is only used with 'frame_b: world'; the origin of a frame is used otherwise")
    if a == b:
        raise read.error(
            "frame_b", f"expected two different frames, found '{a}' twice; further frames can be added under `frames`"
        )
    return a, b, read.vector("point", 3, "m", (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Point(Loop):
    """The origins of two frames coincide: φ = a − b, m, world axes. λ is the force on the body of frame a."""

    kind: ClassVar[str] = "point"

    @classmethod
    def read(cls, name: str, read: Fields, context: ReadContext) -> Self:
        """Read the constraint from its entry. Raises InputError naming file and key."""
        return cls(name, read, *read_sides(read, context.robot))

    def residual(self, symbols: Symbols) -> Residual:
        """Three rows."""
        a, b = self.sides(symbols)
        return Residual(a.position - b.position, _none())

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """Force components, world axes."""
        return tuple(f"{c} [N]" for c in "xyz")


@dataclass(frozen=True)
class Hinge(Loop):
    """The origins of two frames coincide, and so do their axes `axis` (each in the frame's own axes): five equations.

    φ = a − b (m, world axes), then n₁·k and n₂·k, where k is the axis of a, and n₁ and n₂ are perpendicular to the axis
    of b. The multipliers of the last two are moments on the body of frame a, N m, about k × n₁ and k × n₂. φ also
    vanishes where the axes are opposed; `alignment_cosine` excludes this solution.
    """

    axis: tuple[float, ...]
    kind: ClassVar[str] = "hinge"
    alignment_rows: ClassVar[int] = 3

    @classmethod
    def read(cls, name: str, read: Fields, context: ReadContext) -> Self:
        """Read the constraint from its entry. Raises InputError naming file and key."""
        return cls(name, read, *read_sides(read, context.robot), read_direction(read, "axis", (0.0, 0.0, 1.0)))

    def residual(self, symbols: Symbols) -> Residual:
        """Five rows."""
        import casadi

        a, b = self.sides(symbols)
        k = a.rotation @ casadi.DM(self.axis)
        across = [casadi.dot(b.rotation @ casadi.DM(n), k) for n in perpendicular(self.axis)]
        return Residual(casadi.vertcat(a.position - b.position, *across), _none())

    def alignment_cosine(self, symbols: Symbols) -> casadi.SX:
        """The cosine of the angle between the axes of the two sides."""
        import casadi

        a, b = self.sides(symbols)
        return casadi.dot(a.rotation @ casadi.DM(self.axis), b.rotation @ casadi.DM(self.axis))

    def alignment_residual(self, symbols: Symbols) -> casadi.SX:
        """The difference of the axes (3)."""
        import casadi

        a, b = self.sides(symbols)
        return (a.rotation - b.rotation) @ casadi.DM(self.axis)

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """Force components in world axes, and two moments."""
        return (*(f"{c} [N]" for c in "xyz"), "moment 1 [N m]", "moment 2 [N m]")


@dataclass(frozen=True)
class Weld(Loop):
    """Two frames coincide: φ = a − b (m, world axes), then half the vector part of Rᵦᵀ Rₐ − Rₐᵀ Rᵦ (axes of b).

    The multipliers are the force on the body of frame a in world axes, N, and the moment on it in the axes of b, N m.
    The norm of the last three rows is the sine of the angle between the frames, which also vanishes at 180 deg;
    `alignment_cosine` excludes this solution.
    """

    kind: ClassVar[str] = "weld"
    alignment_rows: ClassVar[int] = 9

    @classmethod
    def read(cls, name: str, read: Fields, context: ReadContext) -> Self:
        """Read the constraint from its entry. Raises InputError naming file and key."""
        return cls(name, read, *read_sides(read, context.robot))

    def residual(self, symbols: Symbols) -> Residual:
        """Six rows."""
        import casadi

        a, b = self.sides(symbols)
        turn = b.rotation.T @ a.rotation
        angle = [0.5 * (turn[j, i] - turn[i, j]) for i, j in ((1, 2), (2, 0), (0, 1))]
        return Residual(casadi.vertcat(a.position - b.position, *angle), _none())

    def alignment_cosine(self, symbols: Symbols) -> casadi.SX:
        """The cosine of the angle θ between the frames, from tr Rᵦᵀ Rₐ = 1 + 2 cos θ."""
        import casadi

        a, b = self.sides(symbols)
        return 0.5 * (casadi.trace(b.rotation.T @ a.rotation) - 1.0)

    def alignment_residual(self, symbols: Symbols) -> casadi.SX:
        """Rᵦᵀ Rₐ − 1 (9), whose length is 2 √(1 − cos θ)."""
        import casadi

        a, b = self.sides(symbols)
        return casadi.vec(b.rotation.T @ a.rotation - casadi.SX.eye(3))

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """Force and moment components."""
        return (*(f"{c} [N]" for c in "xyz"), *(f"r{c} [N m]" for c in "xyz"))


@dataclass(frozen=True)
class Distance(Loop):
    """A massless rod between the origins of two frames: φ = (d·d − length²) / (2 length) with the length in m.

    λ is the force in the rod, N; a positive force pushes the ends apart.
    """

    length: float
    kind: ClassVar[str] = "distance"

    @classmethod
    def read(cls, name: str, read: Fields, context: ReadContext) -> Self:
        """Read the constraint from its entry. Raises InputError naming file and key."""
        return cls(name, read, *read_sides(read, context.robot), read.number("length", "m", positive=True))

    @property
    def settable(self) -> dict[str, Settable]:
        """The length can be set too."""
        return super().settable | {"length": Settable("m", POSITIVE)}

    def residual(self, symbols: Symbols) -> Residual:
        """One row."""
        import casadi

        a, b = self.sides(symbols)
        way, length = a.position - b.position, self.value(symbols, "length")
        return Residual((casadi.dot(way, way) - length * length) / (2.0 * length), _none())

    def lever_velocities(self, symbols: Symbols) -> casadi.SX:
        """The relative velocity of its ends (3), m/s."""
        a, b = self.sides(symbols)
        return a.linear - b.linear

    def lengths(self, symbols: Symbols) -> casadi.SX:
        """The length of the rod."""
        import casadi

        return casadi.SX(self.value(symbols, "length"))

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """The rod's force."""
        return ("push [N]",)


def read_direction(read: Fields, key: str, usual: tuple[float, ...]) -> tuple[float, ...]:
    """Read a direction and return it as a unit vector. Raises InputError naming file and key for a length of 0."""
    given = np.array(read.vector(key, 3, "", usual))
    size = length(given)
    if not 1e-6 <= size <= LARGEST:
        raise read.error(key, f"expected a direction, found a vector of length {0 if size < 1e-6 else size:.3g}")
    return tuple((given / size).tolist())


def perpendicular(axis: tuple[float, ...]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Two unit vectors perpendicular to a unit axis and to each other; for a coordinate axis, coordinate axes."""
    k = np.array(axis)
    first = np.cross(np.eye(3)[int(np.argmin(np.abs(k)))], k)
    first /= np.linalg.norm(first)
    return tuple(first.tolist()), tuple(np.cross(k, first).tolist())


def _placed(frame: FrameSymbols, at: tuple[float, ...] | None) -> FrameSymbols:
    if at is None:
        return frame
    import casadi

    arm = frame.rotation @ casadi.SX(casadi.sparsify(casadi.DM(at[:3])))
    turn = casadi.SX(casadi.sparsify(casadi.DM(np.array(at[3:]).reshape(3, 3))))
    linear = frame.linear + casadi.cross(frame.angular, arm)
    return type(frame)(frame.position + arm, frame.rotation @ turn, linear, frame.angular)


def _none() -> casadi.SX:
    import casadi

    return casadi.SX(0, 1)


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
