"""The entry of an actuator in a robot configuration."""

from __future__ import annotations

from bellcrank.actuators.actuator import Actuator
from bellcrank.config.fields import Fields
from bellcrank.errors import InputError


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
