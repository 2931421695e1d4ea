"""The region of torque and speed that a motor may reach for a short time: its use, and its outline for pictures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.electrical import electrical_torque, friction_torque
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.product_arrays import MotorArrays
from bellcrank.actuators.short_time_limits import SpeedTorqueLimit, peak_curve_use, peak_curves, short_time_limits
from bellcrank.arrays import Array

PEAK = "the peak torque or current"
SPEEDS = 401  # of an outline, in each direction


@dataclass(frozen=True, eq=False)
class ShortTimeRegion:
    """Peak torque and current, voltage, largest speed and printed curve of one motor, as far as they are known.

    Attributes:
        motor: The motor.
        conditions: The supply.
    """

    motor: Motor
    conditions: Conditions

    @cached_property
    def _motors(self) -> MotorArrays:
        return MotorArrays.of([self.motor])

    @cached_property
    def _limits(self) -> dict[str, list[SpeedTorqueLimit]]:
        """The known straight limits, by name; those on the electrical torque need the motor's friction too. Those of a
        motor that is given by ratings are part of its curve.
        """
        found: dict[str, list[SpeedTorqueLimit]] = {}
        if self.motor.by_ratings:
            return found
        for limit in short_time_limits(self._motors, self.conditions):
            friction = 0.0 if limit.basis == "shaft" else self._motors.coulomb_torque[0]
            if not np.isnan(limit.torque[0] + limit.speed[0] + friction):
                found.setdefault(limit.name, []).append(limit)
        return found

    @cached_property
    def _curve_known(self) -> bool:
        return bool(np.isfinite(peak_curves(self._motors, self.conditions).y[0, 0]))

    @property
    def known(self) -> bool:
        """Whether one limit or more are known."""
        return self._curve_known or bool(self._limits)

    @property
    def unknown(self) -> tuple[str, ...]:
        """The limits that are unknown; none where the maker prints a curve. That of the speed counts apart."""
        if self._curve_known:
            return ()
        if self.motor.by_ratings:
            return ("the torque-speed curve",)
        torque = "peak torque" in self._limits or "peak current" in self._limits
        voltage = "voltage limit" in self._limits
        return (() if torque else (PEAK,)) + (() if voltage else ("the voltage limit",))

    def use(self, torque: Array, speed: Array) -> Array:
        """The largest share (n,) of the known limits at shaft torques N m and speeds rad/s; NaN where none is known."""
        uses = self.uses(torque, speed)
        return np.asarray(uses.max(axis=0)) if len(uses) else np.full(uses.shape[1:], np.nan)

    def uses(self, torque: Array, speed: Array) -> Array:
        """The share (m, n) of each of m known limits at shaft torques N m and speeds rad/s."""
        if self.motor.by_ratings and self._curve_known:
            return peak_curve_use(self._motors, self.conditions, torque, speed)[None]
        current_torque = electrical_torque(self._motors, torque, speed)
        uses = [
            limit.use(current_torque if limit.basis == "electrical" else torque, speed)
            for limits in self._limits.values()
            for limit in limits
        ]
        if self._curve_known:
            uses.append(peak_curve_use(self._motors, self.conditions, torque, speed))
        shape = np.broadcast_shapes(torque.shape, speed.shape)
        return np.stack([np.broadcast_to(use, shape) for use in uses]) if uses else np.zeros((0, *shape))

    def highest_torque(self, speed: Array) -> Array:
        """The largest shaft torque (n,) N m at speeds (n,) rad/s that the known limits allow: infinite where none does,
        -inf beyond the largest speed.
        """
        high = np.full(speed.shape, np.inf)
        friction = friction_torque(self._motors, speed)
        for limits in self._limits.values():
            for limit in limits:
                a, b = float(limit.torque[0]), float(limit.speed[0])
                if a == 0.0:
                    high = np.where(np.abs(b * speed) <= 1.0, high, -np.inf)
                else:
                    high = np.minimum(high, (1.0 - b * speed) / a - (friction if limit.basis == "electrical" else 0.0))
        if self._curve_known:
            curve = peak_curves(self._motors, self.conditions)
            beyond = 0.0 if self.motor.by_ratings else -np.inf
            high = np.minimum(high, curve.at(np.abs(speed), beyond=beyond))
        return high

    @cached_property
    def largest_speed(self) -> float:
        """The speed, rad/s, beyond which no torque is allowed, driving or braking; infinite where it is unknown."""
        ends = [np.inf]
        for limits in self._limits.values():
            for limit in limits:
                a, b = float(limit.torque[0]), float(limit.speed[0])
                if b > 0.0:  # braking, |a T_e + b ω| <= 1 with T_e down to the largest braking torque
                    ends.append((1.0 + a * self._braking_torque if a > 0.0 else 1.0) / b)
        if self._curve_known:
            ends.append(float(peak_curves(self._motors, self.conditions).last_x[0]))
        return float(min(ends))

    def voltage_torques(self, speed: Array) -> Array | None:
        """The largest and the smallest shaft torque (2, n), N m, that the voltage allows at speeds (n,) rad/s; None
        where that is unknown.
        """
        if "voltage limit" not in self._limits:
            return None
        limit = self._limits["voltage limit"][0]
        friction = friction_torque(self._motors, speed) if limit.basis == "electrical" else 0.0
        a, b = float(limit.torque[0]), float(limit.speed[0])
        return np.array([(1.0 - b * speed) / a - friction, (-1.0 - b * speed) / a - friction])

    @property
    def _braking_torque(self) -> float:
        """The largest braking torque, N m; infinite where it is unknown."""
        peak, current = float(self._motors.peak_torque[0]), float(self._motors.peak_electrical_torque[0])
        return float(np.fmin(peak, current)) if np.isfinite(np.fmin(peak, current)) else np.inf

    @cached_property
    def outline(self) -> Array | None:
        """Corners (k, 2) of speed rad/s and torque N m of the region, all four quadrants; None where it has no end."""
        top = self.largest_speed
        if not np.isfinite(top):
            return None
        if self.motor.by_ratings:
            corners = np.array([*(self.motor.peak_curve or ()), (top, 0.0)]) * [
                [[1, 1]],
                [[1, -1]],
                [[-1, -1]],
                [[-1, 1]],
            ]
            return np.concatenate([corners[0], corners[1, ::-1], corners[2], corners[3, ::-1]])
        speed = np.linspace(-top, top, 2 * SPEEDS - 1)
        high, low = self.highest_torque(speed), -self.highest_torque(-speed)
        inside = np.isfinite(high) & np.isfinite(low) & (high >= low)
        if not inside.any():
            return None
        speed, high, low = speed[inside], high[inside], low[inside]
        return np.column_stack(
            [np.concatenate([speed, speed[::-1], speed[:1]]), np.concatenate([high, low[::-1], high[:1]])]
        )
