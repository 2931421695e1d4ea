"""Conditions in a robot configuration: `conditions` for the whole robot, and keys of `actuators.NAME` for one axis."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Any, Final

from bellcrank.actuators.catalogue.catalogue_row_checks import POSITIVE, Range
from bellcrank.actuators.catalogue.product_fields import product_number
from bellcrank.actuators.conditions import BY_NAME, CHOICES, RANGES, Conditions
from bellcrank.errors import InputError

if TYPE_CHECKING:
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
        raise fields.error(name, str(error).removeprefix(f"conditions: argument '{name}': ")) from None
    return value
