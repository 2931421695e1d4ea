"""The events of a scene: times at which the function of a condition crosses zero.

Each entry of the list `events` is {name, when, direction: up | down | any, stop, latch}. `when` is one of {joint,
position | velocity}, {expression}, {aligned: {joint_a, joint_b}}, {singular_constraints: THRESHOLD}, {contact_lost:
CONSTRAINT} and {friction_demand: {constraint, limit}}. `direction` is the sign of the
function's change; the default is any, but down for singular_constraints and contact_lost, and up for friction_demand.
`stop: true` ends the simulation at the event. `latch: true` ends it with a plastic impact that locks the position; the
event then reports the velocity after the impact, the impulse and the energy lost.

A rolling disk ends the simulation where it loses contact, unless it is `two_sided` or an event has the condition
contact_lost for it, and where it lies flat.

`aligned: {joint_a, joint_b, constraint}`: the origins of two joints and the point of the constraint between them are
collinear. `singular_constraints: THRESHOLD`: σ_min/σ_max of J M⁻¹ᐟ² reaches the threshold. `contact_lost: CONSTRAINT`:
the normal force of a rolling disk reaches zero. `friction_demand: {constraint, limit}`: the ratio of friction to normal
force of a rolling disk reaches a limit, such as the coefficient of friction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Protocol

from bellcrank.config.fields import Fields
from bellcrank.elements.constraint import Constraint
from bellcrank.elements.element import joint_unit, read_joint
from bellcrank.elements.expression import Expression, parse_expression
from bellcrank.elements.loop_constraints import WORLD, Loop
from bellcrank.elements.rolling_constraint import RollingDisk
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.robot.robot import Robot, RobotJoint

if TYPE_CHECKING:
    import casadi

    from bellcrank.scene.output_quantities import EquationSymbols


FLAT = 1e-4  # rad: below this angle to the plane the lowest point of a disk is not well defined
DIRECTIONS: Final = {"up": 1, "down": -1, "any": 0}
CONDITIONS: Final = ("joint", "expression", "aligned", "singular_constraints", "contact_lost", "friction_demand")


class Condition(Protocol):
    """A condition of an event: a function g(t, x, u, p) whose zeros are the events, and the frames that it uses."""

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that it uses."""

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zeros are the events."""


@dataclass(frozen=True)
class Aligned:
    """The sine of the angle between two links about joint a's axis, which is zero where they are collinear.

    The links are the lines from the constraint's point P to the origins A and B of joints a and b; they may be
    stretched out or folded back. `link_a` and `link_b` are the child links of the joints, whose origins are A and B.
    For small angles the function is the deviation of the angle at P, rad.
    """

    link_a: str
    link_b: str
    loop: Loop
    axis: tuple[float, ...]

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames of both joints and of the constraint."""
        return (self.link_a, self.link_b, *self.loop.frames)

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zeros are the events."""
        import casadi

        symbols = equations.symbols
        a, b, tip = symbols.frame(self.link_a), symbols.frame(self.link_b), self.loop.sides(symbols)[0].position
        arm_a, arm_b = a.position - tip, b.position - tip
        area = casadi.dot(a.rotation @ casadi.DM(self.axis), casadi.cross(arm_a, arm_b))
        return area / casadi.sqrt(casadi.dot(arm_a, arm_a) * casadi.dot(arm_b, arm_b))


@dataclass(frozen=True)
class SingularConstraint:
    """σ_min/σ_max of J M⁻¹ᐟ² (Reactions.closeness) minus a threshold: small where constraints become dependent."""

    threshold: float

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that it uses."""
        return ()

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zeros are the events."""
        return equations.closeness - self.threshold


@dataclass(frozen=True)
class ContactLost:
    """The normal force of a rolling disk, N."""

    constraint: str

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that it uses."""
        return ()

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zeros are the events."""
        return equations.multipliers(self.constraint)[0]


@dataclass(frozen=True)
class LiesFlat:
    """The sine of the angle between a rolling disk and its plane, minus FLAT."""

    disk: RollingDisk

    @property
    def frames(self) -> tuple[str, ...]:
        """The frame of the disk."""
        return self.disk.frames

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zeros are the events."""
        return self.disk.steepness(equations.symbols) - FLAT


@dataclass(frozen=True)
class FrictionDemand:
    """The friction of a rolling disk minus `limit` times its normal force, N."""

    constraint: str
    limit: float

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that it uses."""
        return ()

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zeros are the events."""
        import casadi

        normal, *friction = casadi.vertsplit(equations.multipliers(self.constraint))
        return casadi.norm_2(casadi.vertcat(*friction)) - self.limit * normal


def read_aligned(read: Fields, robot: Robot, constraints: Sequence[Constraint]) -> Aligned:
    """Read the condition `aligned`. Raises InputError unless exactly one constraint is between the joints."""
    a, b = read_joint(read, robot, "joint_a"), read_joint(read, robot, "joint_b")
    if a == b:
        raise read.error("joint_b", f"expected two different joints, found '{a.name}' twice")

    def beyond(joint: str, frame: str) -> bool:
        return frame != WORLD and joint in set(robot.supporting_joints(frame))

    def between(loop: Loop) -> bool:
        sides = [(loop.frame_a, loop.frame_b), (loop.frame_b, loop.frame_a)]
        return any(beyond(a.name, mine) and beyond(b.name, other) for mine, other in sides)

    loops = [constraint for constraint in constraints if isinstance(constraint, Loop) and constraint.kind != "distance"]
    if "constraint" in read:
        name = read.text("constraint")
        found = [loop for loop in loops if loop.name == name]
        if not found:
            raise read.error("constraint", unknown_name("loop", name, [loop.name for loop in loops]))
    else:
        read.known("constraint")
        found = [loop for loop in loops if between(loop)]
        if len(found) != 1:
            there = ", ".join(loop.name for loop in found) or "none"
            raise read.error(
                "",
                f"expected one constraint between the links that '{a.name}' and '{b.name}' carry, found {there}; "
                "write its name under the key 'constraint'",
            )
    links = robot.urdf.joints
    read.done()
    return Aligned(links[a.name].child, links[b.name].child, found[0], tuple(links[a.name].axis))


def read_singular(read: Fields, constraints: Sequence[Constraint]) -> SingularConstraint:
    """Read the condition `singular_constraints`. Raises InputError for a scene without constraints."""
    if not constraints:
        raise read.error("singular_constraints", "the scene has no constraints")
    return SingularConstraint(read.number("singular_constraints", "", positive=True, maximum=1.0))


def read_contact(read: Fields, key: str, constraints: Sequence[Constraint]) -> str:
    """Read the name of a rolling disk. Raises InputError for any other."""
    name = read.text(key)
    disks = [constraint.name for constraint in constraints if isinstance(constraint, RollingDisk)]
    if name not in disks:
        raise read.error(key, unknown_name("rolling disk", name, disks))
    return name


@dataclass(frozen=True)
class JointReaches:
    """θ − value (rad or m), or θ̇ − value (rad/s or m/s), of a joint."""

    joint: RobotJoint
    what: str
    value: float

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that it uses."""
        return ()

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zeros are the events."""
        position, velocity, _ = equations.symbols.joint(self.joint)
        return (position if self.what == "position" else velocity) - self.value


@dataclass(frozen=True)
class ExpressionVanishes:
    """The value of an expression."""

    expression: Expression

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames in the expression."""
        return self.expression.frames

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zeros are the events."""
        return self.expression.value(equations.symbols, equations.acceleration)


@dataclass(frozen=True)
class EventRule:
    """A named condition with the direction of its zero crossing.

    Attributes:
        name: The name of the event.
        when: The condition.
        direction: +1 (rising), −1 (falling) or 0 (both).
        stop: Whether the event ends the simulation.
        latch: Whether it ends the simulation with an impact that locks the position.
    """

    name: str
    when: Condition
    direction: int
    stop: bool
    latch: bool = False

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that it uses."""
        return self.when.frames

    @property
    def impulse_unit(self) -> str:
        """The unit of the impulse of a latch."""
        if isinstance(self.when, JointReaches):
            return f"{joint_unit(self.when.joint, 'torque')} s"
        return "N m s" if isinstance(self.when, Aligned) else "J s per unit of the expression"

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function g(t, x, u, p) whose zeros are the events."""
        return self.when.function(equations)


def read_events(
    read: Fields, robot: Robot, parameters: Mapping[str, Any], constraints: Sequence[Constraint] = ()
) -> tuple[EventRule, ...]:
    """Read the list `events`, and add the events of rolling disks. Raises InputError naming file and key."""
    events: list[EventRule] = []
    for entry in read.mappings("events"):
        name = entry.text("name")
        if name in [event.name for event in events]:
            raise entry.error("name", f"the name '{name}' is taken by another event")
        when = _read_condition(entry.mapping("when"), robot, parameters, constraints)
        usual = {ContactLost: "down", SingularConstraint: "down", FrictionDemand: "up"}.get(type(when), "any")
        direction = DIRECTIONS[entry.choice("direction", tuple(DIRECTIONS), usual)]
        latch = entry.flag("latch", False)
        if latch and isinstance(when, (ContactLost, FrictionDemand, SingularConstraint)):
            raise entry.error(
                "latch", "a latch requires the position of a joint, an expression, or aligned as its condition"
            )
        if latch and isinstance(when, JointReaches) and when.what == "velocity":
            raise entry.error("latch", "a latch requires the position of a joint, found a velocity")
        if latch and not entry.flag("stop", True):
            raise entry.error(
                "stop",
                "an event that latches ends the simulation; remove stop: false, or write joints.NAME.stop with "
                "latch: true",
            )
        events.append(EventRule(name, when, direction, entry.flag("stop", latch), latch))
        entry.done()
    return (*events, *_contacts(constraints, events))


def _contacts(constraints: Sequence[Constraint], events: Sequence[EventRule]) -> list[EventRule]:
    """The events that end a simulation where a disk loses contact with its plane, or lies flat on it."""
    disks = [constraint for constraint in constraints if isinstance(constraint, RollingDisk)]
    told = {event.when.constraint for event in events if isinstance(event.when, ContactLost)}
    lost = [disk.name for disk in disks if not disk.two_sided and disk.name not in told]
    return [
        *(EventRule(f"{name} contact lost", ContactLost(name), -1, True) for name in lost),
        *(EventRule(f"{disk.name} lies flat", LiesFlat(disk), -1, True) for disk in disks),
    ]


def read_expression(read: Fields, robot: Robot, parameters: Mapping[str, Any]) -> Expression:
    """Read the expression under the key `expression`. Raises InputError naming file and key."""
    given = read.raw("expression")
    text = str(given) if isinstance(given, (int, float)) and not isinstance(given, bool) else read.text("expression")
    try:
        return parse_expression(text, robot, parameters)
    except InputError as error:
        raise read.error("expression", str(error)) from None


def _read_condition(
    read: Fields, robot: Robot, parameters: Mapping[str, Any], constraints: Sequence[Constraint]
) -> Condition:
    read.known(*CONDITIONS, "position", "velocity")
    read.done()
    there = [key for key in CONDITIONS if key in read]
    if there == ["expression"]:
        condition: Condition = ExpressionVanishes(read_expression(read, robot, parameters))
    elif there == ["aligned"]:
        condition = read_aligned(read.mapping("aligned"), robot, constraints)
    elif there == ["singular_constraints"]:
        condition = read_singular(read, constraints)
    elif there == ["contact_lost"]:
        condition = ContactLost(read_contact(read, "contact_lost", constraints))
    elif there == ["friction_demand"]:
        demand = read.mapping("friction_demand")
        limit = demand.number("limit", "", positive=True)
        condition = FrictionDemand(read_contact(demand, "constraint", constraints), limit)
        demand.done()
    elif "joint" in there and "expression" in there:
        raise read.error("joint", "expected a joint or an expression, found both")
    elif len(there) > 1:
        raise read.error(there[1], f"expected one condition, found {' and '.join(there)}")
    else:
        condition = _read_joint_condition(read, robot)
    return condition


def _read_joint_condition(read: Fields, robot: Robot) -> JointReaches:
    joint = read_joint(read, robot)
    if ("position" in read) == ("velocity" in read):
        found = "both" if "position" in read else "neither"
        raise read.error("", f"expected the 'position' or the 'velocity' of the joint, found {found}")
    what = "position" if "position" in read else "velocity"
    return JointReaches(joint, what, read.number(what, joint_unit(joint, what)))
