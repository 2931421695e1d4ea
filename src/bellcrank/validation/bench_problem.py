"""The scenes that the bench integrates: analytic equations, start, duration, and what a solver's run hands back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, pi, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.errors import InputError, among
from bellcrank.validation.textbook import PlanarTwoLink, SpringPendulum

Array = NDArray[np.float64]
OUTPUTS = 101  # times at which every solver's positions are compared


@dataclass(frozen=True)
class Problem:
    """A scene with two coordinates and its analytic equations.

    `start` is (q, v), (4,), SI units, in the order of `joints`; the error of a run is the largest difference
    of any coordinate from the reference at `times`, in `unit`. `known` are published values of (q, v) at the end;
    `overrides` make of the scene file what the equations describe.
    """

    name: str
    title: str
    equations: PlanarTwoLink | SpringPendulum
    joints: tuple[str, str]
    start: tuple[float, float, float, float]
    duration: float
    unit: str
    known: tuple[float, float, float, float]

    @property
    def times(self) -> Array:
        """The output times, (101,), s."""
        return np.linspace(0.0, self.duration, OUTPUTS)


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
}  # fmt: skip


def problem(name: str) -> Problem:
    """The problem of that name. Raises InputError for an unknown one."""
    if name not in PROBLEMS:
        raise InputError("bench: " + among("scene", name, PROBLEMS))
    return PROBLEMS[name]


@dataclass(frozen=True)
class Outcome:
    """One run: seconds on the solver's own clock, positions (k, 2), and when (k,) where not at the problem's times.

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


def cartesian(start: tuple[float, float, float, float]) -> tuple[list[float], list[float]]:
    """Position (x, y) and velocity of the spring pendulum's mass, gravity along -y, from (θ, r, θ̇, ṙ)."""
    angle, r, rate, speed = start
    s, c = sin(angle), cos(angle)
    return [r * s, -r * c], [speed * s + r * rate * c, -speed * c + r * rate * s]


def polar(xy: NDArray[Any]) -> Array:
    """Angle from hanging (unwrapped) and length, (k, 2), from the mass's x and y, (k, 2)."""
    return np.column_stack([np.unwrap(np.arctan2(xy[:, 0], -xy[:, 1])), np.hypot(xy[:, 0], xy[:, 1])])
