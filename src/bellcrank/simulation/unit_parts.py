"""Where unit vectors lie in a state."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bellcrank.robot.robot import RobotJoint

_PLACES = {"floating": (3, 4), "planar": (2, 2)}  # from the joint's first coordinate on: (offset, length)


def unit_parts(joints: Iterable[RobotJoint]) -> tuple[tuple[int, int], ...]:
    """(first, length) of each unit quaternion, and of the cosine and sine of each planar joint, in the state."""
    return tuple((j.q + _PLACES[j.kind][0], _PLACES[j.kind][1]) for j in joints if j.kind in _PLACES)
