"""Reference problems of the N four-bar mechanism, and its scene for any N.

Source: IFToMM library of computational benchmark problems, A02.
"""

from __future__ import annotations

import numpy as np
import yaml

from bellcrank.errors import InputError
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.trajectory.trajectory import Trajectory
from bellcrank_bench.problems import urdf_texts
from bellcrank_bench.problems.checks import Array, Check, finished, largest
from bellcrank_bench.problems.problem import IFTOMM, Benchmark, Problem, Published, scene_of
from bellcrank_bench.textbook.integrate import integrate
from bellcrank_bench.textbook.n_four_bar import NFourBar

MOST_LOOPS = 1000
ROD = 1 / 12  # kg m²: a uniform rod of 1 kg and 1 m about its centre
START = (0.0, -1.0)  # angle of the cranks from upright, rad, and its rate, rad/s


def n_four_bar(loops: int) -> Scene:
    """The scene of the N four-bar mechanism with N = `loops`.

    N + 1 cranks on the ground, 1 m apart, whose tops are joined by N couplers; all are uniform rods of 1 m and 1 kg. It
    starts upright with the top of the first crank, frame `B0`, moving at 1 m/s along x. Raises InputError for N below 1
    or above MOST_LOOPS.
    """
    text, scene = n_four_bar_texts(loops)
    return scene_of(text, yaml.safe_load(scene))


def n_four_bar_texts(loops: int) -> tuple[str, str]:
    """Its URDF and its scene file as texts; the joints `crank_0`, `coupler_0`, `crank_1`, … are 0 at the start."""
    if not 1 <= loops <= MOST_LOOPS:
        raise InputError(f"n_four_bar: expected 1 to {MOST_LOOPS} loops, found {loops}")
    parts = [urdf_texts.link("ground")]
    for k in range(loops + 1):
        parts.append(urdf_texts.link(f"crank_link_{k}", 1.0, (0, 0.5, 0), (ROD, 0, ROD)))
        parts.append(urdf_texts.joint(f"crank_{k}", "continuous", "ground", f"crank_link_{k}", (k, 0, 0)))
        if k < loops:
            parts.append(urdf_texts.link(f"coupler_link_{k}", 1.0, (0.5, 0, 0), (0, ROD, ROD)))
            parts.append(
                urdf_texts.joint(f"coupler_{k}", "continuous", f"crank_link_{k}", f"coupler_link_{k}", (0, 1, 0))
            )
    name = f"n_four_bar_{loops}"
    robot = "\n  ".join([f'<robot name="{name}">', *parts]) + "\n</robot>\n"
    lines = [
        f"# {loops + 1} cranks and {loops} couplers of 1 m and 1 kg, upright at first: A02 of the IFToMM library of "
        "benchmark problems.",
        f"name: N four-bar, N = {loops}",
        f"urdf: {name}",
        "gravity: [0, -9.81, 0]                  # m/s^2",
        "frames:",
        *(f"  B{k}: {{link: crank_link_{k}, xyz: [0, 1, 0]}}" for k in range(loops + 1)),
        *(f"  C{k}: {{link: coupler_link_{k}, xyz: [1, 0, 0]}}" for k in range(loops)),
        "constraints:",
        *(f"  - {{name: top_{k + 1}, kind: point, frame_a: C{k}, frame_b: B{k + 1}}}" for k in range(loops)),
        "initial: {crank_0: 0, velocity: {crank_0: -1}}       # rad/s; the rest follows",
        "outputs:",
        "  B0: {frame: B0, what: position}",
        "  energy: {energy: total}",
        f"simulate: {{duration: {10 if loops < 40 else 20}, solver: DOP853, rtol: 1.0e-10, atol: 1.0e-10}}",
    ]
    return '<?xml version="1.0"?>\n' + robot, "\n".join(lines) + "\n"


def judge(run: Trajectory) -> list[Check]:
    """Known: on the parallel branch it has one degree of freedom, whose equation SciPy's DOP853 integrates.

    Whenever the links lie flat, the constraint Jacobian loses rank N, and the motion continues on the same branch. The
    library's own tolerance is 1e-3 m.
    """
    loops, top = len(run.scene.constraints), parallel_top(run)
    flat = np.count_nonzero(np.diff(np.sign(top[:, 1])))
    cranks = [run.robot.joint(f"crank_{k}").q for k in range(loops + 1)]
    apart = run.position[:, cranks] - run.position[:, cranks[:1]]
    return [
        finished(run),
        Check("passages through the flat position", float(flat), 10.0, at_least=True),
        Check("B0", largest(run.output("B0") - top), 1e-6, "m"),
        Check("difference between cranks", largest(apart), 1e-6, "rad"),
        Check("energy drift", run.energy_drift(), 1e-7),
        Check("position residual", run.constraint_residual(), 1e-12, "m"),
    ]


def parallel_top(run: Trajectory) -> Array:
    """The point B0 at the run's times, (n, 3), m, on the parallel branch."""
    angle, _ = integrate(NFourBar(len(run.scene.constraints)).derivative, np.array(START), run.time).T
    return crank_top(angle)


def crank_top(angle: Array) -> Array:
    """The point B0, (n, 3), m, at angles (n,) of the first crank from upright, rad."""
    return np.stack([-np.sin(angle), np.cos(angle), 0 * angle], -1)


def _bundled(loops: int, duration: float, published: tuple[Published, ...] = ()) -> Problem:
    name = f"n_four_bar_{loops}"
    return Problem(
        name=name,
        title=f"N four-bar, N = {loops}, {duration:g} s",
        source=f"{IFTOMM}, A02",
        make=lambda: load_scene(name),
        judge=judge,
        settings={"duration": duration, "rtol": 1e-10, "atol": 1e-10, "samples": 401},
        benchmark=Benchmark(
            scene=name,
            equations=NFourBar(loops),
            joints=("crank_0",),
            start=START,
            duration=duration,
            unit="rad",
            count=1,
            compared_count=1,
            constrained=True,
            c_baseline=False,
            slow=loops > 2,
            tightest=1e-13 if loops == 2 else 1e-10,
            published=published,
            remarks=(
                "C baseline: none, as in the fewest coordinates it would be a pendulum without a loop",
                "MuJoCo, Drake: not set up, as the compliance of their constraints decides which branch follows the "
                "flat position",
            ),
        ),
    )


_PUBLISHED = (
    Published("OpenSim 3.2", 0.455, "i5-4570"),
    Published("Exudyn", 0.0776, "i9, steps of 10 ms, energy off by 0.114 J"),
)
PROBLEMS = (_bundled(2, 10.0, _PUBLISHED), _bundled(40, 20.0))
