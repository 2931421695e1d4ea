"""The statistics of a study whose designs are a sample: distributions of measures and probabilities of limits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank.cached_values import Portable
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.notes import Note, ranked
from bellcrank.present.results import Result
from bellcrank.present.tables import ruled
from bellcrank.studies.designs.samples import Sample
from bellcrank.studies.results.exceedance import Exceedance, exceedance, parse_limit
from bellcrank.studies.results.intervals import SampleLayout
from bellcrank.studies.results.study_columns import StudyColumns
from bellcrank.studies.results.tolerance import LEVELS, Estimate, MeasureDistribution, measure_distribution

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLE_LEVELS = (0.05, 0.5, 0.95)


@dataclass(frozen=True, eq=False, kw_only=True)
class SampleStatistics(Portable, Result):
    """The distribution of each measure over the designs of a sample, and probabilities that limits are exceeded.

    Attributes:
        title: What was studied.
        units: The unit of each measure by name.
        columns: The measures of the designs.
        layout: How the designs depend on each other.
        candidates: The measures that are shown by default if they vary.
        noise: Differences of a measure up to absolute + relative × magnitude are errors of the computation.
        file_notes: The notes of the designs' scene.
    """

    title: str
    units: Mapping[str, str]
    columns: StudyColumns
    layout: SampleLayout
    candidates: tuple[str, ...] = ()
    noise: tuple[float, float] = (0.0, 1e-12)
    file_notes: tuple[Note, ...] = ()

    def distribution(self, measure: str, levels: Sequence[float] = LEVELS) -> MeasureDistribution:
        """Estimate how a measure is distributed.

        Args:
            measure: The name of a measure, one of `units`.
            levels: The levels of the quantiles, between 0 and 1.

        Returns:
            Mean, standard deviation and quantiles with 95 % confidence intervals, over the designs that have the
            measure; the number of the others.

        Raises:
            InputError: There is no such measure, or a level is not between 0 and 1.

        Example:
            >>> import bellcrank as bc
            >>> vary = {"crank_length": "normal(1.24 m, 1 mm)"}
            >>> found = bc.sobol_indices("four_bar", vary, n=2).statistics.distribution("lock.time")
            >>> found.unit, found.count
            ('s', 64)
        """
        self._check(measure)
        given = arguments.array("levels", levels, (None,)).tolist()
        for level in given:
            arguments.number("levels", level, least=0.0, most=1.0)
        return measure_distribution(self.columns, measure, self.units[measure], self.layout, given)

    def exceedance(self, limit: str) -> Exceedance:
        """Estimate the probability that a limit is exceeded.

        Args:
            limit: A measure, ">" or "<", and a value, such as "lock.time > 13 s": where that holds it is exceeded.

        Returns:
            The probability with its 95 % confidence interval, and what designs without the measure leave open.

        Raises:
            InputError: The text is not a limit of a measure.

        Example:
            >>> import bellcrank as bc
            >>> vary = {"crank_length": "normal(1.24 m, 1 mm)"}
            >>> found = bc.sobol_indices("four_bar", vary, n=2).statistics.exceedance("lock.time > 1 min")
            >>> found.probability
            0.0
        """
        text = arguments.text("limit", limit, "a limit such as 'lock.time > 13 s'")
        return exceedance(self.columns, parse_limit(text, self.units, "limit"), self.layout)

    @property
    def default_measures(self) -> tuple[str, ...]:
        """The candidates that vary beyond numerical errors; all measures that do where there are no candidates."""
        return tuple(name for name in self.candidates or self.units if self._varies(name))

    def table(self, measures: Sequence[str] | None = None) -> str:
        """Write mean, standard deviation and quantiles of measures as text, with their 95 % intervals.

        Args:
            measures: Names of measures; by default `default_measures`.

        Returns:
            One line a measure.

        Raises:
            InputError: A measure is unknown.

        Example:
            >>> import bellcrank as bc
            >>> found = bc.sobol_indices("four_bar", {"crank_length": "normal(1.24 m, 1 mm)"}, n=2)
            >>> print(found.statistics.table(["lock.time"]).splitlines()[0].split("  ")[0])
            measure
        """
        head = ["measure", "unit", "mean", "standard deviation", *(f"{level:.0%}" for level in TABLE_LEVELS), "designs"]
        lines = [head]
        for name in self._measures(measures):
            one = self.distribution(name, TABLE_LEVELS)
            cells = [str(each) for each in (one.mean, one.deviation, *one.quantiles.values())]
            absent = sum(one.missing.values())
            lines.append([name, one.unit, *cells, f"{one.count}{f' ({absent} without)' if absent else ''}"])
        return "\n".join(ruled(lines))

    @property
    def notes(self) -> tuple[Note, ...]:
        """The notes of the designs' scene, and the measures that not all designs have."""
        missing = {name: sum(self.distribution(name, ()).missing.values()) for name in self.default_measures}
        absent = (f"{name}: {count} designs do not have it" for name, count in missing.items() if count)
        return ranked([*self.file_notes, *absent])

    def as_dict(self) -> dict[str, Any]:
        """The distributions of all measures as data for JSON.

        Returns:
            Each measure with its unit, its estimates with 95 % intervals, and the designs that have it.

        Example:
            >>> import bellcrank as bc
            >>> found = bc.sobol_indices("four_bar", {"crank_length": "normal(1.24 m, 1 mm)"}, n=2)
            >>> found.statistics.as_dict()["measures"]["lock.time"]["unit"]
            's'
        """
        measures = {}
        for name in self.units:
            one = self.distribution(name, TABLE_LEVELS)
            estimates = self._estimates(one)
            measures[name] = {"unit": one.unit, "designs": one.count, "missing": dict(one.missing)} | {
                title: {"value": each.value, "low": each.interval[0], "high": each.interval[1]}
                for title, each in estimates.items()
            }
        return {"title": self.title, "measures": measures, "notes": [note.as_dict() for note in self.notes]}

    def _rows(self) -> list[Sequence[object]]:
        rows: list[Sequence[object]] = []
        for name in self.units:
            one = self.distribution(name, TABLE_LEVELS)
            estimates = self._estimates(one)
            if not rows:
                titles = (f"{title}{part}" for title in estimates for part in ("", " from", " to"))
                rows.append(["measure", "unit", "designs", *titles])
            numbers = [number for each in estimates.values() for number in (each.value, *each.interval)]
            rows.append([name, one.unit, one.count, *(x if math.isfinite(x) else "" for x in numbers)])
        return rows

    @staticmethod
    def _estimates(one: MeasureDistribution) -> dict[str, Estimate]:
        levels = {f"{level:.0%}": each for level, each in one.quantiles.items()}
        return {"mean": one.mean, "standard deviation": one.deviation, **levels}

    def plot(
        self, path: str | Path | None = None, measures: Sequence[str] | None = None, limits: Sequence[str] = ()
    ) -> Figure:
        """Draw a histogram of each measure, with limits and the probability that they are exceeded.

        Args:
            path: Where the picture is written, in the format of its suffix (PNG without one); None: nowhere.
            measures: Names of measures; by default those with limits, else `default_measures`.
            limits: Limits such as "lock.time > 13 s".

        Returns:
            A matplotlib figure.

        Raises:
            InputError: A measure is unknown, a text is not a limit, or the file cannot be written.

        Example:
            >>> import bellcrank as bc
            >>> found = bc.sobol_indices("four_bar", {"crank_length": "normal(1.24 m, 1 mm)"}, n=2)
            >>> len(found.statistics.plot(limits=["lock.time > 13 s"]).axes)
            1
        """
        from bellcrank.studies.results.statistics_plots import plot_distributions

        listed = arguments.several("limits", limits, str, "limits", alone=True)
        found = [self.exceedance(limit) for limit in listed]
        limited = tuple(dict.fromkeys(each.limit.measure for each in found))
        names = self._measures(measures if measures is not None else limited or None)
        shown = [(self.distribution(name), self.columns.measures[name]) for name in names]
        target = None if path is None else arguments.path("path", path, "the path of a picture")
        return plot_distributions(shown, found, f"{self.title}: {self.layout.rows} designs", target)

    def _varies(self, measure: str) -> bool:
        values = self.columns.measures[measure]
        known = values[np.isfinite(values)]
        absolute, relative = self.noise
        return bool(len(known)) and bool(np.ptp(known) > absolute + relative * np.abs(known).max())

    def _check(self, measure: object) -> None:
        if arguments.text("measure", measure, "the name of a measure") not in self.units:
            raise InputError(f"{self.title}: {unknown_name('measure', str(measure), self.units)}")

    def _measures(self, given: Sequence[str] | None) -> tuple[str, ...]:
        if given is None:
            return self.default_measures
        names = arguments.several("measures", given, str, "names of measures", alone=True)
        for name in names:
            self._check(name)
        return names


def sample_layout(sample: Sample, dimensions: int) -> SampleLayout:
    """How the points of a sample depend on each other.

    Raises:
        InputError: The sample is one scrambling, or one Latin hypercube, whose error is unknown.
    """
    if sample.method == "random":
        return SampleLayout.random(sample.count)
    if sample.method == "latin":
        return SampleLayout.latin_hypercube(sample.count, sample.replicates)
    return SampleLayout.sobol(sample.count, sample.replicates, dimensions)
