"""What a robot file says besides its tree, as entries of a scene: closed loops, springs, motors, start.

A scene of a robot file has the same keys as one that a user writes: frames and constraints for loops, forces for
springs, actuated for motors, initial for the start. Entries that the scene has itself, by the same name, take
precedence; `robot_file: tree` uses none of the file's but its notes. Merging twice changes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from bellcrank.config.fields import Fields
from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess
from bellcrank.messages import file_name_here, unknown_name
from bellcrank.notes import as_note
from bellcrank.robot import catalog
from bellcrank.robot.formats.file_readers import read_robot_file
from bellcrank.robot.formats.gepetto_file import motor_notes, read_gepetto, with_joint_types, without_motor
from bellcrank.robot.formats.robot_file import (
    WORLD,
    FileJointSpring,
    FileSphericalSpring,
    FrameBushing,
    FramePlace,
    FrameSpring,
    JointCoupling,
    JointRelation,
    Loop,
    RobotFile,
    relation_text,
)
from bellcrank.robot.load import xacro_text
from bellcrank.scene.source_mapping import SourceMapping, source_mapping

SPRING: Final = ("stiffness", "damping", "free_length")  # numbers of a spring, and of a bushing
BUSHING: Final = ("torque_stiffness", "torque_damping", "force_stiffness", "force_damping")
CHOICES: Final = ("all", "tree")  # of the key robot_file
_LISTS: Final = ("constraints", "forces")
_TABLES: Final = ("frames", "rotor_inertia")


def with_robot_file(data: Mapping[str, Any], source: Path, access: FileAccess) -> tuple[SourceMapping, RobotFile]:
    """Read the robot file that a scene's mapping names.

    Returns a copy of the mapping with the entries of the file, and the file. Raises InputError.
    """
    fields = Fields(data, str(source), access=access)
    path = robot_path(fields)
    try:
        file = read_robot_file(path, access.by(path), xacro_values(fields))
    except InputError as error:
        # The message already names the robot file where the scene was made from it.
        if source == path or str(error).startswith(str(path)):
            raise
        raise InputError(f"{source}: {error}") from None
    file = _with_imported_types(file, fields)
    merged: SourceMapping = source_mapping(data)
    entries = _entries(file, _imported(fields))
    if fields.choice("robot_file", CHOICES, "all") == "tree":
        entries = {key: value for key, value in entries.items() if key == "notes"}
    _merge(merged, entries)
    return merged, file


def xacro_values(fields: Fields) -> dict[str, str]:
    """The values of a xacro file's arguments, under the key xacro_args. Raises InputError."""
    given = fields.mapping("xacro_args", {})
    return {name: xacro_text(given.raw(name)) for name in given}


def without_robot_file(data: Mapping[str, Any], file: RobotFile) -> SourceMapping:
    """A copy of a scene's mapping without the entries that are exactly those of a robot file."""
    bare: SourceMapping = source_mapping(data)
    for key, value in _entries(file, frozenset()).items():
        own = bare.get(key)
        if isinstance(value, list) and isinstance(own, list):
            bare[key] = [entry for entry in own if entry not in value]
        elif isinstance(value, dict) and isinstance(own, dict):
            for name in [name for name in own if name in value and own[name] == value[name]]:
                del own[name]
        elif own == value:
            del bare[key]
        if key in bare and bare[key] in ([], {}):
            del bare[key]
    return bare


def _merge(data: SourceMapping, entries: Mapping[str, Any]) -> None:
    """Add entries that the mapping does not have. Values of an unexpected type are left to their readers."""
    for key, value in entries.items():
        own = data.get(key)
        if key == "actuated" and "actuators" in data:
            continue
        if key not in data:
            data[key] = source_mapping(value)
        elif key in _LISTS and isinstance(own, list):
            names = {entry.get("name") for entry in own if isinstance(entry, Mapping)}
            data[key] = [*source_mapping([entry for entry in value if entry["name"] not in names]), *own]
        elif key == "notes" and isinstance(own, list):
            data[key] = [*own, *(note for note in value if note not in own)]
        elif isinstance(own, Mapping) and (key in _TABLES or (key == "initial" and not {"motion", "run"} & own.keys())):
            data[key].update(source_mapping({name: entry for name, entry in value.items() if name not in own}))


def _entries(file: RobotFile, imported: frozenset[Path]) -> dict[str, Any]:
    """The keys of a scene that say what a robot file says, without loops of files that the scene imports itself."""
    frames: dict[str, Any] = {}
    loops = [] if file.loop_file in imported else file.loops
    taken = frozenset(part.attributes.get("name", "").strip() for part in file.urdf.children)
    constraints = [_constraint(loop, taken, frames) for loop in loops]
    found: dict[str, Any] = {
        "frames": frames,
        "constraints": constraints,
        "forces": [_spring(spring, taken, frames) for spring in file.springs],
        "actuated": list(dict.fromkeys(motor.joint for motor in file.motors)),
        "rotor_inertia": dict(file.rotor_inertia),
        "initial": _start(file),
        "gravity": None if file.gravity is None else list(file.gravity),
        "notes": [as_note(note).updated(where=file.source.name).data() for note in file.notes],
    }
    return {key: value for key, value in found.items() if value}


def _spring(
    spring: FileJointSpring | FileSphericalSpring | FrameSpring | FrameBushing,
    taken: frozenset[str],
    frames: dict[str, Any],
) -> dict[str, Any]:
    if isinstance(spring, FrameSpring | FrameBushing):
        ends = {f"frame_{k}": _frame(f"{spring.name}_{k}", getattr(spring, k), taken, frames) for k in "ab"}
        kind, keys = ("bushing", BUSHING) if isinstance(spring, FrameBushing) else ("spring", SPRING)
        numbers = {key: getattr(spring, key) for key in keys}
        return {"kind": kind, "name": spring.name, **ends, **numbers}
    entry = {"name": f"spring_{spring.joint}", "joint": spring.joint, "stiffness": spring.stiffness}
    if isinstance(spring, FileSphericalSpring):
        return {"kind": "spherical_spring", **entry}
    return {"kind": "joint_spring", **entry, "rest": spring.reference}


def _imported(fields: Fields) -> frozenset[Path]:
    """The files that the scene's own constraints name."""
    return frozenset((fields.access.folder / str(entry["file"])).resolve() for entry in _importers(fields))


def _importers(fields: Fields) -> list[Mapping[str, Any]]:
    """The entries of the scene's constraints that name a file."""
    entries = fields.raw("constraints", ())
    listed = entries if isinstance(entries, list) else []
    return [entry for entry in listed if isinstance(entry, Mapping) and isinstance(entry.get("file"), str)]


def _with_imported_types(file: RobotFile, fields: Fields) -> RobotFile:
    """The robot file with the types of joints that Gepetto's YAML files under `constraints` give, and what of other
    files there is not used. Raises InputError.
    """
    for entry in _importers(fields):
        if entry.get("kind") in ("mjcf", "sdf"):
            name = Path(str(entry["file"])).name
            note = f"{name}: of this file only closed loops and couplings of joints are used"
            file = replace(file, notes=tuple(dict.fromkeys((*file.notes, note))))
        if entry.get("kind") == "gepetto":
            path = fields.access.folder / str(entry["file"])
            if fields.access.allows(path) and path.is_file():  # otherwise refused where the constraints are read
                gepetto = read_gepetto(path)
                others = tuple(note for note in file.notes if not note.startswith(f"{path.name} beside it"))
                file = replace(file, notes=others)
                urdf, notes = with_joint_types(file.urdf, gepetto.joint_types, path)
                notes += motor_notes(path, without_motor(urdf, gepetto.motors))
                file = replace(file, urdf=urdf, notes=tuple(dict.fromkeys((*file.notes, *notes))))
    return file


# ---- loops


def _constraint(loop: Loop, taken: frozenset[str], frames: dict[str, Any]) -> dict[str, Any]:
    if isinstance(loop, JointCoupling | JointRelation):
        return _relation(loop)
    swapped = loop.a.frame == WORLD
    a, b = (loop.b, loop.a) if swapped else (loop.a, loop.b)
    entry: dict[str, Any] = {"kind": loop.kind, "name": loop.name}
    entry["frame_a"] = _frame(f"{loop.name}_a", a, taken, frames)
    if b.frame == WORLD and (loop.kind in ("point", "distance") or not any(b.rpy)):
        entry |= {"frame_b": WORLD, "point": list(b.xyz)}
    else:
        entry["frame_b"] = _frame(f"{loop.name}_b", b, taken, frames)
    if loop.kind in AXIAL:
        axes = [list(loop.axis), list(loop.axis_2)]
        entry["axis"] = axes.pop(1 if swapped and loop.kind == "universal" else 0)
        if loop.kind == "universal":
            entry["axis_2"] = axes.pop()
    if loop.length is not None:
        entry["length"] = loop.length
    return entry


AXIAL: Final = ("hinge", "universal", "prismatic", "planar")  # kinds with the key `axis`


def _frame(name: str, place: FramePlace, taken: frozenset[str], frames: dict[str, Any]) -> str:
    """The name of a frame at a place: that of the robot, or of a new one that is not `taken`."""
    if place.frame != WORLD and not any((*place.xyz, *place.rpy)):
        return place.frame
    while name in taken:
        name += "_frame"
    frames[name] = {"link": place.frame, "xyz": list(place.xyz), "rpy": list(place.rpy)}
    return name


def _relation(loop: JointCoupling | JointRelation) -> dict[str, Any]:
    """A linear coupling, or an expression where it is not linear, holds one joint or relates several."""
    if isinstance(loop, JointCoupling) and loop.leader is not None and len(loop.coefficients) == 2:
        offset, ratio = loop.coefficients
        return {
            "kind": "coupling",
            "name": loop.name,
            "joint_a": loop.leader,
            "joint_b": loop.joint,
            "ratio": ratio,
            "offset": offset,
        }
    return {"kind": "expression", "name": loop.name, "expression": relation_text(loop)}


# ---- start


def _start(file: RobotFile) -> dict[str, Any]:
    """The start by joint; with loops it is the first guess of the search for a consistent start."""
    found: dict[str, Any] = {}
    for joint, value in (file.start or {}).items():
        numbers = value if isinstance(value, tuple) else (value,)

        def entry(of: list[float] | float) -> Any:
            return {"guess": of} if file.loops else of

        if len(numbers) == 1:
            found[joint] = entry(numbers[0])
        elif len(numbers) == 4:
            found[joint] = {"quaternion_xyzw": entry(list(numbers))}
        else:
            found[joint] = {"position": entry(list(numbers[:3])), "quaternion_xyzw": entry(list(numbers[3:]))}
    return found


# ---- The robot file that the key `urdf` of a configuration names.


def robot_path(fields: Fields) -> Path:
    """The path of the file that the key `urdf` names by a path or by the name of a robot. Raises InputError."""
    text = fields.text("urdf")
    path_like = Path(text).suffix in catalog.SUFFIXES or "/" in text
    named = None if path_like or _is_there(fields.access.folder / file_name_here(text)) else catalog.find_named(text)
    if named is not None:
        return named
    path = fields.file("urdf")
    if _is_there(path):
        return path.resolve()
    if path_like:
        raise fields.error("urdf", f"there is no file {path}; write a path relative to the configuration's folder")
    raise fields.error("urdf", unknown_name("robot", text, catalog.names()))


def robot_access(fields: Fields, path: Path) -> FileAccess:
    """Which files the robot file may name."""
    named = fields.access.by(path)
    return replace(named, area=path.parent) if fields.overridden("urdf") else named


def _is_there(path: Path) -> bool:
    """Whether the path exists and is not a folder; the file may still be unreadable."""
    try:
        return path.exists() and not path.is_dir()
    except (OSError, ValueError):
        return False
