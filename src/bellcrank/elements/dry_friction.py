"""Dry friction of joints: a joint sticks until the force that would move it exceeds the static friction.

Each entry of the mapping `joints` has the name of a joint and its `dry_friction`. At speed v > 0 its size is

    F(v) = coulomb + (static − coulomb) exp(−v / speed)     (law: exponential)
    F(v) = coulomb + (static − coulomb) / (1 + v / speed)   (law: hyperbolic)

plus viscous v, against the motion; at v = 0 it takes any value up to `static` that keeps the joint at rest. Sources:
exponential, Armstrong-Hélouvry, Dupont & Canudas de Wit, Automatica 30 (1994); hyperbolic, with coulomb = 0, Leine &
Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems (2004), 6.5.

A `brake` adds `torque` to the friction of its joint while the formula `engaged` is positive, `delay` later where it is
one of time alone.

A simulation holds the mode of each such joint: which way it slides, or that it is at rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Final

from bellcrank.config.fields import Fields
from bellcrank.elements.element import (  # fmt: skip
    NONNEGATIVE,
    POSITIVE,
    Force,
    GeneralisedForce,
    Settable,
    joint_named,
    joint_unit,
    number,
)
from bellcrank.elements.expression import Expression, Term, delayed
from bellcrank.elements.formulas import FormulaReader
from bellcrank.elements.held_inputs import HeldSource, held_source
from bellcrank.elements.joint_forces import Friction, JointForce, Numbers
from bellcrank.robot.robot import RobotJoint

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols

LAWS: Final = ("exponential", "hyperbolic")
KEY: Final = "dry_friction"
BRAKE: Final = "brake"


@dataclass(frozen=True)
class DryFriction(JointForce):
    """Dry friction of a joint, N m or N; `speed` (rad/s or m/s) is that over which it falls from static to Coulomb."""

    coulomb: float
    static: float  # that of `coulomb` where the file gives none
    speed: float
    viscous: float
    law: str
    falls: bool  # whether `static` is given, and friction falls from it to `coulomb`
    brake: float = 0.0  # N m or N
    engaged: Expression | None = None  # the brake is engaged while it is positive
    kind: ClassVar[str] = KEY
    NUMBERS: ClassVar[Numbers] = {
        "coulomb": ("torque", None, NONNEGATIVE),
        "static": ("torque", None, NONNEGATIVE),
        "speed": ("velocity", 1.0, POSITIVE),
        "viscous": ("damping", 0.0, NONNEGATIVE),
        "brake": ("torque", 0.0, POSITIVE),
    }

    @property
    def at_rest(self) -> str:
        """The name of the number that is the largest force at rest."""
        return "static" if self.falls else "coulomb"

    @property
    def settable(self) -> dict[str, Settable]:
        """The numbers of the file, of which the force at rest is more than 0."""
        joint = self.joint
        found = {key: Settable(joint_unit(joint, what), bound) for key, (what, _, bound) in self.NUMBERS.items()}
        least = POSITIVE if self.engaged is None else NONNEGATIVE
        found[self.at_rest] = Settable(joint_unit(joint, "torque"), least)
        keys = [*("coulomb", "static", "speed", "viscous")] if self.falls else ["coulomb", "viscous"]
        return {key: found[key] for key in (keys if self.engaged is None else [*keys, "brake"])}

    @property
    def formulas(self) -> tuple[Expression, ...]:
        """1 while the brake is engaged."""
        if self.engaged is None:
            return ()
        return (
            Expression("", Term("step", (self.engaged.term,)), f"step {self.engaged.meaning or self.engaged.text}"),
        )

    def braking(self, symbols: Symbols) -> casadi.SX:
        """What the brake adds to the friction, N m or N; 0 along motions that are given."""
        if self.engaged is None or not symbols.held_sides:
            return symbols.zero
        return self.value(symbols, "brake") * self.formulas[0].value(symbols, None, symbols.sides(self))

    @property
    def mode(self) -> HeldSource:
        """The entries of u that hold the mode during a run: the direction d of motion, against which the force acts;
        whether the joint moves; and whether its force is what keeps it at rest (1 or 0). Where a brake without other
        friction is released it moves and d is 0.

        In a closed linkage that other joints hold, a joint may be at rest with its largest force (d is 1 or −1) or
        with none (d is 0). The last entry is by how much (x / limit)² may exceed 1: more than 0, up to 1e-6, only
        where the load is the limit up to rounding, so that the joint would stick and slide without end.
        """
        return held_source(f"mode of {self.name}", [0.0, 0.0, 1.0, 0.0])

    def limit(self, symbols: Symbols) -> casadi.SX:
        """The largest force at rest, N m or N."""
        import casadi

        return casadi.SX(self.value(symbols, self.at_rest)) + self.braking(symbols)

    def limits(self, symbols: Symbols) -> tuple[casadi.SX, casadi.SX]:
        """The least and the largest force at rest, N m or N."""
        limit = self.limit(symbols)
        return -limit, limit

    def sliding(self, symbols: Symbols, direction: casadi.SX) -> casadi.SX:
        """The force (N m or N) at the joint's velocity while it moves in a direction, 1 or −1; 0 for 0."""
        import casadi

        velocity = self.shaft(symbols).velocity
        coulomb = self.value(symbols, "coulomb") + self.braking(symbols)
        if self.at_rest == "coulomb":
            return -direction * coulomb
        static, speed = (self.value(symbols, name) for name in ("static", "speed"))
        static += self.braking(symbols)
        share = direction * velocity / speed
        falling = casadi.exp(-share) if self.law == "exponential" else 1.0 / (1.0 + share)
        return -direction * (coulomb + (static - coulomb) * falling)

    def direction(self, symbols: Symbols) -> casadi.SX:
        """The direction of motion, as held by a run; elsewhere the sign of the velocity."""
        import casadi

        return symbols.signal(self.mode)[0] if symbols.held_sides else casadi.sign(self.shaft(symbols).velocity)

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The force of sliding and the viscous one; that of a stuck joint follows from the equations of motion."""
        _, velocity, index = symbols.joint(self.joint)
        force = self.sliding(symbols, self.direction(symbols)) - self.value(symbols, "viscous") * velocity
        return GeneralisedForce(symbols.joint_force(index, force), symbols.zero, force * velocity, False)

    def measure(self, symbols: Symbols) -> casadi.SX:
        """The force at the joint, N m or N, stuck or sliding."""
        return super().measure(symbols) + symbols.holding.get(self.name, 0.0)


def dry_joints(read: Fields) -> tuple[str, ...]:
    """The names of the joints of a scene that have dry friction of their own. Raises InputError."""
    joints = read.mapping("joints", {})
    return tuple(name for name in joints if KEY in joints.mapping(name))


def read_dry_friction(read: Fields, formulas: FormulaReader, forces: Sequence[Force]) -> tuple[DryFriction, ...]:
    """Read the mapping `joints` of a scene. Raises InputError naming file and key."""
    joints, found = read.mapping("joints", {}), []
    for name in joints:
        entry = joints.mapping(name)
        joint = joint_named(joints, name, name, formulas.robot)
        entry.only((KEY, "stop", BRAKE))
        if KEY not in entry and BRAKE not in entry:
            if "stop" not in entry:
                raise joints.error(name, f"expected '{KEY}', 'stop' or '{BRAKE}', found nothing")
            continue
        part = _friction(entry.mapping(KEY), joint) if KEY in entry else _none(entry, joint)
        if BRAKE in entry:
            torque, engaged = _brake(entry.mapping(BRAKE), joint, formulas)
            part = replace(part, brake=torque, engaged=engaged)
        for other in forces:
            if KEY in entry and isinstance(other, Friction) and other.joint.name == name:
                raise entry.error(KEY, f"force '{other.name}' is friction of the same joint; remove one of the two")
            if other.name == part.name:
                raise entry.error(KEY, f"the name '{part.name}' is taken by a force; give the force another name")
        found.append(part)
    return tuple(found)


def _none(entry: Fields, joint: RobotJoint) -> DryFriction:
    """No dry friction but that of a brake."""
    return DryFriction(f"{KEY}_{joint.name}", entry, joint, 0.0, 0.0, 1.0, 0.0, LAWS[0], False)


def _brake(read: Fields, joint: RobotJoint, formulas: FormulaReader) -> tuple[float, Expression]:
    read.only(("torque", "engaged", "delay"))
    torque = number(read, "torque", joint_unit(joint, "torque"), bound=POSITIVE)
    engaged = formulas.read(read, "engaged")
    delay = number(read, "delay", "s", 0.0, NONNEGATIVE)
    if delay:
        if not engaged.operations <= {"time", "number", "parameter"}:
            raise read.error("delay", "a delay requires an 'engaged' that is a formula of time alone, such as t - 0.5")
        engaged = delayed(engaged, delay)
    read.done()
    return torque, engaged


def _friction(read: Fields, joint: RobotJoint) -> DryFriction:
    read.only((*DryFriction.NUMBERS, "law"))
    coulomb = number(read, "coulomb", joint_unit(joint, "torque"), bound=NONNEGATIVE)
    static = number(read, "static", joint_unit(joint, "torque"), coulomb, NONNEGATIVE)
    law = read.choice("law", LAWS, "exponential")
    for key in ("speed", "law"):
        if key in read and "static" not in read:
            raise read.error(key, f"'{key}' says how friction falls from 'static', which is not given")
    if static < coulomb:
        raise read.error("static", f"expected at least 'coulomb', {coulomb:g}, found {static:g}")
    if static == 0.0:
        raise read.error("coulomb", "expected more than 0, found 0; without dry friction remove 'dry_friction'")
    if "static" in read and "speed" not in read:
        raise read.error("static", "'static' requires 'speed', over which friction falls from it to 'coulomb'")
    speed = number(read, "speed", joint_unit(joint, "velocity"), 1.0, POSITIVE)
    viscous = number(read, "viscous", joint_unit(joint, "damping"), 0.0, NONNEGATIVE)
    read.done()
    return DryFriction(f"{KEY}_{joint.name}", read, joint, coulomb, static, speed, viscous, law, "static" in read)
