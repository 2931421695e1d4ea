"""Many runs of a benchmark by MuJoCo's rollout with threads, and by SciPy in a loop."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from bellcrank.config.yaml_file import read_yaml
from bellcrank_bench.measurements.ensemble_row import Duration, EnsembleRow, best_in_turns, clocked, thread_count
from bellcrank_bench.measurements.row import Row
from bellcrank_bench.measurements.scene_benchmark import SETTINGS
from bellcrank_bench.measurements.work_precision import measure
from bellcrank_bench.peers import mujoco, scipy_pinocchio
from bellcrank_bench.problems.problem import Benchmark
from bellcrank_bench.problems.reference_motion import reference
from bellcrank_bench.problems.registry import BENCHMARKS, NOT_MEASURED

ROLLOUT = "mujoco.rollout"
TURNS = 2
LONGEST = 1.0  # s of a turn, about
LOOSER = 1e3  # the error of a run is the sum of those of its steps
MEMORY = 64e6  # bytes of all states of a rollout at most, about
MOST_RUNS = 256


def peer_rows(name: str, tolerance: float, threads: int, base: Duration) -> list[EnsembleRow]:
    """The rows of the peers of a scene; a peer without a time says why."""
    if name not in BENCHMARKS:
        note = f"not measured: {NOT_MEASURED[name]}"
        return [EnsembleRow(subject=name, tool=tool, note=note) for tool in (ROLLOUT, scipy_pinocchio.NAME)]
    chosen = BENCHMARKS[name]
    published = read_yaml(SETTINGS)
    settings = published.get(chosen.scene, published["unconstrained"])
    return [
        *_rollouts(chosen, settings[mujoco.NAME], tolerance, threads, base),
        _scipy(chosen, tolerance, base),
    ]


def _rollouts(
    benchmark: Benchmark, settings: Mapping[str, Any], tolerance: float, threads: int, base: Duration
) -> list[EnsembleRow]:
    """mujoco.rollout at the fastest setting with an error of at most LOOSER tolerances, else the most accurate one."""
    try:
        steppings = list(mujoco.steppings(benchmark, settings))
    except ImportError:
        note = "not installed: pip install 'bellcrank[peers]'"
        return [EnsembleRow(subject=benchmark.scene, tool=ROLLOUT, note=note)]
    exact, limit = reference(benchmark.scene), LOOSER * tolerance
    found = [measure([stepping.run], exact, repeats=1, budget=0.0)[0] for stepping in steppings]
    chosen, best = min(zip(steppings, found, strict=True), key=lambda each: _rank(each[1], limit))
    if not best.reached:
        return [EnsembleRow(subject=benchmark.scene, tool=ROLLOUT, note="diverges at every setting")]
    reached = "" if best.error <= limit else f" (no setting reaches {limit:g})"
    bytes_per_run = 8 * chosen.count * (len(benchmark.times) - 1) * (1 + chosen.model.nq + chosen.model.nv)
    runs = int(max(min(MEMORY / bytes_per_run, LONGEST / best.seconds, MOST_RUNS), 2 * threads))
    rows = []
    for count in (1, threads):
        once, end = chosen.rollout(runs, count)
        [time] = best_in_turns([partial(clocked, once)], TURNS)
        rows.append(
            EnsembleRow(
                subject=benchmark.scene,
                tool=ROLLOUT,
                setting=thread_count(count),
                time=time / runs,
                base=base,
                error=float(np.abs(end() - exact.benchmark.positions(exact.state)[-1]).max()),
                note=f"{chosen.method}, {chosen.setting}{reached}; error: from the reference at the end",
            )
        )
    return rows


def _rank(row: Row, limit: float) -> tuple[float, float]:
    return (limit, row.seconds) if row.error <= limit else (row.error, row.seconds)


def _scipy(benchmark: Benchmark, tolerance: float, base: Duration) -> EnsembleRow:
    runs = list(scipy_pinocchio.runs(benchmark, {"solve_ivp": {"DOP853": [tolerance]}}))
    if not runs:
        return EnsembleRow(subject=benchmark.scene, tool=scipy_pinocchio.NAME, note="no scene of it")
    [run], errors = runs, []
    exact = reference(benchmark.scene)

    def once() -> None:
        errors.append(exact.error(run.once().position))

    [best] = best_in_turns([lambda: clocked(once)], TURNS)
    return EnsembleRow(
        subject=benchmark.scene, tool=run.tool, setting="loop in Python", time=best, base=base, error=errors[0],
        note=f"DOP853, {run.setting}; error: from the reference",
    )  # fmt: skip
