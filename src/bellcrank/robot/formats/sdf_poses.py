"""Poses in SDFormat: the frames of models, links, joints and <frame>s, resolved to the frame of the file's top scope.

Rules: sdformat.org, "Pose Frame Semantics" (SDFormat 1.7 and later). A pose is relative to the frame that `relative_to`
names. Without it a link, a <frame> and a nested model are relative to their model, a joint to its child, and a <frame>
with `attached_to` to that frame. Names of nested models are separated by "::".
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.robot.formats.mjcf_placement import inverse, placement
from bellcrank.robot.formats.urdf_elements import NUMBER
from bellcrank.robot.formats.xml_tree import XmlElement

MODEL, WORLD = "__model__", "world"
LARGEST = 1e30  # of a number

Fail = Callable[[str], InputError]


@dataclass
class Frame:
    """A named frame: its pose in the frame `relative_to`, and the frame that it moves with ("" for a link)."""

    pose: Array
    relative_to: str
    attached_to: str
    line: int
    placement: str = ""  # of a nested model: the frame in it that the pose places


@dataclass
class Frames:
    """The frames of a file by their full names ("arm::link"); `fail(message)` makes the InputError."""

    fail: Fail
    named: dict[str, Frame] = field(default_factory=dict)
    _found: dict[str, Array] = field(default_factory=dict)

    def add(self, name: str, frame: Frame) -> None:
        """Add a frame. Raises InputError where the name is taken."""
        if name in self.named:
            raise self.fail(f"line {frame.line}: the name '{name}' is taken (line {self.named[name].line}); rename one")
        self.named[name] = frame

    def known(self, name: str, line: int, what: str) -> str:
        """The name of a frame that is there. Raises InputError."""
        if name not in self.named:
            shown = [each for each in self.named if not each.endswith(MODEL)]
            raise self.fail(f"line {line}: {what}: {unknown_name('frame', name, shown)}")
        return name

    def pose(self, name: str) -> Array:
        """The pose (4, 4) of a frame in the top scope. Raises InputError for a cycle or an unknown frame."""
        return self._resolved(name, [])

    def link(self, name: str) -> str:
        """The link that a frame moves with. Raises InputError for a cycle or an unknown frame."""
        passed: list[str] = []
        while (above := self.named[name].attached_to) != "":
            passed.append(name)
            if above in passed:
                raise self._cycle("attached_to", passed[passed.index(above) :])
            name = self.known(above, self.named[name].line, "attached_to")
        return name

    def _resolved(self, name: str, above: list[str]) -> Array:
        if name in self._found:
            return self._found[name]
        if name in above:
            raise self._cycle("relative_to", above[above.index(name) :])
        frame = self.named[name]
        if len(above) > 500:
            raise self.fail(f"line {frame.line}: poses are relative to each other more than 500 deep")
        chain = [*above, name]
        base = np.eye(4)
        if frame.relative_to:
            base = self._resolved(self.known(frame.relative_to, frame.line, "relative_to"), chain)
        pose = base @ frame.pose
        if frame.placement:
            pose = pose @ inverse(self._inside(name, frame))
        self._found[name] = pose
        return pose

    def _inside(self, model: str, frame: Frame) -> Array:
        """The pose of the placement frame of a model in that model."""
        target = self.known(frame.placement, frame.line, "placement_frame")
        other = Frames(self.fail, dict(self.named))
        other.named[model] = Frame(np.eye(4), "", frame.attached_to, frame.line)
        return other._resolved(target, [])  # the model is placed by a frame in it: no circle with what asked for it

    def _cycle(self, key: str, names: list[str]) -> InputError:
        listed = ", ".join(f"'{name}'" for name in names[:6]) + (", …" if len(names) > 6 else "")
        return self.fail(
            f"line {self.named[names[0]].line}: {key}: the frames {listed} refer to each other in a circle; one of "
            "them must refer to another frame"
        )


def read_pose(element: XmlElement, where: str, fail: Fail) -> tuple[Array, str]:
    """The <pose> of an element, (4, 4), and its `relative_to` ("" where there is none). Raises InputError."""
    pose = element.find("pose")
    if pose is None:
        return np.eye(4), ""
    quaternion = pose.attributes.get("rotation_format", "euler_rpy") == "quat_xyzw"
    values = numbers(pose, f"{where}, <pose>", fail)
    count = 7 if quaternion else 6
    if not values:
        values = (0.0,) * 6 + (1.0,) * quaternion
    if len(values) != count:
        raise fail(f"line {pose.line}: {where}, <pose>: expected {count} numbers, found {len(values)}")
    turn = np.array(values[3:])
    if quaternion:
        if np.linalg.norm(turn) < 1e-9:
            raise fail(f"line {pose.line}: {where}, <pose>: the quaternion has length zero")
        rotation = Rotation.from_quat(turn)
    else:
        degrees = pose.attributes.get("degrees", "false").strip().lower() in ("true", "1")
        rotation = Rotation.from_euler("xyz", turn, degrees=degrees)
    return placement(np.array(values[:3]), rotation), pose.attributes.get("relative_to", "").strip()


def numbers(element: XmlElement, where: str, fail: Fail, infinite: bool = False) -> tuple[float, ...]:
    """The numbers in the text of an element, finite unless `infinite`. Raises InputError."""
    found = []
    for word in element.text.split():
        value = float(word) if NUMBER.fullmatch(word) else math.nan
        if infinite and word.lower().lstrip("+-") in ("inf", "infinity"):
            value = -math.inf if word.startswith("-") else math.inf
        if not abs(value) <= (math.inf if infinite else LARGEST):
            raise fail(f"line {element.line}: {where}: expected numbers of at most {LARGEST:g}, found {word[:40]!r}")
        found.append(value)
    return tuple(found)


def number(parent: XmlElement, tag: str, default: float, where: str, fail: Fail, infinite: bool = False) -> float:
    """The number in a child element, `default` where there is none. Raises InputError."""
    element = parent.find(tag)
    if element is None:
        return default
    values = numbers(element, f"{where}, <{tag}>", fail, infinite)
    if len(values) != 1:
        raise fail(f"line {element.line}: {where}, <{tag}>: expected one number, found {len(values)}")
    return values[0]


def text_of(parent: XmlElement, tag: str) -> str:
    """The text of a child element without blanks around it; "" where there is none."""
    element = parent.find(tag)
    return "" if element is None else element.text.strip()
