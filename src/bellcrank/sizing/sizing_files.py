"""The files that a sizing is written to: sizing.csv, sizing.json and a history of each motion, with units."""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.actuator_fields import actuator_data
from bellcrank.arrays import Array
from bellcrank.files import atomic_write, json_files
from bellcrank.files.csv_files import write_table
from bellcrank.messages import file_name
from bellcrank.motion.motion import Motion
from bellcrank.motion.sampled.csv_file import write_motion
from bellcrank.sizing.joint_sizing import JointSizing, MotorSizing, Peak, ShaftSizing
from bellcrank.sizing.loads.joint_histories import MotionHistory, motion_history, sizing_inputs
from bellcrank.sizing.loads.structure_loads import StructureLoad

if TYPE_CHECKING:
    from bellcrank.sizing.result import Sizing

RESULTS = ("sizing.csv", "sizing.json")
REPORT = "report.html"
FILES = (
    *RESULTS,
    REPORT,
    "history_*.csv",
    "constraint_forces_*.csv",
    "over_time_*.png",
    "*torque_speed.png",
)  # all that a sizing writes
_OURS = re.compile(
    r"\A(?:(?:history|constraint_forces)_[^/\\\0]+\.csv|over_time_[^/\\\0]+\.png|(?:motor_)?torque_speed\.png"
    r"|sizing\.csv|report\.html)\Z"
)


def write_results(sizing: Sizing, folder: str | Path) -> list[Path]:
    """Write sizing.csv and sizing.json into a folder, each as a whole or not at all, and return their paths.

    Raises InputError where a file cannot be written.
    """
    folder = Path(folder)
    text = json_text(sizing)
    atomic_write.write_text(folder / "sizing.json", text)
    return [sizing.to_csv(folder / "sizing.csv"), folder / "sizing.json"]


def write_histories(sizing: Sizing, folder: str | Path) -> list[Path]:
    """Write the files of each motion of a sizing, history_<motion>.csv and others, and return their paths.

    A file holds the motion's rows with the torques of all joints with one degree of freedom and, with actuators,
    torque, speed and power at the motor shafts. It can be read as a motion again. For a closed linkage,
    constraint_forces_<motion>.csv holds the constraints' multipliers. Raises InputError where a file cannot
    be written.
    """
    mechanism, motions, actuators = sizing_inputs(sizing)
    joints = [joint for joint in mechanism.robot.joints if joint.nv == 1]
    paths = []
    for motion, name in zip(motions, file_names(motions), strict=True):
        history = motion_history(mechanism, joints, actuators, motion)
        torque = np.column_stack([joint.torque for joint in history.joints])
        paths.append(write_motion(motion, Path(folder) / f"history_{name}.csv", torque, _shaft_columns(history)))
        if history.multiplier_names:
            paths.append(_write_constraint_forces(history, Path(folder) / f"constraint_forces_{name}.csv"))
    return paths


def _shaft_columns(history: MotionHistory) -> dict[tuple[str, str], Array]:
    """The columns of the motors' shafts: (title, unit) and values (n,)."""
    columns = {}
    for joint in history.joints:
        if joint.shaft is not None:
            columns[f"{joint.name} shaft torque", "N m"] = joint.shaft.torque
            columns[f"{joint.name} shaft speed", "rad/s"] = joint.shaft.speed
            columns[f"{joint.name} shaft power", "W"] = joint.shaft.power
    return columns


def _write_constraint_forces(history: MotionHistory, path: Path) -> Path:
    """Write the multipliers over time, titled as in the CSV file of a run."""
    labels = [("time", "s")]
    for name, label in history.multiplier_names:
        what, _, unit = label.rpartition("[")
        labels.append((f"{name} {what}".strip(), unit.removesuffix("]")))
    return write_table(path, labels, [np.column_stack([history.time, history.multipliers])])


def file_names(motions: Sequence[Motion]) -> list[str]:
    """The part of a file name that stands for each motion; all are different."""
    names: list[str] = []
    for motion in motions:
        name, number = file_name(motion.name), 1
        while name in names:
            number += 1
            name = f"{file_name(motion.name)}_{number}"
        names.append(name)
    return names


def earlier_files(folder: str | Path) -> list[str]:
    """Names of the files that the sizing.json of a folder lists; none where there is no such file."""
    return json_files.listed_files(Path(folder) / "sizing.json", _OURS)


def remove_stale(folder: str | Path, earlier: Iterable[str], written: Iterable[Path]) -> list[str]:
    """Remove the files of an earlier sizing that were not written again, and return their names."""
    kept = {path.name.casefold() for path in written}
    removed = []
    for name in earlier:
        path = Path(folder) / name
        if name.casefold() in kept or path.is_symlink() or not path.is_file():
            continue
        with contextlib.suppress(OSError):
            path.unlink()
            removed.append(name)
    return removed


def json_text(sizing: Sizing, files: Iterable[str] = RESULTS) -> str:
    """The text of sizing.json. "files" lists `files`; `json_files.list_files` adds those that are written later."""
    return json_files.json_text(sizing_data(sizing, files), **sizing.json_layout._asdict())


def sizing_data(sizing: Sizing, files: Iterable[str] = ()) -> dict[str, Any]:
    """The whole sizing, as sizing.json holds it; a margin against a limit of 0 is infinite."""
    return {
        "robot": sizing.robot,
        "motions": list(sizing.motions),
        "gravity": list(sizing.gravity),
        "payloads": [{"mass": mass, "frame": frame} for mass, frame in sizing.payloads],
        "forces": [{"name": force.name, "kind": force.kind, "on": force.on} for force in sizing.forces],
        "parameters": {name: {"value": value, "unit": unit or "1"} for name, value, unit in sizing.parameters},
        "mass_tolerance": sizing.mass_tolerance,
        "mass_tolerance_percent": float(f"{100.0 * sizing.mass_tolerance:.10g}"),
        "joints_without_actuator": list(sizing.joints_without_actuator),
        "files": list(files),
        "inside": sizing.inside,
        "exceeded": list(sizing.exceeded),
        **({"unknown": list(sizing.unknown)} if sizing.unknown else {}),
        "cannot_be_sized": list(sizing.unsizable),
        **({"undetermined": list(sizing.undetermined)} if sizing.undetermined else {}),
        "urdf_errors": list(sizing.urdf_errors),
        "joints_allowed_without_mass": list(sizing.allowed_massless),
        "warnings": list(sizing.warnings),
        "notes": [note.as_dict() for note in sizing.notes],
        "units": {
            "gravity": "m/s^2, in the world",
            "mass": "kg",
            "torque": "N m (N on prismatic joints)",
            "speed": "rad/s (m/s)",
            "position": "rad (m)",
            "power": "W",
            "energy": "J",
            "inertia": "kg m^2 (kg)",
            "force": "N",
            "moment": "N m",
            "time": "s",
            "margin": "share of the limit left (position: rad or m)",
        },
        "supply": _peak(sizing.supply_peak),
        "regeneration": _peak(sizing.regeneration_peak),
        "joints": [_joint_document(joint) for joint in sizing.joints],
        **({"structure": [_load_document(load) for load in sizing.structure]} if sizing.structure else {}),
        **({"motors": [_motor_document(motor) for motor in sizing.motors]} if sizing.motors else {}),
    }


def _peak(peak: Peak | None) -> dict[str, Any] | None:
    return (
        None
        if peak is None
        else {"value": peak.value, "time": peak.time, "motion": peak.motion, "position": list(peak.position)}
    )


def _joint_document(joint: JointSizing) -> dict[str, Any]:
    return {
        "name": joint.name,
        "kind": joint.kind,
        "torque_unit": joint.torque_unit,
        "speed_unit": joint.speed_unit,
        "peaks": {name: _peak(peak) for name, peak in joint.peaks.items()},
        "rms_torque": joint.rms_torque,
        "mean_speed": joint.mean_speed,
        "motoring_energy": joint.motoring_energy,
        "regenerated_energy": joint.regenerated_energy,
        "friction_share": joint.friction_share,
        "holding": {"torque": joint.holding_torque, "position": list(joint.holding_position)},
        "effort": {"limit": joint.effort_limit, "margin": joint.effort_margin},
        "velocity": {"limit": joint.velocity_limit, "margin": joint.velocity_margin},
        "position": {
            "range": list(joint.position_range),
            "limits": list(joint.position_limits),
            "margin": joint.position_margin,
        },
        "cycles": [vars(cycle) for cycle in joint.cycles],
        "exceeded": list(joint.exceeded),
        "shaft": None if joint.shaft is None else _shaft_document(joint.shaft),
    }


def _motor_document(motor: MotorSizing) -> dict[str, Any]:
    return {
        "name": motor.name,
        "joints": list(motor.joints),
        "peak_torque": _peak(motor.peak_torque),
        "peak_speed": _peak(motor.peak_speed),
        "rms_torque": motor.rms_torque,
        "exceeded": list(motor.exceeded),
        "shaft": _shaft_document(motor.shaft),
    }


def _load_document(load: StructureLoad) -> dict[str, Any]:
    peaks = {"force": _peak(load.peak_force), "moment": _peak(load.peak_moment)}
    return {"name": load.name, "kind": load.kind, "peaks": peaks}


def _shaft_document(shaft: ShaftSizing) -> dict[str, Any]:
    document = {
        "actuator": _actuator_document(shaft.actuator),
        "peak_torque": _peak(shaft.peak_torque),
        "rms_torque": shaft.rms_torque,
        "peak_speed": _peak(shaft.peak_speed),
        "curve_use": _peak(shaft.curve_use),
        "inertia_ratio": shaft.inertia_ratio,
        "margins": shaft.margins,
        "criteria": [one.as_dict() for one in shaft.judged.criteria],
        "tightest": shaft.tightest,
        "inside": shaft.inside,
        "verdict": shaft.verdict,
    }
    return document | ({"unknown": shaft.unknown} if shaft.unknown else {})


def _actuator_document(actuator: Actuator) -> dict[str, Any]:
    """The ratings with the torque-speed curve; of a motor with a gear also these and their conditions."""
    points = actuator.curve_points
    ratings = {entry.name: getattr(actuator, entry.name) for entry in fields(Actuator) if entry.init}
    document = ratings | {"curve": points and [list(point) for point in points]}
    return document | ({} if actuator.by_ratings else actuator_data(actuator))


# ---- The file sizing.csv: one line a joint, motor or constraint, with units in the header.


def sizing_rows(sizing: Sizing) -> list[Sequence[object]]:
    """The rows of sizing.csv, first its header with units.

    One is of a joint with a motor, then one of a motor of a coupled transmission, then one of a constraint or a joint
    without a motor of a closed linkage. A cell is empty where there is no limit, no actuator or no such load. Each
    criterion that is judged of any motor has a column.
    """
    criteria = tuple(dict.fromkeys(name for _, shaft in sizing.shafts for name in shaft.margins))
    rows = [_csv_row(joint, criteria) for joint in sizing.joints]
    rows += [dict.fromkeys(rows[0], "") | _csv_motor_row(motor, criteria) for motor in sizing.motors]
    rows += [dict.fromkeys(rows[0], "") | _csv_load_row(load) for load in sizing.structure]
    return [list(rows[0]), *(list(row.values()) for row in rows)]


def _csv_row(joint: JointSizing, criteria: Iterable[str]) -> dict[str, Any]:
    """The cells of a joint's line by column; empty where there is no value."""
    peak = joint.peaks["peak_torque"]
    row: dict[str, Any] = {
        "joint": joint.name,
        "torque unit": joint.torque_unit,
        "speed unit": joint.speed_unit,
        "peak torque [torque unit]": joint.peak_torque,
        "peak torque at rows [torque unit]": joint.sampled_torque,
        "min torque [torque unit]": joint.min_torque,
        "max torque [torque unit]": joint.max_torque,
        "RMS torque [torque unit]": joint.rms_torque,
        "holding torque [torque unit]": joint.holding_torque,
        "peak speed [speed unit]": joint.peak_speed,
        "mean speed [speed unit]": joint.mean_speed,
        "peak motoring power [W]": joint.peak_motoring_power,
        "peak regenerating power [W]": joint.peak_regenerating_power,
        "motoring energy [J]": joint.motoring_energy,
        "regenerated energy [J]": joint.regenerated_energy,
        "friction share of peak [1]": joint.friction_share,
        "largest inertia [kg m^2 or kg]": joint.largest_inertia,
        "peak bearing force [N]": joint.peak_bearing_force,
        "peak tilting moment [N m]": joint.peak_tilting_moment,
        "peak torque at [s]": peak.time,
        "peak torque in motion": peak.motion,
        "effort limit [torque unit]": joint.effort_limit,
        "effort margin [1]": joint.effort_margin,
        "velocity limit [speed unit]": joint.velocity_limit,
        "velocity margin [1]": joint.velocity_margin,
        "position margin [rad or m]": joint.position_margin,
    }
    return _csv_cells(row | {"kind": f"{joint.kind} joint with a motor"} | _csv_shaft(joint.shaft, criteria))


def _csv_motor_row(motor: MotorSizing, criteria: Iterable[str]) -> dict[str, Any]:
    """The cells of a line of a motor of a coupled transmission: what is known at its axis, and its shaft."""
    row = {
        "joint": motor.name,
        "torque unit": "N m",
        "speed unit": "rad/s",
        "peak torque [torque unit]": abs(motor.peak_torque.value),
        "RMS torque [torque unit]": motor.rms_torque,
        "peak speed [speed unit]": motor.peak_speed.value,
        "peak torque at [s]": motor.peak_torque.time,
        "peak torque in motion": motor.peak_torque.motion,
    }
    return _csv_cells(row | {"kind": "motor of a coupled transmission"} | _csv_shaft(motor.shaft, criteria))


def _csv_load_row(load: StructureLoad) -> dict[str, Any]:
    """The cells of a line of a constraint or of a joint without a motor."""
    row = {
        "joint": load.name,
        "peak bearing force [N]": load.peak_force and load.peak_force.value,
        "peak tilting moment [N m]": load.peak_moment and load.peak_moment.value,
        "kind": load.kind,
    }
    return _csv_cells(row)


def _csv_shaft(shaft: ShaftSizing | None, criteria: Iterable[str]) -> dict[str, Any]:
    """The columns of a motor's shaft."""
    row = {
        "shaft peak torque [N m]": shaft and shaft.peak_torque and shaft.peak_torque.value,
        "shaft RMS torque [N m]": shaft and shaft.rms_torque,
        "shaft peak speed [rad/s]": shaft and shaft.peak_speed.value,
        "load to rotor inertia [1]": shaft and shaft.inertia_ratio,
    }
    for name in criteria:
        row[f"{name} margin [1]"] = shaft and shaft.margins.get(name)
    tightest = {"tightest margin [1]": shaft and shaft.tightest_margin, "tightest criterion": shaft and shaft.tightest}
    return row | tightest | {"shaft verdict": shaft and shaft.state}


def _csv_cells(row: dict[str, Any]) -> dict[str, Any]:
    return {
        key: "" if value is None or value != value or value in (math.inf, -math.inf) else value
        for key, value in row.items()
    }
