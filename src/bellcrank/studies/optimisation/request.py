"""What a search for the best design is asked for, checked, as a problem of numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.config.fields import parse_number
from bellcrank.elements.parameters import is_of_the_tree
from bellcrank.errors import InputError
from bellcrank.messages import format_value, unknown_name
from bellcrank.scene.scene import Scene
from bellcrank.scene.study import MOST_DESIGNS, MOST_FRONT_POINTS, MOST_STARTS, OptimiseEntry, sizes_as_written
from bellcrank.studies.designs.axes import MOST_VALUES, StudyAxis, read_axis
from bellcrank.studies.designs.design_space import MOST_DIMENSIONS
from bellcrank.studies.designs.distributions import Distribution, is_distribution, read_distribution
from bellcrank.studies.designs.samples import LARGEST_SEED
from bellcrank.studies.designs.sizing_changes import present_value
from bellcrank.studies.execution.design_runner import DesignRunner
from bellcrank.studies.execution.execution import Executor, LocalExecutor
from bellcrank.studies.execution.fastest_runner import FastestRunner
from bellcrank.studies.optimisation.formulas import Formulas
from bellcrank.studies.optimisation.problem import DesignProblem, Variable, written_value
from bellcrank.studies.optimisation.robustness import Robustness, read_rule
from bellcrank.studies.optimisation.size_search import MOST_RUN, all_combinations
from bellcrank.studies.results.exceedance import Limit, parse_limit
from bellcrank.studies.sweep_plan import Planner, SweepPlan, planner

SAMPLES, STARTS, POINTS = 256, 8, 9
FAR = 1e30  # a limit that no design comes near


@dataclass(frozen=True)
class Request:
    """What is asked for; what is None is as the scene's entry `optimise` says.

    Once it is completed, `objectives` are the measures with 1 where they are to be small, −1 where large.
    """

    variables: Mapping[str, Any] | None = None
    minimise: str | Sequence[str] | None = None
    maximise: str | Sequence[str] | None = None
    limits: Sequence[str] | None = None
    size: bool | None = None
    start: Mapping[str, Any] | None = None
    samples: int | None = None
    starts: int | None = None
    seed: int | None = None
    points: int | None = None
    tolerances: Mapping[str, Any] | None = None
    robust: str | None = None
    fastest: bool | None = None
    objectives: tuple[tuple[str, float], ...] = ()

    @property
    def several(self) -> str:
        """The objectives in words."""
        return ", ".join(name for name, _ in self.objectives)


def plan_search(
    scene: Scene, asked: Request, executor: Executor | None = None, progress: Callable[[int], object] | None = None
) -> tuple[DesignProblem, Request, Array | None]:
    """What is looked for, the request with all its numbers, and the start (variables,) that is asked for.

    Of several objectives the first is that of the problem; the others are among its limits, without effect as yet.
    Raises InputError.
    """
    asked = _completed(scene, asked)
    assert asked.variables is not None and asked.limits is not None
    tolerances = {path: one for path, one in (asked.tolerances or {}).items() if path not in asked.variables}
    where = f"optimise {scene.name}"
    plan_designs = planner(where, size=bool(asked.size), fastest=bool(asked.fastest), place=f"{where}:")
    plan = _planned(scene, {**asked.variables, **_around(scene, tolerances)}, plan_designs)
    runner = plan.runner
    units, axes = Formulas(runner.units), runner.axes  # type: ignore[attr-defined]
    for measure, sign in asked.objectives:
        try:
            assert units[measure]
        except InputError as error:
            raise InputError(f"optimise {scene.name}: {'minimise' if sign > 0.0 else 'maximise'}: {error}") from None
    limits = tuple(parse_limit(text, units, "limit", kept=True) for text in asked.limits)
    if isinstance(runner, FastestRunner):
        named = {name for name, _ in asked.objectives} | {limit.measure for limit in limits}
        runner = runner.only({leaf for name in named for leaf in units.leaves_of(name)})
    problem = DesignProblem(
        runner.scene,  # type: ignore[attr-defined]
        runner,
        tuple(_variable(scene, axis, asked.variables[axis.path]) for axis in axes[: len(asked.variables)]),
        *asked.objectives[0],
        (*limits, *(level(name, sign, sign * FAR, units) for name, sign in asked.objectives[1:])),
        executor or LocalExecutor(),
        progress or (lambda done: None),
        plan.notes,
        _robustness(scene, asked, runner, axes),
        units.known,
    )
    if problem.robustness is not None and (equal := [limit for limit in limits if limit.relation == "="]):
        raise InputError(
            f"optimise {scene.name}: the limit {equal[0]} cannot be kept at each deviation within the tolerances; "
            "write <= or >="
        )
    if problem.robustness is not None and len(asked.objectives) > 1:
        pairs = {*zip(problem.measures, problem.sides.tolist(), strict=True)}
        if twice := {name for name, side in pairs if (name, -side) in pairs}:
            raise InputError(
                f"pareto_front {scene.name}: with tolerances, '{min(twice)}' cannot be both an objective and limited "
                "from the other side"
            )
    if (whole := [one.axis.path for one in problem.variables if one.axis.whole and one.sizes]) and (
        all_combinations(problem) is None
    ):
        raise InputError(
            f"optimise {scene.name}: '{whole[0]}' takes whole numbers only, so that all combinations have to be run: "
            f"give sizes of all variables, with at most {MOST_RUN} combinations"
        )
    return problem, asked, None if asked.start is None else _start(problem, asked.start)


def _completed(scene: Scene, asked: Request) -> Request:
    """The request with what the scene's entry says. Raises InputError."""
    entry = scene.optimise
    where = f"optimise {scene.name}"
    variables = dict(entry.vary) if asked.variables is None else asked.variables
    variables = arguments.mapping("variables", variables, "a mapping of parameters to their bounds (lower, upper)")
    if not variables:
        raise InputError(f"{where}: nothing is varied; vary parameters within bounds, or write optimise: {{vary: …}}")
    objectives = _objectives(where, asked, entry)
    limits = entry.limits if asked.limits is None else asked.limits
    limits = arguments.several("limits", limits, str, "conditions such as 'lock.crank <= 120 deg'", alone=True)
    size, fastest = (
        getattr(entry, name) if getattr(asked, name) is None else arguments.flag(name, getattr(asked, name))
        for name in ("size", "fastest")
    )
    if asked.fastest and asked.size is None:
        size = False  # what is asked for replaces what the scene says
    if asked.size and asked.fastest is None:
        fastest = False
    counts: dict[str, Any] = {}
    for name, default, least, most in (
        ("samples", SAMPLES, 1, MOST_DESIGNS), ("starts", STARTS, 1, MOST_STARTS), ("seed", 0, 0, LARGEST_SEED),
        ("points", POINTS, 2, MOST_FRONT_POINTS),
    ):  # fmt: skip
        given, written = getattr(asked, name), getattr(entry, name)
        number = given if given is not None else default if written is None else written
        counts[name] = arguments.whole(name, number, least=least, most=most)
    given = {"variables": variables, "objectives": objectives, "limits": limits} | counts
    given |= {"size": bool(size), "fastest": bool(fastest)}
    return replace(asked, **given, **_tolerances(where, asked, entry))


def _tolerances(where: str, asked: Request, entry: OptimiseEntry) -> dict[str, Any]:
    """The tolerances as texts or distributions, and the rule. Raises InputError."""
    tolerances = dict(entry.tolerances) if asked.tolerances is None else asked.tolerances
    what = "a mapping of paths to distributions of their deviations, such as 'uniform(-1 mm, 1 mm)'"
    tolerances = arguments.mapping("tolerances", tolerances, what)
    robust = entry.robust
    if asked.robust is not None:
        robust = arguments.text("robust", asked.robust, "'worst' or 'mean + K sd'")
    if not tolerances:
        if robust is not None:
            raise InputError(f"{where}: robust {format_value(robust)} needs tolerances, of which there are none")
        return {"tolerances": {}, "robust": None}
    for path, one in tolerances.items():
        if not (isinstance(one, Distribution) or (isinstance(one, str) and is_distribution(one))):
            raise InputError(
                f"{where}: tolerances: '{path}': expected a distribution, such as 'uniform(-1 mm, 1 mm)', found "
                f"{arguments.found(one)}"
            )
    try:
        read_rule("worst" if robust is None else robust)
    except ValueError as error:
        raise InputError(f"{where}: robust: {error}") from None
    return {"tolerances": tolerances, "robust": "worst" if robust is None else robust}


def _around(scene: Scene, tolerances: Mapping[str, Any]) -> dict[str, list[Any]]:
    """The scene's own values of what has a tolerance and is not varied. Raises InputError."""
    found: dict[str, list[Any]] = {}
    for path in tolerances:
        name = path.removeprefix("parameters.").removesuffix(".value")
        known = scene.parameters.get(name)
        value = known.value if known is not None else written_value(scene.data, path)
        if value is None and is_of_the_tree(path):
            value = present_value(scene, path)
        if value is None:
            raise InputError(
                f"optimise {scene.name}: tolerances: '{path}' is neither varied nor a number of the scene; write its "
                "value in the scene"
            )
        found[path] = [value, value]
    return found


def _robustness(scene: Scene, asked: Request, runner: DesignRunner, axes: Sequence[StudyAxis]) -> Robustness | None:
    """How designs are judged. Raises InputError."""
    if not asked.tolerances:
        return None
    where, found = f"optimise {scene.name}: tolerances", dict[str, Distribution]()
    names = [axis.path for axis in axes]
    for path, one in asked.tolerances.items():
        axis = axes[names.index(path)]
        if not axis.numeric or axis.whole:
            raise InputError(f"{where}: '{path}' takes no deviations: it is no real number")
        try:
            if axis.suffix:  # in the unit in which the values are written
                read = read_distribution(one, None) if isinstance(one, str) else one
                factor = parse_number(f"1 {read.unit}", axis.suffix) if read.unit else math.nan
                if not math.isfinite(factor):
                    raise InputError(f"expected a unit behind the numbers, such as {axis.suffix}, found {one}")
                read = Distribution(read.family, tuple(factor * number for number in read.numbers), axis.suffix)
            else:
                read = read_distribution(one if isinstance(one, str) else str(one), axis.unit)
        except (InputError, ValueError) as error:
            raise InputError(f"{where}: '{path}': {error}") from None
        found[path] = read
    extra = range(len(asked.variables or {}), len(axes))
    others = [float(axes[k].numbers[0]) for k in extra]
    return Robustness(read_rule(asked.robust), found, tuple(names.index(path) for path in found), np.array(others))


def level(measure: str, sign: float, value: float, units: Mapping[str, str]) -> Limit:
    """The limit that keeps an objective at least as good as a value."""
    return Limit(measure, "<=" if sign > 0.0 else ">=", value, units[measure])


def _objectives(where: str, asked: Request, entry: OptimiseEntry) -> tuple[tuple[str, float], ...]:
    """The measures to be made small (1) and large (−1). Raises InputError."""
    given: dict[str, Sequence[str]] = {}
    for name, value in (("minimise", asked.minimise), ("maximise", asked.maximise)):
        if value is not None:
            what = "the name of a measure, such as 'lock.time'"
            given[name] = arguments.several(name, value, str, what, alone=True)
    if not given:
        given = {"minimise": entry.minimise, "maximise": entry.maximise}
    found = [
        (measure, sign) for name, sign in (("minimise", 1.0), ("maximise", -1.0)) for measure in given.get(name, ())
    ]
    names = [measure for measure, _ in found]
    if not found or set(given.get("minimise", ())) & set(given.get("maximise", ())):
        seen = "neither" if not found else "both"
        raise InputError(f"{where}: expected a measure to minimise or one to maximise, found {seen}")
    if len(set(names)) < len(names):
        raise InputError(f"{where}: expected each objective once, found {', '.join(names)}")
    return tuple(found)


def _planned(scene: Scene, given: Mapping[str, Any], plan_designs: Planner) -> SweepPlan:
    """What runs designs within bounds. Raises InputError."""
    if len(given) > MOST_DIMENSIONS:
        raise InputError(f"optimise {scene.name}: expected at most {MOST_DIMENSIONS} variables, found {len(given)}")
    pairs = {}
    for path, bounds in given.items():
        several = isinstance(bounds, (list, tuple, np.ndarray)) and not arguments.is_masked(bounds)
        if isinstance(bounds, Mapping):
            try:
                lists = {key: list(it) if isinstance(it, np.ndarray) and it.ndim else it for key, it in bounds.items()}
                pairs[path] = sizes_as_written(lists)
            except ValueError as error:
                raise InputError(f"optimise {scene.name}: '{path}': {error}") from None
        elif several and len(bounds) == 2:
            pairs[path] = list(bounds)
        else:
            raise InputError(
                f"optimise {scene.name}: '{path}': expected two bounds, or standard sizes such as "
                f"{{'sizes': [0.3, 0.31]}}, found {arguments.found(bounds)}"
            )
    return plan_designs(scene, pairs, None, None)


def _variable(scene: Scene, axis: StudyAxis, given: Any) -> Variable:
    """An axis with its bounds or sizes, as they are given, as a variable. Raises InputError."""
    where = f"optimise {scene.name}: '{axis.path}'"
    if not axis.numeric:
        what = "numbers" if isinstance(given, Mapping) else "two bounds"
        raise InputError(f"{where}: expected {what} in one unit, found {format_value(list(axis.choices))}")
    if isinstance(given, Mapping) and "sizes" in given:
        sizes = sorted(map(float, axis.numbers))
        if len(set(sizes)) < max(len(sizes), 2):
            raise InputError(
                f"{where}: expected two sizes or more that differ, found {arguments.found(given['sizes'])}"
            )
        return Variable(axis, sizes[0], sizes[-1], tuple(sizes))
    lower, upper = map(float, axis.numbers[:2])
    if not lower < upper:
        found = f"{lower:g} and {upper:g} {axis.unit}".rstrip()
        raise InputError(f"{where}: expected the lower bound below the upper, found {found}")
    return Variable(axis, lower, upper, _stepped(where, axis) if isinstance(given, Mapping) else ())


def _stepped(where: str, axis: StudyAxis) -> tuple[float, ...]:
    """The sizes from a lower to an upper bound in steps. Raises InputError."""
    lower, upper, step = map(float, axis.numbers)
    steps = (upper - lower) / step if step > 0.0 else math.nan
    if not 0.5 <= steps < MOST_VALUES or abs(steps - round(steps)) > 1e-6:
        raise InputError(
            f"{where}: expected a step of which a whole number, less than {MOST_VALUES}, is {upper - lower:g} "
            f"{axis.unit}, found {step:g} {axis.unit}"
        )
    return (*(float(f"{lower + k * step:.12g}") for k in range(round(steps))), upper)


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
        own = read_axis(problem.scene, path, [given[path]], unit, "start:")
        if not own.numeric or (axis.suffix and own.suffix not in ("", axis.suffix)):
            raise InputError(f"start: '{path}': expected a number in {axis.unit}, found {format_value(given[path])}")
        number = float(own.numbers[0])
        if not variable.lower <= number <= variable.upper:
            raise InputError(
                f"start: '{path}' is {number:g} {axis.unit}, outside its bounds {variable.lower:g} to "
                f"{variable.upper:g} {axis.unit}"
            )
        if variable.sizes and number not in variable.sizes:
            raise InputError(f"start: '{path}' is {number:g} {axis.unit}, which is none of its sizes")
        numbers.append(number)
    return problem.point(numbers)
