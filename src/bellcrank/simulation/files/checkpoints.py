"""Checkpoints: a run is kept on disk while it is computed, in a folder run.blocks beside the run.npz that is to be.

about.npz in that folder holds what run.npz holds beside its rows; 0001.npz, 0002.npz, … hold the rows, events and
statistics of a few seconds of computing each, and the state at their end. Every file is written atomically, the folder
together with its first checkpoint, so that a process that is killed loses only the rows since the last checkpoint.
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
from typing import TYPE_CHECKING

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.dynamics.equations.system import system_of
from bellcrank.elements.signals import Signal
from bellcrank.errors import InputError, NotSavedError
from bellcrank.files.atomic_write import file_meant
from bellcrank.files.temporaries import is_running, new_folder, own_mark
from bellcrank.scene.run_contents import (
    CHECKPOINT,
    CHECKPOINTS,
    VERSION,
    archive_of,
    checkpoint_file,
    holds_checkpoints,
)
from bellcrank.scene.scene import Scene
from bellcrank.scene.settings import Settings
from bellcrank.simulation.files.save_run import (
    event_auxiliary,
    file_contents,
    refuse_functions,
    run_path,
    save_run,
    write_archive,
)
from bellcrank.simulation.integration.integration import repeat_run
from bellcrank.simulation.integration.statistics import Statistics, Status, statistics_of
from bellcrank.simulation.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from bellcrank._step import StepBlock

CHECKPOINT_EVERY, LONGEST_BETWEEN_CHECKPOINTS = (
    5.0,
    1e6,
)  # s of computing between two checkpoints: the default, and the most
SPACING = 50.0  # times as long as writing takes: on a slow disk checkpoints are further apart


def check_checkpoint_every(seconds: float) -> float:
    """The seconds of computing between two checkpoints; InputError where it is no such number."""
    return arguments.number("checkpoint_every", seconds, "s", above=0.0, most=LONGEST_BETWEEN_CHECKPOINTS)


def checkpoint_folder(path: str | Path) -> Path:
    """The folder of the checkpoints of a run that is kept in an .npz file: run.blocks for run.npz."""
    return run_path(path).with_suffix(".blocks")


def set_aside(folder: Path) -> Path | None:
    """Rename the folder of an earlier run to run.blocks.1 and so on; returns its new path, None where there is none.

    Raises InputError where it is something else, and where another process still writes it.
    """
    if not os.path.lexists(folder):
        return None
    if not holds_checkpoints(folder):
        raise InputError(
            f"{folder}: expected the checkpoints of an unfinished run there, found something else; rename it"
        )
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


class CheckpointWriter:
    """Keeps a run in an .npz file: checkpoints about every `every` seconds of computing, and the file at the end.

    Raises InputError where the file cannot be written.
    """

    def __init__(self, path: str | Path, every: float) -> None:
        self.every = check_checkpoint_every(every)
        self.target, self.folder = run_path(path), checkpoint_folder(path)
        file_meant(self.target)
        set_aside(self.folder)
        self._written = self._rows = 0  # checkpoints and rows written so far
        self._events = np.zeros(0, dtype=np.int32)  # events written so far, as numbers of their functions
        self._until = 0.0  # s
        self._warned = False  # that a checkpoint could not be written
        self._waiting: list[StepBlock] = []

    def begin(self, scene: Scene, settings: Settings, parameters: Array, signals: tuple[Signal, ...]) -> None:
        """Say what is simulated. Raises InputError for a scene that no file can hold."""
        refuse_functions(scene)
        self._run = Trajectory(
            scene=scene,
            settings=settings,
            time=np.zeros(0),
            state=np.zeros((0, system_of(scene).size)),
            parameters=parameters,
            signals=signals,
            status=Status.INTERRUPTED,
            events=(),
            statistics=Statistics(
                steps=0, rejected=0, evaluations=0, jacobians=0, factorisations=0, kernel_time=0.0
            ),
            steps=np.zeros(0),
            repeat=repeat_run,
        )  # fmt: skip

    def add(self, block: StepBlock) -> float:
        """Write what the integrator found since the last call; returns the seconds until the next call.

        What cannot be written now is written with the next checkpoint.
        """
        begun = time.monotonic()
        self._waiting.append(block)
        index, x = (
            np.concatenate([getattr(b, name) for b in self._waiting]) for name in ("event_index", "event_state")
        )
        nq, nv = self._run.robot.nq, self._run.robot.nv
        arrays = {
            "time": np.concatenate([b.time for b in self._waiting]),
            "state": np.concatenate([b.state for b in self._waiting]),
            "event_time": np.concatenate([b.event_time for b in self._waiting]),
            "event_position": x[:, :nq],
            "event_velocity": x[:, nq : nq + nv],
            "steps": block.steps,
            "end_time": np.array([block.end_time]),
            "end_state": block.end_state[None],
        }
        if self._run.scene.auxiliary_states:
            arrays["event_auxiliary"] = x[:, nq + nv : nq + nv + system_of(self._run.scene).nz]
        if self._run.scene.held_sources:
            arrays |= {n: np.concatenate([getattr(b, n) for b in self._waiting]) for n in ("held_time", "held_values")}
        rules = [self._run.scene.events[k] for k in index.tolist()]
        kept = np.concatenate([self._events, index])
        statistics = statistics_of(self._run.scene, block, kept)
        try:
            self._write(Status.INTERRUPTED, statistics, [(rule.name, rule.stop) for rule in rules], arrays)
            self._waiting.clear()
            self._events = kept
        except InputError as error:
            if not self._warned:
                self._warned = True
                warnings.warn(f"{error}; the run goes on, and is saved as soon as there is room", stacklevel=2)
        return max(self.every, SPACING * (time.monotonic() - begun))

    def finish(self, run: Trajectory) -> None:
        """Save the run and remove its checkpoints. Raises NotSavedError, which says what is kept."""
        try:
            save_run(run, self.target, lasting=self._written > 0)
        except InputError as error:
            raise NotSavedError(f"{error}; {self._kept(run)}", run) from None
        if self._written:
            gone = new_folder("blocks", self.target.parent)
            with contextlib.suppress(OSError):
                self.folder.rename(gone)  # at once: half a folder would look like a run
            shutil.rmtree(gone, ignore_errors=True)

    def _kept(self, run: Trajectory) -> str:
        """What the checkpoints hold of a run that could not be saved; its last rows are added if there is room."""
        if not self._written:
            return "nothing of the run is kept"
        rest = run.events[len(self._events) :]
        arrays = {"time": run.time[self._rows :], "state": run.state[self._rows :], "steps": run.steps}
        arrays |= {
            "event_time": np.array([event.time for event in rest]),
            "event_position": np.array([event.position for event in rest]).reshape(-1, run.robot.nq),
            "event_velocity": np.array([event.velocity for event in rest]).reshape(-1, run.robot.nv),
            "end_time": run.time[-1:],
            "end_state": run.state[-1:],
        }
        if run.scene.auxiliary_states:
            arrays["event_auxiliary"] = event_auxiliary(run.scene, rest)
        held = run.signals[len(run.signals) - len(run.scene.held_sources) :]
        if held:
            breaks, values = held[0].breaks[:-1], np.concatenate([s.coefficients[:, 0] for s in held], axis=1)
            arrays |= {"held_time": breaks[breaks > self._until], "held_values": values[breaks > self._until]}
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
        self, status: Status, statistics: Statistics, events: Sequence[tuple[str, bool]], arrays: dict[str, Array]
    ) -> None:
        """Write a checkpoint, the first with its folder. Raises InputError."""
        about = {
            "format": CHECKPOINT, "version": VERSION, "status": str(status), "statistics": asdict(statistics),
            "events": [{"name": name, "stopped": stopped} for name, stopped in events],
        }  # fmt: skip
        name = f"{self._written + 1:04d}.npz"
        if self._written:
            write_archive(self.folder / name, about, arrays)
        else:
            facts, common = file_contents(self._run)
            facts |= {"held": [source.width for source in self._run.scene.held_sources]}
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
        self._written += 1
        self._rows += len(arrays["time"])
        self._until = float(arrays["end_time"][-1])
