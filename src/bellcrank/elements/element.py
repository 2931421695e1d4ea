"""What forces and controllers have in common: a name, where they stand in the file, and numbers that parameters set."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Final, NamedTuple

from bellcrank.config.fields import Fields
from bellcrank.errors import InputError
from bellcrank.messages import format_value, unknown_name

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.signal_source import SignalSource
    from bellcrank.elements.symbols import Symbols
    from bellcrank.robot.robot import Robot, RobotJoint

# Units at a revolute and at a prismatic joint.
JOINT_UNITS: Final = {
    "position": ("rad", "m"),
    "velocity": ("rad/s", "m/s"),
    "acceleration": ("rad/s^2", "m/s^2"),
    "torque": ("N m", "N"),
    "stiffness": ("N m/rad", "N/m"),
    "damping": ("N m s/rad", "N s/m"),
}


class Bound(NamedTuple):
    """What a number may be: more than `least`, or `least` itself where that is `included`."""

    least: float
    included: bool

    def admits(self, value: float) -> bool:
        """Whether a number keeps the bound."""
        return value >= self.least if self.included else value > self.least

    def wanted(self, unit: str) -> str:
        """The bound in words, such as "more than 0 N m"."""
        least = f"{self.least:g} {unit}".rstrip()
        return f"{least} or more" if self.included else f"more than {least}"


ANY: Final = Bound(-math.inf, True)
NONNEGATIVE: Final = Bound(0.0, True)
POSITIVE: Final = Bound(0.0, False)
MASS_ERROR: Final = Bound(-1.0, False)  # a share of the mass: something must be left of it


class Settable(NamedTuple):
    """A number that parameters can set: its unit, and what it may be in the file and by a parameter alike."""

    unit: str
    bound: Bound = ANY


@dataclass(frozen=True)
class Applied:
    """What a force adds to the equations of motion.

    force (nv): all of it, N m or N; potential, J: the part of it that is −∂V/∂q; power, W: of the rest, as it
    changes T + V; actuator: whether a motor gives it.
    """

    force: casadi.SX
    potential: casadi.SX
    power: casadi.SX
    actuator: bool


@dataclass(frozen=True)
class Part:
    """A force or controller of a scene. `settable` are the numbers that parameters can set."""

    name: str
    place: Fields = field(repr=False, compare=False)
    owner: ClassVar[str] = "force"  # how parameters address it: force.NAME.FIELD or control.NAME.FIELD
    kind: ClassVar[str] = ""

    @property
    def settable(self) -> dict[str, Settable]:
        """Field -> what "force.NAME.FIELD" can set."""
        return {}

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames it uses."""
        return ()

    @property
    def source(self) -> SignalSource | None:
        """The signal it follows."""
        return None

    def apply(self, symbols: Symbols) -> Applied:
        """Its expressions."""
        raise NotImplementedError

    def wrenches(self, symbols: Symbols) -> tuple[tuple[str, casadi.SX], ...]:
        """(frame, force (3) N and moment (3) N m about its origin, world axes) on the body of each frame it acts on;
        none of a force between joint coordinates.
        """
        return ()

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """What follows an output's name in the titles of the columns of `measure`, such as "[N m]"."""
        raise NotImplementedError

    def measure(self, symbols: Symbols) -> casadi.SX:
        """The force as an instrument would show it."""
        raise NotImplementedError

    def value(self, symbols: Symbols, name: str) -> casadi.SX | float:
        """A number of its own, or the symbol of the parameter that sets it."""
        return symbols.value(self.owner, self.name, name, self.number(name))

    def number(self, name: str) -> float:
        """The number of a field, of a vector's component ("force.x") or of a joint's ("kp.elbow")."""
        key, _, rest = name.partition(".")
        value: Any = getattr(self, key)
        if rest:
            value = value[rest] if isinstance(value, Mapping) else value["xyz".index(rest)]
        return float(value)

    def vector(self, symbols: Symbols, name: str) -> casadi.SX:
        """A vector (3) of its own, each component a number or a symbol."""
        import casadi

        return casadi.vertcat(*[casadi.SX(self.value(symbols, f"{name}.{c}")) for c in "xyz"])


def joint_unit(joint: RobotJoint, quantity: str) -> str:
    """The unit of a quantity at a joint: rad or m, N m or N, …"""
    return JOINT_UNITS[quantity][joint.kind == "prismatic"]


def common_unit(joints: Sequence[RobotJoint], quantity: str) -> str:
    """The unit of a quantity at several joints: one, or both ("N m or N") where they are of both kinds."""
    units = dict.fromkeys(joint_unit(joint, quantity) for joint in joints)
    return next(iter(units)) if len(units) == 1 else " or ".join(JOINT_UNITS[quantity])


def joint_named(read: Fields, key: str, name: str, robot: Robot) -> RobotJoint:
    """A one-degree-of-freedom joint of the robot; InputError naming file and key."""
    try:
        return robot.one_degree_joint(name, "a scene's forces, control, start and events")
    except InputError as error:
        raise read.error(key, str(error).removeprefix(f"{robot.name}: ")) from None


def read_joint(read: Fields, robot: Robot, key: str = "joint") -> RobotJoint:
    """The one-degree-of-freedom joint under a key; InputError naming file and key."""
    return joint_named(read, key, read.text(key), robot)


def read_frame(read: Fields, robot: Robot, key: str = "frame") -> str:
    """The name of a frame under a key; InputError naming file and key."""
    name = read.text(key)
    if name not in robot.frame_names:
        raise read.error(key, unknown_name("frame", name, robot.frame_names))
    return name


def number(read: Fields, key: str, unit: str, default: float | None = None, bound: Bound = ANY) -> float:
    """A number within a bound, needed where the default is None; InputError naming file and key."""
    value = read.number(key, unit) if default is None else read.number(key, unit, default)
    if not bound.admits(value):
        raise read.error(key, f"expected {bound.wanted(unit)}, found {format_value(read.raw(key, default))}")
    return value


def entry_names(entries: Sequence[Mapping[str, Any]]) -> list[str]:
    """The names of a list's entries: what `name` says; else the kind where it is the only one of it, else the kind and
    the joint ("damper_elbow"); a name that is taken gets a number ("damper_elbow_2").
    """
    kinds = [str(entry.get("kind", "entry")) for entry in entries if "name" not in entry]
    taken = {str(entry["name"]) for entry in entries if "name" in entry}
    names = []
    for entry in entries:
        if "name" in entry:
            names.append(str(entry["name"]))
            continue
        kind = str(entry.get("kind", "entry"))
        base = f"{kind}_{entry['joint']}" if kinds.count(kind) > 1 and "joint" in entry else kind
        name, k = base, 1
        while name in taken:
            k += 1
            name = f"{base}_{k}"
        taken.add(name)
        names.append(name)
    return names


def named_entries(read: Fields, key: str) -> list[tuple[str, Fields]]:
    """The mappings of a list with their names; InputError where a name is no text, has a dot or stands twice."""
    entries = read.mappings(key)
    raw = [entry for entry in read.raw(key, ())]
    names = entry_names(raw)
    for k, entry in enumerate(entries):
        if "name" in entry:
            name = entry.text("name")
            if "." in name:
                raise entry.error("name", f"expected a name without dots, found '{name}'")
            if name in names[:k]:
                raise entry.error("name", f"the name '{name}' is taken by entry {names.index(name) + 1}")
        entry.known("name")
    return list(zip(names, entries, strict=True))


def table_span(part: Part) -> tuple[float, float]:
    """First and last time of the table of a torque or wrench, s."""
    assert part.source is not None
    signal = part.source.signal
    held = signal.kinked and signal.coefficients.shape[1] == 1
    return float(signal.breaks[0]), float(signal.breaks[-2 if held else -1])  # held values have a piece beyond the last
