"""Signals u(t): piecewise polynomials that the stepper evaluates beside the compiled equations.

A tabulated torque is one; so is the motion that a controller follows, with its first and second derivatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Signal:
    """Columns that are polynomials between breaks.

    breaks (m+1,) in s, increasing; coefficients (m, degree+1, width), ascending powers of t − breaks[i]; `derivatives`
    0, 1 or 2: how many derivatives follow the values in u. Beyond its ends a signal keeps its end value and its
    derivatives are 0. `kinked`: value or slope jumps at breaks, so that no step may cross one.
    """

    breaks: Array
    coefficients: Array
    derivatives: int
    kinked: bool

    @property
    def size(self) -> int:
        """How many entries of u it supplies."""
        return int(self.coefficients.shape[2]) * (self.derivatives + 1)

    def at(self, t: Array) -> Array:
        """Values, then first, then second derivatives, (n, size), at times (n,); at a kink the limit from after."""
        inside = np.clip(t, self.breaks[0], self.breaks[-1])
        k = np.clip(np.searchsorted(self.breaks, inside, side="right") - 1, 0, len(self.breaks) - 2)
        s = (inside - self.breaks[k])[:, None]
        held = ((t < self.breaks[0]) | (t > self.breaks[-1]))[:, None]
        powers = self.coefficients[k]
        blocks = []
        for order in range(self.derivatives + 1):
            value = np.zeros((len(t), powers.shape[2]))
            for degree in range(powers.shape[1] - 1, -1, -1):
                value = value * s + powers[:, degree]
            blocks.append(np.where(held, 0.0, value) if order else value)
            powers = powers[:, 1:] * np.arange(1, powers.shape[1])[None, :, None]
        return np.concatenate(blocks, axis=1)


def values_at(signals: Sequence[Signal], t: Array) -> Array:
    """All signals (n, nu) at times (n,)."""
    return np.concatenate([np.zeros((len(t), 0)), *[s.at(t) for s in signals]], axis=1)
