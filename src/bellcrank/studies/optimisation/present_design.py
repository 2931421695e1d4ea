"""The design that a scene itself is, among those of a search."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bellcrank.config.fields import parse_number
from bellcrank.studies.optimisation.problem import DesignProblem
from bellcrank.studies.sizing_runner import SizingRunner


def present_point(problem: DesignProblem) -> NDArray[np.float64] | None:
    """The point of the scene's own values, which may be outside the bounds; None where not all are parameters."""
    runner, numbers = problem.runner, []
    parameters = runner.scene.parameters  # type: ignore[attr-defined]
    for k, variable in enumerate(problem.variables):
        axis = variable.axis
        name = runner.changes[k].path if isinstance(runner, SizingRunner) else axis.path
        name = name.removeprefix("parameters.").removesuffix(".value")
        own = parameters.get(name) or next((it for it in parameters.values() if it.sets == (axis.path,)), None)
        if own is None:
            return None
        numbers.append(own.value / parse_number(axis.value(1.0), own.unit))
    return problem.point(numbers)
