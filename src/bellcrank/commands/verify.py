"""`bellcrank verify`: compiled dynamics against analytic equations, the largest differences on screen."""

from __future__ import annotations

import argparse

from bellcrank.validation.verify import TOLERANCE, VERIFIABLE, verify


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The scene's name."""
    parser.add_argument("robot", metavar="ROBOT", help=f"one of: {', '.join(VERIFIABLE)}")


def run(arguments: argparse.Namespace) -> int:
    """Print each quantity's largest difference; 1 where one is above the tolerance."""
    found = verify(arguments.robot)
    print(f"{arguments.robot}: compiled Pinocchio against the analytic equations (largest difference / largest entry)")
    for d in found:
        verdict = "ok" if d.agrees else "DIFFERS"
        print(f"  {d.quantity:17} {d.states:19} {d.samples:5d} states   {d.relative:9.2e}   {verdict}")
    worst = max(d.relative for d in found)
    print(f"largest {worst:.2e}, tolerance {TOLERANCE:.0e}")
    return 0 if all(d.agrees for d in found) else 1
