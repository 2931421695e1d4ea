"""The report of a run: whether it finished and passed its self-checks, events, constraints, the end, and the pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bellcrank.plot_style import svg_of
from bellcrank.reports.document import Document, Facts, Picture, Still, Table
from bellcrank.reports.inputs import drive_table, force_table, joint_table, robot_facts, scene_facts
from bellcrank.reports.machine_facts import about, made_with
from bellcrank.simulation.run_plot import run_pages
from bellcrank.simulation.run_warnings import run_notes
from bellcrank.simulation.summary import END_HEADER, JOINTS, end_rows, run_facts

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory import Trajectory

EVENTS = 40  # events listed one by one
FORCES = 24  # multipliers listed
NOTES = 8  # notes listed


def run_document(run: Trajectory) -> Document:
    """The report of a run. SI units; what is listed is shortened where it is long."""
    against, notes = (*_gaps(run), *run.warnings), run_notes(run)
    warnings = (*against, *run.robot.inertia_warnings)
    more = len(notes) - NOTES
    facts = tuple((name, text) for name, text in run_facts(run) if name not in ("warning", "note"))
    parts: list[Facts | Table | Picture] = [Facts("The run", facts), *_events(run), *_constraints(run), _end(run)]
    inputs = (*robot_facts(run.robot), *scene_facts(run))
    parts += [Facts("Robot and scene", inputs), joint_table(run.robot)]
    if run.scene.forces or run.scene.control:
        parts.append(force_table(run.scene, run.parameters.tolist()))
    if run.scene.config.actuators:
        parts.append(drive_table(run.scene.config.actuators))
    made = made_with()
    parts.append(Facts("Made with", (("scene", run.scene.source.name), *made)))
    pages = run_pages(run)
    for k, figure in enumerate(pages):
        title = "Everything over time" + (f", {k + 1} of {len(pages)}" if len(pages) > 1 else "")
        parts.append(Picture(title, svg_of(figure)))
    return Document(
        run.scene.name, "Warnings" if against else "OK", not against, _verdict(run, against),
        ("simulation", run.scene.source.name, facts[0][1], *about(made)), warnings,
        (*notes[:NOTES], *([f"… and {more} more joints that leave their range"] if more > 0 else ())),
        _still(run), tuple(parts),
    )  # fmt: skip


def _gaps(run: Trajectory) -> list[str]:
    """That the run is not numbers throughout, which no residual of it tells."""
    bad = ~np.isfinite(run.state).all(axis=1)
    return [f"from {run.time[bad.argmax()]:.6g} s on the run is not finite numbers"] if bad.any() else []


def _verdict(run: Trajectory, warnings: tuple[str, ...]) -> tuple[str, ...]:
    lines = [run.message.removeprefix(f"{run.scene.name}: ")]
    if not warnings:
        drift, residual = run.energy_drift(), run.equation_residual()
        text = f"Self-checks passed: energy is in balance to {drift:.1e}, the equations of motion to {residual:.1e}"
        if run.scene.constraints:
            text += f", and constraints are closed to {run.constraint_residual():.1e} m or rad"
        lines.append(text + ".")
    return tuple(line[:1].upper() + line[1:] for line in lines)


def _still(run: Trajectory) -> Still:
    """The end, where events stop a run and failures end it."""
    good = np.isfinite(run.state).all(axis=1)
    time = float(run.time[good][-1]) if good.any() else float(run.time[0])
    last = next((event for event in reversed(run.events) if event.stopped), None)
    return Still(time, f"At {time:.6g} s" + (f", event '{last.name}'" if last else ", the end"))


def _events(run: Trajectory) -> list[Table]:
    if not run.events:
        return []
    one = [joint for joint in run.robot.joints if joint.nv == 1][:6]
    header = ("event", "time\n[s]", *(f"{j.name}\n[{'m' if j.kind == 'prismatic' else 'rad'}]" for j in one), "then")
    rows = tuple(
        (e.name, f"{e.time:.9g}", *(f"{e.position[j.q]:.6g}" for j in one), _then(e.stopped, e.energy_lost))
        for e in run.events[:EVENTS]
    )
    hidden = len(run.events) - EVENTS
    return [Table("Events", header, rows, f"… and {hidden} more" if hidden > 0 else "")]


def _then(stopped: bool, lost: float) -> str:
    text = "ended the run" if stopped else ""
    return f"{text}, {lost:.6g} J lost".removeprefix(", ") if lost else text


def _constraints(run: Trajectory) -> list[Table]:
    """Each multiplier's largest size and when, and how far its constraint came apart."""
    rows = []
    for constraint in run.scene.constraints:
        history = run.constraint(constraint.name)
        for label, values in zip(history.labels, history.multipliers.T, strict=True):
            what, _, unit = label.removesuffix("]").rpartition(" [")
            at = int(np.argmax(np.abs(values)))
            rows.append(
                (
                    f"{constraint.name}: {what}",
                    f"{values[at]:.6g} {unit}",
                    f"{run.time[at]:.6g}",
                    f"{values[-1]:.6g} {unit}",
                )
            )
    if not rows:
        return []
    note = "Forces of constraints on the body of their first frame, in the world's axes where labels say x, y, z."
    hidden = len(rows) - FORCES
    note += f" … and {hidden} more." if hidden > 0 else ""
    return [Table("Forces in the constraints", ("", "largest", "at\n[s]", "at the end"), tuple(rows[:FORCES]), note)]


def _end(run: Trajectory) -> Table:
    rows = end_rows(run)
    hidden = len(run.robot.joints) - JOINTS
    note = f"… and {hidden} more joints" if hidden > 0 else ""
    return Table("At the end", ("", *END_HEADER[1:]), tuple(rows), note)
