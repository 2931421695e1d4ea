"""Runs on disk: one .npz that holds the numbers to the bit and everything that gave rise to them.

Beside the arrays lies a JSON text that holds the scene, the URDF and the files that the scene names, so that a run can
be loaded, and judged anew, where the originals are gone. Plain numpy format: no pickled objects, no code.
"""

from __future__ import annotations

import importlib.metadata
import json
import math
import platform
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.codegen import llvm as machine
from bellcrank.dynamics.system import system_of, system_parameters
from bellcrank.elements.expression_constraint import Own
from bellcrank.elements.signals import Signal
from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess, Trust
from bellcrank.files.atomic_write import writing
from bellcrank.scene.run_contents import RUN, VERSION, refusing, run_contents, unpacked_scene
from bellcrank.scene.scene import Scene, load_held_scene
from bellcrank.simulation.explicit_start import explicit_start
from bellcrank.simulation.run_checks import check_arrays, checked_about
from bellcrank.simulation.simulate import event_at, unturned
from bellcrank.simulation.trajectory import Trajectory
from bellcrank.terminal import interruption
from bellcrank.text import file_name_here, readable, utf8
from bellcrank.version import version

Array = NDArray[np.float64]


def save_run(run: Trajectory, path: str | Path, lasting: bool = False) -> Path:
    """Write a run as .npz (the suffix is added where it is missing), whole or not at all; returns the path.

    In it: time (s), state, parameters, steps, events and signals as float64, bit for bit, and a JSON text with scene,
    URDF, status, settings, statistics, versions and machine. `lasting`: a power cut does not lose it. Raises InputError
    where the folder cannot be written.
    """
    about, arrays = run_facts(run)
    nq, nv = run.robot.nq, run.robot.nv
    arrays |= {
        "time": run.time,
        "state": run.state,
        "steps": run.steps,
        # for other readers: they are computed anew
        "multipliers": np.concatenate([part.multipliers for part in run.parts()]),
        "event_time": np.array([event.time for event in run.events], dtype=np.float64),
        "event_position": np.array([event.position for event in run.events]).reshape(-1, nq),
        "event_velocity": np.array([event.velocity for event in run.events]).reshape(-1, nv),
    }
    if run.events and (latch := run.events[-1].latch) is not None:
        arrays["latch_velocity"] = latch.velocity  # a run that starts from the file goes on from it
    target = run_path(path)
    write_archive(target, about, arrays, lasting)
    return target


def run_path(path: str | Path) -> Path:
    """The path of a run's file, with its suffix."""
    target = Path(path)
    return target if target.suffix == ".npz" else target.with_name(target.name + ".npz")


def write_archive(target: Path, about: dict[str, Any], arrays: dict[str, Array], lasting: bool = False) -> None:
    """Write an .npz with a JSON text and arrays, whole or not at all. Raises InputError."""
    text = np.frombuffer(utf8(json.dumps(about, ensure_ascii=False)), dtype=np.uint8)
    contents: dict[str, Any] = {"about": text, **arrays}
    with interruption.unbroken(), writing(target, lasting) as temporary, temporary.open("wb") as file:
        np.savez(file, **contents)


def run_facts(run: Trajectory) -> tuple[dict[str, Any], dict[str, Array]]:
    """What a run's file holds beside its rows: the JSON text's content, and parameters and signals.

    Raises InputError for a scene that no file can hold.
    """
    refuse_functions(run.scene)
    scene, files = _scene_files(run.scene)
    about = {
        "format": RUN,
        "version": VERSION,
        "scene": scene,
        "urdf": str(run.robot.mesh_source.resolve()),  # its meshes stay where they are
        "files": files,
        "status": str(run.status),
        "settings": asdict(run.settings),
        "statistics": asdict(run.statistics),
        "error_estimate": run.known_estimate if math.isfinite(run.known_estimate or 0.0) else None,
        "events": [{"name": event.name, "stopped": event.stopped} for event in run.events],
        "signals": [{k: v for k, v in vars(s).items() if not isinstance(v, np.ndarray)} for s in run.signals],
        "versions": {"bellcrank": version()} | {p: _version(p) for p in ("pin", "casadi", "llvmlite", "numpy")},
        "machine": {"target": asdict(machine.target()), "python": platform.python_version(), "on": platform.platform()},
    }
    arrays: dict[str, Array] = {"parameters": run.scene.own_parameters}
    for k, signal in enumerate(run.signals):
        arrays |= {f"signal_{k}_{name}": v for name, v in vars(signal).items() if isinstance(v, np.ndarray)}
    return about, arrays


def refuse_functions(scene: Scene) -> None:
    """Name a constraint that is a Python function, which no file can hold (InputError)."""
    own = [constraint.name for constraint in scene.constraints if isinstance(constraint, Own)]
    if own:
        raise InputError(
            f"{scene.name}: constraint '{own[0]}' is a Python function, which no file can hold; write it as "
            "{kind: expression} in the scene, or keep the run as CSV (to_csv)"
        )


def load_run(path: str | Path, *, trust: Trust = ()) -> Trajectory:
    """Read a run that `Trajectory.save` wrote: the same numbers to the bit, on a scene made anew from the file alone.
    A folder of blocks (run.blocks) is a run that was interrupted where its last block ends.

    Entries, shapes and numbers are checked (run_checks.py); whether they are a motion of the scene, the certificate of
    the run says. Meshes of its robot are drawn from files in its folder, below it, and in the folders `trust`
    (files/access.py). Raises InputError, one sentence, for a file that is missing, damaged, foreign or of a later
    version.
    """
    file = arguments.path("path", path, "the path of a run (.npz)")
    about, arrays, scene = _read(file)
    with refusing(file):
        robot, settings, estimate = scene.robot, about["settings"], about.get("error_estimate")
        robot.mesh_source = Path(file_name_here(about.get("urdf") or str(robot.source)))
        robot.mesh_access = FileAccess.below(file.parent, trust)
        check_arrays(about, arrays, scene, (robot.nq + robot.nv + system_of(scene).has_work,))
        p = np.concatenate([arrays["parameters"], system_parameters(scene)[len(arrays["parameters"]) :]])
        rules = [rule.name for rule in scene.events]
        events = tuple(
            event_at(scene, rules.index(e["name"]), float(t), q, v, p)
            for e, t, q, v in zip(
                about["events"], arrays["event_time"], arrays["event_position"], arrays["event_velocity"], strict=True
            )
        )
    signals = tuple(Signal(**facts, **_parts(arrays, f"signal_{k}_")) for k, facts in enumerate(about["signals"]))
    run = Trajectory(
        scene, settings, arrays["time"], arrays["state"], p, signals, about["status"], events, about["statistics"],
        arrays["steps"],
    )  # fmt: skip
    if file.is_dir():
        run = unturned(run)  # what is done at the end of a run
    run.remember_origin(file)
    if estimate is not None:
        run.remember_estimate(estimate)
    return run


def _read(file: Path) -> tuple[dict[str, Any], dict[str, Array], Scene]:
    """The checked JSON text, the float64 arrays, and the scene, with the settings of the run, of a run's file. The
    scene names no files but those in it.
    """
    about, arrays = run_contents(file)
    with refusing(file):
        about = checked_about(about)
        scene = load_held_scene(unpacked_scene(about))
        if about["settings"].stabilisation != scene.settings.stabilisation:
            scene = replace(scene, settings=about["settings"])
    return about, arrays, scene


def _parts(arrays: dict[str, Array], prefix: str) -> dict[str, Any]:
    return {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}


# ---- the scene, and the files that it names


def _scene_files(scene: Scene) -> tuple[str, dict[str, str]]:
    """The name of the scene's file, and the texts by name of all that it takes to load it from one folder."""
    import yaml

    folder, texts = scene.source.parent, scene.files
    files: dict[str, str] = {}

    def gathered(value: Any, key: str = "") -> Any:
        if isinstance(value, dict):
            return {k: gathered(v, k) for k, v in value.items()}
        if isinstance(value, list):
            return [gathered(v) for v in value]
        if key == "file" and value in texts:
            return _add(files, folder / value, texts[value])
        return value

    data = gathered(scene.data)
    if scene.initial.saved is not None:
        data |= explicit_start(scene)  # the state itself: the run that it came from may be gone
    data |= {"name": readable(scene.name), "urdf": _add(files, scene.robot.source, scene.robot.urdf.text)}
    text = yaml.safe_dump(data, allow_unicode=True, sort_keys=False)
    return _add(files, scene.source.with_suffix(".yaml"), text), files


def _add(files: dict[str, str], path: Path, text: str) -> str:
    name, number = readable(path.name), 1
    while name in files and files[name] != text:
        number += 1
        name = readable(f"{path.stem}_{number}{path.suffix}")
    files[name] = text
    return name


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"
