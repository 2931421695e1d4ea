"""The machine code of a function for one kind and one target, in two tiers.

Long code is compiled quickly first, at LLVM's level 0, and optimised in another process meanwhile (full_tier.py). Both
give the same results to the last bit, so that it does not matter when the optimised code takes over. Short code is
optimised at once, and code that is called seldom never is, if it is long.
"""

from __future__ import annotations

import ctypes
import json
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from bellcrank._step import code_maker
from bellcrank.codegen import cache as disk
from bellcrank.codegen import full_tier
from bellcrank.codegen import llvm as machine
from bellcrank.codegen.expression_graph import Graph
from bellcrank.codegen.kernels import KINDS
from bellcrank.codegen.locks import making

_LENGTH = 8  # bytes of the size of quickly compiled code
# The code is called through @target. Where there is none yet, @make asks Python for it; it fails where Python fails.
_IR = """
@target = global ptr null
@make = global ptr null
@maker = global ptr null

define i32 @evaluate({parameters}) {{
  %code = load atomic ptr, ptr @target acquire, align 8
  %missing = icmp eq ptr %code, null
  br i1 %missing, label %wanted, label %ready, !prof !0
ready:
  %status = tail call i32 %code({parameters})
  ret i32 %status
wanted:
  %make = load ptr, ptr @make
  %maker = load ptr, ptr @maker
  %made = call ptr %make(ptr %maker)
  %failed = icmp eq ptr %made, null
  br i1 %failed, label %none, label %found
none:
  ret i32 1
found:
  %first = tail call i32 %made({parameters})
  ret i32 %first
}}
!0 = !{{!"branch_weights", i32 1, i32 1000000}}
"""
_PARAMETERS = "ptr %inputs, ptr %outputs"
_BATCH_PARAMETERS = "ptr %inputs, ptr %outputs, ptr %strides, i64 %samples"
_FULL, _QUICK = 2, 0  # LLVM's levels
_failures: list[BaseException] = []  # of code that the integrator needed


@dataclass(frozen=True)
class StoredCode:
    """Machine code from the cache, and the compressed IR whose optimised code is yet to come, if any."""

    code: bytes
    ir: bytes = b""


class Recipe:
    """The entry of a function in the cache, which names the entries of its machine code.

    Attributes:
        input_sizes: The sizes of the function's inputs.
        output_sizes: Those of its outputs.
    """

    def __init__(self, key: str, stored: dict[str, Any]) -> None:
        self._key, self._objects = key, dict[str, str](stored["objects"])
        self.input_sizes: tuple[int, ...] = tuple(stored["inputs"])
        self.output_sizes: tuple[int, ...] = tuple(stored["outputs"])

    @classmethod
    def load(cls, key: str, inputs: Sequence[int]) -> Recipe | None:
        """The recipe from the cache; None where there is none, or its first inputs have other sizes."""
        kind = {"inputs": [int], "outputs": [int], "objects": {str: str}}
        stored: dict[str, Any] | None = disk.load_data(key, kind)
        if not stored or min([*stored["inputs"], *stored["outputs"]], default=0) < 0:
            return None
        return cls(key, stored) if stored["inputs"][: len(inputs)] == list(inputs) else None

    @classmethod
    def of(cls, key: str, graph: Graph) -> Recipe:
        """A new recipe."""
        return cls(key, {**_sizes(graph), "objects": {}})

    def code(self, kind: str, target: machine.Target) -> StoredCode | None:
        """The cached code: the optimised one, or else the quickly compiled one; None where there is none."""
        optimised = self._payload(_hint(kind, target))
        if optimised is not None:
            return StoredCode(optimised)
        quick = self._payload("quick:" + _hint(kind, target))
        if quick is None:
            return None
        end = _LENGTH + int.from_bytes(quick[:_LENGTH], "little")
        return StoredCode(quick[_LENGTH:end], quick[end:])

    def store(self, kind: str, target: machine.Target, made: StoredCode, key: str, graph: Graph | None = None) -> None:
        """Store new code under a key; with IR, as quickly compiled code. `graph` gives the sizes anew."""
        if graph is not None:
            sizes = _sizes(graph)
            self.input_sizes, self.output_sizes = tuple(sizes["inputs"]), tuple(sizes["outputs"])
        quick, payload = bool(made.ir), made.code
        if quick:
            payload = len(made.code).to_bytes(_LENGTH, "little") + made.code + made.ir
        disk.store(key, self._signature() + b"\n" + payload)
        self._objects["quick:" * quick + _hint(kind, target)] = key
        entry = {"inputs": self.input_sizes, "outputs": self.output_sizes, "objects": self._objects}
        disk.store(self._key, json.dumps(entry).encode())

    def _payload(self, hint: str) -> bytes | None:
        key = self._objects.get(hint)
        stored = disk.load(key) if key else None
        sizes, _, payload = (stored or b"").partition(b"\n")
        return payload if payload and sizes == self._signature() else None

    def _signature(self) -> bytes:
        return json.dumps([self.input_sizes, self.output_sizes]).encode()


def _hint(kind: str, target: machine.Target) -> str:
    return f"{kind}:{target.name}:{target.cpu}:{target.features}"


def _sizes(graph: Graph) -> dict[str, list[int]]:
    return {"inputs": list(graph.input_sizes), "outputs": [size for size, *_ in graph.outputs]}


# ---- Entries of compiled functions: fixed addresses behind which code is made when first called, and replaced by
# faster code while it is used.


class Entry:
    """An address that stays the same while the code behind it is replaced.

    All codes must give the same results. A call that is under way ends in the code in which it began, so that replaced
    code must stay in memory.

    Attributes:
        address: The address of the function, of the signature of its kind (kernels.py).
    """

    def __init__(self, name: str, kind: str, chosen: machine.Target, maker: Callable[[], int]) -> None:
        """`maker` returns the address of the code, and is called where a call finds none; 0 where it fails.

        The entry keeps it.
        """
        symbols = ("evaluate", "target", "make", "maker")
        self._loaded = machine.Loaded(f"{name} entry", _code(kind == "batch", chosen), chosen, symbols)
        self._maker = maker
        self.address = self._loaded.address
        self._cell("make").value = code_maker()
        self._cell("maker").value = id(maker)
        self._target = self._cell("target")

    def use(self, address: int) -> None:
        """Let later calls run the code at this address."""
        self._target.value = address  # one aligned store

    def _cell(self, symbol: str) -> ctypes.c_void_p:
        return ctypes.c_void_p.from_address(self._loaded.addresses[symbol])


@cache
def _code(batch: bool, chosen: machine.Target) -> bytes:
    return machine.object_code(_IR.format(parameters=_BATCH_PARAMETERS if batch else _PARAMETERS), chosen)


@dataclass(frozen=True)
class Source:
    """What machine code is made of: the function's name, its cached recipe, and its graph, traced when needed."""

    name: str
    recipe: Callable[[], Recipe]
    graph: Callable[[], Graph]


@dataclass(frozen=True)
class Draft:
    """LLVM IR that is to be compiled: at which level, and whether the optimised code is to come later."""

    ir: str
    level: int
    improved: bool


class MachineCode:
    """Code at one address, made when asked for, or when first called.

    Attributes:
        kind: The kind of the function (kernels.py).
        target: The processor.
    """

    def __init__(self, source: Source, kind: str, target: machine.Target) -> None:
        self._source, self.kind, self.target = source, kind, target
        self._entry: Entry | None = None
        self._improving = False
        self._loaded: list[machine.Loaded] = []  # the last of them runs; calls may still be in those before

    @property
    def is_made(self) -> bool:
        """Whether there is code to call."""
        return bool(self._loaded)

    @property
    def is_improving(self) -> bool:
        """Whether optimised code is to come."""
        return self._improving

    @property
    def address(self) -> int:
        """The address of the function; the code is compiled if there is none."""
        if not self._loaded:
            self.make()
        return self._entry.address if self._entry is not None else self._loaded[-1].address

    @property
    def lazy_address(self) -> int:
        """The address of the function; where there is no code yet, it is compiled when first called.

        Only the integrator may call it, which then asks `raise_failure`.
        """
        with making:
            if not self.is_made and self._entry is None:
                self._entry = self._new_entry()
            return self.address if self._entry is None else self._entry.address

    def make(self) -> int:
        """The address of the code itself, which is made if there is none."""
        with making:
            if not self.is_made and not self.load():
                draft = self.draft()
                self.finish(draft, machine.object_code(draft.ir, self.target, draft.level))
            return self._loaded[-1].address

    def load(self) -> bool:
        """Take the code from the cache; False where it has none."""
        stored = self._source.recipe().code(self.kind, self.target)
        if stored is None:
            return False
        try:
            self._use(stored.code, improved=bool(stored.ir))
        except (RuntimeError, KeyError):
            return False  # this LLVM cannot load it: compile again
        if stored.ir:
            full_tier.ask(self, stored.ir, self.target)
        return True

    def draft(self) -> Draft:
        """The IR of the function, and how it is to be compiled first."""
        graph = self._source.graph()
        ir = KINDS[self.kind](graph, self.target.lanes, self.target.fused)
        return Draft(ir, _QUICK if graph.is_long else _FULL, graph.is_long and not graph.seldom)

    def finish(self, draft: Draft, code: bytes) -> None:
        """Load the code of a draft, store it, and ask for the optimised code that is to come."""
        made = StoredCode(code, full_tier.compressed(draft.ir) if draft.improved else b"")
        key = machine.object_key(draft.ir, self.target, draft.level)
        self._source.recipe().store(self.kind, self.target, made, key, self._source.graph())
        self._use(code, draft.improved)
        if draft.improved:
            full_tier.ask(self, made.ir, self.target)

    def improve(self, code: bytes, ir: str) -> None:
        """Use optimised code of the IR from now on, and store it."""
        key = machine.object_key(ir, self.target, _FULL)
        with making:
            self._source.recipe().store(self.kind, self.target, StoredCode(code), key)
            self._use(code, improved=False)

    def _use(self, code: bytes, improved: bool) -> None:
        loaded = machine.Loaded(self._source.name, code, self.target)
        if improved and self._entry is None:
            self._entry = self._new_entry()
        if self._entry is not None:
            self._entry.use(loaded.address)
        self._loaded.append(loaded)
        self._improving = improved

    def _new_entry(self) -> Entry:
        itself = weakref.ref(self)

        def made() -> int:
            """The address of the code, for the integrator; 0 where it cannot be made."""
            found = itself()
            try:
                return 0 if found is None else found.make()
            except BaseException as error:  # the integrator's caller raises it
                _failures.append(error)
                return 0

        return Entry(self._source.name, self.kind, self.target, made)


def raise_failure() -> None:
    """Raise the error that kept the integrator from code that it needed, if there was one."""
    if _failures:
        error = _failures[0]
        _failures.clear()
        raise error
