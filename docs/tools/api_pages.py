"""The pages of the Python interface: the public names of the package, grouped by the room that they live in."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bellcrank as bc
from bellcrank import deprecated

TITLES = {
    "robot": "Robots",
    "motion": "Motions",
    "actuators": "Actuators",
    "sizing": "Sizing",
    "planning": "Fastest motions",
    "scene": "Robot configurations and scenes",
    "simulation": "Simulation",
    "analysis": "Linear analysis",
    "studies": "Sweeps",
    "dynamics": "Inverse dynamics and derivatives of scenes",
    "replays": "Replays and reports",
    "errors": "Errors",
}
ROOMS = {"reports": "replays"}  # rooms without a page of their own
OLD_ARGUMENTS = (  # function, old argument, new one: decorators tell no one outside
    ("size", "drives", "actuators"),
    ("replay, show, report", "thing", "source"),
)


def groups() -> dict[str, list[str]]:
    """Room -> public names that live in it, in the order of TITLES. Raises KeyError for a room without a title."""
    found: dict[str, list[str]] = {room: [] for room in TITLES}
    for name, home in bc._HOME.items():
        if name not in deprecated.NAMES:
            room = home.partition(".")[0]
            found[ROOMS.get(room, room)].append(name)
    return {room: names for room, names in found.items() if names}


def pages() -> dict[str, str]:
    """Path below docs/ -> Markdown."""
    found = {"reference/api/index.md": _index(), "reference/api/deprecated.md": _deprecated()}
    for room, names in groups().items():
        text = "\n\n".join(f"::: bellcrank.{name}" for name in names)
        found[f"reference/api/{room}.md"] = f"# {TITLES[room]}\n\n{text}\n"
    return found


def _index() -> str:
    lines = ["# Python reference\n", "```python\nimport bellcrank as bc\n```\n"]
    for room, names in groups().items():
        links = ", ".join(f"[`{name}`][bellcrank.{name}]" for name in names)
        lines.append(f"- [{TITLES[room]}]({room}.md): {links}")
    lines.append(
        "\nArrays are NumPy arrays in SI units. Position has one number a joint (rad or m, continuous joints "
        "unwrapped). A free base comes first, with position and quaternion x y z w; its velocity is in its own frame."
    )
    return "\n".join([*lines, ""])


def _deprecated() -> str:
    """Old names of the package, old attributes of its classes, old arguments, and what they are now."""
    for name in bc.__all__:
        getattr(bc, name)  # so that all classes are known
    rows = [(f"bellcrank.{old}", f"bellcrank.{new}") for old, new in deprecated.NAMES.items()]
    for cls in _below(deprecated.Renamed):
        for old, new in vars(cls).get("renamed", {}).items():
            module, colon, function = new.partition(":")
            rows.append((f"{cls.__name__}.{old}", f"{module}.{function}(…)" if colon else f"{cls.__name__}.{new}"))
    rows += [(f"{function}({old}=…)", f"({new}=…)") for function, old, new in OLD_ARGUMENTS]
    rows += [(f"bellcrank.{old}", f"bellcrank.{new}") for old, new in deprecated.MODULES.items()]
    lines = [
        "# Deprecated names\n",
        "These names of version 0.4 still work, with a `DeprecationWarning`, and will be removed in "
        f"{deprecated.REMOVAL}. Old keys of YAML files are in the [YAML reference](../yaml.md#deprecated-names).\n",
        "| old | new |",
        "|---|---|",
    ]
    return "\n".join([*lines, *(f"| `{old}` | `{new}` |" for old, new in dict.fromkeys(rows)), ""])


def _below(cls: type[Any]) -> Iterator[type[Any]]:
    each: type[Any]
    for each in cls.__subclasses__():
        yield each
        yield from _below(each)
