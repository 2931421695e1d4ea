"""Which motors go with which gears, as index arrays, so that criteria judge many at once, and their order.

A pair is ranked by its tier, then by the number of main criteria that are unknown, then by the objective (a known value
before an unknown one), then by its largest utilisation, then by the ids. A combination is ranked by the sums of these
over its axes; utilisations, and the objective "margin", count by their maximum. Values are compared after rounding to
`RESOLUTION`, so that the order does not depend on rounding errors.

Each step of the order keeps its meaning when the same pairs are added to two combinations, so the sums of lower bounds
are lower bounds; `joint_search` uses this.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import DIRECT, Gear
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.powertrain import PowerTrains
from bellcrank.actuators.product_arrays import Curves, GearArrays, MotorArrays
from bellcrank.actuators.short_time_limits import SpeedTorqueLimit, peak_curves, short_time_limits
from bellcrank.arrays import Array, Indices, Mask
from bellcrank.cached_values import cached_property
from bellcrank.numerics import floats

Index = Indices
Value = TypeVar("Value")
MOST_KEPT = 32  # limits of all motors that are kept: two functions under the conditions of 16 axes
RankKeys = NDArray[np.int64]  # (m, 6), see COLUMNS
RankKey = tuple[int, int, int, int, int, int]
COLUMNS = ("fails", "not all shown", "main criteria unknown", "objective unknown", "objective", "largest utilisation")
RESOLUTION = 1e-9  # of a mass in kg, a cost, a loss in W, and a utilisation
LARGEST = 10**8  # values above are equal, so that sums over all axes stay integers of 64 bits
NOTHING: RankKey = (1, 0, 0, 0, 0, 0)  # an axis that nothing can drive
NOT_JUDGED: RankKey = (2, 0, 0, 0, 0, 0)  # a pair that is left out beforehand
ALL_SHOWN, PASSES_KNOWN, FAILS = range(3)


@dataclass(frozen=True, kw_only=True, eq=False)
class Products:
    """The motors and gears of a catalogue, as rows and as arrays of their figures.

    Attributes:
        motors: The motors.
        gears: The gears; one of kind "direct" stands for a motor without a gear.
        motor_arrays: Figures of the motors.
        gear_arrays: Figures of the gears.
    """

    motors: tuple[Motor, ...]
    gears: tuple[Gear, ...]
    motor_arrays: MotorArrays
    gear_arrays: GearArrays
    _kept: dict[tuple[str, Conditions], Any] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(cls, motors: Sequence[Motor], gears: Sequence[Gear]) -> Products:
        """Products from rows."""
        return cls(
            motors=tuple(motors),
            gears=tuple(gears),
            motor_arrays=MotorArrays.of(motors),
            gear_arrays=GearArrays.of(gears),
        )

    def short_time_limits(self, conditions: Conditions) -> tuple[SpeedTorqueLimit, ...]:
        """The straight limits of short-time operation of all motors; computed once for the same conditions."""
        limits: tuple[SpeedTorqueLimit, ...] = self._once(short_time_limits, conditions)
        return limits

    def peak_curves(self, conditions: Conditions) -> Curves:
        """The printed curves of short-time operation of all motors; computed once for the same conditions."""
        curves: Curves = self._once(peak_curves, conditions)
        return curves

    def _once(self, function: Callable[[MotorArrays, Conditions], Any], conditions: Conditions) -> Any:
        key = (function.__name__, conditions)
        if key not in self._kept:
            if len(self._kept) >= MOST_KEPT:
                self._kept.pop(next(iter(self._kept)))
            self._kept[key] = function(self.motor_arrays, conditions)
        return self._kept[key]


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairs:
    """m combinations of motors and gears.

    Attributes:
        products: The motors and gears.
        motor: Number (m,) of the motor of each pair.
        gear: Number (m,) of the gear of each pair.
        fits: Whether (m,) flange and shaft are known to fit; False where the catalogue does not say.
    """

    products: Products
    motor: Index
    gear: Index
    fits: Mask
    _kept: dict[Any, Any] = field(default_factory=dict, init=False, repr=False)

    def __len__(self) -> int:
        return len(self.motor)

    def take(self, rows: Index | slice | Mask) -> Pairs:
        """The pairs of these rows."""
        taken = Pairs(products=self.products, motor=self.motor[rows], gear=self.gear[rows], fits=self.fits[rows])
        taken._kept.update((key, value[rows]) for key, value in self._kept.items())
        return taken

    def of_motor(self, name: str) -> Array:
        """A figure (m,) of each pair's motor; NaN where unknown."""
        return np.asarray(getattr(self.motors, name))

    def of_gear(self, name: str) -> Array:
        """A figure (m,) of each pair's gear; NaN where unknown."""
        return floats(getattr(self.gears, name))

    @property
    def with_gear(self) -> Mask:
        """Whether each pair has a gear (m,)."""
        return np.asarray(~self.products.gear_arrays.direct[self.gear])

    def rows(self, pair: int) -> tuple[Motor, Gear]:
        """The motor and gear of one pair."""
        return self.products.motors[self.motor[pair]], self.products.gears[self.gear[pair]]

    def once(self, key: Any, function: Callable[[], Value]) -> Value:
        """What a function gives, with one entry for each pair; computed once for a key, for criteria that share it."""
        if key not in self._kept:
            self._kept[key] = function()
        value: Value = self._kept[key]
        return value

    @cached_property
    def motors(self) -> MotorArrays:
        """Figures of each pair's motor, each taken when it is first asked for."""
        return self.products.motor_arrays[self.motor]

    @cached_property
    def gears(self) -> GearArrays:
        """Figures of each pair's gear, each taken when it is first asked for."""
        return self.products.gear_arrays[self.gear]

    @cached_property
    def coefficients(self) -> Array:
        """Factors (m, 5) of a cycle's features whose sum is the electrical torque of each pair."""
        return PowerTrains(self.motors, self.gears).electrical_coefficients

    @classmethod
    def of(cls, *rows: tuple[Motor, Gear]) -> Pairs:
        """Given pairs, which fit."""
        numbers, fits = np.arange(len(rows)), np.ones(len(rows), dtype=bool)
        products = Products.of([motor for motor, _ in rows], [gear for _, gear in rows])
        return cls(products=products, motor=numbers, gear=numbers, fits=fits)

    @classmethod
    def possible(
        cls, motors: Sequence[Motor], gears: Sequence[Gear], kind: Literal["rotary", "linear"] = "rotary"
    ) -> Pairs:
        """All combinations that can drive an axis.

        Only linear axes accept screws and racks. A rotary axis also takes each motor without a gear,
        and takes a motor and gear sold as one only so. Flange and shaft must fit where both sides state them. A gear
        whose flange begins with the name of its maker is built into the motors that state this flange.

        Args:
            motors: The motors to choose from.
            gears: The gears to choose from; direct drive is added for a rotary axis.
            kind: The kind of axis.

        Returns:
            The combinations; there may be none.
        """
        if kind == "linear":
            gears = [gear for gear in gears if gear.linear]
            motors = [motor for motor in motors if motor.kind != "actuator"]
        else:
            gears = [DIRECT, *(gear for gear in gears if not gear.linear and gear.kind != "direct")]
        flange, flange_known = _flanges_fit(motors, gears)
        shaft, shaft_known = _shafts_fit(motors, gears)
        direct = np.array([gear.kind == "direct" for gear in gears], dtype=bool)
        whole = np.array([motor.kind == "actuator" for motor in motors], dtype=bool)
        motor, gear = np.nonzero((flange & shaft & ~whole[:, None]) | direct)
        return cls(
            products=Products.of(motors, gears),
            motor=motor,
            gear=gear,
            fits=direct[gear] | (flange_known & shaft_known)[motor, gear],
        )


def _flanges_fit(motors: Sequence[Motor], gears: Sequence[Gear]) -> tuple[Mask, Mask]:
    """Whether flanges do not contradict each other (motors, gears), and whether both sides state them."""
    names = {name: number for number, name in enumerate(dict.fromkeys(_name(m.flange) for m in motors))}
    offered = np.array([names[_name(motor.flange)] for motor in motors], dtype=np.intp)
    taken = np.zeros((len(names), len(gears)), dtype=bool)
    for column, gear in enumerate(gears):
        for name in (gear.input_flange or "").split(";"):
            if _name(name) in names:
                taken[names[_name(name)], column] = True
    stated = np.array([bool(_name(motor.flange)) for motor in motors], dtype=bool)
    known = stated[:, None] & np.array([bool(_name(gear.input_flange)) for gear in gears], dtype=bool)
    built_in = np.array([_is_built_in(gear) for gear in gears], dtype=bool)
    return np.asarray((~known & ~built_in) | taken[offered]), np.asarray(known)


def _is_built_in(gear: Gear) -> bool:
    """Whether a gear is built into certain motors of its maker: its flange names them, beginning with the maker."""
    return any(_name(name).startswith(_name(gear.maker) + " ") for name in (gear.input_flange or "").split(";"))


def _shafts_fit(motors: Sequence[Motor], gears: Sequence[Gear]) -> tuple[Mask, Mask]:
    """Whether the motor's shaft is not too thick (motors, gears), and whether both diameters are stated."""
    shaft = np.array([m.shaft_diameter for m in motors], dtype=float)[:, None]
    bore = np.array([g.input_shaft_diameter for g in gears], dtype=float)
    known = ~np.isnan(shaft) & ~np.isnan(bore)
    return np.asarray(~known | (shaft <= bore * (1.0 + 1e-9))), np.asarray(known)


def _name(flange: str | None) -> str:
    return (flange or "").strip().casefold()


@dataclass(frozen=True, kw_only=True, eq=False)
class PairVerdicts:
    """Verdicts on m pairs under one set of loads, in the order of their ids.

    Attributes:
        tier: (m,) 0 all criteria shown, 1 passes what is known, 2 fails.
        main_unknown: (m,) number of main criteria that are unknown.
        objective: (m,) what is minimised; NaN where unknown.
        use: (m,) largest known utilisation.
    """

    tier: NDArray[np.int8]
    main_unknown: NDArray[np.int8]
    objective: Array
    use: Array


def rank_keys(verdicts: PairVerdicts) -> RankKeys:
    """The keys (m, 6) by which pairs are ranked: the smaller one comes first, compared column by column."""
    unknown = np.isnan(verdicts.objective)
    return np.column_stack(
        [
            verdicts.tier == FAILS,
            verdicts.tier == PASSES_KNOWN,
            verdicts.main_unknown,
            unknown,
            rounded(np.where(unknown, 0.0, verdicts.objective)),
            rounded(np.nan_to_num(verdicts.use, nan=0.0)),
        ]
    ).astype(np.int64)


def rounded(values: Array) -> NDArray[np.int64]:
    """Values as multiples of `RESOLUTION`."""
    return np.rint(np.clip(values, -LARGEST, LARGEST) / RESOLUTION).astype(np.int64)


def order_of(keys: RankKeys) -> Indices:
    """Row numbers of the keys, best first; equal keys in the order of the rows, that is of the ids."""
    return np.lexsort(keys.T[::-1])


def failing_order(keys: RankKeys) -> Indices:
    """Row numbers of failing pairs, the nearest to the limits first."""
    return np.lexsort((keys[:, 4], keys[:, 3], keys[:, 5]))


def as_key(row: Iterable[int]) -> RankKey:
    """A row of keys as a tuple, which Python compares column by column."""
    fails, partial, unknown, unvalued, value, use = map(int, row)
    return (fails, partial, unknown, unvalued, value, use)


def total(keys: Sequence[RankKey], largest: bool) -> RankKey:
    """The key of a combination; `largest` where its objective is the largest of its pairs' (margin), not the sum."""
    if not keys:
        return (0, 0, 0, 0, 0, 0)
    fails, partial, unknown, unvalued, values, uses = zip(*keys, strict=True)
    value = max(values) if largest else sum(values)
    return (sum(fails), sum(partial), sum(unknown), sum(unvalued), value, max(uses))


def less_than(keys: RankKeys, others: Sequence[RankKey], best: RankKey, largest: bool) -> Mask:
    """Whether (m,) the total of each key with some others is less than the best one."""
    rest = np.array(total(others, largest), dtype=np.int64)
    totals = keys + rest
    totals[:, 5] = np.maximum(keys[:, 5], rest[5])
    if largest:
        totals[:, 4] = np.maximum(keys[:, 4], rest[4])
    found, equal = np.zeros(len(keys), dtype=bool), np.ones(len(keys), dtype=bool)
    for column, limit in zip(totals.T, best, strict=True):
        found |= equal & (column < limit)
        equal &= column == limit
    return found


def smallest(keys: RankKeys) -> RankKey:
    """The smallest of some keys; that of an axis that nothing can drive where there is none."""
    return as_key(keys[order_of(keys)[0]]) if len(keys) else NOTHING
