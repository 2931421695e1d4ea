"""Catalogue files, read and written: one product a row, CSV with units in the header.

    id,maker,model,kind,nominal_voltage [V],rotor_inertia [g cm^2],…,quality,source,checked,notes

An empty cell is an unknown value. The kinds of the rows say whether a file holds motors or gears; a file with a column
"curve" holds points of curves, and belongs to the products of all files that are read together.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any

from bellcrank import arguments
from bellcrank.actuators.catalogue.catalogue_columns import (
    CURVE_COLUMNS,
    CURVE_FIELDS,
    GEAR_COLUMNS,
    GEAR_KINDS,
    MOTOR_COLUMNS,
    MOTOR_KINDS,
    REQUIRED,
    Column,
)
from bellcrank.actuators.catalogue.catalogue_tables import (
    CatalogueRow,
    CatalogueTable,
    CurvePoint,
    Header,
    Placed,
    Product,
    number,
    read_points,
    read_table,
    text,
    with_curves,
)
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import write_text
from bellcrank.files.csv_files import csv_text
from bellcrank.messages import format_value, unknown_name

_ID = re.compile(r"\A[A-Za-z0-9][A-Za-z0-9._-]{0,79}\Z")
_DATE = re.compile(r"\A\d{4}-\d{2}-\d{2}\Z")
MOST_FILES = 1000  # of one folder


def read_products(paths: Iterable[Path]) -> list[Placed]:
    """The products of files and folders, with the curves that belong to them.

    Raises InputError, with file, line and column, for what is not as expected, and for an id that occurs twice.
    """
    found: dict[str, Placed] = {}
    points: list[CurvePoint] = []
    for file in _files(paths):
        table = read_table(file)
        if "curve" in table.names:
            points += read_points(table)
            continue
        for one in _products(table):
            other = found.setdefault(one.product.id, one)
            if other is not one:
                raise InputError(
                    f"{one.place}: id '{one.product.id}' is also at {other.place}; give each product an id of its own"
                )
    return with_curves(found, points)


def _files(paths: Iterable[Path]) -> list[Path]:
    files: dict[Path, None] = {}
    for path in paths:
        if not path.is_dir():
            files[path] = None
            continue
        try:
            inside = sorted(one for one in path.iterdir() if one.suffix.lower() == ".csv")
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror}; check its permissions") from None
        if not inside:
            raise InputError(f"{path}: no catalogue in this folder; expected files such as motors.csv and gears.csv")
        if len(inside) > MOST_FILES:
            raise InputError(f"{path}: {len(inside)} CSV files, expected at most {MOST_FILES}")
        files |= dict.fromkeys(inside)
    return list(files)


def _products(table: CatalogueTable) -> list[Placed]:
    for name in REQUIRED:
        if name not in table.names:
            raise InputError(
                f"{table.file}: line {table.line}: column '{name}' is missing; every catalogue file needs the columns "
                f"{', '.join(REQUIRED)} (a file of curves: id and curve)"
            )
    kinds = [_kind(row) for row in table.rows]
    gears = bool(kinds) and kinds[0] in GEAR_KINDS
    for row, kind in zip(table.rows, kinds, strict=True):
        if (kind in GEAR_KINDS) != gears:
            raise row.error(
                "kind",
                f"'{kind}' is a {'motor' if gears else 'gear'}, and the rows above are {'gears' if gears else 'motors'}"
                "; put motors and gears into files of their own",
            )
    headers = table.headers(GEAR_COLUMNS if gears else MOTOR_COLUMNS)
    return [Placed(_product(row, headers, gears), f"{row.file}, line {row.line}") for row in table.rows]


def _kind(row: CatalogueRow) -> str:
    kind = row.cells.get("kind", "")
    if kind not in MOTOR_KINDS + GEAR_KINDS:
        raise row.error("kind", unknown_name("kind", kind, MOTOR_KINDS + GEAR_KINDS))
    return kind


def _product(row: CatalogueRow, headers: Sequence[Header], gear: bool) -> Product:
    kind = row.cells["kind"]
    values: dict[str, Any] = {}
    from_titles: dict[str, str] = {}  # field -> title of the column that it is from
    converted = {}
    for header in headers:
        value = text(row, header) if header.column.unit is None else number(row, header)
        if value is None:
            continue
        column = header.column
        if column.kinds and kind not in column.kinds:
            raise row.error(header.title, _wrong_kind(column, kind, GEAR_COLUMNS if gear else MOTOR_COLUMNS))
        if column.field in values:
            raise row.error(header.title, f"'{from_titles[column.field]}' gives this value too; remove one of the two")
        values[column.field], from_titles[column.field] = value, header.title
        if column.convert:
            converted[column.field] = (column.convert, header.title)
    _check_texts(row, values)
    _convert(row, values, converted)
    if gear:
        _refer_inertia_to_input(row, values, from_titles)
    try:
        return Gear(**values) if gear else Motor(**values)
    except InputError as error:
        raise InputError(f"{row.file}: line {row.line}: {error}") from None


def _wrong_kind(column: Column, kind: str, columns: Mapping[str, Column]) -> str:
    instead = [
        one.title for one in columns.values() if one.field == column.field and (not one.kinds or kind in one.kinds)
    ]
    remedy = f"use the column {' or '.join(map(repr, instead))}" if instead else "leave the cell empty"
    return f"a product of kind '{kind}' has no such value (it is for {', '.join(column.kinds)}); {remedy}"


def _check_texts(row: CatalogueRow, values: Mapping[str, Any]) -> None:
    for name in REQUIRED:
        if name not in values:
            raise row.error(name, "the cell is empty; every product needs it")
    if not _ID.match(values["id"]) or values["id"] == "direct":
        raise row.error(
            "id",
            "expected a letter or digit and then letters, digits, '.', '_' or '-', at most 80 in all, and not 'direct'"
            f", found {format_value(values['id'])}",
        )
    checked = values.get("checked", "")
    if checked and not _is_date(checked):
        raise row.error("checked", f"expected a date such as 2026-11-22, found {format_value(checked)}")
    if ("price" in values) != ("currency" in values):
        given, lacking = ("price", "currency") if "price" in values else ("currency", "price")
        raise row.error(given, f"there is a {given} without a {lacking}; give both, or leave both empty")


def _is_date(written: str) -> bool:
    try:
        return bool(_DATE.match(written)) and bool(date.fromisoformat(written))
    except ValueError:
        return False


def _convert(row: CatalogueRow, values: dict[str, Any], converted: Mapping[str, tuple[str, str]]) -> None:
    """Replace values that were given as a lead, a radius, or before the gear."""
    for name, (how, title) in converted.items():
        if how == "x ratio^2":
            if "ratio" not in values:
                raise row.error(title, "needs the column 'ratio', to refer the inertia to the output")
            values[name] *= values["ratio"] ** 2
        else:
            values[name] = (2.0 * math.pi if how == "2 pi / x" else 1.0) / values[name]
        if not math.isfinite(values[name]):
            raise row.error(title, "the value is too large or too small")


def _refer_inertia_to_input(row: CatalogueRow, values: dict[str, Any], titles: Mapping[str, str]) -> None:
    """The gear's inertia at its input: J_in = J_out / N²."""
    if "inertia" not in values:
        return
    side = values.get("inertia_side")
    if side is None:
        raise row.error(
            titles["inertia"], "the side is not said; write 'input' or 'output' in the column 'inertia_side'"
        )
    if side == "output":
        if "ratio" not in values:
            raise row.error(titles["inertia"], "an inertia at the output needs a ratio, to refer it to the input")
        values["inertia"] /= values["ratio"] ** 2


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
