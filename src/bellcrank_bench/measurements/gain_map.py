"""Maps of error and work over Baumgarte's gains, with the automatic gains, no stabilisation and projection to compare.

`bellcrank.simulation.integration.automatic_gains` explains what they show: the gains at which error or cost begin to
grow are those of the rate of the motion itself, for every solver, step and tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.scene.scene import Scene, load_scene
from bellcrank.scene.settings import Stabilisation
from bellcrank.simulation.integration.automatic_gains import AutomaticGains, automatic_gains
from bellcrank.simulation.simulate import simulate
from bellcrank_bench.measurements.row import finite

Array = NDArray[np.float64]
ADAPTIVE = ("RK45", "DOP853")
SOLVERS = ("RK4", *ADAPTIVE)
TOLERANCE = 1e-9  # rtol = atol of the maps
TOLERANCES = (1e-6, 1e-9, 1e-12)  # of the slices
FACTORS = tuple(np.geomspace(1e-2, 1e2, 13))  # gains of a map and a slice, times the automatic ones
HALVINGS = 4
FIXED_DECAY = 0.3  # α h of gains that follow the step
OUTPUTS = 201  # times at which the motion is compared
DIVERGED = 10.0  # m or rad, of a residual or error
MOST_WORK = 30  # times the evaluations without stabilisation: runs that take more are stopped


@dataclass(frozen=True)
class Case:
    """A scene of the maps: its name, duration (s) and fixed step (s) for RK4."""

    scene: str
    duration: float
    step: float


CASES = (Case("four_bar", 12.0, 0.025), Case("rolling_disk", 10.0, 0.0025), Case("bricard", 10.0, 0.005))


@dataclass(frozen=True, kw_only=True)
class GainPoint:
    """One run with its stabilisation; numbers are infinite if it did not finish.

    Attributes:
        solver: The solver.
        setting: Its tolerance, or the step of RK4, s.
        kind: Kind of stabilisation.
        alpha: Baumgarte's α, 1/s.
        beta: Baumgarte's β, 1/s.
        residual: Largest position residual at the ends of steps, m or rad.
        residual_between: Largest position residual at the output times between them, m or rad.
        error: Largest error of a position at the output times, m or rad.
        evaluations: Number of evaluations of the equations.
        step: Mean step, s.
    """

    solver: str
    setting: float
    kind: str
    alpha: float
    beta: float
    residual: float
    residual_between: float
    error: float
    evaluations: int
    step: float


@dataclass(frozen=True, kw_only=True)
class GainMap:
    """All runs of a scene.

    Attributes:
        case: The scene.
        automatic: The automatic gains.
        rows: Every solver and setting without stabilisation, with projection and with the automatic gains.
        grid: Every solver over (α, β).
        slices: Every solver and setting along α = β.
        halvings: RK4 as its step is halved: without stabilisation, with the automatic gains, with gains of the step.
    """

    case: Case
    automatic: AutomaticGains
    rows: list[GainPoint]
    grid: list[GainPoint]
    slices: list[GainPoint]
    halvings: list[GainPoint]

    def plain(self, solver: str, kind: str, setting: float | None = None) -> GainPoint:
        """The row of a solver with a kind of stabilisation, at its first setting or at the given one."""
        rows = [r for r in self.rows if r.solver == solver and r.kind == kind]
        return rows[0] if setting is None else next(r for r in rows if r.setting == setting)


class GainStudy:
    """The runs of one scene against a reference with tight tolerances."""

    def __init__(self, case: Case, progress: Callable[[], object]) -> None:
        self.case, self._progress = case, progress
        self.scene = load_scene(case.scene)
        self.times = np.linspace(0.0, case.duration, OUTPUTS)
        projection = stabilised(self.scene, Stabilisation("projection"))
        self.reference = simulate(projection, None, "DOP853", 1e-13, 1e-13, times=self.times).position

    def point(self, solver: str, setting: float, stabilisation: Stabilisation, most: int = 10**8) -> GainPoint:
        """One run; `setting` is the tolerance, or the step (s) of RK4, and `most` the limit of evaluations."""
        scene = stabilised(self.scene, stabilisation)
        chosen: dict[str, Any] = {"step": setting} if solver == "RK4" else {"rtol": setting, "atol": setting}
        ends = simulate(scene, self.case.duration, solver, times="steps", max_evaluations=most, **chosen)
        between = simulate(scene, None, solver, times=self.times, max_evaluations=most, **chosen)
        residual = error = between_steps = math.inf
        if ends.status.success and len(between) == OUTPUTS:
            with np.errstate(all="ignore"):  # a run that diverged overflows
                residual, between_steps = ends.constraint_residual(), between.constraint_residual()
                error = float(np.abs(between.position - self.reference).max())
        residual, between_steps, error = (x if x < DIVERGED else math.inf for x in (residual, between_steps, error))
        self._progress()
        return GainPoint(
            solver=solver,
            setting=setting,
            kind=stabilisation.kind,
            alpha=stabilisation.alpha,
            beta=stabilisation.beta,
            residual=residual,
            residual_between=between_steps,
            error=error,
            evaluations=ends.statistics.evaluations,
            step=float(ends.time[-1]) / max(ends.statistics.steps, 1),
        )

    def run(self) -> GainMap:
        """All runs of the scene."""
        settings = {"RK4": self.case.step, "RK45": TOLERANCE, "DOP853": TOLERANCE}
        gains = automatic_gains(self.scene, replace(self.scene.settings, duration=self.case.duration))
        kinds = (Stabilisation("none"), Stabilisation("projection"), gains.stabilisation)
        places = [(solver, setting) for solver, setting in settings.items()]
        places += [(solver, t) for solver in ADAPTIVE for t in TOLERANCES if t != TOLERANCE]
        rows = [self.point(*place, kind) for place in places for kind in kinds]
        most = {(r.solver, r.setting): MOST_WORK * r.evaluations for r in rows if r.kind == "none"}

        def with_gains(solver: str, setting: float, alpha: float, beta: float) -> GainPoint:
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
        return GainMap(case=self.case, automatic=gains, rows=rows, grid=grid, slices=slices, halvings=halvings)


def runs_per_scene() -> int:
    """The number of points of a scene."""
    places, n = len(SOLVERS) + len(ADAPTIVE) * (len(TOLERANCES) - 1), len(FACTORS)
    return 3 * places + len(SOLVERS) * n * n + places * n + 3 * (HALVINGS + 1)


def stabilised(scene: Scene, stabilisation: Stabilisation) -> Scene:
    """The scene with another stabilisation."""
    return replace(scene, settings=replace(scene.settings, stabilisation=stabilisation))


def gain_maps_data(reports: Sequence[GainMap], facts: dict[str, Any]) -> dict[str, Any]:
    """All points as JSON can hold them; numbers of runs that did not finish are null."""
    return {
        "machine": facts,
        "scenes": [
            {**asdict(report.case), "automatic": asdict(report.automatic)}
            | {
                name: [finite(asdict(point)) for point in getattr(report, name)]
                for name in ("rows", "grid", "slices", "halvings")
            }
            for report in reports
        ],
    }
