"""Sizings of many designs of a robot configuration: the DesignRunner behind `bellcrank sweep --size`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bellcrank.arrays import Array, Indices, Mask
from bellcrank.cached_values import Portable, cached_property
from bellcrank.elements.frame_joints import path_frames
from bellcrank.errors import BellcrankError, InputError
from bellcrank.motion.motion_entry import stretched
from bellcrank.notes import Note, in_use, ranked, reached
from bellcrank.scene.scene import Scene
from bellcrank.sizing.loads.joint_histories import SizingInputs
from bellcrank.sizing.mechanism_sizing import size_mechanism
from bellcrank.sizing.result import Sizing
from bellcrank.sizing.sizing_subject import sizing_subject
from bellcrank.studies.designs.plain_axes import DesignAxis
from bellcrank.studies.designs.sizing_changes import changes_of, factors, override
from bellcrank.studies.execution.design_runner import StudyInterrupted, infeasible_reason, scene_identity
from bellcrank.studies.execution.many_sizings import SizingBatch, certain
from bellcrank.studies.execution.shared_sizing import SharedSizing
from bellcrank.studies.results.sizing_measures import Judged, judged, measures_of
from bellcrank.studies.results.study_columns import StudyColumns

Whole = Indices
Progress = Callable[[int], object]
BLOCK = 64  # designs whose peaks are refined together
BLOCK_OF_LINKAGES = 256  # designs whose motions are made together
NOISE = 1e-9  # of a measure: how far peaks and RMS values of a design may be from those of `bellcrank.size`


class SizingRunner(Portable):
    """Sizes the designs of a robot configuration along the axes of a study (a DesignRunner).

    Link lengths, masses, inertias, payloads, the scene's parameters, ratings of actuators and durations of motions are
    inputs of compiled equations, so that many designs are sized at once; `notes` says where designs are sized one by
    one. A motion of joints is the same in all designs: where a length differs, a frame follows another path.

    Args:
        scene: The robot configuration.
        axes: What is varied (studies/designs/sizing_changes.py).
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
    def shared(self) -> SharedSizing:
        """What designs share."""
        return SharedSizing(self.scene, self.changes, self.motions)

    @cached_property
    def judged(self) -> Judged:
        """The measures, and what they are compared with."""
        found = judged(self.base, self.shared.reports_holding)
        return replace(found, units={**found.units, **dict.fromkeys(self._durations(self.base), "s")})

    def _durations(self, sizing: Sizing) -> dict[str, float]:
        """The durations of all motions, s, as measures, where designs change one."""
        changed = any(
            change.kind in ("duration", "waypoint") or change.path.startswith("motions.") for change in self.changes
        )
        motions = () if sizing.inputs is None or not changed else sizing.inputs.motions
        return {f"{motion.name}.duration": motion.duration for motion in motions}

    @property
    def units(self) -> Mapping[str, str]:
        """Every measure by name with its unit, in the order of the columns."""
        return self.judged.units

    @property
    def default_measures(self) -> tuple[str, ...]:
        """The measures that tables and plots show if they vary: the smallest margin, and those of joints."""
        joints = [name for name in self.units if name.endswith(".margin")]
        torques = [name for name in self.units if name.endswith(".peak_torque")]
        return ("margin", *torques, *joints)

    @property
    def noise(self) -> tuple[float, float]:
        """Absolute and relative differences of a measure up to which they are errors of the computation."""
        return NOISE, NOISE

    @property
    def notes(self) -> tuple[Note, ...]:
        """Sentences about what to look at: those of the sizing of the configuration, and how designs are sized."""
        found = list(self.base.warnings)
        if reason := self.shared.single_reason:
            found.append(f"designs are sized one by one, because {reason}")
        if not self.shared.reports_holding:
            found.append("holding torques are not among the measures; `bellcrank size` gives them for one design")
        return ranked([*self._file_notes, *found, *self._path_notes()])

    @property
    def _file_notes(self) -> tuple[Note, ...]:
        """What the robot's file says and is not modelled."""
        return in_use(self.scene.config.notes, None, bool(self.scene.robot.gravity.any()))

    def _path_notes(self) -> list[str]:
        """A sentence for each motion of an open chain that is made from a frame's path while lengths are varied."""
        entries = self.scene.config.motions
        moved = [axis.path for axis, change in zip(self.axes, self.changes, strict=True) if change.moves]
        if self.shared.mechanism.closed or not moved:
            return []
        return [
            f"motion '{name}' was made from a frame's path with the lengths of the configuration, and its joints move "
            f"alike in all designs: where {', '.join(moved)} differ, the frame moves along another path"
            for name in self.base.motions
            if name in entries and any(path_frames(entries[name], entries))
        ]

    @cached_property
    def identity(self) -> Mapping[str, str]:
        """What the results depend on, by a name that a user understands."""
        return {
            **scene_identity(self.scene),
            "sizing over": ", ".join(self.base.motions),
        }

    # ---- designs

    def run(self, values: Array, *, threads: int = 1, progress: Progress | None = None) -> StudyColumns:
        """The columns of designs with values (n, axes), in the axes' units; see DesignRunner."""
        rows = _Rows({name: np.full(len(values), np.nan) for name in self.units}, np.zeros(len(values), dtype=bool))
        numbers = values * factors(self.axes, self.changes)
        try:
            if not self.shared.single_reason and len(values):
                self._together(numbers, np.flatnonzero(certain(self.shared, numbers)), rows, threads, progress)
            for row in np.flatnonzero(~rows.done).tolist():
                self._single(values[row].tolist(), row, rows)
                if progress is not None:
                    progress(int(rows.done.sum()))
        except KeyboardInterrupt:
            done = np.flatnonzero(rows.done)
            raise StudyInterrupted(done, self._columns(rows).take(done)) from None
        return self._columns(rows)

    def _columns(self, rows: _Rows) -> StudyColumns:
        unknown = dict(rows.unsizable)
        shared = (*reached(self._file_notes), *self.base.undetermined)  # the latter by the rows of the motions
        if shared:
            unknown = dict.fromkeys(range(len(rows.done)), shared[0]) | unknown
        return self.judged.columns(dict(rows.measures), rows.infeasible, unknown)

    def _together(self, numbers: Array, wanted: Whole, rows: _Rows, threads: int, progress: Progress | None) -> None:
        """Fill in the rows `wanted` in blocks, but for those of designs that cannot follow a motion."""
        shared = self.shared
        size = BLOCK if shared.changed_linkage is None else BLOCK_OF_LINKAGES
        blocks = [wanted[first : first + size] for first in range(0, len(wanted), size)]
        _ = shared.design_motions, shared.speeds, shared.holding  # before threads use them
        with ThreadPoolExecutor(max(1, min(threads, len(blocks)))) as pool:
            try:
                found = pool.map(lambda block: SizingBatch(shared, numbers[block]).measures(), blocks)
                for block, (columns, good) in zip(blocks, found, strict=True):
                    for name, column in columns.items():
                        if name in rows.measures:
                            rows.measures[name][block[good]] = column[good]
                    rows.done[block[good]] = True
                    if shared.unsizable:
                        rows.unsizable |= dict.fromkeys(block[good].tolist(), shared.unsizable)
                    if progress is not None:
                        progress(int(rows.done.sum()))
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise

    def _single(self, numbers: Sequence[float], row: int, rows: _Rows) -> None:
        """Fill in a row by `bellcrank.size`."""
        try:
            sizing = self.design(numbers)
        except BellcrankError as error:
            rows.infeasible[row] = infeasible_reason(error, self.scene)
        else:
            for name, value in (measures_of(sizing) | self._durations(sizing)).items():
                if name in rows.measures:
                    rows.measures[name][row] = value
            if sizing.unsizable:
                rows.unsizable[row] = "; ".join(sizing.unsizable)
        rows.done[row] = True

    def design(self, numbers: Sequence[float]) -> Sizing:
        """The sizing of one design by `bellcrank.size`. Raises BellcrankError where it cannot be built or sized."""
        sizing = self._sized(*self._changed(numbers))
        _ = sizing.judging.verdicts  # that of `base` is not asked for
        return sizing

    def inputs(self, numbers: Sequence[float]) -> SizingInputs:
        """The mechanism, motions and actuators of one design. Raises BellcrankError where it cannot be built."""
        overrides, durations = self._changed(numbers)
        return self._inputs(self._scene(overrides), durations)

    def _changed(self, numbers: Sequence[float]) -> tuple[dict[str, Any], dict[str, float]]:
        """Overrides of the scene, and durations of motions, s."""
        overrides: dict[str, Any] = {}
        durations: dict[str, float] = {}
        si = np.array(numbers) * factors(self.axes, self.changes)
        for axis, change, number, value in zip(self.axes, self.changes, numbers, si.tolist(), strict=True):
            if change.kind == "duration":
                durations[change.owner] = value
            else:
                path, changed = override(self.scene, change.path, axis.value(number))
                overrides[path] = changed
        return overrides, durations

    def _sized(self, overrides: Mapping[str, Any], durations: Mapping[str, float]) -> Sizing:
        """The sizing with changed values, and motions that take other durations, s."""
        scene = self._scene(overrides)
        mechanism, motions, actuators = self._inputs(scene, durations)
        config = scene.config
        return size_mechanism(
            mechanism,
            motions,
            actuators,
            transmissions=config.transmissions,
            duty=config.duty or None,
            mounts=config.mounts,
            conditions=config.conditions,
        )

    def _scene(self, overrides: Mapping[str, Any]) -> Scene:
        return self.scene.with_overrides(overrides) if overrides else self.scene

    def _inputs(self, scene: Scene, durations: Mapping[str, float]) -> SizingInputs:
        subject = sizing_subject(scene, self.motions)
        for name, duration in durations.items():
            if not 0.0 < duration < np.inf:
                raise InputError(f"motions.{name}.duration: expected more than 0 s, found {duration:g} s")
        motions = tuple(
            stretched(motion, durations[motion.name] / motion.duration) if motion.name in durations else motion
            for motion in subject.motions
        )
        return SizingInputs(subject.mechanism, motions, subject.actuators)


@dataclass(eq=False)
class _Rows:
    """The rows of designs while they are filled in."""

    measures: dict[str, Array]
    done: Mask
    infeasible: dict[int, str] = field(default_factory=dict)
    unsizable: dict[int, str] = field(default_factory=dict)
