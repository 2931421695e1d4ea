"""The continuous (S1) torque over speed, derated for ambient temperature and altitude.

In this order: the curve that the maker prints (unknown beyond its end, unless it ends at 0 or the speed is not
permitted); the nominal torque up to the nominal speed; above it the thermal limit
from both thermal resistances, which counts up to the nominal torque. Without a nominal torque it is the thermal limit;
without the thermal figures it is unknown above the nominal speed. Where the nominal torque is reduced for the ambient
temperature or the altitude, and the thermal limit there is less, the thermal limit counts.

Thermal limit: with the copper loss P_cu at the largest winding temperature and the heat P_f(ω) of friction and iron in
the housing (`Motor.friction_heat_share`), T_h = T_a + R_ha (P_cu + P_f) and T_w = T_h + R_wh P_cu. The largest P_cu
that is permitted gives T_e = k √(P_cu / R(T_w)), and the shaft torque is T_e less friction. (Two thermal resistances:
maxon's motor data; the resistance rise in the limit: derived here.)

Altitude: in thin air both thermal resistances are taken larger by 1/f, f the permitted temperature rise of IEC 60034-1
over that up to 1000 m. Printed torques are reduced by f (T_max - T_a) / (T_max - T_ref), in proportion to the
temperature rise. Copper loss alone would give the root of it; the proportional reduction r is on the safe side as long
as friction and iron losses are less than r / (1 + r) of the heat, nearly a half. An ambient temperature below the
reference, or a site below 1000 m, raises no printed torque.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.copper import resistance_factor
from bellcrank.actuators.electrical import friction_loss, friction_torque, loss_per_squared_torque
from bellcrank.actuators.motor import UNSTATED_REFERENCE, Motor
from bellcrank.actuators.product_arrays import MotorArrays
from bellcrank.arrays import Array
from bellcrank.numerics import floats

SOURCES = ("unknown", "printed curve", "thermal limit", "nominal torque")


class ContinuousTorque(NamedTuple):
    """Continuous torque of many motors.

    Attributes:
        torque: Shaft torque, N m; NaN where unknown.
        source: Index into `SOURCES` of what it comes from.
    """

    torque: Array
    source: NDArray[np.int8]


def continuous_torque(motors: MotorArrays, speed: Array | float, conditions: Conditions) -> ContinuousTorque:
    """The continuous torque at the shaft at a speed.

    Args:
        motors: The motors.
        speed: Speed of the shaft, rad/s, of either sign; it broadcasts with the motors.
        conditions: Ambient temperature and altitude.

    Returns:
        The torque and where it comes from.

    Example:
        >>> from bellcrank.actuators.conditions import Conditions
        >>> from bellcrank.actuators.continuous_torque import SOURCES, continuous_torque
        >>> from bellcrank.actuators.motor import UNSTATED_REFERENCE, Motor
        >>> from bellcrank.actuators.product_arrays import MotorArrays
        >>> motor = Motor(id="m", maker="", model="", nominal_torque=1.27, nominal_speed=314.0)
        >>> found = continuous_torque(MotorArrays.of([motor]), 100.0, Conditions())
        >>> float(found.torque[0]), SOURCES[found.source[0]]
        (1.27, 'nominal torque')
    """
    speed = np.abs(floats(speed))
    derating = printed_torque_factor(motors, conditions)
    curve = _printed_curve(motors, speed) * derating
    printed = motors.nominal_torque * derating
    thermal = thermal_limit_torque(motors, speed, conditions)
    up_to_nominal = (speed <= motors.nominal_speed) | (speed == 0.0)
    by_nominal = up_to_nominal & (np.isnan(thermal) | (derating == 1.0)) & ~np.isnan(printed)
    by_thermal = np.where(np.isnan(thermal), np.nan, np.fmin(thermal, printed))
    has_curve = motors.continuous_curve.known
    torque = np.where(has_curve, curve, np.where(by_nominal, printed, by_thermal))
    source = np.where(has_curve, 1, np.where(torque == thermal, 2, 3)) * ~np.isnan(torque)
    return ContinuousTorque(torque, source.astype(np.int8))


def _printed_curve(motors: MotorArrays, speed: Array) -> Array:
    """The torque of the printed curve at speeds of 0 or more, N m; beyond its end unknown.

    It is 0 there where the curve ends at 0, and above the largest permitted speed.
    """
    curve = motors.continuous_curve
    last = curve.last_x
    stopped = (curve.at(last) == 0.0) | (speed > motors.max_speed)
    return np.where((speed > last) & ~stopped, np.nan, curve.at(speed, beyond=0.0))


def thermal_limit_torque(motors: MotorArrays, speed: Array | float, conditions: Conditions) -> Array:
    """The shaft torque that heats the winding to its largest temperature in the end, N m; 0 where friction alone does.

    The housing's largest temperature limits it too where it is stated.

    Args:
        motors: The motors.
        speed: Speed of the shaft, rad/s; it broadcasts with the motors.
        conditions: Ambient temperature and altitude.

    Returns:
        Torque, N m; NaN where a figure is unknown.
    """
    speed = np.abs(floats(speed))
    winding = motors.resistance_winding_housing / conditions.altitude_factor
    housing = motors.resistance_housing_ambient / conditions.altitude_factor
    loss = motors.friction_heat_share * friction_loss(motors, speed)
    copper = (motors.max_winding_temperature - conditions.ambient - housing * loss) / (winding + housing)
    copper = np.fmin(copper, (motors.max_housing_temperature - conditions.ambient) / housing - loss + 0.0 * copper)
    heat_per_squared_torque = loss_per_squared_torque(motors) * resistance_factor(motors.max_winding_temperature)
    electrical = np.sqrt(np.maximum(copper, 0.0) / heat_per_squared_torque)
    return np.maximum(electrical - friction_torque(motors, speed), 0.0)


def printed_torque_factor(motors: MotorArrays, conditions: Conditions) -> Array:
    """What remains of a printed continuous torque at the conditions' ambient temperature and altitude.

    Args:
        motors: The motors.
        conditions: Ambient temperature and altitude.

    Returns:
        A factor of at most 1; NaN where the ambient temperature is above the reference and the largest winding
        temperature is unknown. A reference temperature that is not stated counts as 25 °C.
    """
    stated = motors.reference_temperature
    reference = np.where(np.isnan(stated), UNSTATED_REFERENCE, stated)
    rise = np.maximum(motors.max_winding_temperature - conditions.ambient, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.clip(rise / (motors.max_winding_temperature - reference), 0.0, 1.0)
    return conditions.altitude_factor * np.where(conditions.ambient <= reference, 1.0, factor)


def continuous_torque_text(motor: Motor, speed: float, conditions: Conditions) -> str:
    """The continuous torque of one motor in words, with where it comes from and what was assumed.

    Args:
        motor: The motor.
        speed: Speed of the shaft, rad/s.
        conditions: Ambient temperature and altitude.

    Returns:
        A clause such as "0.0286 N m (nominal torque, derated by 0.9)".
    """
    motors = MotorArrays.of([motor])
    found = continuous_torque(motors, speed, conditions)
    torque, source = float(found.torque[0]), SOURCES[int(found.source[0])]
    if source == "unknown":
        return f"unknown ({_lacking(motor, speed, conditions)})"
    if source == "nominal torque" and motor.nominal_torque is None:
        source = "nominal current"
    if motor.by_ratings:
        return f"{torque:.4g} N m"
    factor = float(printed_torque_factor(motors, conditions)[0])
    if source == "thermal limit":
        derated = f" at {conditions.ambient:g} °C" + (
            f", {conditions.altitude:g} m" if conditions.altitude_factor < 1 else ""
        )
    else:
        derated = f", derated by {factor:.3g}" if factor < 1.0 else ""
        if motor.reference_temperature is None:
            derated += f"; its reference temperature is not stated, {UNSTATED_REFERENCE:g} °C is assumed"
    return f"{torque:.4g} N m ({source}{derated})"


def _lacking(motor: Motor, speed: float, conditions: Conditions) -> str:
    """What a motor does not state, so that its continuous torque at a speed is unknown."""
    reference = UNSTATED_REFERENCE if motor.reference_temperature is None else motor.reference_temperature
    if motor.continuous_curve is not None and abs(speed) > motor.continuous_curve[-1][0]:
        return f"the printed curve ends at {motor.continuous_curve[-1][0]:.4g} rad/s, below {abs(speed):.4g} rad/s"
    if motor.continuous_torque is None and motor.continuous_curve is None:
        return "neither a nominal torque nor the figures of the thermal limit are stated"
    if motor.max_winding_temperature is None and conditions.ambient > reference:
        return f"the ambient temperature is above {reference:g} °C and the largest winding temperature is not stated"
    if motor.nominal_speed is None:
        return "the speed of the nominal torque is not stated"
    return (
        f"{speed:.4g} rad/s is above the nominal speed, {motor.nominal_speed:.4g} rad/s, and figures of the thermal "
        "limit are not stated"
    )
