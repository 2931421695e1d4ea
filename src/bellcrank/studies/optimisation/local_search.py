"""Local searches from several designs at once: sequential quadratic programming within a trust region.

Each iteration linearises the objective and the limits of each search, solves a quadratic programme for its step, and
runs the designs of all searches together. Limits are penalised exactly, so that a search may begin where they are
broken; a peak is the largest of its maxima over time, each of which is linearised by itself (epigraph form). Source:
J. Nocedal, S. J. Wright, Numerical Optimization, 2nd ed. (2006): the S l1 QP method, section 18.5, with damped BFGS
updates, procedure 18.2. The Karush-Kuhn-Tucker residual is computed from the gradients, apart from the search.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.studies.optimisation.gradients import GradientRow, Gradients
from bellcrank.studies.optimisation.problem import DesignProblem

MOST_ITERATIONS = 100
FIRST_RADIUS, LEAST_RADIUS, LARGEST_RADIUS = 0.1, 1e-10, 0.5  # of steps, as shares of the width between the bounds
TINY, MOST_TINY = 1e-13, 5  # a reduction that rounding may hide, and how many such steps follow one another
ENOUGH = 1e-9  # of the residual, at which a search ends
CONVERGED = 1e-6  # of the residual, up to which its end is called an optimum
KEPT = 1e-7  # by how much a limit may be broken, as a share of its spread
AT_BOUND = 1e-9
# A bound holds a step that comes so near to it, and so near in proportion to its multiplier: one of them vanishes
# (F. Facchinei, A. Fischer, C. Kanzow, SIAM J. Optim. 9 (1998) 14-32).
NEAR_BOUND, HOLDS = 1e-6, 1e-3
ACTIVE = 1e-6
PENALTY, LARGEST_PENALTY = 10.0, 1e7
PRECISE = {"eps_abs": 1e-12, "eps_rel": 1e-12}  # of the quadratic programmes
WEIGHT = 1e3  # of the sum of multipliers, which is 1, in the least squares of the residual


@dataclass(frozen=True, eq=False)
class Function:
    """The largest of some linearised functions, scaled: the objective, or a limit that is to stay below 0.

    With `equal` its magnitude is to be 0.
    """

    rows: tuple[GradientRow, ...]
    equal: bool = False

    @property
    def value(self) -> float:
        """Its value at the design."""
        return max(row.value for row in self.rows)


@dataclass(frozen=True, eq=False)
class Kkt:
    """How well a design satisfies the first-order conditions of an optimum.

    Attributes:
        residual: The largest of what remains of the gradient of the Lagrangian, of broken limits and of multipliers of
            limits that are not active; in units of the objective's spread per width of a variable.
        limits: The scaled multipliers (limits,); of a limit with "=", of either sign.
        bounds: The scaled multipliers (variables,): negative at a lower bound, positive at an upper one.
    """

    residual: float
    limits: Array
    bounds: Array


@dataclass(eq=False)
class LocalSearch:
    """One local search.

    Attributes:
        point: The design, from 0 to 1.
        values: Its objective and measures of limits.
        lower: The bounds (variables,) of the search; where `upper` is equal, the variable is fixed.
        upper: See `lower`.
        reason: Why it ended; empty while it goes on.
        blocked: Why the last design that it tried was infeasible; empty where it was not.
        hidden: Reductions of the scaled objective that its errors may hide.
    """

    point: Array
    values: Array
    lower: Array
    upper: Array
    reason: str = ""
    blocked: str = ""
    radius: float = FIRST_RADIUS
    penalty: float = PENALTY
    functions: list[Function] = field(default_factory=list)
    hessian: Array = field(default_factory=lambda: np.zeros((0, 0)))
    multipliers: list[Array] = field(default_factory=list)
    old: tuple[Array, list[Function]] | None = None
    kkt: Kkt | None = None
    fresh: bool = True
    hidden: float = TINY
    tiny: int = 0
    restarts: int = 3

    @property
    def free(self) -> Mask:
        """Which variables (variables,) are not fixed."""
        return np.asarray(self.upper > self.lower)


def local_searches(
    problem: DesignProblem,
    gradients: Gradients,
    starts: Array,
    values: Array,
    each: Callable[[], object],
    boxes: tuple[Array, Array] | None = None,
) -> list[LocalSearch]:
    """Search from feasible designs (n, variables) with values (n, 1 + limits); `each` is called after each iteration.

    `boxes` are lower and upper bounds (n, variables) of each search, by default 0 and 1. Raises StudyInterrupted on
    Ctrl-C.
    """
    size = starts.shape[1]
    lower, upper = (np.zeros_like(starts), np.ones_like(starts)) if boxes is None else boxes
    given = zip(starts, values, lower, upper, strict=True)
    hidden = max(TINY, problem.error)
    searches = [LocalSearch(*one, hessian=np.eye(size), hidden=hidden) for one in given]
    for one in searches:
        if not one.free.any():
            one.reason = "nothing is left to vary"
    for _ in range(MOST_ITERATIONS):
        linearise(problem, gradients, [one for one in searches if one.fresh and not one.reason])
        live = [one for one in searches if not one.reason]
        steps = [_step(one) for one in live]
        moving = [(one, step) for one, step in zip(live, steps, strict=True) if not one.reason]
        if not moving:
            break
        trials = np.array([np.clip(one.point + step[0], one.lower, one.upper) for one, step in moving])
        before = problem.count
        found = problem.run(trials)
        for k, ((one, step), trial) in enumerate(zip(moving, trials, strict=True)):
            _judge(problem, one, step, trial, found[k], problem.reasons.get(before + k, ""))
        each()
    for one in searches:
        one.reason = one.reason or f"{MOST_ITERATIONS} iterations"
    return searches


def linearise(problem: DesignProblem, gradients: Gradients, searches: Sequence[LocalSearch]) -> None:
    """Compute the functions and the residual of searches at their designs, and what follows for their Hessians."""
    free = [one.free for one in searches]
    rows = gradients.at([one.point for one in searches], [one.values for one in searches], free)
    for one, measures in zip(searches, rows, strict=True):
        one.fresh = False
        objective = [_scaled(row, problem.sign / problem.scales[0], 0.0) for row in measures[0]]
        one.functions = [Function(tuple(objective))]
        for k, limit in enumerate(problem.limits):
            factor = (1.0 if limit.relation == "=" else problem.side(k)) / problem.scales[1 + k]
            scaled = tuple(_scaled(row, factor, limit.value) for row in measures[1 + k])
            one.functions.append(Function(scaled, limit.relation == "="))
        if not all(np.isfinite(row.gradient).all() for function in one.functions for row in function.rows):
            one.reason = "designs beside it are infeasible"
            continue
        _update_hessian(one)
        one.kkt = kkt_of(one.point, one.functions, one.lower, one.upper)
        if one.kkt.residual <= ENOUGH:
            one.reason = "the residual is small"


def kkt_of(point: Array, functions: Sequence[Function], lower: Array, upper: Array) -> Kkt:
    """The multipliers that make the residual least, by non-negative least squares over what is active."""
    from scipy.optimize import nnls

    size = len(point)
    columns, gaps, owners = [], [], []
    for k, function in enumerate(functions):
        for row in function.rows:
            gap = (functions[0].value if k == 0 else 0.0) - row.value
            if k == 0 or function.equal or gap <= ACTIVE:
                for sign in (1.0, -1.0) if function.equal else (1.0,):
                    columns.append(sign * row.gradient)
                    gaps.append(0.0 if function.equal else max(gap, 0.0))
                    owners.append((k, sign))
    free = len(columns)
    gap_of = {-1.0: point - lower, 1.0: upper - point}
    at = [(j, side) for j in range(size) for side, near in gap_of.items() if near[j] < AT_BOUND]
    columns += [side * np.eye(size)[j] for j, side in at]
    use = [i for i in range(len(columns)) if i >= free or owners[i][0] or gaps[i] <= ACTIVE]
    matrix = np.array([columns[i] for i in use]).T
    sums = np.array([[WEIGHT * (i < free and owners[i][0] == 0) for i in use]])
    found, _ = nnls(np.vstack([matrix, sums]), np.r_[np.zeros(size), WEIGHT])
    total = float(sum(found[n] for n, i in enumerate(use) if i < free and owners[i][0] == 0))
    found = found / (total or 1.0)
    limits, bounds, slack = np.zeros(len(functions) - 1), np.zeros(size), 0.0
    for n, i in enumerate(use):
        if i >= free:
            bounds[at[i - free][0]] += at[i - free][1] * found[n]
            continue
        slack = max(slack, float(found[n] * gaps[i]))
        if owners[i][0]:
            limits[owners[i][0] - 1] += owners[i][1] * found[n]
    broken = max((abs(f.value) if f.equal else f.value for f in functions[1:]), default=0.0)
    return Kkt(max(float(np.abs(matrix @ found).max()), broken, slack), limits, bounds)


def _scaled(row: GradientRow, factor: float, offset: float) -> GradientRow:
    return row._replace(value=factor * (row.value - offset), gradient=factor * row.gradient)


# ---- steps


def _step(one: LocalSearch) -> tuple[Array, float]:
    """The step of a search and the reduction that its model promises; ends it where there is none."""
    lower = np.maximum(one.lower - one.point, -one.radius)
    upper = np.minimum(one.upper - one.point, one.radius)
    solved = _quadratic_programme(one.hessian, one.functions, lower, upper, one.penalty)
    if solved is None:
        one.reason = "the quadratic programme was not solved"
        return np.zeros(len(one.point)), 0.0
    step, one.multipliers = solved
    largest = max((float(np.abs(each).sum()) for each in one.multipliers[1:]), default=0.0)
    if largest > 0.5 * one.penalty and _broken(one.functions, 0.0 * step) > KEPT:
        one.penalty = min(10.0 * one.penalty, LARGEST_PENALTY)
        solved = _quadratic_programme(one.hessian, one.functions, lower, upper, one.penalty) or solved
        step, one.multipliers = solved
    promised = _merit(one, 0.0 * step) - _merit(one, step) - 0.5 * float(step @ one.hessian @ step)
    one.tiny = one.tiny + 1 if promised <= one.hidden else 0
    if (promised <= 0.0 or one.tiny > MOST_TINY) and one.restarts and one.kkt and one.kkt.residual > CONVERGED:
        one.restarts, one.tiny, one.hessian, one.old = one.restarts - 1, 0, np.eye(len(one.point)), None
        return _step(one)  # curvatures that were learned far away may be too large here
    if promised <= 0.0 or one.tiny > MOST_TINY or one.radius < LEAST_RADIUS:
        one.reason = "no short step makes it better" if one.radius < LEAST_RADIUS else "no step makes it better"
    return step, promised


def _judge(
    problem: DesignProblem, one: LocalSearch, step: tuple[Array, float], trial: Array, values: Array, why: str
) -> None:
    """Accept a design or not, and set the size of the next step."""
    length, promised = float(np.abs(step[0]).max()), step[1]
    pair = np.array([one.values, values])
    merits = problem.objective(pair) + one.penalty * problem.violation(pair)
    # Reductions that errors may hide count as promised (Conn, Gould, Toint, Trust-Region Methods (2000), 17.4).
    hidden = one.hidden
    ratio = float((merits[0] - merits[1] + hidden) / (promised + hidden)) if np.isfinite(values).all() else -1.0
    one.blocked = why
    if ratio > 1e-4:
        one.old = one.point, one.functions
        one.point, one.values, one.fresh = trial, values, True
    if ratio < 0.25:
        one.radius = 0.25 * length
    elif ratio > 0.75 and length > 0.9 * one.radius:
        one.radius = min(2.0 * one.radius, LARGEST_RADIUS)


def _merit(one: LocalSearch, step: Array) -> float:
    objective = max(row.value + float(row.gradient @ step) for row in one.functions[0].rows)
    return objective + one.penalty * _broken(one.functions, step)


def _broken(functions: Sequence[Function], step: Array) -> float:
    """The sum of what the linearised limits are broken by."""
    total = 0.0
    for function in functions[1:]:
        values = [row.value + float(row.gradient @ step) for row in function.rows]
        total += abs(values[0]) if function.equal else max(max(values), 0.0)
    return total


def _quadratic_programme(
    hessian: Array, functions: Sequence[Function], lower: Array, upper: Array, penalty: float
) -> tuple[Array, list[Array]] | None:
    """The step d that makes max_i (f_i + g_i d) + d B d / 2 + penalty * (sum of broken limits) least within bounds, and
    the multipliers of each function's rows; None where it is not found.
    """
    import casadi

    free = upper > lower
    size, count = int(free.sum()), len(functions) - 1
    rows, limits, which = [], [], []
    for k, function in enumerate(functions):
        for row in function.rows:
            for sign in (1.0, -1.0) if function.equal else (1.0,):
                slack = np.zeros(1 + count)
                slack[k] = -1.0
                rows.append(np.r_[sign * row.gradient[free], slack])
                limits.append(-sign * row.value)
                which.append((k, sign))
    matrix, whole = np.array(rows), size + 1 + count
    quadratic = np.zeros((whole, whole))
    quadratic[:size, :size] = hessian[np.ix_(free, free)]
    sparsity = {"h": casadi.Sparsity.dense(whole, whole), "a": casadi.Sparsity.dense(*matrix.shape)}
    solver = casadi.conic("step", "piqp", sparsity, {"error_on_fail": False, "piqp": PRECISE})
    found = solver(
        h=quadratic,
        g=np.r_[np.zeros(size), 1.0, np.full(count, penalty)],
        a=matrix,
        lbx=np.r_[lower[free], -np.inf, np.zeros(count)],
        ubx=np.r_[upper[free], np.inf, np.full(count, np.inf)],
        lba=-np.inf,
        uba=np.array(limits),
    )
    step, multipliers = np.zeros(len(lower)), np.array(found["lam_a"]).ravel()
    step[free] = np.array(found["x"]).ravel()[:size]
    if not np.isfinite(step).all() or not np.isfinite(multipliers).all():
        return None
    step, forces = np.clip(step, lower, upper), np.zeros(len(lower))
    forces[free] = np.abs(np.array(found["lam_x"]).ravel()[:size])
    for bound in (lower, upper):  # an interior point comes near to a bound that holds it, and does not reach it
        near = np.maximum(AT_BOUND, np.minimum(NEAR_BOUND, HOLDS * forces))
        step = np.where(np.abs(step - bound) < near, bound, step)
    own: list[list[float]] = [[] for _ in functions]
    for (k, sign), multiplier in zip(which, multipliers, strict=True):
        if sign > 0.0:
            own[k].append(float(multiplier))
        else:
            own[k][-1] -= float(multiplier)
    return step, [np.array(each) for each in own]


def _update_hessian(one: LocalSearch) -> None:
    """Damped BFGS update from the change of the Lagrangian's gradient along the last step."""
    if one.old is None:
        return
    point, functions = one.old
    one.old = None
    step, change = one.point - point, np.zeros(len(point))
    for before, now, multipliers in zip(functions, one.functions, one.multipliers, strict=True):
        for row, multiplier in zip(before.rows, multipliers, strict=True):
            same = [other for other in now.rows if other.key == row.key]
            if same and abs(multiplier) > 1e-12:
                near = min(same, key=lambda other: abs(other.time - row.time))
                change += multiplier * (near.gradient - row.gradient)
    bent = one.hessian @ step
    curvature, length = float(step @ bent), float(step @ change)
    if curvature <= 0.0:
        return
    if length < 0.2 * curvature:
        share = 0.8 * curvature / (curvature - length)
        change = share * change + (1.0 - share) * bent
        length = float(step @ change)
    one.hessian = one.hessian + np.outer(change, change) / length - np.outer(bent, bent) / curvature
