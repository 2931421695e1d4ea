"""Bodies that nothing holds: one that spins about its middle axis and flips, and a humanoid that falls."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.trajectory import Trajectory
from bellcrank_bench.problems import urdf_texts
from bellcrank_bench.problems.problem import Array, Figure, Problem, ended, largest, scene_of

INERTIA = (1.0, 2.0, 3.0)  # kg m²
SPIN = 2 * pi  # rad/s: a turn a second
WOBBLE = 0.01 * SPIN  # rad/s about the third axis
MOMENTA = {f"{kind}_momentum": {"momentum": kind} for kind in ("linear", "angular")}


def spinning_scene() -> Scene:
    """A free body in no gravity, turned out of the world's axes, spinning about its middle axis with a wobble."""
    base = {
        "rpy": [0.3, -0.4, 0.5], "linear_velocity": [0.1, 0.2, -0.3], "angular_velocity": [0.0, SPIN, WOBBLE],
        "expressed_in": "body",
    }  # fmt: skip
    data = {"gravity": [0.0, 0.0, 0.0], "floating_base": True, "base": base, "outputs": MOMENTA}
    return scene_of(urdf_texts.free_body(INERTIA), data)


def judge_flips(run: Trajectory) -> list[Figure]:
    """Known: angular velocity in Jacobi's elliptic functions; the base's own axes are the principal ones.

    Source: L. Landau, E. Lifshitz, Mechanics (1976), §37.
    """
    expected = spin_closed_form(run.time)
    flips = np.count_nonzero(np.diff(np.sign(expected[:, 1])))
    return [
        ended(run),
        Figure("angular velocity", largest(run.velocity[:, 3:6] - expected), 1e-8, "rad/s"),
        Figure("flips", float(flips), 4.0, "", at_least=True),
    ]


def judge_thousand_turns(run: Trajectory) -> list[Figure]:
    """Known: energy and both momenta stay, and a quaternion has length 1."""
    return [
        ended(run),
        Figure("energy drift", run.energy_drift(), 1e-9),
        Figure("angular momentum drift", _drift(run.output("angular_momentum")), 1e-9, "relative"),
        Figure("linear momentum drift", _drift(run.output("linear_momentum")), 1e-9, "relative"),
        Figure("quaternion off length 1", run.constraint_residual(), 1e-12),
    ]


def spin_closed_form(times: Array) -> Array:
    """Angular velocity (n, 3), rad/s, in the body's axes, from (0, SPIN, WOBBLE) at time 0."""
    from scipy.special import ellipj, ellipkm1

    i1, i2, i3 = INERTIA
    start = np.array([0.0, SPIN, WOBBLE])
    energy = 2 * np.sum(np.array(INERTIA) * start**2) / 2  # 2 E
    momentum = np.sum((np.array(INERTIA) * start) ** 2)  # M²; here M² > 2 E I2
    high, low = energy * i3 - momentum, momentum - energy * i1
    rest = WOBBLE**2 * i3 * (i3 - i1) / low  # 1 - k², exact: the third component is least at time 0
    tau = times * sqrt((i3 - i2) * low / (i1 * i2 * i3)) + ellipkm1(rest)  # at time 0 sn = 1
    sn, cn, dn, _ = ellipj(tau, 1.0 - rest)
    sizes = np.sqrt([high / (i1 * (i3 - i1)), high / (i2 * (i3 - i2)), low / (i3 * (i3 - i1))])
    return np.stack([cn, sn, dn], -1) * sizes


# ---- a humanoid


def judge_humanoid(run: Trajectory) -> list[Figure]:
    """Known: gravity alone acts, so linear momentum changes by m g t, angular momentum about the centre of mass stays,
    and the centre of mass moves on its parabola; Pinocchio's own centroidal momentum at the end is the second route.
    """
    import pinocchio as pin

    model = run.robot.model
    data = model.createData()
    gravity, mass, t = np.array(run.robot.gravity), pin.computeTotalMass(model), run.time[:, None]
    linear, angular = run.output("linear_momentum"), run.output("angular_momentum")
    start = np.array(pin.centerOfMass(model, data, run.position[0]))
    centre = start + linear[0] / mass * t + gravity * t * t / 2
    about_centre = angular - np.cross(centre, linear)
    last = pin.computeCentroidalMomentum(model, data, run.position[-1], run.velocity[-1])
    end = np.array(pin.centerOfMass(model, data, run.position[-1]))
    size, turning = largest(linear), largest(last.angular)
    return [
        ended(run),
        Figure("linear momentum", largest(linear - linear[0] - mass * gravity * t) / size, 1e-9, "relative"),
        Figure("angular momentum about the centre", _drift(about_centre), 1e-9, "relative"),
        Figure("centre of mass off its parabola", largest(centre[-1] - end), 1e-9, "m"),
        Figure("linear, by Pinocchio", largest(linear[-1] - last.linear) / size, 1e-12, "relative"),
        Figure("angular, by Pinocchio", largest(about_centre[-1] - last.angular) / turning, 1e-9, "relative"),
        Figure("energy drift", run.energy_drift(), 1e-9),
        Figure("quaternion off length 1", run.constraint_residual(), 1e-12),
    ]  # fmt: skip


def _drift(rows: Array) -> float:
    return largest(rows - rows[0]) / float(np.linalg.norm(rows[0]))


FINE = {"rtol": 1e-12, "atol": 1e-12}
PROBLEMS = (
    Problem(
        "middle_axis_flips", "free body about its middle axis, the first flips", spinning_scene, judge_flips,
        FINE | {"duration": 20.0},
    ),
    Problem(
        "middle_axis_1000_turns", "free body about its middle axis, 1,000 turns", spinning_scene, judge_thousand_turns,
        {"duration": 1000.0, "rtol": 1e-13, "atol": 1e-14, "samples": 10_001},  # at 1e-12 momentum drifts by 2e-8
    ),
    Problem(
        "humanoid_fall", "Talos in free fall, 1 s", lambda: load_scene("talos_free_fall"), judge_humanoid,
        {"duration": 1.0, "rtol": 1e-11, "atol": 1e-11, "samples": 101},
    ),
)  # fmt: skip
