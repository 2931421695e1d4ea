"""The diagonal of a tree's mass matrix alone, in work that grows with the number of joints.

M_kk = S_kᵀ I_k S_k with the composite inertia I_k of all that joint k moves, in its own frame, and its axis S_k; for a
screw of h m per rad it is aᵀ I a + h² m, as (h a) · (a × c) = 0.
Source: composite-rigid-body algorithm, Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 6.2, without the
off-diagonal entries, whose number grows with the square.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.robot.tree import Tree

if TYPE_CHECKING:
    import casadi


def inertia_diagonal(tree: Tree) -> casadi.Function:
    """(q) -> M_kk of each joint of one degree of freedom, in their order, rotors included, kg m² or kg.

    No joint may mimic another one. The coordinates of a joint with several degrees of freedom do not matter, as
    it moves with all that it carries.
    """
    import casadi

    q = casadi.SX.sym("q", sum(joint.nq for joint in tree.joints))
    mass = [casadi.SX(float(joint.mass)) for joint in tree.joints]
    moment: list[Any] = []  # first moment of mass, about the joint's origin, in its frame
    second: list[Any] = []  # inertia there
    for joint in tree.joints:
        lever = np.array(joint.lever)
        moment.append(casadi.SX(casadi.sparsify(casadi.DM(joint.mass * lever))))
        about = _matrix(joint.inertia) + joint.mass * (lever @ lever * np.eye(3) - np.outer(lever, lever))
        second.append(casadi.SX(casadi.sparsify(casadi.DM(about))))
    places = np.cumsum([0, *(joint.nq for joint in tree.joints)])
    found: list[Any] = [None] * len(tree.joints)
    for k in range(len(tree.joints) - 1, -1, -1):  # a parent comes before its children
        joint, axis = tree.joints[k], casadi.SX(casadi.sparsify(casadi.DM(tree.joints[k].axis)))
        if joint.nv != 1:
            continue  # what carries it, a free base, has no entry of its own
        turns, travel = joint.kind != "prismatic", {"prismatic": 1.0, "screw": joint.pitch}.get(joint.kind, 0.0)
        found[k] = casadi.SX(joint.armature[0])
        if turns:
            found[k] += axis.T @ second[k] @ axis
        if travel:
            found[k] += travel**2 * mass[k]
        if not (parent := joint.parent):
            continue
        angle = q[int(places[k])]
        rotation = casadi.SX(casadi.sparsify(casadi.DM(np.array(joint.placement.rotation).reshape(3, 3))))
        shift = casadi.SX(casadi.sparsify(casadi.DM(joint.placement.translation)))
        if travel:
            shift = shift + rotation @ axis * (travel * angle)
        if turns:
            rotation = rotation @ _about_axis(axis, angle)
        arm, about = rotation @ moment[k], rotation @ second[k] @ rotation.T
        crossed = arm @ shift.T
        arms = casadi.dot(arm, shift)
        lengths = casadi.dot(shift, shift)
        about += (2.0 * arms + mass[k] * lengths) * casadi.SX.eye(3) - crossed - crossed.T
        about -= mass[k] * (shift @ shift.T)
        second[parent - 1] += about
        moment[parent - 1] += arm + mass[k] * shift
        mass[parent - 1] += mass[k]
    return casadi.Function(
        "inertia_diagonal", [q], [casadi.densify(casadi.vertcat(*(x for x in found if x is not None)))]
    )


def _matrix(six: tuple[float, ...]) -> Any:
    xx, xy, yy, xz, yz, zz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _about_axis(axis: casadi.SX, angle: casadi.SX) -> casadi.SX:
    """The rotation by an angle about a unit axis (Rodrigues)."""
    import casadi

    sine, cosine = casadi.sin(angle), casadi.cos(angle)
    return cosine * casadi.SX.eye(3) + sine * casadi.skew(axis) + (1.0 - cosine) * (axis @ axis.T)
