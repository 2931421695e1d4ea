"""LLVM: target machine, object code, and loaded code."""

from __future__ import annotations

import itertools
import os
import platform
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from bellcrank.codegen import cache as disk
from bellcrank.codegen import locks
from bellcrank.codegen.object_code import llvm, target_machine
from bellcrank.codegen.object_code import object_code as emitted
from bellcrank.errors import CompileError, InputError
from bellcrank.messages import unknown_name

# Of the compiled functions (kernels.py); a change makes every cached object stale.
ABI = 1
_serial = itertools.count()


@dataclass(frozen=True)
class Target:
    """A processor for which code is generated: LLVM's CPU name, features, SIMD lanes, fused multiply-add."""

    name: str
    cpu: str
    features: str
    lanes: int
    fused: bool


def processor() -> str:
    """The model name of the processor."""
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8") as file:
            return next(line.split(":")[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration, IndexError):
        return platform.processor() or platform.machine()


_LEVELS = {
    "avx512": ("skylake-avx512", "+avx512f,+avx512dq,+avx512vl,+fma", 8, True),
    "avx2": ("haswell", "+avx2,+fma,-avx512f", 4, True),
    "baseline": ("x86-64", "", 2, False),
}


def target() -> Target:
    """The target that BELLCRANK_TARGET names: "native" (also when unset), "avx512", "avx2" or "baseline".

    Raises InputError for an unknown name, or for one that this processor cannot run.
    """
    return _target(target_name())


def target_name() -> str:
    """The value of BELLCRANK_TARGET, "native" where it is not set."""
    return os.environ.get("BELLCRANK_TARGET") or "native"


@cache
def _target(name: str) -> Target:
    if name != "native" and name not in _LEVELS:
        raise InputError("BELLCRANK_TARGET: " + unknown_name("target", name, ["native", *_LEVELS]))
    has = llvm().get_host_cpu_features()
    if name == "native":
        lanes = 8 if has.get("avx512f") and has.get("avx512dq") else 4 if has.get("avx2") else 2
        fused = bool(has.get("fma")) or platform.machine() in ("aarch64", "arm64")  # every ARM of 64 bits has it
        return Target(name, llvm().get_host_cpu_name(), has.flatten(), lanes, fused)
    cpu, features, lanes, fused = _LEVELS[name]
    missing = [f[1:] for f in features.split(",") if f.startswith("+") and not has.get(f[1:])]
    if missing:
        raise InputError(
            f"BELLCRANK_TARGET={name}: this processor lacks {', '.join(missing)}; leave it unset for the best it has"
        )
    return Target(name, cpu, features, lanes, fused)


@cache
def _jit(chosen: Target) -> Any:
    # LLVM's older linker asks for memory section by section, and ends the process where code is then more than 2 GB
    # away from its constants. JITLink places an object as a whole, in a quarter to half of the time.
    return llvm().create_lljit_compiler(target_machine(chosen.cpu, chosen.features, 2), use_jit_link=True)


def object_key(ir: str, chosen: Target, level: int = 2) -> str:
    """The cache key of the machine code of `ir` for a target."""
    import llvmlite

    return "object-" + disk.digest(ir, chosen.cpu, chosen.features, llvmlite.__version__, str(ABI), str(level))


def object_code(ir: str, chosen: Target, level: int = 2) -> bytes:
    """Compile IR to an object file, by LLVM's optimisation level 0 … 2. Raises CompileError where LLVM refuses it.

    Level 0 takes a sixth of the time, and the code twice as long. The results are the same to the last bit.
    """
    with locks.llvm:
        try:
            return emitted(ir, chosen.cpu, chosen.features, level)
        except RuntimeError as error:
            raise CompileError(f"LLVM refused generated code (a bug in bellcrank): {error}") from error


class Loaded:
    """Machine code in memory; the address of `evaluate` stays valid as long as this object lives, which frees it.

    Attributes:
        addresses: The addresses of `evaluate` and other symbols that were asked for.
    """

    def __init__(self, name: str, code: bytes, chosen: Target, symbols: tuple[str, ...] = ("evaluate",)) -> None:
        with locks.llvm:
            builder = llvm().JITLibraryBuilder().add_object_img(code).add_current_process()
            for symbol in symbols:
                builder.export_symbol(symbol)
            self._library = builder.link(_jit(chosen), f"{name}.{next(_serial)}")  # LLVM needs a unique name
            self.addresses: dict[str, int] = {symbol: self._library[symbol] for symbol in symbols}
            self.address = self.addresses["evaluate"]
