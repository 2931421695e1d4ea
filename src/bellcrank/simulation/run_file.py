"""Runs on disk: one .npz that holds the numbers to the bit and everything that gave rise to them.

Beside the arrays lies a JSON text that holds the scene, the URDF and the files that the scene names, so that a run can
be loaded, and judged anew, where the originals are gone. Plain numpy format: no pickled objects, no code.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib.metadata
import json
import math
import platform
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.codegen import llvm as machine
from bellcrank.dynamics.system import system_of, system_parameters
from bellcrank.elements.expression_constraint import Own
from bellcrank.elements.signals import Signal
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.access import MOST_RUN, FileAccess, Trust, open_regular
from bellcrank.files.atomic_write import writing
from bellcrank.files.temporaries import new_folder
from bellcrank.scene.scene import Scene, load_held_scene
from bellcrank.simulation.run_archive import DAMAGE, NoRun, brief, read_archive
from bellcrank.simulation.run_checks import check_arrays, checked_about
from bellcrank.simulation.run_start import SavedState, explicit_start
from bellcrank.simulation.simulate import event_at, unturned
from bellcrank.simulation.status import Status
from bellcrank.simulation.trajectory import Trajectory
from bellcrank.terminal import interruption
from bellcrank.text import file_name_here, readable, utf8
from bellcrank.version import version

Array = NDArray[np.float64]
FORMAT = "bellcrank run"
BLOCKS = "bellcrank run in blocks"  # the about.npz of a folder that run_blocks.py writes
VERSION = 1
SAME_TIME = 1e-12  # share of a time by which a row may miss it
LONGEST_WHY = 300  # characters of what is wrong in a message


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
        "format": FORMAT,
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
    with _refusing(file):
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


def saved_state(path: str | Path, time: float | None = None) -> SavedState:
    """A row of a run that `Trajectory.save` wrote: the last, or that at a time (s); after a latch, behind its impact.

    Raises InputError as `load_run`, and where the run has no row at that time, or no finite state there.
    """
    file = Path(path)
    about, arrays, scene = _read(file)
    robot = scene.robot
    with _refusing(file):
        check_arrays(about, arrays, scene, (robot.nq + robot.nv, robot.nq + robot.nv + 1))
    times, state = arrays["time"], arrays["state"]
    k = len(times) - 1 if time is None else int(np.abs(times - time).argmin())
    if time is not None and not abs(times[k] - time) <= SAME_TIME * max(1.0, abs(time)):
        near = ", ".join(f"{t:.12g}" for t in np.sort(times[np.argsort(np.abs(times - time))[:2]]))
        raise InputError(f"{file}: the run has no row at {time:.12g} s; the nearest are at {near} s")
    q, v = state[k, : robot.nq], state[k, robot.nq : robot.nq + robot.nv]
    last = about["events"][-1]["name"] if k == len(times) - 1 and about["status"] == Status.EVENT else None
    if any(rule.latch and rule.name == last for rule in scene.events):
        latch = load_run(file).events[-1].latch
        v = v if latch is None else latch.velocity
    if not (np.isfinite(q).all() and np.isfinite(v).all()):
        raise InputError(f"{file}: the state at {times[k]:.6g} s is not finite; start from an earlier `time`")
    return SavedState(file.name, robot.joints, q, v, float(times[k]) + scene.initial.clock)


def _read(file: Path) -> tuple[dict[str, Any], dict[str, Array], Scene]:
    """The checked JSON text, the float64 arrays, and the scene, with the settings of the run, of a run's file. The
    scene names no files but those in it.
    """
    about, arrays = _contents(file)
    with _refusing(file):
        about = checked_about(about)
        scene = load_held_scene(_unpacked(json.dumps(about["files"], sort_keys=True)) / _plain(about["scene"]))
        if about["settings"].stabilisation != scene.settings.stabilisation:
            scene = replace(scene, settings=about["settings"])
    return about, arrays, scene


def _contents(file: Path) -> tuple[dict[str, Any], dict[str, Array]]:
    """The JSON text and the float64 arrays of a run's file, or of a folder of blocks; InputError for any other file."""
    if file.is_dir():
        from bellcrank.simulation.run_blocks import joined_blocks

        return joined_blocks(file)
    return archive_of(file, FORMAT)


def archive_of(file: Path, form: str, unpacked: int | None = None) -> tuple[dict[str, Any], dict[str, Array]]:
    """The JSON text and the float64 arrays of an .npz of a format; InputError for any other file. `unpacked` as in
    `read_archive`.
    """
    try:
        with open_regular(file, MOST_RUN) as stream:
            about, arrays = read_archive(stream, unpacked)
    except NoRun:
        about, arrays = {}, {}
    except DAMAGE as error:
        raise _damaged(file, error) from None
    if about.get("format") != form:
        raise InputError(f"{file}: not a run: expected an .npz that Trajectory.save wrote")
    if about.get("version") != VERSION:
        raise InputError(
            f"{file}: the run has format version {brief(about.get('version'), '')}, this bellcrank {version()} reads "
            f"{VERSION}; load it with the bellcrank that wrote it, or a later one"
        )
    return about, arrays


def _parts(arrays: dict[str, Array], prefix: str) -> dict[str, Any]:
    return {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}


@contextlib.contextmanager
def _refusing(file: Path) -> Iterator[None]:
    """Tell what a file's content is refused for, in one sentence with the file (InputError)."""
    try:
        yield
    except BellcrankError as error:
        raise InputError(f"{file}: the scene in it cannot be rebuilt: {_why(error)}") from None
    except DAMAGE as error:
        raise _damaged(file, error) from None


def _damaged(file: Path, error: BaseException) -> InputError:
    why = _why(error)
    return InputError(f"{file}: not a run, or damaged{f' ({why})' if why else ''}; save or copy it again")


def _why(error: BaseException) -> str:
    """What an error says, in one line of a message's length."""
    text = " ".join(str(error).split())
    return text if len(text) <= LONGEST_WHY else f"{text[:LONGEST_WHY]}…"


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


@cache
def _unpacked(files: str) -> Path:
    """A folder with these files (JSON {name: text}) in it, kept until the process ends. Raises InputError."""
    texts: dict[str, str] = {_plain(name): text for name, text in json.loads(files).items()}
    try:
        folder = new_folder("run")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        for name, text in texts.items():
            (folder / name).write_bytes(utf8(text))
    except OSError as error:
        raise InputError(f"cannot be unpacked into {tempfile.gettempdir()}: {error.strerror or error}") from None
    return folder


def _plain(name: str) -> str:
    """A file's name as this system takes it; ValueError for one that leads out of its folder."""
    if Path(name).name != name or name in ("", ".."):
        raise ValueError(f"it names the file {brief(name)}")
    return file_name_here(name)


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"
