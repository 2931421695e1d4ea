"""What a reference problem is: a scene, solver settings, and figures to judge a run by, each with a bar."""

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
from bellcrank.simulation.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Figure:
    """A number of a run in `unit`, and the bar it must not exceed; with `at_least` it must reach the bar instead."""

    name: str
    value: float
    bar: float
    unit: str = ""
    at_least: bool = False

    @property
    def good(self) -> bool:
        """Whether it keeps to its bar; a number that is not finite never does."""
        return bool(np.isfinite(self.value) and (self.value >= self.bar if self.at_least else self.value <= self.bar))


@dataclass(frozen=True)
class Problem:
    """A scene with a known answer.

    `make` gives the scene, `settings` are arguments of `simulate`, and `judge` takes the run and gives its figures; the
    docstring of `judge` names the source of the known answer.
    """

    name: str
    title: str
    make: Callable[[], Scene]
    judge: Callable[[Trajectory], list[Figure]]
    settings: Mapping[str, Any] = field(default_factory=dict)

    def run(self) -> Trajectory:
        """Simulate it."""
        return simulate(self.make(), **self.settings)

    def figures(self) -> list[Figure]:
        """Simulate and judge it."""
        return self.judge(self.run())


def scene_of(urdf_text: str | None, data: Mapping[str, Any]) -> Scene:
    """The scene of a URDF's text (None where `data` names its `urdf`) and a mapping of scene keys.

    Files are written to a folder that lasts as long as the process. Raises InputError as `load_scene` does.
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


def largest(difference: Any) -> float:
    """The largest absolute entry; infinite where one is no number."""
    found = float(np.abs(np.asarray(difference, dtype=float)).max(initial=0.0))
    return found if np.isfinite(found) else float("inf")


def ended(run: Trajectory) -> Figure:
    """Whether the run came to its end, as a figure: 0 yes, 1 no."""
    return Figure(f"ended early ({run.status})", float(not run.success), 0.0)


@cache
def _folder() -> Path:
    path = new_folder("problems")
    atexit.register(shutil.rmtree, path, ignore_errors=True)
    return path
