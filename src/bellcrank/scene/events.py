"""The events of a scene: moments at which a condition's function passes zero.

Each entry of the list `events` is {name, when: {joint, position | velocity} or {expression}, direction: up | down |
any, stop}: a joint reaches a position or velocity, or a formula (expression.py) becomes zero. `direction` is the sign
of the function's change (default any); `stop: true` ends the run there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from bellcrank.card.fields import Fields
from bellcrank.errors import InputError
from bellcrank.robot.robot import Robot, RobotJoint
from bellcrank.scene.expression import Expression, parse_expression
from bellcrank.scene.part import joint_unit, read_joint

if TYPE_CHECKING:
    from collections.abc import Mapping

    import casadi

    from bellcrank.scene.symbols import Symbols

DIRECTIONS: Final = {"up": 1, "down": -1, "any": 0}


@dataclass(frozen=True)
class JointReaches:
    """θ − value, or θ̇ − value, of a joint: rad or m, rad/s or m/s."""

    joint: RobotJoint
    what: str
    value: float

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames it uses."""
        return ()

    def apply(self, symbols: Symbols) -> casadi.SX:
        """The function whose zero it is."""
        position, velocity, _ = symbols.joint(self.joint)
        return (position if self.what == "position" else velocity) - self.value


@dataclass(frozen=True)
class EventRule:
    """A named condition; direction +1 (rising), −1 (falling) or 0; `stop`: it ends the run."""

    name: str
    when: JointReaches | Expression
    direction: int
    stop: bool

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames it uses."""
        return self.when.frames

    def apply(self, symbols: Symbols) -> casadi.SX:
        """The function g(t, x, u, p) whose zero is the event."""
        return self.when.apply(symbols)


def read_events(read: Fields, robot: Robot, parameters: Mapping[str, Any]) -> tuple[EventRule, ...]:
    """The list `events` of a scene; InputError naming file and key."""
    events: list[EventRule] = []
    for entry in read.mappings("events"):
        name = entry.text("name")
        if name in [event.name for event in events]:
            raise entry.error("name", f"the name '{name}' is taken by another event")
        when = _read_condition(entry.mapping("when"), robot, parameters)
        direction = DIRECTIONS[entry.choice("direction", tuple(DIRECTIONS), "any")]
        events.append(EventRule(name, when, direction, entry.flag("stop", False)))
        entry.done()
    return tuple(events)


def read_expression(read: Fields, robot: Robot, parameters: Mapping[str, Any]) -> Expression:
    """The formula under the key `expression`; InputError naming file, key and piece."""
    given = read.raw("expression")
    text = str(given) if isinstance(given, (int, float)) and not isinstance(given, bool) else read.text("expression")
    try:
        return parse_expression(text, robot, parameters)
    except InputError as error:
        raise read.error("expression", str(error)) from None


def _read_condition(read: Fields, robot: Robot, parameters: Mapping[str, Any]) -> JointReaches | Expression:
    read.known("joint", "position", "velocity", "expression")
    if "expression" in read:
        condition: JointReaches | Expression = read_expression(read, robot, parameters)
        if "joint" in read:
            raise read.error("joint", "expected a joint or an expression, found both")
    else:
        joint = read_joint(read, robot)
        if ("position" in read) == ("velocity" in read):
            found = "both" if "position" in read else "neither"
            raise read.error("", f"expected the 'position' or the 'velocity' that the joint reaches, found {found}")
        what = "position" if "position" in read else "velocity"
        condition = JointReaches(joint, what, read.number(what, joint_unit(joint, what)))
    read.done()
    return condition
