"""Motions, and the sizing of motors over them, as a film: one motion after the other, with the torques it takes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.element_forces import mechanism_notes, motion_notes, with_force_rows
from bellcrank.dynamics.mechanism import Mechanism, mechanism_of
from bellcrank.elements.joint_forces import JointSpring
from bellcrank.errors import InputError
from bellcrank.motion.coordinates import position_labels, velocity_labels
from bellcrank.replays.film.arrows import PlacedScene, motor_arrow, rods_of, shown_frames, springs_of
from bellcrank.replays.film.camera import camera_for, ground_for
from bellcrank.replays.film.charts import chart, joined, joined_times
from bellcrank.replays.film.film import Arrow, Chart, Film, Mark, Rod, Spring, Trace
from bellcrank.replays.film.frames import Footage, Forces, Placed, footage, joined_arrows
from bellcrank.replays.film.motion_series import motion_series
from bellcrank.replays.film.motor_limits import exceeded_peaks, motor_state, torque_speed_planes
from bellcrank.replays.film.rms_points import with_rms_points
from bellcrank.replays.film.robot_view import film_axes, filmed_bodies, frame_points, scenery, traced_frames
from bellcrank.replays.film.sampled_trajectory import Course, placing
from bellcrank.replays.geometry.meshes import Detail
from bellcrank.simulation.interpolation import signal_jumps
from bellcrank.simulation.plot_panels import by_unit, titled_apart
from bellcrank.simulation.run_csv import torque_unit
from bellcrank.sizing.history import joint_torques
from bellcrank.sizing.table import verdict
from bellcrank.version import version

if TYPE_CHECKING:
    from bellcrank.actuators.actuator import Drive
    from bellcrank.codegen.compile import Compiled
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene
    from bellcrank.sizing.result import JointSizing, Sizing

Array = NDArray[np.float64]
Progress = Callable[[float], None] | None
GAP = 1e-3  # s between a motion and the next: less than a screen shows


def film_of_motion(
    motion: Motion,
    robot: Robot | Scene,
    *,
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
    progress: Progress = None,
) -> Film:
    """The film of a robot's motion, with the torques (N m or N) that it takes, under the forces of a scene where one is
    given. Raises InputError for an unknown frame to trace, and for a motion of another robot.
    """
    mechanism = mechanism_of(robot)
    robot, motion = mechanism.robot, with_force_rows(mechanism, mechanism.along(motion)[0])
    facts = [("lasts", f"{motion.duration:.6g} s"), *(("warning", text) for text in robot.inertia_warnings)]
    if title is not None:
        facts.append(("motion", f"{robot.name}: {motion.name}"))
    return _film(
        mechanism,
        [motion],
        {},
        trace,
        detail,
        title or f"{robot.name}: {motion.name}",
        facts,
        (*motion.warnings, *mechanism_notes(mechanism), *motion_notes(mechanism, motion)),
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
    scene = mechanism.scene
    acted = () if scene is None else shown_frames(scene)
    frames = tuple(dict.fromkeys([*(body.name for body in bodies), *acted, *wanted]))
    code = placing(robot, frames) if scene is None else placing(robot, frames, scene.parameters)
    lengths = np.zeros(0) if scene is None else scene.parameter_values
    starts = _starts(motions)
    motors = mechanism.motors

    def efforts(motion: Motion, t: Array, q: Array, v: Array, a: Array) -> list[Array]:
        torques = joint_torques(mechanism, motors, drives, t, q, v, a, float(motion.time[-1]))
        shafts = [
            motor_state(joint, drives.get(joint.name), torque, v, a)
            for joint, torque in zip(motors, torques.T, strict=True)
        ]
        return [
            torques,
            *(np.stack(each, axis=1) for each in zip(*shafts, strict=True)),
        ]

    def forces_of(motion: Motion) -> Forces:
        def forces(t: Array, _q: Array, _v: Array, placed: Placed) -> list[Arrow]:
            torques = joint_torques(mechanism, motors, drives, t, *motion.at(t), float(motion.time[-1]))
            return [motor_arrow(robot, joint, torque, placed) for joint, torque in zip(motors, torques.T, strict=True)]

        return forces

    courses = [_course(robot, motion, frames, code, lengths) for motion in motions]
    timed = mechanism.equations.scene  # its tables are read at the times of the motion
    jumps = np.zeros(0) if timed is None else signal_jumps(timed, timed.signals)
    series = motion_series(motions, [partial(efforts, motion) for motion in motions], jumps)
    shots: list[Footage] = []
    for k, motion in enumerate(motions):
        course = courses[k].with_rows(series[k].time)

        def heard(share: float, k: int = k) -> None:
            if progress is not None:
                progress((k + share) / len(motions))

        shots.append(footage(course, bodies, frame_points(course, wanted), (), heard, forces_of(motion)))
    shifts = [start - float(motion.time[0]) for motion, start in zip(motions, starts, strict=True)]
    time = np.concatenate([shot.time + shift for shot, shift in zip(shots, shifts, strict=True)])
    once = np.append(np.diff(time) > 0.0, True)  # of the two sides of a jump, which share a posture, the later
    arrows = _arrows(shots, shifts)
    springs, rods = _springs_and_rods(scene, shots)
    besides = [ends.reshape(-1, 3) for ends in (*(s.ends for s in springs), *(r.ends for r in rods))]
    views = [  # arrows, springs and rods are of all motions
        scenery(shot, arrows if k == 0 else (), besides if k == 0 else ()) for k, shot in enumerate(shots)
    ]
    view = views[0]._replace(
        points=np.concatenate([each.points for each in views]), poses=np.concatenate([each.poses for each in views])
    )
    during = joined_times([each.time + shift for each, shift in zip(series, shifts, strict=True)])
    off = max(each.off for each in series)
    groups = [joined(parts) for parts in zip(*(each.groups for each in series), strict=True)]
    begun = [Mark(start, f"motion {m.name} begins") for m, start in zip(motions, starts, strict=True)]
    return Film(
        title, time[once], view.poses[once], bodies, camera_for(view), max(shot.bound for shot in shots),
        ground_for([], view, not robot.floating_base), _joined_traces(shots, shifts),
        arrows, tuple(Spring(s.name, s.ends[once]) for s in springs), film_axes(robot, bodies, _sprung(scene)),
        tuple(sorted([*(begun if len(motions) > 1 else ()), *marks], key=lambda mark: mark.time)),
        _charts(mechanism, off, during, *groups[:4]), torque_speed_planes(mechanism, drives, off, during, *groups[4:]),
        (*facts, ("bellcrank", version())), good, tuple(Rod(r.name, r.ends[once]) for r in rods),
        (*notes, *warnings),
    )  # fmt: skip


def _springs_and_rods(scene: Scene | None, shots: Sequence[Footage]) -> tuple[list[Spring], list[Rod]]:
    """The springs and rods of a scene, at the frames of all motions one after the other."""
    if scene is None:
        return [], []
    placed = [PlacedScene(scene, scene.parameter_values, shot.position, shot.placed) for shot in shots]
    springs = [
        Spring(parts[0].name, np.concatenate([part.ends for part in parts]))
        for parts in zip(*map(springs_of, placed), strict=True)
    ]
    rods = [
        Rod(parts[0].name, np.concatenate([part.ends for part in parts]))
        for parts in zip(*map(rods_of, placed), strict=True)
    ]
    return springs, rods


def _sprung(scene: Scene | None) -> set[str]:
    """The joints with a spring of their own."""
    forces = () if scene is None else scene.forces
    return {force.joint.name for force in forces if isinstance(force, JointSpring)}


def _starts(motions: Sequence[Motion]) -> list[float]:
    """When each motion begins in the film, s."""
    lengths = [motion.duration + GAP for motion in motions]
    return [float(motions[0].time[0]) * (len(motions) == 1) + sum(lengths[:k]) for k in range(len(motions))]


def _course(robot: Robot, motion: Motion, frames: tuple[str, ...], code: Compiled, parameters: Array) -> Course:
    layout = [(joint.name, joint.q, joint.v) for joint in robot.joints]
    if [(joint.name, joint.q, joint.v) for joint in motion.joints] != layout:
        raise InputError(
            f"motion '{motion.name}' is for the joints {', '.join(motion.joint_names)}, the robot {robot.name} has "
            f"{', '.join(joint.name for joint in robot.joints)}"
        )
    rows = np.append(np.diff(motion.time) > 0.0, True)  # of two rows of one time, which share a position, the later
    return Course(
        robot, motion.time[rows], motion.position[rows], motion.velocity[rows], lambda t: motion.at(t)[:2], frames,
        code, parameters,
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


def _arrows(shots: Sequence[Footage], shifts: Sequence[float]) -> tuple[Arrow, ...]:
    names = dict.fromkeys(arrow.name for shot in shots for arrow in shot.arrows)
    found = []
    for name in names:
        mine = [(arrow, shift) for shot, shift in zip(shots, shifts, strict=True) for arrow in shot.arrows]
        mine = [(arrow, shift) for arrow, shift in mine if arrow.name == name]
        found.append(joined_arrows([arrow for arrow, _ in mine], [shift for _, shift in mine]))
    return tuple(found)


def _charts(
    mechanism: Mechanism, off: float, time: Array, q: Array, v: Array, a: Array, torque: Array
) -> tuple[Chart, ...]:
    """Charts of positions, velocities, accelerations and torques over times (n,) of the film."""
    robot = mechanism.robot
    panels = by_unit("joint torque", [(joint.name, torque_unit(joint.kind)) for joint in mechanism.motors], torque)
    panels += by_unit("position", position_labels(robot.joints), q)
    panels += by_unit("velocity", velocity_labels(robot.joints), v)
    panels += by_unit("acceleration", velocity_labels(robot.joints, 2), a)
    for panel in panels:
        panel.time, panel.off = time, off
    return tuple(chart(panel) for panel in titled_apart(panels))
