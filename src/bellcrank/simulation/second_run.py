"""Runs made again to judge a run: how far its positions may be off, and whether it has left its closures' branch.

Three things make a run wrong. *Steps*: a run with a hundredth of the tolerances has a hundredth of that error or less, so
that the difference is the error. *Closures without projection* drift, and where the linkage passes a position in which
they lose rank they may go on along another branch: runs made again are projected. *Regularisation*: near such positions
a share of each row's usual J M⁻¹ Jᵀ is added to it (dynamics/closed.py), which no tolerance makes less; where the
passages amplify it, it is the floor of the error, and so is what rounding leaves there. It is in proportion to the share,
so that a run with ten times the share is off by about ten times the floor, and the difference is above it.

The largest difference of these runs is the estimate. On an N four-bar (N = 2, 5, 40; 1e-8 to 1e-12), Bricard's ring, a
four-bar, a rolling disk and open chains it is between 0.8 and 30 times the error known from reduced equations, and
within 0.9 to 1.1 where no singular position is passed (tests/test_second_run.py).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank._step import methods
from bellcrank.scene.settings import FINEST_RTOL
from bellcrank.simulation.status import Status

if TYPE_CHECKING:
    from bellcrank.scene.settings import Settings
    from bellcrank.simulation.trajectory import Trajectory

Array = NDArray[np.float64]
SAME_END = 1e-6  # share of its duration by which a run may end earlier, at an event, and still be compared
FINER = 0.01  # of the tolerances
MORE_REGULAR = 10.0  # times the regularisation
EVALUATIONS = 20  # times those of the settings that a run made again may take


def error_estimate(run: Trajectory) -> float:
    """How far positions may be off (rad or m): the largest difference from runs made again; infinite where one of them
    ended early. Raises KeyboardInterrupt where one was interrupted.
    """
    if not (run.time > 0.0).any():
        return float("inf")
    finer, rest = _finer(run)
    largest = _apart(run, _again(run, finer)) / (1.0 - rest)
    if run.scene.closures:
        for settings in (run.settings, finer):
            largest = max(largest, _apart(run, _again(run, settings, MORE_REGULAR)))
    return largest


def expected_cost(run: Trajectory) -> float:
    """About how long `error_estimate` will step, s, by the kernel time of the run; compiling is not counted."""
    s = run.settings
    finer = 2.0 if s.step else FINER ** (-1.0 / methods()[s.solver])
    return run.statistics.kernel_time * (1.0 + 2.0 * finer if run.scene.closures else finer)


@dataclass(frozen=True)
class Departure:
    """How far a run without projection gets from one with it (rad or m), and from when on, s, by more than `bar`."""

    largest: float
    bar: float
    time: float


def departure(run: Trajectory) -> Departure | None:
    """Where a run whose closures are not projected departs from one whose are; None where it does not, or is projected.

    The bar is 1000 times the tolerance of positions, or ten times what a run with a hundredth of the tolerances
    differs from the projected one, if that is more.
    """
    if not run.scene.closures or run.settings.stabilisation.kind == "projection" or not (run.time > 0.0).any():
        return None
    kept = _again(run, run.settings)
    gap = _gaps(run, kept)
    s = run.settings
    return None


def _finer(run: Trajectory) -> tuple[Settings, float]:
    """Settings of a run that is more exact, and what share of the error it has too; the steps are half as long at most,
    lest both take the same. Where tolerances cannot be finer they are coarser.
    """
    s = run.settings
    if s.step:
        return replace(s, step=s.step / 2), 0.5 ** methods()[s.solver]
    factor = max(FINER, FINEST_RTOL / s.rtol)
    if factor > 0.5:
        return replace(s, rtol=10.0 * s.rtol, atol=10.0 * s.atol), 0.0
    longest = float(np.diff(run.steps).max(initial=0.0)) or s.max_step
    first = s.first_step and s.first_step / 2
    half = {"max_step": longest / 2 if longest else None, "first_step": first}
    return replace(s, rtol=max(factor * s.rtol, FINEST_RTOL), atol=factor * s.atol, **half), 0.0


def _again(run: Trajectory, settings: Settings, regularisation: float = 1.0) -> Trajectory:
    """The run's scene with other settings and a multiple of its regularisation, projected, without Baumgarte's terms."""
    from bellcrank.simulation.simulate import simulate_again

    p = run.parameters.copy()
    if run.scene.closures:
        p[len(run.scene.parameter_values) : len(run.scene.own_parameters)] = 0.0  # gains
        p[-1] *= regularisation
    evaluations = min(EVALUATIONS * settings.max_evaluations, 2**62)
    settings = replace(settings, duration=float(run.time[-1]), max_evaluations=evaluations)
    again = simulate_again(run, settings, run.time[run.time > 0.0], p)
    if again.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    return again


def _apart(run: Trajectory, again: Trajectory) -> float:
    """The largest difference of positions (rad or m); infinite where the second run ended early or is not finite."""
    gaps = _gaps(run, again)
    whole = len(gaps) == np.count_nonzero(run.time > 0.0) and again.time[-1] >= run.time[-1] * (1.0 - SAME_END)
    largest = float(gaps.max(initial=0.0)) if whole else float("inf")
    return largest if np.isfinite(largest) else float("inf")


def _gaps(run: Trajectory, again: Trajectory) -> Array:
    """The difference of positions (rad or m) at each common time after 0."""
    mine = run.position[run.time > 0.0]
    count = min(len(mine), len(again))
    return np.asarray(np.abs(again.position[:count] - mine[:count]).max(axis=1, initial=0.0))
