"""Reactions: the multipliers of constraints for outputs and events, and the wrenches that joints transmit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from bellcrank.dynamics.constraints.constraint_derivatives import rows_by_constraint
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.equations.kkt import Factor
from bellcrank.elements.constraint import Constraint
from bellcrank.elements.symbols import FrameSymbols, Symbols

if TYPE_CHECKING:
    import casadi

    from bellcrank.dynamics.equations.kkt import ConstrainedSolution
    from bellcrank.scene.scene import Scene

PASSES: Final = 6  # of the power iterations
FLOOR: Final = 1e-12  # regularisation of the inverse iteration, as a share of a row's usual J M⁻¹ Jᵀ


class ConstraintReactions:
    """The multipliers of a scene's constraints, N or N m, by the constraint's name, and the distance to a
    singularity.
    """

    def __init__(
        self,
        constraints: Sequence[Constraint],
        solution: ConstrainedSolution,
        multipliers: casadi.SX,
        s: Symbols,
    ) -> None:
        self._solution, self._multipliers = solution, multipliers
        self._rows = rows_by_constraint(constraints, s)

    def of(self, name: str) -> casadi.SX:
        """The multipliers of one constraint in the order of its labels; 0 for rows that were left out."""
        import casadi

        place = {row: k for k, row in enumerate(self._solution.derivatives.rows.kept)}
        return casadi.vertcat(*[self._multipliers[place[r]] if r in place else casadi.SX(0) for r in self._rows[name]])

    @property
    def closeness(self) -> casadi.SX:
        """σ_min/σ_max of J M⁻¹ᐟ², the constraints' Jacobian in the metric of the mass matrix; 1 for a single row.

        Lengths are in units of the characteristic length. The eigenvalues of S = J M⁻¹ Jᵀ are the squares of the
        singular values. Power iterations with S and with (S + εD)⁻¹, D the usual diagonal of S, give the extreme ones
        as Rayleigh quotients. Near a singular position the inverse iteration converges at once; where the two smallest
        values are close the result is an upper bound, and ε limits it at about 1e-6. Source: Golub & Van Loan, Matrix
        Computations, 4th ed., 8.2.
        """
        import casadi

        c, mass = self._solution.derivatives, self._solution.mass
        m, unit = c.jacobian.size1(), c.rows.unit
        jacobian = casadi.sparsify(casadi.diag(1.0 / unit)) @ c.jacobian
        inverse = Factor(mass, jacobian, FLOOR * c.rows.scale / (unit * unit))
        inertia = Factor(mass, casadi.SX(0, mass.size1()), casadi.SX(0, 1))

        def times(x: casadi.SX) -> casadi.SX:
            return jacobian @ inertia.solve(jacobian.T @ x, casadi.SX(0, 1))[0]

        no_force = casadi.SX(mass.size1(), 1)
        # a start that is not orthogonal to a singular direction of any mechanism seen
        start = casadi.SX(np.cos(1.0 + 2.0 * np.arange(m) ** 2))
        least = largest = start
        for _ in range(PASSES if m > 1 else 0):
            least, largest = inverse.solve(no_force, least)[1], times(largest)
            least, largest = least / casadi.norm_2(least), largest / casadi.norm_2(largest)

        def quotient(x: casadi.SX) -> casadi.SX:
            return casadi.dot(x, times(x)) / casadi.dot(x, x)

        return casadi.sqrt(casadi.fmax(quotient(least), 0.0) / quotient(largest))


def joint_reactions(scene: Scene) -> casadi.Function:
    """(t, q, v, u, p, a, λ) -> the wrench through each joint, joint after joint.

    A wrench is the force (N), then the moment (N m), that the parent link exerts on the child link, in the joint's own
    (child) frame, about its origin.

    A virtual displacement δ of a frame changes φ by G δ (a virtual velocity changes ψ likewise), hence constraints
    exert the wrench Gᵀ λ on the frame's link; springs and wrenches of the scene act on the links of their frames. The
    wrench through a joint is what the motion of all links beyond it needs (recursive Newton-Euler), less all external
    wrenches on these links. Forces between joint coordinates (couplings, motors, joint springs, friction) do not pass
    through joints.
    """
    import casadi

    s = Symbols(scene.robot, scene.parameters, scene.frames, scene.initial.clock)
    for source in scene.signal_sources:  # all of them, in the order of the scene's signals
        s.signal(source)
    external = [item for force in scene.forces for item in force.wrenches(s)]
    kept = rows_of(scene).kept if scene.constraints else ()
    a, multipliers = casadi.SX.sym("a", scene.robot.nv), casadi.SX.sym("lambda", len(kept))
    tree = s.algorithm("reactions")(s.q, s.v, a, s.tracer_parameters)
    if scene.constraints:
        external += _constraint_wrenches(scene, s, kept, multipliers)
    wrenches = [(_joints_below(scene, name), s.frame(name).position, w) for name, w in external]
    columns = []
    for k, own in enumerate(s.joint_frames()):
        force, moment = tree[6 * k : 6 * k + 3], tree[6 * k + 3 : 6 * k + 6]
        for joints, point, wrench in wrenches:
            if k + 1 in joints:
                force -= own.rotation.T @ wrench[:3]
                moment -= own.rotation.T @ (wrench[3:] + casadi.cross(point - own.position, wrench[:3]))
        columns += [force, moment]
    return casadi.Function("joint_wrenches", [s.t, s.q, s.v, s.u, s.p, a, multipliers], [casadi.vertcat(*columns)])


class _DisplacedFrames:
    """Frames after small displacements and with additional twists (a FrameSource of `Symbols`)."""

    def __init__(self, s: Symbols, displaced: Mapping[str, FrameSymbols]) -> None:
        self._symbols, self._displaced = s, displaced

    def frame(self, name: str) -> FrameSymbols:
        """The displaced frame, or the frame itself where it has no displacement."""
        return self._displaced[name] if name in self._displaced else self._symbols.frame(name)

    def local_frame(self, name: str) -> tuple[FrameSymbols, casadi.SX]:
        """The same in the world's axes."""
        import casadi

        return self.frame(name), casadi.SX.eye(3)


def _constraint_wrenches(
    scene: Scene, s: Symbols, kept: tuple[int, ...], multipliers: casadi.SX
) -> list[tuple[str, casadi.SX]]:
    """(frame, wrench of all constraints on its link: force, moment about its origin, world axes)."""
    import casadi

    names = list(dict.fromkeys(name for constraint in scene.constraints for name in constraint.frames))
    shift, twist = casadi.SX.sym("shift", 6, len(names)), casadi.SX.sym("speed", 6, len(names))
    displaced = {name: _displaced(s.frame(name), shift[:, k], twist[:, k]) for k, name in enumerate(names)}
    touched = s.with_frames(_DisplacedFrames(s, displaced))
    residuals = [constraint.residual(touched) for constraint in scene.constraints]
    position = casadi.vertcat(casadi.SX(0, 1), *[r.position for r in residuals])
    velocity = casadi.vertcat(casadi.SX(0, 1), *[r.velocity for r in residuals])
    by_shift, by_twist = casadi.jacobian(position, casadi.vec(shift)), casadi.jacobian(velocity, casadi.vec(twist))
    slope = casadi.vertcat(by_shift, by_twist)[list(kept), :]
    both = casadi.vertcat(casadi.vec(shift), casadi.vec(twist))
    load = casadi.substitute(slope, both, casadi.SX.zeros(both.shape)).T @ multipliers
    return [(name, load[6 * k : 6 * k + 6]) for k, name in enumerate(names)]


def _displaced(frame: FrameSymbols, shift: casadi.SX, twist: casadi.SX) -> FrameSymbols:
    """A frame after a small displacement (translation, rotation vector) and with an additional twist, world axes."""
    import casadi

    return FrameSymbols(
        position=frame.position + shift[:3],
        rotation=(casadi.SX.eye(3) + casadi.skew(shift[3:])) @ frame.rotation,
        linear=frame.linear + twist[:3],
        angular=frame.angular + twist[3:],
    )


def _joints_below(scene: Scene, frame: str) -> set[int]:
    """The joints (numbers from 1) between a frame's link and the world."""
    robot = scene.robot
    return set(robot.equations.tree.supporting_joints(robot.frame_index(frame)))
