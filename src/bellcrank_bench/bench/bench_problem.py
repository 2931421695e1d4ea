"""The scenes that the bench integrates: analytic equations, start, duration, and what a solver's run hands back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, pi, radians, sin
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank_bench.textbook.open_chains import PlanarTwoLink, SimplePendulum, SpringPendulum
from bellcrank_bench.textbook.reduced_coordinates import BricardRing, FourBar, FourBars, RollingDisk, SteadyTurn

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory import Trajectory

Array = NDArray[np.float64]
OUTPUTS = 101  # times at which every solver's positions are compared


def _itself(x: NDArray[Any]) -> NDArray[Any]:
    return x


@dataclass(frozen=True)
class Published:
    """A whole run's time in s that others report, with which tool, on what machine and how."""

    tool: str
    seconds: float
    how: str


@dataclass(frozen=True)
class Problem:
    """A scene with its analytic equations in the fewest coordinates.

    `start` is their state, SI units; without constraints it is (q, v), in the order of `joints`. `unreduced` makes of
    such states (..., n) those of all coordinates and rates, which the program in C integrates, the `count` coordinates
    first; `compared` makes of these coordinates the `compared_count` positions that are compared, which are the scene's
    `output` of that name, or without one its first positions. The error of a run is the largest difference from the
    reference at `times`, in `unit`. `known` are published values of `unreduced` states at the end, as far as they go; a
    `closed` scene has constraints; `in_c`: there is a program in C. `pieces` are the steps of the reference between two
    outputs, and of the run that judges it. `slow`: a quick bench of all scenes leaves it out; `tightest` is the
    tightest tolerance that is tried. `published` are times that others report, `remarks` say in a line each what is
    not measured, and why, or what is unlike.
    """

    name: str
    title: str
    equations: Any  # a class of textbook.py or reduced.py
    joints: tuple[str, ...]
    start: tuple[float, ...]
    duration: float
    unit: str
    known: tuple[float, ...]
    count: int = 2
    compared_count: int = 2
    unreduced: Callable[[NDArray[Any]], NDArray[Any]] = _itself
    compared: Callable[[NDArray[Any]], NDArray[Any]] = _itself
    closed: bool = False
    in_c: bool = True
    pieces: tuple[int, int] = (4, 6)
    output: str = ""
    slow: bool = False
    tightest: float = 1e-13
    published: tuple[Published, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def adaptive(self) -> tuple[str, ...]:
        """Methods of ours that choose their steps and that are measured here: closed scenes are not stiff."""
        return ("RK45", "DOP853") if self.closed else ("RK45", "DOP853", "Radau")

    @property
    def times(self) -> Array:
        """The output times, (101,), s."""
        return np.linspace(0.0, self.duration, OUTPUTS)

    def positions(self, states: NDArray[Any]) -> NDArray[Any]:
        """What is compared, (k, compared_count), of states (k, n) in the fewest coordinates."""
        return self.compared(self.unreduced(states)[..., : self.count])

    def own(self, run: Trajectory) -> Array:
        """What is compared of a run of the scene, (k, compared_count)."""
        found = run.output(self.output) if self.output else run.position
        return np.asarray(found[:, : self.compared_count])


def _opensim(seconds: float) -> Published:
    return Published("OpenSim 3.2", seconds, "i5-4570")


_DISK_START = (0.0, 0.0, *(radians(a) for a in (10.0, 45.0, 0.0, 100.0, 200.0, 0.0)))
_FOUR_BAR, _DISK, _RING, _TURN = FourBar(), RollingDisk(), BricardRing(), SteadyTurn()
_NO_C_OF_LOOPS = "C by hand: none: in the fewest coordinates it would be a pendulum, which shows no loop"
_ONLY_EXUDYN = "MuJoCo, Drake: not set up: how soft their constraints are decides the branch where all links lie flat"
# Sources: A. Ghosal, Dynamics and Control of Mechanical Systems, NPTEL 2022, lecture 18, end values by an 8th-order
# integrator; IFToMM library of computational benchmark problems, A01 (closed form in elliptic functions), A02, A04.
PROBLEMS = {
    "planar_2r_swing": Problem(
        "planar_2r_swing", "planar 2R arm, free swing of 10 s", PlanarTwoLink(), ("shoulder", "elbow"),
        (-pi / 2, pi / 4, 0.0, 0.0), 10.0, "rad", (-1.6288964, 0.4774930, -1.4299024, 2.5688865),
    ),
    "spring_pendulum": Problem(
        "spring_pendulum", "spring pendulum, 20 s", SpringPendulum(), ("swing", "slide"),
        (pi / 4, 5.0, 0.2, 0.1), 20.0, "rad | m", (-0.32885524, 6.70749476, -0.6952644, -3.54642339),
    ),
    "pendulum": Problem(
        "pendulum", "simple pendulum, A01, 10 s", SimplePendulum(), ("swing",),
        (-pi / 2, 0.0), 10.0, "rad", (-0.2786806735699835, 4.343160692864683), 1, 1,
        published=(_opensim(0.637), Published("Exudyn", 0.037, "i7")),
    ),
    "four_bar": Problem(  # to 12 s: it locks at 12.268 s
        "four_bar", "deployable four-bar, 12 s", _FOUR_BAR, ("crank", "coupler", "rocker"),
        (radians(1.0), 0.0), 12.0, "rad", (), 3, 3, _FOUR_BAR.angles, closed=True, pieces=(1, 2),
    ),
    "rolling_disk": Problem(
        "rolling_disk", "thin disk rolling and leaning, 10 s", _DISK, ("root_joint",),
        _DISK_START, 10.0, "m", (-0.05536301, -0.0652155), 5, 3, compared=_DISK.centre, closed=True, pieces=(6, 8),
        remarks=("C by hand has moments about the contact point, bellcrank a free body and three rows",),
    ),
    "bricard": Problem(
        "bricard", "Bricard's ring of six rods, A04, 10 s", _RING, tuple(f"hinge_{k}" for k in range(5)),
        (pi / 2, 0.0), 10.0, "m", (), 1, 3, compared=_RING.corner, closed=True, pieces=(1, 2), output="P3",
        published=(_opensim(0.258), Published("Exudyn", 3.57, "5 s simulated")),
        remarks=("C by hand has the one parameter of all postures, bellcrank five hinges and five rows, one too many",),
    ),
    **{
        f"n_four_bar_{n}": Problem(
            f"n_four_bar_{n}", f"{n} four-bars in a row, A02, through singular positions, {t:g} s", FourBars(n),
            ("crank_0",), (0.0, -1.0), t, "rad", (), 1, 1, closed=True, in_c=False, slow=n > 2,
            tightest=1e-13 if n == 2 else 1e-10,
            published=published, remarks=(_NO_C_OF_LOOPS, _ONLY_EXUDYN),
        )
        for n, t, published in (
            (2, 10.0, (_opensim(0.455), Published("Exudyn", 0.0776, "i9, steps of 10 ms, energy off by 0.114 J"))),
            (40, 20.0, ()),
        )
    },
    "two_wheeler": Problem(
        "two_wheeler", "cart on two wheels round a circle, 10 s", _TURN, ("root_joint",),
        (0.0, -2.2, 0.0), 10.0, "m", (), 3, 3, compared=_TURN.place, closed=True, in_c=False, pieces=(1, 2),
        output="cart",
        remarks=("C by hand, MuJoCo, Drake, Exudyn: not set up: it goes round steadily, as the closed form says",),
    ),
}  # fmt: skip
# Shipped closed scenes without a row, and why.
NO_ROWS = {"five_bar": "its motors' limits make kinks, at which no reference in extended precision is to be had"}


def usual() -> list[str]:
    """The scenes of a bench of all: those that are not slow."""
    return [name for name, each in PROBLEMS.items() if not each.slow]


def problem(name: str) -> Problem:
    """The problem of that name. Raises InputError for an unknown one."""
    if name not in PROBLEMS:
        raise InputError("bench: " + unknown_name("scene", name, PROBLEMS))
    return PROBLEMS[name]


@dataclass(frozen=True)
class Outcome:
    """One run: seconds on the solver's own clock, positions (k, compared_count), and when (k,) where not at the
    problem's times.

    `whole` is the time of the user's whole call where it is measured apart, s.
    """

    seconds: float
    position: Array
    time: Array | None = None
    evaluations: int | None = None
    steps: int | None = None
    rejected: int | None = None
    whole: float | None = None


@dataclass(frozen=True)
class Run:
    """A tool with a method and a setting, ready to run again and again; `note` says what its clock covers."""

    tool: str
    method: str
    setting: str
    note: str
    once: Callable[[], Outcome]


def cartesian(start: tuple[float, ...]) -> tuple[list[float], list[float]]:
    """Position (x, y) and velocity of the spring pendulum's mass, gravity along -y, from (θ, r, θ̇, ṙ)."""
    angle, r, rate, speed = start
    s, c = sin(angle), cos(angle)
    return [r * s, -r * c], [speed * s + r * rate * c, -speed * c + r * rate * s]


def polar(xy: NDArray[Any]) -> Array:
    """Angle from hanging (unwrapped) and length, (k, 2), from the mass's x and y, (k, 2)."""
    return np.column_stack([np.unwrap(np.arctan2(xy[:, 0], -xy[:, 1])), np.hypot(xy[:, 0], xy[:, 1])])
