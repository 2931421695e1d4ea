"""Random linkages, what they do, and how far another linkage's curve or lengths are from theirs."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from bellcrank.studies.synthesis.linkage import FourBar, SixBar, SliderCrank

Array = NDArray[np.float64]
LEAST_TRANSMISSION = np.deg2rad(10.0)


@dataclass(frozen=True)
class Target:
    """A random linkage, with 20 of its coupler points at known crank angles."""

    linkage: FourBar | SliderCrank
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
            angles=np.zeros(0),
        )  # fmt: skip
        angles = _angles(rng, timed)
        return Target(linkage, angles, linkage.path(angles))


def random_slider_crank(rng: np.random.Generator, timed: bool) -> Target:
    """A coupler of 1.1 to 5 cranks, an offset with which the crank turns fully, a coupler point within 1.5 couplers."""
    while True:
        coupler = rng.uniform(1.1, 5.0)
        offset = rng.uniform(-1.0, 1.0) * (coupler - 1.0)
        if (1.0 + abs(offset)) / coupler > np.cos(LEAST_TRANSMISSION):
            continue
        size, turn = rng.uniform(0.1, 1.0), rng.uniform(0.0, 2.0 * np.pi)
        linkage = SliderCrank(
            crank=size, coupler=coupler * size, offset=offset * size,
            pivot=tuple(rng.uniform(-1.0, 1.0, 2).tolist()), ground_angle=turn,
            point=tuple((coupler * size * rng.uniform(-1.5, 1.5, 2)).tolist()), angles=np.zeros(0),
        )  # fmt: skip
        angles = _angles(rng, timed)
        return Target(linkage, angles, linkage.path(angles))


def random_six_bar(rng: np.random.Generator, on_rocker: bool, timed: bool) -> Target:
    """A random crank-rocker with a dyad from a point within 1.2 couplers to one within 1.2 grounds or rockers; the dyad
    assembles over the turn with a transmission angle of 10 deg, and its coupler point is within 1.5 links.
    """
    while True:
        base = random_target(rng, timed).linkage
        assert isinstance(base, FourBar)
        carrier = base.rocker if on_rocker else base.ground
        lengths = rng.uniform(0.5, 2.5, 2) * base.ground
        more = {field.name: getattr(base, field.name) for field in fields(FourBar)}
        more |= {name: float(more[name]) for name in ("ground", "crank", "coupler", "rocker", "ground_angle")}
        more["point"] = tuple((lengths[0] * rng.uniform(-1.5, 1.5, 2)).tolist())
        linkage = SixBar(
            **more, on_rocker=on_rocker, joint=tuple((base.coupler * rng.uniform(-1.2, 1.2, 2)).tolist()),
            second_pivot=tuple((carrier * rng.uniform(-1.2, 1.2, 2)).tolist()), link=float(lengths[0]),
            second_rocker=float(lengths[1]), second_branch=float(rng.choice([-1.0, 1.0])),
        )  # fmt: skip
        if linkage.assembles and linkage.transmission_angle > LEAST_TRANSMISSION:
            angles = _angles(rng, timed)
            return Target(linkage, angles, linkage.path(angles))


def random_function(rng: np.random.Generator, slider: bool) -> tuple[FourBar | SliderCrank, Array]:
    """A linkage, and 20 pairs (20, 2) of crank angle and output over 60 to 324 deg of its crank, either way, with
    random offsets. A four-bar has links of 0.4 to 4 cranks; in that range it assembles, and its transmission angle is
    at least 10 deg.
    """
    while True:
        start, span = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(np.pi / 3.0, 1.8 * np.pi) * rng.choice([-1.0, 1.0])
        angles = start + np.linspace(0.0, span, 20)
        sign = 1.0
        if slider:
            linkage, sign = random_slider_crank(rng, True).linkage, rng.choice([-1.0, 1.0])
        else:
            ground, coupler, rocker = rng.uniform(0.4, 4.0, 3)
            linkage = FourBar(
                ground=ground, crank=1.0, coupler=coupler, rocker=rocker, branch=float(rng.choice([-1.0, 1.0])),
                pivot=(0.0, 0.0), ground_angle=0.0, angles=angles, of_range=True,
            )  # fmt: skip
            if not linkage.assembles or linkage.transmission_angle < LEAST_TRANSMISSION:
                continue
        offsets = rng.uniform(-3.0, 3.0, 2)
        return linkage, np.c_[angles + offsets[0], sign * linkage.output(angles) + offsets[1]]


def length_distance(target: FourBar | SliderCrank, found: FourBar | SliderCrank) -> float:
    """The largest difference of lengths over the target's crank; those of a four-bar up to their scale, and offsets up
    to their sign, which is the other one where the slider is on the other side.
    """
    first, second = (np.abs(list(each.lengths.values())) for each in (target, found))
    scale = first[0] / second[0] if isinstance(target, FourBar) else 1.0
    return float(np.abs(scale * second - first).max() / target.crank)


def _angles(rng: np.random.Generator, timed: bool) -> Array:
    steps = np.ones(20) if timed else rng.uniform(0.3, 1.7, 20)
    start = rng.uniform(0.0, 2.0 * np.pi)
    return start + 2.0 * np.pi * np.concatenate([[0.0], np.cumsum(steps)[:-1]]) / steps.sum()


def curve_distance(target: FourBar | SliderCrank, found: FourBar | SliderCrank, samples: int = 41) -> float:
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
