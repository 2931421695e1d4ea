"""What a criterion is: a load compared with a limit, over many pairs of motors and gears at once.

Unknown values are NaN, which pass through every formula: a utilisation that is NaN is unknown, never a pass. Where a
bound of the missing limit is stated (the rated torque lies below the peak torque), it may show a verdict all the same.
"""

from __future__ import annotations

import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import reduce
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.arrays import Array, Indices, Mask
from bellcrank.config.units import RPM
from bellcrank.sizing.selection.axis_loads import DrivenAxis
from bellcrank.sizing.selection.load_reductions import ReducedCycle, ReducedLoads
from bellcrank.sizing.selection.pairs import Pairs

Verdict = Literal["inside", "exceeded", "unknown", "note"]


@dataclass(frozen=True, kw_only=True)
class CriterionResult:
    """One criterion of one pair.

    Attributes:
        name: Such as "voltage limit".
        use: Utilisation, 1 at the limit; None where unknown or a note.
        verdict: "inside", "exceeded", "unknown" (something that it needs is not stated), or "note" (not judged).
        text: A sentence: the load, the limit, and where they come from; or what is missing.
        estimate: Where the verdict is unknown because another actuator's mass is not stated: the utilisation without
            that mass. None otherwise.
    """

    name: str
    use: float | None
    verdict: Verdict
    text: str
    estimate: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """The criterion as JSON holds it."""
        return asdict(self)


CycleUse = Callable[[Pairs, ReducedCycle, Conditions], Array]


# Fields that give the shaft torque of a load, and those that give the torque of the current, as alternatives.
SHAFT = (
    ("gear.ratio", "gear.inertia", "motor.rotor_inertia", "gear.efficiency"),
    ("gear.ratio", "gear.inertia", "motor.rotor_inertia", "gear.efficiency_curve", "gear.rated_torque"),
)
TORQUE_CONSTANT = (("motor.torque_constant", "motor.torque_constant_basis"),)
FRICTION = ((*TORQUE_CONSTANT[0], "motor.no_load_current"), ("motor.coulomb_friction", "motor.viscous_friction"))


BY_RATINGS = "not judged: the actuator is given by its ratings, which do not contain it"
AT_LEAST = "whatever the figures are that are not stated"
ROUNDING = 1e-12  # N m and other SI units: smaller loads are written as 0
TOLERANCE = 2e-5  # of a limit: a motion that is planned up to a limit meets it to about 1e-5


def exceeds(use: Any) -> Any:
    """Whether a utilisation, a number or an array, is above its limit by more than the tolerance; NaN is not."""
    return use > 1.0 + TOLERANCE


def within(use: Any) -> Any:
    """Whether a utilisation is at most 1: a bound of a limit shows no pass by the tolerance; NaN is not."""
    return use <= 1.0


class Criterion(ABC):
    """One criterion of a motor and gear for one axis.

    Attributes:
        name: Such as "voltage limit".
        formula: The condition, as text.
        source: Where the formula is from.
        needs: Fields that decide it ("motor.peak_torque"): alternatives, each of them sufficient.
        of_gear: Whether it depends on the gear alone.
        of_ratings: Whether it applies to motors that are given by their ratings alone (`Motor.by_ratings`).
    """

    name: ClassVar[str]
    formula: ClassVar[str]
    source: ClassVar[str]
    needs: ClassVar[tuple[tuple[str, ...], ...]] = ((),)
    of_gear: ClassVar[bool] = False
    of_ratings: ClassVar[bool] = False

    @abstractmethod
    def cycle_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Utilisation (m,) in one cycle, whose torques contain the safety factor."""

    def reduced_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """The same, NaN where the order of the samples decides."""
        return self.cycle_use(pairs, cycle, conditions)

    @abstractmethod
    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """A sentence about one pair in one cycle."""

    def judged(self, pairs: Pairs, axis: DrivenAxis, conditions: Conditions) -> Mask:
        """Whether (m,) the criterion has a limit for each pair; otherwise it is a note."""
        return np.ones(len(pairs), dtype=bool)

    def applies(self, pairs: Pairs, axis: DrivenAxis, conditions: Conditions) -> Mask:
        """Whether (m,) the criterion is judged for each pair, and not left to the user by ratings."""
        judged = self.judged(pairs, axis, conditions)
        return judged if self.of_ratings else np.asarray(judged & (pairs.of_motor("by_ratings") == 0.0))

    def cycle_below(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions, level: Array) -> Mask:
        """Whether (m,) a bound that costs little shows that the utilisation in one cycle is at most a level (m,)."""
        return np.zeros(len(pairs), dtype=bool)

    def below(self, pairs: Pairs, loads: ReducedLoads, conditions: Conditions, level: Array) -> Mask:
        """Whether (m,) bounds that cost little show that the utilisation is at most a level.

        Args:
            pairs: m motors and gears.
            loads: The cycles of the axis.
            conditions: What is assumed beside the loads.
            level: The level (m,).

        Returns:
            True where it is shown; False says nothing.
        """
        shown = np.ones(len(pairs), dtype=bool)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for rows, part, cycles in cycles_of(pairs, loads, conditions, of_gear=self.of_gear):
                for cycle in cycles:
                    shown[rows] &= self.cycle_below(part, cycle, conditions, level[rows])
        return shown

    def use(self, pairs: Pairs, loads: ReducedLoads, conditions: Conditions) -> Array:
        """Utilisation of the worst cycle.

        Args:
            pairs: m motors and gears.
            loads: The cycles of the axis.
            conditions: What is assumed beside the loads.

        Returns:
            Utilisation (m,), 1 at the limit, NaN where it is unknown.
        """
        return np.asarray(worst(self._uses(pairs, loads, conditions)))

    def _uses(self, pairs: Pairs, loads: ReducedLoads, conditions: Conditions) -> Array:
        """Utilisation (c, m) in each cycle."""
        uses = np.empty((len(loads.cycles), len(pairs)))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for rows, part, cycles in cycles_of(pairs, loads, conditions, of_gear=self.of_gear):
                for number, cycle in enumerate(cycles):
                    uses[number, rows] = self.cycle_use(part, cycle, conditions)
        return uses

    def result(self, pair: Pairs, loads: ReducedLoads, conditions: Conditions) -> CriterionResult:
        """The verdict on one pair, with a sentence about its worst cycle."""
        uses = self._uses(pair, loads, conditions)
        use = float(worst(uses)[0])
        judged = bool(self.applies(pair, loads.axis, conditions)[0])
        if not judged and not self.of_ratings and pair.of_motor("by_ratings")[0]:
            return CriterionResult(name=self.name, use=None, verdict="note", text=BY_RATINGS)
        ((_, _, cycles),) = cycles_of(pair, loads, conditions, of_gear=self.of_gear)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            loads_of = uses[:, 0]
            if np.isnan(use):  # of the cycles in which it is unknown, that of the largest load
                sizes = np.nan_to_num([self.compared(pair, cycle, conditions) for cycle in cycles])
                loads_of = np.where(np.isnan(uses[:, 0]), sizes, -np.inf)
            number = int(np.argmax(np.where(np.isnan(loads_of), -np.inf, loads_of)))
            text = self.cycle_text(pair, cycles[number], conditions)
        verdict: Verdict = (
            "note" if not judged else "unknown" if np.isnan(use) else "exceeded" if exceeds(use) else "inside"
        )
        known = judged and not np.isnan(use)
        return CriterionResult(name=self.name, use=use if known else None, verdict=verdict, text=text)

    def compared(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> float:
        """By what cycles are compared where the utilisation of one pair is unknown; NaN: by nothing."""
        return math.nan

    def missing(self, pair: Pairs) -> str:
        """What the rows of one pair lack for this criterion, in words."""
        motor, gear = pair.rows(0)
        lacking = min((lacks(needed, motor, gear) for needed in self.needs), key=len)  # the first of the shortest
        return "not stated: " + ", ".join(lacking) if lacking else "not known from what is stated"


class UseBound(NamedTuple):
    """What an unknown limit is not below, or not above: a name, and the fields whose largest known value it is."""

    name: str
    fields: tuple[str, ...]


class LimitCriterion(Criterion):
    """A load that is at most a limit.

    Attributes:
        quantity: Name of the load, as a sentence begins.
        limit_name: Name of the limit.
        unit: Unit of both; "axis torque" stands for N m or N. Fields in rad/s are converted to "rpm".
        stated: The field that is the limit, such as "gear.max_speed"; a subclass without one has a `limit` of its own.
        lower_bound: Where the limit is unknown, what it is not below: it shows a pass.
        upper_bound: Where the limit is unknown, what it is not above: it shows a failure.
    """

    quantity: ClassVar[str]
    limit_name: ClassVar[str]
    unit: ClassVar[str]
    stated: ClassVar[str]
    lower_bound: ClassVar[UseBound | None] = None
    upper_bound: ClassVar[UseBound | None] = None

    @abstractmethod
    def demand(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """The load (m,)."""

    def limit(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """The limit (m,); NaN where unknown."""
        return self._largest(pairs, (self.stated,))

    def least_demand(self, pairs: Pairs, cycle: ReducedCycle, over: Array | None = None) -> Array | None:
        """A load (m,) that an unknown one is not below: it shows a failure; any lower load where it is not over one."""
        return None

    def most_demand(self, pairs: Pairs, cycle: ReducedCycle) -> Array | None:
        """A load (m,) that costs little, which the load is not above: it shows a pass."""
        return None

    def cycle_below(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions, level: Array) -> Mask:
        """By `most_demand`."""
        most = self.most_demand(pairs, cycle)
        if most is None:
            return super().cycle_below(pairs, cycle, conditions, level)
        limit, bound = self.limit(pairs, cycle, conditions), self.at_least(pairs, cycle)
        if bound is not None:
            limit = np.where(np.isnan(limit), bound[0], limit)
        return np.asarray(most <= level * limit)

    def at_least(self, pairs: Pairs, cycle: ReducedCycle) -> tuple[Array, str] | None:
        """A figure (m,) that the limit is not below, with its name: it shows a pass where the limit is unknown."""
        return None if (own := self.lower_bound) is None else (self._largest(pairs, own.fields), own.name)

    def at_most(self, pairs: Pairs, cycle: ReducedCycle) -> tuple[Array, str] | None:
        """A figure (m,) that the limit is not above, with its name: it shows a failure where the limit is unknown."""
        return None if (own := self.upper_bound) is None else (self._largest(pairs, own.fields), own.name)

    def _largest(self, pairs: Pairs, fields: tuple[str, ...]) -> Array:
        """The largest known value (m,) of fields of the rows, in the unit."""
        sides = {"motor": pairs.of_motor, "gear": pairs.of_gear}
        values = (sides[side](name) for side, name in (field.split(".") for field in fields))
        figures = np.asarray(reduce(np.fmax, values))
        return figures * RPM if self.unit == "rpm" else figures

    def cycle_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Load over limit; where one is unknown, with a bound of it where that decides."""
        demand = self.demand(pairs, cycle, conditions)
        limit = self.limit(pairs, cycle, conditions)
        use = share(demand, limit)
        for bound, decides in ((self.at_least(pairs, cycle), within), (self.at_most(pairs, cycle), exceeds)):
            if bound is not None:
                instead = share(demand, bound[0])
                use = np.where(np.isnan(use) & decides(instead), instead, use)
        if type(self).least_demand is LimitCriterion.least_demand:  # there is no such bound
            return use
        rows = np.nonzero(np.isnan(demand))[0]
        if len(rows):
            part = pairs.take(rows)
            most = self.at_most(part, cycle)
            highest = limit[rows] if most is None else np.fmin(limit[rows], most[0])
            least = self.least_demand(part, cycle, highest)
            if least is not None:
                instead = share(least, highest)
                use[rows] = np.where(exceeds(instead), instead, use[rows])
        return use

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """The load and its limit, with units, and the cycle."""
        unit = ("N m" if cycle.axis.kind == "rotary" else "N") if self.unit == "axis torque" else self.unit
        demand = float(self.demand(pair, cycle, conditions)[0])
        load = f"{self.quantity} {figure(demand)} {unit}"
        if np.isnan(demand):
            least = self.least_demand(pair, cycle)
            size = math.nan if least is None else float(least[0])
            if math.isnan(size):
                return f"{self.quantity} unknown in '{cycle.name}'; {self.missing(pair)}"
            load = f"{self.quantity} at least {figure(size)} {unit}, {AT_LEAST}"
            if not exceeds(self.cycle_use(pair, cycle, conditions)[0]):
                return f"{load}, in '{cycle.name}'; {self.missing(pair)}"
        limit, name = float(self.limit(pair, cycle, conditions)[0]), self.limit_name
        if np.isnan(limit):
            use = float(self.cycle_use(pair, cycle, conditions)[0])
            bound = self.at_least(pair, cycle) if use <= 1.0 else self.at_most(pair, cycle)
            if np.isnan(use) or bound is None:
                return f"{load} in '{cycle.name}'; {self.missing(pair)}"
            limit, name = float(bound[0][0]), f"{bound[1]} (the {name} is not stated, and not {_side(use)})"
        return f"{load} of {limit:.4g} {unit}, {name}, in '{cycle.name}'"

    def compared(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> float:
        """The load of one pair, or the bound that an unknown one is not below."""
        demand = self.demand(pair, cycle, conditions)
        least = self.least_demand(pair, cycle) if np.isnan(demand[0]) else None
        return float((demand if least is None else least)[0])


def figure(value: float) -> str:
    """A load as text with four digits; what is left by rounding errors is 0."""
    return "0" if abs(value) < ROUNDING else f"{value:.4g}"


def _side(use: float) -> str:
    return "lower" if use <= 1.0 else "higher"


def share(demand: Array | float, limit: Array) -> Array:
    """Demand over limit; 0 where nothing is demanded of a known or unknown limit, infinite of a limit of 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(demand == 0.0, 0.0, np.divide(demand, limit))


def worst(uses: Array) -> Array:
    """The largest utilisation (m,) of several (c, m): exceeding where one does, else NaN where one is unknown."""
    known = np.fmax.reduce(uses, axis=0)
    return np.where(np.isnan(uses).any(axis=0) & ~exceeds(known), np.nan, known)


def alternatives(*groups: tuple[tuple[str, ...], ...]) -> tuple[tuple[str, ...], ...]:
    """Every choice of one alternative of each group, as alternatives of all the fields that they name."""
    choices = itertools.product(*groups)
    return tuple(tuple(dict.fromkeys(name for part in choice for name in part)) for choice in choices)


def lacks(needed: tuple[str, ...], motor: Motor, gear: Gear) -> tuple[str, ...]:
    """Those of the needed fields that the rows of a pair do not state."""
    rows = {"motor": motor, "gear": gear}
    return tuple(
        f"the {side}'s {field.replace('_', ' ')}"
        for side, field in (name.split(".") for name in needed)
        if getattr(rows[side], field) is None
    )


def cycles_of(
    pairs: Pairs, loads: ReducedLoads, conditions: Conditions, *, of_gear: bool = False
) -> list[tuple[Indices | slice, Pairs, tuple[ReducedCycle, ...]]]:
    """Rows of pairs, these pairs, and their cycles: a gear with an efficiency over load has cycles of its own."""
    common = loads.with_safety_factor(conditions.safety_factor)
    curved = pairs.products.gear_arrays.efficiency_curve.known[pairs.gear]
    if of_gear or not curved.any():
        return [(slice(None), pairs, common.cycles)]
    own = [(pairs.gear == n, common.through(pairs.products.gears[n])) for n in np.unique(pairs.gear[curved])]
    if len(own) == 1 and curved.all():
        return [(slice(None), pairs, own[0][1])]
    parts = [(np.nonzero(here)[0], cycles) for here, cycles in (*own, (~curved, common.cycles))]
    return [(rows, pairs.take(rows), cycles) for rows, cycles in parts]
