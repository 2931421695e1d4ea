"""The tables of the README as Markdown: time against error of scenes, and time per sample of the dynamics."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from bellcrank_bench.c_baseline.baseline import NAME as C_BASELINE
from bellcrank_bench.measurements.dynamics_speed import GENERATED, PINOCCHIO
from bellcrank_bench.measurements.row import Row
from bellcrank_bench.measurements.scene_benchmark import SceneReport
from bellcrank_bench.measurements.work_precision import BELLCRANK, PROJECTED, time_at

METHOD = "DOP853"  # of bellcrank against the C baseline
PEERS = {  # label: the tools that it stands for
    "SciPy + Pinocchio": ("SciPy + pin.aba", "SciPy + pin.constraintDynamics"),
    "MuJoCo": ("MuJoCo",),
    "Drake": ("Drake",),
    "Exudyn": ("Exudyn",),
}
ROBOTS = {"ur5": "UR5", "panda": "Panda", "talos": "Talos with free base"}


def scene_tables(reports: Sequence[SceneReport]) -> str:
    """Ratios of times to reach an error: a table of the scenes without constraints, and one of those with constraints.

    Every scene is compared at an error of 1e-6, those without constraints at 1e-10 too. With constraints, bellcrank's
    runs are those with projection.
    """
    unconstrained = [report for report in reports if not report.reference.benchmark.constrained]
    constrained = [report for report in reports if report.reference.benchmark.constrained]
    tables = [(unconstrained, (1e-6, 1e-10)), (constrained, (1e-6,))]
    return "\n".join(_scene_table(chosen, levels) for chosen, levels in tables if chosen)


def _scene_table(reports: Sequence[SceneReport], levels: Sequence[float]) -> str:
    columns = [(report, level) for report in reports for level in levels]
    head = [f"{report.problem.title}, error {level:.0e}".replace("e-0", "e-") for report, level in columns]
    rows = [[f"bellcrank's stepping / {C_BASELINE}", *(_against_c(*column) for column in columns)]]
    measured = {row.tool for report in reports for row in report.rows}
    for label, tools in PEERS.items():
        if measured.intersection(tools):
            rows.append([f"{label} / bellcrank", *(_against_peer(*column, tools) for column in columns)])
    return _table(["", *head], rows)


def _own(report: SceneReport) -> list[Row]:
    """bellcrank's rows; with constraints those with projection."""
    suffix = PROJECTED if report.reference.benchmark.constrained else ""
    return [row for row in report.rows if row.tool == BELLCRANK and row.method.endswith(suffix)]


def _against_c(report: SceneReport, level: float) -> str:
    def chosen(rows: Iterable[Row]) -> list[Row]:
        return [row for row in rows if row.method.removesuffix(PROJECTED) == METHOD]

    baseline = chosen(row for row in report.rows if row.tool == C_BASELINE)
    if not baseline:
        return "no C baseline"
    coordinates = report.reference.benchmark.c_coordinates
    ratio = _ratio(time_at(chosen(_own(report)), level), time_at(baseline, level))
    return f"{ratio} (C in {coordinates})" if coordinates else ratio


def _against_peer(report: SceneReport, level: float, tools: Sequence[str]) -> str:
    rows = [row for row in report.rows if row.tool in tools]
    return _ratio(time_at(rows, level), time_at(_own(report), level)) if rows else "not set up"


def _ratio(slower: float, faster: float) -> str:
    """A ratio of times; `never` if no setting of the slower one reaches the error."""
    if not math.isfinite(faster):
        return "not reached"
    if not math.isfinite(slower):
        return "never"
    value = slower / faster
    return f"{value:.2f}" if value < 3 else f"{value:.1f}" if value < 10 else f"{value:,.0f}"


def dynamics_table(rows: Sequence[Row]) -> str:
    """Nanoseconds per sample of batches: a line per robot and algorithm, a column per tool."""
    tools = list(dict.fromkeys(row.tool for row in rows))
    order = [PINOCCHIO, GENERATED, *reversed([tool for tool in tools if tool not in (PINOCCHIO, GENERATED)])]
    names = {PINOCCHIO: "Pinocchio C++", GENERATED: "casadi's C, -O3"}
    lines = []
    for subject, method in dict.fromkeys((row.subject, row.method) for row in rows):
        mine = {row.tool: row for row in rows if (row.subject, row.method) == (subject, method)}
        label = f"{ROBOTS.get(subject, subject)}, {method.replace('_', ' ')}"
        lines.append([label, *(_nanoseconds(mine.get(tool), mine.get(PINOCCHIO)) for tool in order)])
    return _table(["ns per sample", *(names.get(tool, _instruction_set(tool)) for tool in order)], lines)


def _instruction_set(tool: str) -> str:
    return tool.replace("avx512", "AVX-512").replace("avx2", "AVX2")


def _nanoseconds(row: Row | None, pinocchio: Row | None) -> str:
    if row is None or not row.reached:
        return "-"
    text = f"{row.nanoseconds:,.0f}" if row.nanoseconds >= 100 else f"{row.nanoseconds:.1f}"
    if pinocchio is None or not pinocchio.reached or not row.tool.startswith(BELLCRANK):
        return text
    return f"{text} ({pinocchio.seconds / row.seconds:.0f}×)"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [f"| {' | '.join(cells)} |" for cells in (head, *rows)]
    lines.insert(1, "|" + "---|" * len(head))
    return "\n".join(lines) + "\n"
