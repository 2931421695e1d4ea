"""Reads runs: files that `Trajectory.save` wrote, and folders of checkpoints."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.elements.signals import Signal
from bellcrank.files.access import FileAccess, Trust
from bellcrank.messages import file_name_here
from bellcrank.scene.run_contents import refusing, run_contents, unpacked_scene
from bellcrank.scene.scene import Scene, load_held_scene
from bellcrank.simulation.files.run_file_checks import check_arrays, checked_about
from bellcrank.simulation.integration.automatic_gains import tuned
from bellcrank.simulation.integration.integration import repeat_run, until_turned_over
from bellcrank.simulation.trajectory.events import event_at
from bellcrank.simulation.trajectory.trajectory import Trajectory


@arguments.named
def load_run(path: str | Path, *, trust: Trust = ()) -> Trajectory:
    """Load a run that `Trajectory.save` wrote.

    All numbers are the same to the bit; the scene is rebuilt from the file alone. Entries, shapes and numbers are
    checked against the scene; whether they are a motion of it, `Trajectory.warnings` says. A folder of checkpoints
    (run.blocks) is read as a run that was interrupted at its last checkpoint.

    Args:
        path: The .npz file, or a folder of checkpoints.
        trust: Folders from which the robot's meshes may be read, beside the folder of the file and those below it.

    Returns:
        The run.

    Raises:
        InputError: The file is missing, damaged, of another program or of a later version.

    Example:
        >>> import bellcrank as bc, pathlib, tempfile
        >>> run = bc.simulate("pendulum", duration=1.0)
        >>> path = run.save(pathlib.Path(tempfile.mkdtemp()) / "pendulum.npz")
        >>> again = bc.load_run(path)
        >>> bool((again.state == run.state).all())
        True
    """
    file = arguments.path("path", path, "the path of a run (.npz)")
    about, arrays, scene = _read(file)
    with refusing(file):
        robot, settings, estimate = scene.robot, about["settings"], about["error_estimate"]
        robot.mesh_source = Path(file_name_here(about["urdf"]))
        robot.mesh_access = FileAccess.below(file.parent, trust)
        check_arrays(about, arrays, scene, (system_of(scene).size,))
        p = np.concatenate([arrays["parameters"], system_parameters(scene)[len(arrays["parameters"]) :]])
        rows = [arrays["event_position"], arrays["event_velocity"]]
        if system_of(scene).nz:
            rows.append(arrays["event_auxiliary"])
        rules = [rule.name for rule in scene.events]
        parts = [_parts(arrays, f"signal_{k}_") for k in range(len(about["signals"]))]
        signals = tuple(Signal(**facts, **part) for facts, part in zip(about["signals"], parts, strict=True))
        events = tuple(
            event_at(scene, rules.index(e["name"]), float(t), x, p, signals)
            for e, t, x in zip(about["events"], arrays["event_time"], np.hstack(rows), strict=True)
        )
    run = Trajectory(
        scene=scene,
        settings=settings,
        time=arrays["time"],
        state=arrays["state"],
        parameters=p,
        signals=signals,
        status=about["status"],
        events=events,
        statistics=about["statistics"],
        steps=arrays["steps"],
        repeat=repeat_run,
    )
    if file.is_dir():
        run = until_turned_over(run)  # this is done when a run ends
    elif about["notes"] is not None:
        vars(run)["notes"] = tuple(about["notes"])  # some are of files that this one does not hold
    run.remember_origin(file)
    until = about["known_until"]
    if estimate is not None or until is not None:
        run.remember_estimate(math.inf if estimate is None else estimate, math.inf if until is None else until)
    return run


def _read(file: Path) -> tuple[dict[str, Any], dict[str, Array], Scene]:
    """The checked JSON text and the arrays of a run's file, and its scene with the settings of the run."""
    about, arrays = run_contents(file)
    with refusing(file):
        about = checked_about(about)
        scene = load_held_scene(unpacked_scene(about))
        if about["settings"].stabilisation != scene.settings.stabilisation:
            scene = replace(scene, settings=about["settings"])
        return about, arrays, tuned(scene)


def _parts(arrays: dict[str, Array], prefix: str) -> dict[str, Any]:
    return {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}
