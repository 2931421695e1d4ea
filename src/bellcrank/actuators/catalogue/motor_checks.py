"""All checks of motors against themselves: figures that follow from each other, the order of limits, heat, friction.

U is the nominal voltage, R the line-to-line resistance, k the torque constant of the DC-equivalent motor, k_t that on
its own basis, k_n the speed constant, J the inertia of the rotor, I_0, I_N and I_S the currents at no load, at the
nominal point and at standstill, M_N, M_P and M_S the nominal, peak and stall torque.
"""

from __future__ import annotations

import math

from bellcrank.actuators.catalogue.product_checks import Check, order, plausible, product_of, quotient
from bellcrank.actuators.copper import COPPER, REFERENCE
from bellcrank.actuators.motor import Motor

Figures = tuple[float | None, float | None]
_MAXON = "maxon, key information on motor data"
_LINE = "the DC-equivalent motor, U = R I + k ω, M = k I"
_ROUNDING = "printed figures have two to four digits"
_TORQUE_TOLERANCE = "makers state torque constants to within 10 %"
_DENSITY = 6000.0  # kg/m³, of motors as a whole: between aluminium and copper


def _stall_current(motor: Motor) -> Figures:
    return quotient(motor.nominal_voltage, motor.resistance), motor.stall_current


def _stall_torque(motor: Motor) -> Figures:
    current = motor.stall_current or quotient(motor.nominal_voltage, motor.resistance)
    return product_of(motor.dc_torque_constant, current), motor.stall_torque


def _time_constant(motor: Motor) -> Figures:
    k = motor.dc_torque_constant
    return quotient(product_of(motor.rotor_inertia, motor.resistance), product_of(k, k)), motor.mechanical_time_constant


def _constants(motor: Motor) -> Figures:
    return product_of(motor.dc_torque_constant, motor.speed_constant), 1.0


def _constants_of_unknown_basis(motor: Motor) -> Figures:
    return None if motor.torque_constant_basis else product_of(motor.torque_constant, motor.speed_constant), 1.0


def _no_load_speed(motor: Motor) -> Figures:
    voltage = motor.nominal_voltage
    if voltage is not None and motor.resistance is not None and motor.no_load_current is not None:
        voltage -= motor.resistance * motor.no_load_current
    return motor.no_load_speed, quotient(voltage, motor.dc_voltage_constant)


def _speed_constant(motor: Motor) -> Figures:
    return motor.no_load_speed, product_of(motor.nominal_voltage, motor.speed_constant)


def _nominal_current(motor: Motor) -> Figures:
    basis = motor.torque_constant_basis
    return motor.nominal_torque, product_of(motor.torque_constant, motor.nominal_current) if basis else None


def _peak_current(motor: Motor) -> Figures:
    basis = motor.torque_constant_basis
    return motor.peak_torque, product_of(motor.torque_constant, motor.peak_current) if basis else None


def _voltage_at_nominal_point(motor: Motor) -> Figures:
    """The voltage line at the nominal current, converted to that of the DC-equivalent motor."""
    k, basis_k = motor.dc_torque_constant, motor.torque_constant
    if k is None or basis_k is None or motor.resistance is None or motor.nominal_current is None:
        return None, None
    if motor.nominal_voltage is None:
        return None, None
    left = motor.nominal_voltage - motor.resistance * motor.nominal_current * basis_k / k
    return motor.nominal_speed, quotient(left, motor.dc_voltage_constant)


def _thermal_current(motor: Motor) -> Figures:
    """Nominal current against that which alone heats the winding to its limit; both of the DC-equivalent motor."""
    parts = (motor.resistance_winding_housing, motor.resistance_housing_ambient, motor.resistance)
    hottest, k = motor.max_winding_temperature, motor.dc_torque_constant
    if None in parts or hottest is None or k is None or motor.torque_constant is None:
        return None, None
    winding, housing, resistance = (part or 0.0 for part in parts)
    rise = hottest - (REFERENCE if motor.reference_temperature is None else motor.reference_temperature)
    hot = resistance * (1.0 + COPPER * (hottest - REFERENCE))
    heat = quotient(rise, (winding + housing) * hot)
    current = product_of(motor.nominal_current, motor.torque_constant / k)
    return current, None if heat is None or heat <= 0.0 else math.sqrt(heat)


def _nominal_power(motor: Motor) -> Figures:
    """Shaft power against the largest electrical power that the voltage and current allow (any basis of current)."""
    factor = 1.0 if motor.torque_constant_basis == "dc" else math.sqrt(1.5)  # √(3/2) U I_rms, an amplitude U
    return product_of(motor.nominal_torque, motor.nominal_speed), product_of(
        factor, motor.nominal_voltage, motor.nominal_current
    )


def _max_efficiency(motor: Motor) -> Figures:
    share = quotient(motor.no_load_current, motor.stall_current)
    return motor.max_efficiency, None if share is None or share >= 1.0 else (1.0 - math.sqrt(share)) ** 2


ELECTRICAL_CHECKS: tuple[Check[Motor], ...] = (
    Check(
        name="stall current",
        formula="U / R = I_S",
        source="Ohm's law at standstill",
        figures=_stall_current,
        unit="A",
        least=0.95,
        most=1.05,
        reason=_ROUNDING,
        advice="one of nominal voltage, resistance (line to line, at 25 °C) and stall current is of another winding",
    ),
    Check(
        name="stall torque",
        formula="k I_S = M_S",
        source=_LINE,
        figures=_stall_torque,
        unit="N m",
        least=0.9,
        most=1.1,
        reason=f"{_TORQUE_TOLERANCE}; friction and iron saturation at the stall current are within that",
        advice="check the basis of the torque constant (factors 1.15 and 0.82), stall torque and current",
    ),
    Check(
        name="mechanical time constant",
        formula="J R / k² = mechanical time constant",
        source=_MAXON,
        figures=_time_constant,
        unit="s",
        least=0.95,
        most=1.05,
        reason=f"{_ROUNDING}; resistances at 22 °C and 25 °C differ by 1.2 %",
        advice="check the inertia (its unit, and the side of a gear that it refers to), resistance and torque constant",
    ),
    Check(
        name="torque and speed constant",
        formula="k k_n = 1",
        source="power balance: the back-EMF per speed is the torque per current",
        figures=_constants,
        least=0.97,
        most=1.03,
        reason=_ROUNDING,
        advice="check the basis of the torque constant: RMS or amplitude of the phase current, or direct current",
    ),
    Check(
        name="torque and speed constant, basis unknown",
        formula="k_t k_n, which is 0.87, 1 or 1.22 for the three bases",
        source="power balance; √3/2 for the amplitude, √(3/2) for the RMS value of the phase current",
        figures=_constants_of_unknown_basis,
        least=0.4,
        most=1.29,
        reason="5 % of rounding above the largest; below, the torque of an actuator's output has lost half in its gear",
        advice="no basis explains both constants",
    ),
    Check(
        name="no-load speed",
        formula="no-load speed = (U - R I_0) / k",
        source=_LINE,
        figures=_no_load_speed,
        unit="rad/s",
        least=0.9,
        most=1.12,
        reason="iron losses reduce the speed; commutation ahead of the rotor raises it by up to 9 % (Faulhaber BP4)",
        advice="check the nominal voltage, the no-load speed and the basis of the torque constant",
    ),
    Check(
        name="speed constant",
        formula="no-load speed = U k_n",
        source=_LINE,
        figures=_speed_constant,
        unit="rad/s",
        least=0.85,
        most=1.1,
        reason="friction and the no-load current reduce the speed; constants of models' names are rounded",
        advice="check nominal voltage, no-load speed and speed constant",
    ),
    Check(
        name="nominal torque and current",
        formula="M_N = k_t I_N",
        source=_LINE,
        figures=_nominal_current,
        unit="N m",
        least=0.75,
        most=1.1,
        reason=f"{_TORQUE_TOLERANCE}; friction, iron losses and warm magnets take up to 25 %",
        advice="check the basis of the torque constant and of the current",
    ),
    Check(
        name="peak torque and current",
        formula="M_P = k_t I_peak",
        source=_LINE,
        figures=_peak_current,
        unit="N m",
        least=0.5,
        most=1.1,
        reason=f"{_TORQUE_TOLERANCE}; saturation takes up to half",
        advice="check the basis of the torque constant and of the current",
    ),
    Check(
        name="nominal point below the voltage line",
        formula="nominal speed <= (U - R I_N) / k",
        source=_LINE,
        figures=_voltage_at_nominal_point,
        unit="rad/s",
        most=1.12,
        reason="as for the no-load speed",
        advice="the nominal point cannot be reached at the nominal voltage",
    ),
    Check(
        name="thermal limit of the current",
        formula="I_N <= √(ΔT / ((R_th1 + R_th2) R (1 + α (T_max - 25 °C))))",
        source="steady state of the two thermal resistances with copper loss alone",
        figures=_thermal_current,
        unit="A",
        most=1.1,
        reason="thermal resistances are printed with two digits; friction and iron loss only lower the left side",
        advice="the nominal current heats the winding beyond its limit: check thermal resistances and temperatures",
    ),
    Check(
        name="efficiency at the nominal point",
        formula="M_N ω_N <= U I_N (√(3/2) U I_N unless the current is direct)",
        source="power balance",
        figures=_nominal_power,
        unit="W",
        most=0.97,
        reason="no motor of this size has more than 97 %",
        advice="check nominal torque, speed, voltage and current; are they of one operating point?",
    ),
    Check(
        name="largest efficiency",
        formula="largest efficiency = (1 - √(I_0 / I_S))²",
        source=_MAXON,
        figures=_max_efficiency,
        least=0.93,
        most=1.07,
        reason="both currents are printed with two to three digits",
        advice="check no-load current, stall current and efficiency",
    ),
)


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
