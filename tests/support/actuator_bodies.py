"""Bodies of actuators as payloads of a robot: the independent way to load a mechanism with them."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

import bellcrank as bc
from bellcrank.actuators.gear import DIRECT


def payload_at_joint(robot, joint, mass, axial, transverse):
    """A body on the parent link of a joint, at the joint's origin, its axis along the joint's, from the URDF's text."""
    joints = robot.urdf.joints
    found = next(one for one in (joints.values() if isinstance(joints, dict) else joints) if one.name == joint)
    axis = Rotation.from_euler("xyz", found.rpy).apply(np.array(found.axis) / np.linalg.norm(found.axis))
    return body(found.parent, mass, axial, transverse, axis, found.xyz)


def body(frame, mass, axial, transverse, axis, point=(0.0, 0.0, 0.0)):
    """A body with rotational symmetry about an axis through a point of a frame."""
    axis = np.asarray(axis, dtype=float)
    inertia = transverse * np.eye(3) + (axial - transverse) * np.outer(axis, axis)
    six = (inertia[0, 0], inertia[0, 1], inertia[1, 1], inertia[0, 2], inertia[1, 2], inertia[2, 2])
    return bc.Payload(mass, frame, cg=tuple(point), inertia=six)


@dataclass(frozen=True)
class Cylinders:
    """Mass, kg, and inertia along and across the axis, kg m², of solid cylinders one behind the other."""

    mass: float
    axial_inertia: float
    transverse_inertia: float


def cylinders(motor, gear=DIRECT):
    """A motor and its gear by the parallel axis theorem; a body whose diameter or length is unknown is a point mass."""
    parts = [motor] + ([] if gear.kind == "direct" else [gear])
    sized = [(part.mass, part.diameter / 2.0, part.length) for part in parts if part.diameter and part.length]
    mass, weight = sum(part.mass for part in parts), sum(m for m, _, _ in sized)
    starts = np.cumsum([0.0] + [length for _, _, length in sized])
    centres = [start + length / 2.0 for start, (_, _, length) in zip(starts, sized, strict=False)]
    middle = sum(m * x for (m, _, _), x in zip(sized, centres, strict=True)) / weight if weight else 0.0
    axial = sum(m * r * r / 2.0 for m, r, _ in sized)
    transverse = sum(
        m * (3.0 * r * r + length * length) / 12.0 + m * (x - middle) ** 2
        for (m, r, length), x in zip(sized, centres, strict=True)
    )
    return Cylinders(mass, axial, float(transverse))
