"""The search over standard sizes: all combinations one by one, or branch and bound with continuous variables inside.

Where every variable has sizes and there are at most `MOST_RUN` combinations, all are run. Otherwise local searches over
a box, with sizes as if they were continuous, give what its combinations can reach; a box whose end is no better than
the best combination is left out, another is cut at the size that its end is farthest from. Ends are rounded to sizes
and searched again, so that good combinations are known early. Source: A. H. Land, A. G. Doig, Econometrica 28 (1960)
497-520. Ends are local optima: that no box was left out wrongly is not proved where the problem is not convex.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from bellcrank.arrays import Array
from bellcrank.studies.optimisation.gradients import Gradients
from bellcrank.studies.optimisation.local_search import KEPT, LocalSearch, local_searches
from bellcrank.studies.optimisation.problem import DesignProblem

MOST_RUN = 10_000  # combinations that are all run
MOST_BOXES = 5000
TOGETHER = 16  # boxes that are searched together
STARTS = 3  # of a box, besides the end of the box that it was cut from
SAME_VALUE = 1e-6  # of objectives, in units of their spread


@dataclass(frozen=True)
class Combinations:
    """How the combinations of standard sizes were searched.

    Attributes:
        count: How many there are.
        tried: How many were run, or searched with all their sizes.
        gap: How much better than the design, at most, is what local searches found in boxes that are left, in the unit
            of the objective; 0 where none is left, infinite where no combination keeps the limits.
        proved: Whether all of them were run.
    """

    count: int
    tried: int
    gap: float
    proved: bool

    @property
    def complete(self) -> bool:
        """Whether each combination was tried or excluded."""
        return self.gap == 0.0


@dataclass(frozen=True, eq=False)
class Box:
    """Bounds (variables,) of designs, what their local optimum is not better than, and where to start."""

    lower: Array
    upper: Array
    bound: float
    end: Array | None = None


def all_combinations(problem: DesignProblem) -> Array | None:
    """The points (n, variables) of all combinations; None where there are too many, or a variable has no sizes."""
    if len(problem.sizes) < len(problem.variables) or problem.combinations > MOST_RUN:
        return None
    grid = np.meshgrid(*(problem.sizes[k] for k in range(len(problem.variables))), indexing="ij")
    return np.stack([axis.ravel() for axis in grid], axis=1)


@dataclass(eq=False)
class SizeSearch:
    """Branch and bound over the sizes of a problem whose sample has been run.

    Attributes:
        problem: The problem.
        gradients: Its gradients.
        each: Called after each iteration.
        found: Searches with all sizes fixed.
        open: Boxes that are left.
    """

    problem: DesignProblem
    gradients: Gradients
    each: Callable[[], object]
    found: list[LocalSearch] = field(default_factory=list)
    open: list[Box] = field(default_factory=list)
    tried: set[tuple[float, ...]] = field(default_factory=set)

    def run(self, starts: Array) -> None:
        """Search, at first from some feasible designs (n, variables). Raises StudyInterrupted on Ctrl-C."""
        size = len(self.problem.variables)
        self.open = [Box(np.zeros(size), np.ones(size), -np.inf)]
        boxes = 0
        while self.open and boxes < MOST_BOXES:
            now = self.open[:TOGETHER]
            ends = self._ends(now, starts)
            self._round([one for group in ends for one in (group[:1] if boxes else group)])
            parts = [part for box, group in zip(now, ends, strict=True) for part in self._cut(box, group)]
            left = [one for one in self.open[TOGETHER:] + parts if one.bound < self.best - SAME_VALUE]
            self.open = sorted(left, key=lambda one: one.bound)
            boxes, starts = boxes + len(now), starts[:0]

    @property
    def best(self) -> float:
        """The scaled objective of the best combination; infinite where none keeps the limits."""
        return min(map(self._merit, self.found), default=np.inf)

    def result(self) -> Combinations:
        """How the combinations were searched."""
        bound, best = min((one.bound for one in self.open), default=self.best), self.best
        gap = 0.0 if not self.open else float((best - bound) * self.problem.scales[0])
        return Combinations(self.problem.combinations, len(self.tried), gap, False)

    def _merit(self, one: LocalSearch) -> float:
        values = one.values[None]
        return float(self.problem.objective(values)[0]) if self.problem.violation(values)[0] <= KEPT else np.inf

    # ---- boxes

    def _ends(self, boxes: Sequence[Box], starts: Array) -> list[list[LocalSearch]]:
        """The ends of searches in boxes, the best of each first."""
        given = [self._starts(box, starts) for box in boxes]
        owners = np.repeat(np.arange(len(boxes)), list(map(len, given)))
        lower, upper = (np.array([getattr(boxes[k], name) for k in owners.tolist()]) for name in ("lower", "upper"))
        searches = self._searches(np.concatenate(given), lower, upper)
        return [sorted((one for k, one in searches if owners[k] == n), key=self._merit) for n in range(len(boxes))]

    def _starts(self, box: Box, starts: Array) -> Array:
        """Designs in a box: the end of the box that it was cut from, the best known ones, and given ones."""
        points, values = np.concatenate(self.problem.points), np.concatenate(self.problem.values)
        inside = ((points >= box.lower) & (points <= box.upper)).all(axis=1)
        rows = np.flatnonzero(inside & np.isfinite(values).all(axis=1))
        merit = self.problem.objective(values[rows]) + 10.0 * self.problem.violation(values[rows])
        rows = rows[np.argsort(merit, kind="stable")]
        chosen: list[Array] = []
        for point in points[rows]:
            if len(chosen) < STARTS and all(np.abs(point - one).max() > 0.05 for one in chosen):
                chosen.append(point)
        own = [] if box.end is None else [np.clip(box.end, box.lower, box.upper)]
        return np.array([*own, *chosen, *starts]).reshape(-1, len(box.lower))

    def _searches(self, points: Array, lower: Array, upper: Array) -> list[tuple[int, LocalSearch]]:
        """Searches from those points that are feasible, with their numbers."""
        values = self.problem.run(points)
        rows = np.flatnonzero(np.isfinite(values).all(axis=1))
        boxes = lower[rows], upper[rows]
        found = local_searches(self.problem, self.gradients, points[rows], values[rows], self.each, boxes)
        return list(zip(rows.tolist(), found, strict=True))

    def _cut(self, box: Box, ends: Sequence[LocalSearch]) -> list[Box]:
        """The parts of a box that are left after its searches; none where it is one combination, or has no end that
        keeps the limits and is not at sizes.
        """
        bound = max(box.bound, self._merit(ends[0])) if ends else np.inf
        if not np.isfinite(bound):
            return []
        point = ends[0].point
        away = {
            k: float(np.abs(sizes - point[k]).min() / np.diff(sizes).max()) for k, sizes in self.problem.sizes.items()
        }
        k = max(away, key=away.__getitem__)
        if away[k] < 1e-9:
            return []
        sizes, parts = self.problem.sizes[k], []
        for below in (True, False):
            lower, upper = box.lower.copy(), box.upper.copy()
            if below:
                upper[k] = sizes[sizes <= point[k]].max()
            else:
                lower[k] = sizes[sizes >= point[k]].min()
            parts.append(Box(lower, upper, bound, point))
        return parts

    def _round(self, ends: Sequence[LocalSearch]) -> None:
        """Search beside ends with each size fixed at the nearest one."""
        fixed = list(self.problem.sizes)
        fresh = []
        for point in self.problem.at_sizes(
            np.array([one.point for one in ends]).reshape(-1, len(self.problem.variables))
        ):
            if (key := tuple(point[fixed].tolist())) not in self.tried:
                self.tried.add(key)
                fresh.append(point)
        if fresh:
            lower, upper = np.array(fresh), np.array(fresh)
            free = [k for k in range(lower.shape[1]) if k not in fixed]
            lower[:, free], upper[:, free] = 0.0, 1.0
            self.found += [one for _, one in self._searches(np.array(fresh), lower, upper)]
