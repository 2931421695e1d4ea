"""Compiled constrained dynamics against a textbook's equations with multipliers (textbook_closed.py)."""

from __future__ import annotations

from typing import Any

import numpy as np

from bellcrank.dynamics.system import system_of, system_parameters
from bellcrank.scene.scene import Scene
from bellcrank.simulation.simulate import simulate
from bellcrank.simulation.trajectory import Trajectory
from bellcrank_bench.textbook.closed_linkages import Array, ClosedFourBar, SixCoordinateDisk, solve_along
from bellcrank_bench.verify.difference import DRIFT_APART, Difference, difference

FINE: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-12}


def verify_four_bar(scene: Scene, samples: int = 1000, seed: int = 1) -> list[Difference]:
    """The four-bar: accelerations, multipliers and kinetic energy at random closed states of both branches and along
    the run to its lock, then the run against SciPy's DOP853.
    """
    book, random = ClosedFourBar(), np.random.default_rng(seed)
    crank, rate = random.uniform(0.2, 2.4, samples), random.normal(0.0, 2.0, samples)
    found = []
    run = simulate(scene, **FINE)
    for states, (q, v) in (
        ("random", book.closed(crank, rate, random.choice([-1.0, 1.0], samples))),
        ("run", (run.position, run.velocity)),
    ):
        acceleration, energies, multipliers = _evaluated(scene, q, v)
        expected, forces = book.accelerations(q, v)
        found += [
            difference("accelerations", states, acceleration, expected),
            difference("multipliers", states, multipliers, forces),
            difference("kinetic energy", states, energies[:, 0], book.energy(q, v)[0]),
        ]
    x = solve_along(book.derivative, np.r_[run.position[0], run.velocity[0]], run.time)
    return found + _along(run, x[:, :3], x[:, 3:])


def verify_rolling_disk(scene: Scene, samples: int = 1000, seed: int = 1) -> list[Difference]:
    """The disk on its free base against the six coordinates: accelerations, contact force and energies at random
    rolling states, then the run against SciPy's DOP853.
    """
    disk, random = SixCoordinateDisk(), np.random.default_rng(seed)
    q = np.concatenate([random.normal(0.0, 1.0, (samples, 3)), random.uniform(-1.2, 1.2, (samples, 3))], -1)
    q[:, 2] = disk.radius * np.cos(q[:, 4])
    v = disk.velocity(q, random.normal(0.0, 3.0, (samples, 3)))
    acceleration, energies, multipliers = _evaluated(scene, *free_base(q, v))
    expected, force = disk.accelerations(q, v)
    kinetic, potential = disk.energy(q, v)
    found = [
        difference("accelerations", "random", acceleration, free_base_rate(q, v, expected)),
        difference("normal force", "random", multipliers[:, 0], force[:, 2]),
        difference(
            "friction", "random", np.linalg.norm(multipliers[:, 1:], axis=1), np.linalg.norm(force[:, :2], axis=1)
        ),
        difference("kinetic energy", "random", energies[:, 0], kinetic),
        difference("potential energy", "random", energies[:, 1], potential),
    ]
    run = simulate(scene, rtol=1e-13, atol=1e-13)  # its least tilts are sharp, and spread errors tenfold
    tilt, heading = np.radians(10.0), np.radians(45.0)  # case A of the lecture
    start = np.array([0.0, 0.0, disk.radius * np.cos(tilt), heading, tilt, 0.0])
    x = solve_along(disk.derivative, np.r_[start, disk.velocity(start, np.radians([0.0, 100.0, 200.0]))], run.time)
    place, speed = free_base(x[:, :6], x[:, 6:])
    sign = np.sign((run.position[:, 3:] * place[:, 3:]).sum(-1, keepdims=True))  # a quaternion and its negative are one
    place[:, 3:] *= sign
    return found + _along(run, place, speed)


def free_base(q: Array, v: Array) -> tuple[Array, Array]:
    """Position with quaternion x y z w (n, 7), and velocity in the body's axes (n, 6), of the lecture's coordinates."""
    quaternion = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (len(q), 4))
    for axis, angle in zip((2, 0, 1), q[:, 3:].T, strict=True):
        half = np.zeros((len(q), 4))
        half[:, axis], half[:, 3] = np.sin(angle / 2), np.cos(angle / 2)
        quaternion = _product(quaternion, half)
    turn = _rotations(q)
    linear = np.einsum("nji,nj->ni", turn, v[:, :3])
    return np.concatenate([q[:, :3], quaternion], -1), np.concatenate([linear, _spin(q, v)[0]], -1)


def free_base_rate(q: Array, v: Array, a: Array) -> Array:
    """The rate (n, 6) of the velocity in the body's axes."""
    turn = _rotations(q)
    omega, still = _spin(q, v)
    linear = np.einsum("nji,nj->ni", turn, a[:, :3]) - np.cross(omega, np.einsum("nji,nj->ni", turn, v[:, :3]))
    return np.concatenate([linear, _spin(q, a)[0] + still], -1)


def _spin(q: Array, v: Array) -> tuple[Array, Array]:
    """Angular velocity (n, 3) in the body's axes, and its rate at constant rates of the angles."""
    (s2, c2), (s3, c3) = ((np.sin(x), np.cos(x)) for x in (q[:, 4], q[:, 5]))
    w1, w2, w3 = v[:, 3:].T
    x, y, z = w2, w3 + s2 * w1, c2 * w1  # in the axes after heading and tilt
    omega = np.stack([c3 * x - s3 * z, y, s3 * x + c3 * z], -1)
    dy, dz = c2 * w2 * w1, -s2 * w2 * w1
    rate = np.stack([-s3 * dz - w3 * omega[:, 2], dy, c3 * dz + w3 * omega[:, 0]], -1)
    return omega, rate


def _rotations(q: Array) -> Array:
    """Rotations (n, 3, 3) from the body to the world: heading about Z, tilt about X, spin about Y."""
    whole = np.broadcast_to(np.eye(3), (len(q), 3, 3))
    for axis, angle in zip((2, 0, 1), q[:, 3:].T, strict=True):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turn = np.zeros((len(q), 3, 3))
        turn[:, axis, axis] = 1.0
        turn[:, i, i] = turn[:, j, j] = np.cos(angle)
        turn[:, j, i] = np.sin(angle)
        turn[:, i, j] = -turn[:, j, i]
        whole = whole @ turn
    return whole


def _product(a: Array, b: Array) -> Array:
    """The product (n, 4) of quaternions x y z w."""
    va, wa, vb, wb = a[:, :3], a[:, 3:], b[:, :3], b[:, 3:]
    scalar = wa * wb - (va * vb).sum(-1, keepdims=True)
    return np.concatenate([wa * vb + wb * va + np.cross(va, vb), scalar], -1)


def _evaluated(scene: Scene, q: Array, v: Array) -> tuple[Array, Array, Array]:
    """Accelerations (n, nv), energies (n, 2) and multipliers (n, rows) of the compiled equations."""
    n = len(q)
    arguments = np.zeros((n, 1)), np.hstack([q, v]), np.zeros((n, 0)), np.tile(system_parameters(scene), (n, 1))
    acceleration, energies, *_ = system_of(scene).observation(*arguments)
    return acceleration, energies, system_of(scene).constraint(*arguments)[0]


def _along(run: Trajectory, q: Array, v: Array) -> list[Difference]:
    found = []
    for states, rows in (("run, SciPy's DOP853", slice(None)), ("its end", slice(-1, None))):
        for quantity, ours, theirs in (("positions", run.position, q), ("velocities", run.velocity, v)):
            found.append(difference(quantity, states, ours[rows], theirs[rows], DRIFT_APART))
    return found
