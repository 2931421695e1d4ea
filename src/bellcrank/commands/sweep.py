"""`bellcrank sweep`: a table on screen; sweep.csv, sweep.json and a picture in a folder."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from bellcrank.commands.options import add_keep_every, add_trust, keep_every, whole_option
from bellcrank.commands.output_files import list_on_failure
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import check_folder, default_place
from bellcrank.messages import unknown_name
from bellcrank.terminal.progress import counting


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The scene, what to vary, and where to write."""
    parser.add_argument(
        "scene", metavar="SCENE", help="a scene or robot configuration: a path, or a name that `bellcrank robots` lists"
    )
    parser.add_argument(
        "--vary", action="append", required=True, metavar="PATH=FIRST:LAST:COUNT", dest="axes",
        help="vary a parameter of the scene, initial.JOINT or simulate.KEY over equally spaced values, or over listed "
        "ones with PATH=A,B,C; may be repeated for all combinations",
    )  # fmt: skip
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="changes",
        help="change a value of the scene first, such as simulate.duration='20 s'; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--measure", action="append", default=[], metavar="NAME", dest="measures",
        help="a measure that the table and the picture show, such as lock.time; may be repeated (the files hold all)",
    )  # fmt: skip
    parser.add_argument(
        "--threads", metavar="N", help="number of designs that run at the same time (default: the machine's threads)"
    )
    add_trust(parser)
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="output folder (default: SCENE_sweep in the current folder)"
    )
    parser.add_argument("--no-plots", action="store_true", help="do not write a picture")
    add_keep_every(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the designs. Exit code 0: at least one design finished; 1: none did; 130: interrupted. What was computed is
    written in any case. Raises BellcrankError for invalid input.
    """
    from bellcrank.scene.overrides import parse_assignment
    from bellcrank.scene.scene import load_scene
    from bellcrank.studies.axes import parse_axis
    from bellcrank.studies.sweep import MOST_THREADS, sweep
    from bellcrank.studies.sweep_result import UNKNOWN
    from bellcrank.studies.sweep_tables import PartialTables
    from bellcrank.terminal import interruption

    vary = {}
    for text in arguments.axes:
        path, values = parse_axis(text)
        if path in vary:
            raise InputError(f"--vary {text!r}: '{path}' is varied already")
        vary[path] = values
    threads = whole_option("--threads", arguments.threads, 1, MOST_THREADS)
    changes = dict(parse_assignment(text) for text in arguments.changes)
    folder = arguments.out or default_place(f"{Path(arguments.scene).stem}_sweep")
    every = keep_every(arguments)
    check_folder("--out", folder, ["sweep.csv", "sweep.json", "sweep.png"])
    scene = load_scene(arguments.scene, trust=arguments.trust)
    tables = PartialTables(folder)
    for left in tables.earlier:
        print(f"note: an earlier sweep into {folder} did not finish; its partial results are now in {left}")
    with counting("check", " values") as checking, counting("sweep", " designs") as bar, interruption.held() as check:

        def progress(done: int, count: int) -> None:
            check()
            bar(done, count)

        result = sweep(
            scene, vary, overrides=changes, threads=threads, progress=progress, checking=checking, keep=tables.write,
            keep_every=every,
        )  # fmt: skip
        try:
            files = tables.finish(result) if result.designs else []
        except InputError:
            print(result.table())  # at least on the screen
            raise
    measures = arguments.measures or None
    unknown = [name for name in arguments.measures if name not in result.units]
    if unknown and result.designs:  # after the files, so that results are not lost for a typing error
        raise InputError(
            f"--measure: {unknown_name('measure', unknown[0], result.units)}; all of them are in {files[0]}"
        )
    drawn = result.complete and not arguments.no_plots  # no picture after an interruption
    if (measures or result.default_measures) and files and drawn:
        with list_on_failure(files, folder):
            result.plot(folder / "sweep.png", measures)
        files.append(folder / "sweep.png")
    if result.designs:
        print(result.table(measures))
    count, ended = len(result.designs), [d for d in result.designs if not d.reason]
    if not result.complete:
        print(f"\ninterrupted: {count} of {math.prod(result.shape)} designs were run")
    unclear = sum(design.status == UNKNOWN for design in result.designs)
    unknown_part = f", {unclear} unknown (see their reasons)" if unclear else ""
    failed = count - len(ended) - unclear
    print(f"\n{scene.name}: {count} designs, {len(ended)} finished, {failed} did not{unknown_part}")
    print(f"wrote {', '.join(path.name for path in files) or 'nothing'} in {folder}")
    return (0 if ended else 1) if result.complete else 130
