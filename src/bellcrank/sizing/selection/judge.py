"""Judging many pairs of motors and gears for one axis: cheap criteria first, and costly ones for what is left."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.electrical import loss_per_squared_torque
from bellcrank.arrays import Array, Mask
from bellcrank.sizing.selection.axis_loads import DrivenAxis
from bellcrank.sizing.selection.criteria import Criterion, CriterionResult, cycles_of, exceeds
from bellcrank.sizing.selection.gear_criteria import (
    AxialLoad,
    GearAverageSpeed,
    GearAverageTorque,
    GearLife,
    GearMaxSpeed,
    GearMomentaryTorque,
    GearRepeatedPeak,
    TiltingMoment,
)
from bellcrank.sizing.selection.load_reductions import ACCELERATION, ReducedCycle, ReducedLoads
from bellcrank.sizing.selection.matching_criteria import InertiaRatio, MotorType, NominalVoltage
from bellcrank.sizing.selection.motor_criteria import (
    ContinuousTorqueCriterion,
    HoldingBrake,
    MotorSpeed,
    PeakCurrent,
    PeakTorque,
    VoltageLimit,
)
from bellcrank.sizing.selection.pairs import Index, Pairs
from bellcrank.sizing.selection.shaft_loads import electrical_coefficients, mean_square, mean_times_speed
from bellcrank.sizing.selection.short_time_criteria import PeakCurve, PeakDuration
from bellcrank.sizing.selection.thermal_criteria import HousingTemperature, WindingTemperature

# ---- Notes on a motor and gear, which are never judged: resonance, and errors at the axis.


ARC_MINUTES = 60.0 * 180.0 / math.pi


class NoteCriterion(Criterion):
    """A figure without a limit."""

    def judged(self, pairs: Pairs, axis: DrivenAxis, conditions: Conditions) -> Mask:
        """No pair."""
        return np.zeros(len(pairs), dtype=bool)


class Resonance(NoteCriterion):
    """The lowest natural frequencies of rotor and load on the gear's stiffness.

    With the rotor held it is √(K/J_load)/2π; with a free rotor √(K (1/J_load + 1/(N² (J_rotor + J_gear))))/2π.
    """

    name = "resonance"
    formula = "√(K/J_load)/2π and √(K (1/J_load + 1/(N² J)))/2π"
    source = "two bodies on a spring, e.g. Ellis, Control System Design Guide, 2012, chapter 16"
    needs = (("gear.stiffness", "gear.ratio", "gear.inertia", "motor.rotor_inertia"),)

    def cycle_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """The largest inertia of the cycle, so that the lowest frequency is told."""
        return np.full(len(pairs), np.max(cycle.inertia))

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """Both frequencies at the largest inertia of the load."""
        if pair.of_gear("direct")[0]:
            return "no gear"
        held, free = (float(one[0]) for one in resonances(pair, float(np.max(cycle.inertia))))
        if math.isnan(free):
            return self.missing(pair)
        return f"{held:.3g} Hz with the rotor held, {free:.3g} Hz free, at the largest inertia in '{cycle.name}'"


class AxisError(NoteCriterion):
    """Backlash and wind-up of the gear at the axis, and what they are at a distance of 1 m."""

    name = "error at the axis"
    formula = "backlash, and max |τ| / K"
    source = "the gear's data sheet"
    needs = (("gear.backlash",), ("motor.backlash",), ("gear.stiffness",))

    def cycle_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """The largest torque, so that the largest wind-up is told."""
        return np.full(len(pairs), cycle.max_torque)

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """Backlash and wind-up where they are known."""
        motor, gear = pair.rows(0)
        direct = gear.kind == "direct"
        backlash = motor.backlash if direct else gear.backlash
        parts = [f"backlash {_size(backlash, cycle)}"] if backlash is not None else []
        if not direct and gear.stiffness is not None:
            parts.append(f"wind-up {_size(cycle.max_torque / gear.stiffness, cycle)} in '{cycle.name}'")
        return "; ".join(parts) or ("no gear" if direct else "neither backlash nor stiffness is stated")


def resonances(pairs: Pairs, load_inertia: float) -> tuple[Array, Array]:
    """Natural frequencies (m,), Hz, with the rotor held and free."""
    stiffness = pairs.of_gear("stiffness")
    rotor = pairs.of_gear("ratio") ** 2 * (pairs.of_motor("rotor_inertia") + pairs.of_gear("inertia"))
    with np.errstate(divide="ignore"):
        held, free = stiffness / load_inertia, stiffness * (1.0 / np.float64(load_inertia) + 1.0 / rotor)
    return np.sqrt(held) / (2.0 * math.pi), np.sqrt(free) / (2.0 * math.pi)


def _size(error: float, cycle: ReducedCycle) -> str:
    if cycle.axis.kind == "linear":
        return f"{error * 1e3:.3g} mm"
    return f"{error * ARC_MINUTES:.3g} arcmin ({error * 1e3:.3g} mm at 1 m)"


Tier = Literal["all criteria shown", "passes what is known", "fails"]
INSIDE, EXCEEDED, UNKNOWN, NOTE, NOT_EVALUATED = range(5)
VERDICTS: Final = ("inside", "exceeded", "unknown", "note", "not evaluated")
TIERS: Final[tuple[Tier, ...]] = get_args(Tier)
GEAR_CRITERIA: Final[tuple[Criterion, ...]] = (
    GearMaxSpeed(),
    GearAverageSpeed(),
    GearRepeatedPeak(),
    GearAverageTorque(),
    GearMomentaryTorque(),
    GearLife(),
)
# Criteria of pairs in the order of their cost: pairs that fail one group are left out of the groups that follow.
CHEAP: Final[tuple[tuple[Criterion, ...], ...]] = (
    (MotorSpeed(), HoldingBrake(), TiltingMoment(), AxialLoad(), MotorType(), NominalVoltage(), InertiaRatio()),
    (ContinuousTorqueCriterion(),),
    (PeakTorque(), PeakCurrent(), VoltageLimit(), PeakCurve()),
)
COSTLY: Final[tuple[tuple[Criterion, ...], ...]] = ((PeakDuration(),), (WindingTemperature(), HousingTemperature()))
NOTES: Final[tuple[Criterion, ...]] = (Resonance(), AxisError())
CRITERIA: Final = (*GEAR_CRITERIA, *(criterion for group in (*CHEAP, *COSTLY) for criterion in group))
CHUNK = 8192  # pairs judged at once
THREADS = 2
FEW = 16  # parts, in which threads wait for each other longer than they gain


@dataclass(frozen=True, kw_only=True, eq=False)
class Judgement:
    """What every criterion says of m pairs for one axis.

    Attributes:
        pairs: The pairs.
        loads: The loads.
        conditions: The conditions.
        criteria: The c criteria, in the order of rows.
        use: Utilisation (c, m), 1 at the limit; NaN where unknown, a note, or not evaluated. It is NaN too where a
            bound that costs little shows that it is inside and not above the utilisation of another criterion, so
            that the largest utilisation is exact.
        verdict: (c, m) indices into `VERDICTS`.
        loss: Mean electrical loss of motor and gear in the worst cycle (m,), W, with the winding at 25 °C; NaN where
            unknown.
    """

    pairs: Pairs
    loads: ReducedLoads
    conditions: Conditions
    criteria: tuple[Criterion, ...]
    use: Array
    verdict: NDArray[np.int8]
    loss: Array

    @property
    def tier(self) -> NDArray[np.int8]:
        """Class of each pair (m,), an index into `TIERS`."""
        fails = (self.verdict == EXCEEDED).any(axis=0)
        unknown = (self.verdict == UNKNOWN).any(axis=0)
        return np.where(fails, 2, np.where(unknown, 1, 0)).astype(np.int8)

    @property
    def largest_use(self) -> Array:
        """Largest known utilisation of each pair (m,); 0 where none is known."""
        return np.asarray(np.fmax.reduce(self.use, axis=0, initial=0.0))

    @property
    def mass(self) -> Array:
        """Mass of motor and gear (m,), kg; NaN where unknown."""
        return self.pairs.of_motor("mass") + self.pairs.of_gear("mass")


def in_words(pair: Pairs, loads: ReducedLoads, conditions: Conditions) -> tuple[CriterionResult, ...]:
    """Every criterion and note of one pair."""
    return tuple(each.result(pair, loads, conditions) for each in (*CRITERIA, *NOTES))


def judge(pairs: Pairs, loads: ReducedLoads, conditions: Conditions, exact: bool = True) -> Judgement:
    """Judge many pairs for one axis by every criterion.

    Gear criteria are evaluated once for each gear. A pair that fails one group of criteria is left out of the costlier
    groups that follow; their verdict is then "not evaluated", which is never a pass, because the pair fails anyway.

    Args:
        pairs: The motors and gears.
        loads: The cycles of the axis.
        conditions: What is assumed beside the loads.
        exact: Whether the largest utilisation is wanted. Otherwise only verdicts and losses are right, and a bound that
            shows that a criterion is inside leaves its utilisation unknown.

    Returns:
        Utilisations and verdicts.
    """
    use = np.full((len(CRITERIA), len(pairs)), np.nan)
    verdict = np.full(use.shape, NOT_EVALUATED, dtype=np.int8)
    loss = np.full(len(pairs), np.nan)
    judgement = Judgement(
        pairs=pairs, loads=loads, conditions=conditions, criteria=CRITERIA, use=use, verdict=verdict, loss=loss
    )
    for row, criterion in enumerate(GEAR_CRITERIA):
        _judge_gears(judgement, row, criterion)
    alive = np.nonzero(~(verdict == EXCEEDED).any(axis=0))[0]
    undecided = np.zeros((len(COSTLY), len(pairs)), dtype=bool)  # groups of costly criteria that bounds do not decide
    _in_threads(lambda rows: _judge_chunk(judgement, rows, undecided, exact), _chunks(pairs, alive))
    row = len(GEAR_CRITERIA) + sum(map(len, CHEAP))
    for group, left in zip(COSTLY, undecided, strict=True):
        rows = np.nonzero(left & ~(verdict == EXCEEDED).any(axis=0))[0]
        _in_threads(partial(_judge_rows, judgement, row, group), _chunks(pairs, rows))
        row += len(group)
    return judgement


def _in_threads(function: Callable[[Index], None], parts: list[Index]) -> None:
    """Call a function of each part; NumPy lets other threads run while it computes, which pays for many parts only."""
    if len(parts) <= FEW:
        for part in parts:
            function(part)
        return
    with ThreadPoolExecutor(THREADS) as threads:
        list(threads.map(function, parts))


def _chunks(pairs: Pairs, rows: Index) -> list[Index]:
    """Parts of the rows of pairs that are judged at once."""
    return [part[start : start + CHUNK] for part in _by_efficiency(pairs, rows) for start in range(0, len(part), CHUNK)]


def _by_efficiency(pairs: Pairs, rows: Index) -> list[Index]:
    """Rows of pairs, apart for each gear whose efficiency depends on the load, because its cycles are its own."""
    curved = pairs.products.gear_arrays.efficiency_curve.known
    gear = pairs.gear[rows]
    return [rows[~curved[gear]], *(rows[gear == number] for number in np.nonzero(curved)[0])]


def _judge_gears(judgement: Judgement, row: int, criterion: Criterion) -> None:
    """Judge every gear once, whichever motors it goes with."""
    pairs, loads, conditions = judgement.pairs, judgement.loads, judgement.conditions
    if not len(pairs):
        return
    gears = np.arange(len(pairs.products.gears))
    each = Pairs(products=pairs.products, motor=np.zeros_like(gears), gear=gears, fits=np.ones(len(gears), dtype=bool))
    use, verdict = verdicts(criterion, each, loads, conditions)
    product = pairs.of_motor("by_ratings") == 0.0
    judgement.use[row] = np.where(product, use[pairs.gear], np.nan)
    judgement.verdict[row] = np.where(product, verdict[pairs.gear], NOTE)


def _judge_chunk(judgement: Judgement, rows: Index, undecided: Mask, exact: bool) -> None:
    """Judge some pairs by the cheap criteria, group by group; note which costly ones their bounds leave undecided."""
    row, part = len(GEAR_CRITERIA), judgement.pairs.take(rows)
    level = np.fmax.reduce(judgement.use[:row, rows], axis=0, initial=0.0 if exact else 1.0)  # largest use so far
    for group in CHEAP:
        passed = np.ones(len(rows), dtype=bool)
        for offset, criterion in enumerate(group):
            rest = _by_bound(judgement, row + offset, criterion, part, rows, level)
            _judge_rows(judgement, row + offset, (criterion,), rows[rest], part.take(rest))
            use = judgement.use[row + offset, rows]
            level = np.fmax(level, use)
            passed &= ~exceeds(use)
        row += len(group)
        rows, part, level = rows[passed], part.take(passed), level[passed]
        if not len(rows):
            return
    judgement.loss[rows] = mean_loss(part, judgement.loads, judgement.conditions)
    for number, group in enumerate(COSTLY):
        for offset, criterion in enumerate(group):
            rest = _by_bound(judgement, row + offset, criterion, part, rows, level)
            undecided[number, rows[rest]] = True
        row += len(group)


def _by_bound(judgement: Judgement, row: int, criterion: Criterion, part: Pairs, rows: Index, level: Array) -> Index:
    """Enter what notes and bounds decide; numbers of the pairs that are left, which count as not evaluated."""
    judged = criterion.applies(part, judgement.loads.axis, judgement.conditions)
    below = criterion.below(part, judgement.loads, judgement.conditions, np.minimum(level, 1.0))
    judgement.verdict[row, rows] = np.where(judged, np.where(below, INSIDE, NOT_EVALUATED), NOTE)
    return np.nonzero(judged & ~below)[0]


def _judge_rows(
    judgement: Judgement, row: int, group: tuple[Criterion, ...], rows: Index, part: Pairs | None = None
) -> None:
    """Judge some pairs exactly by a group of criteria, the first of which has this row."""
    part = judgement.pairs.take(rows) if part is None else part
    for offset, criterion in enumerate(group):
        use, verdict = verdicts(criterion, part, judgement.loads, judgement.conditions)
        judgement.use[row + offset, rows] = use
        judgement.verdict[row + offset, rows] = verdict


def verdicts(
    criterion: Criterion, pairs: Pairs, loads: ReducedLoads, conditions: Conditions
) -> tuple[Array, NDArray[np.int8]]:
    """Utilisation (NaN of a note) and verdict of each pair; of a criterion of gears, whichever their motors are."""
    use = criterion.use(pairs, loads, conditions)
    of_pairs = criterion.judged if criterion.of_gear else criterion.applies
    judged: Mask = of_pairs(pairs, loads.axis, conditions)
    verdict = np.where(np.isnan(use), UNKNOWN, np.where(exceeds(use), EXCEEDED, INSIDE))
    return np.where(judged, use, np.nan), np.where(judged, verdict, NOTE).astype(np.int8)


def mean_loss(pairs: Pairs, loads: ReducedLoads, conditions: Conditions) -> Array:
    """Mean loss of motor and gear in the worst cycle (m,), W, with the winding at 25 °C and without safety factor.

    It is the mean of the electrical power less that of the output power τ q̇; the power of the actuator's own inertia,
    whose mean is zero in a cycle, is left out.
    """
    losses = np.empty((len(loads.cycles), len(pairs)))
    for rows, part, cycles in cycles_of(pairs, loads, replace(conditions, safety_factor=1.0)):
        for number, cycle in enumerate(cycles):
            factors = electrical_coefficients(part, cycle)
            copper = loss_per_squared_torque(part.motors) * mean_square(factors, cycle)
            factors = factors.copy()
            factors[:, ACCELERATION] = 0.0
            power = part.of_gear("ratio") * mean_times_speed(factors, cycle)
            losses[number, rows] = copper + power - cycle.mean_output_power
    return np.asarray(np.max(losses, axis=0))
