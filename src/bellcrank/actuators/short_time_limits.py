"""What a motor may do for a short time: straight limits of torque and speed, and a maker's region of both.

Each straight limit is |a T + b ω| ≤ 1 on the shaft torque T or the electrical torque T_e (`SpeedTorqueLimit`), both
signs at once: a pair of half-planes that holds in all four quadrants, so that a load needs only its extreme points. The
use of a limit, |a T + b ω|, is the factor along the ray from the origin. A printed curve is not convex in general
(`peak_curve_use`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.copper import resistance_factor
from bellcrank.actuators.electrical import electrical_torque, friction_torque, usable_voltage
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.product_arrays import Curves, MotorArrays
from bellcrank.arrays import Array
from bellcrank.numerics import floats

PEAK = "the peak torque or current"
SPEEDS = 401  # of an outline, in each direction


@dataclass(frozen=True, kw_only=True, eq=False)
class SpeedTorqueLimit:
    """A limit |a T + b ω| ≤ 1 of many motors.

    Attributes:
        name: "peak torque", "peak current", "voltage limit" or "maximum speed".
        basis: Whether T is the "shaft" torque or the "electrical" torque T_e = T + T_c sign(ω) + c_v ω.
        torque: a, 1/(N m), NaN where unknown.
        speed: b, s/rad, NaN where unknown.
    """

    name: str
    basis: Literal["shaft", "electrical"]
    torque: Array
    speed: Array

    def use(self, torque: Array, speed: Array) -> Array:
        """|a T + b ω| at a torque (N m, of the limit's basis) and a speed (rad/s): 1 at the limit, NaN unknown."""
        return np.asarray(np.abs(self.torque * torque + self.speed * speed))


def short_time_limits(motors: MotorArrays, conditions: Conditions) -> tuple[SpeedTorqueLimit, ...]:
    """The straight limits of short-time operation.

    Peak torque is of the shaft; peak current is T_e ≤ k_t I_peak; a motor that states one of the two only is bounded by
    it. The voltage limit is |R/k T_e + k ω| ≤ U with the usable voltage U and R at the conditions' winding temperature.
    Where k or R is unknown it is the straight line through the stall torque and the no-load speed, on the shaft torque:
    both are proportional to the voltage (`voltage_limit_source` says which).

    Args:
        motors: The motors.
        conditions: The supply and the winding temperature.

    Returns:
        Peak torque, peak current, voltage limit (electrical), voltage limit (shaft; known only where the electrical one
        is not), maximum speed.
    """
    zero = np.zeros_like(motors.peak_torque)
    usable = usable_voltage(motors, conditions)
    resistance = motors.resistance * resistance_factor(conditions.winding_temperature)
    share = motors.nominal_voltage / usable
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        line = (resistance / motors.dc_torque_constant / usable, motors.dc_voltage_constant / usable)
        printed = np.isnan(line[0]) | np.isnan(line[1])
        limits = (
            ("peak torque", "shaft", 1.0 / motors.peak_torque, zero),
            ("peak current", "electrical", 1.0 / motors.peak_electrical_torque, zero),
            ("voltage limit", "electrical", *line),
            (
                "voltage limit",
                "shaft",
                np.where(printed, share / motors.stall_torque, np.nan),
                np.where(printed, share / motors.no_load_speed, np.nan),
            ),
            ("maximum speed", "shaft", zero, 1.0 / motors.max_speed),
        )
    return tuple(
        SpeedTorqueLimit(name=name, basis=basis, torque=torque, speed=speed)  # type: ignore[arg-type]
        for name, basis, torque, speed in limits
    )


def peak_curves(motors: MotorArrays, conditions: Conditions) -> Curves:
    """The printed curves of short-time operation at the bus voltage.

    They hold at the nominal voltage U_n. At a lower voltage U the voltage-limited part of a curve moves by the speed
    (U_n - U)/k to lower speeds (from U = R I + k ω at the same current); the whole curve is moved so, which is on the
    safe side where it is not limited by the voltage. Without k the curve is unknown then. At a higher voltage the
    printed curve stays. A maker's curve includes the drive's reserve.
    """
    curves = motors.peak_curve
    if conditions.voltage is None:
        return curves
    lack = np.maximum(motors.nominal_voltage - conditions.voltage, 0.0) / motors.dc_voltage_constant
    shift = np.where(motors.nominal_voltage <= conditions.voltage, 0.0, lack)[..., None]
    return Curves(curves.x - shift, np.where(np.isnan(shift), np.nan, curves.y))


def curve_use(curves: Curves, torque: Array, speed: Array) -> Array:
    """The use of the region below curves of torque over speed, along the ray from the origin; NaN without a curve.

    The region is star-shaped about the origin (`product_checks.torque_speed_curve`), so a point is inside exactly where
    its use is at most 1.

    Args:
        curves: Torque N m over speed rad/s; beyond the last speed no torque is available.
        torque: Shaft torque, N m; it broadcasts with the products.
        speed: Shaft speed, rad/s.

    Returns:
        Use: 1 on the curve, NaN where there is no curve.
    """
    torque, speed = np.abs(floats(torque)), np.abs(floats(speed))
    last = curves.last_x
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        use = np.where(last > 0.0, speed / last, np.where((torque > 0.0) | (speed > 0.0), np.inf, 0.0))
        loaded = torque > 0.0  # without torque the ray ends with the curve, which may be 0 before its end
        for k in range(curves.x.shape[-1] - 1):
            x0, x1, y0, y1 = curves.x[..., k], curves.x[..., k + 1], curves.y[..., k], curves.y[..., k + 1]
            # The segment's line in the quadrant is n · (ω, T) = c with c >= 0; a point's use of it is n · (ω, T) / c.
            # It counts where the ray crosses the segment: between the directions of its ends.
            if (x0 < 0.0).any():
                y0 = np.where(x0 < 0.0, y0 + (y1 - y0) * (-x0 / (x1 - x0)), y0)
                x0 = np.maximum(x0, 0.0)
            constant = y0 * x1 - y1 * x0
            crosses = loaded & (torque * x0 <= speed * y0) & (torque * x1 >= speed * y1)
            along = (torque * (x1 - x0) + speed * (y0 - y1)) / constant
            use = np.where(crosses & ((x1 > 0.0) & (constant > 0.0)), np.fmax(use, along), use)
    return np.where(curves.known & ~np.isnan(torque + speed), use, np.nan)


def peak_curve_use(motors: MotorArrays, conditions: Conditions, torque: Array, speed: Array) -> Array:
    """The use of the printed curve of short-time operation at the bus voltage; see `peak_curves` and `curve_use`."""
    return curve_use(peak_curves(motors, conditions), torque, speed)


def voltage_limit_source(motor: Motor) -> str:
    """Where the voltage limit of a motor comes from, in words; "unknown" where it cannot be drawn."""
    if motor.dc_torque_constant is not None and motor.resistance is not None:
        return "torque constant and resistance"
    if motor.nominal_voltage is None:
        return "unknown"
    return "unknown" if motor.stall_torque is None or motor.no_load_speed is None else "stall torque and no-load speed"


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
