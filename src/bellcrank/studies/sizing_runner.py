"""Sizings of many designs of a robot configuration: the DesignRunner behind `bellcrank sweep --size`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.cached_values import Portable, cached_property
from bellcrank.codegen import cache as disk
from bellcrank.codegen import llvm as machine
from bellcrank.errors import BellcrankError
from bellcrank.motion.stretching import stretched
from bellcrank.scene.scene import Scene
from bellcrank.sizing.mechanism_sizing import size_mechanism
from bellcrank.sizing.result import Sizing
from bellcrank.sizing.size import sizing_subject
from bellcrank.studies.columns import Columns
from bellcrank.studies.sizing_axes import DesignAxis, changes_of, factors
from bellcrank.studies.sizing_batch import BLOCK, SizingBatch
from bellcrank.studies.sizing_measures import Judged, judged, measures_of
from bellcrank.version import version

Array = NDArray[np.float64]
Progress = Callable[[int], object]


class SizingRunner(Portable):
    """Sizes the designs of a robot configuration along the axes of a study (a DesignRunner).

    Link lengths, masses, inertias, payloads, the scene's parameters, ratings of actuators and durations of motions are
    inputs of compiled equations, so that many designs are sized at once; `notes` says where designs are sized one by
    one. A motion of joints is the same in all designs: where a length differs, a frame follows another path.

    Args:
        scene: The robot configuration.
        axes: What is varied (studies/sizing_axes.py).
        motions: Names of the motions to size over; by default all of the configuration.

    Raises:
        InputError: A path does not exist, or the configuration itself cannot be sized.
    """

    def __init__(self, scene: Scene, axes: Sequence[DesignAxis], motions: Sequence[str] | None = None) -> None:
        self.axes = tuple(axes)
        self.motions = None if motions is None else tuple(motions)
        self.scene, self.changes = changes_of(scene, self.axes)

    # ---- what designs share

    @cached_property
    def base(self) -> Sizing:
        """The sizing of the configuration itself."""
        return self._sized({}, {})

    @cached_property
    def batch(self) -> SizingBatch:
        """The sizing of many designs at once."""
        return SizingBatch(self.scene, self.changes, self.motions)

    @cached_property
    def judged(self) -> Judged:
        """The measures, and what they are compared with."""
        return judged(self.base, self.batch.reports_holding)

    @property
    def units(self) -> Mapping[str, str]:
        """Every measure by name with its unit, in the order of the columns."""
        return self.judged.units

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences about what to look at: those of the sizing of the configuration, and how designs are sized."""
        found = list(self.base.warnings)
        if reason := self.batch.single_reason:
            found.append(f"designs are sized one by one, because {reason}")
        if not self.batch.reports_holding:
            found.append("holding torques are not among the measures; `bellcrank size` gives them for one design")
        return tuple(dict.fromkeys(found))

    @cached_property
    def identity(self) -> Mapping[str, str]:
        """What the results depend on, by a name that a user understands."""
        target = machine.target()
        return {
            "scene": disk.digest(repr(self.scene.data)),
            "files of the scene": disk.digest(repr(sorted(self.scene.files.items()))),
            "robot": disk.digest(self.scene.robot.key),
            "sizing": f"over {', '.join(self.base.motions)}",
            "axes": ", ".join(f"{axis.path} [{axis.unit or '1'}]" for axis in self.axes),
            "bellcrank": version(),
            "processor": f"{target.lanes} SIMD lanes, {'with' if target.fused else 'without'} fused multiply-add",
        }

    # ---- designs

    def run(self, values: Array, *, threads: int = 1, progress: Progress | None = None) -> Columns:
        """The columns of designs with values (n, axes), in the axes' units; see DesignRunner."""
        measures = {name: np.full(len(values), np.nan) for name in self.units}
        infeasible: dict[int, str] = {}
        unsizable: dict[int, str] = {}
        together = np.zeros(len(values), dtype=bool)
        numbers = values * factors(self.axes, self.changes)
        if not self.batch.single_reason and len(values):
            together = self.batch.certain(numbers)
            together[np.flatnonzero(together)] = self._together(
                numbers, np.flatnonzero(together), measures, threads, progress
            )
            if self.batch.unsizable:
                unsizable = dict.fromkeys(np.flatnonzero(together).tolist(), self.batch.unsizable)
        for row in np.flatnonzero(~together).tolist():
            try:
                sizing = self._design(values[row].tolist())
            except BellcrankError as error:
                infeasible[row] = str(error).removeprefix(f"{self.scene.source}: ")
            else:
                for name, value in measures_of(sizing).items():
                    if name in measures:
                        measures[name][row] = value
                if sizing.unsizable:
                    unsizable[row] = "; ".join(sizing.unsizable)
            if progress is not None:
                progress(1)
        return self.judged.columns(measures, infeasible, unsizable)

    def _together(
        self,
        numbers: Array,
        rows: NDArray[np.intp],
        measures: Mapping[str, Array],
        threads: int,
        progress: Progress | None,
    ) -> NDArray[np.bool_]:
        """Fill in the measures of rows in blocks, and return which of them have finite loads."""
        blocks = [rows[first : first + BLOCK] for first in range(0, len(rows), BLOCK)]
        good = [np.zeros(0, dtype=bool)]
        if blocks:
            self.batch.prepare()
        with ThreadPoolExecutor(max(1, min(threads, len(blocks)))) as pool:
            try:
                found = pool.map(lambda block: self.batch.measures(numbers[block]), blocks)
                for block, (columns, finite) in zip(blocks, found, strict=True):
                    for name, column in columns.items():
                        measures[name][block[finite]] = column[finite]
                    good.append(finite)
                    if progress is not None:
                        progress(int(finite.sum()))
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise
        return np.concatenate(good)

    def _design(self, numbers: Sequence[float]) -> Sizing:
        """The sizing of one design by `bellcrank.size`. Raises BellcrankError where it cannot be built or sized."""
        overrides: dict[str, Any] = {}
        durations: dict[str, float] = {}
        si = np.array(numbers) * factors(self.axes, self.changes)
        for axis, change, number, value in zip(self.axes, self.changes, numbers, si, strict=True):
            if change.kind == "duration":
                durations[change.owner] = float(value)
            else:
                overrides[change.path] = axis.value(number)
        return self._sized(overrides, durations)

    def _sized(self, overrides: Mapping[str, Any], durations: Mapping[str, float]) -> Sizing:
        """The sizing with changed values, and motions that take other durations, s."""
        scene = self.scene.with_overrides(overrides) if overrides else self.scene
        subject = sizing_subject(scene, self.motions)
        motions = [
            stretched(motion, durations[motion.name] / motion.duration) if motion.name in durations else motion
            for motion in subject.motions
        ]
        transmissions = scene.config.transmissions
        return size_mechanism(subject.mechanism, motions, subject.actuators, transmissions=transmissions)
