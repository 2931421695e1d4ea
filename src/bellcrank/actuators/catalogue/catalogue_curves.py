"""Files of curves, one point a row, and the products that the curves belong to.

id,curve,speed [rpm],torque [N m],load,efficiency [%]
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

from bellcrank.actuators.catalogue.catalogue_columns import CURVE_COLUMNS
from bellcrank.actuators.catalogue.catalogue_row_checks import Points
from bellcrank.actuators.catalogue.catalogue_tables import CatalogueRow, CatalogueTable, number, text
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name

Product = Motor | Gear


class Placed(NamedTuple):
    """A product and where it stands, such as "motors.csv, line 7"."""

    product: Product
    place: str


class CurvePoint(NamedTuple):
    """A point of a curve in a file."""

    row: CatalogueRow
    product: str
    curve: str
    x: float
    y: float


def read_points(table: CatalogueTable) -> list[CurvePoint]:
    """The points of a file of curves. Raises InputError."""
    headers = {header.column.name: header for header in table.headers(CURVE_COLUMNS)}
    found = []
    for row in table.rows:
        values = {
            name: text(row, one) if one.column.unit is None else number(row, one) for name, one in headers.items()
        }
        product, curve = values.get("id"), values.get("curve")
        if not isinstance(product, str) or not isinstance(curve, str):
            raise row.error("id" if product is None else "curve", "the cell is empty; every point needs id and curve")
        wanted = ("load", "efficiency") if curve == "efficiency_curve" else ("speed", "torque")
        for name, value in values.items():
            if isinstance(value, float) and name not in wanted:
                raise row.error(headers[name].title, f"a point of '{curve}' has no {name}; leave the cell empty")
        x, y = (values.get(name) for name in wanted)
        if not isinstance(x, float) or not isinstance(y, float):
            lacking = CURVE_COLUMNS[wanted[0] if x is None else wanted[1]].title
            raise row.error(lacking, f"the value is missing; a point of '{curve}' needs {' and '.join(wanted)}")
        found.append(CurvePoint(row, product, curve, x, y))
    return found


def with_curves(products: Mapping[str, Placed], points: Iterable[CurvePoint]) -> list[Placed]:
    """The products, with the curves that points describe. Raises InputError."""
    curves: dict[tuple[str, str], list[CurvePoint]] = {}
    for point in points:
        if point.product not in products:
            raise point.row.error("id", unknown_name("product", point.product, products))
        gear = isinstance(products[point.product].product, Gear)
        if gear != (point.curve == "efficiency_curve"):
            what = "gear" if gear else "motor"
            raise point.row.error("curve", f"'{point.product}' is a {what} and has no such curve")
        curves.setdefault((point.product, point.curve), []).append(point)
    found = dict(products)
    for (name, curve), given in curves.items():
        values: Points = tuple((point.x, point.y) for point in given)
        product, place = found[name]
        try:
            found[name] = Placed(replace(product, **{curve: values}), place)  # type: ignore[arg-type]
        except InputError as error:
            raise InputError(f"{given[0].row.file}: line {given[0].row.line}: {error}") from None
    return list(found.values())
