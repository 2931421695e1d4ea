"""Ranges of parameters together with motors of a catalogue: combinations of pairs outside, continuous values inside.

Sobol points over the ranges and their corners are run first. From the best of them, the values are changed so that what
is chosen there is used least (or loses least), and motors are chosen again, until nothing better is found. Where
nothing passes at any point, values are searched for the combinations that are nearest to it. Where the objective is a
mass or a cost, which a combination of pairs has whatever the values are, lighter combinations are then tried in the
order of their objective: those that no point comes near to are left out, and for each other one a local search looks
for values with which it passes. The first that does is the best; what is left once the searches are used up bounds the
gap. Source of the inner problem, the least largest utilisation in epigraph form: J. Nocedal, S. J. Wright, Numerical
Optimization, 2nd ed. (2006), ch. 18 (sequential quadratic programming, here SciPy's SLSQP).
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from bellcrank.actuators.catalogue.catalogue import Catalogue
from bellcrank.arrays import Array, Indices
from bellcrank.errors import BellcrankError
from bellcrank.sizing.selection.candidates import completed
from bellcrank.sizing.selection.choose import system_results
from bellcrank.sizing.selection.criteria import exceeds
from bellcrank.sizing.selection.joint_problem import NO_MASS
from bellcrank.sizing.selection.judge import NOTE, UNKNOWN
from bellcrank.sizing.selection.judged_axes import MAIN, JudgedAxes
from bellcrank.sizing.selection.pairs import RESOLUTION
from bellcrank.sizing.selection.select import PreparedSelection
from bellcrank.sizing.selection.selection import Candidate, Selection
from bellcrank.studies.selection.design_selection import Inside
from bellcrank.studies.selection.designs_with_motors import DesignsWithMotors

Combination = tuple[int, ...]  # number of the pair of each axis
STARTS = 3  # designs from which values are improved
NEAREST = 12  # combinations for which values are searched where nothing passes
ROUNDS = 8  # of improving the values and choosing again
NEAR = 1.5  # a combination that no point uses less than so much is left out
MOST_SEARCHES = 24  # local searches for values of lighter combinations
MOST_COMBINATIONS = 100_000  # that are looked at in the order of their objective
DIFFERENCE = 1e-4  # of values from 0 to 1, for gradients
UNSHOWN = 1000  # of a level: more than the main criteria of all axes
FAILED = 100.0  # the largest utilisation of a design that cannot be built
AT_BOUND = 1e-9  # of values from 0 to 1: nearer ones are at the bound
MOST_TRIED = 60  # designs of a local search


class RangeSearch:
    """The search over ranges of some axes of designs.

    Args:
        designs: The designs.
        lower: The smallest values (axes,); of an axis with sizes, with any number.
        upper: The largest values; equal to `lower` for an axis with sizes.
        objective: What is minimised.
    """

    def __init__(self, designs: DesignsWithMotors, lower: Array, upper: Array, objective: str) -> None:
        self.designs, self.lower, self.upper, self.objective = designs, lower, upper, objective
        self.free, self.unit = np.flatnonzero(upper > lower), 0.0  # the latter of losses, W
        self.points: list[tuple[Array, PreparedSelection, Selection]] = []
        self.inside = Inside(0)

    def run(self, sample: Array) -> None:
        """Run the designs (n, axes) of a sample, then search. Raises KeyboardInterrupt; rows stay."""
        for values in sample:
            self._choose(values)
        self.inside = Inside(len(sample))
        for values, _, selection in self._starts():
            self._improve(values, selection)
        if self.points and self.designs.best is not None and not self.designs.best[1].inside:
            self._nearest()
        if self.objective in ("mass", "cost") and self.designs.best is not None and self.designs.best[1].inside:
            self._lighter()

    def _choose(self, values: Array) -> Selection | None:
        found = self.designs.run(values.tolist())
        if found is None:
            return None
        self.points.append((values, *found))
        return found[1]

    def _starts(self) -> list[tuple[Array, PreparedSelection, Selection]]:
        """The best points with different motors."""
        rows = [row for row in self.designs.rows if not row.reason]
        order, seen = sorted(range(len(rows)), key=lambda k: rows[k].rank), set[tuple[str, ...]]()
        found: list[tuple[Array, PreparedSelection, Selection]] = []
        for k in order:
            if rows[k].pairs not in seen and len(found) < STARTS:
                seen.add(rows[k].pairs)
                found.append(self.points[k])
        return found

    def _improve(self, values: Array, selection: Selection) -> None:
        """Change the values so that the motors are used least, choose again, and so on."""
        rank: tuple[int, ...] | None = None
        for _ in range(ROUNDS):
            nearest = {one.axis.name: one.chosen or one.candidates[0] for one in selection.axes}
            pairs = {name: _ids(one.motor.id, one.gear.id) for name, one in nearest.items()}
            before, (values, _) = values, self._values_for(pairs, values, 0.0)
            if np.array_equal(values, before) or (again := self._choose(values)) is None:
                return
            now = self.designs.rows[-1].rank
            if rank is not None and now >= rank:
                return
            rank, selection = now, again

    # ---- values for given pairs

    def _values_for(self, pairs: dict[str, str], start: Array, enough: float) -> tuple[Array, float]:
        """Values from a start with which given pairs are used least, or lose least where that is the objective, and the
        largest utilisation; the search ends early where it is at most `enough`.
        """
        from scipy.optimize import minimize

        width = np.where(self.upper > self.lower, self.upper - self.lower, 1.0)[self.free]
        first = (start[self.free] - self.lower[self.free]) / width
        products, loss = self._products(pairs), self.objective == "loss"
        best: list[tuple[float, float, Array]] = []  # use beyond 1 and objective, the smaller the better
        names, tried = list[str](), list[Array]()

        def at(x: Array) -> Array:
            values = start.copy()
            inside = np.where(x < AT_BOUND, 0.0, np.where(x > 1.0 - AT_BOUND, 1.0, x))
            values[self.free] = self.lower[self.free] + inside * width
            uses, losses = self._uses(values, pairs, products)
            names.extend(sorted(set(uses) - set(names)) if not names else [])
            largest = max(uses.values(), default=FAILED)
            merit = (max(largest, 1.0), losses) if loss else (largest, 0.0)
            if not best or merit < best[-1][:2]:
                best.append((*merit, values))
            tried.append(values)
            if largest <= enough or len(tried) == MOST_TRIED:
                raise StopIteration
            return np.array([losses, *(min(uses.get(name, FAILED), FAILED) for name in names)])

        known: dict[bytes, tuple[Array, Array]] = {}

        def linear(z: Array) -> tuple[Array, Array]:
            """Losses and utilisations, and their forward or backward differences."""
            x = np.clip(z[: len(first)], 0.0, 1.0)
            if x.tobytes() not in known:
                here, slopes = at(x), []
                for k in range(len(x)):
                    step = DIFFERENCE if x[k] < 0.5 else -DIFFERENCE
                    slopes.append((at(x + step * np.eye(len(x))[k]) - here) / step)
                known[x.tobytes()] = here, np.array(slopes).T
            return known[x.tobytes()]

        def least(z: Array) -> tuple[float, Array]:
            values, slopes = linear(z)
            self.unit = self.unit or max(abs(float(values[0])), 1e-9)
            if not loss:
                return float(z[-1]), np.eye(len(z))[-1]
            return float(values[0]) / self.unit, np.append(slopes[0], 0.0) / self.unit

        def limit(z: Array) -> Array:
            return np.asarray((1.0 if loss else z[-1]) - linear(z)[0][1:])

        def limit_slopes(z: Array) -> Array:
            slopes = -linear(z)[1][1:]
            return np.column_stack([slopes, np.full(len(slopes), 0.0 if loss else 1.0)])

        try:
            begin = np.append(first, at(first)[1:].max(initial=0.0))
            minimize(
                least, begin, jac=True, method="SLSQP", bounds=[*[(0.0, 1.0)] * len(first), (0.0, FAILED)],
                constraints={"type": "ineq", "fun": limit, "jac": limit_slopes},
                options={"ftol": 1e-5},
            )  # fmt: skip
        except StopIteration:
            pass
        return best[-1][2], best[-1][0]

    def _uses(self, values: Array, pairs: dict[str, str], products: Catalogue) -> tuple[dict[str, float], float]:
        """The utilisations of given pairs by axis and criterion, and their losses; none where there is no design."""
        self.designs.done(len(self.designs.rows))  # where Ctrl-C is seen
        try:
            prepared = self.designs.prepared(self.designs.design(values.tolist()), pairs, products)
        except BellcrankError:
            return {}, FAILED
        return utilisations(prepared.problem)

    def _products(self, pairs: dict[str, str]) -> Catalogue:
        """The products of some pairs alone."""
        wanted = {part for ids in pairs.values() for part in ids.split("+")}
        every = self.points[0][1].products
        return Catalogue(
            tuple(one for one in every.motors if one.id in wanted),
            tuple(one for one in every.gears if one.id in wanted),
            every.left_out,
        )

    # ---- other combinations

    def _nearest(self) -> None:
        """Where nothing passes at any point, search values for the combinations that are nearest to it."""
        tables = self._tables(math.inf, math.inf)
        few = [np.argsort(one.use.min(axis=0), kind="stable")[:STARTS] for one in tables]
        combinations = list(product(*(one.tolist() for one in few)))
        uses = [self._at_points(tables, one)[0] for one in combinations]
        for k in np.argsort([use.min() for use in uses], kind="stable")[:NEAREST].tolist():
            values, use = self._values_for(
                self._pairs(tables, combinations[k]), self.points[int(uses[k].argmin())][0], 1.0
            )
            if not exceeds(np.array(use)) and (found := self._choose(values)) is not None:
                self._improve(values, found)
                return

    def _at_points(self, tables: Sequence[_Table], places: Combination) -> tuple[Array, Array]:
        """How much a combination is used at each point, and how little is known of it."""
        pairs = list(zip(tables, places, strict=True))
        return np.max([one.use[:, k] for one, k in pairs], axis=0), np.sum(
            [one.level[:, k] for one, k in pairs], axis=0
        )

    def _pairs(self, tables: Sequence[_Table], places: Combination) -> dict[str, str]:
        """The ids of a combination by axis."""
        found = {}
        for one, table, place in zip(self.points[0][1].problem.axes, tables, places, strict=True):
            motor, gear = one.pairs.rows(int(table.row[place]))
            found[one.axis.name] = _ids(motor.id, gear.id)
        return found

    def _lighter(self) -> None:
        """Try combinations of less mass or cost than the best, in their order, until one passes."""
        assert self.designs.best is not None
        number, selection, _ = self.designs.best
        best = self.designs.rows[number].mass if self.objective == "mass" else self.designs.rows[number].cost
        if best is None:
            return
        level = _level([one.chosen for one in selection.axes if one.chosen is not None])
        tables = self._tables(best, level)
        searched, gap, nearest_use = 0, 0.0, math.inf
        nearest: tuple[str, ...] = ()
        for looked, (value, places) in enumerate(_in_order([table.figure for table in tables])):
            if value >= best - RESOLUTION:
                break
            if searched == MOST_SEARCHES or looked == MOST_COMBINATIONS:
                gap = best - value
                break
            use, levels = self._at_points(tables, places)
            if not (near := (use <= NEAR) & (levels <= level)).any():
                continue
            searched += 1
            pairs = self._pairs(tables, places)
            start = self.points[int(np.where(near, use, np.inf).argmin())][0]
            values, least = self._values_for(pairs, start, 1.0)
            if not exceeds(np.array(least)):
                again = self._choose(values)
                if again is not None and self.designs.best[0] == len(self.designs.rows) - 1:
                    self._improve(values, again)
                    break
            elif least < nearest_use:
                nearest, nearest_use = tuple(pairs.values()), least
        self.inside = Inside(self.inside.sampled, searched, gap, nearest, nearest_use)

    def _tables(self, best: float, level: float) -> list[_Table]:
        """The pairs of each axis that may be part of something below a mass or cost: that come near to passing at a
        point, without the masses of other axes, and are no less known there than a level.
        """
        problem = self.points[0][1].problem
        figures = [one.bodies.mass if self.objective == "mass" else one.cost for one in problem.axes]
        least = [float(np.nanmin(each)) for each in figures]
        found = []
        for axis, figure in enumerate(figures):
            lighter = figure < best - (sum(least) - least[axis]) - RESOLUTION  # NaN is unknown
            lighter |= math.isinf(best)
            rows = np.flatnonzero(lighter & (problem.bounds[axis][:, 0] == 0))
            use, levels = np.full((2, len(self.points), len(rows)), np.inf)
            for point, (_, prepared, _) in enumerate(self.points):
                masses = (NO_MASS,) * len(figures)
                short = np.nan_to_num(prepared.problem.judgement(axis, masses, rows).largest_use, nan=0.0)
                near = np.flatnonzero(short <= NEAR)  # of which those that fail were not judged by all criteria
                judgement = completed(prepared.problem.judgement(axis, masses, rows[near]))
                use[point, near] = np.nan_to_num(judgement.largest_use, nan=0.0)
                unknown = judgement.verdict == UNKNOWN
                main = unknown[[one.name in MAIN for one in judgement.criteria]].sum(axis=0)
                levels[point, near] = UNSHOWN * unknown.any(axis=0) + main
            kept = np.flatnonzero(((use <= NEAR) & (levels <= level)).any(axis=0))
            found.append(_Table(rows[kept], figure[rows[kept]], use[:, kept], levels[:, kept]))
        return found


class _Table(NamedTuple):
    """Some pairs (m,) of an axis: their numbers, masses or costs, and by point their uses and how little is known."""

    row: Indices
    figure: Array
    use: Array
    level: Array


def _level(chosen: Sequence[Candidate]) -> int:
    """How little is known of some pairs: how many are not all shown, then the number of unknown main criteria."""
    return sum(UNSHOWN * bool(one.unknown) + len(MAIN & set(one.unknown)) for one in chosen)


def utilisations(problem: JudgedAxes) -> tuple[dict[str, float], float]:
    """The known utilisations by axis and criterion of axes with one pair each, and the sum of their losses, W."""
    choice = (0,) * len(problem.axes)
    masses, found, losses = problem.choice_masses(choice), dict[str, float](), 0.0
    for k, one in enumerate(problem.axes):
        judgement = completed(problem.judgement(k, masses, np.zeros(1, dtype=np.intp)))
        judged = zip(judgement.criteria, judgement.use[:, 0], judgement.verdict[:, 0], strict=True)
        for criterion, use, verdict in judged:
            if verdict != NOTE and not math.isnan(use):
                found[f"{one.axis.name} {criterion.name}"] = float(use)
        losses += float(np.nan_to_num(judgement.loss[0], nan=0.0))
    for result in system_results(problem, choice):
        if result.use is not None:
            found[f" {result.name}"] = float(result.use)
    return found, losses


def _ids(motor: str, gear: str) -> str:
    return f"{motor}+{gear}"


def _in_order(figures: Sequence[Array]) -> Iterator[tuple[float, Combination]]:
    """Combinations of one entry of each array, as places, in the order of their sums."""
    if not all(map(len, figures)):
        return
    orders = [np.argsort(one, kind="stable") for one in figures]
    ranked = [one[order] for one, order in zip(figures, orders, strict=True)]
    first = (0,) * len(figures)
    heap, seen = [(float(sum(one[0] for one in ranked)), first)], {first}
    while heap:
        value, ranks = heapq.heappop(heap)
        yield value, tuple(int(order[k]) for order, k in zip(orders, ranks, strict=True))
        for axis in range(len(ranks)):
            after = (*ranks[:axis], ranks[axis] + 1, *ranks[axis + 1 :])
            if after[axis] < len(ranked[axis]) and after not in seen:
                seen.add(after)
                heapq.heappush(heap, (float(sum(one[k] for one, k in zip(ranked, after, strict=True))), after))
