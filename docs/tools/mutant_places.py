"""Places of the physics code where a small fault can be put, and the drawing of such faults by seed.

A fault (a mutant) changes the text of one file in one place. There are four kinds: a *sign* (a + b -> a - b, -a -> a,
+= -> -=), a *factor* (0.5 -> 1.0, 2 -> 3, a * b -> a * b * 2), an *index* (a[0] -> a[1], a[:n] -> a[:n + 1],
axis=0 -> axis=1) and a *comparison* (< -> <=, == -> !=, min -> max, and -> or). Texts are left alone: docstrings,
annotations, messages, tables, plots, and the arguments of checks.
"""

from __future__ import annotations

import ast
import hashlib
import io
import tokenize
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

KINDS = ("sign", "factor", "index", "comparison")
ROOMS = ("robot", "actuators", "motion", "elements", "dynamics", "simulation", "analysis", "sizing", "planning")
SOME_OF = {  # rooms that also hold what is no physics: these modules compute
    "scene": "events free_joint_start initial output_quantities",
    "studies": "axes design_space distributions exceedance intervals measures plain_axes sample_statistics samples "
    "scene_designs sensitivity sizing_changes many_sizings sizing_measures sweep_statistics tolerance",
    "codegen": "directional expression_graph kernels llvm_ir tracer",
}
TEXT_FILES = set(  # words in the names of files that read, write, check and show
    "cache catalog catalogue check checks comparison csv fields file files finding json names notes options plot plots "
    "save status summary tables text warnings writer xml".split()
)
TEXT_MODULES = {"load", "load_run", "mesh_path"}
TEXT_FUNCTIONS = set(
    "csv dict draw html label labels message name names note notes plot print repr say str summary text texts title "
    "titled titles warnings".split()
)
TEXT_CALLS = set(
    "BellcrankError InputError ValueError error fail format format_value join note print refuse title unknown_name "
    "warn".split()
)
TEXT_ARGUMENTS = {"label", "message", "progress", "remedy", "stacklevel", "title", "where"}
TYPES = {"Annotated", "Callable", "Literal", "NDArray", "dict", "list", "tuple", "type"}
SWAPPED = {"+": "-", "-": "+", "+=": "-=", "-=": "+=", "<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=",
           "!=": "==", "and": "or", "or": "and", "&&": "||", "||": "&&"}  # fmt: skip
SWAPPED |= {a: b for low, high in (("min", "max"), ("minimum", "maximum"), ("fmin", "fmax"), ("nanmin", "nanmax"),
                                   ("argmin", "argmax")) for a, b in ((low, high), (high, low))}  # fmt: skip
SMALL = 1e-3  # a nonzero number below it is a tolerance: twice a tolerance is no fault


@dataclass(frozen=True)
class Mutant:
    """One change of the text of one file.

    `file` is relative to the folder of the package, or to src/cpp. `start` and `end` are places in its text. `scope` is
    the lines, first and last, of the function around it; None outside functions.
    """

    kind: str
    file: str
    line: int
    start: int
    end: int
    after: str
    source: str  # the line
    column: int  # of `start` in the line
    scope: tuple[int, int] | None = None

    @property
    def room(self) -> str:
        """The room, with cpp/ before one of C++; a module outside all rooms is its own."""
        room = self.file.partition("/")[0].removesuffix(".py")
        return f"cpp/{room}" if self.is_cpp else room

    @property
    def is_cpp(self) -> bool:
        """Whether it is a change of C++."""
        return not self.file.endswith(".py")

    @property
    def name(self) -> str:
        """What it is, the same as long as the file is: FILE:LINE:COLUMN kind "before" -> "after"."""
        shown = "cpp/" * self.is_cpp + self.file
        before = self.source[self.column : self.column + self.end - self.start]
        after = " ".join(self.after.split())
        return f'{shown}:{self.line}:{self.column + 1} {self.kind} "{before}" -> "{after}"'

    @property
    def change(self) -> tuple[str, str, str]:
        """The file, and the line before and after the change, without spaces around: the same wherever the line is."""
        before, rest = self.source[: self.column], self.source[self.column + self.end - self.start :]
        return self.name.partition(":")[0], self.source.strip(), f"{before}{self.after}{rest}".strip()

    def applied(self, text: str) -> str:
        """The text of the file with the change."""
        return text[: self.start] + self.after + text[self.end :]


def drawn(places: list[Mutant], seed: int) -> dict[str, list[Mutant]]:
    """Of each kind one mutant a place, in an order that the seed decides: the first n are a uniform sample of n.

    The order is that of digests of the seed with the text of each line, so that a change of the code elsewhere leaves
    what is drawn.
    """
    choices: dict[tuple[str, str, int], list[Mutant]] = {}
    for mutant in places:
        choices.setdefault((mutant.kind, mutant.file, mutant.start), []).append(mutant)
    ranked: dict[str, list[tuple[bytes, Mutant]]] = {kind: [] for kind in KINDS}
    repeated: Counter[str] = Counter()  # lines that a file has several times
    for (kind, file, _), some in sorted(choices.items()):
        line = some[0].source.lstrip()
        key = f"{seed} {kind} {file} {line} {some[0].column - len(some[0].source) + len(line)}"
        repeated[key] += 1
        rank = hashlib.sha256(f"{key} {repeated[key]}".encode()).digest()
        ranked[kind].append((rank, some[rank[-1] % len(some)]))
    return {kind: [mutant for _, mutant in sorted(found, key=lambda pair: pair[0])] for kind, found in ranked.items()}


# ---- Python


def computes(stem: str) -> bool:
    """Whether a module of this name computes, rather than reads, writes, checks or shows."""
    return stem not in TEXT_MODULES and not TEXT_FILES & set(stem.split("_"))


def python_places(package: Path) -> list[Mutant]:
    """One mutant of each place of the physics modules below the folder of the package."""
    files = [package / "numerics.py"]
    for room in ROOMS:
        files += [path for path in (package / room).rglob("*.py") if computes(path.stem)]
    for room, modules in SOME_OF.items():
        files += [path for module in modules.split() for path in (package / room).rglob(f"{module}.py")]
    return [m for path in sorted(files) for m in places_in(path.read_text("utf-8"), str(path.relative_to(package)))]


def places_in(text: str, file: str) -> list[Mutant]:
    """One mutant of each place of a Python text."""
    return list(_Python(text, file).visit(ast.parse(text)))


class _Python:
    """Walks through a syntax tree and yields mutants; the operators' places are those of the tokens."""

    def __init__(self, text: str, file: str) -> None:
        self.text, self.file = text, file
        self.lines = text.splitlines(keepends=True)
        self.begins = [0]
        for line in self.lines:
            self.begins.append(self.begins[-1] + len(line))
        self.tokens = {}  # start of each operator and name -> the text of it
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type in (tokenize.OP, tokenize.NAME):
                self.tokens[self.begins[token.start[0] - 1] + token.start[1]] = token.string
        self.starts = sorted(self.tokens)
        self.scope: tuple[int, int] | None = None
        self.index = False  # inside a subscript

    def visit(self, node: ast.AST) -> Iterator[Mutant]:
        yield from getattr(self, f"visit_{type(node).__name__}", self._children)(node)

    def _children(self, node: ast.AST) -> Iterator[Mutant]:
        for child in ast.iter_child_nodes(node):
            yield from self.visit(child)

    def _nothing(self, node: ast.AST) -> Iterator[Mutant]:
        yield from ()

    visit_Raise = visit_Assert = visit_JoinedStr = visit_Import = visit_ImportFrom = _nothing

    # ---- what is passed over

    def visit_FunctionDef(self, node: ast.FunctionDef) -> Iterator[Mutant]:
        words = node.name.strip("_").split("_")
        if TEXT_FUNCTIONS & set(words) or words[-1] == "table" or words[0] == "refuse":
            return
        outer, self.scope = self.scope, self.scope or (node.lineno, node.end_lineno or node.lineno)
        for child in (*node.args.defaults, *filter(None, node.args.kw_defaults), *node.body):
            yield from self.visit(child)
        self.scope = outer

    def visit_Lambda(self, node: ast.Lambda) -> Iterator[Mutant]:
        yield from self.visit(node.body)

    def visit_ClassDef(self, node: ast.ClassDef) -> Iterator[Mutant]:
        for child in node.body:
            yield from self.visit(child)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> Iterator[Mutant]:
        if node.value:
            yield from self.visit(node.value)

    def visit_Assign(self, node: ast.Assign) -> Iterator[Mutant]:
        if not any(isinstance(target, ast.Name) and target.id.startswith("__") for target in node.targets):
            yield from self._children(node)

    def visit_If(self, node: ast.If) -> Iterator[Mutant]:
        if not (isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"):
            yield from self._children(node)

    # ---- places

    def visit_BinOp(self, node: ast.BinOp) -> Iterator[Mutant]:
        if isinstance(node.op, (ast.Add, ast.Sub)) and not self._is_sequence(node):
            yield self._swapped("sign", node.left, node.right, "+" if isinstance(node.op, ast.Add) else "-")
        if isinstance(node.op, (ast.Mult, ast.Div)) and not self.index and not self._is_sequence(node):
            end = self._end(node)
            yield self._mutant("factor", self._start(node), end, self.text[self._start(node) : end] + " * 2")
        yield from self._children(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> Iterator[Mutant]:
        if isinstance(node.op, (ast.Add, ast.Sub)) and not self._is_sequence(node.value):
            yield self._swapped("sign", node.target, node.value, "+=" if isinstance(node.op, ast.Add) else "-=")
        yield from self._children(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Iterator[Mutant]:
        if isinstance(node.op, ast.USub) and not (self.index and isinstance(node.operand, ast.Constant)):
            yield self._mutant("sign", self._start(node), self._start(node) + 1, "")
        yield from self._children(node)

    def visit_Compare(self, node: ast.Compare) -> Iterator[Mutant]:
        for left, op, right in zip([node.left, *node.comparators], node.ops, node.comparators, strict=False):
            symbol = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
            if type(op) in symbol:
                yield self._swapped("comparison", left, right, symbol[type(op)])
        yield from self._children(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> Iterator[Mutant]:
        for left, right in zip(node.values, node.values[1:], strict=False):
            yield self._swapped("comparison", left, right, "and" if isinstance(node.op, ast.And) else "or")
        yield from self._children(node)

    def visit_Call(self, node: ast.Call) -> Iterator[Mutant]:
        called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        owner = node.func.value if isinstance(node.func, ast.Attribute) else None
        if called in TEXT_CALLS or (isinstance(owner, ast.Name) and owner.id in ("arguments", "re", "warnings")):
            return
        if called in SWAPPED:
            end = self._end(node.func)
            yield self._mutant("comparison", end - len(called), end, SWAPPED[called])
        outer, self.index = self.index, False
        for argument in (node.func, *(node.args if called != "reshape" else ())):
            yield from self.visit(argument)
        for keyword in node.keywords:
            if keyword.arg == "axis" and isinstance(keyword.value, ast.Constant) and keyword.value.value in (0, 1):
                place = keyword.value
                yield self._mutant("index", self._start(place), self._end(place), str(1 - int(str(place.value))))
            elif keyword.arg not in TEXT_ARGUMENTS:
                yield from self.visit(keyword.value)
        self.index = outer

    def visit_Subscript(self, node: ast.Subscript) -> Iterator[Mutant]:
        if getattr(node.value, "id", getattr(node.value, "attr", "")) in TYPES:
            return
        yield from self.visit(node.value)
        outer, self.index = self.index, True
        yield from self.visit(node.slice)
        self.index = outer

    def visit_Slice(self, node: ast.Slice) -> Iterator[Mutant]:
        for bound in (node.lower, node.upper):
            if isinstance(bound, (ast.Name, ast.Attribute, ast.Call, ast.Subscript)):
                yield self._mutant("index", self._start(bound), self._end(bound), f"{self._of(bound)} + 1")
                yield self._mutant("index", self._start(bound), self._end(bound), f"{self._of(bound)} - 1")
        yield from self._children(node)

    def visit_Constant(self, node: ast.Constant) -> Iterator[Mutant]:
        value = node.value
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            return
        if self.index:
            if isinstance(value, int):
                for other in (value + 1, value - 1):
                    yield self._mutant("index", self._start(node), self._end(node), str(other))
        else:
            after = value + 1 if isinstance(value, int) else scaled(value)
            yield self._mutant("factor", self._start(node), self._end(node), str(after))

    # ---- text

    def _is_sequence(self, node: ast.AST) -> bool:
        """Whether a sum or product is visibly one of texts, lists, tuples or sets."""
        if isinstance(node, ast.BinOp):
            return self._is_sequence(node.left) or self._is_sequence(node.right)
        if isinstance(node, ast.Call):
            return getattr(node.func, "id", "") in {"list", "tuple", "str", "set", "sorted", "repr"} | TEXT_CALLS
        return isinstance(node, (ast.List, ast.Tuple, ast.Set, ast.ListComp, ast.SetComp, ast.JoinedStr, ast.Dict)) or (
            isinstance(node, ast.Constant) and isinstance(node.value, (str, bytes))
        )

    def _offset(self, line: int, column: int) -> int:
        return self.begins[line - 1] + len(self.lines[line - 1].encode()[:column].decode())

    def _start(self, node: ast.expr | ast.stmt) -> int:
        return self._offset(node.lineno, node.col_offset)

    def _end(self, node: ast.expr) -> int:
        return self._offset(node.end_lineno or 0, node.end_col_offset or 0)

    def _of(self, node: ast.expr) -> str:
        return self.text[self._start(node) : self._end(node)]

    def _swapped(self, kind: str, left: ast.expr, right: ast.expr, symbol: str) -> Mutant:
        """A mutant of the operator between two operands; brackets may stand beside it."""
        low, high = self._end(left), self._start(right)
        at = next(k for k in self.starts if low <= k < high and self.tokens[k] == symbol)
        return self._mutant(kind, at, at + len(symbol), SWAPPED[symbol])

    def _mutant(self, kind: str, start: int, end: int, after: str) -> Mutant:
        line = self.text.count("\n", 0, start)
        source = self.lines[line].rstrip("\n")
        return Mutant(kind, self.file, line + 1, start, end, after, source, start - self.begins[line], self.scope)


def scaled(value: float) -> float:
    """A number that is wrong: twice the number, 1 for 0; 1000 times a tolerance."""
    return 1.0 if value == 0 else float(f"{value * (1000.0 if abs(value) < SMALL else 2.0):.15g}")
