"""How exact the proximal solve is over its regularisation μ: regular, redundant and nearly singular constraints.

The reference is dense: with M = L Lᵀ and G = J L⁻ᵀ, the accelerations are L⁻ᵀ (w + G⁺ (b − G w)), w = L⁻¹ f, with the
pseudo-inverse by singular values (Udwadia & Kalaba, Proc. R. Soc. A 439 (1992)).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.constrained import REFINEMENTS
from bellcrank.dynamics.kkt import Factor, proximal
from bellcrank.dynamics.system import system_of, system_parameters
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.simulate import simulate
from bellcrank_bench.textbook.closed_linkages import ClosedFourBar

Array = NDArray[np.float64]
SHARES = tuple(10.0**k for k in range(-14, -5))  # μ, of a row's usual J M⁻¹ Jᵀ
RANK = 1e-11  # of the largest singular value: below it a row repeats others
NEAR = (1e-1, 1e-2, 1e-3, 1e-4)  # rad of a four-bar from where it lies flat
OFF = (1e-6, 1e-4, 1e-2)  # rad of Bricard's mechanism from its constraint


class Study(NamedTuple):
    """Relative errors (k,) of accelerations and of the multipliers' joint forces Jᵀ λ at `shares`, at one state."""

    state: str
    shares: Sequence[float]
    acceleration: Array
    force: Array


def proximal_errors(
    scene: Scene, q: Array, v: Array, name: str, shares: Sequence[float] = SHARES, refinements: int = REFINEMENTS
) -> Study:
    """The proximal solve of a scene at a state, μ by μ, against the dense reference; each error is a share of the
    largest acceleration, or joint force.
    """
    solve = _solver(scene, refinements)
    m, j, tau, b, *_ = solve(q, v, shares[0])
    exact, reaction = dense(m, j, tau.ravel(), b.ravel())
    errors = []
    for value in shares:
        *_, ours, theirs = solve(q, v, value)
        errors.append((_gap(ours.ravel(), exact), _gap(theirs.ravel(), reaction)))
    return Study(name, shares, *np.array(errors).T)


def contradiction(
    scene: Scene, q: Array, v: Array, distance: float, shares: Sequence[float] = SHARES, refinements: int = REFINEMENTS
) -> Study:
    """How much accelerations and joint forces change, μ by μ, where the posture is `distance` (m, rad) off the constraint.

    A row that repeats the others does so on the constraint alone. As far off it as the stages of a step are, a solve whose
    μ is small takes the row for one of its own and follows its contradiction: what an error-controlled solver then sees
    is no rounding, but it jumps like it, and makes the steps short.
    """
    solve = _solver(scene, refinements)
    direction = np.random.default_rng(0).normal(size=len(q))
    there = q + distance * direction / np.linalg.norm(direction)
    changes = []
    for value in shares:
        (*_, here, force), (*_, off, other) = solve(q, v, value), solve(there, v, value)
        changes.append((_gap(off, here), _gap(other, force)))
    return Study(f"{scene.name}, {distance:g} off", shares, *np.array(changes).T)


def _solver(scene: Scene, refinements: int) -> Callable[[Array, Array, float], list[Array]]:
    """(q, v, μ) -> M, J, force, right-hand side, acceleration and Jᵀ λ of the proximal solve."""
    import casadi

    assembly, share = system_of(scene).assembly, casadi.SX.sym("share")
    assert assembly.solution is not None
    mass, closed = assembly.solution.mass, assembly.solution.closed
    force, right = assembly.actuator + assembly.passive - assembly.bias, closed.required(0.0, 0.0)
    factor = Factor(mass, closed.jacobian, share * closed.rows.scale)
    a, multipliers = proximal(factor, force, right, refinements)
    parts = [mass, closed.jacobian, force, right, a, closed.jacobian.T @ multipliers]
    f = casadi.Function("study", [assembly.t, assembly.state, assembly.u, assembly.p, share], parts)
    u, p = scene.signals_at(np.zeros(1))[0], system_parameters(scene)

    def solve(q: Array, v: Array, value: float) -> list[Array]:
        x = np.concatenate([q, v, np.zeros(system_of(scene).size - len(q) - len(v))])
        return [np.array(part) for part in f(0.0, x, u, p, value)]

    return solve


def _gap(found: Array, exact: Array) -> float:
    return float(np.abs(found - exact).max() / np.abs(exact).max())


def dense(mass: Array, jacobian: Array, force: Array, right: Array) -> tuple[Array, Array]:
    """Accelerations (n,) and the joint forces of constraints Jᵀ λ (n,), by singular values."""
    lower = np.linalg.cholesky(mass)
    g = np.linalg.solve(lower, jacobian.T).T
    w = np.linalg.solve(lower, force)
    push = np.linalg.pinv(g, rcond=RANK) @ (right - g @ w)
    return np.linalg.solve(lower.T, w + push), lower @ push


def proximal_studies() -> list[Study]:
    """A regular constraint, Bricard's redundant one and that off its constraint, and a four-bar ever nearer to lying flat."""
    four_bar, bricard = load_scene("four_bar"), load_scene("bricard")
    run = simulate(bricard, duration=1.0, times=[0.7, 1.0], rtol=1e-12, atol=1e-12)
    there = run.position[0], run.velocity[0]
    found = [proximal_errors(bricard, *there, "Bricard, one row redundant")]
    found += [contradiction(bricard, *there, distance) for distance in OFF]
    book = ClosedFourBar()
    for crank in (1.0, *NEAR):
        q, v = book.closed(np.array(crank), np.array(1.0), np.array(1.0))
        found.append(proximal_errors(four_bar, q, v, f"four-bar, {crank:g} rad from flat"))
    return found


def proximal_table(studies: Sequence[Study] | None = None) -> str:
    """The studies as a table: relative error of the accelerations, a column for each μ."""
    studies = proximal_studies() if studies is None else studies
    lines = [f"{'mu':28}" + "".join(f"{share:9.0e}" for share in studies[0].shares)]
    return "\n".join([*lines, *(f"{s.state:28}" + "".join(f"{e:9.1e}" for e in s.acceleration) for s in studies)])
