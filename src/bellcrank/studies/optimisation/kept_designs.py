"""The designs of a search that are kept in its folder, so that a search that was killed goes on.

A search asks for the same designs again when it is started again: those that are kept are not run a second time.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from bellcrank.arrays import Array, Indices, Mask
from bellcrank.files.access import MOST_RUN, open_regular
from bellcrank.files.npz_archive import read_archive
from bellcrank.simulation.files.save_run import write_archive
from bellcrank.studies.execution.software_and_processor import environment
from bellcrank.studies.execution.study_folder import FORMAT, StudyFolder

EVERY = 2.0  # s between two files
_MEMBERS = re.compile("numbers|values|out|reason_rows|reason_texts")


@dataclass(frozen=True, eq=False)
class Ran:
    """What was run of n designs.

    Attributes:
        names: The measures.
        done: (n,) which were run.
        values: (n, names).
        out: (n,) which cannot be built or do not reach their target.
        texts: What is said of some, by row.
    """

    names: tuple[str, ...]
    done: Mask
    values: Array
    out: Mask
    texts: dict[int, str]

    @classmethod
    def none(cls, count: int, names: Sequence[str]) -> Self:
        """So many designs that are not run yet."""
        no = np.zeros(count, dtype=np.bool_)
        return cls(tuple(names), no, np.full((count, len(names)), np.nan), no.copy(), {})

    def fill(self, rows: Indices, ran: Ran) -> None:
        """Put what was run into these rows."""
        self.done[rows], self.values[rows], self.out[rows] = True, ran.values, ran.out
        self.texts.update({int(rows[k]): text for k, text in ran.texts.items()})

    def part(self, rows: Indices) -> Ran:
        """Some rows."""
        texts = {k: self.texts[row] for k, row in enumerate(rows.tolist()) if row in self.texts}
        return Ran(self.names, self.done[rows], self.values[rows], self.out[rows], texts)

    def judged(self) -> tuple[Array, dict[int, str]]:
        """The measures (n, names), NaN where infeasible, and why, by row."""
        values, reasons = self.values.copy(), {row: self.texts[row] for row in np.flatnonzero(self.out).tolist()}
        for row in np.flatnonzero(~np.isfinite(values).all(axis=1)).tolist():
            reasons.setdefault(row, self.texts.get(row, f"it does not have {' and '.join(set(self.names))}"))
        values[list(reasons)] = np.nan
        return values, reasons


class KeptDesigns(StudyFolder):
    """The folder of a search, with the measures of each design that was run."""

    def __init__(self, path: str | Path, *, restart: bool = False, notify: Callable[[str], object] = print) -> None:
        super().__init__(path, restart=restart, notify=notify)
        self.names: tuple[str, ...] = ()
        self._known: dict[bytes, tuple[Array, bool, str]] = {}
        self._unsaved: list[bytes] = []
        self._saved = time.monotonic()

    def __exit__(self, *reason: object) -> None:
        try:
            self.save()
        finally:
            super().__exit__(*reason)

    def open(self, identity: Mapping[str, str], axes: Sequence[str], names: Sequence[str]) -> None:
        """Read what an earlier process kept of a search over these axes for these measures.

        Raises InputError where the folder holds another one.
        """
        self.names = tuple(dict.fromkeys(names))
        what = {"axes": " ".join(axes), "kind": "a search for the best design"}
        whole = {**identity, **environment(), **what}
        if self._found(whole, 0, self.names, lambda path: self._read_designs(path, len(axes))):
            self.notify(f"{len(self._known)} designs were run before, in {self.checkpoints}")

    def recalled(self, numbers: Array, names: Sequence[str]) -> Ran:
        """What is known of designs with values (n, axes)."""
        columns, found = [self.names.index(name) for name in names], Ran.none(len(numbers), names)
        for k, row in enumerate(numbers):
            if (known := self._known.get(row.tobytes())) is not None:
                found.done[k], found.values[k], found.out[k] = True, known[0][columns], known[1]
                if known[2]:
                    found.texts[k] = known[2]
        return found

    def add(self, numbers: Array, ran: Ran) -> None:
        """Keep designs with values (n, axes) and all measures. Raises InputError where they cannot be written."""
        for k, row in enumerate(numbers):
            self._known[key := row.tobytes()] = ran.values[k], bool(ran.out[k]), ran.texts.get(k, "")
            self._unsaved.append(key)
        if time.monotonic() - self._saved > EVERY:
            self.save()

    def remove_checkpoints(self) -> None:
        """Remove what was kept, once the result is written."""
        self._unsaved = []
        super().remove_checkpoints()

    def save(self) -> None:
        """Write what is not written yet. Raises InputError where it cannot be."""
        if not self._unsaved:
            return
        self._describe()
        found = [self._known[key] for key in self._unsaved]
        texts = {text: k for k, text in enumerate(dict.fromkeys(text for *_, text in found if text))}
        rows = {k: texts[text] for k, (*_, text) in enumerate(found) if text}
        arrays = {
            "numbers": np.array([np.frombuffer(key) for key in self._unsaved]),
            "values": np.array([values for values, *_ in found]),
            "out": np.array([out for _, out, _ in found], dtype=np.float64),
            "reason_rows": np.array(list(rows), dtype=np.float64),
            "reason_texts": np.array(list(rows.values()), dtype=np.float64),
        }
        about = {"format": FORMAT, "reasons": list(texts)}
        write_archive(self.checkpoints / f"{self._next:06d}.npz", about, arrays, lasting=True)
        self._next += 1
        self._unsaved, self._saved = [], time.monotonic()

    def _read_designs(self, path: Path, axes: int) -> None:
        """Raises one of DAMAGE where a file is not what `save` writes."""
        with open_regular(path, MOST_RUN) as stream:
            about, arrays = read_archive(stream, _MEMBERS)
        texts = about.get("reasons")
        if about.get("format") != FORMAT or not isinstance(texts, list) or len(arrays) != 5:
            raise ValueError("it does not hold designs of a search")
        numbers, values = np.ascontiguousarray(arrays["numbers"]), arrays["values"]
        rows, which = arrays["reason_rows"], arrays["reason_texts"]
        count = len(numbers)
        right = numbers.shape == (count, axes) and values.shape == (count, len(self.names))
        right = right and rows.shape == which.shape and arrays["out"].shape == (count,)
        for given, below in ((rows, count), (which, len(texts)), (arrays["out"], 2)):
            right = right and given.ndim == 1 and bool(((given >= 0) & (given < below) & (given % 1 == 0)).all())
        if not right:
            raise ValueError("its designs do not fit the search")
        reasons = {int(row): str(texts[int(k)]) for row, k in zip(rows.tolist(), which.tolist(), strict=True)}
        for k, row in enumerate(numbers):
            self._known[row.tobytes()] = values[k], bool(arrays["out"][k]), reasons.get(k, "")
