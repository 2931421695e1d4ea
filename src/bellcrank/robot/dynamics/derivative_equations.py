"""Derivatives of a robot's dynamics as casadi expressions, before they are compiled.

Derivatives by position are in the tangent space: column k is the derivative along δ_k of the position q ⊕ δ, which the
velocity δ, held for one second, reaches from q: dq/dδ = E(q) at δ = 0 (`configuration_rate`). For joints of one degree
of freedom this is the plain derivative by q; for a free base δ is a displacement and a rotation vector in the base's
own axes. Matrices leave the functions row by row.

Of the numbers of the robot file and of `load_robot`, those of frames (origins, masses, centres of mass, inertias) are
symbols of the traced tree, and ratios and offsets of mimicking joints are symbols on top of it: their derivatives are
by differentiation. The torque is linear in gravity, rotor inertias and friction coefficients: theirs are the factors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from bellcrank.codegen.expression_graph import graph_of
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.robot.dynamics.equations import Equations
from bellcrank.robot.model.traced_tree import MASS, setting, trace_tree
from bellcrank.robot.model.tree import TreeFrame, TreeMimic

if TYPE_CHECKING:
    import casadi

LARGEST_PLAIN = 12  # degrees of freedom up to which plain differentiation may take fewer operations


@dataclass(frozen=True)
class DerivativeEquations:
    """Derivatives of these equations."""

    equations: Equations

    def inverse_dynamics(self) -> casadi.Function:
        """(q, v, a) -> ∂tau/∂q, ∂tau/∂v, M (nv × nv each, row by row, sparse), with friction."""
        import casadi

        q, v, a = self._symbols("a")
        by_q, by_v, mass = self._newton_euler()(q, v, a)
        by_v += casadi.jacobian(self.equations.friction(v), v)
        return casadi.Function("inverse_dynamics_derivatives", [q, v, a], [_rows(x) for x in (by_q, by_v, mass)])

    def forward_dynamics(self) -> casadi.Function:
        """(q, v, tau) -> ∂a/∂q, ∂a/∂v, M⁻¹ (nv × nv each, row by row), with friction.

        M a + h(q, v) = tau differentiated at fixed tau: M ∂a/∂x = −∂tau/∂x, the latter at the acceleration a that tau
        causes. Source: Carpentier & Mansard, Analytical Derivatives of Rigid Body Dynamics Algorithms, RSS 2018.
        """
        import casadi

        q, v, tau = self._symbols("tau")
        derivatives = self._newton_euler()
        rest = casadi.SX(v.size1(), 1)
        solver = Factorisation.of(derivatives(q, v, rest)[2])
        friction = self.equations.friction(v)
        bias = self.equations.algorithm("inverse_dynamics")(q, v, rest, casadi.SX(0, 1)) + friction
        by_q, by_v, _ = derivatives(q, v, solver.solve(tau - bias))
        by_v += casadi.jacobian(friction, v)
        inverse = solver.inverse()
        found = [solver.solve(by_q, -1.0), solver.solve(by_v, -1.0), inverse]
        return casadi.Function("forward_dynamics_derivatives", [q, v, tau], [_rows(x) for x in found])

    def _newton_euler(self) -> casadi.Function:
        """(q, v, a) -> ∂tau/∂q, ∂tau/∂v, M without friction: of two ways that of the fewest operations."""
        if self.equations.velocities > LARGEST_PLAIN:
            return self._recursive()
        return min((self._recursive(), self._plain()), key=_operations)

    def _recursive(self) -> casadi.Function:
        import casadi

        traced = self.equations.algorithm("inverse_dynamics_derivatives")
        q, v, a = self._symbols("a")
        return casadi.Function("recursive", [q, v, a], list(traced.call([q, v, a, casadi.SX(0, 1)])))

    def _plain(self) -> casadi.Function:
        """By differentiating the expressions of the recursive Newton-Euler algorithm; M by composite bodies."""
        import casadi

        q, v, a = self._symbols("a")
        none = casadi.SX(0, 1)
        tau = self.equations.algorithm("inverse_dynamics")(q, v, a, none)
        rate = casadi.jacobian(self.equations.algorithm("configuration_rate")(q, v), v)
        mass = self.equations.algorithm("mass_matrix")(q, none)
        nv = v.size1()
        by_q = casadi.jacobian(tau, q) @ rate
        return casadi.Function(
            "plain", [q, v, a], [by_q, casadi.jacobian(tau, v), casadi.sparsify(casadi.reshape(mass, nv, nv))]
        )

    def _symbols(self, third: str) -> tuple[casadi.SX, casadi.SX, casadi.SX]:
        import casadi

        nv = self.equations.velocities
        return casadi.SX.sym("q", self.equations.positions), casadi.SX.sym("v", nv), casadi.SX.sym(third, nv)


def _rows(matrix: casadi.SX) -> casadi.SX:
    import casadi

    return casadi.vec(matrix.T)


def _operations(function: casadi.Function) -> int:
    return graph_of(function.serialize().encode("latin-1")).operations


# ---- Linear equations with a sparse symmetric positive matrix of expressions, such as the mass matrix of a tree.
#
# A = Lᵀ D L with a unit lower triangle L, from the last row to the first. For the mass matrix of a tree, L has
# entries only where A has: those of a joint's row are at the joints that carry it. Right-hand sides may be sparse
# too. Source: the LTDL factorisation, Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 6.5.


@dataclass(frozen=True)
class Factorisation:
    """The entries of L below its diagonal, row by row and by column, and 1 / D."""

    lower: list[dict[int, casadi.SX]]
    reciprocal: list[casadi.SX]

    @classmethod
    def of(cls, matrix: casadi.SX) -> Factorisation:
        """The factors of a symmetric matrix, of which the lower triangle is read."""
        import casadi

        rows = casadi.vertsplit(casadi.tril(matrix))
        lower: list[dict[int, casadi.SX]] = [{} for _ in rows]
        reciprocal: list[casadi.SX] = [casadi.SX(0)] * len(rows)
        for k in range(len(rows) - 1, -1, -1):
            reciprocal[k] = 1.0 / casadi.densify(rows[k][k])  # infinite where there is no inertia
            left = rows[k][:k]
            for i in left.sparsity().get_triplet()[1]:
                lower[k][i] = left[i] * reciprocal[k]
                rows[i] = rows[i] - lower[k][i] * rows[k] * _up_to(i, len(rows))
        return cls(lower, reciprocal)

    def solve(self, right: casadi.SX, sign: float = 1.0) -> casadi.SX:
        """A⁻¹ B, or −A⁻¹ B for a sign of −1; sparse where it is zero."""
        import casadi

        rows = casadi.vertsplit(right)
        for k in range(len(rows) - 1, -1, -1):
            for i, factor in self.lower[k].items():
                rows[i] = rows[i] - factor * rows[k]
        for k, factors in enumerate(self.lower):
            rows[k] = rows[k] * (sign * self.reciprocal[k])
            for i, factor in factors.items():
                rows[k] = rows[k] - factor * rows[i]
        return casadi.vertcat(*rows)

    def inverse(self) -> casadi.SX:
        """A⁻¹, from L A⁻¹ = D⁻¹ L⁻ᵀ, whose right-hand side is an upper triangle with the diagonal D⁻¹."""
        import casadi

        size = len(self.lower)
        found = casadi.SX(size, size)
        for k, factors in enumerate(self.lower):
            row = casadi.SX(1, k)
            for i, factor in factors.items():
                row = row - factor * found[i, :k]
            found[k, :k] = row
            found[:k, k] = row.T
            found[k, k] = self.reciprocal[k] - sum(factor * row[i] for i, factor in factors.items())
        return found


def _up_to(last: int, width: int) -> casadi.DM:
    """A sparse row of ones in the columns from 0 to `last`."""
    import casadi

    return casadi.DM(casadi.Sparsity.triplet(1, width, [0] * (last + 1), list(range(last + 1))))


# ---- by numbers of the robot file and of load_robot


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
