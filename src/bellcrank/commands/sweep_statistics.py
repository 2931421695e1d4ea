"""What `bellcrank sweep` says of a sample: probabilities of limits, Sobol indices, and the report as a page."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank.commands.options import add_page, page_of

if TYPE_CHECKING:
    from bellcrank.studies.results.sweep_result import Sweep

SAMPLE_FILES = ("indices.csv", "indices.json", "indices.png", "limits.png", "sweep.html")


def add_sample_arguments(parser: argparse.ArgumentParser) -> None:
    """What is asked of the sample."""
    parser.add_argument(
        "--sobol", metavar="N",
        help="find which parameters the spread of the measures comes from: first-order and total Sobol indices with "
        "their errors, from 16 scramblings of N Sobol points (a power of two), N x (parameters + 2) designs each",
    )  # fmt: skip
    parser.add_argument(
        "--limit", action="append", default=[], metavar="LIMIT", dest="limits",
        help="print the probability that a limit is exceeded with its 95 %% interval, such as 'lock.time > 13 s'; may "
        "be repeated; of a sample with --method random, or of at least 1024 designs, a multiple of 16",
    )  # fmt: skip
    add_page(
        parser,
        "a map of the designs, in which the one that is clicked moves, with distributions, probabilities and indices,",
        "sweep.html in DIR",
        "--report",
    )
    parser.add_argument(
        "--live", action="store_true",
        help="the page computes the design that is clicked, and those between, by sliders, instead of keeping motions",
    )  # fmt: skip


def check_limits(limits: Sequence[str], units: Mapping[str, str]) -> None:
    """Refuse a text that is not a limit of one of the measures, before anything is run (InputError)."""
    from bellcrank.studies.results.exceedance import parse_limit

    for limit in limits:
        parse_limit(limit, units)


def write_statistics(result: Sweep, arguments: argparse.Namespace, folder: Path, files: list[Path]) -> None:
    """Print and write what was asked for; the paths of files are added to `files`. Raises InputError."""
    from bellcrank.studies.designs.sensitivity_sample import SensitivitySample

    measures: Sequence[str] | None = arguments.measures or None
    indices = isinstance(result.space.sample, SensitivitySample)
    if indices:
        print(f"\nSobol indices with 95 % intervals:\n{result.sensitivity.table(measures)}")
        files.append(result.sensitivity.to_csv(folder / "indices.csv"))
        files.append(result.sensitivity.to_json(folder / "indices.json"))
    if arguments.limits:
        print("\nlimits:", *(result.statistics.exceedance(limit) for limit in arguments.limits), sep="\n")
    if indices and not arguments.no_plots:
        result.sensitivity.plot(folder / "indices.png", measures)
        files.append(folder / "indices.png")
    if arguments.limits and not arguments.no_plots:
        result.statistics.plot(folder / "limits.png", limits=arguments.limits)
        files.append(folder / "limits.png")
    page = page_of(arguments, folder / "sweep.html")
    if page is not None:
        from bellcrank.reports.study_report import write_study

        files.append(write_study(result, page, measures=measures, limits=arguments.limits, live=arguments.live))
