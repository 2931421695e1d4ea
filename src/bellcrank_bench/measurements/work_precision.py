"""Work against precision: the time of every tool to reach an error, its Pareto front, and ratios between fronts.

The method is that of work-precision diagrams (Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I,
sec. II.10): one reference and one output grid for all tools, and a sweep of tolerances or steps for each.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from bellcrank.codegen.full_tier import wait_for_optimised_code
from bellcrank_bench.c_baseline.baseline import NAME as C_BASELINE
from bellcrank_bench.measurements.row import Row
from bellcrank_bench.peers.peer import Outcome, Run
from bellcrank_bench.problems.reference_motion import Reference

REPEATS = 30
LEAST_TIME = (
    0.2  # s that 30 repeats last at least: runs of microseconds are repeated more often, to outlast a disturbance
)
BUDGET = 1.0  # s for which a run may be repeated; the first time always counts
QUICK_BUDGET = 0.1  # the same if many scenes are measured
BELLCRANK = "bellcrank"
PROJECTED = " + projection"  # appended to a method's name if constraints are projected after each step
LEVELS = (1e-6, 1e-10)  # errors at which times are compared


def measure(runs: Sequence[Run], reference: Reference, repeats: int = REPEATS, budget: float = BUDGET) -> list[Row]:
    """Rows of runs that are repeated in turns, so that disturbances of the machine affect all alike.

    Each is repeated at least `repeats` times, but fewer times if that takes longer than `budget` s per run.
    """
    outcomes: list[list[Outcome]] = [[] for _ in runs]
    failures = [""] * len(runs)
    begun = time.perf_counter()
    for turn in itertools.count(1):
        for k, run in enumerate(runs):
            if failures[k]:
                continue
            try:
                outcomes[k].append(run.once())
            except Exception as error:  # a peer may raise anything; the row counts as failed and says why
                failures[k] = f"{type(error).__name__}: {error}".splitlines()[0]
        wait_for_optimised_code()  # which the next turns run
        elapsed = (time.perf_counter() - begun) / len(runs)
        if elapsed > budget or (turn >= repeats and elapsed > LEAST_TIME * repeats / REPEATS):
            break
    return [_row(reference, *each) for each in zip(runs, outcomes, failures, strict=True)]


def _row(reference: Reference, run: Run, outcomes: list[Outcome], failure: str) -> Row:
    row = Row(subject=reference.benchmark.scene, tool=run.tool, method=run.method, setting=run.setting, note=run.note)
    if not failure:
        first = outcomes[0]
        error = reference.error(first.position, first.time)
        failure = "" if math.isfinite(error) else "diverged: positions are not finite, or outputs are missing"
    if failure:
        return replace(row, failure=failure)
    return replace(
        row,
        seconds=min(o.seconds for o in outcomes),
        error=error,
        evaluations=first.evaluations,
        steps=first.steps,
        rejected=first.rejected,
        whole=min((o.whole for o in outcomes if o.whole is not None), default=None),
        repeats=len(outcomes),
    )


def pareto(rows: Iterable[Row]) -> list[Row]:
    """The rows that no other row beats in both time and error, in the order of falling error."""
    front: list[Row] = []
    for row in sorted((r for r in rows if r.reached), key=lambda r: (r.error, r.seconds)):
        if not front or row.seconds < front[-1].seconds:
            front.append(row)
    return front[::-1]


def time_at(rows: Iterable[Row], error: float, whole: bool = False) -> float:
    """Seconds to reach `error` along the Pareto front of `rows`, by straight lines between logarithms.

    If every row has a smaller error, it is the time of the fastest; if none is accurate enough, it is infinite. With
    `whole` it is the time of the user's whole call instead of that on the tool's own clock.
    """
    taken = [_whole(r) for r in rows if r.whole is not None] if whole else list(rows)
    front = pareto(taken)
    accurate = [r for r in front if r.error <= error]
    if not accurate:
        return math.inf
    inside, coarse = accurate[0], [r for r in front if r.error > error]
    if not coarse or inside.error == 0.0:
        return inside.seconds
    outside = coarse[-1]
    share = math.log(error / outside.error) / math.log(inside.error / outside.error)
    return float(outside.seconds * (inside.seconds / outside.seconds) ** share)


def _whole(row: Row) -> Row:
    return replace(row, seconds=math.inf if row.whole is None else row.whole)


@dataclass(frozen=True)
class Ratio:
    """How many times as long `slower` takes as `faster` to reach an error; infinite or NaN if one never does."""

    scene: str
    error: float
    slower: str
    faster: str
    value: float


def ratios(scene: str, rows: Sequence[Row], levels: Sequence[float] = LEVELS) -> list[Ratio]:
    """bellcrank's kernel against the C baseline, method by method; then every peer against bellcrank, fastest first."""
    own = [r for r in rows if r.tool == BELLCRANK]
    peers = [tool for tool in dict.fromkeys(r.tool for r in rows) if tool not in (BELLCRANK, C_BASELINE)]
    found = []
    for level in levels:
        for method in dict.fromkeys(r.method for r in own):
            base = method.removesuffix(PROJECTED)
            baseline = [r for r in rows if r.tool == C_BASELINE and r.method == base]
            if baseline:
                ours = time_at([r for r in own if r.method == method], level)
                value = _over(ours, time_at(baseline, level))
                found.append(Ratio(scene, level, f"{BELLCRANK} {method}, kernel", f"{C_BASELINE} {base}", value))
        for whole, clock in ((False, "kernel"), (True, "simulate()")):
            ours = time_at(own, level, whole)
            times = sorted((time_at([r for r in rows if r.tool == tool], level), tool) for tool in peers)
            for place, (seconds, tool) in enumerate(times):
                label = f"{tool} (best peer)" if place == 0 and math.isfinite(seconds) else tool
                found.append(Ratio(scene, level, label, f"{BELLCRANK}, {clock}", _over(seconds, ours)))
    return found


def _over(slower: float, faster: float) -> float:
    return slower / faster if math.isfinite(faster) else math.nan


def failures(rows: Iterable[Row]) -> dict[str, tuple[int, int]]:
    """The number of failed runs and of all runs, by tool."""
    count: dict[str, tuple[int, int]] = {}
    for row in rows:
        failed, total = count.get(row.tool, (0, 0))
        count[row.tool] = (failed + (not row.reached), total + 1)
    return count
