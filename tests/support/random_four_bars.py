"""Random crank-rockers, their coupler points, and how far another linkage's curve is from theirs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bellcrank.studies.synthesis.linkage import FourBar

Array = NDArray[np.float64]
LEAST_TRANSMISSION = np.deg2rad(10.0)


@dataclass(frozen=True)
class Target:
    """A random linkage, with 20 of its coupler points at known crank angles."""

    linkage: FourBar
    angles: Array
    points: Array


def random_target(rng: np.random.Generator, timed: bool) -> Target:
    """Links of 1 to 5 cranks that make a crank-rocker, a coupler point within 1.5 couplers, anywhere in the plane.

    With `timed` the crank turns by 18 deg from point to point; else by random angles, which are forgotten.
    """
    while True:
        ground, coupler, rocker = rng.uniform(1.0, 5.0, 3)
        links = sorted([1.0, ground, coupler, rocker])
        if links[0] + links[3] > links[1] + links[2] - 0.05:
            continue
        cosines = [(coupler**2 + rocker**2 - (ground + side) ** 2) / (2.0 * coupler * rocker) for side in (-1.0, 1.0)]
        if np.abs(cosines).max() > np.cos(LEAST_TRANSMISSION):
            continue
        size, turn = rng.uniform(0.1, 1.0), rng.uniform(0.0, 2.0 * np.pi)
        linkage = FourBar(
            ground=ground * size, crank=size, coupler=coupler * size, rocker=rocker * size,
            pivot=tuple(rng.uniform(-1.0, 1.0, 2).tolist()), ground_angle=turn,
            point=tuple((coupler * size * rng.uniform(-1.5, 1.5, 2)).tolist()), branch=float(rng.choice([-1.0, 1.0])),
            angles=np.zeros(0), error=0.0,
        )  # fmt: skip
        steps = np.ones(20) if timed else rng.uniform(0.3, 1.7, 20)
        angles = (
            rng.uniform(0.0, 2.0 * np.pi) + 2.0 * np.pi * np.concatenate([[0.0], np.cumsum(steps)[:-1]]) / steps.sum()
        )
        return Target(linkage, angles, linkage.path(angles))


def curve_distance(target: FourBar, found: FourBar, samples: int = 41) -> float:
    """The largest distance of the target's coupler curve from that of another linkage, over the size of the former."""
    mine = target.path(np.linspace(0.0, 2.0 * np.pi, samples))
    turn = np.linspace(0.0, 2.0 * np.pi, 4001)
    gaps = np.linalg.norm(mine[:, None] - found.path(turn)[None], axis=2)
    near = turn[gaps.argmin(axis=1)]
    width = turn[1]
    for _ in range(12):  # the foot of the perpendicular, by parabolas through three squared distances
        left, here, right = (((found.path(near + side * width) - mine) ** 2).sum(axis=1) for side in (-1.0, 0.0, 1.0))
        bend = left - 2.0 * here + right
        near = near + np.clip(0.5 * width * (left - right) / np.where(bend > 0.0, bend, np.inf), -width, width)
        width = max(0.1 * width, 1e-5)
    size = float(np.sqrt(((mine - mine.mean(axis=0)) ** 2).sum(axis=1).mean()))
    return float(np.linalg.norm(found.path(near) - mine, axis=1).max()) / size
