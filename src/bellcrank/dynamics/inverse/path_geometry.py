"""Motions made from a frame's path while parameters change the lengths: the frame then moves along another path.

Inverse kinematics along a path takes the lengths of the URDF and the configuration, not those that parameters of the
scene set. Where they differ, notes say so.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from bellcrank.elements.frame_joints import path_frames

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene


def path_notes(scene: Scene, names: Iterable[str]) -> list[str]:
    """A sentence for each of the scene's motions with these names whose frame moves along another path than given."""
    entries = scene.config.motions
    changed = changed_lengths(scene)
    return [
        f"motion '{name}' was made from a frame's path with the lengths of the URDF, which the parameters "
        f"{', '.join(changed)} change: the frame moves along another path; write the motion in joint positions"
        for name in dict.fromkeys(names)
        if changed and name in entries and any(path_frames(entries[name], entries))
    ]


def changed_lengths(scene: Scene) -> list[str]:
    """The parameters that place a joint or frame elsewhere than the URDF or the configuration."""
    frames = scene.robot.equations.tree.frames
    found = []
    for name, parameter in scene.parameters.items():
        for frame, what in parameter.places:
            if what < 6:
                now = [*frames[frame].in_parent.translation, *frames[frame].rpy][what]
                if abs(parameter.value - now) > 1e-9 * max(1.0, abs(now)) and name not in found:
                    found.append(name)
    return found
