"""Analytic equations of the N four-bar mechanism, a row of parallelograms.

Source of the mechanism: IFToMM library of computational benchmark problems, A02.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class NFourBar:
    """The N four-bar mechanism on its parallel branch, where it has one degree of freedom: all cranks have one angle.

    N + 1 cranks and N couplers are uniform rods of 1 m and 1 kg. The state (..., 2) is the angle θ of the cranks from
    upright, rad, and its rate; g in m/s². θ̈ = (G/I) g sin θ with I = (N + 1)/3 + N and G = (N + 1)/2 + N. Where the
    links lie flat, other branches meet this one.

    Attributes:
        loops: N.
        g: Gravity, m/s².
    """

    loops: int
    g: float = 9.81

    def derivative(self, x: NDArray[Any]) -> NDArray[Any]:
        """Rates (..., 2) of the state, in its own precision."""
        weight, inertia = self._moments(x.dtype)
        return np.stack([x[..., 1], self.g * weight / inertia * np.sin(x[..., 0])], -1)

    def energy(self, x: NDArray[Any]) -> NDArray[Any]:
        """Kinetic and potential energy (zero in the flat position), J, (...)."""
        weight, inertia = self._moments(x.dtype)
        return np.asarray(0.5 * inertia * x[..., 1] ** 2 + self.g * weight * np.cos(x[..., 0]))

    def _moments(self, kind: Any) -> tuple[Any, Any]:
        """First and second moment of mass, kg m and kg m²: cranks rotate, couplers translate with the tops."""
        cranks = np.array(self.loops + 1, kind)
        return cranks / 2 + self.loops, cranks / 3 + self.loops
