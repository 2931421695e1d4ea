"""Maps of error and work over Baumgarte's gains, with the automatic choice, none and projection beside them.

What they show is explained in simulation/baumgarte_gains.py: the gains at which a run begins to err or to cost
more are those of the motion's own rate, for every solver, step and tolerance.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.files import atomic_write
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.scene.settings import Stabilisation
from bellcrank.simulation.baumgarte_gains import AutomaticGains, automatic_gains
from bellcrank.simulation.simulate import simulate

Array = NDArray[np.float64]
ADAPTIVE = ("RK45", "DOP853")
SOLVERS = ("RK4", *ADAPTIVE)
TOLERANCE = 1e-9  # rtol = atol of the maps
TOLERANCES = (1e-6, 1e-9, 1e-12)  # of the slices
FACTORS = tuple(np.geomspace(1e-2, 1e2, 13))  # gains of a map and a slice, times the automatic ones
HALVINGS = 4
FIXED_DECAY = 0.3  # α h of the slice that follows the step
OUTPUTS = 201  # times at which the motion is compared
ABSURD = 10.0  # m or rad: such a run blew up
MOST_WORK = 30  # times the evaluations without stabilisation: what takes more is left out


@dataclass(frozen=True)
class Case:
    """A scene of the maps: its name, duration (s) and fixed step (s) for RK4."""

    scene: str
    duration: float
    step: float


CASES = (Case("four_bar", 12.0, 0.025), Case("rolling_disk", 10.0, 0.0025), Case("bricard", 10.0, 0.005))


@dataclass(frozen=True)
class Point:
    """A run with its stabilisation: the largest |φ| (m or rad) at step ends and at outputs between them, the largest
    error of a position (m or rad) at those outputs, evaluations, and mean step (s); infinite where it did not finish.
    """

    solver: str
    setting: float
    kind: str
    alpha: float
    beta: float
    constraint: float
    constraint_between: float
    error: float
    evaluations: int
    step: float


@dataclass(frozen=True)
class GainMap:
    """All of a scene: the automatic gains, plain rows (none, projection, automatic), grids over (α, β), slices α = β of
    several tolerances, and RK4's constraint as its step is halved.
    """

    case: Case
    automatic: AutomaticGains
    rows: list[Point]
    grid: list[Point]
    slices: list[Point]
    halvings: list[Point]

    def plain(self, solver: str, kind: str, setting: float | None = None) -> Point:
        """The row of a solver with a kind of stabilisation, at the map's own setting or another."""
        rows = [r for r in self.rows if r.solver == solver and r.kind == kind]
        return rows[0] if setting is None else next(r for r in rows if r.setting == setting)


class Bench:
    """Runs of one scene against its tight reference."""

    def __init__(self, case: Case, progress: Callable[[], object]) -> None:
        self.case, self._progress = case, progress
        self.scene = load_scene(case.scene)
        self.times = np.linspace(0.0, case.duration, OUTPUTS)
        projection = stabilised(self.scene, Stabilisation("projection"))
        self.reference = simulate(projection, None, "DOP853", 1e-13, 1e-13, times=self.times).position

    def point(self, solver: str, setting: float, stabilisation: Stabilisation, most: int = 10**8) -> Point:
        """One run; `setting` is the tolerance, or the step (s) of RK4."""
        scene = stabilised(self.scene, stabilisation)
        chosen: dict[str, Any] = {"step": setting} if solver == "RK4" else {"rtol": setting, "atol": setting}
        ends = simulate(scene, self.case.duration, solver, times="steps", max_evaluations=most, **chosen)
        between = simulate(scene, None, solver, times=self.times, max_evaluations=most, **chosen)
        constraint = error = beyond = math.inf
        if ends.status.success and len(between) == OUTPUTS:
            with np.errstate(all="ignore"):  # a run that blew up has positions beyond all numbers
                constraint, beyond = ends.constraint_residual(), between.constraint_residual()
                error = float(np.abs(between.position - self.reference).max())
        constraint, beyond, error = (x if x < ABSURD else math.inf for x in (constraint, beyond, error))
        did, s = ends.statistics, stabilisation
        mean_step = float(ends.time[-1]) / max(did.steps, 1)
        self._progress()
        return Point(solver, setting, s.kind, s.alpha, s.beta, constraint, beyond, error, did.evaluations, mean_step)

    def __call__(self) -> GainMap:
        """Everything of the scene."""
        settings = {"RK4": self.case.step, "RK45": TOLERANCE, "DOP853": TOLERANCE}
        gains = automatic_gains(self.scene, replace(self.scene.settings, duration=self.case.duration))
        kinds = (Stabilisation("none"), Stabilisation("projection"), gains.stabilisation)
        places = [(solver, setting) for solver, setting in settings.items()]
        places += [(solver, t) for solver in ADAPTIVE for t in TOLERANCES if t != TOLERANCE]
        rows = [self.point(*place, kind) for place in places for kind in kinds]
        most = {(r.solver, r.setting): MOST_WORK * r.evaluations for r in rows if r.kind == "none"}

        def with_gains(solver: str, setting: float, alpha: float, beta: float) -> Point:
            limit = most.get((solver, setting), 10**8)
            return self.point(solver, setting, Stabilisation("baumgarte", alpha, beta), limit)

        a = gains.alpha
        grid = [with_gains(v, s, a * f, a * g) for v, s in settings.items() for g in FACTORS for f in FACTORS]
        slices = [with_gains(v, s, a * f, a * f) for v, s in places for f in FACTORS]
        halvings = []
        for k in range(HALVINGS + 1):
            h = self.case.step * 0.5 ** (k - 1)
            halvings += [self.point("RK4", h, kinds[0]), with_gains("RK4", h, a, a)]
            halvings.append(with_gains("RK4", h, FIXED_DECAY / h, FIXED_DECAY / h))
        return GainMap(self.case, gains, rows, grid, slices, halvings)


def runs_of_a_scene() -> int:
    """How many points a scene takes."""
    places, n = len(SOLVERS) + len(ADAPTIVE) * (len(TOLERANCES) - 1), len(FACTORS)
    return 3 * places + len(SOLVERS) * n * n + places * n + 3 * (HALVINGS + 1)


def stabilised(scene: Scene, stabilisation: Stabilisation) -> Scene:
    """The scene with another stabilisation."""
    return replace(scene, settings=replace(scene.settings, stabilisation=stabilisation))


def as_text(report: GainMap) -> str:
    """A table: each solver at each setting, without stabilisation, projected, and with automatic gains."""
    g = report.automatic
    lines = [
        f"{report.case.scene}, {report.case.duration:g} s: automatic gains α = β = {g.alpha:.3g} /s from a rate of "
        f"{g.rate:.3g} /s; the pilot run took {g.evaluations} evaluations",
        f"  {'':24}{'stabilisation':14}{'constraint':>10}{'between':>10}{'error':>10}{'evaluations':>13}{'of none':>9}"
        f"{'with pilot':>12}",
    ]
    for r in report.rows:
        plain = report.plain(r.solver, "none", r.setting).evaluations
        where = f"{r.solver}, step {r.setting:g} s" if r.solver == "RK4" else f"{r.solver}, {r.setting:.0e}"
        pilot = f"{(r.evaluations + g.evaluations) / plain:10.2f} x" if r.kind == "baumgarte" else ""
        kind = "automatic" if r.kind == "baumgarte" else r.kind
        lines.append(
            f"  {where:24}{kind:14}{r.constraint:10.1e}{r.constraint_between:10.1e}{r.error:10.1e}{r.evaluations:13}"
            f"{r.evaluations / plain:7.2f} x{pilot}"
        )
    return "\n".join(lines)


def as_data(reports: list[GainMap], facts: dict[str, Any]) -> dict[str, Any]:
    """All points as JSON can hold them: what did not finish is null."""

    def points(rows: list[Point]) -> list[dict[str, Any]]:
        pairs = [asdict(row).items() for row in rows]
        return [{k: None if isinstance(x, float) and not math.isfinite(x) else x for k, x in p} for p in pairs]

    return {
        "machine": facts,
        "scenes": [
            {**asdict(r.case), "automatic": asdict(r.automatic)}
            | {name: points(getattr(r, name)) for name in ("rows", "grid", "slices", "halvings")}
            for r in reports
        ],
    }


def gain_map_command(out: Path | None) -> int:
    """Run all maps, print their tables, and write gains.json and two plots a scene into the folder `out`."""
    from bellcrank.terminal.progress import bars
    from bellcrank_bench.bench import gain_map_plot
    from bellcrank_bench.bench.dynamics_calls import machine_facts

    facts, reports = machine_facts(), []
    for case in CASES:
        with bars()(desc=case.scene, unit="run", total=runs_of_a_scene(), disable=None) as bar:
            reports.append(Bench(case, bar.update)())
        print(as_text(reports[-1]), flush=True)
    if out:
        atomic_write.write_text(out / "gains.json", json.dumps(as_data(reports, facts), indent=1) + "\n")
        print(f"wrote {out / 'gains.json'}")
        for report in reports:
            for kind, draw in (("map", gain_map_plot.draw_map), ("slices", gain_map_plot.draw_slices)):
                path = out / f"gain_{kind}_{report.case.scene}.png"
                gain_map_plot.write(path, draw(report))
                print(f"wrote {path}")
    return 0
