"""How much is unknown of numbers in a file that have few digits: half a unit of the last digit."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from math import factorial

import numpy as np

from bellcrank.arrays import Array

TYPICAL = 8.0  # times the median residual: rounding changes no residual by more
FEW_RESIDUALS = 12  # fewer residuals than this come from jumps, not from rounding
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
    """By how much speeds at the ends may be off that come from positions known to ± `positions`, per s."""
    steps = np.diff(time)
    ends = np.concatenate([steps[:5], steps[-5:]])
    step = float(ends[ends > 0.0].min())
    return [END_WEIGHTS * half / step for half in positions]


def rounding_noise(time: Array, values: Array, order: int, rounding: float) -> bool:
    """Whether rounding shows in differences of samples (n,): exact numbers may have few decimals too."""
    width = order + 2
    if rounding == 0.0 or len(time) < width + FEW_RESIDUALS:
        return False
    most = 2.0**width * rounding / (float(time[-1] - time[0]) / (len(time) - 1)) ** order
    return typical_noise(differences(time, values, width, order), most) > 0.0


def differences(time: Array, values: Array, width: int, order: int) -> Array:
    """Divided differences (n − width,) of samples (n,) over width + 1 of them, as changes of the derivative of this
    order over one step; with width = order the derivative itself.
    """
    table = values
    for level in range(1, width + 1):
        table = np.diff(table) / (time[level:] - time[:-level])
    span = (time[width:] - time[:-width]) / width
    return np.asarray(table * factorial(width) * span ** (width - order))


def typical_noise(residuals: Array, most: float) -> float:
    """By how much rounding changes residuals, at most `most`: exact numbers of few decimals leave few residuals other
    than 0.
    """
    size = np.abs(residuals)
    size = size[size > 1e-3 * most]
    return min(most, TYPICAL * float(np.median(size))) if len(size) >= FEW_RESIDUALS else 0.0


def rounding_of(columns: Sequence[Array]) -> float:
    """Half a unit of the last decimal of the numbers in columns, by which they may be off; 0.0 where they have 12
    significant digits or more. Only the largest numbers of all columns count.
    """
    numbers = np.concatenate([np.unique(np.abs(column))[-32:] for column in columns])
    largest = float(numbers.max(initial=0.0))
    if largest == 0.0:
        return 0.0
    decimals = max(-int(Decimal(repr(number)).normalize().as_tuple().exponent) for number in numbers.tolist())
    unit = 10.0**-decimals
    return 0.0 if unit < 1e-12 * largest else 0.5 * unit
