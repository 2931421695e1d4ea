"""A motor with its gear: what a joint's torque and speed become at the motor shaft, and what the motor
allows.

Shaft speed is N q̇ and shaft torque T = τ_load / (N η) while the load takes power (τ_load q̇ >= 0, standstill
included), τ_load η / N while it gives power back, plus (J_rotor + J_gear) N q̈; N is the ratio and η the
gear's efficiency. τ_load is the joint torque without the reflected rotor inertia N² (J_rotor + J_gear) q̈.
(Equations: the power balance over a gear, e.g. Siciliano et al., Robotics, 2009, section 5.1.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.config.fields import Fields
from bellcrank.errors import InputError

Array = NDArray[np.float64]
_NUMBERS = (  # name, least, more than, most
    ("ratio", None, 0.0, arguments.LARGEST),
    ("rated_torque", None, 0.0, arguments.LARGEST),
    ("peak_torque", None, 0.0, arguments.LARGEST),
    ("rated_speed", None, 0.0, arguments.LARGEST),
    ("max_speed", None, 0.0, arguments.LARGEST),
    ("efficiency", None, 0.0, 1.0),
    ("rotor_inertia", 0.0, None, arguments.LARGEST),
    ("gear_inertia", 0.0, None, arguments.LARGEST),
    ("safety_factor", 1.0, None, arguments.LARGEST),
    ("motor_efficiency", None, 0.0, 1.0),
)
STANDSTILL = 1e-6  # rad/s of the shaft: what is slower stands still; else rounding would choose the flow of power
FASTEST = 1500.0  # rad/s: few motors turn faster, and many have a number above it as their rpm


@dataclass(frozen=True)
class Drive:
    """Motor and gear of one joint; torques N m, inertias kg m² and speeds rad/s, all at the motor shaft.

    `ratio` is motor angle per joint angle (rad/rad; rad/m on a prismatic joint), `efficiency` that of the
    gear (0 < η <= 1), `safety_factor` multiplies torques before they are compared, `motor_efficiency` turns
    shaft power into electrical power (1 where not given). `curve` lists (speed, torque) from speed 0 on,
    speeds rising and torques not rising; beyond its last speed no torque is available. Without it:
    peak_torque up to rated_speed, then straight down to zero at max_speed. Raises InputError for impossible
    values.
    """

    ratio: float
    rated_torque: float
    peak_torque: float
    rated_speed: float
    max_speed: float
    efficiency: float = 1.0
    rotor_inertia: float = 0.0
    gear_inertia: float = 0.0
    safety_factor: float = 1.0
    motor_efficiency: float | None = None
    curve: tuple[tuple[float, float], ...] | None = None

    def __post_init__(self) -> None:
        for name, least, above, most in _NUMBERS:
            value = getattr(self, name)
            if name == "motor_efficiency" and value is None:
                continue
            number = arguments.number(name, value, least=least, above=above, most=most, where="a drive")
            object.__setattr__(self, name, number)
        _require(
            self.reflected_inertia <= arguments.LARGEST,
            "ratio",
            f"one with which the reflected inertia is at most {arguments.LARGEST:g} kg m²",
            self.ratio,
        )
        _require(
            self.peak_torque >= self.rated_torque,
            "peak_torque",
            f"at least the rated torque, {self.rated_torque:g} N m",
            self.peak_torque,
        )
        _require(
            self.max_speed >= self.rated_speed,
            "max_speed",
            f"at least the rated speed, {self.rated_speed:g} rad/s",
            self.max_speed,
        )
        if self.curve is not None:
            object.__setattr__(self, "curve", _points(self.curve))
            speeds, torques = zip(*self.curve, strict=True)
            _require(
                speeds[0] == 0.0 and all(b > a for a, b in pairwise(speeds)),
                "curve",
                "speeds that start at 0 and rise",
                list(speeds),
            )
            _require(
                torques[0] > 0.0 and torques[-1] >= 0.0 and all(b <= a for a, b in pairwise(torques)),
                "curve",
                "torques of 0 or more that do not rise with the speed",
                list(torques),
            )

    @property
    def shaft_inertia(self) -> float:
        """J_rotor + J_gear, kg m² at the motor shaft."""
        return self.rotor_inertia + self.gear_inertia

    @property
    def reflected_inertia(self) -> float:
        """N² (J_rotor + J_gear): the shaft's inertia as the joint feels it, kg m² (prismatic: kg)."""
        return self.ratio * self.ratio * self.shaft_inertia

    @property
    def doubts(self) -> tuple[str, ...]:
        """A sentence for each speed above 1500 rad/s, where rpm may have been meant."""
        return tuple(
            f"{name} {value:g} rad/s is {value * 30.0 / math.pi:.0f} rpm: was rpm meant? write '{value:g} rpm'"
            for name, value in (("rated_speed", self.rated_speed), ("max_speed", self.max_speed))
            if value > FASTEST
        )

    @property
    def curve_points(self) -> tuple[tuple[float, float], ...]:
        """(speed rad/s, torque N m) corners of the curve used, from speed 0 to the last speed."""
        if self.curve is not None:
            return self.curve
        corners = [(0.0, self.peak_torque), (self.rated_speed, self.peak_torque)]
        return tuple(corners + ([(self.max_speed, 0.0)] if self.max_speed > self.rated_speed else []))

    @property
    def outline(self) -> Array:
        """The corners (k, 2) of speed rad/s and torque N m around all that the curve allows, in both directions."""
        speed, torque = np.array([*self.curve_points, (self.curve_points[-1][0], 0.0)]).T
        return np.column_stack(
            [
                np.concatenate([speed, speed[::-1], -speed, -speed[::-1]]),
                np.concatenate([torque, -torque[::-1], -torque, torque[::-1]]),
            ]
        )

    def shaft_torque(self, load_torque: Array, velocity: Array, acceleration: Array) -> Array:
        """Motor shaft torque (n,), N m, from joint load torque (N m or N), velocity and acceleration, all
        (n,)."""
        load_torque, velocity, acceleration = arguments.alike(
            load_torque=load_torque, velocity=velocity, acceleration=acceleration
        )
        with np.errstate(over="ignore", invalid="ignore"):  # infinite and NaN stay so
            motoring = (load_torque * velocity >= 0.0) | (self.ratio * np.abs(velocity) <= STANDSTILL)
            through_gear = np.where(motoring, 1.0 / (self.ratio * self.efficiency), self.efficiency / self.ratio)
            return np.asarray(load_torque * through_gear + self.shaft_inertia * self.ratio * acceleration)

    def electrical_power(self, shaft_power: Array) -> Array:
        """Power at the supply, W, (n,): shaft power over, or when negative times, the motor's efficiency."""
        (shaft_power,) = arguments.alike(shaft_power=shaft_power)
        eta = 1.0 if self.motor_efficiency is None else self.motor_efficiency
        return np.where(shaft_power >= 0.0, shaft_power / eta, shaft_power * eta)

    def available_torque(self, speed: Array) -> Array:
        """Torque of the curve at |speed| (n,), N m; zero beyond its last speed."""
        (speed,) = arguments.alike(speed=speed)
        speeds, torques = np.array(self.curve_points).T
        return np.asarray(np.interp(np.abs(speed), speeds, torques, right=0.0))

    def curve_use(self, torque: Array, speed: Array) -> Array:
        """Share (n,) of the torque-speed curve used, along the ray from the origin: 1 on the curve, more is
        outside.

        `torque` (n,) N m, with any safety factor already in it, and `speed` (n,) rad/s, at the shaft. A point
        is inside exactly when the share is at most 1, because a curve that does not rise is star-shaped about
        0.
        """
        torque, speed = map(np.abs, arguments.alike(torque=torque, speed=speed))
        speeds, torques = np.array(self.curve_points).T
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            reach = np.where(speed > 0.0, speeds[-1] / speed, np.inf)  # factor to the last speed
            for k in range(len(speeds) - 1):
                slope = (torques[k + 1] - torques[k]) / (speeds[k + 1] - speeds[k])
                intercept = torques[k] - slope * speeds[k]
                factor = intercept / (torque - slope * speed)
                at = factor * speed
                # The first crossing counts; a hair of slack so that corners are not missed by round-off.
                slack = 1e-12 * speeds[-1]
                crosses = (
                    (torque > 0.0) & np.isfinite(factor) & (at >= speeds[k] - slack) & (at <= speeds[k + 1] + slack)
                )
                reach = np.where(crosses, np.minimum(reach, factor), reach)
            use = np.where(np.isinf(reach), 0.0, 1.0 / reach)
        return np.where(np.isnan(torque) | np.isnan(speed), np.nan, use)


def drive_from_fields(fields: Fields) -> Drive:
    """The Drive that a configuration's mapping describes; InputError naming file and key."""
    curve = tuple((speed, torque) for speed, torque in fields.rows("curve", 2)) if "curve" in fields else None
    fields.known("curve")
    values = {
        name: fields.number(name, unit, positive=True)
        for name, unit in (
            ("ratio", ""),
            ("rated_torque", "N m"),
            ("peak_torque", "N m"),
            ("rated_speed", "rad/s"),
            ("max_speed", "rad/s"),
        )
    }
    values["efficiency"] = fields.number("efficiency", "", 1.0, positive=True, maximum=1.0)
    values["rotor_inertia"] = fields.number("rotor_inertia", "kg m^2", 0.0, nonnegative=True)
    values["gear_inertia"] = fields.number("gear_inertia", "kg m^2", 0.0, nonnegative=True)
    values["safety_factor"] = fields.number("safety_factor", "", 1.0, positive=True)
    motor_efficiency = fields.optional_number("motor_efficiency", "", positive=True, maximum=1.0)
    fields.done()
    try:
        return Drive(**values, motor_efficiency=motor_efficiency, curve=curve)
    except InputError as error:
        raise fields.error("", str(error)) from None


def _points(curve: object) -> tuple[tuple[float, float], ...]:
    """The points of a curve as numbers. Raises InputError."""
    expected = "at least two (speed rad/s, torque N m) points"
    if isinstance(curve, np.ndarray) and curve.ndim == 2:
        curve = curve.tolist()
    if not isinstance(curve, (list, tuple)) or len(curve) < 2:
        arguments.refuse("curve", expected, curve, "a drive")
    pairs = [arguments.vector("curve", pair, 2, most=arguments.LARGEST, where="a drive") for pair in curve]
    return tuple((float(speed), float(torque)) for speed, torque in pairs)


def _require(condition: bool, name: str, expected: str, found: object) -> None:
    if not condition:
        raise InputError(f"a drive's {name}: expected {expected}, found {found}")
