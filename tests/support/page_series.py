"""What a page carries, decoded as its decode.js does, for tests."""

import base64
import json
import re
import zlib

import numpy as np


def decoded(text):
    """The film of a page's HTML text (or of encode_film's two texts), with arrays for references to its block."""
    if isinstance(text, str):
        film, block = (re.search(rf'id="{name}"[^>]*>([^<]*)<', text)[1] for name in ("film", "arrays"))
    else:
        film, block = text
    data = np.frombuffer(zlib.decompress(base64.b64decode(block)), dtype=np.uint8)

    def read(value):
        if isinstance(value, list):
            return [read(each) for each in value]
        if isinstance(value, dict):
            return _array(data, **value) if "offset" in value else {key: read(each) for key, each in value.items()}
        return value

    return read(json.loads(film))


def _array(data, offset, rows, columns, order, step, base=0.0):
    size = rows * columns
    planes = data[offset : offset + 4 * size].reshape(4, size).astype(np.uint32)
    folded = planes[0] | planes[1] << 8 | planes[2] << 16 | planes[3] << 24
    words = (folded >> 1).astype(np.int32) ^ -(folded & 1).astype(np.int32)
    words = words.reshape(columns, rows)
    with np.errstate(over="ignore"):
        for _ in range(order):
            words = np.cumsum(words, axis=1, dtype=np.int32)
    words = np.ascontiguousarray(words.T)
    values = words.view(np.float32).astype(float) if step == 0 else words * step
    values = values + base
    return values[:, 0] if columns == 1 else values


def value_at(line, t):
    """What the page reads off a line at times t: straight between its times, of two of one time the later."""
    time, values = line["time"], line["values"]
    k = np.clip(np.searchsorted(time, t, side="right") - 1, 0, len(time) - 2)
    span = time[k + 1] - time[k]
    share = np.clip(np.divide(t - time[k], span, out=np.zeros(len(t)), where=span > 0.0), 0.0, 1.0)
    a, b = values[k], values[k + 1]
    return np.where(share < 1e-6, a, np.where(share > 1 - 1e-6, b, a + share * (b - a)))
