"""Arrays in one compressed block of bytes, each with a reference by which the page's decode.js finds it.

Every array becomes 32-bit words: multiples of a given step, or the bits of float32. Along each column the words are
replaced by their first or second differences, whichever are smaller; the sign is folded into the lowest bit, and the
four bytes of the words are stored apart. Smooth data are then mostly zeros, which deflate removes.
"""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

LARGEST = 2.0**31 - 1.0
SMALL_CHANGE = 1e-3  # of a value: float32 has seven digits, of which the change needs four
LEVEL = 6  # of zlib: a higher one takes twice the time for 1 % of the size
ArrayReference = dict[str, Any]  # as it stands in the page's JSON


class ArrayEncoder:
    """Collects arrays in one block; equal arrays are stored once."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        self._known: dict[bytes, ArrayReference] = {}

    def add_fixed_point(self, values: ArrayLike, step: float) -> ArrayReference:
        """Store finite values (n, …) within half a `step`; as float32 if that takes more than 32 bits."""
        table = _table(values)
        if table.size and np.abs(table).max() > LARGEST * step:
            return self.add_floats(values)
        return self._add(np.rint(table / step).astype(np.int32), step)

    def add_floats(self, values: ArrayLike) -> ArrayReference:
        """Store values (n, …) as float32, including NaN and infinities; values beyond its range become infinite."""
        with np.errstate(over="ignore"):
            return self._add(np.ascontiguousarray(_table(values), dtype=np.float32).view(np.int32), 0.0)

    def add_centred_floats(self, values: ArrayLike) -> ArrayReference:
        """Store values (n,) as float32, as differences from their centre if they change by little relative to it."""
        table = _table(values)
        some = table[np.isfinite(table)]
        middle = 0.5 * (float(some.min()) + float(some.max())) if some.size else 0.0
        if not some.size or not np.isfinite(middle) or np.ptp(some) >= SMALL_CHANGE * abs(middle):
            return self.add_floats(table)
        return {**self.add_floats(table - middle), "base": middle}

    def add_times(self, times: ArrayLike) -> ArrayReference:
        """Store finite times (n,) within 1e-9 of their span."""
        table = _table(times)
        begin = float(table.min()) if table.size else 0.0  # times since 1970 change by little relative to their size
        table = table - begin
        return {**self.add_fixed_point(table, (table.max() if table.size else 0.0) * 2.0**-30 or 1.0), "base": begin}

    def add_integers(self, values: ArrayLike) -> ArrayReference:
        """Store integers (n, …) of at most 32 bits."""
        return self._add(_table(values).astype(np.int32), 1.0)

    def text(self) -> str:
        """The block, deflated (zlib), in base64."""
        return deflate_base64(b"".join(self._parts))

    def _add(self, words: NDArray[np.int32], step: float) -> ArrayReference:
        order, folded = _smallest_differences(words)
        planes = np.ascontiguousarray(folded.T).reshape(-1).view(np.uint8).reshape(-1, 4).T.tobytes()
        key = planes + repr((words.shape, order, step)).encode()
        if key not in self._known:
            rows, columns = words.shape
            self._known[key] = {"offset": self._size, "rows": rows, "columns": columns, "order": order, "step": step}
            self._parts.append(planes)
            self._size += len(planes)
        return self._known[key]


def deflate_base64(data: bytes) -> str:
    """Bytes, deflated (zlib), in base64."""
    return base64.b64encode(zlib.compress(data, LEVEL)).decode("ascii")


def _table(values: ArrayLike) -> NDArray[Any]:
    table = np.asarray(values)
    return table.reshape(len(table), int(np.prod(table.shape[1:])))


def _smallest_differences(words: NDArray[np.int32]) -> tuple[int, NDArray[np.uint32]]:
    """The order, 1 or 2, of the differences along columns that take fewer bits; and these, with the sign folded in."""
    best: tuple[float, int, NDArray[np.uint32]] | None = None
    difference = words
    for order in (1, 2):
        difference = np.diff(difference, axis=0, prepend=np.int32(0))  # wraps around; decoding does, too
        folded = ((difference << 1) ^ (difference >> 31)).view(np.uint32)
        bits = float(np.log2(1.0 + folded).sum())
        if best is None or bits < best[0]:
            best = (bits, order, folded)
    assert best is not None
    return best[1], best[2]
