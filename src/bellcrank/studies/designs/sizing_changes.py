"""What the axes of a study of sizings change: parameters of the equations, ratings of actuators, motions.

A path names what a parameter of a scene can set (link.forearm_link.mass, joint.elbow.origin.x, frame.tip.origin.x), a
number of a payload (payload.mass, payload.cg.z, payloads.2.inertia.xx), a parameter of the scene, a rating of an
actuator (actuators.elbow.ratio), the duration of a motion (motions.pick.duration), or the time or a joint of a waypoint
(motions.pick.times.2, motions.pick.positions.2.elbow). Any other path is an override of the scene.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from bellcrank.actuators.actuator import RATINGS
from bellcrank.arrays import Array, Mask
from bellcrank.config.fields import parse_number
from bellcrank.elements.element import Bound
from bellcrank.elements.parameters import is_of_the_tree, parameter_bounds, parameter_name, target_of
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.motion.entry_kinds import WaypointsEntry, joins
from bellcrank.motion.generators.path_entries import PathEntry
from bellcrank.robot.model.pinocchio_model import LEAST_MASS
from bellcrank.robot.model.traced_tree import INERTIA, MASS, ORIGIN, SCALE
from bellcrank.scene.scene import Scene
from bellcrank.studies.designs.plain_axes import DesignAxis

Kind = Literal["parameter", "rating", "duration", "waypoint", "override"]
LARGEST = 1e9  # of numbers that certainly fit; larger ones are left to the checks of a single sizing
SMALLEST = 1e-9  # of numbers above 0 that certainly fit
PLACEMENT = re.compile(r"\Amotions\..+\.placement\.(x|y|z|yaw)\Z")
_PAYLOAD = re.compile(r"\Apayloads?(?:\.(\d+))?\.(mass|cg|inertia)(?:\.(\w+))?\Z")
_DURATION = re.compile(r"\Amotions\.(.+)\.duration\Z")
_WAYPOINT = re.compile(r"\Amotions\.(.+)\.(times|positions)\.(\d+)(?:\.(.+))?\Z")
_OF_MOTION = re.compile(
    r"\Amotions\..+\.(times|center|begin|end|points|radius|placement\.[xyz]|placement\.yaw)(\.\d+)?\Z"
)
_RATING = re.compile(r"\Aactuators\.(.+)\.(\w+)\Z")


@dataclass(frozen=True, kw_only=True)
class Change:
    """What an axis changes.

    Attributes:
        kind: A parameter of the equations, a rating, the duration or a waypoint of a motion, or another override.
        path: The path of the override; of a parameter its name in the scene.
        unit: The unit of the number.
        owner: The joint of a rating, or the name of a motion.
        places: What the parameter sets in the tree, as (frame, quantity) of the tracer.
        bounds: Lower bounds of the number.
        moves: Whether it changes where joints or frames are, or a constraint.
        waypoint: The number of the waypoint, and of its coordinate; None where its time is changed.
    """

    kind: Kind
    path: str
    unit: str = ""
    owner: str = ""
    places: tuple[tuple[int, int], ...] = ()
    bounds: tuple[Bound, ...] = ()
    moves: bool = False
    waypoint: tuple[int, int | None] = (0, None)

    def certain(self, values: Array) -> Mask:
        """Whether each value (n,) is one that a scene certainly accepts; others are to be checked one by one."""
        inside = np.isfinite(values) & (np.abs(values) < LARGEST)
        for bound in self.bounds:
            inside &= values >= bound.least if bound.included else values > bound.least
        whats = {what for _, what in self.places}
        if whats & {MASS, SCALE}:
            inside &= values > max(SMALLEST, LEAST_MASS)
        if self.kind in ("rating", "duration") and self.path.rpartition(".")[2] not in (
            "rotor_inertia",
            "gear_inertia",
        ):
            inside &= values > SMALLEST
        return inside


def unit_of(scene: Scene, path: str) -> str | None:
    """The SI unit of what a path changes in a sizing; None where it is an override whose unit is not known here.

    Raises InputError for an unknown link, joint, payload or motion.
    """
    change, _ = _change(scene, path)
    return change.unit or None if change.kind == "override" else change.unit


def changes_of(scene: Scene, axes: Sequence[DesignAxis]) -> tuple[Scene, tuple[Change, ...]]:
    """The scene with a parameter for each number of the tree that the axes vary, and what each axis changes.

    Raises InputError for what does not exist, and for two axes of one quantity.
    """
    declared: dict[str, Any] = {}
    found = []
    for axis in axes:
        change, target = _change(scene, axis.path)
        if not axis.numeric:
            change, target = Change(kind="override", path=axis.path), ""
        if target:
            name = parameter_name(axis.path, [*scene.parameters, *declared])
            declared[name] = {"value": _present(scene, *change.places[0]), "sets": [target]}
            change = Change(**{**vars(change), "path": name})
        found.append(change)
    for axis, change in zip(axes, found, strict=True):
        if change.kind != "override":
            try:
                parse_number(axis.value(1.0), change.unit)
            except ValueError as error:
                raise InputError(f"'{axis.path}': {error}") from None
    repeated = {change.path for change in found if sum(other.path == change.path for other in found) > 1}
    if repeated:
        raise InputError(f"'{next(iter(repeated))}' is varied by two axes; keep one of them")
    if declared:
        scene = scene.with_overrides({f"parameters.{name}": entry for name, entry in declared.items()})
    return scene, tuple(found)


def present_value(scene: Scene, path: str) -> float:
    """The number (SI) of the robot's tree that a path names. Raises InputError for what does not exist."""
    change, _ = _change(scene, path)
    return _present(scene, *change.places[0])


def present_duration(scene: Scene, path: str) -> float | None:
    """The duration, s, that a path names, of a motion without such a key; None for any other path.

    Raises InputError where the motion cannot be made.
    """
    match = _DURATION.match(path)
    entry = scene.data.get("motions", {}).get(match[1]) if match else None
    if match is None or not isinstance(entry, dict) or "duration" in entry:
        return None
    return scene.config.motion(scene.robot, match[1]).duration


def override(scene: Scene, path: str, value: Any) -> tuple[str, Any]:
    """The path and value that give a scene what a path names in a sizing: of the duration of a motion without such a
    key, a speed factor. Raises InputError where the motion cannot be made.
    """
    now = present_duration(scene, path)
    if now is None:
        return path, value
    path = path.removesuffix("duration") + "speed_factor"
    factor = scene.data["motions"][path.split(".", 1)[1].removesuffix(".speed_factor")].get("speed_factor", 1.0)
    return path, factor * now / parse_number(value, "s")


def factors(axes: Sequence[DesignAxis], changes: Sequence[Change]) -> Array:
    """The factors (axes,) from the axes' units to SI units; 1 for what is no plain number."""
    return np.array(
        [
            1.0 if change.kind == "override" else parse_number(axis.value(1.0), change.unit)
            for axis, change in zip(axes, changes, strict=True)
        ]
    )


def _change(scene: Scene, path: str) -> tuple[Change, str]:
    """What a path changes, and the target of the parameter that it needs in the scene, if any."""
    path = path.strip()
    name = path.removeprefix("parameters.").removesuffix(".value")
    parts = (*scene.forces, *scene.control, *scene.constraints)
    if name in scene.parameters:
        parameter = scene.parameters[name]
        bounds = tuple(parameter_bounds(parameter, scene.robot, parts))
        moves = any(what < len(ORIGIN) for _, what in parameter.places) or any(
            target.startswith("constraint.") for target in parameter.sets
        )
        return Change(
            kind="parameter", path=name, unit=parameter.unit, places=parameter.places, bounds=bounds, moves=moves
        ), ""
    target = path if is_of_the_tree(path) else _payload_target(scene, path)
    if target:
        try:
            settable, place = target_of(target, scene.robot, parts)
        except InputError as error:
            raise InputError(f"{scene.source}: '{path}': {error}") from None
        assert place is not None
        moves = place[1] < len(ORIGIN)
        return Change(
            kind="parameter", path=path, unit=settable.unit, places=(place,), bounds=(settable.bound,), moves=moves
        ), target
    known = _rating(scene, path) or _duration(scene, path) or _waypoint(scene, path)
    return known or Change(kind="override", path=path, unit=_unit_of_motion(path)), ""


def _unit_of_motion(path: str) -> str:
    """The unit of a number of a motion's path or timing; empty where it is not known."""
    match = _OF_MOTION.match(path)
    if match is None or bool(match[2]) == (match[1] == "radius" or match[1].startswith("placement")):
        return ""
    return {"times": "s", "placement.yaw": "rad"}.get(match[1], "m")


def _payload_target(scene: Scene, path: str) -> str:
    """The target of a parameter for a number of a payload; empty for any other path. Raises InputError."""
    match = _PAYLOAD.match(path)
    if match is None:
        return ""
    number, what, component = match.groups()
    count = len(scene.config.payloads)
    if not count:
        raise InputError(f"{scene.source}: '{path}': there is no payload; write payloads: [{{mass: 1, frame: NAME}}]")
    if number is None and count > 1:
        raise InputError(f"{scene.source}: '{path}': there are {count} payloads; write payloads.1.{what}, …")
    place = int(number or 1)
    if not 1 <= place <= count:
        raise InputError(f"{scene.source}: '{path}': there are {count} payloads, counted from 1")
    names = {"mass": (), "cg": ORIGIN[:3], "inertia": INERTIA}[what]
    if not names and component is None:
        return f"link.payload {place}.mass"
    if component is not None and component.isdigit() and 1 <= int(component) <= len(names):
        component = names[int(component) - 1]
    if component not in names:
        given = what if component is None else f"{what}.{component}"
        raise InputError(f"{scene.source}: '{path}': {unknown_name('number of a payload', given, _numbers())}")
    return f"link.payload {place}.{what}.{component}"


def _numbers() -> list[str]:
    """The numbers of a payload."""
    return ["mass", *(f"cg.{axis}" for axis in ORIGIN[:3]), *(f"inertia.{entry}" for entry in INERTIA)]


def _rating(scene: Scene, path: str) -> Change | None:
    """The change of a rating of an actuator that is given by its ratings, and states this one."""
    match = _RATING.match(path)
    if match is None or match[1] not in scene.config.actuators or match[2] not in RATINGS:
        return None
    joint, name = match.groups()
    actuator = scene.config.actuators[joint]
    if not actuator.by_ratings or getattr(actuator, name) is None or joint in scene.config.coupled_motors:
        return None
    return Change(kind="rating", path=path, unit=RATINGS[name], owner=joint)


def _duration(scene: Scene, path: str) -> Change | None:
    """The change of the duration of a motion; None where the scene gives the motion's time another meaning."""
    match, entries = _DURATION.match(path), scene.config.motions
    if match is None:
        return None
    if match[1] not in entries:
        raise InputError(f"{scene.source}: '{path}': {unknown_name('motion', match[1], entries)}")
    entry = entries[match[1]]
    limited = isinstance(entry, PathEntry) and any(
        getattr(entry.options, name) is not None for name in ("speed", "acceleration", "jerk")
    )
    if limited or any(joins(one, match[1]) for one in entries.values()):  # others change with it
        return Change(kind="override", path=path, unit="s")
    return Change(kind="duration", path=path, unit="s", owner=match[1])


def _waypoint(scene: Scene, path: str) -> Change | None:
    """The change of a time or a joint's position that a motion through waypoints states; None for anything else."""
    match, motions = _WAYPOINT.match(path), scene.config.motions
    entry = None if match is None else motions.get(match[1])
    if match is None or not isinstance(entry, WaypointsEntry) or not 1 <= int(match[3]) <= len(entry.times):
        return None
    if any(joins(one, match[1]) for one in motions.values()):
        return None
    k, key = int(match[3]) - 1, match[4]
    if match[2] == "times":
        return Change(kind="waypoint", path=path, unit="s", owner=match[1], waypoint=(k, None)) if key is None else None
    posture = entry.positions[k]
    for joint in scene.robot.joints:
        stated = key in posture if isinstance(posture, dict) else (key or "").isdigit() and int(key) <= len(posture)
        if joint.nq == 1 and stated and key == (joint.name if isinstance(posture, dict) else str(joint.q + 1)):
            unit = "m" if joint.kind == "prismatic" else "rad"
            return Change(kind="waypoint", path=path, unit=unit, owner=match[1], waypoint=(k, joint.q))
    return None


def _present(scene: Scene, frame: int, what: int) -> float:
    """The number that the tree has now in a place of the tracer."""
    here = scene.robot.equations.tree.frames[frame]
    numbers = [*here.in_parent.translation, *here.rpy, here.mass, *here.lever, *here.inertia, 1.0]
    return float(numbers[what])
