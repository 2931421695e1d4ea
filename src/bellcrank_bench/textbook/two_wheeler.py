"""Steady turn of a cart on two wheels, in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class SteadyTurn:
    """A cart on two wheels of one axle in a steady turn: speed in m/s, rate in rad/s, height of the axle in m.

    The state (..., 3) is (x, y, heading). The centre of mass lies below the middle of the axle, so no force yaws or
    pitches the cart, and the kinematics of the wheels are the whole motion.
    """

    speed: float = 1.1
    rate: float = 0.5
    height: float = 0.1

    def derivative(self, x: NDArray[Any]) -> NDArray[Any]:
        """Rates (..., 3), in the state's own precision."""
        turn = np.full_like(x[..., 2], self.rate)
        return np.stack([self.speed * np.cos(x[..., 2]), self.speed * np.sin(x[..., 2]), turn], -1)

    def place(self, x: NDArray[Any]) -> NDArray[Any]:
        """Position (..., 3) of the middle of the axle from (x, y, ...)."""
        return np.stack([x[..., 0], x[..., 1], np.full_like(x[..., 0], self.height)], -1)
