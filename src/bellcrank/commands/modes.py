"""`bellcrank modes`: a table of a scene's modes on screen; a page in which they move, and files, in a folder."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank.commands.options import add_set, add_trust, list_on_failure, number_option, output_path
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import check_folder, default_place
from bellcrank.messages import unknown_name
from bellcrank.notes import reached
from bellcrank.terminal.progress import counting

if TYPE_CHECKING:
    from bellcrank.analysis.root_loci import RootLoci
    from bellcrank.scene.scene import Scene

AT = ("start", "equilibrium", "steady")
NAMES = ("modes.json", "modes.mat", "modes.html", "root_loci.png", "root_loci.csv", "root_loci.json")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The scene, the operating point, what to vary, and where to write."""
    parser.add_argument(
        "scene", metavar="SCENE", help="a scene or robot configuration: a path, or a name that `bellcrank robots` lists"
    )
    parser.add_argument(
        "--at", metavar="WHAT",
        help="the operating point: equilibrium or steady (the nearest one to the start), start (as it is), or a time "
        "of a run, s (default: steady where the start moves and a steady motion is found, else equilibrium)",
    )  # fmt: skip
    parser.add_argument(
        "--vary", metavar="PATH=VALUES",
        help="also draw root loci over a parameter or another number of the scene: PATH=FIRST:LAST:COUNT or PATH=A,B,C",
    )  # fmt: skip
    parser.add_argument(
        "--period", metavar="S",
        help="of a periodic motion, s: its Floquet multipliers instead of modes, from the start or the time of --at",
    )  # fmt: skip
    parser.add_argument(
        "--input", action="append", default=None, metavar="JOINT", dest="inputs",
        help="a joint whose torque or force is an input of B and D; may be repeated (default: the joints with motors, "
        "or all)",
    )  # fmt: skip
    add_set(parser, "initial.swing='175 deg'")
    add_trust(parser)
    parser.add_argument(
        "--out", type=output_path, metavar="DIR", help="output folder (default: SCENE_modes in the current folder)"
    )
    parser.add_argument("--no-page", action="store_true", help="do not write the page in which the modes move")


def run(arguments: argparse.Namespace) -> int:
    """Linearise a scene. Exit code 0: no mode grows; 1: a mode grows, or the operating point is not steady, so that its
    eigenvalues say nothing of stability. Raises BellcrankError for invalid input.
    """
    from bellcrank.analysis.linearise import linearise
    from bellcrank.scene.overrides import parse_assignment
    from bellcrank.scene.scene import load_scene

    at = _operating_point(arguments.at)
    period = number_option("--period", arguments.period, "s", above=0.0)
    if period is not None and (arguments.vary is not None or (isinstance(at, str) and at != "start")):
        raise InputError("--period: a periodic motion begins at the start or at a time (--at), without --vary")
    folder = arguments.out or default_place(f"{Path(arguments.scene).stem}_modes")
    check_folder("--out", folder, NAMES)
    changes = dict(parse_assignment(text) for text in arguments.changes)
    scene = load_scene(arguments.scene, changes, trust=arguments.trust)
    if period is not None:
        return _floquet(scene, period, at if isinstance(at, float) else 0.0, folder)
    linear = linearise(scene, at, inputs=arguments.inputs)
    print(linear.table())
    loci = None if arguments.vary is None else _loci(scene, arguments.vary, at)
    files = [folder / "modes.json"]
    linear.to_json(files[0])
    with list_on_failure(files, folder):
        linear.to_mat(folder / "modes.mat")
        files.append(folder / "modes.mat")
        if loci is not None:
            _write_loci(loci, folder, files)
        if linear.steady and linear.modes and not arguments.no_page:
            from bellcrank.reports.modes_page import write_modes_page

            files.append(write_modes_page(scene, linear, folder / "modes.html", loci))
    print(f"\nwrote {', '.join(path.name for path in files)} in {folder}")
    return 0 if linear.stable and not reached(linear.notes) else 1


def _floquet(scene: Scene, period: float, at: float, folder: Path) -> int:
    """Print and write the Floquet multipliers of a periodic motion; returns the exit code."""
    from bellcrank.analysis.floquet import floquet

    found = floquet(scene, period, at)
    print(found.table())
    found.to_json(folder / "modes.json")
    print(f"\nwrote modes.json in {folder}")
    return 0 if found.stable and not reached(found.notes) else 1


def _operating_point(text: str | None) -> str | float | None:
    """The operating point that --at names. Raises InputError."""
    if text is None or text in AT:
        return text
    if not any(letter.isdigit() for letter in text):
        raise InputError(f"--at: {unknown_name('operating point', text, AT)}, or a time (s)")
    return number_option("--at", text, "s", least=0.0)


def _loci(scene: Scene, text: str, at: str | float | None) -> RootLoci:
    from bellcrank.analysis.root_loci import root_loci
    from bellcrank.studies.designs.axes import parse_axis, read_axis

    if isinstance(at, float):
        raise InputError("--vary: root loci require a steady operating point; leave the time of --at out")
    path, values = parse_axis(text)
    axis = read_axis(scene, path, values)
    if axis.distribution is not None:
        raise InputError(f"--vary {text!r}: expected PATH=FIRST:LAST:COUNT or PATH=A,B,C, found a distribution")
    with counting("modes", " values") as progress:
        found = root_loci(scene, path, axis.values, at, progress=progress)
    for value, why in found.failures:
        print(f"note: {path} = {value}: {why}")
    return found


def _write_loci(loci: RootLoci, folder: Path, files: list[Path]) -> None:

    loci.plot(folder / "root_loci.png")
    files.append(folder / "root_loci.png")
    files.append(loci.to_csv(folder / "root_loci.csv"))
    files.append(loci.to_json(folder / "root_loci.json"))
