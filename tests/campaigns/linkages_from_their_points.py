"""Random linkages found again from 20 of their own coupler points, with and without the crank's angles, from the poses
of their couplers, or from 20 pairs of their crank angle and output.

Each kind has as many cases as are asked for, with a line after each 50. A curve counts as found where it is within 1e-8
of its size; cognates count, since theirs is the same. Poses and functions count where the lengths are, over the crank.

python -m tests.campaigns.linkages_from_their_points --cases 1000 --seed 0 --kind four_bar-untimed
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import bellcrank as bc
from tests.support.random_linkages import (
    curve_distance,
    length_distance,
    random_function,
    random_six_bar,
    random_slider_crank,
    random_target,
)

BARS = {"timed": 0.95, "untimed": 0.80, "poses": 0.95, "function": 0.95}
SIX_BARS = {"stephenson": 0.7, "watt": 0.3}  # often other ones pass the points nearly
KINDS = [f"{linkage}-{kind}" for linkage in ("four_bar", "slider_crank") for kind in BARS]
KINDS += ["stephenson-timed", "watt-timed"]


def recovered(number: int, seed: int, linkage: str, kind: str) -> bool:
    """Whether a random linkage, or its curve, is found."""
    rng = np.random.default_rng([seed, number])
    search = {"transmission_angle": 0, "seed": seed}
    try:
        if kind == "function":
            own, pairs = random_function(rng, linkage == "slider_crank")
            found = bc.synthesise(linkage, function=pairs, **search)
            return length_distance(own, found.best) < 1e-8
        if linkage in ("stephenson", "watt"):
            target = random_six_bar(rng, linkage == "watt", True)
            far = 100.0 * np.sqrt(np.var(target.points, axis=0).sum())
            found = bc.synthesise(linkage, target.points, target.angles, longest=far, **search)
            return curve_distance(target.linkage, found.best) < 1e-8
        target = (random_target if linkage == "four_bar" else random_slider_crank)(rng, kind == "timed")
        if kind == "poses":
            ways = np.angle(target.linkage.directions(target.angles))
            found = bc.synthesise(linkage, target.points, directions=ways, **search)
            return length_distance(target.linkage, found.best) < 1e-8
        found = bc.synthesise(linkage, target.points, target.angles if kind == "timed" else None, **search)
    except bc.BellcrankError:
        return False
    return curve_distance(target.linkage, found.best) < 1e-8


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", choices=KINDS)
    given = parser.parse_args()
    count, seed = given.cases, given.seed
    for name in KINDS if given.kind is None else (given.kind,):
        linkage, kind = name.split("-")
        begun, missed = time.process_time(), list[int]()
        for k in range(count):
            if not recovered(k, seed, linkage, kind):
                missed.append(k)
            if (done := k + 1) % 50 == 0 or done == count:
                each = (time.process_time() - begun) / done
                print(f"{name}: {done - len(missed)} of {done} found, {each:.2f} s of CPU each", flush=True)
        bar = SIX_BARS.get(linkage, BARS[kind])
        verdict = "reached" if count - len(missed) >= bar * count else "MISSED"
        print(f"{name}: bar {bar:.0%} {verdict}; missed: {missed[:20]}", flush=True)


if __name__ == "__main__":
    main()
