"""`bellcrank bench`: the table on screen, the figures with machine and versions as JSON."""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import asdict
from pathlib import Path

from bellcrank import atomic
from bellcrank.errors import InputError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Robots, sample count, where to write."""
    parser.add_argument("robots", nargs="*", metavar="ROBOT", help="robots by name or URDF (default: ur5 panda talos)")
    parser.add_argument("--samples", type=int, default=100_000, help="samples a batch (default 100000)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="write bench.json there")


def run(arguments: argparse.Namespace) -> int:
    """Time each robot and algorithm; print ns a sample and the ratio to Pinocchio."""
    from tqdm import tqdm

    from bellcrank.validation.bench import ROBOTS, Row, bench_robot, first_use, machine_facts

    if arguments.samples < 64:
        raise InputError(f"--samples must be at least 64, it is {arguments.samples}")
    names = arguments.robots or list(ROBOTS)
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
        table = [
            {k: (v if not isinstance(v, float) or math.isfinite(v) else None) for k, v in asdict(r).items()}
            for r in rows
        ]
        atomic.write_text(path, json.dumps({"machine": facts, "rows": table, "first_use": starts}, indent=1) + "\n")
        print(f"wrote {path}")
    return 0
