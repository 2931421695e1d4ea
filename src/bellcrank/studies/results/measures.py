"""Measures: the numbers that a study reports of each run, by name, with their units, as columns over many runs.

- start.JOINT
- EVENT.time, EVENT.JOINT, EVENT.JOINT.velocity, EVENT.CONSTRAINT.force.ROW (multipliers), and for a latch EVENT.impulse
  and EVENT.energy_lost: at the first event of that name
- end.time, end.JOINT, end.JOINT.velocity, end.CONSTRAINT.force.ROW, end.work, end.OUTPUT
- least.OUTPUT and largest.OUTPUT, over the whole run, also between the ends of steps
- energy_drift, constraint_residual, over the ends of the solver's steps

A joint with several coordinates has one measure for each.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.dynamics.equations.system import system_of
from bellcrank.motion.coordinates import position_labels, velocity_labels
from bellcrank.scene.events import ContactLost, FrictionDemand, LiesFlat, SingularConstraint

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene
    from bellcrank.studies.execution.runs import Runs


class Measure(NamedTuple):
    """A measure of n runs.

    Attributes:
        name: Such as "lock.time".
        unit: SI.
        values: (n,), NaN where a run does not have it.
        present: Which runs have it (n,); None: all.
    """

    name: str
    unit: str
    values: Array
    present: Mask | None = None


def target_events(scene: Scene) -> list[str]:
    """The events that a run is meant to reach: those that end it, unless they say that a constraint no longer holds."""
    losses = (ContactLost, FrictionDemand, LiesFlat, SingularConstraint)
    return [event.name for event in scene.events if event.stop and not isinstance(event.when, losses)]


def default_measures(scene: Scene, names: Iterable[str]) -> tuple[str, ...]:
    """The measures that tables and plots show: of events that end a run, else of all events, else of the end."""
    events = target_events(scene) or [event.name for event in scene.events]
    prefixes = tuple(f"{name}." for name in events) or ("end.",)
    return tuple(
        name for name in names if name.startswith(prefixes) and not name.endswith(".velocity") and ".force." not in name
    )


def start_measures(robot: Robot, position: Array) -> Iterator[Measure]:
    """The positions (n, nq) of the joints at the start, which tell apart the ways in which a linkage can be assembled.

    A design without a start has NaN there.
    """
    present = np.asarray(np.isfinite(position).all(axis=1))
    yield from (measure._replace(present=present) for measure in _positions("start", robot, position))


def run_measures(runs: Runs) -> Iterator[Measure]:
    """The measures of runs, without those of their starts."""
    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        for name in dict.fromkeys(event.name for event in runs.scene.events):
            yield from _event_measures(runs, name)
        yield from _end_measures(runs)
        yield Measure("energy_drift", "1", _energy_drift(runs))
        yield Measure("constraint_residual", "m or rad", _constraint_residual(runs))


# ---- parts of a run


def _event_measures(runs: Runs, name: str) -> Iterator[Measure]:
    """The measures at the first event of a name; several conditions may have one name."""
    found, robot, system = runs.result, runs.scene.robot, system_of(runs.scene)
    places = [k for k, event in enumerate(runs.scene.events) if event.name == name]
    times = found.event_time[:, places]
    which = np.argmin(np.where(np.isnan(times), np.inf, times), axis=1)
    rows, numbers = np.arange(len(runs)), np.array(places)[which]
    time, state = found.event_time[rows, numbers], found.event_state[rows, numbers]
    present = np.isfinite(time)
    measures = [
        Measure(f"{name}.time", "s", time),
        *_positions(name, robot, state[:, : system.nq]),
        *_velocities(name, robot, state[:, system.nq : system.nq + system.nv]),
    ]
    held = found.held_event[rows, numbers]
    here = runs.at(present, time, state, held)
    if runs.scene.constraints:
        measures += _forces(name, system.multiplier_names, here.evaluated(system.constraint)[0])
    for k in places:
        if runs.scene.events[k].latch:
            own = present & (numbers == k)
            _, _, impulse, lost = runs.at(own, time, state, held).evaluated(system.latch(k))
            yield from (measure._replace(present=present) for measure in measures)
            yield Measure(f"{name}.impulse", runs.scene.events[k].impulse_unit, impulse[:, 0], own)
            yield Measure(f"{name}.energy_lost", "J", lost[:, 0], own)
            return
    yield from (measure._replace(present=present) for measure in measures)


def _end_measures(runs: Runs) -> Iterator[Measure]:
    found, robot, system = runs.result, runs.scene.robot, system_of(runs.scene)
    state, layout = found.end_state, system.observed_layout
    yield Measure("end.time", "s", found.end_time)
    yield from _positions("end", robot, state[:, : system.nq])
    yield from _velocities("end", robot, state[:, system.nq : system.nq + system.nv])
    end = runs.at(None, found.end_time, state, found.held_end)
    if runs.scene.constraints:
        yield from _forces("end", system.multiplier_names, end.evaluated(system.constraint)[0])
    if system.has_work:
        yield Measure("end.work", "J", state[:, -1])
    if not layout.outputs:
        return
    columns = iter(range(layout.outputs))
    values = end.evaluated(system.observe)[0]
    for name, output in runs.scene.outputs.items():
        for label, k in zip(output.quantity.suffixes(), columns, strict=False):
            yield Measure(*_named(f"end.{name}", label), values[:, k])
            yield Measure(*_named(f"least.{name}", label), found.least[:, k])
            yield Measure(*_named(f"largest.{name}", label), found.largest[:, k])


def _energy_drift(runs: Runs) -> Array:
    """`Trajectory.energy_drift` from the extremes of sums of energies (dynamics/equations/observed_quantities.py)."""
    system, found = system_of(runs.scene), runs.result
    energies = system.observed_layout.energies
    start = runs.at(None, np.zeros(len(runs)), runs.start, found.held_start)
    begun = start.evaluated(system.observe)[0][:, energies]
    balance, potential = begun[:, 0], 0.5 * (begun[:, 1] - begun[:, 2])
    least, largest = found.least[:, energies], found.largest[:, energies]
    gap = np.maximum(largest[:, 0] - balance, balance - least[:, 0])
    scale = np.maximum(largest[:, 1] - potential, largest[:, 2] + potential)
    good = np.isfinite(gap) & np.isfinite(scale) & (scale > 0.0)
    return np.where(gap == 0.0, 0.0, np.where(good, gap / np.where(good, scale, 1.0), np.inf))


def _constraint_residual(runs: Runs) -> Array:
    """`Trajectory.constraint_residual` from the extremes of the residuals; infinite where one is not finite."""
    places, found = system_of(runs.scene).observed_layout.residuals, runs.result
    most = np.maximum(found.largest[:, places], -found.least[:, places]).max(axis=1, initial=0.0)
    return np.where(np.isfinite(most), most, np.inf)


# ---- names


def _positions(prefix: str, robot: Robot, position: Array) -> Iterator[Measure]:
    for joint in robot.joints:
        columns = position[:, joint.q : joint.q + joint.nq].T
        for (label, unit), values in zip(position_labels([joint]), columns, strict=True):
            what = label.removeprefix(f"{joint.name} position").strip()
            yield Measure(".".join(part for part in (prefix, joint.name, what) if part), unit, values)


def _velocities(prefix: str, robot: Robot, velocity: Array) -> Iterator[Measure]:
    for joint in robot.joints:
        columns = velocity[:, joint.v : joint.v + joint.nv].T
        for (label, unit), values in zip(velocity_labels([joint]), columns, strict=True):
            what = label.removeprefix(f"{joint.name} velocity").strip()
            yield Measure(".".join(part for part in (prefix, joint.name, what, "velocity") if part), unit, values)


def _forces(prefix: str, names: Sequence[tuple[str, str]], multipliers: Array) -> Iterator[Measure]:
    for (constraint, label), values in zip(names, multipliers.T, strict=True):
        yield Measure(*_named(f"{prefix}.{constraint}.force", label), values)


def _named(prefix: str, label: str) -> tuple[str, str]:
    """Name and unit of "x [m]", or of "[N m]"."""
    title, _, unit = label.removesuffix("]").rpartition("[")
    return ".".join(part for part in (prefix, title.strip().replace(" ", "_")) if part), unit
