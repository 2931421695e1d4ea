"""The C baseline of a benchmark: its equations by hand in C, under SciPy's methods in C.

Beside this file there is one header a scene and one a method; integrate.c includes them.
"""

from __future__ import annotations

import ctypes
from functools import cache

import numpy as np

from bellcrank.errors import BellcrankError
from bellcrank_bench.c_baseline.compiler import FLAGS, HEADERS, shared_library
from bellcrank_bench.peers.peer import Outcome, Run
from bellcrank_bench.problems.checks import Array
from bellcrank_bench.problems.problem import OUTPUT_TIMES, Benchmark

NAME = "C baseline"
METHODS = {"RK4": "rk4", "RK45": "rk45", "DOP853": "dop853", "Radau": "radau"}
NOTE = f"{' '.join(FLAGS)}; clock around the stepping, in C"


class _Statistics(ctypes.Structure):
    _fields_ = (
        ("seconds", ctypes.c_double),
        ("evaluations", ctypes.c_long),
        ("accepted", ctypes.c_long),
        ("rejected", ctypes.c_long),
    )


class CBaseline:
    """The compiled program of a benchmark. Raises BellcrankError if there is no C compiler, or if it fails."""

    def __init__(self, benchmark: Benchmark) -> None:
        self.benchmark = benchmark
        self._library = _library(benchmark)
        self._start = benchmark.unreduced(np.array(benchmark.start))
        self._times = benchmark.times

    def run(self, method: str, tolerance: float = 0.0, step: float = 0.0) -> Outcome:
        """Integrate with rtol = atol = tolerance, or with the fixed step of RK4 in s.

        Raises BellcrankError if the program cannot step.
        """
        function = getattr(self._library, METHODS[method])
        position, made = np.empty((OUTPUT_TIMES, self.benchmark.count)), _Statistics()
        status = function(
            self._start.ctypes.data, self.benchmark.duration, tolerance, tolerance, step,
            self._times.ctypes.data, OUTPUT_TIMES, position.ctypes.data, ctypes.addressof(made),
        )  # fmt: skip
        if status:
            raise BellcrankError(f"{method} in C stopped with status {status}")
        return Outcome(
            seconds=made.seconds,
            position=self.benchmark.compared(position),
            evaluations=made.evaluations,
            steps=made.accepted,
            rejected=made.rejected,
        )

    def many(self, runs: int, tolerance: float) -> tuple[float, Array]:
        """Seconds of so many runs of DOP853, one after another in a loop in C, and where the first ends (count,).

        Raises BellcrankError if the program cannot step.
        """
        starts, ends = np.tile(self._start, (runs, 1)), np.empty((runs, self.benchmark.count))
        made = _Statistics()
        status = self._library.dop853_many(
            starts.ctypes.data, runs, self.benchmark.duration, tolerance, ends.ctypes.data, ctypes.addressof(made)
        )
        if status:
            raise BellcrankError(f"DOP853 in C stopped with status {status}")
        return made.seconds, ends[0]

    def timed(self, method: str, setting: str, tolerance: float = 0.0, step: float = 0.0) -> Run:
        """The same as a run that can be timed."""

        def once() -> Outcome:
            return self.run(method, tolerance, step)

        return Run(tool=NAME, method=method, setting=setting, note=NOTE, once=once)

    def right_hand_side_ns(self, calls: int = 1_000_000) -> float:
        """Nanoseconds of one right-hand side, each call waiting for the one before; the best of five."""
        return float(min(self._library.rhs_ns(self._start.ctypes.data, calls) for _ in range(5)))


@cache
def _library(benchmark: Benchmark) -> ctypes.CDLL:
    library = shared_library(HEADERS / "integrate.c", [f'-DSCENE="{benchmark.scene}.h"'])
    pointer, real, integer = ctypes.c_void_p, ctypes.c_double, ctypes.c_long
    for function in ("rk4", *(METHODS[method] for method in benchmark.adaptive)):
        getattr(library, function).argtypes = [pointer, real, real, real, real, pointer, integer, pointer, pointer]
    library.dop853_many.argtypes = [pointer, integer, real, real, pointer, pointer]
    library.rhs_ns.argtypes, library.rhs_ns.restype = [pointer, integer], real
    return library
