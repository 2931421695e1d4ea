"""What results write, as texts."""

from __future__ import annotations

import tempfile
from pathlib import Path

import bellcrank as bc


def csv_text(result: bc.results.Result) -> str:
    """The text that `to_csv` writes."""
    with tempfile.TemporaryDirectory() as folder:
        return result.to_csv(Path(folder) / "result.csv").read_text(encoding="utf-8")
