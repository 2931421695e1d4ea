"""`select_designs`: sizes and ranges of a robot's parameters together with the motors and gears of a catalogue."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from bellcrank import arguments
from bellcrank.actuators.actuator_fields import OF_AN_AXIS
from bellcrank.actuators.catalogue.catalogue import Catalogue
from bellcrank.actuators.conditions import Conditions
from bellcrank.arguments import Progress
from bellcrank.arrays import Array
from bellcrank.elements.parameters import is_of_the_tree
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.access import Trust
from bellcrank.robot.model.payload import Payload
from bellcrank.robot.robot import Robot
from bellcrank.scene.load import given_scene
from bellcrank.scene.scene import Scene
from bellcrank.sizing.selection.judged_axes import Objective
from bellcrank.sizing.sizing_subject import OneMotion, changed_scene
from bellcrank.studies.designs.axes import StudyAxis
from bellcrank.studies.designs.design_space import DesignSpace
from bellcrank.studies.designs.distributions import Distribution
from bellcrank.studies.designs.samples import Sample
from bellcrank.studies.designs.sizing_changes import present_duration, present_value
from bellcrank.studies.selection.design_selection import DesignSelection
from bellcrank.studies.selection.designs_with_motors import DesignsWithMotors
from bellcrank.studies.selection.range_search import RangeSearch
from bellcrank.studies.sweep_plan import axes_of_sizings

SAMPLES = 32
MOST_RANGES_WITH_CORNERS = 3  # loads often are least at one
MOST_DESIGNS = 100_000
_CONDITION = re.compile(r"\A(conditions|actuators\.[^.]+)\.(.+)\Z")


@arguments.named
def select_designs(
    scene: Scene | Robot | str | Path,
    vary: Mapping[str, Any],
    motions: OneMotion | Sequence[OneMotion] | None = None,
    catalogue: Catalogue | str | Path | Sequence[str | Path] | None = None,
    objective: Objective = "mass",
    *,
    conditions: Conditions | Mapping[str, Any] | None = None,
    keep: Mapping[str, str] | None = None,
    exclude: Iterable[str] = (),
    makers: Iterable[str] = (),
    feedback: bool = True,
    candidates: int = 12,
    effort: int | None = None,
    samples: int | None = None,
    payloads: Iterable[Payload] = (),
    allow_massless: Iterable[str] = (),
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
    progress: Progress | None = None,
) -> DesignSelection:
    """Choose sizes of parameters, from lists or ranges, together with the motor and gear of every axis.

    The motors of each design are chosen by `select`, whose branch and bound tries or excludes every combination of
    motors and gears. The designs are ranked as `select` ranks combinations of motors: first those inside all limits,
    then by how many criteria are shown, then by the objective, then by the largest utilisation. Where lists alone are
    varied and every search was complete, no design of the sizes and the catalogue is ranked better than the result.

    In ranges, Sobol points and the corners of up to three ranges are run first. From the best, values are changed so
    that the chosen motors are used least (for "loss": lose least), and motors are chosen again. For "mass" and "cost"
    lighter combinations of motors are then tried in their order, each with a local search for values with which it
    passes: the first that passes is the result.

    Args:
        scene: A robot configuration or scene, or the path or name of its file.
        vary: Values by parameter or dotted path, as for `sweep(size=True)`: link lengths, masses, payloads, parameters
            of the scene, conditions such as "conditions.voltage". A mapping {"lower": 0.9, "upper": 1.1} is a range.
        motions: As for `select`.
        catalogue: As for `select`.
        objective: As for `select`: "mass", "cost", "loss" or "margin".
        conditions: As for `select`.
        keep: As for `select`.
        exclude: As for `select`.
        makers: As for `select`.
        feedback: As for `select`.
        candidates: As for `select`.
        effort: As for `select`, for each design.
        samples: The number of points over the ranges, for each combination of sizes, by default 32; a power of two is
            best.
        payloads: As for `select`.
        allow_massless: As for `select`.
        overrides: Changes of the scene beforehand, by dotted path.
        trust: Where `scene` is a file, folders whose files it may name, besides those near it.
        progress: Called with the number of designs done, and of all.

    Returns:
        The best design with its `Selection`, and a row for each design. Ctrl-C keeps the best so far.

    Raises:
        InputError: As `select` and `sweep`.
        BellcrankError: Motors can be chosen for none of the designs.

    Example:
        >>> import bellcrank as bc
        >>> result = bc.select_designs("geared_pendulum", {"link.pendulum.mass": [2, 3]}, makers="ROBOTIS")
        >>> result.values, result.gap
        ({'link.pendulum.mass': 2.0}, 0.0)
    """
    scene = given_scene(scene, None, trust)
    if overrides is not None:
        scene = changed_scene(scene, overrides)
    if progress is not None:
        arguments.function("progress", progress)
    if samples is not None:
        samples = arguments.whole("samples", samples, least=1, most=MOST_DESIGNS)
    space = DesignSpace(*_axes(scene, vary, samples))
    if len(space) > MOST_DESIGNS:
        raise InputError(f"select_designs {scene.name}: expected at most {MOST_DESIGNS} designs, found {len(space)}")
    _refuse_without_effect(space.axes, Conditions().updated(conditions))
    settings = {
        "objective": objective, "conditions": conditions, "keep": keep, "feedback": feedback,
        "makers": arguments.several("makers", makers, str, "makers", alone=True),  # which may be iterators
        "exclude": arguments.several("exclude", exclude, str, "ids", alone=True),
        "payloads": arguments.several("payloads", payloads, Payload, "Payloads", alone=True),
        "allow_massless": arguments.several("allow_massless", allow_massless, str, "names of links", alone=True),
    }  # fmt: skip
    candidates = arguments.whole("candidates", candidates, least=1, most=arguments.MOST_ITEMS)
    if effort is not None:
        effort = arguments.whole("effort", effort, least=0)

    def count(done: int) -> None:
        if progress is not None:
            progress(done, max(done, len(space)))

    designs = DesignsWithMotors(scene, space.axes, motions, catalogue, settings, (candidates, effort), count)
    ranges, complete = None, True
    try:
        if space.sample is None:
            for values in space.values().tolist():
                designs.run(values)
        else:
            ends = [(0.0, 0.0) if one.distribution is None else one.distribution.numbers for one in space.axes]
            lower, upper = np.array(ends).T
            ranges = RangeSearch(designs, lower, upper, objective)
            ranges.run(_points(scene, space))
    except KeyboardInterrupt:
        complete = False
        if designs.best is None:
            raise
    if designs.best is None:
        raise BellcrankError(f"motors can be chosen for none of {len(designs.rows)} designs: {designs.rows[0].reason}")
    number, selection, design = designs.best
    inside = None if ranges is None else ranges.inside
    rows = tuple(designs.rows)
    planned = len(space) if inside is None else len(rows)
    return DesignSelection(design, space.axes, rows, number, selection, planned, complete, inside)


def _axes(scene: Scene, vary: Mapping[str, Any], samples: int | None) -> tuple[tuple[StudyAxis, ...], Sample | None]:
    """What is varied, ranges as uniform distributions, and the sample of these. Raises InputError."""
    given = arguments.mapping("vary", vary, "a mapping of parameters to their values")
    ranges = {path: one for path, one in given.items() if isinstance(one, Mapping)}
    for path, one in ranges.items():
        if set(one) != {"lower", "upper"}:
            raise InputError(
                f"select_designs {scene.name}: '{path}': expected values, or a range such as {{'lower': 0.9, "
                f"'upper': 1.1}}, found {arguments.found(one)}"
            )
    ends = {path: [one["lower"], one["upper"]] for path, one in ranges.items()}
    axes = list(axes_of_sizings(scene, {**given, **ends}))
    for k, axis in enumerate(axes):
        if axis.path not in ranges and axis.distribution is not None:
            raise InputError(f"select_designs {scene.name}: '{axis.path}' has a distribution; give values or a range")
        if axis.path in ranges:
            if not axis.numeric or not axis.numbers[0] < axis.numbers[1]:
                found = " and ".join(str(axis.shown(number)) for number in axis.numbers.tolist())
                raise InputError(
                    f"select_designs {scene.name}: '{axis.path}': expected numbers in one unit, the lower below the "
                    f"upper, found {found}"
                )
            spread = Distribution("uniform", tuple(axis.numbers.tolist()), axis.unit)
            axes[k] = replace(axis, numbers=np.zeros(0), distribution=spread, whole=False)
    if samples is not None and not ranges:
        raise InputError(f"select_designs {scene.name}: argument 'samples': no range is varied, so nothing is sampled")
    return tuple(axes), Sample(samples or SAMPLES) if ranges else None


def _points(scene: Scene, space: DesignSpace) -> Array:
    """The designs to run first: the scene's own where its values are within the ranges, the sample, and the corners of
    up to `MOST_RANGES_WITH_CORNERS` ranges.
    """
    ends = [axis.numbers if axis.distribution is None else np.array(axis.distribution.numbers) for axis in space.axes]
    found, present = [space.values()], []
    for axis in space.axes:
        known = scene.parameters.get(axis.path.removeprefix("parameters.").removesuffix(".value"))
        if known is None and is_of_the_tree(axis.path):
            value: float | None = present_value(scene, axis.path)
        else:
            value = present_duration(scene, axis.path) if known is None else known.value
        present.append(math.nan if value is None else value)
    inside = [
        value in numbers if axis.distribution is None else numbers[0] <= value <= numbers[1]
        for axis, numbers, value in zip(space.axes, ends, present, strict=True)
    ]
    if all(inside):
        found.insert(0, np.array([present]))
    if sum(axis.distribution is not None for axis in space.axes) <= MOST_RANGES_WITH_CORNERS:
        found.append(np.array(list(product(*(numbers.tolist() for numbers in ends)))))
    return np.concatenate(found)


def _refuse_without_effect(axes: Sequence[StudyAxis], given: Conditions) -> None:
    """Raise InputError for what the selection would replace: figures of actuators, and conditions that are given."""
    for path in (axis.path for axis in axes):
        match = _CONDITION.match(path)
        if match is None:
            continue
        name = match[2]
        if match[1] != "conditions" and name.partition(".")[0] not in OF_AN_AXIS:
            raise InputError(f"'{path}': the actuators are chosen here, and their figures cannot be varied")
        if name in given.sources:
            raise InputError(f"'{path}': '{name}' is among the conditions that are given, which replace it")
