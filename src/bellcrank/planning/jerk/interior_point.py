"""The least time over squared path speeds within limits that include jerk, by a primal-dual interior-point method.

Minimised is T = ∫ dr/√z over the unknowns of z within constraints g ≤ 0 at all places. The iterates keep all
constraints; the barrier parameter falls until the duality gap is negligible (S. Boyd, L. Vandenberghe, Convex
Optimization, 2004, 11.7; J. Nocedal, S. Wright, Numerical Optimization, 2nd ed., 19). The part of the Hessian that jerk
limits make negative is cut off. Jerk limits are not convex, so the result is a local optimum; the multipliers are the
derivatives of the time with respect to the limits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import BellcrankError
from bellcrank.planning.jerk.jerk_limits import LOCAL, PLACES, SHARES, JerkLimits, SquaredSpeedSpline, Violation

GAP = 1e-9  # of the time: the duality gap at the end
CENTRED = 0.1  # the barrier parameter falls once the Newton decrement squared, over m μ, is below
FALL = 0.15  # factor by which the barrier parameter falls
TO_BOUNDARY = 0.99
CONVEX = 0.02  # share of the objective's curvature that jerk limits leave at least
MOST_STEPS = 400
LEAST_RIDGE = 1e-14  # of the diagonal


@dataclass(frozen=True, kw_only=True, eq=False)
class OptimalSpeed:
    """A locally optimal squared path speed.

    Attributes:
        unknowns: Of the spline.
        multipliers: Of the constraints (cells, PLACES, m), s: derivatives of the time.
        time: T, s.
        gap: The duality gap over the time, of the convex problem that the last step solved.
        steps: Number of Newton steps.
    """

    unknowns: Array
    multipliers: Array
    time: float
    gap: float
    steps: int


@dataclass(frozen=True, eq=False)
class _State:
    unknowns: Array
    z: Array  # (3, p)
    found: Violation

    @property
    def inside(self) -> bool:
        return bool(np.all(self.z[0] > 0.0)) and bool(np.all(self.found.value < 0.0))


class InteriorPoint:
    """The problem on one spline."""

    def __init__(self, spline: SquaredSpeedSpline, limits: JerkLimits) -> None:
        self._spline, self._limits = spline, limits
        self._weights = spline.weights.ravel()
        self._basis = spline.basis(SHARES)

    @property
    def places(self) -> Array:
        """The places (p,) at which limits are kept."""
        return self._spline.points.ravel()

    def state(self, unknowns: Array) -> _State | None:
        """The state; None where z is not positive."""
        z = self._at_points(unknowns)
        if not np.all(z[0] > 0.0):
            return None
        return _State(unknowns, z, self._limits.violation(z))

    def run(self, start: Array, progress: Callable[[float], None] | None = None) -> OptimalSpeed:
        """Solve from unknowns inside all limits."""
        here = self.state(start)
        assert here is not None and here.inside
        count = here.found.value.size
        barrier = 0.1 * self._time(here) / count
        multipliers = barrier / -here.found.value
        steps = 0
        while steps < MOST_STEPS:
            steps += 1
            step, decrement = self._newton(here, multipliers, barrier)
            slack = -here.found.value
            change = self._at_points(step)
            towards = (here.found.slope @ change.T[..., None])[..., 0]
            new = (barrier + multipliers * towards) / slack
            moved = self._search(here, step, barrier, decrement)
            if moved is None or decrement < CENTRED * barrier * count:
                if (
                    moved is None
                    and decrement >= CENTRED * barrier * count
                    and barrier * count < 1e-6 * self._time(here)
                ):
                    break
                if barrier * count <= GAP * self._time(here):
                    break
                barrier *= FALL
            if moved is not None:
                here = moved
                ahead = new - multipliers
                falling = ahead < 0.0
                most = np.min(np.where(falling, -TO_BOUNDARY * multipliers / np.where(falling, ahead, -1.0), 1.0))
                multipliers = multipliers + min(1.0, float(most)) * ahead
                slack = -here.found.value
                multipliers = np.clip(multipliers, 1e-8 * barrier / slack, 1e8 * barrier / slack)
            if progress is not None:
                progress(self._time(here))
        gap = float(np.sum(multipliers * -here.found.value)) / self._time(here)
        cells = self._spline.cells
        return OptimalSpeed(
            unknowns=here.unknowns,
            multipliers=multipliers.reshape(cells, PLACES, -1),
            time=float(np.sum(self._spline.durations(here.unknowns))),
            gap=gap,
            steps=steps,
        )

    def times_at(self, state: _State) -> Array:
        """The parts (p,) of the time that belong to the places, s."""
        return np.asarray(self._weights * state.z[0] ** -0.5)

    def _time(self, state: _State) -> float:
        return float(np.sum(self.times_at(state)))

    def _at_points(self, unknowns: Array) -> Array:
        return np.asarray(np.einsum("csok,ck->ocs", self._basis, self._spline.local(unknowns)).reshape(3, -1))

    def _newton(self, here: _State, multipliers: Array, barrier: float) -> tuple[Array, float]:
        """The step of the unknowns, and the squared Newton decrement."""
        z, slack, slope = here.z[0], -here.found.value, here.found.slope
        gradient = ((barrier / slack)[:, None] @ slope)[:, 0]
        gradient[:, 0] -= 0.5 * self._weights * z**-1.5
        curvature = slope.transpose(0, 2, 1) @ ((multipliers / slack)[..., None] * slope)
        jerks = multipliers[:, self._limits.first_jerk :].sum(axis=1)
        curvature[:, 0, 0] += 0.75 * z**-2.5 * np.maximum(self._weights - jerks, CONVEX * self._weights)
        cells = self._spline.cells
        basis = self._basis.reshape(-1, 3, LOCAL)
        local = (gradient[:, None] @ basis)[:, 0].reshape(cells, -1, LOCAL).sum(axis=1)
        blocks = (basis.transpose(0, 2, 1) @ curvature @ basis).reshape(cells, -1, LOCAL, LOCAL).sum(axis=1)
        size = 2 * cells + 2
        whole, banded = np.zeros(size), np.zeros((LOCAL, size))
        for k in range(LOCAL):
            whole[k : k + 2 * cells : 2] += local[:, k]
            for m in range(k, LOCAL):
                banded[LOCAL - 1 - (m - k), m : m + 2 * cells : 2] += blocks[:, k, m]
        step = _solved(banded, -whole)
        return step, float(-whole @ step)

    def _search(self, here: _State, step: Array, barrier: float, decrement: float) -> _State | None:
        """The state after a share of the step that lowers the barrier function; None where none does."""

        def value(state: _State) -> float:
            return self._time(state) - barrier * float(np.sum(np.log(-state.found.value)))

        before, share = value(here), 1.0
        for _ in range(40):
            ahead = self.state(here.unknowns + share * step)
            inside = ahead is not None and np.all(ahead.found.value < (1.0 - TO_BOUNDARY) * here.found.value)
            if ahead is not None and inside and value(ahead) <= before - 1e-4 * share * decrement:
                return ahead
            share *= 0.6
        return None


def _solved(banded: Array, right: Array) -> Array:
    """The solution of a positive definite banded system, whose diagonal grows where rounding has made it indefinite."""
    from scipy.linalg import LinAlgError, solveh_banded

    ridge = 0.0
    while True:
        stiff = banded.copy()
        stiff[-1] *= 1.0 + ridge
        try:
            return np.asarray(solveh_banded(stiff, right, check_finite=False))
        except LinAlgError:
            ridge = max(LEAST_RIDGE, 100.0 * ridge)
            if ridge > 1.0:
                raise BellcrankError(
                    "the method for limits of jerk failed: its equations are singular to rounding; choose limits of "
                    "jerk that are closer to each other"
                ) from None
