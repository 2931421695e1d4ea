"""A robot's equations as casadi expressions, before they are compiled: Pinocchio's traced algorithms and friction.

Inputs are q (nq), v (nv), a or tau (nv), and parameters p.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array
from bellcrank.robot.model.traced_tree import SCALE, setting, trace_tree
from bellcrank.robot.model.tree import Tree, TreeJoint

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True)
class Equations:
    """The tree, gravity (3,) in m/s², and viscous and Coulomb friction (nv,), the latter smoothed over width."""

    tree: Tree
    gravity: Array
    viscous: Array
    coulomb: Array
    width: float

    @property
    def positions(self) -> int:
        """nq."""
        return sum(joint.nq for joint in self._independent())

    @property
    def velocities(self) -> int:
        """nv."""
        return sum(joint.nv for joint in self._independent())

    def algorithm(self, name: str) -> casadi.Function:
        """One of the tracer's algorithms as it is, without friction, with an empty p where it takes one."""
        return _function(getattr(self._traced(self.tree), name)())

    def frames(self, indices: Sequence[int], targets: Sequence[str] = ()) -> casadi.Function:
        """(q, v, p) -> per frame position 3, rotation 9 (row major), linear and angular velocity, world axes.

        p are the numbers that `targets` name, as in `parametric`.
        """
        return _function(self._traced(self.tree, self._settings(targets), len(targets)).frames(list(indices)))

    def frame_acceleration(self, index: int) -> casadi.Function:
        """(q, v, a) -> linear and angular acceleration of a frame, world axes: the rate of its velocity."""
        import casadi

        frame, rate = self.frames([index]), self.algorithm("configuration_rate")
        q, v = (casadi.SX.sym(n, frame.size1_in(k)) for k, n in enumerate(("q", "v")))
        a = casadi.SX.sym("a", v.size1())
        velocity = casadi.vertcat(*casadi.vertsplit(frame(q, v, casadi.SX(0, 1)))[12:18])
        change = casadi.jtimes(velocity, q, rate(q, v)) + casadi.jtimes(velocity, v, a)
        return casadi.Function("frame_acceleration", [q, v, a], [casadi.densify(change)])

    def dynamics(self, name: str) -> casadi.Function:
        """ "inverse_dynamics" (q, v, a) -> tau, or "forward_dynamics" (q, v, tau) -> a, with friction."""
        import casadi

        f = self.algorithm(name)
        q, v, third = (casadi.SX.sym(n, f.size1_in(k)) for k, n in enumerate(("q", "v", "third")))
        friction, p = self.friction(v), casadi.SX(0, 1)
        inverse = name == "inverse_dynamics"
        out = f(q, v, third, p) + friction if inverse else f(q, v, third - friction, p)
        return casadi.Function(name, [q, v, third], [out])

    def friction(self, v: casadi.SX) -> casadi.SX:
        """viscous v + coulomb v / sqrt(|v|² + width²), structurally zero where a joint has none.

        v is the velocity of a joint of one degree of freedom, or the angular velocity of a spherical joint.
        """
        return self.friction_of(v, self.viscous, self.coulomb)

    def friction_of(self, v: casadi.SX, viscous: Array | casadi.SX, coulomb: Array | casadi.SX) -> casadi.SX:
        """The same with other coefficients (nv,), which may be symbols."""
        import casadi

        friction = casadi.SX.zeros(v.size1(), 1)
        for part in self._velocities():
            if _is_there(viscous[part.start]):
                friction[part] += viscous[part.start] * v[part]
            if _is_there(coulomb[part.start]):
                speed = casadi.sqrt(casadi.sumsqr(v[part]) + self.width**2)
                friction[part] += coulomb[part.start] * v[part] / speed
        return friction

    def _velocities(self) -> list[slice]:
        """Where the velocities of the independent joints stand in v."""
        ends = np.cumsum([0, *(joint.nv for joint in self._independent())]).tolist()
        return [slice(a, b) for a, b in pairwise(ends)]

    def _independent(self) -> list[TreeJoint]:
        followers = self.tree.followers()
        return [joint for k, joint in enumerate(self.tree.joints, 1) if k not in followers]

    def gravity_torque(self) -> casadi.Function:
        """(q) -> the torques that hold the robot at rest."""
        import casadi

        f = self.algorithm("inverse_dynamics")
        q, rest = casadi.SX.sym("q", f.size1_in(0)), casadi.SX(f.size1_in(1), 1)
        return casadi.Function("gravity_torque", [q], [f(q, rest, rest, casadi.SX(0, 1))])

    def inertial_torque(self) -> casadi.Function:
        """(q, a) -> M(q) a: inverse dynamics at rest without gravity or friction."""
        import casadi

        f = _function(trace_tree(self.tree, (0.0, 0.0, 0.0), [], 0).inverse_dynamics())
        q, a = casadi.SX.sym("q", f.size1_in(0)), casadi.SX.sym("a", f.size1_in(2))
        return casadi.Function("inertial_torque", [q, a], [f(q, casadi.SX(f.size1_in(1), 1), a, casadi.SX(0, 1))])

    def inertia_diagonal(self) -> casadi.Function:
        """(q) -> M_kk of the joints of one degree of freedom, rotors included; joints that mimic are not allowed."""
        return inertia_diagonal(self.tree)

    def link_torques(self) -> casadi.Function:
        """(q, v, a) -> each massive link's share of the torque, link by link (links x nv), without rotors."""
        import casadi

        f = self._scaled()
        q, v, a, p = (casadi.SX.sym(n, f.size1_in(k)) for k, n in enumerate("qvap"))
        return casadi.Function("link_torques", [q, v, a], [_shares(f, q, v, a, p)])

    def link_gravity_torques(self) -> casadi.Function:
        """(q) -> the same at rest."""
        import casadi

        f = self._scaled()
        q, p = casadi.SX.sym("q", f.size1_in(0)), casadi.SX.sym("p", f.size1_in(3))
        rest = casadi.SX(f.size1_in(1), 1)
        return casadi.Function("link_gravity_torques", [q], [_shares(f, q, rest, rest, p)])

    def _scaled(self) -> casadi.Function:
        """(q, v, a, p) -> torques with each massive link's mass and inertia times its own factor in p, no rotors."""
        settings = [(frame, SCALE, k) for k, frame in enumerate(self.tree.massive_frames())]
        return _function(self._traced(self.tree.without_rotors(), settings, len(settings)).inverse_dynamics())

    def parametric(self, name: str, targets: Sequence[str]) -> casadi.Function:
        """An algorithm with the numbers that `targets` name (see trace.setting) left as p, without friction."""
        return _function(getattr(self._traced(self.tree, self._settings(targets), len(targets)), name)())

    def _settings(self, targets: Sequence[str]) -> list[tuple[int, int, int]]:
        return [(*setting(self.tree, target), k) for k, target in enumerate(targets)]

    def _traced(self, tree: Tree, settings: Iterable[tuple[int, int, int]] = (), parameters: int = 0) -> Any:
        return trace_tree(tree, tuple(float(x) for x in self.gravity), list(settings), parameters)


def _is_there(coefficient: Any) -> bool:
    """Whether a coefficient is a symbol, or a number other than 0."""
    return not isinstance(coefficient, (int, float)) or coefficient != 0.0


def _shares(f: casadi.Function, q: casadi.SX, v: casadi.SX, a: casadi.SX, p: casadi.SX) -> casadi.SX:
    """d torque / d factor, dense and link by link: torque is linear in the factors, so any point will do; here 1."""
    import casadi

    at = casadi.Function("at", [q, v, a, p], [casadi.jacobian(f(q, v, a, p), p)])
    return casadi.vec(casadi.densify(at(q, v, a, casadi.DM.ones(p.size1()))))


def _function(serialized: bytes) -> casadi.Function:
    import casadi

    return casadi.Function.deserialize(serialized.decode("latin-1"))


# ---- The diagonal of a tree's mass matrix alone, in work that grows with the number of joints.
#
# M_kk = S_kᵀ I_k S_k with the composite inertia I_k of all that joint k moves, in its own frame, and its axis S_k;
# for a screw of h m per rad it is aᵀ I a + h² m, as (h a) · (a × c) = 0. Source: composite-rigid-body algorithm,
# Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 6.2, without the off-diagonal entries, whose number grows
# with the square.


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
