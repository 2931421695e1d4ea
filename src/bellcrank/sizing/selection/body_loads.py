"""The loads of the axes, and their change per kg and kg m² of a body at each mount.

A body of mass m with its centre of gravity at p, and with inertia I_a about its axis z and I_t across it, needs the
force and moment (Newton and Euler)

    F = m (p̈ − g),    M = I_a (z zᵀ ω̇ + (ω × z) zᵀ ω) + I_t (ω̇ − z zᵀ ω̇ − (ω × z) zᵀ ω),

that is the joint forces Q = J_vᵀ F + J_ωᵀ M, and adds m J_vᵀ J_v + J_ωᵀ (I_a z zᵀ + I_t (1 − z zᵀ)) J_ω to the mass
matrix. All of these are linear in m, I_a and I_t, and so are the torques of motors (those of a linkage by
dynamics/inverse/closed_inverse_dynamics.py), the multipliers of constraints and the wrenches through joints. The
rotor's spin relative to its housing has no gyroscopic effect here: only its reflected inertia counts, with the pair.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bellcrank.arrays import Array, Indices
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.inverse.mechanism import Mechanism
from bellcrank.numerics import products
from bellcrank.sizing.selection.mounted_bodies import BodyMotion, JointMotion, MountedBody, MountKinematics, States


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
    """What a unit of a body's mass, of its axial and of its transverse inertia (the last index) adds to the loads of
    some axes.

    `axes` (a,) are their numbers; torque, axial force and inertia are (n, a, 3), the moment (n, a, 3, 3). The static
    torque (n, a) is that of the mass.
    """

    axes: Indices
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
        wrench = mechanism.reactions(*states)[:, [self._places[joint] for joint in self._single]]
        rotor = np.zeros((n, mechanism.robot.nv))
        rotor[:, self._columns] = mechanism.robot.rotor_inertia[self._columns]
        rotor_force = -rotor * states.acceleration
        torque = mechanism.torques(*states)[0] @ self._force.T + self._torque(maps, rotor_force)
        if maps.multipliers is not None and rotor_force.any():
            wrench = wrench + self._constraint_wrenches(maps, states, rotor_force)
        force, moment = self._bearing(wrench[..., None], np.arange(len(self._columns)))
        return AxisLoadSamples(
            torque=torque,
            static_torque=mechanism.torques(*rest)[0] @ self._force.T,
            axial_force=force[..., 0],
            moment=moment[..., 0],
            inertia=self._felt(maps, states, rotor),
        )

    def joint_torques(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """The torques (n, k) at the motors' joints, without the reflected inertia of their rotors."""
        rotor = self.mechanism.robot.rotor_inertia[self._columns]
        torque = self.mechanism.torques(t, q, v, a)[0]
        if not rotor.any():
            return torque
        own = rotor * a[:, self._columns]
        if isinstance(self.mechanism, Linkage):  # with more motors than degrees of freedom others share this torque
            own = products(self.mechanism.force_maps(t, q)[0][:, :, self._columns], own)
        return np.asarray(torque - own)

    def laden_torques(self, states: States, changes: Mapping[int, Array]) -> Array:
        """The torques (n, k) at the motors' joints, without rotors, with the bodies at the mounts of some axes (by
        number) changed by mass, axial and transverse inertia (3,).
        """
        torque = self.joint_torques(*states)
        if not changes:
            return torque
        force = np.zeros((len(states.time), self.mechanism.robot.nv))
        _, motions = self._kinematics.at(states)
        for number, change in changes.items():
            wrench = _newton_euler(motions[number], self.mechanism.robot.gravity) @ change
            columns = list(self._kinematics.bodies[number].columns)
            force[:, columns] += (motions[number].jacobian.transpose(0, 2, 1) @ wrench[:, :, None])[:, :, 0]
        return np.asarray(torque + self._torque(self._maps(states), force) @ self.coordinates)

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
        joints, motions = self._kinematics.at(states)
        return tuple(
            self._unit_body(body, motion, maps, joints, states)
            for body, motion in zip(self._kinematics.bodies, motions, strict=True)
        )

    def _unit_body(
        self, body: MountedBody, motion: BodyMotion, maps: _Maps, joints: Sequence[JointMotion], states: States
    ) -> UnitBodyLoads:
        columns, jacobian = list(body.columns), motion.jacobian
        transposed, axes = jacobian.transpose(0, 2, 1), self._affected(body)
        wrench = _newton_euler(motion, self.mechanism.robot.gravity)
        needed = transposed @ wrench
        held = transposed[:, :, :3] @ -self.mechanism.robot.gravity
        shares = maps.torque[..., axes, :][..., columns]  # (a, c) or (n, a, c)
        through = self._tree_wrenches(body, motion.point, wrench, joints, axes)
        if maps.multipliers is not None:
            every = np.zeros((3, len(needed), self.mechanism.robot.nv))
            every[:, :, columns] = needed.transpose(2, 0, 1)
            through += np.stack([self._constraint_wrenches(maps, states, each)[:, axes] for each in every], axis=-1)
        axial, tilting = self._bearing(through, axes)
        return UnitBodyLoads(
            axes=axes,
            torque=shares @ needed,
            static_torque=(shares @ held[:, :, None])[:, :, 0],
            axial_force=axial,
            moment=tilting,
            inertia=_felt_inertias(shares @ transposed, motion.axis),
        )

    def _affected(self, body: MountedBody) -> Indices:
        """The axes whose loads a body changes: all of a linkage, those below it in an open chain."""
        if not body.columns:
            return np.zeros(0, dtype=np.intp)
        if self.mechanism.closed:
            return np.arange(len(self._columns))
        below = np.isin(self._columns, body.columns)
        return np.flatnonzero((self._force[:, below] != 0.0).any(axis=1))

    def _tree_wrenches(
        self, body: MountedBody, point: Array, wrench: Array, joints: Sequence[JointMotion], axes: Indices
    ) -> Array:
        """The wrenches (n, a, 6, 3) that wrenches (n, 6, 3) at the body's point cause through the joints of some axes,
        in the joints' own frames; 0 for a joint that is not between the body and the world.
        """
        found = np.zeros((len(point), len(axes), 6, 3))
        for place, axis in enumerate(axes):
            number = self._places[self._single[axis]] + 1
            if number in body.joints:
                to_joint = joints[number].rotation.transpose(0, 2, 1)
                arm = point - joints[number].point
                lever = np.zeros_like(wrench[:, 3:])
                lever[:, :, 0] = np.cross(arm, wrench[:, :3, 0])  # only the mass needs a force
                found[:, place, :3] = to_joint @ wrench[:, :3]
                found[:, place, 3:] = to_joint @ (wrench[:, 3:] + lever)
        return found

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
        """The wrenches (n, k, 6) through the joints of the axes of the constraints' answer to joint forces (n, nv)."""
        assert isinstance(self.mechanism, Linkage) and maps.multipliers is not None
        multipliers = products(maps.multipliers, force)
        every = self.mechanism.constraint_wrenches(*states[:3], multipliers)
        return every[:, [self._places[joint] for joint in self._single]]

    def _bearing(self, wrench: Array, axes: Indices) -> tuple[Array, Array]:
        """Axial force (n, a, u) and moment across the axis (n, a, 3, u) of wrenches (n, a, 6, u) through the joints of
        some axes.
        """
        direction = self._directions[self._single[axes]]
        force = (direction[:, None] @ wrench[:, :, :3])[:, :, 0]
        along = direction[:, None] @ wrench[:, :, 3:]
        along[:, self._prismatic[self._single[axes]]] = 0.0
        moment = wrench[:, :, 3:] - direction[:, :, None] * along
        force[:, self._coupled[axes]] = moment[:, self._coupled[axes]] = np.nan
        return force, moment


def _newton_euler(motion: BodyMotion, gravity: Array) -> Array:
    """The force, then moment about its centre of gravity (n, 6, 3), that a unit of a body's mass, axial and transverse
    inertia needs.
    """
    axis, angular, rate = motion.axis, motion.angular_velocity, motion.angular_acceleration
    along = axis * (axis * rate).sum(axis=1, keepdims=True)
    along += np.cross(angular, axis) * (axis * angular).sum(axis=1, keepdims=True)
    wrench = np.zeros((len(axis), 6, 3))
    wrench[:, :3, 0] = motion.linear_acceleration - gravity
    wrench[:, 3:, 1], wrench[:, 3:, 2] = along, rate - along
    return wrench


def _felt_inertias(motion: Array, axis: Array) -> Array:
    """The inertia (n, a, 3) that a unit of mass, axial and transverse inertia adds, for the motions (n, a, 6) of a body
    per unit speed of each axis.
    """
    linear, angular = (motion[:, :, :3] ** 2).sum(axis=-1), (motion[:, :, 3:] ** 2).sum(axis=-1)
    along = (motion[:, :, 3:] @ axis[:, :, None])[:, :, 0] ** 2
    return np.stack([linear, along, angular - along], axis=-1)
