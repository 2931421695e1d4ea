"""`springdamper` of MJCF joints: stiffness and damping that give a time constant and a damping ratio.

MuJoCo's documentation, "XML Reference", body/joint: with the inertia I that the joint feels in the posture of the file,
stiffness = I / (T² ζ²) and damping = 2 I / T for the time constant T and the damping ratio ζ. As in MuJoCo, 1/I is the
joint's entry on the diagonal of M⁻¹, for a ball joint the mean of its three entries.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from bellcrank.numerics import LARGEST
from bellcrank.robot.load_options import LoadOptions
from bellcrank.robot.mjcf_joints import MjcfJoint
from bellcrank.robot.mjcf_start import Start
from bellcrank.robot.pinocchio_model import pinocchio_model
from bellcrank.robot.urdf_file import Urdf


def has_spring_damper(joint: MjcfJoint) -> bool:
    """Whether a joint has a springdamper that MuJoCo uses: two positive numbers. Raises InputError."""
    given = joint.element.numbers("springdamper", 2, 2)
    return given is not None and min(given) > 0.0 and joint.kind != "free"


def with_spring_dampers(
    joints: Sequence[MjcfJoint], urdf: Urdf, posture: Start, armature: Mapping[str, float]
) -> list[MjcfJoint]:
    """The joints, those with a springdamper with stiffness and damping by it.

    `urdf` is the tree, `posture` that of the file by joint, `armature` the rotor inertia by joint. Raises InputError.
    """
    inertia = _inertias(joints, urdf, posture, armature)
    result = []
    for joint in joints:
        if has_spring_damper(joint):
            time, ratio = joint.element.numbers("springdamper", 2, 2) or (1.0, 1.0)
            felt = inertia[joint.name]
            if not (felt / LARGEST < (time * ratio) ** 2 and felt / LARGEST < time):
                raise joint.element.fail(f"springdamper {time:g} {ratio:g} gives a stiffness above {LARGEST:g}")
            joint = replace(joint, stiffness=(felt / (time * ratio) ** 2,), damping=(2.0 * felt / time,))
        result.append(joint)
    return result


def _inertias(
    joints: Sequence[MjcfJoint], urdf: Urdf, posture: Start, armature: Mapping[str, float]
) -> dict[str, float]:
    """The inertia (kg m² or kg) that each joint feels in a posture."""
    import pinocchio as pin

    model = pinocchio_model(urdf, LoadOptions(clean=False), mimic=False)[0]
    q, own = pin.neutral(model), np.zeros(model.nv)
    places = {}
    for joint in joints:
        moving = model.joints[model.getJointId(joint.name)]
        q[moving.idx_q : moving.idx_q + moving.nq] = posture[joint.name]
        places[joint.name] = slice(moving.idx_v, moving.idx_v + moving.nv)
        own[places[joint.name]] = armature.get(joint.name, 0.0)
    mass = np.array(pin.crba(model, model.createData(), q))
    mass = np.triu(mass) + np.triu(mass, 1).T + np.diag(own)
    try:
        inverse = np.diagonal(np.linalg.inv(mass))
    except np.linalg.LinAlgError:
        inverse = np.zeros(model.nv)
    if not (np.isfinite(inverse).all() and (inverse > 0.0).all()):
        first = next(joint for joint in joints if has_spring_damper(joint))
        raise first.element.fail("springdamper needs the inertia of all joints, and some joint moves no mass")
    return {name: 1.0 / float(inverse[place].mean()) for name, place in places.items()}
