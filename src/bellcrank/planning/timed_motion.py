"""The motion of joints along a path with its timing, and by how much it exceeds the limits between its rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from bellcrank.arrays import Array, Indices
from bellcrank.motion.motion import Motion
from bellcrank.planning.fastest_motion import LimitExcess
from bellcrank.planning.fastest_pass import PathTiming, fastest_on_grid
from bellcrank.planning.jerk.jerk_pass import JerkTiming, jerk_excess
from bellcrank.planning.joint_path import JointPath
from bellcrank.planning.limits.path_limits import PathLimits
from bellcrank.planning.motion_rows import SHORTEST, motion_rows
from bellcrank.planning.speed_scaling import scaled_motion

CHECKED_SHARES = (0.0, 0.13, 0.37, 0.5, 0.63, 0.87, 1.0)  # of the time between two rows
KEPT = 7e-7  # share of a limit: a motion that exceeds none by more is not slowed
AIMED = 3e-7  # share of a limit that a slowed motion may exceed
MOST_SLOWED = 2e-3  # of the speed
TOLERATED = 1e-3  # share of a limit: where more is exceeded, a motion on a grid is tried
LASTING = 1e-5  # of the whole time: not where it is exceeded for a shorter time
CELLS = 4000  # of that grid
EXCEEDED = 1e-6  # share of a limit: a motion that exceeds it by less keeps it
SIGN_KNOWN = 1e-9  # of a joint's largest speed: below, the sign of a speed is rounding


@dataclass(frozen=True, eq=False)
class TimedMotion:
    """A motion along a path.

    Attributes:
        motion: The motion.
        factor: The factor, at most 1, by which it is faster than its timing, so that it keeps the limits between rows.
        excess: The largest share by which it exceeds a limit.
        before: By how much it would exceed a limit if it were not slower; None where it is not.
    """

    motion: Motion
    factor: float
    excess: float
    before: LimitExcess | None = None


def timed_motion(path: JointPath, timing: PathTiming | JerkTiming, bounds: PathLimits, refined: bool) -> TimedMotion:
    """The motion of the joints along one path, with the rows between which it exceeds the limits least. A refined one
    is slowed where it still exceeds them.
    """
    if isinstance(timing, JerkTiming):
        best = timing.motion("part")
        least = limit_excess(bounds, best)
    else:
        best, least = None, np.inf
        for shortest in SHORTEST if refined else SHORTEST[:1]:
            motion = _sampled(path, timing, shortest)
            if (excess := limit_excess(bounds, motion)) < least or best is None:
                best, least = motion, excess
            if least <= KEPT:
                break
    assert best is not None
    return _slowed(best, least, bounds) if refined and least > KEPT else TimedMotion(best, 1.0, least)


def take_grid(
    paths: Sequence[JointPath], timings: list[PathTiming | JerkTiming], parts: list[TimedMotion], bounds: PathLimits
) -> list[str]:
    """Replace the timings and motions along paths where a motion on a grid exceeds the limits much less, as where the
    allowed accelerations have holes; a warning for each.
    """
    warnings = []
    for k, (path, timing, part) in enumerate(zip(paths, timings, parts, strict=True)):
        if isinstance(timing, JerkTiming) or part.excess <= TOLERATED:
            continue
        if time_above(bounds, part.motion, TOLERATED) <= LASTING * part.motion.duration:
            continue
        coarse = fastest_on_grid(path, bounds, CELLS)
        on_grid = timed_motion(path, coarse, bounds, refined=False)
        if on_grid.excess < 0.5 * part.excess:
            timings[k], parts[k] = coarse, on_grid
            warnings.append(
                f"cells that adapt themselves lead to a motion of {timing.duration:.6g} s, which exceeds a limit by "
                f"{100.0 * part.excess:.2g} %; this one has {CELLS} equal cells"
            )
    return warnings


def _slowed(motion: Motion, excess: float, bounds: PathLimits) -> TimedMotion:
    """A motion, slower by so little that it keeps the limits; as it is where that is not enough."""
    factor, slope, before = 1.0, 3.0, excess  # a jerk falls with the third power of the factor, others by less
    while slope > 0.0 and (factor := factor - (excess - AIMED) / slope) > 1.0 - MOST_SLOWED:
        slower = scaled_motion(motion, factor)
        excess = limit_excess(bounds, slower)
        if excess <= KEPT:
            return TimedMotion(slower, factor, excess, worst_excess(bounds, motion))
        slope = (before - excess) / (1.0 - factor)
    return TimedMotion(motion, 1.0, before)


def _sampled(path: JointPath, timing: PathTiming, shortest: float) -> Motion:
    rows = np.array(motion_rows(timing, shortest, path.turning_points()))
    q, first, second = path.at(np.clip(rows[:, 1], 0.0, path.length))
    y, u = rows[:, 2:3], rows[:, 3:4]
    return Motion(path.joints, rows[:, 0], q, first * y, first * u + second * y * y, "part")


def limit_excess(bounds: PathLimits, motion: Motion) -> float:
    """The largest share by which a motion exceeds a limit, at its rows and between them."""
    wide = np.flatnonzero(np.diff(motion.time) > 0.0)
    worst = max(float(np.max(_excess_at(bounds, motion, wide, share))) for share in CHECKED_SHARES)
    return max(worst, jerk_excess(motion, bounds.largest_jerk)[0]) if bounds.jerk_groups else worst


def worst_excess(bounds: PathLimits, motion: Motion) -> LimitExcess:
    """The limit that a motion exceeds most, at its rows and between them, and for how long limits are exceeded."""
    wide = np.flatnonzero(np.diff(motion.time) > 0.0)
    table = np.stack([_excess_at(bounds, motion, wide, share) for share in CHECKED_SHARES])
    place, row = np.unravel_index(int(np.argmax(table)), table.shape)
    worst, share = float(table[place, row]), CHECKED_SHARES[int(place)]
    lasting = time_above(bounds, motion, EXCEEDED) if worst > EXCEEDED else 0.0
    if bounds.jerk_groups and (jerk := jerk_excess(motion, bounds.largest_jerk))[0] > worst:
        return LimitExcess(f"jerk of {jerk[1]}", jerk[0], jerk[2], lasting)
    time, *states = _states(motion, wide[[row]], share)
    by_limit = {name: float(one[0]) for name, one in bounds.excess_by_limit(*states).items()}
    return LimitExcess(max(by_limit, key=lambda name: by_limit[name]), worst, float(time[0]), lasting)


def time_above(bounds: PathLimits, motion: Motion, excess: float) -> float:
    """The time, s, in which a motion exceeds a limit other than of jerk by more than a share, between its rows."""
    step = np.diff(motion.time)
    wide = np.flatnonzero(step > 0.0)
    inner = CHECKED_SHARES[1:-1]
    ends = [0.0, *((a + b) / 2.0 for a, b in pairwise(inner)), 1.0]
    return sum(
        (end - begin) * float(np.sum(step[wide][_excess_at(bounds, motion, wide, share) > excess]))
        for share, (begin, end) in zip(inner, pairwise(ends), strict=True)
    )


def _excess_at(bounds: PathLimits, motion: Motion, rows: Indices, share: float) -> Array:
    """The shares by which limits are exceeded after a share of the time from rows (n,) to the next ones."""
    return bounds.excess_of_motion(*_states(motion, rows, share)[1:])


def _states(motion: Motion, rows: Indices, share: float) -> tuple[Array, Array, Array, Array]:
    """Times (n,) after a share of the time from rows (n,) to the next ones, and the states there. A speed that is 0 but
    for rounding has the direction that it has between the rows, on which friction and the losses of gears depend.
    """
    step = np.diff(motion.time)[rows]
    time = motion.time[rows] + share * step
    q, v, a = motion.at(time, side="after" if share < 1.0 else "before")
    middle = motion.at(motion.time[rows] + 0.5 * step)[1]
    least = SIGN_KNOWN * np.abs(motion.velocity).max(axis=0)
    return time, q, np.where(np.abs(v) < least, np.copysign(np.minimum(np.abs(middle), least), middle), v), a
