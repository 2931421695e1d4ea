"""The motion and the motors of a two-link arm that carries a weight, by optimisation, next to MAPTOR's collocation.

The arm lifts its tip, on which a weight acts as a force, from (0.3, 0.1) m to (−0.6, 0.1) m, from rest to rest. The
objective is T + 0.1 (0.08 τ₁ + 0.05 τ₂) + 0.01 ∫ (τ₁² + τ₂²) dt with the largest torques τ₁ and τ₂, at most
100 N m; speeds are at most 2 rad/s, and the tip stays above 0.05 m. bellcrank has a motion through waypoints at given
shares of its duration, which is a variable, as the inner postures are.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.motion.motion import Motion
from bellcrank.scene.scene import Scene
from bellcrank.studies.execution.sizing_runner import SizingRunner
from bellcrank.studies.optimisation.optimise import optimise
from bellcrank.studies.optimisation.optimum import Optimum
from bellcrank_bench.problems.problem import scene_of
from bellcrank_bench.problems.urdf_texts import two_link
from bellcrank_bench.textbook.planar_2r import PlanarTwoLink

Array = NDArray[np.float64]
LENGTH, LOAD = 0.4, 5.0  # m of each link, kg at the tip
ARM = PlanarTwoLink(LENGTH, LENGTH, 2.0, 1.5, LENGTH / 2, LENGTH / 2, 2.0 * LENGTH**2 / 12, 1.5 * LENGTH**2 / 12, 9.81)
FROM, TO = (0.3, 0.1), (-0.6, 0.1)  # m
FASTEST, STRONGEST, LOWEST = 2.0, 100.0, 0.05  # rad/s, N m, m
OF_TORQUES, OF_SQUARES = (0.008, 0.005), 0.01  # weights of the objective
OBJECTIVE = (
    f"reach.duration + {OF_TORQUES[0]} * shoulder.peak_torque + {OF_TORQUES[1]} * elbow.peak_torque"
    f" + {OF_SQUARES} * reach.duration * (shoulder.rms_torque**2 + elbow.rms_torque**2)"
)
LIMITS = [f"{joint}.peak_{what}" for joint in ("shoulder", "elbow") for what in (
    f"speed <= {FASTEST} rad/s", f"torque <= {STRONGEST} N m")]  # fmt: skip
FIRST = 2.3  # s that the motion takes at the start of the search
RAMP = 0.03  # of the duration, for speeding up there and for slowing down


def posture(x: float, y: float) -> Array:
    """The posture (2,) with the tip at a point: with q2 > 0, unless q1 is negative then."""
    bend = np.arccos((x * x + y * y - 2.0 * LENGTH**2) / (2.0 * LENGTH**2))
    found = []
    for q2 in (bend, -bend):
        q1 = np.arctan2(y, x) - np.arctan2(LENGTH * np.sin(q2), LENGTH + LENGTH * np.cos(q2))
        found.append(np.array([q1, q2]))
    return found[0] if found[0][0] >= 0.0 else found[1]


def waypoint_times(inner: int) -> Array:
    """The shares (inner + 2,) of the duration at which waypoints are passed: half of them in ramps at both ends."""
    ramp, count = 2.0 * RAMP, inner // 4 + 1
    ends = ramp * (np.arange(count + 1) / count)
    middle = np.linspace(ramp, 1.0 - ramp, inner - 2 * count + 2)[1:-1]
    return np.concatenate([ends, middle, 1.0 - ends[::-1]])


def arm_scene(inner: int) -> Scene:
    """The arm with the weight and the motion at the start of the search."""
    shares, (begin, end) = waypoint_times(inner), (posture(*FROM), posture(*TO))
    blend = np.clip(shares / RAMP, 0.0, 1.0) ** 2 / 2.0 * RAMP + np.maximum(shares - RAMP, 0.0)  # a trapezoid of speed
    late = np.maximum(shares - (1.0 - RAMP), 0.0)
    way = (blend - late**2 / (2.0 * RAMP)) / (1.0 - RAMP)
    points = begin + way[:, None] * (end - begin)
    points[0], points[-1] = begin, end
    motion = {"kind": "waypoints", "times": (FIRST * shares).tolist()}
    motion["positions"] = [{"shoulder": float(q1), "elbow": float(q2)} for q1, q2 in points]
    weight = {"name": "weight", "kind": "wrench", "frame": "tip", "force": [0.0, -LOAD * ARM.g, 0.0]}
    return scene_of(two_link(ARM), {"gravity": [0.0, -ARM.g, 0.0], "forces": [weight], "motions": {"reach": motion}})


def variables(inner: int) -> dict[str, tuple[float, float]]:
    """The bounds of the duration and of the inner postures, as far as the largest speed reaches from both ends."""
    shares, (begin, end) = waypoint_times(inner), (posture(*FROM), posture(*TO))
    found = {"motions.reach.duration": (1.88, 2.6)}
    for k, share in enumerate(shares[1:-1].tolist(), 2):
        before, after = (FASTEST * FIRST * part for part in (share, 1.0 - share))
        for name, a, b in zip(("shoulder", "elbow"), begin, end, strict=True):
            low, high = max(a - before, b - after), min(a + before, b + after)
            found[f"motions.reach.positions.{k}.{name}"] = (float(low), float(high))
    return found


@dataclass(frozen=True)
class Evaluation:
    """An objective, and by how much the worst limit is exceeded (negative where all are kept), in SI units."""

    objective: float
    excess: float


def evaluated(motion: Motion, points: int = 40) -> Evaluation:
    """The objective of a motion by the equations of a textbook, and Gauss-Legendre sums between all rows."""
    x, w = np.polynomial.legendre.leggauss(points)
    length = np.diff(motion.time)
    times = (motion.time[:-1, None] + length[:, None] * (x + 1.0) / 2.0).ravel()
    weight = (length[:, None] * w / 2.0).ravel()
    torque = _torques(*motion.at(times))
    dense = np.concatenate([motion.time, times])
    q, v, a = motion.at(dense)
    peak = np.abs(_torques(q, v, a)).max(axis=0)
    height = LENGTH * np.sin(q[:, 0]) + LENGTH * np.sin(q.sum(axis=1))
    excess = [LOWEST - height.min(), np.abs(v).max() - FASTEST, peak.max() - STRONGEST, -q[:, 0].min()]
    excess += [q[:, 0].max() - np.pi, np.abs(q[:, 1]).max() - np.pi]
    objective = motion.duration + float(peak @ OF_TORQUES) + OF_SQUARES * float(weight @ (torque**2).sum(axis=1))
    return Evaluation(objective, float(max(excess)))


def _torques(q: Array, v: Array, a: Array) -> Array:
    """The torques (n, 2) with the weight at the tip: its force times the levers of the joints."""
    far = LENGTH * np.cos(q.sum(axis=1))
    levers = np.stack([LENGTH * np.cos(q[:, 0]) + far, far], axis=1)
    return np.asarray(ARM.inverse_dynamics(q, v, a) + LOAD * ARM.g * levers)


def bellcrank_optimum(inner: int, **asked: Any) -> tuple[Optimum, float]:
    """The best motion through so many inner waypoints, and the time of the processor, s, scene and search."""
    begin = time.process_time()
    scene, vary = arm_scene(inner), variables(inner)
    written = scene.data["motions"]["reach"]["positions"]
    start = {"motions.reach.duration": FIRST}
    start |= {path: written[int(path.split(".")[3]) - 1][path.split(".")[4]] for path in vary if path not in start}
    found = optimise(
        scene, vary, minimise=OBJECTIVE, limits=LIMITS, size=True,
        **{"samples": 1, "starts": 1, "threads": 1, "start": start, **asked},
    )  # fmt: skip
    return found, time.process_time() - begin


def motion_of(found: Optimum) -> Motion:
    """The motion of an optimum."""
    runner = found.problem.runner
    assert isinstance(runner, SizingRunner)
    return runner.inputs(list(found.values.values())).motions[0]


INNER = 12  # waypoints between the first and the last
TOLERANCES = (1e-3, 1e-6)  # of MAPTOR: that of its published example, and a tight one


def arm_report(inner: int) -> tuple[list[str], dict[str, Any]]:
    """Lines with the objectives and the times of the processor of both, and the same as data.

    MAPTOR's lines are left out where it is not installed, which a line says.
    """
    found, seconds = bellcrank_optimum(inner)
    checked = evaluated(motion_of(found))
    values = found.measures
    lines = [
        f"bellcrank, {inner} inner waypoints: objective {found.objective:.5f} in {seconds:.2f} s of the processor, "
        f"{found.problem.count} designs, {found.status}; T {found.values['motions.reach.duration']:.4f} s, "
        f"torques {values['shoulder.peak_torque']:.2f} and {values['elbow.peak_torque']:.2f} N m",
        f"  by the textbook's equations: {checked.objective:.5f}, limits exceeded by {max(checked.excess, 0.0):.1e}",
    ]
    data: dict[str, Any] = {"inner": inner, "objective": found.objective, "seconds": seconds, "status": found.status}
    data |= {"checked": checked.objective, "excess": checked.excess, "maptor": []}
    try:
        from bellcrank_bench.measurements.arm_peers import maptor_optimum

        peers = [maptor_optimum(tolerance) for tolerance in TOLERANCES]
    except ImportError as error:
        return [*lines, f"MAPTOR is not installed: {error}"], data
    for one in peers:
        lines.append(
            f"MAPTOR, tolerance {one.tolerance:g}: objective {one.objective:.5f} in {one.seconds:.2f} s of the "
            f"processor; T {one.duration:.4f} s, torques {one.torques[0]:.2f} and {one.torques[1]:.2f} N m; "
            f"bellcrank's objective is {found.objective / one.objective:.5f} times as large, "
            f"its time {seconds / one.seconds:.3f}"
        )
        data["maptor"].append(vars(one))
    return lines, data
