"""CSV files of a catalogue as tables of texts: header, rows and the line of each row; cells as numbers or texts.

A file of curves has one point a row:

    id,curve,speed [rpm],torque [N m],load,efficiency [%]
"""

from __future__ import annotations

import csv
import io
import math
import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from bellcrank.actuators.catalogue.catalogue_columns import CURVE_COLUMNS, Column
from bellcrank.actuators.catalogue.product_checks import Points
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.config.units import decimal_number, units_for
from bellcrank.errors import InputError
from bellcrank.files.access import read_text
from bellcrank.files.csv_files import unguarded
from bellcrank.messages import format_value, unknown_name

MOST_BYTES = 32 * 2**20  # of one file
MOST_ROWS = 100_000  # of one file
MOST_COLUMNS = 200
LONGEST_TEXT = 4000  # letters of a cell
_OTHERS = ((";", "semicolons"), ("\t", "tabs"))
_HEADER = re.compile(r"\A([^\[\]]*)(?:\[([^\[\]]*)\])?\Z")
_DECIMAL_COMMA = re.compile(r"\A[-+]?\d+,\d+\Z")
Product = Motor | Gear


@dataclass(frozen=True)
class Header:
    """A column of a file: what it holds, and the factor from its unit to the column's."""

    title: str
    column: Column
    factor: float


@dataclass(frozen=True)
class CatalogueRow:
    """One row of a file: the cells that are not empty, by the title of their column."""

    file: Path
    line: int
    cells: dict[str, str]

    def error(self, title: str, text: str) -> InputError:
        """An InputError that names file, line and column."""
        return InputError(f"{self.file}: line {self.line}, column '{title}': {text}")


@dataclass(frozen=True)
class CatalogueTable:
    """The rows of a file, its columns' titles and their line."""

    file: Path
    line: int
    titles: tuple[str, ...]
    rows: tuple[CatalogueRow, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the columns, without units."""
        return tuple(split_title(title)[0] for title in self.titles)

    def headers(self, columns: Mapping[str, Column]) -> tuple[Header, ...]:
        """The columns, checked. Raises InputError for unknown names, names twice, and wrong or missing units."""
        found: dict[str, Header] = {}
        for title in self.titles:
            name, unit = split_title(title)
            if name not in columns:
                raise InputError(f"{self.file}: line {self.line}: {unknown_name('column', name, columns)}")
            if name in found:
                raise InputError(f"{self.file}: line {self.line}: column '{name}' occurs twice; remove one")
            found[name] = Header(title, columns[name], self._factor(columns[name], unit))
        return tuple(found.values())

    def _factor(self, column: Column, unit: str | None) -> float:
        place = f"{self.file}: line {self.line}: column '{column.name}'"
        if column.unit is None:
            if unit is not None:
                raise InputError(f"{place} holds texts and has no unit, found [{unit[:40]}]")
            return 1.0
        known = units_for(column.unit)
        if unit is None and "" not in known:
            raise InputError(f"{place} has no unit; write '{column.title}', or one of {_listed(known)}")
        if (unit or "") not in known:
            raise InputError(f"{place} is in {format_value(unit)}, expected {_listed(known)}")
        return known[unit or ""]


def _listed(units: Mapping[str, float]) -> str:
    return ", ".join(f"[{unit}]" if unit else "no unit" for unit in units)


def split_title(title: str) -> tuple[str, str | None]:
    """Name and unit of a header's cell; the unit is None where there is none."""
    match = _HEADER.match(title)
    if match is None:
        return title, None
    return match[1].strip(), None if match[2] is None else match[2].strip()


def read_table(file: Path, expected: str = "a header 'id,maker,model,kind,…' and rows of products") -> CatalogueTable:
    """The table in a CSV file. Raises InputError with file and line where it is not one.

    `expected` says what the file is to hold.
    """
    lines = _lines(file, read_text(file, MOST_BYTES))
    first, titles = next(lines, (0, []))
    separator = next((name for mark, name in _OTHERS if len(titles) == 1 and mark in titles[0]), None)
    titles = [" ".join(unicodedata.normalize("NFC", title).split()) for title in titles]
    while titles and not titles[-1]:  # commas at the end, as some spreadsheets write them
        titles.pop()
    if not titles:
        raise InputError(f"{file}: the file is empty; expected {expected}")
    if separator is not None:
        raise InputError(
            f"{file}: line {first}: the columns are separated by {separator}; expected commas, and points in the "
            "numbers: save the file as CSV (comma delimited)"
        )
    if len(titles) > MOST_COLUMNS:
        raise InputError(f"{file}: line {first}: {len(titles)} columns, expected at most {MOST_COLUMNS}")
    if "" in titles:
        raise InputError(f"{file}: line {first}: column {titles.index('') + 1} has no name; write one, or remove it")
    rows: list[CatalogueRow] = []
    for line, cells in lines:
        if len(rows) == MOST_ROWS:
            raise InputError(f"{file}: line {line}: more than {MOST_ROWS} rows; split the file")
        rows.append(CatalogueRow(file, line, _cells(file, line, titles, cells)))
    return CatalogueTable(file, first, tuple(titles), tuple(rows))


def _lines(file: Path, text: str) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of each line that is not blank. Raises InputError."""
    reader = csv.reader(io.StringIO(text), strict=True)
    while True:
        line = reader.line_num + 1
        try:
            row = next(reader, None)
        except csv.Error as error:
            raise InputError(f"{file}: line {line}: not valid CSV: {error}") from None
        if row is None:
            return
        if any(cell.strip() for cell in row):
            yield line, [unguarded(cell.strip()).strip() for cell in row]


def _cells(file: Path, line: int, titles: list[str], cells: list[str]) -> dict[str, str]:
    count = len(titles)
    if len(cells) < count or any(cells[count:]):
        raise InputError(
            f"{file}: line {line} has {len(cells)} cells, the header has {count} columns; put texts with commas "
            "between quotation marks"
        )
    return {title: cell for title, cell in zip(titles, cells, strict=False) if cell}


def number(row: CatalogueRow, header: Header) -> float | None:
    """The number of a cell in the column's unit; None where it is empty. Raises InputError."""
    cell = row.cells.get(header.title)
    if cell is None:
        return None
    column = header.column
    try:
        written = decimal_number(cell)
    except ValueError:
        comma = "; write '.' for the decimal comma" if _DECIMAL_COMMA.match(cell) else ""
        raise row.error(
            header.title,
            f"expected a number (its unit is in the header), or an empty cell where the value is unknown, found "
            f"{format_value(cell)}{comma}",
        ) from None
    if not math.isfinite(written):
        raise row.error(header.title, f"expected a finite number, found {format_value(cell)}")
    value = written * header.factor
    expected = column.expected(value)
    if expected:
        raise row.error(header.title, f"expected {expected}, found {format_value(cell)}")
    return value


def text(row: CatalogueRow, header: Header) -> str | None:
    """The text of a cell; None where it is empty. Raises InputError."""
    cell = row.cells.get(header.title)
    if cell is None:
        return None
    choices = header.column.choices
    if choices and cell not in choices:
        raise row.error(header.title, unknown_name(header.column.name, cell, choices))
    if len(cell) > LONGEST_TEXT:
        raise row.error(header.title, f"a text of {len(cell)} letters, expected at most {LONGEST_TEXT}")
    if not cell.isprintable():
        raise row.error(header.title, "the text has a line break or a control character; remove it")
    return cell


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
