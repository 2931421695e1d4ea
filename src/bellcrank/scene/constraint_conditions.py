"""Conditions on constraints, for events: links that line up, constraints near singular, contact lost, friction demanded.

`aligned: {joint_a, joint_b, constraint}`: the origins of two joints and the point of the constraint between them lie on one
line. `singular_constraints: THRESHOLD`: σ_min/σ_max of the constraints' Jacobian in the metric of the mass matrix reaches it.
`contact_lost: CONSTRAINT`: the normal force of a rolling disk is down to zero. `friction_demand: {constraint, limit}`: its
friction over its normal force reaches a limit, as a coefficient of friction sets one.
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

FLAT = 1e-4  # rad: a disk that is nearer to lying flat has no lowest point that can be told


class Condition(Protocol):
    """What an event waits for: a function g(t, x, u, p) whose zero it is, the frames and the unit of it."""

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames it uses."""

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zero it is."""


@dataclass(frozen=True)
class Aligned:
    """The sine of the angle between two arms, seen along joint a's axis: zero where they form one line.

    The arms go from the constraint's point P to the origins A and B of joints a and b, so that A, P, B lie on one line,
    stretched out or folded back. `link_a` and `link_b` are the joints' child links, at whose origins the joints are.
    Near the line it changes as the angle at P does, rad.
    """

    link_a: str
    link_b: str
    loop: Loop
    axis: tuple[float, ...]

    @property
    def frames(self) -> tuple[str, ...]:
        """Both joints' and the constraint's."""
        return (self.link_a, self.link_b, *self.loop.frames)

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zero it is."""
        import casadi

        symbols = equations.symbols
        a, b, tip = symbols.frame(self.link_a), symbols.frame(self.link_b), self.loop.sides(symbols)[0].position
        arm_a, arm_b = a.position - tip, b.position - tip
        area = casadi.dot(a.rotation @ casadi.DM(self.axis), casadi.cross(arm_a, arm_b))
        return area / casadi.sqrt(casadi.dot(arm_a, arm_a) * casadi.dot(arm_b, arm_b))


@dataclass(frozen=True)
class SingularConstraint:
    """σ_min/σ_max of J M⁻¹ᐟ² (Reactions.closeness) less a threshold: below it constraints hardly hold, or rows repeat."""

    threshold: float

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames it uses."""
        return ()

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zero it is."""
        return equations.closeness - self.threshold


@dataclass(frozen=True)
class ContactLost:
    """The normal force of a rolling disk, N."""

    constraint: str

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames it uses."""
        return ()

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zero it is."""
        return equations.multipliers(self.constraint)[0]


@dataclass(frozen=True)
class LiesFlat:
    """The sine of the angle between a rolling disk and its plane, less the least that still has a lowest point."""

    disk: RollingDisk

    @property
    def frames(self) -> tuple[str, ...]:
        """The disk's."""
        return self.disk.frames

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zero it is."""
        return self.disk.steepness(equations.symbols) - FLAT


@dataclass(frozen=True)
class FrictionDemand:
    """Friction less `limit` times the normal force of a rolling disk, N."""

    constraint: str
    limit: float

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames it uses."""
        return ()

    def function(self, equations: EquationSymbols) -> casadi.SX:
        """The function whose zero it is."""
        import casadi

        normal, *friction = casadi.vertsplit(equations.multipliers(self.constraint))
        return casadi.norm_2(casadi.vertcat(*friction)) - self.limit * normal


def read_aligned(read: Fields, robot: Robot, constraints: Sequence[Constraint]) -> Aligned:
    """The condition `aligned`; InputError where no constraint, or more than one, lies between the joints."""
    a, b = read_joint(read, robot, "joint_a"), read_joint(read, robot, "joint_b")
    if a == b:
        raise read.error("joint_b", f"two joints line up, both are '{a.name}'")

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
                f"expected one constraint between what '{a.name}' and '{b.name}' carry, found {there}; name it: constraint",
            )
    links = robot.urdf.joints
    read.done()
    return Aligned(links[a.name].child, links[b.name].child, found[0], tuple(links[a.name].axis))


def read_singular(read: Fields, constraints: Sequence[Constraint]) -> SingularConstraint:
    """The condition `singular_constraints`; InputError where nothing is closed."""
    if not constraints:
        raise read.error("singular_constraints", "the scene has no constraints")
    return SingularConstraint(read.number("singular_constraints", "", positive=True, maximum=1.0))


def read_contact(read: Fields, key: str, constraints: Sequence[Constraint]) -> str:
    """The name of the rolling disk under a key; InputError with those there are."""
    name = read.text(key)
    disks = [constraint.name for constraint in constraints if isinstance(constraint, RollingDisk)]
    if name not in disks:
        raise read.error(key, unknown_name("rolling disk", name, disks))
    return name
