"""The numbers that the reader of a page can change."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bellcrank.elements.parameters import parameter_bounds

if TYPE_CHECKING:
    from bellcrank.elements.parameters import Parameter
    from bellcrank.scene.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Setting:
    """A number that the reader can change.

    Attributes:
        group: Under which heading it stands.
        name: Its name there.
        unit: Its unit; empty for a factor.
        value: The value of the sizing or run.
        range: The ends of its slider.
        least: The least value that is accepted, or is not, if `above`.
        above: Whether the least value itself is refused.
        path: The path of the override that changes it; empty where there is none.
        entry: Its place in the list that the path names, or its key in the mapping; empty for a number of its own.
        options: What is chosen among, where the value is the number of one of them; empty for other numbers.
    """

    group: str
    name: str
    unit: str
    value: float
    range: tuple[float, float]
    least: float = 0.0
    above: bool = False
    path: str = ""
    entry: str = ""
    options: tuple[str, ...] = ()


def slider_end(value: float) -> float:
    """The least of 1, 2 and 5 times a power of ten that is not below a value."""
    power = 10.0 ** math.floor(math.log10(value)) if value > 0.0 else 1.0
    return next(power * step for step in (1.0, 2.0, 5.0, 10.0) if power * step >= value)


PARAMETERS = "parameters"  # the heading under which a scene's parameters stand


def parameter_settings(
    scene: Scene, parameters: Mapping[str, Parameter], named: bool = True
) -> tuple[dict[str, Setting], list[str]]:
    """The settings of a scene's parameters by name, and sentences on those that the reader cannot change; `named` says
    whether overrides change them by their names.
    """
    parts = (*scene.forces, *scene.control, *scene.constraints)
    found: dict[str, Setting] = {}
    fixed = []
    for name, parameter in parameters.items():
        if any(10 <= place[1] < 16 for place in parameter.places):
            fixed.append(f"parameter {name} keeps its value: moments of inertia depend on each other")
            continue
        bounds = parameter_bounds(parameter, scene.robot, parts)
        least = max((bound.least for bound in bounds), default=-math.inf)
        value = parameter.value
        reach = slider_end(abs(value)) if value == 0.0 else 0.5 * abs(value)
        found[name] = Setting(
            group=PARAMETERS,
            name=name,
            unit=parameter.unit,
            value=value,
            range=(max(value - reach, least), value + reach),
            least=least,
            above=any(bound.least == least and not bound.included for bound in bounds),
            path=name if named else "",
        )
    return found, fixed
