"""Checks of a run against a known answer, which a problem's `judge` returns, and those that several problems use."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.simulation.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Check:
    """A number computed from a run, in `unit`, and its limit: an upper one, or a lower one with `at_least`."""

    name: str
    value: float
    limit: float
    unit: str = ""
    at_least: bool = False

    @property
    def passed(self) -> bool:
        """Whether the number respects its limit; a number that is not finite never does."""
        return bool(
            np.isfinite(self.value) and (self.value >= self.limit if self.at_least else self.value <= self.limit)
        )


def largest(difference: Any) -> float:
    """The largest absolute entry of an array; infinite if an entry is not finite."""
    found = float(np.abs(np.asarray(difference, dtype=float)).max(initial=0.0))
    return found if np.isfinite(found) else float("inf")


def finished(run: Trajectory) -> Check:
    """Whether the run reached its end: 0 if it did, 1 if not."""
    return Check(f"ended early ({run.status})", float(not run.success), 0.0)


def constraints_satisfied(run: Trajectory) -> list[Check]:
    """The residuals of the constraints at every row of the run."""
    return [
        Check("position residual", run.constraint_residual(), 1e-12, "m or rad"),
        Check("velocity residual", run.velocity_residual(), 1e-12, "m/s or rad/s"),
    ]


def turning_points(*joints: str) -> list[dict[str, Any]]:
    """Scene events at which a joint's velocity is zero, so that extremes are as exact as the run itself."""
    return [{"name": f"{name} turns", "when": {"joint": name, "velocity": 0}} for name in joints]


def extremes(run: Trajectory) -> tuple[Array, Array]:
    """Least and greatest positions, (nq,) each, over the start, the events and the end."""
    rows = np.array([run.position[0], *(event.position for event in run.events), run.position[-1]])
    return rows.min(0), rows.max(0)
