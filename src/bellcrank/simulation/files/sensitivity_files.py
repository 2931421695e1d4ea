"""Sensitivities of a run as CSV and .npz files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.files.atomic_write import writing
from bellcrank.files.csv_files import write_table
from bellcrank.motion.coordinates import position_labels, velocity_labels
from bellcrank.simulation.files.run_csv import output_labels

if TYPE_CHECKING:
    from bellcrank.simulation.sensitivities.sensitivities import RunSensitivity


def write_csv(sensitivities: Sequence[RunSensitivity], path: str | Path) -> Path:
    """Write time and the derivatives of positions, velocities and outputs by each variable; returns the path.

    The header names columns and units, such as "d(crank position)/d(crank_length) [rad per m]". The file is written
    atomically. Raises InputError where it cannot be written.
    """
    labels, columns = [("time", "s")], [sensitivities[0].time[:, None]]
    for one in sensitivities:
        run = one.run
        quantities = [*position_labels(run.robot.joints), *velocity_labels(run.robot.joints)]
        for name in run.outputs:
            quantities += output_labels(run, name)
        labels += [(f"d({quantity})/d({one.name})", one.per(unit)) for quantity, unit in quantities]
        columns += [one.state, *(x.reshape(len(one.time), -1) for x in one.outputs.values())]
    return write_table(path, labels, iter([np.column_stack(columns)]))


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
