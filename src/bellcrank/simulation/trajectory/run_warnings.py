"""Reasons not to trust a run."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.dynamics.equations.system import system_of
from bellcrank.elements.signals import values_at
from bellcrank.simulation.trajectory.error_estimate import DRIFTED, departure

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory.trajectory import Trajectory

LARGEST_RESIDUAL, LARGEST_DRIFT = 1e-6, 1e-3  # relative, above which a run is not to be trusted
LARGEST_CONSTRAINT_RESIDUAL = 1e-3  # rad, or of the mechanism's characteristic length
EVENT_TOLERANCE = 1e-6  # of an event function's largest value, by which it may miss zero at the event
STIFF, SLOW = 0.1, 20_000  # of the steps, and evaluations: by so many stiff steps a long run is slowed down
NOISE = 1e-7  # of the energies: rounding and tolerance


def run_warnings(run: Trajectory) -> tuple[str, ...]:
    """Reasons not to trust a run, a clause each.

    It ended early, a result is not finite, the equations of motion or the energy balance are not satisfied, kinetic
    energy is negative, a constraint is violated, or an event is not at the zero of its function.
    """
    found = []
    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        residual, drift = run.equation_residual(), run.energy_drift()
        gap, size, least, largest = _energies(run)
    if not run.success:
        found.append(
            f"the run ended before its duration of {run.settings.duration:g} s: results are for the time before"
        )
    found += run.non_finite
    if residual > LARGEST_RESIDUAL:
        found.append(
            "the accelerations do not satisfy the equations of motion: the mass matrix is nearly singular; give "
            "massless links inertia"
        )
    if drift > LARGEST_DRIFT and not gap < NOISE * size:  # at rest, the drift is a ratio of rounding errors
        found.append("the energy balance is violated: take smaller tolerances or steps")
    if least < -NOISE * largest:
        found.append(f"kinetic energy is negative (down to {least:.3g} J): check masses and inertias")
    found += _stiffness(run)
    return (*found, *_open_constraints(run), *_departure(run), *_false_events(run), *_missed_events(run))


def not_known(run: Trajectory) -> tuple[str, ...]:
    """A clause where the error of the positions is estimated to exceed its bound, and from when on."""
    until = run.known_until
    if until is None or until == math.inf:
        return ()
    known = run.known_accuracy
    assert known is not None
    size = "a repeated run ended early" if known.estimate == math.inf else f"it grows to {known.estimate:.2g} rad or m"
    return (
        f"the positions are not known beyond {until:.4g} s: there the error estimate exceeds "
        f"{run.settings.error_bound:g} of a coordinate's range ({size}); take smaller tolerances, or end the run "
        "before: a motion that is sensitive to its start can be known for a limited time only",
    )


def _stiffness(run: Trajectory) -> list[str]:
    """A clause on a run of an explicit solver in which stability limits the steps."""
    cost, solver = run.statistics, run.settings.solver
    few = cost.evaluations < SLOW or cost.stiff_steps < STIFF * cost.steps
    if solver == "auto" or few:
        return []
    return [
        f"the equations are stiff from {cost.stiff_since:.4g} s on: stability, not accuracy, limits "
        f"{cost.stiff_steps} of {cost.steps} steps of {solver}; take solver: auto or Radau, which may be many times "
        "faster"
    ]


def _energies(run: Trajectory) -> tuple[float, float, float, float]:
    """The largest change of T + V − W, the largest |T| + |V|, the least T and the largest |T|, J."""
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
    """A clause for each constraint with a large position residual, in the order of the scene."""
    names = [constraint.name for constraint in run.scene.constraints]
    worst = dict.fromkeys(names, (LARGEST_CONSTRAINT_RESIDUAL, 0.0, 0.0))  # relative, residual, time
    for part in run.parts():
        for name in names:
            history = part.constraint(name)
            k = int(np.argmax(np.nan_to_num(history.relative)))
            if history.relative[k] > worst[name][0]:
                worst[name] = (float(history.relative[k]), float(history.residual[k]), float(part.time[k]))
    return [
        f"constraint '{name}' has a residual of {residual:.3g} m or rad at {time:.4g} s: take stabilisation: "
        "projection, or smaller tolerances; if it cannot be satisfied there, this is not a motion of the mechanism"
        for name, (relative, residual, time) in worst.items()
        if relative > LARGEST_CONSTRAINT_RESIDUAL
    ]


def _departure(run: Trajectory) -> list[str]:
    """Clauses on a run without projection: its constraints drift, or it differs from a run with projection."""
    s, found = run.settings, []
    if not run.scene.constraints or s.stabilisation.kind == "projection":
        return []
    open_, allowed = run.constraint_residual(), s.atol + s.rtol * float(np.abs(run.position).max())
    if not s.step and open_ > DRIFTED * allowed:
        found.append(
            f"constraint residuals grow to {open_:.3g} m or rad, {open_ / allowed:.2g} times the tolerance: take "
            "stabilisation: projection"
        )
    gone = departure(run)
    if gone is not None and gone.largest > 0.0:
        found.append(
            f"the run differs from one with projection from {gone.time:.4g} s on, by up to {gone.largest:.3g} rad or "
            "m; take stabilisation: projection (near configurations where constraints lose rank, drift decides which "
            "branch of the motion a linkage follows)"
        )
    if gone is not None and gone.ended is not None:
        found.append(
            f"with stabilisation: projection the run ends at {gone.ended:.4g} s: later results may not be a motion of "
            "the linkage"
        )
    return found


def _false_events(run: Trajectory) -> list[str]:
    """A clause for each event at which its function is not zero and does not jump across zero."""
    if not run.events:
        return []
    system, names = system_of(run.scene), [rule.name for rule in run.scene.events]
    which = np.array([names.index(event.name) for event in run.events])
    time = np.array([event.time for event in run.events])
    state = np.zeros((len(time), system.size))
    for row, event in zip(state, run.events, strict=True):
        row[: len(event.state)] = event.state

    def value(t: Array, x: Array) -> Array:
        rows = system.events(t[:, None], x, values_at(run.signals, t), run.parameters)
        return np.asarray(rows.reshape(len(t), -1)[np.arange(len(t)), which])

    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        largest = np.max([np.abs(part.event_values).max(axis=0) for part in run.parts()], axis=0)[which]
        here, span = value(time, state), 1e-9 * (1.0 + time)
        rates = system.rhs(time[:, None], state, values_at(run.signals, time), run.parameters)
        slope = (rates[0] if isinstance(rates, tuple) else rates)[
            :, : system.size
        ]  # with constraints there is a guard as well
        before, after = (value(time + h, state + h[:, None] * slope) for h in (-span, span))
        wrong = (np.abs(here) > EVENT_TOLERANCE * (1.0 + largest)) & ~(before * after <= 0.0)
    first = {run.events[k].name: here[k] for k in np.flatnonzero(wrong)[::-1]}
    return [
        f"event '{name}' is not at a zero of its function (which is {value:.4g} there): the steps are too large; take "
        "a smaller step or tighter tolerances"
        for name, value in first.items()
    ]


def _missed_events(run: Trajectory) -> list[str]:
    """A clause for each event of which crossings may have been missed."""
    return [
        f"the function of event '{it.event}' oscillates so fast that crossings may have been missed in {it.steps} "
        f"step{'' if it.steps == 1 else 's'} from {it.first:.6g} s on: set simulate.max_step to a few of its periods "
        "or less"
        for it in run.statistics.unresolved
        if not it.undefined
    ]
