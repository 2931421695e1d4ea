"""What every film shows of a robot: its bodies, joint axes and traced frames, and what the camera must see."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.motion.kinematics.rotations import rotate
from bellcrank.replays.film.arrows import ArrowScale, child_link, scales_up_to
from bellcrank.replays.film.camera import CameraScene
from bellcrank.replays.film.film import Arrow, FilmAxis
from bellcrank.replays.film.film_samples import PointFunction, SampledFrames
from bellcrank.replays.film.sampled_trajectory import SampledTrajectory
from bellcrank.replays.geometry.meshes import Detail
from bellcrank.replays.geometry.shapes import DrawnBody
from bellcrank.replays.geometry.visuals import robot_bodies
from bellcrank.terminal.progress import share_bar

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot

MOST_LEAVES = 2  # links without children that are traced by default
_TIPS = ("tip", "tool0", "tool", "tcp", "ee", "ee_link", "end_effector", "flange")
_TIP = re.compile(r"(^|_)(tip|tool0?|tcp|ee|end_?effector)($|_)", re.IGNORECASE)
ARROW_LENGTH = 0.2  # of the scene: the length of arrows for which the camera leaves room


def film_bodies(robot: Robot, detail: Detail) -> tuple[tuple[DrawnBody, ...], tuple[str, ...]]:
    """The bodies of a robot, with an empty one for each moving link without shapes; and notes."""
    with share_bar("meshes") as progress:
        bodies, notes = robot_bodies(robot, detail, progress)
    there = {body.name for body in bodies}
    moved = dict.fromkeys(child_link(robot, name) for name, _ in joint_axes(robot))
    return (*bodies, *(DrawnBody(name, ()) for name in moved if name not in there)), notes


def joint_axes(robot: Robot) -> list[tuple[str, Array]]:
    """(joint, unit axis in its own frame) of the joints with one degree of freedom, including mimic joints."""
    axes = [(name, robot.joint_axis(name)) for name in robot.all_joint_names]
    return [(name, axis) for name, axis in axes if np.any(axis)]


def revolute_axes(robot: Robot) -> list[tuple[str, Array]]:
    """(child link, axis in its frame) of the joints with one degree of freedom that turn."""
    linear = {joint.name for joint in robot.joints if joint.kind == "prismatic"}
    return [(child_link(robot, name), axis) for name, axis in joint_axes(robot) if name not in linear]


def film_axes(robot: Robot, bodies: Sequence[DrawnBody], sprung: Iterable[str] = ()) -> tuple[FilmAxis, ...]:
    """The axes of a robot's joints; those of `sprung` revolute joints with torsion springs."""
    number = {body.name: k for k, body in enumerate(bodies)}
    linear, sprung = {joint.name for joint in robot.joints if joint.kind == "prismatic"}, set(sprung)
    return tuple(
        FilmAxis(
            name=name,
            body=number[child_link(robot, name)],
            point=(0.0, 0.0, 0.0),
            direction=(float(x), float(y), float(z)),
            torsion_spring=name in sprung and name not in linear,
        )
        for name, (x, y, z) in joint_axes(robot)
    )


def traced_frames(robot: Robot, asked: Iterable[str], default: Sequence[str] = ()) -> tuple[str, ...]:
    """The frames to trace: those asked for, else the default, else a frame named like a tip, else the last links.

    Last links are traced only if there are few. Raises InputError for a frame that the robot does not have.
    """
    asked = (asked,) if isinstance(asked, str) else tuple(dict.fromkeys(asked))
    for name in asked:
        if name not in robot.frame_names:
            raise InputError(f"trace: {unknown_name('frame', name, robot.frame_names)}")
    if asked or default:
        return asked or tuple(default)
    for name in _TIPS:
        if name in robot.frame_names:
            return (name,)
    tips = tuple(name for name in robot.frame_names if _TIP.search(name) and name not in robot.urdf.joints)
    parents = {joint.parent for joint in robot.urdf.joints.values()}
    leaves = tuple(name for name in robot.urdf.links if name not in parents)
    found = tips if 0 < len(tips) <= 2 * MOST_LEAVES else leaves
    return found if len(found) <= 2 * MOST_LEAVES and (found is tips or len(found) <= MOST_LEAVES) else ()


def frame_origins(trajectory: SampledTrajectory, names: Iterable[str]) -> dict[str, PointFunction]:
    """The origins of frames, as points to trace."""

    def origin(k: int) -> PointFunction:
        return lambda points, quaternions: points[:, k]

    return {name: origin(trajectory.frame_index[name]) for name in names}


def camera_scene(frames: SampledFrames, arrows: Sequence[Arrow] = (), points: Sequence[Array] = ()) -> CameraScene:
    """What the camera must see: the bodies and traces of frames, arrows, and other points (m, 3)."""
    robot = frames.trajectory.robot
    axes = [rotate(frames.frame_pose(link)[1][0], axis) for link, axis in revolute_axes(robot)]
    visible = frames.visible_points
    scales = scales_up_to(arrows, ARROW_LENGTH * float(np.ptp(visible, axis=0).max()))
    tips = [_arrow_tips(arrows[k], scale) for scale in scales for k in scale.arrows]
    return CameraScene(
        points=np.concatenate([visible, *points, *tips]),
        poses=frames.poses,
        axes=np.array(axes).reshape(-1, 3),
        gravity=np.array(robot.gravity),
    )


def _arrow_tips(arrow: Arrow, scale: ArrowScale) -> Array:
    """The end points (m, 3) of an arrow at the times at which it has a length."""
    size = np.linalg.norm(arrow.vectors, axis=1)
    there = np.isfinite(size) & np.isfinite(arrow.points).all(axis=1) & (size > 0.0)
    lengths = scale.lengths(size[there])
    return np.asarray(arrow.points[there] + arrow.vectors[there] * (lengths / size[there])[:, None])


def named_facts(rows: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """Facts in which a line without a name has the name of the line before."""
    facts: list[tuple[str, str]] = []
    for name, value in rows:
        facts.append((name or facts[-1][0], value))
    return facts
