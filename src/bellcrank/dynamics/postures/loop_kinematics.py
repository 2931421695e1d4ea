"""Kinematics of closed loops: the posture, velocity and acceleration of all joints from those of independent joints.

With independent joints i and dependent joints d, φ(q, t) = 0 gives q_d by continuation from the previous posture
(posture_search.py), so that the branch is kept, and J v = −φ_t, J a = −γ give their velocities and accelerations. The
motions that the constraints allow are v = N v_i with N_i = 1 and N_d = −J_d⁺ J_i. Many designs of a linkage may be
followed at once; one linkage is one design of itself.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bellcrank.arrays import Array, Indices, Mask
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.constraints.constraint_alignment import alignment_cosines_along
from bellcrank.dynamics.constraints.constraint_derivatives import (
    SymbolicRows,
    aligned_constraints,
    differentiate_constraints,
)
from bellcrank.dynamics.constraints.constraint_rows import characteristic_length, rows_of, velocity_units
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.dynamics.inverse.idle_rotations import IdleRotation, idle_rotations
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.dynamics.postures.posture_search import FARTHEST, Followed, Way, follow_postures, scene_as_design
from bellcrank.dynamics.postures.start_equations import start_equations
from bellcrank.elements.symbols import Symbols
from bellcrank.errors import InputError, UnreachableError
from bellcrank.motion.motion import Motion
from bellcrank.numerics import products, pseudo_inverse, singular_values
from bellcrank.robot.robot import RobotJoint

if TYPE_CHECKING:
    import casadi

    from bellcrank.codegen.compile import Compiled
    from bellcrank.scene.scene import Scene

DEAD = 1e-6  # a smallest singular value below this share of the largest: dead point, postures accurate to its root only
STEEP = 1e3  # rad or characteristic lengths a unit: dependent joints that move faster are near a dead point
SINGULAR = 1e-8  # a singular value below this share of the largest counts as 0


class LoopTerms(NamedTuple):
    """Values of constraints at n states: φ (n, h), (φ̇, ψ) (n, m), J (n, m, nv) and the drift γ (n, m)."""

    position_residual: Array
    velocity_residual: Array
    jacobian: Array
    drift: Array


class FollowedMotions(NamedTuple):
    """Positions, velocities and accelerations (d, n, nv) of d designs at the n rows of a motion; `followed` (d,) says
    for which designs they hold.
    """

    position: Array
    velocity: Array
    acceleration: Array
    followed: Mask


class _Rates(NamedTuple):
    """v and a (n, nv) along a motion, N_d (n, dependent, independent), and the smallest singular value of the scaled
    J_d over its largest (n,).
    """

    velocity: Array
    acceleration: Array
    slope: Array
    regularity: Array


class LoopKinematics:
    """The kinematics of a scene whose constraints close loops, with the characteristic length `length`, m.

    Raises InputError for rolling contact, whose positions depend on the path.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = replace(scene, forces=())
        self.robot = scene.robot
        self.length = characteristic_length(self.scene)
        rows = self.multiplier_names
        if self._terms.output_sizes[0] < len(rows):
            raise InputError(
                f"{scene.source}: constraint '{rows[-1][0]}' rolls, so that positions depend on the path; simulate the "
                "scene with prescribed motions instead: their multipliers are the motors' torques"
            )

    @property
    def multiplier_names(self) -> tuple[tuple[str, str], ...]:
        """(constraint, label) of each multiplier."""
        return system_of(self.scene).multiplier_names

    @cached_property
    def units(self) -> Array:
        """The unit of each degree of freedom (nv): the characteristic length, m, or 1 rad."""
        return velocity_units(self.scene)

    @cached_property
    def start(self) -> Array:
        """The posture (nq,) of the scene's start, which determines the branch."""
        return consistent_start(self.scene)[0]

    # ---- constraints

    @cached_property
    def _terms(self) -> Compiled:
        """(t, q, v, u, p) -> φ (h), (φ̇, ψ) (m), J column after column, γ (m)."""
        key = f"linkage {self.scene.physics_key()} {rows_of(self.scene).signature}"
        return self.robot.compiled(key, self._build)

    def _build(self) -> casadi.Function:
        import casadi

        s = Symbols(self.robot, self.scene.parameters, self.scene.frames, self.scene.initial.clock)
        c = differentiate_constraints(self.scene.constraints, SymbolicRows.unscaled(rows_of(self.scene).kept), s)
        outputs = [c.position_residual, c.velocity_residual, casadi.vec(c.jacobian), c.drift]
        return casadi.Function("linkage", [s.t, s.q, s.v, s.u, s.p], [casadi.densify(x) for x in outputs])

    def terms(self, t: Array, q: Array, v: Array, parameters: Array | None = None) -> LoopTerms:
        """The constraints at n states q (n, nq), v (n, nv) and times (n,) s, with parameters (np,) or the scene's."""
        inputs = self.scene.signals_at(t)
        parameters = self.scene.parameter_values if parameters is None else parameters
        position, velocity, flat, drift = self._terms(t[:, None], q, v, inputs, parameters)
        return LoopTerms(position, velocity, flat.reshape(len(t), self.robot.nv, -1).transpose(0, 2, 1), drift)

    def jacobian(self, t: Array, q: Array) -> Array:
        """J (n, m, nv) at n postures and times (n,) s."""
        return self.terms(t, q, np.zeros((len(q), self.robot.nv))).jacobian

    def scaled(self, jacobian: Array) -> Array:
        """J (…, rows, nv) in rad and characteristic lengths."""
        return jacobian / rows_of(self.scene).unit[:, None] * self.units

    def scaled_position_residual(self, t: float, q: Array) -> tuple[Array, Array]:
        """φ (h) and J (h, nv) at one posture and time (s), in rad and characteristic lengths."""
        at_rest, time = np.zeros(self.robot.nv), np.array([t])
        residual, _, flat, _ = self._terms(
            time, q, at_rest, self.scene.signals_at(time)[0], self.scene.parameter_values
        )
        return residual / rows_of(self.scene).unit, self.scaled(flat.reshape(self.robot.nv, -1).T)

    # ---- degrees of freedom

    @cached_property
    def constrained(self) -> int:
        """The rank of the constraints at the start posture."""
        return rank(self.scaled_position_residual(0.0, self.start)[1])

    def idle_rotations(self, prescribed: Collection[int]) -> tuple[IdleRotation, ...]:
        """The idle rotations at the start posture that leave the velocity coordinates `prescribed` at rest."""
        return idle_rotations(self.scene, self.start, self.scaled_position_residual(0.0, self.start)[1], prescribed)

    def independent(
        self, candidates: Sequence[RobotJoint], name: str, idle: Sequence[IdleRotation] = ()
    ) -> tuple[RobotJoint, ...]:
        """The first candidates that are independent of each other, as many as the linkage has degrees of freedom.

        The `idle` rotations need no joint. Raises InputError, naming the motion, where there are too few.
        """
        jacobian, constrained = self.scaled_position_residual(0.0, self.start)[1], self.constrained
        freedoms = self.robot.nv - constrained
        left, chosen = list(range(self.robot.nv)), list[RobotJoint]()
        for joint in candidates:
            without = [v for v in left if v != joint.v]
            if len(chosen) < freedoms and rank(jacobian[:, without]) == constrained:
                left, chosen = without, [*chosen, joint]
        if len(chosen) + self.idle_count(chosen, idle) < freedoms:
            given = f" ({', '.join(joint.name for joint in chosen)})" if chosen else ""
            dependent = [joint.name for joint in candidates if joint not in chosen]
            depend = f"; {', '.join(dependent)} depend{'s' * (len(dependent) == 1)} on them" if dependent else ""
            more = freedoms - len(chosen) - len(idle)
            kind = "is an idle rotation, which needs" if len(idle) == 1 else "are idle rotations, which need"
            turns = f"; {len(idle)} more {kind} no motor: {'; '.join(map(str, idle))}"
            raise InputError(
                f"motion '{name}': the mechanism has {freedoms} degree{'s' * (freedoms != 1)} of freedom and this "
                f"motion prescribes {len(chosen)}{given}{depend}{turns if idle else ''}; prescribe {more} more: write "
                "also the position of a joint that stays where it is"
            )
        return tuple(chosen)

    @staticmethod
    def idle_count(joints: Sequence[RobotJoint], idle: Sequence[IdleRotation]) -> int:
        """How many idle rotations there are beside the motion of these joints, which they leave at rest."""
        columns = [joint.v for joint in joints]
        return sum(not turn.rates[columns].any() for turn in idle)

    def are_independent(self, columns: Sequence[int]) -> bool:
        """Whether these degrees of freedom are independent of each other at the start posture."""
        jacobian = self.scaled_position_residual(0.0, self.start)[1]
        left = [v for v in range(self.robot.nv) if v not in columns]
        return rank(jacobian[:, left]) == rank(jacobian)

    # ---- motions

    def follow(self, motion: Motion, joints: Sequence[RobotJoint], start: Array | None = None) -> Motion:
        """The motion of all joints in which these (independent) joints move as in `motion`.

        The branch is that of the posture `start` (nq,), by default of the scene's start. Raises UnreachableError where
        the constraints cannot be satisfied, or no longer determine the other joints (dead point).
        """
        start, time = self.start if start is None else start, motion.time
        found = self._postures(motion, joints, start[None], self.scene.parameter_values[None])
        if found.rows[0] < len(motion):
            raise self._unreachable(motion, joints, start, found)
        q, columns = found.postures[0], [joint.v for joint in joints]
        v, a, slope, regularity = self._rates(motion, joints, q, self.scene.parameter_values)
        worst = int(np.argmin(regularity))
        if regularity[worst] < DEAD:
            there = _values(joints, motion.position[worst, [joint.q for joint in joints]])
            raise UnreachableError(
                f"motion '{motion.name}' passes a dead point of the linkage at {time[worst]:.6g} s: there {there} no "
                "longer determines the other joints; end the motion earlier"
            )
        self._refuse_turned_around(motion.name, time, q)
        noise = [np.array(motion.position_noise), np.array(motion.speed_noise)]
        for each in noise if self.robot.nq == self.robot.nv else ():
            each[self._dependent(joints)] = np.abs(slope).max(axis=0) @ each[columns]
        return Motion(self.robot.joints, time, q, v, a, motion.name, motion.notes, tuple(noise[0]), tuple(noise[1]))

    def follow_designs(
        self, motion: Motion, joints: Sequence[RobotJoint], start: Array, parameters: Array
    ) -> FollowedMotions:
        """The motions of designs with consistent starts (d, nq), NaN where there is none, and parameters (d, np).

        That of a design depends on its own numbers alone, to the last bit. A design that cannot be followed, or comes
        near a dead point, is marked; `follow` says why. Welds and hinges are not kept from turning over.
        """
        found = self._postures(motion, joints, start, parameters)
        followed: Mask = found.rows == len(motion)
        units, columns = self.units, [joint.v for joint in joints]
        v, a = np.zeros((2, len(start), len(motion), self.robot.nv))
        for d in np.flatnonzero(followed):
            try:
                rates = self._rates(motion, joints, found.postures[d], parameters[d])
            except InputError:  # the derivative of a constraint is not finite
                followed[d] = False
                continue
            v[d], a[d] = rates.velocity, rates.acceleration
            steep = np.abs(rates.slope) * units[columns] / units[self._dependent(joints), None]
            followed[d] = (rates.regularity >= DEAD).all() and (steep <= STEEP).all() and np.isfinite(a[d]).all()
        return FollowedMotions(found.postures, v, a, followed)

    def _dependent(self, joints: Sequence[RobotJoint]) -> Indices:
        """The degrees of freedom of the other joints."""
        return np.setdiff1d(np.arange(self.robot.nv), [joint.v for joint in joints])

    def _postures(self, motion: Motion, joints: Sequence[RobotJoint], start: Array, parameters: Array) -> Followed:
        """The postures of designs at each row of a motion of these joints."""
        one, scene = scene_as_design(self.scene), self.scene
        p = np.tile(one.parameters, (len(start), 1))
        p[:, : parameters.shape[1]] = parameters
        wanted = motion.position[:, [joint.q for joint in joints]]
        way = Way(motion.time, scene.signals_at(motion.time), wanted, joints)
        return follow_postures(start_equations(scene), one._replace(parameters=p), start, way)

    def _unreachable(
        self, motion: Motion, joints: Sequence[RobotJoint], start: Array, found: Followed
    ) -> UnreachableError:
        """Why a motion cannot be followed beyond a row."""
        row, share, places = int(found.rows[0]), float(found.share[0]), [joint.q for joint in joints]
        before = (motion.position[row - 1] if row else start)[places]
        ahead = motion.position[row, places] - before
        what = f"motion '{motion.name}' cannot be followed at {motion.time[row]:.6g} s: "
        if share == 0.0:
            away = np.abs(ahead / self.units[[joint.v for joint in joints]])
            return UnreachableError(
                f"{what}joint '{joints[int(away.argmax())].name}' moves by {away.max():.4g} rad, or characteristic "
                f"lengths, from one row to the next; expected at most {FARTHEST:g}: give more rows"
            )
        return UnreachableError(
            f"{what}the constraints can be satisfied up to {_values(joints, found.postures[0, row, places])} but no "
            f"further towards {_values(joints, before + share * ahead)}; the posture is out of reach, at a dead point, "
            "or on another branch than the scene's start"
        )

    def _rates(self, motion: Motion, joints: Sequence[RobotJoint], q: Array, parameters: Array) -> _Rates:
        """The rates of all joints at postures (n, nq) along a motion of these joints, with parameters (np,)."""
        time, ind, dep = motion.time, [joint.v for joint in joints], self._dependent(joints)
        v, a = np.zeros((2, len(motion), self.robot.nv))
        v[:, ind], a[:, ind] = motion.velocity[:, ind], motion.acceleration[:, ind]
        _, residual, jacobian, _ = self.terms(time, q, v, parameters)
        scaled = self.scaled(jacobian)[:, :, dep]
        singular = singular_values(scaled, f"motion '{motion.name}': the constraints along it are")
        least = self.constrained - 1  # the others of the dependent joints turn idly
        regularity = singular[:, least] / singular[:, 0] if len(dep) else np.ones(len(motion))
        inverse = self.units[dep][:, None] * jacobian_inverse(scaled, regularity) / rows_of(self.scene).unit
        v[:, dep] = -products(inverse, residual)
        drift = self.terms(time, q, v, parameters).drift
        a[:, dep] = -products(inverse, drift + products(jacobian[:, :, ind], a[:, ind]))
        return _Rates(v, a, -inverse @ jacobian[:, :, ind], regularity)

    def _refuse_turned_around(self, name: str, time: Array, q: Array) -> None:
        """UnreachableError where a weld or hinge is satisfied with its sides half a turn apart."""
        state = np.zeros((len(time), system_of(self.scene).size))
        state[:, : self.robot.nq] = q
        inputs, parameters = self.scene.signals_at(time), system_parameters(self.scene)
        found = alignment_cosines_along(self.scene, time, state, inputs, parameters)
        for constraint, cosine in zip(aligned_constraints(self.scene), found.T, strict=False):
            if not cosine.min() > 0.0:
                raise UnreachableError(
                    f"motion '{name}' satisfies constraint '{constraint}' only with its sides half a turn apart at "
                    f"{time[np.argmin(cosine)]:.6g} s; the linkage cannot follow it there"
                )


def _values(joints: Sequence[RobotJoint], values: Array) -> str:
    """Names of joints with values, for messages."""
    return ", ".join(f"{joint.name} {value:.6g}" for joint, value in zip(joints, values, strict=True))


def rank(jacobian: Array) -> int:
    """The number of singular values of a scaled Jacobian (rows, nv) that are not 0."""
    singular = singular_values(jacobian, "the derivative of the constraints is")
    return int(np.count_nonzero(singular > SINGULAR * singular.max(initial=0.0)))


def jacobian_inverse(matrices: Array, regularity: Array) -> Array:
    """The pseudo-inverses (n, nv, rows) of scaled Jacobians (n, rows, nv) with these ratios of singular values (n,)."""
    if matrices.shape[1] == matrices.shape[2] and (regularity > DEAD).all():
        return np.asarray(np.linalg.inv(matrices), dtype=np.float64)
    return pseudo_inverse(matrices, "the derivative of the constraints is", rcond=SINGULAR)
