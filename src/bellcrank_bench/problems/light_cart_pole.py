"""Reference problem: the light cart-pole, 1e-6 kg under 1 kg, which reaches 4,429 rad/s for an instant.

Proposed by N. Parsons to the IFToMM library of computational benchmark problems (light-cartpole-benchmark).
"""

from __future__ import annotations

from functools import cache
from math import pi, sqrt

import numpy as np

from bellcrank.scene.scene import Scene
from bellcrank.simulation.trajectory.trajectory import Trajectory
from bellcrank_bench.problems import urdf_texts
from bellcrank_bench.problems.checks import Array, Check, finished, largest
from bellcrank_bench.problems.problem import IFTOMM, Problem, scene_of

CART, G = 1e-6, 9.81  # kg, m/s²; the pole is 1 kg and 1 m
SHARE = 1.0 / (1.0 + CART)  # the pole's share of the total mass
PUBLISHED = np.array(  # t, x, θ: rows of results.txt of the proposal
    [
        (0.1, 0.001203674462722, 1.521726637241122),
        (0.3, 0.1027140372631889, 1.113582331681891),
        (0.45, 0.8841044742496597, 0.1161556635401167),
        (0.46, 1.270163682531288, -0.2735643508730795),
        (0.5, 1.604228354236889, -0.6487991074309897),
        (0.9, 1.999997998962427, -1.570750725813462),
        (1.0, 1.998934624975155, -1.524675515758723),
    ]
)
QUARTER = 0.451524535681659  # s, published
PEAK = sqrt(2.0 * G * (1.0 + 1.0 / CART))  # rad/s, by the energy at the vertical; published as 4429.4
_EDGES = np.r_[
    0.0, 1e-5 * 2.0 ** np.arange(17), pi / 2
]  # rad: of quadrature panels that narrow towards the fast instant
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


def scene() -> Scene:
    """The pole horizontal and at rest, with an event each time it passes the vertical."""
    vertical = {"name": "vertical", "when": {"joint": "swing", "position": 0.0}}
    data = {"gravity": [0.0, -G, 0.0], "initial": {"swing": pi / 2}, "events": [vertical]}
    return scene_of(urdf_texts.cart_pole(CART), data)


def reference(times: Array) -> Array:
    """x (m) and θ (rad) at times (n,) s, (n, 2), by quadrature.

    Horizontal momentum is conserved, so x = (1 - sin θ) m/(M + m), and the energy gives dt/dθ = sqrt((1 - m/(M + m)
    cos² θ) / (2 g cos θ)) over a quarter of the period; the other quarters are its mirror images.
    """
    quarter = _time_at_edges()[0]
    phase = np.mod(times, 4 * quarter)
    back = phase > 2 * quarter
    phase = np.where(back, 4 * quarter - phase, phase)
    below = phase > quarter
    angle = _angle(np.where(below, 2 * quarter - phase, phase))
    angle = np.where(below, -angle, angle)
    return np.stack([SHARE * (1.0 - np.sin(angle)), angle], -1)


def judge(run: Trajectory) -> list[Check]:
    """Known: `reference`, and the published values; the error measure is the proposal's, over 1,001 rows of 10 s."""
    off = run.position - reference(run.time)
    rates = [abs(event.velocity[1]) for event in run.events]
    return [
        finished(run),
        Check("error measure", sqrt(np.mean(np.sum(off**2, 1))), 1e-6, "1"),
        Check("reference against published rows", largest(reference(PUBLISHED[:, 0]) - PUBLISHED[:, 1:]), 1e-12, "m"),
        Check("quarter of the period against published", abs(_time_at_edges()[0] - QUARTER), 1e-14, "s"),
        Check("first vertical against published", abs(run.events[0].time - QUARTER), 1e-10, "s"),
        Check("crossings of the vertical, difference from 11", abs(len(rates) - 11.0), 0.0, ""),
        Check("peak rates", largest(np.array(rates) - PEAK), 1e-4, "rad/s"),
        Check("energy drift", run.energy_drift(), 1e-9),
    ]  # fmt: skip


def _slope(s: Array) -> Array:
    """-dt/ds with θ = π/2 - s², which removes the singularity at the start."""
    cosine = np.sin(s * s)  # of θ
    return np.asarray(2.0 * s * np.sqrt((1.0 - SHARE + SHARE * np.cos(s * s) ** 2) / (2.0 * G * cosine)))


def _integral(a: Array, b: Array) -> Array:
    """The integral of the slope from a (n,) to b (n,), by Gauss-Legendre quadrature."""
    middle, half = (a + b)[:, None] / 2, (b - a)[:, None] / 2
    return np.asarray((_slope(middle + half * _NODES) * half) @ _WEIGHTS, dtype=np.float64)


@cache
def _time_at_edges() -> Array:
    """Times (s) at which the pole passes the edges of the panels; the first is the quarter of the period."""
    s = np.sqrt(pi / 2 - _EDGES)
    s[-1] = 0.0
    return np.append(np.cumsum(_integral(s[1:], s[:-1])[::-1])[::-1], 0.0)


def _angle(times: Array) -> Array:
    """θ (rad) at times (n,) s of the first quarter of the period, by Newton's method on the quadrature of its panel."""
    edges, at = np.sqrt(np.maximum(pi / 2 - _EDGES, 0.0)), _time_at_edges()
    panel = np.clip(len(at) - np.searchsorted(at[::-1], times, side="right"), 1, len(at) - 1)
    near, far = edges[panel], edges[panel - 1]  # s at both ends of the panel
    low, high = near.copy(), far.copy()
    s = (low + high) / 2
    for _ in range(40):
        residual = at[panel] + _integral(near, s) - times
        low, high = np.where(residual < 0, s, low), np.where(residual < 0, high, s)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = s - residual / _slope(s)
        s = np.where((newton > low) & (newton < high), newton, (low + high) / 2)
    return np.asarray(pi / 2 - s * s)


PROBLEMS = (
    Problem(
        name="light_cart_pole",
        title="light cart-pole (cart 1e-6 kg, pole 1 kg), 10 s",
        source=f"N. Parsons, light-cartpole-benchmark, proposed to the {IFTOMM}",
        make=scene,
        judge=judge,
        settings={"duration": 10.0, "rtol": 1e-10, "atol": 1e-10, "samples": 1001},
    ),
)
