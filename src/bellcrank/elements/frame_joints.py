"""Which joints a motion of a configuration moves that draws a frame along a path: on a tree, those that carry the frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from bellcrank.elements.constraint import Constraint
from bellcrank.elements.controllers import Controller
from bellcrank.elements.element import Element
from bellcrank.elements.joint_constraints import PrescribedMotion
from bellcrank.motion.entry_kinds import JoinEntry
from bellcrank.motion.motion_entry import MotionEntry
from bellcrank.motion.path_entries import PathEntry
from bellcrank.robot.robot import Robot


def frames_drawn(entry: MotionEntry, entries: Mapping[str, MotionEntry]) -> Iterator[str]:
    """The frames that a motion draws along paths, in the parts of a join too."""
    if isinstance(entry, PathEntry):
        yield entry.options.frame
    if isinstance(entry, JoinEntry):
        for part in entry.part_entries(entries):
            yield from frames_drawn(part, entries)


def refuse_joints_off_paths(
    constraints: Iterable[Constraint], control: Iterable[Controller], robot: Robot, entries: Mapping[str, MotionEntry]
) -> None:
    """InputError where constraints tie joints together and a drive or controller follows, at a joint that does not carry
    the frame, a motion that draws a frame: in a scene such a motion moves the joints that carry it alone.
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
        for frame in frames_drawn(entry, entries):
            off = [name for name in joints if name not in robot.supporting_joints(frame)]
            if off:
                raise part.place.error(
                    "motion",
                    f"'{entry.name}' draws frame '{frame}' along a path, and {', '.join(off)} does not carry that "
                    "frame in the tree of joints, so that it would stand still; `bellcrank size` solves the path on "
                    "the closed mechanism and writes all joints: follow that history as {kind: csv, file: …}",
                )
