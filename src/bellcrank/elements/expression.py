"""Expressions in scene files, such as "2 * slide.velocity * swing.velocity". Their text is parsed, never executed.

An expression may contain numbers, pi, t (s), the scene's parameters, JOINT.position, .velocity and .acceleration,
frame('NAME').x, y, z, vx, vy, vz (world axes, m and m/s), + - * /, ** with a constant exponent, and the functions in
FUNCTIONS. A joint whose name is not an identifier is written joint('odd-name').position.
"""

from __future__ import annotations

import ast
import math
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import TYPE_CHECKING, Any, Final

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.robot.robot import Robot

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols

FUNCTIONS: Final = {  # number of arguments; None: two or more
    "sin": 1, "cos": 1, "tan": 1, "asin": 1, "acos": 1, "atan": 1, "atan2": 2, "sqrt": 1, "exp": 1, "log": 1, "abs": 1,
    "sign": 1, "min": None, "max": None,
}  # fmt: skip
JOINT = ("position", "velocity", "acceleration")
FRAME = ("x", "y", "z", "vx", "vy", "vz")
LONGEST, DEEPEST = 2000, 200
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


@dataclass(frozen=True)
class Expression:
    """An expression that was parsed and whose names exist. Made by `parse_expression`."""

    text: str
    term: Term = field(compare=False)

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that the expression contains."""
        return tuple(dict.fromkeys(leaf.value[0] for leaf in self.term.leaves() if leaf.operation == "frame"))

    @property
    def operations(self) -> set[str]:
        """The kinds of its numbers and names: "number", "time", "parameter", "joint", "frame"."""
        return {leaf.operation for leaf in self.term.leaves()}

    def value(self, symbols: Symbols, acceleration: casadi.SX | None = None) -> casadi.SX:
        """The expression over symbols; `acceleration` (nv) is required if it contains accelerations."""
        import casadi

        return casadi.SX(_build(self.term, symbols, acceleration))


def parse_expression(text: str, robot: Robot, parameters: Mapping[str, Any]) -> Expression:
    """Parse an expression. Raises InputError that quotes the part that is not valid, or the unknown name."""
    if len(text) > LONGEST:
        raise InputError(f"expected an expression of at most {LONGEST} characters, found {len(text)}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Python's warnings on literals do not apply here
            tree = ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        place = getattr(error, "offset", None)
        where = f" at character {place}" if place else ""
        raise InputError(
            f"'{_short(text)}' is not an expression: {getattr(error, 'msg', None) or error}{where}"
        ) from None
    return Expression(text, _Reader(text.strip(), robot, parameters).term(tree.body, 0))


class _Reader:
    """Converts Python's syntax tree to terms, and refuses everything that expressions do not allow."""

    def __init__(self, text: str, robot: Robot, parameters: Mapping[str, Any]) -> None:
        self.text, self.robot, self.parameters = text, robot, parameters

    def term(self, node: ast.expr, depth: int) -> Term:
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
        if isinstance(owner, ast.Call) and isinstance(owner.func, ast.Name) and owner.func.id in ("joint", "frame"):
            arguments = owner.args
            name = arguments[0].value if len(arguments) == 1 and isinstance(arguments[0], ast.Constant) else None
            if not isinstance(name, str) or owner.keywords:
                raise self._error(owner, f"expected {owner.func.id}('NAME')")
            if owner.func.id == "joint":
                return self._joint(node, name, what)
            if name not in self.robot.frame_names:
                raise self._error(node, unknown_name("frame", name, self.robot.frame_names))
            if what not in FRAME:
                raise self._error(node, unknown_name("component of a frame", what, FRAME))
            return Term("frame", value=(name, what))
        raise self._error(node, "expected JOINT.position, joint('NAME').position or frame('NAME').x")

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


def _build(term: Term, s: Symbols, acceleration: casadi.SX | None) -> Any:
    import casadi

    if term.operation == "number":
        return casadi.SX(term.value)
    if term.operation == "time":
        return s.t + s.clock if s.clock else s.t
    if term.operation == "parameter":
        return s.parameter(term.value)
    if term.operation == "joint":
        name, what = term.value
        joint = s.joint(name)
        if what == "acceleration":
            assert acceleration is not None  # constraints with accelerations are refused when they are read
            return acceleration[joint.row]
        return joint.position if what == "position" else joint.velocity
    if term.operation == "frame":
        name, what = term.value
        frame = s.frame(name)
        return frame.position["xyz".index(what)] if len(what) == 1 else frame.linear["xyz".index(what[1])]
    pieces = [_build(piece, s, acceleration) for piece in term.pieces]
    if term.operation in ("min", "max"):
        pick = casadi.fmin if term.operation == "min" else casadi.fmax
        result = pieces[0]
        for piece in pieces[1:]:
            result = pick(result, piece)
        return result
    if term.operation in _CONSTANT:
        return _CONSTANT[term.operation](None, *pieces)
    operation = casadi.fabs if term.operation == "abs" else getattr(casadi, term.operation)
    return operation(*pieces)


def _short(text: str) -> str:
    line = " ".join(text.split())
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
    elif is_dataclass(value):
        for entry in fields(value):
            yield from expressions_in(getattr(value, entry.name))
