"""The accuracy of the proximal solve over its regularisation μ: regular, redundant and nearly singular constraints.

The reference is a dense solve: with M = L Lᵀ and G = J L⁻ᵀ, the accelerations are L⁻ᵀ (w + G⁺ (b − G w)), w = L⁻¹ f,
with the pseudo-inverse by singular values (Udwadia & Kalaba, Proc. R. Soc. A 439 (1992)).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.equations.kkt import REFINEMENTS, Factor, proximal
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.simulate import simulate
from bellcrank_bench.textbook.four_bar import FourBarWithMultipliers

Array = NDArray[np.float64]
SHARES = tuple(10.0**k for k in range(-14, -5))  # μ, relative to a row's usual J M⁻¹ Jᵀ
RANK = 1e-11  # relative to the largest singular value: below it a row is redundant
NEAR = (1e-1, 1e-2, 1e-3, 1e-4)  # rad, from the flat position of a four-bar
OFF = (1e-6, 1e-4, 1e-2)  # rad, distance of Bricard's mechanism from its constraint


class ProximalStudy(NamedTuple):
    """Relative errors (k,) of accelerations and of the joint forces Jᵀ λ for each μ in `shares`, at one state."""

    state: str
    shares: Sequence[float]
    acceleration: Array
    force: Array


def proximal_errors(
    scene: Scene, q: Array, v: Array, name: str, shares: Sequence[float] = SHARES, refinements: int = REFINEMENTS
) -> ProximalStudy:
    """The errors of the proximal solve of a scene at a state for every μ, relative to the largest acceleration or joint
    force of the dense reference.
    """
    solve = _solver(scene, refinements)
    m, j, tau, b, *_ = solve(q, v, shares[0])
    exact, reaction = dense(m, j, tau.ravel(), b.ravel())
    errors = []
    for value in shares:
        *_, ours, theirs = solve(q, v, value)
        errors.append((_relative_error(ours.ravel(), exact), _relative_error(theirs.ravel(), reaction)))
    return ProximalStudy(name, shares, *np.array(errors).T)


def contradiction(
    scene: Scene, q: Array, v: Array, distance: float, shares: Sequence[float] = SHARES, refinements: int = REFINEMENTS
) -> ProximalStudy:
    """The change of accelerations and joint forces for every μ, `distance` (m, rad) off the constraint.

    A redundant row is redundant only on the constraint. Off it, as far as the stages of a step are, a solve with a
    small μ treats the row as an independent one, which contradicts the others. The accelerations then jump, and a
    solver with error control takes short steps.
    """
    solve = _solver(scene, refinements)
    direction = np.random.default_rng(0).normal(size=len(q))
    there = q + distance * direction / np.linalg.norm(direction)
    changes = []
    for value in shares:
        (*_, here, force), (*_, off, other) = solve(q, v, value), solve(there, v, value)
        changes.append((_relative_error(off, here), _relative_error(other, force)))
    return ProximalStudy(f"{scene.name}, {distance:g} off", shares, *np.array(changes).T)


def _solver(scene: Scene, refinements: int) -> Callable[[Array, Array, float], list[Array]]:
    """(q, v, μ) -> M, J, force, right-hand side, acceleration and Jᵀ λ of the proximal solve."""
    import casadi

    assembly, share = system_of(scene).assembly, casadi.SX.sym("share")
    assert assembly.solution is not None
    mass, constraints = assembly.solution.mass, assembly.solution.derivatives
    force, right = assembly.actuator + assembly.passive - assembly.bias, constraints.required_acceleration(0.0, 0.0)
    factor = Factor(mass, constraints.jacobian, share * constraints.rows.scale)
    a, multipliers = proximal(factor, force, right, refinements)
    parts = [mass, constraints.jacobian, force, right, a, constraints.jacobian.T @ multipliers]
    f = casadi.Function("study", [assembly.t, assembly.state, assembly.u, assembly.p, share], parts)
    u, p = scene.signals_at(np.zeros(1))[0], system_parameters(scene)

    def solve(q: Array, v: Array, value: float) -> list[Array]:
        x = np.concatenate([q, v, np.zeros(system_of(scene).size - len(q) - len(v))])
        return [np.array(part) for part in f(0.0, x, u, p, value)]

    return solve


def _relative_error(found: Array, exact: Array) -> float:
    return float(np.abs(found - exact).max() / np.abs(exact).max())


def dense(mass: Array, jacobian: Array, force: Array, right: Array) -> tuple[Array, Array]:
    """Accelerations (n,) and joint forces Jᵀ λ (n,) of the constraints, by singular values."""
    lower = np.linalg.cholesky(mass)
    g = np.linalg.solve(lower, jacobian.T).T
    w = np.linalg.solve(lower, force)
    push = np.linalg.pinv(g, rcond=RANK) @ (right - g @ w)
    return np.linalg.solve(lower.T, w + push), lower @ push


def proximal_studies() -> list[ProximalStudy]:
    """Four-bar, Bricard on and off its redundant constraint, and a four-bar close to its flat position."""
    four_bar, bricard = load_scene("four_bar"), load_scene("bricard")
    run = simulate(bricard, duration=1.0, times=[0.7, 1.0], rtol=1e-12, atol=1e-12)
    there = run.position[0], run.velocity[0]
    found = [proximal_errors(bricard, *there, "Bricard, one row redundant")]
    found += [contradiction(bricard, *there, distance) for distance in OFF]
    four_bar_equations = FourBarWithMultipliers()
    for crank in (1.0, *NEAR):
        q, v = four_bar_equations.closed(np.array(crank), np.array(1.0), np.array(1.0))
        found.append(proximal_errors(four_bar, q, v, f"four-bar, {crank:g} rad from flat"))
    return found


def proximal_table(studies: Sequence[ProximalStudy] | None = None) -> str:
    """The studies as a table: relative errors of the accelerations, one column per μ."""
    studies = proximal_studies() if studies is None else studies
    lines = [f"{'mu':28}" + "".join(f"{share:9.0e}" for share in studies[0].shares)]
    return "\n".join([*lines, *(f"{s.state:28}" + "".join(f"{e:9.1e}" for e in s.acceleration) for s in studies)])
