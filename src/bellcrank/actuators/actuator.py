"""The actuator of a joint, a motor with its gear: the load at the motor shaft, and what the motor allows.

The shaft turns at N q̇. Its torque is τ_load / (N η) while the load takes power (τ_load q̇ >= 0, standstill included) and
τ_load η / N while it gives power back, plus (J_rotor + J_gear) N q̈; N is the ratio and η the gear's efficiency. τ_load
is the joint torque without the reflected rotor inertia N² (J_rotor + J_gear) q̈.
(Equations: the power balance over a gear, e.g. Siciliano et al., Robotics, 2009, section 5.1.)

A figure that is None is unknown. What follows from it is NaN, so that nothing passes or fails because of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.actuators.actuator_checks import check_ratings
from bellcrank.actuators.shaft_load import shaft_torque
from bellcrank.actuators.torque_speed_curve import Points, four_quadrants, share_of_curve, torque_below

if TYPE_CHECKING:
    from bellcrank.actuators.conditions import Conditions
    from bellcrank.actuators.gear import Gear
    from bellcrank.actuators.motor import Motor
    from bellcrank.actuators.motor_with_gear import MotorWithGear

Array = NDArray[np.float64]
ENDLESS = 1e9  # rad/s: a rated torque has no end
FASTEST = 1500.0  # rad/s: few motors turn faster, while many speeds in rpm are larger numbers
SLOWEST = 2.0, 20.0  # rad/s², without and behind a gear: motors reach 1e3 to 1e5, drives with a built-in gear 6


@dataclass(frozen=True)
class Actuator:
    """The motor and gear of one joint. Torques, inertias and speeds are those at the motor shaft; None is unknown.

    It is made from these ratings, or by `Actuator.of` from a motor and a gear of a catalogue, whose limits then follow
    from their models.

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
    rated_torque: float | None
    peak_torque: float | None
    rated_speed: float | None
    max_speed: float | None
    efficiency: float | None = 1.0
    rotor_inertia: float | None = 0.0
    gear_inertia: float | None = 0.0
    safety_factor: float = 1.0
    motor_efficiency: float | None = None
    curve: Points | None = None

    def __post_init__(self) -> None:
        check_ratings(self)

    @classmethod
    def of(cls, motor: Motor, gear: Gear | None = None, conditions: Conditions | None = None) -> MotorWithGear:
        """The actuator that a motor and a gear of a catalogue make.

        Args:
            motor: The motor, or an actuator sold as one.
            gear: The gear; by default none.
            conditions: Supply, surroundings, safety factor and assumptions; by default those of `Conditions()`.

        Returns:
            The actuator. What the two rows do not state stays unknown.

        Raises:
            InputError: The gear's ratio is unknown, or a figure is impossible.

        Example:
            >>> import bellcrank as bc
            >>> from bellcrank.actuators.gear import Gear
            >>> from bellcrank.actuators.motor import Motor
            >>> motor = Motor(id="m", maker="", model="", nominal_torque=0.3, rotor_inertia=6e-6)
            >>> gear = Gear(id="g", maker="", model="", kind="planetary", ratio=50.0, inertia=1e-6)
            >>> actuator = bc.Actuator.of(motor, gear)
            >>> actuator.rated_torque, actuator.efficiency, round(actuator.reflected_inertia, 6)
            (0.3, None, 0.0175)
        """
        from bellcrank.actuators.motor_with_gear import motor_with_gear

        return motor_with_gear(motor, gear, conditions)

    @property
    def rows(self) -> tuple[Motor, Gear]:
        """The motor and the gear as rows of a catalogue, which criteria compare with loads."""
        from bellcrank.actuators.gear import Gear
        from bellcrank.actuators.motor import Motor

        rated = self.rated_torque
        motor = Motor(
            id="ratings",
            maker="",
            model="",
            kind="ratings",
            nominal_torque=rated,
            continuous_curve=None if rated is None else ((0.0, rated), (ENDLESS, rated)),
            peak_torque=self.peak_torque,
            peak_curve=self.curve_points,
            max_speed=self.max_speed,
            rotor_inertia=self.rotor_inertia,
        )
        gear = Gear(
            id="ratings", maker="", model="", kind="direct", ratio=self.ratio, efficiency=self.efficiency,
            inertia=self.gear_inertia,
        )  # fmt: skip
        return motor, gear

    @property
    def judged_under(self) -> Conditions:
        """The conditions under which criteria compare the rows with loads: ratings hold at any supply and place."""
        from bellcrank.actuators.conditions import Conditions

        return Conditions(safety_factor=self.safety_factor)

    def under(self, conditions: Conditions | None) -> Actuator:
        """The same motor and gear under other conditions: those that are given replace its own.

        Args:
            conditions: What is given; None changes nothing.

        Returns:
            The actuator. Of ratings only the safety factor changes.

        Raises:
            InputError: A figure is impossible.

        Example:
            >>> import bellcrank as bc
            >>> actuator = bc.load_robot_config("geared_pendulum").actuators["shoulder"]
            >>> actuator.under(bc.Conditions(safety_factor=2.0)).safety_factor
            2.0
        """
        from bellcrank.actuators.conditions import Conditions

        if conditions is not None:
            arguments.instance("conditions", conditions, Conditions, "Conditions")
        if conditions is None or "safety_factor" not in conditions.given:
            return self
        return replace(self, safety_factor=conditions.safety_factor)

    @property
    def shaft_inertia(self) -> float | None:
        """J_rotor + J_gear, kg m² at the motor shaft; None where one of them is unknown."""
        if self.rotor_inertia is None or self.gear_inertia is None:
            return None
        return self.rotor_inertia + self.gear_inertia

    @property
    def reflected_inertia(self) -> float | None:
        """N² (J_rotor + J_gear): the shaft's inertia reflected to the joint, kg m² (prismatic: kg); None if unknown."""
        inertia = self.shaft_inertia
        return None if inertia is None else self.ratio * self.ratio * inertia

    @property
    def known_inertia(self) -> float:
        """The reflected inertia, kg m² (prismatic: kg), of rotor and gear as far as known: a lower bound."""
        return self.ratio * self.ratio * ((self.rotor_inertia or 0.0) + (self.gear_inertia or 0.0))

    @property
    def unknown_inertias(self) -> tuple[str, ...]:
        """Those of "rotor_inertia" and "gear_inertia" that are unknown."""
        return tuple(name for name in ("rotor_inertia", "gear_inertia") if getattr(self, name) is None)

    @property
    def unknown_of_torque(self) -> tuple[str, ...]:
        """What the shaft torque needs and is unknown: of "efficiency", "rotor_inertia" and "gear_inertia"."""
        return (("efficiency",) if self.efficiency is None else ()) + self.unknown_inertias

    @property
    def unknown_of_supply(self) -> tuple[str, ...]:
        """What the power from the supply needs and is unknown."""
        return self.unknown_of_torque

    @property
    def has_limits(self) -> bool:
        """Whether at least one limit of the torque over the speed is known."""
        return self.curve_points is not None

    @property
    def unknown_limits(self) -> tuple[str, ...]:
        """The limits of the torque over the speed that are unknown."""
        return () if self.has_limits else ("the torque-speed curve",)

    @property
    def continuous_outline(self) -> Array | None:
        """Points (k, 2) of speed rad/s and continuous torque N m, speeds rising from 0; None where unknown."""
        end = self.max_speed if self.max_speed is not None else self.rated_speed
        if self.rated_torque is None or end is None:
            return None
        return np.array([[0.0, self.rated_torque], [end, self.rated_torque]])

    @property
    def doubts(self) -> tuple[str, ...]:
        """A sentence for each speed above 1500 rad/s, which may have been meant in rpm, and for a rotor inertia that
        the rated torque accelerates by less than SLOWEST, which may have been meant in kg cm².
        """
        rotor, rated = self.rotor_inertia or 0.0, self.rated_torque or math.inf
        heavy: tuple[str, ...] = ()
        if rotor * SLOWEST[self.ratio > 1.0] > rated:
            heavy = (
                f"the rated torque accelerates the rotor alone, rotor_inertia {rotor:g} kg m², by {rated / rotor:.2g} "
                f"rad/s² only: was kg cm² meant? write '{rotor:g} kg cm^2'",
            )
        speeds = tuple(
            f"{name} {value:g} rad/s is {value * 30.0 / math.pi:.0f} rpm: was rpm meant? write '{value:g} rpm'"
            for name, value in (("rated_speed", self.rated_speed), ("max_speed", self.max_speed))
            if value is not None and value > FASTEST
        )
        return speeds + heavy

    @property
    def curve_points(self) -> Points | None:
        """Points (speed rad/s, torque N m) of the torque-speed curve, from speed 0 on; None where unknown."""
        if self.curve is not None:
            return self.curve
        if self.peak_torque is None or self.rated_speed is None or self.max_speed is None:
            return None
        corners = ((0.0, self.peak_torque), (self.rated_speed, self.peak_torque))
        return (*corners, (self.max_speed, 0.0)) if self.max_speed > self.rated_speed else corners

    @property
    def outline(self) -> Array | None:
        """Corners (k, 2) of speed rad/s and torque N m of the region that the curve allows, in all four quadrants; None
        where the curve is unknown.
        """
        points = self.curve_points
        return None if points is None else four_quadrants(points)

    def shaft_torque(self, load_torque: Array, velocity: Array, acceleration: Array) -> Array:
        """The torque at the motor shaft.

        Args:
            load_torque: Joint torque (n,) without the reflected rotor inertia, N m (prismatic: N).
            velocity: Joint velocity (n,), rad/s (m/s).
            acceleration: Joint acceleration (n,), rad/s² (m/s²).

        Returns:
            Shaft torque (n,), N m; NaN where the efficiency or an inertia is unknown.

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
            return self._shaft_torque(load_torque, velocity, acceleration)

    def _shaft_torque(self, load_torque: Array, velocity: Array, acceleration: Array) -> Array:
        efficiency = math.nan if self.efficiency is None else self.efficiency
        inertia = math.nan if self.shaft_inertia is None else self.shaft_inertia
        return shaft_torque(load_torque, (velocity, acceleration), self.ratio, efficiency, inertia)

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

    def supply_power(self, torque: Array, speed: Array) -> Array:
        """The power from the supply.

        Args:
            torque: Shaft torque (n,), N m.
            speed: Shaft speed (n,), rad/s.

        Returns:
            Power (n,), W; negative where it is given back, NaN where unknown.

        Raises:
            InputError: For arrays of different shapes.

        Example:
            >>> import bellcrank as bc, numpy as np
            >>> actuator = bc.load_robot_config("geared_pendulum").actuators["shoulder"]
            >>> actuator.supply_power(np.array([0.17]), np.array([100.0]))
            array([20.])
        """
        torque, speed = arguments.alike(torque=torque, speed=speed)
        with np.errstate(over="ignore", invalid="ignore"):
            return self._supply_power(torque, speed)

    def _supply_power(self, torque: Array, speed: Array) -> Array:
        return self.electrical_power(torque * speed)

    def continuous_torque(self, speed: float) -> float | None:
        """The torque that the motor can deliver continuously at a constant speed: the rated torque.

        Args:
            speed: Shaft speed, rad/s, of either sign.

        Returns:
            Torque, N m; None where unknown.

        Raises:
            InputError: For a speed that is not a number.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_robot_config("geared_pendulum").actuators["shoulder"].continuous_torque(100.0)
            0.32
        """
        return self._continuous_torque(arguments.number("speed", speed, "rad/s"))

    def _continuous_torque(self, speed: float) -> float | None:
        return self.rated_torque

    def available_torque(self, speed: Array) -> Array:
        """The torque that the torque-speed curve allows.

        Args:
            speed: Shaft speed (n,), rad/s, of either sign.

        Returns:
            Torque (n,), N m; 0 beyond the last speed of the curve, NaN where the curve is unknown.

        Raises:
            InputError: For values that are not numbers.

        Example:
            >>> import bellcrank as bc, numpy as np
            >>> actuator = bc.load_robot_config("geared_pendulum").actuators["shoulder"]
            >>> actuator.available_torque(np.array([0.0, 700.0]))
            array([0.95, 0.  ])
        """
        return self._available_torque(*arguments.alike(speed=speed))

    def _available_torque(self, speed: Array) -> Array:
        points = self.curve_points
        return np.full(speed.shape, np.nan) if points is None else torque_below(points, speed)

    def limit_uses(self, torque: Array, speed: Array) -> Array:
        """The share of each known limit of torque over speed.

        Args:
            torque: Shaft torque (n,), N m, including any safety factor.
            speed: Shaft speed (n,), rad/s.

        Returns:
            The shares (m, n) of m limits: 1 on the limit, more outside.

        Raises:
            InputError: For arrays of different shapes.

        Example:
            >>> import bellcrank as bc, numpy as np
            >>> actuator = bc.load_robot_config("geared_pendulum").actuators["shoulder"]
            >>> actuator.limit_uses(np.array([0.475]), np.array([100.0]))
            array([[0.5]])
        """
        return self._limit_uses(*arguments.alike(torque=torque, speed=speed))

    def _limit_uses(self, torque: Array, speed: Array) -> Array:
        return self._curve_use(torque, speed)[None] if self.has_limits else np.zeros((0, len(torque)))

    def curve_use(self, torque: Array, speed: Array) -> Array:
        """The share of the torque-speed curve that is used, along the ray from the origin.

        A point is inside the curve exactly when its share is at most 1, because the region under a curve that does not
        rise is star-shaped about the origin.

        Args:
            torque: Shaft torque (n,), N m, including any safety factor.
            speed: Shaft speed (n,), rad/s.

        Returns:
            The share (n,): 1 on the curve, more outside, NaN where an argument is NaN or the curve is unknown.

        Raises:
            InputError: For arrays of different shapes.

        Example:
            >>> import bellcrank as bc, numpy as np
            >>> actuator = bc.load_robot_config("geared_pendulum").actuators["shoulder"]
            >>> actuator.curve_use(np.array([0.475]), np.array([0.0]))
            array([0.5])
        """
        return self._curve_use(*arguments.alike(torque=torque, speed=speed))

    def _curve_use(self, torque: Array, speed: Array) -> Array:
        if (points := self.curve_points) is None:
            return np.full(np.broadcast_shapes(torque.shape, speed.shape), np.nan)
        return share_of_curve(points, torque, speed)
