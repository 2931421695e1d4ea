"""`bellcrank optimise`: the best design, or the front between objectives, on screen and as files in a folder."""

from __future__ import annotations

import argparse
import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank.commands.options import add_output_folder, add_trust, output_path, whole_option, write_each, written
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import check_file, check_folder, default_place
from bellcrank.terminal.progress import counting

if TYPE_CHECKING:
    from bellcrank.studies.optimisation.optimum import Optimum
    from bellcrank.studies.optimisation.pareto_result import ParetoFront

NAMES = ("designs.csv", "optimum.json", "optimum.png")
NAMES_OF_FRONT = ("front.csv", "front.json", "front.png")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The scene, variables, objective, limits, and where to write."""
    parser.add_argument(
        "scene", metavar="SCENE", help="a scene or robot configuration: a path, or a name that `bellcrank robots` lists"
    )
    parser.add_argument(
        "--vary", action="append", default=[], metavar="PATH=LOWER:UPPER",
        help="vary a parameter, or whatever else `bellcrank sweep` can vary, between two bounds, such as "
        "crank_length='1.2 m:1.24 m', or over standard sizes, such as crank_length='1.2 m:1.24 m step 5 mm' or "
        "crank_length=1.2,1.22,1.24; may be repeated (default: the scene's entry optimise)",
    )  # fmt: skip
    parser.add_argument(
        "--minimise", action="append", metavar="MEASURE",
        help="the measure to be made small, one of those of sweeps, or a formula of them; several of --minimise and "
        "--maximise ask for the front between them",
    )  # fmt: skip
    parser.add_argument("--maximise", action="append", metavar="MEASURE", help="the measure to be made large, instead")
    parser.add_argument(
        "--points", metavar="N", help="number of levels of each objective but the first along a front (default: 9)"
    )
    parser.add_argument(
        "--limit", action="append", default=[], metavar="LIMIT", dest="limits",
        help="a condition on a measure that the design is to keep, with <=, >= or =, such as "
        "'lock.crank <= 120 deg'; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--size", action="store_true", help="size the motors over the configuration's motions instead of simulating"
    )
    parser.add_argument(
        "--fastest", action="store_true", help="find the fastest motions along the paths of the configuration's motions"
    )
    parser.add_argument(
        "--tolerance", action="append", default=[], metavar="PATH=DISTRIBUTION", dest="tolerances",
        help="judge each design at deviations of what is varied, or of another number of the scene, such as "
        "crank_length='uniform(-1 mm, 1 mm)'; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--robust", metavar="RULE", help="how, with tolerances: worst (default) or 'mean + K sd', such as 'mean + 3 sd'"
    )
    parser.add_argument(
        "--restart", action="store_true",
        help="set aside the designs that an earlier search kept in the folder, instead of going on with them",
    )  # fmt: skip
    parser.add_argument("--samples", metavar="N", help="number of Sobol points of the global search (default: 256)")
    parser.add_argument("--starts", metavar="N", help="number of local searches (default: 8)")
    parser.add_argument("--seed", metavar="N", help="seed of the Sobol points (default: 0)")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="changes",
        help="change a value of the scene first, such as simulate.duration='20 s'; may be repeated",
    )  # fmt: skip
    parser.add_argument("--threads", metavar="N", help="number of threads that run designs (default: the machine's)")
    parser.add_argument("--workers", metavar="N", help="run designs in N processes of a Dask cluster on this machine")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="run designs on the workers of a Dask scheduler")
    parser.add_argument(
        "--write-config", type=output_path, metavar="FILE", help="write the best design as a scene file"
    )
    add_trust(parser)
    add_output_folder(parser, "SCENE_optimise")


def run(arguments: argparse.Namespace) -> int:
    """Search. Exit code 0: a local optimum that keeps the limits, or a front of such optima; 1: none; 130: interrupted.
    The best designs are written in any case. Raises BellcrankError for invalid input.
    """
    from bellcrank.scene.overrides import parse_assignment
    from bellcrank.scene.scene import load_scene
    from bellcrank.scene.study import MOST_DESIGNS, MOST_FRONT_POINTS, MOST_STARTS
    from bellcrank.studies.designs.samples import LARGEST_SEED
    from bellcrank.studies.execution.executors import MOST_THREADS, MOST_WORKERS, choose_executor
    from bellcrank.studies.optimisation.front import run_front
    from bellcrank.studies.optimisation.kept_designs import KeptDesigns
    from bellcrank.studies.optimisation.optimise import run_search
    from bellcrank.studies.optimisation.request import Request, plan_search
    from bellcrank.terminal import interruption

    folder = arguments.out or default_place(f"{Path(arguments.scene).stem}_optimise")
    asked = Request(
        variables=dict(map(_bounds, arguments.vary)) or None,
        minimise=arguments.minimise,
        maximise=arguments.maximise,
        limits=arguments.limits or None,
        size=arguments.size or None,
        fastest=arguments.fastest or None,
        samples=whole_option("--samples", arguments.samples, 1, MOST_DESIGNS),
        starts=whole_option("--starts", arguments.starts, 1, MOST_STARTS),
        seed=whole_option("--seed", arguments.seed, 0, LARGEST_SEED),
        points=whole_option("--points", arguments.points, 2, MOST_FRONT_POINTS),
        tolerances=dict(map(_tolerance, arguments.tolerances)) or None,
        robust=arguments.robust,
    )
    executor = choose_executor(
        whole_option("--threads", arguments.threads, 1, MOST_THREADS),
        whole_option("--workers", arguments.workers, 1, MOST_WORKERS),
        arguments.scheduler,
    )
    check_folder("--out", folder, (*NAMES, *NAMES_OF_FRONT))
    if arguments.write_config is not None:
        check_file("--write-config", arguments.write_config)
    changes = dict(parse_assignment(text) for text in arguments.changes)
    scene = load_scene(arguments.scene, changes, trust=arguments.trust)
    for option, given, entry in (
        ("--vary", arguments.vary, scene.optimise.vary), ("--limit", arguments.limits, scene.optimise.limits),
        ("--tolerance", arguments.tolerances, scene.optimise.tolerances),
    ):  # fmt: skip
        if given and entry:
            print(f"note: {option} replaces what the scene says under 'optimise'")
    kept = KeptDesigns(folder, restart=arguments.restart, notify=lambda text: print(f"note: {text}"))
    with contextlib.ExitStack() as stack:
        with counting("optimise", " designs") as bar, interruption.held() as check:

            def progress(done: int) -> None:
                check()
                bar(done, done)

            problem, asked, start = plan_search(scene, asked, executor, progress)
            several = len(asked.objectives) > 1
            if several and arguments.write_config is not None:
                raise InputError("--write-config: each design of a front is written into the folder of --out")
            if not several and arguments.points is not None:
                raise InputError("--points: belongs to a front; give several of --minimise and --maximise")
            stack.enter_context(kept)  # wrong input leaves no folder
            problem.keep_in(kept)
            stack.enter_context(executor)
            result = (run_front if several else run_search)(problem, asked, start)
        code = _show_front(result, folder, arguments) if several else _show(result, folder, arguments)  # type: ignore[arg-type]
        if result.complete:
            kept.remove_checkpoints()
    return code


def _tolerance(text: str) -> tuple[str, str]:
    """Path and distribution of "path=distribution". Raises InputError."""
    path, equals, given = text.partition("=")
    if not equals or not path.strip() or not given.strip():
        raise InputError(
            f"--tolerance {text!r}: expected PATH=DISTRIBUTION, such as crank_length='uniform(-1 mm, 1 mm)'"
        )
    return path.strip(), given.strip()


def _bounds(text: str) -> tuple[str, Any]:
    """Path and bounds of "path=lower:upper", or its sizes ("path=lower:upper step step", "path=size,size,…").

    Raises InputError.
    """
    from bellcrank.config.yaml_file import read_value
    from bellcrank.scene.study import STEPPED

    path, equals, given = text.partition("=")
    given, stepped, step = given.partition(" step ")
    parts = [*given.split(":"), *([step] if stepped else [])]
    sizes = given.split(",")
    listed = len(parts) == 1 and len(sizes) > 1
    if not equals or not path.strip() or not (listed or len(parts) == (3 if stepped else 2)):
        raise InputError(
            f"--vary {text!r}: expected PATH=LOWER:UPPER, PATH='LOWER:UPPER step STEP' or PATH=SIZE,SIZE,…, such as "
            "crank_length=1.2:1.24"
        )
    values = [read_value(part, f"--vary {text!r}") for part in (sizes if listed else parts)]
    if listed:
        return path.strip(), {"sizes": values}
    return path.strip(), dict(zip(STEPPED, values, strict=True)) if stepped else values


def _show(result: Optimum, folder: Path, arguments: argparse.Namespace) -> int:
    """Print the result and write the files; returns the exit code."""
    print(result.table())
    for note in result.notes:
        print(f"{note.label}: {note}")
    files: list[Path] = []
    jobs = [(folder / NAMES[0], result.to_csv), (folder / NAMES[1], result.to_json)]
    if not arguments.no_plots:
        jobs.append((folder / NAMES[2], result.plot))  # type: ignore[arg-type]
    if arguments.write_config is not None:
        jobs.append((arguments.write_config, result.write_config))
    write_each(files, jobs)
    print(written(files, folder))
    return (0 if result.converged else 1) if result.complete else 130


def _show_front(front: ParetoFront, folder: Path, arguments: argparse.Namespace) -> int:
    """Print the front and write the files; returns the exit code."""
    print(front.table())
    for note in front.notes:
        print(f"{note.label}: {note}")
    files: list[Path] = []
    jobs: list[Any] = [(folder / NAMES_OF_FRONT[0], front.to_csv), (folder / NAMES_OF_FRONT[1], front.to_json)]
    if not arguments.no_plots:
        jobs.append((folder / NAMES_OF_FRONT[2], front.plot))
    jobs += [(folder / name, one.write_config) for name, one in zip(front.config_names, front.designs, strict=True)]
    write_each(files, jobs)
    print(written(files, folder))
    return (0 if front.converged else 1) if front.complete else 130
