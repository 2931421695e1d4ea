"""`bellcrank select`: tables on screen; selection.csv, selection.json and pictures in a folder."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank.commands.options import (
    add_accept_unknown,
    add_allow_massless,
    add_limit,
    add_page,
    add_set,
    add_trust,
    list_on_failure,
    number_option,
    output_path,
    page_of,
    parse_limit,
    parse_payload,
    scene_with_changes,
    whole_option,
    written,
)
from bellcrank.config.fields import Fields
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import check_file, check_folder, default_place
from bellcrank.messages import format_value, unknown_name

if TYPE_CHECKING:
    from bellcrank.actuators.catalogue.catalogue import Catalogue
    from bellcrank.sizing.selection.selection import Selection
    from bellcrank.studies.selection.design_selection import DesignSelection

DESIGNS = ("designs.csv", "designs.json")
OBJECTIVES = ("mass", "cost", "loss", "margin")
MOST_CANDIDATES = 1000

MAIN_OPTIONS = (  # the others are listed by --help-all
    "--motion", "--catalogue", "--objective", "--keep", "--payload", "--voltage", "--safety-factor",
    "--write-config", "--page", "--over", "--out",
)  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The robot and its motions, what to choose from and for, and where to write."""
    parser.add_argument(
        "robot",
        metavar="ROBOT",
        help="a robot configuration or URDF: a path, or a name that `bellcrank robots` lists",
    )
    _repeated(
        parser,
        "--motion",
        "FILE|NAME",
        "a CSV file, or a motion of the configuration; may be repeated (default: all motions of ROBOT)",
    )
    _repeated(
        parser,
        "--payload",
        "MASS@FRAME",
        "a point mass fixed to a frame, such as 2.5@tool0 (kg) or '500 g@tool0'; may be repeated",
    )
    _repeated(
        parser,
        "--catalogue",
        "DIR",
        "a folder of CSV files, or one file, with motors and gears besides those that come with bellcrank; may be "
        "repeated",
    )
    parser.add_argument(
        "--objective",
        choices=OBJECTIVES,
        default="mass",
        help="choose for least total mass, cost or loss, or for the largest margin (default: mass)",
    )
    _repeated(
        parser,
        "--keep",
        "JOINT=MOTOR[+GEAR]",
        "the motor, and the gear, of a joint are given by their ids; may be repeated",
    )
    _repeated(
        parser,
        "--vary",
        "PATH=VALUES",
        "choose the size of a parameter too: of values as for `bellcrank sweep`, upper_arm=0.9,1.0,1.1, or within a "
        "range, upper_arm=0.9:1.1; may be repeated",
    )
    parser.add_argument("--samples", metavar="N", help="number of points over the ranges of --vary (default: 32)")
    _repeated(parser, "--exclude", "ID|MAKER", "leave out a product or a maker; may be repeated")
    _repeated(parser, "--maker", "MAKER", "choose from the products of this maker only; may be repeated")
    add_limit(parser, "a limit that the chosen drives must keep when they are simulated along the motions")
    add_conditions(parser)
    add_set(parser, "payloads.1.mass='5 kg' or motions.NAME.speed_factor=1.2")
    parser.add_argument(
        "--no-feedback",
        action="store_true",
        help="do not add the masses of motors and gears to the robot's, because its URDF contains them",
    )
    parser.add_argument("--top", metavar="N", help="list N pairs of each joint in the files (default: 12)")
    parser.add_argument(
        "--write-config",
        type=Path,
        metavar="FILE",
        help="write a robot configuration with the chosen motors and gears, which size, simulate and replay open",
    )
    add_page(parser, "the report of the selection", "report.html in DIR", "--report")
    parser.add_argument(
        "--over",
        metavar="FILE",
        help="compare in the page with the motors and gears that another robot configuration names, such as "
        "--write-config writes, under its own conditions",
    )
    add_accept_unknown(parser)
    add_allow_massless(parser)
    add_trust(parser)
    parser.add_argument(
        "--out", type=output_path, metavar="DIR", help="output folder (default: ROBOT_selection in the current folder)"
    )
    parser.add_argument("--no-plots", action="store_true", help="do not write pictures")


def _repeated(parser: argparse.ArgumentParser, option: str, metavar: str, meaning: str) -> None:
    parser.add_argument(option, action="append", default=[], metavar=metavar, help=meaning)


def add_conditions(parser: argparse.ArgumentParser) -> None:
    """Supply, surroundings and safety: an option for each field of `Conditions`, of the same name."""
    for name, metavar, meaning in (
        ("voltage", "V", "voltage of the DC bus (default: the nominal voltage of each motor)"),
        ("voltage_ratio", "R", "how many times higher or lower than a motor's nominal voltage it may be (default: 2)"),
        ("voltage_reserve", "SHARE", "share of the voltage that is kept for control (default: 10%%)"),
        ("winding_temperature", "°C", "winding temperature for which the voltage limit is computed (default: 25)"),
        ("ambient", "°C", "ambient temperature (default: 25)"),
        ("altitude", "M", "altitude of the site above sea level, m (default: 0)"),
        ("safety_factor", "F", "factor on the loads before they are compared with limits (default: 1)"),
        ("inertia_ratio", "R", "largest inertia of load and gear over the rotor's, at the shaft (default: 10)"),
        ("life", "HOURS", "life that gears must reach (L10)"),
        ("bus_capacitance", "F", "capacitance of the DC bus, which stores regenerated energy"),
        ("bus_max_voltage", "V", "voltage of the bus at which the brake resistor switches on"),
        ("brake_resistor_power", "W", "continuous power of the brake resistor"),
        ("brake_resistance", "Ω", "resistance of the brake resistor, which takes at most U²/R"),
        ("brake_resistor_peak_power", "W", "what the brake resistor may take in a pulse"),
        ("supply_power", "W", "largest power of the supply"),
    ):
        parser.add_argument(_option(name), metavar=metavar, help=meaning)
    parser.add_argument(_option("commutation"), choices=("brushed", "brushless"), help="such motors only")
    parser.add_argument(
        _option("construction"),
        choices=("housed", "frameless"),
        help="motors with a housing only, or rotors and stators without one",
    )
    parser.add_argument(
        "--brake",
        action=argparse.BooleanOptionalAction,
        help="each motor must have a brake that holds the load at rest",
    )
    _repeated(
        parser,
        "--momentary-load",
        "JOINT=TORQUE",
        "a torque that happens rarely, such as in an emergency stop, for the gear's momentary limit: elbow='80 N m'; "
        "may be repeated",
    )
    _repeated(
        parser,
        "--assume",
        "FIELD=VALUE",
        "a value for the products that do not state it, such as gear.efficiency=0.7; may be repeated",
    )


def _option(name: str) -> str:
    """The option of a condition."""
    return f"--{name.replace('_', '-')}"


def run(arguments: argparse.Namespace) -> int:
    """Select motors and gears. Exit code 0: every axis has a pair that passes; 1: an axis has none, a main criterion of
    a chosen pair is unknown, or a limit of the whole robot is exceeded. Raises BellcrankError for invalid input.
    """
    from bellcrank.files.json_files import list_files
    from bellcrank.present.tables import wrapped
    from bellcrank.sizing.selection.select import select
    from bellcrank.sizing.selection.selection_files import FILES, REPORT, RESULTS, earlier_files, write_results
    from bellcrank.sizing.selection.tables import table, verdict
    from bellcrank.sizing.selection.written_config import check_target
    from bellcrank.sizing.sizing_files import remove_stale

    payloads = [parse_payload(text) for text in arguments.payload]
    limits = dict(map(parse_limit, arguments.limit))
    kept, count = parse_kept(arguments.keep), whole_option("--top", arguments.top, 1, MOST_CANDIDATES)
    given = conditions(arguments)
    folder = arguments.out or default_place(f"{Path(arguments.robot).stem}_selection")
    check_folder("--out", folder, (*FILES, *DESIGNS))
    if arguments.samples is not None and not arguments.vary:
        raise InputError("--samples: nothing is sampled without a range of --vary, such as upper_arm=0.9:1.1")
    if arguments.vary and limits:
        raise InputError("--limit: not with --vary; judge the best design with `bellcrank judge --simulate`")
    page = page_of(arguments, folder / REPORT)
    if arguments.over is not None and page is None:
        raise InputError("--over: selections are compared in a page; add --page")
    scene = scene_with_changes(arguments.robot, arguments.changes, arguments.trust)
    config = scene.config
    if arguments.write_config is not None:
        check_file("--write-config", arguments.write_config)
        check_target(arguments.write_config, config)
    own = [] if config.catalogue is None else [str(config.catalogue)]
    catalogue = products([*own, *arguments.catalogue], arguments.exclude, arguments.maker)
    settings: dict[str, Any] = {
        "conditions": given, "keep": kept, "feedback": not arguments.no_feedback, "candidates": count or 12,
        "payloads": payloads, "allow_massless": arguments.allow_massless,
    }  # fmt: skip
    other = None if arguments.over is None else named_drives(arguments)
    designs = None
    try:
        if arguments.vary:
            designs = _designs(arguments, catalogue, settings)
            selection = designs.selection
        else:
            selection = select(
                scene,
                arguments.motion or None,
                catalogue,
                arguments.objective,
                simulated_limits=limits or None,
                **settings,
            )
    except InputError as error:
        if error.argument != "keep":
            raise
        raise InputError(error.reason, "--keep") from None
    if designs is not None:
        print(f"{designs.table()}\n")
        for note in designs.notes:
            print(f"{note.label}: {note}")
    earlier, files = earlier_files(folder), list[Path]()
    with list_on_failure(files, folder), ExitStack() as beside:
        pictures = None
        if not arguments.no_plots:
            from bellcrank.sizing.selection.plots import plots_aside

            pictures = beside.enter_context(plots_aside(selection, folder))
        print(table(selection))
        for text in selection.warnings:
            print(wrapped(f"note: {text}", "", "  "))
        files += write_results(selection, folder)
        if designs is not None:
            files += [designs.to_csv(folder / DESIGNS[0]), designs.to_json(folder / DESIGNS[1])]
        if pictures is not None:
            files += pictures()
        if page is not None:
            from bellcrank.reports.report import report

            files.append(report(selection, page, over=other))
        list_files(files[1], RESULTS, [path.name for path in files if path.parent == folder])
    remove_stale(folder, earlier, files)
    if selection.verification is not None:
        print(f"\n{selection.verification}")
    print(f"\n{verdict(selection)}\n{written(files, folder)}")
    if arguments.write_config is not None:
        _write_config(selection, arguments.write_config)
    if designs is not None and not designs.complete:
        return 130
    return 0 if selection.verified or (arguments.accept_unknown and selection.inside) else 1


def named_drives(arguments: argparse.Namespace) -> Selection:
    """The motors and gears that the configuration of --over names, as a selection. Raises InputError."""
    from bellcrank.actuators.catalogue.catalogue import Catalogue
    from bellcrank.actuators.gear import DIRECT
    from bellcrank.scene.scene import load_scene
    from bellcrank.sizing.selection.select import select

    scene = load_scene(arguments.over, trust=arguments.trust)
    drives = {name: one for name, one in scene.config.actuators.items() if not one.by_ratings}
    motors = dict.fromkeys(one.motor for one in drives.values())
    gears = dict.fromkeys(one.gear for one in drives.values() if one.gear.id != DIRECT.id)
    kept = {
        name: one.motor.id if one.motor.kind == "actuator" else f"{one.motor.id}+{one.gear.id}"
        for name, one in drives.items()
    }
    selection = None
    if drives:
        selection = select(
            scene,
            arguments.motion or None,
            Catalogue(tuple(motors), tuple(gears)),
            keep=kept,
            feedback=not arguments.no_feedback,
            allow_massless=arguments.allow_massless,
        )
    without = [] if selection is None else [one.axis.name for one in selection.axes if not one.kept]
    if selection is None or without:
        names = f"; it names none for {', '.join(without)}" if without else ""
        raise InputError(
            f"--over {arguments.over}: expected a robot configuration that names motors and gears of a catalogue, such "
            f"as --write-config writes{names}"
        )
    return replace(selection, proof="every pair was given")


def _designs(arguments: argparse.Namespace, catalogue: Catalogue, settings: dict[str, Any]) -> DesignSelection:
    """The best of the designs that --vary asks for. Raises BellcrankError as `select_designs`."""
    from bellcrank.scene.overrides import parse_assignment
    from bellcrank.scene.scene import load_scene
    from bellcrank.studies.designs.axes import parse_axis
    from bellcrank.studies.selection.select_designs import MOST_DESIGNS, select_designs
    from bellcrank.terminal import interruption
    from bellcrank.terminal.progress import counting

    vary: dict[str, Any] = {}
    for text in arguments.vary:
        path, values = _range(text) or parse_axis(text)
        if path in vary:
            raise InputError(f"--vary {text!r}: '{path}' is varied already")
        vary[path] = values
    scene = load_scene(arguments.robot, trust=arguments.trust)
    changes = dict(parse_assignment(text) for text in arguments.changes)
    with counting("designs", " designs") as bar, interruption.held() as check:

        def progress(done: float, of: float | None) -> None:
            check()
            bar(done, of)

        return select_designs(
            scene, vary, arguments.motion or None, catalogue, arguments.objective, overrides=changes or None,
            progress=progress, samples=whole_option("--samples", arguments.samples, 1, MOST_DESIGNS), **settings,
        )  # fmt: skip


def _range(text: str) -> tuple[str, Any] | None:
    """Path and range of "path=lower:upper"; None for anything else. Raises InputError."""
    from bellcrank.config.yaml_file import read_value

    path, _, given = text.partition("=")
    ends = given.split(":")
    if len(ends) != 2 or not path.strip() or not all(end.strip() for end in ends):
        return None
    lower, upper = (read_value(end, f"--vary {text!r}") for end in ends)
    return path.strip(), {"lower": lower, "upper": upper}


def conditions(arguments: argparse.Namespace) -> dict[str, Any]:
    """The conditions that the options give, by the names of the fields. Raises InputError, which names the option."""
    from bellcrank.actuators.actuator_fields import UNITS
    from bellcrank.actuators.catalogue.product_checks import POSITIVE
    from bellcrank.actuators.conditions import CHOICES, RANGES

    given: dict[str, Any] = {}
    for name, unit in UNITS.items():
        limits = RANGES.get(name, POSITIVE)
        most = None if limits.most == POSITIVE.most else limits.most
        given[name] = number_option(
            _option(name), getattr(arguments, name), unit, above=limits.above, least=limits.least, most=most
        )
    given |= {name: getattr(arguments, name) for name in CHOICES}
    given |= {
        "brake": arguments.brake,
        "momentary_loads": parse_momentary(arguments.momentary_load) or None,
        "assume": parse_assumed(arguments.assume) or None,
    }
    return {name: value for name, value in given.items() if value is not None}


def parse_momentary(texts: list[str]) -> dict[str, float]:
    """Torques (N m or N) by joint from JOINT=TORQUE. Raises InputError."""
    found: dict[str, float] = {}
    for text in texts:
        joint, equals, value = (part.strip() for part in text.partition("="))
        option = f"--momentary-load {format_value(text)}"
        if not equals or not joint or not value:
            raise InputError(f"{option}: expected JOINT=TORQUE, such as elbow='80 N m'")
        if joint in found:
            raise InputError(f"{option}: '{joint}' is given twice; keep one")
        found[joint] = Fields({joint: value}, option).number(joint, "N m or N", nonnegative=True)
    return found


def parse_kept(texts: list[str]) -> dict[str, str]:
    """Pairs by joint from JOINT=MOTOR[+GEAR]. Raises InputError."""
    kept: dict[str, str] = {}
    for text in texts:
        joint, equals, pair = (part.strip() for part in text.partition("="))
        if not equals or not joint or not pair:
            raise InputError(f"--keep {format_value(text)}: expected JOINT=MOTOR or JOINT=MOTOR+GEAR, with their ids")
        if joint in kept:
            raise InputError(f"--keep {format_value(text)}: the motor of '{joint}' is given twice; keep one")
        kept[joint] = pair
    return kept


def parse_assumed(texts: list[str]) -> dict[str, float]:
    """Values by field from FIELD=VALUE, with the units of catalogues. Raises InputError."""
    from bellcrank.actuators.catalogue.product_fields import product_number

    found: dict[str, float] = {}
    for text in texts:
        field, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not field or not value:
            raise InputError(f"--assume {format_value(text)}: expected FIELD=VALUE, such as gear.efficiency=0.7")
        if field in found:
            raise InputError(f"--assume {format_value(text)}: '{field}' is given twice; keep one")
        found[field] = product_number(Fields({field: value}, f"--assume {format_value(text)}"), field)
    return found


def products(folders: list[str], excluded: list[str], makers: list[str]) -> Catalogue:
    """What to choose from: the bundled catalogue and own folders, less what is excluded. Raises InputError."""
    from bellcrank.actuators.catalogue.catalogue import load_catalogue

    catalogue = load_catalogue(*folders)
    left_out: set[str] = set()
    for text in excluded:
        own = {one.id for one in catalogue.products if text.casefold() in (one.id.casefold(), one.maker.casefold())}
        if not own:
            known = [*sorted({one.maker for one in catalogue.products}), *(one.id for one in catalogue.products)]
            raise InputError(f"--exclude: {unknown_name('product or maker', text, known)}")
        left_out |= own
    try:
        chosen = catalogue.filtered(makers=makers)
    except InputError as error:
        raise InputError(f"--maker: {error}") from None
    catalogue = chosen.filtered(exclude=left_out & {one.id for one in chosen.products})
    if not catalogue.motors:
        raise InputError("--maker, --exclude: no motor is left to choose from; name other makers, or exclude less")
    return catalogue


def _write_config(selection: object, path: Path) -> None:
    """Write the robot configuration of a selection, unless an axis has no motor."""
    from bellcrank.sizing.selection.selection import Selection
    from bellcrank.sizing.selection.written_config import write_config

    assert isinstance(selection, Selection)
    if any(one.chosen is None for one in selection.axes):
        print(f"{path} is not written, because not every axis has a motor")
        return
    _, notes = write_config(selection, path)
    for text in notes:
        print(f"note: {path}: {text}")
    print(f"wrote {path}")
