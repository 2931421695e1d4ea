"""What a configuration says of actuators and of the conditions under which they work.

A joint's mapping has the keys of `Actuator`, or `motor` and `gear` (by default none), each the id of a catalogue's row
or a mapping of its own (product_fields.py); beside these the conditions of this axis, which
replace those of the whole robot.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

from bellcrank.actuators.actuator import RATINGS, Actuator
from bellcrank.actuators.catalogue.product_checks import POSITIVE, Range
from bellcrank.actuators.catalogue.product_fields import (
    gear_from_fields,
    motor_from_fields,
    product_data,
    product_number,
)
from bellcrank.actuators.conditions import BY_NAME, CHOICES, RANGES, Conditions
from bellcrank.actuators.gear import DIRECT, Gear
from bellcrank.actuators.motor import Motor
from bellcrank.errors import InputError

if TYPE_CHECKING:
    from bellcrank.actuators.catalogue.catalogue import Catalogue
    from bellcrank.config.fields import Fields


ROBOT_WIDE: Final = "conditions"  # the key, and the source of its values
UNITS: Final = {  # of the fields that are numbers
    "voltage": "V",
    "voltage_ratio": "",
    "voltage_reserve": "",
    "winding_temperature": "°C",
    "ambient": "°C",
    "altitude": "m",
    "safety_factor": "",
    "inertia_ratio": "",
    "life": "h",
    "bus_capacitance": "F",
    "bus_max_voltage": "V",
    "brake_resistor_power": "W",
    "brake_resistance": "Ω",
    "brake_resistor_peak_power": "W",
    "supply_power": "W",
}
DEFAULTS: Final = Conditions()
KEYS: Final = (*UNITS, *CHOICES, "brake", "momentary_loads", "assume")
OF_AN_AXIS: Final = (  # the axes share one bus with its supply; momentary loads have the names of the axes already
    "voltage", "voltage_ratio", "voltage_reserve", "winding_temperature", "ambient", "altitude", "safety_factor",
    "inertia_ratio", "commutation", "construction", "life", "brake", "assume",
)  # fmt: skip

DRIVE_KEYS: Final = (
    "model",
    "elastic",
    "rotor_friction",
    "temperatures",
    "servo",
)  # of a simulation (elements/drives.py)
P = TypeVar("P", Motor, Gear)
CatalogueOf = Callable[[], "Catalogue"]


def given_conditions(fields: Fields, keys: Collection[str] = KEYS) -> dict[str, Any]:
    """The conditions that a mapping states, by the names of the fields of `Conditions`, in SI units.

    Keys that are not those of conditions stay unread. Raises InputError, naming file and key.
    """
    fields.known(*keys)
    return {name: _value(fields, name) for name in keys if name in fields}


def condition_data(
    conditions: Conditions, common: Conditions | None = None, keys: Collection[str] = KEYS
) -> dict[str, Any]:
    """The conditions as a mapping of a YAML file, without what `common`, by default the defaults, says alike."""
    common = DEFAULTS if common is None else common
    data: dict[str, Any] = {}
    for name in keys:
        value, other = getattr(conditions, name), getattr(common, name)
        if name in BY_NAME:
            value = dict(item for item in value if item not in other)
            other = {}
        if value != other:
            data[name] = value
    return data


def _bounds(limits: Range) -> dict[str, Any]:
    """The bounds that `Fields.number` knows; `Conditions` refuses what is beyond others."""
    bounds: dict[str, Any] = {"maximum": limits.most} if limits.most < POSITIVE.most else {}
    return bounds | (
        {"positive": True} if limits.above == 0.0 else {"nonnegative": True} if limits.least == 0.0 else {}
    )


def _value(fields: Fields, name: str) -> Any:
    """The value of one key. Raises InputError."""
    value: Any
    if name == "brake":
        return fields.flag(name, False)
    if name in CHOICES:
        return fields.choice(name, CHOICES[name])
    if name == "assume":
        own = fields.mapping(name)
        value = {entry: product_number(own, entry) for entry in own}
    elif name == "momentary_loads":
        own = fields.mapping(name)
        value = {entry: own.number(entry, "N m or N", nonnegative=True) for entry in own}
    else:
        value = fields.number(name, UNITS[name], getattr(DEFAULTS, name), **_bounds(RANGES.get(name, POSITIVE)))
    try:
        Conditions(**{name: value})
    except InputError as error:
        raise fields.error(name, error.reason) from None
    return value


def catalogue_folder(fields: Fields) -> Path | None:
    """The folder that the key `catalogue` names; None without it. Raises InputError, naming file and key."""
    return fields.file("catalogue") if "catalogue" in fields else None


def actuators_from_fields(
    fields: Fields, folder: Path | None = None, common: Conditions | None = None
) -> dict[str, Actuator]:
    """The actuators by joint that the key `actuators` of a robot configuration describes, under its conditions.

    Ids are looked up in the bundled catalogue and in the files of a folder. Raises InputError, naming file and key.
    """
    fields.known("catalogue")

    @cache
    def catalogue() -> Catalogue:
        from bellcrank.actuators.catalogue.catalogue import load_catalogue

        return load_catalogue(*(() if folder is None else _files_in(fields, folder)))

    if folder is not None:
        catalogue()  # its errors are told even where no joint names a product
    motors = fields.mapping("actuators", {})
    return {joint: actuator_from_fields(motors.mapping(joint), catalogue, common) for joint in motors}


def actuator_from_fields(
    fields: Fields, catalogue: CatalogueOf | None = None, common: Conditions | None = None
) -> Actuator:
    """The Actuator that a joint's mapping describes, where the conditions `common` hold unless it states others.

    Raises InputError, naming file and key.
    """
    common = Conditions() if common is None else common
    fields.known(*DRIVE_KEYS)
    try:
        if "motor" in fields or "gear" in fields:
            return _of_products(fields, catalogue, common)
        return _of_ratings(fields, common)
    except InputError as error:
        if fields.where in str(error):
            raise
        raise fields.error("", str(error)) from None


def actuator_data(actuator: Actuator, common: Conditions | None = None) -> dict[str, Any]:
    """An actuator as a joint's mapping of a robot configuration, which reads back as the same without a catalogue.

    `common` are the conditions of the configuration: those that are alike are not repeated.
    """
    if actuator.by_ratings:
        names = (*RATINGS, "motor_efficiency", "curve")
        known = {name: value for name in names if (value := getattr(actuator, name)) is not None}
        if actuator.curve is not None:
            known["curve"] = [list(point) for point in actuator.curve]
        return known
    data: dict[str, Any] = {"motor": product_data(actuator.motor)}
    if actuator.gear != DIRECT:
        data["gear"] = product_data(actuator.gear)
    return data | condition_data(actuator.conditions, common, OF_AN_AXIS)


def drive_data(entry: Mapping[str, Any]) -> dict[str, Any]:
    """What a joint's mapping says of the drive in a simulation."""
    return {key: entry[key] for key in DRIVE_KEYS if key in entry}


def _of_ratings(fields: Fields, common: Conditions) -> Actuator:
    curve = tuple((speed, torque) for speed, torque in fields.rows("curve", 2)) if "curve" in fields else None
    fields.known("curve", "motor", "gear")
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
    values["safety_factor"] = fields.number("safety_factor", "", common.safety_factor, positive=True)
    motor_efficiency = fields.optional_number("motor_efficiency", "", positive=True, maximum=1.0)
    fields.done()
    return Actuator(**values, motor_efficiency=motor_efficiency, curve=curve)


def _of_products(fields: Fields, catalogue: CatalogueOf | None, common: Conditions) -> Actuator:
    motor = _product(fields, "motor", motor_from_fields, lambda one: one.motor, catalogue)
    gear = DIRECT
    if "gear" in fields and fields.raw("gear") != DIRECT.id:
        gear = _product(fields, "gear", gear_from_fields, lambda one: one.gear, catalogue)
    conditions = common.updated(given_conditions(fields, OF_AN_AXIS), fields.path)
    fields.done()
    return Actuator.of(motor, gear, conditions)


def _product(
    fields: Fields,
    key: str,
    read: Callable[[Fields], P],
    find: Callable[[Catalogue], Callable[[str], P]],
    catalogue: CatalogueOf | None,
) -> P:
    """The motor or gear of a key: a mapping of figures, or the id of a catalogue's row."""
    if isinstance(fields.raw(key), Mapping):
        return read(fields.mapping(key))
    name = fields.text(key)
    if catalogue is None:
        raise fields.error(key, f"there is no catalogue to look '{name}' up in; write a mapping of its figures")
    try:
        return find(catalogue())(name)
    except InputError as error:
        raise fields.error(key, str(error)) from None


def _files_in(fields: Fields, folder: Path) -> list[Path]:
    """The CSV files of a catalogue's folder, each of which the configuration may name. Raises InputError."""
    if not folder.is_dir():
        raise fields.error("catalogue", f"there is no folder {folder}; write a path relative to this file's folder")
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() == ".csv")
    if not files:
        raise fields.error("catalogue", f"the folder {folder} has no file *.csv; expected tables of motors or gears")
    for path in files:
        if not fields.overridden("catalogue") and not fields.access.allows(path):
            raise fields.error("catalogue", f"{path} leads to a file that this file may not name; allow its folder")
    return files
