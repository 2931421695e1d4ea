"""`bellcrank demo`: a gallery of bundled robots and scenes, computed on this machine."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Literal
from urllib.parse import quote

from bellcrank.commands.options import output_path
from bellcrank.commands.result_argument import verdict_of
from bellcrank.commands.robots import title_and_uses

_STYLE = """
body { margin: 0; padding: clamp(.75rem, 4vw, 1.5rem); font: 16px/1.5 system-ui, sans-serif;
  color: #1b2430; background: #f4f6f9; }
main { display: grid; gap: 1.25rem; grid-template-columns: repeat(auto-fill, minmax(min(100%, 26rem), 1fr)); }
article { background: white; border: 1px solid #d5dbe3; border-radius: .6rem; overflow: hidden; }
iframe { width: 100%; height: 26rem; border: 0; border-bottom: 1px solid #d5dbe3; display: block; }
h2 { font-size: 1.05rem; margin: .8rem 1rem .2rem; }
p { margin: 0 1rem .6rem; }
code { background: #eef1f5; padding: .1rem .3rem; border-radius: .2rem; overflow-wrap: anywhere; }
a { color: #0072b2; }
"""
FOLDER = "bellcrank_demo"
INDEX = "index.html"


@dataclass(frozen=True)
class Exhibit:
    """One page of a gallery.

    Attributes:
        page: The name of the page's file, in the gallery's folder.
        title: Its title.
        result: What came out, in one sentence.
        command: The command that makes it.
        report: The name of the file of its report; "" where there is none.
    """

    page: str
    title: str
    result: str
    command: str
    report: str = ""


def gallery_html(title: str, exhibits: Sequence[Exhibit]) -> str:
    """The gallery as one HTML page; it refers to the pages in its folder. All texts are escaped."""
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{_STYLE}</style></head>"
        f"<body><h1>{escape(title)}</h1><main>{''.join(map(_exhibit_html, exhibits))}</main></body></html>\n"
    )


def _exhibit_html(exhibit: Exhibit) -> str:
    links = f'<a href="{quote(exhibit.page)}">Open</a>'
    if exhibit.report:
        links += f' · <a href="{quote(exhibit.report)}">Report</a>'
    return (
        f'<article><iframe src="{quote(exhibit.page)}" title="{escape(exhibit.title)}" loading="lazy"></iframe>'
        f"<h2>{escape(exhibit.title)}</h2><p>{escape(exhibit.result)}</p>"
        f"<p><code>{escape(exhibit.command)}</code></p><p>{links}</p></article>"
    )


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
