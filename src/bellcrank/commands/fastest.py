"""`bellcrank fastest`: the fastest motions along paths, or the factor by which motions can be sped up."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank.commands.options import (
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
    whole_option,
    written,
)
from bellcrank.config.fields import parse_number
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import check_folder, default_place
from bellcrank.messages import file_name, format_value
from bellcrank.notes import reached

if TYPE_CHECKING:
    from bellcrank.planning.limits.motion_limits import MotionLimits
    from bellcrank.planning.speed_scaling import SpeedFactor

UNITS = {
    "speed": "rad/s or m/s",
    "acceleration": "rad/s^2 or m/s^2",
    "jerk": "rad/s^3 or m/s^3",
    "torque": "N m or N",
}
TOOL_UNITS = {
    "tool_speed": "m/s",
    "tool_acceleration": "m/s^2",
    "tool_angular_speed": "rad/s",
    "tool_angular_acceleration": "rad/s^2",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The robot, its motions and limits, and where to write."""
    add_robot_and_motions(
        parser,
        "a motion of the configuration or a CSV file, whose path counts; may be repeated (default: all motions)",
    )
    for key, unit in UNITS.items():
        default = "the URDF's" if key in ("speed", "torque") else "none"
        parser.add_argument(
            f"--{key}", action="append", default=[], metavar="JOINT=VALUE",
            help=f"the largest {key} of a joint, {unit}; may be repeated; 'none' for no limits (default: {default})",
        )  # fmt: skip
    parser.add_argument("--no-actuators", action="store_true", help="leave the limits of motors and gears out")
    parser.add_argument("--tool", metavar="FRAME", default="", help="the frame that the --tool-… options limit")
    for key, unit in TOOL_UNITS.items():
        what = key.replace("_", " ").replace("tool ", "")
        parser.add_argument(f"--{key.replace('_', '-')}", metavar="VALUE", help=f"the largest {what} of --tool, {unit}")
    parser.add_argument(
        "--grid", metavar="CELLS",
        help="use the first-order method on a fixed grid (default: cells that adapt themselves)",
    )  # fmt: skip
    parser.add_argument(
        "--scale", metavar="FACTOR|max",
        help="do not change how the speed varies along the path: speed the motion up by a factor such as 1.2, or by "
        "the largest that the limits allow",
    )  # fmt: skip
    parser.add_argument(
        "--repeat", choices=("pause", "speed"),
        help="also find the shortest pause after the motion, or the highest speed of it, at which the motors can "
        "repeat it indefinitely",
    )  # fmt: skip
    parser.add_argument(
        "--repeat-limit", choices=("rms", "temperature"),
        help="what limits the repetition: the RMS torque against the continuous torque, or the winding's temperature "
        "(default: rms)",
    )  # fmt: skip
    add_set(parser, "payloads.1.mass='5 kg'")
    add_trust(parser)
    add_output_folder(parser, "ROBOT_fastest")
    add_page(
        parser,
        "the replay of each fastest motion, which shows the active limit at each time,",
        "fastest_MOTION.html in DIR",
        "--html",
    )


def run(arguments: argparse.Namespace) -> int:
    """Find fastest motions, or speed factors. Exit code 0: done; 1: the factor asked for exceeds a limit. Raises
    BellcrankError for invalid input, and where no motion keeps the limits.
    """
    folder = arguments.out or default_place(f"{Path(arguments.robot).stem}_fastest")
    limits = _limits(arguments)
    grid = whole_option("--grid", arguments.grid, least=2, most=1_000_000)
    factor = _factor(arguments.scale)
    check_folder("--out", folder)
    scene = scene_with_changes(arguments.robot, arguments.changes, arguments.trust)
    payloads = [parse_payload(text) for text in arguments.payload]
    motions = arguments.motion or list(scene.config.motions)
    _refuse_unused(arguments)
    if not motions:
        raise InputError(
            f"{arguments.robot}: there is no motion whose path could be followed; give a CSV file (--motion FILE), or "
            "write a robot configuration with motions"
        )
    if arguments.page and len(motions) > 1:
        raise InputError(
            f"--page {arguments.page}: expected one motion, found {len(motions)}; choose one with --motion"
        )
    page_of(arguments, folder / "fastest.html")  # is refused before anything is computed
    files: list[Path] = []
    status = 0
    with list_on_failure(files, folder):
        for number, name in enumerate(motions):
            print("" if number == 0 else "\n", end="")
            if arguments.scale is None:
                status = max(status, _fastest(arguments, (scene, name, limits, payloads, grid), folder, files))
            else:
                status = max(status, _scaled(arguments, (scene, name, limits, payloads), factor, (folder, files)))
    print(f"\n{written(files, folder)}")
    return status


def _refuse_unused(arguments: argparse.Namespace) -> None:
    """Raise InputError for options that others leave without use."""
    if arguments.scale is not None:
        given = {"--repeat": arguments.repeat, "--grid": arguments.grid, "--page": arguments.page}
        for option in (name for name, value in given.items() if value is not None):
            raise InputError(f"{option} is for the fastest motion; leave --scale out")
    if arguments.repeat_limit is not None and arguments.repeat is None:
        raise InputError("--repeat-limit is for the repetition of the motion; give --repeat pause or --repeat speed")


def _fastest(arguments: argparse.Namespace, given: tuple[Any, ...], folder: Path, files: list[Path]) -> int:
    from bellcrank.motion.sampled.csv_file import write_motion
    from bellcrank.planning.time_optimal import time_optimal
    from bellcrank.terminal.progress import counting

    scene, name, limits, payloads, grid = given
    with counting(f"fastest along {name}", "cells") as progress:
        found = time_optimal(
            scene, name, limits, grid=grid, payloads=payloads,
            progress=progress,
        )  # fmt: skip
    print(found.table())
    for warning in found.warnings:
        print(f"{'not known' if reached([warning]) else 'warning'}: {warning}")
    stem = file_name(found.path)
    folder.mkdir(parents=True, exist_ok=True)
    write_motion(found.motion, folder / f"fastest_{stem}.csv")
    files.append(folder / f"fastest_{stem}.csv")
    files.append(found.to_csv(folder / f"limits_{stem}.csv"))
    files.append(found.to_json(folder / f"fastest_{stem}.json"))
    if not arguments.no_plots:
        files.append(found.plot(folder / f"fastest_{stem}.png"))
    page = page_of(arguments, folder / f"fastest_{stem}.html")
    if page is not None:
        from bellcrank.replays.page.page import write_page
        from bellcrank.replays.replay import film_of

        files.append(write_page(film_of(found), page))
    if arguments.repeat is not None:
        _repeated(arguments, (scene, found.motion, payloads, stem), folder, files)
    return 1 if reached(found.notes) else 0


def _repeated(arguments: argparse.Namespace, given: tuple[Any, ...], folder: Path, files: list[Path]) -> None:
    from bellcrank.motion.sampled.csv_file import write_motion
    from bellcrank.planning.repeated_cycle import repeated_cycle

    scene, motion, payloads, stem = given
    cycle = repeated_cycle(
        scene,
        motion,
        limit=arguments.repeat_limit or "rms",
        by=arguments.repeat,
        payloads=payloads,
    )
    print("\n" + cycle.table())
    for warning in cycle.warnings:
        print(f"{'not known' if reached([warning]) else 'warning'}: {warning}")
    write_motion(cycle.motion, folder / f"cycle_{stem}.csv")
    files += [folder / f"cycle_{stem}.csv", cycle.to_json(folder / f"cycle_{stem}.json")]


def _scaled(
    arguments: argparse.Namespace, given: tuple[Any, ...], factor: float | None, place: tuple[Path, list[Path]]
) -> int:
    from bellcrank.motion.sampled.csv_file import write_motion
    from bellcrank.planning.speed_scaling import MOST, speed_factor

    scene, name, limits, payloads = given
    folder, files = place
    found = speed_factor(scene, name, limits, payloads=payloads)
    print(found.table())
    stem = file_name(found.motion.name)
    folder.mkdir(parents=True, exist_ok=True)
    if found.factor > 0.0 or factor is not None:
        write_motion(found.scaled(factor), folder / f"scaled_{stem}.csv")
        files.append(folder / f"scaled_{stem}.csv")
    if not arguments.no_plots:
        files.append(found.plot(folder / f"factor_{stem}.png"))
    if reached(found.notes):
        return 1
    if factor is None:
        return 0 if found.factor > 0.0 else 1
    if 1.0 <= factor <= found.factor:
        return 0
    # Other factors may keep the limits or not: a motion that is slower may need more torque, such as that of a fall.
    scaled = speed_factor(scene, found.scaled(factor), limits, payloads=payloads)
    if scaled.factor < 1.0:
        print(f"\nthe factor {factor:g} is not allowed: the motion then exceeds the {_worst(scaled)}")
        return 1
    if found.factor < min(factor, MOST):
        print(f"\nthe factor {factor:g} keeps all limits, but factors between {found.factor:.6g} and it do not")
    return 0


def _worst(found: SpeedFactor) -> str:
    """The limit that the motion as given exceeds most, and by how much."""
    here = found.factors.tolist().index(1.0)
    name, use = max(((name, float(uses[here])) for name, uses in found.uses.items()), key=lambda one: one[1])
    return f"{name} by {100.0 * (use - 1.0):.3g} %"


def _factor(text: str | None) -> float | None:
    """The factor of --scale; None for the largest."""
    if text is None or text == "max":
        return None
    return number_option("--scale", text, above=0.0)


def _limits(arguments: argparse.Namespace) -> MotionLimits:
    from bellcrank.planning.limits.motion_limits import MotionLimits

    chosen: dict[str, Any] = {}
    for key, unit in UNITS.items():
        texts = getattr(arguments, key)
        if texts == ["none"]:
            chosen[key] = "none"
        elif texts:
            pairs = [_limit(f"--{key}", text, unit) for text in texts]
            chosen[key] = dict(pairs)
            if len(pairs) > len(chosen[key]):
                raise InputError(f"--{key}: a joint has two limits; give one")
    for key, unit in TOOL_UNITS.items():
        chosen[key] = number_option(f"--{key.replace('_', '-')}", getattr(arguments, key), unit, above=0.0)
    return MotionLimits(actuators=not arguments.no_actuators, tool=arguments.tool, **chosen)


def _limit(option: str, text: str, unit: str) -> tuple[str, float]:
    joint, equals, value = text.partition("=")
    if not equals or not joint.strip():
        raise InputError(f"{option} {format_value(text)}: expected JOINT=VALUE, such as elbow=2.5")
    try:
        return joint.strip(), parse_number(value.strip(), unit)
    except ValueError as error:
        raise InputError(f"{option} {format_value(text)}: {error}") from None
