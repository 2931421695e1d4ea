"""Electrical behaviour of motors: torque of the current, copper loss, friction loss, voltage and power.

Every motor is its DC equivalent (`Motor.dc_torque_constant`): current I = T_e / k, copper loss R I², voltage R I + k ω
without the inductance; k ω is the back-EMF that is stated where it is not that of the torque constant
(`Motor.dc_voltage_constant`). The electrical torque is that of the shaft and of friction and iron losses,
T_e = T + T_c sign(ω) + c_v ω. Functions take `MotorArrays` and arrays that broadcast with them; NaN is unknown.
"""

from __future__ import annotations

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.copper import COPPER as COPPER
from bellcrank.actuators.copper import REFERENCE as REFERENCE
from bellcrank.actuators.copper import resistance_factor as resistance_factor
from bellcrank.actuators.product_arrays import MotorArrays
from bellcrank.arrays import Array
from bellcrank.numerics import floats


def friction_torque(motors: MotorArrays, speed: Array) -> Array:
    """The friction and iron torque T_c sign(ω) + c_v ω, N m; it has the sign of the speed (rad/s)."""
    return floats(motors.coulomb_torque * np.sign(speed) + motors.viscous_coefficient * speed)


def electrical_torque(motors: MotorArrays, torque: Array, speed: Array) -> Array:
    """The torque of the current T_e (N m) at a shaft torque (N m) and a speed (rad/s)."""
    return np.asarray(torque + friction_torque(motors, speed))


def friction_loss(motors: MotorArrays, speed: Array) -> Array:
    """Friction and iron loss T_c |ω| + c_v ω², W, at a speed (rad/s)."""
    return floats(friction_torque(motors, speed) * speed)


def loss_per_squared_torque(motors: MotorArrays) -> Array:
    """Copper loss at 25 °C over the squared electrical torque, R / k², W/(N m)²."""
    return np.asarray(motors.resistance / motors.dc_torque_constant**2)


def copper_loss(motors: MotorArrays, electrical_torque: Array, temperature: Array | float = REFERENCE) -> Array:
    """Copper loss R I², W, at an electrical torque (N m) and a winding temperature (°C)."""
    return np.asarray(loss_per_squared_torque(motors) * electrical_torque**2 * resistance_factor(temperature))


def voltage(
    motors: MotorArrays, electrical_torque: Array, speed: Array, temperature: Array | float = REFERENCE
) -> Array:
    """Voltage R I + k ω, V, at an electrical torque (N m), a speed (rad/s) and a winding temperature (°C)."""
    resistance = motors.resistance * resistance_factor(temperature)
    return np.asarray(resistance / motors.dc_torque_constant * electrical_torque + motors.dc_voltage_constant * speed)


def voltage_with_inductance(
    motors: MotorArrays, electrical_torque: Array, speed: Array, temperature: Array | float = REFERENCE
) -> Array:
    """Amplitude of the line-to-line voltage of a sinusoidal motor with its inductance, √((R I + k ω)² + (X ω I)²), V.

    The reactance X ω of the inductance takes a voltage a quarter period ahead of the current's. NaN where the motor is
    not sinusoidal, or its inductance or number of pole pairs is unknown. Without field weakening. (The voltage
    equations of a surface-magnet synchronous motor in rotor coordinates with i_d = 0.)
    """
    across = motors.reactance_per_speed * speed * electrical_torque / motors.dc_torque_constant
    return np.asarray(np.hypot(voltage(motors, electrical_torque, speed, temperature), across))


def electrical_power(
    motors: MotorArrays, electrical_torque: Array, speed: Array, temperature: Array | float = REFERENCE
) -> Array:
    """Power from the supply, R I² + T_e ω, W; negative where the motor gives power back."""
    return np.asarray(copper_loss(motors, electrical_torque, temperature) + electrical_torque * speed)


def usable_voltage(motors: MotorArrays, conditions: Conditions) -> Array:
    """The bus voltage (None: the motor's nominal voltage) less the reserve, V."""
    bus = (
        motors.nominal_voltage
        if conditions.voltage is None
        else np.full_like(motors.nominal_voltage, conditions.voltage)
    )
    return np.asarray(bus * (1.0 - conditions.voltage_reserve))
