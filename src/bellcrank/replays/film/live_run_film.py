"""What the page of a run needs to compute it again: functions, settings, places of figures, and rows to compare."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, fields, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Indices
from bellcrank.elements.expression_constraint import FunctionConstraint
from bellcrank.replays.film.film import Film
from bellcrank.replays.film.live_film import LiveFilm, byte_planes, finite, name_of
from bellcrank.replays.film.live_shapes import ShownExpressions
from bellcrank.scene.settings import Settings
from bellcrank.simulation.integration.statistics import Status
from bellcrank.simulation.live_simulation import live_simulation
from bellcrank.simulation.trajectory.plot_panels import linear_panels, residual_panels, shown_unit
from bellcrank.simulation.trajectory.run_warnings import LARGEST_DRIFT
from bellcrank.simulation.trajectory.state_history import residual_columns

if TYPE_CHECKING:
    import casadi

    from bellcrank.dynamics.equations.assembly import Assembly
    from bellcrank.simulation.trajectory.trajectory import Trajectory

ENGINE = 62_000  # bytes of the integrator, deflated
ROWS = 2000  # of a run that a page computes, at least: two for each pixel of a plot
COMPARED = 33  # rows that the page compares on opening


def live_run_film(run: Trajectory, film: Film) -> LiveFilm | str:
    """The run for its page, which shows this film; or a clause that says why the page cannot compute it."""
    places = _Places(run, film)
    live = live_simulation(run, places.shown)
    if isinstance(live, str):
        return live
    rows = np.unique(np.linspace(0, len(run) - 1, COMPARED).astype(int))
    numbers = np.concatenate([live.description, run.time[rows], run.state[rows].ravel()])
    content = {
        "kind": "run",
        "settings": [finite(asdict(replace(one, unit=one.unit or "1"))) for one in live.settings],
        "fixed": live.fixed,
        "modules": [len(module) for module in live.modules],
        "numbers": [len(live.description), len(rows)],
        "size": run.state.shape[1],
        "shown": live.shown,
        "duration": run.settings.duration,
        "samples": max(ROWS, min(len(run), 5 * ROWS)),
        **places.content,
        "events": [[rule.name, rule.stop] for rule in run.scene.events],
        "statuses": [[status, status.success, status.advice] for status in Status],
        "stored": {
            "end": float(run.time[-1]),
            "status": list(Status).index(run.status),
            "events": [[[rule.name for rule in run.scene.events].index(e.name), e.time] for e in run.events],
        },
        "gains": run.settings.stabilisation.kind if run.scene.constraints else None,
        "largest_drift": LARGEST_DRIFT,
        "command": _command(run),
    }
    return LiveFilm(content=content, blocks=(*live.modules, byte_planes(numbers)), engine=ENGINE)


class _Places(ShownExpressions):
    """What a page shows of a state: the expressions, and the place of each figure of a film among them.

    The panels of a plot are asked for with places in place of numbers, so that what they show stands in one module.
    """

    def __init__(self, run: Trajectory, film: Film) -> None:
        super().__init__(film, run.scene)
        self._run = run

    def shown(self, a: Assembly) -> casadi.SX:
        """The expressions; T, V and W come first."""
        import casadi

        film, scene = self.film, self._run.scene
        work = a.work if a.has_work else casadi.SX(0)
        energies = [self._add(each)[:, 0] for each in (a.kinetic, a.potential, work, a.kinetic + a.potential)]
        outputs = {name: self._add(value) for name, value in a.outputs.items()}
        columns = SimpleNamespace(
            scene=scene,
            robot=scene.robot,
            time=np.zeros(1),
            position=self._add(a.q),
            velocity=self._add(a.v),
            kinetic_energy=energies[0],
            potential_energy=energies[1],
            work=energies[2],
            total_energy=energies[3],
            torque=self._add(a.actuator + a.passive),
            multiplier_names=self._run.multiplier_names,
            multipliers=None if a.solution is None else self._add(a.solution.proximal.multipliers),
            outputs=outputs,
            output=outputs.__getitem__,
            constraint_residuals=dict(self._residuals(a)),
        )
        table: Any = columns
        lines = {
            (panel.title, shown_unit(panel.unit), name): int(place[0])
            for panel in (*linear_panels(table), *residual_panels(table, False))
            for name, place in panel.lines
        }
        self.content["charts"] = [
            [lines.get((chart.title.partition(" (")[0], chart.unit, line.name), -1) for line in chart.lines]
            for chart in film.charts
        ]
        self.content["residuals"] = [[unit, int(place[0])] for unit, place in columns.constraint_residuals.items()]
        self.add_shapes(a.symbols, dict(scene.parameters))
        return self.all()

    def _add(self, value: casadi.SX) -> Indices:
        """The places (1, n) of an expression."""
        first = self.add(value)
        return np.arange(first, self.size)[None]

    def _residuals(self, a: Assembly) -> Iterator[tuple[str, Any]]:
        """The places of the largest residuals by unit."""
        import casadi

        if a.solution is None:
            return
        c, found = a.solution.derivatives, dict[str, casadi.SX]()
        both = c.position_residual, c.velocity_residual
        for unit, speed, k in residual_columns(self._run.multiplier_names, both[0].numel(), both[1].numel()):
            found[unit] = casadi.fmax(found.get(unit, 0.0), casadi.fabs(both[speed][k]))
        for unit, value in found.items():
            yield unit, self._add(value)[:, 0]


def _command(run: Trajectory) -> dict[str, Any] | None:
    """How the run is made on the command line; None where it is not."""
    scene, own, used = run.scene, run.scene.settings, run.settings
    if any(isinstance(constraint, FunctionConstraint) for constraint in scene.constraints):
        return None
    overrides: list[list[Any]] = [[path, value] for path, value in scene.config.overrides.items()]
    for one in fields(Settings):
        value = getattr(used, one.name)
        if value != getattr(own, one.name):
            overrides.append([f"simulate.{one.name}", asdict(value) if one.name == "stabilisation" else value])
    return {"words": ["bellcrank", "simulate", name_of(scene.config)], "overrides": overrides}
