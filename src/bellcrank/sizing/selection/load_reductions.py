"""A load cycle reduced once per axis, so that each criterion costs little for each of many motors and gears.

The torque at a motor's shaft is linear in five features of a sample,
x = [τ while the motor drives, τ while the load drives, q̈, sign q̇, q̇], with coefficients that depend on the pair alone:
[1/(N η), η_back/N, J N, T_c, c_v N] (see `shaft_coefficients`). Therefore
- mean squares and mean powers of every pair follow from one matrix of second moments, (1/t) ∫ x xᵀ dt, and
- the largest value of any linear form a T + b ω is taken at an extreme point of the samples: a vertex of the convex
  hull of (τ, q̈, q̇), formed apart where the motor drives, where the load drives and at rest, because the coefficients
  differ. As the signs of the coefficients are known, points that another one exceeds in all directions are left out.
Both are exact to rounding. (A linear function takes its maximum over a set at a vertex of the set's convex hull: Boyd
and Vandenberghe, Convex Optimization, 2004, exercise 2.5 and section 4.3.)
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.powertrain import PowerTrains, motoring
from bellcrank.arrays import Array, Indices
from bellcrank.cached_values import cached_property
from bellcrank.sizing.selection.axis_loads import DrivenAxis, LoadCycle
from bellcrank.sizing.selection.extreme_points import Blocks, extreme_points, not_dominated

DRIVING, DRIVEN, ACCELERATION, DIRECTION, SPEED = range(5)  # the features
STRETCHES = 64  # of a cycle, in which its heat is bounded: more cost time, fewer leave more to the exact solution


class Stretches(NamedTuple):
    """Parts of a cycle that follow each other, of one interval or of several.

    Attributes:
        moments: (k, 5, 5) integrals over each stretch of products of features.
        duration: (k,), s.
        several: Whether a stretch has several intervals.
    """

    moments: Array
    duration: Array
    several: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class ReducedCycle:
    """One load cycle of one axis: its samples, and what criteria need of them. Units of the axis: rad, N m or m, N.

    Attributes:
        axis: The axis.
        name: Name of the cycle.
        duration: s.
        time: Times (n,), s.
        weight: Weights (n,), s, of integrals over the cycle.
        interval: Number (n,) of the interval of each sample, from 0.
        sequence: (first interval, interval after the last, passes) of each part in the order of the cycle.
        features: (n, 5): torque while the motor drives (τ q̇ >= 0, standstill included), torque while the load drives,
            acceleration, direction of motion (-1, 0, 1), speed.
        torque: Torque (n,) at the axis, times the safety factor: what the gear's output bears.
        static_torque: Largest torque that holds the axis at rest in the cycle's postures.
        inertia: Inertia (n,) of the load.
        axial_force: Largest force along the joint's axis, N; NaN where there is none.
        tilting_moment: Largest moment across the joint's axis, N m; NaN where there is none.
        includes_gear: Whether the features' torques are divided by a gear's efficiency over load already.
        safety_factor: Factor on the output torque, which `torque` contains, and on the whole torque at the motor shaft,
            rotor included, which `shaft_loads.coefficients` contain; the features are without it.
    """

    axis: DrivenAxis
    name: str
    duration: float
    time: Array
    weight: Array
    interval: Indices
    sequence: tuple[tuple[int, int, int], ...]
    features: Array
    torque: Array
    static_torque: float
    inertia: Array
    axial_force: float
    tilting_moment: float
    includes_gear: bool = False
    safety_factor: float = 1.0
    _extremes: dict[tuple[int, int], Array] = field(default_factory=dict, init=False, repr=False)

    @property
    def speed(self) -> Array:
        """Speed (n,) of the axis; 0 at standstill."""
        return self.features[:, SPEED]

    @cached_property
    def second_moments(self) -> Array:
        """(5, 5) means over time of products of features."""
        return np.asarray((self.features.T * (self.weight / self.duration)) @ self.features)

    @cached_property
    def passes(self) -> Indices:
        """How often each of the K intervals occurs in the cycle (K,)."""
        passes = np.zeros(int(self.interval.max()) + 1, dtype=np.intp)
        for first, end, count in self.sequence:
            passes[first:end] += count
        return passes

    @cached_property
    def interval_duration(self) -> Array:
        """The time that one pass of each interval takes (K,), s."""
        return np.bincount(self.interval, self.weight, len(self.passes)) / self.passes

    @cached_property
    def interval_order(self) -> Indices:
        """Numbers of the intervals in the order of the cycle, with all passes."""
        return np.concatenate([np.tile(np.arange(first, end), passes) for first, end, passes in self.sequence])

    @property
    def pass_weight(self) -> Array:
        """Weights (n,), s, of one pass."""
        return self.weight / self.passes[self.interval]

    @cached_property
    def blocks(self) -> Blocks:
        """Every few samples of an interval as one: what a quantity cannot exceed in them."""
        return Blocks.of(self.features, self.pass_weight, self.interval)

    @cached_property
    def interval_moments(self) -> Array:
        """(K, 5, 5) means over each interval of products of features."""
        weighted = self.features * self.weight[:, None]
        total = np.bincount(self.interval, self.weight, len(self.passes))
        sums = np.zeros((len(total), 5, 5))
        np.add.at(sums, self.interval, weighted[:, :, None] * self.features[:, None, :])
        return np.divide(sums, total[:, None, None], out=np.zeros_like(sums), where=total[:, None, None] > 0.0)

    @cached_property
    def stretches(self) -> Stretches:
        """At most `STRETCHES` stretches of equally many intervals, in the order of the cycle with all passes."""
        order = self.interval_order
        first = np.arange(0, len(order), -(-len(order) // STRETCHES))
        length = self.interval_duration[order]
        moments = self.interval_moments[order] * length[:, None, None]
        return Stretches(
            np.add.reduceat(moments, first), np.add.reduceat(length, first), several=len(first) < len(order)
        )

    @cached_property
    def forward(self) -> Array:
        """Features (n', 5) with speeds of 0 or more, for limits alike in both directions.

        Samples that move backwards are reversed as a whole, because such a limit on (T, ω) holds for (-T, -ω) too;
        those at rest are there in both signs.
        """
        at_rest = self.features[self.speed == 0.0]
        return np.concatenate([np.where(self.speed[:, None] < 0.0, -self.features, self.features), -at_rest])

    @cached_property
    def corners(self) -> Array:
        """The largest size of each feature at once, (g, 5), of samples where the motor drives and of the others."""
        sizes, driven = np.abs(self.features), self.features[:, DRIVEN] != 0.0
        return np.stack([group.max(axis=0) for group in (sizes[~driven], sizes[driven]) if len(group)])

    @cached_property
    def hull(self) -> Array:
        """Those of the forward features (h, 5) that are extreme points of (τ, q̈, q̇), in each group of samples."""
        rest, driven = self.forward[:, DIRECTION] == 0.0, self.forward[:, DRIVEN] != 0.0
        groups = (self.forward[~rest & ~driven], self.forward[~rest & driven], self.forward[rest])
        return np.concatenate([group[extreme_points(_torque_acceleration_speed(group))] for group in groups])

    def extremes(self, torque: int, speed: int) -> Array:
        """Points (h, 5), of which one has the largest c · x of the forward features x for any c of these signs.

        Args:
            torque: Sign of the factors of torques, acceleration and direction of motion, 1 or -1.
            speed: Sign of the factor of the speed.

        Returns:
            Extreme points that no other one of the same group exceeds in all these directions.
        """
        key = torque, speed
        if key not in self._extremes:
            groups = 2 * (self.hull[:, DIRECTION] == 0.0) + (self.hull[:, DRIVEN] != 0.0)
            kept = []
            for group in np.unique(groups):
                points = self.hull[groups == group]
                kept.append(points[not_dominated(_torque_acceleration_speed(points) * [torque, torque, speed])])
            self._extremes[key] = np.concatenate(kept)
        return self._extremes[key]

    @cached_property
    def mean_speed(self) -> float:
        """Mean of |q̇| over time."""
        return float(self.weight @ np.abs(self.speed)) / self.duration

    @cached_property
    def max_speed(self) -> float:
        """Largest |q̇|."""
        return float(np.max(np.abs(self.speed)))

    @cached_property
    def max_torque(self) -> float:
        """Largest |τ|."""
        return float(np.max(np.abs(self.torque)))

    @cached_property
    def max_inertia(self) -> float:
        """Largest inertia of the load."""
        return float(np.max(self.inertia))

    @cached_property
    def mean_output_power(self) -> float:
        """Mean of τ q̇, W."""
        return float(self.weight @ (self.torque * self.speed)) / self.duration

    def average_torque(self, exponent: float) -> float:
        """Average torque of a gear's life, (∫ |q̇| |τ|^p dt / ∫ |q̇| dt)^(1/p); 0 for an axis that never moves.

        Source: Harmonic Drive, HFUS-2A manual, p. 19 (p = 3).
        """
        travel = self.weight * np.abs(self.speed)
        total = float(np.sum(travel))
        if total == 0.0 or self.max_torque == 0.0:
            return 0.0
        share = (np.abs(self.torque) / self.max_torque) ** exponent  # so that no power overflows
        return float(self.max_torque * float(travel @ share / total) ** (1.0 / exponent))

    @cached_property
    def aligned(self) -> ReducedCycle:
        """The same cycle with only those features in which every part of the torque has the sign of τ, others 0.

        They are the samples where the motor drives (τ q̇ >= 0, standstill included) and τ q̈ >= 0; torques are those of
        the load, before any gear. See `shaft_loads.least_coefficients`.
        """
        aligned = motoring(self.torque, self.speed) & (self.torque * self.features[:, ACCELERATION] >= 0.0)
        features = self.features * aligned[:, None]
        features[:, DRIVING] = np.where(aligned, self.torque / self.safety_factor, 0.0)
        features[:, DRIVEN] = 0.0
        return replace(self, features=features, includes_gear=False)

    def with_safety_factor(self, factor: float) -> ReducedCycle:
        """The same cycle with a safety factor.

        It multiplies what is compared with a limit: the torque at the gear's output, without the actuator's own
        inertia, and the whole torque at the motor shaft, rotor included, (T_load + T_acceleration) S (Oriental Motor,
        Technical reference: selection calculations, required torque); so losses in the copper rise with its square.
        """
        return replace(
            self,
            safety_factor=self.safety_factor * factor,
            torque=self.torque * factor,
            static_torque=self.static_torque * factor,
            axial_force=self.axial_force * factor,
            tilting_moment=self.tilting_moment * factor,
        )

    def through(self, train: PowerTrains) -> ReducedCycle:
        """The same cycle with the torques at the input of one gear (its efficiency over load), times its ratio."""
        torque = train.gear_torque(self.torque / self.safety_factor, self.speed) * train.gears.ratio
        driven = ~motoring(self.torque, self.speed)
        features = self.features.copy()
        features[:, DRIVING] = np.where(driven, 0.0, torque)
        features[:, DRIVEN] = np.where(driven, torque, 0.0)
        return replace(self, features=features, includes_gear=True)


@dataclass(frozen=True, kw_only=True, eq=False)
class ReducedLoads:
    """What one axis must deliver: all its cycles, reduced.

    Attributes:
        axis: The axis.
        cycles: Its cycles; the worst one counts.
    """

    axis: DrivenAxis
    cycles: tuple[ReducedCycle, ...]
    _scaled: dict[float, ReducedLoads] = field(default_factory=dict, init=False, repr=False)
    _through: dict[Gear, tuple[ReducedCycle, ...]] = field(default_factory=dict, init=False, repr=False)

    def with_safety_factor(self, factor: float) -> ReducedLoads:
        """The loads with a safety factor; computed once for each factor."""
        if factor == 1.0:
            return self
        if factor not in self._scaled:
            scaled = tuple(cycle.with_safety_factor(factor) for cycle in self.cycles)
            self._scaled[factor] = ReducedLoads(axis=self.axis, cycles=scaled)
        return self._scaled[factor]

    def through(self, gear: Gear) -> tuple[ReducedCycle, ...]:
        """The cycles at the input of a gear whose efficiency depends on the load; computed once for each gear."""
        if gear not in self._through:
            train = PowerTrains.of(Motor(id="any", maker="", model=""), gear)
            self._through[gear] = tuple(cycle.through(train) for cycle in self.cycles)
        return self._through[gear]


def features_of(torque: Array, speed: Array, acceleration: Array) -> Array:
    """The features (n, 5) of samples (n,) of an axis; a speed of 0 with the sign of its side (one_sided.py)."""
    drives = motoring(torque, speed)
    columns = [np.where(drives, torque, 0.0), np.where(drives, 0.0, torque), acceleration, np.sign(speed), speed]
    return np.stack(columns, axis=-1)


def reduce_cycle(cycle: LoadCycle, axes: tuple[DrivenAxis, ...], number: int) -> ReducedCycle:
    """One axis (its number) of a load cycle, ready for criteria.

    Args:
        cycle: The cycle of all axes.
        axes: The axes.
        number: Which of them.

    Returns:
        The samples of the axis; what criteria need is computed when first asked for.
    """
    torque = np.ascontiguousarray(cycle.torque[:, number])
    speed = cycle.speed[:, number]
    return ReducedCycle(
        axis=axes[number],
        name=cycle.name,
        duration=cycle.duration,
        time=cycle.time,
        weight=cycle.weight,
        interval=cycle.interval,
        sequence=cycle.sequence,
        features=features_of(torque, speed, cycle.acceleration[:, number]),
        torque=torque,
        static_torque=float(np.max(np.abs(cycle.static_torque[:, number]))),
        inertia=np.ascontiguousarray(cycle.inertia[:, number]),
        axial_force=float(np.max(cycle.axial_force[:, number])),
        tilting_moment=float(np.max(cycle.tilting_moment[:, number])),
    )


def reduce_loads(axes: tuple[DrivenAxis, ...], cycles: tuple[LoadCycle, ...]) -> tuple[ReducedLoads, ...]:
    """The loads of every axis, reduced."""
    return tuple(
        ReducedLoads(axis=axis, cycles=tuple(reduce_cycle(cycle, axes, number) for cycle in cycles))
        for number, axis in enumerate(axes)
    )


def _torque_acceleration_speed(features: Array) -> Array:
    """(τ, q̈, q̇) of features, (n, 3)."""
    return np.column_stack([features[:, DRIVING] + features[:, DRIVEN], features[:, ACCELERATION], features[:, SPEED]])
