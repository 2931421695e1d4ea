"""Compiled functions: expression graphs as machine code, called with one sample or a batch."""

from __future__ import annotations

import ctypes
import json
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from bellcrank import arguments
from bellcrank._step import SampleCall, evaluate, evaluate_rows
from bellcrank.arrays import Array
from bellcrank.codegen import cache as disk
from bellcrank.codegen import llvm as machine
from bellcrank.codegen.expression_graph import Graph, graph_of
from bellcrank.codegen.kernels import KINDS
from bellcrank.codegen.locks import making
from bellcrank.codegen.machine_code import MachineCode, Recipe, Source
from bellcrank.errors import CompileError, InputError

if TYPE_CHECKING:
    import casadi

_SETTLED = 2.0  # s; a file changed later may change again without another time in a coarse file system
BLOCK = 4096  # rows of a batch that quickly compiled code evaluates at once: some milliseconds
_BATCH = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)


class Compiled:
    """A function of several vectors as machine code.

    Call it with one array per input, (m,) or (n, m). Single samples and batches may be mixed; a single sample is
    repeated. It returns one array per output, (k,) or (n, k). Machine code for one sample and for batches is compiled
    when first needed, cached on disk, and freed with this object: keep the object while you use its address. The pickle
    of this object holds the graph.
    """

    def __init__(self, name: str, recipe: str, graph: Callable[[], Graph], inputs: Sequence[int] = ()) -> None:
        """`recipe` is its key in the cache; a cached recipe whose first inputs have other sizes is not used."""
        self.name, self._key, self._graph = name, recipe, graph
        self._inputs = tuple(inputs)
        self._found: Recipe | None = None
        self._codes: dict[tuple[str, str], MachineCode] = {}

    def _recipe(self) -> Recipe:
        if self._found is None:
            with making:
                self._found = Recipe.load(self._key, self._inputs) or Recipe.of(self._key, self._graph())
        return self._found

    @property
    def input_sizes(self) -> tuple[int, ...]:
        """The sizes of the inputs."""
        return self._recipe().input_sizes

    @property
    def output_sizes(self) -> tuple[int, ...]:
        """The sizes of the outputs."""
        return self._recipe().output_sizes

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (self.name, self._key, self.graph)

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self

    @property
    def graph(self) -> Graph:
        """The expression graph (traced anew where only machine code was cached)."""
        return self._graph()

    def ir(self, kind: str) -> str:
        """The LLVM IR, `kind` being "scalar", "lanes" or "batch" (kernels.py)."""
        chosen = machine.target()
        return KINDS[kind](self.graph, chosen.lanes, chosen.fused)

    def address(self, kind: str) -> int:
        """The address of the machine code; kernels.py describes its signature."""
        return self.code(kind).address

    def lazy_address(self, kind: str) -> int:
        """The address of machine code that is compiled when the integrator first calls it, if there is none."""
        return self.code(kind).lazy_address

    def code(self, kind: str) -> MachineCode:
        """The machine code of a kind for the target of this moment."""
        key = (kind, machine.target_name())
        code = self._codes.get(key)
        if code is None:
            with making:
                source = Source(self.name, self._recipe, self._graph)
                code = self._codes.setdefault(key, MachineCode(source, kind, machine.target()))
        return code

    def prepared(self, arrays: Sequence[Array], outputs: Sequence[Array]) -> Callable[[], int]:
        """A function that calls the batch code on these arrays without checks.

        The arrays are C-contiguous and have at least as many rows as there are lanes.
        """
        call = _BATCH(self.address("batch"))
        ins = (ctypes.c_void_p * len(arrays))(*[v.ctypes.data for v in arrays])
        outs = (ctypes.c_void_p * len(outputs))(*[o.ctypes.data for o in outputs])
        strides = (ctypes.c_int64 * len(arrays))(*[0 if v.ndim == 1 else v.shape[1] for v in arrays])
        rows = outputs[0].shape[0]
        held = (self, arrays, outputs)
        return lambda: int(call(ins, outs, strides, rows)) if held else 0

    def sample_call(self, shape: tuple[int, ...]) -> SampleCall:
        """A call for one sample that costs little more than its evaluation, with an array of this shape as answer.

        It returns None where this object's own call has to convert its arguments or to refuse them. It is for the
        target of this moment, and keeps this object.
        """
        return SampleCall(self, self.address("scalar"), self.input_sizes, shape, np.ndarray, np.empty)

    def __call__(self, *arrays: Any) -> Any:
        """Evaluate. Raises InputError where an array has a wrong shape or batches differ in length."""
        if all(type(a) is np.ndarray and a.ndim == 1 for a in arrays):
            quick = evaluate(self.address("scalar"), arrays, self.input_sizes, self.output_sizes)
            if quick is not None:
                return quick[0] if len(quick) == 1 else quick
        if len(arrays) != len(self.input_sizes):
            raise InputError(f"{self.name} takes {len(self.input_sizes)} arrays, {len(arrays)} were given")
        values = [np.ascontiguousarray(a, dtype=np.float64) for a in arrays]
        self.address("batch" if any(v.ndim == 2 for v in values) else "scalar")  # after this its sizes are checked
        rows = None
        for k, (value, size) in enumerate(zip(values, self.input_sizes, strict=True)):
            if value.ndim not in (1, 2) or value.shape[-1] != size:
                raise InputError(
                    f"{self.name}: argument {k + 1} has shape {value.shape}, expected ({size},) or (n, {size})"
                )
            if value.ndim == 2:
                if rows not in (None, value.shape[0]):
                    raise InputError(f"{self.name}: batches of different length, {rows} and {value.shape[0]}")
                rows = value.shape[0]
        if rows is not None:
            many = self._many(values, rows)
            return many[0] if len(many) == 1 else tuple(many)
        one = evaluate(self.address("scalar"), tuple(values), self.input_sizes, self.output_sizes)
        if one is None:
            raise CompileError(f"{self.name} could not be evaluated at this sample")
        return one[0] if len(one) == 1 else one

    def rows(self, *arrays: Array) -> list[Array]:
        """The outputs (n, k) for inputs (n, m), some of which may be (m,), by the code for one sample.

        This spares compiling the code for batches of a function that is called for each row once.
        """
        values = [np.atleast_2d(np.ascontiguousarray(a, dtype=np.float64)) for a in arrays]
        address = self.address("scalar")
        for k, (value, size) in enumerate(zip(values, self.input_sizes, strict=True)):
            if value.shape[1] != size:
                raise InputError(f"{self.name}: argument {k + 1} has shape {value.shape}, expected (n, {size})")
        samples = max((len(value) for value, a in zip(values, arrays, strict=True) if a.ndim == 2), default=1)
        return list(evaluate_rows(address, values, list(self.output_sizes), samples))

    def _many(self, values: list[Array], rows: int) -> list[Array]:
        lanes = machine.target().lanes
        if rows == 0:
            return [np.empty((0, size)) for size in self.output_sizes]
        if rows < lanes:  # a batch shorter than a vector: repeat its last row, then cut
            values = [v if v.ndim == 1 else np.vstack([v, np.repeat(v[-1:], lanes - rows, 0)]) for v in values]
            return [o[:rows].copy() for o in self._many(values, lanes)]
        outputs = [np.empty((rows, size)) for size in self.output_sizes]
        code, done = self.code("batch"), 0
        while done < rows:  # in blocks, as long as optimised code may take over
            stop = done + BLOCK if code.is_improving and rows - done >= 2 * BLOCK else rows
            block = [v if v.ndim == 1 else v[done:stop] for v in values]
            status = self.prepared(block, [o[done:stop] for o in outputs])()
            if status:
                raise CompileError(f"{self.name}: compiled code returned status {status} (a bug in bellcrank)")
            done = stop
        return outputs


def make_ready(wanted: Sequence[tuple[Compiled, str]]) -> list[int]:
    """Compile several functions (function, kind); LLVM compiles one while the IR of the next is written.

    Returns the addresses of the machine code.
    """
    codes = [function.code(kind) for function, kind in wanted]
    if not all(code.is_made for code in codes):
        with making, ThreadPoolExecutor(1) as compiler:
            _make(dict.fromkeys(codes), compiler)
    return [code.address for code in codes]


def _make(codes: Iterable[MachineCode], compiler: ThreadPoolExecutor) -> None:
    process, begun = os.getpid(), []
    for code in codes:
        if not code.is_made and not code.load():
            draft = code.draft()
            begun.append((code, draft, compiler.submit(machine.object_code, draft.ir, code.target, draft.level)))
    for code, draft, made in begun:
        # a forked process does not have the compiling thread
        here = os.getpid() != process
        code.finish(draft, machine.object_code(draft.ir, code.target, draft.level) if here else made.result())


@cache
def sources() -> str:
    """A digest of the source files: cached recipes are not used after a change of the package.

    The cache keeps it for the files' states (inode, size, times), because reading 600 files takes a tenth of a command.
    """
    files = sorted(_source_files(Path(__file__).parent.parent))
    states = [Path(file).stat() for file in files]
    key = "sources-" + disk.digest(*files, *(f"{s.st_ino} {s.st_size} {s.st_mtime_ns} {s.st_ctime_ns}" for s in states))
    known: str | None = disk.load_data(key, str)
    if known is None:
        known = disk.digest(*[Path(file).read_bytes() for file in files])
        if time.time() - max(s.st_ctime for s in states) > _SETTLED:
            disk.store(key, json.dumps(known).encode())
    return known


def _source_files(package: Path) -> Iterator[str]:
    for folder, _, names in os.walk(package):
        for name in names:
            native = folder == str(package) and name.startswith(("_trace", "_codegen")) and name.endswith(".so")
            if native or name.endswith(".py"):
                yield os.path.join(folder, name)


def compiled(
    name: str,
    key: Sequence[str],
    build: Callable[[], casadi.Function],
    seldom: bool = False,
    inputs: Sequence[int] = (),
) -> Compiled:
    """The compiled function of the expression that `build` returns, from the cache where possible.

    `key` must contain everything that `build` depends on; `build` is not called if the machine code is cached.
    `seldom`: see Graph. `inputs` are the sizes of the first inputs. Raises CompileError where `build` returns a
    function with other sizes.
    """
    graphs: list[Graph] = []

    def graph() -> Graph:
        with making:
            if not graphs:
                made = graph_of(_serialized(build()), seldom)
                if made.input_sizes[: len(inputs)] != tuple(inputs):
                    raise CompileError(
                        f"{name} takes vectors of sizes {made.input_sizes} where {tuple(inputs)} … are passed, a fault "
                        "of bellcrank; BELLCRANK_CACHE=off may help"
                    )
                graphs.append(made)
            return graphs[0]

    return Compiled(name, "recipe-" + disk.digest(name, *key, sources()), graph, inputs)


def _unpickled(name: str, recipe: str, graph: Graph) -> Compiled:
    return Compiled(name, recipe, lambda: graph, graph.input_sizes)


def _serialized(function: Any) -> bytes:
    if isinstance(function, bytes):
        return function
    if not hasattr(function, "serialize"):
        arguments.refuse("build", "a function that makes a casadi.Function", function, remedy="this is what it made")
    text: str = function.serialize()
    return text.encode("latin-1")
