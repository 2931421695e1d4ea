"""What of a run is not a finite number though the run went on: outputs, energies, forces, closures, events."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.signals import values_at
from bellcrank.simulation.status import Status

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory import Array, Trajectory

EACH = 8  # told one by one; the others are counted
AHEAD = (0.0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-2)  # of the duration: how far beyond the last state its cause is looked for


def non_finite(run: Trajectory) -> tuple[str, ...]:
    """A clause for each quantity of a run that is NaN or infinite in some row, with how many rows and the first time;
    and for each event whose function is NaN, in rows or steps, where no crossing of it can be found.
    """
    with np.errstate(all="ignore"):
        found = [*_quantities(run), *_events(run)]
    clauses = [f"{what} is {how}" for what, how in found[:EACH]]
    if len(found) > EACH:
        clauses.append(f"not finite numbers either, in some rows: {', '.join(what for what, _ in found[EACH:])}")
    return tuple(clauses)


def _quantities(run: Trajectory) -> Iterator[tuple[str, str]]:
    for name, rows in run.outputs.items():
        yield from _told(run, f"output '{name}'", rows)
    for what, rows in (("position", run.position), ("velocity", run.velocity), ("acceleration", run.acceleration),
                       ("torque", run.torque)):  # fmt: skip
        yield from _told_by_joint(run, what, rows)
    energies = {"kinetic energy": run.kinetic_energy, "potential energy": run.potential_energy, "work": run.work}
    for what, rows in energies.items():
        yield from _told(run, f"the {what}", rows)
    for closure in run.scene.closures:
        history = run.closure(closure.name)
        yield from _told(run, f"a multiplier of closure '{closure.name}'", history.multipliers)
        residuals = np.column_stack([history.residual, history.velocity_residual])
        yield from _told(run, f"the residual of closure '{closure.name}'", residuals)


def _told_by_joint(run: Trajectory, what: str, rows: Array) -> Iterator[tuple[str, str]]:
    """One clause for all joints together, with the name of the first that it happens to."""
    bad = ~np.isfinite(rows)
    if not bad.any():
        return
    first = bad[bad.any(axis=1).argmax()]
    joints = run.robot.joints
    places = [slice(j.q, j.q + j.nq) if what == "position" else slice(j.v, j.v + j.nv) for j in joints]
    joint = next(j for j, place in zip(joints, places, strict=True) if first[place].any())
    yield from _told(run, f"the {what} of joint '{joint.name}'", rows)


def _told(run: Trajectory, what: str, rows: Array) -> Iterator[tuple[str, str]]:
    table = rows.reshape(len(run), -1)
    bad: NDArray[np.bool_] = np.asarray(~np.isfinite(table).all(axis=1))
    if bad.any():
        kind = "not a number (NaN)" if np.isnan(table).any() else "infinite"
        yield what, f"{kind} in {_share(run, bad)}, first at {run.time[bad.argmax()]:.6g} s"


def _events(run: Trajectory) -> Iterator[tuple[str, str]]:
    """Events that are NaN in steps of the solver, or in rows where it found none, as at a single row."""
    steps = {it.event: it for it in run.statistics.unresolved if it.undefined}
    rows: NDArray[np.bool_] = np.zeros((len(run), 0), dtype=np.bool_)
    if run.scene.events:
        values = run.scene.system.events(run.time[:, None], run.state, run.inputs, run.parameters)
        rows = np.isnan(np.asarray(values).reshape(len(run), -1))
    for k, rule in enumerate(run.scene.events):
        if rule.name in steps:
            it = steps[rule.name]
            count = f"{it.steps} step{'' if it.steps == 1 else 's'} of the solver"
            first = min([it.first, *run.time[rows[:, k]][:1].tolist()])
        elif rows[:, k].any():
            count, first = _share(run, rows[:, k]), float(run.time[rows[:, k].argmax()])
        else:
            continue
        yield (
            f"the function of event '{rule.name}'",
            f"not a number (NaN) in {count}, first seen at {first:.6g} s: crossings there are not found",
        )


def _share(run: Trajectory, bad: NDArray[np.bool_]) -> str:
    return f"{np.count_nonzero(bad)} of {len(run)} rows"


def cause(run: Trajectory) -> str:
    """What is not a finite number at or just beyond the last finite state of a run that ended NON_FINITE, found along
    its tangent there, as a clause; empty where nothing is.
    """
    good = np.flatnonzero(np.isfinite(run.state).all(axis=1))
    if run.status is not Status.NON_FINITE or not len(good):
        return ""
    system, row = run.scene.system, int(good[-1])
    ahead = np.array(AHEAD) * run.settings.duration
    time = run.time[row] + ahead
    with np.errstate(all="ignore"):
        here = run.time[row : row + 1], run.state[row], values_at(run.signals, run.time[row : row + 1])[0]
        rate = (system.fallback if run.scene.closures else system.rhs)(*here, run.parameters)
        rate = np.where(np.isfinite(rate[: system.size]), rate[: system.size], 0.0)
        state = run.state[row] + ahead[:, None] * rate
        arguments = time[:, None], state, values_at(run.signals, time), run.parameters
        if run.scene.closures:
            _, gap, speed = system.closure(*arguments)
            bad = ~np.isfinite(speed)
            bad[:, : gap.shape[1]] |= ~np.isfinite(gap)
            if bad.any():
                k = int(bad[bad.any(axis=1).argmax()].argmax())
                return f"closure '{system.multiplier_names[k][0]}' is not a finite number there or just beyond"
        acceleration, _, actuator, passive, *_ = system.observation(*arguments)
        found = {"actuator force": actuator, "passive force": passive, "acceleration": acceleration}
        for what, rows in found.items():
            bad = ~np.isfinite(rows)
            if bad.any():
                first = bad[bad.any(axis=1).argmax()]
                joint = next(j for j in run.robot.joints if first[j.v : j.v + j.nv].any())
                return f"the {what} of joint '{joint.name}' is not a finite number there or just beyond"
    return ""
