"""A latch that closes: the plastic impact that takes a rate to zero while constraints stay closed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bellcrank.dynamics.constraint_derivatives import REFINEMENTS, REGULARISATION, flow
from bellcrank.dynamics.kkt import Factor, proximal
from bellcrank.errors import InputError

if TYPE_CHECKING:
    import casadi

    from bellcrank.dynamics.assembly import Assembly
    from bellcrank.scene.events import EventRule


def latch(rule: EventRule, assembly: Assembly) -> list[casadi.SX]:
    """Velocity after (nv), impulses of the closures' rows, impulse of the lock, and the kinetic energy lost, J.

    With g the event's function, the impact is M (v⁺ − v⁻) = J_Gᵀ Λ, J_G v⁺ = (−φ_t, −g_t), J_G = (J; ∂ġ/∂v): v⁻
    projected in the metric of M; what the projection removes is lost. Source: Featherstone, Rigid Body Dynamics
    Algorithms (2008), 11.7. Raises InputError where g depends on velocities.
    """
    import casadi

    s, solution = assembly.symbols, assembly.solution
    g = casadi.SX(rule.apply(s))
    if casadi.depends_on(g, s.v):
        raise InputError(
            f"{s.robot.name}: event '{rule.name}': a latch closes where a position is reached, and its condition "
            "depends on velocities; write it in positions, or take latch: true away"
        )
    rate = flow(g, s)
    lock = casadi.sparsify(casadi.jacobian(rate, s.v))
    if solution is None:
        mass = casadi.sparsify(
            casadi.reshape(s.algorithm("mass_matrix")(s.q, s.tracer_parameters), s.robot.nv, s.robot.nv)
        )
        jacobian, speed = lock, rate
    else:
        mass = solution.mass
        jacobian = casadi.vertcat(solution.closed.jacobian, lock)
        speed = casadi.vertcat(solution.closed.speed, rate)
    scale = casadi.sparsify((jacobian * jacobian) @ (1.0 / casadi.diag(mass)))
    factor = Factor(mass, jacobian, REGULARISATION * scale)
    jump, impulse = proximal(factor, casadi.SX(s.robot.nv, 1), -speed, REFINEMENTS)
    lost = -casadi.dot(s.v + 0.5 * jump, mass @ jump)
    return [s.v + jump, impulse[:-1], impulse[-1], lost]
