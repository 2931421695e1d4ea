"""The result of `optimise` as a text, as a table of all designs, and as a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Mask
from bellcrank.present.tables import aligned
from bellcrank.studies.optimisation.local_search import KEPT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bellcrank.studies.optimisation.optimum import Optimum

BETWEEN = "between sizes: run to bound what combinations of sizes can reach"
MOST_SHOWN = 5  # variables in a picture


def rows_of(result: Optimum) -> list[tuple[str, str, float, float, str]]:
    """Name, unit, before, best and remark of the variables, the objective and the limits."""
    problem, rows, point = result.problem, [], result.problem.present_point()
    before = [math.nan] * len(problem.variables) if point is None else problem.numbers(point[None])[0].tolist()
    for variable, own, (name, value) in zip(problem.variables, before, result.values.items(), strict=True):
        at = result.at_bounds.get(name, "")
        sizes = f"{len(variable.sizes)} sizes, " if variable.sizes else ""
        remark = f"{sizes}{variable.lower:g} to {variable.upper:g}{f', at the {at} bound' if at else ''}"
        rows.append((name, variable.axis.unit, own, value, remark))
    rows.append(_row(result, 0, "minimised" if problem.sign > 0.0 else "maximised"))
    excess = problem.excess(result.found[None])[0]
    for k, limit in enumerate(problem.limits):
        state = ", broken" if excess[k] > KEPT else ", active" if str(limit) in result.active_limits else ""
        rows.append(_row(result, 1 + k, f"{limit}{state}"))
    return rows


def _row(result: Optimum, k: int, remark: str) -> tuple[str, str, float, float, str]:
    return (
        result.problem.label(k),
        result.problem.unit_of(k),
        float(result.before[k]),
        float(result.found[k]),
        remark,
    )


def text_table(result: Optimum) -> str:
    """Variables, objective and limits before and after, multipliers, and the optima that were found."""
    problem = result.problem
    cells = [("", "before", "best" if result.keeps_limits else "nearest", "")]
    for name, unit, before, best, remark in rows_of(result):
        shown = "" if math.isnan(before) else f"{before:.6g}"
        cells.append((f"{name} [{unit}]" if unit else name, shown, f"{best:.8g}", remark))
    lines = aligned(cells, (0, 3))
    for name, value in result.multipliers.items():
        change = f"{value:.4g} {result.problem.unit_of(0)}".rstrip()
        lines.append(f"per SI unit of '{name}', {problem.label(0)} changes by {change}")
    count = f"{problem.count} designs were run"
    count += f", {result.samples} of them Sobol points (seed {result.seed})" if result.samples else ""
    residual = f"residual {result.residual:.1e}; " if len(problem.sizes) < len(problem.variables) else ""
    lines.append(f"{result.status}: {residual}{count}")
    if (sizes := result.combinations) is not None:
        gap = f"{sizes.gap:.3g} {problem.unit_of(0)}".rstrip() if math.isfinite(sizes.gap) else "not known"
        how = "" if sizes.proved else ", as far as local searches show"
        lines.append(f"{sizes.tried} of {sizes.count} combinations of sizes were tried; gap to the best: {gap}{how}")
    for basin in result.basins:
        found = f"found by {basin.found} of {result.searches} local searches"
        lines.append(f"  {result.problem.measure_of(0, basin.objective)}: {found}")
    differences = ", ".join(dict.fromkeys(name for name, how in result.gradients.items() if how != "exact"))
    lines.append(f"gradients: {f'differences of {differences}' if differences else 'exact'}")
    return "\n".join(lines)


def designs_table(result: Optimum) -> list[Sequence[object]]:
    """A header with units, and a row for each design: variables, measures, and why it is infeasible."""
    problem = result.problem
    head: list[object] = [one.axis.label for one in problem.variables]
    head += [f"{problem.label(k)} [{problem.unit_of(k) or '1'}]" for k in range(len(problem.measures))]
    rows: list[Sequence[object]] = [[*head, "reason"]]
    numbers, values = problem.numbers(np.concatenate(problem.points)), np.concatenate(problem.values)
    between = ~_at_sizes(result)
    for k, (own, found) in enumerate(zip(numbers.tolist(), values.tolist(), strict=True)):
        cells = ["" if math.isnan(value) else value for value in found]
        rows.append([*own, *cells, problem.reasons.get(k, BETWEEN if between[k] else "")])
    return rows


def _at_sizes(result: Optimum) -> Mask:
    """Which of the designs that were run have sizes where there are some."""
    points = np.concatenate(result.problem.points)
    return np.asarray((result.problem.at_sizes(points) == points).all(axis=1))


def designs_figure(result: Optimum) -> Figure:
    """The best objective over the designs that were run, and the objective of all designs over each variable."""
    from bellcrank.present.plot_style import colour, literal, new_figure, plain

    problem = result.problem
    shown = problem.variables[:MOST_SHOWN]
    figure = new_figure(3.2 * (1 + len(shown)), 3.4)
    axes = np.atleast_1d(figure.subplots(1, 1 + len(shown)))
    values, points = np.concatenate(problem.values), np.concatenate(problem.points)
    numbers, kept = problem.numbers(points), (problem.violation(values) <= KEPT) & _at_sizes(result)
    other = "breaks a limit, or between sizes" if problem.sizes else "breaks a limit"
    label = f"{problem.label(0)} [{result.problem.unit_of(0) or '1'}]"
    axes[0].step(*zip(*result.history, strict=True), where="post", color=colour(0))
    axes[0].set(xlabel="designs", ylabel=literal(label), title="best so far" if kept.any() else "nearest so far")
    for k, (axis, variable) in enumerate(zip(axes[1:], shown, strict=True)):
        axis.plot(numbers[~kept, k], values[~kept, 0], ".", color="0.75", markersize=3, label=other)
        axis.plot(numbers[kept, k], values[kept, 0], ".", color=colour(0), markersize=3, label="keeps the limits")
        name = "best" if result.keeps_limits else "nearest"
        axis.plot(result.values[variable.axis.path], result.objective, "D", color=colour(1), label=name)
        axis.set(xlabel=literal(variable.axis.label), ylabel=literal(label))
    axes[-1].legend(fontsize="small")
    for axis in axes:
        plain(axis)
    return figure
