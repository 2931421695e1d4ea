"""Writes catalogue files, which `load_catalogue` reads back."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from bellcrank import arguments
from bellcrank.actuators.catalogue.catalogue_columns import (
    CURVE_COLUMNS,
    CURVE_FIELDS,
    GEAR_COLUMNS,
    MOTOR_COLUMNS,
    Column,
)
from bellcrank.actuators.catalogue.catalogue_curves import Product
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.files.atomic_write import write_text
from bellcrank.files.csv_files import csv_text


@arguments.named
def write_catalogue(motors: Sequence[Motor], gears: Sequence[Gear], folder: str | Path) -> list[Path]:
    """Write motors.csv, gears.csv and curves.csv in SI units, without columns that no product uses.

    `load_catalogue` reads them back: every number the same, but for an inertia given at the output, a lead and a
    radius, which differ by round-off.

    Args:
        motors: Motors and actuators.
        gears: Gears, screws and racks.
        folder: The folder; made where it is missing.

    Returns:
        The paths of the files written.

    Raises:
        InputError: A file cannot be written.

    Example:
        >>> import bellcrank as bc, tempfile
        >>> catalogue = bc.load_catalogue().filtered(makers=["Nabtesco"])
        >>> [path.name for path in bc.write_catalogue(catalogue.motors, catalogue.gears, tempfile.mkdtemp())]
        ['gears.csv']
    """
    motors = arguments.several("motors", motors, Motor, "motors")
    gears = arguments.several("gears", gears, Gear, "gears")
    target = arguments.path("folder", folder, "a folder")
    files = []
    for name, products, columns in (("motors.csv", motors, MOTOR_COLUMNS), ("gears.csv", gears, GEAR_COLUMNS)):
        if products:
            cells = [_cells(product, columns) for product in products]
            files.append(_write(target / name, columns, cells))
    everything: tuple[Product, ...] = (*motors, *gears)
    points = [cells for product in everything for cells in _curve_cells(product)]
    if points:
        files.append(_write(target / "curves.csv", CURVE_COLUMNS, points))
    return files


def _write(path: Path, columns: Mapping[str, Column], rows: Sequence[Mapping[str, object]]) -> Path:
    used = [column for column in columns.values() if any(row.get(column.name) not in (None, "") for row in rows)]
    cells: list[list[object]] = [[column.title for column in used]]
    for row in rows:
        values = (row.get(column.name) for column in used)
        cells.append(["" if value is None else value for value in values])
    write_text(path, csv_text(cells))
    return path


def _cells(product: Product, columns: Mapping[str, Column]) -> dict[str, object]:
    cells: dict[str, object] = {}
    for column in columns.values():
        value = getattr(product, column.field)
        if value is None or (column.kinds and product.kind not in column.kinds) or column.convert == "x ratio^2":
            continue
        if column.convert:
            value = (2.0 * math.pi if column.convert == "2 pi / x" else 1.0) / value
        cells[column.name] = repr(float(value)) if column.unit is not None else value
    if isinstance(product, Gear) and product.inertia is not None:  # which a file gives at its `inertia_side`
        at_output = product.inertia_side == "output" and product.ratio is not None
        cells["inertia"] = repr(product.inertia * (product.ratio or 1.0) ** 2 if at_output else product.inertia)
        cells["inertia_side"] = "output" if at_output else "input"
    return cells


def _curve_cells(product: Product) -> list[dict[str, str]]:
    found = []
    for curve in CURVE_FIELDS:
        for x, y in getattr(product, curve, None) or ():
            names = ("load", "efficiency") if curve == "efficiency_curve" else ("speed", "torque")
            found.append({"id": product.id, "curve": curve} | dict(zip(names, map(repr, (x, y)), strict=True)))
    return found
