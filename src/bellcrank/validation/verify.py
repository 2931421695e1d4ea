"""Compiled dynamics against a textbook's equations, quantity by quantity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bellcrank.errors import InputError, among
from bellcrank.robot.load import load_robot
from bellcrank.robot.robot import Robot
from bellcrank.validation.textbook import Array, PlanarTwoLink

TOLERANCE = 1e-11  # relative to the largest entry: some 100 roundings of the two routes
VERIFIABLE = ("planar_2r",)


@dataclass(frozen=True)
class Difference:
    """How far one quantity of two routes lies apart, as a share of its largest entry, over how many states."""

    quantity: str
    states: str
    samples: int
    relative: float

    @property
    def agrees(self) -> bool:
        """Whether the difference is within the tolerance."""
        return self.relative <= TOLERANCE


def verify_planar_2r(robot: Robot, samples: int = 1000, seed: int = 1) -> list[Difference]:
    """Compiled Pinocchio of the planar 2R arm against its analytic equations.

    Inverse and forward dynamics, mass matrix and energy at random states (rad, rad/s, rad/s²), then inverse
    dynamics and forward dynamics along the lecture's circle on both branches.
    """
    if robot.nq != 2 or robot.nv != 2:
        raise InputError(f"{robot.name} has {robot.nv} joints; the analytic equations are those of a planar 2R arm")
    arm = PlanarTwoLink(g=-float(robot.gravity[1]))
    random = np.random.default_rng(seed)
    q = random.uniform(-np.pi, np.pi, (samples, 2))
    v, a, tau = (
        random.normal(0, 3, (samples, 2)),
        random.normal(0, 10, (samples, 2)),
        random.normal(0, 100, (samples, 2)),
    )
    here = "random"
    found = [
        _difference("inverse dynamics", here, robot.inverse_dynamics(q, v, a), arm.inverse_dynamics(q, v, a)),
        _difference("forward dynamics", here, robot.forward_dynamics(q, v, tau), arm.forward_dynamics(q, v, tau)),
        _difference("mass matrix", here, robot.mass_matrix(q), arm.mass_matrix(q)),
    ]
    for name, ours, theirs in zip(
        ("kinetic energy", "potential energy"), robot.energy(q, v), arm.energy(q, v), strict=True
    ):
        found.append(_difference(name, here, ours, theirs))
    phi = np.linspace(0, 2 * np.pi, samples + 1)
    for elbow, place in ((-1, "circle, elbow up"), (1, "circle, elbow down")):
        q, v, a = arm.circle(phi, 2 * np.pi / 10, elbow)
        torque = arm.inverse_dynamics(q, v, a)
        found.append(_difference("inverse dynamics", place, robot.inverse_dynamics(q, v, a), torque))
        found.append(_difference("forward dynamics", place, robot.forward_dynamics(q, v, torque), a))
    return found


def verify(name: str) -> list[Difference]:
    """Verify a shipped robot by name. Raises InputError where no analytic equations are known for it."""
    if name not in VERIFIABLE:
        raise InputError("analytic equations: " + among("scene", name, VERIFIABLE))
    return verify_planar_2r(load_robot(name, gravity=(0.0, -9.81, 0.0), friction="none"))


def _difference(quantity: str, states: str, ours: Array, theirs: Array) -> Difference:
    gap, scale = np.abs(ours - theirs).max(), np.abs(theirs).max()
    return Difference(quantity, states, len(ours), float(gap / scale) if np.isfinite(gap) else float("inf"))
