"""Closed loops: two frames that share a point, a hinge or everything, or that stay a distance apart."""

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


@dataclass(frozen=True)
class Loop(Constraint):
    """A constraint between two frames; `frame_b: world` is a frame fixed at `point` (m), with the world's axes.

    `at_a` and `at_b` place the sides in their frames: origin (3) m, then rotation (9) row by row; None: as they are.
    """

    frame_a: str
    frame_b: str
    point: tuple[float, ...]
    at_a: tuple[float, ...] | None = field(default=None, kw_only=True)
    at_b: tuple[float, ...] | None = field(default=None, kw_only=True)

    @property
    def frames(self) -> tuple[str, ...]:
        """Its two sides."""
        return (self.frame_a,) if self.frame_b == WORLD else (self.frame_a, self.frame_b)

    @property
    def settable(self) -> dict[str, Settable]:
        """The fixed point can be set."""
        return {f"point.{c}": Settable("m") for c in "xyz"} if self.frame_b == WORLD else {}

    def sides(self, symbols: Symbols) -> tuple[FrameSymbols, FrameSymbols]:
        """Both frames in the world."""
        import casadi

        from bellcrank.elements.symbols import FrameSymbols

        a = _placed(symbols.frame(self.frame_a), self.at_a)
        if self.frame_b != WORLD:
            return a, _placed(symbols.frame(self.frame_b), self.at_b)
        rest = casadi.SX(3, 1)
        return a, _placed(FrameSymbols(self.vector(symbols, "point"), casadi.SX.eye(3), rest, rest), self.at_b)


def read_sides(read: Fields, robot: Robot) -> tuple[str, str, tuple[float, ...]]:
    """The keys frame_a, frame_b and, for `frame_b: world`, point (m); InputError naming file and key."""
    a = read_frame(read, robot, "frame_a")
    fixed = read.text("frame_b") == WORLD
    b = WORLD if fixed else read_frame(read, robot, "frame_b")
    if not fixed and "point" in read:
        raise read.error("point", "a point is for 'frame_b: world'; a frame's own origin is used otherwise")
    if a == b:
        raise read.error("frame_b", f"a loop closes two frames, both are '{a}'; add a frame under `frames`")
    return a, b, read.vector("point", 3, "m", (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Point(Loop):
    """The origins of two frames coincide: φ = a − b, m, world axes. λ is the force on the body of frame a."""

    kind: ClassVar[str] = "point"

    @classmethod
    def read(cls, name: str, read: Fields, context: ReadContext) -> Self:
        """The constraint of an entry. Raises InputError naming file and key."""
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
    """The origins coincide, and an axis that both frames have, `axis` in each one's own axes, does too: five equations.

    φ = a − b (m, world axes), then n₁·k and n₂·k: k is the axis of a, n₁ and n₂ are perpendicular to that of b. Their
    multipliers are moments on the body of frame a, N m, about k × n₁ and k × n₂ (turned to face it). φ vanishes with
    the axes opposed too, which no start is and no run keeps (`alignment_cosine`).
    """

    axis: tuple[float, ...]
    kind: ClassVar[str] = "hinge"

    @classmethod
    def read(cls, name: str, read: Fields, context: ReadContext) -> Self:
        """The constraint of an entry. Raises InputError naming file and key."""
        return cls(name, read, *read_sides(read, context.robot), read_direction(read, "axis", (0.0, 0.0, 1.0)))

    def residual(self, symbols: Symbols) -> Residual:
        """Five rows."""
        import casadi

        a, b = self.sides(symbols)
        k = a.rotation @ casadi.DM(self.axis)
        across = [casadi.dot(b.rotation @ casadi.DM(n), k) for n in perpendicular(self.axis)]
        return Residual(casadi.vertcat(a.position - b.position, *across), _none())

    def alignment_cosine(self, symbols: Symbols) -> casadi.SX:
        """The cosine of the angle between the two sides' axes."""
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
    The angle's part of φ is its sine, which vanishes at half a turn too; no start is there and no run stays (`alignment_cosine`).
    """

    kind: ClassVar[str] = "weld"

    @classmethod
    def read(cls, name: str, read: Fields, context: ReadContext) -> Self:
        """The constraint of an entry. Raises InputError naming file and key."""
        return cls(name, read, *read_sides(read, context.robot))

    def residual(self, symbols: Symbols) -> Residual:
        """Six rows."""
        import casadi

        a, b = self.sides(symbols)
        turn = b.rotation.T @ a.rotation
        angle = [0.5 * (turn[j, i] - turn[i, j]) for i, j in ((1, 2), (2, 0), (0, 1))]
        return Residual(casadi.vertcat(a.position - b.position, *angle), _none())

    def alignment_cosine(self, symbols: Symbols) -> casadi.SX:
        """The cosine of the angle θ that the frames are turned by: tr Rᵦᵀ Rₐ = 1 + 2 cos θ."""
        import casadi

        a, b = self.sides(symbols)
        return 0.5 * (casadi.trace(b.rotation.T @ a.rotation) - 1.0)

    def alignment_residual(self, symbols: Symbols) -> casadi.SX:
        """Rᵦᵀ Rₐ − 1 (9), of the length 2 √(1 − cos θ)."""
        import casadi

        a, b = self.sides(symbols)
        return casadi.vec(b.rotation.T @ a.rotation - casadi.SX.eye(3))

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """Force and moment components."""
        return (*(f"{c} [N]" for c in "xyz"), *(f"r{c} [N m]" for c in "xyz"))


@dataclass(frozen=True)
class Distance(Loop):
    """The origins of two frames stay `length` (m) apart, as a light rod keeps them: φ = (d·d − length²) / (2 length).

    λ is the rod's force, N, pushing its ends apart where positive.
    """

    length: float
    kind: ClassVar[str] = "distance"

    @classmethod
    def read(cls, name: str, read: Fields, context: ReadContext) -> Self:
        """The constraint of an entry. Raises InputError naming file and key."""
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
        """How fast its ends move against each other."""
        a, b = self.sides(symbols)
        return a.linear - b.linear

    def lengths(self, symbols: Symbols) -> casadi.SX:
        """The rod's."""
        import casadi

        return casadi.SX(self.value(symbols, "length"))

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """The rod's force."""
        return ("push [N]",)


def read_direction(read: Fields, key: str, usual: tuple[float, ...]) -> tuple[float, ...]:
    """A unit vector along the one under a key; InputError where that has no length."""
    given = np.array(read.vector(key, 3, "", usual))
    size = length(given)
    if not 1e-6 <= size <= LARGEST:
        raise read.error(key, f"expected a direction, found a vector of length {0 if size < 1e-6 else size:.3g}")
    return tuple((given / size).tolist())


def perpendicular(axis: tuple[float, ...]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Two unit vectors perpendicular to a unit axis and to each other, coordinate axes where it is one."""
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
