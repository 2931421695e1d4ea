"""The result of `sobol_indices`: which parameters the spread of each measure comes from.

With independent parameters x, measure f and its variance V, the first-order index of x_i is V[E(f | x_i)] / V, the part
that knowing x_i removes, and the total index is E[V(f | all but x_i)] / V, what is left when all others are known: with
all interactions of x_i. Estimated from blocks A, B, A_B(i) (designs/samples.py):

    first order  small: mean of f(B) (f(A_B(i)) - f(A)), A. Saltelli et al., Comput. Phys. Commun. 181 (2010)
                 259-270, table 2b
                 large: V less half the mean of (f(B) - f(A_B(i)))², M. J. W. Jansen, Comput. Phys. Commun. 117 (1999)
                 35-43
    total        small: half the mean of (f(A) - f(A_B(i)))², Jansen (1999)
                 large: V less the mean of f(A) (f(A_B(i)) - f(B)), the first-order part of all others by (2b), since
                 A_B(i) is B with all other columns of A

`scipy.stats.sobol_indices` has no designs that fail, and its errors are those of a bootstrap of one scrambling.

The errors of the small ones vanish as the index goes to 0, those of the large ones as it goes to 1. f is centred by its
mean first, which does not change the indices and lessens the error. Independent scramblings of the points give the
errors (A. B. Owen, Monte Carlo theory, methods and examples (2013), chapter 17).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array, Mask
from bellcrank.cached_values import Portable, cached_property
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.notes import Note, ranked
from bellcrank.present.results import JsonLayout, Result
from bellcrank.present.tables import ruled
from bellcrank.studies.designs.axes import StudyAxis
from bellcrank.studies.designs.samples import SensitivitySample
from bellcrank.studies.results.exceedance import missing_by_status
from bellcrank.studies.results.intervals import ratio_interval
from bellcrank.studies.results.sample_statistics import SampleStatistics
from bellcrank.studies.results.study_columns import StudyColumns
from bellcrank.studies.results.tolerance import Estimate

if TYPE_CHECKING:
    from matplotlib.figure import Figure


ROUND_OFF = 1e-12  # a standard deviation below this part of the mean says nothing about parameters
LARGE = 0.5  # an index beyond it is estimated by what it lacks to 1
HEAD = (
    "measure",
    "parameter",
    "first order",
    "first order low",
    "first order high",
    "total",
    "total low",
    "total high",
)


@dataclass(frozen=True, kw_only=True)
class SobolIndices:
    """Sobol indices of one measure.

    Attributes:
        measure: The name of the measure.
        parameters: The parameters that vary.
        first: The first-order index of each, with its 95 % confidence interval; NaN where the measure does not vary.
        total: The total index of each. Estimates of an index near 0 or 1 may lie outside 0 to 1 by their error.
        blocks: The number of blocks that the estimates use.
        left_out: The number of blocks that were left out, because a design of theirs does not have the measure. With
            some left out, the indices are those of the parameters where the measure exists, and are not exact, because
            the parameters are not independent there.
        missing: The number of designs without the measure by the status of their run.
    """

    measure: str
    parameters: tuple[str, ...]
    first: tuple[Estimate, ...]
    total: tuple[Estimate, ...]
    blocks: int
    left_out: int
    missing: Mapping[str, int] = field(default_factory=dict)

    @property
    def varies(self) -> bool:
        """Whether the measure varies beyond rounding errors, so that it has indices."""
        return bool(np.isfinite(self.first[0].value))


def measure_indices(
    columns: StudyColumns, measure: str, parameters: Sequence[str], sample: SensitivitySample
) -> SobolIndices:
    """Estimate the Sobol indices of a measure.

    Args:
        columns: The measures of all designs of the sample, in its order.
        measure: The name of one.
        parameters: The names of the parameters that vary, in the order of the sample's dimensions.
        sample: The points of the designs.

    Returns:
        The indices with their 95 % confidence intervals.
    """
    values = columns.measures[measure]
    there = np.isfinite(values)
    blocks = values.reshape(sample.replicates, sample.size, sample.block)
    whole: Mask = np.all(there.reshape(blocks.shape), axis=2)
    first, total = block_indices(blocks, whole)
    return SobolIndices(
        measure=measure,
        parameters=tuple(parameters),
        first=first,
        total=total,
        blocks=int(whole.sum()),
        left_out=int((~whole).sum()),
        missing=missing_by_status(columns, there),
    )


def block_indices(blocks: Array, whole: Mask) -> tuple[tuple[Estimate, ...], tuple[Estimate, ...]]:
    """First-order and total indices with their intervals.

    Args:
        blocks: Outputs (replicates, blocks, d + 2) at A, B, A_B(1), …, A_B(d).
        whole: Which blocks (replicates, blocks) are used; the outputs of the others may be NaN.

    Returns:
        An estimate for each of the d parameters: ratios of sums over all replicates, with Student's t intervals of the
        replicates' deviations. NaN where the outputs do not vary beyond rounding errors.
    """
    number = blocks.shape[2] - 2
    used = blocks[whole]
    scale = float(np.abs(used).max(initial=0.0)) or 1.0  # so that squares neither overflow nor vanish
    centre = float((used[:, :2] / scale).mean()) if len(used) else 0.0
    centred = np.where(whole[:, :, None], blocks / scale - centre, 0.0)
    a, b, mixed = centred[:, :, 0], centred[:, :, 1], np.moveaxis(centred[:, :, 2:], 2, 0)
    variance = 0.5 * (a**2 + b**2).sum(axis=1)
    if not float(variance.sum()) > (ROUND_OFF * abs(centre)) ** 2 * max(len(used), 1):
        nothing = (Estimate(np.nan, (np.nan, np.nan)),) * number
        return nothing, nothing
    first, total = [], []
    for mix in mixed:
        own = _estimate((b * (mix - a)).sum(axis=1), variance)
        first.append(own if own.value <= LARGE else _estimate(variance - 0.5 * ((b - mix) ** 2).sum(axis=1), variance))
        whole_part = _estimate(0.5 * ((a - mix) ** 2).sum(axis=1), variance)
        large = whole_part.value > LARGE
        total.append(_estimate(variance - (a * (mix - b)).sum(axis=1), variance) if large else whole_part)
    return tuple(first), tuple(total)


def _estimate(part: Array, variance: Array) -> Estimate:
    value, half = ratio_interval(part, variance)
    return Estimate(value, (value - half, value + half))


@dataclass(frozen=True, eq=False, kw_only=True)
class Sensitivity(Portable, Result):
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
        file_notes: The notes of the designs' scene.

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
    file_notes: tuple[Note, ...] = ()
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
            file_notes=self.file_notes,
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
        lines = [["measure", "parameter", "first order", "total"]]
        names = self._measures(measures)
        for name in names:
            found = self.indices(name)
            for path, first, total in zip(found.parameters, found.first, found.total, strict=True):
                lines.append([name, path, index_text(first), index_text(total)])
        return "\n".join([*ruled(lines), *self._left_out(names)])

    @property
    def notes(self) -> tuple[Note, ...]:
        """The notes of the designs' scene, and the measures that not all designs have, with approximate indices."""
        return ranked([*self.file_notes, *self._left_out(self.statistics.default_measures)])

    def _left_out(self, measures: Sequence[str]) -> list[str]:
        return [left_out_text(found) for found in map(self.indices, measures) if found.left_out]

    def as_dict(self) -> dict[str, Any]:
        """The indices of all measures, the sample and the numbers of failed designs as data for JSON.

        Returns:
            The indices by measure, and what they were computed from.

        Example:
            >>> import bellcrank as bc
            >>> found = bc.sobol_indices("four_bar", {"crank_length": "normal(1.24 m, 1 mm)"}, n=2)
            >>> list(found.as_dict())
            ['title', 'sample', 'designs', 'parameters', 'units', 'indices', 'notes']
        """
        return {
            "title": self.title,
            "sample": {"n": self.sample.size, "replicates": self.sample.replicates, "seed": self.sample.seed},
            "designs": self.sample.count,
            "parameters": {axis.path: str(axis.distribution) for axis in self.axes},
            "units": dict(self.units),
            "indices": {name: _plain(self.indices(name)) for name in self.units},
            "notes": [note.as_dict() for note in self.notes],
        }

    def _rows(self) -> list[Sequence[object]]:
        rows: list[Sequence[object]] = [HEAD]
        for name in self.units:
            found = self.indices(name)
            for parameter, first, total in zip(found.parameters, found.first, found.total, strict=True):
                numbers = [(each.value, *each.interval) for each in (first, total)]
                cells = [float(number) if math.isfinite(number) else "" for part in numbers for number in part]
                rows.append([name, parameter, *cells])
        return rows

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
