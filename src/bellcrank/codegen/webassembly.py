"""Expression graphs as WebAssembly modules, for pages: the same IR as for one sample of the processor (kernels.py).

LLVM emits a relocatable object, which is a WebAssembly module without exports (WebAssembly/tool-conventions,
Linking.md). The code of a graph has no data segments and calls only its own functions and those of the C library, so
that no address has to be changed: it becomes a module by an export and without the sections for a linker. It imports
from "env":

    __linear_memory    the memory, in which inputs and outputs are
    __stack_pointer    a mutable i32: scratch memory is below it
    sin, cos, …        functions of the C library, all of which JavaScript's Math has but fmod, its operator %

and exports `evaluate(inputs, outputs)`, two addresses of arrays of addresses (4 bytes each) of doubles.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

from bellcrank.codegen import locks
from bellcrank.codegen.expression_graph import Graph
from bellcrank.codegen.kernels import scalar_ir
from bellcrank.codegen.object_code import llvm
from bellcrank.errors import CompileError

TRIPLE = "wasm32-unknown-unknown"
FEATURES = "+bulk-memory,+sign-ext,+mutable-globals"  # of every browser that has DecompressionStream
_HEADER = b"\0asm\1\0\0\0"
_CUSTOM, _EXPORT, _START_ORDER, _CODE, _DATA = 0, 7, 8, 10, 11  # numbers of sections
_SYMBOLS, _UNDEFINED = 8, 0x10  # subsection of the custom section "linking"; flag of a symbol


def webassembly(graph: Graph) -> bytes:
    """The module of a graph.

    Args:
        graph: The expression graph.

    Returns:
        The bytes of a WebAssembly module.

    Raises:
        CompileError: LLVM refuses the code, or it needs a linker.
    """
    # A multiply-add would be a call of the C library: WebAssembly has none. Angles have no vectors to share.
    ir = scalar_ir(graph, 1, False)
    with locks.llvm:
        try:
            return _module(_object(ir))
        except RuntimeError as error:
            raise CompileError(f"LLVM refused generated code (a bug in bellcrank): {error}") from error


@cache
def _machine() -> Any:
    llvm().initialize_all_targets()
    llvm().initialize_all_asmprinters()
    return llvm().Target.from_triple(TRIPLE).create_target_machine(cpu="generic", features=FEATURES, opt=2)


def _object(ir: str) -> bytes:
    module = llvm().parse_assembly(ir)
    machine = _machine()
    module.triple, module.data_layout = TRIPLE, str(machine.target_data)
    passes = llvm().create_pass_builder(machine, llvm().create_pipeline_tuning_options(2))
    passes.getModulePassManager().run(module, passes)
    return bytes(machine.emit_object(module))


def _module(code: bytes) -> bytes:
    """The object as a module that exports `evaluate`."""
    kept, number = [], -1
    for kind, body in _sections(code):
        if kind == _DATA or (kind == _CUSTOM and body.startswith(b"\x0areloc.DATA")):
            raise CompileError("the code of this function has constants in memory, which needs a linker")
        if kind == _CUSTOM:
            if body.startswith(b"\x07linking"):
                number = _evaluate(body[8:])
        else:
            kept.append((kind, body))
    if number < 0:
        raise CompileError("LLVM's object does not name the function (a bug in bellcrank)")
    name = b"evaluate"
    export = bytes([1, len(name)]) + name + b"\0" + _leb(number)
    place = next(k for k, (kind, _) in enumerate(kept) if kind >= _START_ORDER)
    kept.insert(place, (_EXPORT, export))
    return _HEADER + b"".join(bytes([kind]) + _leb(len(body)) + body for kind, body in kept)


def _sections(code: bytes) -> Iterator[tuple[int, bytes]]:
    """Number and content of each section."""
    at = len(_HEADER)
    while at < len(code):
        kind = code[at]
        size, at = _unleb(code, at + 1)
        yield kind, code[at : at + size]
        at += size


def _evaluate(linking: bytes) -> int:
    """The number of the function `evaluate`, from the content of the section "linking"; -1 where there is none."""
    _, at = _unleb(linking, 0)  # the version
    while at < len(linking):
        kind = linking[at]
        size, at = _unleb(linking, at + 1)
        end = at + size
        if kind == _SYMBOLS:
            count, at = _unleb(linking, at)
            for _ in range(count):
                of = linking[at]
                flags, at = _unleb(linking, at + 1)
                if of == 1:
                    raise CompileError("the code of this function has constants in memory, which needs a linker")
                number, at = _unleb(linking, at)
                if of == 3 or (flags & _UNDEFINED and not flags & 0x40):  # a section, or an import with its own name
                    continue
                length, at = _unleb(linking, at)
                if of == 0 and linking[at : at + length] == b"evaluate":
                    return number
                at += length
        at = end
    return -1


def _leb(value: int) -> bytes:
    """An unsigned number in LEB128."""
    found = bytearray()
    while True:
        value, low = value >> 7, value & 0x7F
        found.append(low | (0x80 if value else 0))
        if not value:
            return bytes(found)


def _unleb(code: bytes, at: int) -> tuple[int, int]:
    """The unsigned number in LEB128 that begins at a place, and the place after it."""
    value = shift = 0
    while True:
        byte = code[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if not byte & 0x80:
            return value, at
