"""The summary of a run, as text and HTML: why it ended, what it cost, residuals, warnings, and the end."""

from __future__ import annotations

import math
from dataclasses import asdict
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.dynamics.equations.system import system_of
from bellcrank.errors import InputError
from bellcrank.motion.coordinates import position_labels, velocity_labels
from bellcrank.robot.model.joints import unit_vectors
from bellcrank.simulation.trajectory.error_estimate import unasked_accuracy
from bellcrank.simulation.trajectory.events import contact_rows
from bellcrank.simulation.trajectory.reached import left_ranges

if TYPE_CHECKING:
    from bellcrank.simulation.integration.statistics import Statistics
    from bellcrank.simulation.trajectory.events import Event
    from bellcrank.simulation.trajectory.trajectory import Trajectory

EVENTS = 5  # events listed one by one
JOINTS = 24  # joints listed
SWITCHES = 4  # changes of method listed
LEAVING = 5  # joints listed that leave their range
CONSTRAINTS = 8  # constraints listed
MANY_TURNS = 1e6  # rad: beyond it degrees are not shown
END_HEADER = ("at the end", "position", "", "velocity")


def summary_text(run: Trajectory) -> str:
    """The summary as lines of text, in SI units."""
    rows = run_facts(run)
    width = max(len(name) for name, _ in rows)
    lines = [run.message, *(f"  {name:{width}}  {value}" for name, value in rows), ""]
    table = [END_HEADER, *end_rows(run)]
    widths = [max(len(row[k]) for row in table) for k in range(len(END_HEADER))]
    for first, *others in table:
        cells = (f"{text:>{room}}" for text, room in zip(others, widths[1:], strict=True))
        lines.append("  ".join(["", f"{first:{widths[0]}}", *cells]).rstrip())
    return "\n".join(lines + [f"  {text}" for text in _hidden(run)])


def summary_html(run: Trajectory) -> str:
    """The summary as an HTML table for notebooks; names are escaped."""
    left = 'style="text-align:left"'
    facts = "".join(
        f"<tr><th {left}>{escape(name)}</th><td {left} colspan={len(END_HEADER) - 1}>{escape(value)}</td></tr>"
        for name, value in run_facts(run)
    )
    head = "".join(f"<th>{text}</th>" for text in END_HEADER)
    end = "".join(
        f"<tr><td {left}>{escape(first)}</td>{''.join(f'<td>{escape(text)}</td>' for text in others)}</tr>"
        for first, *others in end_rows(run)
    )
    hidden = "".join(f"<tr><td {left} colspan={len(END_HEADER)}>{escape(text)}</td></tr>" for text in _hidden(run))
    return f"<table><caption {left}>{escape(run.message)}</caption>{facts}<tr>{head}</tr>{end}{hidden}</table>"


def run_facts(run: Trajectory) -> list[tuple[str, str]]:
    """(name, value) of solver, cost, events, residuals, constraints, notes and warnings.

    An empty name continues the entry before.
    """
    settings, cost = run.settings, run.statistics
    how = f"step {settings.step:g} s" if settings.step else f"rtol {settings.rtol:g}, atol {settings.atol:g}"
    effort = f"{_count(cost.steps, 'step')} and {cost.rejected} rejected, {_count(cost.evaluations, 'evaluation')}"
    if len(run.steps) - 1 < cost.steps:
        effort += f", the times of {len(run.steps) - 1} steps are kept"
    if cost.switches:
        effort += f", of which Radau {_count(cost.implicit_steps, 'step')} and {cost.implicit_evaluations} evaluations"
    if cost.jacobians:
        effort += f", {_count(cost.jacobians, 'Jacobian')}, {_count(cost.factorisations, 'factorisation')}"
    last = run.part(slice(-1, None))
    t, v, w = float(last.kinetic_energy[0]), float(last.potential_energy[0]), float(last.work[0])
    work = f", work {w:.6g} J" if system_of(run.scene).has_work else ""
    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        residuals = [
            ("energy drift", _known(run.energy_drift(), "of the largest energy")),
            ("equation residual", _known(run.equation_residual(), "of the largest joint force")),
        ]
    rows = [
        ("solver", f"{settings.solver}, {how}"),
        *_switches(cost),
        ("cost", f"{effort}, {_seconds(cost.kernel_time)} in the integrator"),
        *((("events" if k == 0 else ""), text) for k, text in enumerate(_events(run))),
        ("energy at the end", f"kinetic {t:.6g} J, potential {v:.6g} J{work}"),
        *residuals,
    ]
    rows += contact_rows(run)
    cascades = [(drive.joint.name, drive.cascade) for drive in run.scene.drives if drive.cascade is not None]
    tuned = [(name, cascade) for name, cascade in cascades if cascade.gains == "found"]
    for k, (name, cascade) in enumerate(tuned):
        rows.append(("gains found" if k == 0 else "", f"{name}: {cascade.described()}"))
    rows.append(("error estimate", _error(run)))
    rows += _constraints(run)
    if not run.scene.constraints and unit_vectors(run.robot.joints):
        rows.append(("constraint residual", f"{run.constraint_residual():.1e} (unit length of rotations)"))
    leaving, against = left_ranges(run), {*run.not_known}
    rows += [("not known", text) for text in leaving[:LEAVING]]
    if len(leaving) > LEAVING:
        rows.append(("", f"… and {_count(len(leaving) - LEAVING, 'more joint')} that leave their range"))
    rows += [("not known", text) for text in run.not_known if text not in leaving]
    rows += [("warning", text) for text in (*run.warnings, *run.robot.inertia_warnings) if text not in against]
    return rows + [("note", text) for text in run.notes if text not in against]


def run_data(run: Trajectory) -> dict[str, Any]:
    """The run without its rows, as data for JSON, in SI units."""
    settings, last = run.settings, run.part(slice(-1, None))
    labels = [*position_labels(run.robot.joints), *velocity_labels(run.robot.joints, 1)]
    end = np.concatenate([run.position[-1], run.velocity[-1]]).tolist()
    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        residuals = {
            "energy_drift": run.energy_drift(),
            "equations": run.equation_residual(),
            "constraints": run.constraint_residual(),
            "velocities": run.velocity_residual(),
        }
    return {
        "scene": run.scene.name,
        "status": str(run.status),
        "message": run.message,
        "start": float(run.time[0]),
        "end": float(run.time[-1]),
        "rows": len(run),
        "settings": {"solver": settings.solver, "step": settings.step, "rtol": settings.rtol, "atol": settings.atol},
        "statistics": asdict(run.statistics),
        "events": [
            {
                "name": event.name, "time": event.time, "stopped": event.stopped, "impulse": event.impulse,
                "energy_lost": event.energy_lost,
            }
            for event in run.events
        ],
        "energies_at_end": {
            "kinetic": float(last.kinetic_energy[0]), "potential": float(last.potential_energy[0]),
            "work": float(last.work[0]),
        },
        "residuals": residuals,
        "error_estimate": run.known_estimate,
        "at_end": {f"{name} [{unit}]": value for (name, unit), value in zip(labels, end, strict=True)},
        "not_known": list(run.not_known),
        "warnings": [*run.warnings, *run.robot.inertia_warnings],
        "notes": [note.as_dict() for note in run.notes],
    }  # fmt: skip


def _switches(cost: Statistics) -> list[tuple[str, str]]:
    """When solver "auto" changed its method."""
    if not cost.switches:
        return []
    names = ["Radau" if k % 2 == 0 else "DOP853" for k in range(SWITCHES)]
    listed = [f"{name} from {time:.6g} s" for name, time in zip(names, cost.switch_times, strict=False)]
    more = f", … ({cost.switches} in all)" if cost.switches > len(listed) else ""
    return [("methods", f"DOP853, {', '.join(listed)}{more}")]


def _known(value: float, unit: str) -> str:
    return f"{value:.1e} {unit}" if math.isfinite(value) else f"unknown {unit} (overflow)"


def _error(run: Trajectory) -> str:
    """The error estimate where it is known or takes less than a second, or why it was not computed."""
    found = unasked_accuracy(run)
    if isinstance(found, str):
        return found
    if not math.isfinite(found.estimate):
        return "unknown (a repeated run ended earlier)"
    known = "" if found.known_until == math.inf else f"; known up to {found.known_until:.4g} s"
    return f"about {found.estimate:.1e} (rad or m) in positions, by repeated runs{known}"


def _constraints(run: Trajectory) -> list[tuple[str, str]]:
    """Residuals of the constraints, and their multipliers at the end, with those that are not unique."""
    if not run.scene.constraints:
        return []
    with np.errstate(all="ignore"):
        residuals = _known(run.constraint_residual(), "m or rad"), _known(run.velocity_residual(), "m/s or rad/s")
        rows, last = [("constraint residuals", ", ".join(residuals))], run.part(slice(-1, None))
    for constraint in run.scene.constraints[:CONSTRAINTS]:
        history = last.constraint(constraint.name)
        shown = [
            label.replace("[", f"{value:.6g} ").removesuffix("]")
            for label, value in zip(history.labels, history.multipliers[-1].tolist(), strict=True)
        ]
        rows.append((f"{constraint.name} at the end", ", ".join(shown)))
    if len(run.scene.constraints) > CONSTRAINTS:
        rows.append(("", f"… and {_count(len(run.scene.constraints) - CONSTRAINTS, 'more constraint')}"))
    count = len(run.multiplier_names)
    if not np.isfinite(run.state[-1]).all():
        return rows
    try:
        rank = run.constraint_rank()
    except InputError as error:
        return [*rows, ("not unique", f"unknown: {error}")]
    if rank.rank < count:
        names = [" ".join(name) for name, unique in zip(run.multiplier_names, rank.unique, strict=True) if unique]
        rows.append(
            (
                "not unique",
                f"the constraints have rank {rank.rank} of {count} rows at the end: minimum-norm multipliers are "
                f"reported; unique are {', '.join(names) or 'none'}",
            )
        )
    return rows


def _events(run: Trajectory) -> list[str]:
    lines = [f"{event.name} at {event.time:.9g} s{event_consequence(event)}" for event in run.events[:EVENTS]]
    count = len(run.events) + sum(run.statistics.omitted_events.values())
    if count > EVENTS:
        last, kept = run.events[-1], "" if count == len(run.events) else f" ({len(run.events)} are kept)"
        lines.append(f"… {count} events in all{kept}; the last is {last.name} at {last.time:.9g} s")
    return lines


def event_consequence(event: Event) -> str:
    """The consequence of an event, as a clause after its name and time; empty where there is none."""
    text = ", which ended the run" if event.stopped else ""
    if event.latch is not None:
        text += f" and latched: impulse {event.impulse:.6g} {event.latch.unit}, energy lost {event.energy_lost:.9g} J"
    return text


def end_rows(run: Trajectory) -> list[tuple[str, ...]]:
    """(coordinate, position, in degrees, velocity) at the end.

    Positions and velocities of a joint with several coordinates do not correspond, and have rows of their own.
    """
    rows: list[tuple[str, ...]] = []
    for joint in run.robot.joints[:JOINTS]:
        q = list(zip(position_labels([joint]), run.position[-1, joint.q : joint.q + joint.nq].tolist(), strict=True))
        v = list(zip(velocity_labels([joint]), run.velocity[-1, joint.v : joint.v + joint.nv].tolist(), strict=True))
        if joint.nv == 1:
            rows.append((joint.name, _value(q[0]), _degrees(q[0]), _value(v[0])))
            continue
        rows += [(entry[0][0], _value(entry), "", "") for entry in q]
        rows += [(entry[0][0], "", "", _value(entry)) for entry in v]
    return rows


def _hidden(run: Trajectory) -> list[str]:
    count = len(run.robot.joints) - JOINTS
    return [f"… and {_count(count, 'more joint')}"] if count > 0 else []


def _value(entry: tuple[tuple[str, str], float]) -> str:
    (_, unit), x = entry
    return f"{x:.6g}" + ("" if unit == "1" else f" {unit}")


def _degrees(entry: tuple[tuple[str, str], float]) -> str:
    (_, unit), x = entry
    return f"{math.degrees(x):.2f}°" if unit == "rad" and abs(x) < MANY_TURNS else ""


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _seconds(seconds: float) -> str:
    for factor, unit in ((1e6, "µs"), (1e3, "ms")):
        if seconds * factor < 1000.0:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds:.3g} s"
