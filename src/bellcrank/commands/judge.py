"""`bellcrank judge`: whether the motors and gears that a file names can drive it; judge.json in a folder."""

from __future__ import annotations

import argparse
from pathlib import Path

from bellcrank.commands.options import (
    add_accept_unknown,
    add_allow_massless,
    add_limit,
    add_robot_and_motions,
    add_set,
    add_trust,
    number_option,
    output_path,
    parse_limit,
    parse_payload,
    scene_with_changes,
)
from bellcrank.commands.select import add_conditions, conditions
from bellcrank.commands.size import parse_share
from bellcrank.errors import InputError
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
    add_set(parser, "payloads.1.mass='5 kg' or motions.NAME.speed_factor=1.2")
    add_trust(parser)
    parser.add_argument(
        "--simulate",
        action="store_true",
        help="also simulate the drives along the motions: tracking errors, settling times, voltages, temperatures",
    )
    parser.add_argument(
        "--settle", default="0.5 s", metavar="TIME", help="with --simulate: time after the end of each motion"
    )
    parser.add_argument(
        "--frame", metavar="NAME", help="with --simulate: the frame whose distance from its path is measured"
    )
    add_limit(parser, "with --simulate: a limit that the simulated drives must keep")
    parser.add_argument("--out", type=output_path, metavar="FILE", help="write every criterion as JSON to this file")


def run(arguments: argparse.Namespace) -> int:
    """Judge the motors and gears of a configuration. Exit code 0: all limits are kept; 1: one is exceeded, or a main
    criterion is unknown. Raises BellcrankError for invalid input.
    """
    from bellcrank.present.tables import wrapped
    from bellcrank.sizing.judge import judge
    from bellcrank.sizing.verdict_tables import table, verdict

    payloads = [parse_payload(text) for text in arguments.payload]
    limits = dict(map(parse_limit, arguments.limit))
    if limits and not arguments.simulate:
        raise InputError("--limit is for drives that are simulated; add --simulate")
    tolerance, given = parse_share(arguments.mass_tolerance), conditions(arguments)
    target: Path | None = arguments.out
    if target is not None:
        check_file("--out", target)
    scene = scene_with_changes(arguments.robot, arguments.changes, arguments.trust)
    found = judge(
        scene,
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
    kept = _simulated(arguments, limits) if arguments.simulate else True
    return 0 if kept and (found.verified or (arguments.accept_unknown and found.inside)) else 1


def _simulated(arguments: argparse.Namespace, limits: dict[str, float]) -> bool:
    """Simulate the drives, print how they follow, and return whether the limits are kept. Raises BellcrankError."""
    from bellcrank.scene.overrides import parse_assignment
    from bellcrank.sizing.verification import verify_selection
    from bellcrank.terminal.progress import counting

    unused = [name for name, given in (
        ("--payload", arguments.payload), ("--mass-tolerance", arguments.mass_tolerance != "0"),
        ("conditions of the command line", conditions(arguments)),
    ) if given]  # fmt: skip
    with counting("simulate", " motions") as progress:
        found = verify_selection(
            arguments.robot,
            arguments.motion or None,
            settle=number_option("--settle", arguments.settle, "s", least=0.0, most=1e6) or 0.0,
            frame=arguments.frame,
            limits=limits,
            overrides=dict(parse_assignment(text) for text in arguments.changes) or None,
            trust=arguments.trust,
            progress=progress,
        )
    print(f"\n{found}")
    if unused:
        print(f"note: not part of the simulation: {', '.join(unused)}; write them in the file")
    if arguments.out is not None:
        print(f"wrote {found.to_json(arguments.out.with_name(f'{arguments.out.stem}_simulated.json'))}")
    return found.kept
