"""Motions, and the sizing of motors over them, as a film: one motion after the other, with the torques it takes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank import __version__
from bellcrank.constraints.mechanism import Mechanism, mechanism_of
from bellcrank.errors import InputError
from bellcrank.motion.coordinates import position_labels, velocity_labels
from bellcrank.replays.arrows import motor_arrow
from bellcrank.replays.camera import camera_for, ground_for
from bellcrank.replays.charts import chart, joined, joined_times
from bellcrank.replays.course import Course, placing
from bellcrank.replays.film import Arrow, Chart, Film, Mark, Trace
from bellcrank.replays.footage import Footage, footage
from bellcrank.replays.limits import exceeded_peaks, torque_speed_planes
from bellcrank.replays.meshes import Detail
from bellcrank.replays.rms_points import with_rms_points
from bellcrank.replays.subject import film_axes, filmed_bodies, frame_points, scenery, traced_frames
from bellcrank.simulation.run_csv import torque_unit
from bellcrank.simulation.run_panels import by_unit, titled_apart
from bellcrank.sizing.history import joint_torques
from bellcrank.sizing.plots import drawn_states
from bellcrank.sizing.table import verdict

if TYPE_CHECKING:
    from bellcrank.machine_code.compile import Compiled
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import Robot
    from bellcrank.sizing.drive import Drive
    from bellcrank.sizing.result import JointSizing, Sizing

Array = NDArray[np.float64]
Progress = Callable[[float], None] | None
GAP = 1e-3  # s between a motion and the next: less than a screen shows


def film_of_motion(
    motion: Motion,
    robot: Robot,
    *,
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
    progress: Progress = None,
) -> Film:
    """The film of a robot's motion, with the torques (N m or N) that it takes. Raises InputError for an unknown frame
    to trace, and for a motion of another robot.
    """
    facts = [("lasts", f"{motion.duration:.6g} s"), *(("warning", text) for text in robot.inertia_warnings)]
    if title is not None:
        facts.append(("motion", f"{robot.name}: {motion.name}"))
    return _film(
        mechanism_of(robot),
        [motion],
        {},
        trace,
        detail,
        title or f"{robot.name}: {motion.name}",
        facts,
        motion.warnings,
        progress,
    )


def film_of_sizing(
    sizing: Sizing,
    *,
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
    progress: Progress = None,
) -> Film:
    """The film of a sizing: its motions one after the other, torques, torque-speed planes with the motors' limits, and
    marks where a limit is exceeded. Raises InputError for an unknown frame, and a sizing without its motions.
    """
    if sizing.study is None:
        raise InputError(f"sizing of {sizing.robot}: it does not hold its motions; make it with bellcrank.size")
    mechanism, motions, drives = sizing.study
    starts = _starts(motions)
    begins = {motion.name: start - float(motion.time[0]) for motion, start in zip(motions, starts, strict=True)}
    marks = [
        Mark(begins[peak.motion] + peak.time, text) for joint in sizing.joints for peak, text in exceeded_peaks(joint)
    ]
    facts = sizing_facts(sizing)
    facts += [("motions", ", ".join(sizing.motions)), *((joint.name, _needs(joint)) for joint in sizing.joints)]
    name = title or f"{sizing.robot}: sizing"
    if sizing.robot not in name:
        facts.append(("robot", sizing.robot))
    told = {text for _, text in facts}
    warnings = [text for text in sizing.warnings if text not in told]
    film = _film(mechanism, motions, drives, trace, detail, name, facts, warnings, progress, marks, sizing.inside)
    return replace(film, planes=with_rms_points(film.planes, sizing.joints))


def sizing_facts(sizing: Sizing) -> list[tuple[str, str]]:
    """The answer of a sizing with the count of all that speaks against it; then each of these, errors and warnings."""
    against = [
        *(("cannot be sized", text) for text in sizing.unsizable),
        *(("exceeded", text) for text in sizing.exceeded),
    ]
    if len(against) > 1:
        counts = [
            (len(sizing.unsizable), "joint cannot be sized", "joints cannot be sized"),
            (len(sizing.exceeded), "limit exceeded", "limits exceeded"),
        ]
        answer = ", ".join(f"{count} {one if count == 1 else many}" for count, one, many in counts if count)
        facts = [("verdict", f"{answer}; the first: {against[0][1]}"), *against[1:]]
    elif against:
        facts = [("verdict", f"{against[0][0]}: {against[0][1]}")]
    else:
        facts = [("verdict", verdict(sizing).partition("\n")[0])]
    facts += [("error", text) for text in sizing.urdf_errors]
    warnings = () if sizing.study is None else sizing.study[0].robot.inertia_warnings
    return facts + [("warning", text) for text in warnings]


def _needs(joint: JointSizing) -> str:
    text = f"peak {joint.peak_torque:.4g} {joint.torque_unit}, RMS {joint.rms_torque:.4g} {joint.torque_unit}"
    return text if joint.shaft is None else f"{text}; motor {joint.shaft.verdict}"


def _film(
    mechanism: Mechanism,
    motions: Sequence[Motion],
    drives: Mapping[str, Drive],
    trace: Iterable[str],
    detail: Detail,
    title: str,
    facts: Sequence[tuple[str, str]],
    warnings: Sequence[str],
    progress: Progress,
    marks: Sequence[Mark] = (),
    good: bool = True,
) -> Film:
    robot = mechanism.robot
    wanted = traced_frames(robot, trace)
    bodies, notes = filmed_bodies(robot, detail)
    frames = tuple(dict.fromkeys([*(body.name for body in bodies), *wanted]))
    code = placing(robot, frames)
    starts = _starts(motions)
    shots: list[Footage] = []
    for k, motion in enumerate(motions):
        course = _course(robot, motion, frames, code)

        def heard(share: float, k: int = k) -> None:
            if progress is not None:
                progress((k + share) / len(motions))

        shots.append(footage(course, bodies, frame_points(course, wanted), progress=heard))
    shifts = [start - float(motion.time[0]) for motion, start in zip(motions, starts, strict=True)]
    time = np.concatenate([shot.time + shift for shot, shift in zip(shots, shifts, strict=True)])
    arrows = _arrows(mechanism, motions, drives, shots)
    views = [scenery(shot, arrows if k == 0 else ()) for k, shot in enumerate(shots)]  # arrows are of all motions
    view = views[0]._replace(
        points=np.concatenate([each.points for each in views]), poses=np.concatenate([each.poses for each in views])
    )
    begun = [Mark(start, f"motion {m.name} begins") for m, start in zip(motions, starts, strict=True)]
    return Film(
        title, time, view.poses, bodies, camera_for(view), max(shot.bound for shot in shots),
        ground_for([], view, not robot.floating_base), _joined_traces(shots, shifts),
        arrows, (), film_axes(robot, bodies),
        tuple(sorted([*(begun if len(motions) > 1 else ()), *marks], key=lambda mark: mark.time)),
        _charts(mechanism, motions, drives, shifts), torque_speed_planes(mechanism, motions, drives, shifts),
        (*facts, ("bellcrank", __version__)), good, (*notes, *warnings),
    )  # fmt: skip


def _starts(motions: Sequence[Motion]) -> list[float]:
    """When each motion begins in the film, s."""
    lengths = [motion.duration + GAP for motion in motions]
    return [float(motions[0].time[0]) * (len(motions) == 1) + sum(lengths[:k]) for k in range(len(motions))]


def _course(robot: Robot, motion: Motion, frames: tuple[str, ...], code: Compiled) -> Course:
    layout = [(joint.name, joint.q, joint.v) for joint in robot.joints]
    if [(joint.name, joint.q, joint.v) for joint in motion.joints] != layout:
        raise InputError(
            f"motion '{motion.name}' is for the joints {', '.join(motion.joint_names)}, the robot {robot.name} has "
            f"{', '.join(joint.name for joint in robot.joints)}"
        )
    rows = np.append(np.diff(motion.time) > 0.0, True)  # of two rows of one time, which share a position, the later
    return Course(
        robot, motion.time[rows], motion.position[rows], motion.velocity[rows], lambda t: motion.at(t)[:2], frames,
        code, np.zeros(0),
    )  # fmt: skip


def _joined_traces(shots: Sequence[Footage], shifts: Sequence[float]) -> tuple[Trace, ...]:
    names = dict.fromkeys(trace.name for shot in shots for trace in shot.traces)
    found = []
    for name in names:
        mine = [(t, shift) for shot, shift in zip(shots, shifts, strict=True) for t in shot.traces if t.name == name]
        time = joined_times([trace.time + shift for trace, shift in mine])
        found.append(Trace(name, time, joined([trace.points for trace, _ in mine])))
    return tuple(found)


# ---- torques


def _arrows(
    mechanism: Mechanism, motions: Sequence[Motion], drives: Mapping[str, Drive], shots: Sequence[Footage]
) -> tuple[Arrow, ...]:
    robot, joints = mechanism.robot, mechanism.motors
    parts = [
        [
            motor_arrow(robot, joint, torque, shot.placed)
            for joint, torque in zip(
                joints,
                joint_torques(mechanism, joints, drives, shot.time, *motion.at(shot.time)).T,
                strict=True,
            )
        ]
        for motion, shot in zip(motions, shots, strict=True)
    ]
    return tuple(
        Arrow(
            same[0].name, same[0].unit, np.concatenate([arrow.points for arrow in same]),
            np.concatenate([arrow.vectors for arrow in same]), same[0].about,
        )
        for same in zip(*parts, strict=True)
    )  # fmt: skip


def _charts(
    mechanism: Mechanism, motions: Sequence[Motion], drives: Mapping[str, Drive], shifts: Sequence[float]
) -> tuple[Chart, ...]:
    robot, motors = mechanism.robot, mechanism.motors
    rows: list[list[Array]] = [[], [], [], [], []]
    for motion, shift in zip(motions, shifts, strict=True):
        time, q, v, a = drawn_states(motion)
        torque = joint_torques(mechanism, motors, drives, time, q, v, a)
        for column, values in zip(rows, (time + shift, q, v, a, torque), strict=True):
            column.append(values)
    time = joined_times(rows[0])
    q, v, a, torque = (joined(parts) for parts in rows[1:])
    panels = by_unit("joint torque", [(joint.name, torque_unit(joint.kind)) for joint in motors], torque)
    panels += by_unit("position", position_labels(robot.joints), q)
    panels += by_unit("velocity", velocity_labels(robot.joints), v)
    panels += by_unit("acceleration", velocity_labels(robot.joints, 2), a)
    return tuple(chart(panel, time) for panel in titled_apart(panels))
