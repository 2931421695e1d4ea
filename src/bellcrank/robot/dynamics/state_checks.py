"""Checks of the positions, velocities, accelerations and torques that a robot's functions take, and of results."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.errors import InputError

Array = NDArray[np.float64]
_DOUBLE = np.dtype(np.float64)
QVA, QVTAU = ("q", "v", "a"), ("q", "v", "tau")


@dataclass(frozen=True)
class StateCheck:
    """Checks for a robot of this name and these sizes of q and v."""

    robot: str
    nq: int
    nv: int

    def states(self, names: tuple[str, ...], *states: Any) -> tuple[Array, ...]:
        """Finite arrays of doubles, (n,) or (rows, n) each: q of nq numbers, any other of nv. Raises InputError."""
        out, rows = [], -1
        for name, given in zip(names, states, strict=False):
            x = given if type(given) is np.ndarray and given.dtype is _DOUBLE else self._converted(name, given)
            size = self.nq if name == "q" else self.nv
            if x.ndim not in (1, 2) or x.shape[-1] != size or (x.ndim == 2 and rows not in (-1, len(x))):
                n = rows if rows >= 0 else "n"
                arguments.refuse(name, f"an array of shape ({size},) or ({n}, {size})", x, self.robot)
            if x.ndim == 2:
                rows = len(x)
            if not all_finite(x):
                self._refuse_infinite(name, x)
            out.append(x)
        return tuple(out)

    def answer(self, what: str, answer: Array) -> Array:
        """An answer, which is finite unless numbers overflowed on the way to it (InputError, beginning with `what`)."""
        if not all_finite(answer) and not np.isfinite(answer).all():
            raise InputError(
                f"{self.robot}: {what} overflows: a position, velocity or acceleration is too large; check its units"
            )
        return answer

    def _converted(self, name: str, given: Any) -> Array:
        size = self.nq if name == "q" else self.nv
        return arguments.as_array(name, given, f"an array of shape ({size},) or (n, {size})", self.robot)

    def _refuse_infinite(self, name: str, x: Array) -> None:
        """Name the first number that is not finite, where there is one: the sum of finite ones may be infinite."""
        bad = np.argwhere(~np.isfinite(np.atleast_2d(x)))
        if len(bad):
            row, column = bad[0]
            raise InputError(
                f"{self.robot}: argument '{name}': expected finite numbers, found {np.atleast_2d(x)[row, column]} "
                f"(sample {row}, entry {column})"
            )


def all_finite(x: Array) -> bool:
    """Whether a sum over all numbers is finite, which it is of finite ones only: a quick test before a slow one.

    Not by `np.vdot`: BLAS divides it among threads, whose waiting takes 100 times as long where processors are busy.
    """
    return math.isfinite(sum(x.tolist()) if x.ndim == 1 else np.einsum("i->", x.ravel(order="K")))
