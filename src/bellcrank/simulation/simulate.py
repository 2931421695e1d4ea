"""`simulate`: from a scene to a `Trajectory`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.dynamics.system import system_parameters
from bellcrank.errors import InputError
from bellcrank.scene.overrides import EXPECTED_OVERRIDES
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.scene.settings import SOLVERS, Settings, Stabilisation, check_rows
from bellcrank.simulation.baumgarte_gains import automatic_gains
from bellcrank.simulation.checkpoints import KEEP_EVERY, CheckpointWriter
from bellcrank.simulation.integration import Wanted, integrate_scene

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory import Trajectory

Array = NDArray[np.float64]


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
    """Simulate a scene.

    Arguments that are not given are taken from the key `simulate` of the scene. Names and meanings of the solver's
    settings are those of scipy.integrate.solve_ivp; tolerances apply to every position and velocity (rad, m, rad/s,
    m/s).

    Args:
        scene: A scene, or the path or name of a scene file.
        duration: s.
        solver: "DOP853", "RK45", "Radau" (for stiff scenes) or "RK4".
        rtol: Relative tolerance.
        atol: Absolute tolerance.
        step: Fixed step size, s; it switches the error control off. Tolerances or a solver given here switch off a
            fixed step of the scene.
        times: Times (m,) s at which results are wanted, increasing from 0 on; or "steps", the ends of the solver's
            steps.
        overrides: Changes of the scene by dotted path, such as {"initial.shoulder": "10 deg"}.
        samples: The number of equally spaced times at which results are wanted, where `times` is not given.
        first_step: First step size, s.
        max_step: Largest step size, s.
        max_evaluations: The run ends after so many evaluations of the equations.
        stabilisation: How constraints are kept: "projection", "none", {"kind": "baumgarte", "alpha": 20, "beta": 20}
            (1/s) or {"kind": "baumgarte", "gains": "auto"}.
        progress: Called with the time reached, s, about every 0.1 s.
        keep: An .npz file in which the run is saved at its end. Until then, what is computed is saved in a folder of
            checkpoints beside it, run.blocks for run.npz, which `load_run` reads too; the folder is removed when the
            file is complete. Checkpoints that an earlier, unfinished run left are moved to run.blocks.1, and so on.
        keep_every: Seconds of computing between two checkpoints.

    Returns:
        The run. Its `status` says why it ended; a run that ends early keeps all results until then, with the state at
        its end as one more row.

    Raises:
        InputError: An argument is wrong, the accelerations at the start are not finite, or `keep` cannot be written.

    Example:
        >>> import bellcrank as bc
        >>> run = bc.simulate("four_bar", samples=101)
        >>> lock = run.events[-1]
        >>> print(f"{lock.name} at {lock.time:.4f} s")
        lock at 12.2678 s
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
            f"{scene.source}: {scene.robot.urdf.name} has no movable joint, so there is nothing to simulate; "
            "floating_base: true in a scene frees its base"
        )
    given = {
        "duration": duration, "solver": solver, "rtol": rtol, "atol": atol, "step": step, "samples": samples,
        "first_step": first_step, "max_step": max_step, "max_evaluations": max_evaluations,
        "stabilisation": stabilisation,
    }  # fmt: skip
    changes: dict[str, Any] = {key: value for key, value in given.items() if value is not None}
    every_step = isinstance(times, str)
    if every_step and times != "steps":
        arguments.refuse("times", 'increasing numbers (s) or "steps"', times)
    wanted = None if times is None or every_step else _checked_times(times)
    if wanted is not None and duration is None:
        changes["duration"] = float(wanted[-1]) or scene.settings.duration
    adaptive = changes.get("solver", scene.settings.solver) != "RK4"
    if adaptive and scene.settings.step and step is None and not {"solver", "rtol", "atol"}.isdisjoint(changes):
        changes["step"] = None  # tolerances that are given must be kept
    settings = replace(scene.settings, **changes) if changes else scene.settings
    if settings.stabilisation.auto:
        gains = automatic_gains(scene, settings)
        chosen = replace(settings.stabilisation, alpha=gains.alpha, beta=gains.beta)
        settings = replace(settings, stabilisation=chosen)
    if settings.stabilisation != scene.settings.stabilisation:
        scene = replace(scene, settings=settings)  # gains are parameters of its equations
    wanted = _result_times(scene, settings, wanted)
    projected = bool(scene.constraints) and settings.stabilisation.kind == "projection"
    checkpoints = None
    if keep is not None:
        checkpoints = CheckpointWriter(arguments.path("keep", keep, "the path of a run (.npz)"), keep_every)
    run = integrate_scene(
        scene,
        settings,
        system_parameters(scene),
        Wanted(times=wanted, every_step=every_step, progress=progress, checkpoints=checkpoints),
        projected,
    )
    if checkpoints is not None:
        checkpoints.finish(run)
    return run


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
