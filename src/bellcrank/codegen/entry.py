"""Entries of compiled functions: fixed addresses behind which code is made when first called, and replaced by faster
code while it is used.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache

from bellcrank._step import code_maker
from bellcrank.codegen import llvm as machine

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
