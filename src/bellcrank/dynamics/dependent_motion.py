"""Motions of a linkage: which joints a motion of the configuration or a CSV file is given for, and all others following them."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from bellcrank import arguments
from bellcrank.dynamics.constraint_rows import rows_of
from bellcrank.dynamics.consistent_start import consistent_posture
from bellcrank.dynamics.motion_notes import changed_lengths, path_note
from bellcrank.dynamics.closed_inverse_kinematics import FrameFollower
from bellcrank.elements.frame_joints import frames_drawn
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.csv_files import unguarded
from bellcrank.messages import unknown_name
from bellcrank.motion.csv_file import motion_text, read_motion
from bellcrank.motion.entries import CsvEntry, DwellEntry, JoinEntry, WaypointsEntry
from bellcrank.motion.entry import MotionEntry, Posture
from bellcrank.motion.motion import Motion, join
from bellcrank.motion.path_entries import PathEntry
from bellcrank.motion.waypoints import dwell

if TYPE_CHECKING:
    from bellcrank.dynamics.loop_kinematics import Array, Chain
    from bellcrank.robot.robot import Robot, RobotJoint

AGREEMENT = 1e-5  # rad, or of the mechanism's length: what files round off


def guided_motion(
    chain: Chain, motion: Motion | str | Path, independent: Sequence[str] | None = None
) -> tuple[Motion, tuple[str, ...]]:
    """The motion of all joints of a linkage, and the independent joints it was given by. Raises BellcrankError."""
    robot, config = chain.robot, chain.given.config
    given: set[str] | None = None
    if isinstance(motion, Motion):
        whole = motion
    elif not isinstance(motion, (str, Path)):
        arguments.refuse("motion", "a Motion, the name of a motion, or the path of a CSV file", motion)
    elif str(motion) in config.motions:
        entry = config.motions[str(motion)]
        along = _frame_motion(chain, entry, config.motions)
        if along is not None:
            return along, _independent(chain, along, independent)
        given = _given(entry, robot, config.motions)
        if isinstance(entry, CsvEntry):
            whole = read_partial_motion(robot, entry.path, entry.name, entry.text)
        else:
            whole = chain.given.motion(str(motion))
            moved = changed_lengths(chain.given)
            if moved and any(frames_drawn(entry, config.motions)):
                whole = replace(whole, notes=(*whole.notes, path_note(whole.name, moved)))
    elif arguments.path("motion", motion, "a motion's name or the path of a CSV file").suffix or "/" in str(motion):
        text = motion_text(Path(motion))
        whole = read_partial_motion(robot, Path(motion), Path(motion).stem, text)
        given = _columns(robot, text)
    else:
        raise InputError(
            f"{chain.given.source}: {unknown_name('motion', str(motion), config.motions)}, nor a file of that name"
        )
    if len(whole.joints) != len(robot.joints) or whole.nq != robot.nq:
        raise InputError(
            f"motion '{whole.name}' is for the joints {', '.join(whole.joint_names)}, the robot {robot.name} has "
            f"{', '.join(joint.name for joint in robot.joints)}"
        )
    if independent is not None:
        independent = arguments.several("independent", independent, str, "names of joints")
    if independent is None:
        candidates = [joint for joint in robot.joints if joint.nv == 1 and (given is None or joint.name in given)]
        candidates.sort(key=lambda joint: joint not in chain.actuated)
    else:
        candidates = [robot.one_degree_joint(name, f"motion '{whole.name}'") for name in independent]
    joints = chain.independent(candidates, whole.name)
    found = chain.follow(whole, joints)
    if given is not None and independent is None:
        _check_agreement(chain, whole, found, [joint for joint in candidates if joint not in joints])
    return found, tuple(joint.name for joint in joints)


def _frame_motion(
    chain: Chain, entry: MotionEntry, entries: Mapping[str, MotionEntry], previous: Array | None = None
) -> Motion | None:
    """The motion of an entry that draws a frame along a path, or joins such motions to others, from the posture
    `previous` (nq,); None for any other, and where the path leaves freedoms open. Raises BellcrankError.
    """
    if isinstance(entry, JoinEntry):
        if not any(frames_drawn(entry, entries)):
            return None
        motions: list[Motion] = []
        for part in entry.part_entries(entries):
            last = motions[-1].position[-1] if motions else previous
            one = _frame_motion(chain, part, entries, last)
            if one is None:
                one = _part(chain, part, entries, last)
            motions.append(one)
        return join(*motions, name=entry.name)
    if not isinstance(entry, PathEntry):
        return None
    frame = entry.options.frame
    try:
        start = chain.start if previous is None else previous
        if entry.start is not None:
            start = _started(chain, entry.start, start)
        here = chain.robot.frame_pose(frame, start)[0]
        follower = FrameFollower(chain, entry.path(here), start)
        freedoms, prescribed = follower.prescribed()
        if prescribed == freedoms:
            return follower.motion()
        if entry.options.coordinates is not None or not _led_by_joints(chain, frame):
            raise InputError(follower.refusal())
        return None
    except BellcrankError as error:
        raise type(error)(f"{entry.fields.error('', str(error))}") from None


def _led_by_joints(chain: Chain, frame: str) -> bool:
    """Whether the joints that carry a frame can all be chosen at will, so that an open chain's posture will do."""
    names = chain.robot.supporting_joints(frame)
    columns = [joint.v for joint in chain.robot.joints if joint.name in names]
    return chain.are_independent(columns)


def _part(chain: Chain, entry: MotionEntry, entries: Mapping[str, MotionEntry], previous: Array | None) -> Motion:
    """A part of a join that is no path: its joints lead, the others follow from the posture `previous` (nq,)."""
    if isinstance(entry, DwellEntry) and entry.position is None:
        if previous is None:
            raise InputError(f"{entry.fields.error('', 'a dwell that comes first needs a position')}")
        return dwell(chain.robot, previous, entry.duration, name=entry.name)
    given = _given(entry, chain.robot, entries)
    whole = (
        read_partial_motion(chain.robot, entry.path, entry.name, entry.text)
        if isinstance(entry, CsvEntry)
        else entry.build(chain.robot, entries, previous)
    )
    candidates = [joint for joint in chain.robot.joints if joint.nv == 1 and joint.name in given]
    candidates.sort(key=lambda joint: joint not in chain.actuated)
    joints = chain.independent(candidates, whole.name)
    found = chain.follow(whole, joints, previous)
    _check_agreement(chain, whole, found, [joint for joint in candidates if joint not in joints])
    return found


def _started(chain: Chain, posture: Any, near: Array) -> Array:
    """The posture (nq,) on the constraints nearest to `near` with the joints of a start posture where they are given."""
    q = near.copy()
    if isinstance(posture, Mapping):
        for name, value in posture.items():
            q[chain.robot.one_degree_joint(name, "start").q] = value
    else:
        q = chain.robot.posture(posture)
    held = np.zeros(chain.robot.nv, dtype=bool)
    return consistent_posture(chain.scene, q, held)


def _independent(chain: Chain, motion: Motion, names: Sequence[str] | None) -> tuple[str, ...]:
    """Joints that the posture of a motion follows from: those named, else motors first."""
    candidates = [joint for joint in chain.robot.joints if joint.nv == 1]
    candidates.sort(key=lambda joint: joint not in chain.actuated)
    if names is not None:
        candidates = [chain.robot.one_degree_joint(name, f"motion '{motion.name}'") for name in names]
    return tuple(joint.name for joint in chain.independent(candidates, motion.name))


def _check_agreement(chain: Chain, wanted: Motion, found: Motion, joints: Sequence[RobotJoint]) -> None:
    """Refuse a motion that moves more joints than can be chosen, unless the constraints move them so anyway."""
    for joint in joints:
        gap = found.position[:, joint.q] - wanted.position[:, joint.q]
        gap = np.abs(np.remainder(gap + np.pi, 2.0 * np.pi) - np.pi if joint.kind == "revolute" else gap)
        if gap.max() > AGREEMENT * (1.0 if joint.kind == "revolute" else rows_of(chain.scene).length):
            row = int(gap.argmax())
            raise InputError(
                f"motion '{wanted.name}' wants joint '{joint.name}' at {wanted.position[row, joint.q]:.6g} at "
                f"{wanted.time[row]:.6g} s, the constraints put it at {found.position[row, joint.q]:.6g} (rad or m): it "
                "moves more joints, or a frame along more dimensions, than the linkage has freedoms, or is on another "
                "branch; leave that joint out of it"
            )


def _given(entry: MotionEntry, robot: Robot, entries: Mapping[str, MotionEntry]) -> set[str]:
    """The joints that a motion of the configuration is given for: those that it names; on the path of a frame those that carry
    the frame.
    """
    one = {joint.name for joint in robot.joints if joint.nv == 1}
    if isinstance(entry, PathEntry):
        return one & set(robot.supporting_joints(entry.options.frame))
    if isinstance(entry, CsvEntry):
        return _columns(robot, entry.text)
    if isinstance(entry, JoinEntry):
        parts = [p for p in entry.part_entries(entries) if not isinstance(p, DwellEntry) or p.position is not None]
        found = [_given(part, robot, entries) for part in parts]
        return set.intersection(*found) if found else one
    names: set[str] = set()
    for posture in _postures(entry):
        if not isinstance(posture, Mapping):
            return one
        names |= {str(name) for name in posture}
    return names


def _postures(entry: MotionEntry) -> tuple[Posture, ...]:
    """The postures that waypoints or a dwell name."""
    if isinstance(entry, WaypointsEntry):
        return entry.positions
    return (entry.position,) if isinstance(entry, DwellEntry) and entry.position is not None else ((),)


@dataclass(frozen=True)
class _Some:
    """Some joints of a robot, as a robot of their own to whoever reads their motion."""

    name: str
    joints: tuple[RobotJoint, ...]
    lower: Array
    upper: Array


def read_partial_motion(robot: Robot, path: Path, name: str, text: str | None = None) -> Motion:
    """A CSV motion (motion/csv_file.py) in which some one-degree-of-freedom joints may be left out; they stay at 0.
    `text` is what the file holds, where it was read before. Raises InputError.
    """
    text = motion_text(path) if text is None else text
    there = _columns(robot, text)
    some = [joint for joint in robot.joints if joint.name in there]
    if not some or len(some) == len(robot.joints):
        return read_motion(robot, path, name, text)
    joints = tuple(replace(joint, q=k, v=k) for k, joint in enumerate(some))
    q, v = [joint.q for joint in some], [joint.v for joint in some]
    found = read_motion(cast(Any, _Some(robot.name, joints, robot.lower[q], robot.upper[q])), path, name, text)
    position = np.tile(robot.neutral, (len(found), 1))
    velocity, acceleration = np.zeros((len(found), robot.nv)), np.zeros((len(found), robot.nv))
    position[:, q], velocity[:, v], acceleration[:, v] = found.position, found.velocity, found.acceleration
    position_noise, speed_noise = np.zeros(robot.nq), np.zeros(robot.nv)
    position_noise[q], speed_noise[v] = found.position_noise, found.speed_noise
    return Motion(
        robot.joints, found.time, position, velocity, acceleration, name, found.notes,
        tuple(position_noise), tuple(speed_noise),
    )  # fmt: skip


def _columns(robot: Robot, text: str | None) -> set[str]:
    """The one-degree-of-freedom joints whose positions are columns of a CSV text; none where it could not be read."""
    try:
        rows = csv.reader(io.StringIO(text or ""))
        header = next((row for row in rows if any(cell.strip() for cell in row)), [])
    except csv.Error:
        return set()
    titles = {" ".join(unguarded(cell).split()).partition(" [")[0] for cell in header}
    return {joint.name for joint in robot.joints if joint.nv == 1 and f"{joint.name} position" in titles}
