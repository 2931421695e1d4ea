"""`bellcrank judge`: whether the motors and gears that a file names can drive it; judge.json in a folder."""

from __future__ import annotations

import argparse
from pathlib import Path

from bellcrank.commands.options import (
    add_accept_unknown,
    add_allow_massless,
    add_robot_and_motions,
    add_set,
    add_trust,
    config_with_changes,
    parse_payload,
)
from bellcrank.commands.output_files import output_path
from bellcrank.commands.select import add_conditions, conditions
from bellcrank.commands.size import parse_share
from bellcrank.files.atomic_write import check_file


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The robot, its motions and payloads, what it is judged under, and the file to write."""
    add_robot_and_motions(
        parser,
        "a CSV file, or a motion of the configuration; may be repeated (default: all motions of ROBOT, in the order of "
        "its duty program)",
    )
    parser.add_argument(
        "--mass-tolerance",
        default="0",
        metavar="SHARE",
        help="judge the worst case in which mass and inertia of each link are off by one factor of up to this share, "
        "such as 10%%",
    )
    add_conditions(parser)
    add_accept_unknown(parser)
    add_allow_massless(parser)
    add_set(parser, "payloads.1.mass='5 kg'")
    add_trust(parser)
    parser.add_argument("--out", type=output_path, metavar="FILE", help="write every criterion as JSON to this file")


def run(arguments: argparse.Namespace) -> int:
    """Judge the motors and gears of a configuration. Exit code 0: all limits are kept; 1: one is exceeded, or a main
    criterion is unknown. Raises BellcrankError for invalid input.
    """
    from bellcrank.sizing.judge import judge
    from bellcrank.sizing.selection.tables import wrapped
    from bellcrank.sizing.verdict_tables import table, verdict

    payloads = [parse_payload(text) for text in arguments.payload]
    tolerance, given = parse_share(arguments.mass_tolerance), conditions(arguments)
    target: Path | None = arguments.out
    if target is not None:
        check_file("--out", target)
    config = config_with_changes(arguments.robot, arguments.changes, arguments.trust)
    found = judge(
        config,
        arguments.motion or None,
        None,
        tolerance,
        conditions=given,
        payloads=payloads,
        allow_massless=arguments.allow_massless,
    )
    print(table(found))
    for text in found.warnings:
        print(wrapped(f"note: {text}", "", "  "))
    print(f"\n{verdict(found)}")
    if target is not None:
        print(f"wrote {found.to_json(target)}")
    return 0 if found.verified or (arguments.accept_unknown and found.inside) else 1
