"""Runs that are kept while they are computed: a folder of blocks, run.blocks, beside the run.npz that is to be.

about.npz in it holds what run.npz holds beside its rows; 0001.npz, 0002.npz, … hold rows, events and statistics of a
few seconds of computing each, and the state where each ends. Every file appears whole or not at all, the folder with
its first block, so that a process that is killed loses no more than the rows since the last block.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import time
import warnings
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.system import system_of
from bellcrank.elements.signals import Signal
from bellcrank.errors import InputError, NotSavedError
from bellcrank.files.atomic_write import file_meant
from bellcrank.files.temporaries import is_running, new_folder, own_mark
from bellcrank.scene.run_contents import CHECKPOINT, CHECKPOINTS, archive_of, checkpoint_file, holds_checkpoints
from bellcrank.scene.scene import Scene
from bellcrank.scene.settings import Settings
from bellcrank.simulation.record import Statistics
from bellcrank.simulation.run_file import (
    refuse_functions,
    run_facts,
    run_path,
    save_run,
    write_archive,
)
from bellcrank.simulation.simulate import check_keep_every, statistics_of
from bellcrank.simulation.status import Status

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory import Trajectory

Array = NDArray[np.float64]
SHARE = 50.0  # times as long as a block takes: on a slow disk they are rarer


def blocks_folder(path: str | Path) -> Path:
    """The folder of the blocks of a run that is kept in an .npz file: run.blocks for run.npz."""
    return run_path(path).with_suffix(".blocks")


def set_aside(folder: Path) -> Path | None:
    """Rename a folder of blocks that an earlier run left, to run.blocks.1 and so on; its new path, None without one.

    Raises InputError where it is no such folder, and where the run that writes it goes on.
    """
    if not os.path.lexists(folder):
        return None
    if not holds_checkpoints(folder):
        raise InputError(f"{folder}: expected the blocks of an unfinished run there, found something else; rename it")
    try:
        about, _ = archive_of(checkpoint_file(folder, "about.npz"), CHECKPOINTS)
    except InputError:
        about = {}
    mark = str(about.get("process", ""))
    if is_running(mark):
        raise InputError(
            f"{folder}: another simulation is writing there (process {mark.split('-')[1]}); choose another folder"
        )
    number = 1
    while os.path.lexists(f"{folder}.{number}"):
        number += 1
    try:
        return folder.rename(f"{folder}.{number}")
    except OSError as error:
        raise InputError(f"cannot rename {folder}: {error.strerror}; choose another folder") from None


class Keeper:
    """Keeps a run in an .npz file: blocks while it is computed, about every so many s, and the file at the end.

    Raises InputError where the file cannot be written.
    """

    def __init__(self, path: str | Path, every: float) -> None:
        self.every = check_keep_every(every)
        self.target, self.folder = run_path(path), blocks_folder(path)
        file_meant(self.target)
        set_aside(self.folder)
        self._blocks = self._rows = 0  # written so far
        self._kept_events = np.zeros(0, dtype=np.int32)  # events written so far, as numbers of their functions
        self._until = 0.0  # s
        self._told = False  # that the disk takes nothing
        self._waiting: list[dict[str, Any]] = []

    def begin(self, scene: Scene, settings: Settings, parameters: Array, signals: tuple[Signal, ...]) -> None:
        """Say what is simulated. Raises InputError for a scene that no file can hold."""
        from bellcrank.simulation.trajectory import Trajectory

        none = np.zeros(0)
        state = np.zeros((0, system_of(scene).size))
        cost = Statistics(0, 0, 0, 0, 0, 0.0)
        self._run = Trajectory(scene, settings, none, state, parameters, signals, Status.INTERRUPTED, (), cost, none)
        refuse_functions(scene)

    def add(self, block: dict[str, Any]) -> float:
        """Write what the stepper hands over; what the disk does not take is written with the next block. Returns the
        seconds until that.
        """
        begun = time.monotonic()
        self._waiting.append(block)
        arrays = {name: np.concatenate([part[name] for part in self._waiting]) for name in ("time", "state")}
        index, at, x = (
            np.concatenate([part[f"event_{k}"] for part in self._waiting]) for k in ("index", "time", "state")
        )
        nq, nv = self._run.robot.nq, self._run.robot.nv
        arrays |= {"event_time": at, "event_position": x[:, :nq], "event_velocity": x[:, nq : nq + nv]}
        arrays |= {
            "steps": block["steps"],
            "end_time": np.array([block["end_time"]]),
            "end_state": block["end_state"][None],
        }
        rules = [self._run.scene.events[k] for k in index.tolist()]
        kept = np.concatenate([self._kept_events, index])
        cost = statistics_of(self._run.scene, block["counts"], block["seconds"], block["longest_step"], block, kept)
        try:
            self._write(Status.INTERRUPTED, cost, [(rule.name, rule.stop) for rule in rules], arrays)
            self._waiting.clear()
            self._kept_events = kept
        except InputError as error:
            if not self._told:
                self._told = True
                warnings.warn(f"{error}; the run goes on, and will be kept once there is room", stacklevel=2)
        return max(self.every, SHARE * (time.monotonic() - begun))

    def finish(self, run: Trajectory) -> None:
        """Save the run and remove its blocks. Raises NotSavedError, with what is kept, where that cannot be."""
        try:
            save_run(run, self.target, lasting=self._blocks > 0)
        except InputError as error:
            raise NotSavedError(f"{error}; {self._kept(run)}", run) from None
        if self._blocks:
            gone = new_folder("blocks", self.target.parent)
            with contextlib.suppress(OSError):
                self.folder.rename(gone)  # at once: half a folder would look like a run
            shutil.rmtree(gone, ignore_errors=True)

    def _kept(self, run: Trajectory) -> str:
        """What the blocks hold of a run that could not be saved, with its last rows, if there is room for these."""
        if not self._blocks:
            return "nothing of the run is kept"
        rest = run.events[len(self._kept_events) :]
        arrays = {"time": run.time[self._rows :], "state": run.state[self._rows :], "steps": run.steps}
        arrays |= {
            "event_time": np.array([event.time for event in rest]),
            "event_position": np.array([event.position for event in rest]).reshape(-1, run.robot.nq),
            "event_velocity": np.array([event.velocity for event in rest]).reshape(-1, run.robot.nv),
            "end_time": run.time[-1:],
            "end_state": run.state[-1:],
        }
        try:
            if len(run.time) < self._rows or run.statistics.omitted_events:
                raise InputError("the rest does not follow what is written")
            self._write(run.status, run.statistics, [(event.name, event.stopped) for event in rest], arrays)
        except InputError:
            return (
                f"the first {self._until:.6g} s of {run.time[-1]:.6g} s are kept in {self.folder}, which opens as a run"
            )
        return f"all of it is kept in {self.folder}, which opens as a run"

    def _write(
        self, status: Status, cost: Statistics, events: Sequence[tuple[str, bool]], arrays: dict[str, Array]
    ) -> None:
        """Write a block, the first with its folder. Raises InputError."""
        about = {
            "format": CHECKPOINT, "version": 1, "status": str(status), "statistics": asdict(cost),
            "events": [{"name": name, "stopped": stopped} for name, stopped in events],
        }  # fmt: skip
        name = f"{self._blocks + 1:04d}.npz"
        if self._blocks:
            write_archive(self.folder / name, about, arrays)
        else:
            facts, common = run_facts(self._run)
            try:
                self.target.parent.mkdir(parents=True, exist_ok=True)
                made = new_folder("blocks", self.target.parent)
                try:
                    write_archive(made / "about.npz", facts | {"format": CHECKPOINTS, "process": own_mark()}, common)
                    write_archive(made / name, about, arrays)
                    made.rename(self.folder)
                finally:
                    shutil.rmtree(made, ignore_errors=True)
            except OSError as error:
                raise InputError(f"cannot write {self.folder}: {error.strerror}") from None
        self._blocks += 1
        self._rows += len(arrays["time"])
        self._until = float(arrays["end_time"][-1])
