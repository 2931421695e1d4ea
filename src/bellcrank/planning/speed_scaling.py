"""`bellcrank.speed_factor`: by which factor a motion can be sped up, with its timing otherwise unchanged.

A motion that is faster by the factor k has the velocities k v and the accelerations k² a, so that

    τ(k) = (M a + C v) k² + viscous friction k + g + Coulomb friction

at each sample: the factor at which a limit is reached is a root of a parabola. Only the smoothed part of Coulomb
friction, at very small speeds, needs iterations.

At the factor found with some samples, the use of the limits (a share, 1 at a limit) may exceed 1 between two of them.
Intervals in which it may, judged by its slopes there and beside, are divided until none of them can exceed 1 by more
than EXCESS. A jump of the use, where the power of a gear changes its direction, is divided in the same way.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank._planner import LimitArrays, excess, largest_factor
from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.files.access import Trust
from bellcrank.motion.motion import Motion
from bellcrank.notes import WithNotes
from bellcrank.planning.limits.motion_limits import MotionLimits
from bellcrank.planning.limits.path_limits import PathLimits
from bellcrank.present.results import Result
from bellcrank.present.tables import aligned
from bellcrank.robot.model.payload import Payload
from bellcrank.sizing.mechanism_sizing import motion_warnings
from bellcrank.sizing.sizing_subject import sizing_subject

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene


Part = tuple[Array, LimitArrays, list[Array]]
MOST = 1e3  # times faster
FIRST = 8  # intervals between two rows
PARTS = 8  # of an interval that is divided
EXCESS = 1e-10  # that is left between samples, as a share of a limit
LEVELS = 14
DIVIDED = 20_000  # intervals at most, those that may exceed most first
DRAWN = 121


@dataclass(frozen=True)
class FactorFound:
    """The largest factor, and where a limit is reached.

    Attributes:
        factor: The factor, MOST at most.
        time: The time at which a limit is reached, s.
        row: The row of that limit; negative for a limit of a speed.
        samples: Times that were looked at (n,), s.
    """

    factor: float
    time: float
    row: int
    samples: Array


def largest_factor_of(motion: Motion, bounds: PathLimits) -> FactorFound:
    """The largest factor k for which all limits are kept for every factor from 1 to k; below 1 where the motion
    exceeds a limit, 0 where no factor keeps them.
    """
    samples = _Samples(motion, bounds, _first(motion.time))
    found = samples.largest()
    for _ in range(LEVELS):
        if not 0.0 < found.factor < MOST:
            break
        between = samples.between(found.factor)
        if not len(between):
            break
        samples.add(between)
        found = samples.largest()
    return replace(found, samples=samples.time)


def _first(time: Array) -> Array:
    """The rows' times and times between them."""
    between = (time[:-1, None] + np.diff(time)[:, None] * (np.arange(FIRST) / FIRST)).ravel()
    return np.unique(np.concatenate([between, time]))


class _Samples:
    """Limits of a motion at its samples, in the parts in which these were added."""

    def __init__(self, motion: Motion, bounds: PathLimits, time: Array) -> None:
        self._motion, self._bounds = motion, bounds
        self._parts = [self._part(time)]

    @property
    def time(self) -> Array:
        """All samples' times, in their order, s."""
        return np.sort(np.concatenate([time for time, _, _ in self._parts]))

    def add(self, time: Array) -> None:
        self._parts.append(self._part(time))

    def _part(self, time: Array) -> Part:
        """Times, the limits there, and the factors at which limits of speed are reached, by limit."""
        q, v, a = self._motion.at(time)
        speeds = [largest for _, largest in self._bounds.speed_limits(q, v, a)]
        return time, self._bounds.of_motion(q, v, a), speeds

    def largest(self) -> FactorFound:
        """Above 1 each sample has its own factor, and the least counts; below 1 one factor must suit all samples."""
        found = self._least()
        if found.factor < 1.0 and len(self._parts) > 1:
            self._parts = [self._part(self.time)]
            found = self._least()
        return found

    def _least(self) -> FactorFound:
        found = []
        for time, arrays, _ in self._parts:
            factor, place, row = largest_factor(arrays, MOST)
            found.append(FactorFound(factor, float(time[place]), row, time))
        return min(found, key=lambda one: one.factor)

    def between(self, factor: float) -> Array:
        """Times within the intervals in which the limits may be exceeded."""
        time = np.concatenate([part[0] for part in self._parts])
        use = np.concatenate([_use(each, factor) for each in self._parts])
        order = np.argsort(time)
        time, use = time[order], use[order]
        step = np.diff(time)
        slope = np.abs(np.diff(use)) / step
        beside = np.pad(slope, 1, mode="edge")
        more = 0.5 * step * (beside[:-2] + slope + beside[2:])
        over = np.maximum(use[:-1], use[1:]) + more - 1.0
        fine = step > 1e-12 * np.max(np.abs(time))  # its parts are different numbers
        there = np.flatnonzero((over > EXCESS) & (more > EXCESS) & fine)
        there = there[np.argsort(over[there])[::-1][:DIVIDED]]
        return np.sort((time[there, None] + step[there, None] * (np.arange(1, PARTS) / PARTS)).ravel())


def _use(part: Part, factor: float) -> Array:
    """The largest share of a limit that is used at each sample."""
    time, arrays, speeds = part
    used = 1.0 + excess(arrays, np.full(len(time), factor), np.zeros(len(time)))
    return np.asarray(np.max([used, *(factor / largest for largest in speeds)], axis=0))


@dataclass(frozen=True, kw_only=True, eq=False)
class SpeedFactor(WithNotes, Result):
    """By which factor a motion can be sped up.

    `to_csv` writes one row a factor of the picture: the largest share of each limit that is used.

    Attributes:
        robot: Name of the robot.
        motion: The motion.
        factor: The largest factor k for which all limits are kept for every factor from 1 to k; below 1 where the
            motion itself exceeds a limit; 0 where no factor keeps them. A factor below it and below 1 may exceed a
            limit: a fall needs less torque than the same motion made slowly. 1000 where none up to there does.
        limit: The limit that is reached, such as "motor torque of elbow".
        time: The time of the motion at which it is reached, s.
        factors: Factors (m,) of the picture.
        uses: The largest share of each limit (m,) that is used, by limit.
        warnings: What was not taken into account.

    Example:
        >>> import bellcrank as bc
        >>> bc.speed_factor("planar_2r", "elbow_up").limit
        'torque of shoulder'
    """

    robot: str
    motion: Motion
    factor: float
    limit: str
    time: float
    factors: Array
    uses: Mapping[str, Array]
    warnings: tuple[str, ...] = field(default=())

    def scaled(self, factor: float | None = None) -> Motion:
        """The motion sped up.

        Args:
            factor: The factor; by default the largest one.

        Returns:
            The motion in the time divided by the factor.

        Raises:
            InputError: The factor is not a positive number.

        Example:
            >>> import bellcrank as bc
            >>> found = bc.speed_factor("planar_2r", "elbow_up")
            >>> round(found.scaled(2.0).duration, 9)
            5.0
        """
        k = self.factor if factor is None else arguments.number("factor", factor, above=0.0, most=arguments.LARGEST)
        if k <= 0.0:
            raise InputError(f"motion '{self.motion.name}' cannot be scaled: no factor keeps the {self.limit}")
        return scaled_motion(self.motion, k)

    def table(self) -> str:
        """The factor and the use of each limit.

        Returns:
            The text of a table.

        Example:
            >>> import bellcrank as bc
            >>> print(bc.speed_factor("planar_2r", "elbow_up").table().splitlines()[0])
            Planar 2R arm along elbow_up: 11.1 times as fast (0.901 s instead of 10 s)
        """
        duration = self.motion.duration
        if self.factor <= 0.0:
            return f"{self.robot} along {self.motion.name}: no speed keeps the {self.limit}, at {self.time:.4g} s"
        times, shorter = (
            f"{self.factor:.3g} times as fast",
            f"{duration / self.factor:.3g} s instead of {duration:.3g} s",
        )
        if self.factor >= MOST:
            lines = [f"{self.robot} along {self.motion.name}: {MOST:g} times as fast or more: it reaches no limit"]
        else:
            lines = [
                f"{self.robot} along {self.motion.name}: {times} ({shorter})",
                f"the limit is the {self.limit}, at {self.time:.4g} s of the motion as given",
            ]
        lines += self.warnings
        here = int(np.argmin(np.abs(self.factors - 1.0)))
        rows = [["limit", "used as given"], *([it, f"{100.0 * use[here]:.1f} %"] for it, use in self.uses.items())]
        return "\n".join([*lines, "", *aligned(rows, (0,))])

    def as_dict(self) -> dict[str, Any]:
        """The result as data for JSON, without the motion's rows.

        Returns:
            The factor, what limits it, and the use of each limit over the factors of the picture.

        Example:
            >>> import bellcrank as bc
            >>> bc.speed_factor("planar_2r", "elbow_up").as_dict()["limit"]
            'torque of shoulder'
        """
        return {
            "robot": self.robot,
            "motion": self.motion.name,
            "original_duration": self.motion.duration,
            "factor": self.factor,
            "limit": self.limit,
            "time": self.time,
            "factors": self.factors.tolist(),
            "uses": {name: use.tolist() for name, use in self.uses.items()},
            "warnings": list(self.warnings),
            "notes": [note.as_dict() for note in self.notes],
        }

    def _rows(self) -> list[Sequence[object]]:
        return [["factor", *self.uses], *np.column_stack([self.factors, *self.uses.values()]).tolist()]

    def plot(self, path: str | Path) -> Path:
        """Draw the use of each limit over the factor.

        Args:
            path: The file.

        Returns:
            Its path.

        Raises:
            InputError: The file cannot be written.

        Example:
            >>> import bellcrank as bc, tempfile
            >>> bc.speed_factor("planar_2r", "elbow_up").plot(tempfile.mkdtemp() + "/factor.png").name
            'factor.png'
        """
        from bellcrank.planning.fastest_plot import plot_factor

        return plot_factor(self, arguments.path("path", path, "the path of a picture"))


@arguments.named
def speed_factor(
    robot: Robot | Scene | str | Path,
    motion: Motion | str | Path,
    limits: MotionLimits | None = None,
    *,
    payloads: Iterable[Payload] = (),
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
) -> SpeedFactor:
    """Find the largest factor by which a motion can be sped up within the limits of joints, motors and gears.

    The limits are those of each moment; the continuous torque of motors, which depends on the pause after the motion,
    is not among them. Peaks between the rows of the motion count.

    Args:
        robot: As in `bellcrank.size`.
        motion: A Motion, the name of a motion of the configuration, or the path of a CSV file.
        limits: The limits; by default the URDF's speeds and torques, and the actuators of the configuration.
        payloads: Payloads besides those that the robot carries.
        overrides: Values of a scene, configuration or URDF to change, by dotted path.
        trust: Folders whose files a configuration or URDF may name.

    Returns:
        The factor, and the use of each limit over factors.

    Raises:
        InputError: An argument is wrong, nothing limits the motion, or forces depend on time.

    Example:
        >>> import bellcrank as bc
        >>> round(bc.speed_factor("planar_2r", "elbow_up").factor, 3)
        11.094
    """
    limits = MotionLimits() if limits is None else arguments.instance("limits", limits, MotionLimits, "MotionLimits")
    arguments.instance("motion", motion, (Motion, str, Path), "a Motion, the name of a motion, or a CSV file")
    subject = sizing_subject(robot, [motion], payloads, trust, None, overrides, "motion")
    given = subject.motions[0]
    bounds = PathLimits(subject.mechanism, subject.actuators, limits, transmissions=subject.transmissions)
    if bounds.jerk_groups:
        raise InputError("limits: the speed factor does not take limits of jerk; leave jerk out")
    states = given.at(given.time)
    bounds.check_states(*states)
    if not bounds.names and not bounds.speed_limits(*states):
        raise InputError("nothing limits the motion: the URDF gives no limits and there is no actuator; give limits")
    found = largest_factor_of(given, bounds)
    factor, (q, v, a) = found.factor, given.at(found.samples)
    speeds = bounds.speed_limits(q, v, a)
    name = bounds.names[found.row].group if found.row >= 0 else _tightest(speeds, found)
    if factor >= MOST:
        name = "nothing"
    top = 1.25 * max(factor, 1.0) if factor < MOST else 2.0
    factors = np.unique(np.concatenate([np.linspace(0.0, top, DRAWN)[1:], [1.0]]))
    return SpeedFactor(
        robot=subject.mechanism.robot.name if subject.config is None else subject.config.name,
        motion=given,
        factor=factor,
        limit=name,
        time=found.time,
        factors=factors,
        uses=_uses(bounds, factors, (q, v, a), speeds),
        warnings=tuple(dict.fromkeys([*subject.notes, *bounds.notes, *motion_warnings(subject.mechanism, [given])])),
    )


def scaled_motion(motion: Motion, factor: float) -> Motion:
    """A motion in its time divided by a factor: velocities grow with it, accelerations with its square."""
    start = motion.time[0]
    return Motion(
        motion.joints,
        start + (motion.time - start) / factor,
        motion.position,
        motion.velocity * factor,
        motion.acceleration * factor * factor,
        f"{motion.name} x {factor:.4g}",
        motion.notes,
        motion.position_noise,
        tuple(noise * factor for noise in motion.speed_noise),
    )


def _tightest(speeds: list[tuple[Any, Array]], found: FactorFound) -> str:
    place = int(np.searchsorted(found.samples, found.time))
    return min(speeds, key=lambda one: float(one[1][place]))[0].group if speeds else "nothing"


def _uses(
    bounds: PathLimits, factors: Array, states: tuple[Array, Array, Array], speeds: list[tuple[Any, Array]]
) -> dict[str, Array]:
    """The share of each limit that is used at each factor."""
    q, v, a = states
    found: dict[str, Array] = {}
    still = np.zeros(len(q))
    for group in dict.fromkeys(name.group for name in bounds.names):
        alone = replace(bounds, only=group)
        arrays = alone.of_motion(q, v, a)
        found[group] = np.array([1.0 + np.max(excess(arrays, np.full(len(q), k), still)) for k in factors])
    for name, largest in speeds:
        if name.group not in found:  # an acceleration of the tool grows with the square of the factor
            found[name.group] = factors / float(np.min(largest))
    return found
