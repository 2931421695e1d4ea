"""`bellcrank size`: the table on screen, sizing.csv, sizing.json and plots in a folder."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank.commands.options import number_option
from bellcrank.commands.trust import add_trust
from bellcrank.commands.written import telling
from bellcrank.config.fields import parse_number
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import check_folder, default_place
from bellcrank.messages import format_value
from bellcrank.robot.payload import Payload

if TYPE_CHECKING:
    from bellcrank.dynamics.mechanism import Mechanism
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.robot_config import RobotConfig


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The robot, its motions and payloads, and where to write."""
    parser.add_argument(
        "robot", metavar="ROBOT", help="a robot configuration or URDF: a path, or a name (see bellcrank robots)"
    )
    parser.add_argument(
        "--motion",
        action="append",
        default=[],
        metavar="FILE|NAME",
        help="a motion of the configuration, or a CSV file; may be repeated (default: all of the configuration's)",
    )
    parser.add_argument(
        "--payload",
        action="append",
        default=[],
        metavar="MASS@FRAME",
        help="a point mass fixed to a frame, such as 2.5@tool0 (kg) or '500 g@tool0'; may be repeated",
    )
    parser.add_argument(
        "--mass-tolerance",
        default="0",
        metavar="SHARE",
        help="size for the worst case with each link as a whole, mass and inertia by one factor, up to this far "
        "off, such as 10%%",
    )
    add_allow_massless(parser)
    add_trust(parser)
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder for the files (default: ROBOT_sizing, here)")
    parser.add_argument("--no-plots", action="store_true", help="write no pictures")


def add_allow_massless(parser: argparse.ArgumentParser) -> None:
    """The option that lets motors move links without mass."""
    parser.add_argument(
        "--allow-massless",
        action="append",
        default=[],
        metavar="LINK",
        help="size motors though all that they move, from this link on, has no mass; may be repeated",
    )


def run(arguments: argparse.Namespace) -> int:
    """Size a robot; 0 where all limits are kept, 1 where one is exceeded or a motor cannot be sized. BellcrankError for
    bad input.
    """
    from bellcrank.commands.shown import remarks_of
    from bellcrank.scene.robot_config import load_robot_config
    from bellcrank.sizing.front import size
    from bellcrank.sizing.history import write_histories
    from bellcrank.sizing.report import FILES, REPORTS, earlier_files, remove_stale, write_reports
    from bellcrank.sizing.table import table, verdict

    if Path(arguments.robot).suffix.lower() == ".csv":
        raise InputError(
            f"{arguments.robot}: expected a robot configuration or URDF, found a CSV file; a motion goes to --motion: "
            f"bellcrank size ROBOT --motion {arguments.robot}"
        )
    payloads = [parse_payload(text) for text in arguments.payload]
    tolerance = parse_share(arguments.mass_tolerance)
    folder = arguments.out or default_place(f"{Path(arguments.robot).stem}_sizing")
    check_folder("--out", folder, FILES)
    config = load_robot_config(arguments.robot, trust=arguments.trust)
    sizing = size(
        config, arguments.motion or None, None, tolerance, payloads=payloads, allow_massless=arguments.allow_massless
    )
    assert sizing.study is not None
    mechanism, motions, drives = sizing.study
    print(table(sizing))
    for kind, text in remarks_of(sizing):
        print(f"{kind}: {text}")
    earlier = earlier_files(folder)
    files = write_reports(sizing, folder)  # first what matters most, should the disk be full
    with telling(files, folder):
        files += write_histories(mechanism, motions, folder, drives)
        if not arguments.no_plots:
            from bellcrank.sizing.plots import write_plots

            files += write_plots(
                mechanism, motions, folder, drives, title=config.name, mass_tolerance=tolerance, lines=sizing.joints
            )
        write_reports(sizing, folder, files[len(REPORTS) :])
    remove_stale(folder, earlier, files)
    print(f"\n{verdict(sizing)}\nwrote {', '.join(path.name for path in files)} in {folder}")
    return 0 if sizing.inside else 1


def chosen(config: RobotConfig, robot: Robot, names: list[str]) -> tuple[Mechanism, list[Motion]]:
    """The mechanism and the motions that `--motion` names, all of the configuration's where it names none.

    Raises InputError for an unknown motion, and where there is none; see `bellcrank.sizing.front.chosen`.
    """
    from bellcrank.sizing import front

    return front.chosen(config, robot, names or None)


def parse_payload(text: str) -> Payload:
    """A Payload from MASS@FRAME, the mass in kg unless a unit is written; InputError otherwise."""
    mass, at, frame = text.partition("@")
    if not at or not frame.strip():
        raise InputError(f"--payload {format_value(text)}: expected MASS@FRAME, such as 2.5@tool0")
    try:
        return Payload(parse_number(mass, "kg"), frame.strip())
    except (ValueError, InputError) as error:
        raise InputError(f"--payload {format_value(text)}: {error}") from None


def parse_share(text: str) -> float:
    """A share from "0.1" or "10%"; InputError unless it is at least 0 and below 1."""
    share = number_option("--mass-tolerance", text, least=0.0)
    if share is None or share >= 1.0:
        raise InputError(f"--mass-tolerance {format_value(text)}: expected at least 0 and less than 100%")
    return share
