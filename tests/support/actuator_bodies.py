"""Bodies of actuators as payloads of a robot: the independent way to load a mechanism with them."""

import numpy as np
from scipy.spatial.transform import Rotation

import bellcrank as bc


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
