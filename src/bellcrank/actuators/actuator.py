"""The actuator of a joint, a motor with its gear: the load at the motor shaft, and what the motor allows.

The shaft turns at N q̇. Its torque is τ_load / (N η) while the load takes power (τ_load q̇ >= 0, standstill included) and
τ_load η / N while it gives power back, plus (J_rotor + J_gear) N q̈; N is the ratio and η the gear's efficiency. τ_load
is the joint torque without the reflected rotor inertia N² (J_rotor + J_gear) q̈.
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
STANDSTILL = 1e-6  # rad/s of the shaft: slower counts as at rest, so that rounding does not decide the flow of power
FASTEST = 1500.0  # rad/s: few motors turn faster, while many speeds in rpm are larger numbers


@dataclass(frozen=True)
class Actuator:
    """The motor and gear of one joint. Torques, inertias and speeds are those at the motor shaft.

    Args:
        ratio: Motor angle over joint angle N, rad/rad; rad/m on a prismatic joint.
        rated_torque: Torque that the motor can deliver continuously, N m.
        peak_torque: Largest torque, N m.
        rated_speed: Speed up to which the peak torque is available, rad/s.
        max_speed: Largest speed, rad/s.
        efficiency: Efficiency of the gear η, 0 < η <= 1.
        rotor_inertia: Inertia of the rotor, kg m².
        gear_inertia: Inertia of the gear, kg m².
        safety_factor: Factor of at least 1 on torques before they are compared with limits.
        motor_efficiency: Efficiency from electrical to shaft power; 1 where not given.
        curve: Points (speed rad/s, torque N m) of the torque-speed curve, from speed 0 on, with rising speeds and
            torques that do not rise; beyond the last speed no torque is available. By default the peak torque up to
            the rated speed, then a straight line to 0 at the largest speed.

    Raises:
        InputError: For impossible values.

    Example:
        >>> import bellcrank as bc
        >>> actuator = bc.Actuator(
        ...     ratio=50.0, rated_torque=0.32, peak_torque=0.95, rated_speed=314.0, max_speed=628.0, rotor_inertia=6e-6
        ... )
        >>> round(actuator.reflected_inertia, 6)
        0.015
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
            number = arguments.number(name, value, least=least, above=above, most=most, where="an actuator")
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
        """N² (J_rotor + J_gear): the shaft's inertia reflected to the joint, kg m² (prismatic: kg)."""
        return self.ratio * self.ratio * self.shaft_inertia

    @property
    def doubts(self) -> tuple[str, ...]:
        """A sentence for each speed above 1500 rad/s, which may have been meant in rpm."""
        return tuple(
            f"{name} {value:g} rad/s is {value * 30.0 / math.pi:.0f} rpm: was rpm meant? write '{value:g} rpm'"
            for name, value in (("rated_speed", self.rated_speed), ("max_speed", self.max_speed))
            if value > FASTEST
        )

    @property
    def curve_points(self) -> tuple[tuple[float, float], ...]:
        """Points (speed rad/s, torque N m) of the torque-speed curve used, from speed 0 to the last speed."""
        if self.curve is not None:
            return self.curve
        corners = [(0.0, self.peak_torque), (self.rated_speed, self.peak_torque)]
        return tuple(corners + ([(self.max_speed, 0.0)] if self.max_speed > self.rated_speed else []))

    @property
    def outline(self) -> Array:
        """Corners (k, 2) of speed rad/s and torque N m of the region that the curve allows, in all four quadrants."""
        speed, torque = np.array([*self.curve_points, (self.curve_points[-1][0], 0.0)]).T
        return np.column_stack(
            [
                np.concatenate([speed, speed[::-1], -speed, -speed[::-1]]),
                np.concatenate([torque, -torque[::-1], -torque, torque[::-1]]),
            ]
        )

    def shaft_torque(self, load_torque: Array, velocity: Array, acceleration: Array) -> Array:
        """The torque at the motor shaft.

        Args:
            load_torque: Joint torque (n,) without the reflected rotor inertia, N m (prismatic: N).
            velocity: Joint velocity (n,), rad/s (m/s).
            acceleration: Joint acceleration (n,), rad/s² (m/s²).

        Returns:
            Shaft torque (n,), N m.

        Raises:
            InputError: For arrays of different shapes.

        Example:
            >>> import bellcrank as bc, numpy as np
            >>> actuator = bc.load_robot_config("geared_pendulum").actuators["shoulder"]
            >>> actuator.shaft_torque(np.array([9.81]), np.array([0.0]), np.array([0.0]))
            array([0.24525])
        """
        load_torque, velocity, acceleration = arguments.alike(
            load_torque=load_torque, velocity=velocity, acceleration=acceleration
        )
        with np.errstate(over="ignore", invalid="ignore"):  # infinite and NaN stay so
            motoring = (load_torque * velocity >= 0.0) | (self.ratio * np.abs(velocity) <= STANDSTILL)
            through_gear = np.where(motoring, 1.0 / (self.ratio * self.efficiency), self.efficiency / self.ratio)
            return np.asarray(load_torque * through_gear + self.shaft_inertia * self.ratio * acceleration)

    def electrical_power(self, shaft_power: Array) -> Array:
        """The electrical power: shaft power divided by the motor's efficiency, or multiplied by it where negative.

        Args:
            shaft_power: Power at the motor shaft (n,), W.

        Returns:
            Power from the supply (n,), W; negative where it is given back.

        Raises:
            InputError: For values that are not numbers.

        Example:
            >>> import bellcrank as bc, numpy as np
            >>> actuator = bc.load_robot_config("geared_pendulum").actuators["shoulder"]
            >>> actuator.electrical_power(np.array([17.0, -10.0]))
            array([20. , -8.5])
        """
        (shaft_power,) = arguments.alike(shaft_power=shaft_power)
        eta = 1.0 if self.motor_efficiency is None else self.motor_efficiency
        return np.where(shaft_power >= 0.0, shaft_power / eta, shaft_power * eta)

    def available_torque(self, speed: Array) -> Array:
        """The torque that the torque-speed curve allows.

        Args:
            speed: Shaft speed (n,), rad/s, of either sign.

        Returns:
            Torque (n,), N m; 0 beyond the last speed of the curve.

        Raises:
            InputError: For values that are not numbers.

        Example:
            >>> import bellcrank as bc, numpy as np
            >>> actuator = bc.load_robot_config("geared_pendulum").actuators["shoulder"]
            >>> actuator.available_torque(np.array([0.0, 700.0]))
            array([0.95, 0.  ])
        """
        (speed,) = arguments.alike(speed=speed)
        speeds, torques = np.array(self.curve_points).T
        return np.asarray(np.interp(np.abs(speed), speeds, torques, right=0.0))

    def curve_use(self, torque: Array, speed: Array) -> Array:
        """The share of the torque-speed curve that is used, along the ray from the origin.

        A point is inside the curve exactly when its share is at most 1, because the region under a curve that does not
        rise is star-shaped about the origin.

        Args:
            torque: Shaft torque (n,), N m, including any safety factor.
            speed: Shaft speed (n,), rad/s.

        Returns:
            The share (n,): 1 on the curve, more outside, NaN where an argument is NaN.

        Raises:
            InputError: For arrays of different shapes.

        Example:
            >>> import bellcrank as bc, numpy as np
            >>> actuator = bc.load_robot_config("geared_pendulum").actuators["shoulder"]
            >>> actuator.curve_use(np.array([0.475]), np.array([0.0]))
            array([0.5])
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
                # The first crossing counts. Round-off must not miss a corner, hence the slack.
                slack = 1e-12 * speeds[-1]
                crosses = (
                    (torque > 0.0) & np.isfinite(factor) & (at >= speeds[k] - slack) & (at <= speeds[k + 1] + slack)
                )
                reach = np.where(crosses, np.minimum(reach, factor), reach)
            use = np.where(np.isinf(reach), 0.0, 1.0 / reach)
        return np.where(np.isnan(torque) | np.isnan(speed), np.nan, use)


def _points(curve: object) -> tuple[tuple[float, float], ...]:
    """The points of a curve as numbers. Raises InputError."""
    expected = "at least two (speed rad/s, torque N m) points"
    if isinstance(curve, np.ndarray) and curve.ndim == 2:
        curve = curve.tolist()
    if not isinstance(curve, (list, tuple)) or len(curve) < 2:
        arguments.refuse("curve", expected, curve, "an actuator")
    pairs = [arguments.vector("curve", pair, 2, most=arguments.LARGEST, where="an actuator") for pair in curve]
    return tuple((float(speed), float(torque)) for speed, torque in pairs)


def _require(condition: bool, name: str, expected: str, found: object) -> None:
    if not condition:
        raise InputError(f"an actuator's {name}: expected {expected}, found {found}")


def actuator_from_fields(fields: Fields) -> Actuator:
    """The Actuator that a mapping of a robot configuration describes. Raises InputError, naming file and key."""
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
        return Actuator(**values, motor_efficiency=motor_efficiency, curve=curve)
    except InputError as error:
        raise fields.error("", str(error)) from None
