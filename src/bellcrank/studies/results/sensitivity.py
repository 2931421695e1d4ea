"""The result of `sobol_indices`: which parameters the spread of each measure comes from."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from bellcrank import arguments
from bellcrank.cached_values import Portable, cached_property
from bellcrank.errors import InputError
from bellcrank.files.csv_files import csv_text
from bellcrank.files.results import JsonLayout, WithCsv, WithJson
from bellcrank.messages import unknown_name
from bellcrank.studies.designs.axes import StudyAxis
from bellcrank.studies.designs.sensitivity_sample import SensitivitySample
from bellcrank.studies.results.sample_statistics import SampleStatistics
from bellcrank.studies.results.sobol_indices import SobolIndices, measure_indices
from bellcrank.studies.results.study_columns import StudyColumns
from bellcrank.studies.results.tolerance import Estimate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEAD = ("measure", "parameter", "first order", "low", "high", "total", "low", "high")


@dataclass(frozen=True, eq=False, kw_only=True)
class Sensitivity(Portable, WithJson, WithCsv):
    """The result of `sobol_indices`.

    `to_csv` writes the indices of all measures, one row a measure and parameter, empty where it does not vary.

    Attributes:
        title: What was studied.
        axes: The parameters, with their distributions.
        units: The measures by name, with their SI units.
        columns: The measures of all designs of the sample.
        sample: The points of the designs.
        candidates: The measures that are shown by default if they vary.
        noise: Differences of a measure up to absolute + relative × magnitude are errors of the computation.

    Example:
        >>> import bellcrank as bc
        >>> bc.sobol_indices("four_bar", {"crank_length": "normal(1.24 m, 1 mm)"}, n=2)
        Sensitivity('Deployable four-bar' to crank_length: 96 designs)
    """

    title: str
    axes: tuple[StudyAxis, ...]
    units: Mapping[str, str]
    columns: StudyColumns
    sample: SensitivitySample
    candidates: tuple[str, ...] = ()
    noise: tuple[float, float] = (0.0, 1e-12)
    json_layout: ClassVar = JsonLayout(1)

    def __repr__(self) -> str:
        return f"Sensitivity('{self.title}' to {', '.join(self.parameters)}: {self.sample.count} designs)"

    @property
    def parameters(self) -> tuple[str, ...]:
        """The paths of the parameters."""
        return tuple(axis.path for axis in self.axes)

    @cached_property
    def statistics(self) -> SampleStatistics:
        """Distributions and probabilities over those designs that follow the distributions of the parameters."""
        return SampleStatistics(
            title=self.title,
            units=self.units,
            columns=self.columns.take(self.sample.sampled()),
            layout=self.sample.layout(),
            candidates=self.candidates,
            noise=self.noise,
        )

    def indices(self, measure: str) -> SobolIndices:
        """Estimate the Sobol indices of a measure.

        Args:
            measure: The name of a measure, one of `units`.

        Returns:
            First-order and total index of each parameter with 95 % confidence intervals.

        Raises:
            InputError: There is no such measure.

        Example:
            >>> import bellcrank as bc
            >>> vary = {"crank_length": "normal(1.235 m, 2 mm)", "coupler_length": "normal(1.2 m, 0.1 mm)"}
            >>> found = bc.sobol_indices("four_bar", vary, n=4).indices("lock.crank")
            >>> found.total[0].value > 10.0 * found.total[1].value
            True
        """
        if arguments.text("measure", measure, "the name of a measure") not in self.units:
            raise InputError(f"{self.title}: {unknown_name('measure', measure, self.units)}")
        return measure_indices(self.columns, measure, self.parameters, self.sample)

    def table(self, measures: Sequence[str] | None = None) -> str:
        """Write the indices of measures as text.

        Args:
            measures: Names of measures; by default `statistics.default_measures`.

        Returns:
            One line a measure and parameter, and a line about designs that were left out.

        Raises:
            InputError: A measure is unknown.

        Example:
            >>> import bellcrank as bc
            >>> found = bc.sobol_indices("four_bar", {"crank_length": "normal(1.24 m, 1 mm)"}, n=2)
            >>> print(found.table(["lock.crank"]).splitlines()[2].split()[:2])
            ['lock.crank', 'crank_length']
        """
        lines, notes = [["measure", "parameter", "first order", "total"]], []
        for name in self._measures(measures):
            found = self.indices(name)
            for path, first, total in zip(found.parameters, found.first, found.total, strict=True):
                lines.append([name, path, index_text(first), index_text(total)])
            if found.left_out:
                notes.append(left_out_text(found))
        widths = [max(len(line[k]) for line in lines) for k in range(4)]
        rows = [
            "  ".join(f"{cell:<{width}}" for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines
        ]
        return "\n".join([rows[0], "-" * (sum(widths) + 6), *rows[1:], *notes])

    def as_dict(self) -> dict[str, Any]:
        """The indices of all measures, the sample and the numbers of failed designs as data for JSON.

        Returns:
            The indices by measure, and what they were computed from.

        Example:
            >>> import bellcrank as bc
            >>> found = bc.sobol_indices("four_bar", {"crank_length": "normal(1.24 m, 1 mm)"}, n=2)
            >>> list(found.as_dict())
            ['title', 'sample', 'designs', 'parameters', 'units', 'indices']
        """
        return {
            "title": self.title,
            "sample": {"n": self.sample.size, "replicates": self.sample.replicates, "seed": self.sample.seed},
            "designs": self.sample.count,
            "parameters": {axis.path: str(axis.distribution) for axis in self.axes},
            "units": dict(self.units),
            "indices": {name: _plain(self.indices(name)) for name in self.units},
        }

    def _csv_text(self) -> str:
        rows: list[Sequence[object]] = [HEAD]
        for name in self.units:
            found = self.indices(name)
            for parameter, first, total in zip(found.parameters, found.first, found.total, strict=True):
                numbers = [(each.value, *each.interval) for each in (first, total)]
                cells = [float(number) if math.isfinite(number) else "" for part in numbers for number in part]
                rows.append([name, parameter, *cells])
        return csv_text(rows)

    def plot(self, path: str | Path | None = None, measures: Sequence[str] | None = None) -> Figure:
        """Draw the indices as bars with their intervals, the most influential parameter on top.

        Args:
            path: Where the picture is written, in the format of its suffix (PNG without one); None: nowhere.
            measures: Names of measures; by default `statistics.default_measures`.

        Returns:
            A matplotlib figure.

        Raises:
            InputError: A measure is unknown, or the file cannot be written.

        Example:
            >>> import bellcrank as bc
            >>> found = bc.sobol_indices("four_bar", {"crank_length": "normal(1.24 m, 1 mm)"}, n=2)
            >>> len(found.plot(measures=["lock.crank"]).axes)
            1
        """
        from bellcrank.studies.results.statistics_plots import plot_indices

        shown = [self.indices(name) for name in self._measures(measures)]
        return plot_indices(
            shown, f"{self.title}: Sobol indices from {self.sample.count} designs", arguments.picture(path)
        )

    def _measures(self, given: Sequence[str] | None) -> tuple[str, ...]:
        if given is None:
            return self.statistics.default_measures
        return arguments.several("measures", given, str, "names of measures", alone=True)


def index_text(each: Estimate) -> str:
    """An index with half the width of its interval, to the digit of its error."""
    if not math.isfinite(each.value):
        return "does not vary"
    half = each.half_width
    decimals = 3 if half <= 0.0 else min(max(1 - math.floor(math.log10(half)), 2), 9)
    return f"{each.value:.{decimals}f} ± {half:.2g}"


def left_out_text(found: SobolIndices) -> str:
    """What is to be said of designs that do not have the measure."""
    missing = ", ".join(f"{count} {status}" for status, count in found.missing.items())
    share = found.left_out / (found.left_out + found.blocks)
    return (
        f"{found.measure}: {found.left_out} of {found.left_out + found.blocks} blocks of designs ({share:.2g} of them) "
        f"are left out, because designs do not have the measure ({missing}); the indices are approximate, because the "
        "parameters of the other designs are not independent"
    )


def _plain(found: SobolIndices) -> dict[str, Any]:
    def numbers(each: Estimate) -> dict[str, float | None]:
        names = zip(("value", "low", "high"), (each.value, *each.interval), strict=True)
        return {name: number if math.isfinite(number) else None for name, number in names}

    return {
        "first": {path: numbers(each) for path, each in zip(found.parameters, found.first, strict=True)},
        "total": {path: numbers(each) for path, each in zip(found.parameters, found.total, strict=True)},
        "blocks": found.blocks,
        "left_out": found.left_out,
        "missing": dict(found.missing),
    }
