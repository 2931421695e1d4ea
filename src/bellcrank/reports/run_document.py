"""The report of a run: whether it came to its end and proves itself, events, closures, the end, and the pictures."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.reports.document import Document, Facts, Picture, Table
from bellcrank.reports.machine_facts import made_with
from bellcrank.simulation.summary import END_HEADER, end_rows, run_facts, run_warnings

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory import Trajectory

EVENTS = 40  # events listed one by one


def run_document(run: Trajectory) -> Document:
    """The report of a run. SI units; what is listed is shortened where it is long."""
    warnings = run_warnings(run)
    facts = tuple((name, text) for name, text in run_facts(run) if name != "warning")
    parts: list[Facts | Table | Picture] = [Facts("The run", facts)]
    parts += _events(run)
    parts += _closures(run)
    parts.append(Table("At the end", END_HEADER, tuple(end_rows(run))))
    parts.append(Picture("Everything over time", _picture(run)))
    parts.append(Facts("Made with", (("scene", str(run.scene.source.name)), *made_with())))
    return Document(run.scene.name, "simulation", not warnings, _verdict(run, warnings), warnings, tuple(parts))


def _verdict(run: Trajectory, warnings: tuple[str, ...]) -> tuple[str, ...]:
    lines = [run.message]
    if not warnings:
        drift, residual = run.energy_drift(), run.equation_residual()
        text = f"It proves itself: energy is in balance to {drift:.1e}, the equations of motion to {residual:.1e}"
        if run.scene.closures:
            text += f", and closures are closed to {run.constraint_residual():.1e} m or rad"
        lines.append(text + ".")
    return tuple(lines)


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


def _closures(run: Trajectory) -> list[Table]:
    """Each multiplier's largest size and when, and how far its closure came apart."""
    rows = []
    for closure in run.scene.closures:
        history = run.closure(closure.name)
        for label, values in zip(history.labels, history.multipliers.T, strict=True):
            what, _, unit = label.removesuffix("]").rpartition(" [")
            at = int(np.argmax(np.abs(values)))
            rows.append(
                (
                    f"{closure.name}: {what}",
                    f"{values[at]:.6g} {unit}",
                    f"{run.time[at]:.6g}",
                    f"{values[-1]:.6g} {unit}",
                )
            )
    if not rows:
        return []
    note = "Forces of closures on the body of their first frame, in the world's axes where labels say x, y, z."
    return [Table("Forces in the closures", ("", "largest", "at\n[s]", "at the end"), tuple(rows), note)]


def _picture(run: Trajectory) -> bytes:
    from bellcrank.simulation.run_plot import plot_run

    buffer = io.BytesIO()
    plot_run(run).savefig(buffer, format="png", dpi=130)
    return buffer.getvalue()
