"""Compiled dynamics against a textbook's equations, quantity by quantity: `verify` and what it can verify."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from bellcrank.dynamics.equations.system import system_of
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.robot.load import load_robot
from bellcrank.robot.robot import Robot
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.simulate import simulate
from bellcrank_bench.textbook.integrate import Array, integrate
from bellcrank_bench.textbook.planar_2r import PlanarTwoLink
from bellcrank_bench.textbook.spring_pendulum import SpringPendulum
from bellcrank_bench.verification import VERIFIABLE
from bellcrank_bench.verification.constrained import verify_four_bar, verify_rolling_disk
from bellcrank_bench.verification.difference import Difference, difference, run_differences


@dataclass(frozen=True)
class Textbook:
    """Analytic equations of a scene with two coordinates.

    Attributes:
        equations: The equations.
        draw: Function that returns a number of random positions (n, 2) and velocities (n, 2).
        outputs: The scene's outputs as functions of positions and velocities, by name.
    """

    equations: PlanarTwoLink | SpringPendulum
    draw: Callable[[np.random.Generator, int], tuple[Array, Array]]
    outputs: Mapping[str, Callable[[Array, Array], Array]]


def verify(name: str, samples: int = 1000) -> list[Difference]:
    """The differences of a bundled robot or scene. Raises InputError if there are no analytic equations for it."""
    if name not in VERIFIABLE:
        raise InputError("analytic equations: " + unknown_name("scene", name, VERIFIABLE))
    if name == "planar_2r":
        return verify_planar_2r(load_robot(name, gravity=(0.0, -9.81, 0.0), friction="none"), samples)
    if name in _CLOSED:
        return _CLOSED[name](load_scene(name), samples)
    return verify_scene(load_scene(name), _SCENES[name](), samples)


def verify_planar_2r(robot: Robot, samples: int = 1000, seed: int = 1) -> list[Difference]:
    """The differences of the planar 2R arm's compiled dynamics from its analytic equations.

    Inverse and forward dynamics, mass matrix and energy at random states (rad, rad/s, rad/s²), then inverse and forward
    dynamics along the lecture's circle on both branches.
    """
    if robot.nq != 2 or robot.nv != 2:
        raise InputError(f"{robot.name} has {robot.nv} joints; the analytic equations are those of a planar 2R arm")
    arm = PlanarTwoLink(g=-float(robot.gravity[1]))
    random = np.random.default_rng(seed)
    q, v = _arm_states(random, samples)
    a, tau = random.normal(0, 10, (samples, 2)), random.normal(0, 100, (samples, 2))
    here = "random"
    found = [
        difference("inverse dynamics", here, robot.inverse_dynamics(q, v, a), arm.inverse_dynamics(q, v, a)),
        difference("forward dynamics", here, robot.forward_dynamics(q, v, tau), arm.forward_dynamics(q, v, tau)),
        difference("mass matrix", here, robot.mass_matrix(q), arm.mass_matrix(q)),
    ]
    for name, ours, theirs in zip(
        ("kinetic energy", "potential energy"), robot.energy(q, v), arm.energy(q, v), strict=True
    ):
        found.append(difference(name, here, ours, theirs))
    phi = np.linspace(0, 2 * np.pi, samples + 1)
    for elbow, place in ((-1, "circle, elbow up"), (1, "circle, elbow down")):
        q, v, a = arm.circle(phi, 2 * np.pi / 10, elbow)
        torque = arm.inverse_dynamics(q, v, a)
        found.append(difference("inverse dynamics", place, robot.inverse_dynamics(q, v, a), torque))
        found.append(difference("forward dynamics", place, robot.forward_dynamics(q, v, torque), a))
    return found


def verify_scene(scene: Scene, textbook: Textbook, samples: int = 1000, seed: int = 1) -> list[Difference]:
    """The differences of a scene's compiled equations of motion from analytic ones.

    Accelerations, energies and outputs at random states and along the scene's own run, then the run itself against
    SciPy's DOP853 on the analytic equations: every row, and the last.
    """
    if system_of(scene).size != 4:
        raise InputError(f"{scene.name}: the analytic equations have 2 coordinates and 2 velocities and no work")
    x = np.hstack(textbook.draw(np.random.default_rng(seed), samples))
    found = _compare(scene, textbook, "random", x)
    run = simulate(scene, rtol=1e-12, atol=1e-12)
    found += _compare(scene, textbook, "run", run.state)
    x = integrate(textbook.equations.derivative, run.state[0], run.time)
    return found + run_differences(run, x[:, :2], x[:, 2:])


def _compare(scene: Scene, textbook: Textbook, states: str, x: Array) -> list[Difference]:
    """Accelerations, energies and outputs at states (n, 4)."""
    q, v = x[:, :2], x[:, 2:]
    time, inputs, parameters = (
        np.zeros((len(x), 1)),
        np.zeros((len(x), 0)),
        np.tile(scene.parameter_values, (len(x), 1)),
    )
    acceleration, energies, _, _, *outputs = system_of(scene).observation(time, x, inputs, parameters)
    kinetic, potential = textbook.equations.energy(q, v)
    found = [
        difference("accelerations", states, acceleration, textbook.equations.derivative(x)[:, 2:]),
        difference("kinetic energy", states, energies[:, 0], kinetic),
        difference("potential energy", states, energies[:, 1], potential),
    ]
    for name, rows in zip(scene.outputs, outputs, strict=True):
        if name in textbook.outputs:
            theirs = textbook.outputs[name](q, v)
            found.append(difference(name, states, rows.reshape(theirs.shape), theirs))
    return found


def _arm_states(random: np.random.Generator, samples: int) -> tuple[Array, Array]:
    return random.uniform(-np.pi, np.pi, (samples, 2)), random.normal(0, 3, (samples, 2))


def _pendulum_states(random: np.random.Generator, samples: int) -> tuple[Array, Array]:
    q = np.stack([random.uniform(-np.pi, np.pi, samples), random.uniform(1.0, 10.0, samples)], -1)
    return q, random.normal(0, 3, (samples, 2))


def _swing() -> Textbook:
    arm = PlanarTwoLink()

    def tip(q: Array, v: Array) -> Array:
        first, both = q[:, 0], q[:, 0] + q[:, 1]
        x, y = arm.l1 * np.cos(first) + arm.l2 * np.cos(both), arm.l1 * np.sin(first) + arm.l2 * np.sin(both)
        return np.stack([x, y, np.zeros_like(x)], -1)

    return Textbook(arm, _arm_states, {"tip": tip, "energy": lambda q, v: sum(arm.energy(q, v), np.zeros(len(q)))})


def _spring() -> Textbook:
    pendulum = SpringPendulum()

    def part(k: int) -> Callable[[Array, Array], Array]:
        return lambda q, v: pendulum.accelerations(q, v)[k]

    outputs = {name: part(k) for k, name in enumerate(("coriolis", "centrifugal", "tangential"))}
    return Textbook(pendulum, _pendulum_states, outputs)


_SCENES: dict[str, Callable[[], Textbook]] = {"planar_2r_swing": _swing, "spring_pendulum": _spring}
_CLOSED: dict[str, Callable[[Scene, int], list[Difference]]] = {
    "four_bar": verify_four_bar,
    "rolling_disk": verify_rolling_disk,
}
