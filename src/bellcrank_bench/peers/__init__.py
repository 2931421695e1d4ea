"""The tools that people use today, each set up as fast as it goes; a module a tool, with `runs(problem, settings)`.

Modules that end in `_closed` have the scenes with constraints. Every module raises ImportError where its tool is not
installed. What each clock covers is in the runs' notes.
"""

from __future__ import annotations

from math import cos, sin

import numpy as np

from bellcrank_bench.bench.bench_problem import OUTPUTS, Array, Problem
from bellcrank_bench.textbook.reduced_coordinates import RollingDisk


def substeps(problem: Problem, step: float) -> tuple[int, float]:
    """How many equal steps of about `step` s go between two outputs, and their length, s."""
    interval = problem.duration / (OUTPUTS - 1)
    count = max(1, round(interval / step))
    return count, interval / count


def disk_start(problem: Problem) -> tuple[Array, Array]:
    """The rolling disk as a free body: centre (m) and quaternion (w, x, y, z); its velocity in world axes (m/s) and
    its angular velocity in its own (rad/s).
    """
    state = np.array(problem.start)
    tilt, heading = state[2:4]
    (c, s), (d, e) = (cos(0.5 * heading), sin(0.5 * heading)), (cos(0.5 * tilt), sin(0.5 * tilt))
    equations = problem.equations
    assert isinstance(equations, RollingDisk)
    rates = equations.derivative(state)
    fall = -equations.radius * sin(tilt) * state[5]
    place = problem.positions(state)
    return np.array([*place, c * d, c * e, s * e, s * d]), np.array([*rates[:2], fall, *state[5:8]])
