"""The columns of catalogue files: for each field of `Motor` and `Gear` its unit, its limits, or the texts allowed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, fields, replace
from typing import Literal, get_args

from bellcrank.actuators import gear, motor
from bellcrank.actuators.catalogue.product_checks import NOT_NEGATIVE, POSITIVE, SHARE, Range
from bellcrank.actuators.gear import LINEAR_KINDS, Gear, GearKind
from bellcrank.actuators.motor import Commutation, Motor, MotorKind, TorqueConstantBasis

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
        range: Which numbers are allowed.
        whole: Whether only whole numbers are.
        choices: The texts allowed; empty: any.
        kinds: The kinds of product that have it; empty: all.
        convert: "" where the field holds the number itself, or how it follows: "2 pi / x", "1 / x" or "x ratio^2".
    """

    name: str
    field: str
    unit: str | None = None
    range: Range = POSITIVE
    _: KW_ONLY
    whole: bool = False
    choices: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    convert: Literal["", "2 pi / x", "1 / x", "x ratio^2"] = ""

    @property
    def title(self) -> str:
        """The header's cell, such as "mass [kg]"."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def expected(self, value: float) -> str:
        """What is expected instead of a number; empty where it is allowed."""
        allowed = self.range
        if value > allowed.most:
            return f"at most {allowed.most:g}" + (" (100 %)" if allowed.most == 1.0 else "")
        if allowed.above is not None and value <= allowed.above:
            return f"more than {allowed.above:g}; leave the cell empty where the value is unknown"
        if allowed.least is not None and value < allowed.least:
            return f"{allowed.least:g} or more"
        return "a whole number" if self.whole and value != round(value) else ""


_UNITS: dict[str, str] = {  # field -> unit, of motors and gears
    "nominal_voltage": "V",
    "torque_constant": "N m/A",
    "speed_constant": "rad/s/V",
    "voltage_constant": "V s/rad",
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
_WHOLE = ("pole_pairs", "stages")
_CHOICES: dict[str, tuple[str, ...]] = {
    "torque_constant_basis": get_args(TorqueConstantBasis),
    "commutation": get_args(Commutation),
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


def _columns(
    product: type[Motor] | type[Gear], kinds: tuple[str, ...], ranges: Mapping[str, Range]
) -> dict[str, Column]:
    choices = _CHOICES | {"kind": kinds}
    columns = {}
    for name in (one.name for one in fields(product) if one.name not in CURVE_FIELDS):
        range_ = ranges.get(name, POSITIVE)
        columns[name] = Column(name, name, _unit(name), range_, whole=name in _WHOLE, choices=choices.get(name, ()))
    return columns


def _motor_columns() -> dict[str, Column]:
    columns = _columns(Motor, MOTOR_KINDS, motor.RANGES)
    for name in ("ratio", "backlash"):
        columns[name] = replace(columns[name], kinds=("actuator",))
    name = "rotor_inertia_before_gear"  # as makers of actuators print it
    columns[name] = Column(name, "rotor_inertia", "kg m^2", kinds=("actuator",), convert="x ratio^2")
    return columns


def _gear_columns() -> dict[str, Column]:
    """Those of rotary gears; and those of screws and racks, whose output is a force and a length."""
    columns = _columns(Gear, GEAR_KINDS, gear.RANGES)
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
        columns[other] = replace(columns[name], name=other, unit=unit, kinds=LINEAR_KINDS)
        columns[name] = replace(columns[name], kinds=rotary)
    columns["ratio"] = replace(columns["ratio"], kinds=rotary)
    columns["lead"] = Column("lead", "ratio", "m", kinds=("screw",), convert="2 pi / x")
    columns["pinion_radius"] = Column("pinion_radius", "ratio", "m", kinds=("rack",), convert="1 / x")
    return columns


MOTOR_COLUMNS = _motor_columns()
GEAR_COLUMNS = _gear_columns()
CURVE_COLUMNS = {  # of a file of curves, one row a point
    "id": Column("id", "id"),
    "curve": Column("curve", "curve", choices=CURVE_FIELDS),
    "speed": Column("speed", "speed", "rad/s", NOT_NEGATIVE),
    "torque": Column("torque", "torque", "N m", NOT_NEGATIVE),
    "load": Column("load", "load", ""),
    "efficiency": Column("efficiency", "efficiency", "", SHARE),
}
