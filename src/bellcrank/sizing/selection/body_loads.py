"""The loads of the axes, and their change per kg and kg m² of a body at each mount.

A body of mass m with its centre of gravity at p, and with inertia I_a about its axis z and I_t across it, needs the
force and moment (Newton and Euler)

    F = m (p̈ − g),    M = I_a (z zᵀ ω̇ + (ω × z) zᵀ ω) + I_t (ω̇ − z zᵀ ω̇ − (ω × z) zᵀ ω),

that is the joint forces Q = J_vᵀ F + J_ωᵀ M, and adds m J_vᵀ J_v + J_ωᵀ (I_a z zᵀ + I_t (1 − z zᵀ)) J_ω to the mass
matrix. All of these are linear in m, I_a and I_t, and so are the torques of motors (those of a linkage by
dynamics/closed_inverse_dynamics.py), the multipliers of constraints and the wrenches through joints. The rotor's spin
relative to its housing has no gyroscopic effect here: only its reflected inertia counts, with the pair.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.mechanism import Mechanism
from bellcrank.numerics import products
from bellcrank.sizing.selection.mounted_bodies import BodyMotion, MountedBody, MountKinematics, States

Array = NDArray[np.float64]


class AxisLoadSamples(NamedTuple):
    """Loads of the k axes at n states, in the axes' units.

    Torque and static torque (n, k), the wrench's force along the joint's axis (n, k) and moment across it (n, k, 3; the
    whole moment on a prismatic joint), NaN for coupled axes, and the felt inertia (n, k).
    """

    torque: Array
    static_torque: Array
    axial_force: Array
    moment: Array
    inertia: Array


class UnitBodyLoads(NamedTuple):
    """What one unit of a body's mass, axial and transverse inertia (the first index) adds to the loads of some axes.

    `axes` (a,) are their numbers; torque, axial force and inertia are (3, n, a), the moment (3, n, a, 3). The static
    torque (n, a) is that of the mass.
    """

    axes: NDArray[np.intp]
    torque: Array
    static_torque: Array
    axial_force: Array
    moment: Array
    inertia: Array


@dataclass(frozen=True, eq=False)
class _Maps:
    """Linear maps at n states from joint forces (nv) to the axes' torques, (k, nv) or (n, k, nv), and to the
    constraints' multipliers (n, rows, nv), None for an open chain.
    """

    torque: Array
    multipliers: Array | None


class LoadModel:
    """The loads of the axes of a mechanism, without the reflected inertia of rotors at its motors.

    Args:
        kinematics: The bodies at the mounts.
        coordinates: The matrix C (k, k) of the axes' coordinates θ = C q of the motors' joints.
    """

    def __init__(self, kinematics: MountKinematics, coordinates: Array) -> None:
        self.mechanism: Mechanism = kinematics.mechanism
        self._kinematics = kinematics
        robot, motors = self.mechanism.robot, self.mechanism.motors
        self._columns = [joint.v for joint in motors]
        self.coordinates = coordinates
        self._force = np.linalg.inv(coordinates).T  # τ_axis = C⁻ᵀ τ_joint, as power is the same: τᵀ q̇ = τ_axisᵀ θ̇
        self._coupled = np.count_nonzero(coordinates, axis=1) > 1
        self._single = np.array(np.abs(coordinates).argmax(axis=1))  # the joint of each axis that is not coupled
        names = list(robot.all_joint_names)
        self._places = [names.index(joint.name) for joint in motors]
        self._directions = np.array([robot.joint_axis(joint.name) for joint in motors])
        self._prismatic = np.array([joint.kind == "prismatic" for joint in motors])

    # ---- loads

    def loads(self, states: States) -> AxisLoadSamples:
        """The loads at n states, with the masses that the robot contains."""
        mechanism, n = self.mechanism, len(states.time)
        maps, rest = self._maps(states), states.at_rest
        wrench = mechanism.reactions(*states)[:, self._places]
        rotor = np.zeros((n, mechanism.robot.nv))
        rotor[:, self._columns] = mechanism.robot.rotor_inertia[self._columns]
        rotor_force = -rotor * states.acceleration
        torque = mechanism.torques(*states)[0] @ self._force.T + self._torque(maps, rotor_force)
        if maps.multipliers is not None and rotor_force.any():
            wrench = wrench + self._constraint_wrenches(maps, states, rotor_force)
        force, moment = self._bearing(wrench)
        return AxisLoadSamples(
            torque=torque,
            static_torque=mechanism.torques(*rest)[0] @ self._force.T,
            axial_force=force,
            moment=moment,
            inertia=self._felt(maps, states, rotor),
        )

    def _felt(self, maps: _Maps, states: States, rotor: Array) -> Array:
        """The diagonal of P M Pᵀ (n, k), M without rotors."""
        mechanism = self.mechanism
        if not mechanism.closed and not self._coupled.any():
            own = np.diagonal(self._force) ** 2
            return np.asarray((mechanism.inertia(states.time, states.position) - rotor[:, self._columns]) * own)
        mass = mechanism.equations.mass_matrix(states.position)
        every = np.arange(mechanism.robot.nv)
        mass[:, every, every] -= rotor
        return np.asarray(((maps.torque @ mass) * maps.torque).sum(axis=-1))

    # ---- bodies

    def unit_bodies(self, states: States) -> tuple[UnitBodyLoads, ...]:
        """What the bodies at the mounts of the axes, in their order, add to the loads at n states."""
        maps = self._maps(states)
        poses, motions = self._kinematics.at(states)
        return tuple(
            self._unit_body(body, motion, maps, poses, states)
            for body, motion in zip(self._kinematics.bodies, motions, strict=True)
        )

    def _unit_body(
        self, body: MountedBody, motion: BodyMotion, maps: _Maps, poses: Array, states: States
    ) -> UnitBodyLoads:
        gravity, columns = self.mechanism.robot.gravity, list(body.columns)
        force, moment = _newton_euler(motion, gravity)
        jacobian = motion.jacobian
        needed = np.einsum("nic,uni->unc", jacobian[:, :3], force) + np.einsum("nic,uni->unc", jacobian[:, 3:], moment)
        held = products(jacobian[:, :3].transpose(0, 2, 1), np.broadcast_to(-gravity, motion.point.shape))
        axes = self._affected(body)
        shares = maps.torque[..., axes, :][..., columns]  # (a, c) or (n, a, c)
        torque = (shares @ needed[..., None])[..., 0]
        static = (shares @ held[..., None])[..., 0]
        wrench = self._tree_wrenches(body, motion, force, moment, poses)
        if maps.multipliers is not None:
            every = np.zeros((*needed.shape[:2], self.mechanism.robot.nv))
            every[:, :, columns] = needed
            wrench += np.stack([self._constraint_wrenches(maps, states, each) for each in every])
        axial, tilting = self._bearing(wrench[:, :, :])
        return UnitBodyLoads(
            axes=axes,
            torque=torque,
            static_torque=static,
            axial_force=axial[..., axes],
            moment=tilting[..., axes, :],
            inertia=_felt_inertias(jacobian @ np.swapaxes(shares, -1, -2), motion.axis),
        )

    def _affected(self, body: MountedBody) -> NDArray[np.intp]:
        """The axes whose loads a body changes: all of a linkage, those below it in an open chain."""
        if not body.columns:
            return np.zeros(0, dtype=np.intp)
        if self.mechanism.closed:
            return np.arange(len(self._columns))
        below = np.isin(self._columns, body.columns)
        return np.flatnonzero((self._force[:, below] != 0.0).any(axis=1))

    def _tree_wrenches(self, body: MountedBody, motion: BodyMotion, force: Array, moment: Array, poses: Array) -> Array:
        """The wrenches (3, n, k, 6) through the motors' joints between the body and the world, in their own frames."""
        n, k = poses.shape[:2]
        wrench = np.zeros((3, n, k, 6))
        for number, place in enumerate(self._places):
            if place + 1 in body.joints:
                arm, rotation = motion.point - poses[:, number, :3], poses[:, number, 3:].reshape(n, 3, 3)
                wrench[:, :, number, :3] = np.einsum("nij,uni->unj", rotation, force)
                wrench[:, :, number, 3:] = np.einsum("nij,uni->unj", rotation, moment + np.cross(arm, force))
        return wrench

    # ---- maps

    def _maps(self, states: States) -> _Maps:
        if isinstance(self.mechanism, Linkage):
            torque, multipliers = self.mechanism.force_maps(states.time, states.position)
            return _Maps(self._force @ torque, multipliers)
        torque = np.zeros((len(self._columns), self.mechanism.robot.nv))
        torque[:, self._columns] = self._force
        return _Maps(torque, None)

    def _torque(self, maps: _Maps, force: Array) -> Array:
        return np.asarray((maps.torque @ force[..., None])[..., 0])

    def _constraint_wrenches(self, maps: _Maps, states: States, force: Array) -> Array:
        """The wrenches (n, k, 6) through the motors' joints of the constraints' answer to joint forces (n, nv)."""
        assert isinstance(self.mechanism, Linkage) and maps.multipliers is not None
        multipliers = products(maps.multipliers, force)
        return self.mechanism.constraint_wrenches(*states[:3], multipliers)[:, self._places]

    def _bearing(self, wrench: Array) -> tuple[Array, Array]:
        """Axial force (…, k) and moment across the axis (…, k, 3) of wrenches (…, k, 6) through the motors' joints."""
        force = (wrench[..., :3] * self._directions).sum(axis=-1)
        moment = wrench[..., 3:]
        along = np.where(self._prismatic, 0.0, (moment * self._directions).sum(axis=-1))
        moment = moment - along[..., None] * self._directions
        force, moment = force[..., self._single], moment[..., self._single, :]
        return np.where(self._coupled, np.nan, force), np.where(self._coupled[:, None], np.nan, moment)


def _newton_euler(motion: BodyMotion, gravity: Array) -> tuple[Array, Array]:
    """Force and moment (3, n, 3) about its centre of gravity that a unit of mass, axial and transverse inertia need."""
    axis, angular, rate = motion.axis, motion.angular_velocity, motion.angular_acceleration
    along = axis * (axis * rate).sum(axis=1, keepdims=True)
    along += np.cross(angular, axis) * (axis * angular).sum(axis=1, keepdims=True)
    none = np.zeros_like(along)
    return np.stack([motion.linear_acceleration - gravity, none, none]), np.stack([none, along, rate - along])


def _felt_inertias(jacobian: Array, axis: Array) -> Array:
    """The inertia (3, n, a) that a unit of mass, axial and transverse inertia adds, for Jacobians (n, 6, a)."""
    linear, angular = (jacobian[:, :3] ** 2).sum(axis=1), (jacobian[:, 3:] ** 2).sum(axis=1)
    along = np.einsum("ni,nia->na", axis, jacobian[:, 3:]) ** 2
    return np.stack([linear, along, angular - along])
