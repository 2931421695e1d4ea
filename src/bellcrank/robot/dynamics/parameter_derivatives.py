"""Derivatives of inverse dynamics by numbers of the robot file and of `load_robot`, as casadi expressions.

Numbers of frames (origins, masses, centres of mass, inertias) are symbols of the traced tree, and ratios and offsets of
mimicking joints are symbols on top of it: their derivatives are by differentiation. The torque is linear in gravity,
rotor inertias and friction coefficients: theirs are the factors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.robot.dynamics.equations import Equations
from bellcrank.robot.model.traced_tree import MASS, setting, trace_tree
from bellcrank.robot.model.tree import TreeFrame, TreeMimic

if TYPE_CHECKING:
    import casadi

OF_JOINTS = ("rotor_inertia", "viscous", "coulomb")
OF_MIMICS = ("ratio", "offset")
GRAVITY = ("gravity.x", "gravity.y", "gravity.z")


@dataclass(frozen=True)
class ParameterDerivatives:
    """The derivatives of the inverse dynamics of these equations by parameters of these names.

    `joint_places` says where the velocity of an independent joint stands, and raises InputError for other names.
    """

    equations: Equations
    names: tuple[str, ...]
    joint_places: Callable[[str], slice]

    def check(self) -> None:
        """Raise InputError where a name is not that of a parameter."""
        for name in self.names:
            self._kind(name)

    def function(self) -> casadi.Function:
        """(q, v, a) -> ∂tau/∂p (nv × np, row by row, sparse)."""
        import casadi

        equations = self.equations
        q = casadi.SX.sym("q", equations.positions)
        v, a = casadi.SX.sym("v", equations.velocities), casadi.SX.sym("a", equations.velocities)
        differentiated = [name for name in self.names if self._kind(name) in ("", *OF_MIMICS)]
        columns = {}
        if differentiated:
            values = casadi.DM([self._value(name) for name in differentiated])
            by_p = self._jacobian(differentiated)(q, v, a, values)
            columns = dict(zip(differentiated, casadi.horzsplit(by_p), strict=True))
        for name in self.names:
            if name not in columns:
                columns[name] = self._factor(name, q, v, a)
        rows = casadi.horzcat(*[columns[name] for name in self.names])
        return casadi.Function("parameter_derivatives", [q, v, a], [casadi.vec(casadi.sparsify(rows).T)])

    # ---- parameters by differentiation

    def _jacobian(self, names: Sequence[str]) -> casadi.Function:
        """(q, v, a, p) -> ∂tau/∂p of numbers of frames and of mimicking joints."""
        import casadi

        tree = self.equations.tree
        p = casadi.SX.sym("p", len(names))
        given = dict(zip(names, casadi.vertsplit(p), strict=True))
        settings = [(*setting(tree, name), k) for k, name in enumerate(names) if not self._kind(name)]
        independent = replace(tree, mimics=())
        traced = trace_tree(independent, self._gravity(), settings, len(names)).inverse_dynamics()
        newton_euler = casadi.Function.deserialize(traced.decode("latin-1"))
        q = casadi.SX.sym("q", self.equations.positions)
        v, a = (casadi.SX.sym(name, self.equations.velocities) for name in "va")
        positions, spread = self._all_joints(given, q)
        tau = spread.T @ newton_euler(positions, spread @ v, spread @ a, p)
        return casadi.Function("jacobian", [q, v, a, p], [casadi.jacobian(tau, p)])

    def _all_joints(self, given: dict[str, Any], q: casadi.SX) -> tuple[casadi.SX, casadi.SX]:
        """The positions of all joints, mimicking ones too, and the matrix S by which their velocities are S v."""
        import casadi

        tree = self.equations.tree
        followed = {mimic.follower: mimic for mimic in tree.mimics}
        places, at_q, at_v = {}, 0, 0
        for k, joint in enumerate(tree.joints, 1):
            if k not in followed:
                places[k] = (at_q, at_v)
                at_q, at_v = at_q + joint.nq, at_v + joint.nv
        positions, rows = [], []
        for k, joint in enumerate(tree.joints, 1):
            ratio, offset, leader = casadi.SX(1.0), casadi.SX(0.0), k
            while leader in followed:  # a follower may follow a follower
                mimic = followed[leader]
                own = tree.joints[leader - 1].name
                offset += ratio * given.get(f"joint.{own}.offset", mimic.offset)
                ratio *= given.get(f"joint.{own}.ratio", mimic.multiplier)
                leader = mimic.leader
            first_q, first_v = places[leader]
            positions.append(ratio * q[first_q : first_q + joint.nq] + offset)
            for i in range(joint.nv):
                row = casadi.SX(1, at_v)
                row[first_v + i] = ratio
                rows.append(row)
        return casadi.vertcat(*positions), casadi.vertcat(*rows)

    def _value(self, name: str) -> float:
        """The value of a number of a frame or of a mimicking joint."""
        kind = self._kind(name)
        if kind:
            mimic = self._mimic(name)
            return mimic.multiplier if kind == "ratio" else mimic.offset
        frame, what = setting(self.equations.tree, name)
        return _number(self.equations.tree.frames[frame], what)

    # ---- parameters in which the torque is linear

    def _factor(self, name: str, q: casadi.SX, v: casadi.SX, a: casadi.SX) -> casadi.SX:
        import casadi

        kind = self._kind(name)
        if kind == "gravity":
            along = tuple(float(name == axis) for axis in GRAVITY)
            traced = trace_tree(self.equations.tree, along, [], 0).inverse_dynamics()
            newton_euler = casadi.Function.deserialize(traced.decode("latin-1"))
            rest = casadi.SX(v.size1(), 1)
            return newton_euler(q, rest, rest, casadi.SX(0, 1))
        factor = casadi.SX(v.size1(), 1)
        part = self.joint_places(_joint_of(name))
        if kind == "coulomb":
            factor[part] = v[part] / casadi.sqrt(casadi.sumsqr(v[part]) + self.equations.width**2)
        else:
            factor[part] = a[part] if kind == "rotor_inertia" else v[part]
        return factor

    # ---- names

    def _kind(self, name: str) -> str:
        """ "gravity", one of OF_JOINTS and OF_MIMICS, or "" for a number of a frame. Raises InputError."""
        if name in GRAVITY:
            return "gravity"
        first, _, last = name.partition(".")[0], "", name.rpartition(".")[2]
        if first == "joint" and last in OF_JOINTS:
            self.joint_places(_joint_of(name))
            return last
        if first == "joint" and last in OF_MIMICS:
            self._mimic(name)
            return last
        try:
            setting(self.equations.tree, name)
        except InputError as error:
            if str(error).startswith("a parameter cannot set"):
                raise InputError(
                    f"{error}; of a robot also joint.NAME.rotor_inertia (viscous, coulomb), joint.NAME.ratio (offset) "
                    "of a joint that mimics another one, and gravity.x (y, z)"
                ) from None
            raise
        return ""

    def _mimic(self, name: str) -> TreeMimic:
        tree, joint = self.equations.tree, _joint_of(name)
        named = {tree.joints[mimic.follower - 1].name: mimic for mimic in tree.mimics}
        if joint not in named:
            raise InputError(unknown_name("joint that mimics another one", joint, list(named)))
        return named[joint]

    def _gravity(self) -> tuple[float, ...]:
        return tuple(float(x) for x in self.equations.gravity)


def _joint_of(name: str) -> str:
    return name.partition(".")[2].rpartition(".")[0]


def _number(frame: TreeFrame, what: int) -> float:
    """What `setting` numbers in a frame."""
    numbers = (*frame.in_parent.translation, *frame.rpy, frame.mass, *frame.lever, *frame.inertia, 1.0)
    assert numbers[MASS] == frame.mass
    return numbers[what]
