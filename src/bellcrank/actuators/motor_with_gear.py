"""An actuator made of a motor and a gear of a catalogue: its figures follow from their models."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.continuous_torque import continuous_torque
from bellcrank.actuators.electrical import electrical_power, electrical_torque
from bellcrank.actuators.gear import DIRECT, Gear
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.powertrain import PowerTrains
from bellcrank.actuators.short_time_region import ShortTimeRegion
from bellcrank.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class MotorWithGear(Actuator):
    """The actuator of a motor and a gear, made by `Actuator.of`. What the two rows do not state stays unknown.

    The continuous torque is that at the speed asked (continuous_torque.py), and the limits over speed are peak torque
    and current, the voltage limit, and a printed curve (short_time_limits.py), in all four quadrants.

    Attributes:
        motor: The motor, as the catalogue states it.
        gear: The gear, as the catalogue states it; `DIRECT` without one.
        conditions: Supply, surroundings, safety factor, and values assumed for what the rows do not state.
    """

    motor: Motor
    gear: Gear
    conditions: Conditions

    def under(self, conditions: Conditions | None) -> MotorWithGear:
        """The same motor and gear under other conditions: those that are given replace its own.

        Args:
            conditions: What is given; None changes nothing.

        Returns:
            The actuator.

        Raises:
            InputError: A figure is impossible.
        """
        if conditions is None:
            return self
        return motor_with_gear(self.motor, self.gear, self.conditions.updated(conditions))

    @cached_property
    def _train(self) -> PowerTrains:
        return PowerTrains.of(*self.rows)

    @property
    def rows(self) -> tuple[Motor, Gear]:
        """The motor and the gear with the values assumed for what they do not state."""
        return self.conditions.completed(self.motor), self.conditions.completed(self.gear)

    @property
    def judged_under(self) -> Conditions:
        """The conditions."""
        return self.conditions

    @cached_property
    def _region(self) -> ShortTimeRegion:
        return ShortTimeRegion(self.rows[0], self.conditions)

    @property
    def short_time_region(self) -> ShortTimeRegion:
        """The region of torque and speed that the motor may reach for a short time."""
        return self._region

    @property
    def unknown_of_torque(self) -> tuple[str, ...]:
        """What the shaft torque needs and is unknown: of "efficiency", "rotor_inertia" and "gear_inertia"."""
        known = bool(self._train.gears.efficiency_curve.known[0]) or self.efficiency is not None
        return (() if known else ("efficiency",)) + self.unknown_inertias

    @property
    def unknown_of_supply(self) -> tuple[str, ...]:
        """What the power from the supply needs and is unknown."""
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
        return self._region.known

    @property
    def unknown_limits(self) -> tuple[str, ...]:
        """The limits of the torque over the speed that are unknown."""
        return self._region.unknown

    @property
    def curve_points(self) -> None:
        """None: the limits differ between driving and braking (`outline`)."""
        return None

    @property
    def outline(self) -> Array | None:
        """Corners (k, 2) of speed rad/s and torque N m of the region of short-time operation as far as it is known;
        None where it has no end.
        """
        return self._region.outline

    @property
    def continuous_outline(self) -> Array | None:
        """Points (k, 2) of speed rad/s and continuous torque N m, speeds rising from 0; None where unknown."""
        ends = (self._region.largest_speed, self.max_speed, self.rated_speed)
        end = min((value for value in ends if value is not None and np.isfinite(value)), default=None)
        if end is None:
            return None
        speed = np.linspace(0.0, end, 201)
        torque = continuous_torque(self._train.motors, speed, self.conditions).torque
        known = ~np.isnan(torque)
        return np.column_stack([speed, torque])[known] if known.any() else None

    def voltage_lines(self, speed: Array) -> tuple[Array, Array, Array] | None:
        """Speeds (n,) rad/s with the largest and smallest torque (n,) N m that the voltage allows; None if unknown."""
        found = self._region.voltage_torques(speed)
        return None if found is None else (speed, found[0], found[1])

    def _shaft_torque(self, load_torque: Array, velocity: Array, acceleration: Array) -> Array:
        return self._train.shaft_torque(load_torque, velocity, acceleration)

    def _supply_power(self, torque: Array, speed: Array) -> Array:
        """With the motor's copper, friction and iron losses."""
        motors = self._train.motors
        return electrical_power(motors, electrical_torque(motors, torque, speed), speed)

    def _continuous_torque(self, speed: float) -> float | None:
        found = float(continuous_torque(self._train.motors, speed, self.conditions).torque[0])
        return None if np.isnan(found) else found

    def _available_torque(self, speed: Array) -> Array:
        """The largest driving torque; NaN where a limit is unknown."""
        found = self._region.highest_torque(np.abs(speed))
        return np.full(speed.shape, np.nan) if self.unknown_limits else found

    def _limit_uses(self, torque: Array, speed: Array) -> Array:
        return self._region.uses(torque, speed)

    def _curve_use(self, torque: Array, speed: Array) -> Array:
        """The largest share of those limits of torque over speed that are known."""
        return self._region.use(torque, speed)


def motor_with_gear(motor: Motor, gear: Gear | None, conditions: Conditions | None) -> MotorWithGear:
    """The actuator of a motor and gear. Raises InputError as `Actuator.of`."""
    motor = arguments.instance("motor", motor, Motor, "a Motor")
    gear = DIRECT if gear is None else arguments.instance("gear", gear, Gear, "a Gear")
    conditions = (
        Conditions() if conditions is None else arguments.instance("conditions", conditions, Conditions, "Conditions")
    )
    filled, with_gear = conditions.completed(motor), conditions.completed(gear)
    if with_gear.ratio is None:
        raise InputError(f"gear '{gear.id}': its ratio is unknown, so that nothing follows for the joint")
    if motor.kind == "actuator" and gear.kind != "direct":
        raise InputError(
            f"motor '{motor.id}' is sold with its gear, and its figures hold at the output; give it without "
            f"gear '{gear.id}'"
        )
    return MotorWithGear(
        ratio=with_gear.ratio,
        rated_torque=filled.continuous_torque or None,
        peak_torque=filled.peak_torque,
        rated_speed=filled.nominal_speed or None,  # a torque rated at standstill has no speed
        max_speed=filled.max_speed,
        efficiency=with_gear.efficiency,
        rotor_inertia=filled.rotor_inertia,
        gear_inertia=with_gear.inertia,
        safety_factor=conditions.safety_factor,
        motor=motor,
        gear=gear,
        conditions=conditions,
    )
