"""Motor torques of a mechanism as compiled functions of state and parameters, and their derivatives.

Of an open chain the torques are inverse dynamics less the scene's forces (dynamics/inverse/tree_inverse_dynamics.py).
Of a closed linkage they follow from N, the motions that the constraints allow: with independent velocities v_i and
dependent ones v_d, J_d v_d = −J_i v_i, hence N = [1; −J_d⁻¹ J_i], and (Nᵀ S) τ = Nᵀ Q for motors at the joints of S and
the joint forces Q that the motion needs; more motors than degrees of freedom share the load with the least Σ τ²
(Nakamura & Ghodoussi, IEEE Trans. Robotics Autom. 5, 1989, as in dynamics/inverse/closed_inverse_dynamics.py).

Their derivatives: in an open chain the motion stays as it is. In a closed linkage the independent joints keep their
motion and the others follow from the constraints: with the residuals φ = 0, ν = J v and α = J a + γ of positions,
velocities and accelerations, and J_d the columns of the dependent joints,

    J_d dq_d = −φ_p,    J_d dv_d = −(ν_q dq + ν_p),    J_d da_d = −(α_q dq + α_v dv + α_p),

and dτ = τ_q dq + τ_v dv + τ_a da + τ_p.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.constraints.constraint_derivatives import (
    SymbolicRows,
    derivative_along,
    differentiate_constraints,
)
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.elements.joint_constraints import PrescribedMotion
from bellcrank.elements.symbols import Symbols

if TYPE_CHECKING:
    import casadi

    from bellcrank.codegen.compile import Compiled
    from bellcrank.robot.robot import RobotJoint
    from bellcrank.scene.scene import Scene


MOST_ROWS = 12  # of constraints that are solved as one expression


class MotorTorques:
    """The torques of motors at some joints under a scene's forces, constraints and parameters.

    Args:
        scene: The scene; its control and prescribed motions do not count.
        motors: The joints with motors, each of one degree of freedom.
        independent: Of a closed linkage, the joints that the motion of the others follows from.
    """

    def __init__(self, scene: Scene, motors: tuple[RobotJoint, ...], independent: tuple[RobotJoint, ...] = ()) -> None:
        loops = tuple(c for c in scene.constraints if not isinstance(c, PrescribedMotion))
        bare = replace(scene, constraints=loops, control=(), events=(), outputs={})
        self.scene = replace(bare, initial=replace(scene.initial, clock=0.0))
        self.motors, self.independent = motors, independent
        self._columns = [joint.v for joint in motors]

    def __call__(self, t: Array, q: Array, v: Array, a: Array, p: Array) -> Array:
        """Torques (n, k), N m or N, at times t (n,) and states q (n, nq), v and a (n, nv).

        Parameters p are (np,), or (n, np) for other ones at each sample. A row depends on its own sample alone.
        """
        return np.asarray(self._code(t[:, None], q, v, a, self.scene.signals_at(t), p))

    @property
    def solvable(self) -> bool:
        """Whether the constraints leave a square system for the dependent joints, small enough for one expression."""
        if not self.scene.constraints:
            return True
        rows = len(rows_of(self.scene).kept)
        return rows == self.scene.robot.nv - len(self.independent) and rows <= MOST_ROWS

    @cached_property
    def _code(self) -> Compiled:
        independent = [joint.v for joint in self.independent]
        rows = rows_of(self.scene).signature if self.scene.constraints else ""
        key = f"motor torques {self._columns} {independent} {self.scene.physics_key()} {rows}"
        return self.scene.robot.compiled(key, self._build)

    def _build(self) -> casadi.Function:
        """(t, q, v, a, u, p) -> the torques."""
        import casadi

        scene = self.scene
        s, a = Symbols(scene.robot, scene.parameters, scene.frames), casadi.SX.sym("a", scene.robot.nv)
        torque = self.expression(s, a)
        return casadi.Function("motor_torques", [s.t, s.q, s.v, a, s.u, s.p], [casadi.densify(torque)])

    def expression(self, s: Symbols, a: casadi.SX) -> casadi.SX:
        """The torques (k) as an expression of symbols of the scene and accelerations a (nv)."""
        scene = self.scene
        for source in scene.signal_sources:  # all of them, in the order of the scene's signals
            s.signal(source)
        need = s.inverse_dynamics(s.q, s.v, a) + scene.robot.equations.friction(s.v)
        for force in scene.forces:
            need -= force.generalised_force(s).force
        return self._shared(s, need) if scene.constraints else need[self._columns]

    def _shared(self, s: Symbols, need: casadi.SX) -> casadi.SX:
        """The motors' least torques for joint forces `need` of a closed linkage."""
        import casadi

        kept = SymbolicRows.unscaled(rows_of(self.scene).kept)
        jacobian = differentiate_constraints(self.scene.constraints, kept, s).jacobian
        nv, lead = self.scene.robot.nv, [joint.v for joint in self.independent]
        follow = [v for v in range(nv) if v not in lead]
        motions = casadi.SX.zeros(nv, len(lead))
        motions[lead, :] = casadi.SX.eye(len(lead))
        motions[follow, :] = -casadi.solve(casadi.densify(jacobian[:, follow]), casadi.densify(jacobian[:, lead]))
        grip, load = casadi.densify(motions[self._columns, :].T), casadi.densify(motions.T @ need)
        if self._columns == lead:
            return load
        if len(self._columns) == len(lead):
            return casadi.solve(grip, load)
        return grip.T @ casadi.solve(grip @ grip.T, load)


class Loads(NamedTuple):
    """Torques, speeds and accelerations of the motors (n, k), and their derivatives (n, parameters, k)."""

    torque: Array
    torque_slope: Array
    speed_slope: Array
    acceleration_slope: Array


class MotorTorqueDerivatives(MotorTorques):
    """The torques of motors and their derivatives by some of a scene's parameters.

    Args:
        scene: The scene; its control and prescribed motions do not count.
        motors: The joints with motors, each of one degree of freedom.
        independent: Of a closed linkage, the joints that the motion of the others follows from.
        places: Which of the scene's parameters (in their order).
    """

    def __init__(
        self,
        scene: Scene,
        motors: tuple[RobotJoint, ...],
        independent: tuple[RobotJoint, ...],
        places: tuple[int, ...],
    ) -> None:
        super().__init__(scene, motors, independent)
        self._places = places

    def loads(self, t: Array, q: Array, v: Array, a: Array) -> Loads:
        """Torques and derivatives at times t (n,) and states q (n, nq), v and a (n, nv)."""
        p, shape = self.scene.parameter_values, (len(t), len(self._places), len(self.motors))
        found = self._slopes(t[:, None], q, v, a, self.scene.signals_at(t), p)
        torque, *slopes = (np.asarray(each) for each in found)
        return Loads(torque, *(each.reshape(shape) for each in slopes))

    @cached_property
    def _slopes(self) -> Compiled:
        columns, lead = [joint.v for joint in self.motors], [joint.v for joint in self.independent]
        rows = rows_of(self.scene).signature if self.scene.constraints else ""
        key = f"motor torque slopes {self._places} {columns} {lead} {self.scene.physics_key()} {rows}"
        return self.scene.robot.compiled(key, self._derivatives)

    def _derivatives(self) -> casadi.Function:
        """(t, q, v, a, u, p) -> torques, and for each parameter the derivatives of torques, speeds, accelerations."""
        import casadi

        scene, columns = self.scene, [joint.v for joint in self.motors]
        s, a = Symbols(scene.robot, scene.parameters, scene.frames), casadi.SX.sym("a", scene.robot.nv)
        torque = self.expression(s, a)
        slopes, speeds, accelerations = [], [], []
        for place in self._places:
            p = s.p[place]
            dq, dv, da = self._motion_change(s, a, p)
            moved = derivative_along(torque, s, dq)
            moved += casadi.jtimes(torque, casadi.vertcat(s.v, a), casadi.vertcat(dv, da))
            slopes.append(moved + casadi.jacobian(torque, p))
            speeds.append(dv[columns])
            accelerations.append(da[columns])
        outputs = [torque, *(casadi.vertcat(*each) for each in (slopes, speeds, accelerations))]
        inputs = [s.t, s.q, s.v, a, s.u, s.p]
        return casadi.Function("motor_torque_slopes", inputs, [casadi.densify(each) for each in outputs])

    def _motion_change(self, s: Symbols, a: casadi.SX, p: casadi.SX) -> tuple[casadi.SX, casadi.SX, casadi.SX]:
        """The changes (nv) of position, velocity and acceleration with a parameter."""
        import casadi

        nv = self.scene.robot.nv
        none = casadi.SX.zeros(nv, 1)
        if not self.scene.constraints:
            return none, none, none
        kept = SymbolicRows.unscaled(rows_of(self.scene).kept)
        c = differentiate_constraints(self.scene.constraints, kept, s)
        lead = [joint.v for joint in self.independent]
        follow = [k for k in range(nv) if k not in lead]
        dependent = casadi.densify(c.jacobian[:, follow])

        def followed(change: casadi.SX) -> casadi.SX:
            step = casadi.SX.zeros(nv, 1)
            step[follow] = casadi.solve(dependent, -casadi.densify(change))
            return step

        dq = followed(casadi.jacobian(c.position_residual, p))
        rate = c.velocity_residual
        dv = followed(casadi.jacobian(rate, p) + derivative_along(rate, s, dq))
        acceleration = c.jacobian @ a + c.drift
        change = casadi.jacobian(acceleration, p) + derivative_along(acceleration, s, dq)
        return dq, dv, followed(change + casadi.jtimes(acceleration, s.v, dv))
