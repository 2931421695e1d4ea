"""When dry friction kept joints at rest in a run, and whether the forces that did so are unique."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.elements.dry_friction import DryFriction
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.notes import Note

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory import Trajectory

Array = NDArray[np.float64]
SHOWN = 4  # intervals of a joint in a summary


def stuck_intervals(run: Trajectory, joint: str) -> Array:
    """Beginnings and ends (n, 2), s, of the intervals in which a joint was stuck. Raises InputError."""
    parts = {part.joint.name: part for part in run.scene.dry_friction}
    if joint not in parts:
        raise InputError(f"{run.scene.name}: {unknown_name('joint with dry friction', joint, parts)}")
    time, modes = _modes(run, parts[joint])
    rest = np.concatenate([[False], modes[:, 1] == 0.0, [False]])
    edges = np.flatnonzero(rest[1:] != rest[:-1]).reshape(-1, 2)
    found = np.clip(time[edges], run.time[0], run.time[-1])
    return found[found[:, 1] > found[:, 0]]


def rest_rows(run: Trajectory) -> Iterator[tuple[str, str]]:
    """(name, value) of a summary: how long each joint with dry friction was stuck."""
    for k, part in enumerate(run.scene.dry_friction):
        found, end = stuck_intervals(run, part.joint.name), float(run.time[-1])
        listed = [f"from {a:.6g} s to {'the end' if b == end else f'{b:.6g} s'}" for a, b in found[:SHOWN].tolist()]
        more = f", … ({len(found)} times)" if len(found) > SHOWN else ""
        total = float(np.sum(found[:, 1] - found[:, 0]))
        text = f"for {total:.6g} s: {', '.join(listed)}{more}" if len(found) else "never"
        yield ("stuck" if k == 0 else "", f"{part.joint.name} {text}")


def shared_rest(run: Trajectory) -> tuple[Note, ...]:
    """A note where joints of closed linkages hold each other, so that their forces are not unique."""
    names = []
    for part in run.scene.dry_friction:
        _, modes = _modes(run, part)
        if ((modes[:, 1] == 0.0) & (modes[:, 2] == 0.0)).any():
            names.append(part.joint.name)
    if not names:
        return ()
    return (
        Note(
            "dry friction of several joints holds the same linkage, so that the forces of friction at rest, and those "
            f"of its constraints, are not unique; the motion is (joints {', '.join(names)} give way to others)"
        ),
    )


def _modes(run: Trajectory, part: DryFriction) -> tuple[Array, Array]:
    """The times (n + 1,), s, between which the mode of a joint (n, 3) lasts (`DryFriction.mode`)."""
    signal = run.signals[run.scene.signal_sources.index(part.mode)]
    time = signal.breaks.copy()
    time[-1] = np.inf
    return time, signal.coefficients[:, 0, :]
