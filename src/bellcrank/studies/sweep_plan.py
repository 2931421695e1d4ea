"""What a sweep runs: a scene, its designs, and what is done with each, checked before the first one is run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from bellcrank import arguments
from bellcrank.elements.parameters import is_of_the_tree
from bellcrank.errors import InputError
from bellcrank.notes import Note, ranked
from bellcrank.scene.scene import Scene
from bellcrank.scene.study import METHODS, MOST_POINTS, Study
from bellcrank.simulation.trajectory.scene_notes import file_notes
from bellcrank.studies.designs.axes import StudyAxis, parse_values, read_axis
from bellcrank.studies.designs.design_space import DesignSpace
from bellcrank.studies.designs.samples import LARGEST_SEED, PointSet, Sample, SensitivitySample
from bellcrank.studies.designs.sizing_changes import override, present_value, unit_of
from bellcrank.studies.execution.design_runner import DesignRunner
from bellcrank.studies.execution.fastest_runner import FastestRunner
from bellcrank.studies.execution.simulation_runner import SimulationRunner
from bellcrank.studies.execution.sizing_runner import SizingRunner

MOST_TRIED = 64  # values of an axis that are tried before a sweep: all of them, or as many with equal spacing
Checking = Callable[[float, float | None], object]
Planner = Callable[[Scene, Mapping[str, Any] | None, "SampleRequest | None", Checking | None], "SweepPlan"]
SWEEP = "sweep over"  # with which messages about a path begin


@dataclass(frozen=True, eq=False)
class SweepPlan:
    """What a sweep runs."""

    scene: Scene
    space: DesignSpace
    runner: DesignRunner
    notes: tuple[Note, ...] = ()


@dataclass(frozen=True)
class SampleRequest:
    """How designs are drawn; what is None is as the scene's study says.

    With `sobol`, the number of Sobol points of each scrambling, they are those of Sobol indices.
    """

    count: int | None = None
    method: str | None = None
    seed: int | None = None
    sobol: int | None = None


def planner(where: str, *, size: bool, fastest: bool, place: str = SWEEP) -> Planner:
    """What plans designs that are sized, timed along their fastest motions, or else simulated. Raises InputError.

    Messages begin with `where`, those about a path with `place`.
    """
    if size and fastest:
        raise InputError(f"{where}: expected designs to be sized or timed (fastest), found both; leave one out")
    plan = plan_sizings if size else plan_fastest if fastest else plan_sweep
    return partial(plan, place=place)


def plan_sweep(
    scene: Scene,
    vary: Mapping[str, Any] | None,
    sample: SampleRequest | None,
    checking: Checking | None = None,
    place: str = SWEEP,
) -> SweepPlan:
    """The simulations of a sweep; what is None is taken from the scene's study.

    Without `sample`, `vary` has bounds, and the plan has no designs.

    Raises InputError for a path that does not exist, accepts none of its values or changes the equations.
    """
    axes = _axes(scene, vary, lambda path: None, place)
    of_tree = {
        axis.path: present_value(scene, axis.path) for axis in axes if axis.numeric and is_of_the_tree(axis.path)
    }
    if of_tree:
        scene = scene.with_overrides(of_tree)  # declares parameters, which are inputs of the equations
    _refuse_repeated(scene, axes, place)
    space = _space(scene, axes, sample)
    for axis in axes:
        _check(scene, axis, checking, place)
    return SweepPlan(scene, space, SimulationRunner(scene, axes), ranked(file_notes(scene)))


def plan_sizings(
    scene: Scene,
    vary: Mapping[str, Any] | None,
    sample: SampleRequest | None,
    checking: Checking | None = None,
    place: str = SWEEP,
) -> SweepPlan:
    """The sizings of a sweep; what is None is taken from the scene's study.

    Without `sample`, `vary` has bounds, and the plan has no designs.

    Raises InputError for a path that does not exist or accepts none of its values.
    """
    axes = axes_of_sizings(scene, vary, place)
    space = _space(scene, axes, sample)
    runner = SizingRunner(scene, axes)
    for axis, change in zip(axes, runner.changes, strict=True):
        if change.kind == "override":
            _check(scene, axis, checking, place, equations=False)
    return SweepPlan(scene, space, runner, runner.notes)


def plan_fastest(
    scene: Scene,
    vary: Mapping[str, Any] | None,
    sample: SampleRequest | None,
    checking: Checking | None = None,
    place: str = SWEEP,
) -> SweepPlan:
    """The fastest motions of a sweep; as `plan_sizings`."""
    axes = axes_of_sizings(scene, vary, place)
    space, runner = _space(scene, axes, sample), FastestRunner(scene, axes)
    for axis in axes:
        _check(runner.scene, axis, checking, place, equations=False)
    return SweepPlan(scene, space, runner, runner.notes)


def axes_of_sizings(scene: Scene, vary: Mapping[str, Any] | None, place: str = SWEEP) -> tuple[StudyAxis, ...]:
    """What sizings vary; None: as the scene's study says. Raises InputError."""
    axes = _axes(scene, vary, lambda path: unit_of(scene, path), place)
    _refuse_repeated(scene, axes, place)
    return axes


def _axes(
    scene: Scene, vary: Mapping[str, Any] | None, unit: Callable[[str], str | None], place: str
) -> tuple[StudyAxis, ...]:
    """What is varied; `unit` gives the unit of a path that is no parameter, where it is known. Raises InputError."""
    study = scene.study
    if vary is None:
        if not study.vary:
            raise InputError(
                f"sweep of {scene.name}: nothing is varied; give parameters with their values, or write them in the "
                "scene under study: {vary: …}"
            )
        return tuple(_written_axis(scene, study, path, unit(path)) for path in study.vary)
    given = arguments.mapping("vary", vary, "a mapping of parameters to their values")
    if not given:
        raise InputError(f"sweep of {scene.name}: expected at least one parameter to vary, found none")
    return tuple(read_axis(scene, path, values, unit(path), place) for path, values in given.items())


def _refuse_repeated(scene: Scene, axes: Sequence[StudyAxis], place: str) -> None:
    """Raise InputError where an axis replaces what an earlier one sets, whose values would then be without effect."""
    earlier: dict[str, str] = {}
    for axis in axes:
        target = _target(scene, axis.path)
        for known, path in earlier.items():
            if f"{known}.".startswith(f"{target}."):
                raise InputError(f"{place} '{path}' and '{axis.path}': both set '{target}'; keep one of them")
        earlier[target] = axis.path


def _target(scene: Scene, path: str) -> str:
    """A path in one spelling: a parameter by its name, and a joint of the start without "guess"."""
    path = path.strip()
    name = path.removeprefix("parameters.").removesuffix(".value")
    if name in scene.parameters:
        return name
    return path.removesuffix(".guess") if path.startswith("initial.") else path


def _written_axis(scene: Scene, study: Study, path: str, unit: str | None) -> StudyAxis:
    """The axis that the scene's study describes. Raises InputError, which names file, line and key."""
    values = study.vary[path]
    try:
        return read_axis(scene, path, parse_values(values, "") if isinstance(values, str) else values, unit)
    except InputError as error:
        assert study.place is not None
        raise study.place.error(path, error.reason) from None


def _space(scene: Scene, axes: tuple[StudyAxis, ...], sample: SampleRequest | None) -> DesignSpace:
    return DesignSpace(()) if sample is None else DesignSpace(axes, _sample(scene, axes, sample))


def _sample(scene: Scene, axes: tuple[StudyAxis, ...], asked: SampleRequest) -> PointSet | None:
    """The sample that is asked for; that of the scene is for distributions, wherever these are written."""
    if asked.sobol is not None:
        return _sensitivity_sample(scene, axes, asked)
    study, sample, method, seed = scene.study, asked.count, asked.method, asked.seed
    if sample is not None:
        sample = arguments.whole("sample", sample, least=1, most=MOST_POINTS)
    if method is not None:
        method = arguments.one_of("method", method, METHODS)
    if seed is not None:
        seed = arguments.whole("seed", seed, least=0, most=LARGEST_SEED)
    if sample is None and any(axis.distribution is not None for axis in axes):
        sample = study.sample
    if sample is None:
        for name, value in (("method", method), ("seed", seed)):
            if value is not None:
                raise InputError(f"{name}: belongs to a sample; say how many designs are drawn, such as sample 1024")
        return None
    method = method or study.method or METHODS[0]
    return Sample.of(sample, method, study.seed or 0 if seed is None else seed)


def _sensitivity_sample(scene: Scene, axes: tuple[StudyAxis, ...], asked: SampleRequest) -> SensitivitySample:
    size = arguments.whole("sobol", asked.sobol, least=2)
    for name, value in (("sample", asked.count), ("method", asked.method)):
        if value is not None:
            raise InputError(f"{name}: cannot be combined with sobol")
    for axis in axes:
        if axis.distribution is None:
            raise InputError(
                f"Sobol indices of {scene.name}: parameter '{axis.path}' has values and no distribution; write one "
                "such as normal(1.24 m, 1 mm)"
            )
    given = scene.study.seed or 0 if asked.seed is None else asked.seed
    seed = arguments.whole("seed", given, least=0, most=LARGEST_SEED)
    return SensitivitySample(len(axes), size, seed=seed)


def _check(scene: Scene, axis: StudyAxis, checking: Checking | None, place: str, equations: bool = True) -> None:
    """Refuse a path that accepts none of its values or, with `equations`, changes the equations (InputError).

    A parameter is an input of the equations, whatever its value, so that one value that the scene takes is enough.
    """
    parameter = axis.path.removeprefix("parameters.") in scene.parameters
    tried = _tried(axis)
    refused: list[InputError] = []
    for k, number in enumerate(tried):
        if checking is not None:
            checking(k, len(tried))
        try:
            path, value = override(scene, axis.path, axis.value(number))
            design = scene.with_overrides({path: value})
        except InputError as error:
            refused.append(error)
            continue
        if not equations:
            return
        if design.structure_key != scene.structure_key:
            raise InputError(
                f"{place} '{axis.path}': it changes the equations, which would be compiled for every value; make it "
                f"a parameter of the scene (parameters: {{NAME: {{value: …, sets: […]}}}}) and vary that"
            )
        if parameter:
            return
    if len(refused) == len(tried):
        some = (
            "" if len(tried) == len(axis) else f" ({len(tried)} values of this axis were tried, and none is accepted)"
        )
        raise InputError(f"{refused[0]}{some}")


def _tried(axis: StudyAxis) -> list[float]:
    """The values that are tried: all, or some with equal spacing; of a distribution at equal steps of probability."""
    numbers = axis.numbers
    if axis.distribution is not None:
        numbers = axis.distribution.quantiles((np.arange(MOST_TRIED) + 0.5) / MOST_TRIED)
    elif len(axis) > MOST_TRIED and not axis.choices:
        numbers = numbers[np.linspace(0, len(axis) - 1, MOST_TRIED).round().astype(int)]
    tried: list[float] = numbers.tolist()
    return tried
