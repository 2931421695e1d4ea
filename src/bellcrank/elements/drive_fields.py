"""Reads the drives of a scene: the entries of `actuators` with a `model`, by the figures of their motors and gears."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.actuator_fields import DRIVE_KEYS
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.copper import resistance_factor
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.product_arrays import MotorArrays
from bellcrank.actuators.short_time_limits import short_time_limits
from bellcrank.actuators.thermal import ThermalModel
from bellcrank.config.fields import Fields
from bellcrank.elements.controller import ControlContext, Controller
from bellcrank.elements.drives import LOSS, MODELS, Drive
from bellcrank.elements.dry_friction import LAWS
from bellcrank.elements.element import NONNEGATIVE, POSITIVE, joint_named, joint_unit, number
from bellcrank.elements.servo_fields import read_servo
from bellcrank.robot.robot import Robot, RobotJoint

PER_AMPLITUDE = {"phase_peak": 1.0, "phase_rms": 1.0 / math.sqrt(2.0)}  # torque constants, over the basis
RIGID = "rigid"  # in place of a stiffness
LEAST_RATIO = 1e-9  # of a gear, whose square occurs


def read_drives(
    read: Fields,
    actuators: Mapping[str, Actuator],
    robot: Robot,
    context: ControlContext,
    sticking: Sequence[str],
    control: Sequence[Controller],
    names: Sequence[str],
) -> tuple[Drive, ...]:
    """The drives of the entries of `actuators` that have a `model`.

    `sticking` are the joints with dry friction of their own; `control` the scene's controllers; `names` are those of
    its forces. Raises InputError.
    """
    entries, found = read.mapping("actuators", {}), []
    for name in entries:
        entry = entries.mapping(name)
        if "model" not in entry:
            for key in DRIVE_KEYS[1:]:
                if key in entry:
                    raise entry.error(
                        key, f"'{key}' describes a drive in a simulation, which needs 'model' ({' or '.join(MODELS)})"
                    )
            continue
        joint = joint_named(entries, name, name, robot)
        drive = _drive(entry, joint, actuators[name], context)
        if not drive.has_own_rotor and drive.friction is not None and name in sticking:
            raise entry.error(
                "model",
                f"joint '{name}' has dry_friction or a brake, and the rotor's friction acts there too, since the "
                "gear is rigid; write elastic"
                + ("" if drive.loses_by_load else ", or rotor_friction: none and add the two"),
            )
        for taken in names:
            if taken in (drive.name, f"rotor_friction_{name}", f"gear_contact_{name}"):
                raise entry.error("model", f"the name '{taken}' is taken by a force; give the force another name")
        for part in control:
            if name in [each.name for each in part.joints]:
                raise entry.error(
                    "servo", f"control '{part.name}' acts at joint '{name}' too, past the motor; remove one of the two"
                )
        found.append(drive)
    return tuple(found)


def _drive(entry: Fields, joint: RobotJoint, actuator: Actuator, context: ControlContext) -> Drive:
    model = entry.choice("model", MODELS)
    motor, gear = actuator.rows
    conditions = actuator.conditions
    numbers = _gear_numbers(entry, joint, motor, gear)
    loss, law = _friction_numbers(entry, motor)
    circuit = _torque_limits(motor, conditions) if model == "torque" else _circuit(entry, model, motor, conditions)
    curve = tuple(motor.peak_curve or ()) if model == "torque" else ()
    heat = _temperatures(entry, model, motor, conditions)
    if heat:
        circuit["resistance"] /= float(resistance_factor(conditions.winding_temperature))
    servo, command = read_servo(entry, joint, model, context)
    name = f"drive_{joint.name}"
    return Drive(name, entry, (joint,), None, model, numbers, loss, law, circuit, curve, servo, command, heat)


def _temperatures(entry: Fields, model: str, motor: Motor, conditions: Conditions) -> dict[str, float]:
    """The figures of the two thermal bodies, and their temperatures at the start; none without `temperatures`."""
    if "temperatures" not in entry:
        return {}
    if model == "torque":
        raise entry.error("temperatures", "temperatures require the currents of model: dc or dq")
    read = entry.mapping("temperatures")
    read.only(("winding", "housing"))
    start = {key: number(read, key, "°C", conditions.ambient) for key in ("winding", "housing")}
    read.done()
    model_of = ThermalModel.of(MotorArrays.of((motor,)), conditions)
    figures = {
        key: float(getattr(model_of, key)[0])
        for key in (
            "winding_capacity",
            "housing_capacity",
            "winding_resistance",
            "housing_resistance",
            "friction_share",
        )
    }
    if not all(math.isfinite(value) for value in figures.values()):
        raise entry.error(
            "temperatures",
            "temperatures require motor.resistance_winding_housing, resistance_housing_ambient, time_constant_winding, "
            "time_constant_motor and what share of the friction heats the housing; state or assume them",
        )
    return figures | {"ambient": conditions.ambient} | start


def _circuit(entry: Fields, model: str, motor: Motor, conditions: Conditions) -> dict[str, float]:
    """The figures of the windings and of the supply."""

    def stated(key: str, value: float | None) -> float:
        if value is None:
            raise entry.error(
                "model", f"model: {model} requires 'motor.{key}', which is not stated; state or assume it"
            )
        return value

    bus = motor.nominal_voltage if conditions.voltage is None else conditions.voltage
    hot = float(resistance_factor(conditions.winding_temperature))
    resistance = stated("resistance", motor.resistance) * hot
    inductance = stated("inductance", motor.inductance)
    if model == "dc":
        found = {
            "resistance": resistance,
            "inductance": inductance,
            "torque_constant": stated("torque_constant", motor.dc_torque_constant),
            "voltage_constant": stated("torque_constant", motor.dc_voltage_constant),
        } | ({} if bus is None else {"voltage": bus})
        return found | ({} if motor.peak_electrical_torque is None else {"peak_torque": motor.peak_electrical_torque})
    if motor.torque_constant_basis not in PER_AMPLITUDE:
        raise entry.error(
            "model",
            "model: dq requires a torque constant per phase current: torque_constant_basis phase_rms or phase_peak",
        )
    share = PER_AMPLITUDE[motor.torque_constant_basis]
    constant = stated("torque_constant", motor.torque_constant) * share
    inside = motor.ratio or 1.0 if motor.kind == "actuator" else 1.0
    found = {
        "resistance": 0.5 * resistance,
        "inductance": 0.5 * inductance,
        "torque_constant": constant,
        "pole_pairs": stated("pole_pairs", motor.pole_pairs) * inside,
    } | ({} if bus is None else {"voltage": bus / math.sqrt(3.0)})
    if motor.peak_current is not None:
        most = motor.peak_current / share
        found |= {"peak_current": most, "peak_torque": constant * most}
    return found


def _gear_numbers(entry: Fields, joint: RobotJoint, motor: Motor, gear: Gear) -> dict[str, float]:
    ratio = 1.0 if gear.ratio is None else gear.ratio
    if not LEAST_RATIO <= ratio <= 1.0 / LEAST_RATIO:
        raise entry.error("model", f"expected a ratio of {LEAST_RATIO:g} to {1.0 / LEAST_RATIO:g}, found {ratio:g}")
    if "elastic" not in entry:
        if gear.efficiency is None:
            return {"ratio": ratio}
        if gear.driven_efficiency == 0.0:
            raise entry.error(
                "model",
                "a gear that locks itself (back_efficiency: 0) requires 'elastic': behind a rigid one the equations of "
                "motion may have no solution",
            )
        assert gear.driven_efficiency is not None
        return {"ratio": ratio, "efficiency": gear.efficiency, "back_efficiency": gear.driven_efficiency}
    elastic = entry.mapping("elastic")
    if elastic.raw("stiffness", None) == RIGID:
        return {"ratio": ratio, **_rigid_backlash(elastic, joint, gear), **_own_rotor(entry, motor, gear)}
    elastic.only(("stiffness", "damping", "backlash", "hysteresis"))
    if "stiffness" in elastic or gear.stiffness is None:
        stiffness = number(elastic, "stiffness", joint_unit(joint, "stiffness"), bound=POSITIVE)
    else:
        stiffness = gear.stiffness
    damping = number(elastic, "damping", joint_unit(joint, "damping"), bound=NONNEGATIVE)
    backlash = number(elastic, "backlash", joint_unit(joint, "position"), gear.backlash or 0.0, NONNEGATIVE)
    hysteresis = _hysteresis(elastic, joint, backlash) if "hysteresis" in elastic else {}
    elastic.done()
    rotor = _own_rotor(entry, motor, gear)
    if gear.efficiency is None:
        raise entry.error("elastic", "an elastic gear requires gear.efficiency; state or assume it")
    assert gear.driven_efficiency is not None
    return {"ratio": ratio, "stiffness": stiffness, "damping": damping, "backlash": backlash, **rotor,
            "efficiency": gear.efficiency, "back_efficiency": gear.driven_efficiency, **hysteresis}  # fmt: skip


def _own_rotor(entry: Fields, motor: Motor, gear: Gear) -> dict[str, float]:
    """The inertia of a rotor that turns by itself."""
    missing = [key for key, value in (("motor.rotor_inertia", motor.rotor_inertia), ("gear.inertia", gear.inertia))
               if value is None]  # fmt: skip
    if missing:
        raise entry.error("elastic", f"an elastic gear requires {' and '.join(missing)}; state or assume it")
    assert motor.rotor_inertia is not None and gear.inertia is not None
    inertia = motor.rotor_inertia + gear.inertia
    if not inertia > 0.0:
        raise entry.error(
            "elastic", "behind an elastic gear the rotor turns by itself; give it an inertia of more than 0"
        )
    return {"inertia": inertia}


def _rigid_backlash(elastic: Fields, joint: RobotJoint, gear: Gear) -> dict[str, float]:
    """The gap of a rigid gear, and the restitution of its flanks."""
    elastic.only(("stiffness", "backlash", "restitution"))
    backlash = number(elastic, "backlash", joint_unit(joint, "position"), gear.backlash or 0.0, NONNEGATIVE)
    if not backlash:
        raise elastic.error(
            "backlash", "a rigid gear without backlash has no 'elastic'; give its backlash, or remove it"
        )
    restitution = number(elastic, "restitution", "", 0.0, NONNEGATIVE)
    if restitution > 1.0:
        raise elastic.error("restitution", f"expected 0 to 1, found {restitution:g}")
    elastic.done()
    return {"backlash": backlash, "restitution": restitution}


def _hysteresis(elastic: Fields, joint: RobotJoint, backlash: float) -> dict[str, float]:
    if backlash:
        raise elastic.error("hysteresis", "a gear with backlash has no hysteresis here; write backlash: 0 or remove it")
    read = elastic.mapping("hysteresis")
    read.only(("torque", "stiffness"))
    found = {
        f"hysteresis_{key}": number(read, key, joint_unit(joint, key), bound=POSITIVE)
        for key in ("torque", "stiffness")
    }
    read.done()
    return found


def _friction_numbers(entry: Fields, motor: Motor) -> tuple[dict[str, float], str]:
    """The friction of the rotor: `rotor_friction`, or that of the motor."""
    given = entry.raw("rotor_friction", None)
    if isinstance(given, str):
        entry.choice("rotor_friction", ("none",))
        return {"coulomb": 0.0, "static": 0.0, "speed": 1.0, "viscous": 0.0}, LAWS[0]
    if given is None:
        coulomb, viscous = motor.coulomb_torque, motor.viscous_coefficient
        if coulomb is None or viscous is None:
            raise entry.error(
                "model",
                "a drive requires the motor's friction, which is not stated; state motor.coulomb_friction and "
                "motor.viscous_friction, or write rotor_friction {coulomb, viscous} or none",
            )
        return {"coulomb": coulomb, "static": coulomb, "speed": 1.0, "viscous": viscous}, LAWS[0]
    read = entry.mapping("rotor_friction")
    read.only((*LOSS, "law"))
    coulomb = number(read, "coulomb", "N m", bound=NONNEGATIVE)
    static = number(read, "static", "N m", coulomb, NONNEGATIVE)
    if static < coulomb:
        raise read.error("static", f"expected at least 'coulomb', {coulomb:g}, found {static:g}")
    if "static" in read and static > coulomb and "speed" not in read:
        raise read.error("static", "'static' requires 'speed', over which friction falls from it to 'coulomb'")
    found = {"coulomb": coulomb, "static": static, "speed": number(read, "speed", "rad/s", 1.0, POSITIVE),
             "viscous": number(read, "viscous", "N m s/rad", 0.0, NONNEGATIVE)}  # fmt: skip
    law = read.choice("law", LAWS, LAWS[0])
    read.done()
    return found, law


def _torque_limits(motor: Motor, conditions: Conditions) -> dict[str, float]:
    """a and b of each known limit |a T + b ω| ≤ 1 that bounds the torque."""
    found = dict[str, float]()
    for limit in short_time_limits(MotorArrays.of((motor,)), conditions):
        a, b = float(limit.torque[0]), float(limit.speed[0])
        if math.isfinite(a) and math.isfinite(b) and a > 0.0:
            k = len(found) // 2
            found |= {f"a{k}": a, f"b{k}": b}
    return found


def separate_rotors(fields: Fields) -> tuple[str, ...]:
    """The joints whose rotor has states of its own, so that its inertia is not the joint's. Raises InputError."""
    entries = fields.mapping("actuators", {})
    return tuple(name for name in entries if {"model", "elastic"} <= {*entries.mapping(name)})
