"""States of a run between its rows: on both sides of jumps of a force, and by smooth interpolation elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.dynamics.equations.system import system_of
from bellcrank.motion.coordinates import from_rates, rates
from bellcrank.motion.sampled.quintic_splines import smooth_between
from bellcrank.motion.sampled.resampling import before

if TYPE_CHECKING:
    from bellcrank.elements.signals import Signal
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory.trajectory import Trajectory

SMALL_JUMP = 1e-9  # of a signal's largest value: smaller jumps are rounding
MOST_JUMPS = 20_000  # of a run
SUBSTEPS = 4  # of the integration from a row to a jump


def with_jumps(run: Trajectory) -> Trajectory:
    """The run with two more rows for each time at which a force jumps between two rows: just before and just after.

    States must be finite and times increasing.
    """
    jumps = jump_times(run)
    early = before(jumps)
    new = ~np.isin(early, run.time)
    if new.any():
        times = early[new]
        at = np.searchsorted(run.time, times, side="right")
        there = run.time[at] == jumps[new]  # there is a row already; states do not jump
        state = run.state[at]
        if not there.all():
            state[~there] = _reached(run, times[~there])
        run = _with_rows(run, times, state)
    late = jumps[~np.isin(jumps, run.time)]
    return _with_rows(run, late, run.state[np.searchsorted(run.time, late) - 1]) if len(late) else run


def _with_rows(run: Trajectory, times: Array, state: Array) -> Trajectory:
    at = np.searchsorted(run.time, times)
    return replace(run, time=np.insert(run.time, at, times), state=np.insert(run.state, at, state, axis=0))


def jump_times(run: Trajectory) -> Array:
    """Times (s) between the first row and the last at which a signal jumps; at most MOST_JUMPS."""
    times = signal_jumps(run.scene, run.signals)
    inside: Array = times[(times > run.time[0]) & (times < run.time[-1])][:MOST_JUMPS]
    return inside


def signal_jumps(scene: Scene, signals: Sequence[Signal]) -> Array:
    """Times (s), increasing, at which tabulated forces, or motions that controllers follow, jump."""
    found = [np.asarray(scene.stops)]
    for signal in signals:
        if signal.kinked:
            u = signal.at(signal.breaks)
            jump = np.abs(u - signal.at(before(signal.breaks))) > SMALL_JUMP * np.abs(u).max(initial=0.0)
            found.append(signal.breaks[jump.any(axis=1)])
    return np.unique(np.concatenate(found))


def between(run: Trajectory) -> Callable[[Array], Trajectory]:
    """A function that gives the run at other times (m,) s; no jump may lie between a time and the rows beside it."""
    smooth = smooth_between(run.robot.joints, run.time, run.position, run.velocity, run.acceleration)
    nq, nv = run.robot.nq, run.robot.nv
    own = slice(nq + nv, nq + nv + system_of(run.scene).nz)
    auxiliary = None
    if system_of(run.scene).nz:
        auxiliary = _hermite(run.time, run.state[:, own], _rate(run, run.time, run.state)[:, own])

    def at(times: Array) -> Trajectory:
        state = np.zeros((len(times), run.state.shape[1]))
        state[:, :nq], state[:, nq : nq + nv] = smooth(times)
        if auxiliary is not None:
            state[:, own] = auxiliary(times)
        return replace(run, time=times, state=_with_work(run, times, state))

    return at


def _hermite(time: Array, value: Array, rate: Array) -> Callable[[Array], Array]:
    """Values (m, nz) at times (m,) s by cubic polynomials with the values and rates (n, nz) of the rows."""
    rise = np.diff(value, axis=0)

    def at(times: Array) -> Array:
        row = np.clip(np.searchsorted(time, times, side="right") - 1, 0, len(time) - 2)
        step = time[row + 1] - time[row]
        s = ((times - time[row]) / step)[:, None]
        begin, end = step[:, None] * rate[row] - rise[row], step[:, None] * rate[row + 1] - rise[row]
        return np.asarray(value[row] + s * (rise[row] + (1.0 - s) * ((1.0 - s) * begin - s * end)))

    return at


def _with_work(run: Trajectory, times: Array, state: Array) -> Array:
    """States (m, nx) with the work for which the energy balance is that of the rows beside them."""
    if system_of(run.scene).has_work:
        energy = replace(run, time=times, state=state).total_energy
        state[:, -1] = energy - np.interp(times, run.time, run.total_energy - run.work)
    return state


def _reached(run: Trajectory, times: Array) -> Array:
    """States (m, nx) at increasing times between rows.

    They are integrated by Runge-Kutta steps of order 4 from the row before, or from the time before where several lie
    between the same two rows.
    """
    row = np.searchsorted(run.time, times, side="right") - 1
    rank = np.arange(len(times)) - np.searchsorted(row, row)
    state = run.state[row]
    for k in range(int(rank.max()) + 1):
        mine = np.flatnonzero(rank == k)
        begin = run.time[row[mine]] if k == 0 else np.nextafter(times[mine - 1], np.inf)  # after the jump there
        start = run.state[row[mine]] if k == 0 else state[mine - 1]
        state[mine] = _stepped(run, begin, start, times[mine])
    after = run.state[row + 1]
    span = np.abs(after - run.state[row]).max(axis=1) + np.abs(run.velocity[row]).max(axis=1) * (
        run.time[row + 1] - run.time[row]
    )
    lost = ~(np.abs(state - run.state[row]).max(axis=1) <= 10.0 * span)  # stiff: such steps diverge
    share = (times - run.time[row]) / (run.time[row + 1] - run.time[row])
    state[lost] = (run.state[row] + share[:, None] * (after - run.state[row]))[lost]
    return _with_work(run, times, state)


def _stepped(run: Trajectory, begin: Array, state: Array, end: Array) -> Array:
    """States (m, nx) at the times `end` (m,) s, integrated from `state` at the times `begin`."""
    h = (end - begin) / SUBSTEPS
    scale = h[:, None]
    with np.errstate(all="ignore"):
        for k in range(SUBSTEPS):
            t = begin + k * h
            late = end if k == SUBSTEPS - 1 else t + h
            k1 = _rate(run, t, state)
            k2 = _rate(run, t + 0.5 * h, state + 0.5 * scale * k1)
            k3 = _rate(run, t + 0.5 * h, state + 0.5 * scale * k2)
            k4 = _rate(run, late, state + scale * k3)
            state = state + scale / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        q, v = state[:, : run.robot.nq], state[:, run.robot.nq : run.robot.nq + run.robot.nv]
        state = state.copy()
        state[:, : run.robot.nq] = from_rates(run.robot.joints, q, *rates(run.robot.joints, q, v, 0.0 * v))[0]
    return state


def _rate(run: Trajectory, t: Array, state: Array) -> Array:
    """dx/dt (m, nx) by the accelerations of the equations of motion; 0 for the work."""
    there = replace(run, time=t, state=state)
    q, v, a = there.position, there.velocity, there.acceleration
    rate, own = (
        np.zeros_like(state),
        slice(run.robot.nq + run.robot.nv, run.robot.nq + run.robot.nv + system_of(run.scene).nz),
    )
    if system_of(run.scene).nz:
        found = system_of(run.scene).rhs(*there._arguments)
        rate[:, own] = (found[0] if isinstance(found, tuple) else found)[:, own]
    rate[:, : run.robot.nq], rate[:, run.robot.nq : run.robot.nq + run.robot.nv] = (
        rates(run.robot.joints, q, v, a)[0],
        a,
    )
    return rate
