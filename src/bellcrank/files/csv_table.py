"""Tables of numbers as CSV files, written a block of rows at a time: their text is many times the numbers."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bellcrank.files.atomic_write import writing
from bellcrank.files.csv_cells import guarded

Array = NDArray[np.float64]
ROWS = 1024  # made text of at a time


def write_table(path: str | Path, labels: Sequence[tuple[str, str]], blocks: Iterable[Array]) -> Path:
    """Write a header of (name, unit) of each column and the rows of the blocks (n, columns), every number with the
    digits that give it back exactly; returns the path.

    Blocks are taken one after the other, so that a generator needs no more memory than one of them. The file is
    replaced in one step, or not at all. Raises InputError where the folder cannot be written.
    """
    target = Path(path)
    with writing(target) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerow(guarded(f"{name} [{unit}]" for name, unit in labels))
        for block in blocks:
            for first in range(0, len(block), ROWS):
                file.writelines(",".join(map(repr, row)) + "\n" for row in block[first : first + ROWS].tolist())
    return target
