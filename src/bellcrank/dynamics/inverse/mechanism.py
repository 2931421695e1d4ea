"""A mechanism with motors, as sizing and inverse dynamics see it: an open chain or a closed linkage under forces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.constraints.reactions import joint_reactions
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.inverse.tree_inverse_dynamics import TreeInverseDynamics
from bellcrank.elements.dry_friction import JointDryFriction
from bellcrank.elements.forces import SphericalSpring
from bellcrank.elements.frame_forces import Spring
from bellcrank.elements.joint_constraints import PrescribedMotion
from bellcrank.elements.joint_forces import Friction, JointForce
from bellcrank.elements.joint_stops import JointStop
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.motion.motion import Motion, require_joints
from bellcrank.motion.sampled.csv_file import read_motion
from bellcrank.robot.robot import BLOCK_NUMBERS, LARGEST_WHOLE, Robot, RobotJoint
from bellcrank.scene.scene import Scene

if TYPE_CHECKING:
    from bellcrank.codegen.compile import Compiled
    from bellcrank.elements.element import Force

DRY_WIDTH = 1e-6  # rad/s or m/s: speeds beside a reversal, where dry friction is at its largest


class OpenChain:
    """A robot alone, or a scene whose only constraints are prescribed motions, as a `Mechanism`.

    What holds a joint with several degrees of freedom (a free base) is not considered. Raises InputError where
    `actuated` leaves out a joint, which nothing would hold.
    """

    closed = False
    multiplier_names: tuple[tuple[str, str], ...] = ()

    def __init__(self, robot: Robot, scene: Scene | None = None, actuated: Sequence[str] | None = None) -> None:
        self.robot, self.scene = robot, scene
        self.motors: tuple[RobotJoint, ...] = tuple(joint for joint in robot.joints if joint.nv == 1)
        self.equations = TreeInverseDynamics(robot, scene)
        self._columns = [joint.v for joint in self.motors]
        if actuated is not None:
            for name in actuated:
                robot.one_degree_joint(name, f"{robot.name}: actuated")
            left = [joint.name for joint in self.motors if joint.name not in actuated]
            if left:
                raise InputError(
                    f"{robot.name}: actuated leaves out {', '.join(left)}: every joint of an open chain needs a motor "
                    "to follow a motion; remove actuated"
                )

    def along(
        self, motion: Motion | str | Path, independent: Sequence[str] | None = None
    ) -> tuple[Motion, tuple[str, ...]]:
        """The motion: a Motion, a motion of the scene by name, or a CSV file. Raises BellcrankError."""
        every = tuple(joint.name for joint in self.motors)
        if independent is not None and set(independent) != set(every):
            raise InputError(
                f"{self.robot.name}: independent: all joints of an open chain are independent ({', '.join(every)}); "
                "remove this argument"
            )
        motions = {} if self.scene is None else self.scene.config.motions
        if isinstance(motion, Motion):
            whole = motion
        elif not isinstance(motion, (str, Path)):
            arguments.refuse("motion", "a Motion, the name of a motion, or the path of a CSV file", motion)
        elif str(motion) in motions and self.scene is not None:
            whole = self.scene.motion(str(motion))
        elif arguments.path("motion", motion, "a motion's name or the path of a CSV file").suffix or "/" in str(motion):
            whole = read_motion(self.robot, Path(motion), Path(motion).stem)
        else:
            source = self.robot.source if self.scene is None else self.scene.source
            raise InputError(f"{source}: {unknown_name('motion', str(motion), motions)}, nor a file of that name")
        require_joints(whole, self.robot)
        return whole, every

    def torques(self, t: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """The motors' torques (n, k), and no multipliers (n, 0)."""
        return self.equations.needed(t, q, v, a)[:, self._columns], np.zeros((len(t), 0))

    def torque_map(self, t: Array, q: Array) -> Callable[[Array], Array]:
        """The function that gives the motors' torques (n, k) for joint forces (n, nv)."""
        return lambda forces: forces[:, self._columns]

    def friction(self, t: Array, q: Array, v: Array) -> Array:
        """The part (n, k) of the motors' torques that overcomes friction."""
        return self.equations.friction(t, q, v)[:, self._columns]

    def link_torques(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """The part (n, links, k) of the motors' torques that each link's mass and inertia cause."""
        return self.equations.link_torques(q, v, a)[:, :, self._columns]

    def inertia(self, t: Array, q: Array) -> Array:
        """M_ii (n, k), kg m² or kg, rotors included."""
        if self.robot.nv > LARGEST_WHOLE and not self.equations.sets_tree:
            return self.robot.inertia_diagonal(q)
        rows = max(1, BLOCK_NUMBERS // self.robot.nv**2)
        blocks = (self.equations.mass_matrix(q[first : first + rows]) for first in range(0, len(q), rows))
        diagonal = [np.diagonal(block, axis1=-2, axis2=-1)[:, self._columns] for block in blocks]
        return np.concatenate([np.zeros((0, len(self._columns))), *diagonal])

    def gravity_torque(self, q: Array) -> Array:
        """The torques (n, nv) that hold the robot at rest against gravity, without the forces of the scene."""
        t, at_rest = np.zeros(len(q)), np.zeros((len(q), self.robot.nv))
        return self.equations.needed(t, q, at_rest, at_rest) + self.equations.applied(t, q, at_rest)

    def link_gravity_torques(self, q: Array) -> Array:
        """The part (n, links, nv) of these torques that each link causes."""
        at_rest = np.zeros((len(q), self.robot.nv))
        return self.equations.link_torques(q, at_rest, at_rest)

    def reactions(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """The wrench (n, joints, 6) through each joint of the tree, forces at frames included."""
        plain = self.equations.scene is None or not (
            any(force.frames for force in self.equations.forces) or self.equations.sets_tree
        )
        if plain:
            return np.asarray(self.robot.joint_reactions(q, v, a))
        flat = self._reactions(t[:, None], q, v, self._signals(t), self.equations.parameters, a, np.zeros((len(t), 0)))
        return np.asarray(flat).reshape(len(t), -1, 6)

    def _signals(self, t: Array) -> Array:
        assert self.equations.scene is not None
        return self.equations.scene.signals_at(t)

    @cached_property
    def _reactions(self) -> Compiled:
        scene = self.equations.scene
        assert scene is not None
        return self.robot.compiled("joint wrenches " + scene.physics_key(), lambda: joint_reactions(scene))

    def residuals(self, t: Array, q: Array, v: Array, a: Array) -> tuple[float, float]:
        """0, as there are no constraints, and the largest force at a joint without a motor, relative to the largest of
        all.

        Such a joint is a free base.
        """
        need = np.abs(self.equations.needed(t, q, v, a))
        left = np.delete(need, self._columns, axis=1)
        return 0.0, float(left.max(initial=0.0) / (need.max(initial=0.0) or 1.0))


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
