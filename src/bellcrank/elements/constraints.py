"""Reads the constraints of a scene.

Each entry of the list `constraints` has a `kind`, an optional `name`, and the keys of its kind. To add a kind, derive a
class from `Constraint` (constraint.py) and add it to `KINDS`. A file of another tool (constraint_importers.py) is an
entry too, for all loops in that file.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Final

from bellcrank.config.fields import Fields
from bellcrank.elements.constraint import Constraint, ReadContext
from bellcrank.elements.constraint_importers import IMPORTERS, import_constraints
from bellcrank.elements.element import named_entries
from bellcrank.elements.expression_constraint import ExpressionConstraint
from bellcrank.elements.joint_constraints import Coupling, PrescribedMotion
from bellcrank.elements.loop_constraints import Distance, Hinge, Point, Weld
from bellcrank.elements.loop_joints import Planar, Prismatic, Universal
from bellcrank.elements.pin_friction import allow_friction
from bellcrank.elements.rolling_constraint import RollingDisk

Reader = Callable[[str, Fields, ReadContext], Sequence[Constraint]]  # called with a name, an entry and its context


def _reader(kind: type[Constraint]) -> Reader:
    return lambda name, read, context: [kind.read(name, read, context)]


KINDS: Final[dict[str, Reader]] = {
    **{
        cls.kind: _reader(cls)
        for cls in (
            Point,
            Hinge,
            Weld,
            Distance,
            Universal,
            Prismatic,
            Planar,
            Coupling,
            PrescribedMotion,
            RollingDisk,
            ExpressionConstraint,
        )
    },
    **{kind: partial(import_constraints, kind) for kind in IMPORTERS},
}


def read_constraints(read: Fields, context: ReadContext) -> tuple[Constraint, ...]:
    """Read the list `constraints` of a scene. Raises InputError naming file and key."""
    constraints: list[Constraint] = []
    for name, entry in named_entries(read, "constraints"):
        kind = entry.choice("kind", tuple(KINDS))
        allow_friction(entry, kind)
        constraints += KINDS[kind](name, entry, context)
        entry.done()
    taken = [constraint.name for constraint in constraints]
    for name in taken:
        if taken.count(name) > 1:
            raise read.error("constraints", f"two constraints are named '{name}'; give each entry a unique name")
    return tuple(constraints)
