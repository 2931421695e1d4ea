"""A lower bound of the time of all motions along a path that keep the limits.

Behind a gear that loses power the torque at the shaft is, with the load τ(u) = a u + b x + c of a joint that turns
forward, the path acceleration u and x = (ds/dt)²,

    T(u) = max(τ / (N η), τ η / N) + J N (q' u + q'' x)

(the larger of both: τ > 0 takes power). T is convex in u. So T <= L allows an interval of u. T >= -L leaves out the u for
which both lines are below -L: an open interval, where the two slopes have different signs, which happens where the rotor
needs a torque against the load's. The allowed u are then an interval with such holes, one a gear. The bound replaces
them by the interval from the least to the most of them, which contains them, as the relaxed problem does (J. Warga,
Optimal Control of Differential and Functional Equations, 1972): a motion that changes quickly enough between the ends
of a hole comes as near to its time as one likes. src/cpp/planner/lower_bound.hpp has the rest of the argument.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bellcrank._planner import lower_bound
from bellcrank.planning.fastest_pass import share_of_path, slope_of_share
from bellcrank.planning.joint_path import JointPath
from bellcrank.planning.known_places import KnownPlaces
from bellcrank.planning.path_limits import PathLimits

CELLS = (250, 500, 1000, 2000, 4000, 8000)
CELLS_OF_LINKAGES = CELLS[:4]  # each place solves a system of equations
PARTS = 4  # of a cell, as in lower_bound.hpp
CLOSE = 1e-6  # relative: a bound that is as near to the time of a motion is near enough


def least_time(path: JointPath, limits: PathLimits, time: float) -> float:
    """The time, s, that every motion along a path from rest to rest takes at least, if it keeps the limits other than
    of jerk.

    The bound is found with more and more cells, until it is within 1e-6 of a known time. Between places limits may change by the
    largest second difference of their values at neighbouring places.

    Args:
        path: The path.
        limits: The limits.
        time: The time of a known motion, s.

    Returns:
        The bound; it may exceed the known time where that motion exceeds a limit.
    """
    careful = replace(limits, creep=0.0)
    known = KnownPlaces(lambda s: careful.places(path, s))
    best = 0.0
    for cells in CELLS_OF_LINKAGES if limits.mechanism.closed else CELLS:
        r = np.linspace(0.0, 1.0, PARTS * cells + 1)
        arrays = careful.at_places(known.at(path.length * share_of_path(r)))
        best = max(best, lower_bound(arrays, r, path.length * slope_of_share(r)))
        if time - best <= CLOSE * time:
            break
    return best
