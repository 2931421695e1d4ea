"""`bellcrank replay`: the replay of a run, scene, sizing or selection as one HTML page, as a still or as a film."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank.commands.options import add_live, number_option, output_path, size_option
from bellcrank.commands.result_argument import add_other, add_result_argument, compute_or_load, stem, verdict_of
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import check_file, default_place
from bellcrank.files.temporaries import temporary_folder
from bellcrank.terminal.progress import counting

if TYPE_CHECKING:
    from bellcrank.replays.geometry.meshes import Detail

PICTURES = ("png", "gif", "mp4")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to show, and where to write."""
    add_result_argument(parser)
    add_other(parser)
    parser.add_argument(
        "--out", type=output_path, metavar="FILE", help="the page (default: RUN.html in the current folder)"
    )
    parser.add_argument(
        "--trace", action="append", default=[], metavar="FRAME", help="draw the path of this frame; may be repeated"
    )
    parser.add_argument("--full-meshes", action="store_true", help="do not simplify the meshes")
    parser.add_argument("--no-plots", action="store_true", help="leave the plots out of the page")
    add_live(parser)
    parser.add_argument("--open", action="store_true", help="open the page in the web browser")
    films = parser.add_argument_group(
        "stills and films", "rendered by headless Chromium; the page itself is written only with --out or --open"
    )
    films.add_argument("--png", type=output_path, metavar="FILE", help="write a still as PNG")
    films.add_argument("--at", metavar="S", help="time of the still, s (default: the end)")
    films.add_argument("--gif", type=output_path, metavar="FILE", help="write the replay as GIF")
    films.add_argument("--mp4", type=output_path, metavar="FILE", help="write the replay as MP4")
    films.add_argument("--speed", metavar="X", help="playback speed relative to real time (default: 1)")
    films.add_argument("--fps", metavar="N", help="frames per second (default: 15 for GIF, 30 for MP4)")
    films.add_argument("--window", metavar="WxH", default="960x720", help="size in pixels (default: 960x720)")


def run(arguments: argparse.Namespace) -> int:
    """Write the replay. Exit code 0 or 1 as `verdict_of` says. Raises BellcrankError for invalid input."""
    from bellcrank.replays.page.page import NOTHING, write_page
    from bellcrank.replays.replay import film_of, film_over, open_browser, told_apart
    from bellcrank.reports.report import compared_surroundings

    pictures = {kind: path for kind in PICTURES if (path := getattr(arguments, kind)) is not None}
    for kind, path in pictures.items():
        if path.suffix.lower() != f".{kind}":
            raise InputError(f"--{kind} {path}: expected a name that ends in .{kind}")
    wanted = bool(arguments.out or arguments.open or not pictures)  # the page itself
    out = arguments.out or default_place(f"{stem(arguments.run)}.html")
    for option, path in {**pictures, **({"out": out} if wanted else {})}.items():
        check_file(f"--{option}", path)
    draw = _drawing(arguments, pictures)
    if pictures:
        from bellcrank.replays.page.rendering import check_rendering_tools

        check_rendering_tools(pictures)
    result = compute_or_load(arguments)
    detail: Detail = "full" if arguments.full_meshes else "reduced"
    computes = arguments.live if wanted and arguments.other is None and not arguments.no_plots else False
    film = film_of(result, trace=arguments.trace, detail=detail, live=computes)
    verdicts, around, first = [verdict_of(result)], NOTHING, arguments.run
    if arguments.other is not None:
        arguments.run = arguments.other
        other = compute_or_load(arguments)
        verdicts.append(verdict_of(other))
        second = film_of(other, trace=arguments.trace, detail=detail)
        film, second = told_apart(film, second, (stem(first), stem(arguments.other)))
        around = compared_surroundings((result, film), (other, second))
        film = film_over(film, second)
    with temporary_folder("replay") as folder:
        target = out if wanted else folder / "replay.html"
        page = write_page(film, target, plots=wanted and not arguments.no_plots, around=around if wanted else NOTHING)
        files = [draw(kind, page, path) for kind, path in pictures.items()]
    print("\n".join(verdict for _, verdict in verdicts))
    for name, text in (*film.facts, *(("note", note) for note in film.notes)):
        if name.rpartition(": ")[2] in ("error", "warning", "not known", "note"):
            print(f"{name}: {text}")
    for path in ([page] if wanted else []) + files:
        print(f"wrote {path} ({path.stat().st_size / 1e6:.2f} MB)")
    if arguments.open:
        open_browser(page)
    return 0 if all(success for success, _ in verdicts) else 1


def _drawing(arguments: argparse.Namespace, kinds: Iterable[str]) -> Callable[[str, Path, Path], Path]:
    """A function that draws a picture of a kind from a page into a file; options are checked first (InputError)."""
    from bellcrank.replays.page.rendering import MOST_FPS

    most_fps = min((MOST_FPS[f".{kind}"] for kind in kinds if f".{kind}" in MOST_FPS), default=max(MOST_FPS.values()))
    speed = number_option("--speed", arguments.speed, above=0.0)
    fps = number_option("--fps", arguments.fps, least=1.0, most=most_fps)
    at = number_option("--at", arguments.at, "s")
    size = size_option("--window", arguments.window, 64, 4096)

    def draw(kind: str, page: Path, path: Path) -> Path:
        from bellcrank.replays.page.rendering import render_still, render_video

        if kind == "png":
            return render_still(page, path, at, size)
        with counting(kind, "frame") as progress:
            return render_video(page, path, 1.0 if speed is None else speed, fps, size, progress)

    return draw
