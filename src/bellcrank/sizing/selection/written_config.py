"""The robot configuration with the actuators that were chosen, as a YAML file.

It keeps everything that the original file has, with paths relative to its new place. The actuators are written with all
their figures, so that they need no catalogue, and their masses as payloads at their mounts. The part of an actuator
that the URDF contains already (`Axis.included`) is taken off its payload.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.actuator_fields import ROBOT_WIDE, actuator_data, condition_data, drive_data
from bellcrank.config.yaml_file import read_yaml
from bellcrank.errors import InputError
from bellcrank.files import atomic_write
from bellcrank.files.access import FileAccess
from bellcrank.messages import file_name_here, one_line
from bellcrank.robot import catalog
from bellcrank.scene.overrides import apply_overrides
from bellcrank.scene.robot_config import RobotConfig, read_config
from bellcrank.scene.source_mapping import plain
from bellcrank.sizing.selection.axis_pairs import body_of
from bellcrank.sizing.selection.tables import percent, selected_for

if TYPE_CHECKING:
    from bellcrank.sizing.selection.selection import AxisSelection, Candidate, Selection

_FILES = ("file", "run", "urdf", "catalogue")  # keys whose values name files or folders
_TRUST = "it names files outside its folder; open it with --trust DIR, or write it beside the original"


def write_config(selection: Selection, path: str | Path) -> tuple[Path, tuple[str, ...]]:
    """Write the configuration of a selection, and return its path and notes on what it does not contain.

    Raises InputError where it was not made for a configuration, an axis has no motor, an actuator is lighter than that
    of the URDF, the configuration is no longer that of its file, or the file cannot be written.
    """
    target = Path(path)
    config = None if selection.inputs is None else selection.inputs.config
    if config is None:
        raise InputError(
            f"{path}: not written: the selection was not made for a robot configuration or URDF, which names its file"
        )
    check_target(target, config)
    text, notes = config_text(selection, config, target)
    with atomic_write.writing(target) as temporary:
        temporary.write_text(text, encoding="utf-8")
        notes += _checked(temporary, config)
    return target, notes


def check_target(path: Path, config: RobotConfig) -> None:
    """Refuse a path that is not that of a YAML file, or is that of the configuration itself (InputError)."""
    if path.suffix.lower() not in (".yaml", ".yml"):
        raise InputError(f"{path}: expected the name of a YAML file, such as {path.stem or 'robot'}.yaml")
    if path.exists() and path.resolve() == config.source.resolve():
        raise InputError(f"{path}: is the configuration that was selected for; write another file, so that it is kept")


def config_text(selection: Selection, config: RobotConfig, path: Path) -> tuple[str, tuple[str, ...]]:
    """The text of the file, and notes on what it does not contain. Raises InputError."""
    import yaml

    without = [one.axis.name for one in selection.axes if one.chosen is None]
    if without:
        raise InputError(f"{path}: not written, because no motor was found for {', '.join(without)}")
    folder = path.resolve().parent
    data = _original(config, folder)
    payloads, notes = _payloads(selection, config)
    data.pop(ROBOT_WIDE, None)
    if common := condition_data(selection.conditions):
        data[ROBOT_WIDE] = common
    before = data.get("actuators", {})
    data["actuators"] = {
        one.axis.name: actuator_data(Actuator.of(*selection.stated(one.chosen), one.conditions), selection.conditions)
        | drive_data(before.get(one.axis.name, {}))
        for one in selection.axes
        if one.chosen is not None
    }
    notes += _duty(selection, data)
    if payloads:
        data["payloads"] = [*data.get("payloads", []), *payloads]
        data["mounts"] = {**data.get("mounts", {}), **_mounts(selection)}
    body = yaml.safe_dump(data, allow_unicode=True, sort_keys=False, width=120)
    return "\n".join([*_comments(selection), body]), notes


def _duty(selection: Selection, data: dict[str, Any]) -> tuple[str, ...]:
    """Write the duty program along which motors were judged; a note where the file does not have its motions."""
    duty = None if selection.inputs is None else selection.inputs.duty
    if duty is None:
        return ()
    missing = {step.motion for step in duty if step.motion is not None} - set(data.get("motions", {}))
    if missing:
        names = ", ".join(f"'{name}'" for name in sorted(missing))
        return (f"the duty program is not part of the file, which does not have its motions {names}",)
    data["duty"] = [step.as_data() for step in duty]
    return ()


def _original(config: RobotConfig, folder: Path) -> dict[str, Any]:
    """The keys of the original file with the overrides of the selection, and with paths relative to a folder."""
    if config.source.resolve() == config.urdf.resolve():
        named = next((name for name, urdf in catalog.names().items() if urdf == config.urdf), None)
        written = {"name": config.name, "urdf": named or _relative(config.urdf, folder)}
        changed: dict[str, Any] = plain(apply_overrides(written, config.overrides))
        return changed
    original = apply_overrides(read_yaml(config.source), config.overrides)
    data: dict[str, Any] = moved(plain(original), config.source.resolve().parent, folder)
    return {"name": config.name} | data


def moved(value: Any, old: Path, new: Path, key: str = "") -> Any:
    """Data of a file with the names of files relative to a new folder. Bundled robots keep their names."""
    if isinstance(value, dict):
        return {name: moved(entry, old, new, name) for name, entry in value.items()}
    if isinstance(value, list):
        return [moved(entry, old, new, key) for entry in value]
    if key in _FILES and isinstance(value, str) and not value.startswith("~/"):
        place = old / file_name_here(value)
        return _relative(place, new) if place.exists() else value
    return value


def _relative(path: Path, folder: Path) -> str:
    return Path(os.path.relpath(path.resolve(), folder)).as_posix()


def _payloads(selection: Selection, config: RobotConfig) -> tuple[list[dict[str, Any]], tuple[str, ...]]:
    """Payloads besides those of the original: those that the selection was given, then the actuators' bodies."""
    given = () if selection.inputs is None else selection.inputs.mechanism.robot.payloads[len(config.payloads) :]
    found = [{"mass": one.mass, "frame": one.frame, "cg": list(one.cg), "inertia": list(one.inertia)} for one in given]
    notes = []
    for one in selection.axes if selection.feedback else ():
        assert one.chosen is not None
        if one.chosen.mass is None:
            notes.append(f"the mass of {one.chosen.id} is unknown, and not part of the file")
        elif (payload := actuator_payload(one, one.chosen)) is not None:
            found.append(payload)
    return found, tuple(notes)


def actuator_payload(one: AxisSelection, chosen: Candidate) -> dict[str, Any] | None:
    """The body of an actuator of known mass at its mount, less what the URDF contains; None where nothing is left.

    Raises InputError where the URDF contains more than the body.
    """
    body, included = body_of(chosen.motor, chosen.gear), one.axis.included
    assert body is not None  # its mass is known
    mass, axial, transverse = body.numbers - included.numbers
    if mass == axial == transverse == 0.0:
        return None
    if mass <= 0.0 or axial < 0.0 or transverse < 0.0 or axial > 2.0 * transverse * (1.0 + 1e-9):
        raise InputError(
            f"actuator of {one.axis.name}: {chosen.id} has {body.mass:.4g} kg, and the URDF contains an actuator of "
            f"{included.mass:.4g} kg there (mounts.{one.axis.name}); no payload is the difference of the two bodies; "
            "take the actuator out of the URDF's link"
        )
    direction = np.array(one.axis.mount_direction)
    inertia = transverse * np.eye(3) + (axial - transverse) * np.outer(direction, direction)
    rows, columns = (0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)  # xx xy yy xz yz zz
    return {
        "mass": float(mass),
        "frame": one.axis.mount,
        "cg": [float(x) for x in one.axis.mount_point],
        "inertia": inertia[rows, columns].tolist(),
    }


def _mounts(selection: Selection) -> dict[str, dict[str, Any]]:
    """The mounts of actuators whose masses the file contains, so that another selection replaces them."""
    found = {}
    for one in selection.axes:
        if one.chosen is None or one.chosen.mass is None:
            continue
        body = body_of(one.chosen.motor, one.chosen.gear)
        assert body is not None  # its mass is known
        found[one.axis.name] = {
            "link": one.axis.mount,
            "axis": list(one.axis.mount_direction),
            "included_mass": body.mass,
            "included_axial_inertia": body.axial_inertia,
            "included_transverse_inertia": body.transverse_inertia,
        }
    return found


def _comments(selection: Selection) -> list[str]:
    """What was chosen and why, as lines of comments."""
    of_axes = {one.axis.name: one.conditions for one in selection.axes}
    conditions = "; ".join(f"{name} {value}" for name, value in selected_for(selection.conditions, of_axes))
    lines = [f"Motors and gears chosen by bellcrank select for {selection.robot} ({selection.objective}); {conditions}"]
    for one in selection.axes:
        if (chosen := one.chosen) is None:
            continue
        lines.append(f"{one.axis.name}: {chosen.tier}; {percent(chosen.largest_use)} of {chosen.binding}")
        for product in (chosen.motor, *(() if chosen.gear.kind == "direct" else (chosen.gear,))):
            lines.append(f"  {product.maker} {product.model} ({product.id}): {product.source or 'source not stated'}")
        motor, gear = selection.stated(chosen)
        filled = [f"motor.{name} = {value:g}" for name, value in one.conditions.filled(motor)]
        filled += [f"gear.{name} = {value:g}" for name, value in one.conditions.filled(gear)]
        lines += [f"  assumed: {', '.join(filled)}"] if filled else []
    return [f"# {one_line(line)}" for line in lines]


def _checked(path: Path, config: RobotConfig) -> tuple[str, ...]:
    """Read a file back; a note where it can be read only with --trust. Raises InputError where it differs."""
    access = FileAccess(path.parent, path.parent)
    notes: tuple[str, ...] = ()
    try:
        again = read_config(path, access)
    except InputError:
        everywhere = FileAccess(path.parent, path.parent, (Path(path.resolve().anchor),))
        again, notes = read_config(path, everywhere), (_TRUST,)
    for name in ("gravity", "floating_base", "friction", "frames", "actuated"):
        if getattr(again, name) != getattr(config, name):
            raise InputError(
                f"{config.source}: '{name}' of the file is not that of the configuration that was selected for; it was "
                "changed after reading, and only files can be written again"
            )
    return notes
