"""`simulate`: from a scene to a run."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank._step import integrate
from bellcrank.codegen import llvm as machine
from bellcrank.codegen.compile import make_ready
from bellcrank.dynamics.binding_rows import binding_of, coordinate_weights
from bellcrank.dynamics.consistent_start import consistent_start
from bellcrank.dynamics.constraint_angles import cosines_along, turning
from bellcrank.dynamics.prescribed_motion_end import drive_end, signals_until
from bellcrank.dynamics.system import LARGEST_STAGED, system_of, system_parameters
from bellcrank.elements.signals import values_at
from bellcrank.errors import InputError
from bellcrank.scene.constraint_conditions import ContactLost
from bellcrank.scene.overrides import EXPECTED_OVERRIDES
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.scene.settings import SOLVERS, Settings, Stabilisation, check_rows
from bellcrank.simulation.baumgarte_gains import automatic_gains
from bellcrank.simulation.record import Event, Latch, Statistics, Unresolved
from bellcrank.simulation.status import Status
from bellcrank.simulation.trajectory import Trajectory
from bellcrank.terminal import interruption

if TYPE_CHECKING:
    from bellcrank.simulation.run_blocks import Keeper

Array = NDArray[np.float64]
LEAST_ATOL = 1e-100  # less says no more, and squares of shares of it would overflow
KEEP_EVERY, LONGEST_KEEP = 5.0, 1e6  # s
MISSED = ("unresolved_count", "unresolved_time", "undefined_count", "undefined_time", "event_counts")
MANY = 32  # outputs, from which on they are projected together


def simulate(
    scene: Scene | str | Path,
    duration: float | None = None,
    solver: str | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    step: float | None = None,
    times: Any = None,
    overrides: Mapping[str, Any] | None = None,
    *,
    samples: int | None = None,
    first_step: float | None = None,
    max_step: float | None = None,
    max_evaluations: int | None = None,
    stabilisation: Stabilisation | Mapping[str, Any] | str | None = None,
    progress: Callable[[float], None] | None = None,
    keep: str | Path | None = None,
    keep_every: float = KEEP_EVERY,
) -> Trajectory:
    """Simulate a scene (or the file or name of one) over `duration` seconds; what is not given, the scene says.

    solver: "DOP853", "RK45", "Radau" (stiff) or "RK4"; rtol and atol as in scipy.integrate.solve_ivp, on every position
    and velocity (rad, m, rad/s, m/s). A fixed `step` (s) turns the step-size control off; tolerances given here, or a
    solver that has them, undo a fixed step of the scene. Results are given at `times` (m,) in s, at `samples` equal
    times, or with times="steps" at the solver's own steps; a run that ends early has its last state as a row more.
    `overrides` changes the scene, as in {"initial.shoulder": "10 deg"}. `progress` is called with the time reached
    about every 0.1 s. `stabilisation` says how constraints are kept: "projection", "none", {"kind": "baumgarte", "alpha":
    20, "beta": 20} or {"kind": "baumgarte", "gains": "auto"}. `keep` names an .npz file in which the run is kept: it is
    saved there at the end, and what is computed before that, about every `keep_every` s of computing, in a folder of
    blocks beside it, run.blocks for run.npz, which `load_run` opens too; it goes when the file is there. Blocks of an
    earlier run that never came to its end are moved to run.blocks.1, and so on.

    Returns a Trajectory, whose `status` says why it ended: what was computed is never lost. Raises InputError for
    arguments that are wrong, for a start at which the accelerations are not finite, and where `keep` cannot be written.
    """
    if not isinstance(scene, Scene):
        scene = load_scene(arguments.subject("scene", scene, "a scene"))
    if overrides is not None and (changed := arguments.mapping("overrides", overrides, EXPECTED_OVERRIDES)):
        scene = scene.with_overrides(changed)
    if solver is not None:
        arguments.text("solver", solver, f"one of {', '.join(SOLVERS)}")
    if progress is not None:
        arguments.function("progress", progress, "a function of the time reached")
    if not scene.robot.nv:
        raise InputError(
            f"{scene.source}: {scene.robot.urdf.name} has no joint that moves, so that there is nothing to simulate; "
            "floating_base: true in a scene sets it free"
        )
    given = {
        "duration": duration, "solver": solver, "rtol": rtol, "atol": atol, "step": step, "samples": samples,
        "first_step": first_step, "max_step": max_step, "max_evaluations": max_evaluations,
        "stabilisation": stabilisation,
    }  # fmt: skip
    changes: dict[str, Any] = {key: value for key, value in given.items() if value is not None}
    steps_wanted = isinstance(times, str)
    if steps_wanted and times != "steps":
        arguments.refuse("times", 'increasing numbers (s) or "steps"', times)
    wanted = None if times is None or steps_wanted else _checked_times(times)
    if wanted is not None and duration is None:
        changes["duration"] = float(wanted[-1]) or scene.settings.duration
    adaptive = changes.get("solver", scene.settings.solver) != "RK4"
    if adaptive and scene.settings.step and step is None and not {"solver", "rtol", "atol"}.isdisjoint(changes):
        changes["step"] = None  # whoever asks for tolerances wants them kept
    settings = with_gains(scene, replace(scene.settings, **changes) if changes else scene.settings)
    if settings.stabilisation != scene.settings.stabilisation:
        scene = replace(scene, settings=settings)  # gains are parameters of its equations
    if wanted is None:
        check_rows(settings.samples, scene.robot.nq + scene.robot.nv)
        wanted = np.linspace(0.0, settings.duration, settings.samples)
    elif wanted[-1] > settings.duration * (1.0 + 1e-15):
        raise InputError(f"times reach {wanted[-1]:.17g} s, beyond the duration of {settings.duration:.17g} s")
    else:
        wanted = np.minimum(wanted, settings.duration)
    projected = bool(scene.constraints) and settings.stabilisation.kind == "projection"
    keeper = None
    if keep is not None:
        from bellcrank.simulation.run_blocks import Keeper

        keeper = Keeper(arguments.path("keep", keep, "the path of a run (.npz)"), keep_every)
    run = _integrate(scene, settings, wanted, steps_wanted, progress, system_parameters(scene), projected, keeper)
    if keeper is not None:
        keeper.finish(run)
    return run


def check_keep_every(seconds: float) -> float:
    """The seconds of computing between two blocks of a run that is kept; InputError where they are none."""
    return arguments.number("keep_every", seconds, "s", above=0.0, most=LONGEST_KEEP)


def simulate_again(run: Trajectory, settings: Settings, times: Array, p: Array) -> Trajectory:
    """A run's scene once more, with constraints kept by projection: with other settings, at `times` (m,) s, and with
    parameters `p` of its equations.
    """
    return _integrate(run.scene, settings, times, False, None, p, projected=bool(run.scene.constraints))


def _integrate(
    scene: Scene,
    settings: Settings,
    times: Array,
    every_step: bool,
    progress: Callable[[float], None] | None,
    p: Array,
    projected: bool,
    keeper: Keeper | None = None,
) -> Trajectory:
    system, signals = system_of(scene), scene.signals
    end, duration = drive_end(scene), settings.duration
    if end is not None and end.time <= duration:
        duration, signals, times = end.time, signals_until(scene, end.time), times[times <= end.time]
    if binding_of(scene).massless:
        _refuse_massless_motion(scene)
    x0 = np.zeros(system.size)
    q0, v0 = consistent_start(scene)
    x0[: system.nq], x0[system.nq : system.nq + system.nv] = q0, v0
    _refuse_pulling_contact(scene, p, x0)
    implicit = settings.solver == "Radau"
    staged = not implicit and system.size <= LARGEST_STAGED
    closed = bool(scene.constraints)
    # code for many states at once pays where evaluations are cheap beside it
    together = projected and not every_step and not signals and system.size <= LARGEST_STAGED and len(times) >= MANY
    code = {"rhs": (system.stage if staged else system.rhs, "scalar")}
    if scene.events:
        code["events"] = (system.events, "scalar")
    if implicit and system.whole_jacobian:
        code["jacobian"] = (system.jacobian, "scalar")
    elif implicit:
        code["tangent"] = (system.tangent, "batch")
    if closed:
        code["fallback"] = (system.fallback_stage if staged else system.fallback, "scalar")
    if projected:
        code["project"], code["project_fallback"] = (system.project, "scalar"), (system.project_fallback, "scalar")
    if together:
        code["project_batch"] = (system.project, "batch")
    address = dict(zip(code, make_ready(tuple(code.values())), strict=True))
    if keeper is not None:
        keeper.begin(scene, settings, p, signals)
    result = integrate(
        address["rhs"],
        settings.solver,
        0.0,
        duration,
        x0,
        p,
        norm_size=system.size if any(c.source is not None for c in scene.constraints) else system.nq + system.nv,
        rtol=settings.rtol,
        atol=max(settings.atol, LEAST_ATOL),
        step=settings.step or 0.0,
        first_step=settings.first_step or 0.0,
        max_step=settings.max_step or math.inf,
        times=times,
        every_step=every_step,
        unit=unit_parts(scene),
        signals=[(s.breaks, s.coefficients, s.derivatives, s.kinked) for s in signals],
        stops=scene.stops,
        events=address.get("events", 0),
        terminal=[event.stop for event in scene.events],
        direction=[event.direction for event in scene.events],
        event_samples=2 if all(isinstance(event.when, ContactLost) for event in scene.events) else 8,
        jacobian=address.get("jacobian", 0),
        tangent=address.get("tangent", 0),
        lanes=machine.target().lanes if implicit or together else 1,
        max_evaluations=settings.max_evaluations,
        progress=progress,
        block=None if keeper is None else keeper.add,
        block_seconds=0.0 if keeper is None else keeper.every,
        staged=staged,
        fallback=address.get("fallback", 0),
        project=address.get("project", 0),
        project_fallback=address.get("project_fallback", 0),
        project_batch=address.get("project_batch", 0),
        nq=system.nq,
        weights=coordinate_weights(scene) if projected else None,
    )
    status = tuple(Status)[result.status]
    if status is Status.INTERRUPTED:
        interruption.cut_short()
    if status is Status.FINISHED and duration < settings.duration:
        status = Status.DRIVE_ENDED
    if status is Status.NON_FINITE and result.accepted == 0:
        _refuse_infinite_start(scene, p, x0)
    time, state = result.time, result.state
    if not len(time) or (status is not Status.FINISHED and time[-1] < result.end_time):
        time, state = np.append(time, result.end_time), np.vstack([state, result.end_state[None]])
    events = tuple(
        event_at(scene, int(k), float(t), x[: system.nq], x[system.nq : system.nq + system.nv], p)
        for k, t, x in zip(result.event_index, result.event_time, result.event_state, strict=True)
    )
    cost = result.accepted, result.rejected, result.evaluations, result.jacobians, result.factorisations
    missed = {name: getattr(result, name) for name in MISSED}
    statistics = statistics_of(scene, cost, result.seconds, result.longest_step, missed, result.event_index)
    return unturned(Trajectory(scene, settings, time, state, p, signals, status, events, statistics, result.steps))


def statistics_of(
    scene: Scene, cost: tuple[int, ...], seconds: float, longest: float, missed: Mapping[str, Any],
    kept: NDArray[np.int32],
) -> Statistics:  # fmt: skip
    """Statistics from what the stepper says: its counts, the arrays MISSED by event function, and the events kept."""
    accepted, rejected, evaluations, jacobians, factorisations = cost
    unresolved = (
        *_unresolved(scene, missed["unresolved_count"], missed["unresolved_time"]),
        *_unresolved(scene, missed["undefined_count"], missed["undefined_time"], undefined=True),
    )
    omitted = _omitted(scene, missed["event_counts"], kept)
    return Statistics(
        accepted, rejected, evaluations, jacobians, factorisations, seconds, unresolved, longest, omitted
    )  # fmt: skip


def _unresolved(
    scene: Scene, count: NDArray[np.int64], first: Array, undefined: bool = False
) -> tuple[Unresolved, ...]:
    """Events of which crossings may have been missed, from the number of such steps and a time in the first."""
    return tuple(
        Unresolved(scene.events[k].name, steps, float(first[k]), undefined)
        for k, steps in enumerate(count.tolist())
        if steps
    )


def _omitted(scene: Scene, count: NDArray[np.int64], kept: NDArray[np.int32]) -> dict[str, int]:
    """How many events of each name were found that are not among those `kept`."""
    if sum(count.tolist()) == len(kept):  # all of them, which a short run should learn quickly
        return {}
    left = count - np.bincount(kept, minlength=len(count))
    found: dict[str, int] = {}
    for k in np.flatnonzero(left).tolist():
        found[scene.events[k].name] = found.get(scene.events[k].name, 0) + int(left[k])
    return found


def unturned(run: Trajectory) -> Trajectory:
    """The run up to the row before one in which a weld or hinge has gone beyond a quarter of a turn."""
    scene, time = run.scene, run.time
    if not turning(scene):
        return run
    good = (cosines_along(scene, time, run.state, scene.signals_at(time), run.parameters) > 0.0).all(axis=1)
    if good.all():
        return run
    rows = max(int(np.argmin(good)), 1)
    events = tuple(event for event in run.events if event.time <= time[rows - 1])
    return replace(run, time=time[:rows], state=run.state[:rows], status=Status.TURNED_OVER, events=events)


def with_gains(scene: Scene, settings: Settings) -> Settings:
    """The settings with Baumgarte's automatic gains in them, where they are asked for."""
    if not settings.stabilisation.auto:
        return settings
    gains = automatic_gains(scene, settings)
    chosen = replace(settings.stabilisation, alpha=gains.alpha, beta=gains.beta)
    return replace(settings, stabilisation=chosen)


def event_at(scene: Scene, k: int, t: float, q: Array, v: Array, p: Array) -> Event:
    """Event k of the scene at a time (s) and a state, with multipliers and what a latch does there."""
    system, rule = system_of(scene), scene.events[k]
    x = np.concatenate([q, v, np.zeros(system.size - system.nq - system.nv)])
    arguments = (np.array([t]), x, values_at(scene.signals, np.array([t]))[0], p)
    multipliers = system.constraint(*arguments)[0] if scene.constraints else np.zeros(0)
    latch = None
    if rule.latch:
        after, constraints, impulse, lost = system.latch(k)(*arguments)
        latch = Latch(after, float(impulse[0]), rule.impulse_unit, constraints, float(lost[0]))
    return Event(rule.name, t, q, v, rule.stop, multipliers, latch)


def unit_parts(scene: Scene) -> list[tuple[int, int]]:
    """Where in the state a quaternion, or the cosine and sine of a planar joint, lies: (first, length) of each."""
    places = {"floating": (3, 4), "planar": (2, 2)}
    return [(j.q + places[j.kind][0], places[j.kind][1]) for j in scene.robot.joints if j.kind in places]


def _checked_times(times: Any) -> Array:
    array = arguments.increasing("times", times, "s")
    if array[0] < 0.0:
        arguments.refuse("times", "increasing numbers (s) from 0 on", float(array[0]))
    return array.copy()


def _refuse_massless_motion(scene: Scene) -> None:
    """Name the joints that can move without moving mass, with the scene's own parameters (InputError)."""
    from bellcrank.dynamics.singular_mass import massless_motion

    motion = massless_motion(scene)
    if motion is not None:
        raise InputError(f"{scene.source}: {motion}")


def _refuse_pulling_contact(scene: Scene, p: Array, x0: Array) -> None:
    """Name a rolling contact whose plane would have to pull at the start already (InputError)."""
    places = [k for k, rule in enumerate(scene.events) if rule.stop and isinstance(rule.when, ContactLost)]
    if not places:
        return
    normal = system_of(scene).events(np.zeros(1), x0, values_at(scene.signals, np.zeros(1))[0], p)
    for k in places:
        rule = scene.events[k].when
        assert isinstance(rule, ContactLost)
        if normal[k] < 0.0:
            raise InputError(
                f"{scene.source}: constraints: '{rule.constraint}' is not in contact at the start: its plane would have to "
                f"pull by {-normal[k]:.6g} N; change the start or the forces, or write two_sided: true if it can"
            )


def _refuse_infinite_start(scene: Scene, p: Array, x0: Array) -> None:
    """Name the joint whose acceleration is not finite at the start, with what to do (InputError)."""
    system = system_of(scene)
    u = scene.signals_at(np.zeros(1))[0]
    rhs = system.fallback if scene.constraints else system.rhs
    rate = rhs(np.zeros(1), x0, u, p)[system.nq : system.nq + system.nv]
    bad = np.flatnonzero(~np.isfinite(rate))
    if len(bad):
        where = next(j.name for j in reversed(scene.robot.joints) if j.v <= bad[0])
        raise InputError(
            f"{scene.source}: the accelerations at the start are not finite at joint '{where}': either nothing beyond "
            "it has inertia about its axis (give those links mass), or a force, gain or parameter has no value there "
            "or is too large"
        )
