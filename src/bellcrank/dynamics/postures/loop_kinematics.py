"""Kinematics of closed loops: the posture, velocity and acceleration of all joints from those of independent joints.

With independent joints i and dependent joints d, φ(q, t) = 0 gives q_d by Newton's method from the previous posture, so
that the branch is kept, and J v = −φ_t, J a = −γ give their velocities and accelerations. The motions that the
constraints allow are v = N v_i with N_i = 1 and N_d = −J_d⁺ J_i.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bellcrank.cached_values import cached_property
from bellcrank.dynamics.constraints.aligned_constraints import aligned_constraints
from bellcrank.dynamics.constraints.constraint_alignment import alignment_cosines_along
from bellcrank.dynamics.constraints.constraint_derivatives import SymbolicRows, differentiate_constraints
from bellcrank.dynamics.constraints.constraint_rows import characteristic_length, rows_of, velocity_units
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.dynamics.inverse.idle_rotations import IdleRotation, idle_rotations
from bellcrank.dynamics.postures.consistent_start import consistent_start, displaced
from bellcrank.elements.symbols import Symbols
from bellcrank.errors import InputError, UnreachableError
from bellcrank.motion.motion import Motion
from bellcrank.numerics import least_squares, products, pseudo_inverse, singular_values
from bellcrank.robot.robot import RobotJoint

if TYPE_CHECKING:
    import casadi

    from bellcrank.codegen.compile import Compiled
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]
CLOSED = 1e-13  # rad, or of the characteristic length: Newton's method ends below it
ROUNDED = 1e-11  # the same: below it Newton's method also ends where rounding keeps the residual from decreasing
STEP = 0.05  # the same, that independent joints move in one step of continuation
MOST_STEPS = 100_000  # from one row of a motion to the next: 5,000 rad
LEAP = 0.1  # the same, the largest difference between a posture and its prediction: more is another branch
FINEST = 14  # halvings of a step before a posture counts as unreachable
DEAD = 1e-6  # a smallest singular value below this share of the largest: dead point, postures accurate to its root only
SINGULAR = 1e-8  # a singular value below this share of the largest counts as 0


class LoopTerms(NamedTuple):
    """Values of constraints at n states: φ (n, h), (φ̇, ψ) (n, m), J (n, m, nv) and the drift γ (n, m)."""

    position_residual: Array
    velocity_residual: Array
    jacobian: Array
    drift: Array


@dataclass(frozen=True)
class _Leading:
    """The independent joints of a motion, and the motion's name for messages."""

    joints: tuple[RobotJoint, ...]
    motion: str

    @cached_property
    def places(self) -> list[int]:
        """Their indices in q."""
        return [joint.q for joint in self.joints]

    @cached_property
    def columns(self) -> list[int]:
        """Their indices in v."""
        return [joint.v for joint in self.joints]

    def values(self, values: Array) -> str:
        """Their names with values, for messages."""
        return ", ".join(f"{joint.name} {value:.6g}" for joint, value in zip(self.joints, values, strict=True))


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

    def terms(self, t: Array, q: Array, v: Array) -> LoopTerms:
        """The constraints at n states q (n, nq), v (n, nv) and times (n,) s."""
        inputs, parameters = self.scene.signals_at(t), self.scene.parameter_values
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
        leading = _Leading(tuple(joints), motion.name)
        q = self._postures(motion, leading, self.start if start is None else start)
        v, a, follows = self._rates(motion, leading, q)
        self._refuse_turned_around(motion.name, motion.time, q)
        noise = [np.array(motion.position_noise), np.array(motion.speed_noise)]
        dependent = np.setdiff1d(np.arange(self.robot.nv), leading.columns)
        for each in noise if self.robot.nq == self.robot.nv else ():
            each[dependent] = follows @ each[leading.columns]
        return Motion(
            self.robot.joints, motion.time, q, v, a, motion.name, motion.notes, tuple(noise[0]), tuple(noise[1])
        )

    def _postures(self, motion: Motion, leading: _Leading, here: Array) -> Array:
        """The posture (n, nq) of each row of a motion, from the posture `here` (nq,)."""
        q = np.empty((len(motion), self.robot.nq))
        places, units = leading.places, self.units[leading.columns]
        wanted = motion.position[:, places]
        for k in range(len(motion)):
            t = float(motion.time[k])
            away = np.abs((wanted[k] - here[places]) / units)
            if not away.max() <= MOST_STEPS * STEP:
                joint = leading.joints[int(away.argmax())].name
                raise UnreachableError(
                    f"motion '{motion.name}' cannot be followed at {t:.6g} s: joint '{joint}' moves by "
                    f"{away.max():.4g} rad, or characteristic lengths, from one row to the next; expected at most "
                    f"{MOST_STEPS * STEP:g}: give more rows"
                )
            steps = max(1, int(np.ceil(away.max() / STEP)))
            for target in here[places] + np.arange(1, steps + 1)[:, None] / steps * (wanted[k] - here[places]):
                here = self._reach(here, target, leading, t, 0)
            here[places] = wanted[k]
            q[k] = here
        return q

    def _rates(self, motion: Motion, leading: _Leading, q: Array) -> tuple[Array, Array, Array]:
        """v and a (n, nv) at postures (n, nq), and the largest |N_d| (dependent, independent) along the motion."""
        n, time, ind = len(motion), motion.time, leading.columns
        dep = np.setdiff1d(np.arange(self.robot.nv), ind)
        v, a = np.zeros((n, self.robot.nv)), np.zeros((n, self.robot.nv))
        v[:, ind], a[:, ind] = motion.velocity[:, ind], motion.acceleration[:, ind]
        _, residual, jacobian, _ = self.terms(time, q, v)
        scaled = self.scaled(jacobian)[:, :, dep]
        singular = singular_values(scaled, f"motion '{motion.name}': the constraints along it are")
        least = self.constrained - 1  # the others of the dependent joints turn idly
        worst = int(np.argmin(singular[:, least] / singular[:, 0])) if len(dep) else 0
        if len(dep) and singular[worst, least] < DEAD * singular[worst, 0]:
            raise UnreachableError(
                f"motion '{motion.name}' passes a dead point of the linkage at {time[worst]:.6g} s: there "
                f"{leading.values(motion.position[worst, leading.places])} no longer determines the other joints; end "
                "the motion earlier"
            )
        inverse = self.units[dep][:, None] * jacobian_inverse(scaled) / rows_of(self.scene).unit
        v[:, dep] = -products(inverse, residual)
        drift = self.terms(time, q, v).drift
        a[:, dep] = -products(inverse, drift + products(jacobian[:, :, ind], a[:, ind]))
        return v, a, np.abs(inverse @ jacobian[:, :, ind]).max(axis=0)

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

    def _reach(self, q: Array, target: Array, leading: _Leading, t: float, depth: int) -> Array:
        """The posture with the independent joints at `target`, on the branch of q."""
        there = self._newton(q, target, leading, t)
        if there is not None:
            return there
        if depth == FINEST:
            raise UnreachableError(
                f"motion '{leading.motion}' cannot be followed at {t:.6g} s: the constraints can be satisfied up to "
                f"{leading.values(q[leading.places])} but no further towards {leading.values(target)}; the posture is "
                "out of reach, at a dead point, or on another branch than the scene's start"
            )
        middle = self._reach(q, 0.5 * (q[leading.places] + target), leading, t, depth + 1)
        return self._reach(middle, target, leading, t, depth + 1)

    def _newton(self, q: Array, target: Array, leading: _Leading, t: float) -> Array | None:
        """The posture with the independent joints at `target`, near q; None where Newton's method leaves the branch."""
        places, ind = leading.places, leading.columns
        dep = np.setdiff1d(np.arange(self.robot.nv), ind)
        residual, jacobian = self.scaled_position_residual(t, q)
        step = np.zeros(self.robot.nv)
        step[ind] = (target - q[places]) / self.units[ind]
        if not (np.isfinite(residual).all() and np.isfinite(jacobian).all()):
            return None
        what = f"motion '{leading.motion}': the constraints at {t:.6g} s are"
        step[dep] = least_squares(jacobian[:, dep], -residual - jacobian[:, ind] @ step[ind], what, rcond=SINGULAR)
        q = displaced(self.scene, q, self.units * step)
        strayed, before = np.zeros(self.robot.nv), np.inf
        for _ in range(12):
            q[places] = target
            residual, jacobian = self.scaled_position_residual(t, q)
            size = float(np.abs(residual).max(initial=0.0))
            if size <= CLOSED or (size <= ROUNDED and size >= before):
                return q
            before = size
            step = np.zeros(self.robot.nv)
            if not (np.isfinite(residual).all() and np.isfinite(jacobian).all()):
                return None
            step[dep] = least_squares(jacobian[:, dep], -residual, what, rcond=SINGULAR)
            strayed += step
            if not np.abs(strayed).max() <= LEAP:
                return None
            q = displaced(self.scene, q, self.units * step)
        return None


def rank(jacobian: Array) -> int:
    """The number of singular values of a scaled Jacobian (rows, nv) that are not 0."""
    singular = singular_values(jacobian, "the derivative of the constraints is")
    return int(np.count_nonzero(singular > SINGULAR * singular.max(initial=0.0)))


def jacobian_inverse(matrices: Array) -> Array:
    """The pseudo-inverses (n, nv, rows) of scaled Jacobians (n, rows, nv)."""
    return pseudo_inverse(matrices, "the derivative of the constraints is", rcond=SINGULAR)
