"""bellcrank's own runs of a benchmark, each next to the C baseline with the same method and setting."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial
from typing import Any

from bellcrank.errors import BellcrankError
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.scene.settings import Stabilisation
from bellcrank.simulation.simulate import simulate
from bellcrank_bench.c_baseline.baseline import CBaseline
from bellcrank_bench.measurements.machine import seconds_in_new_processes
from bellcrank_bench.measurements.work_precision import BELLCRANK, PROJECTED
from bellcrank_bench.peers.peer import Outcome, Run
from bellcrank_bench.problems.problem import Benchmark

TOLERANCES = {
    False: (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13),
    True: (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13),
}  # the default sweep, and the full one
SUBSTEPS = {False: (5, 10, 20, 50, 100, 200), True: (2, 5, 10, 20, 40, 80, 120, 200)}  # of RK4, between two outputs
NOTE = "kernel: clock around the stepping, in C++; whole: simulate() of a scene that is loaded"


def groups(benchmark: Benchmark, baseline: CBaseline | None, full: bool) -> list[list[Run]]:
    """bellcrank's runs, each in a group with the C baseline (if there is one) that is timed in turns with it.

    With constraints there is one run without stabilisation, as in the C baseline, and one with projection. `full`
    selects the finer sweep.
    """
    scenes = _scenes(benchmark)
    settings: list[tuple[str, str, dict[str, float]]] = []
    for method in benchmark.adaptive:
        for tolerance in (each for each in TOLERANCES[full] if each >= benchmark.tightest):
            settings.append((method, f"{tolerance:g}", {"tolerance": tolerance}))
    for count in SUBSTEPS[full]:
        step = benchmark.times[1] / count
        settings.append(("RK4", f"h {step:.3g}", {"step": step}))
    made = []
    for method, setting, given in settings:
        group = []
        for suffix, scene in scenes.items():
            once = partial(_simulate, benchmark, scene, method, **given)
            group.append(Run(tool=BELLCRANK, method=method + suffix, setting=setting, note=NOTE, once=once))
        if baseline is not None:
            group.append(baseline.timed(method, setting, **given))
        made.append(group)
    return made


def _scenes(benchmark: Benchmark) -> dict[str, Scene]:
    """The scene, by what the names of its methods gain: one with constraints without stabilisation and with projection.

    Events are left out: none would occur within the duration, and the C baseline has none.
    """
    scene = load_scene(benchmark.scene)
    order = tuple(joint.name for joint in scene.robot.joints)
    if order[: len(benchmark.joints)] != benchmark.joints:
        raise BellcrankError(
            f"{benchmark.scene}: the scene's joints are {order}, the analytic equations have {benchmark.joints}"
        )
    if not benchmark.constrained:
        return {"": scene}
    kinds = {"": "none", PROJECTED: "projection"} if benchmark.c_baseline else {PROJECTED: "projection"}
    return {
        suffix: replace(scene, events=(), settings=replace(scene.settings, stabilisation=Stabilisation(kind)))
        for suffix, kind in kinds.items()
    }


def _simulate(
    benchmark: Benchmark, scene: Scene, method: str, tolerance: float = 1e-6, step: float | None = None
) -> Outcome:
    settings: dict[str, Any] = {"solver": method, "rtol": tolerance, "atol": tolerance, "step": step}
    begun = time.perf_counter()
    run = simulate(scene, times=benchmark.times, duration=benchmark.duration, **settings)
    whole = time.perf_counter() - begun
    made = run.statistics
    return Outcome(
        seconds=made.kernel_time,
        position=benchmark.positions_of(run),
        evaluations=made.evaluations,
        steps=made.steps,
        rejected=made.rejected,
        whole=whole,
    )


def first_run(benchmark: Benchmark) -> dict[str, float]:
    """Seconds from a scene's name to its first run in a new process, with an empty cache and then from the cache."""
    cold, cached = seconds_in_new_processes(
        f"import bellcrank\nscene = bellcrank.load_scene({benchmark.scene!r})\n"
        "bellcrank.simulate(scene, solver='DOP853', rtol=1e-8, atol=1e-8)"
    )
    return {"cold": cold, "cached": cached}
