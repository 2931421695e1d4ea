"""Derivatives of motor torques along a motion by a scene's parameters.

In an open chain the motion stays as it is. In a closed linkage the independent joints keep their motion and the others
follow from the constraints: with the residuals φ = 0, ν = J v and α = J a + γ of positions, velocities and
accelerations, and J_d the columns of the dependent joints,

    J_d dq_d = −φ_p,    J_d dv_d = −(ν_q dq + ν_p),    J_d da_d = −(α_q dq + α_v dv + α_p),

and dτ = τ_q dq + τ_v dv + τ_a da + τ_p.
"""

from __future__ import annotations

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
from bellcrank.dynamics.inverse.motor_torques import MotorTorques
from bellcrank.elements.symbols import Symbols

if TYPE_CHECKING:
    import casadi

    from bellcrank.codegen.compile import Compiled
    from bellcrank.robot.robot import RobotJoint
    from bellcrank.scene.scene import Scene


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
