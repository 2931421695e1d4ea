"""What the integrator of sensitivities is given, as typed records (src/cpp/integrator/sensitivities.cpp)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bellcrank.codegen.directional import Directional

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DirectionalKernels:
    """Addresses of the functions of a directional derivative, and the size of the tape between them."""

    point: int
    along: int
    tape: int

    @classmethod
    def of(cls, derivative: Directional, *, later: bool = False) -> DirectionalKernels:
        """The compiled functions; `later`: compiled when first called."""
        point, along = derivative.point.code("scalar"), derivative.along.code("directions")
        tape = derivative.point.output_sizes[-1]
        if later:
            return cls(point.lazy_address, along.lazy_address, tape)
        return cls(point.address, along.address, tape)


@dataclass(frozen=True, eq=False, kw_only=True)
class SensitivityProblem:
    """S' = f_x S + f_p along a run.

    Attributes:
        rate: The directional derivative of x' = f(t, x, u, p).
        fallback: The one that holds where the guard of `rate` is not positive; None without constraints.
        project: The projection of S onto the constraints' derivatives; None where the run does not project.
        project_fallback: The one that holds where its guard is not positive.
        lanes: SIMD lanes.
        seeds: S (directions, nq + nv) at the start.
        changes: dp (directions, parameters).
        tolerance: Of S, relative to the largest position or velocity of a direction so far.
        floors: Errors (directions,) that are too small to count.
        first_step: s.
        given_steps: Whether the pass tries the steps of the run.
        steps: Times, s, at which steps end, the start first.
        marks: Times, s, at which S is wanted besides the rows; steps end there.
        times: Times (n,) s of the rows.
        states: The states (n, nx) of the run in the rows.
    """

    rate: DirectionalKernels
    fallback: DirectionalKernels | None
    project: DirectionalKernels | None
    project_fallback: DirectionalKernels | None
    lanes: int
    seeds: Array
    changes: Array
    tolerance: float
    floors: Array
    first_step: float
    given_steps: bool
    steps: Array
    marks: Array
    times: Array
    states: Array
