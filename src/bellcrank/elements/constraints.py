"""The constraints of a scene: what a URDF tree cannot say.

Each entry of the list `constraints` has a `kind`, maybe a `name`, and the keys of its kind (loops.py, joint_relations.py,
rolling.py, formula.py); `{kind: gepetto | mjcf | sdf, file}` stands for all loops that such a file beside the URDF
tells of (foreign.py).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final

from bellcrank.config.fields import Fields
from bellcrank.elements.constraint import Constraint
from bellcrank.elements.element import named_entries
from bellcrank.elements.expression_constraint import Formula
from bellcrank.elements.importers import READERS, read_foreign
from bellcrank.elements.joint_relations import Coupling, Drive
from bellcrank.elements.loops import Distance, Hinge, Point, Weld
from bellcrank.elements.rolling import RollingDisk
from bellcrank.robot.robot import Robot

if TYPE_CHECKING:
    from bellcrank.motion.motion import Motion

KINDS: Final[dict[str, Any]] = {
    cls.kind: cls for cls in (Point, Hinge, Weld, Distance, Coupling, Drive, RollingDisk, Formula)
}


def read_constraints(
    read: Fields, robot: Robot, motions: Mapping[str, Any], motion_of: Callable[[str], Motion]
) -> tuple[Constraint, ...]:
    """The list `constraints` of a scene; InputError naming file and key."""
    parameters = read.raw("parameters", {})
    constraints: list[Constraint] = []
    for name, entry in named_entries(read, "constraints"):
        kind = entry.choice("kind", (*KINDS, *READERS))
        if kind in READERS:
            constraints += read_foreign(kind, name, entry, robot)
        elif kind == Drive.kind:
            constraints.append(Drive.read(name, entry, robot, motions, motion_of))
        elif kind == Formula.kind:
            names = parameters if isinstance(parameters, Mapping) else {}
            constraints.append(Formula.read_with(name, entry, robot, names))
        else:
            constraints.append(KINDS[kind].read(name, entry, robot))
        entry.done()
    taken = [constraint.name for constraint in constraints]
    for name in taken:
        if taken.count(name) > 1:
            raise read.error("constraints", f"two constraints are named '{name}'; name the entries")
    return tuple(constraints)
