"""The columns of catalogue files: for each field of `Motor` and `Gear` its unit, its limits, or the texts allowed."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, fields
from typing import Literal, get_args

from bellcrank.actuators.gear import Gear, GearKind
from bellcrank.actuators.motor import Motor, MotorKind, TorqueConstantBasis
from bellcrank.arguments import LARGEST

Rule = Literal["positive", "nonnegative", "share", "whole", "temperature"]
ABSOLUTE_ZERO = -273.15  # °C
LINEAR_KINDS = ("screw", "rack")  # gears whose output moves along a line
MOTOR_KINDS: tuple[str, ...] = get_args(MotorKind)
GEAR_KINDS: tuple[str, ...] = tuple(kind for kind in get_args(GearKind) if kind != "direct")
QUALITIES = (  # how near a row is to the maker, nearest first
    "datasheet",
    "manual",
    "product_page",
    "datasheet_transcription",
    "distributor_page",
    "measured",
    "secondary",
    "user",
)
SIDES = ("input", "output")
REQUIRED = ("id", "maker", "model", "kind")


@dataclass(frozen=True)
class Column:
    """One column: a number in a unit, or a text.

    Attributes:
        name: As the header names it.
        field: The field that it fills.
        unit: Unit of the field, as in config/units.py; None: a text.
        rule: Which numbers are allowed.
        choices: The texts allowed; empty: any.
        kinds: The kinds of product that have it; empty: all.
        convert: "" where the field holds the number itself, or how it follows: "2 pi / x", "1 / x" or "x ratio^2".
    """

    name: str
    field: str
    unit: str | None = None
    rule: Rule = "positive"
    _: KW_ONLY
    choices: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    convert: Literal["", "2 pi / x", "1 / x", "x ratio^2"] = ""

    @property
    def title(self) -> str:
        """The header's cell, such as "mass [kg]"."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def expected(self, value: float) -> str:
        """What is expected instead of a number; empty where it is allowed."""
        if self.rule == "whole" and (value < 1.0 or value != int(value)):
            return "a whole number of 1 or more"
        if self.rule == "share" and not 0.0 < value <= 1.0:
            return "more than 0 and at most 1 (100 %)"
        if self.rule == "positive" and value <= 0.0:
            return "more than 0; leave the cell empty where the value is unknown"
        if self.rule == "nonnegative" and value < 0.0:
            return "0 or more"
        if self.rule == "temperature" and value <= ABSOLUTE_ZERO:
            return f"a temperature above {ABSOLUTE_ZERO} °C"
        return f"at most {LARGEST:g}" if value > LARGEST else ""


_UNITS: dict[str, str] = {  # field -> unit, of motors and gears
    "nominal_voltage": "V",
    "torque_constant": "N m/A",
    "speed_constant": "rad/s/V",
    "resistance": "Ω",
    "inductance": "H",
    "pole_pairs": "",
    "stages": "",
    "no_load_current": "A",
    "nominal_current": "A",
    "peak_current": "A",
    "stall_current": "A",
    "viscous_friction": "N m s/rad",
    "rotor_inertia": "kg m^2",
    "inertia": "kg m^2",
    "peak_time": "s",
    "time_constant_winding": "s",
    "time_constant_motor": "s",
    "mechanical_time_constant": "s",
    "resistance_winding_housing": "K/W",
    "resistance_housing_ambient": "K/W",
    "max_winding_temperature": "°C",
    "max_housing_temperature": "°C",
    "reference_temperature": "°C",
    "ratio": "",
    "max_efficiency": "",
    "efficiency": "",
    "back_efficiency": "",
    "backlash": "rad",
    "lost_motion": "rad",
    "stiffness": "N m/rad",
    "life": "h",
    "life_exponent": "",
    "tilting_moment": "N m",
    "axial_load": "N",
    "mass": "kg",
    "diameter": "m",
    "length": "m",
    "shaft_diameter": "m",
    "input_shaft_diameter": "m",
    "price": "",
}
_RULES: dict[str, Rule] = {
    "pole_pairs": "whole",
    "stages": "whole",
    "max_efficiency": "share",
    "efficiency": "share",
    "back_efficiency": "share",
    "max_winding_temperature": "temperature",
    "max_housing_temperature": "temperature",
    "reference_temperature": "temperature",
}
_ZERO_ALLOWED = ("no_load_current", "friction", "inertia", "backlash", "lost_motion", "starting_torque", "inductance")
_CHOICES: dict[str, tuple[str, ...]] = {
    "torque_constant_basis": get_args(TorqueConstantBasis),
    "inertia_side": SIDES,
    "quality": QUALITIES,
}
CURVE_FIELDS = ("continuous_curve", "peak_curve", "efficiency_curve")  # in files of their own


def _unit(name: str) -> str | None:
    if name in _UNITS:
        return _UNITS[name]
    if name.endswith(("torque", "coulomb_friction")):
        return "N m"
    return "rad/s" if name.endswith("speed") else None


def _rule(name: str) -> Rule:
    if name in _RULES:
        return _RULES[name]
    return "nonnegative" if name.endswith(_ZERO_ALLOWED) or name == "nominal_speed" else "positive"


def _columns(product: type[Motor] | type[Gear], kinds: tuple[str, ...]) -> dict[str, Column]:
    choices = _CHOICES | {"kind": kinds}
    names = [one.name for one in fields(product) if one.name not in CURVE_FIELDS]
    return {name: Column(name, name, _unit(name), _rule(name), choices=choices.get(name, ())) for name in names}


def _motor_columns() -> dict[str, Column]:
    columns = _columns(Motor, MOTOR_KINDS)
    for name in ("ratio", "backlash"):
        columns[name] = Column(name, name, _unit(name), _rule(name), kinds=("actuator",))
    name = "rotor_inertia_before_gear"  # as makers of actuators print it
    columns[name] = Column(name, "rotor_inertia", "kg m^2", "nonnegative", kinds=("actuator",), convert="x ratio^2")
    return columns


def _gear_columns() -> dict[str, Column]:
    """Those of rotary gears; and those of screws and racks, whose output is a force and a length."""
    columns = _columns(Gear, GEAR_KINDS)
    rotary = tuple(kind for kind in GEAR_KINDS if kind not in LINEAR_KINDS)
    linear = {
        "rated_torque": ("rated_force", "N"),
        "average_torque": ("average_force", "N"),
        "repeated_peak_torque": ("repeated_peak_force", "N"),
        "momentary_torque": ("momentary_force", "N"),
        "stiffness": ("axial_stiffness", "N/m"),
        "backlash": ("axial_backlash", "m"),
        "lost_motion": ("axial_lost_motion", "m"),
    }
    for name, (other, unit) in linear.items():
        columns[name] = Column(name, name, _unit(name), _rule(name), kinds=rotary)
        columns[other] = Column(other, name, unit, _rule(name), kinds=LINEAR_KINDS)
    columns["ratio"] = Column("ratio", "ratio", "", kinds=rotary)
    columns["lead"] = Column("lead", "ratio", "m", kinds=("screw",), convert="2 pi / x")
    columns["pinion_radius"] = Column("pinion_radius", "ratio", "m", kinds=("rack",), convert="1 / x")
    return columns


MOTOR_COLUMNS = _motor_columns()
GEAR_COLUMNS = _gear_columns()
CURVE_COLUMNS = {  # of a file of curves, one row a point
    "id": Column("id", "id"),
    "curve": Column("curve", "curve", choices=CURVE_FIELDS),
    "speed": Column("speed", "speed", "rad/s", "nonnegative"),
    "torque": Column("torque", "torque", "N m", "nonnegative"),
    "load": Column("load", "load", "", "nonnegative"),
    "efficiency": Column("efficiency", "efficiency", "", "share"),
}
