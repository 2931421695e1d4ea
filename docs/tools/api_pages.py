"""The pages of the Python interface: the public names of the package, grouped by the room that they live in."""

from __future__ import annotations

import inspect
import re
from operator import attrgetter

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
    "present": "Results of all kinds",
    "errors": "Errors",
}
NAME = re.compile(r"(?<!\[)(?P<code>`bc\.(?P<name>results\.\w+|\w+)(?:\.\w+)*(?:\([^`]*\))?`)(?!\])")
ROOMS = {"reports": "replays", "codegen": "dynamics"}  # rooms without a page of their own
HOME = {**bc._HOME, **{f"results.{name}": home for name, home in bc.results._HOME.items()}}  # public name -> module


def groups() -> dict[str, list[str]]:
    """Room -> public names that live in it, in the order of TITLES. Raises KeyError for a room without a title."""
    found: dict[str, list[str]] = {room: [] for room in TITLES}
    for name, home in HOME.items():
        room = home.partition(".")[0]
        found[ROOMS.get(room, room)].append(name)
    return {room: names for room, names in found.items() if names}


def pages() -> dict[str, str]:
    """Path below docs/ -> Markdown, of the pages of rooms, which the build fills with the docstrings."""
    found = {}
    for room, names in groups().items():
        text = "\n\n".join(f"::: bellcrank.{name}" for name in names)
        found[f"reference/api/{room}.md"] = f"# {TITLES[room]}\n\n{text}\n"
    return found


def index() -> str:
    """The page of all names with the first sentence of each."""
    lines = [
        "# Python reference\n",
        "`help(bc.NAME)` prints the whole text of a name with shapes, units, errors and an example; so does the site.",
        "\nArrays are NumPy arrays in SI units. Position has one number a joint (rad or m, continuous joints "
        "unwrapped). A free base comes first, with position and quaternion x y z w; its velocity is in its own frame.",
    ]
    for room, names in groups().items():
        lines += [f"\n## {TITLES[room]}\n", "| name | meaning | source |", "|---|---|---|"]
        for name in names:
            sentence = re.split(r"(?<=\.)\s", inspect.getdoc(attrgetter(name)(bc)) or "", maxsplit=1)[0]
            sentence = " ".join(sentence.replace("|", "\\|").split())
            home = HOME[name].replace(".", "/")
            lines.append(f"| `bc.{name}` | {sentence} | `bellcrank/{home}.py` |")
    return "\n".join([*lines, ""])


def linked(markdown: str) -> str:
    """Markdown in which each `bc.NAME` outside code blocks and links leads to its entry on the page of its room."""

    def link(found: re.Match[str]) -> str:
        code, name = found["code"], found["name"]
        return f"[{code}][bellcrank.{name}]" if name in HOME else code

    parts = re.split(r"(^```.*?^```$)", markdown, flags=re.MULTILINE | re.DOTALL)
    return "".join(part if part.startswith("```") else NAME.sub(link, part) for part in parts)
