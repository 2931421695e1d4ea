"""All checks of motors against themselves: electrical ones, the order of limits, heat, and figures in wrong units."""

from __future__ import annotations

import math

from bellcrank.actuators.catalogue.consistency_check import Check, order, plausible, product_of, quotient
from bellcrank.actuators.catalogue.motor_electrical_checks import ELECTRICAL_CHECKS
from bellcrank.actuators.motor import Motor

_DENSITY = 6000.0  # kg/m³, of motors as a whole: between aluminium and copper


def _acceleration_time(motor: Motor) -> float | None:
    torque = motor.peak_torque or motor.stall_torque
    speed = motor.no_load_speed or motor.max_speed or motor.nominal_speed or None
    return quotient(product_of(1000.0, motor.rotor_inertia, speed), torque)


def _gyration(motor: Motor) -> float | None:
    """Radius of gyration of the rotor, with its inertia before a gear inside, against the size of the motor's mass."""
    inertia, mass = motor.rotor_inertia, motor.mass
    if inertia is None or mass is None or (motor.kind == "actuator" and motor.ratio is None):
        return None
    return quotient(math.sqrt(inertia / mass) / (motor.ratio or 1.0), math.cbrt(mass / _DENSITY))


def _torque_of_shaft(motor: Motor) -> float | None:
    return None if motor.kind == "actuator" else quotient(motor.nominal_torque or motor.peak_torque, motor.mass)


def _torque_of_output(motor: Motor) -> float | None:
    torque = motor.nominal_torque or motor.peak_torque or motor.stall_torque
    return quotient(torque, motor.mass) if motor.kind == "actuator" else None


def _fastest(motor: Motor) -> float | None:
    speeds = [one for one in (motor.nominal_speed, motor.no_load_speed, motor.max_speed) if one]
    return max(speeds) * (motor.ratio or 1.0) if speeds else None


def _heat_capacity_per_mass(motor: Motor) -> float | None:
    return quotient(quotient(motor.time_constant_motor, motor.resistance_housing_ambient), motor.mass)


def _heat_capacities(motor: Motor) -> tuple[float | None, float | None]:
    winding = quotient(motor.time_constant_winding, motor.resistance_winding_housing)
    return winding, quotient(motor.time_constant_motor, motor.resistance_housing_ambient)


def _nominal_power_per_mass(motor: Motor) -> float | None:
    return quotient(product_of(motor.nominal_torque, motor.nominal_speed or None), motor.mass)


MOTOR_CHECKS: tuple[Check[Motor], ...] = (
    *ELECTRICAL_CHECKS,
    order("nominal_torque", "peak_torque", "N m"),
    order("nominal_torque", "stall_torque", "N m"),
    order("nominal_current", "peak_current", "A"),
    order("nominal_current", "stall_current", "A"),
    order("no_load_current", "nominal_current", "A"),
    order("nominal_speed", "no_load_speed", "rad/s", most=1.02),
    order("nominal_speed", "max_speed", "rad/s"),
    order("time_constant_winding", "time_constant_motor", "s"),
    order("max_housing_temperature", "max_winding_temperature", "°C"),
    Check(
        name="heat capacities",
        formula="τ_1 / R_th2 <= τ_2 / R_th1",
        source="definition: the winding is a part of the motor",
        figures=_heat_capacities,
        unit="J/K",
        most=1.0,
        reason="by definition",
        advice="were the two thermal resistances exchanged?",
    ),
    plausible(
        "heat capacity per mass",
        "τ_2 / (R_th1 m), in J/(kg K), which is 385 for copper, 460 for steel and 900 for aluminium",
        _heat_capacity_per_mass,
        (100.0, 3000.0),
        "check mass, time constant of the motor and thermal resistance to ambient",
    ),
    plausible(
        "winding temperature",
        "largest winding temperature, in °C (insulation classes of IEC 60085 reach 250 °C)",
        lambda motor: motor.max_winding_temperature,
        (60.0, 260.0),
        "is it in °F?",
    ),
    plausible(
        "time to accelerate",
        "J ω / M, in ms, with the no-load or largest speed and the peak or stall torque",
        _acceleration_time,
        (0.5, 2000.0),
        "check the inertia: its unit, and whether it is before the gear inside or at the output",
    ),
    plausible(
        "inertia and mass",
        "√(J / m) over (m / 6000 kg/m³)^(1/3), the rotor's radius of gyration over the motor's size",
        _gyration,
        (0.03, 1.0),
        "check the inertia: its unit, and whether it is before the gear inside or at the output",
    ),
    plausible(
        "torque per mass",
        "nominal (or peak) torque over mass, in N m/kg",
        _torque_of_shaft,
        (0.01, 50.0),
        "check the units of torque and mass",
    ),
    plausible(
        "output torque per mass",
        "nominal (or peak, or stall) torque over mass, in N m/kg",
        _torque_of_output,
        (0.5, 500.0),
        "check the units of torque and mass",
    ),
    plausible(
        "power per mass",
        "M_N ω_N / m, in W/kg",
        _nominal_power_per_mass,
        (2.0, 20000.0),
        "check the units of torque, speed and mass",
    ),
    plausible("rotor speed", "largest stated speed of the rotor, in rad/s", _fastest, (3.0, 20000.0), "check its unit"),
    plausible(
        "electrical time constant",
        "L / R, in s",
        lambda motor: quotient(motor.inductance, motor.resistance),
        (5e-6, 0.1),
        "check the units of inductance and resistance",
    ),
    plausible("backlash", "backlash, in rad", lambda motor: motor.backlash, (0.0, 0.2), "is it in arcmin or degrees?"),
)
