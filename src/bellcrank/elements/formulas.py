"""Reads the expressions of forces and controllers: formulas in the file, and tables over a formula in a CSV file.

The first column of such a table holds values of the formula, each other column a quantity at these values. Between two
rows a column is a straight line, or a cubic spline ("cubic"); before the first and after the last row it keeps its
value. Units stand in the header.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array
from bellcrank.config.fields import Fields
from bellcrank.config.units import UNITS, split_number
from bellcrank.elements.expression import Expression, OutputTerm, Sides, Term, parse_expression
from bellcrank.elements.force_table import CLOSEST, read_columns, table_text
from bellcrank.errors import InputError
from bellcrank.messages import format_value
from bellcrank.robot.robot import Robot

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols

OVER = ("linear", "cubic")
MOST_ROWS = 300  # of a table over a formula: each row is a piece of the machine code


@dataclass(frozen=True)
class FormulaReader:
    """Reads expressions in which the joints and frames of a robot, parameters and outputs may be named."""

    robot: Robot
    parameters: Mapping[str, Any]
    output: OutputTerm | None = None

    def parsed(self, read: Fields, key: str, given: object, unit: str = "") -> Expression:
        """The expression that is given under a key: a number, a text with a unit, or a formula in SI units.

        Raises InputError naming file and key.
        """
        number = not isinstance(given, str) or _is_quantity(given)
        text = repr(read.parsed(key, given, unit)) if number else str(given)
        try:
            found = parse_expression(text, self.robot, self.parameters, self.output)
        except InputError as error:
            wanted = f"a number in {unit} or a formula" if unit else "a number or a formula"
            raise read.error(key, f"expected {wanted}: {error}") from None
        if any(leaf.operation == "joint" and leaf.value[1] == "acceleration" for leaf in found.term.leaves()):
            raise read.error(key, "a force must be a formula of positions and velocities, not of accelerations")
        return found

    def read(self, read: Fields, key: str, unit: str = "") -> Expression:
        """Read an expression. Raises InputError naming file and key."""
        return self.parsed(read, key, read.raw(key), unit)

    def several(self, read: Fields, key: str, unit: str = "") -> tuple[Expression, ...]:
        """Read a list of expressions. Raises InputError naming file and key."""
        given = read.raw(key)
        if not isinstance(given, (list, tuple)) or not given:
            raise read.error(key, f"expected a list of numbers or formulas, found {format_value(given)}")
        return tuple(self.parsed(read, key, one, unit) for one in given)

    def matrix(self, read: Fields, key: str, columns: int) -> tuple[tuple[Expression, ...], ...]:
        """Read a list of rows of `columns` expressions each. Raises InputError naming file and key."""
        given = read.raw(key)
        rows = given if isinstance(given, (list, tuple)) else ()
        if not rows or not all(isinstance(row, (list, tuple)) and len(row) == columns for row in rows):
            raise read.error(key, f"expected a list of rows of {columns} numbers each, found {format_value(given)}")
        return tuple(tuple(self.parsed(read, key, one) for one in row) for row in rows)

    def tables(self, read: Fields, units: Mapping[str, str]) -> tuple[dict[str, Expression], str]:
        """Read `over`, `file` and `interpolation`: the columns of these units that the table has, and its text.

        Raises InputError naming the key, or the CSV file and its line.
        """
        over, path = self.read(read, "over"), read.file("file")
        interpolation = read.choice("interpolation", OVER, "linear")
        text = table_text(path)
        try:
            argument, columns = read_columns(path, text, units)
        except InputError as error:
            raise read.error("file", str(error)) from None
        if len(argument) > MOST_ROWS:
            raise read.error(
                "file",
                f"expected at most {MOST_ROWS} rows in a table over a formula, found {len(argument)}; thin it out",
            )
        if np.diff(argument).min() < CLOSEST * max(1.0, float(np.abs(argument).max())):
            raise read.error("file", f"{path}: two rows of the first column are equal to rounding; remove one of them")
        return {name: _table(over, argument, values, interpolation) for name, values in columns.items()}, text


def _is_quantity(text: str) -> bool:
    """Whether a text is a number, with or without a unit."""
    split = split_number(text)
    return split is not None and (not split[1] or any(split[1] in units for units in UNITS.values()))


def _table(over: Expression, argument: Array, values: Array, interpolation: str) -> Expression:
    if interpolation == "cubic" and len(argument) > 2:
        from scipy.interpolate import CubicSpline

        powers = CubicSpline(argument, values).c[::-1].T
    else:
        powers = np.stack([values[:-1], np.diff(values) / np.diff(argument)], axis=1)
    knots, pieces = tuple(argument.tolist()), tuple(tuple(row) for row in powers.tolist())
    corners = knots if len(pieces[0]) == 2 else (knots[0], knots[-1])
    term = Term("table", (over.term,), (knots, pieces, float(values[-1]), corners))
    return Expression(f"table over {over.text}", term, repr(term))


def read_active(read: Fields, formulas: FormulaReader) -> Expression | None:
    """Read `active`, the formula while which is positive a force acts. Raises InputError naming file and key."""
    read.known("active")
    return formulas.read(read, "active") if "active" in read else None


def active_switches(own: tuple[Term, ...], active: Expression | None) -> tuple[Term, ...]:
    """The functions whose signs change where a force is not smooth, `active` among them, each once."""
    return own if active is None else tuple(dict.fromkeys((*own, active.term)))


def on_or_off(active: Expression | None, symbols: Symbols, sides: Sides) -> casadi.SX | float:
    """1 while a force acts, and else 0."""
    if active is None:
        return 1.0
    return Expression("", Term("step", (active.term,))).value(symbols, None, sides)


def common(formulas: Sequence[Expression]) -> tuple[str, ...]:
    """The frames that formulas contain, each once."""
    return tuple(dict.fromkeys(name for formula in formulas for name in formula.frames))
