"""The file sizing.csv: one line a joint, motor or constraint, with units in the header."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from bellcrank.files import csv_files
from bellcrank.sizing.joint_sizing import JointSizing
from bellcrank.sizing.result import Sizing
from bellcrank.sizing.shaft_sizing import MotorSizing, ShaftSizing
from bellcrank.sizing.structure_loads import StructureLoad


def csv_text(sizing: Sizing) -> str:
    """The text of sizing.csv: one line a joint with a motor, then one a motor of a coupled transmission, then one a
    constraint and joint without a motor of a closed linkage; units in the header, empty where there is no limit, no
    actuator or no such load. Each criterion that is judged of any motor has a column.
    """
    criteria = tuple(dict.fromkeys(name for _, shaft in sizing.shafts for name in shaft.margins))
    rows = [_csv_row(joint, criteria) for joint in sizing.joints]
    rows += [dict.fromkeys(rows[0], "") | _csv_motor_row(motor, criteria) for motor in sizing.motors]
    rows += [dict.fromkeys(rows[0], "") | _csv_load_row(load) for load in sizing.structure]
    return csv_files.csv_text([rows[0], *(row.values() for row in rows)])


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
