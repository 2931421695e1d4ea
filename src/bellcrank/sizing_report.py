"""A sizing for people and programs: a table for the terminal, sizing.csv and sizing.json, units always said."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from . import atomic
from .sizing_result import JointSizing, Peak, ShaftSizing, Sizing

NO_LIMIT = "no limit given"


def table(sizing: Sizing) -> str:
    """The sizing as text: joints, then shafts, then the supply; units in the headers."""
    parts = [_heading(sizing), _grid(*_joint_rows(sizing)), "", _grid(*_structure_rows(sizing))]
    if any(joint.shaft for joint in sizing.joints):
        parts += ["", "At the motor shaft (margins with the safety factor on torques):", _grid(*_shaft_rows(sizing))]
    supply, back = sizing.supply_peak, sizing.regeneration_peak
    parts += ["", f"All joints at one instant: {supply.value:.4g} W from the supply (at {supply.time:.4g} s of "
                  f"{supply.motion}), {back.value:.4g} W given back (at {back.time:.4g} s of {back.motion})"]
    if sizing.mass_tolerance:
        parts.append("Peaks are the worst case within the mass tolerance; RMS, energies and supply power are upper "
                     "bounds; reactions and inertias are nominal.")
    return "\n".join(parts)


def verdict(sizing: Sizing) -> str:
    """One paragraph: what is exceeded, or that nothing is, and how many limits are not given."""
    if sizing.exceeded:
        return "\n".join(["EXCEEDED:", *(f"  - {text}" for text in sizing.exceeded)])
    margins = [(margin, f"{joint.name}'s {what}") for joint in sizing.joints for margin, what in _margins(joint)]
    if not margins:
        return "Nothing to compare with: neither the URDF nor a drive gives a limit."
    smallest, where = min(margins)
    return f"All inside: the tightest margin is {smallest:.1%}, {where}."


def write_reports(sizing: Sizing, folder: str | Path) -> list[Path]:
    """Write sizing.csv and sizing.json into a folder, whole or not at all; returns their paths. InputError."""
    folder = Path(folder)
    files = {folder / "sizing.csv": csv_text(sizing), folder / "sizing.json": json_text(sizing)}
    for path, text in files.items():
        atomic.write_text(path, text)
    return list(files)


def csv_text(sizing: Sizing) -> str:
    """One line a joint; units in the headers, empty where there is no limit or no drive."""
    rows = [_csv_row(joint) for joint in sizing.joints]
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return buffer.getvalue()


def json_text(sizing: Sizing) -> str:
    """The whole sizing; numbers that are not finite (a margin against a limit of 0) are written as null."""
    document = {
        "robot": sizing.robot, "motions": list(sizing.motions), "mass_tolerance": sizing.mass_tolerance,
        "inside": sizing.inside, "exceeded": list(sizing.exceeded), "warnings": list(sizing.warnings),
        "units": {"torque": "N m (N on prismatic joints)", "speed": "rad/s (m/s)", "position": "rad (m)", "power": "W",
                  "energy": "J", "inertia": "kg m^2 (kg)", "force": "N", "moment": "N m", "time": "s",
                  "margin": "share of the limit left (position: rad or m)"},
        "supply": _peak(sizing.supply_peak), "regeneration": _peak(sizing.regeneration_peak),
        "joints": [_joint_document(joint) for joint in sizing.joints],
    }
    return json.dumps(_finite(document), indent=1, allow_nan=False) + "\n"


def _heading(sizing: Sizing) -> str:
    tolerance = f", mass tolerance ±{sizing.mass_tolerance:.3g}" if sizing.mass_tolerance else ""
    return f"{sizing.robot}, {len(sizing.motions)} motion(s): {', '.join(sizing.motions)}{tolerance}\n"


def _joint_rows(sizing: Sizing) -> tuple[list[str], list[list[str]]]:
    unit, speed = _units(sizing)
    header = ["joint", f"peak\n[{unit}]", f"min\n[{unit}]", f"max\n[{unit}]", f"RMS\n[{unit}]",
              f"peak speed\n[{speed}]", f"mean speed\n[{speed}]", "motoring\n[W]", "regenerating\n[W]",
              "effort\nmargin", "speed\nmargin", "position\nmargin"]
    rows = []
    for joint in sizing.joints:
        position = joint.position_margin
        rows.append([
            joint.name, *_figures(joint.peak_torque, joint.min_torque, joint.max_torque, joint.rms_torque,
                                  joint.peak_speed, joint.mean_speed, joint.peak_motoring_power,
                                  joint.peak_regenerating_power),
            _percent(joint.effort_margin), _percent(joint.velocity_margin),
            NO_LIMIT if position is None else f"{position:+.3g} {joint.speed_unit[:-2]}"])
    return header, rows


def _structure_rows(sizing: Sizing) -> tuple[list[str], list[list[str]]]:
    unit, _ = _units(sizing)
    inertia = "kg m² | kg" if "|" in unit else "kg" if unit == "N" else "kg m²"
    header = ["joint", f"holding\n[{unit}]", "friction share\nof the peak", f"inertia M_ii\n[{inertia}]",
              "bearing force\n[N]", "tilting moment\n[N m]", "energy in\n[J]", "given back\n[J]", "peak at\n[s]",
              "in motion"]
    rows = []
    for joint in sizing.joints:
        peak = joint.peaks["peak_torque"]
        rows.append([joint.name, *_figures(joint.holding_torque), f"{joint.friction_share:.1%}",
                     *_figures(joint.largest_inertia, joint.peak_bearing_force, joint.peak_tilting_moment,
                               joint.motoring_energy, joint.regenerated_energy, peak.time), peak.motion])
    return header, rows


def _shaft_rows(sizing: Sizing) -> tuple[list[str], list[list[str]]]:
    header = ["joint", "peak\n[N m]", "RMS\n[N m]", "peak speed\n[rad/s]", "peak speed\n[rpm]", "load/rotor\ninertia",
              "peak\nmargin", "rated\nmargin", "speed\nmargin", "curve\nmargin", "verdict"]
    rows = []
    for joint in sizing.joints:
        if (shaft := joint.shaft) is None:
            continue
        rows.append([joint.name, *_figures(shaft.peak_torque.value, shaft.rms_torque, shaft.peak_speed.value,
                                           shaft.peak_speed.value * 30.0 / math.pi),
                     "-" if shaft.inertia_ratio is None else f"{shaft.inertia_ratio:.3g}",
                     *(_percent(margin) for margin in shaft.margins.values()), shaft.verdict])
    return header, rows


def _units(sizing: Sizing) -> tuple[str, str]:
    kinds = {(joint.torque_unit, joint.speed_unit) for joint in sizing.joints}
    return kinds.pop() if len(kinds) == 1 else ("N m | N", "rad/s | m/s")


def _margins(joint: JointSizing) -> list[tuple[float, str]]:
    found = [(joint.effort_margin, "torque against the URDF's effort limit"),
             (joint.velocity_margin, "speed against the URDF's velocity limit")]
    if joint.shaft is not None:
        found += [(margin, f"drive ({name})") for name, margin in joint.shaft.margins.items()]
    return [(margin, what) for margin, what in found if margin is not None]


def _figures(*values: float) -> list[str]:
    return [f"{0.0 if abs(value) < 1e-7 else value:.4g}" for value in values]


def _percent(margin: float | None) -> str:
    if margin is None:
        return NO_LIMIT
    return f"{margin:+.1%}" if math.isfinite(margin) else "limit is 0"


def _grid(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns under headers of one or two lines; the first and the last column are texts."""
    titles = [title.split("\n") for title in header]
    depth = max(map(len, titles))
    heads = [[title[k] if k < len(title) else "" for title in titles] for k in range(depth)]
    lines = [*heads, *map(list, rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(header))]

    def written(line: Sequence[str]) -> str:
        cells = [cell.ljust(width) if k in (0, len(widths) - 1) else cell.rjust(width)
                 for k, (cell, width) in enumerate(zip(line, widths, strict=True))]
        return "  ".join(cells).rstrip()

    rule = "-" * (sum(widths) + 2 * len(widths) - 2)
    return "\n".join([*map(written, heads), rule, *map(written, rows)])


def _csv_row(joint: JointSizing) -> dict[str, Any]:
    peak, shaft = joint.peaks["peak_torque"], joint.shaft
    row: dict[str, Any] = {
        "joint": joint.name, "torque unit": joint.torque_unit, "speed unit": joint.speed_unit,
        "peak torque [torque unit]": joint.peak_torque, "min torque [torque unit]": joint.min_torque,
        "max torque [torque unit]": joint.max_torque, "RMS torque [torque unit]": joint.rms_torque,
        "holding torque [torque unit]": joint.holding_torque, "peak speed [speed unit]": joint.peak_speed,
        "mean speed [speed unit]": joint.mean_speed, "peak motoring power [W]": joint.peak_motoring_power,
        "peak regenerating power [W]": joint.peak_regenerating_power, "motoring energy [J]": joint.motoring_energy,
        "regenerated energy [J]": joint.regenerated_energy, "friction share of peak [1]": joint.friction_share,
        "largest inertia [kg m^2 or kg]": joint.largest_inertia, "peak bearing force [N]": joint.peak_bearing_force,
        "peak tilting moment [N m]": joint.peak_tilting_moment, "peak torque at [s]": peak.time,
        "peak torque in motion": peak.motion, "effort limit [torque unit]": joint.effort_limit,
        "effort margin [1]": joint.effort_margin, "velocity limit [speed unit]": joint.velocity_limit,
        "velocity margin [1]": joint.velocity_margin, "position margin [rad or m]": joint.position_margin,
        "shaft peak torque [N m]": shaft and shaft.peak_torque.value, "shaft RMS torque [N m]": shaft and shaft.rms_torque,
        "shaft peak speed [rad/s]": shaft and shaft.peak_speed.value,
        "load to rotor inertia [1]": shaft and shaft.inertia_ratio,
    }
    for name in ("peak torque", "rated torque", "speed", "torque-speed curve"):
        row[f"shaft {name} margin [1]"] = shaft and shaft.margins[name]
    row["shaft verdict"] = shaft and ("inside" if shaft.inside else "exceeded")
    return {key: "" if value is None or value != value or value in (math.inf, -math.inf) else value
            for key, value in row.items()}


def _peak(peak: Peak) -> dict[str, Any]:
    return {"value": peak.value, "time": peak.time, "motion": peak.motion, "position": list(peak.position)}


def _joint_document(joint: JointSizing) -> dict[str, Any]:
    return {
        "name": joint.name, "kind": joint.kind, "torque_unit": joint.torque_unit, "speed_unit": joint.speed_unit,
        "peaks": {name: _peak(peak) for name, peak in joint.peaks.items()},
        "rms_torque": joint.rms_torque, "mean_speed": joint.mean_speed, "motoring_energy": joint.motoring_energy,
        "regenerated_energy": joint.regenerated_energy, "friction_share": joint.friction_share,
        "holding": {"torque": joint.holding_torque, "position": list(joint.holding_position)},
        "effort": {"limit": joint.effort_limit, "margin": joint.effort_margin},
        "velocity": {"limit": joint.velocity_limit, "margin": joint.velocity_margin},
        "position": {"range": list(joint.position_range), "limits": list(joint.position_limits),
                     "margin": joint.position_margin},
        "cycles": [vars(cycle) for cycle in joint.cycles], "exceeded": list(joint.exceeded),
        "shaft": None if joint.shaft is None else _shaft_document(joint.shaft),
    }


def _shaft_document(shaft: ShaftSizing) -> dict[str, Any]:
    drive = {key: value for key, value in vars(shaft.drive).items() if key != "curve"}
    return {
        "drive": drive | {"curve": [list(point) for point in shaft.drive.curve_points]},
        "peak_torque": _peak(shaft.peak_torque), "rms_torque": shaft.rms_torque, "peak_speed": _peak(shaft.peak_speed),
        "curve_use": _peak(shaft.curve_use), "inertia_ratio": shaft.inertia_ratio, "margins": dict(shaft.margins),
        "tightest": shaft.tightest, "inside": shaft.inside, "verdict": shaft.verdict,
    }


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
