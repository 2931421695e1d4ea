"""The film of a run: bodies, traces, forces, events, charts and the facts of its summary."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.dynamics.equations.system import system_of
from bellcrank.elements.joint_forces import JointSpring
from bellcrank.elements.joint_stops import GearContact
from bellcrank.elements.rolling_constraint import RollingDisk
from bellcrank.errors import InputError
from bellcrank.motion.coordinates import position_labels
from bellcrank.motion.sampled.quintic_splines import smooth_between
from bellcrank.notes import reached
from bellcrank.replays.film.arrows import (
    RunFrames,
    SceneFrames,
    contact_points,
    element_frames,
    run_arrows,
    scene_rods,
    scene_springs,
)
from bellcrank.replays.film.camera import choose_camera, choose_ground
from bellcrank.replays.film.charts import run_charts
from bellcrank.replays.film.film import Arrow, Film, TimelineEvent
from bellcrank.replays.film.film_samples import FramePose, PointFunction, sample_frames
from bellcrank.replays.film.live_film import settled
from bellcrank.replays.film.live_run_film import live_run_film
from bellcrank.replays.film.robot_view import (
    camera_scene,
    film_axes,
    film_bodies,
    frame_origins,
    named_facts,
    traced_frames,
)
from bellcrank.replays.film.sampled_trajectory import SampledTrajectory, frame_pose_function
from bellcrank.replays.geometry.meshes import Detail
from bellcrank.robot.model.joints import LENGTHS
from bellcrank.scene.output_quantities import FrameOutput
from bellcrank.simulation.files.run_csv import titled
from bellcrank.simulation.trajectory.events import (
    impacts_at_stops,
    intervals_at_stops,
    saturated_intervals,
    stuck_intervals,
)
from bellcrank.simulation.trajectory.interpolation import with_jumps
from bellcrank.simulation.trajectory.summary import event_consequence, run_facts
from bellcrank.version import version

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory.events import Event
    from bellcrank.simulation.trajectory.trajectory import Trajectory

MOST_TURN = 1.0  # rad between rows: below it quintics are accurate to 2e-5 of a body's size at a constant rate
FIRST_FACTS = ("ended", "not known", "warning", "note")
MOST_EVENTS = 200
MOST_VALUES = 6  # joints, or multipliers, in the text of an event
MOST_DEGREES = 1e6  # rad: larger angles are told in rad


def film_of_run(
    run: Trajectory,
    *,
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
    progress: Callable[[float], None] | None = None,
    live: bool | None = False,
) -> Film:
    """The film of a run; with `live` the page computes it again, None: where it can, and adds less than 400 kB by that.

    Traces are drawn of the frames in `trace`, else of the frames of the scene's outputs, else of the robot's tip; and
    of rolling contacts. Raises InputError for an unknown frame, for a run whose first state is not finite, and for
    times that do not increase.
    """
    scene, robot = run.scene, run.robot
    notes: list[str] = []
    rows = finite_rows(run)
    if rows < len(run):
        notes.append(f"from {run.time[rows]:.6g} s on the run is not finite; it is shown up to there")
    bodies, body_notes = film_bodies(robot, detail)
    traced = traced_frames(robot, trace, output_frames(run))
    frames = tuple(dict.fromkeys([*(body.name for body in bodies), *element_frames(scene), *traced]))
    charts, chart_times = run_charts(run)
    trajectory = run_trajectory(run, rows, frames)
    notes += _turn_notes(trajectory)
    end = float(trajectory.time[-1])
    trajectory = trajectory.with_rows(chart_times[chart_times <= end])
    events = [event for event in run.events if trajectory.time[0] <= event.time <= end]
    disks = [constraint for constraint in scene.constraints if isinstance(constraint, RollingDisk)]
    points = frame_origins(trajectory, traced)
    for disk in disks:
        points[f"{disk.name} contact"] = _contact_point_function(run, trajectory, disk)

    def arrows(t: Array, q: Array, v: Array, frame_pose: FramePose) -> Iterable[Arrow]:
        return run_arrows(_run_frames(run, t, q, v, frame_pose))

    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        sampled = sample_frames(trajectory, bodies, points, [event.time for event in events], progress, arrows)
        run_frames = _run_frames(run, sampled.time, sampled.position, sampled.velocity, sampled.frame_pose)
        springs, rods = tuple(scene_springs(run_frames)), tuple(scene_rods(run_frames))
        ended = run.message.removeprefix(f"{scene.name}: ") + ("; it is not known" if run.not_known else "")
        facts = [("ended", ended), *named_facts(run_facts(run))]
    facts.sort(key=lambda fact: FIRST_FACTS.index(fact[0]) if fact[0] in FIRST_FACTS else len(FIRST_FACTS))
    ends = [*(spring.ends for spring in springs), *(rod.ends for rod in rods)]
    view = camera_scene(sampled, sampled.arrows, [each.reshape(-1, 3) for each in ends])
    planes = [(np.array(disk.normal), run_frames.number(disk, "height")) for disk in disks]
    film = Film(
        title=title or scene.name,
        time=sampled.time,
        poses=sampled.poses,
        bodies=bodies,
        camera=choose_camera(view),
        error_bound=sampled.error_bound,
        ground=choose_ground(planes, view, not robot.floating_base),
        traces=sampled.traces,
        arrows=sampled.arrows,
        springs=springs,
        rods=rods,
        axes=film_axes(robot, bodies, {f.joint.name for f in scene.forces if isinstance(f, JointSpring)}),
        events=_timeline_events(run, events, end),
        charts=charts,
        facts=(*facts, ("bellcrank", version())),
        success=run.success and not run.non_finite and not run.not_known,
        notes=(*body_notes, *notes),
    )
    computed, why = settled("run", live, lambda: live_run_film(run, film))
    return replace(film, notes=(*film.notes, *why), live=computed)


def run_trajectory(run: Trajectory, rows: int, frames: tuple[str, ...]) -> SampledTrajectory:
    """The first rows of a run, with a smooth curve through them between jumps."""
    scene, robot = run.scene, run.robot
    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        finite = with_jumps(run if rows == len(run) else replace(run, time=run.time[:rows], state=run.state[:rows]))
        time, q, v = finite.time, finite.position, finite.velocity
        a = np.concatenate([part.acceleration for part in finite.parts()])
        interpolate = smooth_between(robot.joints, time, q, v, a)
    return SampledTrajectory(
        robot=robot,
        time=time,
        position=q,
        velocity=v,
        interpolate=interpolate,
        frames=frames,
        pose_function=frame_pose_function(robot, frames, scene.parameters),
        parameters=run.parameters[: len(scene.parameters)],
    )


def _run_frames(run: Trajectory, time: Array, q: Array, v: Array, frame_pose: FramePose) -> RunFrames:
    state = np.zeros((len(time), system_of(run.scene).size))
    moving = run.robot.nq + run.robot.nv
    state[:, : run.robot.nq], state[:, run.robot.nq : moving] = q, v
    for k in range(moving, moving + system_of(run.scene).nz):
        state[:, k] = np.interp(time, run.time, run.state[:, k])
    return RunFrames(scene=run.scene, parameters=run.parameters, state=state, frame_pose=frame_pose, run=run, time=time)


def finite_rows(run: Trajectory) -> int:
    """The number of rows before the first that is not finite. InputError if it is 0, or if times do not increase."""
    good = np.isfinite(run.state).all(axis=1) & np.isfinite(run.time)
    rows = len(good) if good.all() else int(good.argmin())
    if not rows:
        raise InputError(f"{run.scene.name}: the run's first state is not finite; simulate it again")
    if np.any(np.diff(run.time[:rows]) <= 0.0):
        raise InputError(f"{run.scene.name}: the times of the run do not increase; sort its rows")
    return rows


def _turn_notes(trajectory: SampledTrajectory) -> list[str]:
    """A note if a joint turns so far from row to row that the motion between them is uncertain."""
    h = np.diff(trajectory.time)
    turns: dict[str, float] = {}
    for joint in trajectory.robot.joints:
        if joint.kind != "prismatic" and len(h):
            first = joint.v + LENGTHS.get(joint.kind, 0)
            speed = np.linalg.norm(trajectory.velocity[:, first : joint.v + joint.nv], axis=1)
            turns[joint.name] = float((h * np.maximum(speed[:-1], speed[1:])).max())
    name = max(turns, key=lambda name: turns[name], default="")
    if turns.get(name, 0.0) <= MOST_TURN:
        return []
    return [
        f"joint '{name}' turns by up to {turns[name]:.3g} rad between rows, so that the motion shown between rows is "
        "uncertain; simulate with more samples"
    ]


def output_frames(run: Trajectory) -> tuple[str, ...]:
    """The frames whose positions are outputs of the scene."""
    quantities = [output.quantity for output in run.scene.outputs.values()]
    return tuple(dict.fromkeys(q.frame for q in quantities if isinstance(q, FrameOutput) and q.what == "position"))


def _contact_point_function(run: Trajectory, trajectory: SampledTrajectory, disk: RollingDisk) -> PointFunction:
    k = trajectory.frame_index[disk.frame]

    def point(points: Array, quaternions: Array) -> Array:
        frames = SceneFrames(
            scene=run.scene,
            parameters=run.parameters,
            state=np.zeros(0),
            frame_pose=lambda name: (points[:, k], quaternions[:, k]),
        )
        return contact_points(frames, disk)

    return point


def _timeline_events(run: Trajectory, events: Sequence[Event], end: float) -> tuple[TimelineEvent, ...]:
    found = [TimelineEvent(event.time, _event_text(run, event)) for event in events[:MOST_EVENTS]]
    found += [TimelineEvent(note.time, note) for note in reached(run.notes) if note.time is not None]
    found += _sticking(run, end)
    if not run.success:
        found.append(TimelineEvent(end, f"{run.status}: {run.reason}"))
    return tuple(sorted(found, key=lambda event: event.time))


def _sticking(run: Trajectory, end: float) -> Iterator[TimelineEvent]:
    """When joints with dry friction stick and begin to slide again, and when others strike, and leave, their stops."""
    for name in run.scene.sticking:
        for begun, over in stuck_intervals(run, name)[:MOST_EVENTS].tolist():
            yield TimelineEvent(begun, f"{name} sticks")
            if over < end:
                yield TimelineEvent(over, f"{name} slides")
    for drive in run.scene.drives:
        what = "torque" if drive.model == "torque" else "voltage"
        for begun, over in saturated_intervals(run, drive)[:MOST_EVENTS].tolist():
            yield TimelineEvent(begun, f"{drive.joint.name} drive: {what} at its limit")
            if over < end:
                yield TimelineEvent(over, f"{drive.joint.name} drive: {what} within its limit")
    for stop in run.scene.contacts:
        name, what = stop.held, "flank" if isinstance(stop, GearContact) else "stop"
        for time, _ in impacts_at_stops(run, name)[:MOST_EVENTS].tolist():
            yield TimelineEvent(time, f"{name} strikes its {what}")
        for _, over in intervals_at_stops(run, name)[:MOST_EVENTS].tolist():
            if over < end:
                yield TimelineEvent(over, f"{name} leaves its {what}")


def _event_text(run: Trajectory, event: Event) -> str:
    """An event with its consequence, and the joints' positions and constraint forces if they are few."""
    parts = [f"{event.name}{event_consequence(event)}"]
    parts.append(_values(position_labels(run.robot.joints), event.position))
    names = [titled(f"{owner} {label}") for owner, label in system_of(run.scene).multiplier_names]
    parts.append(_values(names, event.multipliers))
    return "; ".join(part for part in parts if part)


def _values(labels: Sequence[tuple[str, str]], values: Array) -> str:
    if not 0 < len(labels) <= MOST_VALUES or len(labels) != len(values):
        return ""
    return ", ".join(
        f"{name.removesuffix(' position')} {np.degrees(value):.2f}°"
        if unit == "rad" and abs(value) < MOST_DEGREES
        else f"{name} {value:.6g} {unit}"
        for (name, unit), value in zip(labels, values.tolist(), strict=True)
    )
