"""A reduced load cycle gives what all its samples give."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_catalogue import random_cycles, random_gears, random_motors

from bellcrank.actuators.powertrain import PowerTrains
from bellcrank.sizing.selection.axis_loads import DrivenAxis, LoadCycle
from bellcrank.sizing.selection.load_reductions import SPEED, ReducedCycle, reduce_cycle, reduce_loads
from bellcrank.sizing.selection.pairs import Pairs
from bellcrank.sizing.selection.shaft_loads import (
    FEW,
    electrical_coefficients,
    largest,
    largest_signed,
    mean_square,
    mean_times_speed,
    not_above,
    shaft_coefficients,
    speed_coefficients,
)

AXIS = DrivenAxis(name="a", kind="rotary", joints=("a",), mount="base")


def cycle_of(torque: Any, speed: Any, acceleration: Any, weight: Any = None) -> ReducedCycle:
    """A cycle of these samples, one interval each ten."""
    torque, speed, acceleration = (np.asarray(one, dtype=float)[:, None] for one in (torque, speed, acceleration))
    n = len(torque)
    weight = np.full(n, 0.1) if weight is None else np.asarray(weight, dtype=float)
    interval = np.arange(n) // 10
    cycle = LoadCycle(
        name="c",
        duration=float(weight.sum()),
        time=np.arange(n) * 0.1,
        weight=weight,
        interval=interval,
        sequence=((0, int(interval[-1]) + 1, 1),),
        torque=torque,
        static_torque=np.abs(torque),
        speed=speed,
        acceleration=acceleration,
        position=np.zeros((n, 1)),
        axial_force=np.zeros((n, 1)),
        tilting_moment=np.zeros((n, 1)),
        inertia=np.ones((n, 1)),
    )
    return reduce_cycle(cycle, (AXIS,), 0)


def many_pairs(seed: int) -> Pairs:
    """More pairs than `FEW`, so that extreme points are used."""
    pairs = Pairs.possible(random_motors(30, seed), [g for g in random_gears(12, seed) if not g.efficiency_curve])
    return pairs.take(np.resize(np.arange(len(pairs)), FEW + 80))


def rng_samples(seed: int, shape: str, n: int = 80) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Samples that spread over space, a plane, a line, or that are one point; speeds of both signs and rests."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n, 3)) * [40.0, 3.0, 60.0]
    if shape == "plane":
        points[:, 2] = 0.3 * points[:, 0] - 2.0 * points[:, 1]
    elif shape == "line":
        points = np.outer(rng.normal(size=n), [40.0, 3.0, -60.0])
    elif shape == "point":
        points[:] = points[0]
    elif shape == "still":
        points[:, 1:] = 0.0
    points[rng.random(n) < 0.2, 1] = 0.0
    return points[:, 0], points[:, 1], points[:, 2]


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), shape=st.sampled_from(["space", "plane", "line", "point", "still"]))
def test_largest_values_of_extreme_points_are_those_of_all_samples(seed: int, shape: str) -> None:
    torque, speed, acceleration = rng_samples(seed, shape)
    cycle, pairs = cycle_of(torque, speed, acceleration), many_pairs(seed % 7)
    trains = PowerTrains(pairs.motors, pairs.gears)
    every = PowerTrains(
        pairs.products.motor_arrays[pairs.motor][:, None], pairs.products.gear_arrays[pairs.gear][:, None]
    )
    load = every.load(torque, speed, acceleration)
    assert trains.shaft_inertia.shape == (len(pairs),)
    shaft, electrical = shaft_coefficients(pairs, cycle), electrical_coefficients(pairs, cycle)
    np.testing.assert_allclose(largest(shaft, cycle), np.abs(load.torque).max(axis=1), rtol=1e-11)
    exact = np.abs(load.electrical_torque).max(axis=1)
    np.testing.assert_allclose(largest(electrical, cycle), exact, rtol=1e-11)
    assert (not_above(electrical, cycle) >= exact * (1.0 - 1e-12)).all()
    level = np.median(exact)
    found = largest(electrical, cycle, level)
    np.testing.assert_allclose(found[exact > level], exact[exact > level], rtol=1e-11)
    assert (found <= np.maximum(exact * (1.0 + 1e-12), level)).all(), "a bound stands in below the level alone"
    per_torque, per_speed = np.random.default_rng(seed).uniform(0.1, 2.0, (2, len(pairs)))
    volts = per_torque[:, None] * load.electrical_torque + per_speed[:, None] * load.speed
    factors = per_torque[:, None] * electrical + speed_coefficients(pairs, per_speed)
    np.testing.assert_allclose(largest(factors, cycle), np.abs(volts).max(axis=1), rtol=1e-10)
    for sign in (1.0, -1.0):
        side = per_torque[:, None] * np.abs(load.torque) + sign * per_speed[:, None] * np.abs(load.speed)
        found = largest_signed(per_torque[:, None] * shaft, speed_coefficients(pairs, sign * per_speed), cycle)
        scale = np.maximum(np.abs(side).max(axis=1), 1e-300)
        np.testing.assert_allclose(found / scale, side.max(axis=1) / scale, atol=1e-10)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), shape=st.sampled_from(["space", "plane", "line", "point", "still"]))
def test_means_of_moments_are_those_of_all_samples(seed: int, shape: str) -> None:
    torque, speed, acceleration = rng_samples(seed, shape)
    weight = np.random.default_rng(seed).uniform(0.0, 0.3, len(torque))
    weight[::7] = 0.0
    cycle, pairs = cycle_of(torque, speed, acceleration, weight), many_pairs(seed % 7).take(slice(0, 40))
    every = PowerTrains(
        pairs.products.motor_arrays[pairs.motor][:, None], pairs.products.gear_arrays[pairs.gear][:, None]
    )
    load = every.load(torque, speed, acceleration)
    electrical = electrical_coefficients(pairs, cycle)
    squares = (load.electrical_torque**2 @ weight) / weight.sum()
    np.testing.assert_allclose(mean_square(electrical, cycle), squares, rtol=1e-10, atol=1e-13 * squares.max())
    powers = load.electrical_torque * load.speed
    expected = (powers @ weight) / weight.sum()
    found = pairs.of_gear("ratio") * mean_times_speed(electrical, cycle)
    np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(powers).max() + 1e-300)
    for exponent in (1.0, 3.0, 10.0 / 3.0):
        travel = weight * np.abs(speed)
        average = (travel @ np.abs(torque) ** exponent / travel.sum()) ** (1 / exponent) if travel.any() else 0.0
        assert cycle.average_torque(exponent) == pytest.approx(average, rel=1e-11)
    intervals = cycle.interval_moments
    for number in range(len(intervals)):
        inside = cycle.interval == number
        mean = (cycle.features[inside].T * weight[inside]) @ cycle.features[inside] / weight[inside].sum()
        np.testing.assert_allclose(intervals[number], mean, atol=1e-10 * np.abs(mean).max() + 1e-300)


def test_the_aligned_cycle_has_no_torque_where_parts_oppose_each_other() -> None:
    torque = np.array([0.02, 0.02, -0.03, 0.04, -0.01, 0.05])
    speed = np.array([1.0, -1.0, -2.0, 0.0, 2.0, 1.0])
    acceleration = np.array([3.0, 3.0, -1.0, 2.0, -1.0, -4.0])
    cycle = cycle_of(torque, speed, acceleration)
    along = np.array([True, False, True, True, False, False])  # the motor drives, and the acceleration is along τ
    found = cycle.aligned.features
    np.testing.assert_array_equal(found[~along], 0.0)
    np.testing.assert_allclose(found[along], np.column_stack([
        torque[along], np.zeros(3), acceleration[along], np.sign(speed[along]), speed[along]
    ]))  # fmt: skip


def test_efficiency_over_load_reduces_each_gear_for_itself() -> None:
    gears = [gear for gear in random_gears(60, 3) if gear.efficiency_curve]
    assert gears, "the random catalogue has gears with a curve"
    axes, cycles = random_cycles(1, 5, samples=100)
    (loads,) = reduce_loads(axes, cycles)
    pairs = Pairs.possible(random_motors(3, 3), gears[:1])
    one = pairs.take(np.flatnonzero(pairs.with_gear)[:1])
    (cycle,) = loads.through(gears[0])
    assert cycle.includes_gear
    train = PowerTrains.of(*one.rows(0))
    expected = train.shaft_torque(loads.cycles[0].torque, loads.cycles[0].speed, cycles[0].acceleration[:, 0])
    found = (shaft_coefficients(one, cycle) @ cycle.features.T)[0]
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-15)
    assert loads.through(gears[0])[0] is cycle, "computed once"


def test_blocks_bound_their_samples() -> None:
    axes, cycles = random_cycles(1, 9, samples=210, parts=3)
    (loads,) = reduce_loads(axes, cycles)
    (cycle,) = loads.cycles
    maxima, weight, interval = cycle.blocks
    assert weight.sum() == pytest.approx(cycle.pass_weight.sum(), rel=1e-12)
    assert len(weight) < len(cycle.weight) / 8
    for number in range(len(cycle.passes)):
        inside = cycle.interval == number
        assert weight[interval == number].sum() == pytest.approx(cycle.interval_duration[number], rel=1e-12)
        np.testing.assert_array_equal(
            maxima[interval == number].max(axis=0), np.abs(cycle.features[inside]).max(axis=0)
        )


def test_a_cycle_at_rest_has_no_travel_and_no_speed() -> None:
    cycle = cycle_of(np.full(20, 5.0), np.zeros(20), np.zeros(20))
    assert cycle.max_speed == cycle.mean_speed == cycle.average_torque(3.0) == cycle.mean_output_power == 0.0
    assert cycle.max_torque == 5.0
    assert not cycle.features[:, SPEED].any()
