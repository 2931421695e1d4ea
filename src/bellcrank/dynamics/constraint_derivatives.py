"""Constrained equations of motion: constraints differentiated, and solved for accelerations and multipliers.

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

from bellcrank.dynamics.base_frame_elimination import Turning
from bellcrank.dynamics.kkt import Factor, proximal
from bellcrank.elements.constraint import Constraint

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols

REFINEMENTS = 3  # passes of the proximal solve after the first; what they leave of a regular row is μ⁴
PROJECTING = 1  # the same for projections, whose corrections are small
REGULARISATION = 1e-9  # μ, as a share of a row's J M⁻¹ Jᵀ
LEAST = 1e-14  # the same at rest where the row vanishes
NEAR_SINGULAR = 1e-4  # a pivot below this share of its usual value calls for the proximal solve


class Rows(NamedTuple):
    """The rows of constraints that bind; for each its usual J M⁻¹ Jᵀ (`scale`), its usual square of J with columns as
    in `columns` (`square`), and how large 1 is in it (`unit`). `columns` (nv): the mechanism's length, m, for
    coordinates in m, 1 for others. Numbers or symbols. `singular`: M is, as some joint moves nothing but what constraints
    hold.
    """

    kept: tuple[int, ...]
    scale: casadi.SX
    square: casadi.SX
    unit: casadi.SX
    columns: casadi.SX
    singular: bool = False

    @classmethod
    def plain(cls, kept: Sequence[int]) -> Rows:
        """Rows whose size is not asked for."""
        import casadi

        ones = casadi.SX.ones(len(kept), 1)
        return cls(tuple(kept), ones, ones, ones, casadi.SX.ones(1, 1))


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
        """The power of constraints that move with time: v·Jᵀλ = −λ·(φ_t, ψ at rest) on φ̇ = 0, ψ = 0."""
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

    jacobian, usual = closed.jacobian, closed.rows.scale
    right = closed.required(*casadi.vertsplit(gains)) if gains.numel() else closed.required(0.0, 0.0)
    if closed.rows.singular:
        weighted = jacobian.T @ casadi.diag(1.0 / usual)
        mass, force = casadi.sparsify(mass + weighted @ jacobian), force + weighted @ right
    plain = Factor(mass, jacobian, casadi.SX(jacobian.size1(), 1))
    mu = regularisation(mass, closed, share)
    regular = Factor(mass, jacobian, mu)
    return Solution(
        closed, mass, regular, regular.solve(force, right)[1], *proximal(regular, force, right, REFINEMENTS),
        *plain.solve(force, right), plain.slack(NEAR_SINGULAR * usual),
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
    kinetic energy; the mechanism's own length a second, or 1 rad/s, counts as moving.
    """
    import casadi

    _, usual, square, unit, columns, _ = closed.rows
    now = (closed.jacobian * closed.jacobian) @ (columns * columns) / square
    speed = usual * casadi.dot(closed.v, mass @ closed.v) / (unit * unit)
    return usual * (share * (now + speed / (1.0 + speed)) + LEAST)


def row_names(constraints: Sequence[Constraint], s: Symbols) -> list[tuple[str, str]]:
    """(constraint, what its multiplier is) of every row, all φ and then all ψ."""
    position, velocity = [], []
    for constraint in constraints:
        h = constraint.residual(s).position.size1()
        names = [(constraint.name, label) for label in constraint.labels(s.robot)]
        position += names[:h]
        velocity += names[h:]
    return position + velocity


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
        rows = Rows.plain(range(h + velocity.size1()))
    kept = rows.kept
    position = casadi.vertcat(casadi.SX(0, 1), *[position[k] for k in kept if k < h])
    velocity = casadi.vertcat(casadi.SX(0, 1), *[velocity[k - h] for k in kept if k >= h])
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
