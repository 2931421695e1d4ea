"""Size motors and simulate robots from a URDF, on machine code made for that robot."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOME = {
    "BellcrankError": "errors", "InputError": "errors", "UnreachableError": "errors", "load_robot": "robot",
    "Robot": "robot", "Payload": "payload",
}  # fmt: skip
__all__ = ["__version__", *_HOME]

if TYPE_CHECKING:
    from bellcrank.errors import BellcrankError, InputError, UnreachableError
    from bellcrank.payload import Payload
    from bellcrank.robot import Robot, load_robot


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"bellcrank.{_HOME[name]}"), name)
    raise AttributeError(f"module 'bellcrank' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
