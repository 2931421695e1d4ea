"""The bench of scenes: which runs there are, their rows, and the report as text and as JSON data."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from bellcrank.config.yaml_file import read_yaml
from bellcrank.errors import BellcrankError
from bellcrank_bench.bench import own_runs
from bellcrank_bench.bench.bench_problem import Run, problem
from bellcrank_bench.bench.work_precision import (
    BUDGET,
    LEVELS,
    OWN,
    REPEATS,
    Ratio,
    Row,
    failures,
    measure,
    pareto,
    ratios,
    time_at,
)
from bellcrank_bench.c_baseline.c_baseline import HandWritten
from bellcrank_bench.textbook.reference_motion import Reference, reference

# name: package, and its module in rivals, with "_closed" after it for scenes with constraints
PEERS = {"MuJoCo": "mujoco", "Drake": "drake", "Exudyn": "exudyn"}
SETTINGS = Path(__file__).with_name("peer_settings.yaml")


@dataclass(frozen=True)
class SceneReport:
    """All rows of one scene, what is compared, and what was missing."""

    scene: str
    reference: Reference
    rows: list[Row]
    ratios: list[Ratio]
    first_run: dict[str, float]
    right_hand_side_ns: float | None
    missing: list[str]


def bench_scene(
    name: str,
    peers: bool = False,
    repeats: int = REPEATS,
    progress: Callable[[list[list[Run]]], Iterable[list[Run]]] = iter,
    budget: float = BUDGET,
) -> SceneReport:
    """Measure one scene with everything that is installed; `progress` wraps the groups of runs (tqdm).

    `budget`: s for which a run is repeated at most.
    """
    chosen = problem(name)
    missing = list(chosen.remarks)
    try:
        hand = HandWritten(chosen) if chosen.in_c else None
    except BellcrankError as error:
        hand = None
        missing.append(f"C by hand: {error}")
    groups = own_runs.groups(chosen, hand, full=peers)
    published = read_yaml(SETTINGS)
    settings = published.get(name, published["trees"])
    suffix = "_closed" if chosen.closed else ""
    groups += [[run] for run in _module("scipy_pinocchio" + suffix).runs(chosen, settings)]
    for tool, package in PEERS.items() if peers else ():
        if tool not in settings:
            continue
        try:
            groups += [[run] for run in _module(package + suffix).runs(chosen, settings[tool])]
        except ImportError:
            missing.append(f"{tool}: not installed: pip install 'bellcrank[peers]'")
    exact = reference(name)
    rows = [row for group in progress(groups) for row in measure(group, exact, repeats, budget)]
    nanoseconds = hand.right_hand_side_ns() if hand else None
    return SceneReport(
        name, exact, rows, ratios(name, rows), own_runs.first_run(chosen), nanoseconds, missing
    )  # fmt: skip


def _module(name: str) -> Any:
    return importlib.import_module(f"bellcrank_bench.peers.{name}")


def versions() -> dict[str, str]:
    """Versions of what took part."""
    found = {}
    for name in ("bellcrank", "numpy", "scipy", "pin", *PEERS.values()):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def as_text(report: SceneReport) -> str:
    """The tables of one scene: rows, with a star on each tool's Pareto front, then the ratios."""
    chosen = report.reference.problem
    lines = [
        f"{chosen.title}; error: largest position difference [{chosen.unit}] at {len(chosen.times)} times",
        f"  reference: extrapolation in extended precision, own error {report.reference.step_error:.0e}, "
        f"from SciPy's DOP853 at 1e-13 {report.reference.scipy_error:.0e}",
        f"  first run of a new process, imports included: {report.first_run['cold']:.2f} s, "
        f"from the cache {report.first_run['cached']:.2f} s",
    ]
    if report.right_hand_side_ns is not None:
        lines.append(f"  C by hand: {report.right_hand_side_ns:.1f} ns a right-hand side")
    lines += [f"  {line}" for line in report.missing]
    for tool in dict.fromkeys(r.tool for r in report.rows):
        rows = [r for r in report.rows if r.tool == tool]
        lines += [f"  {tool}: {note}" for note in dict.fromkeys(r.note for r in rows)]
        front = pareto(rows)
        lines += [f"   {'*' if r in front else ' '} {_row_text(r)}" for r in rows]
    lines.append("  " + ", ".join(f"{t}: {bad} of {n} runs failed" for t, (bad, n) in failures(report.rows).items()))
    for level in LEVELS:
        lines.append(f"  times to reach an error of {level:g} (interpolated on the Pareto fronts), as ratios:")
        lines += [f"    {r.slower:28}/ {r.faster:24} {_ratio_text(r)}" for r in report.ratios if r.error == level]
    return "\n".join(lines + _published_text(report))


def _published_text(report: SceneReport) -> list[str]:
    """What others report for whole runs, beside the time of simulate() to the first of LEVELS."""
    published = report.reference.problem.published
    ours = time_at([r for r in report.rows if r.tool == OWN], LEVELS[0], whole=True)
    lines = [
        f"    {each.tool:12} {each.seconds * 1e3:8.1f} ms ({each.how}): {each.seconds / ours:.0f} times that"
        for each in published
    ]
    head = f"  published elsewhere, on other machines; here simulate() to {LEVELS[0]:g} takes {ours * 1e3:.3f} ms:"
    return [head, *lines] if published else []


def _row_text(row: Row) -> str:
    label = f"{row.method:24} {row.setting:16}"
    if not row.reached:
        return f"{label} FAILED: {row.failure}"
    whole = "" if row.whole is None else f" whole {row.whole * 1e6:10.1f} µs"
    counts = {"evaluations": row.evaluations, "steps": row.steps, "rejected": row.rejected}
    told = ", ".join(f"{n} {what}" for what, n in counts.items() if n is not None)
    return f"{label} {row.seconds * 1e6:11.1f} µs{whole}  error {row.error:.1e}  {told}"


def _ratio_text(ratio: Ratio) -> str:
    return f"{ratio.value:8.2f}" if math.isfinite(ratio.value) else "     not reached"


def as_data(reports: Sequence[SceneReport], machine: dict[str, Any]) -> dict[str, Any]:
    """Everything as plain data; what is infinite or undefined is null."""
    return {
        "machine": machine | {"versions": machine["versions"] | versions()},
        "interpolation": "log-log along each Pareto front",
        "scenes": [
            {
                "scene": r.scene, "title": r.reference.problem.title, "unit": r.reference.problem.unit,
                "reference_error": {"finer_steps": r.reference.step_error, "scipy_dop853": r.reference.scipy_error},
                "first_run": r.first_run, "c_right_hand_side_ns": r.right_hand_side_ns, "missing": r.missing,
                "published": [asdict(each) for each in r.reference.problem.published],
                "ratios": [_finite(asdict(ratio)) for ratio in r.ratios],
                "failed": {tool: {"failed": bad, "of": n} for tool, (bad, n) in failures(r.rows).items()},
                "rows": [_finite(asdict(row)) for row in r.rows],
            }
            for r in reports
        ],
    }  # fmt: skip


def _finite(data: dict[str, Any]) -> dict[str, Any]:
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in data.items()}
