"""A robot: its data, and its dynamics as machine code that is compiled when first called."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Self

import numpy as np

from bellcrank import arguments
from bellcrank._step import SampleCall
from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.codegen.compile import Compiled
from bellcrank.errors import InputError
from bellcrank.notes import Note, as_note
from bellcrank.robot.dynamics.compiled_robot import NO_PARAMETERS, QVA, QVTAU, all_finite
from bellcrank.robot.dynamics.robot_derivatives import RobotDerivatives
from bellcrank.robot.model.joints import RobotJoint
from bellcrank.robot.model.payload import Payload
from bellcrank.robot.model.robot_cache import robot_data

__all__ = ["BLOCK_NUMBERS", "LARGEST_WHOLE", "Robot", "RobotJoint"]

LARGEST_WHOLE = 60  # joints up to which the mass matrix is one expression
BLOCK_NUMBERS = 4_000_000  # of mass matrices in memory at a time


class Robot(RobotDerivatives):
    """A URDF robot and its dynamics, made by `load_robot`.

    Position is (nq,) or (n, nq), velocity, acceleration and torque (nv,) or (n, nv): one number a joint of one degree
    of freedom (rad, m and N m, N). A free base comes first, with position (world, m) and quaternion x y z w, and
    velocity linear (m/s) then angular (rad/s) in the base's own frame.

    Attributes:
        name: Name of the robot in the URDF.
        source: Path of the URDF.
        file: What the robot file says besides the tree: closed loops, springs, motors, notes (`RobotFile`).
        joints: The independent joints, each with its name, kind and place in position and velocity.
        joint_names: Names of the joints with one degree of freedom.
        all_joint_names: Names of all moving joints, mimicking ones too.
        frame_names: Names of all frames: links, joints and added frames.
        massive_links: Names of the moving links and payloads that have mass or inertia.
        nq, nv: Numbers of position and velocity coordinates.
        lower, upper: Position limits (nq,), rad or m, infinite where there is none.
        effort_limit, velocity_limit: Limits (nv,) of torque or force (N m or N) and speed (rad/s or m/s).
        viscous, coulomb: Friction coefficients (nv,), N m s/rad or N s/m, and N m or N.
        friction_width: Speed (rad/s or m/s) over which Coulomb friction is smoothed.
        rotor_inertia: Rotor inertia (nv,) at the joints, kg m² or kg.
        gravity: Acceleration of gravity (3,) in the world, m/s².
        payloads: The payloads that it carries.
        floating_base: Whether the base is free.

    Example:
        >>> import bellcrank as bc
        >>> robot = bc.load_robot("planar_2r")
        >>> robot.joint_names
        ('shoulder', 'elbow')
        >>> robot.inverse_dynamics([0.0, 0.0], [0.0, 0.0], [0.0, 0.0]).shape
        (2,)
    """

    @property
    def notes(self) -> tuple[Note, ...]:
        """What the robot's file says and is not modelled.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_robot("planar_2r").notes
            ()
        """
        return tuple(map(as_note, self.file.notes))

    # ---- torques and accelerations

    def inverse_dynamics(self, q: Any, v: Any, a: Any) -> Array:
        """Joint torques for a motion: tau = M(q) a + C(q, v) v + g(q) + friction(v), rotor inertia in M.

        Source: recursive Newton-Euler algorithm, Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 5, by
        Pinocchio.

        Args:
            q: Position (nq,) or (n, nq).
            v: Velocity (nv,) or (n, nv).
            a: Acceleration (nv,) or (n, nv), rad/s² or m/s².

        Returns:
            Torques or forces (nv,) or (n, nv), N m or N.

        Raises:
            InputError: A shape is wrong, a number is not finite, or a torque overflows.

        Example:
            >>> import bellcrank as bc
            >>> robot = bc.load_robot("planar_2r", friction="none", gravity=(0, 0, 0))
            >>> robot.inverse_dynamics([0.0, 0.0], [0.0, 0.0], [0.0, 0.0])
            array([0., 0.])
        """
        sample = self._sample_inverse_dynamics(q, v, a)
        if sample is not None:
            return sample
        torque: Array = self.dynamics("inverse_dynamics")(*self._check.states(QVA, q, v, a))
        if not all_finite(torque) and not np.isfinite(torque).all():
            raise InputError(f"{self.name}: a torque overflows: the motion is too fast; check its units")
        return torque

    def forward_dynamics(self, q: Any, v: Any, tau: Any) -> Array:
        """Joint accelerations under torques, the robot's friction and gravity.

        Source: articulated-body algorithm, Featherstone (2008), ch. 7, by Pinocchio.

        Args:
            q: Position (nq,) or (n, nq).
            v: Velocity (nv,) or (n, nv).
            tau: Torques or forces (nv,) or (n, nv), N m or N.

        Returns:
            Accelerations (nv,) or (n, nv), rad/s² or m/s².

        Raises:
            InputError: A shape is wrong, a number is not finite, or the mass matrix is singular.

        Example:
            >>> import bellcrank as bc
            >>> robot = bc.load_robot("planar_2r")
            >>> tau = robot.inverse_dynamics([0.3, 0.1], [0.0, 0.0], [1.0, 2.0])
            >>> robot.forward_dynamics([0.3, 0.1], [0.0, 0.0], tau).round(9)
            array([1., 2.])
        """
        sample = self._sample_forward_dynamics(q, v, tau)
        if sample is not None:
            return sample
        acceleration: Array = self.dynamics("forward_dynamics")(*self._check.states(QVTAU, q, v, tau))
        if not all_finite(acceleration) and not np.isfinite(acceleration).all():
            bad = np.argwhere(~np.isfinite(np.atleast_2d(acceleration)))[0]
            joint = next(j.name for j in reversed(self.joints) if j.v <= bad[1])
            raise InputError(
                f"{self.name}: the forward dynamics of sample {bad[0]} has no finite answer at joint '{joint}': "
                "there is no inertia about the joint's axis, and the mass matrix is singular; give the links beyond "
                "the joint mass (`bellcrank check` names them)"
            )
        return acceleration

    def gravity_torque(self, q: Any) -> Array:
        """The torques that hold the robot at rest.

        Args:
            q: Position (nq,) or (n, nq).

        Returns:
            Torques or forces (nv,) or (n, nv), N m or N.

        Raises:
            InputError: A shape is wrong, a number is not finite, or a torque overflows.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_robot("planar_2r", gravity=(0, 0, 0)).gravity_torque([0.5, 0.5])
            array([0., 0.])
        """
        sample = self._sample_gravity_torque(q)
        if sample is not None:
            return sample
        return self._check.answer("a torque", self._gravity_torque(*self._check.states(QVA, q)))

    def friction_torque(self, v: Any) -> Array:
        """Joint friction: viscous v + coulomb v / sqrt(|v|² + width²), at each joint by itself.

        Args:
            v: Velocity (nv,) or (n, nv).

        Returns:
            Torques or forces (nv,) or (n, nv), N m or N, with the sign of the velocity.

        Raises:
            InputError: A shape is wrong, or a number is not finite.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_robot("planar_2r", friction={"elbow": (2.0, 0.0)}).friction_torque([1.0, 1.5])
            array([0., 3.])
        """
        v = self._check.states(("v",), v)[0]
        speed = np.abs(v)
        for joint in self.joints:
            if joint.kind == "spherical":
                part = slice(joint.v, joint.v + joint.nv)
                speed[..., part] = np.linalg.norm(v[..., part], axis=-1, keepdims=True)
        return np.asarray(self.viscous * v + self.coulomb * (v / np.hypot(speed, self.friction_width)))

    def link_torques(self, q: Any, v: Any, a: Any) -> Array:
        """The share of the joint torques that each link's mass and inertia cause.

        Torque is linear in masses and inertias: the shares sum to inverse dynamics without friction and rotor inertia.

        Args:
            q: Position (nq,) or (n, nq).
            v: Velocity (nv,) or (n, nv).
            a: Acceleration (nv,) or (n, nv).

        Returns:
            Torques or forces (links, nv) or (n, links, nv), N m or N; links and payloads in the order of
            `massive_links`.

        Raises:
            InputError: A shape is wrong, a number is not finite, or a torque overflows.

        Example:
            >>> import bellcrank as bc
            >>> robot = bc.load_robot("planar_2r", friction="none")
            >>> shares = robot.link_torques([0.1, 0.2], [0.3, 0.4], [0.5, 0.6])
            >>> torque = robot.inverse_dynamics([0.1, 0.2], [0.3, 0.4], [0.5, 0.6])
            >>> bool((abs(shares.sum(axis=0) - torque) < 1e-9).all())
            True
        """
        q, v, a = self._check.states(QVA, q, v, a)
        if not self.massive_links:
            rows = {len(x) for x in (q, v, a) if x.ndim == 2}
            return np.zeros((*rows, 0, self.nv))
        flat = self._check.answer("a torque", self._code("link_torques", self.equations.link_torques)(q, v, a))
        return flat.reshape(*flat.shape[:-1], len(self.massive_links), self.nv)

    def link_gravity_torques(self, q: Any) -> Array:
        """The share of the gravity torque that each link's mass causes: `link_torques` at rest.

        Args:
            q: Position (nq,) or (n, nq).

        Returns:
            Torques or forces (links, nv) or (n, links, nv), N m or N.

        Raises:
            InputError: A shape is wrong, a number is not finite, or a torque overflows.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_robot("planar_2r").link_gravity_torques([0.1, 0.2]).shape
            (2, 2)
        """
        (q,) = self._check.states(QVA, q)
        if not self.massive_links:
            return np.zeros((*q.shape[:-1], 0, self.nv))
        code = self._code("link_gravity_torques", self.equations.link_gravity_torques)
        flat = self._check.answer("a torque", code(q))
        return flat.reshape(*flat.shape[:-1], len(self.massive_links), self.nv)

    def joint_reactions(self, q: Any, v: Any, a: Any) -> Array:
        """The wrench that each joint transmits from its parent link to its child link.

        Rotor inertia and friction act across the joint and are not in the wrench.

        Args:
            q: Position (nq,) or (n, nq).
            v: Velocity (nv,) or (n, nv).
            a: Acceleration (nv,) or (n, nv).

        Returns:
            Force (N) then moment (N m) on the child link, (len(all_joint_names), 6), or (n, …, 6) for a batch, in the
            joint's own (child) frame, about its origin.

        Raises:
            InputError: A shape is wrong, a number is not finite, or a wrench overflows.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_robot("planar_2r").joint_reactions([0.1, 0.2], [0.0, 0.0], [0.0, 0.0]).shape
            (2, 6)
        """
        wrench = self._algorithm("reactions")(*self._check.states(QVA, q, v, a), NO_PARAMETERS)
        flat = self._check.answer("a wrench", wrench)
        return flat.reshape(*flat.shape[:-1], len(self._tree.joints), 6)

    # ---- inertia and energy

    def mass_matrix(self, q: Any) -> Array:
        """The mass matrix M(q), rotor inertia included.

        Source: composite-rigid-body algorithm, Featherstone (2008), ch. 6, by Pinocchio. Its expression grows with nv²;
        for more than 60 joints column k is what inverse dynamics gives for the acceleration e_k at rest without
        gravity, ch. 6.1 there.

        Args:
            q: Position (nq,) or (n, nq).

        Returns:
            Mass matrices (nv, nv) or (n, nv, nv), kg, kg m and kg m².

        Raises:
            InputError: A shape is wrong, a number is not finite, or an entry overflows.

        Example:
            >>> import bellcrank as bc
            >>> m = bc.load_robot("planar_2r").mass_matrix([0.1, 0.2])
            >>> m.shape, bool(abs(m - m.T).max() < 1e-12)
            ((2, 2), True)
        """
        sample = None if self.nv > LARGEST_WHOLE else self._sample_mass_matrix(q)
        if sample is not None:
            return sample
        (q,) = self._check.states(QVA, q)
        if self.nv > LARGEST_WHOLE:
            whole = np.stack([self._mass_by_columns(row) for row in q]) if q.ndim == 2 else self._mass_by_columns(q)
            return self._check.answer("a mass matrix", whole)
        flat = self._check.answer("a mass matrix", self._algorithm("mass_matrix")(q, NO_PARAMETERS))
        return flat.reshape(*flat.shape[:-1], self.nv, self.nv)

    def inertia_diagonal(self, q: Any) -> Array:
        """The diagonal of the mass matrix for the joints with one degree of freedom, rotor inertia included.

        For more than 60 joints, none of which mimics another, work and memory grow with their number only.

        Args:
            q: Position (nq,) or (n, nq).

        Returns:
            M_kk (k,) or (n, k), kg m² or kg, in the order of `joint_names`.

        Raises:
            InputError: A shape is wrong, a number is not finite, or an inertia overflows.

        Example:
            >>> import bellcrank as bc
            >>> robot = bc.load_robot("planar_2r")
            >>> bool((robot.inertia_diagonal([0.1, 0.2]) == robot.mass_matrix([0.1, 0.2]).diagonal()).all())
            True
        """
        (q,) = self._check.states(QVA, q)
        if self.nv <= LARGEST_WHOLE or self._tree.mimics:
            columns = [joint.v for joint in self.joints if joint.nv == 1]
            rows = max(1, BLOCK_NUMBERS // max(1, self.nv) ** 2)
            states = np.atleast_2d(q)
            blocks = [self.mass_matrix(states[first : first + rows]) for first in range(0, len(states), rows)]
            diagonal = [np.diagonal(block, axis1=-2, axis2=-1)[:, columns] for block in blocks]
            found = np.concatenate([np.zeros((0, len(columns))), *diagonal])
            return found if q.ndim == 2 else np.asarray(found[0])
        return self._check.answer("an inertia", self._code("inertia_diagonal", self.equations.inertia_diagonal)(q))

    def energy(self, q: Any, v: Any) -> tuple[Array, Array]:
        """Kinetic and potential energy, the potential energy being zero at the world's origin.

        Args:
            q: Position (nq,) or (n, nq).
            v: Velocity (nv,) or (n, nv).

        Returns:
            Kinetic and potential energy, J, a number or (n,) each.

        Raises:
            InputError: A shape is wrong, a number is not finite, or an energy overflows.

        Example:
            >>> import bellcrank as bc
            >>> kinetic, potential = bc.load_robot("planar_2r").energy([0.0, 0.0], [0.0, 0.0])
            >>> float(kinetic)
            0.0
        """
        sample = self._sample_energy(q, v)
        if sample is not None:
            return sample[0], sample[1]
        states = self._check.states(QVA, q, v)
        both = self._check.answer("an energy", self._algorithm("energy")(*states, NO_PARAMETERS))
        return both[..., 0], both[..., 1]

    # ---- variants

    def with_payloads(self, payloads: Iterable[Payload]) -> Self:
        """The same robot carrying more payloads.

        Args:
            payloads: Payloads besides those that it carries already.

        Returns:
            A new robot.

        Raises:
            InputError: A payload's frame is unknown.

        Example:
            >>> import bellcrank as bc
            >>> len(bc.load_robot("planar_2r").with_payloads([bc.Payload(1.0, "tip")]).payloads)
            1
        """
        loads = arguments.several("payloads", payloads, Payload, "Payloads")
        options = replace(self.options, payloads=(*self.payloads, *loads))
        robot = type(self)(self.file, robot_data(self.file, options), options)
        robot.mesh_source, robot.mesh_access = self.mesh_source, self.mesh_access
        return robot

    # ---- internals

    @property
    def _gravity_torque(self) -> Compiled:
        return self._code("gravity_torque", self.equations.gravity_torque)

    @cached_property
    def _sample_inverse_dynamics(self) -> SampleCall:
        return self.dynamics("inverse_dynamics").sample_call((self.nv,))

    @cached_property
    def _sample_forward_dynamics(self) -> SampleCall:
        return self.dynamics("forward_dynamics").sample_call((self.nv,))

    @cached_property
    def _sample_gravity_torque(self) -> SampleCall:
        return self._gravity_torque.sample_call((self.nv,))

    @cached_property
    def _sample_mass_matrix(self) -> SampleCall:
        return self._algorithm("mass_matrix").sample_call((self.nv, self.nv))

    @cached_property
    def _sample_energy(self) -> SampleCall:
        return self._algorithm("energy").sample_call((2,))

    def _mass_by_columns(self, q: Array) -> Array:
        code = self._code("inertial_torque", self.equations.inertial_torque)
        columns = code(np.tile(q, (self.nv, 1)), np.eye(self.nv))
        return np.asarray(0.5 * (columns + columns.T))  # symmetric but for rounding
