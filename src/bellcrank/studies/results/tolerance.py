"""The distribution of each measure over the designs of a sample: mean, standard deviation, quantiles, histogram."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from bellcrank.arrays import Array
from bellcrank.studies.results.exceedance import missing_by_status
from bellcrank.studies.results.intervals import Interval, SampleLayout, quantile, ratio_interval
from bellcrank.studies.results.study_columns import StudyColumns

LEVELS = (0.01, 0.05, 0.5, 0.95, 0.99)
MOST_BINS = 60


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % confidence interval; an end that the sample does not reach is infinite."""

    value: float
    interval: Interval

    @property
    def half_width(self) -> float:
        """Half the width of the interval."""
        return 0.5 * (self.interval[1] - self.interval[0])

    def __str__(self) -> str:
        """The number with as many digits as its interval deserves; with ± where this is symmetric."""
        (low, high), half = self.interval, self.half_width
        if not math.isfinite(self.value):
            return "-"
        if math.isfinite(half) and abs((high - self.value) - (self.value - low)) <= 1e-6 * half:
            return f"{figure(self.value, half)} ± {half:.2g}"
        return f"{figure(self.value, half)} ({figure(low, half)} to {figure(high, half)})"


@dataclass(frozen=True, kw_only=True)
class MeasureDistribution:
    """How a measure is distributed over the designs that have it.

    Attributes:
        measure: The name of the measure.
        unit: Its unit.
        count: The number of designs that have it.
        missing: The number of the others by the status of their run.
        least: The least value; NaN where no design has the measure, as all that follows.
        largest: The largest value.
        mean: The mean.
        deviation: The standard deviation.
        quantiles: The quantiles by their level.
    """

    measure: str
    unit: str
    count: int
    missing: Mapping[str, int] = field(default_factory=dict)
    least: float
    largest: float
    mean: Estimate
    deviation: Estimate
    quantiles: Mapping[float, Estimate]


def figure(value: float, error: float) -> str:
    """A number with two digits more than its error leaves certain, at least four and at most twelve."""
    if not math.isfinite(value):
        return "unknown"
    certain = math.log10(abs(value) / error) if value and error > 0.0 and math.isfinite(error) else 4.0
    return f"{value:#.{min(max(math.ceil(certain) + 1, 4), 12)}g}".rstrip(".")


def measure_distribution(
    columns: StudyColumns, measure: str, unit: str, layout: SampleLayout, levels: Sequence[float] = LEVELS
) -> MeasureDistribution:
    """How a measure is distributed, estimated from the designs of a sample.

    The interval of the standard deviation is the root of that of the mean squared deviation, which does not take the
    measure for normally distributed.

    Args:
        columns: The measures of the designs.
        measure: The name of one.
        unit: Its unit.
        layout: How the designs depend on each other.
        levels: Levels of the quantiles, between 0 and 1.

    Returns:
        Mean, standard deviation and quantiles with their intervals.
    """
    values = columns.measures[measure]
    there = np.isfinite(values)
    known = values[there]
    among = layout.sums(there)
    # Around a value of the sample, so that the squares of a measure with a large mean keep their digits.
    origin = float(np.median(known)) if len(known) else np.nan
    offset = np.where(there, values - origin, 0.0)
    shift, half = ratio_interval(layout.sums(offset), among)
    mean = origin + shift
    squared = np.where(there, (offset - shift) ** 2, 0.0)
    bias = len(known) / (len(known) - 1) if len(known) > 1 else np.nan
    variance, spread = (bias * part for part in ratio_interval(layout.sums(squared), among))
    low, high = np.sqrt(np.maximum([variance - spread, variance + spread], 0.0)).tolist()
    return MeasureDistribution(
        measure=measure,
        unit=unit,
        count=len(known),
        missing=missing_by_status(columns, there),
        least=float(known.min()) if len(known) else np.nan,
        largest=float(known.max()) if len(known) else np.nan,
        mean=Estimate(mean, (mean - half, mean + half)),
        deviation=Estimate(float(np.sqrt(variance)), (low, high)),
        quantiles={level: Estimate(*quantile(values, level, layout)) for level in levels},
    )


def histogram(values: Array) -> tuple[Array, Array]:
    """The density (bins,) of finite values and the edges (bins + 1,) of its bins, at most `MOST_BINS`.

    The width is that of D. Freedman, P. Diaconis, Z. Wahrscheinlichkeitstheorie verw. Geb. 57 (1981) 453-476, over the
    range of the values.
    """
    known = values[np.isfinite(values)]
    if not len(known):
        return np.zeros(0), np.zeros(1)
    least, largest = float(known.min()), float(known.max())
    if not largest - least > 1e-12 * max(abs(least), abs(largest)):  # one value: one bin, as wide as a drawn line
        width = max(abs(least) * 1e-6, 1e-12)
        return np.array([1.0 / width]), np.array([least - 0.5 * width, least + 0.5 * width])
    low, high = np.quantile(known, [0.25, 0.75])
    width = 2.0 * (high - low) * len(known) ** (-1.0 / 3.0)
    bins = MOST_BINS if width <= 0.0 else int(np.clip(np.ceil((largest - least) / width), 1, MOST_BINS))
    density, edges = np.histogram(known, bins=bins, range=(least, largest), density=True)
    return density.astype(np.float64), edges
