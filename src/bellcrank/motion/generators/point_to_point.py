"""Motions from posture to posture in the shortest time within limits of the joints, all joints in step.

Between two postures the joints move along the straight line of joint space, q(t) = q₀ + σ(t) (q₁ − q₀), and σ from 0 to
1 is the fastest profile within the limits of all joints, min v_i/|Δq_i| and likewise for acceleration and jerk
(L. Biagiotti, C. Melchiorri, Trajectory Planning for Automatic Machines and Robots, 3.4 and 4.4: synchronisation). A
blend at a posture lets the motion pass it without a stop: the path is that of `blends.py`, and the speed y along it is
constant in each blend, where the joints' accelerations are q'' y² and their jerks q''' y³.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.motion.generators.blends import MOST_BENT, STEEPEST, BlendedPath, Section, blended, straight, timing
from bellcrank.motion.generators.closed_form import ClosedForm, TimedPath
from bellcrank.motion.generators.profile import Profile
from bellcrank.motion.generators.profile import profile as make_profile
from bellcrank.motion.generators.waypoints import checked_samples
from bellcrank.motion.limit_checks import check_size, limit_notes
from bellcrank.motion.motion import Motion, join
from bellcrank.robot.model.joints import require_one_degree

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot

Posture = Mapping[str, float] | Sequence[float] | Array
JointLimit = str | float | Mapping[str, float]
PROFILES = ("trapezoid", "s_curve")
KEYS = {"speed": "rad/s or m/s", "acceleration": "rad/s² or m/s²", "jerk": "rad/s³ or m/s³"}
SAME = 1e-9  # rad or m: postures closer than this are the same


@arguments.named
def point_to_point(
    robot: Robot,
    positions: Sequence[Posture] | Array,
    *,
    speed: JointLimit = "urdf",
    acceleration: JointLimit | None = None,
    jerk: JointLimit | None = None,
    profile: str = "s_curve",
    blend: float = 0.0,
    share: float = 1.0,
    samples: int = 1001,
    name: str = "point_to_point",
) -> Motion:
    """Move from posture to posture in the shortest time within limits of the joints, along straight lines in joint
    space.

    All joints start and arrive together. Without a blend the motion stops at each posture and no joint overshoots.

    Args:
        robot: The robot; joints that move have one degree of freedom.
        positions: Two postures or more: joint positions by name (other joints are neutral), or (nq,), rad or m.
        speed: Largest speed: "urdf" for the URDF's, one number for all joints, or numbers by joint (joints not named
            are not limited), rad/s or m/s.
        acceleration: Largest acceleration, one number or numbers by joint, rad/s² or m/s².
        jerk: Largest jerk, for the profile "s_curve": one number or numbers by joint, rad/s³ or m/s³.
        profile: "trapezoid": constant acceleration; "s_curve": limited jerk.
        blend: Distance from each inner posture, in joint space (rad and m), at which the path leaves the straight line
            to pass it without a stop; the path then misses the posture by at most 5/16 of it. 0: stop there.
        share: Share of all limits that is used, above 0, at most 1.
        samples: Least number of rows of a piece of the motion between stops.
        name: Name of the motion.

    Returns:
        The motion.

    Raises:
        InputError: An argument is wrong, two postures that follow each other are the same, no limit of the acceleration
            or (for "s_curve") of the jerk is given for a joint that moves, or a blend takes more than half of
            the line between two postures.

    Example:
        >>> import bellcrank as bc
        >>> arm = bc.load_robot("planar_2r")
        >>> move = bc.point_to_point(arm, [{}, {"elbow": 1.0}], speed=1.0, acceleration=4.0, profile="trapezoid")
        >>> move.duration
        1.25
    """
    title = f"motion '{arguments.text('name', name, empty=True)}'"
    arguments.robot(robot)
    if arguments.text("profile", profile, "the name of a profile", where=title) not in PROFILES:
        arguments.one_of("profile", profile, PROFILES, where=title)
    blend = arguments.number("blend", blend, "rad or m", least=0.0, most=1e9, where=title)
    share = arguments.number("share", share, above=0.0, most=1.0, where=title)
    samples = checked_samples(title, samples)
    points = _points(robot, positions, title)
    given = {"speed": speed, "acceleration": acceleration, "jerk": jerk if profile == "s_curve" else None}
    if profile == "trapezoid" and jerk is not None:
        raise InputError(f"{title}: profile 'trapezoid' cannot keep a limit of jerk: choose s_curve, or leave it out")
    limits = {key: share * _of_joints(robot, key, value, title) for key, value in given.items()}
    if profile == "trapezoid":
        del limits["jerk"]
    lines = [straight(a, b) for a, b in pairwise(points)]
    paths = [BlendedPath((line,), ()) for line in lines]
    if blend > 0.0:
        paths = [blended(lines, [blend] * (len(lines) - 1), title, "rad or m", 2)]
    parts = [_along(robot, path, _timing(robot, path, limits, profile, title), samples, name) for path in paths]
    motion = parts[0] if len(parts) == 1 else join(*parts, name=name)
    notes = (*motion.notes, *limit_notes(robot, name, motion.time, motion.position))
    return replace(motion, name=name, notes=notes)


def _points(robot: Robot, positions: object, title: str) -> Array:
    """The postures (k, nq)."""
    given = list(positions) if isinstance(positions, np.ndarray) and positions.ndim else positions
    listed = arguments.several("positions", given, object, "two postures or more", where=title)
    if len(listed) < 2 or any(point is None for point in listed):
        arguments.refuse("positions", "two postures or more", given, title)
    points = np.stack(
        [np.asarray(robot.posture(point), dtype=np.float64) for point in cast(tuple[Posture, ...], listed)]
    )
    check_size(title, "position", points)
    for k, step in enumerate(np.abs(np.diff(points, axis=0)).max(axis=1).tolist()):
        if step < SAME:
            raise InputError(
                f"{title}: postures {k + 1} and {k + 2} are the same; leave one of them out, and use a dwell for a "
                "pause"
            )
    moving = np.abs(np.diff(points, axis=0)).max(axis=0) > 0.0
    for joint in robot.joints:
        if joint.nv != 1 and moving[joint.q : joint.q + joint.nq].any():
            require_one_degree(joint, title)
    return points


def _of_joints(robot: Robot, key: str, given: JointLimit | None, title: str) -> Array:
    """The limits (nq,) of one quantity, infinite where there is none and for joints of several degrees of freedom."""
    limits = np.full(len(robot.lower), np.inf)
    single = [joint for joint in robot.joints if joint.nv == 1]
    if given is None:
        return limits
    if key == "speed" and isinstance(given, str):
        arguments.one_of(key, given, ("urdf",), where=title)
        for joint in single:
            found = float(robot.velocity_limit[joint.v])
            limits[joint.q] = found if found > 0.0 else np.inf
    elif isinstance(given, Mapping):
        for joint_name, value in arguments.mapping(key, given, "a number, or numbers by joint", where=title).items():
            try:
                column = robot.one_degree_joint(joint_name, key).q
            except InputError as error:
                raise InputError(f"{title}: argument '{key}': {error}") from None
            limits[column] = arguments.number(f"{key} of '{joint_name}'", value, KEYS[key], above=0.0, where=title)
    else:
        limits[[joint.q for joint in single]] = arguments.number(key, given, KEYS[key], above=0.0, where=title)
    return limits


def _timing(robot: Robot, path: BlendedPath, limits: Mapping[str, Array], kind: str, title: str) -> Profile:
    """The fastest profile over a straight line; with blends, the fastest with a constant speed in each blend."""
    e = np.stack([(segment.end - segment.begin) / segment.length for segment in path.segments])
    r = np.array([0.0, *path.blends, 0.0])
    sections = []
    for k, segment in enumerate(path.segments):
        bounds = _bounds(robot, limits, np.abs(e[k]), title)
        if len(path.segments) == 1:
            return make_profile(kind, path.length, None, **bounds)
        sections.append(Section(length=segment.length - r[k] - r[k + 1], **bounds))
        if k + 1 < len(path.segments):
            turn, first = np.abs(e[k + 1] - e[k]), np.maximum(np.abs(e[k]), np.abs(e[k + 1]))
            width = 2.0 * r[k + 1]
            speed = min(
                _least(limits["speed"], first),
                np.sqrt(_least(limits["acceleration"], turn * STEEPEST / width)),
                np.cbrt(_least(limits["jerk"], turn * MOST_BENT / width**2)) if "jerk" in limits else np.inf,
            )
            sections.append(Section(length=float(width), speed=float(speed), even=True))
    return timing(kind, sections, title)


def _bounds(robot: Robot, limits: Mapping[str, Array], rates: Array, title: str) -> dict[str, Any]:
    """Speed, acceleration and jerk along a straight line on which the joints move with these rates (nq,)."""
    found: dict[str, Any] = {}
    for key, limit in limits.items():
        bound = _least(limit, rates)
        if np.isfinite(bound):
            found[key] = bound
        elif key != "speed":
            moving = [joint.name for joint in robot.joints if joint.nv == 1 and rates[joint.q] > 0.0]
            raise InputError(
                f"{title}: no limit of {key} is known for {', '.join(moving)}, which move; give '{key}' ({KEYS[key]})"
            )
    return found


def _least(limits: Array, rates: Array) -> float:
    """The smallest limit over rate, of the rates above 0."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return float(np.min(np.where(rates > 0.0, limits / rates, np.inf)))


def _along(robot: Robot, path: BlendedPath, timing: Profile, samples: int, name: str) -> Motion:
    single = [joint for joint in robot.joints if joint.nv == 1]
    columns = tuple(joint.q for joint in single), tuple(joint.v for joint in single)
    curve = TimedPath(path, timing, *columns, robot.nv)
    time, *along = timing.rows(samples, path.knots)
    q, v, a = curve.states(*along)
    q[0], q[-1] = path.segments[0].begin, path.segments[-1].end
    return Motion(robot.joints, time, q, v, a, name, forms=(ClosedForm(0.0, timing.duration, curve),))
