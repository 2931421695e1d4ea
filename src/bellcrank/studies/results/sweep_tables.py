"""The table of a sweep on the screen: designs line by line, the first and the last of many, and a summary."""

from __future__ import annotations

import csv
import importlib.util
import io
import json
import math
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank._step import csv_rows
from bellcrank.arrays import Array, Mask
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import writing
from bellcrank.files.csv_files import guarded
from bellcrank.messages import readable, utf8
from bellcrank.present.tables import aligned
from bellcrank.simulation.files.save_run import write_archive
from bellcrank.studies.execution.run_outcomes import UNKNOWN
from bellcrank.version import version

if TYPE_CHECKING:
    from bellcrank.studies.results.sweep_result import Sweep


MOST_LINES = 20  # designs: the first and the last
SUMMARISED = 10  # designs, above which there is a summary
LONGEST_REASON = 110
MOST_AXES = 2  # whose values say where a measure is least and largest
BLOCK = 8192  # rows converted to text at a time
ROW_GROUP = 2**17  # rows of a Parquet file that are written at a time
FORMAT = "bellcrank sweep"
INSTALL = "pip install 'bellcrank[parquet]'"
MOST_CSV, MOST_JSON = 100_000, 10_000  # designs in such a file
NAMES = ("sweep.csv", "sweep.json", "sweep.parquet", "sweep.npz")


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
    made = aligned(lines, range(len(widths) - texts, len(widths)))
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
    return lines + aligned(table, (0, 6, 7))


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


PARTIAL_NAMES = tuple(name.replace(".", ".partial.") for name in NAMES)  # of a sweep that was interrupted


def has_pyarrow() -> bool:
    """Whether Parquet files can be written."""
    return importlib.util.find_spec("pyarrow") is not None


def write_tables(sweep: Sweep, folder: Path) -> list[Path]:
    """Write the designs into a folder: sweep.csv, and sweep.json of few; of very many sweep.parquet, or sweep.npz where
    pyarrow is not installed. Of a sweep that was interrupted they are sweep.partial.csv and so on. Other files of these
    names are of an earlier sweep, or of a part of this one: they are removed, but for the files of a whole sweep beside
    those of a part.

    Returns the paths of the files, the first of which holds everything. Raises InputError, which says what is kept.
    """
    if len(sweep) > MOST_CSV:
        kinds = [("sweep.parquet", sweep.to_parquet) if has_pyarrow() else ("sweep.npz", sweep.to_npz)]
    else:
        kinds = [("sweep.csv", sweep.to_csv), ("sweep.json", sweep.to_json)][: 1 + (len(sweep) <= MOST_JSON)]
    files: list[Path] = []
    try:
        for name, write in kinds:
            files.append(write(folder / (name if sweep.complete else name.replace(".", ".partial."))))
    except InputError as error:
        raise InputError(f"{error}; {f'all designs are in {files[0].name}' if files else 'nothing is kept'}") from None
    for name in (*PARTIAL_NAMES, *(NAMES if sweep.complete else ())):
        if folder / name not in files:
            (folder / name).unlink(missing_ok=True)
    return files


def write_csv(sweep: Sweep, path: str | Path) -> Path:
    """Write one row a design; a cell is empty where there is no measure, or it is not finite. The write is atomic."""
    labels = [*(axis.label for axis in sweep.axes), "status", *_labels(sweep, sweep.units), "reason"]
    reasons, reason_of = _reasons(sweep)
    measures = [sweep.columns.measures[name] for name in sweep.units]
    columns: list[Array | tuple[NDArray[np.int32], list[str]]] = []
    for axis, numbers in zip(sweep.axes, sweep.values.T, strict=True):
        columns.append((numbers.astype(np.int32), list(map(_quoted, axis.choices))) if axis.choices else numbers)
    columns.append((sweep.columns.status.astype(np.int32), list(map(_quoted, sweep.columns.statuses))))
    columns += [*measures, (reason_of, list(map(_quoted, reasons)))]
    with writing(path) as temporary, temporary.open("wb") as file:
        file.write(",".join(map(_quoted, labels)).encode() + b"\n")
        for first in range(0, len(sweep), BLOCK):
            rows = slice(first, first + BLOCK)
            parts = [(each[0][rows], each[1]) if isinstance(each, tuple) else each[rows] for each in columns]
            file.write(csv_rows(parts, blank=True))
    return Path(path)


def _quoted(value: object) -> str:
    """A cell of text as it stands in a CSV file, in characters that UTF-8 has."""
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow([*guarded([value]), ""])  # a row of one empty cell would be '""'
    return readable(text.getvalue()[:-1])


def design_rows(sweep: Sweep) -> list[Sequence[object]]:
    """The rows that `write_csv` writes, first the header."""
    rows: list[Sequence[object]] = [
        [*(axis.label for axis in sweep.axes), "status", *_labels(sweep, sweep.units), "reason"]
    ]
    for design, numbers in zip(sweep.designs, sweep.values.tolist(), strict=True):
        measures = [x if math.isfinite(x := design.measures.get(name, math.nan)) else "" for name in sweep.units]
        shown = [axis.shown(number) for axis, number in zip(sweep.axes, numbers, strict=True)]
        rows.append([*shown, design.status, *measures, design.reason])
    return rows


def sweep_data(sweep: Sweep) -> dict[str, Any]:
    """Axes, units, and designs with their measures."""
    values = sweep.values.tolist()
    return {
        "scene": sweep.scene.name,
        "source": sweep.scene.source.name,
        "complete": sweep.complete,
        "axes": _axes(sweep, values=True),
        **({"sample": sweep.space.sample.identity} if sweep.space.sample is not None else {}),
        "units": dict(sweep.units),
        "notes": [note.as_dict() for note in sweep.notes],
        "designs": [
            {
                "values": [axis.shown(number) for axis, number in zip(sweep.axes, numbers, strict=True)],
                "status": design.status,
                "reason": design.reason,
                "measures": dict(design.measures),
            }
            for design, numbers in zip(sweep.designs, values, strict=True)
        ],
    }


def write_parquet(sweep: Sweep, path: str | Path) -> Path:
    """Write one row a design; values that are not finite are null. Raises InputError where pyarrow is missing."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise InputError(f"cannot write {path}: Parquet files need the package pyarrow; {INSTALL}") from None

    text = pyarrow.dictionary(pyarrow.int32(), pyarrow.string())
    axes = [(axis.label, text if axis.choices else pyarrow.float64()) for axis in sweep.axes]
    measures = [(label, pyarrow.float64()) for label in _labels(sweep, sweep.units)]
    columns = [("design", pyarrow.int64()), *axes, ("status", text), *measures, ("reason", text)]
    schema = pyarrow.schema(columns, metadata={"bellcrank": json.dumps(_about(sweep))})
    names = [*(axis.label for axis in sweep.axes if axis.choices), "status", "reason"]
    reasons, reason_of = _reasons(sweep)

    def texts(codes: NDArray[Any], known: list[str], absent: Mask | None = None) -> Any:
        numbers = pyarrow.array(codes.astype(np.int32), mask=absent)
        return pyarrow.DictionaryArray.from_arrays(
            numbers, pyarrow.array([utf8(name).decode() for name in known], pyarrow.string())
        )

    with writing(path) as temporary, parquet.ParquetWriter(temporary, schema, use_dictionary=names) as file:
        for first in range(0, len(sweep), ROW_GROUP):
            rows = slice(first, first + ROW_GROUP)
            arrays = [pyarrow.array(sweep.index[rows])]
            for axis, numbers in zip(sweep.axes, sweep.values[rows].T, strict=True):
                found = texts(numbers, list(map(str, axis.choices))) if axis.choices else None
                arrays.append(pyarrow.array(np.ascontiguousarray(numbers)) if found is None else found)
            arrays.append(texts(sweep.columns.status[rows], list(sweep.columns.statuses)))
            for name in sweep.units:
                values = sweep.columns.measures[name][rows]
                arrays.append(pyarrow.array(values, mask=~np.isfinite(values)))
            arrays.append(texts(reason_of[rows] - 1, reasons[1:] or [""], reason_of[rows] == 0))
            file.write_table(pyarrow.Table.from_arrays(arrays, schema=schema))
    return Path(path)


def write_npz(sweep: Sweep, path: str | Path) -> Path:
    """Write the columns as arrays; values that are not finite are NaN."""
    reasons, reason_of = _reasons(sweep)
    arrays: dict[str, Any] = {"design": sweep.index}
    for axis, numbers in zip(sweep.axes, sweep.values.T, strict=True):
        arrays[axis.label] = np.array(list(map(str, axis.choices)))[numbers.astype(int)] if axis.choices else numbers
    arrays |= {"status": sweep.columns.status, "statuses": np.array(sweep.columns.statuses)}
    arrays |= {"reason": reason_of, "reasons": np.array(reasons)}
    for name, label in zip(sweep.units, _labels(sweep, sweep.units), strict=True):
        values = sweep.columns.measures[name]
        arrays[label] = np.where(np.isfinite(values), values, np.nan) if np.isinf(values).any() else values
    write_archive(Path(path), _about(sweep), arrays)
    return Path(path)


def _reasons(sweep: Sweep) -> tuple[list[str], NDArray[np.int32]]:
    """The different reasons, the first of which is none, and the number (designs,) of each design's reason."""
    numbers = {"": 0}
    found = np.zeros(len(sweep), dtype=np.int32)
    for row, reason in sweep.reasons.items():
        found[row] = numbers.setdefault(reason, len(numbers))
    return list(numbers), found


def _about(sweep: Sweep) -> dict[str, Any]:
    """What the file holds beside its rows."""
    return {
        "format": FORMAT,
        "version": version(),
        "scene": sweep.scene.name,
        "source": sweep.scene.source.name,
        "complete": sweep.complete,
        "designs": len(sweep.space),
        "axes": _axes(sweep, values=False),
        "sample": None if sweep.space.sample is None else sweep.space.sample.identity,
        "units": dict(sweep.units),
    }


def _axes(sweep: Sweep, values: bool) -> list[dict[str, Any]]:
    found = []
    for axis in sweep.axes:
        facts: dict[str, Any] = {"path": axis.path, "unit": axis.unit or "1"}
        if axis.distribution is not None:
            facts["distribution"] = str(axis.distribution)
        elif values:
            facts["values"] = axis.values
        else:
            facts |= {"count": len(axis), "first": axis.shown(axis.numbers[0]), "last": axis.shown(axis.numbers[-1])}
        found.append(facts)
    return found


def file_note(sweep: Sweep) -> str:
    """Why the designs are in a file of another kind; empty where they are in CSV and JSON."""
    if len(sweep) <= MOST_JSON:
        return ""
    if len(sweep) <= MOST_CSV:
        return f" (JSON is written of at most {MOST_JSON} designs)"
    more = "" if has_pyarrow() else f"; for Parquet: {INSTALL}"
    return f" (CSV is written of at most {MOST_CSV} designs{more})"
