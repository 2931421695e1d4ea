"""Reference problems of free bodies: a spin about the intermediate axis that flips, and a humanoid in free fall."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.trajectory.trajectory import Trajectory
from bellcrank_bench.problems import urdf_texts
from bellcrank_bench.problems.checks import Array, Check, finished, largest
from bellcrank_bench.problems.problem import Problem, scene_of

INERTIA = (1.0, 2.0, 3.0)  # kg m²
SPIN = 2 * pi  # rad/s: a turn a second
WOBBLE = 0.01 * SPIN  # rad/s about the third axis
MOMENTA = {f"{kind}_momentum": {"momentum": kind} for kind in ("linear", "angular")}


def spinning_scene() -> Scene:
    """A body without gravity, rotated against the world, spinning about its intermediate axis with a wobble."""
    base = {
        "rpy": [0.3, -0.4, 0.5], "linear_velocity": [0.1, 0.2, -0.3], "angular_velocity": [0.0, SPIN, WOBBLE],
        "expressed_in": "body",
    }  # fmt: skip
    data = {"gravity": [0.0, 0.0, 0.0], "floating_base": True, "base": base, "outputs": MOMENTA}
    return scene_of(urdf_texts.free_body(INERTIA), data)


def judge_flips(run: Trajectory) -> list[Check]:
    """Known: the angular velocity in Jacobi's elliptic functions; the base's own axes are the principal axes.

    Source: L. Landau, E. Lifshitz, Mechanics (1976), §37.
    """
    expected = spin_closed_form(run.time)
    flips = np.count_nonzero(np.diff(np.sign(expected[:, 1])))
    return [
        finished(run),
        Check("angular velocity", largest(run.velocity[:, 3:6] - expected), 1e-8, "rad/s"),
        Check("flips", float(flips), 4.0, "", at_least=True),
    ]


def judge_thousand_turns(run: Trajectory) -> list[Check]:
    """Known: energy and both momenta are conserved, and a quaternion has norm 1."""
    return [
        finished(run),
        Check("energy drift", run.energy_drift(), 1e-9),
        Check("angular momentum drift", _drift(run.output("angular_momentum")), 1e-9, "relative"),
        Check("linear momentum drift", _drift(run.output("linear_momentum")), 1e-9, "relative"),
        Check("norm of the quaternion, difference from 1", run.constraint_residual(), 1e-12),
    ]


def spin_closed_form(times: Array) -> Array:
    """Angular velocity (n, 3), rad/s, in the body's axes, from (0, SPIN, WOBBLE) at time 0."""
    from scipy.special import ellipj, ellipkm1

    i1, i2, i3 = INERTIA
    start = np.array([0.0, SPIN, WOBBLE])
    energy = 2 * np.sum(np.array(INERTIA) * start**2) / 2  # 2 E
    momentum = np.sum((np.array(INERTIA) * start) ** 2)  # M²; here M² > 2 E I2
    high, low = energy * i3 - momentum, momentum - energy * i1
    rest = WOBBLE**2 * i3 * (i3 - i1) / low  # 1 - k², without cancellation: the third component is least at time 0
    tau = times * sqrt((i3 - i2) * low / (i1 * i2 * i3)) + ellipkm1(rest)  # at time 0 sn = 1
    sn, cn, dn, _ = ellipj(tau, 1.0 - rest)
    sizes = np.sqrt([high / (i1 * (i3 - i1)), high / (i2 * (i3 - i2)), low / (i3 * (i3 - i1))])
    return np.stack([cn, sn, dn], -1) * sizes


# ---- a humanoid


def judge_humanoid(run: Trajectory) -> list[Check]:
    """Known: gravity alone acts, so linear momentum changes by m g t, angular momentum about the centre of mass is
    conserved, and the centre of mass moves on a parabola; and Pinocchio's own centroidal momentum at the end.
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
        finished(run),
        Check("linear momentum", largest(linear - linear[0] - mass * gravity * t) / size, 1e-9, "relative"),
        Check("angular momentum about the centre", _drift(about_centre), 1e-9, "relative"),
        Check("centre of mass against its parabola", largest(centre[-1] - end), 1e-9, "m"),
        Check("linear, by Pinocchio", largest(linear[-1] - last.linear) / size, 1e-12, "relative"),
        Check("angular, by Pinocchio", largest(about_centre[-1] - last.angular) / turning, 1e-9, "relative"),
        Check("energy drift", run.energy_drift(), 1e-9),
        Check("norm of the quaternion, difference from 1", run.constraint_residual(), 1e-12),
    ]  # fmt: skip


def _drift(rows: Array) -> float:
    return largest(rows - rows[0]) / float(np.linalg.norm(rows[0]))


PROBLEMS = (
    Problem(
        name="middle_axis_flips",
        title="free body about its intermediate axis, the first flips",
        source="L. Landau, E. Lifshitz, Mechanics (1976), §37",
        make=spinning_scene,
        judge=judge_flips,
        settings={"rtol": 1e-12, "atol": 1e-12, "duration": 20.0},
    ),
    Problem(
        name="middle_axis_1000_turns",
        title="free body about its intermediate axis, 1,000 turns",
        source="conservation of energy and momentum",
        make=spinning_scene,
        judge=judge_thousand_turns,
        # at rtol = 1e-12 the momentum drifts by 2e-8
        settings={"duration": 1000.0, "rtol": 1e-13, "atol": 1e-14, "samples": 10_001},
    ),
    Problem(
        name="humanoid_fall",
        title="Talos in free fall, 1 s",
        source="conservation of momentum, and Pinocchio's centroidal momentum",
        make=lambda: load_scene("talos_free_fall"),
        judge=judge_humanoid,
        settings={"duration": 1.0, "rtol": 1e-11, "atol": 1e-11, "samples": 101},
    ),
)
