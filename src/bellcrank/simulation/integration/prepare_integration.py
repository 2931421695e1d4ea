"""From a scene and the arguments of `simulate` to an integration that is ready to run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.cached_values import computed_once
from bellcrank.codegen.llvm import target_name
from bellcrank.dynamics.equations.system import system_parameters
from bellcrank.errors import InputError
from bellcrank.scene.scene import Scene
from bellcrank.scene.settings import SOLVERS, Settings, check_rows
from bellcrank.simulation.integration.automatic_gains import automatic_gains, tuned
from bellcrank.simulation.integration.integration import Integration, RunRows, prepared_integration

RECENT = 4  # integrations of a scene that are kept for the next call


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
