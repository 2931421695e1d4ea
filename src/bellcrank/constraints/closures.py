"""The closures of a scene: what a URDF tree cannot say.

Each entry of the list `closures` has a `kind`, maybe a `name`, and the keys of its kind (loops.py, joint_relations.py,
rolling.py).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final

from bellcrank.card.fields import Fields
from bellcrank.constraints.constraint import Constraint
from bellcrank.constraints.joint_relations import Coupling, Drive
from bellcrank.constraints.loops import Distance, Hinge, Point, Weld
from bellcrank.constraints.rolling import RollingDisk
from bellcrank.robot.robot import Robot
from bellcrank.scene.part import named_entries

if TYPE_CHECKING:
    from bellcrank.motion.motion import Motion

KINDS: Final[dict[str, Any]] = {cls.kind: cls for cls in (Point, Hinge, Weld, Distance, Coupling, Drive, RollingDisk)}


def read_closures(
    read: Fields, robot: Robot, motions: Mapping[str, Any], motion_of: Callable[[str], Motion]
) -> tuple[Constraint, ...]:
    """The list `closures` of a scene; InputError naming file and key."""
    closures: list[Constraint] = []
    for name, entry in named_entries(read, "closures"):
        kind = KINDS[entry.choice("kind", tuple(KINDS))]
        if kind is Drive:
            closures.append(Drive.read(name, entry, robot, motions, motion_of))
        else:
            closures.append(kind.read(name, entry, robot))
        entry.done()
    return tuple(closures)
