"""The parameters of a scene: numbers that are arguments of the compiled equations, so that they can change at no cost.

parameters: {crank_length: {value: 1.241, sets: [joint.coupler.origin.x]}}. A target is one of those of `trace.setting`
(joint.NAME.origin.x, link.NAME.mass, …), frame.NAME.origin.x (y, z, roll, pitch, yaw) of a frame that the configuration
adds, or force.NAME.FIELD, control.NAME.FIELD or constraint.NAME.FIELD (forces.… and constraints.… are accepted too, as
in overrides). The value has the unit of its targets and must satisfy the same bounds as the number in the file.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bellcrank.config.fields import Fields
from bellcrank.elements.element import ANY, NONNEGATIVE, Bound, Element, Settable
from bellcrank.errors import InputError
from bellcrank.messages import format_value, unknown_name
from bellcrank.robot.model.pinocchio_model import LEAST_MASS
from bellcrank.robot.model.traced_tree import INERTIA, ORIGIN, setting

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot

_NAME = re.compile(r"\A[A-Za-z_]\w*\Z")
_NOT_IN_NAMES = re.compile(r"\W")
OF_THE_TREE = ("link", "joint", "frame")  # first parts of targets in the robot's tree
PLURAL = {"forces": "force", "constraints": "constraint"}  # as in the paths of overrides
_RESERVED = ("pi", "t")  # names with a meaning in expressions


@dataclass(frozen=True)
class Parameter:
    """A named number. `sets` are its targets; `places` the (frame, quantity) of those that the tracer sets."""

    name: str
    value: float
    unit: str
    sets: tuple[str, ...]
    places: tuple[tuple[int, int], ...]


def read_parameters(read: Fields, robot: Robot, parts: Sequence[Element]) -> dict[str, Parameter]:
    """Read the mapping `parameters` of a scene with these elements. Raises InputError naming file and key."""
    table = read.mapping("parameters", {})
    parameters: dict[str, Parameter] = {}
    owner: dict[object, str] = {}
    for name in table:
        if not _NAME.match(name) or name in _RESERVED:
            raise table.error(name, "expected a name of letters, digits and _ other than pi and t")
        entry = table.mapping(name)
        sets = _targets(entry)
        units, places, bounds = [], [], []
        for target in sets:
            try:
                (unit, bound), place = _resolve(target, robot, parts)
            except InputError as error:
                raise entry.error("sets", str(error)) from None
            units.append(unit)
            bounds.append(bound)
            if place is not None:
                places.append(place)
            claim: object = target if place is None else place
            if claim in owner:
                raise entry.error("sets", f"'{target}' is already set by the parameter '{owner[claim]}'")
            owner[claim] = name
        if len(set(units)) > 1:
            raise entry.error("sets", f"expected targets of one unit, found {', '.join(u or '1' for u in units)}")
        unit = units[0] if units else ""
        value = entry.number("value", unit)
        for target, bound in zip(sets, bounds, strict=True):
            if not bound.admits(value):
                found = format_value(entry.raw("value"))
                raise entry.error("value", f"expected {bound.wanted(unit)} for '{target}', found {found}")
            if unit == "kg" and 0.0 < value < LEAST_MASS:
                raise entry.error("value", f"expected 0 kg, or {LEAST_MASS:g} kg or more for '{target}'")
        entry.done()
        parameters[name] = Parameter(name, value, unit, sets, tuple(places))
    _check_inertias(table, parameters, robot)
    return parameters


class LinkInertia(NamedTuple):
    """The moments xx, xy, yy, xz, yz, zz of a link, some of which parameters set.

    Attributes:
        link: The name of the link.
        names: The parameter that sets each moment; empty where none does.
        numbers: kg m²: the value of the parameter, or that of the robot's file.
    """

    link: str
    names: tuple[str, ...]
    numbers: tuple[float, ...]


def inertias_set(parameters: Mapping[str, Parameter], robot: Robot) -> list[LinkInertia]:
    """The inertias of links that parameters set."""
    given = {place: p for p in parameters.values() for place in p.places if 10 <= place[1] < 16}
    found = []
    for index in dict.fromkeys(frame for frame, _ in given):
        frame = robot.equations.tree.frames[index]
        setters = [given.get((index, 10 + k)) for k in range(6)]
        names = tuple("" if p is None else p.name for p in setters)
        numbers = tuple(x if p is None else p.value for p, x in zip(setters, frame.inertia, strict=True))
        found.append(LinkInertia(frame.name, names, numbers))
    return found


def parameter_bounds(parameter: Parameter, robot: Robot, parts: Sequence[Element]) -> list[Bound]:
    """The bounds of a parameter's targets."""
    return [_resolve(target, robot, parts)[0].bound for target in parameter.sets]


def is_of_the_tree(path: object) -> bool:
    """Whether a path names a number of the robot's tree, such as link.NAME.mass."""
    return isinstance(path, str) and "." in path and path.partition(".")[0] in OF_THE_TREE


def parameter_name(path: str, taken: Collection[str]) -> str:
    """A name for the parameter that sets a path, other than the names that are taken."""
    name = _NOT_IN_NAMES.sub("_", path)
    while name in taken or not name[0].isalpha():
        name = f"varied_{name}"
    return name


def target_of(target: str, robot: Robot, parts: Sequence[Element]) -> tuple[Settable, tuple[int, int] | None]:
    """The unit and bound of what a parameter may set, and its (frame, quantity) if the tracer sets it.

    Raises InputError for anything that no parameter can set.
    """
    kind, dot, rest = target.partition(".")
    return _resolve(PLURAL.get(kind, kind) + dot + rest, robot, parts)


def _check_inertias(table: Fields, parameters: Mapping[str, Parameter], robot: Robot) -> None:
    """Raise InputError if parameters give a link a negative principal moment of inertia."""
    for link in inertias_set(parameters, robot):
        xx, xy, yy, xz, yz, zz = link.numbers
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if moments[0] < -1e-9 * abs(moments[2]):
            last = [name for name in parameters if name in link.names][-1]
            raise table.mapping(last).error(
                "value",
                f"with {parameters[last].value:g} kg m^2 the link '{link.link}' has a principal moment of inertia "
                f"of {moments[0]:.4g} kg m^2, expected 0 or more",
            )


def _targets(entry: Fields) -> tuple[str, ...]:
    given = entry.raw("sets", [])
    if not isinstance(given, (list, tuple)) or not all(isinstance(target, str) for target in given):
        raise entry.error("sets", "expected a list of targets, such as [link.tool.mass]")
    return tuple(PLURAL.get(kind, kind) + dot + rest for kind, dot, rest in (target.partition(".") for target in given))


def _resolve(target: str, robot: Robot, parts: Sequence[Element]) -> tuple[Settable, tuple[int, int] | None]:
    """The unit and bound of a target, and its (frame, quantity) if the tracer sets it. Raises InputError."""
    kind, _, rest = target.partition(".")
    if kind in ("force", "control", "constraint"):
        mine: Mapping[str, Element] = {part.name: part for part in parts if part.owner == kind}
        name, _, field = rest.partition(".")
        if name not in mine:
            raise InputError(unknown_name(kind, name, mine))
        settable = mine[name].settable
        if field not in settable:
            raise InputError(f"{kind} '{name}': {unknown_name('field', field, settable)}")
        return settable[field], None
    tree = robot.equations.tree
    if kind == "frame":
        name, dot, component = rest.rpartition(".origin.")
        added = {f.name: k for k, f in enumerate(tree.frames) if k and not f.is_body and not f.is_joint}
        if not dot or component not in ORIGIN:
            raise InputError(
                f"a parameter cannot set '{target}'; expected: frame.NAME.origin.x (y, z, roll, pitch, yaw)"
            )
        if name not in added:
            raise InputError(unknown_name("frame of the configuration", name, added))
        what = ORIGIN.index(component)
        return Settable("m" if what < 3 else "rad"), (added[name], what)
    try:
        frame, what = setting(tree, target)
    except InputError as error:
        others = "force.NAME.FIELD, control.NAME.FIELD, constraint.NAME.FIELD, frame.NAME.origin.x"
        others = f"; or {others}" if "cannot set" in str(error) else ""
        raise InputError(f"{error}{others}") from None
    return _of_tracer(what), (frame, what)


def _of_tracer(what: int) -> Settable:
    """The unit and bound of a quantity by its number in `trace.setting`; masses, moments and factors are 0 or more."""
    if what < 6:
        return Settable("m" if what < 3 else "rad")
    if 7 <= what < 10:
        return Settable("m")
    if 10 <= what < 16:
        diagonal = INERTIA[what - 10] in ("xx", "yy", "zz")
        return Settable("kg m^2", NONNEGATIVE if diagonal else ANY)
    return Settable("kg" if what == 6 else "", NONNEGATIVE)
