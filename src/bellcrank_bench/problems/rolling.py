"""Disks, hoops and wheels that roll: the lecture's cases, steady circles, straight rolling, a cart on two wheels.

Source of the disk: A. Ghosal, Dynamics and Control of Mechanical Systems, NPTEL 2022, lecture 18. Motions are known by
an 8th-order integrator at rtol = atol = 1e-13 on its equations, and a second method, or in closed form.
"""

from __future__ import annotations

from math import pi, radians, sin, sqrt
from typing import Any, Final

import numpy as np

from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.simulate import simulate
from bellcrank.simulation.trajectory import Trajectory
from bellcrank_bench.problems.linkages import disk_urdf
from bellcrank_bench.problems.open_chains import turns
from bellcrank_bench.problems.problem import Array, Figure, Problem, ended, largest, scene_of
from bellcrank_bench.textbook.closed_linkages import SixCoordinateDisk

FINE: Final[dict[str, Any]] = {"rtol": 1e-12, "atol": 1e-12}
FINEST: Final[dict[str, Any]] = {"rtol": 1e-13, "atol": 1e-13}
ENDS = {  # scene: (x, y) of the centre at 10 s in m, tilt's range in deg and how exactly it is told
    "rolling_disk": ((-0.05536301, -0.0652155), (1.1822536, 66.79522), 1e-3),
    "rolling_disk_b": ((1.80521908, 0.09849353), (5.0, 9.1858), 1e-3),
    "rolling_disk_c": ((0.10486443, -0.20392919), (-1.3308, 60.4624), 1e-3),
}
DISTURBANCE = 1e-4  # rad/s of tilt, given to straight rolling
PERIODS = 100


def kept(run: Trajectory) -> list[Figure]:
    """How well the disk keeps to the floor, how little it slips, and its energy, at every row of the run."""
    return [
        Figure("off the floor", run.constraint_residual(), 1e-12, "m"),
        Figure("slip", run.velocity_residual(), 1e-10, "m/s"),
        Figure("energy drift", run.energy_drift(), 1e-10),
    ]


def tilt(run: Trajectory) -> Array:
    """The lean (n,) of the disk from the vertical, rad, about its heading."""
    return np.asarray(np.arcsin(run.frame("disk").rotation[:, 2, 1]))


def case(name: str) -> Problem:
    """One of the lecture's cases on a free base, for 10 s."""
    end, limits, bar = ENDS[name]

    def judge(run: Trajectory) -> list[Figure]:
        """Known: the centre's end and the tilt's range to the digits printed."""
        lean = np.degrees(tilt(run))
        return [
            ended(run),
            Figure("centre at the end", largest(run.output("centre")[-1, :2] - end), 1e-6, "m"),
            Figure("range of tilt", largest([lean.min() - limits[0], lean.max() - limits[1]]), bar, "deg"),
            *kept(run),
        ]

    settings = FINE | {"duration": 10.0, "samples": 5001}
    return Problem(name, f"{name.replace('_', ' ')}, 10 s", lambda: load_scene(name), judge, settings)


def six_scene() -> Scene:
    """Case A in the lecture's six coordinates, with events where the tilt turns."""
    return load_scene("rolling_disk_six", {"events": turns("tilt")})


def judge_six(run: Trajectory) -> list[Figure]:
    """Known: range and period of the tilt, range of the normal force, friction that is asked for; and the same motion
    on a free base.
    """
    lean = np.degrees([event.position[run.robot.joint("tilt").q] for event in run.events])
    when = np.array([event.time for event in run.events])
    normal, sideways = run.multipliers[:, 0], np.hypot(*run.multipliers[:, 1:].T)
    free = simulate("rolling_disk", times=run.time, **FINE)
    return [
        ended(run),
        Figure("range of tilt", largest([lean.min() - 1.1822536, lean.max() - 66.79522]), 5e-6, "deg"),
        Figure("period", largest(when[2:] - when[:-2] - 0.936536), 1e-6, "s"),
        Figure("normal force", largest([normal.min() - 3.10555, normal.max() - 13.33296]), 2e-5, "N"),
        Figure("friction asked for", abs((sideways / normal).max() - 0.79924), 1e-5),
        Figure("centre on a free base", largest(run.output("centre") - free.output("centre")), 1e-8, "m"),
        Figure("forces on a free base", largest(run.multipliers - free.multipliers), 1e-6, "N"),
        *kept(run),
    ]


# ---- steady motion


def disk_scene(disk: SixCoordinateDisk, start: dict[str, Any], velocity: dict[str, float]) -> Scene:
    """A disk or hoop on six coordinates at a start; its height and what of its velocity is not given follow."""
    floor = {"name": "floor", "kind": "rolling_disk", "frame": "disk", "axis": [0, 1, 0], "radius": disk.radius}
    place = {"x": 0.0, "y": 0.0, "z": {"guess": disk.radius}, "heading": 0.0, "tilt": 0.0, "spin": 0.0}
    initial = place | start | {"velocity": {"heading": 0.0, "tilt": 0.0, "spin": 0.0} | velocity}
    text = disk_urdf(disk.radius, disk.k, disk.mass)
    return scene_of(text, {"gravity": [0, 0, -disk.g], "constraints": [floor], "initial": initial})


def circle(name: str, disk: SixCoordinateDisk, lean: float, path: float) -> Problem:
    """A disk that goes round steadily, its centre on a circle of radius `path` (m), leaning inwards by `lean` (rad)."""
    rate = disk.circle_rate(lean, path)

    def make() -> Scene:
        turning = {"heading": -rate, "spin": rate * (path / disk.radius + sin(lean))}
        return disk_scene(disk, {"y": path, "tilt": lean}, turning)

    def judge(run: Trajectory) -> list[Figure]:
        """Known: Ω² = g tan α / ((1 + 2k) b + k r sin α), and everything else stays."""
        x, y, _, heading, now, _ = run.position.T
        angle = rate * run.time
        return [
            ended(run),
            Figure("lean", largest(now - lean), 1e-9, "rad"),
            Figure("heading", largest(heading + angle), 1e-9, "rad"),
            Figure("centre", largest([x - path * np.sin(angle), y - path * np.cos(angle)]), 1e-9, "m"),
            *kept(run),
        ]

    return Problem(name, f"{name.replace('_', ' ')}, 10 s", make, judge, FINEST | {"duration": 10.0})


def straight(name: str, share: float) -> Problem:
    """A disk that rolls straight on at a share of its critical speed, with a small tilt rate as disturbance."""
    disk = SixCoordinateDisk()
    speed = share * disk.critical_speed
    n = sqrt(abs(disk.stiffness(speed)))
    stable = share > 1.0

    def make() -> Scene:
        return disk_scene(disk, {}, {"spin": speed / disk.radius, "tilt": DISTURBANCE})

    def judge(run: Trajectory) -> list[Figure]:
        """Known: θ̈ = −n² θ of the tilt about straight rolling: it stays below its first amplitude, ε/n, for as long as
        one likes, or grows as sinh.
        """
        lean = run.joint("tilt").position
        if stable:
            return [
                ended(run),
                Figure("largest tilt, of ε/n", abs(lean).max() * n / DISTURBANCE, 1.001),
                Figure("the same of its least", abs(lean).max() * n / DISTURBANCE, 0.99, at_least=True),
                *kept(run),
            ]
        late = abs(lean) > 20 * DISTURBANCE / n
        growth = np.polyfit(run.time[late], np.log(abs(lean[late])), 1)[0]
        return [ended(run), Figure("rate of growth", abs(growth / n - 1), 0.02, "relative"), *kept(run)]

    duration = PERIODS * 2 * pi / n if stable else 6.0 / n
    title = f"straight rolling at {share:g} of the critical speed"
    return Problem(name, title, make, judge, FINE | {"duration": duration, "samples": 20001})


# ---- a cart


def judge_cart(run: Trajectory) -> list[Figure]:
    """Known: both wheels keep their speeds and the cart its circle; the floor's push along the axle is m v²/b in all, a
    half of it at each wheel by least norm, as the wheels repeat each other's row.
    """
    x, y, _ = run.output("cart").T
    angle, speed, radius, mass = 0.5 * run.time, 1.1, 2.2, 7.0
    push = np.stack([run.constraint(name).multipliers[:, 2] for name in ("left_floor", "right_floor")], -1)
    return [
        ended(run),
        Figure("place", largest([x - radius * np.sin(angle), y + radius * np.cos(angle)]), 1e-6, "m"),
        Figure("push along the axle", largest(push.sum(1) - mass * speed**2 / radius), 1e-5, "N"),
        Figure("each wheel's half", largest(push[:, 0] - push[:, 1]), 1e-4, "N"),
        Figure("off the floor", run.constraint_residual(), 1e-12, "m"),
        Figure("slip", run.velocity_residual(), 1e-10, "m/s"),
        Figure("energy drift", run.energy_drift(), 1e-6),
    ]


PROBLEMS = (
    *(case(name) for name in ENDS),
    Problem(
        "rolling_disk_six", "rolling disk, case A, in six coordinates, 10 s", six_scene, judge_six,
        FINE | {"duration": 10.0, "samples": 20001},
    ),
    circle("disk_round_a_circle", SixCoordinateDisk(radius=0.3), radians(10), 1.0),
    circle("hoop_round_a_circle", SixCoordinateDisk(radius=0.3, k=0.5), radians(10), 1.0),
    circle("disk_spinning_in_place", SixCoordinateDisk(radius=0.3), radians(10), 0.0),
    straight("straight_rolling_fast", 1.2),
    straight("straight_rolling_slow", 0.8),
    Problem(
        "two_wheeler", "cart on two wheels of one axle, 10 s", lambda: load_scene("two_wheeler"), judge_cart,
        {"duration": 10.0, "rtol": 1e-11, "atol": 1e-11},
    ),
)  # fmt: skip
