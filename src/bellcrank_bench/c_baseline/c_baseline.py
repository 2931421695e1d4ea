"""The scenes written by hand in C with SciPy's methods: the yardstick of a compiled right-hand side.

Sources: *.h beside this file, one header a scene and one a method, compiled here for this processor.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from functools import cache
from pathlib import Path

import numpy as np

from bellcrank.errors import BellcrankError
from bellcrank.files.temporaries import temporary_folder
from bellcrank_bench.bench.bench_problem import OUTPUTS, Outcome, Problem

FLAGS = ("-O3", "-march=native", "-fno-math-errno")
METHODS = {"RK4": "rk4", "RK45": "rk45", "DOP853": "dop853", "Radau": "radau"}
NOTE = f"C by hand, {' '.join(FLAGS)}; clock around the stepping, in C"


class _Statistics(ctypes.Structure):
    _fields_ = (
        ("seconds", ctypes.c_double),
        ("evaluations", ctypes.c_long),
        ("accepted", ctypes.c_long),
        ("rejected", ctypes.c_long),
    )


class HandWritten:
    """A scene's shared library. Raises BellcrankError where there is no C compiler, or where it fails."""

    def __init__(self, chosen: Problem) -> None:
        self.problem = chosen
        self._library = _library(chosen)
        self._start = chosen.unreduced(np.array(chosen.start))
        self._times = chosen.times

    def run(self, method: str, tolerance: float = 0.0, step: float = 0.0) -> Outcome:
        """Integrate with rtol = atol = tolerance, or with the fixed step of RK4 in s. Raises BellcrankError."""
        function = getattr(self._library, METHODS[method])
        position, made = np.empty((OUTPUTS, self.problem.count)), _Statistics()
        status = function(
            self._start.ctypes.data, self.problem.duration, tolerance, tolerance, step,
            self._times.ctypes.data, OUTPUTS, position.ctypes.data, ctypes.addressof(made),
        )  # fmt: skip
        if status:
            raise BellcrankError(f"{method} in C stopped with status {status}")
        return Outcome(
            made.seconds, self.problem.compared(position), None, made.evaluations, made.accepted, made.rejected
        )

    def right_hand_side_ns(self, calls: int = 1_000_000) -> float:
        """Nanoseconds a right-hand side, each call waiting for the one before, the best of five."""
        return float(min(self._library.rhs_ns(self._start.ctypes.data, calls) for _ in range(5)))


@cache
def _library(chosen: Problem) -> ctypes.CDLL:
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise BellcrankError("no C compiler: install gcc or cc")
    source = Path(__file__).with_name("integrate.c")
    with temporary_folder("bench") as folder:
        built = folder / f"{chosen.name}.so"
        command = [
            compiler, *FLAGS, f'-DSCENE="{chosen.name}.h"', "-shared", "-fPIC", str(source), "-o", str(built), "-lm",
        ]  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise BellcrankError(f"the C compiler failed: {(done.stderr.splitlines() or [str(done.returncode)])[0]}")
        library = ctypes.CDLL(str(built))
    pointer, real, integer = ctypes.c_void_p, ctypes.c_double, ctypes.c_long
    for function in ("rk4", *(METHODS[method] for method in chosen.adaptive)):
        getattr(library, function).argtypes = [pointer, real, real, real, real, pointer, integer, pointer, pointer]
    library.rhs_ns.argtypes, library.rhs_ns.restype = [pointer, integer], real
    return library
