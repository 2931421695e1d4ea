"""The plastic impact of a latch that closes: it takes the rate of a condition to zero, constraints staying
satisfied.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from bellcrank.dynamics.constraints.constraint_derivatives import time_derivative
from bellcrank.dynamics.equations.kkt import REFINEMENTS, REGULARISATION, Factor, proximal
from bellcrank.errors import InputError

if TYPE_CHECKING:
    import casadi

    from bellcrank.dynamics.equations.assembly import Assembly
    from bellcrank.scene.events import EventRule


def latch_impact(rule: EventRule, assembly: Assembly) -> list[casadi.SX]:
    """The velocity after the impact (nv), the impulses of the constraints' rows and of the latch, and the energy lost.

    Impulses are in N s or N m s, the kinetic energy that is lost in J. With g the event's function, the impact is
    M (v⁺ − v⁻) = J_Gᵀ Λ and J_G v⁺ = (−φ_t, −g_t), J_G = (J; ∂ġ/∂v): v⁻ is projected in the metric of M, and the energy
    of what the projection removes is lost. Source: Featherstone, Rigid Body Dynamics Algorithms (2008), 11.7.

    Raises InputError where g depends on velocities.
    """
    import casadi

    s, solution = assembly.symbols, assembly.solution
    g = casadi.SX(rule.function(assembly.event_equations))
    if casadi.depends_on(g, s.v):
        raise InputError(
            f"{s.robot.name}: event '{rule.name}': a latch closes at a position, but its condition depends on "
            "velocities; write the condition in positions, or remove latch: true"
        )
    rate = time_derivative(g, s)
    lock = casadi.sparsify(casadi.jacobian(rate, s.v))
    if solution is None:
        whole = casadi.reshape(s.algorithm("mass_matrix")(s.q, s.tracer_parameters), s.robot.nv, s.robot.nv)
        mass, jacobian, residual = casadi.sparsify(whole), lock, rate
    else:
        mass = solution.mass
        jacobian = casadi.vertcat(solution.derivatives.jacobian, lock)
        residual = casadi.vertcat(solution.derivatives.velocity_residual, rate)
    scale = casadi.sparsify((jacobian * jacobian) @ (1.0 / casadi.diag(mass)))
    factor = Factor(mass, jacobian, REGULARISATION * scale)
    jump, impulse = proximal(factor, casadi.SX(s.robot.nv, 1), -residual, REFINEMENTS)
    lost = -casadi.dot(s.v + 0.5 * jump, mass @ jump)
    return [s.v + jump, impulse[:-1], impulse[-1], lost]
