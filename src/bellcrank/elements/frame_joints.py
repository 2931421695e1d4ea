"""Checks which joints follow motions along a frame's path: such motions move only joints that carry the frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from bellcrank.elements.constraint import Constraint
from bellcrank.elements.controller import Controller
from bellcrank.elements.element import Element
from bellcrank.elements.joint_constraints import PrescribedMotion
from bellcrank.motion.entry_kinds import JoinEntry
from bellcrank.motion.generators.path_entries import PathEntry
from bellcrank.motion.motion_entry import MotionEntry
from bellcrank.robot.robot import Robot


def path_frames(entry: MotionEntry, entries: Mapping[str, MotionEntry]) -> Iterator[str]:
    """The frames that a motion moves along paths, also in the parts of a join."""
    if isinstance(entry, PathEntry):
        yield entry.options.frame
    if isinstance(entry, JoinEntry):
        for part in entry.part_entries(entries):
            yield from path_frames(part, entries)


def refuse_joints_off_paths(
    constraints: Iterable[Constraint], control: Iterable[Controller], robot: Robot, entries: Mapping[str, MotionEntry]
) -> None:
    """Refuse joints that follow a frame's path but do not carry the frame, in a scene with constraints.

    A motion along a frame's path is computed for the tree of joints, where it moves only the joints that carry the
    frame. Raises InputError if a prescribed motion or controller uses it at another joint.
    """
    constraints = tuple(constraints)
    if all(isinstance(constraint, PrescribedMotion) for constraint in constraints):
        return
    followers: list[tuple[Element, list[str]]] = [
        (c, [c.joint.name]) for c in constraints if isinstance(c, PrescribedMotion)
    ]
    followers += [(part, [joint.name for joint in part.joints]) for part in control]
    for part, joints in followers:
        entry = entries.get(str(part.place.raw("motion", None)))
        if entry is None:
            continue
        for frame in path_frames(entry, entries):
            off = [name for name in joints if name not in robot.supporting_joints(frame)]
            if off:
                raise part.place.error(
                    "motion",
                    f"'{entry.name}' moves frame '{frame}' along a path, but {', '.join(off)} does not carry that "
                    "frame in the tree of joints and would not move; `bellcrank size` solves the path on the closed "
                    "mechanism and writes the motion of all joints: use that file as {kind: csv, file: …}",
                )
