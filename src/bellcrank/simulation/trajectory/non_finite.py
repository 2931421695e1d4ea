"""Results of a run that are not finite: outputs, energies, forces, constraints and event functions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.dynamics.equations.system import system_of
from bellcrank.elements.signals import values_at
from bellcrank.simulation.integration.statistics import Status

if TYPE_CHECKING:
    from bellcrank.elements.signals import Signal
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory.trajectory import Trajectory


EACH = 8  # reported one by one; the others are listed in one clause
AHEAD = (0.0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-2)  # of the duration: how far behind the last state a cause is looked for


@dataclass
class _Tally:
    """In how many rows a quantity is not finite, and the first time."""

    what: str
    first: float  # s
    rows: int = 0
    undefined: bool = False


def non_finite(run: Trajectory) -> tuple[str, ...]:
    """A clause for each quantity of a run that is NaN or infinite in some row, and each event function that is NaN.

    Each says in how many rows or steps, and the first time.
    """
    with np.errstate(all="ignore"):
        tallies: dict[str, _Tally] = {}
        for part in run.parts():
            for key, name, rows in _quantities(part):
                _count(tallies, part, key, name, rows)
        found = [(tally.what, _how(run, tally)) for tally in tallies.values()]
        found += _events(run)
    clauses = [f"{what} is {how}" for what, how in found[:EACH]]
    if len(found) > EACH:
        clauses.append(f"also not finite in some rows: {', '.join(what for what, _ in found[EACH:])}")
    return tuple(clauses)


def _quantities(run: Trajectory) -> Iterator[tuple[str, Callable[[int], str], Array]]:
    """(key, name of a column, rows) of each quantity."""
    for name, rows in run.outputs.items():
        yield f"output {name}", partial("output '{0}'".format, name), rows
    by_joint = {
        "position": run.position,
        "velocity": run.velocity,
        "acceleration": run.acceleration,
        "torque": run.torque,
    }
    for what, rows in by_joint.items():
        yield what, partial(_joint, run, what), rows
    energies = {"kinetic energy": run.kinetic_energy, "potential energy": run.potential_energy, "work": run.work}
    for what, rows in energies.items():
        yield what, partial("the {0}".format, what), rows
    for constraint in run.scene.constraints:
        history, name = run.constraint(constraint.name), constraint.name
        yield f"multiplier {name}", partial("a multiplier of constraint '{0}'".format, name), history.multipliers
        residuals = np.column_stack([history.residual, history.velocity_residual])
        yield f"residual {name}", partial("the residual of constraint '{0}'".format, name), residuals


def _joint(run: Trajectory, what: str, column: int) -> str:
    """The name of a column of a quantity of the joints."""
    places = [(j.q, j.nq) if what == "position" else (j.v, j.nv) for j in run.robot.joints]
    joint = next(j for j, (k, size) in zip(run.robot.joints, places, strict=True) if k <= column < k + size)
    return f"the {what} of joint '{joint.name}'"


def _count(tallies: dict[str, _Tally], run: Trajectory, key: str, name: Callable[[int], str], rows: Array) -> None:
    """Count the rows of a block in which a quantity is not finite."""
    table = rows.reshape(len(run), -1)
    entries: Mask = ~np.isfinite(table)
    bad: Mask = np.asarray(entries.any(axis=1))
    if not bad.any():
        return
    row = int(bad.argmax())
    tally = tallies.setdefault(key, _Tally(name(int(entries[row].argmax())), float(run.time[row])))
    tally.rows += int(np.count_nonzero(bad))
    tally.undefined |= bool(np.isnan(table).any())


def _how(run: Trajectory, tally: _Tally) -> str:
    kind = "not a number (NaN)" if tally.undefined else "infinite"
    return f"{kind} in {tally.rows} of {len(run)} rows, first at {tally.first:.6g} s"


def _events(run: Trajectory) -> Iterator[tuple[str, str]]:
    """Event functions that are NaN in steps of the solver, or in rows only."""
    if not run.scene.events:
        return
    steps = {it.event: it for it in run.statistics.unresolved if it.undefined}
    rows: Mask = np.vstack([np.isnan(part.event_values) for part in run.parts()])
    for k, rule in enumerate(run.scene.events):
        bad = rows[:, k]
        if rule.name in steps:
            it = steps[rule.name]
            count = f"{it.steps} step{'' if it.steps == 1 else 's'} of the solver"
            first = min([it.first, *run.time[bad][:1].tolist()])
        elif bad.any():
            count, first = f"{np.count_nonzero(bad)} of {len(run)} rows", float(run.time[bad.argmax()])
        else:
            continue
        yield (
            f"the function of event '{rule.name}'",
            f"not a number (NaN) in {count}, first seen at {first:.6g} s: crossings there are not found",
        )


def cause(run: Trajectory) -> str:
    """What is not finite at or just after the last finite state of a run with status NON_FINITE, as a clause.

    It is looked for along the state's rate of change there; empty where nothing is found.
    """
    good = np.flatnonzero(np.isfinite(run.state).all(axis=1))
    if run.status is not Status.NON_FINITE or not len(good):
        return ""
    last = slice(good[-1], good[-1] + 1)
    ahead = np.array([AHEAD]) * run.settings.duration
    return causes(run.scene, (run.time[last], run.state[last], run.parameters[None]), run.signals, ahead)[0]


def causes(
    scene: Scene,
    last: tuple[Array, Array, Array],
    signals: tuple[Signal, ...],
    ahead: Array,
    held: Array | None = None,
) -> list[str]:
    """The causes of n runs, from the times (n,), states (n, size) and parameters (n, np) of their `last` finite rows.

    They are looked for at times `ahead` (n, k), s, of these. `held` (n, h): what follows the signals in u.
    """
    system, (time, state, p) = system_of(scene), last
    count, steps = ahead.shape
    held = np.zeros((count, 0)) if held is None else held
    with np.errstate(all="ignore"):
        rhs = system.fallback if scene.constraints else system.rhs
        rate = rhs(time[:, None], state, np.hstack([values_at(signals, time), held]), p)
        rate = np.where(np.isfinite(rate), rate, 0.0)
        times = (time[:, None] + ahead).ravel()
        states = (state[:, None] + ahead[:, :, None] * rate[:, None]).reshape(count * steps, -1)
        inputs = np.hstack([values_at(signals, times), np.repeat(held, steps, axis=0)])
        arguments = times[:, None], states, inputs, np.repeat(p, steps, axis=0)
        found: list[tuple[Mask, list[str]]] = []
        if scene.constraints:
            _, gap, speed = system.constraint(*arguments)
            bad = ~np.isfinite(speed)
            bad[:, : gap.shape[1]] |= ~np.isfinite(gap)
            found.append((bad, [f"constraint '{name}'" for name, _ in system.multiplier_names]))
        acceleration, _, actuator, passive, *_ = system.observation(*arguments)
        joints = [joint.name for joint in scene.robot.joints for _ in range(joint.nv)]
        for what, rows in (("actuator force", actuator), ("passive force", passive), ("acceleration", acceleration)):
            found.append((~np.isfinite(rows), [f"the {what} of joint '{name}'" for name in joints]))
    texts = [""] * count
    for bad, names in found:
        by_run = bad.reshape(count, steps, -1)
        for row in np.flatnonzero(by_run.any(axis=(1, 2))).tolist():
            first = by_run[row][by_run[row].any(axis=1).argmax()]
            texts[row] = texts[row] or f"{names[int(first.argmax())]} is not finite there or just after"
    return texts
