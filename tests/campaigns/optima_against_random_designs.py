"""The optima of the tutorial against 10,000 random designs each.

`python -m tests.campaigns.optima_against_random_designs [COUNT] [SEED]` from the repository.
"""

from __future__ import annotations

import sys

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
    count, seed = (int(sys.argv[k]) if len(sys.argv) > k else default for k, default in ((1, 10000), (2, 0)))
    print(told("four-bar that locks soonest", lock_rivals(count, seed)), flush=True)
    print(told("balanced arm", arm_rivals(count, seed)), flush=True)


if __name__ == "__main__":
    main()
