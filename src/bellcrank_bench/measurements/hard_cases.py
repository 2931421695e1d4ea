"""The hard cases: every reference problem judged, then times of chains and loops of any length, and of first runs."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

from bellcrank.scene.scene import Scene
from bellcrank.simulation.simulate import simulate
from bellcrank_bench.measurements.drives import drives
from bellcrank_bench.measurements.friction_and_stops import friction_and_stops
from bellcrank_bench.measurements.machine import seconds_in_new_processes
from bellcrank_bench.problems.chains_and_arms import CHAIN_SETTINGS, LINKS, chain_scene
from bellcrank_bench.problems.checks import Check, largest
from bellcrank_bench.problems.n_four_bar import crank_top, n_four_bar, parallel_top
from bellcrank_bench.problems.registry import PROBLEMS

BASE_LINKS = 20  # of the chain with which longer ones are compared
LOOPS = (5, 10, 20, 40, 80)
FIRST_RUNS = {"ur5_falling": 1.0, "talos_free_fall": 5.0}  # limits in s, from an empty cache


@dataclass(frozen=True)
class HardCase:
    """The checks of one hard case, and the seconds that it took in all."""

    name: str
    title: str
    checks: list[Check]
    seconds: float


def hard_cases(progress: Callable[[str], None] = lambda name: None) -> list[HardCase]:
    """Every problem simulated and judged, then the times; about a minute.

    `progress` is called with the name of each before it starts. Raises BellcrankError if a first run fails.
    """
    jobs: list[tuple[str, str, Callable[[], list[Check]]]] = [(p.name, p.title, p.checks) for p in PROBLEMS.values()]
    jobs += [
        ("friction_and_stops", "dry friction and stops, against closed forms and SciPy's events", friction_and_stops),
        ("drives", "drives in the loop, against a published trajectory and SciPy's events", drives),
        ("chain_speed", f"time per link and evaluation, against {BASE_LINKS} links", chain_speed),
        ("n_four_bar_speed", f"time per loop and evaluation of the N four-bar, against {LOOPS[0]} loops", loop_speed),
        ("first_runs", "first runs with Radau from an empty cache, in new processes", first_runs),
        ("chain_100_compile", "chain of 100 links compiled from an empty cache, in a new process", compile_time),
    ]
    found = []
    for name, title, checks in jobs:
        progress(name)
        begun = time.perf_counter()
        made = checks()
        found.append(HardCase(name, title, made, time.perf_counter() - begun))
    return found


def chain_speed() -> list[Check]:
    """The time of stepping per link and evaluation, the best of 9 runs taken in turns."""
    best = _best_times({links: chain_scene(links) for links in LINKS}, CHAIN_SETTINGS, repeats=9)
    limits = {links: 1.5 if links > BASE_LINKS else inf for links in LINKS}
    return [
        Check(f"{links} links, {best[links] * 1e9:.1f} ns", best[links] / best[BASE_LINKS], limits[links], "times")
        for links in LINKS
        if links != BASE_LINKS
    ]


def loop_speed(counts: tuple[int, ...] = LOOPS) -> list[Check]:
    """The time of stepping the N four-bar per loop and evaluation, over 1.1 s with one flat position.

    It is constant if the cost is proportional to N. Then for each N the whole 20 s at a tolerance of 1e-8: kernel, all
    of simulate(), and the error of B0 at 401 times. The best of 5 runs taken in turns; of whole ones the best of 2.
    """
    scenes = {n: n_four_bar(n) for n in counts}
    best = _best_times(scenes, {"duration": 1.1, "rtol": 1e-9, "atol": 1e-9}, repeats=5)
    checks = [Check(f"{n} loops, {best[n] * 1e9:.1f} ns", best[n] / best[counts[0]], 2.0, "times") for n in counts[1:]]
    return checks + [check for n, scene in scenes.items() for check in _whole_run(n, scene)]


def _best_times(scenes: dict[int, Scene], settings: dict[str, Any], repeats: int) -> dict[int, float]:
    """Seconds of the kernel per evaluation and element, by the number of elements (links or loops)."""
    best = dict.fromkeys(scenes, inf)
    for _ in range(repeats):
        for count, scene in scenes.items():
            cost = simulate(scene, **settings).statistics
            best[count] = min(best[count], cost.kernel_time / cost.evaluations / count)
    return best


def _whole_run(loops: int, scene: Scene) -> list[Check]:
    settings: dict[str, Any] = {"duration": 20.0, "rtol": 1e-8, "atol": 1e-8, "times": np.linspace(0.0, 20.0, 401)}
    kernel = whole = inf
    for _ in range(2):
        begun = time.perf_counter()
        run = simulate(scene, **settings)
        whole = min(whole, time.perf_counter() - begun)
        kernel = min(kernel, run.statistics.kernel_time)
    each = f"{loops} loops, 20 s"
    top = crank_top(run.position[:, run.robot.joint("crank_0").q])  # so that the outputs need not be compiled
    return [
        Check(f"{each}: kernel, {run.statistics.evaluations} evaluations", kernel * 1e3, inf, "ms"),
        Check(f"{each}: all of simulate()", whole * 1e3, inf, "ms"),
        Check(f"{each}: B0", largest(top - parallel_top(run)), 1e-3, "m"),
    ]


def first_runs() -> list[Check]:
    """The time from `import bellcrank` to the end of 0.1 s of a fall with Radau, with an empty cache."""
    return [
        Check(f"{name} with Radau", _cold(f"bellcrank.simulate({name!r}, duration=0.1, solver='Radau')"), limit, "s")
        for name, limit in FIRST_RUNS.items()
    ]


def compile_time() -> list[Check]:
    """The time from `import bellcrank` to the compiled equations of a chain of 100 links, with an empty cache."""
    path = str(chain_scene(100).source)
    statement = (
        "from bellcrank.dynamics.equations.system import system_of\n"
        f"system_of(bellcrank.load_scene({path!r})).rhs.address('scalar')"
    )
    return [Check("100 links", _cold(statement), 5.0, "s")]


def _cold(statement: str) -> float:
    """Seconds, the better of two, that `import bellcrank` and a statement take in a new process with an empty cache."""
    return min(seconds_in_new_processes(f"import bellcrank\n{statement}")[0] for _ in range(2))
