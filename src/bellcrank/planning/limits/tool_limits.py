"""The limits of a frame's speed and acceleration along a path.

With the frame's Jacobian J the velocity of its origin along a path is J q' y, and its acceleration

    A u + B y²,    A = J q',    B = J q'' + J̇(q, q') q',

so that a limit of the speed bounds the path speed y, and a limit of the acceleration is a second-order cone in u and
y² (D. Verscheure et al., IEEE Trans. Automatic Control 54, 2009, write both so). B consists of a part `bend` A along A
and of one across it of the length `across`: y² is at most limit / across. The same holds for the frame's rotation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bellcrank.arrays import Array
from bellcrank.planning.limits.motion_limits import MotionLimits
from bellcrank.robot.robot import Robot

NEGLIGIBLE = 1e-12  # of the largest |A|: smaller ones are rounding


@dataclass(frozen=True, eq=False)
class NormCoefficients:
    """The coefficients (n, m) of m norms at n places, and their limits (m,)."""

    along: Array
    bend: Array
    across: Array
    limit: Array

    def fastest(self) -> Array:
        """The largest path speeds (n, m)."""
        with np.errstate(divide="ignore"):
            return np.asarray(np.sqrt(self.limit / self.across))


@dataclass(frozen=True)
class ToolLimits:
    """The limits of a frame of a robot; `factors` on them, by their place in `names`."""

    robot: Robot
    limits: MotionLimits

    @property
    def speeds(self) -> list[tuple[str, int, float]]:
        """What is limited, which part of the frame's velocity that is (0 linear, 1 angular), and the limit."""
        return self._given("tool_speed", "tool_angular_speed", "speed")

    @property
    def accelerations(self) -> list[tuple[str, int, float]]:
        """As `speeds`."""
        return self._given("tool_acceleration", "tool_angular_acceleration", "acceleration")

    def _given(self, linear: str, angular: str, what: str) -> list[tuple[str, int, float]]:
        pairs = ((what, 0, getattr(self.limits, linear)), (f"angular {what}", 1, getattr(self.limits, angular)))
        return [(name, part, value) for name, part, value in pairs if value is not None]

    def speed_rates(self, q: Array, first: Array) -> list[tuple[str, Array, float]]:
        """What is limited, |J q'| (n,), and the limit."""
        if not self.speeds:
            return []
        velocity = self.robot.frame_velocity(self.limits.tool, q, first)
        return [(name, np.linalg.norm(velocity[part], axis=1), limit) for name, part, limit in self.speeds]

    def norms(self, q: Array, first: Array, second: Array, slope: Array) -> NormCoefficients:
        """The coefficients of accelerations at positions q with q' = `first` and q'' = `second` (n, nv); A is that of
        `slope`.
        """
        n, given = len(q), self.accelerations
        if not given:
            return NormCoefficients(np.zeros((n, 0)), np.zeros((n, 0)), np.zeros((n, 0)), np.zeros(0))
        rates = self.robot.frame_velocity(self.limits.tool, q, slope)
        growths = self.robot.frame_acceleration(self.limits.tool, q, first, second)
        parts = []
        for _, part, _ in given:
            a, b = rates[part], growths[part]
            along = np.linalg.norm(a, axis=1)
            along = np.where(along <= NEGLIGIBLE * along.max(initial=0.0), 0.0, along)
            direction = a / np.where(along > 0.0, along, np.inf)[:, None]
            lengthwise = np.sum(b * direction, axis=1)
            across = np.linalg.norm(b - lengthwise[:, None] * direction, axis=1)
            parts.append((along, lengthwise / np.where(along > 0.0, along, np.inf), across))
        along, bend, across = (np.ascontiguousarray(np.stack(columns, axis=1)) for columns in zip(*parts, strict=True))
        return NormCoefficients(along, bend, across, np.array([limit for _, _, limit in given]))
