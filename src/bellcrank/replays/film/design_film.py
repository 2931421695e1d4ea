"""The film of a study: several designs of one scene, each with its own motion and its own link lengths."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.elements.rolling_constraint import RollingDisk
from bellcrank.errors import InputError
from bellcrank.motion.kinematics.rotations import rotate
from bellcrank.replays.film.arrows import SceneFrames, element_frames, scene_rods, scene_springs
from bellcrank.replays.film.camera import CameraScene, choose_camera, choose_ground
from bellcrank.replays.film.decimation import frame_rows
from bellcrank.replays.film.film import Film, FilmSpring, Rod, TimelineEvent, Trace
from bellcrank.replays.film.film_samples import FramePose
from bellcrank.replays.film.live_shapes import LinkStretch
from bellcrank.replays.film.motion_film import MotionSequence, motion_trajectories
from bellcrank.replays.film.robot_view import film_axes, film_bodies, revolute_axes, traced_frames
from bellcrank.replays.film.run_film import finite_rows, output_frames, run_trajectory
from bellcrank.replays.film.sampled_trajectory import SampledTrajectory, frame_pose_function, refine
from bellcrank.replays.geometry.meshes import Detail
from bellcrank.replays.geometry.shapes import DrawnBody, body_radii, bounding_boxes, outlines, world_corners
from bellcrank.sizing.loads.joint_histories import SizingInputs

if TYPE_CHECKING:
    from bellcrank.replays.film.sampled_trajectory import SampledTrajectory
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory.trajectory import Trajectory
    from bellcrank.sizing.loads.joint_histories import SizingInputs


# ---- What the film of a study shows of one design: a run of a scene, or a motion over which it was sized.


@dataclass(frozen=True, eq=False, kw_only=True)
class DesignSource:
    """One design.

    Attributes:
        robot: Its robot.
        scene: Its scene; None where there is none.
        parameters: Values of the scene's parameters.
        trajectory: Its motion, with the poses of these frames.
        events: What is marked on the time line.
        traced: The frames that are traced by default.
    """

    robot: Robot
    scene: Scene | None
    parameters: Array
    trajectory: Callable[[tuple[str, ...]], SampledTrajectory]
    events: tuple[TimelineEvent, ...] = ()
    traced: tuple[str, ...] = ()

    def frames(self, position: Array, frame_pose: FramePose) -> SceneFrames | None:
        """What springs and rods are drawn from, at positions (n, nq)."""
        if self.scene is None:
            return None
        return SceneFrames(scene=self.scene, parameters=self.parameters, state=position, frame_pose=frame_pose)


def design_source(result: Trajectory | SizingInputs) -> DesignSource:
    """A design that was simulated, or is sized: then its first motion is shown."""
    if isinstance(result, SizingInputs):
        mechanism, motions, _ = result
        scene = mechanism.scene
        sequence = MotionSequence(mechanism=mechanism, motions=motions[:1], actuators={})
        return DesignSource(
            robot=mechanism.robot,
            scene=scene,
            parameters=np.zeros(0) if scene is None else scene.parameter_values,
            trajectory=lambda frames: motion_trajectories(sequence, frames)[0],
        )
    run = result
    return DesignSource(
        robot=run.robot,
        scene=run.scene,
        parameters=run.parameters,
        trajectory=lambda frames: run_trajectory(run, finite_rows(run), frames),
        events=tuple(TimelineEvent(event.time, event.name) for event in run.events),
        traced=output_frames(run),
    )


TOLERANCE = 1.0 / 400.0  # of the size of the robot: two pixels in a view of 800 lines
REFINEMENT = 0.25  # share of the tolerance for the error between two rows of a run
SEEN = 40  # times of each design by which the camera is chosen


@dataclass(frozen=True, eq=False, kw_only=True)
class FilmedMotion:
    """The motion of one design: poses (n, bodies, 7) at times (n,) s, as in a film.

    `stretch` (bodies, 3, 3) maps points of a body's shapes, in the body's frame, to those of the design. Springs and
    rods are those of the film in the same order.
    """

    time: Array
    poses: Array
    stretch: Array
    springs: tuple[FilmSpring, ...]
    rods: tuple[Rod, ...]
    events: tuple[TimelineEvent, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class DesignFilm:
    """The film of the first design, whose time lasts as long as the longest, and the motions of all.

    `traced` are the bodies, by number, whose paths are the film's traces.
    """

    film: Film
    motions: tuple[FilmedMotion, ...]
    traced: tuple[int, ...]


def film_of_designs(
    results: Sequence[Trajectory | SizingInputs], *, title: str, trace: Iterable[str] = (), detail: Detail = "reduced"
) -> DesignFilm:
    """The film of runs, or of what is sized, of one scene with other parameters, starts or settings.

    Raises InputError for an unknown frame to trace, and without a design.
    """
    if not results:
        raise InputError(f"{title}: expected at least one design with a motion, found none")
    sources = [design_source(result) for result in results]
    scene, robot = sources[0].scene, sources[0].robot
    parameters = {} if scene is None else scene.parameters
    bodies, notes = film_bodies(robot, detail)
    traced = traced_frames(robot, trace, sources[0].traced)
    there = {body.name for body in bodies}
    bodies = (*bodies, *(DrawnBody(name, ()) for name in traced if name not in there))
    frames = tuple(dict.fromkeys([*(body.name for body in bodies), *(() if scene is None else element_frames(scene))]))
    stretch = LinkStretch(robot, bodies, parameters)
    corners, surfaces = bounding_boxes(bodies), outlines(bodies)
    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        poses_of = frame_pose_function(robot, frames, parameters)  # the same for all, so that it is compiled once
        trajectories = [replace(source.trajectory(frames), pose_function=poses_of) for source in sources]
        seen = [_some_poses(trajectory, len(bodies)) for trajectory in trajectories]
        size = max(float(np.linalg.norm(np.ptp(world_corners(poses, corners), axis=1), axis=1).max()) for poses in seen)
        motions = tuple(
            _motion(source, trajectory, bodies, TOLERANCE * (size or 1.0), stretch.maps(trajectory.parameters))
            for source, trajectory in zip(sources, trajectories, strict=True)
        )
    view = CameraScene(
        points=np.concatenate([world_corners(poses, surfaces).reshape(-1, 3) for poses in seen]),
        poses=np.concatenate(seen[:1]),
        axes=_world_axes(robot, trajectories[0]),
        gravity=np.array(robot.gravity),
    )
    number = {body.name: k for k, body in enumerate(bodies)}
    paths = _distinct_paths([(name, number[name]) for name in traced], motions, TOLERANCE * size)
    first, end = motions[0], max(float(motion.time[-1]) for motion in motions)
    lasting = len(first.time) > 1 and end > first.time[-1]  # the player's time is that of the longest motion
    extended = [*range(len(first.time)), *([len(first.time) - 1] if lasting else [])]
    film = Film(
        title=title,
        time=np.append(first.time, end) if lasting else first.time,
        poses=first.poses[extended],
        bodies=bodies,
        camera=choose_camera(view),
        error_bound=TOLERANCE * size,
        ground=choose_ground(_planes(sources[0]), view, not robot.floating_base),
        traces=tuple(Trace(name, first.time, first.poses[:, k, :3]) for name, k in paths),
        springs=tuple(FilmSpring(spring.name, spring.ends[extended]) for spring in first.springs),
        rods=tuple(Rod(rod.name, rod.ends[extended]) for rod in first.rods),
        axes=film_axes(robot, bodies),
        notes=(*notes, "links are stretched so that their joints lie where the parameters of the design place them"),
    )
    return DesignFilm(film=film, motions=motions, traced=tuple(k for _, k in paths))


def _motion(
    source: DesignSource, trajectory: SampledTrajectory, bodies: Sequence[DrawnBody], bound: float, stretch: Array
) -> FilmedMotion:
    """The motion of a design at as few times as the bound (m) allows; events keep their times."""
    corners = bounding_boxes(bodies)
    radii, numbers = body_radii(corners), [trajectory.frame_index[body.name] for body in bodies]
    trajectory = refine(trajectory, numbers, radii, bound / TOLERANCE, REFINEMENT * bound)
    end = float(trajectory.time[-1])
    events = [event for event in source.events if trajectory.time[0] <= event.time <= end]
    keep = np.clip(np.searchsorted(trajectory.time, [event.time for event in events]), 0, len(trajectory.time) - 1)
    points, quaternions = trajectory.frame_poses(trajectory.position)
    bound = (1.0 - REFINEMENT) * bound
    rows = frame_rows(trajectory.time, points[:, numbers], quaternions[:, numbers], radii, bound, np.unique(keep))
    points, quaternions = points[rows], quaternions[rows]

    def frame_pose(name: str) -> tuple[Array, Array]:
        return points[:, trajectory.frame_index[name]], quaternions[:, trajectory.frame_index[name]]

    frames = source.frames(trajectory.position[rows], frame_pose)
    return FilmedMotion(
        time=trajectory.time[rows],
        poses=np.concatenate([points[:, numbers], quaternions[:, numbers]], axis=2),
        stretch=stretch,
        springs=() if frames is None else tuple(scene_springs(frames)),
        rods=() if frames is None else tuple(scene_rods(frames)),
        events=tuple(events),
    )


def _planes(source: DesignSource) -> list[tuple[Array, float]]:
    """The planes that disks of a scene roll on."""
    frames = source.frames(np.zeros((0, 0)), lambda name: (np.zeros((0, 3)), np.zeros((0, 4))))
    disks = [] if frames is None else [c for c in frames.scene.constraints if isinstance(c, RollingDisk)]
    return [(np.array(disk.normal), frames.number(disk, "height")) for disk in disks if frames is not None]


def _distinct_paths(
    paths: Sequence[tuple[str, int]], motions: Sequence[FilmedMotion], bound: float
) -> list[tuple[str, int]]:
    """The paths, name and body, without those that coincide with an earlier one within a bound (m) in every motion."""
    found: list[tuple[str, int]] = []
    for name, body in paths:
        apart = (
            max(float(np.abs(motion.poses[:, body, :3] - motion.poses[:, other, :3]).max()) for motion in motions)
            for _, other in found
        )
        if all(distance > bound for distance in apart):
            found.append((name, body))
    return found


def _some_poses(trajectory: SampledTrajectory, bodies: int) -> Array:
    """Poses (m, bodies, 7) of the bodies, which are the first frames, at a few rows."""
    some = np.unique(np.linspace(0, len(trajectory.time) - 1, SEEN).astype(int))
    points, quaternions = trajectory.frame_poses(trajectory.position[some])
    return np.concatenate([points[:, :bodies], quaternions[:, :bodies]], axis=2)


def _world_axes(robot: Robot, trajectory: SampledTrajectory) -> Array:
    quaternions = trajectory.frame_poses(trajectory.position[:1])[1][0]
    there = [(link, axis) for link, axis in revolute_axes(robot) if link in trajectory.frame_index]
    axes = [rotate(quaternions[trajectory.frame_index[link]], axis) for link, axis in there]
    return np.array(axes).reshape(-1, 3)
