"""A mechanism with motors, as sizing and inverse dynamics see it: an open chain or a closed linkage under forces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.inverse.open_chain_inverse_dynamics import OpenChain
from bellcrank.elements.dry_friction import JointDryFriction
from bellcrank.elements.forces import SphericalSpring
from bellcrank.elements.frame_forces import Spring
from bellcrank.elements.joint_constraints import PrescribedMotion
from bellcrank.elements.joint_forces import Friction, JointForce
from bellcrank.elements.joint_stops import JointStop
from bellcrank.robot.robot import Robot
from bellcrank.scene.scene import Scene

if TYPE_CHECKING:
    from bellcrank.dynamics.inverse.tree_inverse_dynamics import TreeInverseDynamics
    from bellcrank.elements.element import Force
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import RobotJoint


class Mechanism(Protocol):
    """A robot with motors at some joints, under the forces and parameters of a scene.

    All methods take batches: times t (n,) s, positions q (n, nq), velocities v and accelerations a (n, nv). There are k
    motors, in the order of `motors`. Torques are in N m or N. `OpenChain` and `Linkage` implement this protocol.
    """

    @property
    def robot(self) -> Robot:
        """The robot, with payloads."""

    @property
    def scene(self) -> Scene | None:
        """The scene whose forces act; None for a robot alone."""

    @property
    def closed(self) -> bool:
        """Whether constraints close loops."""

    @property
    def motors(self) -> tuple[RobotJoint, ...]:
        """The joints with motors."""

    @property
    def equations(self) -> TreeInverseDynamics:
        """Inverse dynamics of the tree under the scene's forces, without its constraints."""

    @property
    def multiplier_names(self) -> tuple[tuple[str, str], ...]:
        """(constraint, label) of each multiplier."""

    def along(
        self, motion: Motion | str | Path, independent: Sequence[str] | None = None
    ) -> tuple[Motion, tuple[str, ...]]:
        """The motion of all joints, and the independent joints that it follows from. Raises BellcrankError."""

    def torques(self, t: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """The motors' torques (n, k), rotors included, and the constraints' multipliers (n, rows)."""

    def torque_map(self, t: Array, q: Array) -> Callable[[Array], Array]:
        """The function that gives the motors' torques (n, k) for joint forces (n, nv) in these postures; the torques of
        several motions through the same postures need it once.
        """

    def friction(self, t: Array, q: Array, v: Array) -> Array:
        """The part (n, k) of the motors' torques that overcomes friction, also of joints without a motor."""

    def link_torques(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """The part (n, links, k) of the motors' torques that each link's mass and inertia cause."""

    def inertia(self, t: Array, q: Array) -> Array:
        """The inertia (n, k) that accelerates with each motor alone, rotors included: M_ii, or the diagonal of P M
        Pᵀ.
        """

    def reactions(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """The wrench (n, joints, 6) through each joint of the tree, as `Robot.joint_reactions`."""

    def residuals(self, t: Array, q: Array, v: Array, a: Array) -> tuple[float, float]:
        """The largest residual of a constraint, m or rad, and of the equations of motion, relative to their terms."""


def mechanism_of(
    given: Robot | Scene | Mechanism, robot: Robot | None = None, actuated: Sequence[str] | None = None
) -> Mechanism:
    """The mechanism of a robot alone or of a scene: a linkage where constraints other than prescribed motions are
    there.

    `robot` replaces the scene's, for instance by one with payloads; `actuated` names the joints with motors. Raises
    InputError.
    """
    if isinstance(given, OpenChain | Linkage):
        return given
    if isinstance(given, Scene):
        if any(not isinstance(constraint, PrescribedMotion) for constraint in given.constraints):
            return Linkage(given, robot, actuated)
        return OpenChain(given.robot if robot is None else robot, given, actuated or given.config.actuated or None)
    if not isinstance(given, Robot) and not hasattr(given, "inverse_dynamics"):  # other classes may have its methods
        arguments.refuse("robot", "a robot, a scene or a linkage", given, remedy="bc.load_scene reads a scene")
    return OpenChain(cast(Robot, given))


@dataclass(frozen=True)
class AppliedForce:
    """A force of a scene: its name, its kind, and what it acts on, such as "joint 'elbow'"."""

    name: str
    kind: str
    on: str


def applied_forces(mechanism: Mechanism) -> tuple[AppliedForce, ...]:
    """The forces of the scene that act in inverse dynamics, all but rigid stops, in the scene's order."""
    forces = [force for force in mechanism.equations.forces if not isinstance(force, JointStop)]
    return tuple(AppliedForce(force.name, force.kind, acts_on(force)) for force in forces)


def acts_on(force: Force) -> str:
    """What a force acts on, such as "joint 'elbow'"."""
    if isinstance(force, JointForce | SphericalSpring):
        return f"joint '{force.joint.name}'"
    if isinstance(force, Spring):
        other = f"frame '{force.frame_b}'" if len(force.frames) == 2 else "the world"
        return f"frame '{force.frame_a}' and {other}"
    return ", ".join(f"frame '{name}'" for name in force.frames)


def parameter_values(mechanism: Mechanism) -> tuple[tuple[str, float, str], ...]:
    """(name, value, unit) of the scene's parameters, which all apply in inverse dynamics."""
    scene = mechanism.equations.scene
    return () if scene is None else tuple((name, p.value, p.unit) for name, p in scene.parameters.items())


DRY_WIDTH = 1e-6  # rad/s or m/s: speeds beside a reversal, where dry friction is at its largest


@dataclass(frozen=True)
class JointFriction:
    """Friction viscous v + coulomb v / √(v² + width²) of the velocity coordinate `column`."""

    column: int
    viscous: float
    coulomb: float
    width: float


def joint_frictions(mechanism: Mechanism) -> list[JointFriction]:
    """The friction of every joint's coordinates that have one, the robot's and the scene's."""
    robot = mechanism.robot
    found = [
        JointFriction(int(column), float(robot.viscous[column]), float(robot.coulomb[column]), robot.friction_width)
        for column in np.flatnonzero((robot.viscous > 0.0) | (robot.coulomb > 0.0))
    ]
    scene = mechanism.equations.scene
    parameters = () if scene is None else scene.parameters.values()
    set_by = {target: parameter.value for parameter in parameters for target in parameter.sets}
    for force in mechanism.equations.forces:
        if isinstance(force, Friction):
            viscous, coulomb, width = (
                set_by.get(f"force.{force.name}.{key}", getattr(force, key)) for key in Friction.NUMBERS
            )
            found.append(JointFriction(force.joint.v, float(viscous), float(coulomb), float(width)))
        if isinstance(force, JointDryFriction):
            viscous, static = (
                set_by.get(f"force.{force.name}.{key}", force.number(key)) for key in ("viscous", force.at_rest)
            )
            found.append(JointFriction(force.joint.v, float(viscous), float(static), DRY_WIDTH))
    return found


def coulomb_widths(mechanism: Mechanism) -> list[tuple[int, float]]:
    """(index in v, width in rad/s or m/s) of every Coulomb friction, the robot's and the scene's."""
    return [(friction.column, friction.width) for friction in joint_frictions(mechanism) if friction.coulomb > 0.0]
