"""`FastestMotion`: the fastest motion along a path, with what limits it where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.errors import BellcrankError
from bellcrank.notes import WithNotes
from bellcrank.planning.fastest_pass import SPEED_LIMIT, PathTiming, fastest_on_grid
from bellcrank.planning.jerk.jerk_pass import JerkTiming
from bellcrank.planning.joint_path import JointPath
from bellcrank.planning.limits.path_limits import PathLimits
from bellcrank.present.results import Result
from bellcrank.present.tables import aligned

if TYPE_CHECKING:
    from bellcrank.actuators.actuator import Actuator
    from bellcrank.dynamics.inverse.mechanism import Mechanism
    from bellcrank.motion.motion import Motion


OPTIMAL = 1e-6  # the largest gap to the lower bound, and the largest excess, of a motion that is called optimal
CELLS = 500  # of the grid on which the costs of limits are computed
STEP = 1e-3  # relative change of a limit
NO_COST = 1e-6  # relative: a limit of smaller derivative that is nowhere the most costly one is left out


@dataclass(frozen=True)
class LimitCost:
    """How much time a limit costs.

    Attributes:
        limit: What is limited, such as "motor torque of elbow".
        share: The share of the motion's time during which the limit is active.
        derivative: Relative change of the time per relative change of the limit, dT/T over dL/L; -0.3 means that a
            limit 1 % larger saves 0.3 % of the time. NaN where it was not computed.

    Example:
        >>> import bellcrank as bc
        >>> bc.results.LimitCost("torque of elbow", 0.4, -0.3).share
        0.4
    """

    limit: str
    share: float
    derivative: float


@dataclass(frozen=True)
class LimitExcess:
    """By how much a motion exceeds a limit, where, and for how long.

    Attributes:
        limit: The limit that is exceeded most, or approached most closely, such as "motor torque of elbow (upper)".
        share: By which share of it; negative within the limit.
        time: When, s.
        duration: For how long limits are exceeded by more than 1e-6 of them in all, s.

    Example:
        >>> from bellcrank.planning.fastest_motion import LimitExcess
        >>> print(LimitExcess("torque of elbow (upper)", 0.02, 0.5, 1e-5))
        torque of elbow (upper) by 2 % at 0.5 s, for 1e-05 s in all
    """

    limit: str
    share: float
    time: float
    duration: float

    def __str__(self) -> str:
        lasts = f"for {self.duration:.2g} s in all" if self.duration > 0.0 else "for an instant"
        return f"{self.limit} by {100.0 * self.share:.2g} % at {self.time:.6g} s, {lasts}"


@dataclass(frozen=True, kw_only=True, eq=False)
class FastestMotion(WithNotes, Result):
    """The fastest motion of a mechanism along a path, from rest to rest.

    Attributes:
        robot: Name of the robot.
        path: Name of the motion that gives the path.
        motion: The motion: like any other, it can be sized, written and replayed.
        original_duration: The time of the motion that gives the path, s; NaN for a path without time.
        s: Path parameter (n,) at the ends of n - 1 cells, over all parts of the path.
        speed: ds/dt (n,), 1/s times the unit of s.
        largest_speed: The largest ds/dt (n,) from which the end can still be reached within the limits.
        time: Times (n,), s.
        active: The limit that is active in each cell (n - 1,); "" where there is none.
        costs: How much time each limit costs, the most active first.
        excess: The largest share by which the motion exceeds a limit, found by inverse dynamics at its rows and between
            them; negative where it reaches none.
        worst: Which limit that is, when, and for how long limits are exceeded.
        refined: Whether the limits are kept along the whole path; otherwise at the beginning of each cell of a grid.
        lower_bound: The time, s, that every motion along the path takes at least, if it keeps the limits other than of
            jerk along the whole path: a bound of the continuous problem. At most `duration`; NaN where it is not known.
        jerk_limited: Whether there are limits of jerk, which the bound leaves out.
        warnings: What was not taken into account.
        mechanism: The mechanism, which a replay shows.
        actuators: Motor and gear by joint.

    Example:
        >>> import bellcrank as bc
        >>> fastest = bc.time_optimal("planar_2r", "elbow_up")
        >>> fastest.duration < fastest.original_duration
        True
    """

    robot: str
    path: str
    motion: Motion
    original_duration: float
    s: Array
    speed: Array
    largest_speed: Array
    time: Array
    active: tuple[str, ...]
    costs: tuple[LimitCost, ...]
    excess: float
    worst: LimitExcess
    refined: bool
    lower_bound: float = np.nan
    jerk_limited: bool = False
    warnings: tuple[str, ...] = field(default=())
    mechanism: Mechanism | None = field(default=None, repr=False)
    actuators: Mapping[str, Actuator] = field(default_factory=dict, repr=False)

    @property
    def duration(self) -> float:
        """The time of the motion, s."""
        return float(self.time[-1] - self.time[0])

    @property
    def gap(self) -> float:
        """The largest share by which a motion along the path could be shorter, from the lower bound of its time; NaN
        where no bound is known.
        """
        return 1.0 - self.lower_bound / self.duration

    @property
    def bound(self) -> str:
        """What the lower bound says of the time, as a sentence; "optimal" is said of a gap and an excess of at most
        1e-6.

        Example:
            >>> import bellcrank as bc
            >>> fastest = bc.time_optimal("planar_2r", "elbow_up")
            >>> "no motion along the path takes less than 0.780241 s" in fastest.bound
            True
        """
        least = f"takes less than {self.lower_bound:.6g} s"
        if np.isnan(self.lower_bound):
            return "no lower bound of the time is known"
        if self.jerk_limited:
            return f"without limits of jerk no motion {least}"
        if not self.refined and self.gap <= 0.0:
            return (
                f"bound on this grid: no motion {least} that keeps the limits everywhere, as this one does at the "
                "beginnings of cells"
            )
        if self.gap <= OPTIMAL and self.excess <= OPTIMAL:
            return f"optimal: no motion along the path {least}"
        return f"no motion along the path {least}, {100.0 * self.gap:.2g} % below its time"

    def __repr__(self) -> str:
        return f"FastestMotion({self.robot!r} along {self.path!r}: {self.duration:.6g} s)"

    def table(self) -> str:
        """The times, and which limit costs how much.

        Returns:
            The text of a table.

        Example:
            >>> import bellcrank as bc
            >>> print(bc.time_optimal("planar_2r", "elbow_up").table().splitlines()[0])  # doctest: +ELLIPSIS
            Planar 2R arm along elbow_up: 0.780... s instead of 10 s, 12.8 x
        """
        lines = [f"{self.robot} along {self.path}: {self.duration:.6g} s"]
        if np.isfinite(self.original_duration):
            lines[0] += f" instead of {self.original_duration:.6g} s, {self.original_duration / self.duration:.3g} x"
        lines.append(self.bound)
        rows = [["limit", "active during", "time saved by 1 % more"]]
        for cost in self.costs:
            if cost.share < 5e-4 and abs(cost.derivative) < 5e-4:
                continue  # active for an instant: it would be printed as zeros
            saved = "-" if np.isnan(cost.derivative) else f"{-cost.derivative:.3f} %"
            rows.append([cost.limit, f"{100.0 * cost.share:.1f} %", saved])
        return "\n".join([*lines, "", *aligned(rows, (0,))])

    def as_dict(self) -> dict[str, Any]:
        """The result as data for JSON, without the motion's rows.

        Returns:
            Times in s; costs by limit.

        Example:
            >>> import bellcrank as bc
            >>> sorted(bc.time_optimal("planar_2r", "elbow_up").as_dict())[:3]
            ['bound', 'costs', 'duration']
        """
        original = self.original_duration
        return {
            "robot": self.robot,
            "path": self.path,
            "duration": self.duration,
            "original_duration": original if np.isfinite(original) else None,
            "excess": self.excess,
            "worst": {
                "limit": self.worst.limit,
                "share": self.worst.share,
                "time": self.worst.time,
                "duration": self.worst.duration,
            },
            "refined": self.refined,
            "lower_bound": None if np.isnan(self.lower_bound) else self.lower_bound,
            "gap": None if np.isnan(self.gap) else self.gap,
            "bound": self.bound,
            "costs": [
                {
                    "limit": cost.limit,
                    "share_of_time": cost.share,
                    "derivative": None if np.isnan(cost.derivative) else cost.derivative,
                }
                for cost in self.costs
            ],
            "warnings": list(self.warnings),
            "notes": [note.as_dict() for note in self.notes],
        }

    def _rows(self) -> list[Sequence[object]]:
        rows: list[Sequence[object]] = [["t [s]", "s", "ds/dt [1/s]", "largest ds/dt [1/s]", "active limit from here"]]
        for row in zip(self.time, self.s, self.speed, self.largest_speed, [*self.active, ""], strict=True):
            rows.append([*(float(x) for x in row[:4]), row[4]])
        return rows

    def plot(self, path: str | Path) -> Path:
        """Draw the path speed below the largest one over the path, coloured by the active limit.

        Args:
            path: The file.

        Returns:
            Its path.

        Raises:
            InputError: The file cannot be written.

        Example:
            >>> import bellcrank as bc, tempfile
            >>> bc.time_optimal("planar_2r", "elbow_up").plot(tempfile.mkdtemp() + "/fastest.png").name
            'fastest.png'
        """
        from bellcrank.planning.fastest_plot import plot_fastest

        return plot_fastest(self, arguments.path("path", path, "the path of a picture"))


def shares(active: Sequence[str], durations: Array) -> dict[str, float]:
    """The share of the time during which each limit is active, the largest first; cells without one are left out."""
    total = float(np.sum(durations))
    found: dict[str, float] = {}
    for name, time in zip(active, durations.tolist(), strict=True):
        if name:
            found[name] = found.get(name, 0.0) + time / total
    return dict(sorted(found.items(), key=lambda item: -item[1]))


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
