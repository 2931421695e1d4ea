"""`bellcrank size`: tables on screen; sizing.csv, sizing.json, histories and pictures in a folder."""

from __future__ import annotations

import argparse
from pathlib import Path

from bellcrank.commands.options import (
    add_accept_unknown,
    add_allow_massless,
    add_live,
    add_output_folder,
    add_page,
    add_robot_and_motions,
    add_set,
    add_trust,
    list_on_failure,
    number_option,
    page_of,
    parse_payload,
    scene_with_changes,
    written,
)
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import check_folder, default_place
from bellcrank.messages import format_value


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The robot, its motions and payloads, and where to write."""
    add_robot_and_motions(
        parser,
        "a CSV file, or a motion of the configuration; may be repeated (default: all motions of ROBOT)",
    )
    parser.add_argument(
        "--mass-tolerance",
        default="0",
        metavar="SHARE",
        help="size for the worst case in which mass and inertia of each link are off by one factor of up to this "
        "share, such as 10%%",
    )
    add_set(parser, "payloads.1.mass='5 kg' or motions.NAME.speed_factor=1.2")
    add_page(parser, "the report of the sizing", "report.html in DIR")
    add_live(parser)
    add_accept_unknown(parser)
    add_allow_massless(parser)
    add_trust(parser)
    add_output_folder(parser, "ROBOT_sizing")


def run(arguments: argparse.Namespace) -> int:
    """Size a robot. Exit code 0: all limits are kept; 1: a limit is exceeded, a main criterion of a motor is unknown,
    or a motor cannot be sized. Raises BellcrankError for invalid input.
    """
    from bellcrank.commands.result_argument import remarks_of
    from bellcrank.files.json_files import list_files
    from bellcrank.sizing.size import size
    from bellcrank.sizing.sizing_files import (
        FILES,
        REPORT,
        RESULTS,
        earlier_files,
        remove_stale,
        write_histories,
        write_results,
    )
    from bellcrank.sizing.tables import table, verdict

    if Path(arguments.robot).suffix.lower() == ".csv":
        raise InputError(
            f"{arguments.robot}: expected a robot configuration or URDF, found a CSV file; a motion goes to --motion: "
            f"bellcrank size ROBOT --motion {arguments.robot}"
        )
    payloads = [parse_payload(text) for text in arguments.payload]
    tolerance = parse_share(arguments.mass_tolerance)
    folder = arguments.out or default_place(f"{Path(arguments.robot).stem}_sizing")
    check_folder("--out", folder, FILES)
    page = page_of(arguments, folder / REPORT)
    if page is None and arguments.live is not None:
        raise InputError("--live and --static say what the page does; give --page too")
    scene = scene_with_changes(arguments.robot, arguments.changes, arguments.trust)
    sizing = size(
        scene, arguments.motion or None, None, tolerance, payloads=payloads, allow_massless=arguments.allow_massless
    )
    print(table(sizing))
    for kind, text in remarks_of(sizing):
        print(f"{kind}: {text}")
    earlier = earlier_files(folder)
    files = write_results(sizing, folder)  # first what matters most, in case the disk is full
    with list_on_failure(files, folder):
        files += write_histories(sizing, folder)
        if not arguments.no_plots:
            from bellcrank.sizing.plots import write_plots

            files += write_plots(sizing, folder)
        if page is not None:
            from bellcrank.reports.report import report

            files.append(report(sizing, page, live=arguments.live))
        list_files(files[1], RESULTS, [path.name for path in files if path.parent == folder])
    remove_stale(folder, earlier, files)
    print(f"\n{verdict(sizing)}\n{written(files, folder)}")
    accepted = arguments.accept_unknown or not sizing.not_verified
    return 0 if sizing.inside and accepted else 1


def parse_share(text: str) -> float:
    """A share from "0.1" or "10%"; InputError unless it is at least 0 and below 1."""
    share = number_option("--mass-tolerance", text, least=0.0)
    if share is None or share >= 1.0:
        raise InputError(f"--mass-tolerance {format_value(text)}: expected at least 0 and less than 100%")
    return share
