"""Which limit is active where along a fastest motion, and how much time each limit costs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import BellcrankError
from bellcrank.planning.fastest_motion import LimitCost, shares
from bellcrank.planning.fastest_pass import SPEED_LIMIT, PathTiming, fastest_on_grid
from bellcrank.planning.jerk.jerk_pass import JerkTiming
from bellcrank.planning.joint_path import JointPath
from bellcrank.planning.limits.path_limits import PathLimits

CELLS = 500  # of the grid on which the costs of limits are computed
STEP = 1e-3  # relative change of a limit
NO_COST = 1e-6  # relative: a limit of smaller derivative that is nowhere the most costly one is left out


def active_limits(bounds: PathLimits, path: JointPath, timing: PathTiming | JerkTiming) -> Sequence[str]:
    """The active limit of each cell."""
    if isinstance(timing, JerkTiming):
        return timing.active
    middle = (timing.s[1:] + timing.s[:-1]) / 2.0
    speeds = bounds.speed_limits(*(path.spline(middle, order) for order in (0, 1, 2)))
    tightest = np.argmin(np.stack([value for _, value in speeds]), axis=0) if speeds else np.zeros(len(middle), int)
    return [
        bounds.names[row].group
        if row >= 0
        else speeds[int(tightest[k])][0].group
        if row == SPEED_LIMIT and speeds
        else ""
        for k, row in enumerate(timing.active.tolist())
    ]


def limit_costs(
    bounds: PathLimits,
    paths: Sequence[JointPath],
    timings: Sequence[PathTiming | JerkTiming],
    active: tuple[str, ...],
    derivatives: bool,
) -> tuple[LimitCost, ...]:
    """The cost of each limit along several paths, whose cells the active limits belong to, the most active first; with
    `derivatives` False only their shares of the time.
    """
    durations = np.concatenate([np.where(np.diff(t.s) > 0.0, t.durations, 0.0) for t in timings])
    smooth = [timing for timing in timings if isinstance(timing, JerkTiming)]
    if not smooth:
        return _differences(bounds, paths, active, durations, derivatives)
    share, whole = shares(active, durations), float(np.sum(durations))
    groups = {group: sum(timing.derivatives.get(group, 0.0) for timing in smooth) / whole
              for timing in smooth for group in timing.derivatives}  # fmt: skip
    listed = sorted(groups, key=lambda group: -share.get(group, 0.0))
    return tuple(
        LimitCost(group, share.get(group, 0.0), groups[group] if derivatives else np.nan)
        for group in listed
        if group in share or abs(groups[group]) > NO_COST
    )


def _differences(
    bounds: PathLimits, paths: Sequence[JointPath], active: tuple[str, ...], durations: Array, derivatives: bool
) -> tuple[LimitCost, ...]:
    """The cost of each active limit; derivatives by central differences on a fixed grid."""
    found = []
    for name, share in shares(active, durations).items():
        derivative = np.nan
        if derivatives:
            times = []
            for factor in (1.0 - STEP, 1.0 + STEP):
                changed = replace(bounds, factors={name: factor})
                try:
                    times.append(sum(fastest_on_grid(one, changed, CELLS).duration for one in paths))
                except BellcrankError:  # a smaller limit cannot be kept
                    times.append(np.nan)
            derivative = (times[1] - times[0]) / (2.0 * STEP * 0.5 * (times[0] + times[1]))
        found.append(LimitCost(name, share, float(derivative)))
    return tuple(found)
