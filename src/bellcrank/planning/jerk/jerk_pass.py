"""The fastest motion along a path with limits of jerk, on cells that adapt themselves.

The path parameter s is written as s(r) = S (10 r³ - 15 r⁴ + 6 r⁵): where ṙ does not vanish, speed and acceleration
do at both ends, as a finite jerk demands, and z = ṙ² is smooth there. Cells are halved where a limit is exceeded
between the places at which it is kept, and where no limit is reached: there the motion changes from one to another.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.errors import BellcrankError
from bellcrank.motion.motion import Motion
from bellcrank.planning.fastest_pass import fastest_on_grid
from bellcrank.planning.jerk.interior_point import InteriorPoint, OptimalSpeed
from bellcrank.planning.jerk.jerk_limits import PLACES, JerkLimits, SquaredSpeedSpline
from bellcrank.planning.joint_path import JointPath
from bellcrank.planning.limits.path_limits import PathLimits
from bellcrank.robot.model.joints import one_degree_columns

FIRST_CELLS, FIRST_CELLS_A_KNOT, MOST_FIRST_CELLS = 100, 12, 1500
CLOSE = 4e-4  # of the parameter r: closer knots and turning points count as one
GRID_CELLS = 500  # of the first-order method, which finds where limits cannot be kept
NARROW = 1e-9  # of the parameter r
NOISE = 1e-9  # of a position over a limit of jerk: the third power of the shortest time of a cell, for rounding
WIDE = 20.0  # times the shortest time: longer cells become several rows of the motion
PARTS = 5
MOST_PASSES = 20
MOST_CELLS = 6000
CHECKED = (0.1, 0.4, 0.6, 0.9)  # shares of a cell between the places at which limits are kept
EXCESS = 1e-4  # share by which a limit may be exceeded there
IDLE = 1e-3  # share of a limit: a cell in which all limits are missed by more somewhere is idle
COSTLY = 5e-4  # of the whole time: idle cells that are longer are halved
SLOWER = 0.25  # factor between the squared speeds that are tried for a start
TRIALS = 60


@dataclass(frozen=True, kw_only=True, eq=False)
class JerkTiming:
    """The timing of a motion along a path with limits of jerk, at n ends of cells.

    Attributes:
        path: The path over r.
        s: Path parameters (n,) of the path that was given.
        speed: ds/dt (n,).
        fastest: The largest ds/dt (n,) from which the end can be reached within all limits but those of jerk.
        durations: Of the cells (n - 1,), s.
        active: The limit that costs most time in each cell (n - 1,); "" for none.
        derivatives: dT over the relative change of each limit, s, by its group.
        spline: The cells.
        found: The squared speeds.
        shortest: The shortest time, s, that a cell may be halved to.
    """

    path: JointPath
    s: Array
    speed: Array
    fastest: Array
    durations: Array
    active: tuple[str, ...]
    derivatives: dict[str, float]
    spline: SquaredSpeedSpline
    found: OptimalSpeed
    shortest: float

    @property
    def duration(self) -> float:
        """The time of the motion, s."""
        return float(np.sum(self.durations))

    def motion(self, name: str) -> Motion:
        """The motion of the joints, with rows at the ends of cells, and within cells that are wide."""
        starts = np.concatenate([[0.0], np.cumsum(self.durations)])
        rows = [
            np.column_stack(
                [starts[:-1], self.spline.r[:-1], self.spline.values(self.found.unknowns, (0.0,))[:2, :, 0].T]
            )
        ]
        width = np.diff(self.spline.r)
        wide = self.durations > WIDE * self.shortest
        for part in range(1, PARTS):
            share = part / PARTS
            z = self.spline.values(self.found.unknowns, (share,))[:2, :, 0].T
            time = starts[:-1] + self.spline.durations(self.found.unknowns, share)
            rows.append(np.column_stack([time, self.spline.r[:-1] + share * width, z])[wide])
        last = self.spline.values(self.found.unknowns, (1.0,))[:2, -1, 0]
        rows.append(np.concatenate([starts[-1:], self.spline.r[-1:], last])[None])
        time, r, z, slope = np.concatenate(rows)[np.argsort(np.concatenate(rows)[:, 1], kind="stable")].T
        q, first, second = (self.path.spline(r, order) for order in (0, 1, 2))
        v = first * np.sqrt(z)[:, None]
        a = second * z[:, None] + 0.5 * first * slope[:, None]
        v[[0, -1]] = a[[0, -1]] = 0.0
        return Motion(self.path.joints, time, q, v, a, name)


def jerk_limited(
    path: JointPath, limits: PathLimits, progress: Callable[[int, float], None] | None = None
) -> JerkTiming:
    """The timing of a locally fastest motion from rest to rest, with no acceleration at both ends.

    Raises BellcrankError where no slow motion keeps the limits.
    """
    coarse = fastest_on_grid(path, limits, GRID_CELLS) if limits.names else None
    smooth = _from_rest(path)
    shortest = _shortest(path, limits)
    r = _first_cells(path, smooth)
    for _ in range(MOST_PASSES):
        spline = SquaredSpeedSpline(r)
        problem = InteriorPoint(spline, JerkLimits.of(smooth, limits, spline.points.ravel(), spline.middles(PLACES)))
        found = problem.run(_slow_start(problem, spline))
        if progress is not None:
            progress(spline.cells, found.time)
        halved = _halved(smooth, limits, (spline, found), shortest)
        if not halved.any() or spline.cells > MOST_CELLS:
            break
        r = np.sort(np.concatenate([r, ((r[1:] + r[:-1]) / 2.0)[halved]]))
    r, z = spline.r, found.unknowns[::2]
    groups, derivatives = _costs(problem, limits, smooth, found)
    s = path.length * _share(r)
    fastest = limits.fastest(path, s) if coarse is None else np.interp(s, coarse.s, coarse.fastest)
    speed = path.length * _share(r, 1) * np.sqrt(z)
    return JerkTiming(
        path=smooth,
        s=s,
        speed=speed,
        fastest=np.maximum(speed, fastest),
        durations=spline.durations(found.unknowns),
        active=groups,
        derivatives=derivatives,
        spline=spline,
        found=found,
        shortest=shortest,
    )


def jerk_excess(motion: Motion, most: Array) -> tuple[float, str, float]:
    """The largest share by which a joint's jerk exceeds its limit (nv,) along the quintics of a motion, the joint, and
    when, s. Joints of several degrees of freedom have no such limit.
    """
    positions, rates = one_degree_columns(motion.joints)
    step = np.diff(motion.time)
    wide = np.flatnonzero(step > 0.0)
    t = step[wide, None]
    q, v, a = motion.position[:, positions], motion.velocity[:, rates], motion.acceleration[:, rates]
    length = q[wide + 1] - q[wide]
    v0, v1, a0, a1 = v[wide] * t, v[wide + 1] * t, a[wide] * t * t, a[wide + 1] * t * t
    c3 = 10.0 * length - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15.0 * length + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
    c5 = 6.0 * length - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1
    worst, joint, time = -1.0, "", float(motion.time[0])
    names = [next(one.name for one in motion.joints if one.nv == 1 and one.v == rate) for rate in rates]
    for share in np.linspace(0.0, 1.0, 11):
        over = np.abs(6.0 * c3 + 24.0 * c4 * share + 60.0 * c5 * share**2) / t**3 / most[rates] - 1.0
        row, column = np.unravel_index(int(np.argmax(over)), over.shape)
        if over[row, column] > worst:
            worst, joint = float(over[row, column]), names[int(column)]
            time = float(motion.time[wide[row]] + share * t[row, 0])
    return worst, joint, time


def _share(r: Array, order: int = 0) -> Array:
    """10 r³ - 15 r⁴ + 6 r⁵ or a derivative, to full relative precision next to both ends."""
    x = 1.0 - r
    if order == 0:
        return np.asarray(
            np.where(r < 0.5, r**3 * (10.0 - 15.0 * r + 6.0 * r * r), 1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x * x))
        )
    return np.asarray((30.0 * (r * x) ** 2, 60.0 * r * x * (x - r), 60.0 * (1.0 - 6.0 * r * x))[order - 1])


def _from_rest(path: JointPath) -> JointPath:
    """The path over r."""

    def spline(r: Array, order: int) -> Array:
        s = path.length * _share(r)
        if order == 0:
            return path.spline(s, 0)
        a, b, c = (path.length * _share(r, k)[:, None] for k in (1, 2, 3))
        first = path.spline(s, 1)
        if order == 1:
            return first * a
        second = path.spline(s, 2)
        if order == 2:
            return second * a * a + first * b
        return path.spline(s, 3) * a**3 + 3.0 * second * a * b + first * c

    knots = np.array([_place(s / path.length) for s in path.knots])
    return JointPath(path.joints, 1.0, spline, knots, path.deviation)


def _place(share: float) -> float:
    from scipy.optimize import brentq

    if share <= 0.0 or share >= 1.0:
        return float(share >= 1.0)
    return float(brentq(lambda r: float(_share(np.array([r]))[0]) - share, 0.0, 1.0, xtol=1e-15))


def _first_cells(path: JointPath, smooth: JointPath) -> Array:
    share = path.turning_points() / path.length
    share = share[np.concatenate([[True], np.diff(share) > CLOSE])[: len(share)]]  # a joint at rest turns by rounding
    turning = np.array([_place(s) for s in share])
    own = np.unique(np.concatenate([smooth.knots, turning]))
    own = own[np.concatenate([[True], np.diff(own) > CLOSE])]
    own[0], own[-1] = 0.0, 1.0
    count = max(FIRST_CELLS, min(FIRST_CELLS_A_KNOT * len(smooth.knots), MOST_FIRST_CELLS))
    even = np.linspace(0.0, 1.0, count + 1)
    near = np.min(np.abs(even[:, None] - own[None, :]), axis=1)
    return np.unique(np.concatenate([own, even[near > 0.3 / count]]))


def _slow_start(problem: InteriorPoint, spline: SquaredSpeedSpline) -> Array:
    """A motion of constant ṙ that is slow enough for all limits."""
    level = 1e4
    for _ in range(TRIALS):
        unknowns = np.zeros(2 * len(spline.r))
        unknowns[::2] = level
        state = problem.state(unknowns)
        if state is not None and state.inside:
            unknowns[::2] *= 0.5
            half = problem.state(unknowns)
            if half is not None and half.inside:
                return unknowns
        level *= SLOWER
    raise BellcrankError(
        "no slow motion along the path keeps the limits strictly, which the method for limits of jerk begins with; "
        "choose larger torques, or leave the limits of jerk out"
    )


def _shortest(path: JointPath, limits: PathLimits) -> float:
    """The time of a cell, s, below which rounding of positions spoils the jerk of a quintic in time: by 1e-4."""
    positions, rates = one_degree_columns(path.joints)
    size = np.max(np.abs(path.spline(np.linspace(0.0, path.length, 101), 0)[:, positions]), axis=0)
    return float(np.max(np.cbrt(NOISE * size / limits.largest_jerk[rates])))


def _halved(
    path: JointPath, limits: PathLimits, solved: tuple[SquaredSpeedSpline, OptimalSpeed], shortest: float
) -> Mask:
    """The cells that are too wide."""
    spline, found = solved
    width, time = np.diff(spline.r), np.nan_to_num(spline.durations(found.unknowns), nan=np.inf)
    z = spline.values(found.unknowns, CHECKED)
    positive = np.all(z[0] > 0.0, axis=1)
    z[0] = np.maximum(z[0], 1e-12 * float(np.max(z[0])))
    places = (spline.r[:-1, None] + np.array(CHECKED) * width[:, None]).ravel()
    between = JerkLimits.of(path, limits, places, spline.middles(len(CHECKED))).violation(z.reshape(3, -1)).share
    most = between.max(axis=1).reshape(spline.cells, -1)
    over = most.max(axis=1) > EXCESS
    idle = most.min(axis=1) < -IDLE
    costly = idle & (time > COSTLY * found.time)
    return np.asarray((over | ~positive | costly) & (time > 2.0 * shortest) & (width > NARROW))


def _costs(
    problem: InteriorPoint, limits: PathLimits, path: JointPath, found: OptimalSpeed
) -> tuple[tuple[str, ...], dict[str, float]]:
    """The limit that costs most in each cell, and the derivatives of the time by the limits' groups."""
    state = problem.state(found.unknowns)
    assert state is not None
    cells = found.multipliers.shape[0]
    columns = [group for _, group in limits.linearised] + [""] + 2 * limits.jerk_groups
    cost = found.multipliers.reshape(cells * PLACES, -1) * state.found.by_limit
    groups = list(dict.fromkeys(group for group in columns if group))
    speeds = limits.speed_limits(path.spline(problem.places, 0), path.spline(problem.places, 1))
    groups += [name.group for name, _ in speeds if name.group not in groups]
    table = np.zeros((len(groups), cells * PLACES))
    for column, group in enumerate(columns):
        if group:
            table[groups.index(group)] += cost[:, column]
    if speeds:
        tightest = np.argmin(np.stack([value for _, value in speeds]), axis=0)
        speed_column = columns.index("")
        for k, (name, _) in enumerate(speeds):
            table[groups.index(name.group)] += np.where(tightest == k, cost[:, speed_column], 0.0)
    per_cell = table.reshape(len(groups), cells, PLACES).sum(axis=2)
    weight = problem.times_at(state).reshape(cells, PLACES).sum(axis=1)
    first = np.argmax(per_cell, axis=0)
    active = tuple(
        groups[k] if per_cell[k, cell] > 1e-4 * weight[cell] else "" for cell, k in enumerate(first.tolist())
    )
    return active, {group: -float(per_cell[k].sum()) for k, group in enumerate(groups)}
