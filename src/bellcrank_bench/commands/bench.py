"""`bellcrank bench`: time and error of solvers on scenes, or time of the dynamics alone, as tables, JSON and plots."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from bellcrank.errors import InputError
from bellcrank.files import atomic_write
from bellcrank.terminal import interruption
from bellcrank.terminal.progress import bars

SUMMARY = "measure time against error, next to hand-written C and other tools"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Scenes or robots, peers, number of samples, where to write."""
    parser.add_argument(
        "scenes", nargs="*", metavar="SCENE",
        help="scenes by name (default: all that have a reference, quickly, without the slow n_four_bar_40)",
    )  # fmt: skip
    parser.add_argument("--peers", action="store_true", help="run MuJoCo, Drake and Exudyn too, and finer sweeps; slow")
    parser.add_argument(
        "--dynamics", nargs="*", metavar="ROBOT",
        help="instead of scenes: batches of inverse and forward dynamics of robots (default: ur5 panda talos)",
    )  # fmt: skip
    parser.add_argument(
        "--derivatives", action="store_true",
        help="with --dynamics: the derivatives of inverse and forward dynamics, next to Pinocchio's in C++",
    )  # fmt: skip
    parser.add_argument(
        "--hard", action="store_true", help="instead of scenes: the hard cases, each checked against its known answer"
    )
    parser.add_argument(
        "--gains", action="store_true", help="instead of scenes: maps of error and work over Baumgarte's gains"
    )
    parser.add_argument(
        "--ensembles", nargs="*", metavar="SCENE",
        help="instead of scenes: the time of a design among many, of sweeps, sizings and single calls "
        "(default: all scenes that have designs); --peers adds MuJoCo's rollout and SciPy",
    )  # fmt: skip
    parser.add_argument(
        "--fastest", nargs="*", metavar="ROBOT",
        help="instead of scenes: the fastest motion along a path with torque limits, next to toppra and copp-py where "
        "they are installed (default: ur5 panda planar_2r)",
    )  # fmt: skip
    parser.add_argument(
        "--arm", nargs="?", const="12", metavar="WAYPOINTS",
        help="instead of scenes: the motion and the torques of a two-link arm by optimisation, with so many inner "
        "waypoints (default 12), next to MAPTOR where it is installed",
    )  # fmt: skip
    parser.add_argument(
        "--sensitivities", nargs="*", metavar="SCENE",
        help="instead of scenes: the time of a gradient of a run by 20 parameters, in runs",
    )  # fmt: skip
    parser.add_argument(
        "--pages", action="store_true",
        help="instead of scenes: what pages compute, in headless Chromium, next to the machine code of the same "
        "expressions",
    )  # fmt: skip
    parser.add_argument(
        "--designs", metavar="N", default="10000", help="designs of each ensemble of --ensembles (default 10000)"
    )
    parser.add_argument(
        "--sweep-designs", metavar="N", default="100000",
        help="designs of the sweep of --ensembles that writes files (default 100000; the largest: 1000000)",
    )  # fmt: skip
    parser.add_argument(
        "--repeats",
        metavar="N",
        default="30",
        help="least number of runs per setting; the best one counts (default 30)",
    )
    parser.add_argument(
        "--samples", metavar="N", default="100000", help="samples per batch of --dynamics (default 100000)"
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="write bench.json, and a plot per scene, into this folder"
    )
    parser.add_argument(
        "--markdown", type=Path, metavar="FILE",
        help="write the tables of scenes or --dynamics as Markdown, as the README shows them",
    )  # fmt: skip


def run(arguments: argparse.Namespace) -> int:
    """Measure, print tables and write files; exit code 1 if a hard case misses a limit."""
    from bellcrank.commands.options import whole_option

    arguments.repeats = whole_option("--repeats", arguments.repeats, 1, 10**6)
    arguments.samples = whole_option("--samples", arguments.samples, 64, 10**8)
    arguments.designs = whole_option("--designs", arguments.designs, 1, 10**6)
    arguments.sweep_designs = whole_option("--sweep-designs", arguments.sweep_designs, 1, 10**6)
    lists = (arguments.dynamics, arguments.ensembles, arguments.fastest, arguments.sensitivities)
    others = (
        arguments.hard,
        arguments.gains,
        arguments.pages,
        arguments.arm is not None,
        *(names is not None for names in lists),
    )
    if sum([bool(arguments.scenes), *others]) > 1:
        raise InputError(
            "bench: scenes, --hard, --gains, --pages, --dynamics, --ensembles, --fastest, --arm and --sensitivities "
            "are separate benchmarks; name robots after --dynamics or --fastest and scenes after --ensembles or "
            "--sensitivities"
        )
    if arguments.derivatives and (arguments.dynamics is None or arguments.markdown):
        raise InputError("bench: --derivatives goes with --dynamics, and --markdown is not for it")
    if arguments.markdown and (
        arguments.hard
        or arguments.gains
        or arguments.pages
        or any(one is not None for one in (arguments.ensembles, arguments.fastest, arguments.arm))
    ):
        raise InputError("bench: --markdown is for scenes and --dynamics")
    if arguments.out:
        atomic_write.check_folder("--out", arguments.out)
    if arguments.derivatives:
        return _derivatives(arguments)
    if arguments.markdown:
        atomic_write.check_folder("--markdown", arguments.markdown.parent)
    with interruption.whole_runs():
        if arguments.hard:
            return _hard_cases(arguments.out)
        if arguments.gains:
            return _gains(arguments.out)
        if arguments.pages:
            return _pages(arguments)
        if arguments.ensembles is not None:
            return _ensembles(arguments)
        if arguments.fastest is not None:
            return _fastest(arguments)
        if arguments.arm is not None:
            return _arm(arguments)
        if arguments.sensitivities is not None:
            return _sensitivities(arguments)
        return _scenes(arguments) if arguments.dynamics is None else _dynamics(arguments)


def _sensitivities(arguments: argparse.Namespace) -> int:
    from bellcrank_bench.measurements import sensitivity_speed as speed

    rows = list(speed.sensitivity_rows(arguments.sensitivities or speed.SCENES, arguments.repeats))
    print("\n".join(speed.table(rows)))
    if arguments.out:
        atomic_write.write_text(arguments.out / "bench.json", json.dumps(speed.as_json(rows), indent=1) + "\n")
    return 0


def _scenes(arguments: argparse.Namespace) -> int:
    from bellcrank_bench.measurements import scene_benchmark
    from bellcrank_bench.measurements.machine import machine_facts
    from bellcrank_bench.measurements.work_precision import BUDGET, QUICK_BUDGET
    from bellcrank_bench.peers.peer import Run
    from bellcrank_bench.plots import work_precision
    from bellcrank_bench.problems.registry import BENCHMARKS, NOT_MEASURED, benchmark, quick_benchmarks
    from bellcrank_bench.tables import markdown, text

    quick = not (arguments.scenes or arguments.peers)
    names = quick_benchmarks() if quick else list(dict.fromkeys(arguments.scenes or BENCHMARKS))
    for name in names:
        benchmark(name)
    facts, budget = machine_facts(), QUICK_BUDGET if quick else BUDGET
    print(
        f"{facts['cpu']}, one thread, best of {arguments.repeats} runs or more (or of as many as fit into {budget:g} s)"
    )
    if quick:
        slow = ", ".join(name for name in BENCHMARKS if name not in names)
        print(f"name scenes for longer measurements and for slow ones ({slow}); --peers adds the other simulators")
    if not arguments.scenes:
        print("\n".join(f"{name}: not measured: {reason}" for name, reason in NOT_MEASURED.items()))
    reports, stopped = [], None
    for name in names:
        progress: Callable[[list[list[Run]]], Iterable[list[Run]]] = partial(
            bars(), desc=name, unit="run", disable=None
        )
        try:
            reports.append(scene_benchmark.measure_scene(name, arguments.peers, arguments.repeats, progress, budget))
        except KeyboardInterrupt as stop:  # what has been measured is written
            stopped = stop
            break
        print(text.scene_table(reports[-1]), flush=True)
    if arguments.out and reports:
        _write_json(arguments.out / "bench.json", scene_benchmark.benchmark_data(reports, facts))
        for report in reports:
            path = arguments.out / f"work_precision_{report.problem.name}.png"
            work_precision.write(path, report, facts["cpu"])
            print(f"wrote {path}")
    if arguments.markdown and reports:
        _write_text(arguments.markdown, markdown.scene_tables(reports))
    if stopped is not None:
        raise stopped
    return 0


def _dynamics(arguments: argparse.Namespace) -> int:
    from bellcrank_bench.measurements import single_calls
    from bellcrank_bench.measurements.dynamics_speed import ROBOTS, first_use, measure_robot
    from bellcrank_bench.measurements.machine import machine_facts
    from bellcrank_bench.measurements.row import Row
    from bellcrank_bench.tables import markdown, text

    tqdm = bars()
    names = arguments.dynamics or list(ROBOTS)
    jobs = [(name, algorithm) for name in names for algorithm in ("inverse_dynamics", "forward_dynamics")]
    rows: list[Row] = []
    for name, algorithm in tqdm(jobs, desc="bench", unit="table", disable=None):
        rows += measure_robot(name, algorithm, arguments.samples)
    single: list[Row] = []
    for name in tqdm(arguments.dynamics or single_calls.ROBOTS, desc="single calls", unit="robot", disable=None):
        single += single_calls.forward_dynamics_calls(name)
    starts = {name: first_use(name) for name in tqdm(names, desc="first use", unit="robot", disable=None)}
    facts = machine_facts()
    print(f"{facts['cpu']}, one thread, best of several; errors relative to Pinocchio")
    for title, table in ((f"batches of {arguments.samples}", rows), ("single calls, one after another", single)):
        print(f"{title}, ns per sample")
        print(text.dynamics_table(table))
    for name, seconds in starts.items():
        print(f"  {name:12} load, trace, compile {seconds['first']:.3f} s, from the cache {seconds['cached']:.3f} s")
    if arguments.out:
        data = {
            "machine": facts,
            "rows": [row.dynamics_data() for row in rows],
            "single_calls": [row.dynamics_data() for row in single],
            "first_use": starts,
        }
        _write_json(arguments.out / "bench.json", data)
    if arguments.markdown:
        _write_text(arguments.markdown, markdown.dynamics_table(rows))
    return 0


def _derivatives(arguments: argparse.Namespace) -> int:
    from bellcrank_bench.measurements.derivative_speed import derivative_rows
    from bellcrank_bench.measurements.dynamics_speed import ROBOTS
    from bellcrank_bench.measurements.machine import machine_facts
    from bellcrank_bench.tables.text import dynamics_table

    facts, rows = machine_facts(), []
    print(f"{facts['cpu']}, one thread, best of several, ns per sample; errors relative to Pinocchio")
    with interruption.whole_runs():
        for name in bars()(arguments.dynamics or list(ROBOTS), desc="bench", unit="robot", disable=None):
            found = derivative_rows(name)
            print(dynamics_table(found), flush=True)
            rows += found
    if arguments.out:
        data = {"machine": facts, "rows": [row.dynamics_data() for row in rows]}
        _write_json(arguments.out / "derivatives.json", data)
    return int(any(row.failure for row in rows))


def _ensembles(arguments: argparse.Namespace) -> int:
    from bellcrank_bench.measurements import ensemble_speed, study_speed, warm_calls
    from bellcrank_bench.measurements.ensemble_row import EnsembleRow
    from bellcrank_bench.measurements.machine import machine_facts
    from bellcrank_bench.tables.text import ensemble_table

    facts, repeats = machine_facts(), arguments.repeats
    names = [ensemble_speed.varied(name) for name in arguments.ensembles or ensemble_speed.VARIED]
    jobs: dict[str, Callable[[], list[EnsembleRow]]] = {
        f"{arguments.designs:,} designs of {name} at {ensemble_speed.TOLERANCE:g}; ratios to one run": partial(
            ensemble_speed.ensemble_rows, name, arguments.designs, repeats, arguments.peers
        )
        for name in names
    }
    if not arguments.ensembles:
        jobs |= {
            "a sweep with its files, a design; ratio to the stepping of one run": partial(
                study_speed.study_rows, arguments.sweep_designs
            ),
            "sizings, a design; ratios to size()": partial(study_speed.sizing_rows, arguments.designs, min(repeats, 5)),
            "a warm simulate(); ratios to its stepping": partial(warm_calls.simulate_rows, "four_bar", repeats),
            "inverse dynamics, a call; ratios to pin.rnea": partial(warm_calls.inverse_dynamics_rows, "ur5", repeats),
            "the first use of a process; ratios to an empty cache": partial(warm_calls.first_use_rows, "ur5"),
        }
    print(f"{facts['cpu']}, {facts['cores']} cores, best of {repeats}; CPU time: of all threads of the process")
    tables = {}
    for title, job in bars()(jobs.items(), desc="bench", unit="table", disable=None):
        tables[title] = job()
        print(f"{title}\n{ensemble_table(tables[title])}", flush=True)
    if arguments.out:
        rows = [{"table": title, **row.data()} for title, found in tables.items() for row in found]
        _write_json(arguments.out / "ensembles.json", {"machine": facts, "rows": rows})
    return 0


def _pages(arguments: argparse.Namespace) -> int:
    from bellcrank_bench.measurements.machine import machine_facts
    from bellcrank_bench.measurements.page_speed import page_rows
    from bellcrank_bench.tables.text import ensemble_table

    facts = machine_facts()
    try:
        rows = page_rows(arguments.samples, min(arguments.repeats, 5))
    except InputError as error:
        print(f"pages are not measured: {error}")
        return 0
    print(f"{facts['cpu']}, one thread, best of {min(arguments.repeats, 5)}")
    print(ensemble_table(rows))
    if arguments.out:
        _write_json(arguments.out / "pages.json", {"machine": facts, "rows": [row.data() for row in rows]})
    return 0


def _arm(arguments: argparse.Namespace) -> int:
    from bellcrank.commands.options import whole_option
    from bellcrank_bench.measurements.arm_design import INNER, arm_report
    from bellcrank_bench.measurements.machine import machine_facts

    facts = machine_facts()
    lines, data = arm_report(whole_option("--arm", arguments.arm, 4, 40) or INNER)
    print(f"{facts['cpu']}, one thread")
    print("\n".join(lines))
    if arguments.out:
        _write_json(arguments.out / "arm.json", {"machine": facts, **data})
    return 0


def _fastest(arguments: argparse.Namespace) -> int:
    from bellcrank_bench.measurements.fastest_speed import ROBOTS, fastest_rows
    from bellcrank_bench.measurements.machine import machine_facts
    from bellcrank_bench.measurements.row import Row
    from bellcrank_bench.tables.text import fastest_table

    rows: list[Row] = []
    for name in bars()(arguments.fastest or ROBOTS, desc="bench", unit="robot", disable=None):
        rows += fastest_rows(name, arguments.repeats)
    facts = machine_facts()
    print(f"{facts['cpu']}, one thread, best of {arguments.repeats} rounds; a row's error is the relative difference "
          "of its motion's time from the first row with the same limits")  # fmt: skip
    print(fastest_table(rows))
    if arguments.out:
        _write_json(arguments.out / "fastest.json", {"machine": facts, "rows": [row.scene_data() for row in rows]})
    return 0


def _hard_cases(out: Path | None) -> int:
    from bellcrank_bench.measurements.hard_cases import hard_cases
    from bellcrank_bench.measurements.machine import machine_facts
    from bellcrank_bench.measurements.row import finite
    from bellcrank_bench.tables.text import hard_case_table

    with bars()(desc="hard cases", unit="case", disable=None) as bar:

        def progress(name: str) -> None:
            bar.set_postfix_str(name)
            bar.update()

        cases = hard_cases(progress)
    for case in cases:
        print(hard_case_table(case))
    if out:
        rows = [
            {"problem": case.name, "seconds": case.seconds, **finite(asdict(check))}
            for case in cases
            for check in case.checks
        ]
        _write_json(out / "hard_cases.json", {"machine": machine_facts(), "rows": rows})
    return 0 if all(check.passed for case in cases for check in case.checks) else 1


def _gains(out: Path | None) -> int:
    from bellcrank_bench.measurements import gain_map
    from bellcrank_bench.measurements.machine import machine_facts
    from bellcrank_bench.plots import gain_map as plots
    from bellcrank_bench.tables.text import gain_table

    facts, reports = machine_facts(), []
    for case in gain_map.CASES:
        with bars()(desc=case.scene, unit="run", total=gain_map.runs_per_scene(), disable=None) as bar:
            reports.append(gain_map.GainStudy(case, bar.update).run())
        print(gain_table(reports[-1]), flush=True)
    if out:
        _write_json(out / "gains.json", gain_map.gain_maps_data(reports, facts))
        for report in reports:
            for kind, draw in (("map", plots.draw_map), ("slices", plots.draw_slices)):
                path = out / f"gain_{kind}_{report.case.scene}.png"
                plots.write(path, draw(report))
                print(f"wrote {path}")
    return 0


def _write_json(path: Path, data: dict[str, Any]) -> None:
    _write_text(path, json.dumps(data, indent=1) + "\n")


def _write_text(path: Path, text: str) -> None:
    atomic_write.write_text(path, text)
    print(f"wrote {path}")
