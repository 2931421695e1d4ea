"""Splines of degree 5 through given points, as functions of time that can be differentiated and copied."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bellcrank._step import spline_coefficients, spline_values
from bellcrank.arrays import Array
from bellcrank.errors import InputError

FEWEST = 6  # points of a spline whose ends are not-a-knot


@dataclass(frozen=True, eq=False)
class QuinticSpline:
    """A spline by its knots (n + 6,) and coefficients (n, m)."""

    knots: Array
    coefficients: Array

    @classmethod
    def through(cls, times: Array, points: Array, rest: bool) -> QuinticSpline:
        """The spline through points (k, m) at times (k,), which rise.

        With `rest` its first and second derivative are 0 at both ends. Without, the ends are not-a-knot, for which
        `FEWEST` points are needed (C. de Boor, A Practical Guide to Splines, 1978, ch. XIII).

        Raises:
            InputError: The times are too close for numbers.
        """
        inner = times[1:-1] if rest else times[3:-3]
        knots = np.concatenate([np.repeat(times[:1], 6), inner, np.repeat(times[-1:], 6)])
        try:
            found = spline_coefficients(knots, np.ascontiguousarray(times), np.ascontiguousarray(points, dtype=float))
        except ValueError:
            raise too_close(times) from None
        if not np.isfinite(found).all():
            raise too_close(times)
        return cls(knots, found)

    def __call__(self, times: Array, order: int = 0) -> Array:
        """Values (k, m) of a derivative at times (k,); beyond the ends the curve goes on as it is there."""
        return spline_values(self.knots, self.coefficients, np.ascontiguousarray(times, dtype=float), order)


def too_close(times: Array) -> InputError:
    """The error of points through which no curve can be computed."""
    least = float(np.min(np.diff(times)))
    return InputError(
        f"no smooth curve passes through {len(times)} points whose times lie as close as {least:.3g} s; "
        "leave some of them out"
    )
