"""Where the links and joints of a robot lie relative to each other when every joint is at zero."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.motion.kinematics.rotations import from_rpy

if TYPE_CHECKING:
    from bellcrank.robot.formats.urdf_file import Joint, Urdf


DEFAULT_SCALE = 0.5  # m, of a robot whose joints all coincide


def transform(xyz: tuple[float, ...], rpy: tuple[float, ...]) -> Array:
    """The homogeneous transform (4, 4) of a position (m) and roll, pitch, yaw (rad)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = from_rpy(np.array(rpy, dtype=float)), xyz
    return matrix


class LinkLayout:
    """Links grouped into rigid bodies: a carrier link, which is the root or moves by a joint, and links fixed to it.

    Attributes:
        carrier: The carrier of each link.
        links_of: The links of each carrier, the carrier first.
        parent_joint: The joint above each link but the root.
        in_carrier: Transform (4, 4) of each link in the frame of its carrier.
        ends: Points (3,) m in each carrier's frame where joints, fixed links or user frames are.
        size: Diagonal of the box around all link origins with every joint at zero (m).
        scale: Largest distance between joints on one carrier (m), at most four times the median.
    """

    def __init__(self, urdf: Urdf, frames: Mapping[str, tuple[str, tuple[float, ...], tuple[float, ...]]]) -> None:
        self.urdf = urdf
        self.parent_joint: dict[str, Joint] = {joint.child: joint for joint in urdf.joints.values()}
        below: dict[str, list[Joint]] = {link: [] for link in urdf.links}
        for joint in urdf.joints.values():
            below[joint.parent].append(joint)
        self.carrier = {urdf.root: urdf.root}
        self.links_of: dict[str, list[str]] = {urdf.root: [urdf.root]}
        self.in_carrier: dict[str, Array] = {urdf.root: np.eye(4)}
        self.ends: dict[str, list[Array]] = {urdf.root: []}
        at_zero: dict[str, Array] = {urdf.root: np.eye(4)}
        waiting = [urdf.root]
        while waiting:
            link = waiting.pop()
            carrier = self.carrier[link]
            for joint in below[link]:
                child, place = joint.child, self.in_carrier[link] @ transform(joint.xyz, joint.rpy)
                at_zero[child] = at_zero[link] @ transform(joint.xyz, joint.rpy)
                self.ends[carrier].append(place[:3, 3])
                fixed = joint.type == "fixed"
                self.carrier[child] = carrier if fixed else child
                self.in_carrier[child] = place if fixed else np.eye(4)
                if fixed:
                    self.links_of[carrier].append(child)
                else:
                    self.links_of[child], self.ends[child] = [child], []
                waiting.append(child)
        for link, xyz, _ in frames.values():
            if link in self.carrier:
                self.ends[self.carrier[link]].append((self.in_carrier[link] @ np.array([*xyz, 1.0]))[:3])
        origins = np.array([place[:3, 3] for place in at_zero.values()])
        self.size = float(np.linalg.norm(np.ptp(origins, axis=0)))
        spans = [float(np.linalg.norm(end)) for ends in self.ends.values() for end in ends]
        spans = [span for span in spans if span > 0.0]
        # the base may be far longer than the links
        self.scale = min(max(spans), 4.0 * float(np.median(spans))) if spans else DEFAULT_SCALE
