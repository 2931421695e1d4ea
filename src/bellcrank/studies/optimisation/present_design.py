"""The design that a scene itself is, among those of a search."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.config.fields import parse_number
from bellcrank.config.numbers import split_number
from bellcrank.studies.optimisation.problem import DesignProblem
from bellcrank.studies.sizing_runner import SizingRunner


def present_point(problem: DesignProblem) -> NDArray[np.float64] | None:
    """The point of the scene's own values, which may be outside the bounds; None where not all are known."""
    runner, numbers = problem.runner, []
    parameters = runner.scene.parameters  # type: ignore[attr-defined]
    for k, variable in enumerate(problem.variables):
        axis = variable.axis
        name = runner.changes[k].path if isinstance(runner, SizingRunner) else axis.path
        name = name.removeprefix("parameters.").removesuffix(".value")
        own = parameters.get(name) or next((it for it in parameters.values() if it.sets == (axis.path,)), None)
        if own is not None:
            numbers.append(own.value / parse_number(axis.value(1.0), own.unit))
            continue
        written = _written(runner.scene.data, axis.path)  # type: ignore[attr-defined]
        split = split_number(written) if isinstance(written, str) else None
        if split is None and isinstance(written, (int, float)) and not isinstance(written, bool):
            split = float(written), ""
        if split is None or split[1] != axis.suffix:
            return None
        numbers.append(split[0])
    return problem.point(numbers)


def _written(data: Any, path: str) -> Any:
    """What a scene's mapping says under a dotted path; None where it says nothing there."""
    for key in path.split("."):
        data = data.get(key) if isinstance(data, dict) else None
    return data
