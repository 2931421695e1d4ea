"""What any film shows of a robot: its bodies, joint axes and traced frames."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.replays.film.arrows import child_link
from bellcrank.replays.film.camera import Scenery
from bellcrank.replays.film.film import Arrow, Axis, Body
from bellcrank.replays.film.frames import Footage, Point
from bellcrank.replays.film.sampled_trajectory import Course
from bellcrank.replays.geometry.meshes import Detail
from bellcrank.replays.geometry.rotations import turned
from bellcrank.replays.geometry.visuals import bodies as visual_bodies
from bellcrank.terminal.progress import share_bar

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot

Array = NDArray[np.float64]
MOST_LEAVES = 2  # links without followers that are traced where nothing else says what is
_TIPS = ("tip", "tool0", "tool", "tcp", "ee", "ee_link", "end_effector", "flange")
_TIP = re.compile(r"(^|_)(tip|tool0?|tcp|ee|end_?effector)($|_)", re.IGNORECASE)
ARROW = 0.2  # of the scene: how far the camera expects arrows to reach


def filmed_bodies(robot: Robot, detail: Detail) -> tuple[tuple[Body, ...], tuple[str, ...]]:
    """The bodies of a robot with their notes; links that joints move are among them, if only as places."""
    with share_bar("meshes") as progress:
        bodies, notes = visual_bodies(robot, detail, progress)
    there = {body.name for body in bodies}
    moved = dict.fromkeys(child_link(robot, name) for name, _ in joint_axes(robot))
    return (*bodies, *(Body(name, ()) for name in moved if name not in there)), notes


def joint_axes(robot: Robot) -> list[tuple[str, Array]]:
    """(joint, unit axis in its own frame) of the joints with one degree of freedom, mimicking ones too."""
    axes = [(name, robot.joint_axis(name)) for name in robot.all_joint_names]
    return [(name, axis) for name, axis in axes if np.any(axis)]


def turning_axes(robot: Robot) -> list[tuple[str, Array]]:
    """(link, axis in its frame) of the joints that turn."""
    linear = {joint.name for joint in robot.joints if joint.kind == "prismatic"}
    return [(child_link(robot, name), axis) for name, axis in joint_axes(robot) if name not in linear]


def film_axes(robot: Robot, bodies: Sequence[Body], sprung: Iterable[str] = ()) -> tuple[Axis, ...]:
    """The axes of a robot's joints, those of `sprung` joints as torsion springs."""
    number = {body.name: k for k, body in enumerate(bodies)}
    linear, sprung = {joint.name for joint in robot.joints if joint.kind == "prismatic"}, set(sprung)
    return tuple(
        Axis(
            name, number[child_link(robot, name)], (0.0, 0.0, 0.0), (float(x), float(y), float(z)),
            name in sprung and name not in linear,
        )
        for name, (x, y, z) in joint_axes(robot)
    )  # fmt: skip


def traced_frames(robot: Robot, asked: Iterable[str], followed: Sequence[str] = ()) -> tuple[str, ...]:
    """The frames to trace: those asked for, else those followed, else one that is called a tip, else the last links
    where they are few. Raises InputError for a name that the robot does not have.
    """
    asked = (asked,) if isinstance(asked, str) else tuple(dict.fromkeys(asked))
    for name in asked:
        if name not in robot.frame_names:
            raise InputError(f"trace: {unknown_name('frame', name, robot.frame_names)}")
    if asked or followed:
        return asked or tuple(followed)
    for name in _TIPS:
        if name in robot.frame_names:
            return (name,)
    tips = tuple(name for name in robot.frame_names if _TIP.search(name) and name not in robot.urdf.joints)
    parents = {joint.parent for joint in robot.urdf.joints.values()}
    leaves = tuple(name for name in robot.urdf.links if name not in parents)
    found = tips if 0 < len(tips) <= 2 * MOST_LEAVES else leaves
    return found if len(found) <= 2 * MOST_LEAVES and (found is tips or len(found) <= MOST_LEAVES) else ()


def frame_points(course: Course, names: Iterable[str]) -> dict[str, Point]:
    """The origins of frames, to be traced."""

    def origin(k: int) -> Point:
        return lambda points, turns: points[:, k]

    return {name: origin(course.index[name]) for name in names}


def scenery(shots: Footage, arrows: Sequence[Arrow] = (), more: Sequence[Array] = ()) -> Scenery:
    """What a camera must know of footage, its arrows, and points (m, 3) besides."""
    robot = shots.course.robot
    axes = [turned(shots.placed(link)[1][0], axis) for link, axis in turning_axes(robot)]
    size = float(np.ptp(shots.cloud, axis=0).max())
    points = np.concatenate([shots.cloud, *more, *(_tips(arrow, ARROW * size) for arrow in arrows)])
    return Scenery(points, shots.poses, np.array(axes).reshape(-1, 3), np.array(robot.gravity))


def _tips(arrow: Arrow, longest: float) -> Array:
    """About where an arrow ends (m, 3) that is drawn so long at most (m)."""
    size = np.linalg.norm(arrow.vectors, axis=1)
    there = np.isfinite(size) & np.isfinite(arrow.points).all(axis=1)
    if not np.any(size[there]):
        return np.zeros((0, 3))
    usual = np.percentile(size[there], 98.0) or size[there].max()
    length = longest * np.minimum(size[there] / usual, 1.0)
    return np.asarray(arrow.points[there] + arrow.vectors[there] * (length / np.maximum(size[there], 1e-300))[:, None])


def named_facts(rows: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """Facts in which a line without a name has that of the line before."""
    facts: list[tuple[str, str]] = []
    for name, value in rows:
        facts.append((name or facts[-1][0], value))
    return facts
