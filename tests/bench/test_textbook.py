"""Analytic equations against Newton's law, conservation and one another."""

import numpy as np

from bellcrank_bench.textbook.planar_2r import PlanarTwoLink
from bellcrank_bench.textbook.spring_pendulum import SpringPendulum, cartesian, polar

PENDULUM = SpringPendulum()


def pendulum_states(count, seed=3):
    random = np.random.default_rng(seed)
    q = np.column_stack([random.uniform(-3, 3, count), random.uniform(1, 9, count)])
    return q, random.normal(0, 2, (count, 2))


def test_spring_pendulum_obeys_newtons_law_in_cartesian_coordinates():
    q, v = pendulum_states(200)
    a = PENDULUM.forward_dynamics(q, v)
    coriolis, centrifugal, tangential = PENDULUM.accelerations(q, v)
    along = np.column_stack([np.sin(q[:, 0]), -np.cos(q[:, 0])])
    across = np.column_stack([np.cos(q[:, 0]), np.sin(q[:, 0])])
    acceleration = (a[:, 1] - centrifugal)[:, None] * along + (tangential + coriolis)[:, None] * across
    spring = -PENDULUM.stiffness * (q[:, 1] - PENDULUM.free_length)
    force = spring[:, None] * along + PENDULUM.mass * np.array([0.0, -PENDULUM.g])
    np.testing.assert_allclose(PENDULUM.mass * acceleration, force, rtol=0, atol=1e-11)


def test_spring_pendulum_keeps_its_energy_at_every_state():
    q, v = (array.astype(np.longdouble) for array in pendulum_states(200))
    x = np.concatenate([q, v], -1)
    rate, h = PENDULUM.derivative(x), np.longdouble(1e-6)
    energy = [sum(PENDULUM.energy(y[:, :2], y[:, 2:])) for y in (x - h * rate, x + h * rate)]
    power = (energy[1] - energy[0]) / (2 * h)
    assert np.abs(power).max() < 1e-7 * np.abs(energy[0]).max()


def test_spring_pendulum_at_rest_below_its_pivot_bounces_at_the_springs_frequency():
    rest = PENDULUM.free_length + PENDULUM.mass * PENDULUM.g / PENDULUM.stiffness
    shift = 0.1
    a = PENDULUM.forward_dynamics(np.array([0.0, rest + shift]), np.zeros(2))
    np.testing.assert_allclose(a, [0.0, -PENDULUM.stiffness / PENDULUM.mass * shift], atol=1e-13)


def test_polar_coordinates_invert_cartesian_ones():
    for q, v in zip(*pendulum_states(20), strict=True):
        place, speed = cartesian((*q, *v))
        h = 1e-6
        points = np.array([np.subtract(place, np.multiply(h, speed)), np.add(place, np.multiply(h, speed))])
        ends = polar(points)
        np.testing.assert_allclose(ends.mean(axis=0), q, atol=1e-9)
        np.testing.assert_allclose((ends[1] - ends[0]) / (2 * h), v, atol=1e-6)


def test_planar_arm_rates_are_its_forward_dynamics_without_torques():
    arm = PlanarTwoLink(l1=0.8, m1=3.0, m2=7.0, r1=0.3, r2=0.4, i1=0.2, i2=0.5)
    random = np.random.default_rng(4)
    q, v = random.uniform(-3, 3, (200, 2)), random.normal(0, 2, (200, 2))
    rates = arm.derivative(np.concatenate([q, v], -1))
    np.testing.assert_array_equal(rates[:, :2], v)
    np.testing.assert_allclose(rates[:, 2:], arm.forward_dynamics(q, v, np.zeros((200, 2))), rtol=1e-10, atol=1e-11)


def test_planar_arm_rates_stay_in_extended_precision():
    x = np.array([-1.2, 0.4, 0.3, -0.2], dtype=np.longdouble)
    assert PlanarTwoLink().derivative(x).dtype == np.longdouble
    assert PENDULUM.derivative(x + 3).dtype == np.longdouble
