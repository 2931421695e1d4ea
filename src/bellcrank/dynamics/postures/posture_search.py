"""One search for postures that satisfy the constraints of a scene, for many designs or many first guesses at once.

src/cpp/integrator/start_search.hpp carries it out, each design by itself. Which searches follow one another is decided
in start_stages.py.
"""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bellcrank._step import consistent_postures
from bellcrank.dynamics.postures.start_equations import start_equations

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Codes = NDArray[np.int32]
Method = Literal["nearest", "damped", "continued"]


class StartCode(IntEnum):
    """Why a design has no consistent start."""

    CONSISTENT = 0
    UNDEFINED = 1  # a row of the constraints, or its derivative
    UNSATISFIED = 2
    TURNED_AROUND = 3  # a weld or a hinge
    VIOLATED = 4  # by the given velocities
    FLAT_DISK = 5


class SearchVerdicts(NamedTuple):
    """For each design a StartCode, and which row, constraint or event is to blame, with its value."""

    code: Codes
    place: Codes
    value: Array


class Constrained(NamedTuple):
    """Designs of a scene: p (n, np), the units of the rows (n or 1, rows) and the characteristic lengths (n or 1,)."""

    parameters: Array
    units: Array
    lengths: Array

    def picked(self, rows: NDArray[np.intp]) -> Constrained:
        """Some of the designs, which may repeat."""
        one_unit, one_length = len(self.units) == 1, len(self.lengths) == 1
        return Constrained(
            self.parameters[rows],
            self.units if one_unit else self.units[rows],
            self.lengths if one_length else self.lengths[rows],
        )


class Satisfied(NamedTuple):
    """Which rows of φ (heights,), and which welds and hinges by their sides (cosines,), a search satisfies."""

    rows: Mask
    cosines: Mask


class PostureSearch(NamedTuple):
    """How postures are searched.

    Attributes:
        held: The degrees of freedom (nv,) whose positions are held, those of a free joint along its parent's axes.
        method: "nearest": Gauss-Newton steps of minimum norm, which end at the nearest posture or where J loses rank.
            "damped": Levenberg-Marquardt steps, which may end further away. "continued": the same, while the residuals
            of the first guess are reduced to 0 gradually.
        satisfied: What of the constraints is satisfied; None: all.
    """

    held: Mask
    method: Method = "nearest"
    satisfied: Satisfied | None = None


def search_postures(
    scene: Scene, designs: Constrained, q: Array, search: PostureSearch, threads: int = 1
) -> tuple[Array, SearchVerdicts]:
    """Where the search ends (n, nq) from q (n, nq) with the parameters of n designs."""
    equations = start_equations(scene)
    satisfied = search.satisfied
    if satisfied is None:
        satisfied = Satisfied(np.ones(equations.heights, dtype=bool), np.ones(equations.cosine_count, dtype=bool))
    found, code, place, value = consistent_postures(
        equations,
        designs.parameters,
        designs.units,
        designs.lengths,
        q,
        search.held,
        satisfied.rows,
        satisfied.cosines,
        search.method,
        threads,
    )
    return found, SearchVerdicts(code, place, value)
