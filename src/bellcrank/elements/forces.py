"""The forces of a scene: springs, dampers, bushings, friction, torques and wrenches.

Each entry of the list `forces` has a `kind`, an optional `name`, and the keys of its kind (joint_forces.py,
spherical_spring.py and frame_forces.py), in SI units unless other units are written. The work W of a simulation is that
of the forces without a potential.
"""

from __future__ import annotations

from typing import Final

from bellcrank.config.fields import Fields
from bellcrank.elements.bushing import Bushing
from bellcrank.elements.element import Force, named_entries
from bellcrank.elements.formulas import FormulaReader
from bellcrank.elements.frame_forces import Spring, Wrench
from bellcrank.elements.joint_forces import Damper, Friction, JointForce, JointLoad, JointSpring, Torque
from bellcrank.elements.spherical_spring import SphericalSpring

KINDS: Final[dict[str, type[JointForce | SphericalSpring | Spring | Wrench | Bushing]]] = {
    cls.kind: cls
    for cls in (JointSpring, SphericalSpring, Spring, Damper, Friction, Torque, JointLoad, Wrench, Bushing)
}


def read_forces(read: Fields, formulas: FormulaReader) -> tuple[Force, ...]:
    """Read the list `forces` of a scene. Raises InputError naming file and key."""
    forces: list[Force] = []
    for name, entry in named_entries(read, "forces"):
        kind = KINDS[entry.choice("kind", tuple(KINDS))]
        forces.append(kind.read(name, entry, formulas))
        entry.done()
    return tuple(forces)
