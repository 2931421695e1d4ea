"""What is told where two routes to the same quantity are compared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
TOLERANCE = 1e-11  # relative to the largest entry: some 100 roundings of the two routes
DRIFT_APART = 1e-9  # of two integrations at rtol = 1e-12 and 1e-13: the motion spreads what their steps leave


@dataclass(frozen=True)
class Difference:
    """How far one quantity of two routes lies apart, as a share of its largest entry, over how many states."""

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
    """The difference of two arrays; infinite where one is no number or has another shape."""
    if ours.shape != theirs.shape:
        return Difference(quantity, states, len(ours), float("inf"), tolerance)
    gap, scale = np.abs(ours - theirs).max(), np.abs(theirs).max()
    return Difference(quantity, states, len(ours), float(gap / scale) if np.isfinite(gap) else float("inf"), tolerance)
