"""Analytic equations of the simple pendulum."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank_bench.textbook.integrate import Array


@dataclass(frozen=True)
class SimplePendulum:
    """A point mass on a massless rod: q = (θ,), the angle from hanging in rad; length in m, mass in kg, g in m/s²."""

    length: float = 1.0
    mass: float = 1.0
    g: float = 9.81

    def derivative(self, x: NDArray[Any]) -> NDArray[Any]:
        """Rates (..., 2) of the state x = (θ, θ̇), (..., 2), in x's own precision."""
        return np.stack([x[..., 1], -self.g / self.length * np.sin(x[..., 0])], -1)

    def energy(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Kinetic and potential energy (zero in the lowest position), (...) each, J, from θ and θ̇, (..., 1)."""
        kinetic = 0.5 * self.mass * (self.length * v[..., 0]) ** 2
        return kinetic, self.mass * self.g * self.length * (1 - np.cos(q[..., 0]))
