"""What a reference problem is: a scene with a known answer, and how closely a run must meet it."""

from __future__ import annotations

import atexit
import hashlib
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from bellcrank.files.temporaries import new_folder
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.simulate import simulate
from bellcrank.simulation.trajectory.trajectory import Trajectory
from bellcrank_bench.problems.checks import Array, Check

LECTURE = "A. Ghosal, Dynamics and Control of Mechanical Systems, NPTEL 2022, lecture 18"
IFTOMM = "IFToMM library of computational benchmark problems"
OUTPUT_TIMES = 101  # at which the positions of every solver are compared


def _identity(x: NDArray[Any]) -> NDArray[Any]:
    return x


@dataclass(frozen=True)
class Published:
    """The time of a whole run in s that others report: with which tool, on what machine or how."""

    tool: str
    seconds: float
    how: str


@dataclass(frozen=True, kw_only=True)
class Benchmark:
    """What `bellcrank bench` measures on a problem: analytic equations of motion, and what is compared with them.

    Attributes:
        scene: Name of the bundled scene that is integrated, without its events.
        equations: Analytic equations in the fewest coordinates, an object of `textbook/` with `derivative(state)`.
        joints: The scene's first joints, in the order of the equations.
        start: Initial state of the equations, SI units; without constraints it is (q, v).
        duration: Simulated time, s.
        unit: Unit of the positions that are compared, and so of the error.
        known_end: Published values of `unreduced` states at the end, as many as there are.
        count: Number of coordinates that the C baseline integrates.
        compared_count: Number of positions that are compared.
        unreduced: Function that maps reduced states (..., n) to all coordinates and rates, the coordinates first.
        compared: Function that maps coordinates (..., count) to the compared positions (..., compared_count).
        output: The output of the scene that holds the compared positions; without one, they are its first positions.
        constrained: Whether the scene has constraints.
        c_baseline: Whether there is a program in C for it.
        c_coordinates: In which other coordinates that program integrates, if it does.
        reference_steps: Extrapolation steps between two output times: of the run that estimates the reference's
            error, and of the reference.
        slow: Whether `bellcrank bench` without names leaves it out.
        tightest: The tightest tolerance that is tried.
        published: Times that others report.
        remarks: What is not measured and why, or what differs between the tools; one line each.
    """

    scene: str
    equations: Any
    joints: tuple[str, ...]
    start: tuple[float, ...]
    duration: float
    unit: str
    known_end: tuple[float, ...] = ()
    count: int
    compared_count: int
    unreduced: Callable[[NDArray[Any]], NDArray[Any]] = _identity
    compared: Callable[[NDArray[Any]], NDArray[Any]] = _identity
    output: str = ""
    constrained: bool = False
    c_baseline: bool = True
    c_coordinates: str = ""
    reference_steps: tuple[int, int] = (4, 6)
    slow: bool = False
    tightest: float = 1e-13
    published: tuple[Published, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def adaptive(self) -> tuple[str, ...]:
        """The solvers with step control that are measured; without constraints also Radau."""
        return ("RK45", "DOP853") if self.constrained else ("RK45", "DOP853", "Radau")

    @property
    def times(self) -> Array:
        """The output times, (101,), s."""
        return np.linspace(0.0, self.duration, OUTPUT_TIMES)

    def positions(self, states: NDArray[Any]) -> NDArray[Any]:
        """The compared positions (k, compared_count) of reduced states (k, n)."""
        return self.compared(self.unreduced(states)[..., : self.count])

    def positions_of(self, run: Trajectory) -> Array:
        """The compared positions (k, compared_count) of a run of the scene."""
        found = run.output(self.output) if self.output else run.position
        return np.asarray(found[:, : self.compared_count])


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A scene with a known answer.

    Attributes:
        name: Name in the registry.
        title: What it is, in one line.
        source: Where the problem and its answer come from.
        make: Function that returns the scene.
        settings: Arguments of `simulate`: duration, tolerances, output times.
        judge: Function that compares a run with the known answer and returns checks, each with its tolerance. Its
            docstring says how the answer is known.
        benchmark: What `bellcrank bench` measures on it; None if it is not measured.
    """

    name: str
    title: str
    source: str
    make: Callable[[], Scene]
    judge: Callable[[Trajectory], list[Check]]
    settings: Mapping[str, Any] = field(default_factory=dict)
    benchmark: Benchmark | None = None

    def run(self) -> Trajectory:
        """Simulate the scene with the problem's settings."""
        return simulate(self.make(), **self.settings)

    def checks(self) -> list[Check]:
        """Simulate the scene and judge the run."""
        return self.judge(self.run())


def scene_of(urdf_text: str | None, data: Mapping[str, Any]) -> Scene:
    """A scene from a URDF's text (None if `data` names its `urdf`) and a mapping of scene keys.

    The files are written to a folder that is deleted when the process ends. Raises InputError as `load_scene` does.
    """
    entries = dict(data)
    if urdf_text is not None:
        urdf = _folder() / f"{hashlib.sha256(urdf_text.encode()).hexdigest()[:16]}.urdf"
        urdf.write_text(urdf_text, encoding="utf-8")
        entries["urdf"] = urdf.name
    text = yaml.safe_dump(entries, sort_keys=False)
    path = _folder() / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scene(path)


@cache
def _folder() -> Path:
    path = new_folder("problems")
    atexit.register(shutil.rmtree, path, ignore_errors=True)
    return path
