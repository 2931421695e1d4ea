"""Compiled dynamics with constraints against the textbook's equations with multipliers."""

from __future__ import annotations

from typing import Any

import numpy as np

from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.scene.scene import Scene
from bellcrank.simulation.simulate import simulate
from bellcrank_bench.textbook.four_bar import FourBarWithMultipliers
from bellcrank_bench.textbook.integrate import Array, integrate
from bellcrank_bench.textbook.rolling_disk import SixCoordinateDisk, free_base, free_base_rate
from bellcrank_bench.verification.difference import Difference, difference, run_differences

FINE: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-12}


def verify_four_bar(scene: Scene, samples: int = 1000, seed: int = 1) -> list[Difference]:
    """Differences of the four-bar: accelerations, multipliers and kinetic energy at random states of both branches and
    along the run to its lock, then the run itself against SciPy's DOP853.
    """
    equations, random = FourBarWithMultipliers(), np.random.default_rng(seed)
    crank, rate = random.uniform(0.2, 2.4, samples), random.normal(0.0, 2.0, samples)
    found = []
    run = simulate(scene, **FINE)
    for states, (q, v) in (
        ("random", equations.closed(crank, rate, random.choice([-1.0, 1.0], samples))),
        ("run", (run.position, run.velocity)),
    ):
        acceleration, energies, multipliers = _evaluated(scene, q, v)
        expected, forces = equations.accelerations(q, v)
        found += [
            difference("accelerations", states, acceleration, expected),
            difference("multipliers", states, multipliers, forces),
            difference("kinetic energy", states, energies[:, 0], equations.energy(q, v)[0]),
        ]
    x = integrate(equations.derivative, np.r_[run.position[0], run.velocity[0]], run.time)
    return found + run_differences(run, x[:, :3], x[:, 3:])


def verify_rolling_disk(scene: Scene, samples: int = 1000, seed: int = 1) -> list[Difference]:
    """Differences of the disk with a floating base from the lecture's six coordinates: accelerations, contact force and
    energies at random rolling states, then the run itself against SciPy's DOP853.
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
    run = simulate(scene, rtol=1e-13, atol=1e-13)  # the motion amplifies errors tenfold at each least tilt
    tilt, heading = np.radians(10.0), np.radians(45.0)  # case A of the lecture
    start = np.array([0.0, 0.0, disk.radius * np.cos(tilt), heading, tilt, 0.0])
    x = integrate(disk.derivative, np.r_[start, disk.velocity(start, np.radians([0.0, 100.0, 200.0]))], run.time)
    place, speed = free_base(x[:, :6], x[:, 6:])
    sign = np.sign(
        (run.position[:, 3:] * place[:, 3:]).sum(-1, keepdims=True)
    )  # a quaternion and its negative are one rotation
    place[:, 3:] *= sign
    return found + run_differences(run, place, speed)


def _evaluated(scene: Scene, q: Array, v: Array) -> tuple[Array, Array, Array]:
    """Accelerations (n, nv), energies (n, 2) and multipliers (n, rows) by the compiled equations."""
    n = len(q)
    arguments = np.zeros((n, 1)), np.hstack([q, v]), np.zeros((n, 0)), np.tile(system_parameters(scene), (n, 1))
    acceleration, energies, *_ = system_of(scene).observation(*arguments)
    return acceleration, energies, system_of(scene).constraint(*arguments)[0]
