"""Tables of measurements as text for the terminal."""

from __future__ import annotations

import math
from collections.abc import Sequence

from bellcrank_bench.c_baseline.baseline import NAME as C_BASELINE
from bellcrank_bench.measurements.ensemble_row import EnsembleRow
from bellcrank_bench.measurements.gain_map import GainMap
from bellcrank_bench.measurements.hard_cases import HardCase
from bellcrank_bench.measurements.row import Row
from bellcrank_bench.measurements.scene_benchmark import SceneReport
from bellcrank_bench.measurements.work_precision import BELLCRANK, LEVELS, Ratio, failures, pareto, time_at
from bellcrank_bench.verification.difference import Difference


def scene_table(report: SceneReport) -> str:
    """One scene: its rows, with a star at those of each tool's Pareto front, then the ratios."""
    reference, each = report.reference, report.reference.benchmark
    lines = [
        f"{report.problem.title}; error: largest position difference [{each.unit}] at {len(each.times)} times",
        f"  reference: extrapolation in extended precision; its own error {reference.step_error:.0e}, difference "
        f"from SciPy's DOP853 at 1e-13 {reference.scipy_error:.0e}",
        f"  first run of a new process, imports included: {report.first_run['cold']:.2f} s, "
        f"from the cache {report.first_run['cached']:.2f} s",
    ]
    if report.right_hand_side_ns is not None:
        lines.append(f"  {C_BASELINE}: {report.right_hand_side_ns:.1f} ns per right-hand side")
    lines += [f"  {line}" for line in report.missing]
    for tool in dict.fromkeys(row.tool for row in report.rows):
        rows = [row for row in report.rows if row.tool == tool]
        lines += [f"  {tool}: {note}" for note in dict.fromkeys(row.note for row in rows)]
        front = pareto(rows)
        lines += [f"   {'*' if row in front else ' '} {_row(row)}" for row in rows]
    counts = (f"{tool}: {failed} of {total} runs failed" for tool, (failed, total) in failures(report.rows).items())
    lines.append("  " + ", ".join(counts))
    for level in LEVELS:
        lines.append(f"  ratios of times to reach an error of {level:g} (interpolated on the Pareto fronts):")
        lines += [f"    {r.slower:28}/ {r.faster:24} {_ratio(r)}" for r in report.ratios if r.error == level]
    return "\n".join(lines + _published(report))


def _published(report: SceneReport) -> list[str]:
    """Times of whole runs that others report, next to the time of simulate() to the first of LEVELS."""
    published = report.reference.benchmark.published
    ours = time_at([row for row in report.rows if row.tool == BELLCRANK], LEVELS[0], whole=True)
    lines = [
        f"    {each.tool:12} {each.seconds * 1e3:8.1f} ms ({each.how}): {each.seconds / ours:.0f} times as long"
        for each in published
    ]
    head = f"  published times, on other machines; here simulate() to {LEVELS[0]:g} takes {ours * 1e3:.3f} ms:"
    return [head, *lines] if published else []


def _row(row: Row) -> str:
    label = f"{row.method:24} {row.setting:16}"
    if not row.reached:
        return f"{label} FAILED: {row.failure}"
    whole = "" if row.whole is None else f" whole {row.whole * 1e6:10.1f} µs"
    counts = {"evaluations": row.evaluations, "steps": row.steps, "rejected": row.rejected}
    known = ", ".join(f"{count} {what}" for what, count in counts.items() if count is not None)
    return f"{label} {row.seconds * 1e6:11.1f} µs{whole}  error {row.error:.1e}  {known}"


def _ratio(ratio: Ratio) -> str:
    return f"{ratio.value:8.2f}" if math.isfinite(ratio.value) else "     not reached"


def dynamics_table(rows: Sequence[Row]) -> str:
    """A line per row, with how many times as fast it is as the first row of its robot and algorithm."""
    base: dict[tuple[str, str], float] = {}
    lines = []
    for row in rows:
        ratio = base.setdefault((row.subject, row.method), row.seconds) / row.seconds
        times = f"{ratio:6.2f} x" if math.isfinite(ratio) else "       -"
        numbers = f"{row.nanoseconds:9.1f} ns  {times}  error {row.error:.1e}" if row.reached else "        -"
        lines.append(f"  {row.subject:12} {row.method:17} {row.tool:31} {numbers}  {row.failure or row.note}")
    return "\n".join(lines)


def fastest_table(rows: Sequence[Row]) -> str:
    """A line per row, with how many times as long it takes as the first row of its robot."""
    base: dict[str, float] = {}
    lines = []
    for row in rows:
        ratio = row.seconds / base.setdefault(row.subject, row.seconds)
        numbers = f"{row.seconds * 1e3:8.3f} ms  {ratio:6.2f} x  error {row.error:.1e}  {row.note}"
        lines.append(f"  {row.subject:10} {row.tool:14} {row.method:30} {row.failure or numbers}")
    return "\n".join(lines)


def ensemble_table(rows: Sequence[EnsembleRow]) -> str:
    """A line per row: its time and CPU time, each also as a multiple of its base, and its error."""
    head = f"  {'':76}{'time':>12}{'ratio':>9}{'CPU time':>13}{'ratio':>9}   error"
    return "\n".join([head, *map(_ensemble_row, rows)])


def _ensemble_row(row: EnsembleRow) -> str:
    label = f"  {row.subject:20} {row.tool:38} {row.setting:15}"
    if not row.timed:
        return f"{label} not timed: {row.note}"
    pairs = ((row.time.seconds, row.base.seconds), (row.time.cpu, row.base.cpu))
    times = (f"{one * 1e6:10.2f} µs {one / base:8.3g}" if math.isfinite(one) else f"{'-':>21}" for one, base in pairs)
    error = "" if row.error is None else f"{row.error:.1e}"
    return f"{label} {'  '.join(times)}   {error:8} {row.note}".rstrip()


def hard_case_table(case: HardCase) -> str:
    """One hard case: its title and time, then its checks with their limits."""
    lines = [f"{case.name}: {case.title} ({case.seconds:.2f} s)"]
    for check in case.checks:
        limit = "" if math.isinf(check.limit) else f"   {'at least' if check.at_least else 'at most'} {check.limit:.3g}"
        verdict = "" if check.passed else "   MISSED"
        lines.append(f"  {check.name:58} {check.value:12.4g} {check.unit:9}{limit}{verdict}")
    return "\n".join(lines)


def gain_table(report: GainMap) -> str:
    """One scene: each solver at each setting, without stabilisation, with projection, and with automatic gains."""
    gains = report.automatic
    lines = [
        f"{report.case.scene}, {report.case.duration:g} s: automatic gains α = β = {gains.alpha:.3g} /s from a rate of "
        f"{gains.rate:.3g} /s; the pilot run took {gains.evaluations} evaluations",
        f"  {'':24}{'stabilisation':14}{'residual':>10}{'between':>10}{'error':>10}{'evaluations':>13}{'of none':>9}"
        f"{'with pilot':>12}",
    ]
    for row in report.rows:
        plain = report.plain(row.solver, "none", row.setting).evaluations
        where = f"{row.solver}, step {row.setting:g} s" if row.solver == "RK4" else f"{row.solver}, {row.setting:.0e}"
        pilot = f"{(row.evaluations + gains.evaluations) / plain:10.2f} x" if row.kind == "baumgarte" else ""
        kind = "automatic" if row.kind == "baumgarte" else row.kind
        lines.append(
            f"  {where:24}{kind:14}{row.residual:10.1e}{row.residual_between:10.1e}{row.error:10.1e}"
            f"{row.evaluations:13}{row.evaluations / plain:7.2f} x{pilot}"
        )
    return "\n".join(lines)


def difference_table(name: str, differences: Sequence[Difference]) -> str:
    """The differences of one robot or scene from its analytic equations, and how many agree."""
    lines = [f"{name}: compiled Pinocchio against the analytic equations (largest difference / largest entry)"]
    for d in differences:
        verdict = "ok" if d.agrees else "DIFFERS"
        lines.append(
            f"  {d.quantity:17} {d.states:19} {d.samples:5d} states   {d.relative:9.2e}   "
            f"tolerance {d.tolerance:.0e}   {verdict}"
        )
    lines.append(f"{sum(d.agrees for d in differences)} of {len(differences)} quantities agree")
    return "\n".join(lines)
