"""Integration of a scene: its equations go to the integrator, and what it finds becomes a `Trajectory`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING
from weakref import ref

import numpy as np

from bellcrank._step import PreparedProblem
from bellcrank.arrays import Array
from bellcrank.cached_values import computed_once
from bellcrank.codegen import llvm as machine
from bellcrank.codegen.compile import Compiled, make_ready
from bellcrank.codegen.machine_code import raise_failure
from bellcrank.dynamics.constraints.constraint_alignment import alignment_cosines_along
from bellcrank.dynamics.constraints.constraint_derivatives import aligned_constraints
from bellcrank.dynamics.constraints.constraint_rows import coordinate_weights
from bellcrank.dynamics.constraints.singular_mass_matrix import refuse_singular_mass_matrix
from bellcrank.dynamics.equations.compiled_equations import LARGEST_STAGED, System
from bellcrank.dynamics.equations.system import start_states, system_of
from bellcrank.dynamics.inverse.input_breakpoints import prescribed_motion_end, signals_until
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.elements.dry_friction import DryFriction
from bellcrank.elements.element import joint_unit
from bellcrank.elements.joint_stops import JointStop
from bellcrank.elements.signals import Signal, values_at
from bellcrank.errors import InputError
from bellcrank.robot.model.joints import unit_vectors
from bellcrank.scene.events import ContactLost
from bellcrank.scene.scene import Scene
from bellcrank.simulation.integration.integration_problem import (
    DerivativeKernels,
    EventSearch,
    IntegrationProblem,
    Kernels,
    StateLayout,
    StepControl,
    found_signals,
    function_updates,
    held_entries,
    known_signals,
)
from bellcrank.simulation.integration.statistics import Status, statistics_of
from bellcrank.simulation.trajectory.events import Event, event_at
from bellcrank.simulation.trajectory.trajectory import Trajectory
from bellcrank.terminal import interruption

if TYPE_CHECKING:
    from bellcrank._step import StepResult
    from bellcrank.scene.settings import Settings
    from bellcrank.simulation.files.checkpoints import CheckpointWriter

LEAST_ATOL = 1e-100  # a smaller one changes nothing, and squares of its fractions would underflow
BATCH_OUTPUTS = 32  # from so many outputs on they are projected many at a time
AT_STOP = 1e-9  # rad or m, or of the stop's place, by which a start may be beyond a stop by rounding


@dataclass(frozen=True, eq=False)
class RunRows:
    """The rows of a run that are wanted: at `times` (m,) s or, if `every_step`, at the ends of the solver's steps."""

    times: Array
    every_step: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Integration:
    """An integration of a scene whose kernels are compiled and whose start is known: `run` costs little more than
    stepping.

    Attributes:
        scene: The scene.
        settings: The solver's settings.
        parameters: Parameters of its equations.
        signals: Its signals that are known before, until a prescribed motion ends.
        duration: s; shorter than that of the settings where a prescribed motion ends.
        x0: The state at the start.
        problem: The integrator's problem.
        stepper: The same, read by the integrator.
    """

    scene: Scene
    settings: Settings
    parameters: Array
    signals: tuple[Signal, ...]
    duration: float
    x0: Array
    problem: IntegrationProblem
    stepper: PreparedProblem

    def run(
        self, progress: Callable[[float], None] | None = None, checkpoints: CheckpointWriter | None = None
    ) -> Trajectory:
        """Integrate. `progress` is called with the time reached; `checkpoints` keeps the run on disk meanwhile.

        Raises InputError where the accelerations at the start are not finite.
        """
        updates = function_updates(self.scene)
        if checkpoints is None:
            result = self.stepper.run(progress, updates=updates)
        else:
            checkpoints.begin(self.scene, self.settings, self.parameters, self.signals)
            result = self.stepper.run(progress, checkpoints.add, checkpoints.every, updates=updates)
        return self.trajectory(result, self.parameters)

    def trajectory(self, result: StepResult, parameters: Array) -> Trajectory:
        """What the integrator found with these parameters as a run. Raises InputError as `run`."""
        raise_failure()
        held = found_signals(self.scene, np.array(result.held_time), np.asarray(result.held_values))
        signals = (*self.signals, *held)
        status = _STATUSES[result.status]
        if status is Status.INTERRUPTED:
            interruption.cut_short()
        if status is Status.FINISHED and self.duration < self.settings.duration:
            status = Status.PRESCRIBED_MOTION_ENDED
        if status is Status.NON_FINITE and result.accepted == 0:
            refuse_infinite_start(self.scene, parameters, self.x0)
        scene, time, state = self.scene, result.time, result.state
        if status is Status.PRESCRIBED_MOTION_ENDED and (not len(time) or time[-1] < result.end_time):
            time, state = np.append(time, result.end_time), np.vstack([state, result.end_state[None]])
        events = _events(scene, result, parameters, signals) if scene.events else ()
        statistics = statistics_of(scene, result, None if result.events_complete else result.event_index)
        if not result.finite:
            time, state, status = _finite_rows(time, state, status)
        run = Trajectory(
            scene, self.settings, time, state, parameters, signals, status, events, statistics, result.steps, repeat_run
        )
        return until_turned_over(run)


def prepared_integration(
    scene: Scene, settings: Settings, parameters: Array, rows: RunRows, projected: bool, observe: bool = False
) -> Integration:
    """Prepare to integrate a scene with other settings and parameters of its equations.

    `projected`: the states are projected onto its constraints. `observe`: the extremes of the observed quantities
    (`System.observe`) are wanted. Raises InputError if the start is invalid: massless
    motion, an open contact.
    """
    system, signals, duration, times = system_of(scene), scene.signals, settings.duration, rows.times
    end = prescribed_motion_end(scene)
    if end is not None and end.time <= duration:
        duration, signals, times = end.time, signals_until(scene, end.time), times[times <= end.time]
    signals = known_signals(scene, signals)
    refuse_singular_mass_matrix(scene)
    q0, v0 = consistent_start(scene)
    x0 = start_states(scene, q0[None], v0[None], parameters)[0]
    refuse_open_contact(scene, parameters, x0)
    for text in impossible_contacts(scene, parameters[None], q0[None]).values():
        raise InputError(f"{scene.source}: {text}")
    # code for many states at once pays off where an evaluation is cheap beside it
    batched = (
        projected
        and not rows.every_step
        and not scene.signal_sources
        and system.size <= LARGEST_STAGED
        and len(times) >= BATCH_OUTPUTS
    )
    kernels = scene_kernels(scene, settings, projected, batched)
    problem = IntegrationProblem(
        kernels=kernels,
        layout=state_layout(scene),
        control=step_control(settings),
        t1=duration,
        x0=x0,
        parameters=parameters,
        signals=signals,
        held=held_entries(scene),
        stops=scene.stops,
        events=event_search(scene),
        times=times,
        every_step=rows.every_step,
        observed=system.observed_layout.size if observe else 0,
        observed_within=system.observed_layout.outputs if observe else 0,
        observe=system.observe.address("scalar") if observe else 0,
    )
    return Integration(
        scene=scene,
        settings=settings,
        parameters=parameters,
        signals=signals,
        duration=duration,
        x0=x0,
        problem=problem,
        stepper=PreparedProblem(problem),
    )


_STATUSES = tuple(Status)


def _finite_rows(time: Array, state: Array, status: Status) -> tuple[Array, Array, Status]:
    """The rows before the first that is not finite: between two huge states, interpolation may overflow."""
    rows = max(int(np.argmin(np.isfinite(state).all(axis=1))), 1)  # the start is finite
    return time[:rows], state[:rows], Status.NON_FINITE


def _events(scene: Scene, result: StepResult, parameters: Array, signals: tuple[Signal, ...]) -> tuple[Event, ...]:
    return tuple(
        event_at(scene, int(k), float(t), x, parameters, signals)
        for k, t, x in zip(result.event_index, result.event_time, result.event_state, strict=True)
    )


def repeat_run(run: Trajectory, settings: Settings, times: Array, parameters: Array) -> Trajectory:
    """Integrate a run's scene again, projected onto its constraints, with rows at `times` (m,) s."""
    return prepared_integration(
        run.scene, settings, parameters, RunRows(times), projected=bool(run.scene.constraints)
    ).run()


def until_turned_over(run: Trajectory) -> Trajectory:
    """The run up to the row before one in which a weld or hinge is turned by more than a quarter turn."""
    scene, time = run.scene, run.time
    if not aligned_constraints(scene):
        return run
    good = (alignment_cosines_along(scene, time, run.state, run.inputs, run.parameters) > 0.0).all(axis=1)
    if good.all():
        return run
    rows = max(int(np.argmin(good)), 1)
    events = tuple(event for event in run.events if event.time <= time[rows - 1])
    return replace(run, time=time[:rows], state=run.state[:rows], status=Status.TURNED_OVER, events=events)


# ---- the integrator's records


def scene_kernels(scene: Scene, settings: Settings, projected: bool, batched: bool) -> Kernels:
    """The compiled functions that a run calls; those that not every run needs are compiled when first called."""
    system, implicit = system_of(scene), settings.solver == "Radau"
    staged = not implicit and system.size <= LARGEST_STAGED
    code = {"rhs": (system.stage if staged else system.rhs, "scalar")}
    if scene.events:
        code["events"] = (system.events, "scalar")
    if implicit:
        code |= _derivatives(system)
    later = {}
    if scene.constraints:
        later["fallback"] = (system.fallback_stage if staged else system.fallback, "scalar")
    if projected:
        later["project"], later["project_fallback"] = (system.project, "scalar"), (system.project_fallback, "scalar")
    if batched:
        later["project_batch"] = (system.project, "batch")
    addresses = dict(zip(code, make_ready(tuple(code.values())), strict=True))
    addresses |= {name: function.lazy_address(kind) for name, (function, kind) in later.items()}
    return Kernels(
        staged=staged,
        lanes=machine.target().lanes if implicit or batched else 1,
        derivatives=_LateDerivatives(ref(system)) if settings.solver == "auto" else None,
        **addresses,
    )


@dataclass(frozen=True)
class _LateDerivatives:
    """Compiles the derivatives of a system when called; the integrator, which keeps this, does not keep the system."""

    system: ref[System]

    def __call__(self) -> DerivativeKernels:
        system = self.system()
        assert system is not None, "whoever integrates keeps the scene"
        wanted = _derivatives(system)
        addresses = dict(zip(wanted, make_ready(tuple(wanted.values())), strict=True))
        return DerivativeKernels(lanes=machine.target().lanes, **addresses)


def _derivatives(system: System) -> dict[str, tuple[Compiled, str]]:
    if system.whole_jacobian:
        return {"jacobian": (system.jacobian, "scalar")}
    return {"tangent": (system.tangent, "batch")}


@computed_once
def state_layout(scene: Scene) -> StateLayout:
    """The parts of the state of a scene."""
    system = system_of(scene)
    prescribed = any(constraint.source is not None for constraint in scene.constraints)
    return StateLayout(
        norm_size=system.size if prescribed else system.nq + system.nv + system.nz,
        nq=system.nq,
        joints=[(j.q, j.nq, j.v, j.nv) for j in scene.robot.joints] if not system.nz else (),
        unit_parts=[(part.start, part.stop - part.start) for part in unit_vectors(scene.robot.joints)],
        weights=coordinate_weights(scene) if scene.constraints else None,
        mixed=system.nz > 0,
    )


def step_control(settings: Settings) -> StepControl:
    """The method of the settings and its step sizes."""
    return StepControl(
        method=settings.solver,
        rtol=settings.rtol,
        atol=max(settings.atol, LEAST_ATOL),
        step=settings.step or 0.0,
        first_step=settings.first_step or 0.0,
        max_step=settings.max_step or math.inf,
        max_evaluations=settings.max_evaluations,
    )


@computed_once
def event_search(scene: Scene) -> EventSearch:
    """How the events of a scene are looked for."""
    return EventSearch(
        terminal=[event.stop for event in scene.events],
        direction=[event.direction for event in scene.events],
        samples=2 if all(isinstance(event.when, ContactLost) for event in scene.events) else 8,
    )


# ---- starts that are refused


def refuse_open_contact(scene: Scene, parameters: Array, x0: Array) -> None:
    """Name a rolling contact whose plane would have to pull at the start already (InputError)."""
    opened = open_contacts(scene, parameters[None], x0[None])
    for text in opened.values():
        raise InputError(f"{scene.source}: {text}")


def impossible_contacts(scene: Scene, parameters: Array, q: Array) -> dict[int, str]:
    """The designs with parameters (n, np) and starts q (n, nq) in which a joint is beyond its stop, or whose friction
    or stop cannot have its parameters, and which one.
    """
    set_by = {target: k for k, parameter in enumerate(scene.parameters.values()) for target in parameter.sets}
    found = dict[int, str]()

    def numbers(part: DryFriction | JointStop, name: str) -> Array:
        k = set_by.get(f"force.{part.name}.{name}")
        return np.full(len(q), part.number(name)) if k is None else parameters[:, k]

    for part in scene.dry_friction:
        if part.falls:
            static, coulomb = numbers(part, "static"), numbers(part, "coulomb")
            for row in np.flatnonzero(static < coulomb).tolist():
                text = (
                    f"joint '{part.held}': static friction {static[row]:g} is below Coulomb friction "
                    f"{coulomb[row]:g}; change the parameters"
                )
                found.setdefault(row, text)
    for stop in scene.stops_of_joints:
        restitution, place, unit = numbers(stop, "restitution"), q[:, stop.joint.q], joint_unit(stop.joint, "position")
        for row in np.flatnonzero(restitution > 1.0).tolist():
            text = (
                f"joint '{stop.joint.name}': restitution {restitution[row]:g} of its stop is above 1; "
                "change the parameter"
            )
            found.setdefault(row, text)
        for end, side in (("lower", 1.0), ("upper", -1.0)):
            at = numbers(stop, end)
            for row in np.flatnonzero(side * (place - at) < -AT_STOP * np.maximum(1.0, np.abs(at))).tolist():
                text = (
                    f"joint '{stop.joint.name}' starts at {place[row]:.9g} {unit}, beyond its {end} stop at "
                    f"{at[row]:.9g} {unit}; change the start or the stop"
                )
                found.setdefault(row, text)
    return found


def open_contacts(scene: Scene, parameters: Array, x0: Array) -> dict[int, str]:
    """The designs with parameters (n, np) and starts (n, size) in which a rolling contact is open, and which one."""
    places = _contact_events(scene)
    if not places:
        return {}
    u = values_at(scene.signals, np.zeros(1))[0]
    normal = system_of(scene).events.rows(np.zeros(1), x0, u, parameters)[0]
    found = dict[int, str]()
    for k in reversed(places):  # so that the first is named
        rule = scene.events[k].when
        assert isinstance(rule, ContactLost)
        for row in np.flatnonzero(normal[:, k] < 0.0).tolist():
            found[row] = (
                f"constraints: '{rule.constraint}' is not in contact at the start: its plane would have to pull by "
                f"{-normal[row, k]:.6g} N; change the start or the forces, or write two_sided: true if the plane can "
                "pull"
            )
    return found


@computed_once
def _contact_events(scene: Scene) -> tuple[int, ...]:
    """The numbers of the events that end the run where a rolling contact would pull."""
    return tuple(k for k, rule in enumerate(scene.events) if rule.stop and isinstance(rule.when, ContactLost))


def refuse_infinite_start(scene: Scene, parameters: Array, x0: Array) -> None:
    """Name the joint whose acceleration is not finite at the start, and the remedies (InputError)."""
    for text in infinite_starts(scene, parameters[None], x0[None]).values():
        raise InputError(f"{scene.source}: {text}")


def infinite_starts(scene: Scene, parameters: Array, x0: Array) -> dict[int, str]:
    """The designs with parameters (n, np) and starts (n, size) in which an acceleration is not finite, and which."""
    system, u = system_of(scene), scene.signals_at(np.zeros(1))[0]
    staged = scene.settings.solver != "Radau" and system.size <= LARGEST_STAGED  # what a run calls is compiled
    more = (np.zeros(system.size), np.zeros(1)) if staged else ()
    plain, *guard = (system.stage if staged else system.rhs).rows(np.zeros(1), x0, u, parameters, *more)
    odd = ~np.isfinite(plain).all(axis=1)
    if guard:
        odd |= ~(guard[0][:, 0] > 0.0)
    rows = np.flatnonzero(odd)
    rates = plain[rows]
    if guard and len(rows):
        fallback = system.fallback_stage if staged else system.fallback
        rates = fallback.rows(np.zeros(1), x0[rows], u, parameters[rows], *more)[0]
    found = dict[int, str]()
    for row, rate in zip(rows.tolist(), rates[:, system.nq : system.nq + system.nv], strict=True):
        bad = np.flatnonzero(~np.isfinite(rate))
        if len(bad):
            where = next(j.name for j in reversed(scene.robot.joints) if j.v <= bad[0])
            found[row] = (
                f"the acceleration of joint '{where}' is not finite at the start: either the links beyond it have no "
                "inertia about its axis (give them mass), or a force, gain or parameter is undefined or too large there"
            )
    return found
