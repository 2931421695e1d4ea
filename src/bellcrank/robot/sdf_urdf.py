"""Writes joints of SDFormat as joints of a URDF in the extended sense."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from xml.sax.saxutils import quoteattr

import numpy as np

from bellcrank.robot.mjcf_names import Names
from bellcrank.robot.mjcf_placement import Array
from bellcrank.robot.mjcf_urdf import origin
from bellcrank.robot.sdf_joints import JointAxis, SdfJoint


def fixed_xml(name: str, parent: str, child: str, place: Array) -> str:
    """A fixed joint."""
    return f'<joint name={quoteattr(name)} type="fixed">{_ends(parent, child)}{origin(place)}</joint>'


def floating_xml(name: str, parent: str, child: str, place: Array) -> str:
    """A joint with all freedoms."""
    return f'<joint name={quoteattr(name)} type="floating">{_ends(parent, child)}{origin(place)}</joint>'


def joint_xml(joint: SdfJoint, parent: str, child: str, place: Array, links: Names) -> Iterator[str]:
    """A joint; one with two axes that differ in more than their direction is two revolute joints and a link."""
    axes = joint.axes
    if len(axes) == 2 and replace(axes[1], direction=axes[0].direction) != axes[0]:
        cross = links.new(f"{joint.name}_cross")
        yield f"<link name={quoteattr(cross)}/>"
        for k, (axis, ends) in enumerate(zip(axes, ((parent, cross), (cross, child)), strict=True), 1):
            single = replace(joint, name=f"{joint.name}_{k}", type="revolute", axes=(axis,))
            yield from joint_xml(single, *ends, place if k == 1 else np.eye(4), links)
        return
    kind = joint.type
    if kind == "revolute" and axes[0].lower is None and axes[0].upper is None:
        kind = "continuous"
    pitch = f' pitch="{joint.pitch!r}"' if kind == "screw" else ""
    parts = [f"<joint name={quoteattr(joint.name)} type={quoteattr(kind)}{pitch}>{_ends(parent, child)}{origin(place)}"]
    for tag, axis in zip(("axis", "axis2"), axes, strict=False):
        parts.append(f'<{tag} xyz="{" ".join(map(repr, axis.direction))}"/>')
    if axes:
        parts += _numbers(axes[0], kind)
    yield "".join([*parts, "</joint>"])


def _numbers(axis: JointAxis, kind: str) -> Iterator[str]:
    limits = {"effort": axis.effort, "velocity": axis.velocity}
    if kind != "continuous":
        # URDF takes a missing one of two limits for 0
        limits |= {"lower": axis.lower, "upper": axis.upper}
        if (axis.lower is None) != (axis.upper is None):
            limits |= {"lower": -1e30 if axis.lower is None else axis.lower}
            limits |= {"upper": 1e30 if axis.upper is None else axis.upper}
    listed = " ".join(f'{key}="{value!r}"' for key, value in limits.items() if value is not None)
    if listed:
        yield f"<limit {listed}/>"
    if axis.damping or axis.friction:
        yield f'<dynamics damping="{axis.damping!r}" friction="{axis.friction!r}"/>'
    if axis.mimic is not None:
        leader, multiplier, offset = axis.mimic
        yield f'<mimic joint={quoteattr(leader)} multiplier="{multiplier!r}" offset="{offset!r}"/>'


def _ends(parent: str, child: str) -> str:
    return f"<parent link={quoteattr(parent)}/><child link={quoteattr(child)}/>"
