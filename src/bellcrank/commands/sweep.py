"""`bellcrank sweep`: a table on screen; files with every design and a picture in a folder."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank.commands.options import (
    add_checkpoint_every,
    add_page,
    add_trust,
    checkpoint_every,
    list_on_failure,
    output_path,
    page_of,
    whole_option,
    written,
)
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import check_folder, default_place
from bellcrank.messages import unknown_name
from bellcrank.terminal.progress import counting

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene
    from bellcrank.studies.results.sweep_result import Sweep
    from bellcrank.studies.sweep_plan import SweepPlan


SAMPLE_FILES = ("indices.csv", "indices.json", "indices.png", "limits.png", "sweep.html")


def add_sample_arguments(parser: argparse.ArgumentParser) -> None:
    """What is asked of the sample."""
    parser.add_argument(
        "--sobol", metavar="N",
        help="find which parameters the spread of the measures comes from: first-order and total Sobol indices with "
        "their errors, from 16 scramblings of N Sobol points (a power of two), N x (parameters + 2) designs each",
    )  # fmt: skip
    parser.add_argument(
        "--limit", action="append", default=[], metavar="LIMIT", dest="limits",
        help="print the probability that a limit is exceeded with its 95 %% interval, such as 'lock.time > 13 s'; may "
        "be repeated; of a sample with --method random, or of at least 1024 designs, a multiple of 16",
    )  # fmt: skip
    add_page(
        parser,
        "a map of the designs, in which the one that is clicked moves, with distributions, probabilities and indices,",
        "sweep.html in DIR",
        "--report",
    )
    parser.add_argument(
        "--live", action="store_true",
        help="the page computes the design that is clicked, and those between, by sliders, instead of keeping motions",
    )  # fmt: skip


def check_limits(limits: Sequence[str], units: Mapping[str, str]) -> None:
    """Refuse a text that is not a limit of one of the measures, before anything is run (InputError)."""
    from bellcrank.studies.results.exceedance import parse_limit

    for limit in limits:
        parse_limit(limit, units)


def write_statistics(result: Sweep, arguments: argparse.Namespace, folder: Path, files: list[Path]) -> None:
    """Print and write what was asked for; the paths of files are added to `files`. Raises InputError."""
    from bellcrank.studies.designs.samples import SensitivitySample

    measures: Sequence[str] | None = arguments.measures or None
    indices = isinstance(result.space.sample, SensitivitySample)
    if indices:
        print(f"\nSobol indices with 95 % intervals:\n{result.sensitivity.table(measures)}")
        files.append(result.sensitivity.to_csv(folder / "indices.csv"))
        files.append(result.sensitivity.to_json(folder / "indices.json"))
    if arguments.limits:
        print("\nlimits:", *(result.statistics.exceedance(limit) for limit in arguments.limits), sep="\n")
    if indices and not arguments.no_plots:
        result.sensitivity.plot(folder / "indices.png", measures)
        files.append(folder / "indices.png")
    if arguments.limits and not arguments.no_plots:
        result.statistics.plot(folder / "limits.png", limits=arguments.limits)
        files.append(folder / "limits.png")
    page = page_of(arguments, folder / "sweep.html")
    if page is not None:
        from bellcrank.reports.study_report import write_study

        files.append(write_study(result, page, measures=measures, limits=arguments.limits, live=arguments.live))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The scene, what to vary, and where to write."""
    parser.add_argument(
        "scene", metavar="SCENE", help="a scene or robot configuration: a path, or a name that `bellcrank robots` lists"
    )
    parser.add_argument(
        "--vary", action="append", default=[], metavar="PATH=VALUES", dest="axes",
        help="vary a parameter of the scene, initial.JOINT or simulate.KEY: over equally spaced values "
        "(PATH=FIRST:LAST:COUNT), listed ones (PATH=A,B,C), or drawn ones (PATH='normal(MEAN, SD)', also uniform, "
        "truncnormal, triangular, loguniform); may be repeated for all combinations (default: the scene's study)",
    )  # fmt: skip
    parser.add_argument(
        "--size", action="store_true",
        help="size the motors over the configuration's motions instead of simulating; lengths, masses, payload.mass, "
        "actuators.JOINT.ratio, motions.NAME.duration and the like can then be varied too",
    )  # fmt: skip
    parser.add_argument(
        "--fastest", action="store_true",
        help="find the fastest motions along the paths of the configuration's motions instead",
    )  # fmt: skip
    parser.add_argument("--sample", metavar="N", help="number of designs that are drawn from the distributions")
    parser.add_argument(
        "--method", metavar="NAME", help="how they are drawn: sobol (default), latin (Latin hypercube) or random"
    )
    parser.add_argument("--seed", metavar="N", help="seed of the random numbers (default: 0)")
    add_sample_arguments(parser)
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="changes",
        help="change a value of the scene first, such as simulate.duration='20 s'; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--measure", action="append", default=[], metavar="NAME", dest="measures",
        help="a measure that the table and the picture show, such as lock.time; may be repeated (the files hold all)",
    )  # fmt: skip
    parser.add_argument("--threads", metavar="N", help="number of threads that run designs (default: the machine's)")
    parser.add_argument("--workers", metavar="N", help="run designs in N processes of a Dask cluster on this machine")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="run designs on the workers of a Dask scheduler")
    add_trust(parser)
    parser.add_argument(
        "--out", type=output_path, metavar="DIR", help="output folder (default: SCENE_sweep in the current folder)"
    )
    parser.add_argument(
        "--restart",
        action="store_true",
        help="set an unfinished sweep in the folder aside, instead of going on with it",
    )
    parser.add_argument("--no-plots", action="store_true", help="do not write a picture")
    add_checkpoint_every(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the designs. Exit code 0: at least one design finished (passes, where designs are sized); 1: none did; 130:
    interrupted. What was computed is written in any case. Raises BellcrankError for invalid input.
    """
    from bellcrank.studies.execution.executors import MOST_THREADS, MOST_WORKERS, choose_executor
    from bellcrank.studies.execution.study_folder import StudyFolder
    from bellcrank.studies.results.sweep_tables import NAMES, PARTIAL_NAMES, write_tables
    from bellcrank.studies.sweep import run_sweep
    from bellcrank.terminal import interruption

    folder = arguments.out or default_place(f"{Path(arguments.scene).stem}_sweep")
    threads = whole_option("--threads", arguments.threads, 1, MOST_THREADS)
    workers = whole_option("--workers", arguments.workers, 1, MOST_WORKERS)
    executor, every = choose_executor(threads, workers, arguments.scheduler), checkpoint_every(arguments)
    check_folder("--out", folder, [*NAMES, *PARTIAL_NAMES, "sweep.png", *SAMPLE_FILES])
    if page_of(arguments, folder / "sweep.html") is None and arguments.live:  # is refused before anything is computed
        raise InputError("--live says what the page does; give --page too")
    plan = _plan(arguments)
    check_limits(arguments.limits, plan.runner.units)
    study = StudyFolder(folder, restart=arguments.restart, notify=lambda text: print(f"note: {text}"))
    with study, counting("sweep", " designs") as bar, interruption.held() as check:

        def progress(done: float, count: float | None) -> None:
            check()
            bar(done, count)

        result = run_sweep(plan, executor, folder=study, progress=progress, checkpoint_every=every)
        try:
            files = write_tables(result, folder) if len(result) else []
        except InputError:
            print(result.table())  # at least on the screen
            raise
        if result.complete:
            study.remove_checkpoints()
    return _show(result, arguments, folder, files)


def _plan(arguments: argparse.Namespace) -> SweepPlan:
    """What the arguments ask for. Raises InputError."""
    from bellcrank.scene.study import MOST_POINTS
    from bellcrank.studies.designs.axes import parse_axis
    from bellcrank.studies.designs.samples import LARGEST_SEED
    from bellcrank.studies.sweep_plan import SampleRequest, planner

    vary: dict[str, Any] = {}
    for text in arguments.axes:
        path, values = parse_axis(text)
        if path in vary:
            raise InputError(f"--vary {text!r}: '{path}' is varied already")
        vary[path] = values
    sample = whole_option("--sample", arguments.sample, 1, MOST_POINTS)
    sobol = whole_option("--sobol", arguments.sobol, 2, MOST_POINTS)
    seed = whole_option("--seed", arguments.seed, 0, LARGEST_SEED)
    with counting("check", " values") as checking:
        plan, drawn = (
            planner("sweep", size=arguments.size, fastest=arguments.fastest),
            SampleRequest(sample, arguments.method, seed, sobol),
        )
        return plan(_scene(arguments), vary or None, drawn, checking)


def _scene(arguments: argparse.Namespace) -> Scene:
    from bellcrank.scene.overrides import parse_assignment
    from bellcrank.scene.scene import load_scene

    scene = load_scene(
        arguments.scene, dict(parse_assignment(text) for text in arguments.changes), trust=arguments.trust
    )
    if arguments.axes and scene.study.vary:
        print("note: --vary replaces what the scene varies under 'study'")
    return scene


def _show(result: Sweep, arguments: argparse.Namespace, folder: Path, files: list[Path]) -> int:
    """Print the table, write the picture; returns the exit code."""
    from bellcrank.studies.execution.run_outcomes import UNKNOWN
    from bellcrank.studies.results.sweep_tables import NAMES, file_note

    measures = arguments.measures or None
    unknown = [name for name in arguments.measures if name not in result.units]
    if unknown and files:  # after the files, so that results are not lost for a typing error
        raise InputError(
            f"--measure: {unknown_name('measure', unknown[0], result.units)}; all of them are in {files[0]}"
        )
    files = list(files)
    drawn = result.complete and not arguments.no_plots  # no picture after an interruption
    if (measures or result.default_measures) and files and drawn:
        with list_on_failure(files, folder):
            result.plot(folder / "sweep.png", measures)
        files.append(folder / "sweep.png")
    if len(result):
        print(result.table(measures))
    if len(result) and result.complete:
        with list_on_failure(files, folder):
            write_statistics(result, arguments, folder, files)
    unclear = int((result.status == UNKNOWN).sum())
    unknown_part = f", {unclear} unknown (see their reasons)" if unclear else ""
    failed = len(result) - result.finished - unclear
    did = ("pass", "do") if arguments.size else ("finished", "did")
    count = f"{len(result)}" if result.complete else f"{len(result)} of {len(result.space)}"
    print(f"\n{result.scene.name}: {count} designs, {result.finished} {did[0]}, {failed} {did[1]} not{unknown_part}")
    if result.check is not None:
        print(f"check: {result.check}")
    for note in (*result.not_known, *(note for note in result.notes if note.matter != "reached")):
        print(f"{note.label}: {note}")
    if result.space.sample is not None:
        print(f"sample: {result.space.sample.identity}")
        if result.space.sample.note:
            print(f"note: {result.space.sample.note}")
    print(f"{written(files, folder)}{file_note(result)}")
    if not result.complete:
        earlier = [name for name in NAMES if (folder / name).exists()]
        old = f"; {', '.join(earlier)} there: of an earlier sweep" if earlier else ""
        if arguments.page is not None:
            print("note: no page is written of an interrupted sweep")
        print(f"interrupted: {len(result)} of {len(result.space)} designs were run; the same command goes on{old}")
    known = result.finished and not result.not_known
    return (0 if known else 1) if result.complete else 130
