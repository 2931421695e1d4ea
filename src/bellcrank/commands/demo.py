"""`bellcrank demo`: a gallery of bundled robots and scenes, computed on this machine."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from bellcrank.commands.options import output_path
from bellcrank.commands.result_argument import verdict_of
from bellcrank.commands.robots import title_and_uses

if TYPE_CHECKING:
    from bellcrank.reports.gallery import Exhibit

FOLDER = "bellcrank_demo"
INDEX = "index.html"


@dataclass(frozen=True)
class Demonstration:
    """One bundled result: the name of its configuration or scene, and the command that makes it."""

    name: str
    command: Literal["simulate", "size"]


DEMONSTRATIONS = (
    Demonstration("planar_2r", "size"),
    Demonstration("four_bar", "simulate"),
    Demonstration("five_bar", "size"),
    Demonstration("rolling_disk", "simulate"),
    Demonstration("spring_pendulum", "simulate"),
    Demonstration("bricard", "simulate"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Where to write."""
    parser.add_argument(
        "--out", type=output_path, metavar="DIR", help=f"the folder (default: {FOLDER} in the current folder)"
    )
    parser.add_argument("--open", action="store_true", help="open the gallery in the web browser")


def run(arguments: argparse.Namespace) -> int:
    """Write the pages and the gallery. Raises InputError where the folder cannot be written."""
    from bellcrank.files.atomic_write import check_folder, default_place, write_text
    from bellcrank.replays.replay import open_browser
    from bellcrank.reports.gallery import gallery_html
    from bellcrank.terminal.progress import counting

    folder: Path = arguments.out or default_place(FOLDER)
    check_folder("--out", folder, [INDEX, *(f"{it.name}.html" for it in DEMONSTRATIONS)])
    folder.mkdir(parents=True, exist_ok=True)
    exhibits = []
    with counting("demo", " pages") as progress:
        for done, demonstration in enumerate(DEMONSTRATIONS):
            progress(done, len(DEMONSTRATIONS))
            exhibits.append(_exhibit(demonstration, folder))
            print(f"{demonstration.name}: {exhibits[-1].result}", flush=True)
        progress(len(DEMONSTRATIONS), len(DEMONSTRATIONS))
    write_text(folder / INDEX, gallery_html("What bellcrank does", exhibits))
    print(f"wrote {folder / INDEX}")
    if arguments.open:
        open_browser(folder / INDEX)
    return 0


def _exhibit(demonstration: Demonstration, folder: Path) -> Exhibit:
    """Compute one result and write its page."""
    from bellcrank.replays.replay import replay
    from bellcrank.reports.gallery import Exhibit
    from bellcrank.reports.report import report
    from bellcrank.scene.robot_config import names
    from bellcrank.scene.scene import load_scene
    from bellcrank.simulation.simulate import simulate
    from bellcrank.sizing.size import size

    name = demonstration.name
    title = title_and_uses(names()[name])[0]
    page, about = folder / f"{name}.html", folder / f"{name}_report.html"
    if demonstration.command == "size":
        sizing = size(name)
        replay(sizing, page)
        report(sizing, about)
        return Exhibit(page.name, title, verdict_of(sizing)[1], f"bellcrank size {name}", about.name)
    trajectory = simulate(load_scene(name))
    replay(trajectory, page)
    drift = f"energy drift {trajectory.energy_drift():.1e}" if trajectory.success else trajectory.status
    result = f"{trajectory.time[-1]:.1f} s, {trajectory.statistics.steps} steps, {drift}"
    return Exhibit(page.name, title, result, f"bellcrank simulate {name}")
