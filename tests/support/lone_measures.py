"""Measures, status and reason of a single run from its `Trajectory`: what the rows of studies must agree with.

- start.JOINT
- EVENT.time, EVENT.JOINT, EVENT.JOINT.velocity, EVENT.CONSTRAINT.force.ROW (multipliers), and for a latch EVENT.impulse
  and EVENT.energy_lost: at the first event of that name
- end.time, end.JOINT, end.JOINT.velocity, end.CONSTRAINT.force.ROW, end.OUTPUT
- least.OUTPUT and largest.OUTPUT, over the rows of the run
- energy_drift, constraint_residual

A joint with several coordinates has one measure for each.
"""

import math

import numpy as np

from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.motion.coordinates import position_labels, velocity_labels
from bellcrank.simulation.integration.statistics import Status
from bellcrank.studies.results.measures import target_events


def start_measures(scene):
    """The positions of the joints at the start, which tell apart the ways in which a linkage can be assembled."""
    yield from _positions("start", scene.robot, consistent_start(scene)[0])


def run_measures(run):
    """The measures of a run, without those of its start."""
    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        for name in dict.fromkeys(event.name for event in run.scene.events):
            first = next((event for event in run.events if event.name == name), None)
            if first is not None:
                yield f"{name}.time", "s", first.time
                yield from _positions(name, run.robot, first.position)
                yield from _velocities(name, run.robot, first.velocity)
                yield from _forces(name, run, first.multipliers)
                if first.latch is not None:
                    yield f"{name}.impulse", first.latch.unit, first.latch.impulse
                    yield f"{name}.energy_lost", "J", first.latch.energy_lost
        yield "end.time", "s", float(run.time[-1])
        yield from _positions("end", run.robot, run.position[-1])
        yield from _velocities("end", run.robot, run.velocity[-1])
        yield from _forces("end", run, run.multipliers[-1])
        for name, output in run.scene.outputs.items():
            rows = run.output(name).reshape(len(run), -1)
            for label, column in zip(output.quantity.suffixes(), rows.T, strict=True):
                yield *_named(f"end.{name}", label), float(column[-1])
                yield *_named(f"least.{name}", label), float(column.min())
                yield *_named(f"largest.{name}", label), float(column.max())
        yield "energy_drift", "1", run.energy_drift()
        yield "constraint_residual", "m or rad", run.constraint_residual()


def _positions(prefix, robot, position):
    for joint in robot.joints:
        values = position[joint.q : joint.q + joint.nq].tolist()
        for (label, unit), value in zip(position_labels([joint]), values, strict=True):
            what = label.removeprefix(f"{joint.name} position").strip()
            yield ".".join(part for part in (prefix, joint.name, what) if part), unit, value


def _velocities(prefix, robot, velocity):
    for joint in robot.joints:
        values = velocity[joint.v : joint.v + joint.nv].tolist()
        for (label, unit), value in zip(velocity_labels([joint]), values, strict=True):
            what = label.removeprefix(f"{joint.name} velocity").strip()
            yield ".".join(part for part in (prefix, joint.name, what, "velocity") if part), unit, value


def measure_name(prefix, label):
    """The name of the measure of a column with this label."""
    return _named(prefix, label)[0]


def _named(prefix, label):
    """Name and unit of "x [m]", or of "[N m]"."""
    title, _, unit = label.removesuffix("]").rpartition("[")
    return ".".join(part for part in (prefix, title.strip().replace(" ", "_")) if part), unit


def _forces(prefix, run, multipliers):
    for (constraint, label), value in zip(run.multiplier_names, multipliers.tolist(), strict=True):
        yield *_named(f"{prefix}.{constraint}.force", label), value


def reason(run):
    """Why a run did not reach its target; empty where it did."""
    wanted = target_events(run.scene)
    if run.status is Status.FINISHED and wanted:
        return f"no event {' nor '.join(map(repr, wanted))} within {run.settings.duration:g} s"
    if run.status is Status.EVENT:
        end = next(event.name for event in run.events if event.stopped)
        return "" if end in wanted else f"event '{end}' ended the run at {run.time[-1]:.6g} s"
    return "" if run.success else run.reason


def unknown_measures(run, measures):
    """Which measures of a run are not finite numbers, and which target events could not be looked for, as a clause."""
    bad = [f"'{name}'" for name, value in measures.items() if not math.isfinite(value)]
    wanted = target_events(run.scene)
    bad += [
        f"the function of event '{it.event}'" for it in run.statistics.unresolved if it.undefined and it.event in wanted
    ]
    return f"{bad[0]}{f' and {len(bad) - 1} more' if len(bad) > 1 else ''} not a finite number" if bad else ""
