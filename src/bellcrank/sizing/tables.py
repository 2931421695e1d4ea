"""The tables and the verdict of a sizing, as text for the terminal and as HTML for notebooks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

from bellcrank.notes import Note
from bellcrank.sizing.text_tables import TableContent, html_table, text_table

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


def not_known(texts: Sequence[str]) -> list[tuple[str, list[str]]]:
    """What is not known, by its reason: what a robot's file says and is not modelled, and the rows of motions."""
    omitted: list[str] = [text for text in texts if isinstance(text, Note)]
    peaks = [text for text in texts if not isinstance(text, Note)]
    titles = (
        ("Not known: what the robot's file says, acts along the motions, and is not modelled", omitted),
        ("Not known: peaks that the rows of a motion do not determine", peaks),
    )
    return [(title, found) for title, found in titles if found]


def verdict(sizing: Sizing) -> str:
    """What cannot be sized, which limits are exceeded or that none is, errors of the URDF, and what was allowed."""
    lines = []
    if sizing.unsizable:
        lines += ["cannot be sized:", *(f"  - {text}" for text in sizing.unsizable)]
    if sizing.exceeded:
        count = len(sizing.exceeded)
        lines += [f"EXCEEDED: {count} limit{'' if count == 1 else 's'}", *(f"  - {text}" for text in sizing.exceeded)]
    if sizing.not_verified:
        motors = "1 motor" if len(sizing.not_verified) == 1 else f"{len(sizing.not_verified)} motors"
        lines.append(f"Not verified: {motors} may be far too weak or too slow")
        lines += [f"  - {text}" for text in sizing.not_verified]
    if sizing.undetermined:
        for title, texts in not_known(sizing.undetermined):
            lines += [title, *(f"  - {text}" for text in texts)]
    if sizing.inside:
        lines.append(_kept(sizing))
    if sizing.unknown:
        lines += ["Unknown, because what they need is not stated:", *(f"  - {text}" for text in sizing.unknown)]
    if sizing.urdf_errors:
        lines.append("The URDF has errors, which `bellcrank check` lists too, and the torques depend on them:")
        lines += [f"  - {text}" for text in sizing.urdf_errors]
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
    units = _Units(sizing)
    header = [
        "joint",
        units.header("peak", "torque"),
        units.header("min", "torque"),
        units.header("max", "torque"),
        units.header("RMS", "torque"),
        units.header("peak speed", "speed"),
        units.header("mean speed", "speed"),
        "motoring\n[W]",
        "regenerating\n[W]",
        "effort\nmargin",
        "speed\nmargin",
        "position\nmargin",
    ]
    rows = []
    for joint in sizing.joints:
        position = joint.position_margin
        rows.append(
            [
                joint.name,
                units.cell(joint.peak_torque, joint.torque_unit),
                units.cell(joint.min_torque, joint.torque_unit),
                units.cell(joint.max_torque, joint.torque_unit),
                units.cell(joint.rms_torque, joint.torque_unit),
                units.cell(joint.peak_speed, joint.speed_unit),
                units.cell(joint.mean_speed, joint.speed_unit),
                *_figures(joint.peak_motoring_power, joint.peak_regenerating_power),
                _percent(joint.effort_margin),
                _percent(joint.velocity_margin),
                NO_LIMIT if position is None else f"{position:+.3g} {joint.position_unit}",
            ]
        )
    return TableContent(header, rows)


def structure_rows(sizing: Sizing) -> TableContent:
    """Holding torque, friction, inertia, reactions and energies of each joint."""
    units = _Units(sizing)
    header = [
        "joint",
        units.header("peak at rows", "torque"),
        units.header("holding", "torque"),
        "friction share\nof the peak",
        units.header("inertia M_ii", "inertia"),
        "bearing force\n[N]",
        "tilting moment\n[N m]",
        "energy in\n[J]",
        "given back\n[J]",
        "peak at\n[s]",
        "in motion",
    ]
    rows = []
    for joint in sizing.joints:
        peak = joint.peaks["peak_torque"]
        rows.append(
            [
                joint.name,
                units.cell(joint.sampled_torque, joint.torque_unit),
                units.cell(joint.holding_torque, joint.torque_unit),
                f"{joint.friction_share:.1%}",
                units.cell(joint.largest_inertia, _inertia_unit(joint)),
                *_figures(
                    joint.peak_bearing_force,
                    joint.peak_tilting_moment,
                    joint.motoring_energy,
                    joint.regenerated_energy,
                    peak.time,
                ),
                peak.motion,
            ]
        )
    return TableContent(header, rows)


def force_rows(sizing: Sizing) -> TableContent:
    """The largest force and moment in each constraint and joint without a motor."""
    header = ["constraint or joint", "kind", "force\n[N]", "moment\n[N m]", "force at\n[s]", "in motion"]
    rows = []
    for load in sizing.structure:
        force, moment = load.peak_force, load.peak_moment
        first = force or moment
        rows.append(
            [
                load.name,
                load.kind,
                "-" if force is None else _figures(force.value)[0],
                "-" if moment is None else _figures(moment.value)[0],
                "-" if force is None else _figures(force.time)[0],
                first.motion if first else "-",
            ]
        )
    return TableContent(header, rows)


def shaft_rows(sizing: Sizing) -> TableContent:
    """What each motor's shaft delivers, and its margins."""
    header = [
        "joint or motor" if sizing.motors else "joint",
        "peak\n[N m]",
        "RMS\n[N m]",
        "peak speed\n[rad/s]",
        "peak speed\n[rpm]",
        "load/rotor\ninertia",
        "peak\nmargin",
        "continuous\nmargin",
        "speed\nmargin",
        "verdict",
    ]
    rows = []
    for name, shaft in sizing.shafts:
        rows.append(
            [
                name,
                UNKNOWN if shaft.peak_torque is None else _figures(shaft.peak_torque.value)[0],
                UNKNOWN if shaft.rms_torque is None else _figures(shaft.rms_torque)[0],
                *_figures(shaft.peak_speed.value, shaft.peak_speed.value * 30.0 / math.pi),
                _inertia_ratio(shaft),
                *(_margin_of(shaft, name) for name in ("peak torque", "continuous torque", "motor speed")),
                shaft.verdict,
            ]
        )
    return TableContent(header, rows)


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

    def __init__(self, sizing: Sizing) -> None:
        self.mixed = len({joint.kind == "prismatic" for joint in sizing.joints}) > 1
        one = sizing.joints[0]
        self.of = {"torque": one.torque_unit, "speed": one.speed_unit, "inertia": _inertia_unit(one)}

    def header(self, title: str, quantity: str) -> str:
        return title if self.mixed else f"{title}\n[{self.of[quantity]}]"

    def cell(self, value: float, unit: str) -> str:
        [figure] = _figures(value)
        return f"{figure} {unit}" if self.mixed else figure


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
