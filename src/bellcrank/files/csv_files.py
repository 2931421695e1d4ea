"""CSV files: tables of numbers, and cells with text that a spreadsheet does not take for a formula.

A cell with text that begins with =, +, -, @ or a control character is written with an apostrophe before it (OWASP, "CSV
injection"), which is removed when the cell is read back. Numbers are written as they are.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

from bellcrank._step import csv_rows
from bellcrank.arrays import Array
from bellcrank.files.atomic_write import writing

ROWS = 1024  # converted to text at a time
_FORMULA = tuple("=+-@\t\r\n＝＋－＠")  # spreadsheets accept the full-width ones too
MARK = "'"


def write_table(path: str | Path, labels: Sequence[tuple[str, str]], blocks: Iterable[Array]) -> Path:
    """Write a header of (name, unit) pairs and the rows of the blocks (n, columns); returns the path.

    Numbers are written with enough digits to read them back exactly. Blocks are written one after the other, so that a
    generator needs the memory of one block. The write is atomic. Raises InputError where the folder cannot be written.
    """
    target = Path(path)
    header = csv_text([[f"{name} [{unit}]" for name, unit in labels]])
    with writing(target) as temporary, temporary.open("wb") as file:
        file.write(header.encode())
        for block in blocks:
            for first in range(0, len(block), ROWS):
                file.write(csv_rows(list(block[first : first + ROWS].T), blank=False))
    return target


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    """The text of a CSV file with these rows, the header among them. Texts are guarded, numbers exact."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(guarded(row) for row in rows)
    return text.getvalue()


def guarded(cells: Iterable[object]) -> list[object]:
    """The cells of a row, with an apostrophe before texts that a spreadsheet would take for formulas."""
    return [MARK + cell if isinstance(cell, str) and _is_formula(cell) else cell for cell in cells]


def unguarded(cell: str) -> str:
    """The text of a cell that `guarded` has written."""
    return cell[1:] if cell.startswith(MARK) and _is_formula(cell) else cell


def _is_formula(text: str) -> bool:
    """Whether a text, without its leading apostrophes, would be taken for a formula."""
    return text.lstrip(MARK).startswith(_FORMULA)
