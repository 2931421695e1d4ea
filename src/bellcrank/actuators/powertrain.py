"""Power trains: motors with gears that drive an axis; loads at the shaft, losses, power and mass.

An axis has torque τ (N m or N), speed q̇ and acceleration q̈. The shaft turns at N q̇ and bears

    T = τ/(N η) while the load takes power (τ q̇ >= 0, standstill included), τ η_b/N while it gives power back,
        plus (J_rotor + J_gear) N q̈

with the gear's ratio N and efficiencies η, η_b (power balance over a gear, e.g. Siciliano et al., Robotics, 2009,
section 5.1). With a curve of efficiency over load the gear's loss torque is |τ| (1/η - 1) driving and |τ| (1 - η)
driven; below the first point of the curve the loss torque is that of the first point, because friction does not vanish
with the load. The curve stands in for η_b too where that is not stated.

`PowerTrains` holds pairs: `PowerTrains(motors[:, None], gears[None, :])` is every motor with every gear,
`PowerTrains.of(motor, gear)` one pair. Loads broadcast against the pairs; `trains[..., None]` puts samples last.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from bellcrank.actuators import electrical
from bellcrank.actuators.gear import DIRECT, Gear
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.product_arrays import GearArrays, MotorArrays
from bellcrank.arrays import Array, Mask
from bellcrank.cached_values import cached_property
from bellcrank.numerics import floats


def motoring(load: Array, velocity: Array) -> Mask:
    """Whether a load takes power, as the one that a joint at rest holds does: load · velocity >= 0.

    The velocity is 0 where the joint rests for a finite time; at another zero it has the sign of one of its sides, as
    the samples of sizing/loads/motion_grid.py have it.
    """
    return floats(np.sign(load) * velocity >= 0.0)  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class PowerTrains:
    """Motors with gears; figures of both broadcast to the shape of the pairs.

    Attributes:
        motors: The motors.
        gears: The gears; `DIRECT` without one.
    """

    motors: MotorArrays
    gears: GearArrays

    @classmethod
    def of(cls, motor: Motor, gear: Gear = DIRECT) -> Self:
        """One pair, of shape (1,): samples (n,) of a load broadcast with it."""
        return cls(MotorArrays.of([motor]), GearArrays.of([gear]))

    def __getitem__(self, index: Any) -> Self:
        return type(self)(self.motors[index], self.gears[index])

    @property
    def shaft_inertia(self) -> Array:
        """J_rotor + J_gear, kg m² at the shaft."""
        return self.motors.rotor_inertia + self.gears.inertia

    @property
    def reflected_inertia(self) -> Array:
        """N² (J_rotor + J_gear), kg m² at the axis (linear: kg)."""
        return self.gears.ratio**2 * self.shaft_inertia

    @property
    def mass(self) -> Array:
        """kg."""
        return self.motors.mass + self.gears.mass

    @property
    def electrical_coefficients(self) -> Array:
        """Factors (…, 5) of the electrical torque, T_e = c · [τ motoring, τ generating, q̈, sign q̇, q̇].

        They are [1/(N η), η_b/N, (J_rotor + J_gear) N, T_c, c_v N], NaN where a gear has only a curve of efficiency.
        """
        motors = self.motors
        columns = *self._factors, motors.coulomb_torque, motors.viscous_coefficient * self.gears.ratio
        return np.stack(np.broadcast_arrays(*columns), axis=-1)

    def gear_torque(self, torque: Array, speed: Array) -> Array:
        """Shaft torque of the load through the gear, without inertia, N m.

        Args:
            torque: Axis torque, N m (N).
            speed: Axis speed, rad/s (m/s).

        Returns:
            Torque, N m.
        """
        drives, (driving, driven, _) = motoring(torque, speed), self._factors
        found = torque * np.where(drives, driving, driven)
        if self._curved is None:
            return floats(found)
        opposed = np.where(speed == 0.0, np.sign(torque), np.sign(speed))
        lost = self._curve_loss(np.abs(torque), drives)
        return floats(np.where(self._curved, (torque + opposed * lost) / self.gears.ratio, found))

    @cached_property
    def _factors(self) -> tuple[Array, Array, Array]:
        """1/(N η) and η_b/N, of the load, and (J_rotor + J_gear) N, of its acceleration."""
        gears = self.gears
        through = 1.0 / (gears.ratio * gears.efficiency), gears.driven_efficiency / gears.ratio
        return *through, self.shaft_inertia * gears.ratio

    @cached_property
    def _curved(self) -> Mask | None:
        """Which gears have a curve of efficiency; None: no one has."""
        known = self.gears.efficiency_curve.known
        return known if known.any() else None

    def _curve_loss(self, size: Array, drives: Mask) -> Array:
        """Loss torque at the output, N m, of the curves of efficiency over load at torques of a size."""
        gears = self.gears
        first = gears.efficiency_curve.x[..., 0] * gears.rated_torque
        size = np.maximum(size, first)
        efficiency = gears.efficiency_curve.at(size / gears.rated_torque)
        driven = np.where(np.isnan(gears.back_efficiency), efficiency, gears.back_efficiency)
        return floats(size * np.where(drives, 1.0 / efficiency - 1.0, 1.0 - driven))

    def shaft_torque(self, torque: Array, speed: Array, acceleration: Array) -> Array:
        """Torque at the motor shaft.

        Args:
            torque: Axis torque without the actuator's own inertia, N m (N).
            speed: Axis speed, rad/s (m/s).
            acceleration: Axis acceleration, rad/s² (m/s²).

        Returns:
            Torque, N m.

        Example:
            >>> import numpy as np
            >>> from bellcrank.actuators.gear import Gear
            >>> from bellcrank.actuators.motor import Motor
            >>> from bellcrank.actuators.powertrain import PowerTrains
            >>> gear = Gear(id="g", maker="", model="", kind="spur", ratio=50.0, efficiency=0.8, inertia=1e-6)
            >>> train = PowerTrains.of(Motor(id="m", maker="", model="", rotor_inertia=5e-6), gear)
            >>> float(train.shaft_torque(np.array([11.31]), np.array([2.0]), np.array([3.0]))[0])
            0.28365
        """
        return np.asarray(self.gear_torque(torque, speed) + self._factors[2] * np.asarray(acceleration))

    def load(self, torque: Array, speed: Array, acceleration: Array) -> ShaftLoad:
        """Everything at the shaft along a load.

        Args:
            torque: Axis torque without the actuator's own inertia, N m (N).
            speed: Axis speed, rad/s (m/s).
            acceleration: Axis acceleration, rad/s² (m/s²).

        Returns:
            Torques, speed, losses and power; copper loss and power at 25 °C.
        """
        motors = self.motors
        shaft_speed = self.gears.ratio * np.asarray(speed)
        through_gear = self.gear_torque(torque, speed)
        shaft = through_gear + self._factors[2] * np.asarray(acceleration)
        current_torque = electrical.electrical_torque(motors, shaft, shaft_speed)
        return ShaftLoad(
            speed=shaft_speed,
            torque=shaft,
            electrical_torque=current_torque,
            copper_loss=electrical.copper_loss(motors, current_torque),
            friction_loss=electrical.friction_loss(motors, shaft_speed),
            gear_loss=through_gear * shaft_speed - torque * speed,
            electrical_power=electrical.electrical_power(motors, current_torque, shaft_speed),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class ShaftLoad:
    """What power trains bear along a load, arrays of one shape.

    Attributes:
        speed: Of the shaft, rad/s.
        torque: Of the shaft, N m.
        electrical_torque: T_e = T + T_c sign(ω) + c_v ω, N m.
        copper_loss: At 25 °C, W.
        friction_loss: Friction and iron loss of the motor, W.
        gear_loss: W.
        electrical_power: From the supply, W; negative where power is given back.
    """

    speed: Array
    torque: Array
    electrical_torque: Array
    copper_loss: Array
    friction_loss: Array
    gear_loss: Array
    electrical_power: Array
