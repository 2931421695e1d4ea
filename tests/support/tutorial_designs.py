"""The optima of the tutorial, and random designs that keep the same bounds and limits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

import bellcrank as bc

Array = NDArray[np.float64]
GROUND, ANGLE = 1.241, np.deg2rad(155.0)
LIMITS = ("lock.crank = 155 deg", "start.rocker <= 90 deg")
LOCK = {"crank_length": (1.2, 1.24), "coupler_length": (1.15, 1.25), "rocker_length": (1.15, 1.25)}


@dataclass(frozen=True)
class Rivals:
    """An optimum, and the objective (n,) of random designs; NaN of those that cannot be run."""

    best: bc.results.Optimum
    objective: Array

    @property
    def beaten(self) -> int:
        """How many of the random designs are better than the optimum by more than rounding."""
        known = self.objective[np.isfinite(self.objective)]
        return int((known < self.best.objective * (1.0 - 1e-9)).sum())


@cache
def lock_optimum() -> bc.results.Optimum:
    return bc.optimise("four_bar", LOCK, minimise="lock.time", limits=LIMITS, threads=1)


@cache
def arm_optimum() -> bc.results.Optimum:
    return bc.optimise("balanced_arm", threads=1)


def lock_rivals(count: int, seed: int) -> Rivals:
    """Linkages that lock at the angle by the law of cosines: crank and coupler at random, the rocker follows."""
    best, rng = lock_optimum(), np.random.default_rng(seed)
    crank, coupler = (rng.uniform(*LOCK[name], 50 * count) for name in ("crank_length", "coupler_length"))
    rocker = np.sqrt(GROUND**2 + crank**2 - 2.0 * GROUND * crank * np.cos(ANGLE)) - coupler
    within = (rocker >= LOCK["rocker_length"][0]) & (rocker <= LOCK["rocker_length"][1])
    designs = np.stack([crank, coupler, rocker], axis=1)[within][:count]
    columns = best.problem.runner.run(designs, threads=1)
    angle = columns.measures["lock.crank"]
    assert np.abs(angle[np.isfinite(angle)] - ANGLE).max() < 1e-6
    branch = columns.measures["start.rocker"] <= 0.5 * np.pi  # of the other one, the guesses of some designs lead there
    return Rivals(best, np.where(branch, columns.measures["lock.time"], np.nan))


def arm_rivals(count: int, seed: int) -> Rivals:
    """Springs and arms at random within the bounds."""
    best, rng = arm_optimum(), np.random.default_rng(seed)
    columns = best.problem.runner.run(best.problem.numbers(rng.random((count, 3))), threads=1)
    return Rivals(best, columns.measures["shoulder.peak_torque"])
