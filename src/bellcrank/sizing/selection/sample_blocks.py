"""Samples of a load in blocks, which bound what happens in them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bellcrank.arrays import Array, Indices

Index = Indices
SIZE = 16  # samples


class Blocks(NamedTuple):
    """Blocks of samples that follow each other in one interval.

    Attributes:
        maxima: (b, c) largest sizes of the samples' c features in each block, each feature for itself.
        weight: Weights (b,), s, of one pass.
        interval: Number (b,) of the interval of each block.
    """

    maxima: Array
    weight: Array
    interval: Index

    @classmethod
    def of(cls, features: Array, weight: Array, interval: Index) -> Blocks:
        """Blocks of samples with features (n, c), weights (n,) and interval numbers (n,), which rise."""
        number = np.arange(len(interval)) - np.searchsorted(interval, interval)  # in the interval
        first = np.flatnonzero(number % SIZE == 0)
        return cls(
            np.maximum.reduceat(np.abs(features), first, axis=0), np.add.reduceat(weight, first), interval[first]
        )
