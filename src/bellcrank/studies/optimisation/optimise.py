"""`optimise`: the best design of a scene within bounds and limits."""

from __future__ import annotations

import contextlib
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bellcrank import arguments
from bellcrank.arguments import PROGRESS, Progress
from bellcrank.arrays import Array
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.access import Trust
from bellcrank.robot.robot import Robot
from bellcrank.scene.load import given_scene
from bellcrank.scene.scene import Scene
from bellcrank.studies.designs.samples import Sample
from bellcrank.studies.execution.executors import choose_executor
from bellcrank.studies.optimisation.gradients import Gradients
from bellcrank.studies.optimisation.kept_designs import KeptDesigns
from bellcrank.studies.optimisation.local_search import (
    CONVERGED,
    KEPT,
    LARGEST_PENALTY,
    LocalSearch,
    linearise,
    local_searches,
)
from bellcrank.studies.optimisation.optimum import Basin, Optimum
from bellcrank.studies.optimisation.problem import DesignProblem
from bellcrank.studies.optimisation.request import SAMPLES, STARTS, Request, plan_search
from bellcrank.studies.optimisation.size_search import SAME_VALUE, Combinations, SizeSearch, all_combinations
from bellcrank.studies.results.study_columns import varies

SAME_DESIGN = 1e-3  # up to this difference, scaled, and SAME_VALUE of the objective two local optima are one


@arguments.named
def optimise(
    scene: Scene | Robot | str | Path,
    variables: Mapping[str, Any] | None = None,
    *,
    minimise: str | None = None,
    maximise: str | None = None,
    limits: Sequence[str] | None = None,
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
) -> Optimum:
    """Find the values of parameters within bounds that make a measure smallest or largest, and keep limits.

    Sobol points over all bounds are run first, many at once as in `sweep`; from the best of them that are best among
    their neighbours, local searches by sequential quadratic programming follow. The result is the best design found:
    a local optimum, whose first-order conditions are computed. That no better one exists is not proved.

    Where all variables have standard sizes and at most 10,000 combinations, all of them are run, and the result is the
    best of them. Otherwise combinations are searched by branch and bound, with local searches inside.

    Args:
        scene: A scene or robot, or the path or name of its file.
        variables: Bounds (lower, upper) by parameter of the scene or dotted path, whatever `sweep` can vary; numbers
            in SI units, or texts such as "1 deg". Standard sizes are {"sizes": [0.3, 0.31]}, or {"lower": 0.3,
            "upper": 0.4, "step": "5 mm"}. None: as the scene says under `optimise`.
        minimise: The measure to be made small, one of those of `sweep`, such as "lock.time", or a formula of measures:
            "go.duration + 0.008 * elbow.peak_torque".
        maximise: The measure to be made large, instead.
        limits: Conditions on measures, or formulas of them, that the design is to keep: "lock.crank <= 120 deg", with
            <=, >= or =.
        size: Whether designs are sized over the motions of the configuration, as by `sweep(size=True)`, instead of
            simulated; by default as the scene says, else False.
        fastest: Whether the fastest motions along the paths of the configuration's motions are found, as by
            `sweep(fastest=True)`, instead; by default as the scene says, else False.
        start: Values by the names of `variables`, a design from which a local search begins too. The values of the
            scene are another start where they are within the bounds.
        samples: The number of Sobol points, by default 256; a power of two is best.
        starts: The number of local searches from Sobol points, by default 8.
        seed: Of the sample, by default 0. The same seed gives the same result, with any number of threads.
        tolerances: Distributions of deviations, by what is varied or another number of the scene, such as
            {"crank_length": "uniform(-1 mm, 1 mm)"}. Each design is then judged at deviations of its values.
        robust: How: "worst" (by default), over the design and the ends of the tolerances, or "mean + K sd" such as
            "mean + 3 sd", over a sample; to the worse side of each measure.
        folder: A folder in which the designs that were run are kept under "checkpoints". A search that was killed and
            is started again with the same arguments takes them as they are, and has the same result.
        restart: Set what is kept there aside.
        threads: How many threads run designs; by default as many as the machine has processors, and one in each worker.
        workers: Run designs in so many processes of a Dask cluster on this machine; the result is the same.
        scheduler: Or on the workers of this Dask scheduler, such as "tcp://10.0.0.1:8786".
        overrides: Changes of the scene beforehand, by dotted path.
        trust: Where `scene` is a file, folders whose files it may name, besides those near it.
        progress: Called with the number of designs that were run, and None, as it is not known how many follow.

    Returns:
        The best design, with its multipliers and its residual. Ctrl-C keeps the best design so far.

    Raises:
        InputError: A name, bound, limit or start is not as expected, or no variable changes the objective.
        BellcrankError: None of the designs can be run.

    Example:
        >>> import bellcrank as bc
        >>> best = bc.optimise("four_bar", {"crank_length": (1.22, 1.24)}, minimise="lock.time", samples=16)
        >>> print(best.values["crank_length"], best.at_bounds)
        1.24 {'crank_length': 'upper'}
    """
    scene = given_scene(scene, overrides, trust)
    report = None if progress is None else arguments.function("progress", progress, PROGRESS)
    told = None if report is None else lambda done: report(done, None)
    asked = Request(
        variables,
        minimise,
        maximise,
        limits,
        size,
        start,
        samples,
        starts,
        seed,
        tolerances=tolerances,
        robust=robust,
        fastest=fastest,
    )
    executor = choose_executor(threads, workers, scheduler)
    problem, asked, begin = plan_search(scene, asked, executor, told)
    if len(asked.objectives) > 1:
        raise InputError(
            f"optimise {scene.name}: expected one measure to minimise or to maximise, found {asked.several}; "
            "bellcrank.pareto_front finds the designs between them"
        )
    restart = arguments.flag("restart", restart)
    with contextlib.ExitStack() as stack:
        if folder is not None:
            kept = KeptDesigns(arguments.path("folder", folder, "the path of a folder"), restart=restart)
            problem.keep_in(stack.enter_context(kept))
        stack.enter_context(executor)
        return run_search(problem, asked, begin)


def run_search(problem: DesignProblem, asked: Request, start: Array | None) -> Optimum:
    """Search. Raises InputError and BellcrankError as `optimise`."""
    count, starts = asked.samples or SAMPLES, asked.starts or STARTS
    gradients = Gradients(problem)
    searches, history, complete = list[LocalSearch](), list[tuple[int, float]](), True
    before = np.full(1 + len(problem.limits), np.nan)
    tree, combinations = None, None

    def record() -> None:
        if (row := problem.best(KEPT)) is not None:
            history.append((problem.count, float(np.concatenate(problem.values)[row, 0])))

    try:
        here = problem.present_point()
        if here is not None:
            before = problem.run(here[None])[0]
        first = [] if here is None or not _inside(here) else [here]
        if start is not None:
            _check_start(problem, start, problem.run(start[None]))
            first.append(start)
        points = all_combinations(problem)
        if all_run := points is not None:
            asked = replace(asked, samples=0)
        else:
            drawn = Sample(count, "sobol", asked.seed or 0)
            points = problem.at_sizes(drawn.points(0, count, len(problem.variables)))
        values = problem.run(points)
        _refuse_constant(problem, values)
        problem.set_scales(values)
        record()
        if all_run:
            combinations = Combinations(len(points), len(points), 0.0, True)
            return _result(problem, gradients, searches, asked, before, history, complete, combinations)
        chosen = _starts(problem, points, values, starts)
        begin = np.concatenate([np.array(first).reshape(-1, len(problem.variables)), points[chosen]])
        known = np.concatenate([problem.run(begin[: len(first)]), values[chosen]])
        good = np.isfinite(known).all(axis=1)
        if problem.sizes:
            tree = SizeSearch(problem, gradients, record)
            tree.run(begin[good])
            searches = tree.found
        else:
            searches = local_searches(problem, gradients, begin[good], known[good], record)
    except KeyboardInterrupt:
        complete = False
        if problem.best(KEPT) is None:
            raise
        record()
    if problem.sizes:
        combinations = Combinations(problem.combinations, 0, math.inf, False) if tree is None else tree.result()
    return _result(problem, gradients, searches, asked, before, history, complete, combinations)


def search_known(problem: DesignProblem, asked: Request, starts: int, before: Array) -> Optimum:
    """Search from the best of the designs that were run already, whose combinations of sizes were not all run.

    Raises StudyInterrupted on Ctrl-C.
    """
    gradients, history = Gradients(problem), list[tuple[int, float]]()

    def record() -> None:
        if (row := problem.best(KEPT)) is not None:
            history.append((problem.count, float(np.concatenate(problem.values)[row, 0])))

    record()
    points, values = np.concatenate(problem.points), np.concatenate(problem.values)
    inside = ((points >= 0.0) & (points <= 1.0)).all(axis=1)
    points, values = points[inside], values[inside]
    chosen, combinations = _starts(problem, points, values, starts), None
    if problem.sizes:
        tree = SizeSearch(problem, gradients, record)
        tree.run(points[chosen])
        searches, combinations = tree.found, tree.result()
    else:
        searches = local_searches(problem, gradients, points[chosen], values[chosen], record)
    return _result(problem, gradients, searches, asked, before, history, True, combinations)


def result_of_known(problem: DesignProblem, asked: Request, before: Array, found: Optimum) -> Optimum:
    """The best of the designs that were run already: all combinations of sizes, as in a result that was `found`."""
    combinations, history = found.combinations, found.history
    return _result(problem, Gradients(problem), (), asked, before, history, found.complete, combinations)


def _check_start(problem: DesignProblem, start: Array, values: Array) -> None:
    """Raise InputError where a start is infeasible or breaks a limit."""
    if not np.isfinite(values).all():
        raise InputError(f"start: the design cannot be run: {problem.reasons[problem.count - 1]}")
    for k, limit in enumerate(problem.limits):
        if problem.excess(values)[0, k] > KEPT:
            unit = "" if limit.unit == "1" else f" {limit.unit}"
            raise InputError(f"start: it breaks the limit {limit}: {limit.measure} is {values[0, 1 + k]:.6g}{unit}")


def _inside(point: Array) -> bool:
    return bool(((point >= 0.0) & (point <= 1.0)).all())


def _refuse_constant(problem: DesignProblem, values: Array) -> None:
    """Raise BellcrankError where no design can be run, and InputError where no variable changes the objective."""
    known = values[np.isfinite(values).all(axis=1)]
    if not len(known):
        reason, count = Counter(problem.reasons.values()).most_common(1)[0]
        raise BellcrankError(f"none of {len(values)} designs within the bounds can be run; {count} of them: {reason}")
    if len(known) > 1 and not varies(known[:, 0], problem.runner.noise):
        raise InputError(f"no variable changes the objective '{problem.measure}', which is {known[0, 0]:g} everywhere")


# ---- the search


def _starts(problem: DesignProblem, points: Array, values: Array, count: int) -> Array:
    """The numbers of the best feasible points that are better than their nearest neighbours; others fill up."""
    from scipy.spatial import KDTree

    rows = np.flatnonzero(np.isfinite(values).all(axis=1))
    merit = problem.objective(values[rows]) + 10.0 * problem.violation(values[rows])
    near = min(2 * points.shape[1], len(rows) - 1)
    best = np.ones(len(rows), dtype=bool)
    if near:
        _, beside = KDTree(points[rows]).query(points[rows], near + 1)
        best = merit <= merit[beside].min(axis=1)
    order = np.lexsort((merit, ~best))
    return np.asarray(rows[order[:count]])


def _basins(problem: DesignProblem, searches: Sequence[LocalSearch]) -> tuple[Basin, ...]:
    """The distinct ends of searches that are optima and keep the limits, the best first."""

    def scaled(one: LocalSearch) -> float:
        return float(problem.objective(one.values[None])[0])

    groups: list[list[LocalSearch]] = []
    ends = [one for one in searches if one.kkt is not None and one.kkt.residual <= CONVERGED]
    for one in sorted(ends, key=scaled):
        for group in groups:
            near = np.abs(group[0].point - one.point).max() < SAME_DESIGN
            if near or abs(scaled(group[0]) - scaled(one)) < SAME_VALUE:
                group.append(one)
                break
        else:
            groups.append([one])
    return tuple(
        Basin(float(group[0].values[0]), len(group), tuple(problem.numbers(group[0].point[None])[0].tolist()))
        for group in groups
    )


def _merit(problem: DesignProblem, one: LocalSearch) -> float:
    broken = float(problem.violation(one.values[None])[0])
    return float(problem.objective(one.values[None])[0]) + (0.0 if broken <= KEPT else LARGEST_PENALTY * broken)


def _result(
    problem: DesignProblem,
    gradients: Gradients,
    searches: Sequence[LocalSearch],
    asked: Request,
    before: Array,
    history: Sequence[tuple[int, float]],
    complete: bool,
    combinations: Combinations | None,
) -> Optimum:
    row = problem.best(KEPT)
    if row is None:
        raise BellcrankError("none of the designs can be run")
    point = np.concatenate(problem.points)[row]
    sized = [k in problem.sizes for k in range(len(point))]
    lower, upper = np.where(sized, point, 0.0), np.where(sized, point, 1.0)
    best = LocalSearch(point, np.concatenate(problem.values)[row], lower, upper)
    merit = {id(one): _merit(problem, one) for one in (best, *searches)}
    if searches:  # of designs that are as good, the end of a search
        least = min(merit.values()) + SAME_VALUE
        ends = [one for one in searches if merit[id(one)] <= least]
        best = min(ends, key=lambda one: math.inf if one.kkt is None else one.kkt.residual, default=best)
    if best.kkt is None and complete and best.free.any():
        linearise(problem, gradients, [best])
    alike = [one for one in searches if (one.point[sized] == best.point[sized]).all()]
    return Optimum(
        problem=problem,
        point=best.point,
        found=best.values,
        before=before,
        kkt=best.kkt,
        reason=best.reason,
        blocked=best.blocked,
        basins=_basins(problem, alike),
        searches=len(alike),
        exact=gradients.exact_measures,
        samples=asked.samples or 0,
        seed=asked.seed or 0,
        history=tuple(history),
        complete=complete,
        combinations=combinations,
    )
