"""Reference problems of the simple pendulum: its swing (A01), and its fall from 1e-9 rad off upright.

Source of A01: IFToMM library of computational benchmark problems.
"""

from __future__ import annotations

from math import asinh, pi, sin

import numpy as np

from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.trajectory.trajectory import Trajectory
from bellcrank_bench.problems import urdf_texts
from bellcrank_bench.problems.checks import Check, finished, largest
from bellcrank_bench.problems.problem import IFTOMM, Benchmark, Problem, Published, scene_of
from bellcrank_bench.textbook.pendulum import SimplePendulum

P1 = {  # (x, y) of the mass, m, at times in s: closed form in Jacobi's elliptic functions, evaluated with 40 digits
    0.5: (-0.391048791550546388, -0.920369948785192204),
    1.0: (0.986291751131875319, -0.165010853125541169),
    3.0: (0.176651789922838189, -0.984273409737892617),
    5.0: (-0.942305435043757335, -0.334754338414000581),
    7.0: (-0.998618779175479798, -0.0525407829982987163),
}
LEAN = 1e-9  # rad from upright, of the fall
G = 9.81  # m/s²


def judge_swing(run: Trajectory) -> list[Check]:
    """Known: the closed form in Jacobi's elliptic functions."""
    return [
        finished(run),
        Check("P1", largest(run.output("P1")[:, :2] - list(P1.values())), 1e-9, "m"),
        Check("energy drift", run.energy_drift(), 1e-10),
    ]


def upright_scene() -> Scene:
    """A pendulum of 1 m, whose joint is 0 upright, until it is horizontal."""
    level = {"name": "level", "when": {"joint": "swing", "position": pi / 2}, "stop": True}
    data = {"gravity": [0.0, -G, 0.0], "initial": {"swing": LEAN}, "events": [level]}
    return scene_of(urdf_texts.upright_pendulum(), data)


def judge_fall(run: Trajectory) -> list[Check]:
    """Known: from the energy, with k = cos(θ0/2) and l = 1 m, t = sqrt(l/g) (K(k) - F(φ, k)), sin φ = sin(π/4) / k.

    F(φ, 1) = asinh(tan φ), and 1 - k² = 2.5e-19. Source: L. Landau, E. Lifshitz, Mechanics (1976), §11.
    """
    from scipy.special import ellipkm1

    fall = (ellipkm1(sin(LEAN / 2) ** 2) - asinh(1.0)) / np.sqrt(G)
    return [finished(run), Check("time of the fall", abs(run.time[-1] - fall), 1e-6, "s")]


PROBLEMS = (
    Problem(
        name="pendulum",
        title="simple pendulum, A01",
        source=f"{IFTOMM}, A01; closed form in elliptic functions",
        make=lambda: load_scene("pendulum"),
        judge=judge_swing,
        settings={"rtol": 1e-12, "atol": 1e-12, "duration": 10.0, "times": list(P1)},
        benchmark=Benchmark(
            scene="pendulum",
            equations=SimplePendulum(),
            joints=("swing",),
            start=(-pi / 2, 0.0),
            duration=10.0,
            unit="rad",
            known_end=(-0.2786806735699835, 4.343160692864683),
            count=1,
            compared_count=1,
            published=(Published("OpenSim 3.2", 0.637, "i5-4570"), Published("Exudyn", 0.037, "i7")),
        ),
    ),
    # The coordinate is the deviation from upright, so the absolute tolerance must lie far below it.
    Problem(
        name="upright_pendulum",
        title="pendulum 1e-9 rad from upright, until it is horizontal",
        source="L. Landau, E. Lifshitz, Mechanics (1976), §11",
        make=upright_scene,
        judge=judge_fall,
        settings={"duration": 20.0, "rtol": 1e-12, "atol": 1e-18},
    ),
)
