"""The same robot in another unit of length: all lengths times a factor, with mass and time as they are.

Forces then are the factor times, moments and energies its square times as large; angles and accelerations of joints
that turn stay.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

LIMITS = ("lower", "upper", "velocity")


def scaled_urdf(source: Path, target: Path, factor: float) -> Path:
    """Write the URDF with its lengths times a factor, without shapes."""
    tree = ElementTree.parse(source)
    for link in tree.getroot().iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
        for inertia in link.iter("inertia"):
            for key, value in inertia.attrib.items():
                inertia.set(key, repr(float(value) * factor**2))
    for origin in tree.getroot().iter("origin"):
        origin.set("xyz", " ".join(repr(float(x) * factor) for x in origin.get("xyz", "0 0 0").split()))
    for joint in tree.getroot().iter("joint"):
        slides, limit, friction = joint.get("type") == "prismatic", joint.find("limit"), joint.find("dynamics")
        for key in LIMITS if limit is not None and slides else ():
            limit.set(key, repr(float(limit.get(key, 0)) * factor))
        if friction is not None:
            for key, power in (("damping", 0 if slides else 2), ("friction", 1 if slides else 2)):
                friction.set(key, repr(float(friction.get(key, 0)) * factor**power))
    tree.write(target)
    return target


def scaled_options(robot: Any, options: dict[str, Any], factor: float) -> dict[str, Any]:
    """Those of `bc.load_robot` that have lengths in their units; friction, whose width has two units, is none."""
    slides = {joint.name for joint in robot.joints if joint.kind == "prismatic"}
    found = dict(options, friction="none", gravity=tuple(factor * x for x in options["gravity"]))
    found["rotor_inertia"] = {
        name: value * (1.0 if name in slides else factor**2) for name, value in options["rotor_inertia"].items()
    }
    found["frames"] = {
        name: (link, tuple(factor * x for x in xyz), rpy) for name, (link, xyz, rpy) in options["frames"].items()
    }
    found["payloads"] = [
        replace(load, cg=tuple(factor * x for x in load.cg), inertia=tuple(factor**2 * x for x in load.inertia))
        for load in options["payloads"]
    ]
    return found


def units(robot: Any, factor: float) -> tuple[Any, Any, Any]:
    """What position (nq,), velocity (nv,) and joint forces (nv,) are multiplied by."""
    q, v = np.ones(robot.nq), np.ones(robot.nv)
    for joint in robot.joints:
        count = {"prismatic": 1, "planar": 2, "floating": 3}.get(joint.kind, 0)
        q[joint.q : joint.q + count] = v[joint.v : joint.v + count] = factor
    return q, v, factor**2 / v
