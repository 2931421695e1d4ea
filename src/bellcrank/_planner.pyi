"""The fastest motion along a path (src/cpp/planner)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Row = tuple[int, int, int, int, int, float, float]

class LimitArrays:
    """Limits at n places of a path, as path_limits.hpp describes them; rows are (drive, back, motor, curve, braking,
    sense, limit).
    """

    def __init__(
        self,
        a: Array,
        b: Array,
        d: Array,
        c: Array,
        w: Array,
        rate: Array,
        motor_rate: Array,
        fastest: Array,
        width: Array,
        negligible: Array,
        along: Array,
        bend: Array,
        across: Array,
        norm: Array,
        rows: list[Row],
        curves: list[Sequence[tuple[float, float]]],
    ) -> None: ...

def lower_bound(limits: LimitArrays, r: Array, ds: Array) -> tuple[float, Array]: ...
def fastest_on_grid(limits: LimitArrays, s: Array, begin: float, end: float) -> dict[str, Any]: ...
def fastest_refined(
    limits: LimitArrays,
    r: Array,
    s: Array,
    ds: Array,
    narrow: NDArray[np.uint8],
    begin: float,
    end: float,
    speed_tolerance: float,
    excess_tolerance: float,
    tooth: float,
    apart: float,
) -> dict[str, Any]: ...
def excess(limits: LimitArrays, speed: Array, acceleration: Array) -> Array: ...
def linearised(limits: LimitArrays, speed: Array, acceleration: Array) -> tuple[Array, Array, Array, Array]: ...
def bounds_at(limits: LimitArrays, place: int, speed: float) -> tuple[float, float, int, int, float]: ...
def largest_factor(limits: LimitArrays, to: float) -> tuple[float, int, int]: ...
