"""Where a robot's links and joints lie in each other while every joint is at zero."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.motion.rotations import from_rpy

if TYPE_CHECKING:
    from bellcrank.robot.urdf_file import Joint, Urdf

Array = NDArray[np.float64]

DEFAULT = 0.5  # m: the scale of a robot all of whose joints are in one place


def placement(xyz: tuple[float, ...], rpy: tuple[float, ...]) -> Array:
    """The transform (4, 4) of a position (m) and roll, pitch, yaw (rad)."""
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = from_rpy(np.array(rpy, dtype=float)), xyz
    return place


class Skeleton:
    """Links by the links that carry them: those that move on their own, while the others are fixed to one of them.

    `carrier` names each link's; `carried` lists each carrier's links, itself first; `inside` is each link's transform
    (4, 4) in its carrier, `above` the joint over each link. `size` (m) is how large the robot is with every joint at
    zero, and `scale` (m) how far apart joints of one link are at most, or usually.
    """

    def __init__(self, urdf: Urdf, frames: Mapping[str, tuple[str, tuple[float, ...], tuple[float, ...]]]) -> None:
        self.urdf = urdf
        self.above: dict[str, Joint] = {joint.child: joint for joint in urdf.joints.values()}
        below: dict[str, list[Joint]] = {link: [] for link in urdf.links}
        for joint in urdf.joints.values():
            below[joint.parent].append(joint)
        self.carrier = {urdf.root: urdf.root}
        self.carried: dict[str, list[str]] = {urdf.root: [urdf.root]}
        self.inside: dict[str, Array] = {urdf.root: np.eye(4)}
        self.ends: dict[str, list[Array]] = {urdf.root: []}  # points in a carrier where something begins or is fixed
        at_zero: dict[str, Array] = {urdf.root: np.eye(4)}
        waiting = [urdf.root]
        while waiting:
            link = waiting.pop()
            carrier = self.carrier[link]
            for joint in below[link]:
                child, place = joint.child, self.inside[link] @ placement(joint.xyz, joint.rpy)
                at_zero[child] = at_zero[link] @ placement(joint.xyz, joint.rpy)
                self.ends[carrier].append(place[:3, 3])
                fixed = joint.type == "fixed"
                self.carrier[child] = carrier if fixed else child
                self.inside[child] = place if fixed else np.eye(4)
                if fixed:
                    self.carried[carrier].append(child)
                else:
                    self.carried[child], self.ends[child] = [child], []
                waiting.append(child)
        for link, xyz, _ in frames.values():
            if link in self.carrier:
                self.ends[self.carrier[link]].append((self.inside[link] @ np.array([*xyz, 1.0]))[:3])
        origins = np.array([place[:3, 3] for place in at_zero.values()])
        spans = [float(np.linalg.norm(end)) for ends in self.ends.values() for end in ends]
        self.size = float(np.linalg.norm(np.ptp(origins, axis=0)))
        spans = [span for span in spans if span > 0.0]
        self.scale = min(max(spans), 4.0 * float(np.median(spans))) if spans else DEFAULT  # a ground may be far longer
