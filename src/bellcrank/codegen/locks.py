"""Locks around libraries that are not thread-safe, and their state in a forked process.

A forked process has only the thread that called fork: a lock that another thread held is never released there, and data
that it was changing stay inconsistent. Therefore a fork waits until no other thread compiles, traces or imports, and
holds the locks. The package imports this module first, so that its handlers are registered before anything else runs.
"""

from __future__ import annotations

import _imp
import concurrent.futures.thread  # noqa: F401  what it does at a fork must be known before one waits here
import contextlib
import os
import sys
import threading
from importlib import _bootstrap
from typing import Any

making = threading.RLock()  # for casadi and LLVM, which are not thread-safe; compiled code runs without it
llvm = threading.RLock()  # for the one context and JIT of LLVM; take `making` first where both are needed
_PACKAGES = {"bellcrank", "casadi", "llvmlite", "pinocchio", "eigenpy", "numpy", "scipy", "yaml", "matplotlib"}
_PASSES = 1000  # limits the waiting, because an import of this very thread does not end
_wait_for = getattr(_bootstrap, "_lock_unlock_module", lambda name: None)  # waits while a thread imports the module
_taken = threading.local()


def _take() -> None:
    held = _taken.held = contextlib.ExitStack()
    held.enter_context(making)
    held.enter_context(llvm)
    _imp.acquire_lock()  # held to the end, so that no import begins after the last check
    held.callback(_imp.release_lock)
    for _ in range(_PASSES):
        names = _imported_now()
        if not names:
            break
        _imp.release_lock()
        for name in names:
            _wait_for(name)
        _imp.acquire_lock()
    lock = _lock_of_llvmlite()  # last, because llvmlite may be imported while this thread waits
    if lock is not None:
        held.enter_context(lock)


def _give_back() -> None:
    _taken.held.close()


def _lock_of_llvmlite() -> Any:
    """llvmlite's own lock, which is taken wherever code is freed; None where llvmlite is not loaded."""
    ffi = sys.modules.get("llvmlite.binding.ffi")
    return getattr(getattr(ffi, "lib", None), "_lock", None)


def _imported_now() -> list[str]:
    """Modules that threads are importing: Python holds a lock for each, and does nothing about it at a fork."""
    names = list(getattr(_bootstrap, "_module_locks", ()))
    return [n for n in names if (top := n.partition(".")[0]) in _PACKAGES or top in sys.stdlib_module_names]


os.register_at_fork(before=_take, after_in_parent=_give_back, after_in_child=_give_back)
