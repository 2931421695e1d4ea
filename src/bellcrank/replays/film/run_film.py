"""A run as a film: its bodies along its states, traces, forces, events, series and certificate."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.system import system_of
from bellcrank.elements.joint_forces import JointSpring
from bellcrank.elements.rolling import RollingDisk
from bellcrank.errors import InputError
from bellcrank.motion.coordinates import position_labels
from bellcrank.motion.hermite import smooth_between
from bellcrank.replays.film.arrows import (
    Moments,
    PlacedScene,
    contact_points,
    rods_of,
    run_arrows,
    shown_frames,
    springs_of,
)
from bellcrank.replays.film.camera import camera_for, ground_for
from bellcrank.replays.film.charts import run_charts
from bellcrank.replays.film.film import Arrow, Film, Mark
from bellcrank.replays.film.frames import Placed, Point, footage
from bellcrank.replays.film.robot_view import (  # fmt: skip
    film_axes,
    filmed_bodies,
    frame_points,
    named_facts,
    scenery,
    traced_frames,
)
from bellcrank.replays.film.sampled_trajectory import Course, placing
from bellcrank.replays.geometry.meshes import Detail
from bellcrank.scene.outputs import FrameOutput
from bellcrank.simulation.interpolation import with_jumps
from bellcrank.simulation.run_csv import titled
from bellcrank.simulation.summary import event_consequence, run_facts
from bellcrank.version import version

if TYPE_CHECKING:
    from bellcrank.simulation.events import Event
    from bellcrank.simulation.trajectory import Trajectory

Array = NDArray[np.float64]
MOST_TURN = 1.0  # rad between rows: quintics follow even turning to 2e-5 of a body's size then
_FIRST = ("ended", "warning", "note")  # of the facts
MOST_MARKS = 200
FEW = 6  # joints, or multipliers, that a mark tells of


def film_of_run(
    run: Trajectory,
    *,
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Film:
    """The film of a run: traces are of the frames in `trace`, or else of those that the scene's outputs follow, or the
    robot's tip; and of rolling contacts.

    Raises InputError for an unknown frame, and where the run's first state is not finite or its times do not increase.
    """
    scene, robot = run.scene, run.robot
    notes: list[str] = []
    rows = _finite_rows(run)
    if rows < len(run):
        notes.append(f"from {run.time[rows]:.6g} s on the run is not finite numbers: it is shown until then")
    bodies, more = filmed_bodies(robot, detail)
    wanted = traced_frames(robot, trace, _output_frames(run))
    frames = tuple(dict.fromkeys([*(body.name for body in bodies), *shown_frames(scene), *wanted]))
    charts, shown = run_charts(run)
    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        finite = with_jumps(run if rows == len(run) else replace(run, time=run.time[:rows], state=run.state[:rows]))
        time, q, v = finite.time, finite.position, finite.velocity
        a = np.concatenate([part.acceleration for part in finite.parts()])
        between = smooth_between(robot.joints, time, q, v, a)
    course = Course(
        robot, time, q, v, between, frames, placing(robot, frames, scene.parameters),
        run.parameters[: len(scene.parameters)],
    )  # fmt: skip
    notes += _coarse(course)
    course = course.with_rows(shown[shown <= time[-1]])
    events = [event for event in run.events if time[0] <= event.time <= time[-1]]
    disks = [constraint for constraint in scene.constraints if isinstance(constraint, RollingDisk)]
    points = frame_points(course, wanted)
    for disk in disks:
        points[f"{disk.name} contact"] = _contact_of(run, course, disk)

    def forces(t: Array, q: Array, v: Array, placed: Placed) -> Iterable[Arrow]:
        return run_arrows(_moments(run, t, q, v, placed))

    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        shots = footage(course, bodies, points, [event.time for event in events], progress, forces)
        moments = _moments(run, shots.time, shots.position, shots.velocity, shots.placed)
        springs, rods = tuple(springs_of(moments)), tuple(rods_of(moments))
        facts = [("ended", run.message.removeprefix(f"{scene.name}: ")), *named_facts(run_facts(run))]
    facts.sort(key=lambda fact: _FIRST.index(fact[0]) if fact[0] in _FIRST else len(_FIRST))
    ends = [*(spring.ends for spring in springs), *(rod.ends for rod in rods)]
    view = scenery(shots, shots.arrows, [each.reshape(-1, 3) for each in ends])
    planes = [(np.array(disk.normal), moments.number(disk, "height")) for disk in disks]
    return Film(
        title or scene.name, shots.time, shots.poses, bodies, camera_for(view), shots.bound,
        ground_for(planes, view, not robot.floating_base), shots.traces, shots.arrows, springs,
        film_axes(robot, bodies, {f.joint.name for f in scene.forces if isinstance(f, JointSpring)}),
        _marks(run, events, float(time[-1])), charts, (), (*facts, ("bellcrank", version())),
        run.success and not run.non_finite,
        rods, (*more, *notes),
    )  # fmt: skip


def _moments(run: Trajectory, time: Array, q: Array, v: Array, placed: Placed) -> Moments:
    state = np.zeros((len(time), system_of(run.scene).size))
    state[:, : run.robot.nq], state[:, run.robot.nq : run.robot.nq + run.robot.nv] = q, v
    return Moments(run.scene, run.parameters, state, placed, run, time)


def _finite_rows(run: Trajectory) -> int:
    """How many rows there are before the first that is not finite; InputError for none, or times that go back."""
    good = np.isfinite(run.state).all(axis=1) & np.isfinite(run.time)
    rows = len(good) if good.all() else int(good.argmin())
    if not rows:
        raise InputError(f"{run.scene.name}: the run's first state is not finite numbers; simulate it again")
    if np.any(np.diff(run.time[:rows]) <= 0.0):
        raise InputError(f"{run.scene.name}: the times of the run do not increase; sort its rows")
    return rows


def _coarse(course: Course) -> list[str]:
    """That something turns so far from row to row that the motion between them is a guess."""
    h = np.diff(course.time)
    turns: dict[str, float] = {}
    for joint in course.robot.joints:
        if joint.kind != "prismatic" and len(h):
            first = joint.v + {"floating": 3, "planar": 2}.get(joint.kind, 0)
            speed = np.linalg.norm(course.velocity[:, first : joint.v + joint.nv], axis=1)
            turns[joint.name] = float((h * np.maximum(speed[:-1], speed[1:])).max())
    name = max(turns, key=lambda name: turns[name], default="")
    if turns.get(name, 0.0) <= MOST_TURN:
        return []
    return [
        f"joint '{name}' turns by up to {turns[name]:.3g} rad from row to row, so that what is shown between rows is a "
        "guess; simulate with more samples"
    ]


def _output_frames(run: Trajectory) -> tuple[str, ...]:
    quantities = [output.quantity for output in run.scene.outputs.values()]
    shown = [q.frame for q in quantities if isinstance(q, FrameOutput) and q.what == "position"]
    return tuple(dict.fromkeys(shown))


def _contact_of(run: Trajectory, course: Course, disk: RollingDisk) -> Point:
    k = course.index[disk.frame]

    def point(points: Array, turns: Array) -> Array:
        return contact_points(
            PlacedScene(run.scene, run.parameters, np.zeros(0), lambda name: (points[:, k], turns[:, k])), disk
        )

    return point


def _marks(run: Trajectory, events: Sequence[Event], end: float) -> tuple[Mark, ...]:
    marks = [Mark(event.time, _event_text(run, event)) for event in events[:MOST_MARKS]]
    if not run.success:
        marks.append(Mark(end, f"{run.status}: {run.reason}"))
    return tuple(marks)


def _event_text(run: Trajectory, event: Event) -> str:
    """An event with its consequence, the joints and the closures' forces there, where they are few."""
    parts = [f"{event.name}{event_consequence(event)}"]
    parts.append(_values(position_labels(run.robot.joints), event.position))
    names = [titled(f"{owner} {label}") for owner, label in system_of(run.scene).multiplier_names]
    parts.append(_values(names, event.multipliers))
    return "; ".join(part for part in parts if part)


def _values(labels: Sequence[tuple[str, str]], values: Array) -> str:
    if not 0 < len(labels) <= FEW or len(labels) != len(values):
        return ""
    return ", ".join(
        f"{name.removesuffix(' position')} {np.degrees(value):.2f}°" if unit == "rad" else f"{name} {value:.6g} {unit}"
        for (name, unit), value in zip(labels, values.tolist(), strict=True)
    )
