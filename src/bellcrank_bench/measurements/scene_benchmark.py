"""The benchmark of a scene: bellcrank, the C baseline and the peers over their sweeps of settings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from bellcrank.config.yaml_file import read_yaml
from bellcrank.errors import BellcrankError
from bellcrank_bench.c_baseline import baseline
from bellcrank_bench.c_baseline.baseline import CBaseline
from bellcrank_bench.measurements import bellcrank_runs
from bellcrank_bench.measurements.row import Row, finite
from bellcrank_bench.measurements.work_precision import BUDGET, REPEATS, Ratio, failures, measure, ratios
from bellcrank_bench.peers import drake, exudyn, mujoco, scipy_pinocchio
from bellcrank_bench.peers.peer import Peer, Run
from bellcrank_bench.problems.problem import Problem
from bellcrank_bench.problems.reference_motion import Reference, reference
from bellcrank_bench.problems.registry import benchmark, problem

ALWAYS: tuple[Peer, ...] = (scipy_pinocchio.PEER,)  # the peers that are installed with bellcrank
OPTIONAL: tuple[Peer, ...] = (mujoco.PEER, drake.PEER, exudyn.PEER)  # the peers of `bellcrank bench --peers`
SETTINGS = Path(__file__).parent.parent / "peers" / "settings.yaml"


@dataclass(frozen=True, kw_only=True)
class SceneReport:
    """What was measured of one scene.

    Attributes:
        problem: The problem whose benchmark it is.
        reference: The reference motion.
        rows: All rows.
        ratios: Ratios of times at equal error.
        first_run: Seconds of the first run in a new process, `cold` and `cached`.
        right_hand_side_ns: Nanoseconds of a right-hand side of the C baseline; None without one.
        missing: What was not measured, and why; one line each.
    """

    problem: Problem
    reference: Reference
    rows: list[Row]
    ratios: list[Ratio]
    first_run: dict[str, float]
    right_hand_side_ns: float | None
    missing: list[str]

    def data(self) -> dict[str, Any]:
        """The report as JSON can hold it; what is infinite or undefined is null."""
        each = self.reference.benchmark
        return {
            "scene": each.scene,
            "title": self.problem.title,
            "unit": each.unit,
            "reference_error": {
                "finer_steps": self.reference.step_error,
                "scipy_dop853": self.reference.scipy_error,
            },
            "first_run": self.first_run,
            "c_right_hand_side_ns": self.right_hand_side_ns,
            "missing": self.missing,
            "published": [asdict(published) for published in each.published],
            "ratios": [finite(asdict(ratio)) for ratio in self.ratios],
            "failed": {tool: {"failed": failed, "of": total} for tool, (failed, total) in failures(self.rows).items()},
            "rows": [row.scene_data() for row in self.rows],
        }


def measure_scene(
    name: str,
    peers: bool = False,
    repeats: int = REPEATS,
    progress: Callable[[list[list[Run]]], Iterable[list[Run]]] = iter,
    budget: float = BUDGET,
) -> SceneReport:
    """Measure one scene with everything that is installed.

    Args:
        name: Name of a problem with a benchmark.
        peers: Whether to run MuJoCo, Drake and Exudyn too, with finer sweeps.
        repeats: Least number of repeats of a run.
        progress: Wraps the groups of runs that are measured (tqdm).
        budget: Time for which a run is repeated at most, s.
    """
    chosen = benchmark(name)
    missing = list(chosen.remarks)
    compiled = None
    if chosen.c_baseline:
        try:
            compiled = CBaseline(chosen)
        except BellcrankError as error:
            missing.append(f"{baseline.NAME}: {error}")
    groups = bellcrank_runs.groups(chosen, compiled, full=peers)
    published = read_yaml(SETTINGS)
    settings = published.get(chosen.scene, published["unconstrained"])
    for peer in ALWAYS + (OPTIONAL if peers else ()):
        if peer.name not in settings:
            continue
        try:
            groups += [[run] for run in peer.runs(chosen, settings[peer.name])]
        except ImportError:
            missing.append(f"{peer.name}: not installed: pip install 'bellcrank[peers]'")
    exact = reference(name)
    rows = [row for group in progress(groups) for row in measure(group, exact, repeats, budget)]
    return SceneReport(
        problem=problem(name),
        reference=exact,
        rows=rows,
        ratios=ratios(chosen.scene, rows),
        first_run=bellcrank_runs.first_run(chosen),
        right_hand_side_ns=compiled.right_hand_side_ns() if compiled else None,
        missing=missing,
    )


def benchmark_data(reports: Sequence[SceneReport], machine: dict[str, Any]) -> dict[str, Any]:
    """All reports as JSON can hold them, with the facts of the machine and the versions of what took part."""
    return {
        "machine": machine | {"versions": machine["versions"] | versions()},
        "interpolation": "log-log along each Pareto front",
        "scenes": [report.data() for report in reports],
    }


def versions() -> dict[str, str]:
    """The versions of what took part."""
    found = {}
    for name in ("bellcrank", "numpy", "pin", *(peer.package for peer in ALWAYS + OPTIONAL)):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found
