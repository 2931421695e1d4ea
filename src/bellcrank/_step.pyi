"""Calls compiled functions (step_ext/module.cpp)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

def evaluate(
    address: int, inputs: tuple[Any, ...], input_sizes: tuple[int, ...], output_sizes: tuple[int, ...]
) -> tuple[NDArray[np.float64], ...] | None: ...
