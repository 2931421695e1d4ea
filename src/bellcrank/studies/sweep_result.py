"""The result of a sweep: one row a design, with its measures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.cached_values import Portable, cached_property
from bellcrank.deprecated import Renamed
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.scene.scene import Scene
from bellcrank.studies.axes import Axis
from bellcrank.studies.measures import target_events

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
INFEASIBLE = "infeasible"  # the design cannot be built
UNKNOWN = "unknown"  # its run finished, but a measure of it is not a finite number


@dataclass(frozen=True)
class Design:
    """One row of a sweep.

    Attributes:
        index: Its number in the grid.
        status: The status of its run, "infeasible" where it cannot be built, or "unknown" where a measure is not a
            finite number.
        reason: Why it did not reach its target; empty where it did.
        measures: Its measures by name.
    """

    index: int
    status: str
    reason: str
    measures: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Sweep(Portable, Renamed):
    """The result of `sweep`: designs over the grid of all combinations of values, the last axis fastest.

    Attributes:
        scene: The scene that was varied.
        axes: The parameters that were varied, with their values.
        designs: The designs that were run, in the order of the grid: all, unless the sweep was interrupted.
        units: The measures by name, with their SI units.

    Example:
        >>> import bellcrank as bc
        >>> bc.sweep("four_bar", {"crank_length": [1.22, 1.23, 1.24]})
        Sweep('Deployable four-bar' over crank_length: 3 designs, 3 finished)
    """

    renamed: ClassVar[Mapping[str, str]] = {"telling": "default_measures"}

    scene: Scene
    axes: tuple[Axis, ...]
    designs: tuple[Design, ...]
    units: Mapping[str, str] = field(repr=False)

    def __repr__(self) -> str:
        finished = sum(not design.reason for design in self.designs)
        axes = ", ".join(axis.path for axis in self.axes)
        return f"Sweep('{self.scene.name}' over {axes}: {len(self.designs)} designs, {finished} finished)"

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of values along each axis."""
        return tuple(len(axis) for axis in self.axes)

    @property
    def complete(self) -> bool:
        """Whether every design of the grid was run."""
        return len(self.designs) == math.prod(self.shape)

    @cached_property
    def values(self) -> Array:
        """The values (designs, axes) of the axes, in their units."""
        place = np.unravel_index(np.array([design.index for design in self.designs], dtype=np.intp), self.shape)
        return np.column_stack([axis.numbers[k] for axis, k in zip(self.axes, place, strict=True)])

    def column(self, measure: str) -> Array:
        """Get a measure of each design.

        Args:
            measure: The name of a measure, one of `units`.

        Returns:
            Values (designs,) in SI units; NaN where a design does not have it.

        Raises:
            InputError: There is no such measure; the message lists the names.

        Example:
            >>> import bellcrank as bc
            >>> bc.sweep("four_bar", {"crank_length": [1.22, 1.24]}).column("lock.time").round(3)
            array([18.559, 12.109])
        """
        if arguments.text("measure", measure, "the name of a measure") not in self.units:
            raise InputError(f"sweep of {self.scene.name}: {unknown_name('measure', measure, self.units)}")
        return np.array([design.measures.get(measure, math.nan) for design in self.designs])

    def grid(self, measure: str) -> Array:
        """Get a measure over the grid.

        Args:
            measure: The name of a measure, one of `units`.

        Returns:
            Values in the shape of the grid, one dimension an axis; NaN where a design was not run.

        Raises:
            InputError: There is no such measure; the message lists the names.

        Example:
            >>> import bellcrank as bc
            >>> vary = {"crank_length": [1.22, 1.24], "rocker_length": [1.2, 1.21, 1.22]}
            >>> bc.sweep("four_bar", vary).grid("lock.time").shape
            (2, 3)
        """
        column = self.column(measure)
        table = np.full(math.prod(self.shape), math.nan)
        table[[design.index for design in self.designs]] = column
        return table.reshape(self.shape)

    @property
    def default_measures(self) -> tuple[str, ...]:
        """The measures that tables and plots show: of events that end a run, else of all events, else of the end."""
        events = target_events(self.scene) or [event.name for event in self.scene.events]
        prefixes = tuple(f"{name}." for name in events) or ("end.",)
        found = [name for name in self.units if name.startswith(prefixes)]
        chosen = tuple(name for name in found if not name.endswith(".velocity") and ".force." not in name)
        return chosen or tuple(name for name in ("end.time",) if name in self.units)

    def table(self, measures: Sequence[str] | None = None) -> str:
        """Format the designs as text.

        Args:
            measures: Names of measures; by default `default_measures`.

        Returns:
            One line a design: axes, measures, status and reason, with units in the header.

        Raises:
            InputError: A measure is unknown.

        Example:
            >>> import bellcrank as bc
            >>> print(bc.sweep("four_bar", {"crank_length": [1.22, 1.24]}).table(["lock.time"]).splitlines()[0])
            crank_length [m]  lock.time [s]  status  reason
        """
        from bellcrank.studies.sweep_tables import text_table

        return text_table(self, self._measures(measures))

    def to_csv(self, path: str | Path) -> Path:
        """Write one row a design as CSV: axes, status, every measure, reason.

        Args:
            path: The file, which is replaced in one step.

        Returns:
            The path of the file. The header names units.

        Raises:
            InputError: The file cannot be written.

        Example:
            >>> import bellcrank as bc, pathlib, tempfile
            >>> result = bc.sweep("four_bar", {"crank_length": [1.22, 1.24]})
            >>> path = result.to_csv(pathlib.Path(tempfile.mkdtemp()) / "sweep.csv")
            >>> path.read_text().split(",")[:2]
            ['crank_length [m]', 'status']
        """
        from bellcrank.studies.sweep_tables import write_csv

        return write_csv(self, arguments.path("path", path, "the path of a file"))

    def to_json(self, path: str | Path) -> Path:
        """Write axes, units and designs as JSON.

        Args:
            path: The file, which is replaced in one step.

        Returns:
            The path of the file. Numbers that are not finite are null.

        Raises:
            InputError: The file cannot be written.

        Example:
            >>> import bellcrank as bc, json, pathlib, tempfile
            >>> result = bc.sweep("four_bar", {"crank_length": [1.22, 1.24]})
            >>> path = result.to_json(pathlib.Path(tempfile.mkdtemp()) / "sweep.json")
            >>> list(json.loads(path.read_text()))
            ['scene', 'source', 'complete', 'axes', 'units', 'designs']
        """
        from bellcrank.studies.sweep_tables import write_json

        return write_json(self, arguments.path("path", path, "the path of a file"))

    def plot(self, path: str | Path | None = None, measures: Sequence[str] | None = None) -> Figure:
        """Draw one panel a measure: a line over one axis, a map over two.

        Args:
            path: Where the picture is written (PNG); None: nowhere.
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
        from bellcrank.studies.sweep_plot import plot_sweep

        return plot_sweep(self, self._measures(measures), None if path is None else arguments.path("path", path))

    def _measures(self, given: object) -> tuple[str, ...]:
        if given is None:
            return self.default_measures
        listed = arguments.several("measures", given, str, "names of measures", alone=True)
        if not listed:
            arguments.refuse("measures", "at least one name of a measure", given)
        return listed
