"""Writes a run to one .npz file that holds its numbers to the bit and everything that they came from.

Beside the arrays lies a JSON text with the scene, the URDF and the files that the scene names, so that a run can be
loaded and checked again where the originals are gone. The file is plain numpy format, without pickled objects or code.
"""

from __future__ import annotations

import importlib.metadata
import json
import math
import platform
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.actuators.actuator_fields import actuator_data, drive_data
from bellcrank.arrays import Array
from bellcrank.codegen import llvm as machine
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.elements.expression_constraint import FunctionConstraint
from bellcrank.elements.sampled_controllers import FunctionController, StateSpace
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import writing
from bellcrank.messages import readable, utf8
from bellcrank.robot.formats.xml_tree import xml_text
from bellcrank.robot.model.joints import LENGTHS
from bellcrank.scene.run_contents import RUN, VERSION
from bellcrank.terminal import interruption
from bellcrank.version import version

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory.events import Event
    from bellcrank.simulation.trajectory.trajectory import Trajectory


def save_run(run: Trajectory, path: str | Path, lasting: bool = False) -> Path:
    """Write a run to an .npz file (the suffix is added where it is missing), atomically; returns its path.

    The file holds time (s), state, parameters, steps, events and signals as float64, and a JSON text with scene, URDF,
    status, settings, statistics, versions and machine. `lasting`: it survives a power cut. Raises InputError where the
    file cannot be written.
    """
    about, arrays = file_contents(run)
    about["notes"] = [note.record() for note in run.notes]
    nq, nv = run.robot.nq, run.robot.nv
    arrays |= {
        "time": run.time,
        "state": run.state,
        "steps": run.steps,
        # for other programs; load_run computes them from the states
        "multipliers": np.concatenate([part.multipliers for part in run.parts()]),
        "event_time": np.array([event.time for event in run.events], dtype=np.float64),
        "event_position": np.array([event.position for event in run.events]).reshape(-1, nq),
        "event_velocity": np.array([event.velocity for event in run.events]).reshape(-1, nv),
    }
    if run.scene.auxiliary_states:
        arrays["event_auxiliary"] = event_auxiliary(run.scene, run.events)
    if run.events and (latch := run.events[-1].latch) is not None:
        arrays["latch_velocity"] = latch.velocity  # a run that starts from the file continues from it
    target = run_path(path)
    write_archive(target, about, arrays, lasting)
    return target


def event_auxiliary(scene: Scene, events: Sequence[Event]) -> Array:
    """The auxiliary states (events, nz) at events."""
    size = sum(states.size for states in scene.auxiliary_states)
    return np.array([event.auxiliary for event in events]).reshape(-1, size)


def run_path(path: str | Path) -> Path:
    """The path of a run's file, with its suffix."""
    target = Path(path)
    return target if target.suffix == ".npz" else target.with_name(target.name + ".npz")


def write_archive(target: Path, about: dict[str, Any], arrays: dict[str, Array], lasting: bool = False) -> None:
    """Write a JSON text and arrays to an .npz file, atomically; if `lasting`, it survives a power cut.

    Raises InputError where the file cannot be written.
    """
    text = np.frombuffer(utf8(json.dumps(about, ensure_ascii=False)), dtype=np.uint8)
    contents: dict[str, Any] = {"about": text, **arrays}
    with interruption.unbroken(), writing(target, lasting) as temporary, temporary.open("wb") as file:
        np.savez(file, **contents)


def file_contents(run: Trajectory) -> tuple[dict[str, Any], dict[str, Array]]:
    """What a run's file holds beside its rows: the content of the JSON text, and the arrays of parameters and signals.

    Raises InputError for a scene that no file can hold.
    """
    refuse_functions(run.scene)
    scene, files = _scene_files(run.scene)
    about = {
        "format": RUN,
        "version": VERSION,
        "scene": scene,
        "urdf": str(run.robot.mesh_source.resolve()),  # meshes are not copied
        "files": files,
        "status": str(run.status),
        "settings": asdict(run.settings),
        "statistics": asdict(run.statistics),
        "error_estimate": run.known_estimate if math.isfinite(run.known_estimate or 0.0) else None,
        "known_until": _known_until(run),
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
    """Refuse a scene with a constraint or controller that is a Python function, which no file can hold (InputError)."""
    if any(isinstance(part, FunctionController) for part in scene.control):
        raise InputError(
            f"{scene.name}: the argument 'controller' is a Python function, which no file can hold; write it under "
            "'control' in the scene, or save the run as CSV (to_csv)"
        )
    own = [constraint.name for constraint in scene.constraints if isinstance(constraint, FunctionConstraint)]
    if own:
        raise InputError(
            f"{scene.name}: constraint '{own[0]}' is a Python function, which no file can hold; write it as "
            "{kind: expression} in the scene, or save the run as CSV (to_csv)"
        )


def _scene_files(scene: Scene) -> tuple[str, dict[str, str]]:
    """The name of the scene's file, and the texts by name of all files that loading it from one folder takes."""
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
        for entry, part in zip(data.get("control", ()), scene.control, strict=False):
            if isinstance(part, StateSpace) and part.holds:
                entry["holds"] = list(part.holds)
    data |= _without_catalogue(scene, data)
    data.pop("xacro_args", None)  # the URDF is the expanded one
    data |= {"name": readable(scene.name), "urdf": _add(files, scene.robot.source, xml_text(scene.robot.file.urdf))}
    text = yaml.safe_dump(data, allow_unicode=True, sort_keys=False)
    return _add(files, scene.source.with_suffix(".yaml"), text), files


def _without_catalogue(scene: Scene, data: dict[str, Any]) -> dict[str, Any]:
    """The key `actuators` with the figures of the motors and gears that it names; the catalogue may change."""
    data.pop("catalogue", None)
    actuators = scene.config.actuators
    if all(one.by_ratings for one in actuators.values()):
        return {}
    before = data.get("actuators", {})
    return {
        "actuators": {
            joint: actuator_data(one, scene.config.conditions) | drive_data(before.get(joint, {}))
            for joint, one in actuators.items()
        }
    }


def _add(files: dict[str, str], path: Path, text: str) -> str:
    """Add a file's text under its name, or the name with a number where it is taken; returns the name."""
    name, number = readable(path.name), 1
    while name in files and files[name] != text:
        number += 1
        name = readable(f"{path.stem}_{number}{path.suffix}")
    files[name] = text
    return name


def _known_until(run: Trajectory) -> float | None:
    """Up to when the run is known, s; None where that is its end, or not known."""
    known = run.known_accuracy
    return known.known_until if known is not None and math.isfinite(known.known_until) else None


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def explicit_start(scene: Scene) -> dict[str, Any]:
    """The keys `initial` and `base` of a scene with the numbers of its consistent start, SI units."""
    q, v = consistent_start(scene)
    initial: dict[str, Any] = {"velocity": {}}
    found: dict[str, Any] = {}
    for k, j in enumerate(scene.robot.joints):
        position, velocity = q[j.q : j.q + j.nq].tolist(), v[j.v : j.v + j.nv].tolist()
        if j.nv == 1:
            initial[j.name], initial["velocity"][j.name] = position[0], velocity[0]
            continue
        size = LENGTHS.get(j.kind, 0)
        free: dict[str, Any] = {"expressed_in": "body"}
        if size:
            free |= {"position": position[:size], "linear_velocity": velocity[:size]}
        if j.kind != "planar":
            free |= {"quaternion_xyzw": position[size:], "angular_velocity": velocity[size:]}
        else:
            free |= {"angle": float(np.arctan2(position[3], position[2])), "angular_velocity": velocity[size]}
        if scene.robot.floating_base and k == 0:
            found["base"] = free
        else:
            initial[j.name] = free
    if scene.initial.clock:
        initial["clock"] = scene.initial.clock
    return found | {"initial": initial}
