"""First-order and total Sobol indices: which share of a measure's variance each parameter explains.

With independent parameters x, measure f and its variance V, the first-order index of x_i is V[E(f | x_i)] / V, the part
that knowing x_i removes, and the total index is E[V(f | all but x_i)] / V, what is left when all others are known: with
all interactions of x_i. Estimated from blocks A, B, A_B(i) (sensitivity_sample.py):

    first order  small: mean of f(B) (f(A_B(i)) - f(A)), A. Saltelli et al., Comput. Phys. Commun. 181 (2010)
                 259-270, table 2b
                 large: V less half the mean of (f(B) - f(A_B(i)))², M. J. W. Jansen, Comput. Phys. Commun. 117 (1999)
                 35-43
    total        small: half the mean of (f(A) - f(A_B(i)))², Jansen (1999)
                 large: V less the mean of f(A) (f(A_B(i)) - f(B)), the first-order part of all others by (2b), since
                 A_B(i) is B with all other columns of A

The errors of the small ones vanish as the index goes to 0, those of the large ones as it goes to 1. f is centred by its
mean first, which does not change the indices and lessens the error. Independent scramblings of the points give the
errors (A. B. Owen, Monte Carlo theory, methods and examples (2013), chapter 17).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.studies.designs.sensitivity_sample import SensitivitySample
from bellcrank.studies.results.exceedance import missing_by_status
from bellcrank.studies.results.intervals import ratio_interval
from bellcrank.studies.results.study_columns import StudyColumns
from bellcrank.studies.results.tolerance import Estimate

ROUND_OFF = 1e-12  # a standard deviation below this part of the mean says nothing about parameters
LARGE = 0.5  # an index beyond it is estimated by what it lacks to 1


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
