"""Pinocchio's computeRNEADerivatives and computeABADerivatives in C++, linked to the library of its wheel."""

from __future__ import annotations

import ctypes
import importlib.metadata
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.errors import BellcrankError
from bellcrank.robot.robot import Robot
from bellcrank_bench.c_baseline.compiler import shared_library

Array = NDArray[np.float64]
SOURCE = Path(__file__).with_suffix(".cpp")
DEFINITIONS = (  # as libpinocchio is built
    "PINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION", "BOOST_MPL_LIMIT_LIST_SIZE=30", "BOOST_MPL_LIMIT_VECTOR_SIZE=30",
    "BOOST_MPL_CFG_NO_PREPROCESSED_HEADERS", "BOOST_FUSION_INVOKE_MAX_ARITY=12", "NDEBUG",
)  # fmt: skip


class PinocchioDerivatives:
    """The derivatives of the dynamics of a robot without joints that mimic others."""

    def __init__(self, robot: Robot) -> None:
        """Raises BellcrankError where there is no C++ compiler, or Pinocchio cannot read its own model."""
        self._library, self._nv = _library(), robot.nv
        self._robot = self._library.new_robot(robot.model.saveToString().encode())
        if not self._robot or robot.model.nv != robot.nv:
            raise BellcrankError(f"{robot.name}: Pinocchio's C++ cannot read the model")

    def __del__(self) -> None:
        if getattr(self, "_robot", None):
            self._library.delete_robot(self._robot)

    def loop(self, forward: bool, states: Sequence[Array]) -> Callable[[], Any]:
        """A loop in C++ over the rows of q, v and a (or tau, if `forward`), whose results stay in Pinocchio's data."""
        held = [np.ascontiguousarray(x) for x in states]
        places = [x.ctypes.data for x in held]
        return lambda: self._library.derivatives(self._robot, forward, *places, None, None, None, len(held[0]))

    def results(self, forward: bool, states: Sequence[Array]) -> list[Array]:
        """The derivatives by q and v, and M or M⁻¹, (n, nv, nv) each."""
        held = [np.ascontiguousarray(x) for x in states]
        out = [np.empty((len(held[0]), self._nv, self._nv)) for _ in range(3)]
        places = [x.ctypes.data for x in (*held, *out)]
        self._library.derivatives(self._robot, forward, *places, len(held[0]))
        return out


@cache
def _library() -> ctypes.CDLL:
    """The compiled loop; half a minute."""
    import casadi  # noqa: F401  loaded after this library, it ends the process

    prefix = Path(str(importlib.metadata.distribution("libpinocchio").locate_file("cmeel.prefix"))).resolve()
    libraries = prefix / "lib"
    options = [
        "-std=c++17", *(f"-D{each}" for each in DEFINITIONS), f"-I{prefix}/include", f"-I{prefix}/include/eigen3",
        f"-L{libraries}", "-lpinocchio_default", "-lboost_serialization", f"-Wl,-rpath,{libraries}",
    ]  # fmt: skip
    library = shared_library(SOURCE, options)
    library.new_robot.argtypes, library.new_robot.restype = [ctypes.c_char_p], ctypes.c_void_p
    library.delete_robot.argtypes = [ctypes.c_void_p]
    library.derivatives.argtypes = [ctypes.c_void_p, ctypes.c_int, *[ctypes.c_void_p] * 6, ctypes.c_long]
    return library
