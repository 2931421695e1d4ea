"""The quantities of a run whose least and largest values say how far it went and how far it can be trusted.

They are one vector function of (t, x, u, p): the columns of the scene's outputs; three sums of energies; the residuals
of the constraints that are kept, m or rad; for each unit vector of the position its length less 1; and for each weld
and hinge the cosine of the angle between its sides.

With T, V and W the kinetic energy, the potential energy and the work, the sums are B = T + V − W, P = T + V + |W| and
N = T − V + |W|. Since |a| = max(a, −a), the extremes of B, P and N and the energies at the start give the energy drift
(`Trajectory.energy_drift`) of a run:

    max |T + V − T₀ − V₀ − W| = max (max B − B₀, B₀ − min B),
    max (T + |V − V₀| + |W|)  = max (max P − V₀, max N + V₀).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from bellcrank.dynamics.constraints.constraint_derivatives import aligned_constraints, sine_rows
from bellcrank.dynamics.constraints.reactions import ConstraintReactions
from bellcrank.robot.model.joints import unit_vectors

if TYPE_CHECKING:
    import casadi

    from bellcrank.dynamics.equations.assembly import Assembly
    from bellcrank.scene.scene import Scene

ENERGIES = 3  # B, P and N


@dataclass(frozen=True, kw_only=True)
class ObservedLayout:
    """Where the quantities are in their vector.

    Attributes:
        outputs: The number of columns of the outputs, which come first.
        energies: B, P and N.
        residuals: Those of constraints and of unit vectors, all of which should be 0.
        cosines: Those of welds and hinges.
        size: The number of quantities.
    """

    outputs: int
    energies: slice
    residuals: slice
    cosines: slice
    size: int

    @classmethod
    def of(cls, scene: Scene, size: int) -> ObservedLayout:
        """The layout of a scene's vector of `size` quantities."""
        outputs = sum(len(output.quantity.suffixes()) for output in scene.outputs.values())
        after, cosines = outputs + ENERGIES, len(aligned_constraints(scene))
        return cls(
            outputs=outputs,
            energies=slice(outputs, after),
            residuals=slice(after, size - cosines),
            cosines=slice(size - cosines, size),
            size=size,
        )


def observed_quantities(scene: Scene, assembly: Assembly, rows: Sequence[tuple[str, str]], *, plain: bool) -> casadi.SX:
    """The vector of these quantities; `rows` are (constraint, label) of the rows of constraints that are kept.

    `plain`: outputs by the plain solution of the constraints, which has half the operations and holds where its guard
    is positive (kkt.py).
    """
    import casadi

    a = assembly
    outputs = _plain_outputs(scene, a) if plain and a.solution is not None else [*a.outputs.values()]
    work = a.work if a.has_work else casadi.SX(0)
    size = casadi.fabs(work)
    found = [*outputs, a.kinetic + a.potential - work, a.kinetic + a.potential + size]
    found.append(a.kinetic - a.potential + size)
    cosines = casadi.vertcat(
        casadi.SX(0, 1), *[constraint.alignment_cosine(a.symbols) for constraint in scene.constraints]
    )
    if a.solution is not None:
        found.append(_with_whole_angles(sine_rows(scene, rows), a.solution.derivatives.position_residual, cosines))
    found += [casadi.norm_2(a.q[place]) - 1.0 for place in unit_vectors(scene.robot.joints)]
    return casadi.vertcat(*found, cosines)


def _plain_outputs(scene: Scene, assembly: Assembly) -> list[casadi.SX]:
    solution = assembly.solution
    assert solution is not None
    equations = replace(
        assembly.event_equations,
        acceleration=solution.plain.acceleration,
        reactions=ConstraintReactions(scene.constraints, solution, solution.plain.multipliers, assembly.symbols),
    )
    return [output.value(equations) for output in scene.outputs.values()]


def _with_whole_angles(sines: dict[str, list[int]], residual: casadi.SX, cosines: casadi.SX) -> casadi.SX:
    """φ (h) with the rotation residuals of welds and hinges as whole angles, as in constraint_alignment.py."""
    import casadi

    whole = casadi.SX(residual)
    for k, rows in enumerate(sines.values()):
        if rows:
            sine = casadi.norm_2(residual[rows])
            ratio = casadi.if_else(sine > 0.0, casadi.atan2(sine, cosines[k]) / sine, 1.0)
            whole[rows] = residual[rows] * ratio
    return whole
