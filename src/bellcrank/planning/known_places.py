"""The states and torques of a mechanism at places of a path, each place computed once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bellcrank.planning.path_torques import PathTerms

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PathPlaces:
    """Places of a path.

    Attributes:
        q: Positions (n, nq).
        first: Their first derivatives (n, nv) with respect to the path.
        second: Their second derivatives.
        terms: The coefficients of the motors' torques.
    """

    q: Array
    first: Array
    second: Array
    terms: PathTerms

    @property
    def _arrays(self) -> tuple[Array, ...]:
        terms = self.terms
        return self.q, self.first, self.second, terms.a, terms.b, terms.d, terms.c, terms.w

    def taken(self, index: NDArray[np.intp]) -> PathPlaces:
        """The places of these numbers."""
        q, first, second, *terms = (each[index] for each in self._arrays)
        return PathPlaces(q, first, second, PathTerms(*terms))

    def joined(self, other: PathPlaces) -> PathPlaces:
        """These places and others behind them."""
        pairs = zip(self._arrays, other._arrays, strict=True)
        q, first, second, *terms = (np.concatenate(pair) for pair in pairs)
        return PathPlaces(q, first, second, PathTerms(*terms))


class KnownPlaces:
    """Places that are kept once `compute` has found them for path parameters (n,)."""

    def __init__(self, compute: Callable[[Array], PathPlaces]) -> None:
        self._compute = compute
        self._s: Array = np.zeros(0)  # rising
        self._found: PathPlaces | None = None

    def at(self, s: Array) -> PathPlaces:
        """The places at path parameters (n,)."""
        new = np.setdiff1d(s, self._s)
        if self._found is None:
            self._s, self._found = new, self._compute(new)
        elif len(new):
            both = np.concatenate([self._s, new])
            order = np.argsort(both)
            self._s, self._found = both[order], self._found.joined(self._compute(new)).taken(order)
        return self._found.taken(np.searchsorted(self._s, s))
