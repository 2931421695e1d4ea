"""bellcrank's own runs of a scene, each beside the hand-written C with the same method and setting."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from typing import Any

from bellcrank.errors import BellcrankError
from bellcrank.files.temporaries import temporary_folder
from bellcrank_bench.bench.bench_problem import Outcome, Problem, Run
from bellcrank_bench.bench.work_precision import HAND, OWN, PROJECTED
from bellcrank_bench.c_baseline.c_baseline import NOTE, HandWritten

TOLERANCES = {
    False: (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13),
    True: (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13),
}  # the default sweep, and the full one
SUBSTEPS = {False: (5, 10, 20, 50, 100, 200), True: (2, 5, 10, 20, 40, 80, 120, 200)}  # of RK4, between two outputs
OWN_NOTE = "kernel: steady clock around the stepping; whole: simulate() of a scene that is loaded"


def groups(problem: Problem, hand: HandWritten | None, full: bool) -> list[list[Run]]:
    """bellcrank's runs, each in a group with C (where there is any) that is timed in turns with it.

    A closed scene is run without stabilisation, as the program in C is, and with projection.
    """
    scenes = _scenes(problem)
    made = []
    for method in problem.adaptive:
        for tolerance in (each for each in TOLERANCES[full] if each >= problem.tightest):
            made.append(_group(problem, scenes, hand, method, f"{tolerance:g}", {"tolerance": tolerance}))
    for count in SUBSTEPS[full]:
        step = problem.times[1] / count
        made.append(_group(problem, scenes, hand, "RK4", f"h {step:.3g}", {"step": step}))
    return made


def _group(
    problem: Problem,
    scenes: dict[str, Any],
    hand: HandWritten | None,
    method: str,
    setting: str,
    given: dict[str, float],
) -> list[Run]:
    group = [
        Run(OWN, method + suffix, setting, OWN_NOTE, partial(_simulate, problem, scene, method, **given))
        for suffix, scene in scenes.items()
    ]
    if hand is not None:
        group.append(Run(HAND, method, setting, NOTE, partial(hand.run, method, **given)))
    return group


def _scenes(problem: Problem) -> dict[str, Any]:
    """The scene by what its methods' names gain; a closed one without stabilisation and with projection.

    Both without events: nothing locks or lifts off within the duration, and the program in C watches for none.
    """
    from bellcrank.scene.settings import Stabilisation

    scene = _scene(problem)
    if not problem.closed:
        return {"": scene}
    kinds = {"": "none", PROJECTED: "projection"} if problem.in_c else {PROJECTED: "projection"}
    return {
        suffix: replace(scene, events=(), settings=replace(scene.settings, stabilisation=Stabilisation(kind)))
        for suffix, kind in kinds.items()
    }


def _scene(problem: Problem) -> Any:
    from bellcrank.scene.scene import load_scene

    scene = load_scene(problem.name)
    order = tuple(joint.name for joint in scene.robot.joints)
    if order[: len(problem.joints)] != problem.joints:
        raise BellcrankError(f"{problem.name}: the scene's joints are {order}, the analytic equations {problem.joints}")
    return scene


def _simulate(problem: Problem, scene: Any, method: str, tolerance: float = 1e-6, step: float | None = None) -> Outcome:
    from bellcrank.simulation.simulate import simulate

    begun = time.perf_counter()
    run = simulate(
        scene, solver=method, rtol=tolerance, atol=tolerance, step=step, times=problem.times, duration=problem.duration
    )
    whole = time.perf_counter() - begun
    made = run.statistics
    return Outcome(made.kernel_time, problem.own(run), None, made.evaluations, made.steps, made.rejected, whole)


def first_run(problem: Problem) -> dict[str, float]:
    """Seconds from a scene's name to its first run, in a new process, with an empty cache and then from the cache."""
    script = (
        "import time\nbegun = time.perf_counter()\nimport bellcrank\n"
        f"scene = bellcrank.load_scene({problem.name!r})\n"
        "bellcrank.simulate(scene, solver='DOP853', rtol=1e-8, atol=1e-8)\n"
        "print(time.perf_counter() - begun)\n"
    )
    with temporary_folder("bench") as folder:
        environment, seconds = {**os.environ, "BELLCRANK_CACHE": str(folder)}, []
        for _ in range(2):
            command = [sys.executable, "-c", script]
            done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
            if done.returncode:
                raise BellcrankError(f"the first run of {problem.name} failed: {done.stderr.strip().splitlines()[-1:]}")
            seconds.append(float(done.stdout))
    return {"cold": seconds[0], "cached": seconds[1]}
