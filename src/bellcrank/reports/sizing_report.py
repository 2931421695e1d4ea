"""The content of the report of a sizing: verdict, tables, inputs and pictures."""

from __future__ import annotations

from dataclasses import replace

from bellcrank.present.plot_style import svg_of
from bellcrank.present.tables import TableContent
from bellcrank.replays.film.film import Film
from bellcrank.reports.document import Document, Facts, Picture, Still, Table
from bellcrank.reports.input_tables import (
    about,
    actuator_table,
    force_table,
    joint_table,
    made_with,
    motion_table,
    robot_facts,
)
from bellcrank.sizing.joint_sizing import Peak
from bellcrank.sizing.plots import sizing_figures
from bellcrank.sizing.result import Sizing
from bellcrank.sizing.tables import STRUCTURE, force_rows, joint_rows, shaft_rows, sized_with, structure_rows, verdict


def sizing_document(sizing: Sizing, film: Film, pictures: bool = True) -> Document:
    """The report of a sizing, with the film of its motions."""
    parts: list[Facts | Table | Picture] = [_table("At the joints", joint_rows(sizing))]
    if sizing.shafts:
        note = "Margins with the safety factor on torques."
        parts.append(_table("At the motor shafts", shaft_rows(sizing), note))
    parts.append(_table("Structure and energy", structure_rows(sizing)))
    if sizing.structure:
        parts.append(_table(STRUCTURE, force_rows(sizing)))
    parts.append(
        Facts(
            "Sized for",
            (
                ("motions", ", ".join(sizing.motions)),
                *((name.removesuffix(":"), value) for name, value in sized_with(sizing)),
                ("largest power from the supply", _power(sizing.supply_peak)),
                ("largest power given back", _power(sizing.regeneration_peak)),
            ),
        )
    )
    made = made_with()
    parts += [*_inputs(sizing), Facts("Made with", made), *(_pictures(sizing) if pictures else ())]
    lines = tuple(line.removeprefix("  - ") for line in verdict(sizing).split("\n"))
    count = f"{len(sizing.motions)} motion{'' if len(sizing.motions) == 1 else 's'}"
    return Document(
        title=sizing.robot,
        status=_status(sizing),
        success=sizing.inside,
        verdict=lines,
        about=("motor sizing", count, *about(made)),
        warnings=sizing.warnings,
        notes=(),
        still=_still(sizing, film),
        parts=tuple(parts),
    )


def _power(peak: Peak | None) -> str:
    return "unknown" if peak is None else f"{peak.value:.4g} W at {peak.time:.4g} s of {peak.motion}"


def _status(sizing: Sizing) -> str:
    if sizing.unsizable:
        return "Cannot be sized"
    if sizing.exceeded:
        return "Exceeded"
    if sizing.undetermined:
        return "Not known"
    if sizing.unknown:
        return "Inside as far as known"
    return "OK" if any(_limited(sizing)) else "No limits"


def _limited(sizing: Sizing) -> list[bool]:
    """Whether each joint has a limit to compare with."""
    return [
        not (joint.effort_margin is None and joint.velocity_margin is None and joint.shaft is None)
        for joint in sizing.joints
    ]


def _still(sizing: Sizing, film: Film) -> Still:
    """The first moment at which a limit is exceeded, or else that of the largest load."""
    begun = {f"motion {name} begins": name for name in sizing.motions}
    starts = {begun[event.text]: event.time for event in film.events if event.text in begun}
    for event in film.events:
        if event.text not in begun:
            return Still(event.time, event.text)
    what, peak = _largest(sizing)
    return Still(starts.get(peak.motion, 0.0) + peak.time, f"At {peak.time:.4g} s of {peak.motion}, {what}")


def _largest(sizing: Sizing) -> tuple[str, Peak]:
    """The moment of the largest power from the supply, or where that is unknown of the first joint's largest torque."""
    if (supply := sizing.supply_peak) is not None:
        return f"where the motors take the largest power ({supply.value:.4g} W)", supply
    joint = sizing.joints[0]
    return f"where joint '{joint.name}' needs its largest torque", joint.peaks["peak_torque"]


def _inputs(sizing: Sizing) -> list[Facts | Table]:
    """Tables of the sizing's inputs."""
    if sizing.inputs is None:
        return []
    mechanism, motions, actuators = sizing.inputs
    robot = mechanism.robot
    parts: list[Facts | Table] = [Facts("Robot", tuple(robot_facts(robot))), joint_table(robot), motion_table(motions)]
    scene = mechanism.equations.scene  # with the forces that count
    if scene is not None and scene.forces:
        parts.append(force_table(replace(scene, control=()), scene.parameter_values.tolist()))
    return [*parts, actuator_table(actuators)] if actuators else parts


def _table(title: str, content: TableContent, note: str = "") -> Table:
    header, rows = content
    return Table(title, tuple(header), tuple(map(tuple, rows)), note)


def _pictures(sizing: Sizing) -> list[Picture]:
    if sizing.inputs is None:
        return []
    figures = sizing_figures(sizing)
    titles = [f"Motion '{motion.name}' over time" for motion in sizing.inputs.motions]
    titles += ["Torque and speed at the joints", "Torque and speed at the motor shafts"]
    return [Picture(title, svg_of(figure)) for title, figure in zip(titles, figures.values(), strict=False)]
