"""The fastest motion along a path, and a lower bound of the time of all motions along it.

The lower bound: behind a gear that loses power the torque at the shaft is, with the load τ(u) = a u + b x + c of a
joint that turns forward, the path acceleration u and x = (ds/dt)²,

    T(u) = max(τ / (N η), τ η / N) + J N (q' u + q'' x)

(the larger of both: τ > 0 takes power). T is convex in u. So T <= L allows an interval of u. T >= -L leaves out the u
for which both lines are below -L: an open interval, where the two slopes have different signs, which happens where the
rotor needs a torque against the load's. The allowed u are then an interval with such holes, one a gear. The bound
replaces them by the interval from the least to the most of them, which contains them, as the relaxed problem does
(J. Warga, Optimal Control of Differential and Functional Equations, 1972): a motion that changes quickly enough between
the ends of a hole comes as near to its time as one likes. src/cpp/planner/lower_bound.hpp has the rest of the argument.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank._planner import excess, lower_bound
from bellcrank._planner import fastest_on_grid as grid_pass
from bellcrank._planner import fastest_refined as refined_pass
from bellcrank.arrays import Array, Mask
from bellcrank.errors import BellcrankError
from bellcrank.planning.joint_path import JointPath
from bellcrank.planning.limits.path_limits import PathLimits
from bellcrank.planning.limits.path_torques import KnownPlaces

FIRST_CELLS = 200
COARSE_CELLS = 100
NARROW = 1e-9  # of the path, in the parameter r: cells are not halved further
NEAR_REST = 1e-12  # of the path
TIME_ERROR = 1e-11  # of the whole time, by one cell
EXCESS = 2e-7  # share by which a limit may be exceeded, or missed, in the middle of a cell
CHECKED_EXCESS = 5e-7  # the same elsewhere in a cell
TOOTH = 4e-4  # of the square of the speed, where the motion switches between ends of a hole: a quarter of it is time
APART = 5e-5  # of a time that is too short: rounding of the acceleration in rows that are closer exceeds 1e-6 of limits
MOST_PASSES = 120
CHECKED_EVERY = 10  # passes: the excess elsewhere in cells is found anew, and where no cell is halved
MOST_CELLS = 20_000
KINDS = ("most acceleration", "most deceleration", "along a speed limit", "change", "switching")
SPEED_LIMIT = -2
CELLS = 20_000  # at most
CELLS_OF_LINKAGES = 5_000  # each place solves a system of equations
PARTS = 4  # of a cell, as in lower_bound.hpp
CLOSE = 2e-7  # relative: a bound that is as near to the time of a motion is near enough
GAINED = 2e-8  # of the time: smaller cells that raise the bound by less are the last
MARKED = 0.9  # share of the looseness of all cells that those have that are halved
LEAST_MARKED = 0.05  # of the cells: how much a cell loosens the bound is an estimate
LOOSE = 2e-9  # of the time, by which all cells loosen the bound: less does not matter
SHORTEST = 1e-8  # in the parameter r: differences over shorter cells are rounding


@dataclass(frozen=True, kw_only=True, eq=False)
class PathTiming:
    """The path speed and acceleration of a motion along a path, at n places, with n - 1 cells between them.

    Attributes:
        s: Path parameters (n,).
        speed: ds/dt (n,), 1/s times the unit of s.
        begin: d²s/dt² (n - 1,) at the beginning of each cell.
        end: d²s/dt² (n - 1,) at its end.
        fastest: The largest speeds (n,) from which the end can still be reached within the limits.
        active: The row of the limit that is active in each cell (n - 1,); -1 where there is none, -2 a limit of speed.
        kind: What the motion does in each cell (n - 1,), an index into `KINDS`.
    """

    s: Array
    speed: Array
    begin: Array
    end: Array
    fastest: Array
    active: NDArray[np.int32]
    kind: NDArray[np.int32]

    @property
    def durations(self) -> Array:
        """The time of each cell (n - 1,), s: the one of the cubic in time with the speeds and accelerations at its
        ends, Δs = (y₀ + y₁) Δt/2 + (u₀ - u₁) Δt²/12.
        """
        bend, mean = (self.begin - self.end) / 12.0, (self.speed[:-1] + self.speed[1:]) / 2.0
        length = np.diff(self.s)
        root = mean + np.sqrt(np.maximum(mean * mean + 4.0 * bend * length, 0.0))
        return np.divide(2.0 * length, root, out=np.full_like(length, np.inf), where=root > 0.0)

    @property
    def duration(self) -> float:
        """The time of the motion, s."""
        return float(np.sum(self.durations[np.diff(self.s) > 0.0]))

    def within(self, share: float) -> tuple[Array, Array, Array]:
        """Place, speed and acceleration (n - 1,) of each cell after a share of its time: the quintic in time that
        matches all three at both ends.
        """
        t, length = self.durations, np.diff(self.s)
        v0, v1, a0, a1 = self.speed[:-1] * t, self.speed[1:] * t, self.begin * t * t, self.end * t * t
        c3 = 10.0 * length - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
        c4 = -15.0 * length + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
        c5 = 6.0 * length - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1
        place = v0 * share + a0 / 2.0 * share**2 + c3 * share**3 + c4 * share**4 + c5 * share**5
        speed = (v0 + a0 * share + 3.0 * c3 * share**2 + 4.0 * c4 * share**3 + 5.0 * c5 * share**4) / t
        acceleration = (a0 + 6.0 * c3 * share + 12.0 * c4 * share**2 + 20.0 * c5 * share**3) / (t * t)
        return self.s[:-1] + place, speed, acceleration


def fastest_on_grid(path: JointPath, limits: PathLimits, cells: int) -> PathTiming:
    """The fastest motion from rest to rest whose acceleration is constant over each of equal cells of the path, with
    the limits kept at the beginning of each cell.

    Raises BellcrankError where there is none.
    """
    s = np.linspace(0.0, path.length, cells + 1)
    arrays = limits.at(path, s)
    found = grid_pass(arrays, s, 0.0, 0.0)
    _refuse_failure(found, path, limits, s)
    return _timing(s, found)


def fastest_refined(
    path: JointPath, limits: PathLimits, progress: Callable[[int, float], None] | None = None
) -> PathTiming:
    """The fastest motion from rest to rest, with the limits kept along the whole path.

    Cells are halved until the error of the time and the excess of limits between places are below their tolerances, or
    the cell is negligibly short. Places where a joint changes its direction are ends of cells. Raises BellcrankError.
    """
    r = first_cells(path)
    known = KnownPlaces(lambda s: limits.places(path, s))
    timing = None
    for number in range(MOST_PASSES):
        places = np.empty(2 * len(r) - 1)
        places[::2], places[1::2] = r, (r[1:] + r[:-1]) / 2.0
        s = path.length * share_of_path(places)
        short = np.where(np.diff(r) <= NARROW, 1, np.where(np.diff(s[::2]) <= NEAR_REST * path.length, 2, 0))
        slope = path.length * slope_of_share(places)
        arrays = limits.at_places(known.at(s))
        found = refined_pass(arrays, r, s, slope, short.astype(np.uint8), 0.0, 0.0, TIME_ERROR, EXCESS, TOOTH, APART)
        _refuse_failure(found, path, limits, s[::2])
        timing = _timing(s[::2], found)
        halved = (found["error"] > 1.0) & (short == 0)
        stops = timing.speed[1:-1] == 0.0
        halved[1:] |= stops & (short[1:] == 0)
        halved[:-1] |= stops & (short[:-1] == 0)
        if not stops.any() and (not halved.any() or number % CHECKED_EVERY == CHECKED_EVERY - 1):
            halved |= _exceeding(timing, path, limits) & (short == 0)
        if progress is not None:
            progress(len(r) - 1, timing.duration)
        if not halved.any():
            break
        if len(r) > MOST_CELLS:
            break
        r = np.sort(np.concatenate([r, places[1::2][halved]]))
    assert timing is not None
    if not np.isfinite(timing.duration):
        fastest_on_grid(path, limits, COARSE_CELLS)  # which names the limits where no motion keeps them
        raise BellcrankError("the motion along the path comes to a stop: the limits allow no faster motion there")
    return timing


def first_cells(path: JointPath) -> Array:
    """Ends of cells, as `share_of_path` takes them, to begin with: changes of a joint's direction are among them."""
    turning = path.turning_points() / path.length
    knots = path.knots[1:-1] / path.length
    own = [2.0 / np.pi * np.arcsin(np.sqrt(x)) for x in (turning, knots)]
    r = np.unique(np.concatenate([np.linspace(0.0, 1.0, FIRST_CELLS + 1), *own]))
    keep = np.concatenate([[True], np.diff(r) > 1e-12])
    return np.asarray(r[keep])


def share_of_path(r: Array) -> Array:
    """sin²(π r / 2), to full relative precision of its distance to either end."""
    return np.asarray(np.where(r < 0.5, np.sin(np.pi * r / 2.0) ** 2, 1.0 - np.sin(np.pi * (1.0 - r) / 2.0) ** 2))


def slope_of_share(r: Array) -> Array:
    """The derivative of `share_of_path`."""
    return np.asarray(np.pi / 2.0 * np.sin(np.pi * np.minimum(r, 1.0 - r)))


def _exceeding(timing: PathTiming, path: JointPath, limits: PathLimits) -> Mask:
    """The cells in which a limit is exceeded between their ends."""
    bad = np.zeros(len(timing.begin), dtype=np.bool_)
    for share in (0.1, 0.3, 0.7, 0.9):
        s, speed, acceleration = timing.within(share)
        places = limits.places(path, np.clip(s, 0.0, path.length))
        over = excess(
            limits.at_places(places),
            np.ascontiguousarray(np.maximum(speed, 0.0)),
            np.ascontiguousarray(acceleration),
        )
        bad |= (over > CHECKED_EXCESS) | (speed > limits.fastest_at(places) * (1.0 + CHECKED_EXCESS))
    return bad


def _timing(s: Array, found: dict[str, Any]) -> PathTiming:
    return PathTiming(
        s=np.ascontiguousarray(s),
        speed=found["speed"],
        begin=found["begin"],
        end=found["end"],
        fastest=found["fastest"],
        active=found["active"],
        kind=found["kind"],
    )


def _refuse_failure(found: dict[str, Any], path: JointPath, limits: PathLimits, s: Array) -> None:
    place = found["failed"]
    if place < 0:
        return
    rows = [row for row in dict.fromkeys(found["cause"]) if row >= 0]
    names = " and ".join(str(limits.names[row]) for row in rows) or "the limits"
    share = 100.0 * s[place] / path.length
    raise BellcrankError(
        f"no motion along the path keeps the limits: at {share:.4g} % of the path the {names} cannot be kept at any "
        "speed; choose other limits, or another path"
    )


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
        gained, best = found - best, max(best, found)
        loose[np.diff(r) < 2.0 * SHORTEST] = 0.0
        order = np.argsort(-loose)
        count = max(
            int(np.searchsorted(np.cumsum(loose[order]), MARKED * np.sum(loose))) + 1, int(LEAST_MARKED * len(r))
        )
        marked = order[:count]
        marked = marked[loose[marked] > 0.0]
        if min(time - best - CLOSE * time, gained - GAINED * time, float(np.sum(loose)) - LOOSE * time) <= 0.0:
            return best
        if len(r) + len(marked) > most:
            return best
        r = np.sort(np.concatenate([r, (r[marked] + r[marked + 1]) / 2.0]))
