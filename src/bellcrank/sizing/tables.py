"""The tables and the verdict of a sizing, as text for the terminal and as HTML for notebooks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

from bellcrank.present.tables import TableContent, html_table, listed, text_table
from bellcrank.sizing.selection.tables import exceeded_limits, not_verified, undetermined_lines, unknown_limits

if TYPE_CHECKING:
    from bellcrank.sizing.joint_sizing import JointSizing, ShaftSizing
    from bellcrank.sizing.result import Sizing

NO_LIMIT = "no limit given"
UNKNOWN = "unknown"
STRUCTURE = "In the structure (largest force and moment of each constraint and joint without a motor)"


def table(sizing: Sizing) -> str:
    """The sizing as text: the joints, the motor shafts and the supply."""
    parts = [_heading(sizing), text_table(joint_rows(sizing)), "", text_table(structure_rows(sizing))]
    if sizing.shafts:
        parts += [
            "",
            "At the motor shaft (margins with the safety factor on torques):",
            text_table(shaft_rows(sizing)),
        ]
    if sizing.structure:
        parts += ["", f"{STRUCTURE}:", text_table(force_rows(sizing), (0, 1, 5))]
    parts += ["", f"All joints at one instant: {_power(sizing)}"]
    if sizing.mass_tolerance:
        parts.append(
            "Peaks are the worst case within the mass tolerance; RMS torques, energies and supply power are upper "
            "bounds; reactions, inertias, histories and pictures are for the nominal masses."
        )
    return "\n".join(parts)


def _power(sizing: Sizing) -> str:
    """The largest powers at one instant."""
    supply, back = sizing.supply_peak, sizing.regeneration_peak
    if supply is None or back is None:
        return "power unknown (a figure of an actuator is not stated)"
    return (
        f"{supply.value:.4g} W from the supply (at {supply.time:.4g} s of {supply.motion}), {back.value:.4g} W given "
        f"back (at {back.time:.4g} s of {back.motion})"
    )


def sizing_html(sizing: Sizing) -> str:
    """The verdict and the tables of a sizing as HTML; names are escaped."""
    answer = "<br>".join(escape(line) for line in verdict(sizing).split("\n"))
    conditions = "; ".join(f"{name} {value}" for name, value in sized_with(sizing))
    about = escape(f"{sizing.robot} over {', '.join(sizing.motions)}; {conditions}")
    tables = [html_table("At the joints", joint_rows(sizing))]
    if sizing.shafts:
        tables.append(html_table("At the motor shafts, margins with the safety factor on torques", shaft_rows(sizing)))
    tables.append(html_table("Structure and energy", structure_rows(sizing)))
    if sizing.structure:
        tables.append(html_table(STRUCTURE, force_rows(sizing)))
    notes = "".join(f"<li>{escape(text)}</li>" for text in sizing.warnings)
    return f"<p><b>{answer}</b><br>{about}</p>{''.join(tables)}" + (f"<ul>{notes}</ul>" if notes else "")


def verdict(sizing: Sizing) -> str:
    """What cannot be sized, which limits are exceeded or that none is, errors of the URDF, and what was allowed."""
    lines = listed("cannot be sized:", sizing.unsizable, wrap=False)
    lines += exceeded_limits(sizing.exceeded, wrap=False)
    lines += not_verified(sizing.not_verified, wrap=False)
    lines += undetermined_lines(sizing.undetermined, wrap=False)
    if sizing.inside:
        lines.append(_kept(sizing))
    lines += unknown_limits(sizing.unknown, wrap=False)
    errors = "The URDF has errors, which `bellcrank check` lists too, and the torques depend on them:"
    lines += listed(errors, sizing.urdf_errors, wrap=False)
    if sizing.allowed_massless:
        lines.append(f"Joints that move no mass, as allowed: {', '.join(sizing.allowed_massless)}.")
    return "\n".join(lines)


def _kept(sizing: Sizing) -> str:
    """That all limits are kept, with the smallest margin."""
    margins = [(margin, f"{joint.name}'s {what}") for joint in sizing.joints for margin, what in _margins(joint)]
    margins += [
        (margin, f"{motor.name}'s actuator ({name})")
        for motor in sizing.motors
        for name, margin in motor.shaft.known_margins.items()
    ]
    if not margins:
        if sizing.unknown:
            return "Nothing could be compared: the URDF gives no limit, and the actuators' limits are unknown."
        return "Nothing to compare with: neither the URDF nor an actuator gives a limit."
    smallest, where = min(margins)
    without = ""
    if 0 < len(sizing.joints_without_actuator) < len(sizing.joints):
        names = ", ".join(sizing.joints_without_actuator)
        without = f" Joints without an actuator, compared with the URDF's limits only: {names}."
    if sizing.unknown:
        return f"Inside as far as known: the tightest known margin is {smallest:.1%}, {where}.{without}"
    return f"All inside: the tightest margin is {max(smallest, 0.0):.1%}, {where}.{without}"


def sized_with(sizing: Sizing) -> list[tuple[str, str]]:
    """(name, value) of what a sizing assumes: gravity, payloads, forces, parameters, mass tolerance, actuators."""
    payloads = ", ".join(f"{mass:g} kg @ {frame}" for mass, frame in sizing.payloads)
    rows = [
        ("gravity", f"({', '.join(f'{x:g}' for x in sizing.gravity)}) m/s²"),
        ("payload", payloads or "none"),
    ]
    if sizing.forces:
        rows.append(("forces", ", ".join(f"{force.kind} '{force.name}'" for force in sizing.forces)))
    if sizing.parameters:
        rows.append(
            ("parameters", ", ".join(f"{n} = {value:.6g} {unit}".rstrip() for n, value, unit in sizing.parameters))
        )
    if sizing.mass_tolerance:
        rows.append(("mass tolerance", f"±{100.0 * sizing.mass_tolerance:.10g} %: each link as a whole"))
    if len(sizing.joints_without_actuator) == len(sizing.joints):
        rows.append(("actuators", "none"))
    elif sizing.joints_without_actuator:
        rows.append(("without an actuator:", ", ".join(sizing.joints_without_actuator)))
    return rows


def _heading(sizing: Sizing) -> str:
    """The robot and its motions, and what it was sized with."""
    conditions = "; ".join(f"{name} {value}" for name, value in sized_with(sizing))
    return f"{sizing.robot}, {len(sizing.motions)} motion(s): {', '.join(sizing.motions)}\n{conditions}\n"


def joint_rows(sizing: Sizing) -> TableContent:
    """Torques, speeds, powers and margins of each joint."""
    joints, units = sizing.joints, _Units(sizing.joints)
    position = [
        NO_LIMIT if one.position_margin is None else f"{one.position_margin:+.3g} {one.position_unit}" for one in joints
    ]
    return TableContent.of(
        ("joint", [joint.name for joint in joints]),
        units.column("peak", "torque", "peak_torque"),
        units.column("min", "torque", "min_torque"),
        units.column("max", "torque", "max_torque"),
        units.column("RMS", "torque", "rms_torque"),
        units.column("peak speed", "speed", "peak_speed"),
        units.column("mean speed", "speed", "mean_speed"),
        ("motoring\n[W]", _figures(*(joint.peak_motoring_power for joint in joints))),
        ("regenerating\n[W]", _figures(*(joint.peak_regenerating_power for joint in joints))),
        ("effort\nmargin", [_percent(joint.effort_margin) for joint in joints]),
        ("speed\nmargin", [_percent(joint.velocity_margin) for joint in joints]),
        ("position\nmargin", position),
    )


def structure_rows(sizing: Sizing) -> TableContent:
    """Holding torque, friction, inertia, reactions and energies of each joint."""
    joints, units = sizing.joints, _Units(sizing.joints)
    peaks = [joint.peaks["peak_torque"] for joint in joints]
    return TableContent.of(
        ("joint", [joint.name for joint in joints]),
        units.column("peak at rows", "torque", "sampled_torque"),
        units.column("holding", "torque", "holding_torque"),
        ("friction share\nof the peak", [f"{joint.friction_share:.1%}" for joint in joints]),
        units.column("inertia M_ii", "inertia", "largest_inertia"),
        ("bearing force\n[N]", _figures(*(joint.peak_bearing_force for joint in joints))),
        ("tilting moment\n[N m]", _figures(*(joint.peak_tilting_moment for joint in joints))),
        ("energy in\n[J]", _figures(*(joint.motoring_energy for joint in joints))),
        ("given back\n[J]", _figures(*(joint.regenerated_energy for joint in joints))),
        ("peak at\n[s]", _figures(*(peak.time for peak in peaks))),
        ("in motion", [peak.motion for peak in peaks]),
    )


def force_rows(sizing: Sizing) -> TableContent:
    """The largest force and moment in each constraint and joint without a motor."""
    forces, moments = ([getattr(load, name) for load in sizing.structure] for name in ("peak_force", "peak_moment"))
    first = [force or moment for force, moment in zip(forces, moments, strict=True)]
    return TableContent.of(
        ("constraint or joint", [load.name for load in sizing.structure]),
        ("kind", [load.kind for load in sizing.structure]),
        ("force\n[N]", ["-" if one is None else _figures(one.value)[0] for one in forces]),
        ("moment\n[N m]", ["-" if one is None else _figures(one.value)[0] for one in moments]),
        ("force at\n[s]", ["-" if one is None else _figures(one.time)[0] for one in forces]),
        ("in motion", [one.motion if one else "-" for one in first]),
    )


def shaft_rows(sizing: Sizing) -> TableContent:
    """What each motor's shaft delivers, and its margins."""
    shafts = [shaft for _, shaft in sizing.shafts]
    speeds = [shaft.peak_speed.value for shaft in shafts]
    peaks = [None if shaft.peak_torque is None else shaft.peak_torque.value for shaft in shafts]
    margins = ("peak", "peak torque"), ("continuous", "continuous torque"), ("speed", "motor speed")
    return TableContent.of(
        ("joint or motor" if sizing.motors else "joint", [name for name, _ in sizing.shafts]),
        ("peak\n[N m]", [UNKNOWN if peak is None else _figures(peak)[0] for peak in peaks]),
        ("RMS\n[N m]", [UNKNOWN if one.rms_torque is None else _figures(one.rms_torque)[0] for one in shafts]),
        ("peak speed\n[rad/s]", _figures(*speeds)),
        ("peak speed\n[rpm]", _figures(*(speed * 30.0 / math.pi for speed in speeds))),
        ("load/rotor\ninertia", [_inertia_ratio(shaft) for shaft in shafts]),
        *((f"{title}\nmargin", [_margin_of(shaft, name) for shaft in shafts]) for title, name in margins),
        ("verdict", [shaft.verdict for shaft in shafts]),
    )


def _margin_of(shaft: ShaftSizing, criterion: str) -> str:
    """The margin of a criterion, which may be unknown, or left to the peak current."""
    if criterion not in shaft.margins:
        return "-"
    margin = shaft.margins[criterion]
    return UNKNOWN if margin is None else _percent(margin)


def _inertia_ratio(shaft: ShaftSizing) -> str:
    if shaft.actuator.reflected_inertia is None:
        return UNKNOWN
    return "-" if shaft.inertia_ratio is None else f"{shaft.inertia_ratio:.3g}"


class _Units:
    """Where units are written: in the header where all joints are of one kind, else in each cell."""

    def __init__(self, joints: Sequence[JointSizing]) -> None:
        self.joints, self.mixed = joints, len({joint.kind == "prismatic" for joint in joints}) > 1

    def column(self, title: str, quantity: str, name: str) -> tuple[str, list[str]]:
        """The title and cells of an attribute of joints, which is a torque, speed or inertia."""
        units = [
            {"torque": joint.torque_unit, "speed": joint.speed_unit, "inertia": _inertia_unit(joint)}[quantity]
            for joint in self.joints
        ]
        cells = _figures(*(getattr(joint, name) for joint in self.joints))
        if self.mixed:
            return title, [f"{cell} {unit}" for cell, unit in zip(cells, units, strict=True)]
        return f"{title}\n[{units[0]}]", cells


def _inertia_unit(joint: JointSizing) -> str:
    return "kg" if joint.kind == "prismatic" else "kg m²"


def _margins(joint: JointSizing) -> list[tuple[float, str]]:
    found = [
        (joint.effort_margin, "torque against the URDF's effort limit"),
        (joint.velocity_margin, "speed against the URDF's velocity limit"),
    ]
    if joint.shaft is not None:
        found += [(margin, f"actuator ({name})") for name, margin in joint.shaft.margins.items()]
    return [(margin, what) for margin, what in found if margin is not None]


def _figures(*values: float) -> list[str]:
    return [f"{0.0 if abs(value) < 1e-7 else value:.4g}" for value in values]


def _percent(margin: float | None) -> str:
    if margin is None:
        return NO_LIMIT
    return f"{margin:+.1%}" if math.isfinite(margin) else "limit is 0"
