"""`bellcrank simulate`: a summary on screen; run.npz, run.csv and pictures in a folder."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank.arguments import Progress
from bellcrank.commands.options import (
    add_checkpoint_every,
    add_page,
    add_set,
    add_trust,
    checkpoint_every,
    list_on_failure,
    number_option,
    output_path,
    page_of,
    whole_option,
    write_each,
    written,
)
from bellcrank.errors import InputError, NotSavedError
from bellcrank.files.atomic_write import check_folder, default_place
from bellcrank.terminal.progress import bars

if TYPE_CHECKING:
    from collections.abc import Callable

    from bellcrank.simulation.trajectory.trajectory import Trajectory


CSV_ROWS = 1_000_000  # with more, run.csv needs --csv: it takes about 200 bytes a row, and minutes
INTERRUPTED_ROWS = 20_000  # of an interrupted run: a second of writing


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The scene, what to change in it, and where to write."""
    parser.add_argument(
        "scene", metavar="SCENE", help="a scene or robot configuration: a path, or a name that `bellcrank robots` lists"
    )
    parser.add_argument("--duration", metavar="S", help="simulated time, s")
    parser.add_argument(
        "--solver",
        metavar="NAME",
        help="DOP853, RK45, Radau (for stiff scenes), auto (DOP853 or Radau) or RK4 (fixed step)",
    )
    parser.add_argument("--rtol", metavar="X", help="relative tolerance of positions and velocities")
    parser.add_argument(
        "--atol", metavar="X", help="absolute tolerance of positions and velocities (rad, m, rad/s, m/s)"
    )
    parser.add_argument("--step", metavar="S", help="fixed step, s, instead of tolerances")
    parser.add_argument("--samples", metavar="N", help="number of rows of the result, equally spaced in time")
    add_set(parser, "initial.shoulder='10 deg'")
    add_trust(parser)
    parser.add_argument(
        "--out", type=output_path, metavar="DIR", help="output folder (default: SCENE_run in the current folder)"
    )
    parser.add_argument(
        "--csv", action="store_true", help=f"write run.csv even if the run has more than {CSV_ROWS} rows"
    )
    parser.add_argument("--no-plots", action="store_true", help="do not write pictures")
    add_page(parser, "the report of the run", "report.html in DIR")
    parser.add_argument(
        "--frame", action="append", default=[], metavar="NAME", help="also draw the path of this frame; may be repeated"
    )
    parser.add_argument(
        "--sensitivity", action="append", default=[], metavar="NAME",
        help="also write the derivatives of the run by a parameter of the scene, initial.JOINT or "
        "initial.velocity.JOINT, as sensitivities.csv and sensitivities.npz; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--error-estimate",
        action="store_true",
        help="estimate the error of positions by repeated runs, even if these take more than a second",
    )
    add_checkpoint_every(parser)


def run(arguments: argparse.Namespace) -> int:
    """Simulate a scene. Exit code 0: finished; 1: ended early, or there are warnings; 130: interrupted. What was
    computed is written in any case. Raises BellcrankError for invalid input.
    """
    from bellcrank.scene.overrides import parse_assignment
    from bellcrank.scene.scene import load_scene
    from bellcrank.scene.settings import check_rows
    from bellcrank.simulation.files.checkpoints import checkpoint_folder, set_aside
    from bellcrank.simulation.integration.statistics import Status
    from bellcrank.simulation.simulate import simulate
    from bellcrank.terminal import interruption

    numbers: dict[str, Any] = {
        key: number_option(f"--{key}", getattr(arguments, key), unit, above=0.0) for key, unit in _NUMBERS.items()
    }
    samples = whole_option("--samples", arguments.samples, 2, 10**18)
    changes = dict(parse_assignment(text) for text in arguments.changes)
    folder = arguments.out or default_place(f"{Path(arguments.scene).stem}_run")
    target, every = folder / "run.npz", checkpoint_every(arguments)
    page_of(arguments, folder / "report.html")
    check_folder("--out", folder, [target.name, "run.csv", "run.png", "path_*.png", "sensitivities.*", "report.html"])
    scene = load_scene(arguments.scene, trust=arguments.trust)
    if changes:
        scene = scene.with_overrides(changes)
    _check_frames(scene.robot, arguments.frame)
    try:
        check_rows(scene.settings.samples if samples is None else samples, scene.robot.nq + scene.robot.nv, _COPIES)
    except InputError as error:
        raise InputError(f"{'simulate.samples' if samples is None else '--samples'}: {error}") from None
    duration = scene.settings.duration if numbers["duration"] is None else numbers["duration"]
    unfinished = set_aside(checkpoint_folder(target))
    if unfinished is not None:
        print(f"note: an earlier run into {folder} did not finish; its partial results are now in {unfinished}")
    with interruption.held() as check, simulation_progress(duration) as bar:

        def progress(time: float, _: float | None) -> None:
            check()
            bar(time)

        try:
            result = simulate(
                scene, solver=arguments.solver, samples=samples, progress=progress, checkpoint=target,
                checkpoint_every=every, sensitivities=arguments.sensitivity, **numbers,
            )  # fmt: skip
        except NotSavedError as error:
            print(error.run.table())
            raise
        bar(float(result.time[-1]))
    files, most = [target], CSV_ROWS
    if result.status is Status.INTERRUPTED:  # no pictures and no long table after an interruption
        if arguments.page is not None:
            print("note: no page is written of an interrupted run; `bellcrank report` writes one")
        most, arguments.no_plots, arguments.frame, arguments.page = INTERRUPTED_ROWS, True, [], None
    wanted_csv = arguments.csv or len(result) <= most
    arguments.csv = wanted_csv
    with list_on_failure(files, folder):
        if arguments.error_estimate and result.success:
            write_each(files, _others(result, folder, arguments))
            result.error_estimate()  # part of the summary; the run itself is saved by now
            result.save(target)
        print(result.table())
        if result.known_estimate is not None and not arguments.error_estimate:
            result.save(target)  # with the estimate, which the summary made
        for name in result.sensitivities:
            for text in result.sensitivity(name).notes:
                print(f"  note: sensitivity by {name}: {text}")
        if len(files) == 1:
            write_each(files, _others(result, folder, arguments))
    print(f"\n{written(files, folder)}")
    if not wanted_csv:
        print(_no_csv(result, folder, most))
    if result.status is Status.INTERRUPTED:
        return 130
    return 1 if result.warnings else 0


def _others(
    result: Trajectory, folder: Path, arguments: argparse.Namespace
) -> Iterator[tuple[Path, Callable[[Path], object]]]:
    """The files beside run.npz, and a function that writes each."""
    from bellcrank.messages import file_name

    def csv(path: Path) -> None:
        with _row_bar(len(result)) as progress:
            result.to_csv(path, progress)

    if arguments.csv:
        yield folder / "run.csv", csv
    if result.sensitivities:
        from bellcrank.simulation.files.run_csv import write_npz, write_sensitivities_csv

        found = [result.sensitivity(name) for name in result.sensitivities]
        yield folder / "sensitivities.csv", partial(write_sensitivities_csv, found)
        yield folder / "sensitivities.npz", partial(write_npz, found)
    if not arguments.no_plots:
        from bellcrank.simulation.trajectory.run_plot import plot_run

        yield folder / "run.png", partial(plot_run, result)
        for frame in arguments.frame:
            yield folder / f"path_{file_name(frame)}.png", partial(plot_run, result, frame=frame)
    page = page_of(arguments, folder / "report.html")
    if page is not None:
        from bellcrank.reports.report import report

        yield page, partial(report, result)


_COPIES = 4  # of the states, at most, that writing, summary and pictures hold in memory


def _no_csv(result: Trajectory, folder: Path, most: int) -> str:
    """A sentence that run.csv was not written, and how to write it."""
    text = f"run.csv was not written: the run has {len(result)} rows, more than {most}; write it with --csv"
    text += f", or later with load_run('{folder / 'run.npz'}').to_csv('run.csv')"
    return text + (f" (the run.csv in {folder} belongs to an earlier run)" if (folder / "run.csv").exists() else "")


_NUMBERS = {"duration": "s", "rtol": "", "atol": "", "step": "s"}


def _check_frames(robot: Any, frames: list[str]) -> None:
    from bellcrank.messages import unknown_name

    for frame in frames:
        if frame not in robot.frame_names:
            raise InputError(f"--frame: {unknown_name('frame', frame, robot.frame_names)}")


@contextmanager
def simulation_progress(duration: float) -> Iterator[Callable[[float], None]]:
    """A progress bar over the simulated time, shown after a second; yields a function to call with the time, s."""
    layout = "{l_bar}{bar}| {n:.5g}/{total:g} s simulated [{elapsed}<{remaining}]"
    with bars()(total=duration, desc="simulate", bar_format=layout) as bar:

        def progress(time: float) -> None:
            bar.update(min(time, duration) - bar.n)

        yield progress


@contextmanager
def _row_bar(rows: int) -> Iterator[Progress]:
    """A progress bar over written rows, shown after a second; yields a function to call with their number."""
    with bars()(total=rows, desc="run.csv", unit=" rows", unit_scale=True) as bar:

        def progress(done: float, _: float | None) -> None:
            bar.update(done - bar.n)

        yield progress
