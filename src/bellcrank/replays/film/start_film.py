"""The film of a mechanism at one posture, with the gaps of loops that are not closed there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.dynamics.postures.start_diagnosis import APART, Gap
from bellcrank.elements.loop_constraints import Loop
from bellcrank.motion.kinematics.quaternions import rotate
from bellcrank.replays.film.arrows import SceneFrames, element_frames, scene_rods, scene_springs
from bellcrank.replays.film.camera import choose_camera, choose_ground
from bellcrank.replays.film.film import BodyLayer, Film
from bellcrank.replays.film.film_samples import sample_frames
from bellcrank.replays.film.robot_view import camera_scene, film_axes, film_bodies
from bellcrank.replays.film.sampled_trajectory import SampledTrajectory, frame_pose_function
from bellcrank.replays.geometry.colours import Colour
from bellcrank.replays.geometry.placeholder_shapes import pose_along
from bellcrank.replays.geometry.shapes import IDENTITY, DrawnBody, DrawnShape
from bellcrank.version import version

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

FIRST_SIDE: Colour = (0.85, 0.1, 0.1, 1.0)
SECOND_SIDE: Colour = (0.1, 0.3, 0.9, 1.0)
UP = np.array([0.0, 0.0, 1.0])
PALE: Colour = (0.8, 0.81, 0.83, 1.0)  # of the robot beside gaps
THICKNESS = 0.01  # of the size of the robot: the radius of the balls at both sides of a gap


def film_of_start(scene: Scene, posture: Array, gaps: Sequence[Gap], facts: Sequence[tuple[str, str]]) -> Film:
    """The robot of a scene at a position (nq,), and the gaps of loops between frames.

    A gap is drawn as balls at both sides, red and blue, with a rod between them, in a layer that can be hidden. Where a
    loop fixes rotations that differ, a pin at each side shows the z axis of its frame. `facts` are (name, value) for
    the header.
    """
    robot = scene.robot
    bodies, notes = film_bodies(robot, "reduced")
    if gaps:
        bodies = tuple(
            DrawnBody(body.name, tuple(replace(shape, colour=PALE) for shape in body.shapes)) for body in bodies
        )
    frames = tuple(dict.fromkeys([*(body.name for body in bodies), *element_frames(scene)]))
    trajectory = SampledTrajectory(
        robot=robot,
        time=np.zeros(1),
        position=posture[None],
        velocity=np.zeros((1, robot.nv)),
        interpolate=lambda t: (np.repeat(posture[None], len(t), axis=0), np.zeros((len(t), robot.nv))),
        frames=frames,
        pose_function=frame_pose_function(robot, frames, scene.parameters),
        parameters=scene.own_parameters[: len(scene.parameters)],
    )
    sampled = sample_frames(trajectory, bodies, {})
    placed = SceneFrames(
        scene=scene,
        parameters=trajectory.parameters,
        state=np.concatenate([posture, np.zeros(robot.nv)])[None],
        frame_pose=sampled.frame_pose,
    )
    springs, rods = tuple(scene_springs(placed)), tuple(scene_rods(placed))
    ends = [*(spring.ends for spring in springs), *(rod.ends for rod in rods)]
    view = camera_scene(sampled, (), [each.reshape(-1, 3) for each in ends])
    thickness = THICKNESS * float(np.ptp(view.points, axis=0).max())
    drawn = list(_gap_bodies(placed, gaps, thickness))
    poses = np.tile(np.array(IDENTITY), (len(sampled.time), len(drawn), 1))
    corners = [np.array(shape.pose[:3])[None] for _, body in drawn for shape in body.shapes]
    seen = replace(view, points=np.concatenate([view.points, *corners]))
    return Film(
        title=f"{scene.name}: start",
        time=sampled.time,
        poses=np.concatenate([sampled.poses, poses], axis=1),
        bodies=(*bodies, *(body for _, body in drawn)),
        camera=choose_camera(seen),
        error_bound=0.0,
        ground=choose_ground([], seen, not robot.floating_base),
        springs=springs,
        rods=rods,
        axes=film_axes(robot, bodies),
        layers=tuple(BodyLayer("gaps", str(gap), (len(bodies) + k,)) for k, (gap, _) in enumerate(drawn)),
        facts=(*facts, ("bellcrank", version())),
        success=all(name != "error" for name, _ in facts),
        notes=(*(text for _, text in facts[1:]), *notes),
    )


def _gap_bodies(placed: SceneFrames, gaps: Sequence[Gap], thickness: float) -> Iterator[tuple[Gap, DrawnBody]]:
    """The gaps of loops between frames, drawn in the world frame."""
    loops = {constraint.name: constraint for constraint in placed.scene.constraints if isinstance(constraint, Loop)}
    for gap in gaps:
        loop = loops.get(gap.constraint)
        if loop is None:
            continue
        shapes: list[DrawnShape] = []
        points = []
        for first, colour in ((True, FIRST_SIDE), (False, SECOND_SIDE)):
            point, quaternion = (rows[0] for rows in placed.loop_side(loop, first))
            points.append(point)
            shapes.append(DrawnShape(kind="sphere", size=(thickness,), colour=colour, pose=pose_along(UP, point)))
            if gap.angle > APART:
                pin = rotate(quaternion, np.array([0.0, 0.0, 8.0 * thickness]))
                size = (0.4 * thickness, 8.0 * thickness)
                shapes.append(
                    DrawnShape(kind="cylinder", size=size, colour=colour, pose=pose_along(pin, point + 0.5 * pin))
                )
        between = points[1] - points[0]
        length = float(np.linalg.norm(between))
        if length > APART:
            pose = pose_along(between, 0.5 * (points[0] + points[1]))
            shapes.append(DrawnShape(kind="cylinder", size=(0.5 * thickness, length), colour=FIRST_SIDE, pose=pose))
        yield gap, DrawnBody(f"gap {gap.constraint}", tuple(shapes))
