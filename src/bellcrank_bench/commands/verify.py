"""`bellcrank verify`: compiled dynamics against analytic equations, with the largest differences printed."""

from __future__ import annotations

import argparse

from bellcrank.terminal import interruption
from bellcrank_bench.verification import VERIFIABLE

SUMMARY = "compare compiled equations with a textbook's"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The names of the scenes."""
    parser.add_argument("scenes", nargs="*", metavar="NAME", help=f"one of {', '.join(VERIFIABLE)} (default: all)")


def run(arguments: argparse.Namespace) -> int:
    """Print the largest difference of each quantity; exit code 1 if one exceeds its tolerance."""
    from bellcrank_bench.tables.text import difference_table
    from bellcrank_bench.verification.verify import verify

    good = True
    for name in arguments.scenes or VERIFIABLE:
        with interruption.whole_runs():
            found = verify(name)
        print(difference_table(name, found), flush=True)
        good = good and all(difference.agrees for difference in found)
    return 0 if good else 1
