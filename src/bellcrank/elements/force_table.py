"""Tables of forces over time in CSV files.

A table has a column "time [s]" and either a column "JOINT torque [N m]" (or [N]) for each joint, or components of a
wrench, "force x [N]" to "torque z [N m]".
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np

from bellcrank.arrays import Array
from bellcrank.config.fields import Fields
from bellcrank.config.units import UNITS, decimal_number, units_for
from bellcrank.elements.signals import Signal, SignalSource
from bellcrank.errors import InputError
from bellcrank.files.access import MOST_TABLE, read_text
from bellcrank.files.csv_files import unguarded
from bellcrank.messages import unknown_name
from bellcrank.motion.limit_checks import LARGEST, check_size, check_times

INTERPOLATIONS = ("linear", "cubic", "hold")
MOST_UNEVEN = 1e12  # the longest distance between rows of a cubic table by the shortest: beyond, rounding decides
CLOSEST = 1e-9  # s between the rows of a cubic table: splines overshoot strongly for closer rows
COMPONENTS = {f"{what} {c}": unit for what, unit in (("force", "N"), ("torque", "N m")) for c in "xyz"}  # of a wrench
_HEADER = re.compile(r"^(?P<name>.*\S)\s*\[(?P<unit>[^\[\]]*)\]$")


def read_torque_table(read: Fields, column: str, unit: str, interpolation: str) -> tuple[SignalSource, str]:
    """Read and check the table of a torque. Returns its signal and its text.

    Raises InputError naming the scene's key and the CSV's line.
    """
    path = read.file("file")
    try:
        text = table_text(path)
        time, torque = read_table(path, text, column, unit)
    except InputError as error:
        raise read.error("file", str(error)) from None
    _check_spacing(read, path, time, interpolation)
    name = f"table {path}: {column}, {interpolation}"
    return SignalSource(name, 1, 0, partial(table_signal, time, torque[:, None], interpolation)), text


def read_wrench_table(read: Fields, interpolation: str) -> tuple[SignalSource, str]:
    """Read and check the table of a wrench, six values wide (force, torque). Returns its signal and its text.

    Raises InputError as `read_torque_table`, also for columns that are not components of a wrench.
    """
    path = read.file("file")
    try:
        text = table_text(path)
        header, _ = _rows(path, text)
        there = [_label(title) for title in header if _label(title) != "time"]
        if not there:
            raise InputError(f"{path}: no column of a wrench found; expected: {', '.join(COMPONENTS)}")
        for label in there:
            if label not in COMPONENTS:
                raise InputError(f"{path}: {unknown_name('column of a wrench', label, COMPONENTS)}")
        found = {label: read_table(path, text, label, COMPONENTS[label]) for label in there}
    except InputError as error:
        raise read.error("file", str(error)) from None
    time = next(iter(found.values()))[0]
    _check_spacing(read, path, time, interpolation)
    nothing = np.zeros(len(time))
    values = np.stack([found[label][1] if label in found else nothing for label in COMPONENTS], axis=1)
    name = f"table {path}: wrench, {interpolation}"
    return SignalSource(name, 6, 0, partial(table_signal, time, values, interpolation)), text


def _check_spacing(read: Fields, path: Path, time: Array, interpolation: str) -> None:
    if interpolation == "cubic" and np.diff(time).min() < CLOSEST:
        k = int(np.diff(time).argmin())
        raise read.error(
            "interpolation",
            f"a cubic spline requires times at least {CLOSEST:g} s apart, {path} has {time[k]!r} s and "
            f"{time[k + 1]!r} s; use linear interpolation for jumps",
        )
    if interpolation == "cubic" and np.diff(time).max() > MOST_UNEVEN * np.diff(time).min():
        raise read.error(
            "interpolation",
            f"a cubic spline requires times whose distances differ by a factor of at most {MOST_UNEVEN:g}, those of "
            f"{path} are from {np.diff(time).min():g} s to {np.diff(time).max():g} s; use linear interpolation",
        )


def table_text(path: Path) -> str:
    """Read the text of a table's file. Raises InputError naming the file."""
    return read_text(path, MOST_TABLE)


def read_table(path: Path, text: str, column: str, unit: str) -> tuple[Array, Array]:
    """Read the times (n,), s, and a column (n,), converted to `unit`, from the text of a table; n >= 2.

    Times must increase. Other columns are ignored. Raises InputError, one sentence with file and line.
    """
    header, rows = _rows(path, text)
    labels = [_label(title) for title in header]
    for label in ("time", column):
        if label not in labels:
            if label == column and "torque" in labels:
                raise InputError(
                    f"{path}: the title of the column 'torque' lacks the joint; rename it to '{column} [{unit}]'"
                )
            raise InputError(f"{path}: {unknown_name('column', label, labels)}")
        if labels.count(label) > 1:
            raise InputError(f"{path}: there are two columns '{label}'")
    columns = []
    for label, wanted in (("time", "s"), (column, unit)):
        place = labels.index(label)
        match, known = _HEADER.match(header[place]), units_for(wanted)
        if match is None:
            raise InputError(f"{path}: column '{label}' has no unit; write '{label} [{wanted}]'")
        if match["unit"].strip() not in known:
            raise InputError(f"{path}: column '{label}' is in '{match['unit']}', expected {' or '.join(known)}")
        columns.append(_column(path, header[place], rows, place) * known[match["unit"].strip()])
    time, torque = columns
    if np.any(np.diff(time) <= 0.0):
        k = int(np.argmax(np.diff(time) <= 0.0))
        raise InputError(
            f"{path}: time must increase, but {time[k + 1]:g} s (line {rows[k + 1][0]}) follows {time[k]:g} s"
        )
    check_times(str(path), time)
    check_size(str(path), f"column '{column}':", torque)
    return time, torque


def read_columns(path: Path, text: str, units: Mapping[str, str]) -> tuple[Array, dict[str, Array]]:
    """Read the first column of a table (n,), which must increase, and those of `units` that it has (n,), converted.

    Units of the first column are converted to SI. Raises InputError, one sentence with file and line.
    """
    header, rows = _rows(path, text, None)
    first = _HEADER.match(header[0])
    if first is None:
        raise InputError(f"{path}: the first column '{header[0]}' has no unit; write '{header[0]} [m]', [rad] or [1]")
    unit = first["unit"].strip()
    factor = 1.0 if unit == "1" else next((known[unit] for known in UNITS.values() if unit in known), None)
    if factor is None:
        raise InputError(f"{path}: the unit '{unit}' of the first column is not known; write it in SI units")
    argument = _column(path, header[0], rows, 0) * factor
    if np.any(np.diff(argument) <= 0.0):
        k = int(np.argmax(np.diff(argument) <= 0.0))
        raise InputError(
            f"{path}: the first column must increase, but {argument[k + 1]:g} (line {rows[k + 1][0]}) follows "
            f"{argument[k]:g}"
        )
    check_size(str(path), f"column '{header[0]}':", argument)
    labels = [_label(title) for title in header[1:]]
    for label in labels:
        if label not in units:
            raise InputError(f"{path}: {unknown_name('column', label, units)}")
    found = {}
    for place, label in enumerate(labels, 1):
        if label in found:
            raise InputError(f"{path}: there are two columns '{label}'")
        match, known = _HEADER.match(header[place]), units_for(units[label])
        if match is None or match["unit"].strip() not in known:
            there = "no unit" if match is None else f"the unit '{match['unit']}'"
            raise InputError(f"{path}: column '{label}' has {there}, expected {' or '.join(known)}")
        found[label] = _column(path, header[place], rows, place) * known[match["unit"].strip()]
        check_size(str(path), f"column '{label}':", found[label])
    if not found:
        raise InputError(f"{path}: expected one of the columns {', '.join(units)} beside the first")
    return argument, found


def _label(title: str) -> str:
    """The title of a column without its unit."""
    match = _HEADER.match(title)
    return match["name"] if match else title


def table_signal(time: Array, values: Array, interpolation: str) -> tuple[Signal, Array]:
    """Interpolate values (n, width) at times (n,) by straight lines, a cubic spline, or steps.

    Returns the signal, and the times at which it is not smooth apart from the breaks of a kinked signal.
    """
    if interpolation == "cubic":
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(time, values)  # c: (4, m, width), descending powers
        return Signal(time, np.ascontiguousarray(spline.c[::-1].transpose(1, 0, 2)), 0, False), time[[0, -1]]
    if interpolation == "hold":  # one more piece holds the last value
        return Signal(np.append(time, time[-1] + 1.0), values[:, None], 0, True), np.zeros(0)
    slope = np.diff(values, axis=0) / np.diff(time)[:, None]
    return Signal(time, np.stack([values[:-1], slope], axis=1), 0, True), np.zeros(0)


def _rows(path: Path, text: str, needed: str | None = "time") -> tuple[list[str], list[tuple[int, list[str]]]]:
    try:
        lines = [(k, row) for k, row in enumerate(csv.reader(io.StringIO(text)), 1) if any(c.strip() for c in row)]
    except csv.Error as error:
        raise InputError(f"{path}: not a CSV file: {error}") from None
    if len(lines) < 3:
        raise InputError(
            f"{path}: expected a header such as 'time [s],JOINT torque [N m]' and at least 2 rows of numbers, "
            f"found {max(len(lines) - 1, 0)} rows"
        )
    header = [" ".join(unguarded(cell).split()) for cell in lines[0][1]]
    if needed is not None and all(_label(title) != needed for title in header):
        raise InputError(f"{path}: no column 'time [s]'; expected a header such as 'time [s],JOINT torque [N m]'")
    for number, row in lines[1:]:
        if len(row) != len(header):
            raise InputError(f"{path}: line {number} has {len(row)} columns, the header has {len(header)}")
    return header, lines[1:]


def _column(path: Path, title: str, rows: list[tuple[int, list[str]]], place: int) -> Array:
    values = np.empty(len(rows))
    for k, (number, row) in enumerate(rows):
        try:
            values[k] = decimal_number(row[place])
        except ValueError:
            values[k] = math.nan
        if not math.isfinite(values[k]):
            raise InputError(
                f"{path}: line {number}, column '{title}': {row[place].strip()[:40]!r} is not a finite number"
            )
        if abs(values[k]) > LARGEST[-1]:
            raise InputError(
                f"{path}: line {number}, column '{title}': {row[place].strip()[:40]!r} is too large, expected at most "
                f"{LARGEST[-1]:g}"
            )
    return values
