"""Size motors and simulate robots from a URDF, on machine code made for that robot."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOME = {
    "BellcrankError": "errors",
    "InputError": "errors",
    "UnreachableError": "errors",
    "CompileError": "errors",
    "Robot": "robot.robot",
    "load_robot": "robot.load",
    "Payload": "robot.payload",
    "Motion": "motion.motion",
    "circle": "motion.path",
    "line": "motion.path",
    "waypoints": "motion.path",
    "dwell": "motion.path",
    "join": "motion.path",
    "read_motion": "motion.csv_file",
    "write_motion": "motion.csv_file",
    "Card": "card.card",
    "load_card": "card.card",
    "Drive": "sizing.drive",
    "Sizing": "sizing.size",
    "size": "sizing.size",
    "check_urdf": "urdf.check",
}
__all__ = ["__version__", *_HOME]

if TYPE_CHECKING:
    from bellcrank.card.card import Card, load_card
    from bellcrank.errors import BellcrankError, CompileError, InputError, UnreachableError
    from bellcrank.motion.csv_file import read_motion, write_motion
    from bellcrank.motion.motion import Motion
    from bellcrank.motion.path import circle, dwell, join, line, waypoints
    from bellcrank.robot.load import load_robot
    from bellcrank.robot.payload import Payload
    from bellcrank.robot.robot import Robot
    from bellcrank.sizing.drive import Drive
    from bellcrank.sizing.size import Sizing, size
    from bellcrank.urdf.check import check_urdf


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"bellcrank.{_HOME[name]}"), name)
    raise AttributeError(f"module 'bellcrank' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
