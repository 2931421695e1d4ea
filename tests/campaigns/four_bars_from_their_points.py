"""Random four-bars found again from 20 of their own coupler points, with and without the crank's angles.

Each kind has as many cases as are asked for, with a line after each 50. A curve counts as found where it is within 1e-8
of its size; cognates count, since theirs is the same.

python -m tests.campaigns.four_bars_from_their_points --cases 1000 --seed 0 --kind untimed
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import bellcrank as bc
from tests.support.random_four_bars import curve_distance, random_target

BARS = {"timed": 0.95, "untimed": 0.80}


def recovered(number: int, seed: int, timed: bool) -> bool:
    """Whether the curve of a random linkage is found."""
    target = random_target(np.random.default_rng([seed, number]), timed)
    timing = target.angles if timed else None
    try:
        found = bc.synthesise("four_bar", target.points, timing, transmission_angle=0, seed=seed)
    except bc.BellcrankError:
        return False
    return curve_distance(target.linkage, found.best) < 1e-8


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", choices=BARS)
    given = parser.parse_args()
    count, seed = given.cases, given.seed
    for kind in BARS if given.kind is None else (given.kind,):
        begun, missed = time.process_time(), list[int]()
        for k in range(count):
            if not recovered(k, seed, kind == "timed"):
                missed.append(k)
            if (done := k + 1) % 50 == 0 or done == count:
                each = (time.process_time() - begun) / done
                print(f"{kind}: {done - len(missed)} of {done} curves found, {each:.2f} s of CPU each", flush=True)
        verdict = "reached" if count - len(missed) >= BARS[kind] * count else "MISSED"
        print(f"{kind}: bar {BARS[kind]:.0%} {verdict}; missed: {missed[:20]}", flush=True)


if __name__ == "__main__":
    main()
