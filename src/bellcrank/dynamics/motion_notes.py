"""The forces of a scene as sizing sees them: which ones count, what does not, and where they are not smooth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.elements.element import table_span
from bellcrank.elements.expression import has_time
from bellcrank.elements.frame_forces import Spring
from bellcrank.elements.frame_joints import frames_drawn
from bellcrank.elements.joint_forces import Friction, JointForce, Torque
from bellcrank.elements.joint_relations import Drive
from bellcrank.elements.signal_source import SMALL_JUMP

if TYPE_CHECKING:
    from bellcrank.dynamics.mechanism import Mechanism
    from bellcrank.elements.element import Part
    from bellcrank.motion.motion import Motion
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]
SAME_TIME = 1e-12  # s, or of a time beyond 1 s: a row of a motion and one of a table that rounding set apart
ELSEWHERE = 1e-6  # m, or of a quaternion: a start that differs by more from a motion is another
LEAST_APART = 1e-9  # the same, for a row of a motion that a row of a table adds


@dataclass(frozen=True)
class Element:
    """A force of a scene that counts: its name, its kind, and what it acts on, such as "joint 'elbow'"."""

    name: str
    kind: str
    on: str


def elements(mechanism: Mechanism) -> tuple[Element, ...]:
    """The forces of the scene that count, all of them, in its order."""
    return tuple(Element(force.name, force.kind, acts_on(force)) for force in mechanism.equations.forces)


def acts_on(force: Part) -> str:
    """What a force acts on, such as "joint 'elbow'"."""
    if isinstance(force, JointForce):
        return f"joint '{force.joint.name}'"
    if isinstance(force, Spring):
        other = f"frame '{force.frame_b}'" if len(force.frames) == 2 else "the world"
        return f"frame '{force.frame_a}' and {other}"
    return ", ".join(f"frame '{name}'" for name in force.frames)


def parameter_values(mechanism: Mechanism) -> tuple[tuple[str, float, str], ...]:
    """(name, value, unit) of the scene's parameters, all of which count."""
    scene = mechanism.equations.scene
    return () if scene is None else tuple((name, p.value, p.unit) for name, p in scene.parameters.items())


def mechanism_notes(mechanism: Mechanism) -> tuple[str, ...]:
    """A sentence for each torque that acts beside a motor, and for each part of the scene that does not count."""
    found = [
        f"torque '{force.name}' of the scene acts on joint '{force.joint.name}' besides the motor"
        for force in mechanism.equations.forces
        if isinstance(force, Torque)
    ]
    if mechanism.scene is not None:
        found += [
            f"control '{part.name}' of the scene does not count: motors give what the motion and the other forces need"
            for part in mechanism.scene.control
        ]
        found += _clock_notes(mechanism.scene)
    return tuple(found)


def _clock_notes(scene: Scene) -> Iterator[str]:
    """What depends on time where a simulation of the scene starts with another clock than 0."""
    clock = scene.initial.clock
    moving = [f"{force.kind} '{force.name}'" for force in scene.forces if force.source is not None]
    moving += [
        f"constraint '{part.name}'" for part in scene.constraints if not isinstance(part, Drive) and has_time(part)
    ]
    if clock and moving:
        yield (
            f"initial.clock, {clock:.6g} s, does not count: {', '.join(moving)} {'is' if len(moving) == 1 else 'are'} "
            "read at the times of the motions, where a simulation adds the clock; to size its run, add the clock to "
            "the times of its CSV"
        )


def motion_notes(mechanism: Mechanism, motion: Motion) -> Iterator[str]:
    """A sentence for each table that does not cover a motion, and for a frame's path if parameters change lengths."""
    moved = [] if mechanism.closed or mechanism.scene is None else changed_lengths(mechanism.scene)
    if moved and _follows_frame(mechanism, motion.name):
        yield path_note(motion.name, moved)
    begin, end = float(motion.time[0]), float(motion.time[-1])
    if mechanism.scene is not None:
        yield from _base_notes(mechanism.scene, motion)
        yield from _drive_notes(mechanism.scene, motion)
    for force in mechanism.equations.forces:
        if force.source is None:
            continue
        first, last = table_span(force)
        who = f"{force.kind} '{force.name}': its table"
        if last < end:
            yield (
                f"{who} ends at {last:.6g} s and motion '{motion.name}' at {end:.6g} s; in between the last value is "
                "held"
            )
        if first > begin:
            yield (
                f"{who} begins at {first:.6g} s and motion '{motion.name}' at {begin:.6g} s; in between the first "
                "value is held"
            )


def _base_notes(scene: Scene, motion: Motion) -> Iterator[str]:
    """Free joints, a base among them, that a motion has elsewhere than the scene's start puts them."""
    posture = scene.initial.posture(scene.robot)
    for name in scene.initial.free:
        joint = scene.robot.joint(name)
        first, wanted = (q[joint.q : joint.q + joint.nq] for q in (motion.position[0], posture))
        turned = np.append(wanted[:3], -wanted[3:])  # the same rotation, where there is a quaternion
        if min(np.abs(first - wanted).max(), np.abs(first - turned).max() if joint.nq == 7 else np.inf) > ELSEWHERE:
            yield (
                f"motion '{motion.name}' has joint '{name}' elsewhere than the scene's start (initial, base) puts it; "
                "the motion counts, also for the direction of gravity"
            )


def _drive_notes(scene: Scene, motion: Motion) -> Iterator[str]:
    """Drives of the scene that have their joints follow another motion."""
    for constraint in scene.constraints:
        if isinstance(constraint, Drive) and (follows := str(constraint.place.raw("motion"))) != motion.name:
            yield (
                f"drive '{constraint.name}' of the scene follows motion '{follows}'; here motion '{motion.name}' counts "
                "for its joint"
            )


def path_note(name: str, moved: Sequence[str]) -> str:
    """What is said of a motion that was made from a frame's path by other lengths than those of the parameters."""
    return (
        f"motion '{name}' was made from a frame's path with the lengths of the URDF, which the parameters "
        f"{', '.join(moved)} change: the frame's path is another; write the motion in joint positions"
    )


def changed_lengths(scene: Scene) -> list[str]:
    """The parameters that give a joint or frame another place than the URDF or the configuration."""
    frames = scene.robot.equations.tree.frames
    found = []
    for name, parameter in scene.parameters.items():
        for frame, what in parameter.places:
            if what < 6:
                now = [*frames[frame].in_parent.translation, *frames[frame].rpy][what]
                if abs(parameter.value - now) > 1e-9 * max(1.0, abs(now)) and name not in found:
                    found.append(name)
    return found


def _follows_frame(mechanism: Mechanism, name: str) -> bool:
    """Whether a motion of the scene is made from the path of a frame, wholly or in part."""
    entries = {} if mechanism.scene is None else mechanism.scene.config.motions
    return name in entries and any(frames_drawn(entries[name], entries))


def force_breaks(mechanism: Mechanism) -> Array:
    """Times (m,) s at which a table of the scene has a row: its value or a derivative may jump there."""
    sources = [force.source for force in mechanism.equations.forces if force.source is not None]
    return np.unique(np.concatenate([np.zeros(0), *[source.signal.breaks for source in sources]]))


def with_force_rows(mechanism: Mechanism, motion: Motion) -> Motion:
    """The same motion with rows where tables of the scene have theirs, two of them, before and after, where one jumps.

    What is written or drawn of it at its rows then shows what such forces do. A row that only rounding sets apart from
    a table's has the table's time, so that jumps of both are one.
    """
    breaks = force_breaks(mechanism)
    motion = _at_table_times(motion, breaks)
    breaks = breaks[(breaks > motion.time[0]) & (breaks < motion.time[-1])]
    row = np.searchsorted(motion.time, breaks)
    near = np.where(
        breaks - motion.time[np.maximum(row - 1, 0)] < motion.time[row] - breaks, np.maximum(row - 1, 0), row
    )
    apart = np.abs(motion.time[near] - breaks) / np.maximum(1.0, breaks)
    there, jumps = apart <= SAME_TIME, _jumps(mechanism, breaks)
    rows = np.unique(near[there & jumps])  # that are to stand twice
    rows = rows[(rows > 0) & (rows < len(motion) - 1) & ~np.isin(motion.time[rows], _twins(motion))]
    new = apart > LEAST_APART
    added = np.concatenate([motion.time[rows], breaks[new], breaks[new & jumps]])
    if not len(added):
        return motion
    added = np.sort(added)
    at = np.searchsorted(motion.time, added, side="right")
    time = np.insert(motion.time, at, added)
    states = zip((motion.position, motion.velocity, motion.acceleration), motion.at(added), strict=True)
    q, v, a = (np.insert(old, at, more, axis=0) for old, more in states)
    return replace(motion, time=time, position=q, velocity=v, acceleration=a)


def _at_table_times(motion: Motion, breaks: Array) -> Motion:
    """The motion with the times of its rows those of breaks (s) from which rounding alone sets them apart."""
    if not len(breaks):
        return motion
    after = np.clip(np.searchsorted(breaks, motion.time), 1, len(breaks) - 1)
    low, high = breaks[after - 1], breaks[after]
    nearest = np.where(motion.time - low < high - motion.time, low, high)
    apart = np.abs(nearest - motion.time)
    time = np.where(apart <= SAME_TIME * np.maximum(1.0, np.abs(motion.time)), nearest, motion.time)
    return motion if np.array_equal(time, motion.time) else replace(motion, time=time)


def _twins(motion: Motion) -> Array:
    """The times that stand twice."""
    return np.asarray(motion.time[1:][np.diff(motion.time) == 0.0])


def _jumps(mechanism: Mechanism, times: Array) -> NDArray[np.bool_]:
    """Whether a table jumps at each of these times."""
    found = np.zeros(len(times), dtype=bool)
    for force in mechanism.equations.forces:
        if force.source is not None:
            signal = force.source.signal
            before, after = signal.at(np.nextafter(times, -np.inf)), signal.at(times)
            scale = np.abs(signal.at(signal.breaks)).max(initial=0.0)
            found |= (np.abs(after - before) > SMALL_JUMP * scale).any(axis=1)
    return found


def coulomb_widths(mechanism: Mechanism) -> list[tuple[int, float]]:
    """(velocity coordinate, width in rad/s or m/s) of every Coulomb friction, the robot's and the scene's."""
    robot = mechanism.robot
    found = [(int(column), robot.friction_width) for column in np.flatnonzero(robot.coulomb > 0.0)]
    set_by = {target: value for name, value, _ in parameter_values(mechanism) for target in _targets(mechanism, name)}
    for force in mechanism.equations.forces:
        if isinstance(force, Friction):
            coulomb, width = (
                set_by.get(f"force.{force.name}.{key}", getattr(force, key)) for key in ("coulomb", "width")
            )
            if coulomb > 0.0:
                found.append((force.joint.v, float(width)))
    return found


def _targets(mechanism: Mechanism, name: str) -> tuple[str, ...]:
    scene = mechanism.equations.scene
    assert scene is not None
    return scene.parameters[name].sets
