"""Axes of a study whose values are plain numbers of a scene: parameters, starts of joints and settings of the solver.

Their values go to the equations as arrays. Every other axis makes variants of the scene (scene_designs.py).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.config.fields import parse_number
from bellcrank.config.units import units_for
from bellcrank.elements.element import joint_unit
from bellcrank.elements.parameters import inertias_set, parameter_bounds
from bellcrank.robot.model.pinocchio_model import LEAST_MASS
from bellcrank.scene.robot_config import CONFIG_KEYS, SCENE_KEYS
from bellcrank.scene.scene import Scene
from bellcrank.scene.settings import FINEST_RTOL

SETTING_UNITS = {"duration": "s", "rtol": "", "atol": "", "step": "s", "first_step": "s", "max_step": "s"}
NOT_JOINTS = ("velocity", "motion", "run", "time", "clock")  # keys of `initial` with a meaning of their own
PROBE = 1.2345


class DesignAxis(Protocol):
    """What is needed of an axis of a study (axes.py)."""

    @property
    def path(self) -> str:
        """A parameter, or a dotted path in the scene."""

    @property
    def unit(self) -> str:
        """The unit of its numbers."""

    @property
    def numeric(self) -> bool:
        """Whether its values are numbers."""

    def value(self, number: float) -> Any:
        """The value for which a number stands, in the form that the scene accepts."""


class ValueKind(Enum):
    """What a plain axis sets."""

    PARAMETER = "a parameter"
    POSITION = "the position of a joint at the start, or its guess"
    VELOCITY = "the velocity of a joint at the start"
    SETTING = "a setting of the solver"


@dataclass(frozen=True)
class PlainAxis:
    """An axis of plain numbers.

    Attributes:
        column: Its column among the values of a design.
        kind: What it sets.
        name: The name of the parameter, joint or setting.
        factor: The SI value of 1.
    """

    column: int
    kind: ValueKind
    name: str
    factor: float

    def numbers(self, values: Array) -> Array:
        """Its SI values (n,) among the values (n, axes) of designs."""
        with np.errstate(over="ignore"):
            return np.asarray(values[:, self.column] * self.factor)


def plain_axes(scene: Scene, axes: Sequence[DesignAxis]) -> tuple[PlainAxis, ...]:
    """The axes of plain numbers. Axes that set the same number are not among them."""
    found = [plain for column, axis in enumerate(axes) if (plain := _plain_axis(scene, column, axis)) is not None]
    often = Counter((axis.kind, axis.name) for axis in found)
    return tuple(axis for axis in found if often[axis.kind, axis.name] == 1)


def _plain_axis(scene: Scene, column: int, axis: DesignAxis) -> PlainAxis | None:
    place = _place(scene, axis.path.strip())
    if place is None or not axis.numeric:
        return None
    kind, name, unit = place
    try:
        probe = axis.value(PROBE)
        for factor in units_for(unit).values():
            if parse_number(probe, unit) == PROBE * factor:
                return PlainAxis(column, kind, name, factor)
    except ValueError:
        pass  # an unknown unit, which the scene refuses
    return None


def _place(scene: Scene, path: str) -> tuple[ValueKind, str, str] | None:
    """What a path sets, with its name and SI unit; None where it is not a plain number."""
    if path in (*CONFIG_KEYS, *SCENE_KEYS):
        return None
    parameter = path.removeprefix("parameters.")
    if parameter not in scene.parameters and parameter != path:
        parameter = parameter.removesuffix(".value")
    if parameter in scene.parameters:
        return ValueKind.PARAMETER, parameter, scene.parameters[parameter].unit
    first, _, rest = path.partition(".")
    if first == "simulate" and rest in SETTING_UNITS:
        return ValueKind.SETTING, rest, SETTING_UNITS[rest]
    joints = {joint.name: joint for joint in scene.robot.joints if joint.nv == 1 and joint.name not in NOT_JOINTS}
    moving = rest.removeprefix("velocity.")
    if first != "initial" or "." in moving.removesuffix(".guess"):
        return None
    if moving != rest and moving in joints:
        return ValueKind.VELOCITY, moving, joint_unit(joints[moving], "velocity")
    if rest.removesuffix(".guess") in joints:
        name = rest.removesuffix(".guess")
        return ValueKind.POSITION, name, joint_unit(joints[name], "position")
    return None


def admitted(scene: Scene, axes: Sequence[PlainAxis], values: Array) -> Mask:
    """Which of the values (n, axes) the scene accepts, as far as these axes are concerned."""
    good = np.ones(len(values), dtype=bool)
    for axis in axes:
        numbers = axis.numbers(values)
        good &= np.isfinite(numbers)
        if axis.kind is ValueKind.SETTING:
            good &= numbers > 0.0
        if axis.name == "rtol":
            good &= (numbers >= FINEST_RTOL) & (numbers <= 1.0)
        if axis.kind is ValueKind.PARAMETER:
            for bound in parameter_bounds(scene.parameters[axis.name], scene.robot, scene.elements):
                good &= (numbers >= bound.least) if bound.included else (numbers > bound.least)
            if scene.parameters[axis.name].unit == "kg":
                good &= ~((numbers > 0.0) & (numbers < LEAST_MASS))
    given = {axis.name: axis.numbers(values) for axis in axes if axis.kind is ValueKind.PARAMETER}
    rows = np.flatnonzero(good)
    good[rows] &= _moments_admitted(scene, {name: numbers[rows] for name, numbers in given.items()}, len(rows))
    return good


def _moments_admitted(scene: Scene, given: Mapping[str, Array], count: int) -> Mask:
    """Whether all principal moments of inertia of the links that parameters (n,) change are 0 or more."""
    good = np.ones(count, dtype=bool)
    if not count:
        return good
    for link in inertias_set(scene.parameters, scene.robot):
        if given.keys().isdisjoint(name for name in link.names if name):
            continue
        columns = [
            np.broadcast_to(given.get(name, number), count)
            for name, number in zip(link.names, link.numbers, strict=True)
        ]
        xx, xy, yy, xz, yz, zz = columns
        moments = np.linalg.eigvalsh(np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=1).reshape(count, 3, 3))
        good &= moments[:, 0] >= -1e-9 * np.abs(moments[:, 2])
    return good
