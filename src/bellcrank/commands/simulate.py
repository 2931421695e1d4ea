"""`bellcrank simulate`: the summary on screen; run.npz, run.csv and pictures in a folder."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank.commands.options import number_option, whole_option
from bellcrank.commands.trust import add_trust
from bellcrank.commands.written import telling, write_each
from bellcrank.errors import InputError, NotSavedError
from bellcrank.files.atomic_write import check_folder, default_place
from bellcrank.terminal.progress import bars

if TYPE_CHECKING:
    from collections.abc import Callable

    from bellcrank.simulation.trajectory import Trajectory


CSV_ROWS = 1_000_000  # of more, run.csv is written where it is asked for: it takes about 200 bytes a row and minutes
INTERRUPTED_ROWS = 20_000  # of a run that a signal cut short: a second of writing


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The scene, what to change in it, and where to write."""
    parser.add_argument(
        "scene", metavar="SCENE", help="a scene or robot configuration: a path, or a name (see bellcrank robots)"
    )
    parser.add_argument("--duration", metavar="S", help="how long to simulate, s")
    parser.add_argument("--solver", metavar="NAME", help="DOP853, RK45, Radau (stiff) or RK4 (fixed step)")
    parser.add_argument("--rtol", metavar="X", help="relative tolerance of every position and velocity")
    parser.add_argument("--atol", metavar="X", help="absolute tolerance (rad, m, rad/s, m/s)")
    parser.add_argument("--step", metavar="S", help="a fixed step, s, instead of tolerances")
    parser.add_argument("--samples", metavar="N", help="rows of the result, equally spaced in time")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="changes",
        help="change the scene, such as initial.shoulder='10 deg'; may be repeated",
    )  # fmt: skip
    add_trust(parser)
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder for the files (default: SCENE_run, here)")
    parser.add_argument(
        "--csv", action="store_true", help=f"write run.csv also where the run has more than {CSV_ROWS} rows"
    )
    parser.add_argument("--no-plots", action="store_true", help="write no pictures")
    parser.add_argument(
        "--frame", action="append", default=[], metavar="NAME", help="draw the path of this frame too; may be repeated"
    )
    parser.add_argument(
        "--error-estimate",
        action="store_true",
        help="say how far positions may be off, by repeated runs, even where these take more than a second",
    )
    add_keep_every(parser)


def add_keep_every(parser: argparse.ArgumentParser) -> None:
    """The option that says how often what is computed so far is written."""
    parser.add_argument(
        "--keep-every", metavar="S", help="write what is computed so far about every S seconds of computing (default 5)"
    )


def keep_every(arguments: argparse.Namespace) -> float:
    """The seconds of computing after which what there is is written. Raises InputError."""
    from bellcrank.simulation.checkpoints import KEEP_EVERY, LONGEST_KEEP

    seconds = number_option("--keep-every", arguments.keep_every, "s", above=0.0, most=LONGEST_KEEP)
    return KEEP_EVERY if seconds is None else seconds


def run(arguments: argparse.Namespace) -> int:
    """Simulate a scene; 0 where it came to its end, 1 where it did not or is warned of, 130 where it was interrupted;
    what was computed is written in any case. BellcrankError for bad input.
    """
    from bellcrank.scene.overrides import parse_assignment
    from bellcrank.scene.scene import load_scene
    from bellcrank.scene.settings import check_rows
    from bellcrank.simulation.checkpoints import checkpoint_folder, set_aside
    from bellcrank.simulation.scene_notes import scene_notes
    from bellcrank.simulation.simulate import simulate
    from bellcrank.simulation.status import Status
    from bellcrank.terminal import interruption

    numbers: dict[str, Any] = {
        key: number_option(f"--{key}", getattr(arguments, key), unit, above=0.0) for key, unit in _NUMBERS.items()
    }
    samples = whole_option("--samples", arguments.samples, 2, 10**18)
    changes = dict(parse_assignment(text) for text in arguments.changes)
    folder = arguments.out or default_place(f"{Path(arguments.scene).stem}_run")
    target, every = folder / "run.npz", keep_every(arguments)
    check_folder("--out", folder, [target.name, "run.csv", "run.png", "path_*.png"])
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
        print(f"note: an earlier run into {folder} did not come to its end; what there is of it is now {unfinished}")
    with interruption.held() as check, simulated_bar(duration) as bar:

        def progress(time: float) -> None:
            check()
            bar(time)

        try:
            result = simulate(
                scene, solver=arguments.solver, samples=samples, progress=progress, keep=target, keep_every=every,
                **numbers,
            )  # fmt: skip
        except NotSavedError as error:
            print(error.run.summary())
            raise
        bar(float(result.time[-1]))
    files, most = [target], CSV_ROWS
    if result.status is Status.INTERRUPTED:  # who asks to stop waits for no picture and no long table
        most, arguments.no_plots, arguments.frame = INTERRUPTED_ROWS, True, []
    wanted_csv = arguments.csv or len(result) <= most
    arguments.csv = wanted_csv
    with telling(files, folder):
        if arguments.error_estimate and result.success:
            write_each(files, _others(result, folder, arguments))
            result.error_estimate()  # told in the summary; the run itself is safe by now
            result.save(target)
        print(result.summary())
        if result.known_estimate is not None and not arguments.error_estimate:
            result.save(target)  # with the estimate, which the summary made
        for note in scene_notes(scene, result.settings.duration):
            print(f"  note: {note}")
        if len(files) == 1:
            write_each(files, _others(result, folder, arguments))
    print(f"\nwrote {', '.join(path.name for path in files)} in {folder}")
    if not wanted_csv:
        print(_no_csv(result, folder, most))
    if result.status is Status.INTERRUPTED:
        return 130
    return 1 if result.warnings else 0


def _others(
    result: Trajectory, folder: Path, arguments: argparse.Namespace
) -> Iterator[tuple[Path, Callable[[Path], object]]]:
    """The files beside run.npz, and what writes each."""
    from bellcrank.sizing.history import file_name

    def csv(path: Path) -> None:
        with _row_bar(len(result)) as progress:
            result.to_csv(path, progress)

    if arguments.csv:
        yield folder / "run.csv", csv
    if not arguments.no_plots:
        from bellcrank.simulation.run_plot import plot_run

        yield folder / "run.png", partial(plot_run, result)
        for frame in arguments.frame:
            yield folder / f"path_{file_name(frame)}.png", partial(plot_run, result, frame=frame)


_COPIES = 4  # of the states, at most, that writing, summary and pictures hold, a block of rows at a time


def _no_csv(result: Trajectory, folder: Path, most: int) -> str:
    """That the run was not written as CSV, and how to have it."""
    text = f"run.csv was not written: the run has {len(result)} rows, more than {most}; --csv writes it all the same"
    text += f", and load_run('{folder / 'run.npz'}').to_csv('run.csv') later"
    return text + (f" (the run.csv in {folder} is an earlier run's)" if (folder / "run.csv").exists() else "")


_NUMBERS = {"duration": "s", "rtol": "", "atol": "", "step": "s"}


def _check_frames(robot: Any, frames: list[str]) -> None:
    from bellcrank.messages import unknown_name

    for frame in frames:
        if frame not in robot.frame_names:
            raise InputError(f"--frame: {unknown_name('frame', frame, robot.frame_names)}")


@contextmanager
def simulated_bar(duration: float) -> Iterator[Callable[[float], None]]:
    """A progress bar over the simulated time, which shows itself after a second; yields what to call with the time."""
    layout = "{l_bar}{bar}| {n:.5g}/{total:g} s simulated [{elapsed}<{remaining}]"
    with bars()(total=duration, desc="simulate", delay=1.0, disable=None, bar_format=layout) as bar:

        def progress(time: float) -> None:
            bar.update(min(time, duration) - bar.n)

        yield progress


@contextmanager
def _row_bar(rows: int) -> Iterator[Callable[[int], None]]:
    """A progress bar over rows that are written, which shows itself after a second; yields what to call with them."""
    from tqdm import tqdm

    with tqdm(total=rows, desc="run.csv", unit=" rows", unit_scale=True, delay=1.0, disable=None) as bar:

        def progress(done: int) -> None:
            bar.update(done - bar.n)

        yield progress
