"""`bellcrank report`: a run or a sizing on one page, the verdict first."""

from __future__ import annotations

import argparse
from pathlib import Path

from bellcrank.commands.shown import add_shown, remarks_of, shown, stem, verdict_of
from bellcrank.files.atomic_write import check_file, default_place


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to report, and where to write."""
    add_shown(parser)
    parser.add_argument("--out", type=Path, metavar="FILE", help="the page (default: RUN_report.html, here)")
    parser.add_argument(
        "--trace", action="append", default=[], metavar="FRAME", help="draw the path of this frame; may be repeated"
    )
    parser.add_argument("--open", action="store_true", help="open the page in the web browser")


def run(arguments: argparse.Namespace) -> int:
    """Write the report; 0 where the answer is yes, 1 where it is no. BellcrankError for bad input."""
    from bellcrank.replays.replay import open_browser
    from bellcrank.reports.report import report

    out = arguments.out or default_place(f"{stem(arguments.run)}_report.html")
    check_file("--out", out)
    thing = shown(arguments)
    path = report(thing, out, trace=arguments.trace)
    well, verdict = verdict_of(thing)
    print(verdict)
    for name, text in remarks_of(thing):
        print(f"{name}: {text}")
    print(f"wrote {path} ({path.stat().st_size / 1e6:.2f} MB)")
    if arguments.open:
        open_browser(path)
    return 0 if well else 1
