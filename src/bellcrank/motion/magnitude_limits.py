"""Limits of the numbers of motions and tables, so that no computation overflows.

Interpolation divides changes by times up to the fifth power, and squares the result. Within these limits all of that
lies between 1e-300 and 1e300; the motion of any machine is far within them.
"""

from __future__ import annotations

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import InputError

LONGEST = 1e30  # s, from 0
SHORTEST = 1e-20  # s, between rows
LARGEST = (1e30, 1e50, 1e70)  # of positions and of their first and second derivatives, in SI units


def check_times(title: str, time: Array) -> None:
    """Refuse times (n,) in s beyond LONGEST, and different ones closer than SHORTEST (InputError)."""
    if not len(time):
        return
    k = int(np.argmax(np.abs(time)))
    if abs(time[k]) > LONGEST:
        raise InputError(f"{title}: time {time[k]:g} s in row {k + 1}: expected at most {LONGEST:g} s")
    step = np.diff(time)
    close = np.flatnonzero((step > 0.0) & (step < SHORTEST))
    if len(close):
        k = int(close[0])
        raise InputError(
            f"{title}: rows {k + 1} and {k + 2} are {step[k]:.3g} s apart; use equal times for a jump, or at least "
            f"{SHORTEST:g} s"
        )


def check_size(title: str, what: str, values: Array, order: int = 0) -> None:
    """Refuse positions (n, k), or their derivatives of an order up to 2, beyond LARGEST (InputError)."""
    if not values.size or np.abs(values).max() <= LARGEST[order]:
        return
    rows = np.abs(values.reshape(len(values), -1)).max(axis=1)
    k = int(np.argmax(rows))
    raise InputError(f"{title}: {what} {rows[k]:g} in row {k + 1}: expected at most {LARGEST[order]:g}")
