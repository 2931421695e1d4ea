"""`bellcrank catalogue`: lists motors and gears, shows one of them with its curve, and checks catalogue files."""

from __future__ import annotations

import argparse
import difflib
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank.commands.options import number_option, output_path
from bellcrank.config.fields import parse_number
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import check_file, check_folder, default_place
from bellcrank.messages import format_value, unknown_name

if TYPE_CHECKING:
    from bellcrank.actuators.catalogue.catalogue import Catalogue

ACTIONS = {  # action -> options that it takes
    "list": ("catalogue", "own", "maker", "kind", "voltage", "torque", "speed", "mass", "ratio", "out"),
    "show": ("catalogue", "own", "voltage", "out", "no_plots"),
    "check": ("catalogue", "own"),
}
RANGES = {  # option -> unit, fields of motors and of gears that it filters by; the first that is stated counts
    "torque": ("N m", ("continuous_torque",), ("rated_torque", "average_torque")),
    "speed": ("rad/s", ("nominal_speed", "max_speed", "no_load_speed"), ("average_speed", "max_speed")),
    "mass": ("kg", ("mass",), ("mass",)),
    "ratio": ("", ("ratio",), ("ratio",)),
}
MEANING = {
    "torque": "continuous torque of motors, rated or average torque of gears (N m)",
    "speed": "nominal (or largest) speed of motors, average (or largest) input speed of gears (rad/s, or '3000 rpm..')",
    "mass": "mass (kg)",
    "ratio": "ratio of gears, and of gears inside actuators",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to do, with which products, and where to write."""
    parser.add_argument(
        "action", nargs="?", default="list", metavar="ACTION",
        help="list (default), show a product with its torque-speed curve, or check catalogue files for contradictions; "
        "the id of a product shows it",
    )  # fmt: skip
    parser.add_argument(
        "names", nargs="*", metavar="ID|FILE",
        help="show: ids of products; check: CSV files or folders of them (default: the products that come with "
        "bellcrank)",
    )  # fmt: skip
    parser.add_argument(
        "--catalogue", action="append", default=[], metavar="DIR",
        help="a folder of catalogue files, or one file, that is added; may be repeated",
    )  # fmt: skip
    parser.add_argument("--own", action="store_true", help="leave out the products that come with bellcrank")
    parser.add_argument("--maker", action="append", default=[], metavar="NAME", help="a maker; may be repeated")
    parser.add_argument(
        "--kind", action="append", default=[], metavar="KIND",
        help="a kind of motor (motor, frameless, servo, actuator) or gear (strain_wave, planetary, cycloidal, spur, "
        "belt, screw, rack); may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--voltage", metavar="V", help="list: nominal voltage of motors; show: bus voltage of the voltage line"
    )
    for name, meaning in MEANING.items():
        parser.add_argument(f"--{name}", metavar="MIN..MAX", help=f"{meaning}; either end may be left out")
    parser.add_argument(
        "--out", type=output_path, metavar="DIR|FILE",
        help="list: write what is listed as catalogue files and catalogue.json in this folder; show: the picture "
        "(default: ID.png in the current folder)",
    )  # fmt: skip
    parser.add_argument("--no-plots", action="store_true", help="show: do not write pictures")


def run(arguments: argparse.Namespace) -> int:
    """List, show or check. Exit code 0; 1: a checked product contradicts itself. Raises BellcrankError for invalid
    input.
    """
    if arguments.action not in ACTIONS:
        if difflib.get_close_matches(arguments.action, ACTIONS):
            raise InputError(unknown_name("action", arguments.action, ACTIONS))
        arguments.action, arguments.names = "show", [arguments.action, *arguments.names]
    _refuse_unused(arguments)
    if arguments.action == "check":
        return _check(arguments)
    from bellcrank.actuators.catalogue.catalogue import load_catalogue

    if arguments.action == "list" and arguments.names:
        raise InputError(
            f"unexpected {format_value(arguments.names[0])}; to show a product: bellcrank catalogue show ID"
        )
    catalogue = load_catalogue(*arguments.catalogue, shipped=not arguments.own, contradicting=True)
    return _show(arguments, catalogue) if arguments.action == "show" else _list(arguments, catalogue)


def _refuse_unused(arguments: argparse.Namespace) -> None:
    """Refuse options that the action does not take. Raises InputError."""
    for name in ("maker", "kind", "voltage", *RANGES, "out", "no_plots"):
        if name not in ACTIONS[arguments.action] and getattr(arguments, name) not in (None, [], False):
            option = f"--{name.replace('_', '-')}"
            takers = [action for action, options in ACTIONS.items() if name in options]
            raise InputError(f"{option}: '{arguments.action}' does not take it; it is for {' and '.join(takers)}")


def _list(arguments: argparse.Namespace, catalogue: Catalogue) -> int:
    from bellcrank.actuators.catalogue.catalogue import Catalogue
    from bellcrank.actuators.catalogue.catalogue_columns import GEAR_KINDS, MOTOR_KINDS
    from bellcrank.actuators.catalogue.catalogue_files import write_catalogue
    from bellcrank.commands.catalogue_tables import overview, write_json

    voltage = number_option("--voltage", arguments.voltage, "V", above=0.0)
    chosen = catalogue.filtered(makers=arguments.maker, kinds=arguments.kind, voltage=voltage)
    kinds = set(arguments.kind or (*MOTOR_KINDS, *GEAR_KINDS))  # `filtered` keeps gears where only motors are named
    gears = chosen.gears if voltage is None else ()
    chosen = Catalogue(
        tuple(one for one in chosen.motors if one.kind in kinds), tuple(one for one in gears if one.kind in kinds)
    )
    for name in RANGES:
        chosen = _in_range(chosen, name, getattr(arguments, name))
    if arguments.out is not None:
        check_folder("--out", arguments.out, ["motors.csv", "gears.csv", "curves.csv", "catalogue.json"])
    print(overview(chosen))
    if arguments.out is not None:
        files = write_catalogue(chosen.motors, chosen.gears, arguments.out)
        files.append(write_json(chosen, arguments.out / "catalogue.json"))
        print(f"wrote {', '.join(path.name for path in files)} in {arguments.out}")
    return 0


def _in_range(catalogue: Catalogue, name: str, text: str | None) -> Catalogue:
    """The products whose figure lies in a range; those that do not state it are left out. Raises InputError."""
    if text is None:
        return catalogue
    unit, of_motor, of_gear = RANGES[name]
    low, high = parse_range(f"--{name}", text, unit)

    def inside(product: object, fields: tuple[str, ...]) -> bool:
        values = [value for field in fields if (value := getattr(product, field)) is not None]
        return bool(values) and low <= values[0] <= high

    kept = [one.id for one in catalogue.motors if inside(one, of_motor)]
    kept += [one.id for one in catalogue.gears if inside(one, of_gear)]
    return catalogue.only(kept)


def parse_range(option: str, text: str, unit: str) -> tuple[float, float]:
    """Both ends of MIN..MAX in SI units, of which one may be left out. Raises InputError."""
    low, dots, high = text.partition("..")
    try:
        if not dots or not (low.strip() or high.strip()):
            raise ValueError("expected MIN..MAX, such as 0.5..2, 0.5.. or ..2")
        ends = (
            parse_number(low.strip(), unit) if low.strip() else 0.0,
            parse_number(high.strip(), unit) if high.strip() else float("inf"),
        )
        if ends[0] > ends[1]:
            raise ValueError("the first number is larger than the second; exchange them")
    except ValueError as error:
        raise InputError(f"{option} {format_value(text)}: {error}") from None
    return ends


def _show(arguments: argparse.Namespace, catalogue: Catalogue) -> int:
    from bellcrank.actuators.conditions import Conditions
    from bellcrank.actuators.motor import Motor
    from bellcrank.actuators.motor_plot import write_motor_plot
    from bellcrank.commands.catalogue_tables import product_text

    if not arguments.names:
        raise InputError("show: expected the id of a product; `bellcrank catalogue` lists them")
    voltage = number_option("--voltage", arguments.voltage, "V", above=0.0)
    products = [catalogue.product(name) for name in arguments.names]
    if arguments.out is not None and len(products) > 1:
        raise InputError(f"--out {arguments.out}: names one picture, and {len(products)} products are to be shown")
    drawn = [] if arguments.no_plots else [one for one in products if isinstance(one, Motor)]
    pictures = {one.id: arguments.out or default_place(f"{one.id}.png") for one in drawn}
    for path in pictures.values():
        check_file("--out", path)
    for product in products:
        print(product_text(product))
        if isinstance(product, Motor) and product.id in pictures:
            path = write_motor_plot(product, pictures[product.id], Conditions(voltage=voltage))
            print(f"wrote {path}")
    return 0


def _check(arguments: argparse.Namespace) -> int:
    from bellcrank.actuators.catalogue.catalogue import SHIPPED
    from bellcrank.actuators.catalogue.catalogue_checks import contradictions
    from bellcrank.actuators.catalogue.catalogue_files import read_products
    from bellcrank.commands.catalogue_tables import check_text

    paths = [Path(name) for name in (*arguments.names, *arguments.catalogue)]
    own = read_products(paths or [SHIPPED])
    if paths and not arguments.own:
        read_products([SHIPPED, *(path for path in paths if not path.resolve().is_relative_to(SHIPPED))])
    print(check_text(own))
    return 1 if contradictions(one.product for one in own) else 0
