"""Expands xacro with the package xacro, which is an extra.

A xacro file contains Python expressions and names of files. Both are restricted here: an expression consists of
numbers, texts, lists, arithmetic, comparisons, indices and calls of xacro's functions, without comprehensions, lambdas,
private names or reflection; files must be such as a robot file may name; the environment is not read. The number of
evaluations is limited, and the whole runs in a process of its own with limits of CPU time and memory, because a few
lines of macros and texts can grow without bound.
"""

from __future__ import annotations

import ast
import contextlib
import re
from collections.abc import Callable, Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final
from xml.parsers import expat

from bellcrank.errors import InputError
from bellcrank.files.access import MOST_TEXT, FileAccess
from bellcrank.files.limited_process import MEMORY, SECONDS, Budget, OverBudgetError, limited
from bellcrank.messages import unknown_name
from bellcrank.robot.formats.xml_tree import parse_xml, read_text

MOST_EVALUATIONS: Final = 200_000
MOST_LETTERS: Final = 2_000  # of an expression
MOST_POWER: Final = 64
MOST_VALUE: Final = 1_000_000  # characters of a text, or entries of a list, that an expression stands for
_NODES: Final = (
    ast.Expression, ast.Constant, ast.Name, ast.Load, ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare, ast.IfExp,
    ast.Call, ast.keyword, ast.Attribute, ast.Subscript, ast.Slice, ast.List, ast.Tuple, ast.Dict, ast.operator,
    ast.unaryop, ast.boolop, ast.cmpop,
)  # fmt: skip
_REFUSED: Final = frozenset(
    (
        "vars",
        "type",
        "map",
        "filter",
        "format",
        "format_map",
        "mro",
        "env",
        "optenv",
        "range",
        "factorial",
        "comb",
        "perm",
    )
)
_ARG = re.compile(r"""<xacro:arg\b[^>]*?\bname\s*=\s*["']([^"']+)["']""")


def expanded(text: str, source: Path, access: FileAccess, args: Mapping[str, str]) -> str:
    """The text of a URDF that a xacro text stands for, with values of its <xacro:arg>; see `limited`.

    Raises InputError.
    """
    if find_spec("xacro") is None:
        raise InputError(
            f"{source}: contains xacro elements; install the extra (pip install 'bellcrank[xacro]'), or expand the "
            "file first: xacro robot.urdf.xacro > robot.urdf"
        )
    parse_xml(text, source)  # entities and nesting are refused here
    budget = Budget.of_environment()
    try:
        return limited(_expanded, budget, text, source, access, dict(args))
    except OverBudgetError:
        raise InputError(
            f"{source}: xacro: takes more than {budget}; expand it by itself (xacro FILE > robot.urdf), or allow more "
            f"with {SECONDS} and {MEMORY}"
        ) from None


def _expanded(text: str, source: Path, access: FileAccess, args: Mapping[str, str]) -> str:
    """As `expanded`, in this process: the package keeps its state in module variables."""
    import xml.dom.minidom

    import xacro

    try:
        document = xml.dom.minidom.parseString(text.encode("utf-8"))
    except expat.ExpatError as error:
        raise InputError(f'{source}: xacro: {error}; declare it: xmlns:NAME="…" at <robot>') from None
    declared = set(_ARG.findall(text))
    with _restricted(source, access, declared):
        try:
            xacro.init_stacks(str(source.resolve()))
            xacro.process_doc(document, mappings=dict(args))
            for name in args:
                if name not in declared:
                    raise InputError(f"xacro_args: {unknown_name('argument', name, sorted(declared))}")
            found = str(document.toxml())
        except RecursionError:
            raise InputError(f"{source}: xacro: macros or files refer to each other without an end") from None
        except Exception as error:  # the package passes on whatever an expression raises
            own = _own_error(error)
            if isinstance(own, MemoryError):
                raise own from None
            if own is not None:
                prefix = "" if str(source) in str(own) else f"{source}: xacro: "
                raise InputError(f"{prefix}{own}") from None
            message = " ".join(str(error).split())[:300] or type(error).__name__
            raise InputError(f"{source}: xacro: {message}; correct the file, or expand it by itself") from None
    if len(found) > MOST_TEXT:
        raise InputError(f"{source}: xacro: stands for more than {MOST_TEXT / 2**20:.0f} MiB of text")
    return found


@contextlib.contextmanager
def _restricted(source: Path, access: FileAccess, declared: set[str]) -> Iterator[None]:
    """The package with the restrictions of this module; the arguments of included files are added to `declared`."""
    import xml.dom.minidom
    from unittest import mock

    import xacro
    from xacro import substitution_args

    count = 0
    evaluate: Callable[..., Any] = xacro.safe_eval

    def checked(expression: str, *scopes: Any) -> Any:
        nonlocal count
        count += 1
        if count > MOST_EVALUATIONS:
            raise InputError(f"{source}: xacro: more than {MOST_EVALUATIONS} expressions are evaluated")
        _check(expression, source)
        value = evaluate(expression, *scopes)
        if isinstance(value, (str, list, tuple)) and len(value) > MOST_VALUE:
            kind = "characters" if isinstance(value, str) else "entries"
            raise InputError(f"{source}: xacro: more than {MOST_VALUE} {kind} in the value of '{expression[:40]}'")
        return value

    def located(name: str) -> str:
        current = Path(xacro.filestack[-1])
        path = access.by(current).path(name)
        if str(path.resolve()) in xacro.filestack:
            raise InputError(f"{source}: xacro: {path} includes itself, directly or through others")
        return str(path)

    def parse(given: object, filename: str | None = None) -> Any:
        path = Path(filename or source)
        if not access.allows(path):
            raise InputError(f"{source}: xacro: {path} is not allowed")
        content = read_text(path)
        parse_xml(content, path)
        declared.update(_ARG.findall(content))
        return xml.dom.minidom.parseString(content.encode("utf-8"))

    def refuse(*arguments: object, **others: object) -> str:
        raise InputError(f"{source}: xacro: the environment and $(eval …) are not supported; write the value")

    def find(package: str) -> str:
        for folder in (source.resolve().parent, *source.resolve().parents):
            for path in (folder, folder / package):
                if path.name == package and path.is_dir():
                    return str(path)
        raise InputError(f"{source}: xacro: $(find {package}): no folder of this name is beside or above the file")

    symbols = {**xacro._global_symbols, "xacro": xacro._global_symbols["xacro"]}
    with (
        mock.patch.object(xacro, "safe_eval", checked),
        mock.patch.object(xacro, "abs_filename_spec", located),
        mock.patch.object(xacro, "parse", parse),
        mock.patch.object(xacro, "_global_symbols", symbols),
        mock.patch.object(substitution_args, "_eval_env", refuse),
        mock.patch.object(substitution_args, "_eval_optenv", refuse),
        mock.patch.object(substitution_args, "_eval", refuse),
        mock.patch.object(substitution_args, "_eval_find", find),
    ):
        yield


def _own_error(error: BaseException | None) -> InputError | MemoryError | None:
    """The InputError or MemoryError that an exception of the package wraps."""
    for _ in range(100):
        if error is None or isinstance(error, (InputError, MemoryError)):
            return error
        inner = getattr(error, "exc", None)
        error = inner if isinstance(inner, BaseException) else error.__cause__ or error.__context__
    return None


def _check(expression: str, source: Path) -> None:
    """Refuse an expression that is more than arithmetic and calls. Raises InputError."""
    text = expression.strip()
    shown = " ".join(text.split())[:60]
    if len(text) > MOST_LETTERS:
        raise InputError(f"{source}: xacro: an expression has more than {MOST_LETTERS} characters")
    try:
        tree = ast.parse(text, mode="eval")
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        raise InputError(f"{source}: xacro: '{shown}' is not an expression") from None
    for node in ast.walk(tree):
        name = node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""
        if not isinstance(node, _NODES) or name.startswith("_") or name in _REFUSED:
            what = f"'{name}'" if name else type(node).__name__
            raise InputError(f"{source}: xacro: '{shown}': {what} is not supported; write the value")
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow) and not _small(node.right):
            raise InputError(f"{source}: xacro: '{shown}': expected a number of at most {MOST_POWER} as exponent")
        if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.LShift, ast.Mod)) and _is_text(node.left):
            raise InputError(f"{source}: xacro: '{shown}': formatting of texts is not supported")
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.LShift):
            raise InputError(f"{source}: xacro: '{shown}': '<<' is not supported")
        if (
            isinstance(node, ast.BinOp)
            and isinstance(node.op, ast.Mult)
            and (_is_long(node.left) or _is_long(node.right))
        ):
            raise InputError(f"{source}: xacro: '{shown}': texts and lists cannot be repeated")


def _small(node: ast.expr) -> bool:
    value = node.operand if isinstance(node, ast.UnaryOp) else node
    return isinstance(value, ast.Constant) and isinstance(value.value, (int, float)) and abs(value.value) <= MOST_POWER


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def _is_long(node: ast.expr) -> bool:
    return _is_text(node) or isinstance(node, (ast.List, ast.Tuple))
