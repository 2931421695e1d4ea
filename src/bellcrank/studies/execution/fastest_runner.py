"""Fastest motions of many designs: the DesignRunner behind `bellcrank optimise --fastest`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy

import numpy as np

from bellcrank.arrays import Array
from bellcrank.cached_values import Portable, cached_property
from bellcrank.errors import BellcrankError, InputError
from bellcrank.notes import Note, in_use, ranked
from bellcrank.scene.scene import Scene
from bellcrank.studies.designs.plain_axes import DesignAxis
from bellcrank.studies.designs.sizing_changes import changes_of
from bellcrank.studies.execution.design_runner import StudyInterrupted, infeasible_reason, scene_identity
from bellcrank.studies.results.study_columns import StudyColumns

CYCLE = "cycle_time"
NOISE = 1e-9  # of a time: how it differs between neighbouring designs, measured as differences of second order
FINISHED, INFEASIBLE = STATUSES = ("finished", "infeasible")


class FastestRunner(Portable):
    """Finds the fastest motions of the designs of a robot configuration along the axes of a study (a DesignRunner).

    The measures are `MOTION.time`, the time of the fastest motion along the path of each motion, s, and `cycle_time`,
    their sum (planning/time_optimal.py). Pauses do not count.

    Args:
        scene: The robot configuration.
        axes: What is varied (studies/designs/sizing_changes.py).

    Raises:
        InputError: A path does not exist, changes no path or limit, or the configuration has no motions.
    """

    def __init__(self, scene: Scene, axes: Sequence[DesignAxis]) -> None:
        self.axes = tuple(axes)
        self.motions = tuple(scene.config.motions)
        if not self.motions:
            raise InputError(f"{scene.source}: there is no motion whose path could be followed; write motions")
        self.scene, self.changes = changes_of(scene, self.axes)
        for change in self.changes:
            if change.kind == "duration":
                raise InputError(
                    f"'{change.path}': a fastest motion has a duration of its own; vary what changes its path or limits"
                )

    def only(self, measures: Collection[str]) -> FastestRunner:
        """A runner of the motions that measures ask for."""
        found = copy(self)
        if CYCLE not in measures:
            found.motions = tuple(name for name in self.motions if f"{name}.time" in measures)
        return found

    @property
    def units(self) -> Mapping[str, str]:
        """As in DesignRunner."""
        every = self.motions == tuple(self.scene.config.motions)
        return {f"{name}.time": "s" for name in self.motions} | ({CYCLE: "s"} if every else {})

    @property
    def default_measures(self) -> tuple[str, ...]:
        """As in DesignRunner."""
        return (*((CYCLE,) if len(self.motions) > 1 else ()), *(f"{name}.time" for name in self.motions))

    @property
    def noise(self) -> tuple[float, float]:
        """As in DesignRunner."""
        return NOISE, NOISE

    @property
    def notes(self) -> tuple[Note, ...]:
        """What the robot's file says and is not modelled, and what times leave out."""
        slowed = Note(
            "times are those of motions that `bellcrank fastest` makes, before it slows one by up to 1e-5 where it "
            "exceeds a limit between its rows; pauses do not count"
        )
        file_notes = in_use(self.scene.config.notes, None, bool(self.scene.robot.gravity.any()))
        return ranked([*file_notes, slowed])

    @cached_property
    def identity(self) -> Mapping[str, str]:
        """What the results depend on, by a name that a user understands."""
        return {
            **scene_identity(self.scene),
            "fastest along": ", ".join(self.motions),
        }

    def run(self, values: Array, *, threads: int = 1, progress: Callable[[int], object] | None = None) -> StudyColumns:
        """The columns of designs with values (n, axes), in the axes' units; see DesignRunner."""
        measures = {name: np.full(len(values), np.nan) for name in self.units}
        done, reasons = np.zeros(len(values), dtype=bool), dict[int, str]()

        def one(row: int) -> None:
            try:
                times = self.times(values[row].tolist())
            except BellcrankError as error:
                reasons[row] = infeasible_reason(error, self.scene)
            else:
                for name, time in times.items():
                    measures[f"{name}.time"][row] = time
                if CYCLE in measures:
                    measures[CYCLE][row] = sum(times.values())
            done[row] = True

        def columns() -> StudyColumns:
            status = np.isin(np.arange(len(values)), list(reasons)).astype(np.int8)
            return StudyColumns(statuses=STATUSES, status=status, measures=measures, reasons=reasons)

        try:
            if len(values):
                one(0)  # compiles what the others use
            with ThreadPoolExecutor(max(1, min(threads, len(values)))) as pool:
                try:
                    for _ in pool.map(one, range(1, len(values))):
                        if progress is not None:
                            progress(int(done.sum()))
                except BaseException:
                    pool.shutdown(cancel_futures=True)
                    raise
        except KeyboardInterrupt:
            rows = np.flatnonzero(done)
            raise StudyInterrupted(rows, columns().take(rows)) from None
        return columns()

    def times(self, numbers: Sequence[float]) -> dict[str, float]:
        """The time of each fastest motion of one design, s, by name.

        Raises BellcrankError where the design cannot be built or no motion keeps the limits.
        """
        from bellcrank.planning.time_optimal import least_path_time

        pairs = zip(self.axes, self.changes, numbers, strict=True)
        overrides = {change.path: axis.value(number) for axis, change, number in pairs}
        scene = self.scene.with_overrides(overrides) if overrides else self.scene
        return {name: least_path_time(scene, name) for name in self.motions}
