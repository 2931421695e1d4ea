"""A sweep as text, CSV and JSON, units always said."""

from __future__ import annotations

import csv
import io
import json
import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank.files.atomic_write import write_text
from bellcrank.files.csv_files import guarded

if TYPE_CHECKING:
    from bellcrank.studies.sweep_result import Design, Sweep

MOST_LINES = 64  # of designs on screen: the first and the last of them
LONGEST_REASON = 110


def text_table(sweep: Sweep, measures: Sequence[str]) -> str:
    """The designs one a line: axes, measures with their units, status, reason; of very many the first and the last."""
    columns = [sweep.column(name) for name in measures]
    head = [axis.label for axis in sweep.axes] + [f"{name} [{sweep.units[name]}]" for name in measures]
    lines = [[*head, "status", "reason"]]
    for k, design in enumerate(sweep.designs):
        figures = [
            "unknown" if name in design.measures and not math.isfinite(column[k]) else _figure(float(column[k]))
            for name, column in zip(measures, columns, strict=True)
        ]
        lines.append([*_place(sweep, design), *figures, design.status, design.reason])
    hidden = len(lines) - 1 - MOST_LINES
    if hidden > 0:
        del lines[MOST_LINES // 2 + 1 : -(MOST_LINES // 2)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(head) + 1)]
    rows = []
    for line in lines:
        cells = [f"{text:>{width}}" for text, width in zip(line[:-2], widths[:-1], strict=True)]
        reason = textwrap.shorten(line[-1], LONGEST_REASON, placeholder="…")
        rows.append("  ".join([*cells, f"{line[-2]:{widths[-1]}}", reason]).rstrip())
    if hidden > 0:
        rows.insert(MOST_LINES // 2 + 1, f"… {hidden} more …")
    return "\n".join([rows[0], "-" * (sum(widths) + 2 * len(widths) - 2), *rows[1:]])


def write_csv(sweep: Sweep, path: str | Path) -> Path:
    """One row a design; empty where a measure is none, or not a finite number (status "unknown").

    The file is replaced in one step, or not at all."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    labels = [f"{name} [{unit}]" for name, unit in sweep.units.items()]
    writer.writerow(guarded([*(axis.label for axis in sweep.axes), "status", *labels, "reason"]))
    for design in sweep.designs:
        figures = [design.measures.get(name, math.nan) for name in sweep.units]
        cells = [repr(value) if math.isfinite(value) else "" for value in figures]
        texts = guarded([*_values(sweep, design), design.status]), guarded([design.reason])
        writer.writerow([*texts[0], *cells, *texts[1]])
    write_text(path, text.getvalue())
    return Path(path)


def write_json(sweep: Sweep, path: str | Path) -> Path:
    """Axes, units, and designs with their measures; numbers that are not finite are null."""
    document = {
        "scene": sweep.scene.name,
        "source": sweep.scene.source.name,
        "complete": sweep.complete,
        "axes": [{"path": a.path, "unit": a.unit or "1", "values": list(a.values)} for a in sweep.axes],
        "units": dict(sweep.units),
        "designs": [
            {
                "values": _values(sweep, design),
                "status": design.status,
                "reason": design.reason,
                "measures": {k: v if math.isfinite(v) else None for k, v in design.measures.items()},
            }
            for design in sweep.designs
        ],
    }
    write_text(path, json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    return Path(path)


def _values(sweep: Sweep, design: Design) -> list[Any]:
    """Numbers in the axes' units, or the values themselves where they are none."""
    found, rest = [], design.index
    for axis in reversed(sweep.axes):
        rest, k = divmod(rest, len(axis.values))
        found.append(axis.numbers[k] if axis.numeric else axis.values[k])
    return found[::-1]


def _place(sweep: Sweep, design: Design) -> list[str]:
    return [f"{value:.9g}" if isinstance(value, float) else str(value) for value in _values(sweep, design)]


def _figure(value: float) -> str:
    return f"{value:.9g}" if math.isfinite(value) else "-"
