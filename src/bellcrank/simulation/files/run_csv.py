"""CSV files of a run and of its sensitivities: one row a time, and a header that names each column and its unit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arguments import Progress
from bellcrank.arrays import Array
from bellcrank.elements.joint_forces import Torque
from bellcrank.files.atomic_write import writing
from bellcrank.files.csv_files import write_table
from bellcrank.motion.coordinates import position_labels, velocity_labels

if TYPE_CHECKING:
    from bellcrank.simulation.sensitivities.sensitivities import RunSensitivity
    from bellcrank.simulation.trajectory.trajectory import Trajectory


def write_run_csv(run: Trajectory, path: str | Path, progress: Progress | None = None) -> Path:
    """Write time, positions, velocities, accelerations, torques, energies, work, constraints and outputs as CSV.

    `torque` is that of all forces of the scene at a joint; `actuator torque` is the part of actuators and controllers,
    where the scene has them. Units stand in the header (s, rad, m, N m, N, J, …). Numbers are read back exactly; those
    that are not finite are `nan`, `inf` or `-inf`. `progress` is called with the numbers of rows written and of all.
    Returns the path of the file, which is written atomically. Raises InputError where it cannot be written.
    """

    def blocks() -> Iterator[Array]:
        done = 0
        for part in run.parts():
            yield columns(part)[1]
            done += len(part)
            if progress is not None:
                progress(done, len(run))

    return write_table(path, columns(run.part(slice(0, 1)))[0], blocks())


def columns(run: Trajectory) -> tuple[list[tuple[str, str]], Array]:
    """(name, unit) of every column of a run, and the table (n, columns)."""
    joints = run.robot.joints
    driven = [joint for joint in joints if joint.nv == 1]
    labels = [("time", "s"), *position_labels(joints), *velocity_labels(joints, 1), *velocity_labels(joints, 2)]
    labels += [(f"{joint.name} torque", torque_unit(joint.kind)) for joint in driven]
    if run.scene.control or any(isinstance(force, Torque) for force in run.scene.forces):
        labels += [(f"{joint.name} actuator torque", torque_unit(joint.kind)) for joint in driven]
        actuators = [run.actuator_torque[:, [joint.v for joint in driven]]]
    else:
        actuators = []
    labels += [("kinetic energy", "J"), ("potential energy", "J"), ("work", "J")]
    parts = [run.time, run.position, run.velocity, run.acceleration, run.torque[:, [joint.v for joint in driven]]]
    parts += [*actuators, run.kinetic_energy, run.potential_energy, run.work]
    for constraint in run.scene.constraints:
        history = run.constraint(constraint.name)
        labels += [titled(f"{constraint.name} {label}") for label in history.labels]
        labels.append((f"{constraint.name} residual", "m or rad"))
        parts += [history.multipliers, history.residual]
    for name, values in run.outputs.items():
        taken = {title for title, _ in labels}
        own = output_labels(run, name)
        labels += [(f"{name}: {title}" if title in taken else title, unit) for title, unit in own]
        parts.append(values)
    return labels, np.column_stack(parts)


def output_labels(run: Trajectory, name: str) -> list[tuple[str, str]]:
    """(name, unit) of each column of a named output."""
    return [titled(label) for label in run.scene.outputs[name].labels]


def titled(label: str) -> tuple[str, str]:
    """Title and unit of a label such as "apex x [N]"."""
    title, _, unit = label.removesuffix("]").rpartition(" [")
    return title, unit


def torque_unit(kind: str) -> str:
    """The unit of the torque or force of a joint of this kind."""
    return "N" if kind == "prismatic" else "N m"


def write_sensitivities_csv(sensitivities: Sequence[RunSensitivity], path: str | Path) -> Path:
    """Write `derivative_columns`, atomically; returns the path. Raises InputError where it cannot be written."""
    labels, rows = derivative_columns(sensitivities)
    return write_table(path, labels, iter([rows]))


def derivative_columns(sensitivities: Sequence[RunSensitivity]) -> tuple[list[tuple[str, str]], Array]:
    """Time and the derivatives of positions, velocities and outputs by each variable.

    (name, unit) of every column, such as ("d(crank position)/d(crank_length)", "rad per m"), and the table
    (n, columns).
    """
    labels, columns = [("time", "s")], [sensitivities[0].time[:, None]]
    for one in sensitivities:
        run = one.run
        quantities = [*position_labels(run.robot.joints), *velocity_labels(run.robot.joints)]
        for name in run.outputs:
            quantities += output_labels(run, name)
        labels += [(f"d({quantity})/d({one.name})", one.per(unit)) for quantity, unit in quantities]
        columns += [one.state, *(x.reshape(len(one.time), -1) for x in one.outputs.values())]
    return labels, np.column_stack(columns)


def write_npz(sensitivities: Sequence[RunSensitivity], path: str | Path) -> Path:
    """Write arrays to an .npz file; returns its path.

    They are `time` (n,) s, `names` and `units` (k,) of the variables, `position` (k, n, nq), `velocity` (k, n, nv), and
    `event_names`, `event_times` (e,) s and `event_time_derivatives` (k, e) in s per unit, infinite for an event that
    touches zero without crossing it. Raises InputError where the file cannot be written.
    """
    target = Path(path)
    events = sensitivities[0].run.events
    arrays = {
        "time": sensitivities[0].time,
        "names": np.array([one.name for one in sensitivities]),
        "units": np.array([one.unit for one in sensitivities]),
        "position": np.stack([one.position for one in sensitivities]),
        "velocity": np.stack([one.velocity for one in sensitivities]),
        "event_names": np.array([event.name for event in events], dtype=str),
        "event_times": np.array([event.time for event in events]),
        "event_time_derivatives": np.array([one.event_times for one in sensitivities]),
    }
    with writing(target) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]
    return target
