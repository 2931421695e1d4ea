"""Options that several commands have, the numbers given to them, and the files that a command writes."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank.config.fields import parse_number
from bellcrank.config.units import whole_number
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import check_file
from bellcrank.messages import format_value, unknown_name

if TYPE_CHECKING:
    from bellcrank.robot.model.payload import Payload
    from bellcrank.scene.scene import Scene


def output_path(text: str) -> Path:
    """The path that an option names for output. An empty one, as of a variable that is not set, is refused.

    Raises ArgumentTypeError, which argparse reports with the option's name.
    """
    if not text.strip():
        raise argparse.ArgumentTypeError(f"expected a path, found {text!r}; leave the option out for the default")
    return Path(text)


@contextmanager
def list_on_failure(files: list[Path], folder: Path) -> Iterator[None]:
    """Where the block ends early, by an error or a signal, list the files written until then."""
    try:
        yield
    except BaseException:
        if files:
            print(written(files, folder))
        raise


def write_each(files: list[Path], jobs: Iterable[tuple[Path, Callable[[Path], object]]]) -> None:
    """Write all files that can be written, and add them to a list. Raises the InputError of the first that cannot."""
    failures = []
    for path, write in jobs:
        try:
            write(path)
            files.append(path)
        except InputError as error:
            failures.append(error)
    if failures:
        raise failures[0]


def written(files: Iterable[Path], folder: Path) -> str:
    """The sentence about the files that a command wrote: those in its folder by name, others by their path."""
    files = list(files)
    inside = ", ".join(path.name for path in files if path.parent == folder)
    return f"wrote {inside or 'nothing'} in {folder}{''.join(f', {path}' for path in files if path.parent != folder)}"


def add_robot_and_motions(parser: argparse.ArgumentParser, motion: str) -> None:
    """ROBOT, --motion, with its help, and --payload."""
    parser.add_argument(
        "robot",
        metavar="ROBOT",
        help="a robot configuration or URDF: a path, or a name that `bellcrank robots` lists",
    )
    parser.add_argument("--motion", action="append", default=[], metavar="FILE|NAME", help=motion)
    parser.add_argument(
        "--payload",
        action="append",
        default=[],
        metavar="MASS@FRAME",
        help="a point mass fixed to a frame, such as 2.5@tool0 (kg) or '500 g@tool0'; may be repeated",
    )


def parse_payload(text: str) -> Payload:
    """A Payload from MASS@FRAME, the mass in kg unless a unit is written; InputError otherwise."""
    from bellcrank.robot.model.payload import Payload

    mass, at, frame = text.partition("@")
    if not at or not frame.strip():
        raise InputError(f"--payload {format_value(text)}: expected MASS@FRAME, such as 2.5@tool0")
    try:
        return Payload(parse_number(mass, "kg"), frame.strip())
    except (ValueError, InputError) as error:
        raise InputError(f"--payload {format_value(text)}: {error}") from None


def add_limit(parser: argparse.ArgumentParser, what: str) -> None:
    """The option --limit; `what` begins its help."""
    parser.add_argument(
        "--limit",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help=f"{what}: tracking_error, tool_error, settling_time, command_over_limit, winding_temperature or "
        "bus_voltage, such as tracking_error='0.1 deg'; may be repeated",
    )


def parse_limit(text: str) -> tuple[str, float]:
    """(name, value) of a limit in simulation, NAME=VALUE. Raises InputError."""
    name, sign, value = text.partition("=")
    units = {
        "tracking_error": "rad or m",
        "tool_error": "m",
        "settling_time": "s",
        "winding_temperature": "°C",
        "bus_voltage": "V",
    }
    if name.strip() not in (*units, "command_over_limit"):
        raise InputError(f"--limit {text}: {unknown_name('limit', name.strip(), (*units, 'command_over_limit'))}")
    try:
        return name.strip(), parse_number(value.strip(), units.get(name.strip(), ""))
    except ValueError as error:
        raise InputError(f"--limit {text}: {error if sign else 'expected NAME=VALUE'}") from None


def add_output_folder(parser: argparse.ArgumentParser, default: str) -> None:
    """--out and --no-plots."""
    parser.add_argument(
        "--out", type=output_path, metavar="DIR", help=f"output folder (default: {default} in the current folder)"
    )
    parser.add_argument("--no-plots", action="store_true", help="do not write pictures")


def add_trust(parser: argparse.ArgumentParser) -> None:
    """--trust, the folders whose files a file may name."""
    parser.add_argument(
        "--trust",
        action="append",
        default=[],
        metavar="DIR",
        help="let the scene, robot or run name files in this folder and its subfolders too, besides its own; "
        "may be repeated",
    )


def add_accept_unknown(parser: argparse.ArgumentParser) -> None:
    """--accept-unknown, for the exit code."""
    parser.add_argument(
        "--accept-unknown",
        action="store_true",
        help="end with exit code 0 although main criteria of a motor are unknown, so that it may be far too weak",
    )


def add_set(parser: argparse.ArgumentParser, example: str) -> None:
    """--set, values of the scene to change; `example` is a KEY=VALUE."""
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="changes",
        help=f"change a value of the scene, such as {example}; may be repeated",
    )  # fmt: skip


def scene_with_changes(robot: str, changes: list[str], trust: list[str]) -> Scene:
    """The scene of a path or name, with the values of --set. Raises InputError."""
    from bellcrank.scene.overrides import parse_assignment
    from bellcrank.scene.scene import load_scene
    from bellcrank.sizing.sizing_subject import changed_scene

    assigned = dict(parse_assignment(text) for text in changes)
    scene = load_scene(robot, trust=trust)
    return changed_scene(scene, assigned) if assigned else scene


def add_allow_massless(parser: argparse.ArgumentParser) -> None:
    """--allow-massless, the links without mass that motors may move."""
    parser.add_argument(
        "--allow-massless",
        action="append",
        default=[],
        metavar="LINK",
        help="size motors that move only this link and links fixed to it, although these have no mass; may be repeated",
    )


def add_checkpoint_every(parser: argparse.ArgumentParser) -> None:
    """--checkpoint-every, how often results are saved during the computation."""
    parser.add_argument(
        "--checkpoint-every",
        metavar="S",
        help="save the results so far about every S seconds of computing time (default: 5)",
    )


def checkpoint_every(arguments: argparse.Namespace) -> float:
    """The seconds of computing time between two saves. Raises InputError."""
    from bellcrank.simulation.files.checkpoints import CHECKPOINT_EVERY, LONGEST_BETWEEN_CHECKPOINTS

    seconds = number_option(
        "--checkpoint-every", arguments.checkpoint_every, "s", above=0.0, most=LONGEST_BETWEEN_CHECKPOINTS
    )
    return CHECKPOINT_EVERY if seconds is None else seconds


def number_option(
    option: str, text: str | None, unit: str = "", *, above: float | None = None, least: float | None = None,
    most: float | None = None,
) -> float | None:  # fmt: skip
    """The SI value of an option's number, finite, more than `above`, at least `least`, at most `most`; None where the
    option was not given. Raises InputError.
    """
    if text is None:
        return None
    try:
        value = parse_number(text, unit)
    except ValueError as error:
        raise InputError(f"{option} {format_value(text)}: {error}") from None
    if (
        (above is not None and value <= above)
        or (least is not None and value < least)
        or (most is not None and value > most)
    ):
        bounds = f" of more than {above:g}" if above is not None else "" if least is None else f" of {least:g} or more"
        bounds += "" if most is None else f"{' and' if bounds else ' of'} at most {most:g}"
        raise InputError(f"{option} {format_value(text)}: expected a number{bounds}{f' ({unit})' if unit else ''}")
    return value


def whole_option(option: str, text: str | None, least: int, most: int) -> int | None:
    """The whole number of an option, from `least` to `most`; None where the option was not given. Raises InputError."""
    if text is None:
        return None
    value = whole_number(text)
    if value is None or not least <= value <= most:
        raise InputError(f"{option} {format_value(text)}: expected a whole number from {least} to {most}")
    return value


def size_option(option: str, text: str, least: int, most: int) -> tuple[int, int]:
    """Width and height of an option such as 960x720, each from `least` to `most`. Raises InputError."""
    first, cross, second = text.partition("x")
    width, height = whole_number(first), whole_number(second)
    if not cross or width is None or height is None or not least <= min(width, height) <= max(width, height) <= most:
        raise InputError(
            f"{option} {format_value(text)}: expected WIDTHxHEIGHT, each a whole number of pixels from {least} to "
            f"{most}, such as 960x720"
        )
    return width, height


def add_page(parser: argparse.ArgumentParser, page: str, default: str, older: str | None = None) -> None:
    """The option for a page, the same in every command; `older` is another name, which takes no FILE."""
    parser.add_argument(
        "--page", nargs="?", const="", metavar="FILE",
        help=f"write {page} as one HTML page (default FILE: {default}); give it after the other arguments",
    )  # fmt: skip
    if older is not None:
        parser.add_argument(older, dest="page", action="store_const", const="", help="the same as --page without FILE")


def add_live(parser: argparse.ArgumentParser) -> None:
    """Whether the page computes."""
    computes = parser.add_mutually_exclusive_group()
    computes.add_argument(
        "--live",
        action="store_const",
        const=True,
        dest="live",
        help="the page computes: change payload, speed, ratio and friction of a sizing, motors and gears of a "
        "selection (replay --select), parameters and start of a run (default: where it adds less than 400 kB)",
    )
    computes.add_argument("--static", action="store_const", const=False, dest="live", help="the page only replays")


def page_of(arguments: argparse.Namespace, default: Path) -> Path | None:
    """Where the page goes that was asked for; None where none was. Raises InputError where it cannot be written."""
    if arguments.page is None:
        return None
    if not arguments.page:
        return default
    path = Path(arguments.page)
    if path.suffix.lower() not in (".html", ".htm"):
        path = path.with_name(f"{path.name}.html")  # as the page will be called
    check_file("--page", path)
    return path
