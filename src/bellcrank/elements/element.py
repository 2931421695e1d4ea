"""The base classes of elements: `Element`, and `Force` for forces and controllers (`Constraint` is in constraint.py).

An element has a name, its entry in the scene file, and numbers that parameters can set. It adds expressions to the
equations of motion of a robot and does not depend on the scene.

States of elements (rotors, currents, integrals) follow q and v in the state x, and have rates of their own. Each
element that has some names them, gives their rates, and their values at the start of a run as functions of the posture
and the velocity there.

Held inputs are entries of u that change at instants of a run only, and are found by it: the sides of switching joints,
the samples of controllers. A scene's signals are known before a run; these are not. In the scene's signals they have
their values at the start; the signals of a run have those that it found, as steps. In u they follow the other signals,
the sides first.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Final, NamedTuple

import numpy as np

from bellcrank.arrays import Array
from bellcrank.config.fields import Fields
from bellcrank.elements.signals import Signal, SignalSource
from bellcrank.errors import InputError
from bellcrank.messages import format_value, unknown_name

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.expression import Expression, Term
    from bellcrank.elements.symbols import Symbols
    from bellcrank.robot.robot import Robot, RobotJoint

# Units at a revolute joint or screw, and at a prismatic joint.
JOINT_UNITS: Final = {
    "position": ("rad", "m"),
    "velocity": ("rad/s", "m/s"),
    "acceleration": ("rad/s^2", "m/s^2"),
    "torque": ("N m", "N"),
    "stiffness": ("N m/rad", "N/m"),
    "damping": ("N m s/rad", "N s/m"),
}


@dataclass(frozen=True)
class AuxiliaryStates:
    """The states of one element.

    Attributes:
        name: Of the element.
        labels: The name and unit of each, such as "rotor position [rad]".
    """

    name: str
    labels: tuple[str, ...]

    @property
    def size(self) -> int:
        """How many they are."""
        return len(self.labels)


@dataclass(frozen=True)
class HeldSource(SignalSource):
    """Entries that a run finds, with the values (width,) at its start."""

    @property
    def start(self) -> Array:
        """The values at the start."""
        values: Array = self.signal.coefficients[0, 0]
        return values


def held_source(name: str, start: Sequence[float]) -> HeldSource:
    """Entries with these values at the start."""
    return HeldSource(name, len(start), 0, partial(_constant, tuple(start)))


def _constant(values: tuple[float, ...]) -> tuple[Signal, Array]:
    return Signal(np.array([0.0, 1.0]), np.array(values)[None, None, :], 0, False), np.zeros(0)


def found_signal(time: Array, values: Array) -> Signal:
    """The signal with values (m, width) from the times (m,) s on, each until the next."""
    return Signal(np.append(time, time[-1] + 1.0), values[:, None, :], 0, True)


class Bound(NamedTuple):
    """A lower bound of a number; `included` says whether the number may equal the bound."""

    least: float
    included: bool

    def admits(self, value: float) -> bool:
        """Whether a number is within the bound."""
        return value >= self.least if self.included else value > self.least

    def wanted(self, unit: str) -> str:
        """The bound in words, such as "more than 0 N m"."""
        least = f"{self.least:g} {unit}".rstrip()
        return f"{least} or more" if self.included else f"more than {least}"


ANY: Final = Bound(-math.inf, True)
NONNEGATIVE: Final = Bound(0.0, True)
POSITIVE: Final = Bound(0.0, False)
MASS_ERROR: Final = Bound(-1.0, False)  # relative to the mass, which must stay positive


class Settable(NamedTuple):
    """The unit and the bound of a number that parameters can set; they also apply to the number in the file."""

    unit: str
    bound: Bound = ANY


@dataclass(frozen=True)
class GeneralisedForce:
    """What a force adds to the equations of motion.

    Attributes:
        force: The generalised force (nv), N m or N.
        potential: The potential energy V, J, of the part of the force that is −∂V/∂q.
        power: The power of the rest of the force, W, which changes T + V.
        actuator: Whether a motor exerts the force.
        kinetic: The kinetic energy, J, of bodies that are not the robot's, such as a rotor; None: there are none.
    """

    force: casadi.SX
    potential: casadi.SX
    power: casadi.SX
    actuator: bool
    kinetic: casadi.SX | None = None


@dataclass(frozen=True)
class Element:
    """A force, controller or constraint of a scene; `place` is its entry in the file."""

    name: str
    place: Fields = field(repr=False, compare=False)
    owner: ClassVar[str] = ""  # the first word of a parameter's target: force.NAME.FIELD, control.…, constraint.…
    kind: ClassVar[str] = ""  # the value of the key `kind` in the file

    @property
    def settable(self) -> dict[str, Settable]:
        """The numbers that parameters can set, by field."""
        return {}

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames it uses."""
        return ()

    @property
    def source(self) -> SignalSource | None:
        """The signal it follows."""
        return None

    @property
    def formulas(self) -> tuple[Expression, ...]:
        """The expressions of its force."""
        return ()

    @property
    def switches(self) -> tuple[Term, ...]:
        """The functions whose signs change where its force is not smooth (expression.py), each once."""
        return tuple(dict.fromkeys(term for formula in self.formulas for term in formula.switches))

    @property
    def switch_sides(self) -> HeldSource | None:
        """The entries of u that hold the signs of `switches` during a run."""

        terms = self.switches
        return held_source(f"sides of {self.owner} {self.name}", [1.0] * len(terms)) if terms else None

    @property
    def mode(self) -> HeldSource | None:
        """The entry of u that holds whether its joint is stuck (dry_friction.py)."""
        return None

    @property
    def samples(self) -> HeldSource | None:
        """The entries of u that a sampled controller holds (sampled_controllers.py)."""
        return None

    @property
    def auxiliary(self) -> AuxiliaryStates | None:
        """Its own states."""
        return None

    def auxiliary_rate(self, symbols: Symbols) -> casadi.SX:
        """The rates of its own states."""
        raise NotImplementedError

    def auxiliary_start(self, symbols: Symbols) -> casadi.SX:
        """Its own states at the start, over time, position, velocity, signals and parameters."""
        raise NotImplementedError

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """The names and units of an output's columns, such as "x [N]"; the output's name precedes them."""
        raise NotImplementedError

    def value(self, symbols: Symbols, name: str) -> casadi.SX | float:
        """The number of a field, or the symbol of the parameter that sets it."""
        return symbols.value(self.owner, self.name, name, self.number(name))

    def number(self, name: str) -> float:
        """The number of a field, of a component of a vector ("force.x") or of a joint ("kp.elbow")."""
        key, _, rest = name.partition(".")
        value: Any = getattr(self, key)
        if rest:
            value = value[rest] if isinstance(value, Mapping) else value["xyz".index(rest)]
        return float(value)

    def vector(self, symbols: Symbols, name: str) -> casadi.SX:
        """A vector field (3); each component is a number, or the symbol of the parameter that sets it."""
        import casadi

        return casadi.vertcat(*[casadi.SX(self.value(symbols, f"{name}.{c}")) for c in "xyz"])


@dataclass(frozen=True)
class Force(Element):
    """A force or controller of a scene."""

    owner: ClassVar[str] = "force"

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        raise NotImplementedError

    def wrenches(self, symbols: Symbols) -> tuple[tuple[str, casadi.SX], ...]:
        """The wrenches (frame, wrench) that it exerts on the bodies of frames, in world axes.

        A wrench (6) is the force, N, and the moment about the frame's origin, N m. A force along joint coordinates has
        none.
        """
        return ()

    def measure(self, symbols: Symbols) -> casadi.SX:
        """The values of an output of this force, in the order of `labels`."""
        raise NotImplementedError


def joint_unit(joint: RobotJoint, quantity: str) -> str:
    """The unit of a quantity at a joint: rad or m, N m or N, …"""
    return JOINT_UNITS[quantity][joint.kind == "prismatic"]


def common_unit(joints: Sequence[RobotJoint], quantity: str) -> str:
    """The unit of a quantity at several joints: "N m or N" for revolute and prismatic ones."""
    units = dict.fromkeys(joint_unit(joint, quantity) for joint in joints)
    return next(iter(units)) if len(units) == 1 else " or ".join(JOINT_UNITS[quantity])


def joint_named(read: Fields, key: str, name: str, robot: Robot) -> RobotJoint:
    """Find a joint with one degree of freedom by name. Raises InputError naming file and key."""
    try:
        return robot.one_degree_joint(name, "a scene's forces, control, start and events")
    except InputError as error:
        raise read.error(key, error.reason) from None


def read_joint(read: Fields, robot: Robot, key: str = "joint") -> RobotJoint:
    """Read the name of a joint with one degree of freedom. Raises InputError naming file and key."""
    return joint_named(read, key, read.text(key), robot)


def read_frame(read: Fields, robot: Robot, key: str = "frame") -> str:
    """Read the name of a frame. Raises InputError naming file and key."""
    name = read.text(key)
    if name not in robot.frame_names:
        raise read.error(key, unknown_name("frame", name, robot.frame_names))
    return name


def number(read: Fields, key: str, unit: str, default: float | None = None, bound: Bound = ANY) -> float:
    """Read a number within a bound; it is required if the default is None. Raises InputError naming file and key."""
    value = read.number(key, unit) if default is None else read.number(key, unit, default)
    if not bound.admits(value):
        raise read.error(key, f"expected {bound.wanted(unit)}, found {format_value(read.raw(key, default))}")
    return value


def entry_names(entries: Sequence[Mapping[str, Any]]) -> list[str]:
    """The names of a list's entries.

    An entry without `name` is named after its kind, or after its kind and joint ("damper_elbow") where several entries
    have that kind. A number is appended where the name is taken ("damper_elbow_2").
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
    """Read the mappings of a list, with their names. Raises InputError for a name with a dot or one that is taken."""
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


def table_span(force: Force) -> tuple[float, float]:
    """The first and the last time of the table of a torque or wrench, s."""
    assert force.source is not None
    signal = force.source.signal
    held = signal.kinked and signal.coefficients.shape[1] == 1
    last = signal.breaks[-2 if held else -1]  # held values have one more piece after the last time
    return float(signal.breaks[0]), float(last)
