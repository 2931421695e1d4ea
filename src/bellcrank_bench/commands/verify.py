"""`bellcrank verify`: compiled dynamics against analytic equations, the largest differences on screen."""

from __future__ import annotations

import argparse

from bellcrank.terminal import interruption
from bellcrank_bench.verify.verify import VERIFIABLE, verify

SUMMARY = "compare compiled equations with a textbook's"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The scenes' names."""
    parser.add_argument("scenes", nargs="*", metavar="NAME", help=f"of {', '.join(VERIFIABLE)} (default: all)")


def run(arguments: argparse.Namespace) -> int:
    """Print each quantity's largest difference; 1 where one is above its tolerance."""
    good = True
    for name in arguments.scenes or VERIFIABLE:
        with interruption.whole_runs():
            found = verify(name)
        print(f"{name}: compiled Pinocchio against the analytic equations (largest difference / largest entry)")
        for d in found:
            verdict = "ok" if d.agrees else "DIFFERS"
            print(
                f"  {d.quantity:17} {d.states:19} {d.samples:5d} states   {d.relative:9.2e}   "
                f"tolerance {d.tolerance:.0e}   {verdict}"
            )
        wrong = sum(not d.agrees for d in found)
        print(f"{len(found) - wrong} of {len(found)} quantities agree", flush=True)
        good = good and not wrong
    return 0 if good else 1
