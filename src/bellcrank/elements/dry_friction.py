"""Dry friction of joints: a joint sticks until the force that would move it exceeds the static friction.

Each entry of the mapping `joints` has the name of a joint and its `dry_friction`. At speed v > 0 its size is

    F(v) = coulomb + (static − coulomb) exp(−v / speed)     (law: exponential)
    F(v) = coulomb + (static − coulomb) / (1 + v / speed)   (law: hyperbolic)

plus viscous v, against the motion; at v = 0 it takes any value up to `static` that keeps the joint at rest. Sources:
exponential, Armstrong-Hélouvry, Dupont & Canudas de Wit, Automatica 30 (1994); hyperbolic, with coulomb = 0, Leine &
Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems (2004), 6.5.

A `brake` adds `torque` to the friction of its joint while the formula `engaged` is positive, `delay` later where it is
one of time alone. With `stop: true` a run ends once it has brought the joint to rest.

A pin or slider that closes a loop may have dry friction too: the key `dry_friction` of its entry in `constraints`
(pin_friction.py). A simulation holds the mode of each such joint: which way it slides, or that it is at rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Final

from bellcrank.config.fields import Fields
from bellcrank.elements.element import (  # fmt: skip
    JOINT_UNITS,
    NONNEGATIVE,
    POSITIVE,
    Force,
    GeneralisedForce,
    HeldSource,
    Settable,
    held_source,
    joint_named,
    joint_unit,
    number,
)
from bellcrank.elements.expression import Expression, Term, delayed
from bellcrank.elements.formulas import FormulaReader
from bellcrank.elements.joint_forces import Friction, JointForce, Numbers, Shaft
from bellcrank.robot.robot import Robot, RobotJoint

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.element import AuxiliaryStates
    from bellcrank.elements.symbols import Symbols

LAWS: Final = ("exponential", "hyperbolic")
KEY: Final = "dry_friction"
BRAKE: Final = "brake"
OF_A_JOINT: Final = (KEY, "stop", BRAKE, "clutch")  # the keys of an entry


@dataclass(frozen=True)
class DryFriction(Force):
    """Dry friction at a joint, a rotor or a pin; `speed` (rad/s or m/s) is that over which it falls from static to
    Coulomb friction.
    """

    coulomb: float
    static: float  # that of `coulomb` where the file gives none
    speed: float
    viscous: float
    law: str
    falls: bool  # whether `static` is given, and friction falls from it to `coulomb`
    kind: ClassVar[str] = KEY
    NUMBERS: ClassVar[Numbers] = {
        "coulomb": ("torque", None, NONNEGATIVE),
        "static": ("torque", None, NONNEGATIVE),
        "speed": ("velocity", 1.0, POSITIVE),
        "viscous": ("damping", 0.0, NONNEGATIVE),
    }

    @property
    def held(self) -> str:
        """The name of the joint or pin that it keeps at rest."""
        raise NotImplementedError

    @property
    def slides(self) -> bool:
        """Whether it is a force, N, and not a torque."""
        raise NotImplementedError

    def unit(self, quantity: str) -> str:
        """The unit of a quantity of `JOINT_UNITS` here."""
        return JOINT_UNITS[quantity][self.slides]

    @property
    def rotor(self) -> tuple[AuxiliaryStates, int] | None:
        """Which of a drive's own states is the velocity of the rotor that it acts on; None: the robot moves it."""
        return None

    @property
    def row(self) -> int:
        """The place of its velocity in v; −1: it is none of v, as at a pin of a loop."""
        raise NotImplementedError

    @property
    def is_braked(self) -> bool:
        """Whether its largest force may become 0."""
        return False

    @property
    def is_symmetric(self) -> bool:
        """Whether it holds as much in both directions."""
        return self.rotor is None

    def shaft(self, symbols: Symbols) -> Shaft:
        """What it acts on."""
        raise NotImplementedError

    def along(self, symbols: Symbols, force: casadi.SX) -> casadi.SX:
        """The generalised force (nv) of a force (N m or N) at its shaft."""
        raise NotImplementedError

    @property
    def at_rest(self) -> str:
        """The name of the number that is the largest force at rest."""
        return "static" if self.falls else "coulomb"

    @property
    def settable(self) -> dict[str, Settable]:
        """The numbers of the file, of which the force at rest is more than 0."""
        found = {key: Settable(self.unit(what), bound) for key, (what, _, bound) in self.NUMBERS.items()}
        found[self.at_rest] = Settable(self.unit("torque"), POSITIVE)
        return {key: found[key] for key in (self.NUMBERS if self.falls else ("coulomb", "viscous"))}

    def braking(self, symbols: Symbols) -> casadi.SX:
        """What a brake adds to the friction, N m or N."""
        return symbols.zero

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
        """The force (N m or N) at the velocity while it moves in a direction, 1 or −1; 0 for 0."""
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

    def gain(self, symbols: Symbols) -> casadi.SX | float:
        """What of its force of sliding reaches the joint, as a share: not 1 behind a gear with losses by load."""
        return 1.0

    def gained(self, symbols: Symbols) -> casadi.SX | float:
        """The force (N m or N) that such a gear adds to that of the motor while the joint moves."""
        return 0.0

    def beyond(self, symbols: Symbols) -> casadi.SX:
        """How the force of such a gear depends on the acceleration beyond its limits (1, 3); 0 for others."""
        import casadi

        return casadi.SX.zeros(1, 3)

    def direction(self, symbols: Symbols) -> casadi.SX:
        """The direction of motion, as held by a run; elsewhere the sign of the velocity."""
        import casadi

        return symbols.signal(self.mode)[0] if symbols.held_sides else casadi.sign(self.shaft(symbols).velocity)

    def moving_force(self, symbols: Symbols) -> casadi.SX:
        """The force of sliding and the viscous one, N m or N; that of a stuck joint follows from the equations."""
        friction = self.sliding(symbols, self.direction(symbols))
        return friction - self.value(symbols, "viscous") * self.shaft(symbols).velocity

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The force of sliding and the viscous one."""
        force = self.moving_force(symbols)
        power = force * self.shaft(symbols).velocity
        return GeneralisedForce(self.along(symbols, force), symbols.zero, power, False)

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """The force."""
        return (f"[{self.unit('torque')}]",)

    def measure(self, symbols: Symbols) -> casadi.SX:
        """The force, N m or N, stuck or sliding."""
        return self.moving_force(symbols) + symbols.holding.get(self.name, 0.0)


@dataclass(frozen=True)
class JointDryFriction(DryFriction, JointForce):
    """Dry friction of a joint of the robot, with its brake."""

    brake: float = 0.0  # N m or N
    engaged: Expression | None = None  # the brake is engaged while it is positive
    ends_run: bool = False  # once it is at rest
    NUMBERS: ClassVar[Numbers] = {**DryFriction.NUMBERS, "brake": ("torque", 0.0, POSITIVE)}

    @property
    def held(self) -> str:
        """The name of the joint."""
        return self.joint.name

    @property
    def slides(self) -> bool:
        """Whether the joint is prismatic."""
        return self.joint.kind == "prismatic"

    @property
    def row(self) -> int:
        """The place of the joint's velocity in v."""
        return self.joint.v

    def shaft(self, symbols: Symbols) -> Shaft:
        """The joint."""
        return Shaft(symbols.joint(self.joint).velocity, self.joint.v)

    def along(self, symbols: Symbols, force: casadi.SX) -> casadi.SX:
        """The generalised force (nv) of a force at the joint."""
        return symbols.joint_force(self.joint.v, force)

    @property
    def settable(self) -> dict[str, Settable]:
        """The numbers of the file, that of a brake too."""
        found = super().settable
        if self.engaged is None:
            return found
        least = {self.at_rest: Settable(self.unit("torque"), NONNEGATIVE)}
        return found | least | {"brake": Settable(self.unit("torque"), POSITIVE)}

    @property
    def formulas(self) -> tuple[Expression, ...]:
        """1 while the brake is engaged."""
        return () if self.engaged is None else (engagement(self.engaged),)

    @property
    def is_braked(self) -> bool:
        """Whether it has a brake."""
        return self.engaged is not None

    def braking(self, symbols: Symbols) -> casadi.SX:
        """What the brake adds to the friction, N m or N; 0 along motions that are given."""
        if self.engaged is None or not symbols.held_sides:
            return symbols.zero
        return self.value(symbols, "brake") * self.formulas[0].value(symbols, None, symbols.sides(self))


@dataclass(frozen=True)
class RestingJoint(JointForce):
    """A joint of a closed linkage without dry friction, which is at rest exactly while friction holds the linkage."""

    kind: ClassVar[str] = "rest"

    @property
    def mode(self) -> HeldSource:
        """The entries of u that hold its mode: 0, whether it moves (1 or 0), and twice 0."""
        return held_source(f"mode of {self.name}", [0.0, 1.0, 0.0, 0.0])


def dry_joints(read: Fields) -> tuple[str, ...]:
    """The names of the joints of a scene that have dry friction of their own. Raises InputError."""
    joints = read.mapping("joints", {})
    return tuple(name for name in joints if KEY in joints.mapping(name))


def read_dry_friction(read: Fields, formulas: FormulaReader, forces: Sequence[Force]) -> tuple[JointDryFriction, ...]:
    """Read the mapping `joints` of a scene. Raises InputError naming file and key."""
    joints, found = read.mapping("joints", {}), []
    for name in joints:
        entry = joints.mapping(name)
        joint = joint_named(joints, name, name, formulas.robot)
        entry.only(OF_A_JOINT)
        if KEY not in entry and BRAKE not in entry:
            if not [*entry]:
                raise joints.error(name, f"expected one of {', '.join(OF_A_JOINT)}, found nothing")
            continue
        part = _none(entry, joint)
        if KEY in entry:
            part = JointDryFriction(
                f"{KEY}_{name}",
                entry.mapping(KEY),
                joint,
                **friction_law(entry.mapping(KEY), joint.kind == "prismatic"),
            )
        if BRAKE in entry:
            if "stop" in entry.mapping(BRAKE) and KEY in entry:
                raise entry.mapping(BRAKE).error(
                    "stop",
                    f"joint '{name}' has dry_friction too, which may bring it to rest before the brake; write an event",
                )
            torque, engaged, ends_run = _brake(entry.mapping(BRAKE), joint, formulas)
            part = replace(part, brake=torque, engaged=engaged, ends_run=ends_run)
        for other in forces:
            if KEY in entry and isinstance(other, Friction) and other.joint.name == name:
                raise entry.error(KEY, f"force '{other.name}' is friction of the same joint; remove one of the two")
            if other.name == part.name:
                raise entry.error(KEY, f"the name '{part.name}' is taken by a force; give the force another name")
        found.append(part)
    return tuple(found)


def _none(entry: Fields, joint: RobotJoint) -> JointDryFriction:
    """No dry friction but that of a brake."""
    return JointDryFriction(f"{KEY}_{joint.name}", entry, joint, 0.0, 0.0, 1.0, 0.0, LAWS[0], False)


def _brake(read: Fields, joint: RobotJoint, formulas: FormulaReader) -> tuple[float, Expression, bool]:
    read.only(("torque", "engaged", "delay", "stop"))
    torque = number(read, "torque", joint_unit(joint, "torque"), bound=POSITIVE)
    engaged = read_engaged(read, formulas)
    ends_run = read.flag("stop", False)
    read.done()
    return torque, engaged, ends_run


def read_engaged(read: Fields, formulas: FormulaReader) -> Expression:
    """The formula `engaged`, later by `delay`. Raises InputError."""
    engaged = formulas.read(read, "engaged")
    delay = number(read, "delay", "s", 0.0, NONNEGATIVE)
    if not delay:
        return engaged
    if not engaged.operations <= {"time", "number", "parameter"}:
        raise read.error("delay", "a delay requires an 'engaged' that is a formula of time alone, such as t - 0.5")
    return delayed(engaged, delay)


def engagement(engaged: Expression) -> Expression:
    """1 while a formula is positive, else 0."""
    return Expression("", Term("step", (engaged.term,)), f"step {engaged.meaning or engaged.text}")


def friction_law(read: Fields, slides: bool, *more: str) -> dict[str, Any]:
    """The numbers and the law of an entry `dry_friction`, which may have `more` keys. Raises InputError."""
    unit = {key: JOINT_UNITS[what][slides] for key, (what, *_) in DryFriction.NUMBERS.items()}
    read.only((*DryFriction.NUMBERS, "law", *more))
    coulomb = number(read, "coulomb", unit["coulomb"], bound=NONNEGATIVE)
    static = number(read, "static", unit["static"], coulomb, NONNEGATIVE)
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
    speed = number(read, "speed", unit["speed"], 1.0, POSITIVE)
    viscous = number(read, "viscous", unit["viscous"], 0.0, NONNEGATIVE)
    read.done()
    falls = "static" in read
    return {"coulomb": coulomb, "static": static, "speed": speed, "viscous": viscous, "law": law, "falls": falls}
