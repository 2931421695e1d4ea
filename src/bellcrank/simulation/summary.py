"""A run in a few lines: why it ended, what it cost, its certificate with warnings, its end; as text and HTML."""

from __future__ import annotations

import math
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.dynamics.system import system_of
from bellcrank.elements.signals import values_at
from bellcrank.errors import InputError
from bellcrank.motion.coordinates import position_labels, velocity_labels
from bellcrank.simulation.second_run import DRIFTED, departure, error_estimate, expected_cost

if TYPE_CHECKING:
    from bellcrank.simulation.record import Event
    from bellcrank.simulation.trajectory import Array, Trajectory

EVENTS = 5  # events listed one by one
JOINTS = 24  # joints listed
LARGEST_RESIDUAL, LARGEST_DRIFT = 1e-6, 1e-3  # shares, above which a run is not to be trusted
LARGEST_GAP = 1e-3  # rad, or of the mechanism's length, that a constraint may be apart
OFF_ZERO = 1e-6  # share of its largest value by which an event's function may miss zero at the event
EDGE = 1e-9  # rad, or of the larger end of a range in m, beyond it that is no leaving
LEAVING = 5  # joints listed that leave their range
NOISE = 1e-7  # share of the energies that is rounding and tolerance
CONSTRAINTS = 8  # constraints listed
UNASKED = 1.0  # s that an error estimate may take unasked
MANY_TURNS = 1e6  # rad: beyond it, and where it is no number, degrees say nothing
END_HEADER = ("at the end", "position", "", "velocity")


def summary_text(run: Trajectory) -> str:
    """The run as lines of text: verdict, solver, cost, events, certificate, and the joints at the end (SI units)."""
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
    """The same as a table for notebooks; names are escaped."""
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


def run_warnings(run: Trajectory) -> tuple[str, ...]:
    """What speaks against a run, a clause each: it did not come to its end, something in it is not a finite number, its
    accelerations miss the equations of motion, its energies their balance, kinetic energy is negative, a constraint is
    open, or an event is not at its zero.
    """
    found = []
    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        residual, drift = run.equation_residual(), run.energy_drift()
        gap, size, least, largest = _energies(run)
    if not run.success:
        found.append(f"the run stopped before its {run.settings.duration:g} s: what follows is of its first part")
    found += run.non_finite
    if residual > LARGEST_RESIDUAL:
        found.append(
            "the accelerations do not satisfy the equations: the mass matrix is close to singular there; give "
            "massless links inertia"
        )
    if drift > LARGEST_DRIFT and not gap < NOISE * size:  # where nothing moves, the drift is a ratio of roundings
        found.append("energy is not in balance: take smaller tolerances or steps")
    if least < -NOISE * largest:
        found.append(f"kinetic energy falls to {least:.3g} J: a mass or inertia is not that of a body")
    return (*found, *_open_constraints(run), *_departure(run), *_false_events(run), *_missed_events(run))


def _energies(run: Trajectory) -> tuple[float, float, float, float]:
    """By how much the sum of the energies less work changes at most, the largest sum of their sizes, and the least and
    the largest size of the kinetic energy, J.
    """
    first = run.part(slice(0, 1))
    balance = first.total_energy - first.work
    found = []
    for part in run.parts():
        kinetic, potential = part.kinetic_energy, part.potential_energy
        gap = np.abs(kinetic + potential - part.work - balance).max()
        found.append((gap, (np.abs(kinetic) + np.abs(potential)).max(), -kinetic.min(), np.abs(kinetic).max()))
    gap, size, least, largest = np.max(found, axis=0).tolist()
    return gap, size, -least, largest


def _open_constraints(run: Trajectory) -> list[str]:
    """A clause for each constraint that is far from closed, in the order of the scene."""
    names = [constraint.name for constraint in run.scene.constraints]
    worst = dict.fromkeys(names, (LARGEST_GAP, 0.0, 0.0))  # relative, residual, time
    for part in run.parts():
        for name in names:
            history = part.constraint(name)
            k = int(np.argmax(np.nan_to_num(history.relative)))
            if history.relative[k] > worst[name][0]:
                worst[name] = (float(history.relative[k]), float(history.residual[k]), float(part.time[k]))
    return [
        f"constraint '{name}' is {residual:.3g} m or rad apart at {time:.4g} s: take stabilisation: projection, or "
        "smaller tolerances; if it cannot close there, the motion is none"
        for name, (relative, residual, time) in worst.items()
        if relative > LARGEST_GAP
    ]


def _departure(run: Trajectory) -> list[str]:
    """Clauses on a run whose constraints are not projected: they drift far beyond its tolerances, or it leaves the motion
    that a run with projection has.
    """
    s, found = run.settings, []
    if not run.scene.constraints or s.stabilisation.kind == "projection":
        return []
    open_, allowed = run.constraint_residual(), s.atol + s.rtol * float(np.abs(run.position).max())
    if not s.step and open_ > DRIFTED * allowed:
        found.append(
            f"constraints drift {open_:.3g} m or rad apart, {open_ / allowed:.2g} times the tolerance: take "
            "stabilisation: projection"
        )
    gone = departure(run)
    if gone is not None and gone.largest > 0.0:
        found.append(
            f"the run leaves the motion that projection gives: from {gone.time:.4g} s on it is elsewhere, "
            f"by up to {gone.largest:.3g} rad or m; take stabilisation: projection (near positions in which constraints "
            "lose rank, drift decides along which branch a linkage goes on)"
        )
    if gone is not None and gone.ended is not None:
        found.append(
            f"with stabilisation: projection the run ends at {gone.ended:.4g} s: what follows may be no motion of the "
            "linkage"
        )
    return found


def _false_events(run: Trajectory) -> list[str]:
    """A clause for each event whose function is not zero where the run has it, nor jumps across zero there."""
    if not run.events:
        return []
    system, names = system_of(run.scene), [rule.name for rule in run.scene.events]
    which = np.array([names.index(event.name) for event in run.events])
    time = np.array([event.time for event in run.events])
    state = np.zeros((len(time), system.size))
    for row, event in zip(state, run.events, strict=True):
        row[: system.nq + system.nv] = *event.position, *event.velocity

    def value(t: Array, x: Array) -> Array:
        rows = system.events(t[:, None], x, values_at(run.signals, t), run.parameters)
        return np.asarray(rows.reshape(len(t), -1)[np.arange(len(t)), which])

    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        largest = np.max([np.abs(part.event_values).max(axis=0) for part in run.parts()], axis=0)[which]
        here, span = value(time, state), 1e-9 * (1.0 + time)
        rates = system.rhs(time[:, None], state, values_at(run.signals, time), run.parameters)
        slope = (rates[0] if isinstance(rates, tuple) else rates)[:, : system.size]  # constraints add a guard
        before, after = (value(time + h, state + h[:, None] * slope) for h in (-span, span))
        wrong = (np.abs(here) > OFF_ZERO * (1.0 + largest)) & ~(before * after <= 0.0)
    first = {run.events[k].name: here[k] for k in np.flatnonzero(wrong)[::-1]}
    return [
        f"event '{name}' is not at its own zero (its function is {value:.4g} there): the steps are too large for it; "
        "use a smaller step or tighter tolerances"
        for name, value in first.items()
    ]


def _missed_events(run: Trajectory) -> list[str]:
    """A clause for each event of which crossings may have been missed."""
    return [
        f"event '{it.event}' oscillates so fast that crossings may have been missed in {_count(it.steps, 'step')} from "
        f"{it.first:.6g} s on: set simulate.max_step to a few periods of its function or less"
        for it in run.statistics.unresolved
        if not it.undefined
    ]


def run_notes(run: Trajectory) -> tuple[str, ...]:
    """The joints that start within their URDF's range and leave it, one sentence each."""
    notes = []
    for j in run.robot.joints:
        if j.nq != 1:
            continue
        q, lower, upper = run.position[:, j.q], float(run.robot.lower[j.q]), float(run.robot.upper[j.q])
        edge = EDGE * (
            max(abs(lower), abs(upper)) if j.kind == "prismatic" and np.isfinite([lower, upper]).all() else 1.0
        )
        outside = (q < lower - edge) | (q > upper + edge)
        if not outside.any() or outside[0]:  # what starts outside is told of before the run
            continue
        unit = "m" if j.kind == "prismatic" else "rad"
        far = q[np.argmax(np.maximum(q - upper, lower - q))]
        notes.append(
            f"joint '{j.name}' leaves its range at {run.time[outside.argmax()]:.4g} s: it reaches {far:.6g} {unit}, "
            f"the URDF has {lower:.6g} to {upper:.6g} {unit}, and the simulation knows no stops"
        )
    return tuple(notes)


def run_facts(run: Trajectory) -> list[tuple[str, str]]:
    """(name, value) of solver, cost, events, certificate, constraints, notes and warnings; a name is empty where it goes
    on.
    """
    settings, cost = run.settings, run.statistics
    how = f"step {settings.step:g} s" if settings.step else f"rtol {settings.rtol:g}, atol {settings.atol:g}"
    effort = f"{_count(cost.steps, 'step')} and {cost.rejected} rejected, {_count(cost.evaluations, 'evaluation')}"
    if len(run.steps) - 1 < cost.steps:
        effort += f", the times of {len(run.steps) - 1} steps are kept"
    if cost.jacobians:
        effort += f", {_count(cost.jacobians, 'Jacobian')}, {_count(cost.factorisations, 'factorisation')}"
    last = run.part(slice(-1, None))
    t, v, w = float(last.kinetic_energy[0]), float(last.potential_energy[0]), float(last.work[0])
    work = f", work {w:.6g} J" if system_of(run.scene).has_work else ""
    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        certificate = [
            ("energy drift", _known(run.energy_drift(), "of the largest energy")),
            ("equation residual", _known(run.equation_residual(), "of the largest joint force")),
        ]
    rows = [
        ("solver", f"{settings.solver}, {how}"),
        ("cost", f"{effort}, {_seconds(cost.kernel_time)} of stepping"),
        *((("events" if k == 0 else ""), text) for k, text in enumerate(_events(run))),
        ("energy at the end", f"kinetic {t:.6g} J, potential {v:.6g} J{work}"),
        *certificate,
    ]
    rows.append(("error estimate", _error(run)))
    rows += _constraints(run)
    if not run.scene.constraints and any(joint.kind in ("floating", "planar") for joint in run.robot.joints):
        rows.append(("constraint residual", f"{run.constraint_residual():.1e} (unit length of rotations)"))
    notes = run_notes(run)
    rows += [("note", text) for text in notes[:LEAVING]]
    if len(notes) > LEAVING:
        rows.append(("", f"… and {_count(len(notes) - LEAVING, 'more joint')} that leave their range"))
    return rows + [("warning", text) for text in (*run.warnings, *run.robot.inertia_warnings)]


def _known(value: float, unit: str) -> str:
    return f"{value:.1e} {unit}" if math.isfinite(value) else f"unknown {unit} (beyond all numbers)"


def _error(run: Trajectory) -> str:
    """The error estimate where it is known or costs less than a second, or why it was not computed."""
    ask = "error_estimate(), or simulate --error-estimate"
    value = run.known_estimate
    if value is None:
        if not run.success:
            return "not computed (the run stopped early)"
        if not system_of(run.scene).is_loaded:
            return f"not computed (it takes code that is not loaded; {ask})"
        cost = expected_cost(run)
        value = error_estimate(run, UNASKED) if cost < UNASKED else None
        if value is None:
            return f"not computed (it takes more than {max(cost, UNASKED):.2g} s; {ask})"
        run.remember_estimate(value)
    return (
        f"positions are off by about {value:.1e} (rad or m), by repeated runs"
        if math.isfinite(value)
        else "unknown (a repeated run ended earlier)"
    )


def _constraints(run: Trajectory) -> list[tuple[str, str]]:
    """Residuals of constraints, and their multipliers at the end with what is odd about them."""
    if not run.scene.constraints:
        return []
    with np.errstate(all="ignore"):
        residuals = _known(run.constraint_residual(), "m or rad"), _known(run.velocity_residual(), "m/s or rad/s")
        apart = f"{', '.join(residuals)} apart"
    rows, last = [("closures", apart)], run.part(slice(-1, None))
    for constraint in run.scene.constraints[:CONSTRAINTS]:
        history = last.constraint(constraint.name)
        shown = [
            label.replace("[", f"{value:.6g} ").removesuffix("]")
            for label, value in zip(history.labels, history.multipliers[-1].tolist(), strict=True)
        ]
        rows.append((f"{constraint.name} at the end", ", ".join(shown)))
    if len(run.scene.constraints) > CONSTRAINTS:
        rows.append(("", f"… and {_count(len(run.scene.constraints) - CONSTRAINTS, 'more constraint')}"))
    count = len(system_of(run.scene).multiplier_names)
    if not np.isfinite(run.state[-1]).all():
        return rows
    try:
        rank = run.constraint_rank()
    except InputError as error:
        return [*rows, ("not unique", f"unknown: {error}")]
    if rank.rank < count:
        rows_of = system_of(run.scene).multiplier_names
        names = [" ".join(name) for name, unique in zip(rows_of, rank.unique, strict=True) if unique]
        rows.append(
            (
                "not unique",
                f"the constraints have rank {rank.rank} of {count} rows at the end: the multipliers are the least of all "
                f"that fit; unique are {', '.join(names) or 'none'}",
            )
        )
    return rows


def _events(run: Trajectory) -> list[str]:
    lines = [f"{event.name} at {event.time:.9g} s{event_consequence(event)}" for event in run.events[:EVENTS]]
    count = len(run.events) + sum(run.statistics.omitted_events.values())
    if count > EVENTS:
        last, kept = run.events[-1], "" if count == len(run.events) else f" ({len(run.events)} are kept)"
        lines.append(f"… {count} in all{kept}, the last is {last.name} at {last.time:.9g} s")
    return lines


def event_consequence(event: Event) -> str:
    """What an event did besides happening, as a clause after its name; empty where it did nothing."""
    text = ", which ended the run" if event.stopped else ""
    if event.latch is not None:
        text += f" and latched: impulse {event.impulse:.6g} {event.latch.unit}, energy lost {event.energy_lost:.9g} J"
    return text


def end_rows(run: Trajectory) -> list[tuple[str, ...]]:
    """(coordinate, value, in degrees, velocity) at the end; positions and velocities of a joint with several
    coordinates are not of one kind, and have lines of their own.
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
