"""Size motors and simulate robots from a URDF, on machine code made for that robot."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOME = {
    "BellcrankError": "errors", "InputError": "errors", "UnreachableError": "errors", "CompileError": "errors",
    "Robot": "robot", "load_robot": "robot", "Payload": "payload", "Motion": "motion", "circle": "path", "line": "path",
    "waypoints": "path", "dwell": "path", "join": "path", "read_motion": "motion_csv", "write_motion": "motion_csv",
    "Card": "card", "load_card": "card", "Drive": "drive", "Sizing": "sizing", "size": "sizing", "check_urdf": "check",
}  # fmt: skip
__all__ = ["__version__", *_HOME]

if TYPE_CHECKING:
    from bellcrank.card import Card, load_card
    from bellcrank.check import check_urdf
    from bellcrank.drive import Drive
    from bellcrank.errors import BellcrankError, CompileError, InputError, UnreachableError
    from bellcrank.motion import Motion
    from bellcrank.motion_csv import read_motion, write_motion
    from bellcrank.path import circle, dwell, join, line, waypoints
    from bellcrank.payload import Payload
    from bellcrank.robot import Robot, load_robot
    from bellcrank.sizing import Sizing, size


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"bellcrank.{_HOME[name]}"), name)
    raise AttributeError(f"module 'bellcrank' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
