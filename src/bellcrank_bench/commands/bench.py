"""`bellcrank bench`: time and error of solvers on scenes, or nanoseconds of the dynamics alone, with JSON and plots."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Iterable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank.commands.options import whole_option
from bellcrank.errors import InputError
from bellcrank.files import atomic_write
from bellcrank.terminal import interruption
from bellcrank.terminal.progress import bars

if TYPE_CHECKING:
    from bellcrank_bench.bench.dynamics_calls import Row

SUMMARY = "measure time against error beside hand-written C and other tools"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Scenes or robots, peers, sample count, where to write."""
    parser.add_argument(
        "scenes", nargs="*", metavar="SCENE",
        help="scenes by name (default: all that have a reference, quickly, without the slow n_four_bar_40)",
    )  # fmt: skip
    parser.add_argument("--peers", action="store_true", help="run MuJoCo, Drake and Exudyn too, and finer sweeps; slow")
    parser.add_argument(
        "--dynamics", nargs="*", metavar="ROBOT",
        help="instead of scenes: batches of inverse and forward dynamics of robots (default: ur5 panda talos)",
    )  # fmt: skip
    parser.add_argument("--hard", action="store_true", help="instead of scenes: the hard cases, each with its figure")
    parser.add_argument("--gains", action="store_true", help="instead: error and work over Baumgarte's gains, as maps")
    parser.add_argument(
        "--repeats", metavar="N", default="30", help="runs of a setting at least, the best counts (default 30)"
    )
    parser.add_argument(
        "--samples", metavar="N", default="100000", help="samples a batch of --dynamics (default 100000)"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="write bench.json, and a plot a scene, there")


def run(arguments: argparse.Namespace) -> int:
    """Time scenes, or run the hard cases, or time the dynamics; print tables and write files. 1 where a hard case
    misses its bar.
    """
    arguments.repeats = whole_option("--repeats", arguments.repeats, 1, 10**6)
    arguments.samples = whole_option("--samples", arguments.samples, 64, 10**8)
    if arguments.scenes and (arguments.hard or arguments.gains or arguments.dynamics is not None):
        raise InputError(
            "bench: scenes, --hard, --gains and --dynamics are benches of their own; name robots after --dynamics"
        )
    if arguments.out:
        atomic_write.check_folder("--out", arguments.out)
    with interruption.whole_runs():
        if arguments.hard:
            return _hard_cases(arguments)
        if arguments.gains:
            from bellcrank_bench.bench.gain_map import gain_map_command

            return gain_map_command(arguments.out)
        return _scenes(arguments) if arguments.dynamics is None else _dynamics(arguments)


def _scenes(arguments: argparse.Namespace) -> int:
    tqdm = bars()
    from bellcrank_bench.bench import work_precision_plot
    from bellcrank_bench.bench.bench_problem import NO_ROWS, PROBLEMS, Run, problem, usual
    from bellcrank_bench.bench.dynamics_calls import machine_facts
    from bellcrank_bench.bench.scene_bench import as_data, as_text, bench_scene
    from bellcrank_bench.bench.work_precision import BUDGET, QUICK

    quick = not (arguments.scenes or arguments.peers)
    names = usual() if quick else list(dict.fromkeys(arguments.scenes or PROBLEMS))
    for name in names:
        problem(name)
    facts, budget = machine_facts(), QUICK if quick else BUDGET
    print(f"{facts['cpu']}, one thread, best of {arguments.repeats} runs or more (or of what fits into {budget:g} s)")
    if quick:
        left = ", ".join(name for name in PROBLEMS if name not in names)
        print(f"name scenes for longer measurements and for slow ones ({left}); --peers adds the other simulators")
    if not arguments.scenes:
        print("\n".join(f"{name}: no row: {reason}" for name, reason in NO_ROWS.items()))
    reports, stopped = [], None
    for name in names:
        progress: Callable[[list[list[Run]]], Iterable[list[Run]]] = partial(tqdm, desc=name, unit="run", disable=None)
        try:
            reports.append(bench_scene(name, arguments.peers, arguments.repeats, progress, budget))
        except KeyboardInterrupt as stop:  # what was measured until then is written
            stopped = stop
            break
        print(as_text(reports[-1]), flush=True)
    if arguments.out and reports:
        path = arguments.out / "bench.json"
        atomic_write.write_text(path, json.dumps(as_data(reports, facts), indent=1) + "\n")
        print(f"wrote {path}")
        for report in reports:
            path = arguments.out / f"work_precision_{report.scene}.png"
            work_precision_plot.write(path, report.rows, facts["cpu"])
            print(f"wrote {path}")
    if stopped is not None:
        raise stopped
    return 0


def _hard_cases(arguments: argparse.Namespace) -> int:
    tqdm = bars()
    from bellcrank_bench.bench.dynamics_calls import machine_facts
    from bellcrank_bench.problems.registry import hard_cases

    with tqdm(desc="hard cases", unit="case", disable=None) as bar:

        def progress(name: str) -> None:
            bar.set_postfix_str(name)
            bar.update()

        rows = hard_cases(progress)
    for before, row in zip([None, *rows], rows, strict=False):
        if before is None or before.problem != row.problem:
            print(f"{row.problem}: {row.title} ({row.seconds:.2f} s)")
        f = row.figure
        bound = "" if math.isinf(f.bar) else f"   {'at least' if f.at_least else 'at most'} {f.bar:.3g}"
        print(f"  {f.name:58} {f.value:12.4g} {f.unit:9}{bound}{'' if f.good else '   MISSED'}")
    if arguments.out:
        path = arguments.out / "hard_cases.json"
        table = [{"problem": r.problem, "seconds": r.seconds, **_finite(asdict(r.figure))} for r in rows]
        atomic_write.write_text(path, json.dumps({"machine": machine_facts(), "rows": table}, indent=1) + "\n")
        print(f"wrote {path}")
    return 0 if all(row.figure.good for row in rows) else 1


def _finite(row: dict[str, Any]) -> dict[str, Any]:
    """JSON knows no infinities: what is not finite becomes null."""
    return {key: None if isinstance(value, float) and not math.isfinite(value) else value for key, value in row.items()}


def _dynamics(arguments: argparse.Namespace) -> int:
    tqdm = bars()
    from bellcrank_bench.bench import single_calls
    from bellcrank_bench.bench.dynamics_calls import ROBOTS, bench_robot, first_use, machine_facts

    names = arguments.dynamics or list(ROBOTS)
    jobs = [(name, algorithm) for name in names for algorithm in ("inverse_dynamics", "forward_dynamics")]
    rows: list[Row] = []
    for name, algorithm in tqdm(jobs, desc="bench", unit="table", disable=None):
        rows += bench_robot(name, algorithm, arguments.samples)
    single: list[Row] = []
    for name in tqdm(arguments.dynamics or single_calls.ROBOTS, desc="single calls", unit="robot", disable=None):
        single += single_calls.forward_dynamics_calls(name)
    starts = {name: first_use(name) for name in tqdm(names, desc="first use", unit="robot", disable=None)}
    facts = machine_facts()
    print(f"{facts['cpu']}, one thread, best of several; errors relative to Pinocchio")
    for title, table in ((f"batches of {arguments.samples}", rows), ("single calls, one after another", single)):
        print(f"{title}, ns a sample")
        _print_ratios(table)
    for name, seconds in starts.items():
        print(f"  {name:12} load, trace, compile {seconds['first']:.3f} s, from the cache {seconds['cached']:.3f} s")
    if arguments.out:
        path = arguments.out / "bench.json"
        data = {"machine": facts, "rows": _plain(rows), "single_calls": _plain(single), "first_use": starts}
        atomic_write.write_text(path, json.dumps(data, indent=1) + "\n")
        print(f"wrote {path}")
    return 0


def _print_ratios(rows: list[Row]) -> None:
    """A line a way, with how many times as fast as the first way of its algorithm it is."""
    base: dict[tuple[str, str], float] = {}
    for r in rows:
        ratio = base.setdefault((r.robot, r.algorithm), r.ns) / r.ns
        times = f"{ratio:6.2f} x" if math.isfinite(ratio) else "       -"
        figures = f"{r.ns:9.1f} ns  {times}  error {r.error:.1e}" if math.isfinite(r.ns) else "        -"
        print(f"  {r.robot:12} {r.algorithm:17} {r.way:31} {figures}  {r.note}")


def _plain(rows: list[Row]) -> list[dict[str, Any]]:
    return [_finite(asdict(row)) for row in rows]
