"""Motions of a closed linkage: which joints a motion prescribes, and the motion of all joints that follows."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.inverse.idle_rotations import IdleRotation
from bellcrank.dynamics.inverse.motion_notes import path_notes
from bellcrank.dynamics.postures.closed_inverse_kinematics import ClosedInverseKinematics
from bellcrank.dynamics.postures.consistent_start import consistent_posture
from bellcrank.dynamics.postures.loop_kinematics import LoopKinematics
from bellcrank.elements.frame_joints import path_frames
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.csv_files import unguarded
from bellcrank.messages import unknown_name
from bellcrank.motion.coordinates import position_labels
from bellcrank.motion.entry_kinds import CsvEntry, DwellEntry, JoinEntry
from bellcrank.motion.generators.path_entries import PathEntry
from bellcrank.motion.generators.waypoints import dwell
from bellcrank.motion.motion import Motion, join, other_joints
from bellcrank.motion.motion_entry import MotionEntry
from bellcrank.motion.sampled.csv_file import motion_text, read_motion
from bellcrank.robot.robot import Robot, RobotJoint
from bellcrank.scene.scene import Scene

AGREEMENT = 1e-5  # rad, or of the characteristic length: differences that files round off


class DependentMotions:
    """Motions of all joints of a closed linkage, from motions of independent joints or of a frame.

    `scene` has the motions by name and its clock at 0; `motors` are chosen as independent joints before others.
    """

    def __init__(self, scene: Scene, kinematics: LoopKinematics, motors: Sequence[RobotJoint]) -> None:
        self.scene, self.kinematics, self.motors = scene, kinematics, tuple(motors)
        self.robot = scene.robot
        self.entries: Mapping[str, MotionEntry] = scene.config.motions

    @cached_property
    def idle_rotations(self) -> tuple[IdleRotation, ...]:
        """The idle rotations that leave all motors at rest."""
        return self.kinematics.idle_rotations([joint.v for joint in self.motors])

    def along(
        self, motion: Motion | str | Path, independent: Sequence[str] | None = None
    ) -> tuple[Motion, tuple[str, ...]]:
        """The motion of all joints, and the independent joints that it follows from.

        `motion` is a Motion, the name of a motion of the scene, or the path of a CSV file. Raises BellcrankError.
        """
        if isinstance(motion, (str, Path)) and str(motion) in self.entries:
            followed = self._frame_motion(self.entries[str(motion)])
            if followed is not None:
                return followed, tuple(joint.name for joint in self._independent(followed, None, independent))
        whole, given = self._prescribed(motion)
        if len(whole.joints) != len(self.robot.joints) or whole.nq != self.robot.nq:
            raise other_joints(whole, self.robot)
        if independent is not None:
            independent = arguments.several("independent", independent, str, "names of joints")
        joints = self._independent(whole, given, independent)
        found = self.kinematics.follow(whole, joints)
        if given is not None and independent is None:
            self._check_agreement(whole, found, [j for j in self._candidates(given) if j not in joints])
        return found, tuple(joint.name for joint in joints)

    def leading(self, name: str) -> tuple[str, ...] | None:
        """The independent joints that a motion of the scene prescribes, and nothing more; None for other motions."""
        entry = self.entries.get(name)
        if entry is None or any(path_frames(entry, self.entries)):
            return None
        given = _prescribed_joints(entry, self.robot, self.entries)
        try:
            joints = tuple(joint.name for joint in self.kinematics.independent(self._candidates(given), name))
        except InputError:
            return None
        return joints if given <= set(joints) else None

    def _prescribed(self, motion: Motion | str | Path) -> tuple[Motion, set[str] | None]:
        """A motion of joints, and the joints that it prescribes (None: all)."""
        if isinstance(motion, Motion):
            return motion, None
        if not isinstance(motion, (str, Path)):
            arguments.refuse("motion", "a Motion, the name of a motion, or the path of a CSV file", motion)
        if str(motion) in self.entries:
            entry = self.entries[str(motion)]
            given = _prescribed_joints(entry, self.robot, self.entries)
            if isinstance(entry, CsvEntry):
                return entry.paced(read_partial_motion(self.robot, entry.path, entry.name, entry.text)), given
            whole = self.scene.motion(str(motion))
            return replace(whole, notes=(*whole.notes, *path_notes(self.scene, [str(motion)]))), given
        file = arguments.path("motion", motion, "a motion's name or the path of a CSV file")
        if not (file.suffix or "/" in str(motion)):
            unknown = unknown_name("motion", str(motion), self.entries)
            raise InputError(f"{self.scene.source}: {unknown}, nor a file of that name")
        text = motion_text(Path(motion))
        whole = read_partial_motion(self.robot, Path(motion), Path(motion).stem, text)
        return whole, _joints_in_columns(self.robot, text)

    # ---- independent joints

    def _candidates(self, given: set[str] | None) -> list[RobotJoint]:
        """The joints that may be independent, motors first: those given, by default all without idle rotations."""
        if given is None:
            given = {joint.name for joint in self.robot.joints} - {
                n for turn in self.idle_rotations for n in turn.joints
            }
        found = [joint for joint in self.robot.joints if joint.nv == 1 and joint.name in given]
        return sorted(found, key=lambda joint: joint not in self.motors)

    def _independent(
        self, motion: Motion, given: set[str] | None, names: Sequence[str] | None
    ) -> tuple[RobotJoint, ...]:
        """Joints that determine the posture along a motion: those named, else of the joints given."""
        if names is None:
            candidates = self._candidates(given)
        else:
            candidates = [self.robot.one_degree_joint(name, f"motion '{motion.name}'") for name in names]
        return self.kinematics.independent(candidates, motion.name, self.idle_rotations)

    def _check_agreement(self, wanted: Motion, found: Motion, joints: Sequence[RobotJoint]) -> None:
        """InputError where a motion prescribes dependent joints otherwise than the constraints move them."""
        for joint in joints:
            difference = found.position[:, joint.q] - wanted.position[:, joint.q]
            if joint.kind == "revolute":
                difference = np.remainder(difference + np.pi, 2.0 * np.pi) - np.pi
            difference = np.abs(difference)
            if difference.max() > AGREEMENT * (self.kinematics.length if joint.kind == "prismatic" else 1.0):
                row, unit = int(difference.argmax()), "m" if joint.kind == "prismatic" else "rad"
                raise InputError(
                    f"motion '{wanted.name}' prescribes joint '{joint.name}' at {wanted.position[row, joint.q]:.6g} "
                    f"{unit} at {wanted.time[row]:.6g} s, but the constraints put it at "
                    f"{found.position[row, joint.q]:.6g} {unit}: the motion prescribes more joints or coordinates "
                    "of a frame than the linkage has degrees of freedom, or is on another branch; leave that joint out"
                )

    # ---- motions of frames

    def _frame_motion(self, entry: MotionEntry, previous: Array | None = None) -> Motion | None:
        """The motion of an entry that moves a frame along a path, or joins such motions to others.

        It starts from the posture `previous` (nq,), by default from the scene's start. None for any other entry, and
        where the path leaves degrees of freedom open. Raises BellcrankError.
        """
        if isinstance(entry, JoinEntry):
            return self._joined(entry, previous)
        if not isinstance(entry, PathEntry):
            return None
        frame = entry.options.frame
        try:
            start = self.kinematics.start if previous is None else previous
            if entry.start is not None:
                start = self._start_posture(entry.start, start)
            here = self.robot.frame_pose(frame, start)[0]
            idle, motions = [turn.rates for turn in self.idle_rotations], list[Motion]()
            for path in entry.paths(here):
                last = motions[-1].position[-1] if motions else start
                follower = ClosedInverseKinematics(self.kinematics, path, last, idle)
                freedoms, prescribed = follower.prescribed()
                if prescribed != freedoms:
                    break
                motions.append(follower.motion())
            else:
                return entry.paced(motions[0] if len(motions) == 1 else join(*motions, name=entry.name))
            if entry.options.coordinates is not None or not self._open_chain_suffices(frame):
                raise InputError(follower.too_few_coordinates())
            return None
        except BellcrankError as error:
            raise type(error)(f"{entry.fields.error('', str(error))}") from None

    def _joined(self, entry: JoinEntry, previous: Array | None) -> Motion | None:
        """The motion of a join with a path in it; None for any other join."""
        if not any(path_frames(entry, self.entries)):
            return None
        motions: list[Motion] = []
        for part in entry.part_entries(self.entries):
            last = motions[-1].position[-1] if motions else previous
            found = self._frame_motion(part, last)
            motions.append(self._part(part, last) if found is None else found)
        return entry.paced(join(*motions, name=entry.name))

    def _open_chain_suffices(self, frame: str) -> bool:
        """Whether the joints between a frame and the world are independent of each other, as in an open chain."""
        names = self.robot.supporting_joints(frame)
        return self.kinematics.are_independent([joint.v for joint in self.robot.joints if joint.name in names])

    def _part(self, entry: MotionEntry, previous: Array | None) -> Motion:
        """A part of a join that is no path: its joints are prescribed, the others follow from `previous` (nq,)."""
        if isinstance(entry, DwellEntry) and entry.position is None:
            if previous is None:
                raise InputError(f"{entry.fields.error('', 'a dwell that comes first needs a position')}")
            return entry.paced(dwell(self.robot, previous, entry.duration, name=entry.name))
        given = _prescribed_joints(entry, self.robot, self.entries)
        if isinstance(entry, CsvEntry):
            whole = entry.paced(read_partial_motion(self.robot, entry.path, entry.name, entry.text))
        else:
            whole = entry.build(self.robot, self.entries, previous)
        joints = self._independent(whole, given, None)
        found = self.kinematics.follow(whole, joints, previous)
        self._check_agreement(whole, found, [joint for joint in self._candidates(given) if joint not in joints])
        return found

    def _start_posture(self, posture: Any, near: Array) -> Array:
        """The posture (nq,) that satisfies the constraints and is nearest to `near`, joints of a start posture set."""
        q = near.copy()
        if isinstance(posture, Mapping):
            for name, value in posture.items():
                q[self.robot.one_degree_joint(name, "start").q] = value
        else:
            q = self.robot.posture(posture)
        return consistent_posture(self.kinematics.scene, q, np.zeros(self.robot.nv, dtype=bool))


def _prescribed_joints(entry: MotionEntry, robot: Robot, entries: Mapping[str, MotionEntry]) -> set[str]:
    """The joints that a motion prescribes: those that it names; for a frame's path, those that carry the frame."""
    one = {joint.name for joint in robot.joints if joint.nv == 1}
    if isinstance(entry, PathEntry):
        return one & set(robot.supporting_joints(entry.options.frame))
    if isinstance(entry, CsvEntry):
        return _joints_in_columns(robot, entry.text)
    if isinstance(entry, JoinEntry):
        parts = [p for p in entry.part_entries(entries) if not isinstance(p, DwellEntry) or p.position is not None]
        found = [_prescribed_joints(part, robot, entries) for part in parts]
        return set.intersection(*found) if found else one
    names: set[str] = set()
    for posture in entry.postures or ((),):
        if not isinstance(posture, Mapping):
            return one
        names |= {str(name) for name in posture}
    return names


# ---- CSV files with some of the joints


@dataclass(frozen=True)
class JointSubset:
    """Some joints of a robot, numbered among themselves, with their limits (a RobotLike)."""

    name: str
    joints: tuple[RobotJoint, ...]
    lower: Array
    upper: Array


def read_partial_motion(robot: Robot, path: Path, name: str, text: str | None = None) -> Motion:
    """A CSV motion (motion/sampled/csv_file.py) in which joints with one degree of freedom may be left out; they stay
    at 0.

    `text` is the content of the file, if it has been read. Raises InputError.
    """
    text = motion_text(path) if text is None else text
    present = _joints_in_columns(robot, text)
    some = [joint for joint in robot.joints if joint.name in present]
    rest = [joint for joint in robot.joints if joint not in some]
    others = {title for title, _ in position_labels([joint for joint in rest if joint.nv != 1])}
    if not some or not rest or (all(joint.nv != 1 for joint in rest) and not others.isdisjoint(_titles(text))):
        return read_motion(robot, path, name, text)
    q, v = [joint.q for joint in some], [joint.v for joint in some]
    joints = tuple(replace(joint, q=k, v=k) for k, joint in enumerate(some))
    found = read_motion(JointSubset(robot.name, joints, robot.lower[q], robot.upper[q]), path, name, text)
    position = np.tile(robot.neutral, (len(found), 1))
    velocity, acceleration = np.zeros((len(found), robot.nv)), np.zeros((len(found), robot.nv))
    position[:, q], velocity[:, v], acceleration[:, v] = found.position, found.velocity, found.acceleration
    position_noise, speed_noise = np.zeros(robot.nq), np.zeros(robot.nv)
    position_noise[q], speed_noise[v] = found.position_noise, found.speed_noise
    return Motion(
        robot.joints,
        found.time,
        position,
        velocity,
        acceleration,
        name,
        found.notes,
        tuple(position_noise),
        tuple(speed_noise),
        derived_from=found.derived_from,
    )


def _titles(text: str | None) -> set[str]:
    """The titles of the columns of a CSV text, without units; none where it cannot be read."""
    try:
        rows = csv.reader(io.StringIO(text or ""))
        header = next((row for row in rows if any(cell.strip() for cell in row)), [])
    except csv.Error:
        return set()
    return {" ".join(unguarded(cell).split()).partition(" [")[0] for cell in header}


def _joints_in_columns(robot: Robot, text: str | None) -> set[str]:
    """The joints of one degree of freedom whose positions are columns of a CSV text; none where it cannot be read."""
    titles = _titles(text)
    return {joint.name for joint in robot.joints if joint.nv == 1 and f"{joint.name} position" in titles}
