"""A selection equals brute force: every pair of a random catalogue at every sample, in plain numpy.

The formulas are written anew from their sources (named in the criteria); nothing of the product computes a load at the
shaft, a criterion, a temperature or a rank here. Axis torques come from the robot's inverse dynamics at the samples.
"""

from __future__ import annotations

import numpy as np
import pytest
from sized_catalogue import sized_catalogue

import bellcrank as bc
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import DIRECT
from bellcrank.dynamics.inverse.mechanism import mechanism_of
from bellcrank.sizing.selection.axis_loads_of import axis_loads
from bellcrank.sizing.selection.axis_pairs import axis_pairs
from bellcrank.sizing.selection.judge import EXCEEDED, INSIDE
from bellcrank.sizing.selection.judged_axes import JudgedAxes

pytestmark = pytest.mark.tier2

ALPHA = 0.0039  # 1/K
CONDITIONS = Conditions(voltage=44.0, voltage_reserve=0.15, ambient=35.0, safety_factor=1.2, life=4000.0)


def arm_2r():
    arm = bc.load_robot("planar_2r")
    motions = [
        bc.waypoints(arm, [0.0, 1.6, 3.0], [{}, {"shoulder": 1.2, "elbow": -0.9}, {}], name="reach"),
        bc.waypoints(arm, [0.0, 1.3, 3.0], [{}, {"shoulder": -0.7, "elbow": 1.4}, {}], name="swing"),
        bc.waypoints(
            arm, [0.0, 1.1, 2.4], [{"elbow": 0.3}, {"shoulder": 0.4, "elbow": 1.0}, {"elbow": 0.3}], name="lift"
        ),
    ]
    return arm, motions


def ur5():
    arm = bc.load_robot("ur5")
    names = [joint.name for joint in arm.joints]
    home, far, low = (
        [0.0, -1.2, 1.5, -0.3, 0.5, 0.0],
        [1.5, -0.6, 0.8, 0.4, -0.5, 1.0],
        [0.4, -0.9, 1.9, -1.0, 0.9, 2.0],
    )
    poses = [dict(zip(names, pose, strict=True)) for pose in (home, far, low)]
    motions = [
        bc.waypoints(arm, [0.0, 1.2, 2.4], [poses[0], poses[1], poses[0]], name="far"),
        bc.waypoints(arm, [0.0, 0.9, 1.8], [poses[0], poses[2], poses[0]], name="low"),
        bc.waypoints(arm, [0.0, 1.5, 3.5], [poses[1], poses[2], poses[1]], name="between"),
    ]
    return arm, motions


class Sampled:
    """One cycle of one axis, sample by sample."""

    def __init__(self, cycle, axis, factor):
        self.weight, self.interval = cycle.weight, cycle.interval
        self.total = cycle.weight.sum()
        self.speed, self.acceleration = cycle.speed[:, axis], cycle.acceleration[:, axis]
        self.side = np.sign(self.speed)  # of a reversal there is a sample on each side, at a speed of about 1e-32
        self.speed = np.where(np.abs(self.speed) <= 1e-9, 0.0, self.speed)
        self.factor, self.load = factor, cycle.torque[:, axis]
        self.torque = factor * self.load  # at the gear's output
        self.inertia = cycle.inertia[:, axis].max()
        assert cycle.sequence == ((0, cycle.interval.max() + 1, 1),)

    def mean(self, values):
        return self.weight @ values / self.total


def brute_force(motor, gear, cycle, conditions):
    """Name -> utilisation of one pair in one cycle, the mean loss, and the losses of each interval."""
    direct = gear.kind == "direct"
    n, torque, speed = gear.ratio, cycle.torque, cycle.speed
    back = gear.efficiency if gear.back_efficiency is None else gear.back_efficiency
    geared = np.where(torque * cycle.side >= 0.0, cycle.load / (n * gear.efficiency), cycle.load * back / n)
    shaft = cycle.factor * (geared + (motor.rotor_inertia + gear.inertia) * n * cycle.acceleration)
    turning = n * speed
    friction = motor.coulomb_friction * np.sign(turning) + motor.viscous_friction * turning
    electrical = shaft + cycle.factor * friction
    mean_speed = cycle.mean(np.abs(turning))
    found = {}
    if not direct:
        travel = cycle.weight * np.abs(speed)
        p = gear.life_exponent
        average = (travel @ np.abs(torque) ** p / travel.sum()) ** (1.0 / p)
        found["gear largest input speed"] = np.abs(turning).max() / gear.max_speed
        found["gear average input speed"] = mean_speed / gear.average_speed
        found["gear repeated peak torque"] = np.abs(torque).max() / gear.repeated_peak_torque
        found["gear average torque"] = average / gear.average_torque
        hours = gear.life * (gear.rated_speed / mean_speed) * (gear.rated_torque / average) ** p
        found["gear life"] = conditions.life / hours
    found["nominal voltage"] = abs(np.log2(conditions.voltage / motor.nominal_voltage))
    found["inertia ratio"] = (cycle.inertia / n**2 + gear.inertia) / motor.rotor_inertia / 10.0
    found["motor speed"] = np.abs(turning).max() / motor.max_speed
    found["continuous torque"] = np.sqrt(cycle.mean(shaft**2)) / continuous(motor, mean_speed, conditions)
    found["peak torque"] = np.abs(shaft).max() / motor.peak_torque
    drop = motor.resistance / motor.torque_constant * electrical + motor.torque_constant * turning
    found["voltage limit"] = np.abs(drop).max() / (conditions.voltage * (1.0 - conditions.voltage_reserve))
    above = np.abs(shaft) > np.array([continuous(motor, one, conditions) for one in np.abs(turning)])
    found["peak duration"] = longest_time(above, cycle.weight) / motor.peak_time
    count = cycle.interval.max() + 1
    seconds = np.bincount(cycle.interval, cycle.weight, count)
    copper = np.bincount(cycle.interval, cycle.weight * electrical**2, count) / seconds
    copper *= motor.resistance / motor.torque_constant**2
    rubbing = np.bincount(cycle.interval, cycle.weight * friction * turning, count) / seconds
    return found, (seconds, copper, rubbing)


def mean_loss(motor, gear, cycle):
    """Electrical power less output power, W, without the power of the actuator's own inertia."""
    back = gear.efficiency if gear.back_efficiency is None else gear.back_efficiency
    torque, speed, n = cycle.torque, cycle.speed, gear.ratio
    geared = np.where(torque * speed >= 0.0, torque / (n * gear.efficiency), torque * back / n)
    friction = motor.coulomb_friction * np.sign(speed) + motor.viscous_friction * n * speed
    current = (
        geared + (motor.rotor_inertia + gear.inertia) * n * cycle.acceleration + friction
    ) / motor.torque_constant
    return cycle.mean(motor.resistance * current**2 + (geared + friction) * n * speed - torque * speed)


def heat_share(motor):
    """Share of the friction loss in the housing with which the nominal point is a thermal limit."""
    rise, speed = motor.max_winding_temperature - 25.0, motor.nominal_speed
    friction = motor.coulomb_friction + motor.viscous_friction * speed
    current = (motor.nominal_torque + friction) / motor.torque_constant
    copper = motor.resistance * current**2 * (1.0 + ALPHA * rise)
    left = rise - (motor.resistance_winding_housing + motor.resistance_housing_ambient) * copper
    return np.clip(left / (motor.resistance_housing_ambient * friction * speed), 0.0, 1.0)


def continuous(motor, speed, conditions):
    """S1 torque: the nominal torque up to the nominal speed, above it both thermal resistances; derated where warm."""
    rise = (motor.max_winding_temperature - conditions.ambient) / (motor.max_winding_temperature - 25.0)
    if rise >= 1.0 and speed <= motor.nominal_speed:
        return motor.nominal_torque
    friction = motor.coulomb_friction + motor.viscous_friction * speed
    heat = heat_share(motor) * friction * speed
    inner, outer = motor.resistance_winding_housing, motor.resistance_housing_ambient
    copper = (motor.max_winding_temperature - conditions.ambient - outer * heat) / (inner + outer)
    copper = min(copper, (motor.max_housing_temperature - conditions.ambient) / outer - heat)
    hot = motor.resistance * (1.0 + ALPHA * (motor.max_winding_temperature - 25.0)) / motor.torque_constant**2
    thermal = max(np.sqrt(max(copper, 0.0) / hot) - friction, 0.0)
    return min(thermal, motor.nominal_torque * min(rise, 1.0))


def longest_time(above, weight):
    """The longest time without a break in a cycle that repeats."""
    if above.all():
        return np.inf
    if not above.any():
        return 0.0
    start = int(np.argmin(above))
    longest = run = 0.0
    for is_above, seconds in zip(np.roll(above, -start), np.roll(weight, -start), strict=True):
        run = run + seconds if is_above else 0.0
        longest = max(longest, run)
    return longest


@np.errstate(all="ignore")  # motors that are far too small run away beyond all numbers
def temperatures(motors, heats, ambient):
    """Largest winding and housing temperature (m, 2) of m motors in the periodic state, extrema inside intervals too.

    Each interval is a linear system x' = A x + b of winding and housing, solved by the eigenvalues of A.
    """
    inner = np.array([motor.resistance_winding_housing for motor in motors])
    outer = np.array([motor.resistance_housing_ambient for motor in motors])
    winding = np.array([motor.time_constant_winding for motor in motors]) / inner
    housing = np.array([motor.time_constant_motor for motor in motors]) / outer
    shares = np.array([heat_share(motor) for motor in motors])
    seconds = heats[0][0]
    matrices, shifts, systems = [], [], []
    for k, duration in enumerate(seconds):
        copper = np.array([heat[1][k] for heat in heats])
        rubbing = shares * np.array([heat[2][k] for heat in heats])
        a = np.empty((len(motors), 2, 2))
        a[:, 0, 0], a[:, 0, 1] = (ALPHA * copper - 1.0 / inner) / winding, 1.0 / (inner * winding)
        a[:, 1, 0], a[:, 1, 1] = 1.0 / (inner * housing), -(1.0 / inner + 1.0 / outer) / housing
        b = np.stack([copper * (1.0 - 25.0 * ALPHA) / winding, (rubbing + ambient / outer) / housing], axis=1)
        values, vectors = np.linalg.eig(a)
        inverse = np.linalg.inv(vectors)
        flow = np.einsum("mij,mj,mjk->mik", vectors, np.exp(values * duration), inverse)
        rest = -np.linalg.solve(a, b[:, :, None])[:, :, 0]
        matrices.append(flow)
        shifts.append(rest - np.einsum("mij,mj->mi", flow, rest))
        systems.append((a, values, vectors, inverse, rest))
    whole, shift = np.broadcast_to(np.eye(2), (len(motors), 2, 2)), np.zeros((len(motors), 2))
    for flow, moved in zip(matrices, shifts, strict=True):
        whole, shift = flow @ whole, np.einsum("mij,mj->mi", flow, shift) + moved
    settles = np.isfinite(whole).all(axis=(1, 2))
    settles[settles] = np.abs(np.linalg.eigvals(whole[settles])).max(axis=1) < 1.0
    whole = np.where(settles[:, None, None], whole, 0.0)
    state = np.linalg.solve(np.eye(2) - whole, shift[:, :, None])[:, :, 0]
    peak = state.copy()
    for (_, values, vectors, inverse, rest), flow, moved, duration in zip(
        systems, matrices, shifts, seconds, strict=True
    ):
        parts = (
            vectors * np.einsum("mij,mj->mi", inverse, state - rest)[:, None, :]
        )  # x_i = rest_i + Σ_j parts_ij e^(λ_j t)
        ratio = -(parts[:, :, 1] * values[:, None, 1]) / (parts[:, :, 0] * values[:, None, 0])
        time = np.log(ratio) / (values[:, 0] - values[:, 1])[:, None]
        value = rest + (parts * np.exp(values[:, None, :] * time[:, :, None])).sum(axis=2)
        inside = (time > 0.0) & (time < duration)
        peak = np.where(inside, np.maximum(peak, value), peak)
        state = np.einsum("mij,mj->mi", flow, state) + moved
        peak = np.maximum(peak, state)
    return np.where(settles[:, None], peak, np.inf)


@pytest.mark.parametrize("robot", [arm_2r, ur5], ids=["2R", "UR5"])
def test_verdicts_and_ranks_equal_brute_force(robot):
    arm, motions = robot()
    catalogue = sized_catalogue(7, 9, 7, largest=100.0)
    loads = axis_loads(mechanism_of(arm), motions)
    axes = axis_pairs(loads.axes, [catalogue] * len(loads.axes), {})
    problem = JudgedAxes(loads, axes, [CONDITIONS] * len(axes), CONDITIONS, "mass", feedback=False)
    tiers = np.zeros(3, dtype=int)
    for axis, one in enumerate(axes):
        judgement = problem.judgement(axis, (-2,) * len(axes))
        names = [criterion.name for criterion in judgement.criteria]
        rows = [one.pairs.rows(pair) for pair in range(len(one.pairs))]
        assert rows == [(motor, gear) for motor in catalogue.motors for gear in (DIRECT, *catalogue.gears)]
        expected = [{} for _ in rows]
        losses = np.full(len(rows), -np.inf)
        for cycle in loads.cycles:
            judged, plain = Sampled(cycle, axis, CONDITIONS.safety_factor), Sampled(cycle, axis, 1.0)
            found = [brute_force(motor, gear, judged, CONDITIONS) for motor, gear in rows]
            hottest = temperatures([motor for motor, _ in rows], [heat for _, heat in found], CONDITIONS.ambient)
            for pair, ((uses, _), (motor, gear)) in enumerate(zip(found, rows, strict=True)):
                limits = np.array([motor.max_winding_temperature, motor.max_housing_temperature])
                rise = (hottest[pair] - CONDITIONS.ambient) / (limits - CONDITIONS.ambient)
                uses["winding temperature"], uses["housing temperature"] = rise
                for name, use in uses.items():
                    expected[pair][name] = max(use, expected[pair].get(name, 0.0))
                losses[pair] = max(losses[pair], mean_loss(motor, gear, plain))
        largest = np.array([max(uses.values()) for uses in expected])
        np.testing.assert_array_equal(judgement.tier == 2, largest > 1.0)
        np.testing.assert_array_equal(judgement.tier == 0, largest <= 1.0)
        passing = np.flatnonzero(largest <= 1.0)
        np.testing.assert_allclose(judgement.largest_use[passing], largest[passing], rtol=1e-9)
        np.testing.assert_allclose(judgement.loss[passing], losses[passing], rtol=1e-9)
        for pair, uses in enumerate(expected):
            for name, use in uses.items():
                verdict, found_use = judgement.verdict[names.index(name), pair], judgement.use[names.index(name), pair]
                if np.isfinite(found_use):
                    assert found_use == pytest.approx(use, rel=1e-9), (one.axis.name, rows[pair], name)
                assert verdict not in (INSIDE, EXCEEDED) or (verdict == INSIDE) == (use <= 1.0)
        tiers += np.bincount(judgement.tier, minlength=3)
        ranked = sorted(
            range(len(rows)),
            key=lambda pair: (
                largest[pair] > 1.0,
                round(rows[pair][0].mass + rows[pair][1].mass, 9),
                largest[pair],
                pair,
            ),
        )
        keys = problem.keys(axis, (-2,) * len(axes))
        order = np.lexsort(keys.T[::-1])
        assert order[: len(passing)].tolist() == ranked[: len(passing)]
    assert tiers[0] > 10 and tiers[2] > 10
