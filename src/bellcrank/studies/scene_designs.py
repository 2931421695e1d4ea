"""From the values of designs to what an ensemble of runs takes: parameters, consistent starts and settings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.consistent_start import consistent_start
from bellcrank.dynamics.prescribed_motion_end import prescribed_motion_end
from bellcrank.dynamics.singular_mass_matrix import refuse_singular_mass_matrix
from bellcrank.dynamics.system import System, system_of, system_parameters
from bellcrank.errors import BellcrankError
from bellcrank.scene.scene import Scene
from bellcrank.simulation.integration import refuse_infinite_start, refuse_open_contact

Array = NDArray[np.float64]
Whole = NDArray[np.int64]
NONE_MEANS = {"step": 0.0, "first_step": 0.0, "max_step": math.inf}  # in StepControl
SETTINGS = ("rtol", "atol", "step", "first_step", "max_step", "max_evaluations")


class DesignAxis(Protocol):
    """What is needed of an axis of a study."""

    @property
    def path(self) -> str:
        """A parameter, or a dotted path in the scene."""

    @property
    def unit(self) -> str:
        """The unit of its numbers."""

    def value(self, number: float) -> Any:
        """The value for which a number stands, in the form that the scene accepts."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DesignGroup:
    """Designs of one block that have the same compiled equations, signals, events and solver.

    Attributes:
        scene: The scene of one of them, which says what they share.
        rows: Their rows in the block (k,), rising.
        parameters: p (k, np), as `system_parameters` gives them.
        start: Consistent starts x (k, size).
        duration: s (k,).
        settings: The numbers of the step control that the axes vary (k,), by the names of StepControl.
    """

    scene: Scene
    rows: Whole
    parameters: Array
    start: Array
    duration: Array
    settings: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, kw_only=True)
class DesignBlock:
    """A block of designs, ready to be run.

    Attributes:
        groups: The designs that can be run; each is in one group.
        infeasible: Why each of the others cannot, by its row; without the path of the scene's file.
        start_position: The consistent position (n, nq) at the start, NaN where there is none. An infeasible design has
            one where it is refused for another reason.
    """

    groups: tuple[DesignGroup, ...]
    infeasible: Mapping[int, str]
    start_position: Array


class SceneDesigns:
    """The designs of a scene along the axes of a study. It can be pickled."""

    def __init__(self, scene: Scene, axes: Sequence[DesignAxis]) -> None:
        self.scene, self.axes = scene, tuple(axes)

    def block(self, values: Array, *, threads: int = 1) -> DesignBlock:
        """The block of designs with values (n, axes), in the units of the axes.

        A design's parameters and start depend on its own values alone, to the last bit.
        """
        infeasible: dict[int, str] = {}
        positions = np.full((len(values), self.scene.robot.nq), np.nan)
        found: dict[tuple[Any, ...], list[tuple[int, Scene, Array, Array]]] = {}
        for row, numbers in enumerate(values.tolist()):
            try:
                scene = self.scene.with_overrides(self.overrides(numbers))
                positions[row] = consistent_start(scene)[0]
                parameters, start = _checked_start(scene)
            except BellcrankError as error:
                infeasible[row] = str(error).removeprefix(f"{self.scene.source}: ")
                continue
            key = system_of(scene), *self._variant(numbers)
            found.setdefault(key, []).append((row, scene, parameters, start))
        groups = tuple(self._group(members) for members in found.values())
        return DesignBlock(groups=groups, infeasible=infeasible, start_position=positions)

    def overrides(self, numbers: Sequence[float]) -> dict[str, Any]:
        """The overrides of the scene that make the design with these values (axes,)."""
        return {axis.path: axis.value(number) for axis, number in zip(self.axes, numbers, strict=True)}

    def _variant(self, numbers: Sequence[float]) -> tuple[float, ...]:
        """The values of the axes that are not plain numbers of the equations, the start or the step control."""
        return tuple(n for axis, n in zip(self.axes, numbers, strict=True) if not _is_plain(self.scene, axis.path))

    def _group(self, members: list[tuple[int, Scene, Array, Array]]) -> DesignGroup:
        scenes = [scene for _, scene, _, _ in members]
        varied = {axis.path.removeprefix("simulate.") for axis in self.axes if axis.path.startswith("simulate.")}
        settings = {
            name: np.array([getattr(s.settings, name) or NONE_MEANS[name] for s in scenes], dtype=np.float64)
            for name in SETTINGS
            if name in varied
        }
        return DesignGroup(
            scene=scenes[0],
            rows=np.array([row for row, *_ in members]),
            parameters=np.array([p for _, _, p, _ in members]),
            start=np.array([x for *_, x in members]),
            duration=np.array([scene.settings.duration for scene in scenes]),
            settings=settings,
        )


def _checked_start(scene: Scene) -> tuple[Array, Array]:
    """p and x of a scene's start; InputError where a run of the scene cannot start."""
    prescribed_motion_end(scene)
    refuse_singular_mass_matrix(scene)
    system: System = system_of(scene)
    start, parameters = np.zeros(system.size), system_parameters(scene)
    q, v = consistent_start(scene)
    start[: system.nq], start[system.nq : system.nq + system.nv] = q, v
    refuse_open_contact(scene, parameters, start)
    refuse_infinite_start(scene, parameters, start)
    return parameters, start


def _is_plain(scene: Scene, path: str) -> bool:
    if path.removeprefix("parameters.").removesuffix(".value") in scene.parameters:
        return True
    first, _, rest = path.partition(".")
    return first == "initial" or (first == "simulate" and (rest == "duration" or rest in SETTINGS))
