"""95 % confidence intervals of what a sample of designs estimates.

Designs that are drawn independently are their own replicates. Points of one Latin hypercube or one scrambled Sobol
sequence depend on each other, so that their spread says nothing about the error; there the sample consists of at least
10 replicates, scrambled independently, and the spread of the replicates gives the error (A. B. Owen, Monte Carlo
theory, methods and examples (2013), chapter 17). No interval assumes that the measures are normally distributed.
`scipy.stats.bootstrap` draws single points again, as if they were independent, so that it is not used.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bellcrank.arrays import Array, Mask
from bellcrank.errors import InputError

Interval = tuple[float, float]
CONFIDENCE = 0.95
TAIL = 0.5 * (1.0 - CONFIDENCE)  # on each side
LEAST_REPLICATES = 10


@dataclass(frozen=True)
class SampleLayout:
    """How the rows of a sample depend on each other.

    Attributes:
        rows: The number of designs.
        replicates: Independent parts of equal size, which follow one another; as many as rows for independent designs.
        gain: How many times larger the variance of a mean over a replicate can be than that of as many independent
            designs, for any function.
    """

    rows: int
    replicates: int
    gain: float = 1.0

    def __post_init__(self) -> None:
        if self.replicates < 1 or self.rows % self.replicates:
            raise ValueError(f"{self.rows} rows cannot be {self.replicates} replicates of equal size")
        if not self.independent and self.replicates < LEAST_REPLICATES:
            raise InputError(
                f"a confidence interval needs at least {LEAST_REPLICATES} replicates that are scrambled independently, "
                f"found {self.replicates}; draw more, or draw independent designs (method random)"
            )

    @classmethod
    def random(cls, rows: int) -> SampleLayout:
        """Designs that are drawn independently."""
        return cls(rows, rows)

    @classmethod
    def latin_hypercube(cls, rows: int, replicates: int) -> SampleLayout:
        """Latin hypercubes of n designs: the variance is at most n / (n - 1) times that of independent designs.

        Owen (2013), proposition 10.4.
        """
        size = rows // replicates
        return cls(rows, replicates, size / (size - 1) if size > 1 else 1.0)

    @classmethod
    def sobol(cls, rows: int, replicates: int, dimension: int) -> SampleLayout:
        """Scrambled Sobol sequences of 2^m designs: the gain is at most 2^(t + d - 1) for d parameters.

        Of another number of designs no bound is known, so that only the number of replicates counts for rare events.
        Z. Pan, A. B. Owen, The nonzero gain coefficients of Sobol's sequences are always powers of two, J. Complexity
        75 (2023) 101700. Random linear scrambling, as SciPy's, has the variance of Owen's nested scrambling (A. B.
        Owen, Variance with alternative scramblings of digital nets, ACM TOMACS 13 (2003) 363-378).
        """
        size = rows // replicates
        balanced = size & (size - 1) == 0
        return cls(
            rows, replicates, 2.0 ** min(_sobol_quality(dimension) + dimension - 1, 1000) if balanced else math.inf
        )

    @property
    def independent(self) -> bool:
        """Whether each design is drawn independently of all others."""
        return self.replicates == self.rows

    @property
    def method(self) -> str:
        """The method behind the intervals of probabilities, in words."""
        if self.independent:
            return f"Clopper-Pearson, {self.rows} independent designs"
        return f"Student's t over {self.replicates} independent replicates of {self.rows // self.replicates} designs"

    def sums(self, values: NDArray[np.generic]) -> Array:
        """The sums (replicates,) of values (rows,) over each replicate."""
        return np.asarray(np.asarray(values, dtype=np.float64).reshape(self.replicates, -1).sum(axis=1))


def ratio_interval(upper: Array, lower: Array) -> tuple[float, float]:
    """The estimate Σ upper / Σ lower from replicates (n,), and half the width of its interval.

    Linearised ratio of means with Student's t (W. G. Cochran, Sampling Techniques, 3rd ed. (1977), section 6.4). With
    lower = 1 it is the mean with its usual interval. The width of a single replicate is infinite.
    """
    count, total = len(upper), float(lower.sum())
    if total == 0.0:
        return math.nan, math.nan
    estimate = float(upper.sum()) / total
    if count < 2:
        return estimate, math.inf
    deviation = (upper - estimate * lower) * (count / total)
    return estimate, student(count - 1) * math.sqrt(float(deviation @ deviation) / (count * (count - 1)))


def student(degrees: int) -> float:
    """The factor of a standard error in a 95 % interval of Student's t."""
    from scipy import stats

    return float(stats.t.ppf(1.0 - TAIL, degrees))


def clopper_pearson(hits: int, count: int) -> Interval:
    """The interval of a probability of which `hits` of `count` independent trials speak.

    It covers at least 95 % for every probability, also where there are few hits or none, which Wilson's does not
    (C. J. Clopper, E. S. Pearson, Biometrika 26 (1934) 404-413; L. D. Brown, T. T. Cai, A. DasGupta, Statistical
    Science 16 (2001) 101-133). Without a trial it is 0 to 1.
    """
    from scipy import stats

    low = float(stats.beta.ppf(TAIL, hits, count - hits + 1)) if hits else 0.0
    high = float(stats.beta.ppf(1.0 - TAIL, hits + 1, count - hits)) if hits < count else 1.0
    return low, high


def proportion(hits: Mask, among: Mask, layout: SampleLayout) -> tuple[float, Interval]:
    """The share of rows `hits` (rows,) of the rows `among`, with its interval; NaN where there is no such row."""
    hits = hits & among
    found, count = int(hits.sum()), int(among.sum())
    if count == 0:
        return math.nan, (0.0, 1.0)
    if layout.independent:
        return found / count, clopper_pearson(found, count)
    estimate, half = ratio_interval(layout.sums(hits), layout.sums(among))
    size = count / layout.replicates
    few = [int((layout.sums(part) > 0.0).sum()) for part in (hits, among & ~hits)]
    if 2 * few[0] < layout.replicates:  # the spread of the replicates would say that the error is 0, or nearly so
        return estimate, _rare(few[0], layout, size)
    if 2 * few[1] < layout.replicates:
        low, high = _rare(few[1], layout, size)
        return estimate, (1.0 - high, 1.0 - low)
    return estimate, (max(estimate - half, 0.0), min(estimate + half, 1.0))


def _rare(replicates_hit: int, layout: SampleLayout, size: float) -> Interval:
    """The interval of a probability p from the number of replicates with at least one hit.

    That number is binomial with a probability P, which lies between n p / (G (1 - p) + n p) and n p for replicates of
    n designs: the first by Cantelli's inequality with a variance of at most G p (1 - p) n of the number of hits (gain
    G), the second by the sum over the designs. p ≤ P as well.
    """
    low, high = clopper_pearson(replicates_hit, layout.replicates)
    odds = layout.gain * high / ((1.0 - high) * size)
    return low / size, high if math.isinf(odds) else min(odds / (1.0 + odds), high)


def quantile(values: Array, level: float, layout: SampleLayout) -> tuple[float, Interval]:
    """The quantile of a level of values (rows,), NaN where there is none, with its interval.

    Independent designs: order statistics by binomial ranks (H. A. David, H. N. Nagaraja, Order Statistics, 3rd ed.
    (2003), section 7.1). Replicates: the interval of the proportion below the estimate, turned into values (R. S.
    Woodruff, J. Am. Stat. Assoc. 47 (1952) 635-646). An end beyond the sample is infinite.
    """
    from scipy import stats

    there = np.isfinite(values)
    ordered = np.sort(values[there])
    count = len(ordered)
    if count == 0:
        return math.nan, (-math.inf, math.inf)
    estimate = float(np.quantile(ordered, level))
    if layout.independent:
        first = int(stats.binom.ppf(TAIL, count, level))
        last = int(stats.binom.ppf(1.0 - TAIL, count, level)) + 1
    else:
        share, (low, high) = proportion(values <= estimate, there, layout)
        first = math.floor((level - (high - share)) * count)
        last = math.ceil((level + (share - low)) * count) + 1
    return estimate, (
        float(ordered[first - 1]) if first >= 1 else -math.inf,
        float(ordered[last - 1]) if last <= count else math.inf,
    )


def _sobol_quality(dimension: int) -> int:
    """The quality parameter t of Sobol's sequence: the sum of the degrees, less 1, of its primitive polynomials.

    I. M. Sobol', USSR Comput. Math. Math. Phys. 7 (1967) 86-112; dimension 1 is van der Corput's sequence, and the
    others take the primitive polynomials over GF(2) by degree e, of which there are φ(2^e - 1) / e.
    """
    counts = (1, 1, 2, 2, 6, 6, 18, 16, 48, 60, 176, 144)
    degrees = [degree for degree, count in enumerate(counts, 1) for _ in range(count)][: dimension - 1]
    return sum(degree - 1 for degree in degrees) + (dimension - 1 - len(degrees)) * len(counts)
