"""Conditions of events on constraints.

`aligned: {joint_a, joint_b, constraint}`: the origins of two joints and the point of the constraint between them are
collinear. `singular_constraints: THRESHOLD`: σ_min/σ_max of J M⁻¹ᐟ² reaches the threshold. `contact_lost: CONSTRAINT`:
the normal force of a rolling disk reaches zero. `friction_demand: {constraint, limit}`: the ratio of friction to normal
force of a rolling disk reaches a limit, such as the coefficient of friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from bellcrank.config.fields import Fields
from bellcrank.elements.constraint import Constraint
from bellcrank.elements.element import read_joint
from bellcrank.elements.loop_constraints import WORLD, Loop
from bellcrank.elements.rolling_constraint import RollingDisk
from bellcrank.messages import unknown_name
from bellcrank.robot.robot import Robot

if TYPE_CHECKING:
    import casadi

    from bellcrank.scene.equation_symbols import EquationSymbols

FLAT = 1e-4  # rad: below this angle to the plane the lowest point of a disk is not well defined


class Condition(Protocol):
    """A condition of an event: a function g(t, x, u, p) whose zeros are the events, and the frames that it uses."""

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that it uses."""

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zeros are the events."""


@dataclass(frozen=True)
class Aligned:
    """The sine of the angle between two links about joint a's axis, which is zero where they are collinear.

    The links are the lines from the constraint's point P to the origins A and B of joints a and b; they may be
    stretched out or folded back. `link_a` and `link_b` are the child links of the joints, whose origins are A and B.
    For small angles the function is the deviation of the angle at P, rad.
    """

    link_a: str
    link_b: str
    loop: Loop
    axis: tuple[float, ...]

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames of both joints and of the constraint."""
        return (self.link_a, self.link_b, *self.loop.frames)

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zeros are the events."""
        import casadi

        symbols = equations.symbols
        a, b, tip = symbols.frame(self.link_a), symbols.frame(self.link_b), self.loop.sides(symbols)[0].position
        arm_a, arm_b = a.position - tip, b.position - tip
        area = casadi.dot(a.rotation @ casadi.DM(self.axis), casadi.cross(arm_a, arm_b))
        return area / casadi.sqrt(casadi.dot(arm_a, arm_a) * casadi.dot(arm_b, arm_b))


@dataclass(frozen=True)
class SingularConstraint:
    """σ_min/σ_max of J M⁻¹ᐟ² (Reactions.closeness) minus a threshold: small where constraints become dependent."""

    threshold: float

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that it uses."""
        return ()

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zeros are the events."""
        return equations.closeness - self.threshold


@dataclass(frozen=True)
class ContactLost:
    """The normal force of a rolling disk, N."""

    constraint: str

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that it uses."""
        return ()

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zeros are the events."""
        return equations.multipliers(self.constraint)[0]


@dataclass(frozen=True)
class LiesFlat:
    """The sine of the angle between a rolling disk and its plane, minus FLAT."""

    disk: RollingDisk

    @property
    def frames(self) -> tuple[str, ...]:
        """The frame of the disk."""
        return self.disk.frames

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zeros are the events."""
        return self.disk.steepness(equations.symbols) - FLAT


@dataclass(frozen=True)
class FrictionDemand:
    """The friction of a rolling disk minus `limit` times its normal force, N."""

    constraint: str
    limit: float

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that it uses."""
        return ()

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zeros are the events."""
        import casadi

        normal, *friction = casadi.vertsplit(equations.multipliers(self.constraint))
        return casadi.norm_2(casadi.vertcat(*friction)) - self.limit * normal


def read_aligned(read: Fields, robot: Robot, constraints: Sequence[Constraint]) -> Aligned:
    """Read the condition `aligned`. Raises InputError unless exactly one constraint is between the joints."""
    a, b = read_joint(read, robot, "joint_a"), read_joint(read, robot, "joint_b")
    if a == b:
        raise read.error("joint_b", f"expected two different joints, found '{a.name}' twice")

    def beyond(joint: str, frame: str) -> bool:
        return frame != WORLD and joint in set(robot.supporting_joints(frame))

    def between(loop: Loop) -> bool:
        sides = [(loop.frame_a, loop.frame_b), (loop.frame_b, loop.frame_a)]
        return any(beyond(a.name, mine) and beyond(b.name, other) for mine, other in sides)

    loops = [constraint for constraint in constraints if isinstance(constraint, Loop) and constraint.kind != "distance"]
    if "constraint" in read:
        name = read.text("constraint")
        found = [loop for loop in loops if loop.name == name]
        if not found:
            raise read.error("constraint", unknown_name("loop", name, [loop.name for loop in loops]))
    else:
        read.known("constraint")
        found = [loop for loop in loops if between(loop)]
        if len(found) != 1:
            there = ", ".join(loop.name for loop in found) or "none"
            raise read.error(
                "",
                f"expected one constraint between the links that '{a.name}' and '{b.name}' carry, found {there}; "
                "write its name under the key 'constraint'",
            )
    links = robot.urdf.joints
    read.done()
    return Aligned(links[a.name].child, links[b.name].child, found[0], tuple(links[a.name].axis))


def read_singular(read: Fields, constraints: Sequence[Constraint]) -> SingularConstraint:
    """Read the condition `singular_constraints`. Raises InputError for a scene without constraints."""
    if not constraints:
        raise read.error("singular_constraints", "the scene has no constraints")
    return SingularConstraint(read.number("singular_constraints", "", positive=True, maximum=1.0))


def read_contact(read: Fields, key: str, constraints: Sequence[Constraint]) -> str:
    """Read the name of a rolling disk. Raises InputError for any other."""
    name = read.text(key)
    disks = [constraint.name for constraint in constraints if isinstance(constraint, RollingDisk)]
    if name not in disks:
        raise read.error(key, unknown_name("rolling disk", name, disks))
    return name
