"""How exactly the numbers in a file say what they mean: half a unit of their last digit."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal

import numpy as np

from bellcrank.motion.coordinates import Array

LOOKED_AT = 64  # numbers of a column
EXACT = 12  # significant digits from which numbers count as exact
MOST = 1e-3  # of a column's range: numbers with few digits, typed by hand, are exact though they have few
# Σ|w| of the derivative w · x / h at the end of six samples h apart, which is the quintic spline's there
END_WEIGHTS = 137 / 60 + 5 + 5 + 10 / 3 + 5 / 4 + 1 / 5


def half_unit(column: Array) -> float:
    """What is unknown of the numbers of a column (n,), in its unit; 0.0 where they have 12 significant digits or more.

    Both a fixed number of decimals and a fixed number of significant digits count: the larger of the two for the
    largest number. It is at most a thousandth of the column's range, since numbers typed by hand are exact.
    """
    numbers = np.unique(np.abs(column))
    numbers = np.concatenate([numbers[-LOOKED_AT // 2 :], numbers[:: max(1, 2 * len(numbers) // LOOKED_AT)]])
    largest = float(numbers.max(initial=0.0))
    if largest == 0.0:
        return 0.0
    written = [Decimal(repr(number)).normalize().as_tuple() for number in numbers.tolist() if number]
    digits = max(len(each.digits) for each in written)
    if digits >= EXACT:
        return 0.0
    decimals = max(-int(each.exponent) for each in written)
    unit = max(10.0**-decimals, 10.0 ** (int(np.floor(np.log10(largest))) + 1 - digits))
    return float(min(0.5 * unit, MOST * np.ptp(column)))


def end_speed_noise(time: Array, positions: Sequence[float]) -> list[float]:
    """What is unknown of speeds at the ends that come from positions known to ± `positions`, per s."""
    steps = np.diff(time)
    ends = np.concatenate([steps[:5], steps[-5:]])
    step = float(ends[ends > 0.0].min())
    return [END_WEIGHTS * half / step for half in positions]
