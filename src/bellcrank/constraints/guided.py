"""Motions of a linkage: which joints a motion of the card or a CSV file is given for, and all others following them."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from bellcrank.card.motions import MotionEntry
from bellcrank.errors import InputError, among
from bellcrank.motion.csv_file import read_motion
from bellcrank.motion.motion import Motion
from bellcrank.scene.symbols import frame_index

if TYPE_CHECKING:
    from bellcrank.constraints.chain import Array, Chain
    from bellcrank.robot.robot import Robot, RobotJoint

AGREEMENT = 1e-5  # rad or m: what files round off


def guided_motion(
    chain: Chain, motion: Motion | str | Path, independent: Sequence[str] | None = None
) -> tuple[Motion, tuple[str, ...]]:
    """The motion of all joints of a linkage, and the independent joints it was given by. Raises BellcrankError."""
    robot, card = chain.robot, chain.given.card
    given: set[str] | None = None
    if isinstance(motion, Motion):
        whole = motion
    elif str(motion) in card.motions:
        entry = card.motions[str(motion)]
        given = _given(entry, robot, card.motions)
        if entry.kind == "csv":
            whole = read_partial_motion(robot, entry.arguments["path"], entry.name)
        else:
            whole = chain.given.motion(str(motion))
    elif Path(motion).suffix or "/" in str(motion):
        whole = read_partial_motion(robot, Path(motion), Path(motion).stem)
        given = _columns(robot, Path(motion))
    else:
        raise InputError(f"{chain.given.source}: {among('motion', str(motion), card.motions)}, nor a file of that name")
    if len(whole.joints) != len(robot.joints) or whole.nq != robot.nq:
        raise InputError(
            f"motion '{whole.name}' is for the joints {', '.join(whole.joint_names)}, the robot {robot.name} has "
            f"{', '.join(joint.name for joint in robot.joints)}"
        )
    if independent is None:
        candidates = [joint for joint in robot.joints if joint.nv == 1 and (given is None or joint.name in given)]
        candidates.sort(key=lambda joint: joint not in chain.actuated)
    else:
        candidates = [robot.one_degree_joint(name, f"motion '{whole.name}'") for name in independent]
    joints = chain.independent(candidates, whole.name)
    found = chain.follow(whole, joints)
    if given is not None and independent is None:
        _check_agreement(whole, found, [joint for joint in candidates if joint not in joints])
    return found, tuple(joint.name for joint in joints)


def _check_agreement(wanted: Motion, found: Motion, joints: Sequence[RobotJoint]) -> None:
    """Refuse a motion that moves more joints than can be chosen, unless the closures move them so anyway."""
    for joint in joints:
        gap = found.position[:, joint.q] - wanted.position[:, joint.q]
        gap = np.abs(np.remainder(gap + np.pi, 2.0 * np.pi) - np.pi if joint.kind == "revolute" else gap)
        if gap.max() > AGREEMENT:
            row = int(gap.argmax())
            raise InputError(
                f"motion '{wanted.name}' wants joint '{joint.name}' at {wanted.position[row, joint.q]:.6g} at "
                f"{wanted.time[row]:.6g} s, the closures put it at {found.position[row, joint.q]:.6g} (rad or m): it "
                "moves more joints, or a frame along more dimensions, than the linkage has freedoms, or is on another "
                "branch; leave that joint out of it"
            )


def _given(entry: MotionEntry, robot: Robot, entries: Mapping[str, MotionEntry]) -> set[str]:
    """The joints that a motion of the card is given for: those that it names; on the path of a frame those that carry
    the frame.
    """
    one = {joint.name for joint in robot.joints if joint.nv == 1}
    if entry.kind in ("circle", "line"):
        return one & set(_carrying(robot, entry.arguments["frame"]))
    if entry.kind == "csv":
        return _columns(robot, entry.arguments["path"])
    if entry.kind == "join":
        parts = [entries[part] if isinstance(part, str) else part for part in entry.arguments["parts"]]
        found = [_given(p, robot, entries) for p in parts if p.kind != "dwell" or "position" in p.arguments]
        return set.intersection(*found) if found else one
    postures = entry.arguments.get("positions", [entry.arguments.get("position", ())])
    if not all(isinstance(posture, Mapping) for posture in postures):
        return one
    return {str(name) for posture in postures for name in posture}


def _carrying(robot: Robot, frame: str) -> list[str]:
    """The joints between a frame and the world."""
    tree = robot.equations.tree
    at, names = int(tree.frames[frame_index(robot, frame)]["parent_joint"]), []
    while at > 0:
        names.append(robot.all_joint_names[at - 1])
        at = int(tree.joints[at - 1]["parent"])
    return names


@dataclass(frozen=True)
class _Some:
    """Some joints of a robot, as a robot of their own to whoever reads their motion."""

    name: str
    joints: tuple[RobotJoint, ...]
    lower: Array
    upper: Array


def read_partial_motion(robot: Robot, path: Path, name: str) -> Motion:
    """A CSV motion (motion/csv_file.py) in which some one-degree-of-freedom joints may be left out; they stay at 0.
    Raises InputError.
    """
    there = _columns(robot, path)
    some = [joint for joint in robot.joints if joint.name in there]
    if not some or len(some) == len(robot.joints):
        return read_motion(robot, path, name)
    joints = tuple(replace(joint, q=k, v=k) for k, joint in enumerate(some))
    q, v = [joint.q for joint in some], [joint.v for joint in some]
    found = read_motion(cast(Any, _Some(robot.name, joints, robot.lower[q], robot.upper[q])), path, name)
    position = np.tile(robot.neutral, (len(found), 1))
    velocity, acceleration = np.zeros((len(found), robot.nv)), np.zeros((len(found), robot.nv))
    position[:, q], velocity[:, v], acceleration[:, v] = found.position, found.velocity, found.acceleration
    return Motion(robot.joints, found.time, position, velocity, acceleration, name, found.notes)


def _columns(robot: Robot, path: Path) -> set[str]:
    """The one-degree-of-freedom joints whose positions are columns of a CSV file; none where it cannot be read."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            header = next((row for row in csv.reader(file) if any(cell.strip() for cell in row)), [])
    except (OSError, ValueError, csv.Error):
        return set()
    titles = {" ".join(cell.split()).partition(" [")[0] for cell in header}
    return {joint.name for joint in robot.joints if joint.nv == 1 and f"{joint.name} position" in titles}
