"""The optima of the tutorial against random designs.

python -m tests.campaigns.optima_against_random_designs --cases 10000 --seed 0
"""

from __future__ import annotations

import argparse

import numpy as np

from tests.support.tutorial_designs import Rivals, arm_rivals, lock_rivals


def told(name: str, rivals: Rivals) -> str:
    """One line on an optimum and its rivals."""
    known = rivals.objective[np.isfinite(rivals.objective)]
    return (
        f"{name}: optimum {rivals.best.objective:.9g}, residual {rivals.best.residual:.1e}; best of {len(known)} of "
        f"{len(rivals.objective)} random designs {known.min():.9g}; beaten by {rivals.beaten}"
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    print(told("four-bar that locks soonest", lock_rivals(given.cases, given.seed)), flush=True)
    print(told("balanced arm", arm_rivals(given.cases, given.seed)), flush=True)


if __name__ == "__main__":
    main()
