"""`pareto_front`: designs between several objectives, of which no other design betters all.

One objective is made best while the others keep levels (epsilon constraints) between what they reach at best and what
they are where another objective is best. Each such design comes from the local searches of `optimise`, which begin from
the best of all designs that were run before. Designs that another one dominates are searched for once more, and else
left out. Source: Y. Y. Haimes, L. S. Lasdon, D. A. Wismer, IEEE Trans. Systems, Man, Cybernetics 1 (1971) 296-297.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from bellcrank import arguments
from bellcrank.arguments import PROGRESS, Progress
from bellcrank.arrays import Array, Indices
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.access import Trust
from bellcrank.robot.robot import Robot
from bellcrank.scene.load import given_scene
from bellcrank.scene.scene import Scene
from bellcrank.scene.study import MOST_FRONT_POINTS
from bellcrank.studies.execution.executors import choose_executor
from bellcrank.studies.optimisation.kept_designs import KeptDesigns
from bellcrank.studies.optimisation.local_search import KEPT
from bellcrank.studies.optimisation.optimise import result_of_known, run_search, search_known
from bellcrank.studies.optimisation.optimum import Optimum
from bellcrank.studies.optimisation.pareto_result import ParetoFront, dominates
from bellcrank.studies.optimisation.problem import DesignProblem
from bellcrank.studies.optimisation.request import FAR, POINTS, STARTS, Request, level, plan_search
from bellcrank.studies.optimisation.size_search import SAME_VALUE

SHARE = 4  # of the local searches: a quarter of them, and at least two, for each level
REPAIRS = 2
NEAR = 1e-3  # of objectives in units of their spread: designs that differ less are one of the front


@arguments.named
def pareto_front(
    scene: Scene | Robot | str | Path,
    variables: Mapping[str, Any] | None = None,
    *,
    minimise: str | Sequence[str] | None = None,
    maximise: str | Sequence[str] | None = None,
    limits: Sequence[str] | None = None,
    points: int | None = None,
    size: bool | None = None,
    fastest: bool | None = None,
    start: Mapping[str, Any] | None = None,
    samples: int | None = None,
    starts: int | None = None,
    seed: int | None = None,
    tolerances: Mapping[str, Any] | None = None,
    robust: str | None = None,
    folder: str | Path | None = None,
    restart: bool = False,
    threads: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
    progress: Progress | None = None,
) -> ParetoFront:
    """Find designs between several objectives, of which no design that was run betters all (a Pareto front).

    Args:
        scene: As for `optimise`.
        variables: As for `optimise`.
        minimise: The measures to be made small, such as ["shoulder.peak_torque", "elbow.peak_torque"].
        maximise: The measures to be made large. With `minimise` there are two objectives or more.
        limits: As for `optimise`.
        points: The number of levels of each objective but the first, by default 9. Where all combinations of standard
            sizes are run, all designs of the front are found, whatever `points` is.
        size: As for `optimise`.
        fastest: As for `optimise`.
        start: As for `optimise`.
        samples: As for `optimise`.
        starts: The number of local searches for the best of each objective, by default 8; a quarter for each level.
        seed: As for `optimise`.
        tolerances: As for `optimise`.
        robust: As for `optimise`.
        folder: As for `optimise`.
        restart: As for `optimise`.
        threads: As for `optimise`.
        workers: As for `optimise`.
        scheduler: As for `optimise`.
        overrides: As for `optimise`.
        trust: As for `optimise`.
        progress: As for `optimise`.

    Returns:
        The front. Each of its designs is an `Optimum` of the first objective, whose limits hold the others at their
        levels, or of another objective where that is at its best. Ctrl-C keeps those that were found.

    Raises:
        InputError: As `optimise`, or there are less than two objectives.
        BellcrankError: None of the designs can be run, or none keeps the limits.

    Example:
        >>> import bellcrank as bc
        >>> front = bc.pareto_front("four_bar", {"crank_length": {"sizes": [1.22, 1.23, 1.24]}},
        ...                         minimise="lock.time", maximise="lock.crank")
        >>> front.objectives
        ('lock.time', 'lock.crank')
    """
    scene = given_scene(scene, overrides, trust)
    report = None if progress is None else arguments.function("progress", progress, PROGRESS)
    told = None if report is None else lambda done: report(done, None)
    asked = Request(
        variables, minimise, maximise, limits, size, start, samples, starts, seed, points, tolerances, robust, fastest
    )
    executor = choose_executor(threads, workers, scheduler)
    problem, asked, begin = plan_search(scene, asked, executor, told)
    if len(asked.objectives) < 2:
        raise InputError(
            f"pareto_front {scene.name}: expected two measures or more to minimise or to maximise, found "
            f"{asked.several}; bellcrank.optimise finds the best of one"
        )
    restart = arguments.flag("restart", restart)
    with contextlib.ExitStack() as stack:
        if folder is not None:
            kept = KeptDesigns(arguments.path("folder", folder, "the path of a folder"), restart=restart)
            problem.keep_in(stack.enter_context(kept))
        stack.enter_context(executor)
        return run_front(problem, asked, begin)


def run_front(problem: DesignProblem, asked: Request, start: Array | None) -> ParetoFront:
    """Search. Raises InputError and BellcrankError as `pareto_front`."""
    points, others = asked.points or POINTS, asked.objectives[1:]
    if points ** len(others) > MOST_FRONT_POINTS:
        count = f"{points ** len(others)}: {points} levels of each of {len(others)} objectives"
        raise InputError(f"points: expected at most {MOST_FRONT_POINTS} designs, found {count}")
    limits = problem.limits[: len(problem.limits) - len(others)]
    first = run_search(problem, asked, start)
    search = _Front(asked, limits, first)
    if not first.keeps_limits:
        raise BellcrankError(f"pareto_front {problem.scene.name}: no design that keeps the limits was found")
    complete = first.complete
    if first.combinations is not None and first.combinations.proved:
        search.take_all()
    elif complete:
        try:
            search.run(points)
        except KeyboardInterrupt:
            complete = False
            if not search.designs:
                search.designs = [first]
    else:
        search.designs = [first]
    designs, left_out = search.front()
    return ParetoFront(search.pool, asked.objectives, limits, designs, left_out, complete)


class _Front:
    """The designs of a front while they are searched for.

    Attributes:
        pool: The problem of the first objective with every design that was run.
        designs: What was found for each level.
        ends: The best of each objective.
    """

    def __init__(self, asked: Request, limits: tuple[Any, ...], first: Optimum) -> None:
        self.asked, self.limits, self.first = asked, limits, first
        self.pool = first.problem
        self.names = [name for name, _ in asked.objectives]
        self.signs = np.array([sign for _, sign in asked.objectives])
        self.designs: list[Optimum] = []
        self.ends: list[Optimum] = []

    # ---- problems

    def _framed(self, k: int, levels: Mapping[int, float]) -> DesignProblem:
        """The problem of an objective with the others at levels, or without effect."""
        units, limits = self.pool.units, list(self.limits)
        for j, (name, sign) in enumerate(self.asked.objectives):
            if j != k:
                limits.append(level(name, sign, levels.get(j, sign * FAR), units))
        return self.pool.reframed(self.names[k], float(self.signs[k]), tuple(limits))

    def _before(self, problem: DesignProblem) -> Array:
        """Measures of the scene's own design, in the order of a problem."""
        return np.asarray(self.first.before[[self.first.problem.measures.index(name) for name in problem.measures]])

    def _search(self, k: int, levels: Mapping[int, float], starts: int) -> Optimum:
        problem = self._framed(k, levels)
        try:
            return search_known(problem, self.asked, starts, self._before(problem))
        finally:
            self.pool = problem.reframed(self.pool.measure, self.pool.sign, self.pool.limits)

    def values(self, designs: Sequence[Optimum]) -> Array:
        """The scaled objectives (n, k), to be made small, of designs."""
        found = np.array([[one.measures[name] for name in self.names] for one in designs])
        return np.asarray(found.reshape(-1, len(self.names)) * self.signs / self._spreads())

    def _spreads(self) -> Array:
        return self.pool.spreads[[self.pool.measures.index(name) for name in self.names]]

    def known(self) -> tuple[Array, Indices]:
        """The scaled objectives (n, k) of the designs at sizes within bounds that keep the limits, and their rows."""
        plain = self._framed(0, {})
        points, values = np.concatenate(plain.points), np.concatenate(plain.values)
        rows = np.flatnonzero(plain.within(points) & (plain.violation(values) <= KEPT))
        columns = [plain.measures.index(name) for name in self.names]
        return values[rows][:, columns] * self.signs / self._spreads(), rows

    # ---- searches

    def run(self, points: int) -> None:
        """Find the best of each objective, then of the first with the others at levels."""
        starts = self.asked.starts or STARTS
        best = [self.first, *(self._search(k, {}, starts) for k in range(1, len(self.names)))]
        measures = np.array([[one.measures[name] for name in self.names] for one in best if one.keeps_limits])
        self.ends = [self._at_levels(k, one) for k, one in enumerate(best) if one.keeps_limits]
        grids = []
        for k in range(1, len(self.names)):
            sign = self.signs[k]
            grids.append(
                np.unique(np.linspace((sign * measures[:, k]).min(), (sign * measures[:, k]).max(), points)) * sign
            )
        few = max(starts // SHARE, 2)
        for levels in product(*(grid.tolist() for grid in grids)):
            self.designs.append(self._search(0, dict(enumerate(levels, 1)), few))
        for _ in range(REPAIRS):
            known, _ = self.known()
            poor = np.flatnonzero(dominates(known, self.values(self.designs)))
            if not len(poor):
                break
            for n in poor.tolist():
                limits = self.designs[n].problem.limits[len(self.limits) :]
                self.designs[n] = self._search(0, {k: limit.value for k, limit in enumerate(limits, 1)}, few)

    def _at_levels(self, k: int, one: Optimum) -> Optimum:
        """The best of an objective, whose limits say what it has of the others."""
        levels = {j: one.measures[name] for j, name in enumerate(self.names)}
        problem = one.problem
        return replace(one, problem=problem.reframed(problem.measure, problem.sign, self._framed(k, levels).limits))

    def take_all(self) -> None:
        """Take the front of the designs that were run, which are all combinations of sizes."""
        known, rows = self.known()
        kept = rows[~dominates(known, known)]
        plain = self._framed(0, {})
        for row in kept.tolist():
            values = np.concatenate(plain.values)[row]
            levels = {k: float(values[plain.measures.index(name)]) for k, name in enumerate(self.names) if k}
            problem = self._framed(0, levels)
            self.designs.append(result_of_known(problem, self.asked, self._before(problem), self.first))

    def front(self) -> tuple[tuple[Optimum, ...], int]:
        """The designs that keep the limits and that no design dominates, in the order of the first objective; and how
        many others were left out. Of designs that are nearly the same one that is an optimum is kept.
        """
        proved = self.first.combinations is not None and self.first.combinations.proved
        designs = [one for one in [*self.ends, *self.designs] if one.keeps_limits]
        values, (known, _) = self.values(designs), self.known()
        good = ~dominates(known, values)
        order = sorted(np.flatnonzero(good).tolist(), key=lambda n: (not designs[n].converged, *values[n].tolist()))
        chosen: list[int] = []
        for n in order:
            if all(np.abs(values[n] - values[m]).max() > (SAME_VALUE if proved else NEAR) for m in chosen):
                chosen.append(n)
        chosen.sort(key=lambda n: tuple(values[n].tolist()))
        return tuple(designs[n] for n in chosen), len(self.designs) + len(self.ends) - int(good.sum())
