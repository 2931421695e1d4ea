"""The actuator of a joint, a motor with its gear: the load at the motor shaft, and what the motor allows.

It is made from ratings, or of a motor and a gear of a catalogue; then the continuous torque is that at the speed asked
(continuous_torque.py), and the limits over speed are peak torque and current, the voltage limit, and a printed curve
(short_time_limits.py), in all four quadrants. Ratings are rows of a motor and a gear too, so that the same formulas
serve both: the load at the shaft is that of one pair (powertrain.py), where the load is the joint torque without the
reflected rotor inertia N² (J_rotor + J_gear) q̈.

A figure that is None is unknown. What follows from it is NaN, so that nothing passes or fails because of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Final

import numpy as np

from bellcrank import arguments
from bellcrank.actuators.actuator_checks import check_ratings
from bellcrank.actuators.catalogue.product_checks import Points
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.continuous_torque import continuous_torque
from bellcrank.actuators.electrical import electrical_power, electrical_torque
from bellcrank.actuators.gear import DIRECT, Gear
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.powertrain import PowerTrains
from bellcrank.actuators.short_time_limits import ShortTimeRegion
from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.errors import InputError

ENDLESS = 1e9  # rad/s: a rated torque has no end
FASTEST = 1500.0  # rad/s: few motors turn faster, while many speeds in rpm are larger numbers
SLOWEST = 2.0, 20.0  # rad/s², without and behind a gear: motors reach 1e3 to 1e5, drives with a built-in gear 6
RATINGS: Final[Mapping[str, str]] = MappingProxyType(  # with their units
    {
        "ratio": "", "rated_torque": "N m", "peak_torque": "N m", "rated_speed": "rad/s", "max_speed": "rad/s",
        "efficiency": "", "rotor_inertia": "kg m^2", "gear_inertia": "kg m^2", "safety_factor": "",
    }
)  # fmt: skip


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

    Attributes:
        motor: The motor, as the catalogue states it; of ratings, a row that has them.
        gear: The gear, as the catalogue states it; `DIRECT` without one.
        conditions: Supply, surroundings, safety factor, and values assumed for what the rows do not state. Ratings hold
            at any supply and place.

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
    motor: Motor = field(init=False, repr=False)
    gear: Gear = field(init=False, repr=False)
    conditions: Conditions = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_ratings(self)
        rated = self.rated_torque
        motor = Motor(
            id="ratings",
            maker="",
            model="",
            kind="ratings",
            nominal_torque=rated,
            continuous_curve=None if rated is None else ((0.0, rated), (ENDLESS, rated)),
            peak_torque=self.peak_torque,
            peak_curve=self._curve_of_ratings,
            max_speed=self.max_speed,
            rotor_inertia=self.rotor_inertia,
        )
        gear = Gear(
            id="ratings", maker="", model="", kind="direct", ratio=self.ratio, efficiency=self.efficiency,
            inertia=self.gear_inertia,
        )  # fmt: skip
        self._are(motor, gear, Conditions(safety_factor=self.safety_factor))

    def _are(self, motor: Motor, gear: Gear, conditions: Conditions) -> None:
        for name, value in (("motor", motor), ("gear", gear), ("conditions", conditions)):
            object.__setattr__(self, name, value)

    @classmethod
    def of(cls, motor: Motor, gear: Gear | None = None, conditions: Conditions | None = None) -> Actuator:
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
        motor = arguments.instance("motor", motor, Motor, "a Motor")
        gear = DIRECT if gear is None else arguments.instance("gear", gear, Gear, "a Gear")
        if conditions is None:
            conditions = Conditions()
        conditions = arguments.instance("conditions", conditions, Conditions, "Conditions")
        filled, with_gear = conditions.completed(motor), conditions.completed(gear)
        if with_gear.ratio is None:
            raise InputError(f"gear '{gear.id}': its ratio is unknown, so that joint loads cannot be computed")
        if motor.kind == "actuator" and gear.kind != "direct":
            raise InputError(
                f"motor '{motor.id}' is sold with its gear, and its figures hold at the output; give it without "
                f"gear '{gear.id}'"
            )
        made = cls(
            ratio=with_gear.ratio,
            rated_torque=filled.continuous_torque or None,
            peak_torque=filled.peak_torque,
            rated_speed=filled.nominal_speed or None,  # a torque rated at standstill has no speed
            max_speed=filled.max_speed,
            efficiency=with_gear.efficiency,
            rotor_inertia=filled.rotor_inertia,
            gear_inertia=with_gear.inertia,
            safety_factor=conditions.safety_factor,
        )
        made._are(motor, gear, conditions)
        return made

    def __repr__(self) -> str:
        stated = [f"{name}={getattr(self, name)!r}" for name in (*RATINGS, "motor_efficiency", "curve")]
        return f"Actuator({', '.join(stated)}, motor='{self.motor.id}', gear='{self.gear.id}')"

    @property
    def by_ratings(self) -> bool:
        """Whether it is made from ratings."""
        return self.motor.by_ratings

    @cached_property
    def rows(self) -> tuple[Motor, Gear]:
        """The motor and the gear with the values assumed for what they do not state."""
        return self.conditions.completed(self.motor), self.conditions.completed(self.gear)

    @cached_property
    def train(self) -> PowerTrains:
        """The one pair of the rows."""
        return PowerTrains.of(*self.rows)

    @cached_property
    def short_time_region(self) -> ShortTimeRegion:
        """The region of torque and speed that the motor may reach for a short time."""
        return ShortTimeRegion(self.rows[0], self.conditions)

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
            >>> actuator = bc.load_scene("geared_pendulum").actuators["shoulder"]
            >>> actuator.under(bc.Conditions(safety_factor=2.0)).safety_factor
            2.0
        """
        if conditions is None:
            return self
        arguments.instance("conditions", conditions, Conditions, "Conditions")
        if not self.by_ratings:
            return Actuator.of(self.motor, self.gear, self.conditions.updated(conditions))
        return replace(self, safety_factor=conditions.safety_factor) if "safety_factor" in conditions.given else self

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
        known = self.rows[1].efficiency_curve is not None or self.efficiency is not None
        return (() if known else ("efficiency",)) + self.unknown_inertias

    @property
    def unknown_of_supply(self) -> tuple[str, ...]:
        """What the power from the supply needs and is unknown."""
        if self.by_ratings:
            return self.unknown_of_torque
        motor = self.rows[0]
        figures = {
            "the torque constant with its basis": motor.dc_torque_constant,
            "the resistance": motor.resistance,
            "the motor's friction or no-load current": motor.coulomb_torque,
        }
        return self.unknown_of_torque + tuple(name for name, value in figures.items() if value is None)

    @property
    def has_limits(self) -> bool:
        """Whether at least one limit of the torque over the speed is known."""
        return self.short_time_region.known

    @property
    def unknown_limits(self) -> tuple[str, ...]:
        """The limits of the torque over the speed that are unknown."""
        return self.short_time_region.unknown

    @property
    def continuous_outline(self) -> Array | None:
        """Points (k, 2) of speed rad/s and continuous torque N m, speeds rising from 0; None where unknown."""
        ends = [one for one in (self.max_speed, self.rated_speed) if one is not None]
        if not self.by_ratings and np.isfinite(fastest := self.short_time_region.largest_speed):
            ends.append(fastest)
        end = (max if self.by_ratings else min)(ends, default=None)
        if end is None:
            return None
        speed = np.linspace(0.0, end, 2 if self.by_ratings else 201)
        torque = continuous_torque(self.train.motors, speed, self.conditions).torque
        known = ~np.isnan(torque)
        return np.column_stack([speed, torque])[known] if known.any() else None

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
    def _curve_of_ratings(self) -> Points | None:
        """Points (speed rad/s, torque N m) of the torque-speed curve, from speed 0 on; None where unknown."""
        if self.curve is not None:
            return self.curve
        if self.peak_torque is None or self.rated_speed is None or self.max_speed is None:
            return None
        corners = ((0.0, self.peak_torque), (self.rated_speed, self.peak_torque))
        return (*corners, (self.max_speed, 0.0)) if self.max_speed > self.rated_speed else corners

    @property
    def curve_points(self) -> Points | None:
        """Points (speed rad/s, torque N m) of the torque-speed curve of ratings, from speed 0 on; None where unknown,
        and of a catalogue's motor, whose limits differ between driving and braking (`outline`).
        """
        return self.motor.peak_curve if self.by_ratings else None

    @property
    def outline(self) -> Array | None:
        """Corners (k, 2) of speed rad/s and torque N m of the region of short-time operation as far as it is known, in
        all four quadrants; None where it has no end.
        """
        return self.short_time_region.outline

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
            >>> actuator = bc.load_scene("geared_pendulum").actuators["shoulder"]
            >>> actuator.shaft_torque(np.array([9.81]), np.array([0.0]), np.array([0.0]))
            array([0.24525])
        """
        load_torque, velocity, acceleration = arguments.alike(
            load_torque=load_torque, velocity=velocity, acceleration=acceleration
        )
        with np.errstate(over="ignore", invalid="ignore"):  # infinite and NaN stay so
            return self.train.shaft_torque(load_torque, velocity, acceleration)

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
            >>> actuator = bc.load_scene("geared_pendulum").actuators["shoulder"]
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
            >>> actuator = bc.load_scene("geared_pendulum").actuators["shoulder"]
            >>> actuator.supply_power(np.array([0.17]), np.array([100.0]))
            array([20.])
        """
        torque, speed = arguments.alike(torque=torque, speed=speed)
        with np.errstate(over="ignore", invalid="ignore"):
            if self.by_ratings:
                return self.electrical_power(torque * speed)
            motors = self.train.motors  # with copper, friction and iron losses
            return electrical_power(motors, electrical_torque(motors, torque, speed), speed)

    def continuous_torque(self, speed: float) -> float | None:
        """The torque that the motor can deliver continuously at a constant speed; of ratings the rated torque.

        Args:
            speed: Shaft speed, rad/s, of either sign.

        Returns:
            Torque, N m; None where unknown.

        Raises:
            InputError: For a speed that is not a number.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_scene("geared_pendulum").actuators["shoulder"].continuous_torque(100.0)
            0.32
        """
        speed = arguments.number("speed", speed, "rad/s")
        found = float(continuous_torque(self.train.motors, speed, self.conditions).torque[0])
        return None if np.isnan(found) else found

    def available_torque(self, speed: Array) -> Array:
        """The largest driving torque that the torque-speed curve allows.

        Args:
            speed: Shaft speed (n,), rad/s, of either sign.

        Returns:
            Torque (n,), N m; 0 beyond the last speed of the curve, NaN where the curve is unknown.

        Raises:
            InputError: For values that are not numbers.

        Example:
            >>> import bellcrank as bc, numpy as np
            >>> actuator = bc.load_scene("geared_pendulum").actuators["shoulder"]
            >>> actuator.available_torque(np.array([0.0, 700.0]))
            array([0.95, 0.  ])
        """
        (speed,) = arguments.alike(speed=speed)
        if self.unknown_limits:
            return np.full(speed.shape, np.nan)
        return self.short_time_region.highest_torque(np.abs(speed))

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
            >>> actuator = bc.load_scene("geared_pendulum").actuators["shoulder"]
            >>> actuator.limit_uses(np.array([0.475]), np.array([100.0]))
            array([[0.5]])
        """
        return self.short_time_region.uses(*arguments.alike(torque=torque, speed=speed))

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
            >>> actuator = bc.load_scene("geared_pendulum").actuators["shoulder"]
            >>> actuator.curve_use(np.array([0.475]), np.array([0.0]))
            array([0.5])
        """
        return self.short_time_region.use(*arguments.alike(torque=torque, speed=speed))
