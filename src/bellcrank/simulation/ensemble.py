"""Integration of many runs of a scene at once: its equations go to the ensemble integrator."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import bellcrank._step as step
from bellcrank.codegen import llvm as machine
from bellcrank.codegen.compile import Compiled, make_ready
from bellcrank.dynamics.system import system_of
from bellcrank.simulation.ensemble_problem import EnsembleProblem, EnsembleResult, LaneKernels
from bellcrank.simulation.integration import LEAST_ATOL, event_search, scene_kernels, state_layout
from bellcrank.simulation.integration_problem import StepControl

if TYPE_CHECKING:
    from bellcrank.elements.signals import Signal
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class EnsembleStarts:
    """What differs between N runs of scenes with the same equations, signals, events and solver.

    Attributes:
        parameters: p (N, np), as `system_parameters` gives them.
        start: Starts x (N, size) that satisfy the constraints.
        duration: s (N,).
        settings: Numbers (N,) of the step control by the names of StepControl, of those that differ.
        signals: The signals that all of them follow.
    """

    parameters: Array
    start: Array
    duration: Array
    settings: Mapping[str, Array] = field(default_factory=dict)
    signals: tuple[Signal, ...] = ()

    def __len__(self) -> int:
        return len(self.start)


def integrate_ensemble(
    scene: Scene, starts: EnsembleStarts, *, threads: int = 1, progress: Callable[[int], object] | None = None
) -> EnsembleResult:
    """Integrate many runs of a scene, each as `simulate` does, and find the extremes of its observed quantities.

    `progress` is called with the number of runs that are done. After Ctrl-C the result says which are done.
    """
    system, settings = system_of(scene), scene.settings
    implicit = settings.solver == "Radau"
    projected = bool(scene.constraints) and settings.stabilisation.kind == "projection"
    layout = system.observed_layout
    kernels = scene_kernels(scene, system, implicit, projected, batched=False)
    code: dict[str, tuple[Compiled, str]] = {"observe": (system.observe, "scalar")}
    if not implicit:
        code |= {"lane_rhs": (system.rhs, "lanes"), "lane_observe": (system.observe, "lanes")}
        if scene.events:
            code["lane_events"] = (system.events, "lanes")
        if projected:
            code["lane_project"] = (system.project, "lanes")
    address = dict(zip(code, make_ready(tuple(code.values())), strict=True))
    lanes = None
    if not implicit:
        lanes = LaneKernels(
            width=machine.target().lanes,
            rhs=address["lane_rhs"],
            events=address.get("lane_events", 0),
            project=address.get("lane_project", 0),
            observe=address["lane_observe"],
        )
    problem = EnsembleProblem(
        kernels=kernels,
        lanes=lanes,
        layout=state_layout(scene),
        control=StepControl(
            method=settings.solver,
            rtol=settings.rtol,
            atol=max(settings.atol, LEAST_ATOL),
            step=settings.step or 0.0,
            first_step=settings.first_step or 0.0,
            max_step=settings.max_step or math.inf,
            max_evaluations=settings.max_evaluations,
        ),
        t1=starts.duration,
        x0=starts.start,
        parameters=starts.parameters,
        settings=dict(starts.settings),
        signals=starts.signals,
        stops=scene.stops,
        events=event_search(scene),
        observed=layout.size,
        observed_within=layout.outputs,
        observe=address["observe"],
        threads=threads,
        progress=progress,
    )
    return step.integrate_ensemble(problem)
