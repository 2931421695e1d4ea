"""Reference problems of the rolling disk: the lecture's cases, steady circles, straight rolling.

Source: A. Ghosal, Dynamics and Control of Mechanical Systems, NPTEL 2022, lecture 18.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians, sin, sqrt
from typing import Any, Final

import numpy as np

from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.simulate import simulate
from bellcrank.simulation.trajectory.trajectory import Trajectory
from bellcrank_bench.problems.checks import Array, Check, finished, largest, turning_points
from bellcrank_bench.problems.problem import LECTURE, Benchmark, Problem, scene_of
from bellcrank_bench.problems.urdf_texts import rolling_disk
from bellcrank_bench.textbook.rolling_disk import ReducedRollingDisk, SixCoordinateDisk

FINE: Final[dict[str, Any]] = {"rtol": 1e-12, "atol": 1e-12}
FINEST: Final[dict[str, Any]] = {"rtol": 1e-13, "atol": 1e-13}
DISTURBANCE = 1e-4  # rad/s of tilt, given to straight rolling
PERIODS = 100  # of the tilt, for which stable straight rolling is watched
START = (0.0, 0.0, *(radians(angle) for angle in (10.0, 45.0, 0.0, 100.0, 200.0, 0.0)))  # case A, of the reduced state
REDUCED = ReducedRollingDisk()


@dataclass(frozen=True)
class Case:
    """What is known of a bundled scene after 10 s: the centre (x, y), m, and the range of the tilt, deg."""

    centre: tuple[float, float]
    tilt_range: tuple[float, float]


CASES = {
    "rolling_disk": Case((-0.05536301, -0.0652155), (1.1822536, 66.79522)),
    "rolling_disk_b": Case((1.80521908, 0.09849353), (5.0, 9.1858)),
    "rolling_disk_c": Case((0.10486443, -0.20392919), (-1.3308, 60.4624)),
}
BENCHMARK = Benchmark(
    scene="rolling_disk",
    equations=REDUCED,
    joints=("root_joint",),
    start=START,
    duration=10.0,
    unit="m",
    known_end=CASES["rolling_disk"].centre,
    count=5,
    compared_count=3,
    compared=REDUCED.centre,
    constrained=True,
    c_coordinates="fewest coordinates",
    reference_steps=(6, 8),
    remarks=("the C baseline integrates moments about the contact point, bellcrank a free body with three rows",),
)


def rolling_constraints(run: Trajectory) -> list[Check]:
    """The distance from the floor, the slip and the energy drift, over all rows of the run."""
    return [
        Check("position residual", run.constraint_residual(), 1e-12, "m"),
        Check("slip", run.velocity_residual(), 1e-10, "m/s"),
        Check("energy drift", run.energy_drift(), 1e-10),
    ]


def tilt(run: Trajectory) -> Array:
    """The tilt (n,) of the disk from the vertical about its heading, rad."""
    return np.asarray(np.arcsin(run.frame("disk").rotation[:, 2, 1]))


def case_problem(name: str) -> Problem:
    """One of the lecture's cases, as a body with a floating base, for 10 s."""
    known = CASES[name]

    def judge(run: Trajectory) -> list[Check]:
        """Known: the centre at the end and the range of the tilt, to the digits printed, by an integrator of order 8 at
        rtol = atol = 1e-13 on the lecture's equations, and by a second method.
        """
        angle = np.degrees(tilt(run))
        least, greatest = known.tilt_range
        return [
            finished(run),
            Check("centre at the end", largest(run.output("centre")[-1, :2] - known.centre), 1e-6, "m"),
            Check("range of tilt", largest([angle.min() - least, angle.max() - greatest]), 1e-3, "deg"),
            *rolling_constraints(run),
        ]

    return Problem(
        name=name,
        title=f"{name.replace('_', ' ')}, 10 s",
        source=LECTURE,
        make=lambda: load_scene(name),
        judge=judge,
        settings=FINE | {"duration": 10.0, "samples": 5001},
        benchmark=BENCHMARK if name == "rolling_disk" else None,
    )


def six_coordinate_scene() -> Scene:
    """Case A in the lecture's six coordinates, with events where the tilt turns."""
    return load_scene("rolling_disk_six", {"events": turning_points("tilt")})


def judge_six_coordinates(run: Trajectory) -> list[Check]:
    """Known: range and period of the tilt, range of the normal force and required friction, by an integrator of order 8
    at rtol = atol = 1e-13 on the lecture's equations; and the same motion with a floating base.
    """
    angle = np.degrees([event.position[run.robot.joint("tilt").q] for event in run.events])
    when = np.array([event.time for event in run.events])
    normal, tangential = run.multipliers[:, 0], np.hypot(*run.multipliers[:, 1:].T)
    free = simulate("rolling_disk", times=run.time, **FINE)
    return [
        finished(run),
        Check("range of tilt", largest([angle.min() - 1.1822536, angle.max() - 66.79522]), 5e-6, "deg"),
        Check("period", largest(when[2:] - when[:-2] - 0.936536), 1e-6, "s"),
        Check("normal force", largest([normal.min() - 3.10555, normal.max() - 13.33296]), 2e-5, "N"),
        Check("required friction coefficient", abs((tangential / normal).max() - 0.79924), 1e-5),
        Check("centre with a floating base", largest(run.output("centre") - free.output("centre")), 1e-8, "m"),
        Check("forces with a floating base", largest(run.multipliers - free.multipliers), 1e-6, "N"),
        *rolling_constraints(run),
    ]


# ---- steady motion


def disk_scene(disk: SixCoordinateDisk, start: dict[str, Any], velocity: dict[str, float]) -> Scene:
    """A disk or hoop in six coordinates; its height, and velocities that are not given, follow from the constraint."""
    floor = {"name": "floor", "kind": "rolling_disk", "frame": "disk", "axis": [0, 1, 0], "radius": disk.radius}
    place = {"x": 0.0, "y": 0.0, "z": {"guess": disk.radius}, "heading": 0.0, "tilt": 0.0, "spin": 0.0}
    initial = place | start | {"velocity": {"heading": 0.0, "tilt": 0.0, "spin": 0.0} | velocity}
    text = rolling_disk(disk.radius, disk.k, disk.mass)
    return scene_of(text, {"gravity": [0, 0, -disk.g], "constraints": [floor], "initial": initial})


def circle_problem(name: str, disk: SixCoordinateDisk, lean: float, path: float) -> Problem:
    """A disk that rolls steadily, its centre on a circle of radius `path` (m), leaning inwards by `lean` (rad)."""
    rate = disk.circle_rate(lean, path)

    def make() -> Scene:
        turning = {"heading": -rate, "spin": rate * (path / disk.radius + sin(lean))}
        return disk_scene(disk, {"y": path, "tilt": lean}, turning)

    def judge(run: Trajectory) -> list[Check]:
        """Known: Ω² = g tan α / ((1 + 2k) b + k r sin α), and everything else stays constant."""
        x, y, _, heading, now, _ = run.position.T
        angle = rate * run.time
        return [
            finished(run),
            Check("lean", largest(now - lean), 1e-9, "rad"),
            Check("heading", largest(heading + angle), 1e-9, "rad"),
            Check("centre", largest([x - path * np.sin(angle), y - path * np.cos(angle)]), 1e-9, "m"),
            *rolling_constraints(run),
        ]

    return Problem(
        name=name,
        title=f"{name.replace('_', ' ')}, 10 s",
        source="closed form",
        make=make,
        judge=judge,
        settings=FINEST | {"duration": 10.0},
    )


def straight_problem(name: str, ratio: float) -> Problem:
    """A disk that rolls straight on at a ratio of its critical speed, disturbed by a small tilt rate."""
    disk = SixCoordinateDisk()
    speed = ratio * disk.critical_speed
    n = sqrt(abs(disk.stiffness(speed)))
    stable = ratio > 1.0

    def make() -> Scene:
        return disk_scene(disk, {}, {"spin": speed / disk.radius, "tilt": DISTURBANCE})

    def judge(run: Trajectory) -> list[Check]:
        """Known: the tilt obeys θ̈ = −n² θ about straight rolling: above the critical speed it stays below its first
        amplitude ε/n, below that speed it grows as sinh.
        """
        angle = run.joint("tilt").position
        if stable:
            relative = float(abs(angle).max() * n / DISTURBANCE)
            return [
                finished(run),
                Check("largest tilt, of ε/n", relative, 1.001),
                Check("largest tilt, of ε/n, at least", relative, 0.99, at_least=True),
                *rolling_constraints(run),
            ]
        late = abs(angle) > 20 * DISTURBANCE / n
        growth = np.polyfit(run.time[late], np.log(abs(angle[late])), 1)[0]
        return [
            finished(run),
            Check("rate of growth", abs(growth / n - 1), 0.02, "relative"),
            *rolling_constraints(run),
        ]

    return Problem(
        name=name,
        title=f"straight rolling at {ratio:g} of the critical speed",
        source="linearised equation of the tilt",
        make=make,
        judge=judge,
        settings=FINE | {"duration": PERIODS * 2 * pi / n if stable else 6.0 / n, "samples": 20001},
    )


PROBLEMS = (
    *(case_problem(name) for name in CASES),
    Problem(
        name="rolling_disk_six",
        title="rolling disk, case A, in six coordinates, 10 s",
        source=LECTURE,
        make=six_coordinate_scene,
        judge=judge_six_coordinates,
        settings=FINE | {"duration": 10.0, "samples": 20001},
    ),
    circle_problem("disk_round_a_circle", SixCoordinateDisk(radius=0.3), radians(10), 1.0),
    circle_problem("hoop_round_a_circle", SixCoordinateDisk(radius=0.3, k=0.5), radians(10), 1.0),
    circle_problem("disk_spinning_in_place", SixCoordinateDisk(radius=0.3), radians(10), 0.0),
    straight_problem("straight_rolling_fast", 1.2),
    straight_problem("straight_rolling_slow", 0.8),
)
