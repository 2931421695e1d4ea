"""Locks around libraries that work on one thread at a time, and how they pass a fork.

A process that is forked has only the thread that forked it: a lock that another thread held stays taken in it for ever,
and what that thread was changing stays half changed. So a fork waits until no other thread compiles, traces or imports,
and holds the locks meanwhile. Imported with the package, so that nothing of it can be under way before.
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

making = threading.RLock()  # casadi and LLVM work on one thread at a time; calls of finished code do not wait
llvm = threading.RLock()  # LLVM's state here is one context and one JIT; whoever wants both takes `making` first
_PACKAGES = {"bellcrank", "casadi", "llvmlite", "pinocchio", "eigenpy", "numpy", "scipy", "yaml", "matplotlib"}
_PASSES = 1000  # bounds the waiting, as an import that this thread itself is in the middle of does not end
_wait_for = getattr(_bootstrap, "_lock_unlock_module", lambda name: None)  # waits while a thread imports the module
_taken = threading.local()


def _take() -> None:
    held = _taken.held = contextlib.ExitStack()
    held.enter_context(making)
    held.enter_context(llvm)
    _imp.acquire_lock()  # held to the end: no import begins after the last look
    held.callback(_imp.release_lock)
    for _ in range(_PASSES):
        names = _imported_now()
        if not names:
            break
        _imp.release_lock()
        for name in names:
            _wait_for(name)
        _imp.acquire_lock()
    lock = _lock_of_llvmlite()  # looked for last, as llvmlite may be imported during all this waiting
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
