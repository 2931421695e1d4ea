"""The film of motions, one after the other, with the torques that they require."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.inverse.input_breakpoints import with_force_rows
from bellcrank.dynamics.inverse.mechanism import Mechanism, mechanism_of
from bellcrank.dynamics.inverse.motion_notes import mechanism_notes, motion_notes
from bellcrank.elements.joint_forces import JointSpring
from bellcrank.motion.coordinates import position_labels, velocity_labels
from bellcrank.motion.motion import require_joints
from bellcrank.motion.sampled.resampling import BETWEEN, SHARE, before, ranges, refined
from bellcrank.replays.film.arrows import SceneFrames, element_frames, motor_arrow, scene_rods, scene_springs
from bellcrank.replays.film.camera import CameraScene, choose_camera, choose_ground
from bellcrank.replays.film.charts import (
    join_times,
    join_with_gaps,
    motor_speed_torque,
    panel_chart,
    torque_speed_plots,
)
from bellcrank.replays.film.film import Arrow, Chart, Film, FilmSpring, Rod, TimelineEvent, Trace
from bellcrank.replays.film.film_samples import ArrowFunction, FramePose, SampledFrames, join_arrows, sample_frames
from bellcrank.replays.film.robot_view import camera_scene, film_axes, film_bodies, frame_origins, traced_frames
from bellcrank.replays.film.sampled_trajectory import SampledTrajectory, frame_pose_function
from bellcrank.replays.geometry.meshes import Detail
from bellcrank.replays.geometry.shapes import DrawnBody
from bellcrank.simulation.files.run_csv import torque_unit
from bellcrank.simulation.trajectory.interpolation import signal_jumps
from bellcrank.simulation.trajectory.plot_panels import by_unit, titled_apart
from bellcrank.sizing.loads.joint_histories import SampledStates, joint_torques
from bellcrank.sizing.loads.motion_grid import Sides, motion_sides
from bellcrank.version import version

if TYPE_CHECKING:
    from bellcrank.actuators.actuator import Actuator
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene


# ---- Time series of joints and motors over motions, sampled so that linear interpolation between rows is accurate.

Function = Callable[[Array, Array, Array, Array], Sequence[Array]]  # t, q, v, a -> tables (n, lines), one a group


@dataclass(frozen=True, eq=False)
class MotionSeries:
    """Increasing times (n,) s of one motion, and tables (n, lines) of groups of lines over them.

    A jump at t has rows at the last number before t and at t. `error` is the largest error of linear interpolation
    between rows, relative to the range of a line, where it exceeds the bound.
    """

    time: Array
    groups: tuple[Array, ...]
    error: float


def motion_series(motions: Sequence[Motion], functions: Sequence[Function], jumps: Array) -> list[MotionSeries]:
    """The series of each motion: position, velocity, acceleration, and the groups that its function returns.

    Linear interpolation between rows is within the bound that follows from the range of a line over all motions
    (BETWEEN * SHARE), or within `error` if that takes too many rows. Forces jump at the times `jumps` (k,) s.
    """
    group_functions = [_groups(motion, function) for motion, function in zip(motions, functions, strict=True)]
    times = [_times(motion, jumps) for motion in motions]
    tables = [groups(time) for groups, time in zip(group_functions, times, strict=True)]
    widths = [table.shape[1] for table in tables[0]]
    reach = np.concatenate([ranges(np.concatenate(group)) for group in zip(*tables, strict=True)])
    found = []
    for time, table, groups in zip(times, tables, group_functions, strict=True):

        def lines(t: Array, groups: Callable[[Array], list[Array]] = groups) -> Array:
            return np.concatenate(groups(t), axis=1)

        every, rows, left = refined(time, np.concatenate(table, axis=1), lines, BETWEEN * SHARE * reach)
        error = float((left / np.where(reach > 0.0, reach, 1.0)).max(initial=0.0))
        found.append(MotionSeries(every, tuple(np.split(rows, np.cumsum(widths)[:-1], axis=1)), error))
    return found


def _times(motion: Motion, jumps: Array) -> Array:
    """The times of a motion's rows and of jumps; the first of two rows of one time is just before it."""
    twin = np.append(np.diff(motion.time) == 0.0, False)
    inside = jumps[(jumps > motion.time[0]) & (jumps < motion.time[-1])]
    return np.unique(np.concatenate([np.where(twin, before(motion.time), motion.time), before(inside), inside]))


def _groups(motion: Motion, function: Function) -> Callable[[Array], list[Array]]:
    def at(time: Array) -> list[Array]:
        q, v, a = motion.at(time)
        return [q, v, a, *function(time, q, v, a)]

    return at


Progress = Callable[[float], None] | None
GAP = 1e-3  # s between a motion and the next: shorter than a frame of a screen


@dataclass(frozen=True, eq=False, kw_only=True)
class MotionSequence:
    """Motions of a mechanism that a film plays one after the other, with the actuators of its motors by joint.

    `more_bodies` move with the frames of the robot after which they are named.
    """

    mechanism: Mechanism
    motions: Sequence[Motion]
    actuators: Mapping[str, Actuator]
    more_bodies: tuple[DrawnBody, ...] = ()

    @cached_property
    def starts(self) -> list[float]:
        """The time at which each motion begins in the film, s; a single motion keeps its own times."""
        motions, lengths = self.motions, [motion.duration + GAP for motion in self.motions]
        return [float(motions[0].time[0]) * (len(motions) == 1) + sum(lengths[:k]) for k in range(len(motions))]

    @cached_property
    def shifts(self) -> list[float]:
        """The difference between the film's time and each motion's time, s."""
        return [start - float(motion.time[0]) for motion, start in zip(self.motions, self.starts, strict=True)]

    @cached_property
    def sides(self) -> list[Sides]:
        """The sides of the speeds of each motion, by which the losses of gears are judged."""
        return [motion_sides(motion) for motion in self.motions]

    def torques(self, motion: Motion, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Torques (n, motors) N m or N of the motors at times (n,) s of a motion."""
        end = float(motion.time[-1])
        states = SampledStates(t, q, v, a)
        return joint_torques(self.mechanism, self.mechanism.motors, self.actuators, states, end)

    def efforts(self, motion: Motion, t: Array, q: Array, v: Array, a: Array) -> list[Array]:
        """Torques at joints, and speeds and torques of motors, (n, motors) each, at times (n,) s of a motion."""
        torques = self.torques(motion, t, q, v, a)
        v = self.sides[self.motions.index(motion)].of_velocity(t, v)  # what is still has no direction by rounding
        motors = [
            motor_speed_torque(joint, self.actuators.get(joint.name), torque, v, a)
            for joint, torque in zip(self.mechanism.motors, torques.T, strict=True)
        ]
        return [torques, *(np.stack(each, axis=1) for each in zip(*motors, strict=True))]

    def arrows(self, motion: Motion) -> ArrowFunction:
        """The torques of the motors as arrows."""
        robot, motors = self.mechanism.robot, self.mechanism.motors

        def arrows(t: Array, _q: Array, _v: Array, frame_pose: FramePose) -> list[Arrow]:
            torques = self.torques(motion, t, *motion.at(t)).T
            return [
                motor_arrow(robot, joint, torque, frame_pose) for joint, torque in zip(motors, torques, strict=True)
            ]

        return arrows


def film_of_motion(
    motion: Motion,
    robot: Robot | Scene | Mechanism,
    *,
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
    progress: Progress = None,
    actuators: Mapping[str, Actuator] | None = None,
) -> Film:
    """The film of a robot's motion with the torques (N m or N) that it requires, under the forces of a scene, if given.
    With `actuators` by joint the plots of torque over speed are those of their motors.

    Raises InputError for an unknown frame to trace, and for a motion of another robot.
    """
    mechanism = mechanism_of(robot)
    robot, motion = mechanism.robot, with_force_rows(mechanism, mechanism.along(motion)[0])
    facts = [("lasts", f"{motion.duration:.6g} s"), *(("warning", text) for text in robot.inertia_warnings)]
    if title is not None:
        facts.append(("motion", f"{robot.name}: {motion.name}"))
    sequence = MotionSequence(mechanism=mechanism, motions=[motion], actuators=actuators or {})
    film = film_of_motions(sequence, title or f"{robot.name}: {motion.name}", trace, detail, progress)
    warnings = (*motion.warnings, *mechanism_notes(mechanism), *motion_notes(mechanism, motion))
    return replace(film, facts=(*facts, *film.facts), notes=(*film.notes, *warnings))


def film_of_motions(
    sequence: MotionSequence, title: str, trace: Iterable[str], detail: Detail, progress: Progress
) -> Film:
    """The film of motions one after the other; its only fact is the version of bellcrank. Raises InputError."""
    mechanism, motions, shifts = sequence.mechanism, sequence.motions, sequence.shifts
    robot, scene = mechanism.robot, mechanism.scene
    traced = traced_frames(robot, trace)
    bodies, notes = film_bodies(robot, detail)
    bodies += sequence.more_bodies
    trajectories = motion_trajectories(sequence, (*(body.name for body in bodies), *traced))
    series = _series(sequence)
    parts: list[SampledFrames] = []
    for k, motion in enumerate(motions):
        trajectory = trajectories[k].with_rows(series[k].time)

        def report(share: float, k: int = k) -> None:
            if progress is not None:
                progress((k + share) / len(motions))

        origins = frame_origins(trajectory, traced)
        parts.append(sample_frames(trajectory, bodies, origins, (), report, sequence.arrows(motion)))
    time = np.concatenate([part.time + shift for part, shift in zip(parts, shifts, strict=True)])
    once = np.append(np.diff(time) > 0.0, True)  # the later of the two sides of a jump, whose positions are equal
    arrows = _joined_arrows(parts, shifts)
    springs, rods = _springs_and_rods(scene, parts)
    view = _camera_scene(
        parts, arrows, [*(s.ends.reshape(-1, 3) for s in springs), *(r.ends.reshape(-1, 3) for r in rods)]
    )
    series_time = join_times([each.time + shift for each, shift in zip(series, shifts, strict=True)])
    error = max(each.error for each in series)
    groups = [join_with_gaps(tables) for tables in zip(*(each.groups for each in series), strict=True)]
    begins = [
        TimelineEvent(start, f"motion {motion.name} begins")
        for motion, start in zip(motions, sequence.starts, strict=True)
    ]
    return Film(
        title=title,
        time=time[once],
        poses=view.poses[once],
        bodies=bodies,
        camera=choose_camera(view),
        error_bound=max(part.error_bound for part in parts),
        ground=choose_ground([], view, not robot.floating_base),
        traces=_joined_traces(parts, shifts),
        arrows=arrows,
        springs=tuple(FilmSpring(s.name, s.ends[once]) for s in springs),
        rods=tuple(Rod(r.name, r.ends[once]) for r in rods),
        axes=film_axes(robot, bodies, _sprung_joints(scene)),
        events=tuple(begins if len(motions) > 1 else ()),
        charts=_charts(mechanism, error, series_time, groups[:4]),
        xy_plots=torque_speed_plots(mechanism, sequence.actuators, error, series_time, *groups[4:]),
        facts=(("bellcrank", version()),),
        notes=notes,
    )


def motion_trajectories(sequence: MotionSequence, frames: Iterable[str]) -> list[SampledTrajectory]:
    """The motions with these frames and those of the scene's elements. Raises InputError for other joints."""
    robot, scene = sequence.mechanism.robot, sequence.mechanism.scene
    names = tuple(dict.fromkeys([*frames, *(() if scene is None else element_frames(scene))]))
    pose_function = frame_pose_function(robot, names, None if scene is None else scene.parameters)
    parameters = np.zeros(0) if scene is None else scene.parameter_values
    found = []
    for motion in sequence.motions:
        require_joints(motion, robot)
        rows = np.append(np.diff(motion.time) > 0.0, True)  # the later of two rows of one time: positions are equal
        found.append(
            SampledTrajectory(
                robot=robot,
                time=motion.time[rows],
                position=motion.position[rows],
                velocity=motion.velocity[rows],
                interpolate=partial(_position_and_velocity, motion),
                frames=names,
                pose_function=pose_function,
                parameters=parameters,
            )
        )
    return found


def _position_and_velocity(motion: Motion, times: Array) -> tuple[Array, Array]:
    return motion.at(times)[:2]


def _series(sequence: MotionSequence) -> list[MotionSeries]:
    timed = sequence.mechanism.equations.scene  # its tables are evaluated at the times of the motion
    jumps = np.zeros(0) if timed is None else signal_jumps(timed, timed.signals)
    return motion_series(sequence.motions, [partial(sequence.efforts, motion) for motion in sequence.motions], jumps)


def _camera_scene(parts: Sequence[SampledFrames], arrows: Sequence[Arrow], points: Sequence[Array]) -> CameraScene:
    """What the camera must see of all motions; arrows and points are those of all motions."""
    scenes = [camera_scene(part, arrows if k == 0 else (), points if k == 0 else ()) for k, part in enumerate(parts)]
    return replace(
        scenes[0],
        points=np.concatenate([each.points for each in scenes]),
        poses=np.concatenate([each.poses for each in scenes]),
    )


def _springs_and_rods(scene: Scene | None, parts: Sequence[SampledFrames]) -> tuple[list[FilmSpring], list[Rod]]:
    """The springs and rods of a scene, at the frames of all motions one after the other."""
    if scene is None:
        return [], []
    frames = [
        SceneFrames(scene=scene, parameters=scene.parameter_values, state=part.position, frame_pose=part.frame_pose)
        for part in parts
    ]
    springs = [
        FilmSpring(each[0].name, np.concatenate([spring.ends for spring in each]))
        for each in zip(*map(scene_springs, frames), strict=True)
    ]
    rods = [
        Rod(each[0].name, np.concatenate([rod.ends for rod in each]))
        for each in zip(*map(scene_rods, frames), strict=True)
    ]
    return springs, rods


def _sprung_joints(scene: Scene | None) -> set[str]:
    """The joints that have a spring."""
    forces = () if scene is None else scene.forces
    return {force.joint.name for force in forces if isinstance(force, JointSpring)}


def _joined_traces(parts: Sequence[SampledFrames], shifts: Sequence[float]) -> tuple[Trace, ...]:
    names = dict.fromkeys(trace.name for part in parts for trace in part.traces)
    found = []
    for name in names:
        own = [(t, shift) for part, shift in zip(parts, shifts, strict=True) for t in part.traces if t.name == name]
        time = join_times([trace.time + shift for trace, shift in own])
        found.append(Trace(name, time, join_with_gaps([trace.points for trace, _ in own])))
    return tuple(found)


def _joined_arrows(parts: Sequence[SampledFrames], shifts: Sequence[float]) -> tuple[Arrow, ...]:
    names = dict.fromkeys(arrow.name for part in parts for arrow in part.arrows)
    found = []
    for name in names:
        own = [(a, shift) for part, shift in zip(parts, shifts, strict=True) for a in part.arrows if a.name == name]
        found.append(join_arrows([arrow for arrow, _ in own], [shift for _, shift in own]))
    return tuple(found)


def _charts(mechanism: Mechanism, error: float, time: Array, groups: Sequence[Array]) -> tuple[Chart, ...]:
    """Charts of positions, velocities, accelerations and torques over times (n,) s of the film."""
    joints = mechanism.robot.joints
    q, v, a, torque = groups
    panels = by_unit("joint torque", [(joint.name, torque_unit(joint.kind)) for joint in mechanism.motors], torque)
    panels += by_unit("position", position_labels(joints), q)
    panels += by_unit("velocity", velocity_labels(joints), v)
    panels += by_unit("acceleration", velocity_labels(joints, 2), a)
    for panel in panels:
        panel.time, panel.off = time, error
    return tuple(panel_chart(panel) for panel in titled_apart(panels))
