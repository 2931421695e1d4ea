"""Many runs of one scene with their own parameters and starts, and compiled functions of their states."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from bellcrank.arrays import Array, Indices, Mask
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.elements.signals import Signal, values_at
from bellcrank.simulation.integration.ensemble import EnsembleResult
from bellcrank.simulation.integration.integration_problem import known_signals

if TYPE_CHECKING:
    from bellcrank.codegen.compile import Compiled
    from bellcrank.scene.scene import Scene


@dataclass(frozen=True, eq=False, kw_only=True)
class Runs:
    """n runs of scenes with the same equations, signals and events.

    Attributes:
        scene: The scene of one of them.
        signals: The signals that all of them followed; what each found is in the result.
        duration: The durations that were asked for (n,), s.
        parameters: p (n, np).
        start: The starts x (n, size).
        result: What the integrator found.
    """

    scene: Scene
    signals: tuple[Signal, ...]
    duration: Array
    parameters: Array
    start: Array
    result: EnsembleResult

    def __len__(self) -> int:
        return len(self.start)

    @classmethod
    def none(cls, scene: Scene) -> Self:
        """No runs: their measures are the names and units of a scene's measures."""
        p, start = system_parameters(scene), np.zeros((0, system_of(scene).size))
        return cls(
            scene=scene,
            signals=known_signals(scene, scene.signals),
            duration=np.zeros(0),
            parameters=np.zeros((0, len(p))),
            start=start,
            result=empty_result(scene, 0),
        )

    def part(self, rows: NDArray[np.int64]) -> Self:
        """Some of the runs, by their numbers."""
        arrays: dict[str, Any] = {
            each.name: value[rows]
            for each in fields(self.result)
            if isinstance(value := getattr(self.result, each.name), np.ndarray)
        }
        return replace(
            self,
            duration=self.duration[rows],
            parameters=self.parameters[rows],
            start=self.start[rows],
            result=replace(self.result, **arrays),
        )

    def at(self, present: Mask | None, time: Array, state: Array, held: Array) -> StatesOfRuns:
        """States (n, size) of all runs, or of those that have them, at times (n,) s, with the held entries (n, h)."""
        rows = None if present is None or present.all() else np.flatnonzero(present)
        if rows is not None:
            time, state, held = time[rows], state[rows], held[rows]
        p = self.parameters if rows is None else self.parameters[rows]
        inputs = np.hstack([values_at(self.signals, time), held])
        return StatesOfRuns(count=len(self), rows=rows, time=time, state=state, inputs=inputs, parameters=p)


@dataclass(frozen=True, eq=False, kw_only=True)
class StatesOfRuns:
    """States (k, size) of some `rows` of `count` runs, None: of all, at times (k,) s, with their signals (k, nu) and
    parameters (k, np).
    """

    count: int
    rows: Indices | None
    time: Array
    state: Array
    inputs: Array
    parameters: Array

    def evaluated(self, function: Compiled) -> tuple[Array, ...]:
        """The outputs (count, size) of a function of (t, x, u, p); NaN in the other rows."""
        found = function(self.time[:, None], self.state, self.inputs, self.parameters)
        several = found if isinstance(found, tuple) else (found,)
        return several if self.rows is None else tuple(self._spread(values) for values in several)

    def _spread(self, values: Array) -> Array:
        whole = np.full((self.count, values.shape[1]), np.nan)
        whole[self.rows] = values
        return whole


def empty_result(scene: Scene, count: int) -> EnsembleResult:
    """The record of so many runs of a scene before anything is known of them."""
    system = system_of(scene)
    size, events, observed = system.size, len(scene.events), system.observed_layout.size
    held = sum(source.width for source in scene.held_sources)
    return EnsembleResult(
        done=np.zeros(count, dtype=bool),
        status=np.zeros(count, dtype=np.int64),
        end_time=np.full(count, np.nan),
        end_state=np.full((count, size), np.nan),
        event_count=np.zeros((count, events), dtype=np.int64),
        event_time=np.full((count, events), np.nan),
        event_state=np.full((count, events, size), np.nan),
        stopped_by=np.full(count, -1, dtype=np.int64),
        unresolved=np.zeros((count, events), dtype=np.int64),
        undefined=np.zeros((count, events), dtype=np.int64),
        least=np.full((count, observed), np.nan),
        largest=np.full((count, observed), np.nan),
        held_start=np.full((count, held), np.nan),
        held_end=np.full((count, held), np.nan),
        held_event=np.full((count, events, held), np.nan),
        accepted=np.zeros(count, dtype=np.int64),
        rejected=np.zeros(count, dtype=np.int64),
        evaluations=np.zeros(count, dtype=np.int64),
        single=np.zeros(count, dtype=bool),
        seconds=0.0,
    )
