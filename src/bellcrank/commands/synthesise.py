"""`bellcrank synthesise`: linkages whose coupler passes the points of a CSV file, or whose output is its function; the
best one as a scene.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank.arrays import Array
from bellcrank.commands.options import add_output_folder, output_path, whole_option, write_each, written
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.atomic_write import check_file, check_folder, default_place
from bellcrank.files.json_files import write_json
from bellcrank.terminal.progress import share_bar

if TYPE_CHECKING:
    pass


LINKAGES = ("four_bar", "slider_crank", "stephenson", "watt")
NAMES = ("points.csv", "synthesis.json", "synthesis.png", "linkage.yaml", "linkage.urdf")
_ARGUMENT = re.compile(r"argument '(\w+)'")  # as the errors of bc.synthesise name what they are about


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The points or the function, the linkage, and where to write."""
    parser.add_argument(
        "points", metavar="FILE",
        help="a CSV file with columns 'x [m]' and 'y [m]', in the order in which the coupler passes the points, and "
        "'crank [deg]' where the crank's angles are prescribed and 'coupler [deg]' where the coupler's are, up to a "
        "common one; or with 'crank [deg]' and 'rocker [deg]' or 'slider [m]': the output is a function of the crank's "
        "angle, both up to common offsets",
    )  # fmt: skip
    parser.add_argument(
        "--linkage", choices=LINKAGES,
        help="the kind of linkage (default: slider_crank where the file has a column 'slider', else four_bar)",
    )  # fmt: skip
    parser.add_argument(
        "--timing",
        metavar="ANGLE",
        help="the crank's angle from one point to the next, such as '20 deg' (default: free)",
    )
    parser.add_argument(
        "--transmission-angle", metavar="ANGLE", default="30 deg",
        help="the least angle between coupler and rocker (of six-bars between link and second rocker too), or between "
        "coupler and the normal of the slider's guide "
        "(default: 30 deg; 0 switches it off)",
    )  # fmt: skip
    parser.add_argument(
        "--longest", metavar="LENGTH",
        help="the largest length of a link, such as '800 mm' (default: of six-bars 20 times the RMS distance of the "
        "points from their mean, of others no limit)",
    )  # fmt: skip
    parser.add_argument("--seed", metavar="N", help="seed of the Sobol points (default: 0)")
    parser.add_argument(
        "--write-config", type=output_path, metavar="FILE",
        help="where the scene of the best linkage is written, with its URDF beside it (default: linkage.yaml in DIR)",
    )  # fmt: skip
    add_output_folder(parser, "FILE_synthesis")


def run(arguments: argparse.Namespace) -> int:
    """Search. Exit code 0; 1 where no linkage was found, as the JSON file says too. Raises InputError."""
    from bellcrank.studies.designs.samples import LARGEST_SEED
    from bellcrank.studies.synthesis.synthesise import synthesise

    folder = arguments.out or default_place(f"{Path(arguments.points).stem}_synthesis")
    seed = whole_option("--seed", arguments.seed, 0, LARGEST_SEED) or 0
    check_folder("--out", folder, NAMES)
    scene = arguments.write_config or folder / NAMES[3]
    if arguments.write_config is not None:
        check_file("--write-config", scene)
    file = arguments.points
    given, of_column = _read(Path(file))
    linkage = arguments.linkage or of_column or LINKAGES[0]
    if of_column not in (None, linkage):
        column = "rocker" if of_column == LINKAGES[0] else "slider"
        raise InputError(f"--linkage: {file} has a column '{column}', which a {linkage} does not have")
    if arguments.timing is not None:
        if "timing" in given or of_column is not None:
            raise InputError(f"--timing: {file} has a column 'crank' already; give one of them")
        given["timing"] = arguments.timing
    with share_bar("synthesise") as bar:
        try:
            result = synthesise(
                linkage,
                **given,
                transmission_angle=arguments.transmission_angle,
                longest=arguments.longest,
                seed=seed,
                progress=lambda share, _: bar(share),
            )
        except InputError as error:
            names = {
                "points": f"{file}",
                "function": f"{file}",
                "directions": f"{file}: column 'coupler'",
                "timing": f"{file}: column 'crank'" if arguments.timing is None else "--timing",
                "transmission_angle": "--transmission-angle",
                "longest": "--longest",
            }
            raise InputError(_ARGUMENT.sub(lambda found: names[found[1]], str(error))) from None
        except BellcrankError as error:
            write_json(folder / NAMES[1], {"linkage": linkage, "status": str(error), "linkages": []})
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


def _read(file: Path) -> tuple[dict[str, Array], str | None]:
    """What a CSV file gives, by the arguments of `synthesise`: `points` with the columns "x [m]" and "y [m]", and
    `timing` and `directions` where there are "crank [deg]" and "coupler [deg]"; or `function` with "crank [deg]" and
    "rocker [deg]" or "slider [m]". And the linkage whose output that is; None for points. Raises InputError.
    """
    import numpy as np

    from bellcrank.actuators.catalogue.catalogue_columns import Column
    from bellcrank.actuators.catalogue.catalogue_tables import number, read_table
    from bellcrank.actuators.catalogue.product_checks import Range

    table = read_table(file, "a header 'x [m],y [m]' and rows of points")
    units = {"x": "m", "y": "m", "crank": "rad", "coupler": "rad", "rocker": "rad", "slider": "m"}
    columns = {name: Column(name, name, unit, Range(above=None)) for name, unit in units.items()}
    headers = {header.column.name: header for header in table.headers(columns)}
    outputs = [name for name in ("rocker", "slider") if name in headers]
    needed = ("crank", *outputs) if outputs else ("x", "y")
    for name in needed:
        if name not in headers:
            unit = "deg" if units[name] == "rad" else "m"
            raise InputError(f"{file}: line {table.line}: there is no column '{name} [{unit}]'")
    for name in headers:
        if outputs and name not in needed[:2]:
            raise InputError(f"{file}: line {table.line}: column '{name}' cannot be combined with '{outputs[0]}'")
    found = np.full((len(table.rows), len(headers)), np.nan)
    for k, row in enumerate(table.rows):
        for j, header in enumerate(headers.values()):
            if (value := number(row, header)) is None:
                raise row.error(header.title, "expected a number, found an empty cell")
            found[k, j] = value
    own = dict(zip(headers, found.T, strict=True))
    if outputs:
        pairs = np.stack([own["crank"], own[outputs[0]]], axis=1)
        return {"function": pairs}, "four_bar" if outputs[0] == "rocker" else "slider_crank"
    given = {"points": np.stack([own["x"], own["y"]], axis=1)}
    more = {"timing": "crank", "directions": "coupler"}
    return given | {key: own[name] for key, name in more.items() if name in own}, None
