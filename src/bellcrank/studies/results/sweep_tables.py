"""The table of a sweep on the screen: designs line by line, the first and the last of many, and a summary."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.studies.execution.run_outcomes import UNKNOWN

if TYPE_CHECKING:
    from bellcrank.studies.results.sweep_result import Sweep

MOST_LINES = 20  # designs: the first and the last
SUMMARISED = 10  # designs, above which there is a summary
LONGEST_REASON = 110
MOST_AXES = 2  # whose values say where a measure is least and largest


def text_table(sweep: Sweep, measures: Sequence[str]) -> str:
    """One line a design: axes, measures with units, status, reason; of many only the first and the last, with a
    summary.
    """
    for name in measures:
        sweep.column(name)  # refuses an unknown one
    head = [axis.label for axis in sweep.axes] + _labels(sweep, measures)
    lines = _aligned([[*head, "status", "reason"], *(_line(sweep, measures, row) for row in _rows(sweep))], texts=2)
    hidden = len(sweep) - MOST_LINES
    if hidden > 0:
        lines.insert(2 + MOST_LINES // 2, f"… {hidden} more …")
    if len(sweep) > SUMMARISED:
        lines += ["", *_summary(sweep, measures)]
    return "\n".join(lines)


def _rows(sweep: Sweep) -> list[int]:
    """The rows that are shown."""
    if len(sweep) <= MOST_LINES:
        return list(range(len(sweep)))
    half = MOST_LINES // 2
    return [*range(half), *range(len(sweep) - half, len(sweep))]


def _line(sweep: Sweep, measures: Sequence[str], row: int) -> list[str]:
    status = sweep.columns.statuses[sweep.columns.status[row]]
    figures = [_figure(float(sweep.column(name)[row]), status) for name in measures]
    reason = textwrap.shorten(sweep.reasons.get(row, ""), LONGEST_REASON, placeholder="…")
    return [*_place(sweep, row), *figures, status, reason]


def _place(sweep: Sweep, row: int) -> list[str]:
    """The values of a design along the axes."""
    shown = (axis.shown(number) for axis, number in zip(sweep.axes, sweep.values[row].tolist(), strict=True))
    return [f"{value:.9g}" if isinstance(value, float) else str(value) for value in shown]


def _labels(sweep: Sweep, measures: Iterable[str]) -> list[str]:
    return [f"{name} [{sweep.units[name]}]" for name in measures]


def _figure(value: float, status: str) -> str:
    if math.isfinite(value):
        return f"{value:.9g}"
    return "unknown" if status == UNKNOWN and math.isinf(value) else "-"


def _aligned(lines: list[list[str]], texts: int) -> list[str]:
    """Lines of cells in columns, the last `texts` of them to the left, with a rule below the first line."""
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    right = len(widths) - texts
    made = []
    for line in lines:
        cells = [
            f"{cell:>{w}}" if k < right else f"{cell:<{w}}"
            for k, (cell, w) in enumerate(zip(line, widths, strict=True))
        ]
        made.append("  ".join(cells).rstrip())
    rule = "-" * (sum(widths[:-1]) + 2 * len(widths) - 4)
    return [made[0], rule, *made[1:]]


def _summary(sweep: Sweep, measures: Sequence[str]) -> list[str]:
    """How many designs have which status with an example of a reason, and the distribution of each measure."""
    statuses = sweep.columns.statuses
    counts = np.bincount(sweep.columns.status, minlength=len(statuses)).tolist()
    parts = [f"{count} {name}" for name, count in zip(statuses, counts, strict=True) if count]
    lines = [f"{len(sweep)} designs: {', '.join(parts)}"]
    examples: dict[str, int] = {}
    for row in sweep.reasons:
        examples.setdefault(statuses[sweep.columns.status[row]], row)
    for name, row in examples.items():
        reason = textwrap.shorten(sweep.reasons[row], LONGEST_REASON, placeholder="…")
        lines.append(f"  {name}, such as design {sweep.index[row]}: {reason}")
    table = [["measure", "designs", "least", "median", "mean", "largest", "least at", "largest at"]]
    for name, label in zip(measures, _labels(sweep, measures), strict=True):
        table.append([label, *_distribution(sweep, sweep.column(name))])
    widths = [max(len(line[k]) for line in table) for k in range(8)]
    for line in table:
        cells = [f"{line[0]:<{widths[0]}}"]
        cells += [f"{cell:>{width}}" for cell, width in zip(line[1:6], widths[1:6], strict=True)]
        cells += [f"{cell:<{width}}" for cell, width in zip(line[6:], widths[6:], strict=True)]
        lines.append("  ".join(cells).rstrip())
    return lines


def _distribution(sweep: Sweep, values: Array) -> list[str]:
    there = np.flatnonzero(np.isfinite(values))
    if not len(there):
        return ["0", *["-"] * 6]
    known = values[there]
    low, high = int(there[np.argmin(known)]), int(there[np.argmax(known)])
    least, largest = float(values[low]), float(values[high])
    mean = float(np.clip(np.mean(known / (scale := max(abs(least), abs(largest), 1e-300))) * scale, least, largest))
    figures = (least, float(np.median(known)), mean, largest)
    return [str(len(known)), *(f"{figure:.6g}" for figure in figures), _where(sweep, low), _where(sweep, high)]


def _where(sweep: Sweep, row: int) -> str:
    if len(sweep.axes) > MOST_AXES:
        return f"design {sweep.index[row]}"
    shown = (axis.shown(number) for axis, number in zip(sweep.axes, sweep.values[row].tolist(), strict=True))
    values = [f"{value:.6g}" if isinstance(value, float) else str(value) for value in shown]
    return ", ".join(f"{axis.path} {value}" for axis, value in zip(sweep.axes, values, strict=True))
