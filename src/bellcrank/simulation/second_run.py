"""Runs made again to judge a run: how far its positions may be off, and whether it has left its closures' branch.

Three things make a run wrong. *Steps*: a run with a hundredth of the tolerances has about a hundredth of that error, so
that the difference is the error. *Constraints without projection* drift, and where the linkage passes a position in which
they lose rank they may go on along another branch: runs made again are projected. *Regularisation*: near such positions
a share of each row's usual J M⁻¹ Jᵀ is added to it (dynamics/constrained.py). What it leaves grows with the share, what
rounding leaves there falls with it, and no tolerance makes either less: where passages amplify them they are the floor
of the error. Runs with ten times the share and with a tenth of it are off by about ten times the one and the other, and
shares of their differences, with a margin for how passages scatter, are taken for the floor.

The largest of these differences is the estimate. On N four-bars (N = 2, 5, 10 and 40; 1e-8 to 1e-13) it was 0.8 to 40
times the error known from their reduced equation, save where that error was small by chance; on Bricard's ring, a
four-bar, a rolling disk and open chains it was 0.95 to 1.1 times the error, and to 25 times at rtol < 2e-13.
"""

from __future__ import annotations

import math
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
# times the regularisation, and how many floors the difference is at least; found by measurement on the N four-bars
REGULARISATIONS = ((10.0, 2.0), (0.1, 5.0))
TINIEST = 5e-324  # s, rad or m: half of it is 0, which is no step and no tolerance
DRIFTED = 1e4  # times the tolerance that a run without projection may be off
LONGEST = 10.0  # s of stepping that a comparison may take unasked
EVALUATIONS = 20  # times those of the settings that a run made again may take


def error_estimate(run: Trajectory, seconds: float = math.inf) -> float | None:
    """How far positions may be off (rad or m): the largest difference from runs made again; infinite where one of them
    ended early, None where one takes more than about so many seconds of stepping. Raises KeyboardInterrupt where one
    was interrupted.
    """
    if not (run.time > 0.0).any():
        return math.inf
    finer, rest = _finer(run)
    wanted = [(finer, 1.0, 1.0 - rest)]
    if run.scene.constraints:
        wanted += [(settings, share, floors) for share, floors in REGULARISATIONS for settings in (run.settings, finer)]
    largest = 0.0
    for settings, share, parts in wanted:
        again = _again(run, settings, share, seconds)
        if again is None:
            return None
        largest = max(largest, _apart(run, again) / parts)
    return largest


def expected_cost(run: Trajectory) -> float:
    """About how long `error_estimate` will step, s, by the kernel time of the run; compiling is not counted."""
    finer = _more_steps(run.settings)
    return run.statistics.kernel_time * (2.0 + 3.0 * finer if run.scene.constraints else finer)


@dataclass(frozen=True)
class Departure:
    """How far a run without projection is from one with it (rad or m), and from when on (s) by more than it may;
    `ended` (s): when the run with projection ended, where it did not come to its end.
    """

    largest: float
    time: float
    ended: float | None


def departure(run: Trajectory) -> Departure | None:
    """Where a run whose constraints are not projected departs from one whose are; None where it does not, or is projected.

    It departs where a coordinate differs by more than 10,000 times its tolerance, or 1 % of how far it moves if that is
    less, and by more than ten times what the run with projection is itself off.
    """
    if not is_comparable(run):
        return None
    kept, finer = _again(run, run.settings), _again(run, _finer(run)[0])
    assert kept is not None and finer is not None
    gaps, s = _gaps(run, finer), run.settings
    count = min(len(gaps), len(kept))
    own = float(np.abs(kept.position[:count] - finer.position[:count]).max(initial=0.0))
    moved = np.ptp(run.position, axis=0)
    allowed = s.atol + s.rtol * np.abs(run.position).max(axis=0)
    bar = np.where(moved > 0.0, np.minimum(DRIFTED * allowed, 0.01 * moved), DRIFTED * allowed)
    off = ((gaps > bar) & (gaps > 10.0 * own)).any(axis=1)
    late = float(finer.time[-1]) if finer.time[-1] < run.time[-1] * (1.0 - SAME_END) else None
    if not off.any() and late is None:
        return None
    time = run.time[run.time > 0.0][: len(gaps)]
    first = float(time[off.argmax()]) if off.any() else float(run.time[-1])
    return Departure(float(gaps.max(initial=0.0)) if off.any() else 0.0, first, late)


def is_comparable(run: Trajectory) -> bool:
    """Whether constraints bind a run that is not projected, and a comparison takes no more than about LONGEST seconds."""
    loose = bool(run.scene.constraints) and run.settings.stabilisation.kind != "projection"
    cost = run.statistics.kernel_time * (1.0 + _more_steps(run.settings))
    return loose and bool((run.time > 0.0).any()) and cost <= LONGEST


def _more_steps(settings: Settings) -> float:
    """How many times the steps of a run a finer one takes, about."""
    return 2.0 if settings.step else float(FINER ** (-1.0 / methods()[settings.solver]))


def _finer(run: Trajectory) -> tuple[Settings, float]:
    """Settings of a run that is more exact, and what share of the error it has too; the steps are half as long at most,
    lest both take the same. Where tolerances cannot be finer they are coarser.
    """
    s = run.settings
    if s.step:
        return replace(s, step=max(s.step / 2, TINIEST)), 0.5 ** methods()[s.solver]
    factor = max(FINER, FINEST_RTOL / s.rtol)
    if factor > 0.5:
        return replace(s, rtol=10.0 * s.rtol, atol=10.0 * s.atol), 0.0
    known = run.statistics.longest_step  # not the longest between kept ends of steps, where these are thinned
    longest = (float(np.diff(run.steps).max(initial=0.0)) if known is None else known) or s.max_step
    first = s.first_step and max(s.first_step / 2, TINIEST)
    half: dict[str, Any] = {"max_step": max(longest / 2, TINIEST) if longest else None, "first_step": first}
    return replace(s, rtol=max(factor * s.rtol, FINEST_RTOL), atol=max(factor * s.atol, TINIEST), **half), 0.0


def _again(
    run: Trajectory, settings: Settings, regularisation: float = 1.0, seconds: float = math.inf
) -> Trajectory | None:
    """The run's scene with other settings and a multiple of its regularisation, projected, without Baumgarte's terms;
    None where it takes more than about so many seconds of stepping.
    """
    from bellcrank.simulation.simulate import simulate_again

    p, cost = run.parameters.copy(), run.statistics
    if run.scene.constraints:
        p[len(run.scene.parameter_values) : len(run.scene.own_parameters)] = 0.0  # gains
        p[-1] *= regularisation
    most = min(EVALUATIONS * settings.max_evaluations, 2**62)
    if math.isfinite(seconds):
        most = min(most, max(int(cost.evaluations * seconds / max(cost.kernel_time, 1e-9)), 1000))
    settings = replace(settings, duration=float(run.time[-1]), max_evaluations=most)
    again = simulate_again(run, settings, run.time[run.time > 0.0], p)
    if again.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    return None if again.status is Status.EVALUATIONS_SPENT and math.isfinite(seconds) else again


def _apart(run: Trajectory, again: Trajectory) -> float:
    """The largest difference of positions (rad or m); infinite where the second run ended early or is not finite."""
    gaps = _gaps(run, again)
    whole = len(gaps) == np.count_nonzero(run.time > 0.0) and again.time[-1] >= run.time[-1] * (1.0 - SAME_END)
    largest = float(gaps.max(initial=0.0)) if whole else math.inf
    return largest if math.isfinite(largest) else math.inf


def _gaps(run: Trajectory, again: Trajectory) -> Array:
    """The differences of positions (n, nq), rad or m, at each common time after 0."""
    mine = run.position[run.time > 0.0]
    count = min(len(mine), len(again))
    return np.abs(again.position[:count] - mine[:count])
