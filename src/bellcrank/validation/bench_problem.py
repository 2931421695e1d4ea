"""The scenes that the bench integrates: analytic equations, start, duration, and what a solver's run hands back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, pi, radians, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.errors import InputError, among
from bellcrank.validation.reduced import FourBar, FourBars, RollingDisk
from bellcrank.validation.textbook import PlanarTwoLink, SpringPendulum

Array = NDArray[np.float64]
OUTPUTS = 101  # times at which every solver's positions are compared


def _itself(x: NDArray[Any]) -> NDArray[Any]:
    return x


@dataclass(frozen=True)
class Problem:
    """A scene with its analytic equations in the fewest coordinates.

    `start` is their state, SI units; without constraints it is (q, v), in the order of `joints`. `unreduced` makes of
    such states (..., n) those of all coordinates and rates, which the program in C integrates, the `count` coordinates
    first; `compared` makes of these coordinates the positions that are compared, which for a scene's own are the first
    `compared_count`. The error of a run is the largest difference from the reference at `times`, in `unit`. `known` are
    published values of `unreduced` states at the end, as far as they go; a `closed` scene has constraints; `in_c`:
    there is a program in C. `pieces` are the steps of the reference between two outputs, and of the run that judges it.
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

    def own(self, position: Array) -> Array:
        """What is compared of a scene's own positions, (k, nq)."""
        return position[:, : self.compared_count]


_DISK_START = (0.0, 0.0, *(radians(a) for a in (10.0, 45.0, 0.0, 100.0, 200.0, 0.0)))
_FOUR_BAR, _DISK = FourBar(), RollingDisk()
# A. Ghosal, Dynamics and Control of Mechanical Systems, NPTEL 2022, lecture 18; end values by an 8th-order integrator.
PROBLEMS = {
    "planar_2r_swing": Problem(
        "planar_2r_swing", "planar 2R arm, free swing of 10 s", PlanarTwoLink(), ("shoulder", "elbow"),
        (-pi / 2, pi / 4, 0.0, 0.0), 10.0, "rad", (-1.6288964, 0.4774930, -1.4299024, 2.5688865),
    ),
    "spring_pendulum": Problem(
        "spring_pendulum", "spring pendulum, 20 s", SpringPendulum(), ("swing", "slide"),
        (pi / 4, 5.0, 0.2, 0.1), 20.0, "rad | m", (-0.32885524, 6.70749476, -0.6952644, -3.54642339),
    ),
    "four_bar": Problem(  # to 12 s: it locks at 12.268 s
        "four_bar", "deployable four-bar, 12 s", _FOUR_BAR, ("crank", "coupler", "rocker"),
        (radians(1.0), 0.0), 12.0, "rad", (), 3, 3, _FOUR_BAR.angles, closed=True, pieces=(1, 2),
    ),
    "rolling_disk": Problem(
        "rolling_disk", "thin disk rolling and leaning, 10 s", _DISK, ("root_joint",),
        _DISK_START, 10.0, "m", (-0.05536301, -0.0652155), 5, 3, compared=_DISK.centre, closed=True, pieces=(6, 8),
    ),
    **{
        f"n_four_bar_{n}": Problem(
            f"n_four_bar_{n}", f"{n} four-bars in a row, through singular positions, {t:g} s", FourBars(n),
            ("crank_0",), (0.0, -1.0), t, "rad", (), 1, 1, closed=True, in_c=False,
        )
        for n, t in ((2, 10.0), (40, 20.0))
    },
}  # fmt: skip


def problem(name: str) -> Problem:
    """The problem of that name. Raises InputError for an unknown one."""
    if name not in PROBLEMS:
        raise InputError("bench: " + among("scene", name, PROBLEMS))
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
