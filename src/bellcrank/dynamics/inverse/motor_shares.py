"""How the motors of a closed linkage share the joint forces that a motion needs, and how its idle rotations respond.

With motors at the joints of S (nv, k), the motions N = [N_m, N_i] that the constraints allow, of which the idle
rotations N_i leave all motors at rest, the accelerations a, and the joint forces Q = M a + h that they need,

    S τ + Jᵀ λ = Q + M N_i α,    N_iᵀ (Q + M N_i α) = 0,    (N_mᵀ S) τ = N_mᵀ (Q + M N_i α),

where no force but those of springs and friction (in Q) acts on an idle rotation, so that it accelerates by α in
addition. With N_m chosen so that N_mᵀ M N_i = 0 the motors' torques do not depend on α: (N_mᵀ S) τ = N_mᵀ Q. More
motors than driven freedoms share the load with the least Σ τ². Sources: Nakamura & Ghodoussi, IEEE Trans. Robotics
Autom. 5 (1989); hybrid dynamics, Featherstone, Rigid Body Dynamics Algorithms (2008), 9.2.

Kinematics alone give the least joint rates of an idle rotation, as if something held it still. It turns freely instead:
its acceleration follows from its own equation of motion, on which no force but those of springs and friction acts (the
second one above). The mass of a rod about its own axis is small, so that this hardly changes the motors' torques. Where
it does, the weight of what turns matters, and the motion is refused.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bellcrank.arrays import Array
from bellcrank.dynamics.inverse.input_breakpoints import force_times
from bellcrank.dynamics.postures.loop_kinematics import SINGULAR, rank
from bellcrank.errors import InputError, UnreachableError
from bellcrank.numerics import products, pseudo_inverse, svd

if TYPE_CHECKING:
    from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
    from bellcrank.motion.motion import Motion


WELL_CONDITIONED = 1e3  # entry of the inverse of a scaled Jacobian, up to which it loses few digits
MASSLESS = 1e-13  # of the largest inertia of a joint: an idle rotation with less has no inertia
MATTERS = 0.05  # of a motor's largest torque: a rotation that changes it by more is not idle


class IdleResponse(NamedTuple):
    """How idle rotations N_i respond to joint forces Q: N_iᵀ (n, i, nv), N_iᵀ M, and (N_iᵀ M N_i)⁻¹ N_iᵀ."""

    rotations: Array
    momentum: Array
    solved: Array

    def accelerations(self, forces: Array) -> Array:
        """What the rotations add to the accelerations (n, nv) for joint forces (n, nv)."""
        return -products(self.rotations.transpose(0, 2, 1), products(self.solved, forces))

    def released(self, forces: Array) -> Array:
        """The joint forces (n, nv) or (n, nv, c) with these accelerations added."""
        right = forces if forces.ndim == 3 else forces[:, :, None]
        found = right - self.momentum.transpose(0, 2, 1) @ (self.solved @ right)
        return np.asarray(found if forces.ndim == 3 else found[:, :, 0])


class MotorShares(NamedTuple):
    """The motors' torques are `torques` (n, k, nv) times the joint forces Q (n, nv); `idle` is None where no rotation
    is idle.
    """

    torques: Array
    rows: RowSpace
    idle: IdleResponse | None = None

    def released(self, forces: Array) -> Array:
        """The joint forces (n, nv) or (n, nv, c) that are left when idle rotations turn freely."""
        return forces if self.idle is None else self.idle.released(forces)


class RowSpace(NamedTuple):
    """Scaled Jacobians (n, rows, nv) as U diag(s) Vᵀ: U (n, rows, k), 1/s (n, k), 0 where s is, and Vᵀ (n, nv, nv)."""

    u: Array
    inverse: Array
    vt: Array

    def multipliers(self, forces: Array) -> Array:
        """The least λ (n, rows) or (n, rows, c) with the least |Jᵀ λ − f| for scaled forces f (n, nv) or (n, nv, c)."""
        right = forces if forces.ndim == 3 else forces[:, :, None]
        k = self.inverse.shape[1]
        found = self.u @ (self.inverse[:, :, None] * (self.vt[:, :k] @ right))
        return np.asarray(found if forces.ndim == 3 else found[:, :, 0])


def motor_shares(linkage: Linkage, q: Array, jacobian: Array, time: Array | None = None) -> MotorShares:
    """The matrices that give the motors' least torques for joint forces.

    Args:
        linkage: The linkage.
        q: Postures (n, nq).
        jacobian: Jacobians of the constraints (n, m, nv) there, as `kinematics.jacobian` gives.
        time: Times (n,) s for messages.

    Returns:
        The matrices.

    Raises:
        InputError: The constraints leave no degree of freedom.
        UnreachableError: The motors cannot move the linkage.
    """
    driven, idle, solve, rows = _freedoms(linkage, jacobian, time)
    if not idle.shape[1]:
        return MotorShares(solve @ driven, rows)
    mass = linkage.equations.mass_matrix(q)
    coupled = idle @ mass
    values, vectors = np.linalg.eigh(coupled @ idle.transpose(0, 2, 1))
    least = MASSLESS * np.einsum("nvv,nmv->n", mass, idle**2)[:, None]
    inverse = np.where(values > least, 1.0 / np.where(values > least, values, 1.0), 0.0)
    solved = (vectors * inverse[:, None, :]) @ (vectors.transpose(0, 2, 1) @ idle)
    driven = driven - (driven @ coupled.transpose(0, 2, 1)) @ solved
    return MotorShares(solve @ driven, rows, IdleResponse(idle, coupled, solved))


def torque_shares(linkage: Linkage, q: Array, jacobian: Array, time: Array | None = None) -> Array:
    """The matrices (n, k, nv) of `motor_shares` alone, without singular values where that is safe.

    Where the motors' joints m determine the others d, the joint forces Q need the torques Q_m − (J_d⁻¹ J_m)ᵀ Q_d by the
    principle of virtual power. Arguments and errors are those of `motor_shares`.
    """
    found = _of_determined_joints(linkage, jacobian)
    return motor_shares(linkage, q, jacobian, time).torques if found is None else found


def _of_determined_joints(linkage: Linkage, jacobian: Array) -> Array | None:
    """The matrices where J_d is square and far from singular at all n postures; else None."""
    motors, units = linkage.motor_columns, linkage.kinematics.units
    others = np.setdiff1d(np.arange(linkage.robot.nv), motors)
    if len(others) != jacobian.shape[1] or linkage.idle_rotations:
        return None
    scaled = linkage.kinematics.scaled(jacobian)
    try:
        inverse = np.linalg.inv(scaled[:, :, others])
    except np.linalg.LinAlgError:
        return None
    if not np.abs(inverse).max(initial=0.0) <= WELL_CONDITIONED:
        return None
    follow = inverse @ scaled[:, :, motors] * units[others][:, None] / units[motors]
    shares = np.zeros((len(jacobian), len(motors), linkage.robot.nv))
    shares[:, np.arange(len(motors)), motors] = 1.0
    shares[:, :, others] = -follow.transpose(0, 2, 1)
    return shares


def held_shares(linkage: Linkage, jacobian: Array) -> Array:
    """The matrices (n, k, nv) that give the motors' torques where something holds the idle rotations still."""
    driven, _, solve, _ = _freedoms(linkage, jacobian, None)
    return np.asarray(solve @ driven)


def _freedoms(linkage: Linkage, jacobian: Array, time: Array | None) -> tuple[Array, Array, Array, RowSpace]:
    """Bases, as rows, of the motions that the constraints allow: N_mᵀ (n, r, nv), which the motors drive, perpendicular
    to the idle rotations N_iᵀ (n, i, nv), which leave them at rest; the pseudo-inverse of N_mᵀ S; and the rest of J.

    Raises BellcrankError.
    """
    source, units, columns = linkage.scene.source, linkage.kinematics.units, linkage.motor_columns
    jacobian = linkage.kinematics.scaled(jacobian)
    constrained = int(max(rank(jacobian[k]) for k in np.linspace(0, len(jacobian) - 1, 7).astype(int)))
    u, values, vt = svd(jacobian, f"{source}: the constraints are")
    rows = RowSpace(u[:, :, : values.shape[1]], _inverses(values), vt)
    null = vt[:, constrained:, :]  # rows: an orthonormal basis of the motions that the constraints allow
    freedoms = null.shape[1]
    if freedoms == 0:
        raise InputError(f"{source}: the constraints of {linkage.robot.name} leave no degree of freedom")
    driven = freedoms - len(linkage.idle_rotations)
    too_few = len(columns) < driven
    u, values, wt = svd(null[:, :, columns], f"{source}: the motions that the constraints allow are")
    weak = 0 if too_few or driven <= 0 else int(np.argmin(values[:, driven - 1]))
    if too_few or driven <= 0 or values[weak, driven - 1] < SINGULAR:
        raise _cannot_move(linkage, freedoms, too_few, None if time is None else float(time[weak]))
    null = (u.transpose(0, 2, 1) @ null) * units
    each = units[columns]
    if (each == each[0]).all():  # N_mᵀ S is diag(s) Wᵀ in these units
        solve = wt[:, :driven].transpose(0, 2, 1) / (each[0] * values[:, None, :driven])
    else:
        solve = pseudo_inverse(null[:, :driven, columns], f"{source}: the motions of the motors are")
    return null[:, :driven], null[:, driven:], solve, rows


def _inverses(values: Array) -> Array:
    """1/s of singular values (n, k), largest first; 0 where one counts as 0."""
    kept = values > SINGULAR * values[:, :1]
    return np.where(kept, 1.0 / np.where(kept, values, 1.0), 0.0)


def _cannot_move(linkage: Linkage, freedoms: int, too_few: bool, time: float | None) -> UnreachableError:
    """The error where the motors leave degrees of freedom that are no idle rotations."""
    when = "" if time is None or too_few else f" at {time:.6g} s"
    idle = len(linkage.idle_rotations)
    besides = f" ({idle} of them idle rotations, which need no motor)" if idle else ""
    return UnreachableError(
        f"{linkage.scene.source}: motors at {', '.join(joint.name for joint in linkage.motors)} cannot move the "
        f"{freedoms} degree{'s' * (freedoms != 1)} of freedom{besides} of {linkage.robot.name}{when}; actuate "
        f"{'more joints' if too_few else 'another joint, or keep away from that posture'}"
    )


def freed_motion(linkage: Linkage, motion: Motion) -> Motion:
    """The motion with the accelerations of idle rotations that turn freely, and a note that says so.

    Raises InputError where holding them still would change the torque of a motor by more than 5 % of its largest.
    """
    idle = linkage.idle_rotations
    if not idle:
        return motion
    t, q, v, a = force_times(motion.time, motion.time[-1]), motion.position, motion.velocity, motion.acceleration
    jacobian = linkage.kinematics.terms(t, q, v).jacobian
    need = linkage.equations.needed(t, q, v, a)
    shares = motor_shares(linkage, q, jacobian, t)
    assert shares.idle is not None
    torque, held = products(shares.torques, need), products(held_shares(linkage, jacobian), need)
    largest = max(float(np.abs(torque).max()), float(np.abs(held).max()))
    change = float(np.abs(held - torque).max()) / largest if largest else 0.0
    turns = f"{len(idle)} idle rotation{'s' * (len(idle) > 1)}, which no motor drives: {'; '.join(map(str, idle))}"
    if change > MATTERS:
        raise InputError(
            f"motion '{motion.name}': the mechanism has {turns}; held still, they change motor torques by "
            f"{change:.2%} of the largest, so that how they turn matters: give such a joint a motor (actuated), fix "
            "it, or simulate the scene with prescribed motions of the motors, whose multipliers are the torques"
        )
    note = (
        f"motion '{motion.name}' leaves {turns}; they turn freely, from rest, with no force but those of springs and "
        f"friction; held still, they would change motor torques by {change:.2g} of the largest"
    )
    return replace(motion, acceleration=a + shares.idle.accelerations(need), notes=(*motion.notes, note))
