"""Work against precision: every tool's time to reach an error, its Pareto front, and ratios between fronts.

The habits are those of work-precision diagrams (Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I,
sec. II.10): one reference, one output grid for all, a sweep of tolerances or steps each.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from bellcrank_bench.bench.bench_problem import Outcome, Run
from bellcrank_bench.textbook.reference_motion import Reference

REPEATS = 30
SETTLE = 0.2  # s that 30 repeats last at least: runs of microseconds are repeated more often, to outlast a disturbance
BUDGET = 1.0  # s a run may be repeated for; the first time always counts
QUICK = 0.1  # the same where many scenes are to be gone through
OWN, HAND = "bellcrank", "C by hand"
PROJECTED = " + projection"  # a method's name gains it where constraints are projected after each step
LEVELS = (1e-6, 1e-10)  # errors at which times are compared


@dataclass(frozen=True)
class Row:
    """One tool, method and setting: best time on its own clock in s, largest position error, and counts.

    `whole` is the best time of the user's whole call in s, where it is measured apart. A run that failed has infinite
    time and error, and `failure` says why: it is counted, never dropped.
    """

    scene: str
    tool: str
    method: str
    setting: str
    seconds: float
    error: float
    evaluations: int | None = None
    steps: int | None = None
    rejected: int | None = None
    whole: float | None = None
    repeats: int = 0
    note: str = ""
    failure: str = ""

    @property
    def reached(self) -> bool:
        """Whether the run ended with finite positions."""
        return math.isfinite(self.error) and math.isfinite(self.seconds)


def measure(runs: Sequence[Run], reference: Reference, repeats: int = REPEATS, budget: float = BUDGET) -> list[Row]:
    """Rows of runs that belong together, taken in turns, so that the machine's moods hit all alike.

    Each is repeated at least `repeats` times, fewer where that takes longer than `budget` s a run.
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
            except Exception as error:  # a peer may raise anything: the row says what, and counts as a failure
                failures[k] = f"{type(error).__name__}: {error}".splitlines()[0]
        elapsed = (time.perf_counter() - begun) / len(runs)
        if elapsed > budget or (turn >= repeats and elapsed > SETTLE * repeats / REPEATS):
            break
    scene = reference.problem.name
    return [_row(scene, *each, reference) for each in zip(runs, outcomes, failures, strict=True)]


def _row(scene: str, run: Run, outcomes: list[Outcome], failure: str, reference: Reference) -> Row:
    if not failure:
        first = outcomes[0]
        error = reference.error(first.position, first.time)
        failure = "" if math.isfinite(error) else "diverged: positions are not finite, or outputs are missing"
    if failure:
        nothing = math.inf
        return Row(scene, run.tool, run.method, run.setting, nothing, nothing, note=run.note, failure=failure)
    whole = min((o.whole for o in outcomes if o.whole is not None), default=None)
    return Row(
        scene, run.tool, run.method, run.setting, min(o.seconds for o in outcomes), error,
        first.evaluations, first.steps, first.rejected, whole, len(outcomes), run.note,
    )  # fmt: skip


def pareto(rows: Iterable[Row]) -> list[Row]:
    """The rows that no other row beats in both time and error, the least exact first."""
    front: list[Row] = []
    for row in sorted((r for r in rows if r.reached), key=lambda r: (r.error, r.seconds)):
        if not front or row.seconds < front[-1].seconds:
            front.append(row)
    return front[::-1]


def time_at(rows: Iterable[Row], error: float, whole: bool = False) -> float:
    """Seconds to reach `error` along the Pareto front of `rows`, by straight lines between logarithms.

    Where every row is more exact than that, the fastest row's time; infinite where none is exact enough. With
    `whole`, of the user's whole call instead of the tool's own clock.
    """
    taken = [_whole(r) for r in rows if r.whole is not None] if whole else list(rows)
    front = pareto(taken)
    exact = [r for r in front if r.error <= error]
    if not exact:
        return math.inf
    inside, coarse = exact[0], [r for r in front if r.error > error]
    if not coarse or inside.error == 0.0:
        return inside.seconds
    outside = coarse[-1]
    share = math.log(error / outside.error) / math.log(inside.error / outside.error)
    return float(outside.seconds * (inside.seconds / outside.seconds) ** share)


def _whole(row: Row) -> Row:
    return replace(row, seconds=math.inf if row.whole is None else row.whole)


@dataclass(frozen=True)
class Ratio:
    """How many times longer `slower` takes than `faster` to an error; infinite or nan where one does not reach it."""

    scene: str
    error: float
    slower: str
    faster: str
    value: float


def ratios(scene: str, rows: Sequence[Row], levels: Sequence[float] = LEVELS) -> list[Ratio]:
    """bellcrank's kernel against C by hand, method by method; then every peer against bellcrank, the best first."""
    own = [r for r in rows if r.tool == OWN]
    peers = [tool for tool in dict.fromkeys(r.tool for r in rows) if tool not in (OWN, HAND)]
    found = []
    for level in levels:
        for method in dict.fromkeys(r.method for r in own):
            base = method.removesuffix(PROJECTED)
            hand = [r for r in rows if r.tool == HAND and r.method == base]
            if hand:
                ours = time_at([r for r in own if r.method == method], level)
                value = _over(ours, time_at(hand, level))
                found.append(Ratio(scene, level, f"{OWN} {method}, kernel", f"{HAND} {base}", value))
        for whole, clock in ((False, "kernel"), (True, "simulate()")):
            ours = time_at(own, level, whole)
            times = sorted((time_at([r for r in rows if r.tool == tool], level), tool) for tool in peers)
            for place, (seconds, tool) in enumerate(times):
                label = f"{tool} (best peer)" if place == 0 and math.isfinite(seconds) else tool
                found.append(Ratio(scene, level, label, f"{OWN}, {clock}", _over(seconds, ours)))
    return found


def _over(slower: float, faster: float) -> float:
    return slower / faster if math.isfinite(faster) else math.nan


def failures(rows: Iterable[Row]) -> dict[str, tuple[int, int]]:
    """How many runs of each tool failed, of how many."""
    count: dict[str, tuple[int, int]] = {}
    for row in rows:
        bad, all_of_it = count.get(row.tool, (0, 0))
        count[row.tool] = (bad + (not row.reached), all_of_it + 1)
    return count
