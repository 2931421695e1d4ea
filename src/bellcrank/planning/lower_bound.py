"""A lower bound of the time of all motions along a path that keep the limits.

Behind a gear that loses power the torque at the shaft is, with the load τ(u) = a u + b x + c of a joint that turns
forward, the path acceleration u and x = (ds/dt)²,

    T(u) = max(τ / (N η), τ η / N) + J N (q' u + q'' x)

(the larger of both: τ > 0 takes power). T is convex in u. So T <= L allows an interval of u. T >= -L leaves out the u
for which both lines are below -L: an open interval, where the two slopes have different signs, which happens where the
rotor needs a torque against the load's. The allowed u are then an interval with such holes, one a gear. The bound
replaces them by the interval from the least to the most of them, which contains them, as the relaxed problem does
(J. Warga, Optimal Control of Differential and Functional Equations, 1972): a motion that changes quickly enough between
the ends of a hole comes as near to its time as one likes. src/cpp/planner/lower_bound.hpp has the rest of the argument.
"""

from __future__ import annotations

import numpy as np

from bellcrank._planner import lower_bound
from bellcrank.arrays import Array
from bellcrank.planning.fastest_pass import first_cells, share_of_path, slope_of_share
from bellcrank.planning.joint_path import JointPath
from bellcrank.planning.limits.path_limits import PathLimits
from bellcrank.planning.limits.path_torques import KnownPlaces

CELLS = 20_000  # at most
CELLS_OF_LINKAGES = 5_000  # each place solves a system of equations
PARTS = 4  # of a cell, as in lower_bound.hpp
CLOSE = 2e-7  # relative: a bound that is as near to the time of a motion is near enough
MARKED = 0.9  # share of the looseness of all cells that those have that are halved
LEAST_MARKED = 0.05  # of the cells: how much a cell loosens the bound is an estimate
LOOSE = 2e-9  # of the time, by which all cells loosen the bound: less does not matter
SHORTEST = 1e-8  # in the parameter r: differences over shorter cells are rounding


def least_time(path: JointPath, limits: PathLimits, time: float, places: Array) -> float:
    """The time, s, that every motion along a path from rest to rest takes at least, if it keeps the limits other than
    of jerk; NaN where limits are known only as more than they are.

    Cells are halved where they loosen the bound, until it is close to a known time. Between the places of a cell limits
    may change by the largest second difference of their values at neighbouring places.

    Args:
        path: The path.
        limits: The limits.
        time: The time of a known motion, s.
        places: Path parameters (n,) to begin with, rising.

    Returns:
        The bound; it may exceed the known time where that motion exceeds a limit.
    """
    if not limits.exact:
        return np.nan
    r = np.unique(np.concatenate([first_cells(path), 2.0 / np.pi * np.arcsin(np.sqrt(places / path.length))]))
    r = r[np.concatenate([np.diff(r) > SHORTEST, [True]])]
    r[0] = 0.0
    known = KnownPlaces(lambda s: limits.places(path, s))
    most = CELLS_OF_LINKAGES if limits.mechanism.closed else CELLS
    best = 0.0
    while True:
        inner = (r[:-1, None] + np.diff(r)[:, None] * (np.arange(PARTS) / PARTS)).ravel()
        parts = np.append(inner, r[-1])
        arrays = limits.at_places(known.at(path.length * share_of_path(parts)))
        found, loose = lower_bound(arrays, parts, path.length * slope_of_share(parts))
        best = max(best, found)
        loose[np.diff(r) < 2.0 * SHORTEST] = 0.0
        order = np.argsort(-loose)
        count = max(
            int(np.searchsorted(np.cumsum(loose[order]), MARKED * np.sum(loose))) + 1, int(LEAST_MARKED * len(r))
        )
        marked = order[:count]
        marked = marked[loose[marked] > 0.0]
        if time - best <= CLOSE * time or np.sum(loose) <= LOOSE * time or len(r) + len(marked) > most:
            return best
        r = np.sort(np.concatenate([r, (r[marked] + r[marked + 1]) / 2.0]))
