"""`bellcrank plot`: a run, a scene or a sizing as PNG."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank.commands.shown import add_shown, shown, stem, verdict_of
from bellcrank.files.atomic_write import check_file, default_place

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory import Trajectory
    from bellcrank.sizing.result import Sizing


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to draw, and where to write."""
    add_shown(parser)
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="the picture of a run, PNG, PDF or SVG (default: RUN.png)"
    )
    parser.add_argument(
        "--frame", action="append", default=[], metavar="NAME", help="draw this frame's path instead; may be repeated"
    )


def run(arguments: argparse.Namespace) -> int:
    """Draw; 0 where the answer is yes, 1 where it is no. BellcrankError for bad input."""
    from bellcrank.sizing.result import Sizing

    out = arguments.out or default_place(f"{stem(arguments.run)}.png")
    check_file("--out", out)
    thing = shown(arguments)
    files = _sizing_files(thing, out) if isinstance(thing, Sizing) else _run_files(thing, out, arguments.frame)
    well, verdict = verdict_of(thing)
    print(f"{verdict}\nwrote {', '.join(map(str, files))}")
    return 0 if well else 1


def _run_files(run: Trajectory, out: Path, frames: list[str]) -> list[Path]:
    from bellcrank.simulation.run_plot import plot_run
    from bellcrank.sizing.history import file_name

    if not frames:
        plot_run(run, out)
        return [out]
    files = [out.with_stem(f"{out.stem}_{file_name(frame)}") for frame in frames]
    for frame, path in zip(frames, files, strict=True):
        plot_run(run, path, frame)
    return files


def _sizing_files(sizing: Sizing, out: Path) -> list[Path]:
    """A picture for each motion, and the torque-speed planes, named after `out`."""
    from bellcrank.files.atomic_write import writing
    from bellcrank.plot_style import DPI, save_figure
    from bellcrank.sizing.plots import draw

    assert sizing.study is not None
    robot, motions, drives = sizing.study
    files = []
    for name, figure in draw(robot, motions, drives, sizing.robot, sizing.mass_tolerance).items():
        files.append(out.with_name(f"{out.stem}_{name}"))
        with writing(files[-1]) as temporary:
            save_figure(figure, temporary, "png", dpi=DPI)
    return files
