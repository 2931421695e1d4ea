"""Motors and gears as mappings of a YAML file: the names of a catalogue's columns, and numbers with units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields as fields_of
from dataclasses import replace
from itertools import pairwise
from typing import Any, Final

from bellcrank.actuators.catalogue.catalogue_columns import CURVE_FIELDS, GEAR_COLUMNS, MOTOR_COLUMNS, REQUIRED, Column
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.config.fields import Fields
from bellcrank.messages import format_value, unknown_name

_CURVE_UNITS: Final = {"efficiency_curve": ("", "")}  # of the two columns; of other curves speed and torque
_SPEED_TORQUE: Final = ("rad/s", "N m")
Points = tuple[tuple[float, float], ...]


def motor_from_fields(fields: Fields) -> Motor:
    """The Motor that a mapping describes. Raises InputError, naming file and key."""
    return Motor(**_values(fields, MOTOR_COLUMNS, Motor))


def gear_from_fields(fields: Fields) -> Gear:
    """The Gear that a mapping describes. Raises InputError, naming file and key."""
    return Gear(**_values(fields, GEAR_COLUMNS, Gear))


def product_data(product: Motor | Gear) -> dict[str, Any]:
    """What is known of a motor or gear as a mapping of a YAML file, which reads back as the same; SI units."""
    columns = GEAR_COLUMNS if isinstance(product, Gear) else MOTOR_COLUMNS
    own = [one for one in columns.values() if not one.kinds or product.kind in one.kinds]
    names = {one.field: one for one in own if one.convert != "x ratio^2"}
    data: dict[str, Any] = {}
    for entry in fields_of(product):
        value = getattr(product, entry.name)
        if value is None or value == "":
            continue
        if entry.name in CURVE_FIELDS:
            data[entry.name] = [list(point) for point in value]
        elif entry.name != "inertia_side":
            column = names[entry.name]
            data[column.name] = _converted(column, value) if column.convert else value
    if "inertia" in data:
        data["inertia_side"] = "input"  # where the field `inertia` is
    return data


def product_number(fields: Fields, name: str) -> float:
    """The number of a key such as "gear.efficiency" or "motor.rotor_inertia", in SI units. Raises InputError."""
    kind, _, field = name.partition(".")
    columns = {"motor": MOTOR_COLUMNS, "gear": GEAR_COLUMNS}.get(kind, {})
    known = [
        f"{kind}.{one.name}"
        for kind, every in (("motor", MOTOR_COLUMNS), ("gear", GEAR_COLUMNS))
        for one in every.values()
        if one.unit is not None and one.name == one.field
    ]
    if name not in known:
        raise fields.error(name, unknown_name("value to assume", name, known))
    return float(_value(fields, replace(columns[field], name=name)))


def _converted(column: Column, value: float) -> float:
    """Lead or radius from the ratio, and the ratio from these."""
    return (2.0 * math.pi if column.convert == "2 pi / x" else 1.0) / value


def _values(fields: Fields, columns: Mapping[str, Column], product: type[Motor] | type[Gear]) -> dict[str, Any]:
    """The values of a product's fields, by the names of the fields. Raises InputError."""
    curves = [entry.name for entry in fields_of(product) if entry.name in CURVE_FIELDS]
    fields.known(*columns, *curves)
    kinds = columns["kind"].choices
    kind = fields.choice("kind", kinds, "motor") if product is Motor else fields.choice("kind", kinds)
    values: dict[str, Any] = {"kind": kind}
    keys: dict[str, str] = {}  # field -> key that it is from
    for key in fields:
        if key in curves:
            values[key] = _curve(fields, key)
        elif key in columns and key != "kind":
            column = columns[key]
            if column.kinds and kind not in column.kinds:
                raise fields.error(key, f"expected with {' or '.join(column.kinds)}; this is of the kind {kind}")
            if column.field in keys:
                raise fields.error(key, f"'{keys[column.field]}' gives this value too; remove one of the two")
            keys[column.field] = key
            values[column.field] = _value(fields, column)
    fields.done()
    _convert(fields, values, {field: columns[key] for field, key in keys.items()})
    for name in REQUIRED:
        values.setdefault(name, fields.path or "unnamed" if name == "id" else "")
    return values


def _convert(fields: Fields, values: dict[str, Any], columns: Mapping[str, Column]) -> None:
    """Replace values that were given as a lead, a radius, before the gear, or at the gear's output."""
    for name, column in columns.items():
        if column.convert == "x ratio^2":
            if "ratio" not in values:
                raise fields.error(column.name, "needs the key 'ratio', to refer the inertia to the output")
            values[name] *= values["ratio"] ** 2
        elif column.convert:
            values[name] = _converted(column, values[name])
    if "inertia" in values and "inertia_side" not in values:
        raise fields.error("inertia", "its side is not said; write inertia_side: input, or output")
    if values.get("inertia_side") == "output" and "inertia" in values:
        if "ratio" not in values:
            raise fields.error("inertia", "needs the key 'ratio', to refer the inertia at the output to the input")
        values["inertia"] /= values["ratio"] ** 2
        if not math.isfinite(values["inertia"]):
            raise fields.error("inertia", "the value is too large")


def _value(fields: Fields, column: Column) -> Any:
    """A text, or a number in the unit of its field."""
    if column.unit is None:
        return fields.choice(column.name, column.choices) if column.choices else fields.text(column.name)
    value = fields.number(column.name, column.unit)
    if expected := column.expected(value):
        raise fields.error(column.name, f"expected {expected}, found {format_value(fields.raw(column.name))}")
    return value


def _curve(fields: Fields, name: str) -> Points:
    """A list of points, each number in SI units or with a unit. Raises InputError."""
    rows = fields.raw(name)
    if not isinstance(rows, (list, tuple)) or not all(isinstance(row, (list, tuple)) and len(row) == 2 for row in rows):
        raise fields.error(name, "expected a list of points of two numbers each")
    first, second = _CURVE_UNITS.get(name, _SPEED_TORQUE)
    points = tuple((fields.parsed(name, a, first), fields.parsed(name, b, second)) for a, b in rows)
    if len(points) < 2 or not all(b[0] > a[0] for a, b in pairwise(points)):
        raise fields.error(name, "expected at least two points whose first numbers rise")
    if min(map(min, points)) < 0.0:
        raise fields.error(name, "expected numbers of 0 or more")
    return points
