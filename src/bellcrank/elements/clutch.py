"""Clutches: the key `clutch` of an entry of `joints`, between that joint and another one, or its parent link.

A clutch is dry friction in the relative velocity w = v − ratio v_other with the largest force `torque`, at rest and
while it slips, as long as the formula `engaged` is positive. A force F at the joint is −ratio F at the other one. With
`one_way: forward` it slips forwards without force, as a freewheel does, and holds backwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

from bellcrank.config.fields import Fields
from bellcrank.elements.dry_friction import LAWS, DryFriction, engagement, read_engaged
from bellcrank.elements.element import POSITIVE, Force, Settable, joint_named, joint_unit, number, read_joint
from bellcrank.elements.expression import Expression
from bellcrank.elements.formulas import FormulaReader
from bellcrank.elements.joint_forces import NO_ROW, Shaft
from bellcrank.robot.robot import RobotJoint

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols

KEY: Final = "clutch"
WAYS: Final = {"forward": 1.0, "backward": -1.0}
FREE: Final = 1e-7  # N m or N, far above rounding: what a freewheel holds in its free direction


@dataclass(frozen=True)
class Clutch(DryFriction):
    """A clutch between a joint and another one; None: its parent link. `one_way` is 1, −1, or 0 for both directions."""

    joint: RobotJoint
    other: RobotJoint | None
    ratio: float
    engaged: Expression | None
    one_way: float
    kind: ClassVar[str] = KEY

    @property
    def held(self) -> str:
        """The name of the clutch."""
        return f"{self.joint.name} clutch"

    @property
    def slides(self) -> bool:
        """Whether its force is one, N, at its joint."""
        return self.joint.kind == "prismatic"

    @property
    def row(self) -> int:
        """The place of its velocity in v; −1 between two joints."""
        return self.joint.v if self.other is None else NO_ROW

    @property
    def torque(self) -> float:
        """The largest force, N m or N."""
        return self.coulomb

    @property
    def settable(self) -> dict[str, Settable]:
        """The largest force."""
        return {"torque": Settable(self.unit("torque"), POSITIVE)}

    @property
    def formulas(self) -> tuple[Expression, ...]:
        """1 while it is engaged."""
        return () if self.engaged is None else (engagement(self.engaged),)

    @property
    def is_braked(self) -> bool:
        """Whether it may be released."""
        return self.engaged is not None

    @property
    def is_symmetric(self) -> bool:
        """Whether it holds as much in both directions."""
        return not self.one_way

    def shaft(self, symbols: Symbols) -> Shaft:
        """The relative motion of the two joints."""
        velocity = symbols.joint(self.joint).velocity
        if self.other is None:
            return Shaft(velocity, self.row)
        return Shaft(velocity - self.ratio * symbols.joint(self.other).velocity, self.row)

    def along(self, symbols: Symbols, force: casadi.SX) -> casadi.SX:
        """The generalised force (nv) of a force at the joint."""
        own = symbols.joint_force(self.joint.v, force)
        return own if self.other is None else own + symbols.joint_force(self.other.v, -self.ratio * force)

    def limit(self, symbols: Symbols) -> casadi.SX:
        """The largest force, N m or N; 0 along motions that are given."""
        if not symbols.held_sides:
            return symbols.zero
        most = symbols.zero + self.value(symbols, "torque")
        return most if self.engaged is None else most * self.formulas[0].value(symbols, None, symbols.sides(self))

    def limits(self, symbols: Symbols) -> tuple[casadi.SX, casadi.SX]:
        """The least and the largest force at rest, N m or N."""
        import casadi

        most = self.limit(symbols)
        free = casadi.fmin(most, FREE)
        return -(free if self.one_way > 0.0 else most), free if self.one_way < 0.0 else most

    def sliding(self, symbols: Symbols, direction: casadi.SX) -> casadi.SX:
        """The force (N m or N) while it slips in a direction, 1 or −1; 0 for 0."""
        share = direction if not self.one_way else 0.5 * direction * (1.0 - self.one_way * direction)
        return -share * self.limit(symbols)


def read_clutches(read: Fields, formulas: FormulaReader, forces: Sequence[Force]) -> tuple[Clutch, ...]:
    """Read the clutches in the mapping `joints` of a scene. Raises InputError naming file and key."""
    joints, found = read.mapping("joints", {}), []
    for name in joints:
        if KEY not in joints.mapping(name):
            continue
        joint, entry = joint_named(joints, name, name, formulas.robot), joints.mapping(name).mapping(KEY)
        entry.only(("with", "ratio", "torque", "engaged", "delay", "one_way"))
        if any(force.name == f"{KEY}_{name}" for force in forces):
            raise entry.error("torque", f"the name '{KEY}_{name}' is taken by a force; give the force another name")
        torque = number(entry, "torque", joint_unit(joint, "torque"), bound=POSITIVE)
        way = WAYS[entry.choice("one_way", tuple(WAYS))] if "one_way" in entry else 0.0
        other = read_joint(entry, formulas.robot, "with") if "with" in entry else None
        if other is None and not way:
            raise entry.error(
                "with", "a clutch requires the other joint, 'with'; at one joint write 'brake' or 'one_way'"
            )
        if other is None and "ratio" in entry:
            raise entry.error("ratio", "'ratio' is that of two joints; name the other one by 'with'")
        if other == joint:
            raise entry.error("with", f"expected another joint, found '{name}' itself")
        ratio = number(entry, "ratio", "", 1.0)
        if ratio == 0.0:
            raise entry.error("ratio", "expected a number other than 0, found 0")
        engaged = read_engaged(entry, formulas) if "engaged" in entry or "delay" in entry else None
        entry.done()
        found.append(
            Clutch(f"{KEY}_{name}", entry, torque, torque, 1.0, 0.0, LAWS[0], False, joint, other, ratio, engaged, way)
        )
    return tuple(found)
