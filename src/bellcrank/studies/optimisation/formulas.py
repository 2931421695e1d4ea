"""Objectives and limits that are formulas of measures, such as "go.duration + 0.008 * elbow.peak_torque".

Their language is that of the expressions of scenes (elements/expression.py) with measures as names: numbers, pi, + - *
/ **, and its functions; measure('odd-name.peak_torque') where a name is no identifier. Measures count in SI units.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.elements.expression import FUNCTIONS, Reader, Term, syntax_tree, term_value
from bellcrank.errors import InputError
from bellcrank.messages import format_value, unknown_name

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True)
class Formula:
    """A formula of measures.

    Attributes:
        text: As it is written.
        term: What it says, with measures as parameters.
        leaves: The measures in it.
        unit: The unit of its value; "1" where it is not that of a measure.
    """

    text: str
    term: Term = field(repr=False)
    leaves: tuple[str, ...]
    unit: str

    def values(self, measures: Array) -> Array:
        """The values (n,) for those (n, leaves) of the measures; NaN where there is none."""
        if not measures.size:
            return np.empty(measures.shape[:-1])
        found = np.array(self._functions[0](measures.reshape(-1, len(self.leaves)).T)).ravel()
        return np.where(np.isfinite(found), found, np.nan).reshape(measures.shape[:-1])

    def slopes(self, measures: Array) -> Array:
        """The derivatives (leaves,) by the measures (leaves,)."""
        return np.array(self._functions[1](measures)).ravel()

    @cached_property
    def _functions(self) -> tuple[casadi.Function, casadi.Function]:
        import casadi

        x = casadi.SX.sym("x", len(self.leaves))
        value = term_value(self.term, _Named(dict(zip(self.leaves, casadi.vertsplit(x), strict=True))), {})  # type: ignore[arg-type]
        return casadi.Function("value", [x], [value]), casadi.Function("slopes", [x], [casadi.jacobian(value, x)])


class Formulas(Mapping[str, str]):
    """The units of measures by name; a name that is no measure is read as a formula of measures.

    Attributes:
        known: The formulas that were asked for, by their texts.
    """

    def __init__(self, units: Mapping[str, str]) -> None:
        self.units, self.known = dict(units), dict[str, Formula]()

    def __getitem__(self, name: str) -> str:
        """The unit. Raises InputError for an unknown measure, and for what is no formula of measures."""
        if name not in self.units and name not in self.known:
            self.known[name] = _read(name, self.units)
        return self.units[name] if name in self.units else self.known[name].unit

    def leaves_of(self, name: str) -> tuple[str, ...]:
        """The measures that a measure or formula is made from."""
        return self.known[name].leaves if name in self.known else (name,)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and bool(self[name])

    def __iter__(self) -> Any:
        return iter(self.units)

    def __len__(self) -> int:
        return len(self.units)


def _read(text: str, units: Mapping[str, str]) -> Formula:
    if _dotted(text):  # not a formula, but a name
        raise InputError(unknown_name("measure", text, units))
    term = _MeasureReader(text.strip(), units).term(syntax_tree(text).body, 0)
    leaves = tuple(dict.fromkeys(leaf.value for leaf in term.leaves() if leaf.operation == "parameter"))
    if not leaves:
        raise InputError(f"the formula {format_value(text)} names no measure")
    return Formula(text, term, leaves, _unit(term, units) or "1")


def _dotted(text: str) -> bool:
    return all(part.isidentifier() for part in text.strip().split("."))


def _unit(term: Term, units: Mapping[str, str]) -> str:
    """The unit of a term; empty of a plain number, "1" where measures of several units are combined."""
    if not term.pieces:
        return units[term.value] if term.operation == "parameter" else ""
    own = [_unit(piece, units) for piece in term.pieces]
    if term.operation in ("negative", "abs", "+", "-", "min", "max"):
        return reduce(lambda a, b: a if a == b or not b else b if not a else "1", own)
    if term.operation in ("*", "/") and not own[1]:
        return own[0]
    if term.operation == "*" and not own[0]:
        return own[1]
    return "1" if any(own) else ""


class _MeasureReader(Reader):
    """Reads the names of measures, as parameters."""

    def __init__(self, text: str, units: Mapping[str, str]) -> None:
        self.text, self.units = text, units

    def _name(self, node: ast.Name) -> Term:
        return Term("number", value=math.pi) if node.id == "pi" else self._measure(node, node.id)

    def _quantity(self, node: ast.Attribute) -> Term:
        parts, owner = [node.attr], node.value
        while isinstance(owner, ast.Attribute):
            parts, owner = [owner.attr, *parts], owner.value
        if not isinstance(owner, ast.Name):
            raise self._error(node, "expected the name of a measure")
        return self._measure(node, ".".join([owner.id, *parts]))

    def _measure(self, node: ast.expr, name: str) -> Term:
        if name not in self.units:
            raise self._error(node, unknown_name("measure", name, self.units))
        return Term("parameter", value=name)

    def _call(self, node: ast.Call, name: str, depth: int) -> Term:
        if name == "measure":
            return self._measure(node, self._named(node, name))
        if name not in FUNCTIONS:
            raise self._error(node, unknown_name("function", name, [*FUNCTIONS, "measure"]))
        return super()._call(node, name, depth)


class _Named:
    """Symbols of measures, where those of a scene's parameters are expected."""

    def __init__(self, symbols: Mapping[str, casadi.SX]) -> None:
        self.symbols = symbols

    def parameter(self, name: str) -> casadi.SX:
        """The symbol of a measure."""
        return self.symbols[name]


MOST_ROWS = 64  # linearised functions of one formula


def choices(several: Sequence[Sequence[Any]], drops: Sequence[Sequence[float]]) -> list[tuple[Any, ...]]:
    """All combinations of one of each, but for those that are least likely: with the largest of their `drops`."""
    left = [sorted(range(len(each)), key=each.__getitem__) for each in drops]
    while math.prod(map(len, left)) > MOST_ROWS:
        most = max((k for k, each in enumerate(left) if len(each) > 1), key=lambda k: drops[k][left[k][-1]])
        left[most].pop()
    return [tuple(several[k][i] for k, i in enumerate(which)) for which in product(*left)]
