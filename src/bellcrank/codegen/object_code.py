"""LLVM IR to object code. As a program, this module compiles for the process that started it (full_tier.py).

It imports nothing of the package, so that the program starts at once. Requests come on standard input: a line of JSON
with the size of the compressed IR, LLVM's name of the processor, its features and the optimisation level, and the IR.
Each is answered by the size of the object code in 8 bytes, 0 where LLVM fails, and the code. The program ends with
standard input, in the middle of its work too.
"""

from __future__ import annotations

import json
import os
import queue
import sys
import threading
import zlib
from functools import cache
from typing import Any


@cache
def llvm() -> Any:
    """llvmlite's binding, ready for this processor."""
    import llvmlite.binding

    llvmlite.binding.initialize_native_target()
    llvmlite.binding.initialize_native_asmprinter()
    return llvmlite.binding


@cache
def target_machine(cpu: str, features: str, level: int) -> Any:
    """LLVM's target machine for a processor and an optimisation level of 0 to 2."""
    triple = llvm().Target.from_triple(llvm().get_process_triple())
    return triple.create_target_machine(cpu=cpu, features=features, opt=level, reloc="pic", codemodel="small", jit=True)


def object_code(ir: str, cpu: str, features: str, level: int) -> bytes:
    """Compile IR. Raises RuntimeError where LLVM refuses it."""
    module = llvm().parse_assembly(ir)
    module.triple = llvm().get_process_triple()
    machine = target_machine(cpu, features, level)
    if level and " alwaysinline " in ir:
        _join(module, machine)
    return bytes(machine.emit_object(module))


def _join(module: Any, machine: Any) -> None:
    """Make one function of those into which the code is divided (llvm_ir.py); what they pass on stays in registers."""
    builder = llvm().create_pass_builder(machine, llvm().create_pipeline_tuning_options(0))
    inliner = llvm().create_new_module_pass_manager()
    inliner.add_always_inliner_pass()
    inliner.run(module, builder)
    scalars = llvm().create_new_function_pass_manager()
    scalars.add_sroa_pass()
    scalars.run(module.get_function("evaluate"), builder)


Request = tuple[str, str, str, int]


def _read(requests: queue.SimpleQueue[Request]) -> None:
    while line := sys.stdin.buffer.readline():
        size, cpu, features, level = json.loads(line)
        ir = sys.stdin.buffer.read(size)
        if len(ir) < size:
            break
        requests.put((zlib.decompress(ir).decode(), cpu, features, level))
    os._exit(0)  # nobody waits for what is being compiled


def _serve() -> None:
    os.nice(10)  # the process that waits goes on working with quickly compiled code
    requests: queue.SimpleQueue[Request] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(requests,), daemon=True).start()
    while True:
        request = requests.get()
        try:
            code = object_code(*request)
        except RuntimeError:
            code = b""
        sys.stdout.buffer.write(len(code).to_bytes(8, "little") + code)
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    _serve()
