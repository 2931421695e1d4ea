"""Random four-bars found again from 20 of their own coupler points, with and without the crank's angles.

`python -m tests.campaigns.four_bars_from_their_points [COUNT] [SEED]` from the repository: of each kind COUNT linkages
(default 1000). A curve counts as found where it is within 1e-8 of its size; cognates count, since theirs is the same.
"""

from __future__ import annotations

import sys
import time

import numpy as np

import bellcrank as bc
from tests.support.random_four_bars import curve_distance, random_target


def recovered(count: int, seed: int, timed: bool) -> tuple[int, list[int]]:
    """How many of `count` curves are found, and the numbers of the others."""
    missed = []
    for k in range(count):
        target = random_target(np.random.default_rng([seed, k]), timed)
        try:
            found = bc.synthesise(
                "four_bar", target.points, target.angles if timed else None, transmission_angle=0, seed=seed
            )
        except bc.BellcrankError:
            missed.append(k)
            continue
        if not curve_distance(target.linkage, found.best) < 1e-8:
            missed.append(k)
    return count - len(missed), missed


def main() -> None:
    count, seed = (int(sys.argv[k]) if len(sys.argv) > k else default for k, default in ((1, 1000), (2, 0)))
    for timed, bar in ((True, 0.95), (False, 0.80)):
        begun = time.process_time()
        found, missed = recovered(count, seed, timed)
        each = (time.process_time() - begun) / count
        verdict = "reached" if found >= bar * count else "MISSED"
        print(f"{'timed' if timed else 'untimed'}: {found} of {count} curves found, bar {bar:.0%} {verdict}; "
              f"{each:.2f} s of CPU each; missed: {missed[:20]}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
