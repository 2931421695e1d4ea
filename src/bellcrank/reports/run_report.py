"""The content of the report of a run: verdict, events, constraint forces, the final state, inputs and pictures."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.present.plot_style import svg_of
from bellcrank.reports.document import Document, Facts, Picture, Still, Table
from bellcrank.reports.input_tables import (
    about,
    actuator_table,
    force_table,
    joint_table,
    made_with,
    robot_facts,
    scene_facts,
)
from bellcrank.simulation.trajectory.reached import left_ranges
from bellcrank.simulation.trajectory.run_plot import run_pages
from bellcrank.simulation.trajectory.summary import END_HEADER, JOINTS, end_rows, run_facts

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory.trajectory import Trajectory

EVENTS = 40  # events listed one by one
FORCES = 24  # multipliers listed
NOTES = 8  # notes listed


def run_document(run: Trajectory, pictures: bool = True) -> Document:
    """The report of a run, in SI units; long lists are shortened."""
    against, leaving = (*_non_finite(run), *run.warnings), left_ranges(run)
    hidden = {*leaving[NOTES:]}
    warnings = (*(text for text in against if text not in hidden), *run.robot.inertia_warnings)
    if hidden:
        warnings += (f"… and {len(hidden)} more joints that leave their range",)
    facts = tuple((name, text) for name, text in run_facts(run) if name not in ("warning", "note", "not known"))
    parts: list[Facts | Table | Picture] = [Facts("The run", facts), *_events(run), *_constraints(run), _end(run)]
    inputs = (*robot_facts(run.robot), *scene_facts(run))
    parts += [Facts("Robot and scene", inputs), joint_table(run.robot)]
    if run.scene.forces or run.scene.control:
        parts.append(force_table(run.scene, run.parameters.tolist()))
    if run.scene.config.actuators:
        parts.append(actuator_table(run.scene.config.actuators))
    made = made_with()
    parts.append(Facts("Made with", (("scene", run.scene.source.name), *made)))
    pages = run_pages(run) if pictures else []
    for k, figure in enumerate(pages):
        title = "Everything over time" + (f", {k + 1} of {len(pages)}" if len(pages) > 1 else "")
        parts.append(Picture(title, svg_of(figure)))
    return Document(
        title=run.scene.name,
        status=_status(run, against),
        success=not against,
        verdict=_verdict(run, against),
        about=("simulation", run.scene.source.name, facts[0][1], *about(made)),
        warnings=warnings,
        notes=tuple(note for note in run.notes if note.matter != "reached"),
        still=_still(run),
        parts=tuple(parts),
    )


def _non_finite(run: Trajectory) -> list[str]:
    """A warning where the run contains values that are not finite, which residuals do not show."""
    bad = ~np.isfinite(run.state).all(axis=1)
    return [f"from {run.time[bad.argmax()]:.6g} s on the run contains values that are not finite"] if bad.any() else []


def _status(run: Trajectory, against: Collection[str]) -> str:
    if against:
        return "Not known" if {*against} <= {*run.not_known} else "Warnings"
    return "OK" if run.known_until is not None else "Error not estimated"


def _verdict(run: Trajectory, warnings: tuple[str, ...]) -> tuple[str, ...]:
    lines = [run.message.removeprefix(f"{run.scene.name}: ")]
    if not warnings:
        drift, residual, known = run.energy_drift(), run.equation_residual(), run.known_accuracy
        text = "Residuals are small" if known is None else "Self-checks passed"
        text += f": the relative energy error is {drift:.1e}, the residual of the equations of motion {residual:.1e}"
        if run.scene.constraints:
            text += f", and the residual of the constraints {run.constraint_residual():.1e} m or rad"
        error = "is not estimated" if known is None else f"is about {known.estimate:.1e} rad or m"
        lines.append(f"{text}; the error of the positions {error}.")
    elif run.not_known:
        lines.append("the run is not known: it depends on what is not modelled, or its error is too large; see below.")
    return tuple(line[:1].upper() + line[1:] for line in lines)


def _still(run: Trajectory) -> Still:
    """The last finite state of the run."""
    good = np.isfinite(run.state).all(axis=1)
    time = float(run.time[good][-1]) if good.any() else float(run.time[0])
    last = next((event for event in reversed(run.events) if event.stopped), None)
    return Still(time, f"At {time:.6g} s" + (f", event '{last.name}'" if last else ", the end"))


def _events(run: Trajectory) -> list[Table]:
    """A table of the events with the positions of the first joints."""
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
    """The largest magnitude of each constraint force, its time, and the force at the end."""
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
    note = "Forces act on the body of the constraint's first frame; components x, y, z are in the world frame."
    hidden = len(rows) - FORCES
    note += f" … and {hidden} more." if hidden > 0 else ""
    return [Table("Constraint forces", ("", "largest", "at\n[s]", "at the end"), tuple(rows[:FORCES]), note)]


def _end(run: Trajectory) -> Table:
    rows = end_rows(run)
    hidden = len(run.robot.joints) - JOINTS
    note = f"… and {hidden} more joints" if hidden > 0 else ""
    return Table("At the end", ("", *END_HEADER[1:]), tuple(rows), note)
