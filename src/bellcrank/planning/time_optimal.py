"""`bellcrank.time_optimal`: the fastest motion of a mechanism along a path."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank._planner import bounds_at
from bellcrank.arguments import PROGRESS, Progress
from bellcrank.arrays import Array
from bellcrank.dynamics.inverse.motion_notes import mechanism_notes, motion_notes
from bellcrank.errors import InputError
from bellcrank.files.access import Trust
from bellcrank.motion.limit_checks import limit_notes
from bellcrank.motion.motion import Motion, join
from bellcrank.planning.fastest_motion import FastestMotion, LimitExcess, active_limits, limit_costs
from bellcrank.planning.fastest_pass import PathTiming, fastest_on_grid, fastest_refined, least_time
from bellcrank.planning.jerk.jerk_pass import JerkTiming, jerk_limited
from bellcrank.planning.joint_path import JointPath, one_degree_joints, paths_of_motion
from bellcrank.planning.limits.motion_limits import MotionLimits
from bellcrank.planning.limits.path_limits import FASTEST, PathLimits
from bellcrank.planning.timed_motion import EXCEEDED, TimedMotion, take_grid, timed_motion, worst_excess
from bellcrank.robot.model.payload import Payload
from bellcrank.sizing.sizing_subject import SizingSubject, sizing_subject

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene

TOLD_ON_GRID = 1e-3  # share of a limit: a motion on a grid that exceeds it by more says so
SLOWER = 1e-5  # share of the speed: a motion that is slowed by more tells it


@arguments.named
def time_optimal(
    robot: Robot | Scene | str | Path,
    path: JointPath | Motion | str | Path,
    limits: MotionLimits | None = None,
    *,
    grid: int | None = None,
    costs: bool = True,
    payloads: Iterable[Payload] = (),
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
    progress: Progress | None = None,
) -> FastestMotion:
    """Find the fastest motion along a path, from rest to rest, within the limits of joints, motors and gears.

    The path speed is the largest at every place (J. Bobrow, S. Dubowsky, J. Gibson, Int. J. Robotics Research 4, 1985),
    by reachability analysis (H. Pham, Q.-C. Pham, IEEE Trans. Robotics 34, 2018). Friction of joints, efficiency by the
    direction of power, and torque over speed are part of the limits. With limits of jerk the squared path speed is a
    spline whose time an interior-point method makes least (the problem: F. Debrouwere et al., IEEE Trans. Robotics 29,
    2013): a local optimum, which also begins and ends without acceleration.

    Args:
        robot: As in `bellcrank.size`: a Robot, a Scene, or the path or name of one.
        path: A JointPath; or a motion, of which the path counts and neither timing nor pauses: a Motion, the name of
            a motion of the configuration, or the path of a CSV file. Where a motion stops, so does the fastest one.
        limits: The limits; by default the URDF's speeds and torques, and the actuators of the configuration.
        grid: Number of cells for the first-order method on a fixed grid; by default the limits are kept to 1e-6 along
            the whole path, on cells that adapt themselves.
        costs: Whether to compute how much time each limit costs.
        payloads: Payloads besides those that the robot carries.
        overrides: Values of a scene, configuration or URDF to change, by dotted path.
        trust: Folders whose files a configuration or URDF may name.
        progress: Called with the number of cells so far, and None, as it is not known how many follow.

    Returns:
        The fastest motion.

    Raises:
        InputError: An argument is wrong, nothing limits the motion, or forces depend on time.
        BellcrankError: No motion along the path keeps the limits; the message says where and which.

    Example:
        >>> import bellcrank as bc
        >>> arm = bc.load_robot("planar_2r", friction="none")
        >>> path = bc.joint_path(arm, [{}, {"shoulder": 1.0, "elbow": -0.5}])
        >>> limits = bc.MotionLimits(torque={"shoulder": 60.0, "elbow": 30.0}, speed="none")
        >>> round(bc.time_optimal(arm, path, limits, costs=False).duration, 4)
        1.5061
    """
    limits = MotionLimits() if limits is None else arguments.instance("limits", limits, MotionLimits, "MotionLimits")
    if grid is not None:
        grid = arguments.whole("grid", grid, least=2, most=1_000_000)
    arguments.flag("costs", costs)
    subject, original, paths = _subject(robot, path, (payloads, trust, overrides))
    bounds = PathLimits(subject.mechanism, subject.actuators, limits, transmissions=subject.transmissions)
    if grid and bounds.jerk_groups:
        raise InputError("argument 'grid': limits of jerk need cells that adapt themselves; leave the grid out")
    report = None if progress is None else arguments.function("progress", progress, PROGRESS)
    told = None if report is None else lambda cells, _: report(cells, None)
    timings: list[PathTiming | JerkTiming] = []
    for one in paths:
        _check_limited(bounds, one)
        if bounds.jerk_groups:
            timings.append(jerk_limited(one, bounds, told))
            continue
        if grid:
            timings.append(fastest_on_grid(one, bounds, grid))
            continue
        timings.append(fastest_refined(one, bounds, told))
    _check_speeds(paths, timings)
    title = "path" if original is None else original.name
    parts = [timed_motion(one, t, bounds, grid is None) for one, t in zip(paths, timings, strict=True)]
    coarse_parts = [] if grid else take_grid(paths, timings, parts, bounds)
    motion = join(*(part.motion for part in parts), name=f"fastest {title}")
    active = tuple(label for one, t in zip(paths, timings, strict=True) for label in active_limits(bounds, one, t))
    worst = worst_excess(bounds, motion)
    least = sum(
        least_time(one, bounds, part.motion.duration, t.s) for one, part, t in zip(paths, parts, timings, strict=True)
    )
    durations = [np.where(np.diff(t.s) > 0.0, t.durations, 0.0) for t in timings]
    return FastestMotion(
        robot=subject.mechanism.robot.name if subject.config is None else subject.config.name,
        path=title,
        motion=motion,
        original_duration=np.nan if original is None else original.duration,
        s=_chained([t.s for t in timings]),
        speed=_joined([t.speed * part.factor for t, part in zip(timings, parts, strict=True)]),
        largest_speed=_joined([t.fastest for t in timings]),
        time=_chained(
            [np.concatenate([[0.0], np.cumsum(t) / part.factor]) for t, part in zip(durations, parts, strict=True)]
        ),
        active=active,
        costs=limit_costs(bounds, paths, timings, active, costs),
        excess=worst.share,
        worst=worst,
        refined=grid is None and not coarse_parts,
        lower_bound=min(least, motion.duration),
        jerk_limited=bool(bounds.jerk_groups),
        mechanism=bounds.mechanism,
        actuators=bounds.actuators,
        warnings=(
            *subject.notes,
            *_warnings(bounds, original, paths, motion),
            *coarse_parts,
            *_excess_warnings(worst, parts, grid is None),
        ),
    )


def least_path_time(scene: Scene, name: str) -> float:
    """The time of the fastest motion along the path of a motion of a scene, s, without the motion.

    `time_optimal` slows its motion by up to 1e-5 where that exceeds a limit between its rows; this time leaves that
    out, and is a smooth function of the scene's numbers up to about 1e-9. Raises BellcrankError as `time_optimal`.
    """
    subject, _, paths = _subject(scene, name, ((), (), None))
    bounds = PathLimits(subject.mechanism, subject.actuators, MotionLimits(), transmissions=subject.transmissions)
    timings: list[PathTiming | JerkTiming] = []
    for one in paths:
        _check_limited(bounds, one)
        timings.append(fastest_refined(one, bounds, None))
    _check_speeds(paths, timings)
    return float(sum(np.where(np.diff(t.s) > 0.0, t.durations, 0.0).sum() for t in timings))


def _subject(
    robot: Any, path: Any, changes: tuple[Iterable[Payload], Trust, Mapping[str, Any] | None]
) -> tuple[SizingSubject, Motion | None, tuple[JointPath, ...]]:
    """The mechanism with its configuration, the motion that gives the path, and the paths."""
    payloads, trust, overrides = changes
    motion = None
    if isinstance(path, JointPath):
        subject = sizing_subject(robot, [_placeholder(path)], payloads, trust, None, overrides)
    else:
        kinds = "a JointPath, a Motion, the name of a motion, or the path of a CSV file"
        arguments.instance("path", path, (Motion, str, Path), kinds)
        if isinstance(path, str):
            arguments.text("path", path, kinds)
        subject = sizing_subject(robot, [path], payloads, trust, None, overrides, "path")
        motion = subject.motions[0]
    mechanism = subject.mechanism
    if isinstance(path, JointPath):
        if mechanism.closed:
            raise InputError("a JointPath is for open chains; give a motion of the linkage, whose path is taken")
        if [joint.name for joint in path.joints] != [joint.name for joint in mechanism.robot.joints]:
            raise InputError(
                "the path is one of another robot: its joints are " + ", ".join(j.name for j in path.joints)
            )
        paths: tuple[JointPath, ...] = (path,)
    else:
        assert motion is not None
        if not mechanism.closed:
            one_degree_joints(mechanism.robot)
        paths = paths_of_motion(motion)
    return subject, motion, paths


def _placeholder(path: JointPath) -> Motion:
    """A motion along a path, so that whatever takes a motion can be asked for the mechanism."""
    time = np.linspace(0.0, 1.0, 2)
    still = np.zeros((2, sum(joint.nv for joint in path.joints)))
    q = path.spline(np.zeros(2), 0)
    return Motion(path.joints, time, q, still, still, "path")


def _check_limited(bounds: PathLimits, path: JointPath) -> None:
    """Raise InputError where nothing limits a joint that moves."""
    s = np.linspace(0.0, path.length, 41)
    q, first, second = (path.spline(s, order) for order in (0, 1, 2))
    bounds.check_states(q, first, second)
    if not bounds.names and not bounds.speed_limits(q, first) and not bounds.jerk_groups:
        raise InputError(
            "nothing limits the motion: the URDF gives neither speeds nor torques, and there is no actuator; give "
            "limits"
        )
    jerky = np.isfinite(bounds.largest_jerk)
    if bounds.jerk_groups and not bounds.names and np.any(np.all(first[:, jerky] == 0.0, axis=1)):
        raise InputError(
            "nothing limits the motion where no joint with a limit of jerk moves: give limits of torque or "
            "acceleration, or of the jerk of all joints"
        )
    if not bounds.names and not bounds.jerk_groups:
        raise InputError(
            "nothing limits the acceleration of the motion: give limits of torque or acceleration, or actuators"
        )
    arrays = bounds.at(path, s)
    free = np.array([not np.isfinite(bounds_at(arrays, k, 0.0)[1]) for k in range(len(s))])
    free &= np.all(first[:, jerky] == 0.0, axis=1)
    if np.any(free[1:] & free[:-1]):  # at one place alone a coefficient may pass through 0
        place = 100.0 * float(s[:-1][free[1:] & free[:-1]][0]) / path.length
        raise InputError(
            f"nothing limits the acceleration of the motion at {place:.3g} % of the path: the limits are of joints or a"
            " frame that rest there; give limits of what moves"
        )


def _check_speeds(paths: Sequence[JointPath], timings: Sequence[PathTiming | JerkTiming]) -> None:
    """Raise InputError where the path speed reaches the largest one that is looked for."""
    for path, timing in zip(paths, timings, strict=True):
        if isinstance(timing, PathTiming) and np.any(free := timing.speed >= FASTEST * (1.0 - 1e-9)):
            place = 100.0 * float(timing.s[int(np.argmax(free))]) / path.length
            raise InputError(
                f"nothing limits the motion at {place:.3g} % of the path, or its limits are too large: the path speed "
                f"exceeds {FASTEST:.0e}; give limits of speed, or of torque or acceleration of what moves there"
            )


def _warnings(
    bounds: PathLimits,
    original: Motion | None,
    paths: Sequence[JointPath],
    motion: Motion,
) -> tuple[str, ...]:
    found = list(dict.fromkeys(bounds.notes))
    limited = {name.joint for name in bounds.names if "torque" in name.what}
    free = [
        axis
        for joint, axis in zip(bounds.mechanism.motors, bounds.axis_names, strict=True)
        if not limited & {joint.name, axis}
    ]
    if free:
        found.append(f"no torque limits the motors at {', '.join(free)}: none is known")
    found += mechanism_notes(bounds.mechanism)
    if original is not None:
        found += [*original.notes, *motion_notes(bounds.mechanism, original)]
        if len(paths) > 1:
            found.append(f"the path has {len(paths)} parts with a stop between them, because motion '{original.name}' "
                         "stops there; its pauses are left out")  # fmt: skip
        worst = max(path.deviation for path in paths)
        if worst > 1e-6:
            found.append(f"the path deviates from motion '{original.name}' by up to {worst:.2g} rad or m")
    if bounds.jerk_groups:
        found.append("limits of jerk make the problem non-convex: the motion is a local optimum, and a faster one may "
                     "exist")  # fmt: skip
    found += limit_notes(bounds.mechanism.robot, motion.name, motion.time, motion.position)
    return tuple(dict.fromkeys(found))


def _excess_warnings(worst: LimitExcess, parts: Sequence[TimedMotion], refined: bool) -> tuple[str, ...]:
    """What to say of a motion that is slower than its limits allow, what that costs, or that exceeds a limit."""
    found: list[str] = []
    begin = 0.0
    for part in parts:
        if part.before is not None and part.factor < 1.0 - SLOWER:
            cost = (1.0 - part.factor) * part.motion.duration
            at = replace(part.before, time=begin + part.before.time)
            found.append(
                f"the motion is slowed by {100.0 * (1.0 - part.factor):.2g} %, which costs {cost:.2g} s, so that it "
                f"keeps the limits between rows: without that it would exceed {at}"
            )
        begin += part.motion.duration
    if worst.share > (EXCEEDED if refined else TOLD_ON_GRID):
        found.append(f"the motion exceeds {worst}" + ("" if refined else " (between the cells of the grid)"))
    return tuple(found)


def _chained(parts: Sequence[Array]) -> Array:
    """Parts that each begin with 0, one after the other."""
    starts = np.concatenate([[0.0], np.cumsum([part[-1] for part in parts])])
    return _joined([part + start for part, start in zip(parts, starts, strict=False)])


def _joined(parts: Sequence[Array]) -> Array:
    return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])
