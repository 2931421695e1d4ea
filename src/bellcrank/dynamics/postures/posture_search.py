"""One search for postures that satisfy the constraints of a scene, for many designs or many first guesses at once.

src/cpp/integrator/start_search.hpp carries it out, each design by itself: for one posture (`search_postures`), or for
the postures along a motion, each on the branch of the one before (`follow_postures`). Which searches for a start follow
one another is decided in start_stages.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bellcrank._step import consistent_postures, followed_postures
from bellcrank.arrays import Array, Indices, Mask
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.equations.system import system_parameters
from bellcrank.dynamics.postures.start_equations import StartEquations, equations_at

if TYPE_CHECKING:
    from bellcrank.robot.robot import RobotJoint
    from bellcrank.scene.scene import Scene

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

    def picked(self, rows: Indices) -> Constrained:
        """Some of the designs, which may repeat."""
        one_unit, one_length = len(self.units) == 1, len(self.lengths) == 1
        return Constrained(
            self.parameters[rows],
            self.units if one_unit else self.units[rows],
            self.lengths if one_length else self.lengths[rows],
        )


def scene_as_design(scene: Scene) -> Constrained:
    """A scene as one design of itself."""
    rows = rows_of(scene)
    return Constrained(system_parameters(scene)[None], rows.unit[None], np.array([rows.length]))


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
    scene: Scene, designs: Constrained, q: Array, search: PostureSearch, threads: int = 1, time: float = 0.0
) -> tuple[Array, SearchVerdicts]:
    """Where the search ends (n, nq) from q (n, nq) with the parameters of n designs, at a time (s)."""
    equations = equations_at(scene, time)
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


# ---- Postures along a motion.

ROUNDED = 1e-11  # rad, or of the characteristic length: a residual that rounding may keep from decreasing
FARTHEST = 5_000.0  # rad, or of the characteristic length: that leading joints may move from one row to the next


class Way(NamedTuple):
    """What n rows of a motion prescribe: times (n,), s, inputs (n, nu) of the equations, positions of joints (n, k).

    Between rows, all of these change linearly.

    Attributes:
        joints: The leading joints, of one degree of freedom each.
        begin: The inputs (nu,) where the motion begins; None: those of the first row.
        longest: The longest first step that may lead to a posture, rad or characteristic lengths.
        rounded: The largest residual at which corrections end that no longer decrease it.
    """

    time: Array
    inputs: Array
    wanted: Array
    joints: Sequence[RobotJoint] = ()
    begin: Array | None = None
    longest: float = np.inf
    rounded: float = ROUNDED


class Followed(NamedTuple):
    """Postures (designs, n, nq) along a motion, and how many rows each design followed (designs,).

    The row after those holds the last posture that was reached, and `share` (designs,) says at which share of the way
    from the row before no posture was found; 0: its joints are further away than FARTHEST.
    """

    postures: Array
    rows: NDArray[np.int32]
    share: Array


def follow_postures(equations: StartEquations, designs: Constrained, q: Array, way: Way, threads: int = 1) -> Followed:
    """The postures of designs along a motion, from q (designs, nq), each on the branch of the one before."""
    first = way.inputs[:1] if way.begin is None else way.begin[None]
    found, rows, share = followed_postures(
        equations,
        designs.parameters,
        designs.units,
        designs.lengths,
        q,
        np.concatenate([way.time[:1], way.time]),
        np.ascontiguousarray(np.concatenate([first, way.inputs])),
        np.ascontiguousarray(np.concatenate([way.wanted[:1], way.wanted])),
        [joint.q for joint in way.joints],
        [joint.v for joint in way.joints],
        way.longest,
        way.rounded,
        threads,
    )
    return Followed(found.reshape(len(q), len(way.time), q.shape[1]), rows, share)
