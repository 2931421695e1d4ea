"""Stops of joints: rigid ends of their ranges, at which impacts follow a coefficient of restitution.

`joints.NAME.stop` has `lower` and `upper` (by default those of the robot file) and `restitution` (0 by default);
`joint_stops: from_file` gives every joint with a range in the robot file a stop without restitution. With `stiffness`
the stop is elastic: a force −max(0, stiffness δ + damping δ̇) at the depth δ. With `latch` a rigid stop holds the joint
once it is reached; with `stop: true` the run ends after the first impact. Source of the law of impact: Newton's;
where several stops are struck at once and it would raise the energy, Poisson's (stuck_joints.py). The flanks of a rigid
gear with backlash are stops of its twist.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np

from bellcrank.config.fields import Fields
from bellcrank.elements.element import (  # fmt: skip
    ANY,
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
from bellcrank.elements.formulas import FormulaReader
from bellcrank.elements.joint_forces import JointForce, JointLoad, Shaft
from bellcrank.robot.robot import Robot, RobotJoint

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.drives import Drive
    from bellcrank.elements.element import AuxiliaryStates
    from bellcrank.elements.symbols import Symbols

KEY: Final = "stop"
ALL: Final = "joint_stops"
CHOICES: Final = ("none", "from_file")


@dataclass(frozen=True)
class JointStop(JointForce):
    """A rigid stop at both ends of a joint's range, rad or m, of which one may be infinite."""

    lower: float
    upper: float
    restitution: float
    latch: bool = False  # once reached it holds the joint
    ends_run: bool = False
    kind: ClassVar[str] = KEY

    @property
    def settable(self) -> dict[str, Settable]:
        """The ends that are finite, and the restitution."""
        unit = joint_unit(self.joint, "position")
        found = {key: Settable(unit, ANY) for key in ("lower", "upper") if math.isfinite(self.number(key))}
        return found if self.latch else {**found, "restitution": Settable("", NONNEGATIVE)}

    @property
    def held(self) -> str:
        """The name of what it stops: its joint."""
        return self.joint.name

    def position(self, symbols: Symbols) -> casadi.SX:
        """The position of what it stops, rad or m."""
        return symbols.joint(self.joint).position

    @property
    def mode(self) -> HeldSource:
        """The entries of u that hold its mode: 1 at the lower and −1 at the upper end, where it holds the joint;
        whether it does not (1 or 0); whether it does; and the impulse of an impact at that instant.
        """
        return held_source(f"mode of {self.name}", [0.0, 1.0, 0.0, 0.0])

    def end(self, symbols: Symbols, name: str) -> casadi.SX:
        """The position of an end, "lower" or "upper"."""
        import casadi

        return casadi.SX(self.value(symbols, name))

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """None: the force of a stop follows from the equations of motion."""
        return GeneralisedForce(symbols.joint_force(self.joint.v, 0.0), symbols.zero, symbols.zero, False)

    def along(self, symbols: Symbols, force: casadi.SX) -> casadi.SX:
        """The generalised force (nv) of a force at the joint."""
        return symbols.joint_force(self.joint.v, force)

    def measure(self, symbols: Symbols) -> casadi.SX:
        """The force at the joint, N m or N, without impacts."""
        import casadi

        return casadi.SX(symbols.holding.get(self.name, 0.0))


@dataclass(frozen=True)
class GearContact(JointStop):
    """The flanks of a rigid gear with backlash, which stop the twist δ = φ/N − q of its drive; see drives.py."""

    drive: Drive = field(repr=False, kw_only=True)

    @property
    def settable(self) -> dict[str, Settable]:
        """None."""
        return {}

    @property
    def held(self) -> str:
        """The name of the gear."""
        return f"{self.joint.name} gear"

    @property
    def rotor(self) -> tuple[AuxiliaryStates, int]:
        """The rate of the twist among the states of the drive."""
        states = self.drive.auxiliary
        assert states is not None
        return states, 1

    def position(self, symbols: Symbols) -> casadi.SX:
        """The twist, rad or m."""
        return symbols.auxiliary(self.rotor[0])[0]

    def shaft(self, symbols: Symbols) -> Shaft:
        """The twist. A unit force turns the rotor forwards and the joint backwards."""
        states, ratio = self.rotor[0], self.drive.gear["ratio"]
        row = symbols.robot.nv + symbols.auxiliary_place(states) + 1
        compliance = 1.0 / (ratio * ratio * self.drive.value(symbols, "gear.inertia"))
        return Shaft(symbols.auxiliary(states)[1], row, own=(row, symbols.zero + compliance), against=self.joint.v)

    def along(self, symbols: Symbols, force: casadi.SX) -> casadi.SX:
        """The generalised force (nv) of a force at the twist."""
        return symbols.joint_force(self.joint.v, -force)


def read_joint_stops(
    read: Fields, robot: Robot, formulas: FormulaReader, names: Sequence[str], driven: Collection[str]
) -> tuple[Force, ...]:
    """Read the stops of a scene. `names` are taken by other forces; `driven` joints follow a prescribed motion.

    Raises InputError naming file and key.
    """
    joints, found = read.mapping("joints", {}), list[Force]()
    own = [name for name in joints if KEY in joints.mapping(name)]
    for name in own:
        joint, entry = joint_named(joints, name, name, robot), joints.mapping(name).mapping(KEY)
        if name in driven:
            raise joints.mapping(name).error(KEY, f"joint '{name}' follows a prescribed motion, which no stop ends")
        found.append(_stop(entry, joint, robot, formulas))
    if read.choice(ALL, CHOICES, "none") == "from_file":
        for joint in robot.joints:
            lower, upper = _range(robot, joint)
            if joint.nv == 1 and joint.name not in (*own, *driven) and (math.isfinite(lower) or math.isfinite(upper)):
                found.append(JointStop(f"stop_{joint.name}", read, joint, lower, upper, 0.0))
    for part in found:
        if part.name in names:
            raise read.error("joints", f"the name '{part.name}' is taken by a force; give the force another name")
    return tuple(found)


def _range(robot: Robot, joint: RobotJoint) -> tuple[float, float]:
    """A joint's range in the robot file; infinite where there is none."""
    return (float(robot.lower[joint.q]), float(robot.upper[joint.q])) if joint.nq == 1 else (-math.inf, math.inf)


def _stop(read: Fields, joint: RobotJoint, robot: Robot, formulas: FormulaReader) -> Force:
    read.only(("lower", "upper", "restitution", "stiffness", "damping", "latch", "stop"))
    unit, file = joint_unit(joint, "position"), _range(robot, joint)
    lower, upper = (
        number(read, key, unit) if key in read else end for key, end in zip(("lower", "upper"), file, strict=True)
    )
    if not (math.isfinite(lower) or math.isfinite(upper)):
        raise read.error("lower", f"joint '{joint.name}' has no range in the robot file; give 'lower', 'upper' or both")
    if not lower < upper:
        key = "lower" if "lower" in read else "upper"
        raise read.error(key, f"expected lower < upper, found {lower:g} and {upper:g} {unit}")
    name = f"stop_{joint.name}"
    if "stiffness" not in read and "damping" not in read:
        restitution = number(read, "restitution", "", 0.0, NONNEGATIVE)
        if restitution > 1.0:
            raise read.error("restitution", f"expected 0 to 1, found {restitution:g}")
        latch = read.flag("latch", False)
        if latch and restitution:
            raise read.error("restitution", "a stop that latches holds the joint, which does not rebound; remove it")
        ends_run = read.flag("stop", False)
        read.done()
        return JointStop(name, read, joint, lower, upper, restitution, latch, ends_run)
    if "latch" in read:
        raise read.error("latch", "an elastic stop (stiffness, damping) does not latch; remove one of the two")
    if "stop" in read:
        raise read.error(
            "stop", "an elastic stop (stiffness, damping) does not end a run; write an event at the joint's position"
        )
    if "restitution" in read:
        raise read.error("restitution", "an elastic stop (stiffness, damping) has no restitution; give one of the two")
    stiffness = number(read, "stiffness", joint_unit(joint, "stiffness"), bound=POSITIVE)
    damping = number(read, "damping", joint_unit(joint, "damping"), 0.0, NONNEGATIVE)
    read.done()
    return JointLoad.read(
        name, Fields(_elastic(joint.name, lower, upper, stiffness, damping), read.where, "forces[0]"), formulas
    )


def _elastic(name: str, lower: float, upper: float, stiffness: float, damping: float) -> dict[str, Any]:
    """The entry of a force that pushes a joint back into its range, and never pulls."""
    parts = []
    for end, sign in ((lower, 1.0), (upper, -1.0)):
        if np.isfinite(end):
            depth, rate = f"({sign * end!r} - {sign!r}*{name}.position)", f"(-{sign!r}*{name}.velocity)"
            parts.append(f"{sign!r}*step({depth})*max(0, {stiffness!r}*{depth} + {damping!r}*{rate})")
    return {"kind": JointLoad.kind, "joint": name, "value": " + ".join(parts)}
