"""Closed linkages with motors: the posture that follows from some joints, and the torques that some motors need.

With independent joints i and the others d, φ(q, t) = 0 gives q_d by Newton's method from the posture before, so that
the branch is kept, and J v = −φ_t, J a = −γ give their rates. The motions that the constraints allow are v = N v_i with
N_i = 1 and N_d = −J_d⁺ J_i. Motors at the joints of S (nv, k), with joint forces Q that the motion needs,

    S τ + Jᵀ λ = Q,    hence  (Nᵀ S) τ = Nᵀ Q,

as J N = 0. More motors than freedoms share by the least Σ τ². Source: Nakamura & Ghodoussi, Dynamics computation of
closed-link robot mechanisms with nonredundant and redundant actuators, IEEE Trans. Robotics Autom. 5 (1989).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.derived import cached_property
from bellcrank.dynamics.constraint_rows import rows_of
from bellcrank.dynamics.consistent_start import consistent_start, moved
from bellcrank.dynamics.constraint_alignment import alignment_cosines_along, turning
from bellcrank.dynamics.tree_inverse_dynamics import InverseEquations
from bellcrank.dynamics.system import system_of, system_parameters
from bellcrank.elements.joint_relations import Drive
from bellcrank.errors import InputError, UnreachableError
from bellcrank.motion.motion import Motion
from bellcrank.numerics import least_squares, pseudo_inverse, singular_values, svd
from bellcrank.robot.joints import lengths_in_velocity
from bellcrank.robot.robot import RobotJoint

if TYPE_CHECKING:
    import casadi

    from bellcrank.codegen.compile import Compiled
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]
CLOSED = 1e-13  # rad, or of the mechanism's length: Newton's method ends below it
ROUNDED = 1e-11  # the same: and may end below this one, where rounding ends it
STEP = 0.05  # rad, or of the mechanism's length, that independent joints move in one step of continuation
MOST_STEPS = 100_000  # from one row of a motion to the next: 5,000 rad
LEAP = 0.1  # the same, by which a posture may miss its prediction: more is another branch
FINEST = 14  # halvings of a step before it counts as unreachable
DEAD = 1e-6  # a singular value below this share of the largest is a dead point: postures there are right to its root
SINGULAR = 1e-8  # a singular value below this share of the largest counts as 0


class Chain:
    """The linkage of a scene, its `prescribed_motion` constraints taken away, with motors at `actuated` joints.

    Without `actuated` the motors sit where the scene has drives: its `prescribed_motion` constraints, or the configuration's `actuated`, or the
    configuration's drives. Raises InputError where there is no constraint, no motor, or rolling contact, whose positions depend on
    the way that was gone.
    """

    def __init__(self, scene: Scene, actuated: Sequence[str] | None = None) -> None:
        scene = replace(scene, initial=replace(scene.initial, clock=0.0))  # times are those of the motion
        drives = [constraint for constraint in scene.constraints if isinstance(constraint, Drive)]
        loops = tuple(constraint for constraint in scene.constraints if not isinstance(constraint, Drive))
        if not loops:
            raise InputError(
                f"{scene.source}: nothing closes a loop; use bc.scene_inverse_dynamics, which takes open chains"
            )
        self.given = scene
        self.loaded = replace(scene, constraints=loops, control=(), events=(), outputs={})
        self.scene = replace(self.loaded, forces=())  # what the kinematics need
        self.robot = scene.robot
        self.equations = InverseEquations(scene.robot, scene)
        rows = self.multiplier_names
        if self._position_rows < len(rows):
            raise InputError(
                f"{scene.source}: constraint '{rows[-1][0]}' rolls, so that positions depend on the way that was gone; "
                "simulate with drive constraints instead, their multipliers are the motors' torques"
            )
        names = list(
            actuated or [drive.joint.name for drive in drives] or scene.config.actuated or scene.config.actuators
        )
        if not names:
            raise InputError(
                f"{scene.source}: which joints of the linkage have motors? write them as actuated: [JOINT, …], of "
                f"{', '.join(scene.robot.joint_names)}"
            )
        self.actuated = tuple(self.robot.one_degree_joint(name, f"{scene.source}: actuated") for name in names)

    @property
    def multiplier_names(self) -> tuple[tuple[str, str], ...]:
        """(constraint, what it is) of each multiplier."""
        return system_of(self.scene).multiplier_names

    @cached_property
    def _position_rows(self) -> int:
        return int(self.terms.output_sizes[0])

    # ---- equations

    @cached_property
    def terms(self) -> Compiled:
        """(t, q, v, u, p) -> φ (h), (φ̇, ψ) (m), J column after column, γ (m)."""
        key = f"linkage {self.scene.physics_key()} {rows_of(self.scene).signature}"
        return self.robot.compiled(key, self._build)

    def _build(self) -> casadi.Function:
        import casadi

        from bellcrank.dynamics.constraint_derivatives import Rows, close
        from bellcrank.elements.symbols import Symbols

        s = Symbols(self.robot, self.scene.parameters, self.scene.frames, self.scene.initial.clock)
        closed = close(self.scene.constraints, Rows.plain(rows_of(self.scene).kept), s)
        outputs = [closed.position, closed.speed, casadi.vec(closed.jacobian), closed.drift]
        return casadi.Function("linkage", [s.t, s.q, s.v, s.u, s.p], [casadi.densify(x) for x in outputs])

    def at(self, t: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Q (n, nv), φ (n, h), (φ̇, ψ) (n, m), J (n, m, nv), γ (n, m) at n states and times (n,) s.

        Q = M a + bias + friction − all forces of the scene (dynamics/inverse_dynamics.py).
        """
        return self.equations.needed(t, q, v, a), *self.closed(t, q, v)

    def closed(self, t: Array, q: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        """φ (n, h), (φ̇, ψ) (n, m), J (n, m, nv), γ (n, m) at n states and times (n,) s."""
        gap, speed, flat, drift = self.terms(t[:, None], q, v, self.scene.signals_at(t), self.scene.parameter_values)
        return gap, speed, flat.reshape(len(t), self.robot.nv, -1).transpose(0, 2, 1), drift

    def _gap(self, t: float, q: Array) -> tuple[Array, Array]:
        """φ (h) and J (h, nv), in rad and lengths of the mechanism."""
        still, time = np.zeros(self.robot.nv), np.array([t])
        gap, _, flat, _ = self.terms(time, q, still, self.scene.signals_at(time)[0], self.scene.parameter_values)
        return gap / rows_of(self.scene).unit, self._scaled(flat.reshape(self.robot.nv, -1).T)

    def _scaled(self, jacobian: Array) -> Array:
        """J (…, rows, nv) in rad and lengths of the mechanism."""
        return jacobian / rows_of(self.scene).unit[:, None] * self.columns

    @cached_property
    def columns(self) -> Array:
        """How large 1 is in each degree of freedom (nv): the mechanism's length, m, or 1 rad."""
        return np.where(lengths_in_velocity(self.robot), self.length, 1.0)

    @property
    def length(self) -> float:
        """The mechanism's own length, m."""
        return rows_of(self.scene).length

    # ---- kinematics

    @cached_property
    def start(self) -> Array:
        """The posture (nq,) of the scene's start, which says which branch is meant."""
        return consistent_start(self.scene)[0]

    def independent(self, candidates: Sequence[RobotJoint], name: str) -> tuple[RobotJoint, ...]:
        """As many of the candidates, the first that will do, as the linkage has freedoms; InputError where they are too
        few or depend on each other.
        """
        jacobian = self._gap(0.0, self.start)[1]
        rank = _rank(jacobian)
        freedoms = self.robot.nv - rank
        left, chosen = list(range(self.robot.nv)), list[RobotJoint]()
        for joint in candidates:
            without = [v for v in left if v != joint.v]
            if len(chosen) < freedoms and _rank(jacobian[:, without]) == rank:
                left, chosen = without, [*chosen, joint]
        if len(chosen) < freedoms:
            set_by = ", ".join(joint.name for joint in chosen)
            others = ", ".join(joint.name for joint in candidates if joint not in chosen)
            raise InputError(
                f"motion '{name}': the mechanism has {freedoms} degree(s) of freedom and this motion prescribes "
                f"{len(chosen)}{f' ({set_by})' if set_by else ''}{f', on which {others} depend(s)' if others else ''}; "
                f"prescribe {freedoms - len(chosen)} more: name a joint that stays where it is too, with its value"
            )
        return tuple(chosen)

    def are_independent(self, columns: Sequence[int]) -> bool:
        """Whether these degrees of freedom can be chosen at will at the start posture."""
        jacobian = self._gap(0.0, self.start)[1]
        left = [v for v in range(self.robot.nv) if v not in columns]
        return _rank(jacobian[:, left]) == _rank(jacobian)

    def follow(self, motion: Motion, joints: Sequence[RobotJoint], start: Array | None = None) -> Motion:
        """The motion with all other joints following these (independent) ones; the branch is that of the posture
        `start` (nq,), else of the scene's start.

        Raises UnreachableError where the constraints cannot follow, or lose their hold on the others (dead point).
        """
        n = len(motion)
        time, ind = motion.time, [joint.v for joint in joints]
        places = [joint.q for joint in joints]
        wanted = motion.position[:, places]
        q = np.empty((n, self.robot.nq))
        here = self.start if start is None else start
        for k in range(n):
            t = float(time[k])
            away = np.abs((wanted[k] - here[places]) / self.columns[ind])
            if not away.max() <= MOST_STEPS * STEP:
                joint = joints[int(away.argmax())].name
                raise UnreachableError(
                    f"motion '{motion.name}' cannot be followed at {t:.6g} s: joint '{joint}' moves by "
                    f"{away.max():.4g} rad, or of the linkage's length, from one row to the next; expected at most "
                    f"{MOST_STEPS * STEP:g}: give more rows"
                )
            steps = max(1, int(np.ceil(away.max() / STEP)))
            for target in here[places] + np.arange(1, steps + 1)[:, None] / steps * (wanted[k] - here[places]):
                here = self._reach(here, target, places, ind, t, motion.name, 0)
            here[places] = wanted[k]
            q[k] = here
        dep = np.setdiff1d(np.arange(self.robot.nv), ind)
        v, a = np.zeros((n, self.robot.nv)), np.zeros((n, self.robot.nv))
        v[:, ind], a[:, ind] = motion.velocity[:, ind], motion.acceleration[:, ind]
        _, speed, jacobian, _ = self.closed(time, q, v)
        scaled = self._scaled(jacobian)[:, :, dep]
        singular = singular_values(scaled, f"motion '{motion.name}': the constraints along it are")
        worst = int(np.argmin(singular[:, -1] / singular[:, 0])) if len(dep) else 0
        if len(dep) and singular[worst, -1] < DEAD * singular[worst, 0]:
            raise UnreachableError(
                f"motion '{motion.name}' passes a dead point of the linkage at {time[worst]:.6g} s: there "
                f"{_listed(joints, wanted[worst])} no longer says where the others are; end it before"
            )
        inverse = self.columns[dep][:, None] * _inverse(scaled) / rows_of(self.scene).unit
        v[:, dep] = -_times(inverse, speed)
        drift = self.closed(time, q, v)[3]
        a[:, dep] = -_times(inverse, drift + _times(jacobian[:, :, ind], a[:, ind]))
        self._refuse_turned(motion.name, time, q)
        follows = np.abs(inverse @ jacobian[:, :, ind]).max(axis=0)  # what is unknown goes through q̇_d = −J_d⁺ J_i q̇_i
        noise = [np.array(motion.position_noise), np.array(motion.speed_noise)]
        for each in noise if self.robot.nq == self.robot.nv else ():
            each[dep] = follows @ each[ind]
        return Motion(self.robot.joints, time, q, v, a, motion.name, motion.notes, tuple(noise[0]), tuple(noise[1]))

    def _refuse_turned(self, name: str, time: Array, q: Array) -> None:
        """UnreachableError where a weld or hinge is closed with its sides turned half around."""
        state = np.zeros((len(time), system_of(self.scene).size))
        state[:, : self.robot.nq] = q
        found = alignment_cosines_along(self.scene, time, state, self.scene.signals_at(time), system_parameters(self.scene))
        for constraint, cosine in zip(turning(self.scene), found.T, strict=False):
            if not cosine.min() > 0.0:
                raise UnreachableError(
                    f"motion '{name}' closes constraint '{constraint}' with its sides turned half around at "
                    f"{time[np.argmin(cosine)]:.6g} s; the linkage cannot follow it there"
                )

    def _reach(
        self, q: Array, target: Array, places: list[int], ind: list[int], t: float, name: str, depth: int
    ) -> Array:
        """The posture with the independent joints at `target`, on the branch of q."""
        there = self._newton(q, target, places, ind, t, name)
        if there is not None:
            return there
        if depth == FINEST:
            joints = [joint for joint in self.robot.joints if joint.v in ind]
            raise UnreachableError(
                f"motion '{name}' cannot be followed at {t:.6g} s: the constraints hold up to "
                f"{_listed(joints, q[places])} and no further towards {_listed(joints, target)}; the linkage is out of "
                "reach or at a dead point, or the scene's start is on another branch"
            )
        middle = self._reach(q, 0.5 * (q[places] + target), places, ind, t, name, depth + 1)
        return self._reach(middle, target, places, ind, t, name, depth + 1)

    def _newton(self, q: Array, target: Array, places: list[int], ind: list[int], t: float, name: str) -> Array | None:
        dep = np.setdiff1d(np.arange(self.robot.nv), ind)
        gap, jacobian = self._gap(t, q)
        step = np.zeros(self.robot.nv)
        step[ind] = (target - q[places]) / self.columns[ind]
        if not _finite(gap, jacobian):
            return None
        what = f"motion '{name}': the constraints at {t:.6g} s are"
        step[dep] = least_squares(jacobian[:, dep], -gap - jacobian[:, ind] @ step[ind], what, rcond=SINGULAR)
        q = moved(self.scene, q, self.columns * step)
        strayed, before = np.zeros(self.robot.nv), np.inf
        for _ in range(12):
            q[places] = target
            gap, jacobian = self._gap(t, q)
            size = float(np.abs(gap).max(initial=0.0))
            if size <= CLOSED or (size <= ROUNDED and size >= before):
                return q
            before = size
            step = np.zeros(self.robot.nv)
            if not _finite(gap, jacobian):
                return None
            step[dep] = least_squares(jacobian[:, dep], -gap, what, rcond=SINGULAR)
            strayed += step
            if not np.abs(strayed).max() <= LEAP:
                return None
            q = moved(self.scene, q, self.columns * step)
        return None

    # ---- forces

    def shares(self, jacobian: Array, time: Array | None = None) -> Array:
        """P (n, k, nv), τ = P Q, from Jacobians (n, m, nv): the motors' least torques for joint forces Q.

        Raises UnreachableError where the motors cannot move the linkage, with its time (s) where `time` (n,) is given.
        """
        jacobian = self._scaled(jacobian)
        rank = int(max(_rank(jacobian[k]) for k in np.linspace(0, len(jacobian) - 1, 7).astype(int)))
        _, _, vt = svd(jacobian, f"{self.given.source}: the constraints are")
        null = vt[:, rank:, :]  # rows: an orthonormal basis of the motions allowed
        grip = null[:, :, [joint.v for joint in self.actuated]]
        if null.shape[1] == 0:
            raise InputError(f"{self.given.source}: the constraints of {self.robot.name} leave nothing to move")
        singular = singular_values(grip, f"{self.given.source}: the motions that the constraints allow are")
        too_few = grip.shape[2] < grip.shape[1]
        weak = int(np.argmin(singular[:, -1]))
        if too_few or singular[weak, -1] < SINGULAR:
            when = "" if time is None or too_few else f" at {time[weak]:.6g} s"
            raise UnreachableError(
                f"{self.given.source}: motors at {', '.join(joint.name for joint in self.actuated)} cannot move the "
                f"{null.shape[1]} freedom(s) of {self.robot.name}{when}; actuate "
                f"{'more joints' if too_few else 'another joint, or keep away from that posture'}"
            )
        null, motors = null * self.columns, [joint.v for joint in self.actuated]
        return np.asarray(pseudo_inverse(null[:, :, motors], f"{self.given.source}: the constraints are") @ null)

    def torques(self, t: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """τ (n, k) of the motors and λ (n, m), the least ones where constraints are redundant, at n states."""
        need, _, _, jacobian, _ = self.at(t, q, v, a)
        torque = _times(self.shares(jacobian, t), need)
        left = need.copy()
        left[:, [joint.v for joint in self.actuated]] -= torque
        inverse = _inverse(self._scaled(jacobian).transpose(0, 2, 1))
        return torque, _times(inverse, left * self.columns) / rows_of(self.scene).unit


def _rank(jacobian: Array) -> int:
    singular = singular_values(jacobian, "the closures' derivative is")
    return int(np.count_nonzero(singular > SINGULAR * singular.max(initial=0.0)))


def _inverse(matrices: Array) -> Array:
    return pseudo_inverse(matrices, "the closures' derivative is", rcond=SINGULAR)


def _finite(*arrays: Array) -> bool:
    return all(np.isfinite(array).all() for array in arrays)


def _times(matrices: Array, vectors: Array) -> Array:
    return np.asarray((matrices @ vectors[:, :, None])[:, :, 0])


def _listed(joints: Sequence[RobotJoint], values: Array) -> str:
    return ", ".join(f"{joint.name} {value:.6g}" for joint, value in zip(joints, values, strict=True))
