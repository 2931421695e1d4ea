"""`bellcrank plot`: pictures of a run, a scene, a sizing or a selection."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank.commands.options import output_path
from bellcrank.commands.result_argument import add_result_argument, compute_or_load, stem, verdict_of
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import check_file, default_place

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory.trajectory import Trajectory
    from bellcrank.sizing.result import Sizing
    from bellcrank.sizing.selection.selection import Selection


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to draw, and where to write."""
    add_result_argument(parser)
    parser.add_argument(
        "--out",
        type=output_path,
        metavar="FILE",
        help="picture of a run: PNG, PDF or SVG; pictures of a sizing are PNG, named after it (default: RUN.png in the "
        "current folder)",
    )
    parser.add_argument(
        "--frame",
        action="append",
        default=[],
        metavar="NAME",
        help="of a run, draw the path of this frame instead; may be repeated",
    )


def run(arguments: argparse.Namespace) -> int:
    """Draw. Exit code 0 or 1 as `verdict_of` says. Raises BellcrankError for invalid input."""
    from bellcrank.sizing.result import Sizing
    from bellcrank.sizing.selection.selection import Selection

    out = arguments.out or default_place(f"{stem(arguments.run)}.png")
    check_file("--out", out)
    result = compute_or_load(arguments)
    if isinstance(result, (Sizing, Selection)):
        if arguments.frame:
            kind = "sizing" if isinstance(result, Sizing) else "selection"
            raise InputError(f"--frame is for a run, and this is a {kind}; leave it out, or add --simulate")
        files = _figure_files(result, out)
    else:
        files = _run_files(result, out, arguments.frame)
    success, verdict = verdict_of(result)
    print(f"{verdict}\nwrote {', '.join(map(str, files))}")
    return 0 if success else 1


def _run_files(run: Trajectory, out: Path, frames: list[str]) -> list[Path]:
    """One picture of everything over time, or one for the path of each frame."""
    from bellcrank.messages import file_name
    from bellcrank.simulation.trajectory.run_plot import plot_run

    if not frames:
        plot_run(run, out)
        return [out]
    files = [out.with_stem(f"{out.stem}_{file_name(frame)}") for frame in frames]
    for frame, path in zip(frames, files, strict=True):
        plot_run(run, path, frame)
    return files


def _figure_files(result: Sizing | Selection, out: Path) -> list[Path]:
    """All pictures of a sizing or selection, named after `out`."""
    from bellcrank.files.atomic_write import writing
    from bellcrank.present.plot_style import DPI, save_figure
    from bellcrank.sizing.plots import sizing_figures
    from bellcrank.sizing.result import Sizing
    from bellcrank.sizing.selection.plots import selection_figures

    files = []
    figures = sizing_figures(result) if isinstance(result, Sizing) else selection_figures(result)
    for name, figure in figures.items():
        files.append(out.with_name(f"{out.stem}_{name}"))
        with writing(files[-1]) as temporary:
            save_figure(figure, temporary, "png", dpi=DPI)
    return files
