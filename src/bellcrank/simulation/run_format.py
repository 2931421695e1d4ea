"""The container of a saved run: an .npz file with a JSON text, `about`, and float64 arrays."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.files.atomic_write import writing
from bellcrank.terminal import interruption
from bellcrank.text import utf8

Array = NDArray[np.float64]


def run_path(path: str | Path) -> Path:
    """The path of a run's file, with its suffix."""
    target = Path(path)
    return target if target.suffix == ".npz" else target.with_name(target.name + ".npz")


def write_archive(target: Path, about: dict[str, Any], arrays: dict[str, Array], lasting: bool = False) -> None:
    """Write a JSON text and arrays to an .npz file, atomically. `lasting`: it survives a power cut. Raises InputError."""
    text = np.frombuffer(utf8(json.dumps(about, ensure_ascii=False)), dtype=np.uint8)
    contents: dict[str, Any] = {"about": text, **arrays}
    with interruption.unbroken(), writing(target, lasting) as temporary, temporary.open("wb") as file:
        np.savez(file, **contents)
