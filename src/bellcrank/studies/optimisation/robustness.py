"""Robust designs: a design is judged at deviations of its values, by the worst of them or by mean and deviation.

The deviations are the same for all designs, so that measures stay smooth functions of the variables.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bellcrank.arguments import found
from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.studies.designs.distributions import Distribution
from bellcrank.studies.designs.samples import Sample

SCENARIOS = 32  # deviations of "mean + k sd"
CHECKED = 256  # independent deviations at which a result is checked
MOST_CORNERS = 6  # tolerances of "worst": 64 corners
LARGEST_FACTOR = 100.0
BOUNDED = ("uniform", "triangular", "truncnormal")
_RULE = re.compile(r"\s*mean\s*\+\s*([0-9.]+)\s*sd\s*", re.ASCII)
EXPECTED = "expected 'worst' or 'mean + K sd', such as 'mean + 3 sd'"


def read_rule(given: object) -> float | None:
    """The factor k of "mean + k sd"; None for "worst". Raises ValueError."""
    if isinstance(given, str) and given == "worst":
        return None
    match = _RULE.fullmatch(given) if isinstance(given, str) else None
    try:
        factor = float(match[1]) if match else math.nan
    except ValueError:
        factor = math.nan
    if not 0.0 <= factor <= LARGEST_FACTOR:
        raise ValueError(f"{EXPECTED}, found {found(given)}")
    return factor


@dataclass(frozen=True, eq=False)
class Robustness:
    """How designs are judged.

    Attributes:
        factor: k of "mean + k sd"; None: by the worst.
        tolerances: The distributions of the deviations, by path.
        axes: The number of the runner's axis of each.
        others: Values of the axes that are no variables, which follow those that are (others,).
    """

    factor: float | None
    tolerances: Mapping[str, Distribution]
    axes: tuple[int, ...]
    others: Array

    def __post_init__(self) -> None:
        if self.factor is not None:
            return
        if len(self.tolerances) > MOST_CORNERS:
            raise InputError(
                f"tolerances: expected at most {MOST_CORNERS} for the worst case, found {len(self.tolerances)}; use "
                "robust 'mean + 3 sd'"
            )
        for path, one in self.tolerances.items():
            if one.family not in BOUNDED:
                raise InputError(
                    f"tolerances: '{path}': {one} has no largest deviation; for the worst case use "
                    f"{', '.join(BOUNDED)}, or robust 'mean + 3 sd'"
                )

    @property
    def rule(self) -> str:
        """The rule in words."""
        return "worst" if self.factor is None else f"mean + {self.factor:g} sd"

    @property
    def sentence(self) -> str:
        """What the measures of a result are."""
        count = len(self.deviations)
        where = "the design and the ends of" if self.factor is None else f"{count} deviations drawn from"
        listed = ", ".join(f"'{path}' {one}" for path, one in self.tolerances.items())
        how = (
            "the worst" if self.factor is None else f"the mean, {self.factor:g} standard deviations to the worse side,"
        )
        return f"each measure is {how} over {where} the tolerances: {listed}"

    @property
    def deviations(self) -> Array:
        """(scenarios, tolerances): none and all corners, or a sample."""
        if self.factor is not None:
            return self.drawn(SCENARIOS, 0)
        ends = [_ends(one) for one in self.tolerances.values()]
        return np.array([np.zeros(len(ends)), *itertools.product(*ends)])

    def drawn(self, count: int, seed: int) -> Array:
        """(count, tolerances) deviations, from a Sobol sample."""
        points = Sample(count, "sobol", seed).points(0, count, len(self.tolerances))
        return np.stack([one.quantiles(u) for one, u in zip(self.tolerances.values(), points.T, strict=True)], axis=1)

    def designs(self, numbers: Array, deviations: Array) -> Array:
        """Values (n · scenarios, axes) of the runner's axes for designs (n, variables)."""
        whole = np.hstack([numbers, np.tile(self.others, (len(numbers), 1))])
        found = np.repeat(whole, len(deviations), axis=0)
        found[:, list(self.axes)] += np.tile(deviations, (len(numbers), 1))
        return found

    def combined(self, values: Array, sides: Array) -> Array:
        """Measures (n, m) from those at the deviations (n, scenarios, m); `sides` (m,) 1 where large is worse or −1."""
        if self.factor is None:
            return np.asarray(sides * (sides * values).max(axis=1))
        return np.asarray(values.mean(axis=1) + sides * self.factor * values.std(axis=1, ddof=1))

    def weights(self, values: Array, side: float) -> Array:
        """The derivatives (scenarios,) of "mean + k sd" of one measure (scenarios,) by its values."""
        assert self.factor is not None
        count, off = len(values), values - values.mean()
        spread = float(values.std(ddof=1))
        slope = off / ((count - 1) * spread) if spread > 0.0 else np.zeros(count)
        return np.asarray(1.0 / count + side * self.factor * slope)


def _ends(one: Distribution) -> tuple[float, float]:
    """The least and the largest deviation."""
    return (one.numbers[0], one.numbers[-1]) if one.family != "truncnormal" else (one.numbers[2], one.numbers[3])
