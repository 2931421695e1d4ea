"""Estimates of a run's error by repeated runs, and whether a run without projection has changed its branch.

A run has three sources of error:

- *Step size*. A run with a hundredth of the tolerances has about a hundredth of this error, so that the difference of
  both runs is the error.
- *Constraints without projection*. They drift, and where a linkage passes a configuration in which they lose rank, it
  may continue along another branch. Repeated runs are projected.
- *Regularisation*. Near such configurations a fraction of the usual J M⁻¹ Jᵀ of each row is added to it
  (dynamics/equations/kkt.py). The error of this grows with the fraction and the effect of rounding falls with it;
  smaller tolerances reduce neither. Runs with ten times and a tenth of the fraction have about ten times the one and
  the other; a part of their differences, with a margin for scatter, is the smallest error that is reported.

The estimate is the largest of these differences, and a run is known up to the time at which one of them is first larger
than the bound of its coordinate (`Settings.error_bound`). That time depends on a few percent of an error where the
error grows slowly, and on the error of the finer run where it grows fast: where the run is not known to its end, a run
with a hundredth of the finer one's tolerances decides. On N four-bars (N = 2, 5, 10 and 40; tolerances 1e-8 to
1e-13) the estimate was 0.8 to 40 times the error known from their reduced equation, except where that error was small
by chance; on Bricard's linkage, a four-bar, a rolling disk and open chains it was 0.95 to 1.1 times the error, and up
to 25 times at rtol < 2e-13.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank._step import methods
from bellcrank.arrays import Array, Mask
from bellcrank.dynamics.equations.system import system_of
from bellcrank.scene.settings import FINEST_RTOL
from bellcrank.simulation.integration.statistics import Status

if TYPE_CHECKING:
    from bellcrank.scene.settings import Settings
    from bellcrank.simulation.trajectory.trajectory import Trajectory

SAME_END = 1e-6  # of its duration: by so much a repeated run may end earlier, at an event, and still be compared
FINER = 0.01  # of the tolerances
# factors of the regularisation, and by what the difference is divided; measured on the N four-bars
REGULARISATIONS = ((10.0, 2.0), (0.1, 5.0))
LEAST_RANGE = 1e-3  # rad or m: a coordinate that moves less has no smaller bound
SAFE = 0.8  # of a bound: an estimate may be smaller than the error by as much
CLOSE = 0.97  # of a bound, for the estimate by a run with a hundredth of the finer one's tolerances
TINIEST = 5e-324  # s, rad or m: the smallest step or tolerance, as half of it is 0
DRIFTED = 1e4  # times the tolerance: the most by which a run without projection may differ
LONGEST = 10.0  # s of integration that a comparison may take without being asked for
UNASKED = 1.0  # s that an estimate may take without being asked for
EVALUATIONS = 20  # times the limit of the settings: the limit of a repeated run


@dataclass(frozen=True)
class Accuracy:
    """How well the positions of a run are known.

    Attributes:
        estimate: Their largest error, rad or m; infinite where a repeated run ended early.
        known_until: The last output time up to which the error of every coordinate is below its bound, s; infinite
            where that is the whole run.
    """

    estimate: float
    known_until: float


def error_bounds(run: Trajectory) -> Array:
    """Up to which error (nq,), rad or m, each position of a run counts as known."""
    return np.asarray(run.settings.error_bound * np.maximum(np.ptp(run.position, axis=0), LEAST_RANGE))


def accuracy(run: Trajectory, seconds: float = math.inf) -> Accuracy | None:
    """How well the positions of a run are known, by repeated runs.

    None where one takes more than about so many `seconds` of integration. Raises KeyboardInterrupt where one was
    interrupted.
    """
    if not (run.time > 0.0).any():
        return Accuracy(math.inf, 0.0)
    finer, rest = _finer(run)
    wanted = [(finer, 1.0, 1.0 - rest)]
    if run.scene.constraints:
        wanted += [(settings, share, floors) for share, floors in REGULARISATIONS for settings in (run.settings, finer)]
    found, bounds = [], error_bounds(run)
    for settings, share, parts in wanted:
        again = _repeated(run, settings, share, seconds)
        if again is None:
            return None
        found.append(_compared(run, again, parts, SAFE * bounds))
    if math.isfinite(found[0].known_until) and (finest := _finest(run)) is not None:
        again = _repeated(run, finest[0], 1.0, seconds)
        if again is not None:
            found[0] = _compared(run, again, 1.0 - finest[1], CLOSE * bounds)
    return Accuracy(max(one.estimate for one in found), min(one.known_until for one in found))


def _compared(run: Trajectory, again: Trajectory, parts: float, bounds: Array) -> Accuracy:
    """How well a run is known by one other, whose differences are so many parts of its error (nq bounds, rad or m)."""
    within = _differences(run, again) <= parts * bounds
    return Accuracy(_largest_difference(run, again) / parts, _known_until(run, within))


def _known_until(run: Trajectory, within: Mask) -> float:
    """The last time of a run up to which all errors (n, nq), at its first n times after 0, are within their bounds."""
    rows = np.asarray(within.all(axis=1))
    count = len(rows) if rows.all() else int(np.argmin(rows))
    time = run.time[run.time > 0.0]
    if count == len(time):
        return math.inf
    return float(time[count - 1]) if count else 0.0


def unasked_accuracy(run: Trajectory) -> Accuracy | str:
    """How well the positions of a run are known if that is known already or takes about a second at most; else why not.

    What is computed is remembered.
    """
    ask = "error_estimate(), or simulate --error-estimate"
    if run.known_accuracy is not None:
        return run.known_accuracy
    if not run.success:
        return "not computed (the run ended early)"
    if not system_of(run.scene).is_loaded:
        return f"not computed (its code is not loaded yet; {ask})"
    cost = expected_cost(run)
    found = accuracy(run, UNASKED) if cost < UNASKED else None
    if found is None:
        return f"not computed (it takes more than {max(cost, UNASKED):.2g} s; {ask})"
    run.remember_estimate(found.estimate, found.known_until)
    return found


def expected_cost(run: Trajectory) -> float:
    """About how long `accuracy` will integrate, s, from the kernel time of the run; without compiling."""
    finer = _more_steps(run)
    return run.statistics.kernel_time * (2.0 + 3.0 * finer if run.scene.constraints else finer)


@dataclass(frozen=True)
class Departure:
    """How a run without projection differs from one with it.

    Attributes:
        largest: The largest difference, rad or m.
        time: From when on it is larger than it may be, s.
        ended: When the run with projection ended, s, if it ended early.
    """

    largest: float
    time: float
    ended: float | None


def departure(run: Trajectory) -> Departure | None:
    """Where a run without projection departs from one with it; None where it does not, or is projected itself.

    It departs where a coordinate differs by more than 10,000 times its tolerance, or 1 % of its range if that is less,
    and by more than ten times the error of the run with projection.
    """
    if not is_comparable(run):
        return None
    kept, finer = _repeated(run, run.settings), _repeated(run, _finer(run)[0])
    assert kept is not None and finer is not None
    gaps, s = _differences(run, finer), run.settings
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
    """Whether a run has constraints and no projection, and a comparison takes at most about LONGEST seconds."""
    loose = bool(run.scene.constraints) and run.settings.stabilisation.kind != "projection"
    cost = run.statistics.kernel_time * (1.0 + _more_steps(run))
    return loose and bool((run.time > 0.0).any()) and cost <= LONGEST


def _more_steps(run: Trajectory) -> float:
    """By about what factor a finer run takes more steps."""
    return 2.0 if run.settings.step else float(FINER ** (-1.0 / _order(run)))


def _order(run: Trajectory) -> int:
    """The order of the method; of "auto" that of Radau where the run changed to it."""
    solver = run.settings.solver
    if solver == "auto":
        solver = "Radau" if run.statistics.switches else "DOP853"
    return methods()[solver]


def _finest(run: Trajectory) -> tuple[Settings, float] | None:
    """As `_finer`, with a hundredth of its tolerances or half of its step; None where they cannot be smaller."""
    s = run.settings
    return None if not s.step and FINER * s.rtol <= FINEST_RTOL else _finer(run, 2)


def _finer(run: Trajectory, times: int = 1) -> tuple[Settings, float]:
    """Settings of a more exact run, so many times over, and which fraction of the error it still has.

    Its steps are at most half as long, so that both do not take the same steps. Tolerances that cannot be smaller are
    made larger.
    """
    s = run.settings
    if s.step:
        return replace(s, step=max(0.5**times * s.step, TINIEST)), 0.5 ** (times * _order(run))
    factor = max(FINER**times, FINEST_RTOL / s.rtol)
    if factor > 0.5:
        return replace(s, rtol=10.0 * s.rtol, atol=10.0 * s.atol), 0.0
    known = run.statistics.longest_step  # run.steps may be decimated
    longest = (float(np.diff(run.steps).max(initial=0.0)) if known is None else known) or s.max_step
    first = s.first_step and max(s.first_step / 2, TINIEST)
    half: dict[str, Any] = {"max_step": max(longest / 2, TINIEST) if longest else None, "first_step": first}
    return replace(s, rtol=max(factor * s.rtol, FINEST_RTOL), atol=max(factor * s.atol, TINIEST), **half), 0.0


def _repeated(
    run: Trajectory, settings: Settings, regularisation: float = 1.0, seconds: float = math.inf
) -> Trajectory | None:
    """The run repeated with other settings and a multiple of its regularisation, projected, without Baumgarte's terms.

    None where it takes more than about so many seconds of integration.
    """
    p, cost = run.parameters.copy(), run.statistics
    if run.scene.constraints:
        p[len(run.scene.parameter_values) : len(run.scene.own_parameters)] = 0.0  # gains
        p[-1] *= regularisation
    most = min(EVALUATIONS * settings.max_evaluations, 2**62)
    if math.isfinite(seconds):
        most = min(most, max(int(cost.evaluations * seconds / max(cost.kernel_time, 1e-9)), 1000))
    settings = replace(settings, duration=float(run.time[-1]), max_evaluations=most)
    again = run.repeat(run, settings, run.time[run.time > 0.0], p)
    if again.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    return None if again.status is Status.EVALUATIONS_SPENT and math.isfinite(seconds) else again


def _largest_difference(run: Trajectory, again: Trajectory) -> float:
    """The largest difference of positions (rad or m); infinite where the other run ended early or is not finite."""
    gaps = _differences(run, again)
    whole = len(gaps) == np.count_nonzero(run.time > 0.0) and again.time[-1] >= run.time[-1] * (1.0 - SAME_END)
    largest = float(gaps.max(initial=0.0)) if whole else math.inf
    return largest if math.isfinite(largest) else math.inf


def _differences(run: Trajectory, again: Trajectory) -> Array:
    """The differences of positions (n, nq), rad or m, at each common time after 0."""
    mine = run.position[run.time > 0.0]
    count = min(len(mine), len(again))
    return np.abs(again.position[:count] - mine[:count])
