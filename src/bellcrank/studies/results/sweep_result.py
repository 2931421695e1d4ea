"""The result of a sweep: one row a design, with its measures as columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.cached_values import Portable, cached_property
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.notes import Note, reached
from bellcrank.present.results import JsonLayout, Result
from bellcrank.scene.scene import Scene
from bellcrank.studies.designs.axes import StudyAxis
from bellcrank.studies.designs.design_space import DesignSpace
from bellcrank.studies.results.study_columns import Design, DesignRows, StudyColumns, varies
from bellcrank.studies.results.sweep_plot import plot_sweep
from bellcrank.studies.results.sweep_tables import (
    design_rows,
    sweep_data,
    text_table,
    write_csv,
    write_npz,
    write_parquet,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bellcrank.studies.results.sample_statistics import SampleStatistics
    from bellcrank.studies.results.sensitivity import Sensitivity
    from bellcrank.studies.results.sweep_check import SweepCheck


@dataclass(frozen=True, eq=False, kw_only=True)
class Sweep(Portable, Result):
    """The result of `sweep`: designs over the grid of all combinations of values (the last axis fastest) or a sample.

    Attributes:
        scene: The scene that was varied.
        space: The designs: what is varied, with its values or its distribution.
        units: The measures by name, with their SI units.
        columns: The results of the designs that were run.
        index: (n,) their numbers, increasing: all, unless the sweep was interrupted.
        candidates: The measures that are shown by default if they vary.
        noise: Differences of a measure up to absolute + relative × magnitude are errors of the computation.
        notes: What to know about all designs, those that are reached first: the designs then are not known.
        sized: Whether the designs were sized, instead of simulated.
        timed: Whether their fastest motions were found, instead.

    Example:
        >>> import bellcrank as bc
        >>> bc.sweep("four_bar", {"crank_length": [1.22, 1.23, 1.24]})
        Sweep('Deployable four-bar' over crank_length: 3 designs, 3 finished)
    """

    scene: Scene
    space: DesignSpace
    units: Mapping[str, str] = field(repr=False)
    columns: StudyColumns = field(default_factory=lambda: StudyColumns.none())
    index: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    candidates: tuple[str, ...] = ()
    noise: tuple[float, float] = (0.0, 1e-12)
    notes: tuple[Note, ...] = field(default=(), repr=False)
    sized: bool = field(default=False, repr=False)
    timed: bool = field(default=False, repr=False)
    json_layout: ClassVar = JsonLayout(1)

    def __repr__(self) -> str:
        axes = ", ".join(axis.path for axis in self.axes)
        return f"Sweep('{self.scene.name}' over {axes}: {len(self)} designs, {self.finished} finished)"

    def __len__(self) -> int:
        return len(self.index)

    @property
    def axes(self) -> tuple[StudyAxis, ...]:
        """What was varied, with its values or its distribution."""
        return self.space.axes

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of values along each axis, then the number of points of the sample if there is one."""
        return self.space.shape

    @property
    def complete(self) -> bool:
        """Whether every design was run."""
        return len(self) == len(self.space)

    @property
    def finished(self) -> int:
        """The number of designs that reached their target."""
        return len(self) - len(self.columns.reasons)

    @property
    def designs(self) -> Sequence[Design]:
        """The designs that were run as objects, which are made when they are asked for; columns are much faster."""
        return DesignRows(self.columns, self.index)

    @cached_property
    def values(self) -> Array:
        """The values (designs, axes) of the axes, in their units."""
        values = self.space.values()
        return values if self.complete else values[self.index]

    @cached_property
    def status(self) -> NDArray[np.str_]:
        """The status (designs,) of each design."""
        return np.array(self.columns.statuses or ("",))[self.columns.status]

    @property
    def reasons(self) -> Mapping[int, str]:
        """Why a design did not reach its target, by its row; none where it did."""
        return self.columns.reasons

    @cached_property
    def check(self) -> SweepCheck | None:
        """Up to 32 designs run again with a tolerance that is smaller by 100, when asked for the first time.

        None for sizings, after an interruption, and where the tolerance is varied.

        Example:
            >>> import bellcrank as bc
            >>> swept = bc.sweep("four_bar", {"crank_length": [1.22, 1.23, 1.24]})
            >>> swept.check.shares["lock.time"] < 1e-6
            True
        """
        from bellcrank.studies.results.sweep_check import check_sweep

        return check_sweep(self)

    @property
    def not_known(self) -> tuple[Note, ...]:
        """Why designs are not known, a sentence each: what acts and is not modelled, and what is noise (`check`).

        Example:
            >>> import bellcrank as bc
            >>> bc.sweep("four_bar", {"crank_length": [1.22, 1.23, 1.24]}).not_known
            ()
        """
        return (*reached(self.notes), *(() if self.check is None else self.check.notes))

    def column(self, measure: str) -> Array:
        """Get a measure of each design.

        Args:
            measure: The name of a measure, one of `units`.

        Returns:
            Values (designs,) in SI units, read-only; NaN where a design does not have it, infinite where it has it and
            it is not a finite number.

        Raises:
            InputError: There is no such measure; the message lists the names.

        Example:
            >>> import bellcrank as bc
            >>> bc.sweep("four_bar", {"crank_length": [1.22, 1.24]}).column("lock.time").round(3)
            array([18.559, 12.109])
        """
        if arguments.text("measure", measure, "the name of a measure") not in self.units:
            raise InputError(f"sweep of {self.scene.name}: {unknown_name('measure', measure, self.units)}")
        found = self.columns.measures[measure].view()
        found.flags.writeable = False  # the sweep's own numbers
        return found

    def grid(self, measure: str) -> Array:
        """Get a measure over the grid.

        Args:
            measure: The name of a measure, one of `units`.

        Returns:
            Values, one dimension an axis and one for the sample; NaN where a design was not run.

        Raises:
            InputError: There is no such measure; the message lists the names.

        Example:
            >>> import bellcrank as bc
            >>> vary = {"crank_length": [1.22, 1.24], "rocker_length": [1.2, 1.21, 1.22]}
            >>> bc.sweep("four_bar", vary).grid("lock.time").shape
            (2, 3)
        """
        column = self.column(measure)
        if self.complete:
            return column.reshape(self.shape)
        table = np.full(len(self.space), np.nan)
        table[self.index] = column
        return table.reshape(self.shape)

    @cached_property
    def default_measures(self) -> tuple[str, ...]:
        """The measures that tables and plots show: the main ones, as far as they vary by more than `noise`."""
        chosen = tuple(name for name in self.candidates if varies(self.columns.measures[name], self.noise))
        return chosen or self.candidates

    @cached_property
    def statistics(self) -> SampleStatistics:
        """Distributions of the measures and probabilities of limits, where the designs are a sample.

        InputError where they are not, and where the error of what they estimate is unknown: Sobol points and Latin
        hypercubes need at least 1,024 designs, a multiple of 16.
        """
        from bellcrank.studies.results.sweep_statistics import sweep_statistics

        return sweep_statistics(self)

    @cached_property
    def sensitivity(self) -> Sensitivity:
        """Sobol indices of the measures; InputError where the designs are not those of `sobol`."""
        from bellcrank.studies.results.sweep_statistics import sweep_sensitivity

        return sweep_sensitivity(self)

    def table(self, measures: Sequence[str] | None = None) -> str:
        """Format the designs as text.

        Args:
            measures: Names of measures; by default `default_measures`.

        Returns:
            One line a design, with units in the header; of many the first and the last, and a summary.

        Raises:
            InputError: A measure is unknown.

        Example:
            >>> import bellcrank as bc
            >>> print(bc.sweep("four_bar", {"crank_length": [1.22, 1.24]}).table(["lock.time"]).splitlines()[0])
            crank_length [m]  lock.time [s]  status  reason
        """
        return text_table(self, self._measures(measures))

    def to_csv(self, path: str | Path) -> Path:
        """Write one row a design as CSV: axes, status, every measure, reason.

        Args:
            path: The file, which is replaced in one step.

        Returns:
            The path of the file. The header names units. Numbers are read back exactly; a cell is empty where a design
            does not have the measure, or it is not a finite number (status "unknown").

        Raises:
            InputError: The file cannot be written.

        Example:
            >>> import bellcrank as bc, pathlib, tempfile
            >>> result = bc.sweep("four_bar", {"crank_length": [1.22, 1.24]})
            >>> path = result.to_csv(pathlib.Path(tempfile.mkdtemp()) / "sweep.csv")
            >>> path.read_text().split(",")[:2]
            ['crank_length [m]', 'status']
        """
        return write_csv(self, arguments.path("path", path, "the path of a file"))

    def as_dict(self) -> dict[str, Any]:
        """Axes, units and designs as data for JSON.

        Returns:
            Each design with its values, status, reason and measures.

        Example:
            >>> import bellcrank as bc
            >>> list(bc.sweep("four_bar", {"crank_length": [1.22, 1.24]}).as_dict())
            ['scene', 'source', 'complete', 'axes', 'units', 'notes', 'designs']
        """
        return sweep_data(self)

    def _rows(self) -> list[Sequence[object]]:
        return design_rows(self)

    def to_parquet(self, path: str | Path) -> Path:
        """Write one row a design as an Apache Parquet file, with the columns of `to_csv`: for very many designs.

        Args:
            path: The file, which is replaced in one step.

        Returns:
            The path of the file. Values that are not finite are null. The metadata of its schema hold, under the key
            "bellcrank", a JSON text with the scene, the axes, the sample with its seed, and the units.

        Raises:
            InputError: The package pyarrow is not installed, or the file cannot be written.

        Example:
            >>> import bellcrank as bc, pathlib, tempfile
            >>> result = bc.sweep("four_bar", {"crank_length": [1.22, 1.24]})
            >>> path = result.to_parquet(pathlib.Path(tempfile.mkdtemp()) / "sweep.parquet")
            >>> import pyarrow.parquet
            >>> pyarrow.parquet.read_table(path).column_names[:3]
            ['design', 'crank_length [m]', 'status']
        """
        return write_parquet(self, arguments.path("path", path, "the path of a file"))

    def to_npz(self, path: str | Path) -> Path:
        """Write the columns as NumPy arrays, for very many designs where pyarrow is not installed.

        Args:
            path: The file, which is replaced in one step.

        Returns:
            The path of the file: arrays by the names of the columns of `to_csv`, NaN where not finite; "status" and
            "reason" number the texts "statuses" and "reasons"; "about" is the JSON text of `to_parquet`.

        Raises:
            InputError: The file cannot be written.

        Example:
            >>> import bellcrank as bc, numpy as np, pathlib, tempfile
            >>> result = bc.sweep("four_bar", {"crank_length": [1.22, 1.24]})
            >>> with np.load(result.to_npz(pathlib.Path(tempfile.mkdtemp()) / "sweep.npz")) as file:
            ...     file["crank_length [m]"]
            array([1.22, 1.24])
        """
        return write_npz(self, arguments.path("path", path, "the path of a file"))

    def plot(self, path: str | Path | None = None, measures: Sequence[str] | None = None) -> Figure:
        """Draw measures: as lines or maps over a grid; of a sample as histograms, and against each parameter.

        Args:
            path: Where the picture is written, in the format of its suffix (PNG without one); None: nowhere.
            measures: Names of measures; by default `default_measures`.

        Returns:
            A matplotlib figure.

        Raises:
            InputError: A measure is unknown, or the file cannot be written.

        Example:
            >>> import bellcrank as bc
            >>> result = bc.sweep("four_bar", {"crank_length": [1.22, 1.24]})
            >>> len(result.plot(measures=["lock.time", "lock.crank"]).axes)
            2
        """
        return plot_sweep(self, self._measures(measures), None if path is None else arguments.path("path", path))

    def _measures(self, given: object) -> tuple[str, ...]:
        if given is None:
            return self.default_measures
        listed = arguments.several("measures", given, str, "names of measures", alone=True)
        if not listed:
            arguments.refuse("measures", "at least one name of a measure", given)
        return listed
