"""Reference motions from the analytic equations, by extrapolation in extended precision, with their error.

Method: Gragg's modified midpoint rule, extrapolated in the square of the step (Hairer, Nørsett, Wanner, Solving
Ordinary Differential Equations I, sec. II.9), order 16, in numpy's longdouble. It shares nothing with what is measured.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank_bench.problems.checks import Array
from bellcrank_bench.problems.problem import Benchmark
from bellcrank_bench.problems.registry import benchmark

DIVISIONS = range(2, 17, 2)  # midpoint steps of the rows of the extrapolation table


@dataclass(frozen=True)
class Reference:
    """The reference motion of a benchmark, with two independent estimates of its error.

    Attributes:
        benchmark: The benchmark.
        state: Reduced states (101, n) at its output times.
        step_error: Largest difference of a position from a run with coarser steps.
        scipy_error: Largest difference of a position from SciPy's DOP853 at rtol = 1e-13, atol = 1e-14 in double
            precision, which is the less accurate of the two.
    """

    benchmark: Benchmark
    state: NDArray[np.longdouble]
    step_error: float
    scipy_error: float

    def error(self, position: Array, time: Array | None = None) -> float:
        """Largest difference of positions (k, m) at the output times, or at `time`; infinite if any is missing."""
        expected = self.benchmark.positions(self.state) if time is None else self.at(time)
        if position.shape != expected.shape:
            return float("inf")
        difference = float(np.abs(position - expected).max())
        return difference if np.isfinite(difference) else float("inf")

    def at(self, time: Array) -> NDArray[np.longdouble]:
        """Positions (k, m) at any times within the duration, from the nearest output time."""
        times = self.benchmark.times
        nodes = np.clip(np.rint(time / times[1]).astype(int), 0, len(times) - 1)
        offsets = time.astype(np.longdouble) - times[nodes]
        near = 1e-15 * self.benchmark.duration
        states = (
            self.state[k] if abs(offset) < near else _advance(self.benchmark, self.state[k], offset, 2)
            for k, offset in zip(nodes, offsets, strict=True)
        )
        return self.benchmark.positions(np.array(list(states)))


@cache
def reference(name: str) -> Reference:
    """The reference motion of the benchmark of that name, computed once per process (about two seconds)."""
    from scipy.integrate import solve_ivp

    chosen = benchmark(name)
    state, finer = (_states(chosen, steps) for steps in chosen.reference_steps)
    double = solve_ivp(
        lambda _, x: chosen.equations.derivative(x), (0.0, chosen.duration), chosen.start,
        method="DOP853", rtol=1e-13, atol=1e-14, t_eval=chosen.times,
    ).y.T  # fmt: skip
    exact = chosen.positions(finer)
    step_error, scipy_error = (float(np.abs(exact - chosen.positions(other)).max()) for other in (state, double))
    return Reference(chosen, finer, step_error, scipy_error)


def _states(chosen: Benchmark, steps: int) -> NDArray[np.longdouble]:
    states = [np.array(chosen.start, dtype=np.longdouble)]
    for length in np.diff(chosen.times.astype(np.longdouble)):
        states.append(_advance(chosen, states[-1], length, steps))
    return np.array(states)


def _advance(chosen: Benchmark, x: NDArray[np.longdouble], length: Any, steps: int) -> NDArray[np.longdouble]:
    for _ in range(steps):
        x = _extrapolate(chosen, x, length / steps)
    return x


def _extrapolate(chosen: Benchmark, x: NDArray[np.longdouble], length: Any) -> NDArray[np.longdouble]:
    f = chosen.equations.derivative
    start = f(x)
    row: list[Any] = []
    for k, n in enumerate(DIVISIONS):
        h = length / n
        before, now = x, x + h * start
        for _ in range(n - 1):
            before, now = now, before + 2 * h * f(now)
        entry = [(before + now + h * f(now)) / 2]
        for j in range(k):
            ratio = np.longdouble(n) / DIVISIONS[k - j - 1]
            entry.append(entry[j] + (entry[j] - row[j]) / (ratio * ratio - 1))
        row = entry
    return np.asarray(row[-1])
