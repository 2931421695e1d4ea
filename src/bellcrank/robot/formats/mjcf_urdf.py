"""Writes the bodies of an MJCF file as a URDF in the extended sense.

Coordinates are MuJoCo's: at `ref` a joint is where the file places its body, and a free joint's position is that of the
body in the world. A body with several joints, or with a joint away from its origin, gets massless links between.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from bellcrank.robot.formats.mjcf_bodies import MjcfBody
from bellcrank.robot.formats.mjcf_inertia import BodyInertia
from bellcrank.robot.formats.mjcf_joints import MOVING, MjcfJoint
from bellcrank.robot.formats.mjcf_names import Names
from bellcrank.robot.formats.mjcf_placement import Array, placement, roll_pitch_yaw, translation
from bellcrank.robot.formats.xml_tree import quoted

TYPES = {"hinge": "revolute", "slide": "prismatic", "ball": "spherical", "free": "floating"}


class UrdfWriter:
    """Writes named bodies; `visuals` are the <visual> elements by body, `efforts` the largest torques by joint."""

    def __init__(self, bodies: Sequence[MjcfBody], visuals: Mapping[str, str], efforts: Mapping[str, float]) -> None:
        self._bodies, self._visuals, self._efforts = bodies, visuals, efforts
        self._links = Names([*(b.name for b in bodies), *(s.link for b in bodies for s in b.sites)])
        self._joints = Names([joint.name for body in bodies for joint in body.joints])

    def text(self, name: str) -> str:
        """The text of the URDF."""
        lines = [f"<robot name={quoted(name)}>"]
        for body in self._bodies:
            visual = self._visuals.get(body.name, "")
            lines.append(f"<link name={quoted(body.name)}>{_inertial(body.inertia)}{visual}</link>")
            if body is not self._bodies[0]:
                lines.extend(self._chain(body))
            for site in body.sites:
                lines.append(f"<link name={quoted(site.link)}/>")
                lines.append(self._fixed(site.link, body.name, site.link, site.place))
        return "\n".join([*lines, "</robot>", ""])

    def _chain(self, body: MjcfBody) -> Iterator[str]:
        """The joints from the parent's link to the body's link, and the links between."""
        at, place = self._bodies[body.parent].name, body.place
        for k, joint in enumerate(body.joints):
            if joint.kind == "free":
                yield self._moving(joint, at, body.name, np.eye(4))
                return
            last = k == len(body.joints) - 1 and not joint.pos.any()
            child = body.name if last else self._links.new(f"{body.name}_after_{joint.name}")
            if not last:
                yield f"<link name={quoted(child)}/>"
            yield self._moving(joint, at, child, place @ translation(joint.pos) @ _to_zero(joint))
            at, place = child, translation(-joint.pos)
        if at != body.name:
            yield self._fixed(body.name, at, body.name, place)

    def _fixed(self, name: str, parent: str, child: str, place: Array) -> str:
        title = self._joints.new(f"{name}_fixed")
        return f'<joint name={quoted(title)} type="fixed">{_ends(parent, child)}{origin(place)}</joint>'

    def _moving(self, joint: MjcfJoint, parent: str, child: str, place: Array) -> str:
        kind = "continuous" if joint.kind == "hinge" and joint.range is None else TYPES[joint.kind]
        parts = [f'<joint name={quoted(joint.name)} type="{kind}">{_ends(parent, child)}{origin(place)}']
        if joint.kind in MOVING:
            parts.append(f'<axis xyz="{_numbers(joint.axis)}"/>')
            bounds = {} if joint.range is None else {"lower": joint.range[0], "upper": joint.range[1]}
            if joint.name in self._efforts:
                bounds["effort"] = self._efforts[joint.name]
            if bounds:
                listed = " ".join(f'{key}="{value!r}"' for key, value in bounds.items())
                parts.append(f"<limit {listed}/>")
        if joint.kind != "free" and (joint.damping[0] or joint.friction):
            parts.append(f'<dynamics damping="{joint.damping[0]!r}" friction="{joint.friction!r}"/>')
        return "".join([*parts, "</joint>"])


def origin(place: Array) -> str:
    """A placement (4, 4) as an <origin>."""
    angles = np.array(roll_pitch_yaw(place[:3, :3]))
    return f'<origin xyz="{_numbers(place[:3, 3])}" rpy="{_numbers(angles)}"/>'


def _ends(parent: str, child: str) -> str:
    return f"<parent link={quoted(parent)}/><child link={quoted(child)}/>"


def _to_zero(joint: MjcfJoint) -> Array:
    """What moves the joint from its reference to the coordinate 0."""
    if joint.kind == "hinge":
        return placement(np.zeros(3), Rotation.from_rotvec(-joint.ref * joint.axis))
    return translation(-joint.ref * joint.axis) if joint.kind == "slide" else np.eye(4)


def _inertial(body: BodyInertia) -> str:
    if body.mass == 0.0 and not body.inertia.any():
        return ""
    i = (body.inertia + body.inertia.T) / 2.0
    entries = {"ixx": i[0, 0], "ixy": i[0, 1], "ixz": i[0, 2], "iyy": i[1, 1], "iyz": i[1, 2], "izz": i[2, 2]}
    inertia = " ".join(f'{key}="{float(value)!r}"' for key, value in entries.items())
    return (
        f'<inertial><origin xyz="{_numbers(body.center)}"/><mass value="{float(body.mass)!r}"/><inertia {inertia}/>'
        "</inertial>"
    )


def _numbers(values: Array) -> str:
    return " ".join(repr(float(value) + 0.0) for value in values)
