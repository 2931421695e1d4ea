"""Expressions in scene files, such as "2 * slide.velocity * swing.velocity". Their text is parsed, never executed.

An expression may contain numbers, pi, t (s), the scene's parameters, JOINT.position, .velocity and .acceleration,
frame('NAME').x, y, z, vx, vy, vz, wx, wy, wz (world axes, m, m/s and rad/s), output('NAME') or output('NAME').x, + - *
/, ** with a constant exponent, and the functions in FUNCTIONS; step(x) is 0 for x < 0 and else 1. A joint whose name is
not an identifier is written joint('odd-name').position.

Where abs, sign, step, min or max switch from one formula to another, an expression is not smooth. `Expression.switches`
are the functions whose signs change there. A simulation ends a step at each of these times, and its forces keep the
formula of one side for a whole step, so that they are smooth there: `value` takes these sides.
"""

from __future__ import annotations

import ast
import math
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

from bellcrank.elements.element import AuxiliaryStates
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.robot.robot import Robot

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols

FUNCTIONS: Final = {  # number of arguments; None: two or more
    "sin": 1, "cos": 1, "tan": 1, "asin": 1, "acos": 1, "atan": 1, "atan2": 2, "sqrt": 1, "exp": 1, "log": 1, "abs": 1,
    "sign": 1, "step": 1, "min": None, "max": None,
}  # fmt: skip
JOINT = ("position", "velocity", "acceleration")
FRAME = ("x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz")
LONGEST, DEEPEST = 2000, 200
_NAMED = ("joint", "frame", "output")
_GUARDING = ("sqrt", "log", "asin", "acos", "tan")  # functions that, like powers and quotients, have no value somewhere
_VARYING = ("time", "joint", "frame", "auxiliary", "gear load")  # leaves that change along a run
_CONSTANT: Final[dict[str, Callable[..., Any]]] = {  # (value, *pieces) -> number
    "number": lambda value: value, "negative": lambda _, x: -x, "+": lambda _, x, y: x + y, "-": lambda _, x, y: x - y,
    "*": lambda _, x, y: x * y, "/": lambda _, x, y: x / y, "**": lambda _, x, y: x**y,
}  # fmt: skip
_SIGNS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}


@dataclass(frozen=True)
class Term:
    """A node of an expression: an operation on other terms, or a leaf with a `value` (a number, or names)."""

    operation: str
    pieces: tuple[Term, ...] = ()
    value: Any = None

    def leaves(self) -> Iterator[Term]:
        """The numbers and names in the term."""
        if not self.pieces:
            yield self
        for piece in self.pieces:
            yield from piece.leaves()

    def nodes(self) -> Iterator[Term]:
        """The term and all terms within it."""
        yield self
        for piece in self.pieces:
            yield from piece.nodes()


Sides = Mapping[Term, "casadi.SX"]  # of the functions of `Expression.switches`: 1 or -1
OutputTerm = Callable[[str, str], Term]  # (name, component or "") -> the term of an output; raises InputError


@dataclass(frozen=True)
class Expression:
    """An expression that was parsed and whose names exist. Made by `parse_expression`.

    `meaning` tells expressions with the same text apart: those with tables or outputs.
    """

    text: str
    term: Term = field(compare=False)
    meaning: str = ""

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that the expression contains."""
        return tuple(dict.fromkeys(leaf.value[0] for leaf in self.term.leaves() if leaf.operation == "frame"))

    @property
    def operations(self) -> set[str]:
        """The kinds of its numbers and names: "number", "time", "parameter", "joint", "frame"."""
        return {leaf.operation for leaf in self.term.leaves()}

    @property
    def switches(self) -> tuple[Term, ...]:
        """The functions whose signs change where the expression is not smooth, each once, the innermost first."""
        found: dict[Term, None] = {}
        for node in reversed(list(self.term.nodes())):
            if node.operation in ("abs", "sign", "step"):
                found[node.pieces[0]] = None
            elif node.operation == "table":
                found[Term("corners", node.pieces, node.value[3])] = None
            elif node.operation in ("min", "max"):
                result, *others = node.pieces
                for piece in others:
                    found[Term("-", (result, piece))] = None
                    result = Term(node.operation, (result, piece))
        return tuple(term for term in found if any(leaf.operation in _VARYING for leaf in term.leaves()))

    def value(self, symbols: Symbols, acceleration: casadi.SX | None = None, sides: Sides | None = None) -> casadi.SX:
        """The expression over symbols; `acceleration` (nv) is required if it contains accelerations."""
        import casadi

        return casadi.SX(_build(self.term, symbols, acceleration, sides or {}))


def delayed(expression: Expression, delay: float) -> Expression:
    """An expression of time alone, some time (s) later."""

    def later(term: Term) -> Term:
        if term.operation == "time":
            return Term("-", (term, Term("number", value=delay)))
        return Term(term.operation, tuple(map(later, term.pieces)), term.value)

    whole = later(expression.term)
    return Expression(expression.text, whole, repr(whole))


def term_value(term: Term, symbols: Symbols, sides: Sides) -> casadi.SX:
    """A term without accelerations over symbols, such as one of `Expression.switches`."""
    import casadi

    return casadi.SX(_build(term, symbols, None, sides))


def parse_expression(
    text: str, robot: Robot, parameters: Mapping[str, Any], output: OutputTerm | None = None
) -> Expression:
    """Parse an expression; `output` gives the terms of outputs where they may be named.

    Raises InputError that quotes the part that is not valid, or the unknown name.
    """
    tree = syntax_tree(text)
    term = Reader(text.strip(), robot, parameters, output).term(tree.body, 0)
    return Expression(
        text, term, repr(term) if any(isinstance(n, ast.Name) and n.id == "output" for n in ast.walk(tree)) else ""
    )


def syntax_tree(text: str) -> ast.Expression:
    """Python's syntax tree of an expression. Raises InputError that quotes what is none."""
    if len(text) > LONGEST:
        raise InputError(f"expected an expression of at most {LONGEST} characters, found {len(text)}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Python's warnings on literals do not apply here
            return ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        place = getattr(error, "offset", None)
        where = f" at character {place}" if place else ""
        why = getattr(error, "msg", None) or (error.reason if isinstance(error, UnicodeEncodeError) else error)
        raise InputError(f"'{_short(text)}' is not an expression: {why}{where}") from None


class Reader:
    """Converts Python's syntax tree to terms, and refuses everything that expressions do not allow."""

    def __init__(
        self, text: str, robot: Robot, parameters: Mapping[str, Any], output: OutputTerm | None = None
    ) -> None:
        self.text, self.robot, self.parameters, self.output = text, robot, parameters, output

    def term(self, node: ast.expr, depth: int) -> Term:
        """The term of a node. Raises InputError that quotes what is not allowed."""
        if depth > DEEPEST:
            raise InputError(f"the expression '{_short(self.text)}' is nested too deeply")
        if isinstance(node, ast.Constant):
            return self._number(node)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
            inner = self.term(node.operand, depth + 1)
            return Term("negative", (inner,)) if isinstance(node.op, ast.USub) else inner
        if isinstance(node, ast.BinOp) and type(node.op) in _SIGNS:
            left, right = self.term(node.left, depth + 1), self.term(node.right, depth + 1)
            sign = _SIGNS[type(node.op)]
            if sign == "**":
                right = Term("number", value=self._constant(right, node.right))
            return Term(sign, (left, right))
        if isinstance(node, ast.Name):
            return self._name(node)
        if isinstance(node, ast.Attribute):
            return self._quantity(node)
        if isinstance(node, ast.Call) and not node.keywords and isinstance(node.func, ast.Name):
            return self._call(node, node.func.id, depth)
        raise self._error(node, "expected numbers, names, + - * / ** and functions")

    def _number(self, node: ast.Constant) -> Term:
        value = node.value
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self._error(node, "expected a number")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self._error(node, "expected a finite number")
        return Term("number", value=number)

    def _constant(self, term: Term, node: ast.expr) -> float:
        """The number of a constant exponent. Raises InputError for any other term."""
        try:
            value = float(_CONSTANT[term.operation](term.value, *[self._constant(x, node) for x in term.pieces]))
        except (KeyError, ArithmeticError, TypeError, ValueError):
            value = math.nan
        if not math.isfinite(value):
            raise self._error(node, "an exponent must be a constant number")
        return value

    def _name(self, node: ast.Name) -> Term:
        if node.id == "pi":
            return Term("number", value=math.pi)
        if node.id == "t":
            return Term("time")
        if node.id in self.parameters:
            return Term("parameter", value=node.id)
        if node.id in self.robot.joint_names:
            raise self._error(node, f"expected one of {', '.join(f'{node.id}.{what}' for what in JOINT)}")
        raise self._error(node, unknown_name("name", node.id, ["pi", "t", *self.parameters, *self.robot.joint_names]))

    def _quantity(self, node: ast.Attribute) -> Term:
        owner, what = node.value, node.attr
        if isinstance(owner, ast.Name):
            return self._joint(node, owner.id, what)
        if isinstance(owner, ast.Call) and isinstance(owner.func, ast.Name) and owner.func.id in _NAMED:
            name = self._named(owner, owner.func.id)
            if owner.func.id == "output":
                return self._output(node, name, what)
            if owner.func.id == "joint":
                return self._joint(node, name, what)
            if name not in self.robot.frame_names:
                raise self._error(node, unknown_name("frame", name, self.robot.frame_names))
            if what not in FRAME:
                raise self._error(node, unknown_name("component of a frame", what, FRAME))
            return Term("frame", value=(name, what))
        raise self._error(node, "expected JOINT.position, joint('NAME').position or frame('NAME').x")

    def _named(self, node: ast.Call, kind: str) -> str:
        """The name in joint('NAME'), frame('NAME') or output('NAME')."""
        name = node.args[0].value if len(node.args) == 1 and isinstance(node.args[0], ast.Constant) else None
        if not isinstance(name, str) or node.keywords:
            raise self._error(node, f"expected {kind}('NAME')")
        return name

    def _output(self, node: ast.expr, name: str, component: str) -> Term:
        if self.output is None:
            raise self._error(node, "outputs can be named in forces and control only")
        try:
            return self.output(name, component)
        except InputError as error:
            raise self._error(node, str(error)) from None

    def _joint(self, node: ast.Attribute, name: str, what: str) -> Term:
        if name not in self.robot.joint_names:
            other = next((joint for joint in self.robot.joints if joint.name == name), None)
            if other is not None:
                raise self._error(
                    node, f"joint '{name}' is {other.kind}; write frame('LINK') of its child link instead"
                )
            raise self._error(node, unknown_name("joint", name, self.robot.joint_names))
        if what not in JOINT:
            raise self._error(node, unknown_name("component of a joint", what, JOINT))
        return Term("joint", value=(name, what))

    def _call(self, node: ast.Call, name: str, depth: int) -> Term:
        if name == "output":
            return self._output(node, self._named(node, name), "")
        if name in ("joint", "frame"):
            raise self._error(
                node, f"expected a component, such as {name}('NAME').{'x' if name == 'frame' else JOINT[0]}"
            )
        if name not in FUNCTIONS:
            raise self._error(node, unknown_name("function", name, FUNCTIONS))
        count = FUNCTIONS[name]
        if len(node.args) < 2 if count is None else len(node.args) != count:
            wanted = "at least two arguments" if count is None else f"{count} argument{'s' if count > 1 else ''}"
            raise self._error(node, f"{name} requires {wanted}, found {len(node.args)}")
        return Term(name, tuple(self.term(argument, depth + 1) for argument in node.args))

    def _error(self, node: ast.expr, message: str) -> InputError:
        piece = ast.get_source_segment(self.text, node) or self.text
        return InputError(f"'{_short(piece)}': {message}")


def _build(term: Term, s: Symbols, acceleration: casadi.SX | None, sides: Sides, guarded: bool = False) -> Any:
    """A term over symbols; in a `guarded` one abs, min, max and tables follow from the state even where sides are held.

    Such a term must not leave its side within a step, as the depth under a root must not: see `_GUARDING`.
    """
    import casadi

    if not term.pieces:
        return _leaf(term, s, acceleration)
    held = {} if guarded else sides
    if term.operation in ("sign", "step"):
        side = sides.get(term.pieces[0])
        if side is None:
            argument = _build(term.pieces[0], s, acceleration, sides, guarded)
            return casadi.sign(argument) if term.operation == "sign" else casadi.if_else(argument >= 0.0, 1.0, 0.0)
        return side if term.operation == "sign" else 0.5 + 0.5 * side
    fractional = term.operation == "**" and not float(term.pieces[1].value).is_integer()
    guards = [guarded or fractional or term.operation in _GUARDING] * len(term.pieces)
    if term.operation == "/":
        guards[1] = True
    pieces = [_build(piece, s, acceleration, sides, guard) for piece, guard in zip(term.pieces, guards, strict=True)]
    if term.operation == "table":
        knots, polynomials, last, corners = term.value
        side = held.get(Term("corners", term.pieces, corners))
        return _interpolated(pieces[0], knots, polynomials, last, corners, side)
    if term.operation == "corners":
        return _alternating(pieces[0], term.value)
    if term.operation in ("min", "max"):
        pick = casadi.fmin if term.operation == "min" else casadi.fmax
        result, before = pieces[0], term.pieces[0]
        for piece, value in zip(term.pieces[1:], pieces[1:], strict=True):
            side = held.get(Term("-", (before, piece)))
            if side is None:
                result = pick(result, value)
            else:  # positive where the earlier one is larger
                result = casadi.if_else((side > 0.0) == (term.operation == "max"), result, value)
            before = Term(term.operation, (before, piece))
        return result
    if term.operation in _CONSTANT:
        return _CONSTANT[term.operation](None, *pieces)
    if term.operation == "abs":
        side = held.get(term.pieces[0])
        return casadi.fabs(pieces[0]) if side is None else side * pieces[0]
    return getattr(casadi, term.operation)(*pieces)


def _leaf(term: Term, s: Symbols, acceleration: casadi.SX | None) -> Any:
    import casadi

    if term.operation == "number":
        return casadi.SX(term.value)
    if term.operation == "time":
        return s.t + s.clock if s.clock else s.t
    if term.operation == "parameter":
        return s.parameter(term.value)
    if term.operation == "auxiliary":  # a state of a drive, by its name, its labels and its number
        name, labels, k = term.value
        return s.auxiliary(AuxiliaryStates(name, labels))[k]
    if term.operation == "gear load":  # along the motion of a drive, by its name; found with the accelerations
        return s.gear_loads[term.value]
    if term.operation == "setting":  # a number of an element, which a parameter may set
        return casadi.SX(s.value(*term.value))
    name, what = term.value
    if term.operation == "joint":
        joint = s.joint(name)
        if what == "acceleration":
            assert acceleration is not None  # constraints with accelerations are refused when they are read
            return acceleration[joint.row]
        return joint.position if what == "position" else joint.velocity
    frame = s.frame(name)
    of = {"v": frame.linear, "w": frame.angular}.get(what[0], frame.position)
    return of["xyz".index(what[-1])]


def _interpolated(
    x: Any,
    knots: tuple[float, ...],
    pieces: tuple[tuple[float, ...], ...],
    last: float,
    corners: tuple[float, ...],
    side: Any,
) -> Any:
    """Polynomials of x − knots[i] (ascending powers) between knots, and the end values beyond them.

    Where the side of the corners (`_alternating`) is held and x is beyond a corner, the polynomial is that before it:
    the one that x belongs to when it is reflected there.
    """
    import casadi

    place = x
    if side is not None:
        nearest = casadi.SX(corners[0])
        for low, high in pairwise(corners):
            nearest = casadi.if_else(x >= 0.5 * (low + high), high, nearest)
        place = casadi.if_else(_alternating(x, corners) * side >= 0.0, x, 2.0 * nearest - x)
    start, powers = casadi.SX(knots[0]), [casadi.SX(power) for power in pieces[0]]
    for knot, piece in zip(knots[1:-1], pieces[1:], strict=True):
        beyond = place >= knot
        start = casadi.if_else(beyond, knot, start)
        powers = [casadi.if_else(beyond, new, old) for new, old in zip(piece, powers, strict=True)]
    value = casadi.SX(0)
    for power in reversed(powers):
        value = value * (x - start) + power
    value = casadi.if_else(place >= knots[-1], last, value)
    return casadi.if_else(place >= knots[0], value, pieces[0][0])


def _alternating(x: Any, zeros: tuple[float, ...]) -> Any:
    """A function with a continuous slope that vanishes at the given values of x only, and changes its sign there."""
    import casadi

    result = x - zeros[0]
    for k, (low, high) in enumerate(pairwise(zeros)):
        sign = 1.0 - 2.0 * (k % 2)
        result = casadi.if_else(x >= low, sign * (x - low) * (high - x) / (high - low), result)
    return casadi.if_else(x >= zeros[-1], (1.0 - 2.0 * ((len(zeros) - 1) % 2)) * (x - zeros[-1]), result)


def _short(text: str) -> str:
    line = " ".join(text.split())
    line = line if line.isprintable() else ascii(line)[1:-1]
    return line if len(line) <= 60 else line[:57] + "…"


def has_time(part: Any) -> bool:
    """Whether an expression in an element, event or output depends on t."""
    return any("time" in expression.operations for expression in expressions_in(part))


def expressions_in(value: Any) -> Iterator[Expression]:
    """The expressions in an element, event or output."""
    if isinstance(value, Expression):
        yield value
    elif isinstance(value, (list, tuple)):
        for entry in value:
            yield from expressions_in(entry)
    elif isinstance(value, Mapping):
        for entry in value.values():
            yield from expressions_in(entry)
    elif is_dataclass(value):
        for entry in fields(value):
            yield from expressions_in(getattr(value, entry.name))
