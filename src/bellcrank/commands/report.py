"""`bellcrank report`: the report of a run, a sizing or a selection, or of two that are compared, as one HTML page."""

from __future__ import annotations

import argparse

from bellcrank.commands.options import add_live, output_path
from bellcrank.commands.result_argument import (
    add_other,
    add_result_argument,
    compute_or_load,
    remarks_of,
    stem,
    verdict_of,
)
from bellcrank.files.atomic_write import check_file, default_place


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to report, and where to write."""
    add_result_argument(parser)
    add_other(parser)
    parser.add_argument(
        "--out", type=output_path, metavar="FILE", help="the page (default: RUN_report.html in the current folder)"
    )
    parser.add_argument(
        "--trace", action="append", default=[], metavar="FRAME", help="draw the path of this frame; may be repeated"
    )
    add_live(parser)
    parser.add_argument("--open", action="store_true", help="open the page in the web browser")


def run(arguments: argparse.Namespace) -> int:
    """Write the report. Exit code 0 or 1 as `verdict_of` says. Raises BellcrankError for invalid input."""
    from bellcrank.replays.replay import open_browser
    from bellcrank.reports.report import report

    out = arguments.out or default_place(f"{stem(arguments.run)}_report.html")
    check_file("--out", out)
    results = [compute_or_load(arguments)]
    if arguments.other is not None:
        arguments.run = arguments.other
        results.append(compute_or_load(arguments))
    other = None if len(results) < 2 else results[1]
    path = report(results[0], out, over=other, trace=arguments.trace, live=arguments.live)
    verdicts = [verdict_of(result) for result in results]
    for result, (_, verdict) in zip(results, verdicts, strict=True):
        print(verdict)
        for name, text in remarks_of(result):
            print(f"{name}: {text}")
    print(f"wrote {path} ({path.stat().st_size / 1e6:.2f} MB)")
    if arguments.open:
        open_browser(path)
    return 0 if all(success for success, _ in verdicts) else 1
