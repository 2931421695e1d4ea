"""The pages of the Python interface: the public names of the package, grouped by the room that they live in."""

from __future__ import annotations

import bellcrank as bc

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
ROOMS = {"reports": "replays", "codegen": "dynamics"}  # rooms without a page of their own


def groups() -> dict[str, list[str]]:
    """Room -> public names that live in it, in the order of TITLES. Raises KeyError for a room without a title."""
    found: dict[str, list[str]] = {room: [] for room in TITLES}
    for name, home in bc._HOME.items():
        room = home.partition(".")[0]
        found[ROOMS.get(room, room)].append(name)
    return {room: names for room, names in found.items() if names}


def pages() -> dict[str, str]:
    """Path below docs/ -> Markdown."""
    found = {"reference/api/index.md": _index()}
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
