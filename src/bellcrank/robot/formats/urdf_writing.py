"""Makes elements of a URDF, and names for those without one, for the readers of other formats."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from bellcrank.arrays import Array
from bellcrank.robot.formats.mjcf_placement import roll_pitch_yaw
from bellcrank.robot.formats.robot_file import WORLD
from bellcrank.robot.formats.xml_tree import XmlElement

MOST_LISTED = 6  # names in one sentence
ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def element(tag: str, line: int, *children: XmlElement, **attributes: str | float | None) -> XmlElement:
    """An element that stands for one in this line of the file; numbers are written exactly, None is left out."""
    texts = {k: v if isinstance(v, str) else repr(v) for k, v in attributes.items() if v is not None}
    return XmlElement(tag, texts, line, [*children])


def joint_element(
    name: str,
    kind: str,
    parent: str,
    child: str,
    place: Array,
    line: int,
    *parts: XmlElement,
    pitch: float | None = None,
) -> XmlElement:
    """A joint of a type of the extended URDF (urdf_file.py) at a placement (4, 4) in its parent link."""
    ends = element("parent", line, link=parent), element("child", line, link=child)
    return element("joint", line, *ends, origin(place, line), *parts, name=name, type=kind, pitch=pitch)


def inertial_element(mass: float, at: XmlElement, entries: Iterable[float], line: int) -> XmlElement:
    """Mass (kg), the <origin> of its centre, and the six ENTRIES (kg m²) in its axes."""
    inertia = dict(zip(ENTRIES, map(float, entries), strict=True))
    parts = element("mass", line, value=float(mass)), element("inertia", line, **inertia)
    return element("inertial", line, at, *parts)


def shape_element(tag: str, place: Array, solid: XmlElement, rgba: str, line: int) -> XmlElement:
    """A <visual> or <collision> at a placement (4, 4) in its link; `rgba` is empty where no colour is given."""
    paint = [element("material", line, element("color", line, rgba=rgba), name="")] if rgba else []
    return element(tag, line, origin(place, line), element("geometry", line, solid), *paint)


def origin(place: Array, line: int) -> XmlElement:
    """A placement (4, 4) as an <origin>."""
    return element("origin", line, xyz=numbers(place[:3, 3].tolist()), rpy=numbers(roll_pitch_yaw(place[:3, :3])))


def numbers(values: Iterable[float]) -> str:
    """Numbers as the value of an attribute, exactly, but no −0."""
    return " ".join(repr(float(value) + 0.0) for value in values)


class Names:
    """Names that are taken."""

    def __init__(self, taken: Iterable[str]) -> None:
        self._taken = {WORLD, *taken}
        self._counts: dict[str, int] = {}

    def new(self, *wishes: str) -> str:
        """The first wish that is free, else the last one with a number; it is taken then."""
        for wish in wishes:
            if wish not in self._taken:
                self._taken.add(wish)
                return wish
        count = self._counts.get(wishes[-1], 1)
        while f"{wishes[-1]}_{count + 1}" in self._taken:
            count += 1
        self._counts[wishes[-1]] = count + 1
        found = f"{wishes[-1]}_{count + 1}"
        self._taken.add(found)
        return found


def listed(names: Sequence[str]) -> str:
    """The first names of several, and how many there are."""
    more = f", … ({len(names)} in all)" if len(names) > MOST_LISTED else ""
    return ", ".join(names[:MOST_LISTED]) + more
