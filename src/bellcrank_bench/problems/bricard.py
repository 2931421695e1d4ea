"""Reference problem: Bricard's mechanism, whose constraint has one redundant row.

Source: IFToMM library of computational benchmark problems, A04.
"""

from __future__ import annotations

from math import pi

import numpy as np

from bellcrank.dynamics.equations.system import system_of
from bellcrank.scene.scene import load_scene
from bellcrank.simulation.trajectory.trajectory import Trajectory
from bellcrank_bench.problems.checks import Check, constraints_satisfied, finished, largest
from bellcrank_bench.problems.problem import IFTOMM, Benchmark, Problem, Published
from bellcrank_bench.textbook.bricard import BricardRing

P3 = {  # position of the point P3, m, at times in s
    0.5: (0.968283679107, -1.22462515944, 0.750146609438),
    1.0: (0.510501461187, -1.64916759939, 0.140123114553),
    2.0: (-0.969340344778, -1.22124689496, 0.75427801078),
    3.0: (-0.967199800049, -1.22802021467, 0.745983176176),
    4.0: (0.524899593391, -1.64387600134, 0.148835846116),
    5.0: (0.9999999977, -1.000067258, 0.99993274),
}
RING = BricardRing()


def judge(run: Trajectory) -> list[Check]:
    """Known: P3 by a null-space reduction of the tree, DOP853 at rtol = 1e-12, projected every 10 ms; one row of the
    constraint is redundant at all times.
    """
    return [
        finished(run),
        Check("P3", largest(run.output("P3") - list(P3.values())), 1e-6, "m"),
        Check("smallest singular value", smallest_singular_value(run), 1e-9, "of the largest"),
        *constraints_satisfied(run),
        Check("energy drift", run.energy_drift(), 1e-9),
    ]


def smallest_singular_value(run: Trajectory) -> float:
    """The constraint Jacobian's smallest singular value over its largest; the greatest ratio over the run."""
    system, ratios = system_of(run.scene), []
    for t, x, u in zip(run.time, run.state, run.inputs, strict=True):
        jacobian = system.linearised_constraints(np.array([t]), x, u, run.parameters)[2]
        values = np.linalg.svd(jacobian, compute_uv=False)
        ratios.append(values[-1] / values[0])
    return float(max(ratios))


PROBLEMS = (
    Problem(
        name="bricard",
        title="Bricard's mechanism, A04",
        source=f"{IFTOMM}, A04",
        make=lambda: load_scene("bricard"),
        judge=judge,
        settings={"rtol": 1e-12, "atol": 1e-12, "duration": 10.0, "times": list(P3)},
        benchmark=Benchmark(
            scene="bricard",
            equations=RING,
            joints=tuple(f"hinge_{k}" for k in range(5)),
            start=(pi / 2, 0.0),
            duration=10.0,
            unit="m",
            count=1,
            compared_count=3,
            compared=RING.corner,
            output="P3",
            constrained=True,
            c_coordinates="its one coordinate",
            reference_steps=(1, 2),
            published=(
                Published("OpenSim 3.2", 0.258, "i5-4570"),
                Published("Exudyn", 3.57, "5 s simulated"),
            ),
            remarks=(
                "the C baseline integrates the one coordinate of the mechanism, bellcrank five hinges with five "
                "constraint rows, of which one is redundant",
            ),
        ),
    ),
)
