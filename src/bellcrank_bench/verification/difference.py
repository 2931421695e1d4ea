"""The difference of a quantity that is computed in two ways."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.simulation.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]
TOLERANCE = 1e-11  # relative to the largest entry: rounding errors of both computations
INTEGRATION_TOLERANCE = 1e-9  # of two integrations at rtol = 1e-12 and 1e-13, whose errors the motion amplifies


@dataclass(frozen=True)
class Difference:
    """The largest difference of a quantity over a number of states, relative to its largest entry.

    Attributes:
        quantity: What is compared.
        states: At which states: random ones, those of a run, its end.
        samples: Number of states.
        relative: Largest difference divided by the largest entry.
        tolerance: Limit of that.
    """

    quantity: str
    states: str
    samples: int
    relative: float
    tolerance: float = TOLERANCE

    @property
    def agrees(self) -> bool:
        """Whether the difference is within the tolerance."""
        return self.relative <= self.tolerance


def difference(quantity: str, states: str, ours: Array, theirs: Any, tolerance: float = TOLERANCE) -> Difference:
    """The difference of two arrays; infinite if one is not finite or their shapes differ."""
    if ours.shape != theirs.shape:
        return Difference(quantity, states, len(ours), float("inf"), tolerance)
    largest, scale = np.abs(ours - theirs).max(), np.abs(theirs).max()
    relative = float(largest / scale) if np.isfinite(largest) else float("inf")
    return Difference(quantity, states, len(ours), relative, tolerance)


def run_differences(run: Trajectory, position: Array, velocity: Array) -> list[Difference]:
    """The differences of a run's positions (n, nq) and velocities (n, nv) from given ones: all rows, and the last."""
    found = []
    for states, rows in (("run, SciPy's DOP853", slice(None)), ("its end", slice(-1, None))):
        for quantity, ours, theirs in (("positions", run.position, position), ("velocities", run.velocity, velocity)):
            found.append(difference(quantity, states, ours[rows], theirs[rows], INTEGRATION_TOLERANCE))
    return found
