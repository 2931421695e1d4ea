"""Reference motions from the analytic equations, by extrapolation in extended precision, with their own error.

Method: Gragg's modified midpoint rule, extrapolated in the square of the step (Hairer, Nørsett, Wanner, Solving
Ordinary Differential Equations I, sec. II.9), order 16, in numpy's longdouble: nothing in common with what is tested.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank_bench.bench.bench_problem import Array, Problem, problem

DIVISIONS = range(2, 17, 2)  # midpoint steps of the extrapolation's rows


@dataclass(frozen=True)
class Reference:
    """States (101, n) at the problem's times, and how far two independent estimates say they may be off.

    `step_error` is the largest difference of a position from a run with finer steps, `scipy_error` that from SciPy's
    DOP853 at rtol = 1e-13, atol = 1e-14 in double precision, which is the less exact of the two routes.
    """

    problem: Problem
    state: NDArray[np.longdouble]
    step_error: float
    scipy_error: float

    def error(self, position: Array, time: Array | None = None) -> float:
        """The largest difference of positions (k, m), at the problem's times or at `time` (k,), s."""
        expected = self.problem.positions(self.state) if time is None else self.at(time)
        if position.shape != expected.shape:
            return float("inf")
        difference = float(np.abs(position - expected).max())
        return difference if np.isfinite(difference) else float("inf")

    def at(self, time: Array) -> NDArray[np.longdouble]:
        """Positions (k, m) at any times within the duration, from the nearest output time."""
        times = self.problem.times
        nodes = np.clip(np.rint(time / times[1]).astype(int), 0, len(times) - 1)
        gaps = time.astype(np.longdouble) - times[nodes]
        near = 1e-15 * self.problem.duration
        steps = (
            self.state[k] if abs(gap) < near else _advance(self.problem, self.state[k], gap, 2)
            for k, gap in zip(nodes, gaps, strict=True)
        )
        return self.problem.positions(np.array(list(steps)))


@cache
def reference(name: str) -> Reference:
    """The reference of a problem, computed once a process (about two seconds)."""
    from scipy.integrate import solve_ivp

    chosen = problem(name)
    state, finer = (_states(chosen, pieces) for pieces in chosen.pieces)
    double = solve_ivp(
        lambda _, x: chosen.equations.derivative(x), (0.0, chosen.duration), chosen.start,
        method="DOP853", rtol=1e-13, atol=1e-14, t_eval=chosen.times,
    ).y.T  # fmt: skip
    exact = chosen.positions(finer)
    step_error, scipy_error = (float(np.abs(exact - chosen.positions(other)).max()) for other in (state, double))
    return Reference(chosen, finer, step_error, scipy_error)


def _states(chosen: Problem, pieces: int) -> NDArray[np.longdouble]:
    states = [np.array(chosen.start, dtype=np.longdouble)]
    for gap in np.diff(chosen.times.astype(np.longdouble)):
        states.append(_advance(chosen, states[-1], gap, pieces))
    return np.array(states)


def _advance(chosen: Problem, x: NDArray[np.longdouble], length: Any, pieces: int) -> NDArray[np.longdouble]:
    for _ in range(pieces):
        x = _extrapolate(chosen, x, length / pieces)
    return x


def _extrapolate(chosen: Problem, x: NDArray[np.longdouble], length: Any) -> NDArray[np.longdouble]:
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
