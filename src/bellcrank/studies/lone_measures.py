"""The measures of a single run, by name, with their units (measures.py), from its `Trajectory`.

- start.JOINT
- EVENT.time, EVENT.JOINT, EVENT.JOINT.velocity, EVENT.CONSTRAINT.force.ROW (multipliers), and for a latch EVENT.impulse
  and EVENT.energy_lost: at the first event of that name
- end.time, end.JOINT, end.JOINT.velocity, end.CONSTRAINT.force.ROW, end.OUTPUT
- least.OUTPUT and largest.OUTPUT, over the rows of the run
- energy_drift, constraint_residual

A joint with several coordinates has one measure for each.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.dynamics.consistent_start import consistent_start
from bellcrank.motion.coordinates import position_labels, velocity_labels

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory import Array, Trajectory

Measure = tuple[str, str, float]  # name, unit, value


def start_measures(scene: Scene) -> Iterator[Measure]:
    """The positions of the joints at the start, which tell apart the ways in which a linkage can be assembled."""
    yield from _positions("start", scene.robot, consistent_start(scene)[0])


def run_measures(run: Trajectory) -> Iterator[Measure]:
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


def _positions(prefix: str, robot: Robot, position: Array) -> Iterator[Measure]:
    for joint in robot.joints:
        values = position[joint.q : joint.q + joint.nq].tolist()
        for (label, unit), value in zip(position_labels([joint]), values, strict=True):
            what = label.removeprefix(f"{joint.name} position").strip()
            yield ".".join(part for part in (prefix, joint.name, what) if part), unit, value


def _velocities(prefix: str, robot: Robot, velocity: Array) -> Iterator[Measure]:
    for joint in robot.joints:
        values = velocity[joint.v : joint.v + joint.nv].tolist()
        for (label, unit), value in zip(velocity_labels([joint]), values, strict=True):
            what = label.removeprefix(f"{joint.name} velocity").strip()
            yield ".".join(part for part in (prefix, joint.name, what, "velocity") if part), unit, value


def _named(prefix: str, label: str) -> tuple[str, str]:
    """Name and unit of "x [m]", or of "[N m]"."""
    title, _, unit = label.removesuffix("]").rpartition("[")
    return ".".join(part for part in (prefix, title.strip().replace(" ", "_")) if part), unit


def _forces(prefix: str, run: Trajectory, multipliers: Array) -> Iterator[Measure]:
    for (constraint, label), value in zip(run.multiplier_names, multipliers.tolist(), strict=True):
        yield *_named(f"{prefix}.{constraint}.force", label), value
