"""Tables of a sweep as text, CSV and JSON, with units; while a sweep runs, as sweep.partial.csv and .json."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import math
import os
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank.errors import InputError
from bellcrank.files.atomic_write import write_text
from bellcrank.files.csv_files import guarded

if TYPE_CHECKING:
    from bellcrank.studies.sweep_result import Design, Sweep

MOST_LINES = 64  # designs on the screen: the first and the last
LONGEST_REASON = 110


def text_table(sweep: Sweep, measures: Sequence[str]) -> str:
    """One line a design: axes, measures with units, status, reason; of many designs only the first and the last."""
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
    """Write one row a design; a cell is empty where there is no measure, or it is not finite (status "unknown").

    The file is written atomically.
    """
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
    """Write axes, units, and designs with their measures; numbers that are not finite are null."""
    document = {
        "scene": sweep.scene.name,
        "source": sweep.scene.source.name,
        "complete": sweep.complete,
        "axes": [{"path": a.path, "unit": a.unit or "1", "values": a.values} for a in sweep.axes],
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
    """The values of a design: numbers in the axes' units, or the values themselves where they are not numbers."""
    found, rest = [], design.index
    for axis in reversed(sweep.axes):
        rest, k = divmod(rest, len(axis))
        found.append(axis.shown(axis.numbers[k]))
    return found[::-1]


def _place(sweep: Sweep, design: Design) -> list[str]:
    return [f"{value:.9g}" if isinstance(value, float) else str(value) for value in _values(sweep, design)]


def _figure(value: float) -> str:
    return f"{value:.9g}" if math.isfinite(value) else "-"


_SUFFIXES = (".csv", ".json")


class PartialTables:
    """Writes the tables of a sweep into a folder.

    Tables that an earlier, unfinished sweep left there are renamed to sweep.partial.1.csv and so on; `earlier` are
    their new paths. Raises InputError where they cannot be renamed.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.paths = [folder / f"sweep.partial{suffix}" for suffix in _SUFFIXES]
        self.earlier = [_set_aside(path) for path in self.paths if os.path.lexists(path)]

    def write(self, sweep: Sweep) -> None:
        """Write the designs that are done; an error of the disk is ignored here and raised at the end."""
        with contextlib.suppress(InputError):
            sweep.to_csv(self.paths[0])
            sweep.to_json(self.paths[1])

    def finish(self, sweep: Sweep) -> list[Path]:
        """Write the final tables; returns their paths. Raises InputError, which says what is kept."""
        files: list[Path] = []
        try:
            files.append(sweep.to_csv(self.folder / "sweep.csv"))
            files.append(sweep.to_json(self.folder / "sweep.json"))
        except InputError as error:
            kept = [path.name for path in self.paths if path.exists()]
            left = f"the designs that were done before are kept in {' and '.join(kept)}" if kept else "nothing is kept"
            if files:
                left = f"all designs are in {files[0].name}"
            raise InputError(f"{error}; {left}") from None
        for path in self.paths:
            path.unlink(missing_ok=True)
        return files


def _set_aside(path: Path) -> Path:
    number = 1
    while os.path.lexists(aside := path.with_suffix(f".{number}{path.suffix}")):
        number += 1
    try:
        return path.rename(aside)
    except OSError as error:
        raise InputError(f"cannot rename {path}: {error.strerror}; choose another folder") from None
