"""`bellcrank synthesise`: four-bars whose coupler passes the points of a CSV file; the best one as a scene."""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

from bellcrank.commands.options import add_output_folder, whole_option
from bellcrank.commands.output_files import output_path, write_each, written
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.atomic_write import check_file, check_folder, default_place
from bellcrank.files.json_files import write_json
from bellcrank.terminal.progress import share_bar

NAMES = ("points.csv", "synthesis.json", "synthesis.png", "linkage.yaml", "linkage.urdf")
_ARGUMENT = re.compile(r"argument '(\w+)'")  # as the errors of bc.synthesise name what they are about


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The points, how they are passed, and where to write."""
    parser.add_argument(
        "points", metavar="FILE",
        help="a CSV file with columns 'x [m]' and 'y [m]', in the order in which the coupler passes the points, and "
        "'crank [deg]' where the crank's angles are prescribed, up to a common one",
    )  # fmt: skip
    parser.add_argument(
        "--timing",
        metavar="ANGLE",
        help="the crank's angle from one point to the next, such as '20 deg' (default: free)",
    )
    parser.add_argument(
        "--transmission-angle", metavar="ANGLE", default="30 deg",
        help="the least angle between coupler and rocker (default: 30 deg; 0 switches it off)",
    )  # fmt: skip
    parser.add_argument("--seed", metavar="N", help="seed of the Sobol points (default: 0)")
    parser.add_argument(
        "--write-config", type=output_path, metavar="FILE",
        help="where the scene of the best linkage is written, with its URDF beside it (default: linkage.yaml in DIR)",
    )  # fmt: skip
    add_output_folder(parser, "FILE_synthesis")


def run(arguments: argparse.Namespace) -> int:
    """Search. Exit code 0; 1 where no linkage was found, as the JSON file says too. Raises InputError."""
    from bellcrank.studies.samples import LARGEST_SEED
    from bellcrank.studies.synthesis.synthesise import read_points, synthesise

    folder = arguments.out or default_place(f"{Path(arguments.points).stem}_synthesis")
    seed = whole_option("--seed", arguments.seed, 0, LARGEST_SEED) or 0
    check_folder("--out", folder, NAMES)
    scene = arguments.write_config or folder / NAMES[3]
    if arguments.write_config is not None:
        check_file("--write-config", scene)
    points, timing = read_points(Path(arguments.points))
    if arguments.timing is not None and timing is not None:
        raise InputError(f"--timing: {arguments.points} has a column 'crank' already; give one of them")
    with share_bar("synthesise") as bar:
        try:
            result = synthesise(
                "four_bar", points, timing if arguments.timing is None else arguments.timing,
                transmission_angle=arguments.transmission_angle, seed=seed, progress=bar,
            )  # fmt: skip
        except InputError as error:
            file = arguments.points
            given = {
                "points": f"{file}",
                "timing": f"{file}: column 'crank'" if arguments.timing is None else "--timing",
                "transmission_angle": "--transmission-angle",
            }
            raise InputError(_ARGUMENT.sub(lambda found: given[found[1]], str(error))) from None
        except BellcrankError as error:
            write_json(folder / NAMES[1], {"linkage": "four_bar", "status": str(error), "linkages": []})
            print(f"bellcrank: {error}", file=sys.stderr)
            return 1
    print(result.table())
    for note in result.notes:
        print(f"{note.label}: {note}")
    files: list[Path] = []
    jobs = [(folder / NAMES[0], result.to_csv), (folder / NAMES[1], result.to_json), (scene, result.write_config)]
    if not arguments.no_plots:
        jobs.append((folder / NAMES[2], result.plot))  # type: ignore[arg-type]
    write_each(files, jobs)
    print(written(files, folder))
    return 0
