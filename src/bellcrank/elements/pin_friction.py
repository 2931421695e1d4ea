"""Dry friction of the pins and sliders that close loops: the key `dry_friction` of an entry of `constraints`.

It acts between the two sides of a hinge or a point constraint about an axis k, or of a prismatic constraint along it:

    w = k · (ω_a − ω_b)      or      w = k · (v_a − v_b − ω_b × (a − b)),      with the law of dry_friction.py in w,

by −F k on frame a and F k on frame b. The generalised force is Gᵀ F with G = ∂w/∂v.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bellcrank.config.fields import Fields
from bellcrank.elements.constraint import Constraint
from bellcrank.elements.dry_friction import KEY, DryFriction, friction_law
from bellcrank.elements.element import Force
from bellcrank.elements.joint_forces import NO_ROW, Shaft
from bellcrank.elements.loop_constraints import Hinge, Loop, Point, Prismatic, read_direction

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols

PINS = (Point.kind, Hinge.kind, Prismatic.kind)


@dataclass(frozen=True)
class PinFriction(DryFriction):
    """Dry friction between the sides of a constraint; `axis` is fixed in frame a, or in frame b of a slider."""

    loop: Loop
    axis: tuple[float, ...]

    @property
    def held(self) -> str:
        """The name of the constraint."""
        return self.loop.name

    @property
    def slides(self) -> bool:
        """Whether the constraint is prismatic."""
        return isinstance(self.loop, Prismatic)

    @property
    def row(self) -> int:
        """−1: its velocity is none of v."""
        return NO_ROW

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames of its two sides."""
        return self.loop.frames

    def shaft(self, symbols: Symbols) -> Shaft:
        """The relative motion of the two sides."""
        import casadi

        a, b = self.loop.sides(symbols)
        if self.slides:
            way = b.rotation @ casadi.DM(self.axis)
            slide = a.linear - b.linear - casadi.cross(b.angular, a.position - b.position)
            return Shaft(casadi.dot(way, slide), NO_ROW)
        return Shaft(casadi.dot(a.rotation @ casadi.DM(self.axis), a.angular - b.angular), NO_ROW)

    def along(self, symbols: Symbols, force: casadi.SX) -> casadi.SX:
        """The generalised force (nv) of a force between the sides."""
        import casadi

        return casadi.jtimes(self.shaft(symbols).velocity, symbols.v, force, True)

    def wrenches(self, symbols: Symbols) -> tuple[tuple[str, casadi.SX], ...]:
        """Force and moment on the bodies of its frames while it moves, at their origins."""
        import casadi

        a, b = self.loop.sides(symbols)
        force, none = self.moving_force(symbols), casadi.SX.zeros(3, 1)
        if self.slides:
            push = force * (b.rotation @ casadi.DM(self.axis))
            found = [(a, push, none), (b, -push, -casadi.cross(a.position - b.position, push))]
        else:
            turn = force * (a.rotation @ casadi.DM(self.axis))
            found = [(a, none, turn), (b, none, -turn)]
        placed = []
        for name, (side, push, moment) in zip(self.frames, found, strict=False):
            arm = side.position - symbols.frame(name).position
            placed.append((name, casadi.vertcat(push, moment + casadi.cross(arm, push))))
        return tuple(placed)


def allow_friction(entry: Fields, kind: str) -> None:
    """Allow the key in an entry of `constraints` that has an axis. Raises InputError where another one has it."""
    if kind in PINS:
        entry.known(KEY)
    elif KEY in entry:
        raise entry.error(KEY, f"a constraint of kind '{kind}' has no axis of friction; {' and '.join(PINS)} have one")


def read_pin_friction(
    constraints: Sequence[Constraint], forces: Sequence[Force], joints: Collection[str]
) -> tuple[PinFriction, ...]:
    """Read the friction of constraints; `joints` have dry friction of the same name. Raises InputError."""
    found = []
    for part in constraints:
        if KEY not in part.place:
            continue
        place = part.place
        assert isinstance(part, Hinge | Point | Prismatic)
        if part.name in joints:
            raise place.error(KEY, f"a joint with dry friction is named '{part.name}' too; rename the constraint")
        name, read = f"{KEY}_{part.name}", place.mapping(KEY)
        if any(force.name == name for force in forces):
            raise place.error(KEY, f"the name '{name}' is taken by a force; give the force another name")
        axis, more = _axis(part, read)
        found.append(
            PinFriction(name, read, **friction_law(read, isinstance(part, Prismatic), *more), loop=part, axis=axis)
        )
    return tuple(found)


def _axis(part: Hinge | Point | Prismatic, read: Fields) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """The axis of the friction, and the key that gives it."""
    if not isinstance(part, Point):
        return part.axis, ()
    if "axis" not in read:
        raise read.error("axis", "a point constraint requires the 'axis' of its pin, in the axes of frame_a")
    return read_direction(read, "axis", (0.0, 0.0, 1.0)), ("axis",)
