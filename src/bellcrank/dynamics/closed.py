"""Constrained equations of motion: closures differentiated, and solved for accelerations and multipliers.

With φ(q, t) = 0 (holonomic rows) and ψ(q, v, t) = 0 (non-holonomic ones), J = ∂(φ̇, ψ)/∂v and γ = what is left of
(φ̈, ψ̇) at v̇ = 0,

    M v̇ = f + Jᵀ λ,    J v̇ = −γ − 2 α (φ̇, ψ) − β² (φ, 0),

α and β being Baumgarte's gains (0 without them). Sources: J. Baumgarte, Comput. Methods Appl. Mech. Eng. 1 (1972); A.
Ghosal, NPTEL 2022, lecture 18.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bellcrank.constraints.constraint import Constraint
from bellcrank.constraints.kkt import Factor, proximal
from bellcrank.dynamics.roots import Turning
from bellcrank.errors import InputError

if TYPE_CHECKING:
    import casadi

    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene
    from bellcrank.scene.symbols import Symbols

Array = NDArray[np.float64]
DEAD = 1e-5  # of the largest entry of a closure's J: a row below it is dead, or alive by rounded angles alone
IMPOSSIBLE = 1e-5  # of the largest gap of a closure, that such a row may be apart

REFINEMENTS = 3  # passes of the proximal solve after the first; what they leave of a regular row is μ⁴
PROJECTING = 1  # the same for projections, whose corrections are small
REGULARISATION = 1e-9  # μ, as a share of a row's J M⁻¹ Jᵀ
LEAST = 1e-14  # the same at rest where the row vanishes
SPREAD = 1e3  # a row's J M⁻¹ Jᵀ, which light links raise, counts up to so many times what it is while the others hold
NEAR_SINGULAR = 1e-4  # a pivot below this share of its usual value calls for the proximal solve


class Rows(NamedTuple):
    """The rows of constraints that bind; for each, as powers of ten, its usual J M⁻¹ Jᵀ (`scale`) and its usual square
    of J (`square`). `massless`: M is singular, as some joint moves nothing but what closures hold.
    """

    kept: tuple[int, ...]
    scale: tuple[float, ...]
    square: tuple[float, ...]
    massless: bool = False


@dataclass(frozen=True)
class Closed:
    """A scene's constraints as expressions: φ (h), φ̇ (h), ψ (k), J (h + k, nv), γ (h + k), and ∂φ/∂t (h), all
    linear or quadratic in the velocities v (nv); `speed_change` is what (φ̇, ψ) becomes more by a small displacement
    `step` (nv) of the position, to first order.

    `rows` says which of the constraints' rows (all φ, then all ψ) these are.
    """

    position: casadi.SX
    rate: casadi.SX
    velocity: casadi.SX
    jacobian: casadi.SX
    drift: casadi.SX
    explicit_rate: casadi.SX
    v: casadi.SX
    step: casadi.SX
    speed_change: casadi.SX
    rows: Rows

    @property
    def kept(self) -> tuple[int, ...]:
        """The numbers of its rows among all φ and then all ψ."""
        return self.rows.kept

    @property
    def speed(self) -> casadi.SX:
        """(φ̇, ψ), which must vanish."""
        import casadi

        return casadi.vertcat(self.rate, self.velocity)

    def required(self, alpha: casadi.SX | float, beta: casadi.SX | float) -> casadi.SX:
        """What J v̇ must be, with Baumgarte's terms."""
        import casadi

        gap = casadi.vertcat(self.position, casadi.SX(self.velocity.size1(), 1))
        return -self.drift - 2.0 * alpha * self.speed - beta * beta * gap

    def power(self, multipliers: casadi.SX) -> casadi.SX:
        """The power of closures that move with time: v·Jᵀλ = −λ·(φ_t, ψ at rest) on φ̇ = 0, ψ = 0."""
        import casadi

        return -casadi.dot(multipliers, self.explicit_rate)


@dataclass(frozen=True)
class Solution:
    """Accelerations and multipliers by two solves, and the means to choose and to project.

    The proximal one holds where rows depend on each other, or nearly, and gives the least multipliers in the metric of
    the rows' own scale; the plain one costs less, and holds while `guard` is positive. `projection` is a displacement
    (nv) and a change of v (nv) that close all rows (Newton's method; `projected`), by the proximal solve and by the
    plain one.
    """

    closed: Closed
    mass: casadi.SX
    regular: Factor
    quick_multipliers: casadi.SX  # by one pass of the proximal solve: right to 1e-9, for events
    acceleration: casadi.SX
    multipliers: casadi.SX
    plain_acceleration: casadi.SX
    plain_multipliers: casadi.SX
    guard: casadi.SX
    projection: tuple[casadi.SX, casadi.SX]
    plain_projection: tuple[casadi.SX, casadi.SX]


def solve(mass: casadi.SX, closed: Closed, force: casadi.SX, gains: casadi.SX, share: casadi.SX) -> Solution:
    """Solve the constrained equations; `gains` is (α, β), or empty without Baumgarte's terms; `share` is μ as a share
    of a row's usual J M⁻¹ Jᵀ, a parameter of the equations, so that runs with two of them tell what it costs.

    Where M is singular, M + Jᵀ W J takes its place, W the inverse of the usual J M⁻¹ Jᵀ, and f + Jᵀ W J v̇ that of f,
    which changes neither v̇ nor λ.
    """
    import casadi

    jacobian, usual = closed.jacobian, casadi.DM(closed.rows.scale)
    right = closed.required(*casadi.vertsplit(gains)) if gains.numel() else closed.required(0.0, 0.0)
    if closed.rows.massless:
        weighted = jacobian.T @ casadi.diag(1.0 / usual)
        mass, force = casadi.sparsify(mass + weighted @ jacobian), force + weighted @ right
    plain = Factor(mass, jacobian, casadi.SX(jacobian.size1(), 1))
    mu = regularisation(mass, closed, share)
    regular = Factor(mass, jacobian, mu)
    return Solution(
        closed, mass, regular, regular.solve(force, right)[1], *proximal(regular, force, right, REFINEMENTS),
        *plain.solve(force, right), plain.slack(casadi.SX(NEAR_SINGULAR * usual)),
        projected(regular, closed, PROJECTING), projected(plain, closed, 0),
    )  # fmt: skip


def projected(factor: Factor, closed: Closed, refinements: int) -> tuple[casadi.SX, casadi.SX]:
    """A displacement (nv) and a change of v (nv) that take φ, φ̇ and ψ to 0 to first order, both with one factor.

    Each is the least that does so in the metric of M; the displacement also respects the non-holonomic rows, so that a
    wheel rolls where it is moved. Newton's method on (φ, φ̇, ψ) as a function of q and v: as its derivative by q is
    there too, what is left is of second order in both. Source: Hairer & Wanner, Solving ODEs II, VII.2.
    """
    import casadi

    still = casadi.SX(factor.n, 1)
    gap = casadi.vertcat(closed.position, casadi.SX(closed.velocity.size1(), 1))
    step = proximal(factor, still, -gap, refinements)[0]
    change = casadi.substitute(closed.speed_change, closed.step, step)
    return step, proximal(factor, still, -closed.speed - change, refinements)[0]


def regularisation(mass: casadi.SX, closed: Closed, share: casadi.SX) -> casadi.SX:
    """μ (rows): a share of each row's usual J M⁻¹ Jᵀ, less where the row's J is less, but not while the linkage moves.

    At distance x from a posture in which J loses rank (a linkage that lies flat loses whole rows) the equations are as
    good as anywhere at rest, but a motion at speed w amplifies what rounding leaves by w/x²; there a share of the usual
    value ends the amplification, and inertia carries the motion through. w² is about the usual value times twice the
    kinetic energy; 1 m/s, or 1 rad/s, counts as moving.
    """
    import casadi

    usual, square = casadi.DM(closed.rows.scale), casadi.DM(closed.rows.square)
    now = casadi.sum2(closed.jacobian * closed.jacobian) / square
    speed = usual * casadi.dot(closed.v, mass @ closed.v)
    return usual * (share * (now + speed / (1.0 + speed)) + LEAST)


def rows_that_bind(scene: Scene, s: Symbols) -> Rows:
    """The rows of a scene's closures (all φ, then all ψ) that say anything, by their Jacobians at random postures.

    A planar loop's row across the plane is 0 = 0 and is left out, also where the drawing rounds right angles to five
    digits (rpy="1.5708 0 0"). Raises InputError where such a row cannot hold.
    """
    import casadi

    whole = close(scene.closures, None, s)
    gap = casadi.vertcat(whole.position, whole.velocity)
    mass = s.algorithm("mass_matrix")(s.q, s.tracer_parameters)
    outputs = [casadi.densify(x) for x in (whole.jacobian, gap, casadi.reshape(mass, scene.robot.nv, scene.robot.nv))]
    f = casadi.Function("rows", [s.q, s.v, s.t, s.u, s.p], outputs)
    random = np.random.default_rng(0)
    sizes, gaps, scales, squares, massless = [], [], [], [], False
    for _ in range(8):
        q = random_posture(scene.robot, random)
        given = (q, np.zeros(scene.robot.nv), 0.0, random.normal(size=s.u.numel()), scene.parameter_values)
        j, g, m = (np.array(x) for x in f(*given))
        sizes.append(np.abs(j).max(axis=1, initial=0.0))
        gaps.append(np.abs(g.ravel()))
        compliance = j @ np.linalg.lstsq(m, j.T, rcond=None)[0]
        held = 1.0 / np.maximum(np.abs(np.linalg.pinv(compliance, hermitian=True).diagonal()), 1e-300)
        scales.append(np.minimum(compliance.diagonal(), SPREAD * held))
        squares.append((j * j).sum(axis=1))
        massless |= bool(np.linalg.matrix_rank(m) < len(m))
    names = row_names(scene.closures, s)
    size, gap = np.max(sizes, axis=0), np.max(gaps, axis=0)
    closure = np.array([name for name, _ in names])
    largest = np.array([[np.max(x[closure == name]) for name in closure] for x in (size, gap)])
    binds = size > DEAD * largest[0]
    for k in np.flatnonzero(~binds & (gap > IMPOSSIBLE * largest[1]) & (gap > 0.0)):
        name, label = names[k]
        raise InputError(
            f"{scene.source}: closures: '{name}' cannot close: its row {label} is {gap[k]:.6g} apart "
            "whatever the joints do; move one of its frames, or take a kind of closure with fewer rows"
        )
    usual = np.stack([np.max(scales, axis=0)[binds], np.max(squares, axis=0)[binds]])
    usual[usual <= 0.0] = 1.0  # no mass at all
    scale, square = (10.0 ** np.round(np.log10(usual))).tolist()  # rounded: not to change with every parameter
    return Rows(tuple(np.flatnonzero(binds).tolist()), tuple(scale), tuple(square), massless)


def row_names(constraints: Sequence[Constraint], s: Symbols) -> list[tuple[str, str]]:
    """(closure, what its multiplier is) of every row, all φ and then all ψ."""
    position, velocity = [], []
    for constraint in constraints:
        h = constraint.residual(s).position.size1()
        names = [(constraint.name, label) for label in constraint.labels(s.robot)]
        position += names[:h]
        velocity += names[h:]
    return position + velocity


def random_posture(robot: Robot, random: np.random.Generator) -> Array:
    """A position (nq,) with every joint within 1.5 rad or m of its zero, and unit rotations."""
    q = robot.neutral + random.uniform(-1.5, 1.5, robot.nq)
    for j in robot.joints:
        part = {"floating": slice(j.q + 3, j.q + 7), "planar": slice(j.q + 2, j.q + 4)}.get(j.kind)
        if part is not None:
            q[part] /= np.linalg.norm(q[part])
    return q


def close(constraints: Sequence[Constraint], rows: Rows | None, s: Symbols) -> Closed:
    """Differentiate constraints; `rows` are those to keep of all φ and then all ψ, all of them where it is None."""
    import casadi

    if s.robot.floating_base:
        s = Turning(s)
    residuals = [constraint.residual(s) for constraint in constraints]
    position = casadi.vertcat(casadi.SX(0, 1), *[r.position for r in residuals])
    velocity = casadi.vertcat(casadi.SX(0, 1), *[r.velocity for r in residuals])
    h = position.size1()
    if rows is None:
        count = h + velocity.size1()
        rows = Rows(tuple(range(count)), (1.0,) * count, (1.0,) * count)
    kept = rows.kept
    position, velocity = position[[k for k in kept if k < h]], velocity[[k - h for k in kept if k >= h]]
    rate = flow(position, s)
    speed = casadi.vertcat(rate, velocity)
    still, step = casadi.SX.zeros(s.v.size1(), 1), casadi.SX.sym("step", s.v.size1())
    expand = s.expand if isinstance(s, Turning) else casadi.sparsify
    return Closed(
        expand(position), expand(rate), expand(velocity), expand(casadi.jacobian(speed, s.v)), expand(flow(speed, s)),
        expand(casadi.substitute(speed, s.v, still)), s.v, step, expand(along(speed, s, step)), rows,
    )  # fmt: skip


def flow(expression: casadi.SX, s: Symbols) -> casadi.SX:
    """The time derivative along q̇ = E(q) v at constant v, time and signals moving on."""
    import casadi

    moving = casadi.jtimes(expression, casadi.vertcat(s.t, s.u), casadi.vertcat(1.0, s.signal_rates))
    return along(expression, s, s.v) + moving


def along(expression: casadi.SX, s: Symbols, step: casadi.SX) -> casadi.SX:
    """The derivative of an expression of q and v with q moving along E(q) `step`, (nv) like a velocity."""
    import casadi

    q_rate = s.algorithm("configuration_rate")(s.q, step)
    if not isinstance(s, Turning):
        return casadi.jtimes(expression, s.q, q_rate)
    q_rate[:3] = s.turn @ step[:3]
    turning = casadi.vec(s.turn @ casadi.skew(step[3:6]))
    return casadi.jtimes(expression, casadi.vertcat(s.q, casadi.vec(s.turn)), casadi.vertcat(q_rate, turning))
