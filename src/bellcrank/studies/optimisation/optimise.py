"""`optimise`: the best design of a scene within bounds and limits."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.access import Trust
from bellcrank.messages import format_value, unknown_name
from bellcrank.scene.given_scene import given_scene
from bellcrank.scene.optimise_entry import MOST_DESIGNS, MOST_STARTS
from bellcrank.scene.scene import Scene
from bellcrank.studies.axes import Axis, read_axis
from bellcrank.studies.columns import varies
from bellcrank.studies.design_space import MOST_DIMENSIONS
from bellcrank.studies.exceedance import parse_limit
from bellcrank.studies.executors import MOST_THREADS
from bellcrank.studies.local_execution import LocalExecutor
from bellcrank.studies.optimisation.gradients import Gradients
from bellcrank.studies.optimisation.local_search import (
    CONVERGED,
    KEPT,
    LARGEST_PENALTY,
    Search,
    linearise,
    local_searches,
)
from bellcrank.studies.optimisation.optimum import Basin, Optimum
from bellcrank.studies.optimisation.problem import DesignProblem, Variable
from bellcrank.studies.samples import LARGEST_SEED, Sample
from bellcrank.studies.sweep_plan import SweepPlan, plan_sizings, plan_sweep

Array = NDArray[np.float64]
SAMPLES, STARTS = 256, 8
SAME_DESIGN, SAME_VALUE = 1e-3, 1e-6  # up to these differences two local optima are one, scaled


@dataclass(frozen=True)
class Request:
    """What is asked for; what is None is as the scene's entry `optimise` says."""

    variables: Mapping[str, Any] | None = None
    minimise: str | None = None
    maximise: str | None = None
    limits: Sequence[str] | None = None
    size: bool | None = None
    start: Mapping[str, Any] | None = None
    samples: int | None = None
    starts: int | None = None
    seed: int | None = None


@arguments.named
def optimise(
    scene: Scene | str | Path,
    variables: Mapping[str, Any] | None = None,
    *,
    minimise: str | None = None,
    maximise: str | None = None,
    limits: Sequence[str] | None = None,
    size: bool | None = None,
    start: Mapping[str, Any] | None = None,
    samples: int | None = None,
    starts: int | None = None,
    seed: int | None = None,
    overrides: Mapping[str, Any] | None = None,
    threads: int | None = None,
    progress: Callable[[int], object] | None = None,
    trust: Trust = (),
) -> Optimum:
    """Find the values of parameters within bounds that make a measure smallest or largest, and keep limits.

    Sobol points over all bounds are run first, many at once as in `sweep`; from the best of them that are best among
    their neighbours, local searches by sequential quadratic programming follow. The result is the best design found:
    a local optimum, whose first-order conditions are computed. That no better one exists is not proved.

    Args:
        scene: A scene, or the path or name of a scene file.
        variables: Bounds (lower, upper) by parameter of the scene or dotted path, whatever `sweep` can vary; numbers
            in SI units, or texts such as "1 deg". None: as the scene says under `optimise`.
        minimise: The measure to be made small, one of those of `sweep`, such as "lock.time".
        maximise: The measure to be made large, instead.
        limits: Conditions on measures that the design is to keep: "lock.crank <= 120 deg", with <=, >= or =.
        size: Whether designs are sized over the motions of the configuration, as by `sweep(size=True)`, instead of
            simulated; by default as the scene says, else False.
        start: Values by the names of `variables`, a design from which a local search begins too. The values of the
            scene are another start where they are within the bounds.
        samples: The number of Sobol points, by default 256; a power of two is best.
        starts: The number of local searches from Sobol points, by default 8.
        seed: Of the sample, by default 0. The same seed gives the same result, with any number of threads.
        overrides: Changes of the scene beforehand, by dotted path.
        threads: How many threads run designs; by default as many as the machine has processors.
        progress: Called with the number of designs that were run.
        trust: Where `scene` is a file, folders whose files it may name, besides those near it.

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
    if progress is not None:
        arguments.function("progress", progress)
    asked = Request(variables, minimise, maximise, limits, size, start, samples, starts, seed)
    if threads is not None:
        threads = arguments.whole("threads", threads, least=1, most=MOST_THREADS)
    return run_search(*plan_search(scene, asked, threads, progress))


def plan_search(
    scene: Scene, asked: Request, threads: int | None = None, progress: Callable[[int], object] | None = None
) -> tuple[DesignProblem, Request, Array | None]:
    """What is looked for, the request with all its numbers, and the start (variables,) that is asked for.

    Raises InputError.
    """
    asked = _completed(scene, asked)
    assert asked.variables is not None and asked.limits is not None
    plan = _planned(scene, asked.variables, sized=bool(asked.size))
    units = plan.runner.units
    for name, measure in (("minimise", asked.minimise), ("maximise", asked.maximise)):
        if measure is not None and measure not in units:
            raise InputError(f"optimise {scene.name}: {name}: {unknown_name('measure', measure, units)}")
    problem = DesignProblem(
        plan.runner.scene,  # type: ignore[attr-defined]
        plan.runner,
        tuple(_variable(scene, axis) for axis in plan.runner.axes),  # type: ignore[attr-defined]
        asked.minimise or asked.maximise or "",
        1.0 if asked.minimise else -1.0,
        tuple(parse_limit(text, units, "limit", kept=True) for text in asked.limits),
        LocalExecutor(threads).threads,
        progress or (lambda done: None),
        plan.notes,
    )
    return problem, asked, None if asked.start is None else _start(problem, asked.start)


def run_search(problem: DesignProblem, asked: Request, start: Array | None) -> Optimum:
    """Search. Raises InputError and BellcrankError as `optimise`."""
    assert asked.samples is not None and asked.starts is not None
    gradients = Gradients(problem)
    searches, history, complete = list[Search](), list[tuple[int, float]](), True
    before = np.full(1 + len(problem.limits), np.nan)

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
        points = Sample(asked.samples, "sobol", asked.seed or 0).points(0, asked.samples, len(problem.variables))
        values = problem.run(points)
        _refuse_constant(problem, values)
        problem.set_scales(values)
        record()
        chosen = _starts(problem, points, values, asked.starts)
        begin = np.concatenate([np.array(first).reshape(-1, len(problem.variables)), points[chosen]])
        known = np.concatenate([problem.run(begin[: len(first)]), values[chosen]])
        good = np.isfinite(known).all(axis=1)
        searches = local_searches(problem, gradients, begin[good], known[good], record)
    except KeyboardInterrupt:
        complete = False
        if problem.best(KEPT) is None:
            raise
    return _result(problem, gradients, searches, asked, before, history, complete)


# ---- what is asked for


def _completed(scene: Scene, asked: Request) -> Request:
    """The request with what the scene's entry says. Raises InputError."""
    entry = scene.optimise
    where = f"optimise {scene.name}"
    variables = dict(entry.vary) if asked.variables is None else asked.variables
    variables = arguments.mapping("variables", variables, "a mapping of parameters to their bounds (lower, upper)")
    if not variables:
        raise InputError(f"{where}: nothing is varied; give bounds of parameters, or write optimise: {{vary: …}}")
    minimise, maximise = asked.minimise, asked.maximise
    for name, value in (("minimise", minimise), ("maximise", maximise)):
        if value is not None:
            arguments.text(name, value, "the name of a measure, such as 'lock.time'")
    if minimise is None and maximise is None:
        minimise, maximise = entry.minimise, entry.maximise
    if (minimise is None) == (maximise is None):
        found = "neither" if minimise is None else "both"
        raise InputError(f"{where}: expected a measure to minimise or one to maximise, found {found}")
    limits = entry.limits if asked.limits is None else asked.limits
    limits = arguments.several("limits", limits, str, "conditions such as 'lock.crank <= 120 deg'", alone=True)
    size = entry.size if asked.size is None else arguments.flag("size", asked.size)
    counts: dict[str, Any] = {}
    for name, default, least, most in (
        ("samples", SAMPLES, 1, MOST_DESIGNS), ("starts", STARTS, 1, MOST_STARTS), ("seed", 0, 0, LARGEST_SEED),
    ):  # fmt: skip
        given, written = getattr(asked, name), getattr(entry, name)
        number = given if given is not None else default if written is None else written
        counts[name] = arguments.whole(name, number, least=least, most=most)
    return replace(
        asked, variables=variables, minimise=minimise, maximise=maximise, limits=limits, size=bool(size), **counts
    )


def _planned(scene: Scene, given: Mapping[str, Any], *, sized: bool) -> SweepPlan:
    """What runs designs within bounds. Raises InputError."""
    if len(given) > MOST_DIMENSIONS:
        raise InputError(f"optimise {scene.name}: expected at most {MOST_DIMENSIONS} variables, found {len(given)}")
    pairs = {}
    for path, bounds in given.items():
        several = isinstance(bounds, (list, tuple, np.ndarray)) and not arguments.is_masked(bounds)
        if not several or len(bounds) != 2:
            raise InputError(f"optimise {scene.name}: '{path}': expected two bounds, found {arguments.found(bounds)}")
        pairs[path] = list(bounds)
    try:
        return (plan_sizings if sized else plan_sweep)(scene, pairs, None)
    except InputError as error:
        raise _renamed(error, f"optimise {scene.name}:") from None


def _renamed(error: InputError, where: str) -> InputError:
    """The error of the axes of a sweep, as one of what was asked for here."""
    text = str(error).replace("sweep over", where)
    return InputError(re.sub(r"""argument 'vary\["(.*?)"\]'""", rf"{where} '\1'", text))


def _variable(scene: Scene, axis: Axis) -> Variable:
    """An axis with two values as a variable. Raises InputError."""
    where = f"optimise {scene.name}: '{axis.path}'"
    if not axis.numeric:
        raise InputError(f"{where}: expected two bounds in one unit, found {format_value(list(axis.choices))}")
    lower, upper = map(float, axis.numbers)
    if not lower < upper:
        found = f"{lower:g} and {upper:g} {axis.unit}".rstrip()
        raise InputError(f"{where}: expected the lower bound below the upper, found {found}")
    return Variable(axis, lower, upper)


def _start(problem: DesignProblem, given: Mapping[str, Any]) -> Array:
    """The point of a start. Raises InputError where it is outside the bounds."""
    given = arguments.mapping("start", given, "a mapping of the variables to their values")
    names = [variable.axis.path for variable in problem.variables]
    numbers = []
    for name in given:
        if name not in names:
            raise InputError(f"start: {unknown_name('variable', name, names)}")
    for variable in problem.variables:
        axis, path = variable.axis, variable.axis.path
        if path not in given:
            raise InputError(f"start: '{path}' has no value; give one of each variable")
        unit = None if axis.suffix else axis.unit
        try:
            own = read_axis(problem.scene, path, [given[path]], unit)
        except InputError as error:
            raise _renamed(error, "start:") from None
        if not own.numeric or (axis.suffix and own.suffix not in ("", axis.suffix)):
            raise InputError(f"start: '{path}': expected a number in {axis.unit}, found {format_value(given[path])}")
        number = float(own.numbers[0])
        if not variable.lower <= number <= variable.upper:
            raise InputError(
                f"start: '{path}' is {number:g} {axis.unit}, outside its bounds {variable.lower:g} to "
                f"{variable.upper:g} {axis.unit}"
            )
        numbers.append(number)
    return problem.point(numbers)


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


def _basins(problem: DesignProblem, searches: Sequence[Search]) -> tuple[Basin, ...]:
    """The distinct ends of searches that are optima and keep the limits, the best first."""

    def scaled(one: Search) -> float:
        return float(problem.objective(one.values[None])[0])

    groups: list[list[Search]] = []
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


def _merit(problem: DesignProblem, one: Search) -> float:
    broken = float(problem.violation(one.values[None])[0])
    return float(problem.objective(one.values[None])[0]) + (0.0 if broken <= KEPT else LARGEST_PENALTY * broken)


def _result(
    problem: DesignProblem,
    gradients: Gradients,
    searches: Sequence[Search],
    asked: Request,
    before: Array,
    history: Sequence[tuple[int, float]],
    complete: bool,
) -> Optimum:
    row = problem.best(KEPT)
    if row is None:
        raise BellcrankError("none of the designs can be run")
    best = Search(np.concatenate(problem.points)[row], np.concatenate(problem.values)[row])
    merit = {id(one): _merit(problem, one) for one in (best, *searches)}
    if searches:  # of designs that are as good, the end of a search
        least = min(merit.values()) + SAME_VALUE
        ends = [one for one in searches if merit[id(one)] <= least]
        best = min(ends, key=lambda one: math.inf if one.kkt is None else one.kkt.residual, default=best)
    if best.kkt is None and complete:
        linearise(problem, gradients, [best])
    return Optimum(
        problem=problem,
        point=best.point,
        found=best.values,
        before=before,
        kkt=best.kkt,
        reason=best.reason,
        blocked=best.blocked,
        basins=_basins(problem, searches),
        searches=len(searches),
        exact=gradients.exact,
        samples=asked.samples or 0,
        seed=asked.seed or 0,
        history=tuple(history),
        complete=complete,
    )
