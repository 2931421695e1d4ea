"""The joints of a linkage that follow from others, as functions of lengths that a page lets its reader change.

With the independent joints i of a motion and the dependent joints d, a page solves φ(q, p) = 0 by Newton's method from
the posture of the sizing, while the parameters go from their values there to new ones: it calls `step` until the
residual vanishes, and refuses values on whose way the posture leaves its branch (assets/live_loops.js). Velocities and
accelerations are v_d = −J_d⁻¹ J_i v_i and a_d = −J_d⁻¹ (γ + J_i a_i), as in dynamics/postures/loop_kinematics.py.
Angles are in rad, lengths in units of the characteristic length.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.dynamics.constraints.constraint_derivatives import SymbolicRows, differentiate_constraints
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.elements.symbols import Symbols

if TYPE_CHECKING:
    from collections.abc import Sequence

    import casadi

    from bellcrank.motion.motion import Motion


@dataclass(eq=False)
class LiveLoops:
    """The loops of a linkage whose joints all have one degree of freedom.

    Attributes:
        linkage: The linkage.
        symbols: The symbols of its equations.
        lead: The independent joints of the motions, as indices in v.
        rest: The others.
        residual: φ as expressions of `symbols`, of the rows that are kept.
        jacobian: J, the same.
    """

    linkage: Linkage
    symbols: Symbols
    lead: tuple[int, ...]
    rest: tuple[int, ...] = field(init=False)
    residual: casadi.SX = field(init=False)
    jacobian: casadi.SX = field(init=False)

    def __post_init__(self) -> None:
        s, scene = self.symbols, self.linkage.kinematics.scene
        self.rest = tuple(v for v in range(self.linkage.robot.nv) if v not in self.lead)
        c = differentiate_constraints(scene.constraints, SymbolicRows.unscaled(rows_of(scene).kept), s)
        self.residual, self.jacobian, self._drift = c.position_residual, c.jacobian, c.drift
        # Rows that are left out are 0 at the values of the sizing; at other ones they have to stay so.
        self._every = differentiate_constraints(scene.constraints, None, s).position_residual

    def states(
        self, states: Sequence[casadi.SX], closed: casadi.SX, values: casadi.SX
    ) -> tuple[casadi.SX, casadi.SX, casadi.SX]:
        """Position, velocity and acceleration of all joints, those of the independent ones given, and the positions
        `closed` of the others, at values of the parameters.
        """
        import casadi

        s, lead, rest = self.symbols, list(self.lead), list(self.rest)
        q, v, a = (casadi.SX(each) for each in states)
        q[rest] = closed
        terms = casadi.Function("terms", [s.q, s.v, s.p], [casadi.densify(self.jacobian), self._drift])
        jacobian, _ = terms(q, casadi.SX.zeros(v.shape), values)
        v[rest] = -casadi.solve(jacobian[:, rest], jacobian[:, lead] @ v[lead])
        _, drift = terms(q, v, values)
        a[rest] = -casadi.solve(jacobian[:, rest], drift + jacobian[:, lead] @ a[lead])
        return q, v, a

    def step(self, q: casadi.SX, closed: casadi.SX, values: casadi.SX) -> list[casadi.SX]:
        """A step of Newton's method from the positions `closed`, where the others are those of `q`.

        Returns:
            The next positions; the largest residual, the largest step, det J_d, and |det J_d| / ‖J_d‖ⁿ; the positions
            that `q` has.
        """
        import casadi

        s, rest, linkage = self.symbols, list(self.rest), self.linkage
        rows, units = rows_of(linkage.kinematics.scene), linkage.kinematics.units
        at = casadi.SX(q)
        at[rest] = closed
        scaled = self.residual / casadi.DM(rows.unit)
        jacobian = casadi.densify(self.jacobian[:, rest] / casadi.DM(rows.unit)) * casadi.DM(
            np.tile(units[rest], (len(rows.unit), 1))
        )
        function = casadi.Function("close", [s.q, s.p], [scaled, jacobian, self._every / rows.length])
        residual, slope, every = function(at, values)
        step = -casadi.solve(slope, residual)
        size = casadi.mmax(casadi.fabs(casadi.vertcat(residual, every)))
        determinant = casadi.det(slope)
        share = casadi.fabs(determinant) / casadi.sumsqr(slope) ** (0.5 * len(rest))
        about = casadi.vertcat(size, casadi.mmax(casadi.fabs(step)), determinant, share)
        return [closed + casadi.DM(units[rest]) * step, about, q[rest]]


def leading_joints(linkage: Linkage, motions: Sequence[Motion]) -> tuple[int, ...] | None:
    """The indices in v of the joints from which the others follow in all motions; None where they differ, or a motion
    does not follow from joints.
    """
    found = {linkage.leading(motion.name) for motion in motions}
    lead = found.pop() if len(found) == 1 else None
    return None if lead is None else tuple(linkage.robot.joint(name).v for name in lead)
