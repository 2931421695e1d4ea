"""Writing results of planning: JSON of what `as_dict` gives, and pictures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank import arguments
from bellcrank.files import atomic_write, json_files
from bellcrank.plot_style import DPI, save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_json(content: Mapping[str, Any], path: str | Path) -> Path:
    """Write data as JSON and return the path. Raises InputError where the file cannot be written."""
    return json_files.write_json(arguments.path("path", path), content, indent=2)


def write_figure(figure: Figure, path: str | Path) -> Path:
    """Write a figure as PNG and return the path. Raises InputError where the file cannot be written."""
    target = arguments.path("path", path)
    with atomic_write.writing(target) as temporary:
        save_figure(figure, temporary, "png", dpi=DPI)
    return target
