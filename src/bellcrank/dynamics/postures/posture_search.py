"""One search for postures that satisfy the constraints of a scene, for many designs or many first guesses at once.

src/cpp/integrator/start_search.hpp carries it out, each design by itself: for one posture (`search_postures`), or for
the postures along a motion, each on the branch of the one before (`follow_postures`). Searches for a start follow one
another in this order, until one succeeds: the motors' joints are held, then freed; in each case damped steps from the
given posture, and a continuation that closes the gaps of the given posture and of the tree's neutral posture gradually.
Then the same, motors held and freed, from random postures around the given one within the joints' ranges, at first near
and then further away. The random postures are the same in every run. Of several starts that are found together, the
nearest within the joints' ranges is taken, and brought as near to the given posture as its branch allows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import IntEnum
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bellcrank._step import consistent_postures, followed_postures
from bellcrank.arrays import Array, Indices, Mask
from bellcrank.dynamics.constraints.constraint_rows import characteristic_length, rows_of
from bellcrank.dynamics.equations.system import system_parameters
from bellcrank.dynamics.postures.start_equations import StartEquations, equations_at
from bellcrank.robot.model.joints import lengths_in_position, unit_vectors

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot, RobotJoint
    from bellcrank.scene.scene import Scene


Codes = NDArray[np.int32]
Method = Literal["nearest", "damped", "continued"]
ROUNDED = 1e-11  # rad, or of the characteristic length: a residual that rounding may keep from decreasing
FARTHEST = 5_000.0  # rad, or of the characteristic length: that leading joints may move from one row to the next
Restarts = Sequence[tuple[int, float]]
RESTARTS = ((8, 0.2), (16, 0.5), (40, 1.0))  # how many random postures, in which share of the joints' ranges
SEED = 15
TOUCHING = 1e-9  # rad or m: by so much a start within a joint's range may be outside
APPROACHES = 40  # attempts to move a start towards the given posture
NEAR = 1e-6  # of the distance: approaches that gain less end


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


class Stage(NamedTuple):
    """A search from several postures (n, guesses, nq) of each design."""

    search: PostureSearch
    guesses: Array


def search_further(
    scene: Scene, designs: Constrained, q: Array, search: PostureSearch, threads: int = 1, restarts: Restarts = RESTARTS
) -> tuple[Mask, Array]:
    """Starts of designs that have none near q (n, nq): which designs have one (n,), and the positions (n, nq).

    `search` says what is held and satisfied; its method is that of each stage.
    """
    reached, place = np.zeros(len(q), dtype=bool), q.copy()
    for stage in _stages(scene, q, search, restarts):
        todo = np.flatnonzero(~reached)
        if not len(todo):
            break
        count = stage.guesses.shape[1]
        trials = designs.picked(np.repeat(todo, count))
        guesses = stage.guesses[todo].reshape(-1, q.shape[1])
        found, verdicts = search_postures(scene, trials, guesses, stage.search, threads)
        consistent = (verdicts.code == StartCode.CONSISTENT).reshape(-1, count)
        found = found.reshape(-1, count, q.shape[1])
        good = np.flatnonzero(consistent.any(axis=1))
        best = _nearest(scene, found[good], consistent[good], q[todo[good]])
        nearest = stage.search._replace(method="nearest")
        place[todo[good]] = _approached(scene, designs.picked(todo[good]), best, q[todo[good]], nearest, threads)
        reached[todo[good]] = True
    return reached, place


def motors_of(scene: Scene) -> tuple[str, ...]:
    """The joints with motors: those named by `actuated` or by the file of the loops, or else those with actuators."""
    return scene.config.actuated or scene.config.joints_with_actuators


def motor_columns(scene: Scene) -> Mask:
    """Which degrees of freedom (nv,) have motors."""
    columns = np.zeros(scene.robot.nv, dtype=bool)
    for name in motors_of(scene):
        joint = scene.robot.joint(name)
        columns[joint.v : joint.v + joint.nv] = True
    return columns


def _stages(scene: Scene, q: Array, search: PostureSearch, restarts: Restarts) -> Iterator[Stage]:
    held = search.held
    with_motors = held | motor_columns(scene)
    masks = [held] if (with_motors == held).all() or with_motors.all() else [with_motors, held]
    for mask in masks:
        tree = _with_held(scene.robot, scene.robot.neutral, q, mask)
        yield Stage(search._replace(held=mask, method="damped"), q[:, None])
        yield Stage(search._replace(held=mask, method="continued"), np.stack([q, tree], axis=1))
    random = np.random.default_rng(SEED)
    for count, share in restarts:
        drawn = random.uniform(-1.0, 1.0, (count, scene.robot.nq))
        for mask in masks:
            guesses = scattered(scene, q, drawn, share, mask)
            yield Stage(search._replace(held=mask, method="damped"), guesses)


def scattered(scene: Scene, q: Array, drawn: Array, share: float, held: Mask) -> Array:
    """Postures (n, count, nq) around q (n, nq), from numbers `drawn` (count, nq) in ±1; a share of the ranges."""
    robot = scene.robot
    reach = np.where(lengths_in_position(robot), characteristic_length(scene), np.pi)
    low, high = q - reach, q + reach
    limited = robot.lower < robot.upper
    inside = limited & (robot.lower < high) & (robot.upper > low)
    low = np.where(inside, np.maximum(low, robot.lower), np.where(limited & np.isfinite(robot.lower), robot.lower, low))
    high = np.where(
        inside, np.minimum(high, robot.upper), np.where(limited & np.isfinite(robot.upper), robot.upper, high)
    )
    moved = np.where(drawn > 0.0, drawn * (high - q)[:, None], -drawn * (low - q)[:, None])
    there = q[:, None] + share * moved
    for part in unit_vectors(robot.joints):
        there[:, :, part] = q[:, None, part] + share * drawn[:, part]
        there[:, :, part] /= np.maximum(np.linalg.norm(there[:, :, part], axis=2, keepdims=True), 1e-12)
    return _with_held(robot, there, q[:, None], held)


def _with_held(robot: Robot, there: Array, q: Array, held: Mask) -> Array:
    """Postures with the coordinates of q where a joint is held, if only in part."""
    kept = np.zeros(robot.nq, dtype=bool)
    for joint in robot.joints:
        kept[joint.q : joint.q + joint.nq] = held[joint.v : joint.v + joint.nv].any()
    return np.where(kept, q, there)


def _distances(scene: Scene, there: Array, q: Array) -> Array:
    """The distance (…) between postures (…, nq), lengths in units of the characteristic length."""
    unit = np.where(lengths_in_position(scene.robot), characteristic_length(scene), 1.0)
    return np.asarray(np.linalg.norm((there - q) / unit, axis=-1))


def _nearest(scene: Scene, found: Array, consistent: Mask, q: Array) -> Array:
    """For each design the posture (nq,) of `found` (n, guesses, nq) nearest to q, within the ranges if one is."""
    robot = scene.robot
    limited = robot.lower < robot.upper
    outside = limited & ((found < robot.lower - TOUCHING) | (found > robot.upper + TOUCHING))
    distance = _distances(scene, found, q[:, None])
    rank = np.where(outside.any(axis=2), 1e6, 0.0) + np.minimum(distance, 1e5)
    best = np.where(consistent, rank, np.inf).argmin(axis=1)
    return np.asarray(found[np.arange(len(found)), best])


def _approached(
    scene: Scene, designs: Constrained, found: Array, q: Array, search: PostureSearch, threads: int
) -> Array:
    """Consistent postures (n, nq) moved along their branch as near to q (n, nq) as steps of bounded length lead."""
    share = np.full(len(q), 0.5)
    distance = _distances(scene, found, q)
    for _ in range(APPROACHES):
        active = np.flatnonzero((share > 1e-3) & (distance > NEAR))
        if not len(active):
            break
        trial = found[active] + share[active, None] * (q[active] - found[active])
        for part in unit_vectors(scene.robot.joints):
            trial[:, part] /= np.maximum(np.linalg.norm(trial[:, part], axis=1, keepdims=True), 1e-12)
        there, verdicts = search_postures(scene, designs.picked(active), trial, search, threads)
        new = _distances(scene, there, q[active])
        better = (verdicts.code == StartCode.CONSISTENT) & (new < (1.0 - NEAR) * distance[active])
        found[active[better]], distance[active[better]] = there[better], new[better]
        share[active[~better]] *= 0.25
    return found
