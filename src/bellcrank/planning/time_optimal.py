"""`bellcrank.time_optimal`: the fastest motion of a mechanism along a path."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank._planner import bounds_at
from bellcrank._planner import excess as exceeded
from bellcrank.dynamics.mechanism import Mechanism
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.access import Trust
from bellcrank.motion.limit_notes import limit_notes
from bellcrank.motion.motion import Motion, join
from bellcrank.planning.fastest_motion import FastestMotion, LimitCost, shares
from bellcrank.planning.fastest_pass import SPEED_LIMIT, PathTiming, fastest_on_grid, fastest_refined
from bellcrank.planning.jerk_pass import JerkTiming, jerk_excess, jerk_limited
from bellcrank.planning.joint_path import JointPath, one_degree_joints, paths_of_motion
from bellcrank.planning.motion_limits import MotionLimits
from bellcrank.planning.motion_rows import SHORTEST, motion_rows
from bellcrank.planning.path_limits import PathLimits
from bellcrank.robot.payload import Payload
from bellcrank.sizing.size import sizing_subject

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.robot_config import RobotConfig
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]
CHECKED_SHARES = (0.0, 0.13, 0.37, 0.5, 0.63, 0.87, 1.0)  # of the time between two rows
KEPT = 7e-7  # share of a limit: no better rows are looked for
TOLD, TOLD_ON_GRID = 1e-5, 1e-3  # share of a limit: a larger excess is told
COARSE_CELLS = 100
CREEP = 1e-3  # of the largest path speed
COST_CELLS = 500  # of the grid on which the costs of limits are computed
COST_STEP = 1e-3  # relative change of a limit
NO_COST = 1e-6  # relative: a limit of smaller derivative that is nowhere the most costly one is left out
TOLD_OF_JERK = 1e-3


def time_optimal(
    robot: Robot | Mechanism | RobotConfig | Scene | str | Path,
    path: JointPath | Motion | str | Path,
    limits: MotionLimits | None = None,
    *,
    grid: int | None = None,
    costs: bool = True,
    payloads: Iterable[Payload] = (),
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
    progress: Callable[[int, float], None] | None = None,
) -> FastestMotion:
    """Find the fastest motion along a path, from rest to rest, within the limits of joints, motors and gears.

    The path speed is the largest at every place (J. Bobrow, S. Dubowsky, J. Gibson, Int. J. Robotics Research 4, 1985),
    by reachability analysis (H. Pham, Q.-C. Pham, IEEE Trans. Robotics 34, 2018). Friction of joints, efficiency by the
    direction of power, and torque over speed are part of the limits. With limits of jerk the squared path speed is a
    spline whose time an interior-point method makes least (the problem: F. Debrouwere et al., IEEE Trans. Robotics 29,
    2013): a local optimum, which also begins and ends without acceleration.

    Args:
        robot: As in `bellcrank.size`: a Robot or Linkage, a RobotConfig, a Scene, or the path or name of one.
        path: A JointPath; or a motion, of which the path counts and neither timing nor pauses: a Motion, the name of
            a motion of the configuration, or the path of a CSV file. Where a motion stops, so does the fastest one.
        limits: The limits; by default the URDF's speeds and torques, and the actuators of the configuration.
        grid: Number of cells for the first-order method on a fixed grid; by default the limits are kept to 1e-6 along
            the whole path, on cells that adapt themselves.
        costs: Whether to compute how much time each limit costs.
        payloads: Payloads besides those that the robot carries.
        overrides: Values of a scene, configuration or URDF to change, by dotted path.
        trust: Folders whose files a configuration or URDF may name.
        progress: Called with the number of cells and the time of the motion so far, s.

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
    name, original, paths, bounds = _subject(robot, path, limits, (payloads, trust, overrides))
    if grid and bounds.jerk_groups:
        raise InputError("argument 'grid': limits of jerk need cells that adapt themselves; leave the grid out")
    timings: list[PathTiming | JerkTiming] = []
    for one in paths:
        _check_limited(bounds, one)
        if bounds.jerk_groups:
            timings.append(jerk_limited(one, bounds, progress))
            continue
        coarse = fastest_on_grid(one, bounds, grid or COARSE_CELLS)
        if grid:
            timings.append(coarse)
            continue
        careful = replace(bounds, creep=CREEP * float(coarse.speed.max()))
        timings.append(fastest_refined(one, careful, progress))
        bounds.notes.extend(careful.notes)
    title = "path" if original is None else original.name
    parts = [_motion(one, t, bounds, grid is None) for one, t in zip(paths, timings, strict=True)]
    motion = join(*parts, name=f"fastest {title}")
    active = tuple(label for one, t in zip(paths, timings, strict=True) for label in _labels(bounds, one, t))
    excess = _excess(bounds, motion)
    durations = [np.where(np.diff(t.s) > 0.0, t.durations, 0.0) for t in timings]
    return FastestMotion(
        robot=name,
        path=title,
        motion=motion,
        original_duration=np.nan if original is None else original.duration,
        s=_chained([t.s for t in timings]),
        speed=_joined([t.speed for t in timings]),
        largest_speed=_joined([t.fastest for t in timings]),
        time=_chained([np.concatenate([[0.0], np.cumsum(own)]) for own in durations]),
        active=active,
        costs=_all_costs(bounds, paths, timings, active, costs),
        excess=excess,
        refined=grid is None,
        mechanism=bounds.mechanism,
        actuators=bounds.actuators,
        warnings=(*_warnings(bounds, original, paths, timings, motion), *_excess_warning(excess, bounds, grid is None)),
    )


def _subject(
    robot: Any, path: Any, limits: MotionLimits, changes: tuple[Iterable[Payload], Trust, Mapping[str, Any] | None]
) -> tuple[str, Motion | None, tuple[JointPath, ...], PathLimits]:
    """The robot's name, the motion that gives the path, the paths, and the limits along them."""
    payloads, trust, overrides = changes
    motion = None
    if isinstance(path, JointPath):
        subject = sizing_subject(robot, [_placeholder(path)], payloads, trust, None, overrides)
    else:
        kinds = "a JointPath, a Motion, the name of a motion, or the path of a CSV file"
        arguments.instance("path", path, (Motion, str, Path), kinds)
        if isinstance(path, str):
            arguments.text("path", path, kinds)
        try:
            subject = sizing_subject(robot, [path], payloads, trust, None, overrides)
        except InputError as error:
            raise InputError(str(error).replace("argument 'motions'", "argument 'path'")) from None
        motion = subject.motions[0]
    if subject.config is not None and subject.config.transmissions:
        raise InputError(
            f"{subject.config.source}: transmissions: the fastest motion does not know motors that move several joints"
        )
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
    name = mechanism.robot.name if subject.config is None else subject.config.name
    return name, motion, paths, PathLimits(mechanism, subject.actuators, limits)


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


def _motion(path: JointPath, timing: PathTiming | JerkTiming, bounds: PathLimits, refined: bool) -> Motion:
    """The motion of the joints along one path, with the rows between which it exceeds the limits least."""
    if isinstance(timing, JerkTiming):
        return timing.motion("part")
    best, least = _sampled(path, timing, SHORTEST[0]), np.inf
    for shortest in SHORTEST if refined else ():
        motion = _sampled(path, timing, shortest)
        if (excess := _excess(bounds, motion)) < least:
            best, least = motion, excess
        if least <= KEPT:
            break
    return best


def _sampled(path: JointPath, timing: PathTiming, shortest: float) -> Motion:
    rows = np.array(motion_rows(timing, shortest))
    q, first, second = path.at(np.clip(rows[:, 1], 0.0, path.length))
    y, u = rows[:, 2:3], rows[:, 3:4]
    return Motion(path.joints, rows[:, 0], q, first * y, first * u + second * y * y, "part")


def _labels(bounds: PathLimits, path: JointPath, timing: PathTiming | JerkTiming) -> Sequence[str]:
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


def _all_costs(
    bounds: PathLimits,
    paths: Sequence[JointPath],
    timings: Sequence[PathTiming | JerkTiming],
    active: tuple[str, ...],
    derivatives: bool,
) -> tuple[LimitCost, ...]:
    durations = np.concatenate([np.where(np.diff(t.s) > 0.0, t.durations, 0.0) for t in timings])
    smooth = [timing for timing in timings if isinstance(timing, JerkTiming)]
    if not smooth:
        return _costs(bounds, paths, active, durations, derivatives)
    share, whole = shares(active, durations), float(np.sum(durations))
    groups = {group: sum(timing.derivatives.get(group, 0.0) for timing in smooth) / whole
              for timing in smooth for group in timing.derivatives}  # fmt: skip
    listed = sorted(groups, key=lambda group: -share.get(group, 0.0))
    return tuple(
        LimitCost(group, share.get(group, 0.0), groups[group] if derivatives else np.nan)
        for group in listed
        if group in share or abs(groups[group]) > NO_COST
    )


def _costs(
    bounds: PathLimits, paths: Sequence[JointPath], active: tuple[str, ...], durations: Array, derivatives: bool
) -> tuple[LimitCost, ...]:
    """The cost of each active limit; derivatives by central differences on a fixed grid."""
    found = []
    for name, share in shares(active, durations).items():
        derivative = np.nan
        if derivatives:
            times = []
            for factor in (1.0 - COST_STEP, 1.0 + COST_STEP):
                changed = replace(bounds, factors={name: factor}, notes=[])
                try:
                    times.append(sum(fastest_on_grid(one, changed, COST_CELLS).duration for one in paths))
                except BellcrankError:  # a smaller limit cannot be kept
                    times.append(np.nan)
            derivative = (times[1] - times[0]) / (2.0 * COST_STEP * 0.5 * (times[0] + times[1]))
        found.append(LimitCost(name, share, float(derivative)))
    return tuple(found)


def _warnings(
    bounds: PathLimits,
    original: Motion | None,
    paths: Sequence[JointPath],
    timings: Sequence[PathTiming | JerkTiming],
    motion: Motion,
) -> tuple[str, ...]:
    found = list(dict.fromkeys(bounds.notes))
    limited = {name.joint for name in bounds.names if "torque" in name.what}
    free = [joint.name for joint in bounds.mechanism.motors if joint.name not in limited]
    if free:
        found.append(f"no torque limits the motors at {', '.join(free)}: none is known")
    if original is not None:
        found += original.notes
        if len(paths) > 1:
            found.append(f"the path has {len(paths)} parts with a stop between them, because motion '{original.name}' "
                         "stops there; its pauses are left out")  # fmt: skip
        worst = max(path.deviation for path in paths)
        if worst > 1e-6:
            found.append(f"the path deviates from motion '{original.name}' by up to {worst:.2g} rad or m")
    if bounds.jerk_groups:
        found.append("limits of jerk make the problem non-convex: the motion is a local optimum, and a faster one may "
                     "exist")  # fmt: skip
    for path, timing in zip(paths, timings, strict=True):
        if isinstance(timing, PathTiming) and timing.unproved.any():
            place = 100.0 * float(timing.s[int(np.argmax(timing.unproved))]) / path.length
            found.append(
                f"at {place:.4g} % of the path friction or efficiency splits the allowed accelerations in two; a "
                "faster motion may exist"
            )
    found += limit_notes(bounds.mechanism.robot, motion.name, motion.time, motion.position)
    return tuple(dict.fromkeys(found))


def _excess(bounds: PathLimits, motion: Motion) -> float:
    """The largest share by which a motion exceeds a limit, at its rows and between them."""
    step = np.diff(motion.time)
    wide = np.flatnonzero(step > 0.0)
    worst = -np.inf
    for share in CHECKED_SHARES:
        time = motion.time[wide] + share * step[wide]
        q, v, a = motion.at(time, side="after" if share < 1.0 else "before")
        over = exceeded(bounds.of_motion(q, v, a), np.ones(len(q)), np.zeros(len(q)))
        worst = max(worst, float(np.max(over)), bounds.excess_of_curves(q, v, a))
        for _, speeds in bounds.speed_limits(q, v):
            worst = max(worst, float(np.max(1.0 / speeds)) - 1.0)
    if bounds.jerk_groups:
        worst = max(worst, jerk_excess(motion, bounds.largest_jerk))
    return worst


def _excess_warning(excess: float, bounds: PathLimits, refined: bool) -> tuple[str, ...]:
    if excess <= (TOLD_OF_JERK if bounds.jerk_groups else TOLD if refined else TOLD_ON_GRID):
        return ()
    if bounds.jerk_groups:
        return (
            f"the motion exceeds a limit by up to {100.0 * excess:.2g} % between its rows; limits of jerk that are "
            "reached for an instant only are better left out",
        )
    return (
        f"the motion exceeds a limit by up to {100.0 * excess:.2g} % "
        + ("for a few microseconds, where the acceleration changes" if refined else "between the cells of the grid"),
    )


def _chained(parts: Sequence[Array]) -> Array:
    """Parts that each begin with 0, one after the other."""
    starts = np.concatenate([[0.0], np.cumsum([part[-1] for part in parts])])
    return _joined([part + start for part, start in zip(parts, starts, strict=False)])


def _joined(parts: Sequence[Array]) -> Array:
    return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])
