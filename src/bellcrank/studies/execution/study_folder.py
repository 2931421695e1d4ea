"""The output folder of a study while it runs: rows that are done are kept there, and found by the next process.

FOLDER/checkpoints/study.json holds what the study is. 000001.npz, 000002.npz, … hold the rows that were computed in a
few seconds each, without compression: compressed they take 96 % of the room, because most digits are random, and ten
times as long. Every file is written under another name, flushed to the disk and renamed; each of its arrays has a
checksum.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bellcrank.arrays import Array
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.access import MOST_RUN, open_regular, read_text
from bellcrank.files.atomic_write import writing
from bellcrank.files.npz_archive import DAMAGE, NoAboutError, read_archive
from bellcrank.files.temporaries import new_folder
from bellcrank.memory import check_memory
from bellcrank.simulation.files.save_run import write_archive
from bellcrank.studies.designs.design_space import LARGEST_SAVED, DesignRange, true_ranges
from bellcrank.studies.execution.software_and_processor import differences
from bellcrank.studies.results.study_columns import StudyColumns

FORMAT, VERSION = "bellcrank study", 1
CHECKPOINTS = "checkpoints"
_ABOUT = "study.json"
_FILE = re.compile(r"\d{6,12}\.npz")
_MEMBERS = re.compile("ranges|status|measures|reason_designs|reason_texts")
_REMEDY = "choose another output folder, or set the earlier one aside with --restart (in Python: restart=True)"
NAME = ".bellcrank-study-lock"
_WOULD_WAIT = (errno.EAGAIN, errno.EACCES)


class StudyRows:
    """The columns of N designs, of which some are done.

    Attributes:
        names: The measures.
        statuses: As in Columns; empty until the first rows are added.
        done: Which designs are done (N,).
        status: Numbers of `statuses` (N,), of the designs that are done.
        measures: (measures, N); undefined where a design is not done.
        reasons: By the number of the design.
    """

    def __init__(self, count: int, names: Sequence[str]) -> None:
        """Raises InputError where the rows do not fit into the memory."""
        check_memory(count, 8 * len(names) + 2, "designs")
        self.names, self.statuses = tuple(names), tuple[str, ...]()
        self.done = np.zeros(count, dtype=np.bool_)
        self.status = np.zeros(count, dtype=np.int8)
        self.measures: Array = np.empty((len(names), count))
        self.reasons: dict[int, str] = {}
        self._texts: dict[str, str] = {}  # many designs have the same reason

    def __len__(self) -> int:
        return len(self.done)

    def add(self, designs: DesignRange, columns: StudyColumns) -> None:
        """Add the rows of a range. Raises BellcrankError where they are not those of this study."""
        if len(columns) != designs.size or tuple(columns.measures) != self.names:
            raise BellcrankError(
                f"{designs.size} designs gave {len(columns)} rows of {len(columns.measures)} measures, expected "
                f"{len(self.names)} measures in the order of the units (a fault of bellcrank)"
            )
        columns_of = [columns.measures[name] for name in self.names]
        reasons = {designs.first + row: text for row, text in columns.reasons.items()}
        self.fill(designs, columns.statuses, columns.status, columns_of, reasons)

    def fill(
        self,
        designs: DesignRange,
        statuses: tuple[str, ...],
        status: NDArray[np.int8],
        measures: Sequence[Array],
        reasons: Mapping[int, str],
    ) -> None:
        """Fill the rows of a range; `reasons` by the number of the design. Raises BellcrankError for other statuses."""
        if self.statuses not in ((), statuses):
            raise BellcrankError(f"statuses {statuses} follow {self.statuses} (a fault of bellcrank)")
        first, stop = designs
        self.statuses = statuses
        self.status[first:stop] = status
        for row, values in zip(self.measures, measures, strict=True):
            row[first:stop] = values
        for design, text in reasons.items():
            self.reasons[design] = self._texts.setdefault(text, text)
        self.done[first:stop] = True

    def columns(self) -> StudyColumns:
        """The rows that are done, without a copy; nothing can be added afterwards."""
        count, measures, status, reasons = len(self), self.measures, self.status, self.reasons
        if not self.done.all():
            count = int(self.done.sum())
            for row in measures:
                row[:count] = row[self.done]
            measures, status = measures[:, :count], status[self.done]
            place = np.cumsum(self.done) - 1
            reasons = {int(place[design]): text for design, text in reasons.items() if self.done[design]}
        return StudyColumns(
            statuses=self.statuses,
            status=status,
            measures=dict(zip(self.names, measures, strict=True)),
            reasons=dict(sorted(reasons.items())),
        )


class StudyFolder:
    """The folder of a study, which no other process can use in the block of this context manager.

    Args:
        path: The output folder.
        restart: Set an unfinished study that is there aside, instead of going on with it.
        notify: Called with a sentence about what is found there.
    """

    def __init__(self, path: str | Path, *, restart: bool = False, notify: Callable[[str], object] = print) -> None:
        self.path, self.restart, self.notify = Path(path), restart, notify
        self.checkpoints = self.path / CHECKPOINTS
        self._lock = FolderLock(self.path)
        self._about: dict[str, Any] = {}
        self._described = False  # whether _ABOUT is that of this study
        self._next = 1

    def __enter__(self) -> Self:
        """Raises InputError where another process uses the folder, or it cannot be written."""
        if self.checkpoints.is_symlink():
            raise InputError(f"{self.checkpoints}: is a link; remove it, or choose another output folder")
        self._lock.__enter__()
        return self

    def __exit__(self, *reason: object) -> None:
        self._lock.__exit__(*reason)

    def resume(self, identity: Mapping[str, str], rows: StudyRows) -> None:
        """Fill the rows that an earlier process kept; all later ones are those of this study.

        Raises InputError where the folder holds another study.
        """
        if self._found(identity, len(rows), rows.names, lambda path: _read(path, rows)):
            self.notify(f"{int(rows.done.sum())} of {len(rows)} designs were done before, in {self.checkpoints}")

    def _found(
        self, identity: Mapping[str, str], designs: int, measures: Sequence[str], read: Callable[[Path], object]
    ) -> bool:
        """Read the files that an earlier process kept of this study; whether there are any. Raises as `resume`."""
        self._about = {
            "format": FORMAT, "version": VERSION, "designs": designs, "measures": list(measures),
            "identity": dict(identity),
        }  # fmt: skip
        if self.restart:
            self._set_aside()
        files = self._files()
        if not files:
            return False
        self._check_same()
        self._described = True
        for path in files:
            try:
                read(path)
            except (InputError, NoAboutError, *DAMAGE) as error:
                text = str(error).removeprefix(f"{path}: ") or type(error).__name__
                self.notify(f"{path} is damaged ({text}); its designs are computed anew")
                path.unlink(missing_ok=True)
        self._next = int(files[-1].stem) + 1
        return True

    def write(self, rows: StudyRows, unsaved: np.ndarray[Any, np.dtype[np.bool_]]) -> None:
        """Keep the rows that the mask `unsaved` names. Raises InputError where they cannot be written."""
        self._describe()
        for ranges in _batches(true_ranges(unsaved)):
            path = self.checkpoints / f"{self._next:06d}.npz"
            _write(path, rows, ranges)
            self._next += 1

    def _describe(self) -> None:
        """Say what study the files belong to. Raises InputError where that cannot be written."""
        if not self._described:
            text = json.dumps(self._about, ensure_ascii=False, indent=1)
            with writing(self.checkpoints / _ABOUT, lasting=True) as temporary:
                temporary.write_text(text, encoding="utf-8", errors="surrogateescape")
            self._described = True

    def remove_checkpoints(self) -> None:
        """Remove what was kept, once the final files are written: they hold the same numbers."""
        if not self.checkpoints.is_dir():
            return
        with contextlib.suppress(OSError):
            gone = new_folder("study", self.path)
            self.checkpoints.rename(gone)  # at once: half of it would look like a study
            shutil.rmtree(gone, ignore_errors=True)

    def _files(self) -> list[Path]:
        try:
            files = [path for path in self.checkpoints.iterdir() if _FILE.fullmatch(path.name)]
            return sorted(files, key=lambda path: int(path.stem))
        except (FileNotFoundError, NotADirectoryError):
            return []
        except OSError as error:
            raise InputError(f"{self.checkpoints}: cannot be read: {error.strerror}; {_REMEDY}") from None

    def _check_same(self) -> None:
        """Refuse checkpoints of another study. Raises InputError."""
        path = self.checkpoints / _ABOUT
        try:
            about = json.loads(read_text(path))
            earlier = dict(about["identity"])
            facts = [about[key] for key in ("format", "version", "designs", "measures")]
            if not (_are_texts(list(earlier.values())) and _are_texts(facts[3])):
                raise ValueError("not texts")
        except (InputError, ValueError, TypeError, KeyError, RecursionError):
            raise InputError(f"{path}: does not say what study the files beside it belong to; {_REMEDY}") from None
        now = self._about["identity"]
        if facts[:2] != [FORMAT, VERSION]:
            raise InputError(f"{self.checkpoints}: was written in another format; {_REMEDY}")
        found = differences(earlier, now, ("there", "now"))
        if not found and facts[2:] != [self._about["designs"], self._about["measures"]]:
            found = differences(
                {"designs": str(facts[2]), "measures": " ".join(map(str, facts[3]))},
                {"designs": str(self._about["designs"]), "measures": " ".join(self._about["measures"])},
                ("there", "now"),
            )
        if found:
            raise InputError(f"{self.checkpoints}: holds an unfinished study that differs in {found}; {_REMEDY}")

    def _set_aside(self) -> None:
        if not self.checkpoints.exists():
            return
        number = 1
        while (to := self.path / f"{CHECKPOINTS}.{number}").exists():
            number += 1
        try:
            self.checkpoints.rename(to)
        except OSError as error:
            raise InputError(f"cannot rename {self.checkpoints}: {error.strerror}; choose another folder") from None
        self.notify(f"the unfinished study that was there is now in {to}")


def _batches(ranges: Sequence[DesignRange]) -> list[list[DesignRange]]:
    """Ranges of at most LARGEST_SAVED designs a list, those that are longer cut."""
    found: list[list[DesignRange]] = [[]]
    room = LARGEST_SAVED
    for first, stop in ranges:
        while first < stop:
            end = min(stop, first + room)
            found[-1].append(DesignRange(first, end))
            room -= end - first
            first = end
            if room == 0:
                found.append([])
                room = LARGEST_SAVED
    return [batch for batch in found if batch]


def _write(path: Path, rows: StudyRows, ranges: Sequence[DesignRange]) -> None:
    chosen = np.concatenate([np.arange(first, stop) for first, stop in ranges])
    reasons = {design: rows.reasons[design] for design in chosen.tolist() if design in rows.reasons}
    texts = {text: k for k, text in enumerate(dict.fromkeys(reasons.values()))}
    about = {"format": FORMAT, "statuses": list(rows.statuses), "reasons": list(texts)}
    arrays = {
        "ranges": np.array(ranges, dtype=np.float64),
        "status": rows.status[chosen].astype(np.float64),
        "measures": rows.measures[:, chosen],
        "reason_designs": np.array(list(reasons), dtype=np.float64),
        "reason_texts": np.array([texts[text] for text in reasons.values()], dtype=np.float64),
    }
    write_archive(path, about, arrays, lasting=True)


def _read(path: Path, rows: StudyRows) -> None:
    """Fill the rows that a file holds. Raises one of DAMAGE where it is not what `_write` writes."""
    with open_regular(path, MOST_RUN) as stream:
        about, arrays = read_archive(stream, _MEMBERS)
    statuses, texts = about.get("statuses"), about.get("reasons")
    if about.get("format") != FORMAT or not (_are_texts(statuses) and _are_texts(texts)) or len(arrays) != 5:
        raise ValueError("it is not a checkpoint of a study")
    assert isinstance(statuses, list) and isinstance(texts, list)
    ranges, status, measures, designs, numbers = (
        arrays[name] for name in ("ranges", "status", "measures", "reason_designs", "reason_texts")
    )
    edges = ranges.ravel()
    right = ranges.ndim == 2 and ranges.shape[1] == 2 and len(ranges) > 0 and _whole(edges, len(rows) + 1)
    if not right or not (np.diff(edges) > 0)[::2].all() or not (np.diff(edges) >= 0).all():
        raise ValueError("its ranges are not ranges of designs")
    count = int((ranges[:, 1] - ranges[:, 0]).sum())
    if status.shape != (count,) or measures.shape != (len(rows.names), count) or not _whole(status, len(statuses)):
        raise ValueError("its rows do not fit its ranges")
    if designs.shape != numbers.shape or not (_whole(designs, len(rows)) and _whole(numbers, len(texts))):
        raise ValueError("its reasons do not fit its rows")
    reasons = {int(design): texts[int(k)] for design, k in zip(designs.tolist(), numbers.tolist(), strict=True)}
    at = 0
    for first, stop in ranges.astype(np.int64).tolist():
        part = slice(at, at + stop - first)
        own = {} if at else reasons
        try:
            rows.fill(
                DesignRange(first, stop), tuple(statuses), status[part].astype(np.int8), list(measures[:, part]), own
            )
        except BellcrankError as error:
            raise ValueError(str(error)) from None
        at = part.stop


def _are_texts(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(entry, str) for entry in value)


def _whole(values: np.ndarray[Any, np.dtype[np.float64]], below: int) -> bool:
    """Whether all are whole numbers from 0 to below `below`."""
    return values.ndim == 1 and bool(((values >= 0) & (values < below) & (values == np.floor(values))).all())


# ---- A lock on a folder, so that two processes do not write one study at once.


class FolderLock:
    """Holds a folder while its block runs. The system releases the lock of a process that is killed.

    The lock is on a file in the folder (flock), which other machines that mount the folder respect too.
    """

    def __init__(self, folder: Path) -> None:
        self.path, self._file = folder / NAME, -1

    def __enter__(self) -> Self:
        """Raises InputError where another process holds the folder, or it cannot be written."""
        while self._file < 0:
            try:
                self.path.parent.mkdir(parents=True, exist_ok=True)
                file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o666)
            except OSError as error:
                raise InputError(
                    f"cannot write in {self.path.parent}: {error.strerror}; choose another folder"
                ) from None
            try:
                self._take(file)
            except BaseException:
                os.close(file)
                raise
            if self._is_ours(file):
                self._file = file
            else:  # its owner has just removed it
                os.close(file)
        return self

    def __exit__(self, *_: object) -> None:
        self.path.unlink(missing_ok=True)  # before it is released
        os.close(self._file)
        self._file = -1

    def _take(self, file: int) -> None:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno not in _WOULD_WAIT:
                raise InputError(
                    f"cannot lock {self.path}: {error.strerror}; choose a folder on another disk"
                ) from None
            holder = os.pread(file, 80, 0).decode("utf-8", "replace").strip() or "its number is not known"
            raise InputError(
                f"{self.path.parent}: another study is writing there ({holder}); wait for it, or choose another folder"
            ) from None
        os.ftruncate(file, 0)
        os.pwrite(file, f"process {os.getpid()} on {os.uname().nodename}\n"[:80].encode(), 0)

    def _is_ours(self, file: int) -> bool:
        try:
            here = self.path.stat(follow_symlinks=False)
        except OSError:
            return False
        mine = os.fstat(file)
        return (here.st_dev, here.st_ino) == (mine.st_dev, mine.st_ino)
