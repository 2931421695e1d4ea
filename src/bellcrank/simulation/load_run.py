"""Reads runs that `Trajectory.save` wrote, or whose checkpoints are there."""

from __future__ import annotations

import atexit
import contextlib
import json
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.dynamics.system import system_of, system_parameters
from bellcrank.elements.signals import Signal
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.access import FileAccess, Trust
from bellcrank.files.temporaries import new_folder
from bellcrank.scene.scene import Scene, load_held_scene
from bellcrank.simulation.checkpoints import joined_checkpoints
from bellcrank.simulation.events import event_at
from bellcrank.simulation.integration import until_turned_over
from bellcrank.simulation.run_archive import DAMAGE, brief
from bellcrank.simulation.run_file_checks import check_arrays, checked_about
from bellcrank.simulation.run_format import RUN, archive_of, damaged, reason
from bellcrank.simulation.run_start import SavedState
from bellcrank.simulation.status import Status
from bellcrank.simulation.trajectory import Trajectory
from bellcrank.text import file_name_here, utf8

Array = NDArray[np.float64]
SAME_TIME = 1e-12  # relative difference of a row's time and a time that is asked for


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
    )
    if file.is_dir():
        run = until_turned_over(run)  # this is done when a run ends
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
    """The JSON text and the float64 arrays of a run's file or a folder of checkpoints; InputError for other files."""
    return joined_checkpoints(file) if file.is_dir() else archive_of(file, RUN)


def _parts(arrays: dict[str, Array], prefix: str) -> dict[str, Any]:
    return {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}


@contextlib.contextmanager
def _refusing(file: Path) -> Iterator[None]:
    """Tell what a file's content is refused for, in one sentence with the file (InputError)."""
    try:
        yield
    except BellcrankError as error:
        raise InputError(f"{file}: the scene in it cannot be rebuilt: {reason(error)}") from None
    except DAMAGE as error:
        raise damaged(file, error) from None


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
