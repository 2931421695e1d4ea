"""The motions of a closed linkage in many designs at once, from one motion of its independent joints.

In each design the dependent joints follow from the constraints with the parameters of that design, as in
dynamics/postures/loop_kinematics.py: from the design's own start, row by row, by Newton's method on φ(q, t, p) = 0 from
the tangent J_d δ_d = −J_i δ_i, in steps of at most `STEP` of the independent joints. Velocities and accelerations are
v_d = −J_d⁻¹ (φ̇ at v_d = 0) and a_d = −J_d⁻¹ (γ + J_i a_i). A design that does not converge, leaves its branch or comes
near a dead point is not followed; `LoopKinematics.follow` says why.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.cached_values import cached_property
from bellcrank.dynamics.constraints.constraint_derivatives import SymbolicRows, differentiate_constraints
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.postures.loop_kinematics import CLOSED, LEAP, MOST_STEPS, ROUNDED, STEP
from bellcrank.elements.symbols import Symbols
from bellcrank.motion.motion import Motion

if TYPE_CHECKING:
    import casadi

    from bellcrank.codegen.compile import Compiled
    from bellcrank.robot.robot import RobotJoint

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
NEWTON = 12  # steps of Newton's method at most
STEEP = 1e3  # rad or characteristic lengths a unit: dependent joints that move faster are near a dead point


@dataclass(frozen=True, eq=False)
class FollowedMotions:
    """Positions, velocities and accelerations (d, n, nv) of d designs at the n rows of a motion; `followed` (d,) says
    for which designs they hold.
    """

    position: Array
    velocity: Array
    acceleration: Array
    followed: Mask


class DependentDesigns:
    """The designs of a linkage whose joints all have one degree of freedom.

    Args:
        linkage: The linkage.
        independent: Joints that determine its posture, as many as it has degrees of freedom.
    """

    def __init__(self, linkage: Linkage, independent: tuple[RobotJoint, ...]) -> None:
        self.scene, self.robot = linkage.kinematics.scene, linkage.robot
        self.lead = [joint.v for joint in independent]
        self.rest = [v for v in range(self.robot.nv) if v not in self.lead]
        self.units, self.row_units = linkage.kinematics.units, rows_of(self.scene).unit

    def follow(self, motion: Motion, start: Array, parameters: Array) -> FollowedMotions:
        """The motions of designs with consistent starts (d, nq), NaN where there is none, and parameters (d, np).

        That of a design depends on its own numbers alone, to the last bit.
        """
        designs, rows = len(start), len(motion)
        good: Mask = np.array(np.isfinite(start).all(axis=1))
        here = np.where(good[:, None], start, 0.0)
        q = np.zeros((designs, rows, self.robot.nq))
        wanted = motion.position[:, self.lead]
        slope = self._slope(motion.time[0], here, parameters)
        for k in range(rows):
            begin = here[:, self.lead].copy()
            away = (np.abs(wanted[k] - begin) / self.units[self.lead]).max(axis=1)
            good &= away <= MOST_STEPS * STEP
            steps = np.where(good, np.maximum(1.0, np.ceil(away / STEP)), 1.0)
            for j in range(1, int(steps.max(initial=1.0)) + 1):
                moves = good & (steps >= j)
                target = begin + np.minimum(j / steps, 1.0)[:, None] * (wanted[k] - begin)
                here, slope, good = self._reach(motion.time[k], here, target, (slope, good, moves), parameters)
            here[:, self.lead] = np.where(good[:, None], wanted[k], here[:, self.lead])
            q[:, k] = here
        return self._with_rates(motion, q, good, parameters)

    def _reach(
        self, time: float, here: Array, target: Array, state: tuple[Array, Mask, Mask], parameters: Array
    ) -> tuple[Array, Array, Mask]:
        """The postures with the independent joints at `target`, the slopes there, and which designs are still followed.

        `state` holds the slopes at `here`, which designs are followed, and which of them move.
        """
        slope, good, moves = state
        there = here.copy()
        change = target - here[:, self.lead]
        there[:, self.lead] = target
        there[:, self.rest] += np.einsum("dri,di->dr", slope, change)
        there = np.where(moves[:, None], there, here)
        strayed, before, going = np.zeros((len(here), len(self.rest))), np.full(len(here), np.inf), moves.copy()
        for _ in range(NEWTON):
            residual, step, new_slope = self._close(time, there, parameters)
            size = np.abs(residual).max(axis=1)
            reached = (size <= CLOSED) | ((size <= ROUNDED) & (size >= before))
            slope = np.where((going & np.isfinite(size))[:, None, None], new_slope, slope)
            lost = going & ~np.isfinite(step).all(axis=1)
            good, going = good & ~lost, going & ~lost
            step = np.where(going[:, None], step, 0.0)  # also the last one: near a dead point it still counts
            there[:, self.rest] += step
            strayed += step
            going &= ~reached
            if not going.any():
                return there, slope, good
            before = np.where(going, size, before)
            lost = going & ~((np.abs(strayed) / self.units[self.rest]).max(axis=1) <= LEAP)
            good, going = good & ~lost, going & ~lost
        return there, slope, good & ~going

    def _with_rates(self, motion: Motion, q: Array, good: Mask, parameters: Array) -> FollowedMotions:
        rows = len(motion)
        v, a = np.zeros_like(q), np.zeros_like(q)
        v[:, :, self.lead], a[:, :, self.lead] = motion.velocity[:, self.lead], motion.acceleration[:, self.lead]
        inputs = self.scene.signals_at(motion.time)
        followed = good.copy()
        for d in np.flatnonzero(good):
            found = self._rates(motion.time[:, None], q[d], v[d], a[d], inputs, parameters[d])
            v[d][:, self.rest], a[d][:, self.rest], slope = (np.asarray(each) for each in found)
            steep = np.abs(slope).reshape(rows, len(self.lead), len(self.rest))
            steep = steep * self.units[self.lead][:, None] / self.units[self.rest]
            followed[d] = np.isfinite(v[d]).all() and np.isfinite(a[d]).all() and bool((steep <= STEEP).all())
        return FollowedMotions(q, v, a, followed)

    # ---- compiled equations

    def _slope(self, time: float, q: Array, parameters: Array) -> Array:
        return self._close(time, q, parameters)[2]

    def _close(self, time: float, q: Array, parameters: Array) -> tuple[Array, Array, Array]:
        """φ (d, h) in its units, the step of Newton's method (d, r), and the dependent joints' slope (d, r, i)."""
        inputs = self.scene.signals_at(np.array([time]))[0]
        residual, step, slope = self._newton(np.array([time]), q, inputs, parameters)
        return residual / self.row_units, step, slope.reshape(len(q), len(self.lead), -1).transpose(0, 2, 1)

    @cached_property
    def _newton(self) -> Compiled:
        """(t, q, u, p) -> φ, −J_d⁻¹ φ, −J_d⁻¹ J_i column after column."""
        return self._compiled("closing", self._newton_step)

    @cached_property
    def _rates(self) -> Compiled:
        """(t, q, v, a, u, p) -> v_d, a_d, −J_d⁻¹ J_i column after column."""
        return self._compiled("rates", self._dependent_rates)

    def _compiled(self, name: str, build: Callable[[], casadi.Function]) -> Compiled:
        key = f"linkage {name} {self.lead} {self.scene.physics_key()} {rows_of(self.scene).signature}"
        return self.robot.compiled(key, build)

    def _newton_step(self) -> casadi.Function:
        import casadi

        s = Symbols(self.robot, self.scene.parameters, self.scene.frames)
        for source in self.scene.signal_sources:
            s.signal(source)
        c = differentiate_constraints(self.scene.constraints, SymbolicRows.unscaled(rows_of(self.scene).kept), s)
        right = casadi.horzcat(c.position_residual, c.jacobian[:, self.lead])
        solved = -casadi.solve(casadi.densify(c.jacobian[:, self.rest]), casadi.densify(right))
        outputs = [c.position_residual, solved[:, 0], casadi.vec(solved[:, 1:])]
        return casadi.Function("closing", [s.t, s.q, s.u, s.p], [casadi.densify(x) for x in outputs])

    def _dependent_rates(self) -> casadi.Function:
        import casadi

        s, a = Symbols(self.robot, self.scene.parameters, self.scene.frames), casadi.SX.sym("a", self.robot.nv)
        for source in self.scene.signal_sources:
            s.signal(source)
        c = differentiate_constraints(self.scene.constraints, SymbolicRows.unscaled(rows_of(self.scene).kept), s)
        dependent = casadi.densify(c.jacobian[:, self.rest])
        velocity = casadi.SX(s.v)
        velocity[self.rest] = 0.0
        found = -casadi.solve(dependent, casadi.densify(casadi.substitute(c.velocity_residual, s.v, velocity)))
        velocity[self.rest] = found
        drift = casadi.substitute(c.drift, s.v, velocity)
        right = casadi.horzcat(drift + c.jacobian[:, self.lead] @ a[self.lead], c.jacobian[:, self.lead])
        solved = -casadi.solve(dependent, casadi.densify(right))
        outputs = [found, solved[:, 0], casadi.vec(solved[:, 1:])]
        return casadi.Function("rates", [s.t, s.q, s.v, a, s.u, s.p], [casadi.densify(x) for x in outputs])
