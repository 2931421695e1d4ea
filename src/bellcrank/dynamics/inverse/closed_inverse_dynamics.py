"""Inverse dynamics of a closed linkage: the torques that its motors must give, and the constraints' multipliers.

Motors at the joints of S (nv, k), with the joint forces Q that the motion needs, satisfy S τ + Jᵀ λ = Q. More motors
than degrees of freedom share the load with the least Σ τ², and idle rotations, such as that of a rod between two balls,
turn freely (motor_shares.py). Source: Nakamura & Ghodoussi, Dynamics computation of closed-link robot mechanisms with
nonredundant and redundant actuators, IEEE Trans. Robotics Autom. 5 (1989).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.constraints.reactions import joint_reactions
from bellcrank.dynamics.inverse.idle_rotations import IdleRotation
from bellcrank.dynamics.inverse.motor_shares import MotorShares, freed_motion, motor_shares, torque_shares
from bellcrank.dynamics.inverse.tree_inverse_dynamics import TreeInverseDynamics
from bellcrank.dynamics.postures.dependent_motion import DependentMotions
from bellcrank.dynamics.postures.loop_kinematics import LoopKinematics
from bellcrank.elements.joint_constraints import PrescribedMotion
from bellcrank.errors import InputError
from bellcrank.motion.motion import Motion
from bellcrank.numerics import products
from bellcrank.robot.robot import Robot, RobotJoint
from bellcrank.scene.scene import Scene

if TYPE_CHECKING:
    from bellcrank.codegen.compile import Compiled


class Linkage:
    """A scene whose constraints close loops, with motors at some joints, for sizing and inverse dynamics.

    Forces and parameters of the scene count; its control does not, and its `prescribed_motion` constraints are removed:
    their joints have motors. All methods take batches of n times and states.

    Args:
        scene: The scene, as `bellcrank.load_scene` reads it.
        robot: A robot in place of the scene's, such as one with payloads.
        actuated: The joints with motors; by default those of the scene's prescribed motions, else its `actuated`, else
            those with actuators.

    Attributes:
        scene: The scene, with `robot`.
        robot: The robot.
        motors: The joints with motors.
        equations: Inverse dynamics of the tree, without its constraints.
        kinematics: The kinematics of the closed loops.

    Raises:
        InputError: No constraint closes a loop, no joint has a motor, or a constraint rolls.

    Example:
        >>> import bellcrank as bc
        >>> from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
        >>> linkage = Linkage(bc.load_scene("five_bar"))
        >>> motion = linkage.motion("pick")
        >>> torque, _ = linkage.torques(motion.time, motion.position, motion.velocity, motion.acceleration)
        >>> torque.shape == (len(motion.time), len(linkage.motors))
        True
    """

    closed = True

    def __init__(self, scene: Scene, robot: Robot | None = None, actuated: Sequence[str] | None = None) -> None:
        if not isinstance(scene, Scene):
            arguments.refuse("scene", "a Scene, as bc.load_scene gives", scene)
        if robot is not None:
            arguments.instance("robot", robot, Robot, "a Robot")
        self.scene: Scene = scene if robot is None else replace(scene, robot=robot)
        if actuated is not None:
            actuated = arguments.several("actuated", actuated, str, "names of joints")
        at_motion_times = replace(self.scene, initial=replace(self.scene.initial, clock=0.0))
        loops = tuple(constraint for constraint in scene.constraints if not isinstance(constraint, PrescribedMotion))
        if not loops:
            raise InputError(
                f"{scene.source}: no constraint closes a loop; use bc.scene_inverse_dynamics, which takes open chains"
            )
        self._loaded = replace(at_motion_times, constraints=loops, control=(), events=(), outputs={})
        self.robot: Robot = self.scene.robot
        self.equations = TreeInverseDynamics(self.robot, at_motion_times)
        self.kinematics = LoopKinematics(self._loaded)
        self.motors: tuple[RobotJoint, ...] = self._motors(actuated)
        self.motor_columns = [joint.v for joint in self.motors]
        self._motions = DependentMotions(at_motion_times, self.kinematics, self.motors)

    @property
    def idle_rotations(self) -> tuple[IdleRotation, ...]:
        """Rotations of links about the line through their connections that no motor drives, such as that of a rod
        between two balls. They turn freely: no force but those of springs and friction acts on them.
        """
        return self._motions.idle_rotations

    def _motors(self, actuated: Sequence[str] | None) -> tuple[RobotJoint, ...]:
        source, config = self.scene.source, self.scene.config
        drives = [constraint for constraint in self.scene.constraints if isinstance(constraint, PrescribedMotion)]
        names = list(
            actuated or [drive.joint.name for drive in drives] or config.actuated or config.joints_with_actuators
        )
        if not names:
            raise InputError(
                f"{source}: no joint of the linkage has a motor; write actuated: [JOINT, …]; expected joints of: "
                f"{', '.join(self.robot.joint_names)}"
            )
        return tuple(self.robot.one_degree_joint(name, f"{source}: actuated") for name in names)

    @property
    def multiplier_names(self) -> tuple[tuple[str, str], ...]:
        """(constraint, label) of each multiplier."""
        return self.kinematics.multiplier_names

    # ---- motions

    def motion(self, motion: Motion | str | Path) -> Motion:
        """The motion of all joints that follows from a motion of independent joints.

        Args:
            motion: A Motion, the name of a motion of the scene, or the path of a CSV file.

        Returns:
            The motion of all joints.

        Raises:
            InputError: The motion does not fit, or prescribes too few joints.
            UnreachableError: The linkage cannot follow it.
        """
        return self.along(motion)[0]

    def along(
        self, motion: Motion | str | Path, independent: Sequence[str] | None = None
    ) -> tuple[Motion, tuple[str, ...]]:
        """The motion of all joints, and the independent joints that it follows from.

        Args:
            motion: A Motion, the name of a motion of the scene, or the path of a CSV file.
            independent: The joints whose positions the motion prescribes; by default those that it moves, motors first.

        Returns:
            The motion, and the names of the independent joints.

        Raises:
            InputError: The motion does not fit, or prescribes too few joints.
            UnreachableError: The linkage cannot follow it.
        """
        found, joints = self._motions.along(motion, independent)
        return freed_motion(self, found), joints

    def leading(self, name: str) -> tuple[str, ...] | None:
        """The independent joints from which all others follow along a motion of the scene.

        Args:
            name: The name of the motion.

        Returns:
            The names of the joints; None where the motion prescribes other joints or frames too, or is none of the
            scene.

        Raises:
            InputError: `name` is no text.
        """
        return self._motions.leading(arguments.text("name", name, "the name of a motion"))

    # ---- forces

    def torques(self, t: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """The motors' torques and the constraints' multipliers.

        Args:
            t: Times (n,), s.
            q: Positions (n, nq), rad or m.
            v: Velocities (n, nv).
            a: Accelerations (n, nv).

        Returns:
            Torques (n, k), N m or N, rotors included, and multipliers (n, rows), N m or N; minimum-norm multipliers
            where constraints are redundant.

        Raises:
            InputError: An array does not fit.
            UnreachableError: The motors cannot move the linkage.
        """
        t, q, v, a = self._rows(t=t, q=q, v=v, a=a)
        jacobian = self.kinematics.terms(t, q, v).jacobian
        return self._torques(self.equations.needed(t, q, v, a), motor_shares(self, q, jacobian, t))

    def _torques(self, need: Array, shares: MotorShares) -> tuple[Array, Array]:
        """Torques and multipliers for joint forces (n, nv), which idle rotations reduce."""
        torque = products(shares.torques, need)
        left = np.array(shares.released(need))
        left[:, self.motor_columns] -= torque
        return torque, shares.rows.multipliers(left * self.kinematics.units) / rows_of(self.kinematics.scene).unit

    def force_maps(self, t: Array, q: Array) -> tuple[Array, Array]:
        """The matrices that give the motors' torques and the constraints' multipliers for joint forces Q (nv).

        Args:
            t: Times (n,), s.
            q: Positions (n, nq), rad or m.

        Returns:
            Matrices (n, k, nv) and (n, rows, nv): `torques` is their products with the joint forces of a motion.

        Raises:
            InputError: An array does not fit.
            UnreachableError: The motors cannot move the linkage.
        """
        t, q = self._rows(t=t, q=q)
        jacobian = self.kinematics.jacobian(t, q)
        found = motor_shares(self, q, jacobian, t)
        shares = found.torques
        left = np.array(found.released(np.tile(np.eye(self.robot.nv), (len(t), 1, 1))))
        left[:, self.motor_columns] -= shares
        scaled = found.rows.multipliers(self.kinematics.units[:, None] * left)
        return shares, np.asarray(scaled / rows_of(self.kinematics.scene).unit[:, None])

    def _shares_at(self, t: Array, q: Array) -> Array:
        return torque_shares(self, q, self.kinematics.jacobian(t, q), t)

    def torque_map(self, t: Array, q: Array) -> Callable[[Array], Array]:
        """The function that gives the motors' torques for joint forces in given postures.

        Args:
            t: Times (n,), s.
            q: Positions (n, nq), rad or m.

        Returns:
            A function of joint forces (n, nv) that returns torques (n, k), N m or N.

        Raises:
            InputError: An array does not fit.
            UnreachableError: The motors cannot move the linkage.
        """
        t, q = self._rows(t=t, q=q)
        shares = self._shares_at(t, q)
        return lambda forces: products(shares, forces)

    def friction(self, t: Array, q: Array, v: Array) -> Array:
        """The part of the motors' torques that overcomes friction, also of joints without a motor.

        Args:
            t: Times (n,), s.
            q: Positions (n, nq), rad or m.
            v: Velocities (n, nv).

        Returns:
            Torques (n, k), N m or N.

        Raises:
            InputError: An array does not fit.
            UnreachableError: The motors cannot move the linkage.
        """
        t, q, v = self._rows(t=t, q=q, v=v)
        return np.asarray(np.einsum("nkv,nv->nk", self._shares_at(t, q), self.equations.friction(t, q, v)))

    def link_torques(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """The part of the motors' torques that each link's mass and inertia cause.

        Args:
            t: Times (n,), s.
            q: Positions (n, nq), rad or m.
            v: Velocities (n, nv).
            a: Accelerations (n, nv).

        Returns:
            Torques (n, links, k), N m or N.

        Raises:
            InputError: An array does not fit.
            UnreachableError: The motors cannot move the linkage.
        """
        t, q, v, a = self._rows(t=t, q=q, v=v, a=a)
        return np.asarray(np.einsum("nkv,nlv->nlk", self._shares_at(t, q), self.equations.link_torques(q, v, a)))

    def inertia(self, t: Array, q: Array) -> Array:
        """The inertia that each motor feels: the diagonal of P M Pᵀ, rotors included.

        Args:
            t: Times (n,), s.
            q: Positions (n, nq), rad or m.

        Returns:
            Inertias (n, k), kg m² or kg.

        Raises:
            InputError: An array does not fit.
            UnreachableError: The motors cannot move the linkage.
        """
        t, q = self._rows(t=t, q=q)
        shares = self._shares_at(t, q)
        return np.asarray(np.einsum("nkv,nvw,nkw->nk", shares, self.equations.mass_matrix(q), shares))

    def reactions(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """The wrench through each joint of the tree, those of constraints and forces included.

        Args:
            t: Times (n,), s.
            q: Positions (n, nq), rad or m.
            v: Velocities (n, nv).
            a: Accelerations (n, nv).

        Returns:
            Wrenches (n, joints, 6): force, N, then moment, N m, as `Robot.joint_reactions` gives.

        Raises:
            InputError: An array does not fit.
            UnreachableError: The motors cannot move the linkage.
        """
        t, q, v, a = self._rows(t=t, q=q, v=v, a=a)
        jacobian, need = self.kinematics.terms(t, q, v).jacobian, self.equations.needed(t, q, v, a)
        shares = motor_shares(self, q, jacobian, t)
        freed = a if shares.idle is None else a + shares.idle.accelerations(need)
        return self._wrenches(t, q, v, freed, self._torques(need, shares)[1])

    def constraint_wrenches(self, t: Array, q: Array, v: Array, multipliers: Array) -> Array:
        """The wrench through each joint of the tree that multipliers of the constraints cause, in which it is linear.

        Args:
            t: Times (n,), s.
            q: Positions (n, nq), rad or m.
            v: Velocities (n, nv).
            multipliers: Multipliers (n, rows), N m or N, as `torques` gives.

        Returns:
            Wrenches (n, joints, 6): force, N, then moment, N m, as `Robot.joint_reactions` gives.

        Raises:
            InputError: An array does not fit.
        """
        t, q, v = self._rows(t=t, q=q, v=v)
        multipliers = arguments.array("multipliers", multipliers, (len(t), len(self.multiplier_names)))
        rest = np.zeros_like(v)
        return self._wrenches(t, q, v, rest, multipliers) - self._wrenches(t, q, v, rest, np.zeros_like(multipliers))

    def _wrenches(self, t: Array, q: Array, v: Array, a: Array, multipliers: Array) -> Array:
        inputs, parameters = self._loaded.signals_at(t), self._loaded.parameter_values
        flat = self._reactions(t[:, None], q, v, inputs, parameters, a, multipliers)
        return np.asarray(flat).reshape(len(t), -1, 6)

    @cached_property
    def _reactions(self) -> Compiled:
        scene = self._loaded
        key = f"joint wrenches {scene.physics_key()} {rows_of(scene).signature}"
        return self.robot.compiled(key, lambda: joint_reactions(scene))

    def residuals(self, t: Array, q: Array, v: Array, a: Array) -> tuple[float, float]:
        """How well a motion satisfies the constraints and the equations.

        Args:
            t: Times (n,), s.
            q: Positions (n, nq), rad or m.
            v: Velocities (n, nv).
            a: Accelerations (n, nv).

        Returns:
            The largest position residual of a constraint, m or rad, and the largest |S τ + Jᵀλ − Q| relative to |Q|.

        Raises:
            InputError: An array does not fit.
            UnreachableError: The motors cannot move the linkage.
        """
        t, q, v, a = self._rows(t=t, q=q, v=v, a=a)
        need = self.equations.needed(t, q, v, a)
        position, _, jacobian, _ = self.kinematics.terms(t, q, v)
        shares = motor_shares(self, q, jacobian, t)
        torque, multipliers = self._torques(need, shares)
        left = shares.released(need) - (jacobian.transpose(0, 2, 1) @ multipliers[:, :, None])[:, :, 0]
        left[:, self.motor_columns] -= torque
        worst, scale = float(np.abs(left).max()), float(np.abs(need).max())
        return float(np.abs(position).max(initial=0.0)), worst / scale if scale else (
            0.0 if worst == 0.0 else float("inf")
        )

    def _rows(self, **states: Array) -> tuple[Array, ...]:
        """Times (n,) and states (n, …) of as many rows, finite. Raises InputError that names the argument."""
        n = len(arguments.array("t", states["t"], (None,), "s"))
        sizes = {"q": self.robot.nq, "v": self.robot.nv, "a": self.robot.nv}
        return tuple(arguments.array(name, x, (n,) if name == "t" else (n, sizes[name])) for name, x in states.items())
