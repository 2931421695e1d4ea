"""Integration of many runs of a scene at once: its equations go to the ensemble integrator."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from bellcrank._step import has_lanes
from bellcrank._step import integrate_ensemble as integrate_in_lanes
from bellcrank.arrays import Array
from bellcrank.codegen import llvm as machine
from bellcrank.codegen.compile import make_ready
from bellcrank.codegen.machine_code import raise_failure
from bellcrank.dynamics.equations.system import system_of
from bellcrank.simulation.integration.ensemble_problem import EnsembleProblem, EnsembleResult, LaneKernels
from bellcrank.simulation.integration.held_entries import held_entries
from bellcrank.simulation.integration.integration import event_search, scene_kernels, state_layout, step_control

if TYPE_CHECKING:
    from bellcrank.dynamics.equations.compiled_equations import System
    from bellcrank.elements.signals import Signal
    from bellcrank.scene.scene import Scene


@dataclass(frozen=True, eq=False, kw_only=True)
class EnsembleStarts:
    """What differs between N runs of scenes with the same equations, signals, events and solver.

    Attributes:
        parameters: p (N, np), as `system_parameters` gives them.
        start: Starts x (N, size) that satisfy the constraints.
        duration: s (N,).
        settings: Numbers (N,) of the step control by the names of StepControl, of those that differ.
        signals: The signals that all of them follow, without those that each finds by itself.
    """

    parameters: Array
    start: Array
    duration: Array
    settings: Mapping[str, Array] = field(default_factory=dict)
    signals: tuple[Signal, ...] = ()

    def __len__(self) -> int:
        return len(self.start)


def integrate_ensemble(
    scene: Scene,
    starts: EnsembleStarts,
    *,
    observe: bool = True,
    threads: int = 1,
    progress: Callable[[int], object] | None = None,
) -> EnsembleResult:
    """Integrate many runs of a scene, each as `simulate` does, and find the extremes of its observed quantities.

    Explicit methods step as many runs at once as the processor has SIMD lanes. Radau steps one by one, and so do "auto"
    a run that becomes stiff, and runs whose forces switch or whose controllers are sampled: each has its own instants.
    A row of the result depends on its own start, parameters and settings alone, to the last bit.

    Args:
        scene: What the runs have in common: equations, signals, events, solver, and settings where `starts` has none.
        starts: What differs between them.
        observe: Whether the extremes of the observed quantities (`System.observe`) are wanted.
        threads: The number of threads.
        progress: Called with the number of runs that are done about every 0.1 s.

    Returns:
        The columns; after Ctrl-C they say which runs are done.
    """
    system, settings = system_of(scene), scene.settings
    alone = settings.solver == "Radau" or bool(scene.held_sources)
    projected = bool(scene.constraints) and settings.stabilisation.kind == "projection"
    problem = EnsembleProblem(
        kernels=scene_kernels(scene, settings, projected, batched=False),
        lanes=None if alone else _lane_kernels(scene, system, projected, observe),
        layout=state_layout(scene),
        control=step_control(settings),
        t1=starts.duration,
        x0=starts.start,
        parameters=starts.parameters,
        settings=dict(starts.settings),
        signals=starts.signals,
        held=held_entries(scene),
        stops=scene.stops,
        events=event_search(scene),
        observed=system.observed_layout.size if observe else 0,
        observed_within=system.observed_layout.outputs if observe else 0,
        observe=system.observe.address("scalar") if observe else 0,
        threads=threads,
        progress=progress,
    )
    columns = integrate_in_lanes(problem)
    raise_failure()
    return EnsembleResult(**columns)


def _lane_kernels(scene: Scene, system: System, projected: bool, observe: bool) -> LaneKernels | None:
    """The compiled functions for as many states as there are SIMD lanes; None where `_step` cannot use so many."""
    width = machine.target().lanes
    if not has_lanes(width):
        return None
    code, later = {"rhs": system.rhs}, {}
    if scene.constraints:
        later["fallback"] = system.fallback
    if scene.events:
        code["events"] = system.events
    if projected:
        later["project"], later["project_fallback"] = system.project, system.project_fallback
    if observe:
        code["observe"] = system.plain_observe
    addresses = dict(zip(code, make_ready([(function, "lanes") for function in code.values()]), strict=True))
    addresses |= {name: function.lazy_address("lanes") for name, function in later.items()}
    return LaneKernels(width=width, **addresses)
