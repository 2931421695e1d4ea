"""`simulate`: from a scene to a `Trajectory`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank.arguments import PROGRESS, Progress
from bellcrank.arrays import Array
from bellcrank.cached_values import computed_once
from bellcrank.codegen.llvm import target_name
from bellcrank.config.fields import Fields
from bellcrank.dynamics.equations.system import system_parameters
from bellcrank.elements.controller import Driven
from bellcrank.elements.sampled_controllers import FunctionController
from bellcrank.errors import InputError
from bellcrank.files.access import Trust
from bellcrank.scene.load import given_scene
from bellcrank.scene.scene import Scene
from bellcrank.scene.settings import SOLVERS, Settings, Stabilisation, check_rows
from bellcrank.simulation.files.checkpoints import CHECKPOINT_EVERY, CheckpointWriter
from bellcrank.simulation.integration.automatic_gains import automatic_gains, tuned
from bellcrank.simulation.integration.integration import Integration, RunRows, prepared_integration

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot
    from bellcrank.simulation.trajectory.trajectory import Trajectory


RECENT = 4  # integrations of a scene that are kept for the next call
NAME = "controller"  # the argument of `simulate`


def prepare_integration(scene: Scene, given: Mapping[str, Any], times: Any = None) -> Integration:
    """The integration of a scene with the settings `given`, None where its own hold, and with rows at `times`.

    The last ones of a scene are kept, so that the same call costs little the next time. Raises InputError where a
    setting is wrong or the start is none.
    """
    if times is not None and not isinstance(times, str):
        return _prepared(scene, given, times)
    recent = _recent(scene)
    # 1 and True are one key of a dict, but not one setting
    key = (times, target_name(), *given.values(), *map(type, given.values()))
    try:
        kept = recent.get(key)
    except TypeError:  # a value that cannot be a key, such as a mapping
        return _prepared(scene, given, times)
    if kept is None:
        kept = _prepared(scene, given, times)
        while len(recent) >= RECENT:
            recent.pop(next(iter(recent)), None)
        recent[key] = kept
    return kept


@computed_once
def _recent(scene: Scene) -> dict[tuple[Any, ...], Integration]:
    return {}


def _prepared(scene: Scene, given: Mapping[str, Any], times: Any) -> Integration:
    if given["solver"] is not None:
        arguments.text("solver", given["solver"], f"one of {', '.join(SOLVERS)}")
    if not scene.robot.nv:
        raise InputError(
            f"{scene.source}: {scene.robot.urdf.name} has no movable joint, so there is nothing to simulate; "
            "floating_base: true in a scene frees its base"
        )
    every_step = isinstance(times, str)
    if every_step and times != "steps":
        arguments.refuse("times", 'increasing numbers (s) or "steps"', times)
    wanted = None if times is None or every_step else _checked_times(times)
    scene = tuned(scene)
    settings = _settings(scene, given, wanted)
    if settings.stabilisation != scene.settings.stabilisation:
        scene = replace(scene, settings=settings)  # gains are parameters of its equations
    rows = RunRows(_result_times(scene, settings, wanted), every_step)
    projected = bool(scene.constraints) and settings.stabilisation.kind == "projection"
    return prepared_integration(scene, settings, system_parameters(scene), rows, projected)


def _settings(scene: Scene, given: Mapping[str, Any], wanted: Array | None) -> Settings:
    """The scene's settings with those that are given, and with gains where they are to be found automatically."""
    changes = {key: value for key, value in given.items() if value is not None}
    if wanted is not None and "duration" not in changes:
        changes["duration"] = float(wanted[-1]) or scene.settings.duration
    adaptive = changes.get("solver", scene.settings.solver) != "RK4"
    tolerances = not {"solver", "rtol", "atol"}.isdisjoint(changes)
    if adaptive and scene.settings.step and "step" not in changes and tolerances:
        changes["step"] = None  # tolerances that are given must be kept
    settings = replace(scene.settings, **changes) if changes else scene.settings
    if settings.stabilisation.auto:
        gains = automatic_gains(scene, settings)
        chosen = replace(settings.stabilisation, alpha=gains.alpha, beta=gains.beta)
        settings = replace(settings, stabilisation=chosen)
    return settings


def _checked_times(times: Any) -> Array:
    array = arguments.increasing("times", times, "s")
    if array[0] < 0.0:
        arguments.refuse("times", "increasing numbers (s) from 0 on", float(array[0]))
    return array.copy()


def _result_times(scene: Scene, settings: Settings, given: Array | None) -> Array:
    """The times at which results are wanted, none of them beyond the duration (InputError)."""
    if given is None:
        check_rows(settings.samples, scene.robot.nq + scene.robot.nv)
        return np.linspace(0.0, settings.duration, settings.samples)
    if given[-1] > settings.duration * (1.0 + 1e-15):
        raise InputError(f"times reach {given[-1]:.17g} s, beyond the duration of {settings.duration:.17g} s")
    return np.minimum(given, settings.duration)


@arguments.named
def simulate(
    scene: Scene | Robot | str | Path,
    duration: float | None = None,
    solver: str | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    step: float | None = None,
    times: Any = None,
    *,
    samples: int | None = None,
    first_step: float | None = None,
    max_step: float | None = None,
    max_evaluations: int | None = None,
    stabilisation: Stabilisation | Mapping[str, Any] | str | None = None,
    checkpoint: str | Path | None = None,
    checkpoint_every: float = CHECKPOINT_EVERY,
    sensitivities: Sequence[str] = (),
    controller: Callable[[float, Array, Array], Any] | None = None,
    sample_time: float | None = None,
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
    progress: Progress | None = None,
) -> Trajectory:
    """Simulate a scene.

    Arguments that are not given are taken from the key `simulate` of the scene. Names and meanings of the solver's
    settings are those of scipy.integrate.solve_ivp; tolerances apply to every position and velocity (rad, m, rad/s,
    m/s).

    Args:
        scene: A scene or robot, or the path or name of its file.
        duration: s.
        solver: "DOP853", "RK45", "Radau" (for stiff scenes), "auto" (DOP853 or Radau, as the scene needs) or "RK4".
        rtol: Relative tolerance.
        atol: Absolute tolerance.
        step: Fixed step size, s; it switches the error control off. Tolerances or a solver given here switch off a
            fixed step of the scene.
        times: Times (m,) s at which results are wanted, increasing from 0 on; or "steps", the ends of the solver's
            steps.
        samples: The number of equally spaced times at which results are wanted, where `times` is not given.
        first_step: First step size, s.
        max_step: Largest step size, s.
        max_evaluations: The run ends after so many evaluations of the equations.
        stabilisation: How constraints are kept: "projection", "none", {"kind": "baumgarte", "alpha": 20, "beta": 20}
            (1/s) or {"kind": "baumgarte", "gains": "auto"}.
        checkpoint: An .npz file in which the run is saved at its end. Until then, what is computed is saved in a folder
            of checkpoints beside it, run.blocks for run.npz, which `load_run` reads too; the folder is removed when the
            file is complete. Checkpoints that an earlier, unfinished run left are moved to run.blocks.1, and so on.
        checkpoint_every: Seconds of computing between two checkpoints.
        sensitivities: What derivatives of the run are wanted by: names of the scene's parameters, "initial.JOINT" and
            "initial.velocity.JOINT" for values of the start. `Trajectory.sensitivity` returns them.
        controller: A function (t, position, velocity) -> torques (N m or N) of the joints with motors, as an array or a
            mapping by joint, that is called every `sample_time` and acts besides the scene's `control`. It is for
            prototypes: a call takes as long as some hundred steps, and neither files nor sweeps can hold it.
        sample_time: The time between two calls of `controller`, s; its torques are constant meanwhile.
        overrides: Changes of the scene by dotted path, such as {"initial.shoulder": "10 deg"}.
        trust: Where `scene` is a file, folders whose files it may name, besides those near it.
        progress: Called with the time reached and the time at the end, s, about every 0.1 s.

    Returns:
        The run. Its `status` says why it ended; a run that ends early keeps all results until then, with the state at
        its end as one more row.

    Raises:
        InputError: An argument is wrong, the accelerations at the start are not finite, `keep` cannot be written, or
            the run has no derivative that is wanted.

    Example:
        >>> import bellcrank as bc
        >>> run = bc.simulate("four_bar", samples=101)
        >>> lock = run.events[-1]
        >>> print(f"{lock.name} at {lock.time:.4f} s")
        lock at 12.2678 s
    """
    scene = given_scene(scene, overrides, trust)
    report = None if progress is None else arguments.function("progress", progress, PROGRESS)
    if controller is not None:
        scene = with_function(scene, controller, sample_time)
    elif sample_time is not None:
        arguments.refuse("sample_time", "nothing without a `controller`", sample_time)
    given = {
        "duration": duration, "solver": solver, "rtol": rtol, "atol": atol, "step": step, "samples": samples,
        "first_step": first_step, "max_step": max_step, "max_evaluations": max_evaluations,
        "stabilisation": stabilisation,
    }  # fmt: skip
    names = arguments.several("sensitivities", sensitivities, str, "names of parameters", alone=True)
    integration = prepare_integration(scene, given, times)
    if names:
        from bellcrank.simulation.sensitivities.sensitivity_integration import propagated, variables_of

        variables = variables_of(integration.scene, names)  # wrong names are refused before the run
    told = None if report is None else lambda time: report(time, integration.duration)
    if checkpoint is None:
        run = integration.run(told)
    else:
        checkpoints = CheckpointWriter(
            arguments.path("checkpoint", checkpoint, "the path of a run (.npz)"), checkpoint_every
        )
        run = integration.run(told, checkpoints)
        checkpoints.finish(run)
    if names:
        run.remember_sensitivities(propagated(integration, run, variables))
    return run


# ---- A scene with a controller that is a Python function.


def with_function(scene: Scene, function: Callable[[float, Array, Array], Any], sample_time: float | None) -> Scene:
    """The scene with a function that is sampled; InputError where an argument is wrong."""
    arguments.function(NAME, function, "a function (t, position, velocity) -> torques")
    if sample_time is None:
        raise InputError("argument 'sample_time': expected the seconds between two calls of `controller`, found none")
    period = arguments.number("sample_time", sample_time, "s", above=0.0)
    if scene.drives:
        raise InputError(
            f"{scene.source}: argument 'controller': its torques act on joints, and joint "
            f"'{scene.drives[0].joint.name}' has a drive; remove its 'model'"
        )
    if NAME in [part.name for part in scene.control]:
        raise InputError(f"{scene.source}: the name '{NAME}' is that of the argument; rename the entry of 'control'")
    driven = Driven.of(scene.robot, scene.config.actuated or scene.config.joints_with_actuators)
    if not driven.joints:
        raise InputError(f"{scene.source}: argument 'controller': no joint has one degree of freedom")
    added = FunctionController(
        name=NAME,
        place=Fields({}, str(scene.source)),
        joints=driven.joints,
        limit=None,
        sample_time=period,
        delay=0.0,
        clock=scene.initial.clock,
        function=function,
    )
    return replace(scene, control=(*scene.control, added))
