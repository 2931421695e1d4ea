"""A sizing for people: tables for the terminal with units in the headers, and a verdict."""

from __future__ import annotations

import math
from collections.abc import Sequence

from bellcrank.sizing.result import JointSizing, Sizing

NO_LIMIT = "no limit given"


def table(sizing: Sizing) -> str:
    """The sizing as text: joints, then shafts, then the supply; units in the headers."""
    parts = [_heading(sizing), _grid(*joint_rows(sizing)), "", _grid(*structure_rows(sizing))]
    if any(joint.shaft for joint in sizing.joints):
        parts += [
            "",
            "At the motor shaft (margins with the safety factor on torques):",
            _grid(*shaft_rows(sizing)),
        ]
    supply, back = sizing.supply_peak, sizing.regeneration_peak
    parts += [
        "",
        f"All joints at one instant: {supply.value:.4g} W from the supply (at {supply.time:.4g} s of "
        f"{supply.motion}), {back.value:.4g} W given back (at {back.time:.4g} s of {back.motion})",
    ]
    if sizing.mass_tolerance:
        parts.append(
            "Peaks are the worst case within the mass tolerance; RMS, energies and supply power are upper "
            "bounds; reactions and inertias, histories and pictures are for the nominal masses."
        )
    return "\n".join(parts)


def verdict(sizing: Sizing) -> str:
    """What cannot be sized, what is exceeded, or that nothing is; errors of the URDF; and what was allowed."""
    lines = []
    if sizing.unsizable:
        lines += ["cannot be sized:", *(f"  - {text}" for text in sizing.unsizable)]
    if sizing.exceeded:
        count = len(sizing.exceeded)
        lines += [f"EXCEEDED: {count} limit{'' if count == 1 else 's'}", *(f"  - {text}" for text in sizing.exceeded)]
    if sizing.inside:
        lines.append(_kept(sizing))
    if sizing.urdf_errors:
        lines.append("The URDF has errors that `bellcrank check` finds, and the torques rest on them:")
        lines += [f"  - {text}" for text in sizing.urdf_errors]
    if sizing.allowed_massless:
        lines.append(f"Joints that move no mass, as allowed: {', '.join(sizing.allowed_massless)}.")
    return "\n".join(lines)


def _kept(sizing: Sizing) -> str:
    """That all limits are kept, and which are not given."""
    margins = [(margin, f"{joint.name}'s {what}") for joint in sizing.joints for margin, what in _margins(joint)]
    if not margins:
        return "Nothing to compare with: neither the URDF nor a drive gives a limit."
    smallest, where = min(margins)
    without = ""
    if 0 < len(sizing.undriven) < len(sizing.joints):
        without = f" Joints without a drive, compared with the URDF's limits only: {', '.join(sizing.undriven)}."
    return f"All inside: the tightest margin is {smallest:.1%}, {where}.{without}"


def sized_with(sizing: Sizing) -> list[tuple[str, str]]:
    """(name, value) of what a sizing rests on: gravity, payload, mass tolerance, drives."""
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
    if len(sizing.undriven) == len(sizing.joints):
        rows.append(("drives", "none"))
    elif sizing.undriven:
        rows.append(("without a drive:", ", ".join(sizing.undriven)))
    return rows


def _heading(sizing: Sizing) -> str:
    """The robot and its motions, and what it was sized with."""
    with_ = "; ".join(f"{name} {value}" for name, value in sized_with(sizing))
    return f"{sizing.robot}, {len(sizing.motions)} motion(s): {', '.join(sizing.motions)}\n{with_}\n"


def joint_rows(sizing: Sizing) -> tuple[list[str], list[list[str]]]:
    """Header and rows: torques, speeds, powers and margins of each joint."""
    unit, speed = _units(sizing)
    header = [
        "joint",
        f"peak\n[{unit}]",
        f"min\n[{unit}]",
        f"max\n[{unit}]",
        f"RMS\n[{unit}]",
        f"peak speed\n[{speed}]",
        f"mean speed\n[{speed}]",
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
                *_figures(
                    joint.peak_torque,
                    joint.min_torque,
                    joint.max_torque,
                    joint.rms_torque,
                    joint.peak_speed,
                    joint.mean_speed,
                    joint.peak_motoring_power,
                    joint.peak_regenerating_power,
                ),
                _percent(joint.effort_margin),
                _percent(joint.velocity_margin),
                NO_LIMIT if position is None else f"{position:+.3g} {joint.speed_unit[:-2]}",
            ]
        )
    return header, rows


def structure_rows(sizing: Sizing) -> tuple[list[str], list[list[str]]]:
    """Header and rows: holding torque, friction, inertia, reactions and energies of each joint."""
    unit, _ = _units(sizing)
    inertia = "kg m² | kg" if "|" in unit else "kg" if unit == "N" else "kg m²"
    header = [
        "joint",
        f"peak at rows\n[{unit}]",
        f"holding\n[{unit}]",
        "friction share\nof the peak",
        f"inertia M_ii\n[{inertia}]",
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
                *_figures(joint.sampled_torque, joint.holding_torque),
                f"{joint.friction_share:.1%}",
                *_figures(
                    joint.largest_inertia,
                    joint.peak_bearing_force,
                    joint.peak_tilting_moment,
                    joint.motoring_energy,
                    joint.regenerated_energy,
                    peak.time,
                ),
                peak.motion,
            ]
        )
    return header, rows


def shaft_rows(sizing: Sizing) -> tuple[list[str], list[list[str]]]:
    """Header and rows: what each motor's shaft delivers, and its margins."""
    header = [
        "joint",
        "peak\n[N m]",
        "RMS\n[N m]",
        "peak speed\n[rad/s]",
        "peak speed\n[rpm]",
        "load/rotor\ninertia",
        "peak\nmargin",
        "rated\nmargin",
        "speed\nmargin",
        "curve\nmargin",
        "verdict",
    ]
    rows = []
    for joint in sizing.joints:
        if (shaft := joint.shaft) is None:
            continue
        rows.append(
            [
                joint.name,
                *_figures(
                    shaft.peak_torque.value,
                    shaft.rms_torque,
                    shaft.peak_speed.value,
                    shaft.peak_speed.value * 30.0 / math.pi,
                ),
                "-" if shaft.inertia_ratio is None else f"{shaft.inertia_ratio:.3g}",
                *(_percent(margin) for margin in shaft.margins.values()),
                shaft.verdict,
            ]
        )
    return header, rows


def _units(sizing: Sizing) -> tuple[str, str]:
    kinds = {(joint.torque_unit, joint.speed_unit) for joint in sizing.joints}
    return kinds.pop() if len(kinds) == 1 else ("N m | N", "rad/s | m/s")


def _margins(joint: JointSizing) -> list[tuple[float, str]]:
    found = [
        (joint.effort_margin, "torque against the URDF's effort limit"),
        (joint.velocity_margin, "speed against the URDF's velocity limit"),
    ]
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
        cells = [
            cell.ljust(width) if k in (0, len(widths) - 1) else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(line, widths, strict=True))
        ]
        return "  ".join(cells).rstrip()

    rule = "-" * (sum(widths) + 2 * len(widths) - 2)
    return "\n".join([*map(written, heads), rule, *map(written, rows)])
