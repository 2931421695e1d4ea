"""The pairs of all axes, judged under the loads that the masses of the actuators cause.

Where the mass of an actuator is not stated, the loads of the axes that it influences are unknown. There, every
criterion that depends on loads is unknown, except where it is exceeded without that mass already. So a pass is never
shown without the mass; a pair that only an unknown counterweight would relieve is left out.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.arrays import Array, Indices, Mask
from bellcrank.cached_values import cached_property
from bellcrank.sizing.selection.axis_loads import AddedMass, AxisLoads, LoadCycle
from bellcrank.sizing.selection.axis_pairs import AxisPairs
from bellcrank.sizing.selection.joint_problem import NO_MASS, UNKNOWN_MASS, Choice, Masses, masses_of
from bellcrank.sizing.selection.judge import EXCEEDED, INSIDE, UNKNOWN, Judgement, judge, verdicts
from bellcrank.sizing.selection.load_reductions import ReducedCycle, ReducedLoads, reduce_cycle
from bellcrank.sizing.selection.pairs import NOT_JUDGED, PairVerdicts, RankKeys, rank_keys

Objective = Literal["mass", "cost", "loss", "margin"]
OF_MOTION = frozenset(
    {"motor speed", "gear average input speed", "gear largest input speed", "motor type", "nominal voltage"}
)  # whatever the torques
MAIN = frozenset(  # a pair of which one of these is unknown may be far too weak
    {"motor speed", "continuous torque", "peak torque", "peak current", "voltage limit", "gear repeated peak torque"}
)
MOST_ROWS_KEPT = 2_000_000  # pairs whose ranks are kept for another time: 64 bytes each
MOST_LOADS_KEPT = 64
PAIRS_OF_A_JUDGEMENT = 2000  # the effort of loads and their reduction, in pairs
TINY = 1e-9  # N m, N, rad/s or m/s: a criterion that is unknown at loads of this size is unknown under any masses


@dataclass(frozen=True, eq=False)
class AxisRanks:
    """The ranks of some pairs of an axis.

    Attributes:
        rows: (n,) numbers of the pairs, rising.
        keys: (n, 6) their keys.
        use: (n,) their largest known utilisations.
        loss: (n,) their losses, NaN where unknown.
    """

    rows: Indices
    keys: RankKeys
    use: Array
    loss: Array

    @classmethod
    def nothing(cls) -> AxisRanks:
        """Of no pairs."""
        return cls(np.zeros(0, dtype=np.intp), np.zeros((0, 6), dtype=np.int64), np.zeros(0), np.zeros(0))

    def with_others(self, others: AxisRanks) -> AxisRanks:
        """These pairs and others, in the order of their numbers."""
        if not len(self.rows):
            return others
        rows = np.concatenate([self.rows, others.rows])
        order = np.argsort(rows)
        return AxisRanks(
            rows=rows[order],
            keys=np.concatenate([self.keys, others.keys])[order],
            use=np.concatenate([self.use, others.use])[order],
            loss=np.concatenate([self.loss, others.loss])[order],
        )

    def of_all(self, count: int) -> AxisRanks:
        """The ranks of all pairs of the axis; those of the others are `NOT_JUDGED`."""
        if len(self.rows) == count:
            return self
        keys = np.tile(np.array(NOT_JUDGED, dtype=np.int64), (count, 1))
        use, loss = np.full(count, np.nan), np.full(count, np.nan)
        keys[self.rows], use[self.rows], loss[self.rows] = self.keys, self.use, self.loss
        return AxisRanks(np.arange(count), keys, use, loss)


@dataclass(eq=False)
class JudgedAxes:
    """The pairs of all axes and their ranks; implements `JointProblem`.

    Attributes:
        loads: The loads of the axes.
        axes: The pairs of each axis.
        conditions: What is assumed of each axis.
        common: What is assumed of all axes together, such as the supply.
        objective: What is minimised.
        feedback: Whether the actuators' masses load other axes.
        progress: Called after each judgement with the effort spent.
    """

    loads: AxisLoads
    axes: Sequence[AxisPairs]
    conditions: Sequence[Conditions]
    common: Conditions
    objective: Objective
    feedback: bool = True
    progress: Callable[[int], object] | None = None
    effort: int = field(default=0, init=False)
    _ranks: OrderedDict[tuple[int, Masses], AxisRanks] = field(default_factory=OrderedDict, init=False)
    _loads: OrderedDict[tuple[int, Masses], ReducedLoads] = field(default_factory=OrderedDict, init=False)
    _tiny: dict[tuple[object, ...], Judgement] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        influence = np.asarray(self.loads.influence, dtype=bool)
        self.influence = influence if self.feedback else np.zeros_like(influence)
        self.largest = self.objective == "margin"
        self.kept = [one.kept for one in self.axes]
        self.classes: list[Indices] = [
            one.bodies.classes if self.influence[:, number].any() else np.zeros(len(one.pairs), dtype=np.intp)
            for number, one in enumerate(self.axes)
        ]

    @cached_property
    def bounds(self) -> list[RankKeys]:
        """Per axis the keys (m, 6) that the pairs' keys do not fall below under any masses."""
        return [self._bound(number) for number in range(len(self.axes))]

    # ---- ranks

    def keys(self, axis: int, masses: Masses, rows: Mask | None = None) -> RankKeys:
        """The keys (m, 6) of an axis where the actuators are of these classes; only those that load it matter.

        Only the pairs `rows` (m,) need to be judged; the keys of others may be `NOT_JUDGED`.
        """
        return self.ranks(axis, masses, rows).keys

    def ranks(self, axis: int, masses: Masses, rows: Mask | None = None) -> AxisRanks:
        """As `keys`, with the utilisations and losses."""
        loading = tuple(one if self.influence[axis, j] else NO_MASS for j, one in enumerate(masses))
        wanted = np.ones(len(self.axes[axis].pairs), dtype=bool) if rows is None else rows.copy()
        found = self._ranks.pop((axis, loading), None) or AxisRanks.nothing()
        wanted[found.rows] = False
        missing = np.flatnonzero(wanted)
        if len(missing):
            judgement = self.judgement(axis, masses, missing)
            keys = self._rank(axis, judgement, missing)
            found = found.with_others(AxisRanks(missing, keys, judgement.largest_use, judgement.loss))
        self._ranks[axis, loading] = found  # as the latest
        while len(self._ranks) > 1 and sum(len(one.rows) for one in self._ranks.values()) > MOST_ROWS_KEPT:
            self._ranks.popitem(last=False)
        return found.of_all(len(wanted))

    def judgement(self, axis: int, masses: Masses, rows: Indices | None = None) -> Judgement:
        """The judgement of an axis's pairs, or of some rows of them, where the actuators are of these classes."""
        pairs = self.axes[axis].pairs if rows is None else self.axes[axis].pairs.take(rows)
        found = judge(pairs, self.axis_loads(axis, masses), self.conditions[axis])
        self.effort += len(pairs) + PAIRS_OF_A_JUDGEMENT
        if self.progress is not None:
            self.progress(self.effort)
        return without_unknown_masses(found) if self.unknown_masses(axis, masses) else found

    def objective_values(self, axis: int, judgement: Judgement, rows: Indices | slice = slice(None)) -> Array:
        """What is minimised, of an axis's pairs; NaN where unknown."""
        one = self.axes[axis]
        if self.objective == "mass":
            return one.bodies.mass[rows]
        if self.objective == "cost":
            return one.cost[rows]
        if self.objective == "loss":
            return judgement.loss
        return np.where(judgement.tier == 1, np.nan, judgement.largest_use)  # a margin that is not shown is unknown

    def _rank(self, axis: int, judgement: Judgement, rows: Indices | slice = slice(None)) -> RankKeys:
        main = np.array([criterion.name in MAIN for criterion in judgement.criteria])
        return rank_keys(
            PairVerdicts(
                tier=judgement.tier,
                main_unknown=(judgement.verdict[main] == UNKNOWN).sum(axis=0).astype(np.int8),
                objective=self.objective_values(axis, judgement, rows),
                use=judgement.largest_use,
            )
        )

    def _bound(self, axis: int) -> RankKeys:
        """Keys that the pairs' keys do not fall below under any masses.

        A criterion that is unknown at tiny loads and speeds is unknown at all: a missing limit is only bounded from
        below by other figures, which a smaller load does not exceed. Criteria of the motion alone are judged as they
        are. Mass and cost do not depend on loads; loss and use count as 0.
        """
        loads = self.axis_loads(axis, (NO_MASS,) * len(self.axes))
        pairs, judgement = self.axes[axis].pairs, self._at_tiny_loads(axis, tiny_loads(loads))
        of_motion = np.array([criterion.name in OF_MOTION for criterion in judgement.criteria])
        for row in np.flatnonzero(of_motion):
            judgement.verdict[row] = verdicts(judgement.criteria[row], pairs, loads, self.conditions[axis])[1]
        found = self._rank(axis, judgement)
        found[:, 0] = (judgement.verdict[of_motion] == EXCEEDED).any(axis=0)
        found[:, 5] = 0
        if self.objective in ("loss", "margin"):
            found[:, 3:5] = 0
        return found

    def _at_tiny_loads(self, axis: int, loads: ReducedLoads) -> Judgement:
        """The judgement of an axis's pairs at tiny loads; made once for the same pairs, conditions and loads."""
        pairs, conditions = self.axes[axis].pairs, self.conditions[axis]
        key = (
            id(pairs),
            conditions,
            loads.axis.kind,
            *(repr(_sizes(cycle)) for cycle in loads.cycles),
        )  # NaN differs from NaN
        if key not in self._tiny:
            self._tiny[key] = judge(pairs, loads, conditions, exact=False)
        return replace(self._tiny[key], verdict=self._tiny[key].verdict.copy())

    # ---- loads

    def cycles(self, masses: Masses) -> tuple[LoadCycle, ...]:
        """The cycles of all axes where the actuators are of these classes; unknown masses are left out."""
        return self.loads.with_masses(self.added_masses(masses))

    def added_masses(self, masses: Masses) -> dict[str, AddedMass]:
        """What actuators of these classes add, by the name of the axis, where it is known and loads an axis."""
        added: dict[str, AddedMass] = {}
        for one, body, column in zip(self.axes, masses, self.influence.T, strict=True):
            if body not in (NO_MASS, UNKNOWN_MASS) and column.any():
                added[one.axis.name] = one.bodies.bodies[body]
        return added

    def axis_loads(self, axis: int, masses: Masses) -> ReducedLoads:
        """The reduced loads of one axis."""
        relevant = tuple(one if self.influence[axis, j] else NO_MASS for j, one in enumerate(masses))
        found = self._loads.pop((axis, relevant), None)
        if found is None:
            cycles = tuple(reduce_cycle(cycle, self.loads.axes, axis) for cycle in self.cycles(relevant))
            found = ReducedLoads(axis=self.axes[axis].axis, cycles=cycles)
        self._loads[axis, relevant] = found  # as the latest
        if len(self._loads) > MOST_LOADS_KEPT:
            self._loads.popitem(last=False)
        return found

    def unknown_masses(self, axis: int, masses: Masses) -> list[str]:
        """Names of the axes whose actuators load this one and have no known mass."""
        return [
            self.axes[j].axis.name for j, one in enumerate(masses) if one == UNKNOWN_MASS and self.influence[axis, j]
        ]

    def choice_masses(self, choice: Choice) -> Masses:
        """The classes of a choice's actuators."""
        return masses_of(self, choice)


def without_unknown_masses(judgement: Judgement) -> Judgement:
    """A judgement made without masses that are not stated: what is inside is unknown, if it depends on loads."""
    of_loads = np.array([criterion.name not in OF_MOTION for criterion in judgement.criteria])
    verdict = judgement.verdict.copy()
    verdict[(verdict == INSIDE) & of_loads[:, None]] = UNKNOWN
    return replace(judgement, verdict=verdict, loss=np.full_like(judgement.loss, np.nan))


def tiny_loads(loads: ReducedLoads) -> ReducedLoads:
    """Loads of which each quantity has the same tiny size, or is 0 or unknown as it was: two samples a cycle."""
    return replace(loads, cycles=tuple(_tiny(cycle) for cycle in loads.cycles))


def _tiny(cycle: ReducedCycle) -> ReducedCycle:
    torque, static, speed, axial, tilting = np.minimum(_sizes(cycle), TINY)
    moving = 0.5 if speed > 0.0 else 0.0
    return replace(
        cycle,
        duration=1.0,
        time=np.array([0.0, moving]),
        weight=np.array([moving, 1.0 - moving]),
        interval=np.arange(2),
        sequence=((0, 2, 1),),
        features=np.array([[torque, 0.0, 0.0, np.sign(speed), speed], [torque, 0.0, 0.0, 0.0, 0.0]]),
        torque=np.full(2, torque),
        static_torque=float(static),
        inertia=np.zeros(2),
        axial_force=float(axial),
        tilting_moment=float(tilting),
    )


def _sizes(cycle: ReducedCycle) -> tuple[float, ...]:
    """The largest torque, static torque, speed, axial force and tilting moment; NaN where there is none."""
    return (cycle.max_torque, cycle.static_torque, cycle.max_speed, cycle.axial_force, cycle.tilting_moment)
