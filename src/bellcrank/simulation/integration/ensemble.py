"""Integration of many runs of a scene at once: its equations go to the ensemble integrator."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank._step import has_lanes
from bellcrank._step import integrate_ensemble as integrate_in_lanes
from bellcrank.arrays import Array, Mask
from bellcrank.codegen import llvm as machine
from bellcrank.codegen.compile import make_ready
from bellcrank.codegen.machine_code import raise_failure
from bellcrank.dynamics.equations.system import system_of
from bellcrank.simulation.integration.integration import event_search, scene_kernels, state_layout, step_control
from bellcrank.simulation.integration.integration_problem import (
    EventSearch,
    HeldEntries,
    Kernels,
    StateLayout,
    StepControl,
    held_entries,
)

if TYPE_CHECKING:
    from bellcrank.dynamics.equations.compiled_equations import System
    from bellcrank.elements.signals import Signal
    from bellcrank.scene.scene import Scene


Whole = NDArray[np.int64]


@dataclass(frozen=True, eq=False, kw_only=True)
class LaneKernels:
    """Addresses of compiled functions that evaluate `width` states at once; 0 where there is none.

    Each takes (t, x, u, p). Entry i of an input or output is a vector of `width`
    doubles, one a lane, at 8 · width · i bytes from its 64-byte aligned beginning.

    Attributes:
        width: The number of lanes, the doubles of a SIMD register.
        rhs: The state's rate; where `fallback` is given, a guard as well.
        fallback: The state's rate where the guard of `rhs` is not positive.
        events: The event functions.
        project: The Newton correction of (q, v) onto the constraints, and a guard.
        project_fallback: The correction where the guard of `project` is not positive.
        observe: The quantities whose extremes are wanted.
    """

    width: int
    rhs: int
    fallback: int = 0
    events: int = 0
    project: int = 0
    project_fallback: int = 0
    observe: int = 0


@dataclass(frozen=True, eq=False, kw_only=True)
class EnsembleProblem:
    """Many runs x' = rhs(t, x, u, p) from t = 0 on, each with its own start, parameters, duration and step sizes.

    Attributes:
        kernels: The functions for single states, for runs that leave the lanes.
        lanes: The functions for many states; None: every run is a single one, as with Radau and with held entries.
        layout: The parts of a state.
        control: The method, and what `rtol` … `max_evaluations` are where the arrays below do not say.
        t1: Durations (N,), s.
        x0: Starts (N, n).
        parameters: p (N, np).
        settings: Arrays (N,) by the names of StepControl's numbers, such as "rtol", of those that differ.
        signals: u, as piecewise polynomials of t; the same for all runs, apart from held entries.
        held: The entries of u after those of the signals, which each run finds; None: there are none.
        stops: Times, s, at which forces jump.
        events: How events are looked for.
        observed: The number m of `observe`'s quantities.
        observed_within: How many of the first of them are looked at within steps too, and not only at their ends.
        observe: `observe` for single states.
        threads: The number of threads.
        progress: Called with the number of runs that are done about every 0.1 s.
    """

    kernels: Kernels
    lanes: LaneKernels | None
    layout: StateLayout
    control: StepControl
    t1: Array
    x0: Array
    parameters: Array
    settings: dict[str, Array] = field(default_factory=dict)
    signals: Sequence[Signal] = ()
    held: HeldEntries | None = None
    stops: Array = field(default_factory=lambda: np.empty(0))
    events: EventSearch = field(default_factory=EventSearch)
    observed: int = 0
    observed_within: int = 0
    observe: int = 0
    threads: int = 1
    progress: Callable[[int], object] | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class EnsembleResult:
    """What `bellcrank._step.integrate_ensemble` finds: columns, one row a run, E event functions, h held entries.

    Attributes:
        done: Whether the run was done (N,); False after Ctrl-C for those that were not, whose other entries are NaN.
        status: Numbers of `Status` (N,).
        end_time: s (N,).
        end_state: (N, n).
        event_count: How often each event occurred (N, E).
        event_time: The time of the first, NaN where there was none (N, E).
        event_state: The state there (N, E, n).
        stopped_by: The number of the event that ended the run, −1: none (N,).
        unresolved: In how many steps crossings of an event may have been missed (N, E).
        undefined: In how many steps an event function was not a number (N, E).
        least: The least value of each observed quantity (N, m).
        largest: The largest value of each (N, m).
        held_start: The held entries at the start (N, h).
        held_end: Those at the end (N, h).
        held_event: Those after the first of each event (N, E, h).
        accepted: Steps (N,).
        rejected: Steps (N,).
        evaluations: Of the right-hand side (N,).
        single: Whether the run left the lanes (N,).
        seconds: Computing time of the call.
    """

    done: Mask
    status: Whole
    end_time: Array
    end_state: Array
    event_count: Whole
    event_time: Array
    event_state: Array
    stopped_by: Whole
    unresolved: Whole
    undefined: Whole
    least: Array
    largest: Array
    held_start: Array
    held_end: Array
    held_event: Array
    accepted: Whole
    rejected: Whole
    evaluations: Whole
    single: Mask
    seconds: float


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
