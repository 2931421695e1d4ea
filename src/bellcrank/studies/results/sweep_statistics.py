"""The statistics and the sensitivity of a sweep whose designs are a sample of distributions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.arrays import Indices
from bellcrank.errors import InputError
from bellcrank.studies.designs.samples import Sample, SensitivitySample
from bellcrank.studies.results.intervals import LEAST_REPLICATES
from bellcrank.studies.results.sample_statistics import SampleStatistics, sample_layout
from bellcrank.studies.results.sensitivity import Sensitivity

if TYPE_CHECKING:
    from bellcrank.studies.results.sweep_result import Sweep


def sweep_statistics(sweep: Sweep) -> SampleStatistics:
    """Distributions of the measures and probabilities of limits.

    After an interruption they are those of the replicates that are complete; of independent designs, those of all that
    are done.

    Raises:
        InputError: The designs are not a sample, have values beside distributions, or the error of what they estimate
            is unknown.
    """
    sample = sweep.space.sample
    _check_pure(sweep)
    if isinstance(sample, SensitivitySample):
        return sweep_sensitivity(sweep).statistics
    assert isinstance(sample, Sample)
    rows, count = np.arange(len(sweep)), len(sweep)
    if sample.method != "random":
        rows, whole = complete_replicates(sweep.index, sample.count, sample.replicates)
        count = whole * (sample.count // sample.replicates)
        sample = Sample(count, sample.method, sample.seed, whole) if whole else sample
    else:
        sample = Sample(count, "random", sample.seed)
    return SampleStatistics(
        title=sweep.scene.name,
        units=sweep.units,
        columns=sweep.columns if len(rows) == len(sweep) else sweep.columns.take(rows),
        layout=sample_layout(sample, len(sweep.axes)),
        candidates=sweep.candidates,
        noise=sweep.noise,
        file_notes=sweep.notes,
    )


def sweep_sensitivity(sweep: Sweep) -> Sensitivity:
    """Sobol indices of the measures, from the scramblings that are complete.

    Raises:
        InputError: The designs are not those that Sobol indices need, or too few of them are done.
    """
    sample = sweep.space.sample
    if not isinstance(sample, SensitivitySample):
        raise InputError(
            f"sweep of {sweep.scene.name}: Sobol indices cannot be computed from these designs; see bc.sobol_indices"
        )
    rows, whole = complete_replicates(sweep.index, sample.count, sample.replicates)
    if whole < LEAST_REPLICATES:
        raise InputError(
            f"Sobol indices of {sweep.scene.name}: {whole} of {sample.replicates} scramblings are complete, and "
            f"{LEAST_REPLICATES} are needed"
        )
    return Sensitivity(
        title=sweep.scene.name,
        axes=sweep.axes,
        units=sweep.units,
        columns=sweep.columns if len(rows) == len(sweep) else sweep.columns.take(rows),
        sample=SensitivitySample(sample.dimensions, sample.size, whole, sample.seed),
        candidates=sweep.candidates,
        noise=sweep.noise,
        file_notes=sweep.notes,
    )


def complete_replicates(designs: NDArray[np.int64], count: int, replicates: int) -> tuple[Indices, int]:
    """The rows of the replicates of which every design is done, replicate by replicate, and their number.

    `designs` (n,) are the numbers of the designs that are done, increasing, of `count`.
    """
    done = np.zeros(count, dtype=np.intp)
    done[designs] = 1
    whole = np.flatnonzero(done.reshape(replicates, -1).all(axis=1))
    each = count // replicates
    return (np.cumsum(done) - 1)[(whole[:, None] * each + np.arange(each)).ravel()], len(whole)


def _check_pure(sweep: Sweep) -> None:
    for axis in sweep.axes:
        if axis.distribution is None:
            raise InputError(
                f"sweep of {sweep.scene.name}: '{axis.path}' has values and no distribution, so that the designs are "
                "not a sample, and a probability has no meaning; give every parameter a distribution"
            )
