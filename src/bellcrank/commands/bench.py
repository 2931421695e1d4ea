"""`bellcrank bench`: time and error of solvers on scenes, or nanoseconds of the dynamics alone, with JSON and plots."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Iterable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from bellcrank import atomic
from bellcrank.errors import InputError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Scenes or robots, peers, sample count, where to write."""
    parser.add_argument(
        "scenes", nargs="*", metavar="SCENE", help="scenes by name (default: all that have a reference)"
    )
    parser.add_argument("--peers", action="store_true", help="run MuJoCo, Drake and Exudyn too, and finer sweeps")
    parser.add_argument(
        "--dynamics", nargs="*", metavar="ROBOT",
        help="instead of scenes: batches of inverse and forward dynamics of robots (default: ur5 panda talos)",
    )  # fmt: skip
    parser.add_argument("--repeats", type=int, default=30, help="runs of a setting, the best counts (default 30)")
    parser.add_argument("--samples", type=int, default=100_000, help="samples a batch of --dynamics (default 100000)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="write bench.json, and a plot a scene, there")


def run(arguments: argparse.Namespace) -> int:
    """Time scenes, or with --dynamics the compiled dynamics; print the tables and write the files."""
    if arguments.dynamics is None:
        return _scenes(arguments)
    if arguments.scenes:
        raise InputError("bench: scenes and --dynamics are two benches; name robots after --dynamics")
    return _dynamics(arguments)


def _scenes(arguments: argparse.Namespace) -> int:
    from tqdm import tqdm

    from bellcrank.validation import work_precision_plot
    from bellcrank.validation.bench import machine_facts
    from bellcrank.validation.problem import PROBLEMS, Run, problem
    from bellcrank.validation.scene_bench import as_data, as_text, bench_scene

    if arguments.repeats < 1:
        raise InputError(f"--repeats must be at least 1, it is {arguments.repeats}")
    names = list(dict.fromkeys(arguments.scenes or PROBLEMS))
    for name in names:
        problem(name)
    facts = machine_facts()
    print(f"{facts['cpu']}, one thread, best of up to {arguments.repeats} runs")
    reports = []
    for name in names:
        progress: Callable[[list[list[Run]]], Iterable[list[Run]]] = partial(tqdm, desc=name, unit="run", disable=None)
        reports.append(bench_scene(name, arguments.peers, arguments.repeats, progress))
        print(as_text(reports[-1]), flush=True)
    if arguments.out:
        path = arguments.out / "bench.json"
        atomic.write_text(path, json.dumps(as_data(reports, facts), indent=1) + "\n")
        print(f"wrote {path}")
        for report in reports:
            path = arguments.out / f"work_precision_{report.scene}.png"
            work_precision_plot.write(path, report.rows, facts["cpu"])
            print(f"wrote {path}")
    return 0


def _dynamics(arguments: argparse.Namespace) -> int:
    from tqdm import tqdm

    from bellcrank.validation.bench import ROBOTS, Row, bench_robot, first_use, machine_facts

    if arguments.samples < 64:
        raise InputError(f"--samples must be at least 64, it is {arguments.samples}")
    names = arguments.dynamics or list(ROBOTS)
    jobs = [(name, algorithm) for name in names for algorithm in ("inverse_dynamics", "forward_dynamics")]
    rows: list[Row] = []
    for name, algorithm in tqdm(jobs, desc="bench", unit="table", disable=None):
        rows += bench_robot(name, algorithm, arguments.samples)
    starts = {name: first_use(name) for name in tqdm(names, desc="first use", unit="robot", disable=None)}
    facts = machine_facts()
    print(f"{facts['cpu']}, one thread, batch of {arguments.samples}, best of several; errors relative to Pinocchio")
    base = {(r.robot, r.algorithm): r.ns for r in rows if r.way.startswith("libpinocchio")}
    for r in rows:
        ratio = base[r.robot, r.algorithm] / r.ns
        times = f"{ratio:6.1f} x" if math.isfinite(ratio) else "       -"
        figures = f"{r.ns:9.1f} ns  {times}  error {r.error:.1e}" if math.isfinite(r.ns) else "        -"
        print(f"  {r.robot:12} {r.algorithm:17} {r.way:31} {figures}  {r.note}")
    for name, seconds in starts.items():
        print(f"  {name:12} load, trace, compile {seconds['first']:.3f} s, from the cache {seconds['cached']:.3f} s")
    if arguments.out:
        path = arguments.out / "bench.json"
        table: list[dict[str, Any]] = [
            {k: (v if not isinstance(v, float) or math.isfinite(v) else None) for k, v in asdict(r).items()}
            for r in rows
        ]
        atomic.write_text(path, json.dumps({"machine": facts, "rows": table, "first_use": starts}, indent=1) + "\n")
        print(f"wrote {path}")
    return 0
