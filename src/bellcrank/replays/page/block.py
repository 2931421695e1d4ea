"""One compressed block of numbers: arrays in few bytes, each found again by what `Block.add…` returned.

Every array becomes 32-bit words: whole steps of a stated size, or the bits of float32. Along each column the words are
replaced by their first or second differences, whichever are smaller, the sign is folded into the lowest bit, and the
four bytes of the words are stored apart. What changes smoothly is then mostly zeros, which deflate takes away.
"""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

LARGEST = 2.0**31 - 1.0
SMALL_CHANGE = 1e-3  # of a value: float32 has seven digits, of which the change is to have four
LEVEL = 6  # of zlib: a higher one takes twice the time for 1 % of the size
Reference = dict[str, Any]


class Block:
    """Arrays gathered into one block; the same array is stored once."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        self._known: dict[bytes, Reference] = {}

    def add_steps(self, values: ArrayLike, step: float) -> Reference:
        """Store finite values (n, …) to within half a `step`; as float32 where that takes more than 32 bits."""
        table = _table(values)
        if table.size and np.abs(table).max() > LARGEST * step:
            return self.add_floats(values)
        return self._add(np.rint(table / step).astype(np.int32), step)

    def add_floats(self, values: ArrayLike) -> Reference:
        """Store values (n, …) as float32, NaN and infinities included; what is beyond its range becomes infinite."""
        with np.errstate(over="ignore"):
            return self._add(np.ascontiguousarray(_table(values), dtype=np.float32).view(np.int32), 0.0)

    def add_values(self, values: ArrayLike) -> Reference:
        """Store values (n,) as `add_floats` does, by how far they are from their middle where they change by little of
        themselves, so that float32 has the digits of the change.
        """
        table = _table(values)
        some = table[np.isfinite(table)]
        middle = 0.5 * (float(some.min()) + float(some.max())) if some.size else 0.0
        if not some.size or not np.isfinite(middle) or np.ptp(some) >= SMALL_CHANGE * abs(middle):
            return self.add_floats(table)
        return {**self.add_floats(table - middle), "from": middle}

    def add_times(self, times: ArrayLike) -> Reference:
        """Store finite times (n,) to within 1e-9 of their span."""
        table = _table(times)
        begin = float(table.min()) if table.size else 0.0  # times since 1970 differ by little of themselves
        table = table - begin
        return {**self.add_steps(table, (table.max() if table.size else 0.0) * 2.0**-30 or 1.0), "from": begin}

    def add_integers(self, values: ArrayLike) -> Reference:
        """Store whole numbers (n, …) of at most 32 bits."""
        return self._add(_table(values).astype(np.int32), 1.0)

    def text(self) -> str:
        """Everything, deflated (zlib), in base64."""
        return compressed(b"".join(self._parts))

    def _add(self, words: NDArray[np.int32], step: float) -> Reference:
        order, folded = _smallest_differences(words)
        planes = np.ascontiguousarray(folded.T).reshape(-1).view(np.uint8).reshape(-1, 4).T.tobytes()
        key = planes + repr((words.shape, order, step)).encode()
        if key not in self._known:
            rows, columns = words.shape
            self._known[key] = {"at": self._size, "rows": rows, "columns": columns, "order": order, "step": step}
            self._parts.append(planes)
            self._size += len(planes)
        return self._known[key]


def compressed(data: bytes) -> str:
    """Bytes, deflated (zlib), in base64."""
    return base64.b64encode(zlib.compress(data, LEVEL)).decode("ascii")


def _table(values: ArrayLike) -> NDArray[Any]:
    table = np.asarray(values)
    return table.reshape(len(table), int(np.prod(table.shape[1:])))


def _smallest_differences(words: NDArray[np.int32]) -> tuple[int, NDArray[np.uint32]]:
    """The order, 1 or 2, of the differences along columns that take fewer bits, and these, the sign folded in."""
    best: tuple[float, int, NDArray[np.uint32]] | None = None
    difference = words
    for order in (1, 2):
        difference = np.diff(difference, axis=0, prepend=np.int32(0))  # wraps around, and so does the way back
        folded = ((difference << 1) ^ (difference >> 31)).view(np.uint32)
        bits = float(np.log2(1.0 + folded).sum())
        if best is None or bits < best[0]:
            best = (bits, order, folded)
    assert best is not None
    return best[1], best[2]
