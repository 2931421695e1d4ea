"""Arrays of casadi expressions that answer NumPy's functions, so that a formula of arrays gives its own expression.

Code that judges arrays of numbers is called with an `ExpressionArray` in place of one of them. NumPy hands its ufuncs
and functions to it (NEP 13 and NEP 18), and what they return is the same formula as expressions; nothing is written
twice. NaN stands for "unknown" in such code, which casadi would fold away (x ≠ x): each element has beside its
expression another one that says whether it is NaN. A question that Python has to answer (`if`, an index) about
a number that is not fixed raises TypeError: then the formula depends on it by more than expressions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, reduce
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray

from bellcrank.arrays import Mask

if TYPE_CHECKING:
    import casadi

Elements = NDArray[np.object_]
NAN = float("nan")


class ExpressionArray(NDArrayOperatorsMixin):
    """An array of expressions.

    Args:
        elements: An object array of numbers and casadi.SX scalars.
        unknown: Of the same shape: whether each element is NaN, as 0, 1 or an SX; None where none is.
    """

    def __init__(self, elements: Elements, unknown: Elements | None = None) -> None:
        self.elements = elements
        self.unknown = _objects(np.zeros(elements.shape)) if unknown is None else unknown

    @classmethod
    def of(cls, vector: casadi.SX, shape: tuple[int, ...]) -> ExpressionArray:
        """The elements of a vector in an array of a shape, the last index first."""
        return cls(_filled([vector[i] for i in range(vector.numel())], shape))

    # ---- as of an array

    @property
    def shape(self) -> tuple[int, ...]:
        """Its shape."""
        return self.elements.shape

    @property
    def T(self) -> ExpressionArray:
        """The transpose."""
        return ExpressionArray(self.elements.T, self.unknown.T)

    def __len__(self) -> int:
        return len(self.elements)

    def __getitem__(self, index: Any) -> ExpressionArray:
        found, unknown = self.elements[index], self.unknown[index]
        return ExpressionArray(_array_of(found), _array_of(unknown))

    def __setitem__(self, index: Any, value: Any) -> None:
        given = _expressions(value)
        self.elements[index], self.unknown[index] = given.elements, given.unknown

    def copy(self) -> ExpressionArray:
        """A copy."""
        return ExpressionArray(self.elements.copy(), self.unknown.copy())

    def astype(self, kind: Any) -> ExpressionArray:
        """Itself: expressions have one kind."""
        return self

    def __bool__(self) -> bool:
        raise TypeError("whether an expression holds is not fixed")

    def __float__(self) -> float:
        raise TypeError("the value of an expression is not fixed")

    def __array__(self, *arguments: Any, **options: Any) -> NDArray[Any]:
        raise TypeError("expressions are not numbers")

    # ---- NumPy's protocols

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        name = ufunc.__name__
        if method != "__call__" or options:
            return NotImplemented
        if name == "matmul":
            return _product(*map(_expressions, inputs))
        return _elementwise(_operations()[name], inputs) if name in _operations() else NotImplemented

    def __array_function__(self, function: Callable[..., Any], kinds: Any, inputs: Any, options: Any) -> Any:
        name = function.__name__
        if name == "where" and len(inputs) == 3:
            return _elementwise(_where, inputs)
        if name in ("stack", "concatenate"):
            arrays = [_expressions(each) for each in inputs[0]]
            parts = ([each.elements for each in arrays], [each.unknown for each in arrays])
            return ExpressionArray(*(function(part, *inputs[1:], **options) for part in parts))
        if name in ("max", "amax") and options == {"axis": 1}:
            return reduce(np.maximum, [inputs[0][:, k] for k in range(inputs[0].shape[1])])
        if name == "broadcast_arrays":
            arrays = [_expressions(each) for each in inputs]
            both = (function(*(each.elements for each in arrays)), function(*(each.unknown for each in arrays)))
            return [ExpressionArray(*each) for each in zip(*both, strict=True)]
        return NotImplemented


def expressions(value: Any) -> list[casadi.SX]:
    """The elements of an array as expressions, NaN where they are unknown."""
    array = _expressions(value)
    pairs = zip(array.elements.flat, array.unknown.flat, strict=True)
    return [_casadi().SX(_choice(unknown, NAN, one)) for one, unknown in pairs]


def _filled(values: Sequence[Any], shape: tuple[int, ...]) -> Elements:
    found = np.empty(len(values), dtype=object)
    for k, value in enumerate(values):
        found[k] = value
    return found.reshape(shape)


def _objects(numbers: Any) -> Elements:
    array = np.asarray(numbers)
    return _filled([float(value) for value in array.flat], array.shape)


def _array_of(value: Any) -> Elements:
    return value if isinstance(value, np.ndarray) else _filled([value], ())


def _expressions(value: Any) -> ExpressionArray:
    if isinstance(value, ExpressionArray):
        return value
    numbers = np.asarray(value, dtype=np.float64)
    return ExpressionArray(_objects(numbers), _objects(np.isnan(numbers)))


def _fixed(value: Any) -> float | None:
    """The number that an expression is; None where it depends on something."""
    if isinstance(value, int | float):
        return float(value)
    return float(value) if value.is_constant() else None


# ---- operations: (value, whether it is NaN) of each operand give those of the result

Element = tuple[Any, Any]
Operation = Callable[..., Element]


def _elementwise(operation: Operation, inputs: Sequence[Any]) -> ExpressionArray | Mask:
    """The operation on each element; an array of booleans where it asks something whose answer is fixed."""
    arrays = [_expressions(each) for each in inputs]
    shape = np.broadcast_shapes(*(each.shape for each in arrays))
    operands = [
        zip(np.broadcast_to(each.elements, shape).flat, np.broadcast_to(each.unknown, shape).flat, strict=True)
        for each in arrays
    ]
    found = [operation(*each) for each in zip(*operands, strict=True)]
    values = _filled([value for value, _ in found], shape)
    if operation in _questions():
        fixed = [_fixed(value) for value in values.flat]
        if None not in fixed:
            return np.array(fixed, dtype=bool).reshape(shape)
    return ExpressionArray(values, _filled([unknown for _, unknown in found], shape))


def _product(first: ExpressionArray, second: ExpressionArray) -> ExpressionArray:
    """A product of matrices: unknown where a number of its row or column is."""
    count = first.unknown @ np.ones(second.shape) + np.ones(first.shape) @ second.unknown
    unknown = [min(fixed, 1.0) if (fixed := _fixed(one)) is not None else one > 0 for one in count.flat]
    return ExpressionArray(first.elements @ second.elements, _filled(unknown, count.shape))


def _or(*flags: Any) -> Any:
    found: Any = 0.0
    for flag in flags:
        fixed = _fixed(flag)
        if fixed:
            return 1.0
        if fixed is None:
            found = flag if _fixed(found) == 0.0 else _casadi().logic_or(found, flag)
    return found


def _not(flag: Any) -> Any:
    fixed = _fixed(flag)
    return float(not fixed) if fixed is not None else _casadi().logic_not(flag)


def _and(*flags: Any) -> Any:
    return _not(_or(*map(_not, flags)))


def _choice(flag: Any, first: Any, second: Any) -> Any:
    fixed = _fixed(flag)
    if fixed is not None:
        return first if fixed else second
    return _casadi().if_else(flag, first, second)


def _where(flag: Element, first: Element, second: Element) -> Element:
    return _choice(flag[0], first[0], second[0]), _choice(flag[0], first[1], second[1])


def _casadi() -> Any:
    import casadi

    return casadi


@cache
def _operations() -> dict[str, Operation]:
    """The operation of each of NumPy's ufuncs that is known here."""
    ca = _casadi()

    def plain(function: Callable[..., Any]) -> Operation:
        def operation(*operands: Element) -> Element:
            unknown = _or(*(each for _, each in operands))
            return (NAN, 1.0) if _fixed(unknown) else (function(*(ca.SX(value) for value, _ in operands)), unknown)

        return operation

    def question(function: Callable[..., Any]) -> Operation:
        def operation(*operands: Element) -> Element:
            known = _not(_or(*(each for _, each in operands)))
            return (
                _and(function(*(ca.SX(value) for value, _ in operands)), known) if _fixed(known) != 0.0 else 0.0
            ), 0.0

        return operation

    def of_known(function: Callable[..., Any]) -> Operation:
        def operation(first: Element, second: Element) -> Element:
            both = function(ca.SX(first[0]), ca.SX(second[0]))
            value = _choice(first[1], second[0], _choice(second[1], first[0], both))
            return value, _and(first[1], second[1])

        return operation

    def logical(function: Callable[..., Any]) -> Operation:
        return lambda *operands: (function(*(value for value, _ in operands)), 0.0)

    questions = {
        "less": lambda a, b: a < b, "less_equal": lambda a, b: a <= b, "equal": lambda a, b: a == b,
        "greater": lambda a, b: a > b, "greater_equal": lambda a, b: a >= b, "not_equal": lambda a, b: a != b,
    }  # fmt: skip
    functions = {
        "add": lambda a, b: a + b, "subtract": lambda a, b: a - b, "multiply": lambda a, b: a * b,
        "divide": lambda a, b: a / b, "power": lambda a, b: a**b, "negative": lambda a: -a, "absolute": ca.fabs,
        "sqrt": ca.sqrt, "square": lambda a: a * a, "sign": ca.sign, "maximum": ca.fmax, "minimum": ca.fmin,
    }  # fmt: skip
    return {
        **{name: plain(function) for name, function in functions.items()},
        **{name: question(function) for name, function in questions.items()},
        "fmax": of_known(ca.fmax),
        "fmin": of_known(ca.fmin),
        "isnan": lambda operand: (operand[1], 0.0),
        "bitwise_and": logical(_and),
        "bitwise_or": logical(_or),
        "invert": logical(_not),
    }


@cache
def _questions() -> tuple[Operation, ...]:
    names = ("less", "less_equal", "equal", "greater", "greater_equal", "not_equal")
    return tuple(_operations()[name] for name in (*names, "isnan", "bitwise_and", "bitwise_or", "invert"))
