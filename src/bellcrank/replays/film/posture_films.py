"""Films of a mechanism at one posture: with the gaps of its loops where it has no start, and moving in its modes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.analysis.linearisation import Linearisation
from bellcrank.analysis.modes import Mode
from bellcrank.analysis.symmetries import project
from bellcrank.arrays import Array, Complex
from bellcrank.dynamics.constraints.constraint_rows import velocity_units
from bellcrank.dynamics.postures.consistent_start import displaced
from bellcrank.dynamics.postures.start_diagnosis import APART, Gap
from bellcrank.elements.loop_constraints import Loop
from bellcrank.errors import InputError
from bellcrank.motion.kinematics.rotations import rotate
from bellcrank.replays.film.arrows import SceneFrames, element_frames, scene_rods, scene_springs
from bellcrank.replays.film.camera import choose_camera, choose_ground
from bellcrank.replays.film.film import BodyLayer, Film, TimelineEvent
from bellcrank.replays.film.film_samples import sample_frames
from bellcrank.replays.film.robot_view import camera_scene, film_axes, film_bodies, frame_origins, traced_frames
from bellcrank.replays.film.sampled_trajectory import SampledTrajectory, frame_pose_function
from bellcrank.replays.geometry.placeholder_shapes import pose_along
from bellcrank.replays.geometry.shapes import IDENTITY, Colour, DrawnBody, DrawnShape
from bellcrank.version import version

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene


FIRST_SIDE: Colour = (0.85, 0.1, 0.1, 1.0)
SECOND_SIDE: Colour = (0.1, 0.3, 0.9, 1.0)
UP = np.array([0.0, 0.0, 1.0])
PALE: Colour = (0.8, 0.81, 0.83, 1.0)  # of the robot beside gaps
THICKNESS = 0.01  # of the size of the robot: the radius of the balls at both sides of a gap
SECONDS = 6.0  # of the film for each mode
PERIODS = 3  # of an oscillation in that time
SAMPLES = 120  # postures of each mode
AMPLITUDE = 0.35  # rad or characteristic lengths: the largest displacement of a mode
SMALLER = (1.0, 0.5, 0.25, 0.1, 0.02)  # shares of it that are tried where loops cannot be closed
RANGE = 3.0  # a growth or decay by e³ is shown


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


def film_of_modes(scene: Scene, linear: Linearisation) -> Film:
    """The film of the modes of a linearised scene, SECONDS each: not to scale in time or amplitude.

    An oscillation is shown for PERIODS periods, growing or decaying at its own rate; a growth or decay by a factor e³.
    A steady motion is seen from the frame that moves along. Raises InputError where there is no mode.
    """
    modes = linear.modes
    if not modes:
        raise InputError(f"{linear.name}: there are no modes to show: the operating point is {linear.kind}")
    robot = scene.robot
    parts = [_postures(scene, linear, mode) for mode in modes]
    time = np.concatenate(
        [k * SECONDS + np.linspace(0.0, 1.0, SAMPLES, endpoint=False) * SECONDS for k in range(len(modes))]
    )
    position = np.concatenate([part for part, _ in parts])
    bodies, notes = film_bodies(robot, "reduced")
    traced = traced_frames(robot, ())
    frames = tuple(dict.fromkeys([*(body.name for body in bodies), *element_frames(scene), *traced]))

    def interpolate(t: Array) -> tuple[Array, Array]:
        found = np.stack([np.interp(t, time, column) for column in position.T], axis=1)
        return found, np.zeros((len(t), robot.nv))

    trajectory = SampledTrajectory(
        robot=robot,
        time=time,
        position=position,
        velocity=np.zeros((len(time), robot.nv)),
        interpolate=interpolate,
        frames=frames,
        pose_function=frame_pose_function(robot, frames, scene.parameters),
        parameters=scene.parameter_values,
    )
    sampled = sample_frames(
        trajectory, bodies, frame_origins(trajectory, traced), [k * SECONDS for k in range(len(modes))]
    )
    placed = SceneFrames(
        scene=scene, parameters=trajectory.parameters,
        state=np.hstack([sampled.position, np.zeros((len(sampled.time), robot.nv))]), frame_pose=sampled.frame_pose,
    )  # fmt: skip
    springs, rods = tuple(scene_springs(placed)), tuple(scene_rods(placed))
    ends = [*(spring.ends for spring in springs), *(rod.ends for rod in rods)]
    view = camera_scene(sampled, (), [each.reshape(-1, 3) for each in ends])
    small = [f"mode {k + 1}" for k, (_, share) in enumerate(parts) if share < 1.0]
    smaller = (f"smaller, as loops do not close further away: {', '.join(small)}",) if small else ()
    return Film(
        title=f"{scene.name}: modes",
        time=sampled.time,
        poses=sampled.poses,
        bodies=bodies,
        camera=choose_camera(view),
        error_bound=sampled.error_bound,
        ground=choose_ground([], view, not robot.floating_base),
        springs=springs,
        rods=rods,
        axes=film_axes(robot, bodies),
        events=tuple(TimelineEvent(k * SECONDS, f"mode {k + 1}: {mode_words(mode)}") for k, mode in enumerate(modes)),
        facts=(("operating point", linear.kind), ("modes", str(len(modes))), ("bellcrank", version())),
        success=linear.stable is not False,
        notes=(
            f"Each mode is shown for {SECONDS:g} s, not to scale in time and amplitude.",
            *smaller,
            *linear.notes,
            *notes,
        ),
    )


def mode_words(mode: Mode) -> str:
    """A mode in a few words, such as "oscillation, 0.498 Hz"."""
    if mode.oscillates:
        return f"{mode.kind}, {mode.frequency:.4g} Hz"
    return mode.kind if mode.time_constant is None else f"{mode.kind}, {mode.time_constant:.4g} s"


def _postures(scene: Scene, linear: Linearisation, mode: Mode) -> tuple[Array, float]:
    """Postures (SAMPLES, nq) of a mode that satisfy the constraints, and the share of AMPLITUDE that they reach."""
    unit = velocity_units(scene) if scene.constraints else np.ones(scene.robot.nv)
    history = np.outer(_course(mode), mode.displacement).real
    history *= AMPLITUDE / max(float(np.abs(history / unit).max(initial=0.0)), 1e-300)
    for share in SMALLER:
        try:
            return np.stack([_closed(scene, linear, share * step) for step in history]), share
        except InputError:
            continue
    return np.tile(linear.position, (SAMPLES, 1)), 0.0


def _course(mode: Mode) -> Complex:
    """The mode's factor (SAMPLES,) over its time in the film, at most 1."""
    share = np.linspace(0.0, 1.0, SAMPLES, endpoint=False)
    real, imaginary = mode.eigenvalue.real, mode.eigenvalue.imag
    if mode.oscillates:
        grown = np.clip(2.0 * np.pi * PERIODS * real / imaginary, -RANGE, RANGE)
        found = np.exp((grown + 2j * np.pi * PERIODS) * share)
        return np.asarray(found / np.abs(found).max())
    if real == 0.0:
        return np.asarray(np.sin(2.0 * np.pi * share) + 0j)
    return np.asarray(np.exp(RANGE * (share - 1.0 if real > 0.0 else -share)) + 0j)


def _closed(scene: Scene, linear: Linearisation, step: Array) -> Array:
    """The posture after a displacement, moved onto the constraints."""
    there = displaced(scene, linear.position, step)
    return project(scene, linear.time, there, linear.velocity)[0] if scene.constraints else there
