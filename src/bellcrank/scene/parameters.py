"""The parameters of a scene: numbers that stay symbols in the compiled equations, so that changing one costs nothing.

parameters: {crank_length: {value: 1.241, sets: [joint.coupler.origin.x]}}. A target is one of trace.setting's
(joint.NAME.origin.x, link.NAME.mass, …), frame.NAME.origin.x (y, z, roll, pitch, yaw) of a frame that the card adds,
or force.NAME.FIELD, control.NAME.FIELD, closure.NAME.FIELD. The value has the unit of its targets.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bellcrank.card.fields import Fields
from bellcrank.errors import InputError, among
from bellcrank.scene.part import Part
from bellcrank.trace import ORIGIN, setting

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot

_NAME = re.compile(r"[A-Za-z_]\w*\Z")
_MEANT = ("pi", "t")  # what expressions mean by these is something else


@dataclass(frozen=True)
class Parameter:
    """A number by name. `sets`: what it sets; `places`: those of the targets that are the tracer's, (frame, what)."""

    name: str
    value: float
    unit: str
    sets: tuple[str, ...]
    places: tuple[tuple[int, int], ...]


def read_parameters(read: Fields, robot: Robot, parts: Sequence[Part]) -> dict[str, Parameter]:
    """The mapping `parameters` of a scene, for its robot, forces and controllers; InputError naming file and key."""
    table = read.mapping("parameters", {})
    parameters: dict[str, Parameter] = {}
    owner: dict[object, str] = {}
    for name in table:
        if not _NAME.match(name) or name in _MEANT:
            raise table.error(name, "expected a name of letters, digits and _ other than pi and t")
        entry = table.mapping(name)
        sets = _targets(entry)
        units, places = [], []
        for target in sets:
            try:
                unit, place = _resolve(target, robot, parts)
            except InputError as error:
                raise entry.error("sets", str(error)) from None
            units.append(unit)
            if place is not None:
                places.append(place)
            claim: object = target if place is None else place
            if claim in owner:
                raise entry.error("sets", f"'{target}' is set by the parameter '{owner[claim]}' already")
            owner[claim] = name
        if len(set(units)) > 1:
            raise entry.error("sets", f"expected targets of one unit, found {', '.join(u or '1' for u in units)}")
        unit = units[0] if units else ""
        bounded = unit in ("kg", "kg m^2") or any(target.endswith(".scale") for target in sets)
        off_diagonal = any(target.endswith((".xy", ".xz", ".yz")) for target in sets)
        value = entry.number("value", unit, nonnegative=bounded and not off_diagonal)
        entry.done()
        parameters[name] = Parameter(name, value, unit, sets, tuple(places))
    return parameters


def _targets(entry: Fields) -> tuple[str, ...]:
    given = entry.raw("sets", [])
    if not isinstance(given, (list, tuple)) or not all(isinstance(target, str) for target in given):
        raise entry.error("sets", "expected a list of targets, such as [link.tool.mass]")
    return tuple(given)


def _resolve(target: str, robot: Robot, parts: Sequence[Part]) -> tuple[str, tuple[int, int] | None]:
    """The unit of a target, and where it is the tracer's."""
    kind, _, rest = target.partition(".")
    if kind in ("force", "control", "closure"):
        mine: Mapping[str, Part] = {part.name: part for part in parts if part.owner == kind}
        name, _, field = rest.partition(".")
        if name not in mine:
            raise InputError(among(kind, name, mine))
        units = mine[name].units
        if field not in units:
            raise InputError(among(f"number of {kind} '{name}'", field, units))
        return units[field], None
    tree = robot.equations.tree
    if kind == "frame":
        name, dot, component = rest.rpartition(".origin.")
        added = {f["name"]: k for k, f in enumerate(tree.frames) if k and not f["is_body"] and not f["is_joint"]}
        if not dot or component not in ORIGIN:
            raise InputError(f"a parameter cannot set '{target}'; of a frame it can set frame.NAME.origin.x (y, z, "
                             "roll, pitch, yaw)")  # fmt: skip
        if name not in added:
            raise InputError(among("frame of the card", name, added))
        what = ORIGIN.index(component)
        return ("m" if what < 3 else "rad"), (added[name], what)
    try:
        frame, what = setting(tree, target)
    except InputError as error:
        others = "force.NAME.FIELD, control.NAME.FIELD, closure.NAME.FIELD, frame.NAME.origin.x"
        others = f"; or {others}" if "cannot set" in str(error) else ""
        raise InputError(f"{error}{others}") from None
    return _tracer_unit(what), (frame, what)


def _tracer_unit(what: int) -> str:
    if what < 3 or 7 <= what < 10:
        return "m"
    return "rad" if what < 6 else "kg" if what == 6 else "kg m^2" if what < 16 else ""
