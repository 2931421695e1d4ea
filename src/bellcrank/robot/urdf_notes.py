"""What a URDF says and is not used: elements and attributes that are not known, with what may have been meant."""

from __future__ import annotations

from difflib import get_close_matches
from functools import lru_cache

from bellcrank.notes import Note
from bellcrank.robot.urdf_extensions import BALL, BUSHING, SPRING
from bellcrank.robot.urdf_loops import TAGS
from bellcrank.robot.xml_tree import Element

CHILDREN = {  # of the elements that are read, what they may contain
    "robot": ("link", "joint", "material", "transmission", "gazebo", "sensor", "ros2_control", "frame",
              BALL, SPRING, BUSHING, *TAGS),
    "link": ("inertial", "visual", "collision"),
    "joint": ("origin", "parent", "child", "axis", "axis2", "limit", "dynamics", "mimic", "calibration",
              "safety_controller"),
    "inertial": ("origin", "mass", "inertia"),
}  # fmt: skip
ATTRIBUTES = {
    "robot": ("name", "version"),
    "link": ("name", "type"),
    "joint": ("name", "type", "pitch"),
    "origin": ("xyz", "rpy"),
    "inertial": (),
    "parent": ("link",),
    "child": ("link",),
    "axis": ("xyz",),
    "axis2": ("xyz",),
    "frame": ("name", "link", "xyz", "rpy"),
    "limit": ("lower", "upper", "effort", "velocity"),
    "dynamics": ("damping", "friction"),
    "mimic": ("joint", "multiplier", "offset"),
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
}
OWNERS = {name: tag for tag in ("dynamics", "limit", "mimic", "mass", "inertia") for name in ATTRIBUTES[tag]}
CLOSE = 0.75  # difflib's ratio from which a name counts as another one misspelt
MOST = 8  # kinds that are listed
MOST_MISSPELT = 20  # sentences
LONGEST = 40  # characters of a name that are compared and shown


def unused(robot: Element) -> tuple[str, ...]:
    """A sentence for each name that is misspelt or stands at the wrong element, and one for all others."""
    found: list[str] = []
    others: dict[str, tuple[int, int]] = {}  # how often, and the first line
    waiting = [robot]
    while waiting:
        element = waiting.pop()
        for name in element.attributes:
            if not name.startswith("xmlns") and name not in ATTRIBUTES.get(element.tag, (name,)):
                what = f"the attribute '{name:.{LONGEST}}' of <{element.tag}>"
                _note(found, others, element, what, _meant(element.tag, name))
        for child in reversed(element.children):
            if element.tag not in CHILDREN or child.tag in CHILDREN[element.tag]:
                if child.tag in CHILDREN or child.tag in ATTRIBUTES:
                    waiting.append(child)
                continue
            close = _close(child.tag, CHILDREN[element.tag])
            what = f"<{child.tag:.{LONGEST}}> in <{element.tag}>"
            _note(found, others, child, what, f"<{close}>" if close else "")
    if others:
        parts = [
            f"{what} ({f'{count} times, first' if count > 1 else 'once,'} in line {line})"
            for what, (count, line) in others.items()
        ]
        more = f" and {len(parts) - MOST} more kinds" if len(parts) > MOST else ""
        found.append(f"what is not known and not used: {', '.join(parts[:MOST])}{more}.")
    return tuple(found)


def _meant(tag: str, name: str) -> str:
    """What an unknown attribute may have been meant to be; empty where nothing is like it."""
    close = _close(name, ATTRIBUTES[tag])
    if close:
        return f"'{close}'"
    return f"'{name}' of <{OWNERS[name]}>" if name in OWNERS else ""


@lru_cache(maxsize=8192)
def _close(name: str, known: tuple[str, ...]) -> str:
    """The known name that is most like another one; empty where none is."""
    close = get_close_matches(name, known, 1, CLOSE) if len(name) <= LONGEST else []
    return close[0] if close else ""


def _note(found: list[str], others: dict[str, tuple[int, int]], element: Element, what: str, meant: str) -> None:
    if meant and len(found) < MOST_MISSPELT:
        text = f"line {element.line}: {what} is not known and not used; was {meant} meant?"
        found.append(Note(text, "changes"))
        return
    count, line = others.get(what, (0, element.line))
    others[what] = (count + 1, line)
