"""The derivatives of a robot's dynamics as machine code that is compiled when first called."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.codegen.compile import Compiled
from bellcrank.errors import InputError
from bellcrank.robot.dynamics.compiled_robot import QVA, QVTAU, CompiledRobot, all_finite
from bellcrank.robot.dynamics.derivative_equations import DerivativeEquations, ParameterDerivatives
from bellcrank.robot.dynamics.equations import Equations
from bellcrank.robot.model.joints import joint_named, require_uniform
from bellcrank.robot.model.traced_tree import setting

if TYPE_CHECKING:
    import casadi


class InverseDynamicsDerivatives(NamedTuple):
    """The derivatives of the torques tau(q, v, a), (nv, nv) or (n, nv, nv); row: torque, column: along which.

    Attributes:
        by_position: ∂tau/∂q, column k along δ_k of q ⊕ δ.
        by_velocity: ∂tau/∂v.
        mass_matrix: ∂tau/∂a = M(q).
    """

    by_position: Array
    by_velocity: Array
    mass_matrix: Array


class ForwardDynamicsDerivatives(NamedTuple):
    """The derivatives of the accelerations a(q, v, tau), (nv, nv) or (n, nv, nv); row: acceleration.

    Attributes:
        by_position: ∂a/∂q, column k along δ_k of q ⊕ δ.
        by_velocity: ∂a/∂v.
        inverse_mass_matrix: ∂a/∂tau = M(q)⁻¹.
    """

    by_position: Array
    by_velocity: Array
    inverse_mass_matrix: Array


class RobotDerivatives(CompiledRobot):
    """A robot and the derivatives of its dynamics; `Robot` adds the dynamics."""

    def inverse_dynamics_derivatives(self, q: Any, v: Any, a: Any) -> InverseDynamicsDerivatives:
        """The derivatives of `inverse_dynamics` by position, velocity and acceleration, friction included.

        The position varies in its tangent space, as in Pinocchio: column k of ∂tau/∂q is the derivative along δ_k of
        q ⊕ δ, the position that the velocity δ reaches from q in one second. For joints of one degree of freedom this
        is the plain derivative by q_k; for a free base δ is a displacement (m) and a rotation vector (rad) in the
        base's own axes, for a spherical joint a rotation vector in the child's axes.

        Source: Carpentier & Mansard, Analytical Derivatives of Rigid Body Dynamics Algorithms, RSS 2018, by Pinocchio;
        for few joints plain differentiation of the recursive Newton-Euler algorithm, where that has fewer operations.

        Args:
            q: Position (nq,) or (n, nq).
            v: Velocity (nv,) or (n, nv).
            a: Acceleration (nv,) or (n, nv), rad/s² or m/s².

        Returns:
            ∂tau/∂q, ∂tau/∂v and M, each (nv, nv) or (n, nv, nv), N m or N over rad or m, rad/s or m/s, rad/s² or m/s².

        Raises:
            InputError: A shape is wrong, a number is not finite, or a derivative overflows.

        Example:
            >>> import bellcrank as bc
            >>> robot = bc.load_robot("planar_2r", gravity=(0, -9.81, 0))
            >>> q, v, a = [0.1, 0.2], [0.3, 0.4], [0.5, 0.6]
            >>> by_q, by_v, mass = robot.inverse_dynamics_derivatives(q, v, a)
            >>> higher = robot.inverse_dynamics([0.1 + 1e-6, 0.2], v, a)
            >>> lower = robot.inverse_dynamics([0.1 - 1e-6, 0.2], v, a)
            >>> bool((abs((higher - lower) / 2e-6 - by_q[:, 0]) < 1e-8).all())
            True
        """
        states = self._check.states(QVA, q, v, a)
        found = self.derivative_code("inverse_dynamics")(*states)
        return InverseDynamicsDerivatives(*self._matrices(found, self.nv))

    def forward_dynamics_derivatives(self, q: Any, v: Any, tau: Any) -> ForwardDynamicsDerivatives:
        """The derivatives of `forward_dynamics` by position, velocity and torque, friction included.

        They follow from those of inverse dynamics at the acceleration that tau causes: ∂a/∂x = −M⁻¹ ∂tau/∂x. The
        position varies in its tangent space as in `inverse_dynamics_derivatives`.

        Source: Carpentier & Mansard, Analytical Derivatives of Rigid Body Dynamics Algorithms, RSS 2018; M⁻¹ by the
        factorisation LᵀDL of a tree's mass matrix, Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 6.5.

        Args:
            q: Position (nq,) or (n, nq).
            v: Velocity (nv,) or (n, nv).
            tau: Torques or forces (nv,) or (n, nv), N m or N.

        Returns:
            ∂a/∂q, ∂a/∂v and M⁻¹, each (nv, nv) or (n, nv, nv).

        Raises:
            InputError: A shape is wrong, a number is not finite, or the mass matrix is singular.

        Example:
            >>> import bellcrank as bc, numpy as np
            >>> robot = bc.load_robot("planar_2r")
            >>> by_q, by_v, inverse = robot.forward_dynamics_derivatives([0.1, 0.2], [0.3, 0.4], [0.0, 0.0])
            >>> bool(np.allclose(inverse @ robot.mass_matrix([0.1, 0.2]), np.eye(2)))
            True
        """
        states = self._check.states(QVTAU, q, v, tau)
        found = self.derivative_code("forward_dynamics")(*states)
        if not all(all_finite(each.reshape(-1)) for each in found) and not np.isfinite(found[2]).all():
            raise InputError(
                f"{self.name}: forward dynamics has no finite derivatives: the mass matrix is singular; give the links "
                "that move without inertia mass (`bellcrank check` names them)"
            )
        return ForwardDynamicsDerivatives(*self._matrices(found, self.nv))

    def derivative_code(self, algorithm: str) -> Compiled:
        """The machine code of the derivatives of an algorithm, for callers that need no checks.

        Args:
            algorithm: "inverse_dynamics" or "forward_dynamics".

        Returns:
            A function of arrays (nq,), (nv,), (nv,), or batches of them, with the three matrices row by row (nv²).

        Raises:
            InputError: There is no such algorithm.

        Example:
            >>> import bellcrank as bc, numpy as np
            >>> code = bc.load_robot("planar_2r").derivative_code("inverse_dynamics")
            >>> [matrix.shape for matrix in code(np.zeros(2), np.zeros(2), np.zeros(2))]
            [(4,), (4,), (4,)]
        """
        arguments.one_of("algorithm", algorithm, ("inverse_dynamics", "forward_dynamics"))
        return self._code(f"{algorithm}_derivatives", lambda: getattr(DerivativeEquations(self.equations), algorithm)())

    def casadi(self, name: str, *, frame: str | None = None, parameters: Sequence[str] = ()) -> casadi.Function:
        """One of the robot's functions as a casadi Function of expressions, with named inputs and outputs.

        The functions are "inverse_dynamics" (q, v, a) -> tau, "forward_dynamics" (q, v, tau) -> a, both with the
        robot's friction, "mass_matrix" (q) -> M, "energy" (q, v) -> kinetic, potential, "configuration_rate" (q, v) ->
        q_rate, "frame" (q, v) -> position (3), rotation (3 × 3, frame to world), linear_velocity, angular_velocity (3,
        world's axes), "inverse_dynamics_derivatives" (q, v, a) -> dtau_dq, dtau_dv, M and
        "forward_dynamics_derivatives" (q, v, tau) -> da_dq, da_dv, M_inverse (nv × nv each). Inputs and outputs are
        those of the methods of the same names, in SI units; their values agree to rounding.

        Args:
            name: The function.
            frame: The name of the frame, for "frame".
            parameters: Names of numbers that become a last input p, as in `inverse_dynamics_parameter_derivatives`;
                those of links and of the origins of joints only, and not for the configuration rate and derivatives.

        Returns:
            A casadi.Function of SX expressions, which casadi differentiates further, and which MX graphs may call.

        Raises:
            InputError: There is no such function, frame or parameter.

        Example:
            >>> import bellcrank as bc
            >>> robot = bc.load_robot("planar_2r")
            >>> robot.casadi("forward_dynamics")
            Function(forward_dynamics:(q[2],v[2],tau[2])->(a[2]) SXFunction)
            >>> robot.casadi("frame", frame="tip", parameters=["joint.elbow.origin.x"]).name_in()
            ['q', 'v', 'p']
        """
        arguments.one_of("name", name, tuple(SIGNATURES))
        names = tuple(arguments.several("parameters", parameters, str, "names of parameters"))
        if names and name in WITHOUT_PARAMETERS:
            raise InputError(f"{self.name}: '{name}' has no parameters; differentiate another function by p instead")
        if (frame is not None) != (name == "frame"):
            arguments.refuse("frame", "the name of a frame for 'frame', and None for other functions", frame, self.name)
        index = 0 if frame is None else self.frame_index(frame)
        for parameter in names:
            setting(self._tree, parameter)
        return CasadiFunctions(self.equations, names).function(name, index)

    def inverse_dynamics_parameter_derivatives(self, q: Any, v: Any, a: Any, parameters: Sequence[str]) -> Array:
        """The derivatives of `inverse_dynamics` by numbers of the robot file: lengths, masses, centres of mass, ….

        A parameter is "joint.NAME.origin.x" (y, z in m; roll, pitch, yaw in rad), "link.NAME.mass" (kg),
        "link.NAME.cg.x" (y, z; the centre of mass in the link's frame, m), "link.NAME.inertia.xx" (xy, yy, xz, yz, zz;
        about the centre of mass, kg m²) or "link.NAME.scale" (a factor on mass and inertia), as `sets` of a scene's
        parameters names them; or one of a joint's own: "joint.NAME.rotor_inertia" (kg m² or kg), "joint.NAME.viscous"
        and "joint.NAME.coulomb" (its friction) or "joint.NAME.ratio" and "joint.NAME.offset" of a joint that mimics
        another one; or "gravity.x" (y, z), m/s².

        Args:
            q: Position (nq,) or (n, nq).
            v: Velocity (nv,) or (n, nv).
            a: Acceleration (nv,) or (n, nv).
            parameters: The names of np parameters.

        Returns:
            ∂tau/∂p, (nv, np) or (n, nv, np): N m or N over the unit of the parameter.

        Raises:
            InputError: A parameter is unknown, a shape is wrong, a number is not finite, or a derivative overflows.

        Example:
            >>> import bellcrank as bc
            >>> robot = bc.load_robot("planar_2r", gravity=(0, -9.81, 0))
            >>> rest = [0.0, 0.0]
            >>> robot.inverse_dynamics_parameter_derivatives(rest, rest, rest, ["link.link_2.mass"]).shape
            (2, 1)
        """
        names = arguments.several("parameters", parameters, str, "names of parameters")
        states = self._check.states(QVA, q, v, a)
        derivatives = ParameterDerivatives(self.equations, tuple(names), self._velocity_place)
        derivatives.check()
        if not names:
            return np.zeros((*np.broadcast_shapes(*(x.shape[:-1] for x in states)), self.nv, 0))
        code = self._code(f"parameter derivatives {names}", derivatives.function)
        return self._matrices((code(*states),), len(names))[0]

    def _velocity_place(self, name: str) -> slice:
        joint = require_uniform(joint_named(self.name, self.joints, self.mimics(), name), "a parameter")
        return slice(joint.v, joint.v + joint.nv)

    def _matrices(self, found: Sequence[Array], width: int) -> list[Array]:
        """Each answer (…, nv width) as matrices (…, nv, width), which are finite."""
        return [self._check.answer("a derivative", each).reshape(*each.shape[:-1], self.nv, width) for each in found]


# ---- A robot's functions as casadi Functions with named inputs and outputs, for optimisers and other tools of
# casadi.


STATE = ("q", "v")
# By function: its inputs, and its outputs with their shapes.
SIGNATURES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "inverse_dynamics": ((*STATE, "a"), ("tau",)),
    "forward_dynamics": ((*STATE, "tau"), ("a",)),
    "mass_matrix": (("q",), ("M",)),
    "energy": (STATE, ("kinetic", "potential")),
    "configuration_rate": (STATE, ("q_rate",)),
    "frame": (STATE, ("position", "rotation", "linear_velocity", "angular_velocity")),
    "inverse_dynamics_derivatives": ((*STATE, "a"), ("dtau_dq", "dtau_dv", "M")),
    "forward_dynamics_derivatives": ((*STATE, "tau"), ("da_dq", "da_dv", "M_inverse")),
}
WITHOUT_PARAMETERS = ("configuration_rate", "inverse_dynamics_derivatives", "forward_dynamics_derivatives")


@dataclass(frozen=True)
class CasadiFunctions:
    """The functions of these equations; `parameters` are numbers of frames that become an input p."""

    equations: Equations
    parameters: tuple[str, ...] = ()

    def function(self, name: str, frame: int = 0) -> casadi.Function:
        """One of SIGNATURES; `frame` is the number of the frame of "frame"."""
        import casadi

        inputs, outputs = SIGNATURES[name]
        symbols = [casadi.SX.sym(each, self._size(each)) for each in inputs]
        p = casadi.SX.sym("p", len(self.parameters))
        found = self._makers(frame)[name](symbols, p)
        given = [*symbols, p] if self.parameters else symbols
        names = [*inputs, "p"] if self.parameters else [*inputs]
        return casadi.Function(name, given, found, names, list(outputs))

    def _makers(self, frame: int) -> dict[str, Callable[[Sequence[casadi.SX], casadi.SX], list[casadi.SX]]]:
        import casadi

        equations, nv = self.equations, self.equations.velocities
        traced = self._traced

        def inverse(x: Sequence[casadi.SX], p: casadi.SX) -> list[casadi.SX]:
            return [traced("inverse_dynamics")(*x, p) + equations.friction(x[1])]

        def forward(x: Sequence[casadi.SX], p: casadi.SX) -> list[casadi.SX]:
            return [traced("forward_dynamics")(x[0], x[1], x[2] - equations.friction(x[1]), p)]

        def mass(x: Sequence[casadi.SX], p: casadi.SX) -> list[casadi.SX]:
            return [casadi.reshape(traced("mass_matrix")(x[0], p), nv, nv)]

        def kinematics(x: Sequence[casadi.SX], p: casadi.SX) -> list[casadi.SX]:
            rows = casadi.vertsplit(equations.frames([frame], self.parameters)(*x, p), [0, 3, 12, 15, 18])
            return [rows[0], casadi.reshape(rows[1], 3, 3).T, rows[2], rows[3]]

        def derivatives(algorithm: str) -> Callable[[Sequence[casadi.SX], casadi.SX], list[casadi.SX]]:
            def found(x: Sequence[casadi.SX], _: casadi.SX) -> list[casadi.SX]:
                columns = getattr(DerivativeEquations(equations), algorithm)().call(list(x))
                return [casadi.reshape(each, nv, nv).T for each in columns]

            return found

        return {
            "inverse_dynamics": inverse,
            "forward_dynamics": forward,
            "mass_matrix": mass,
            "energy": lambda x, p: list(casadi.vertsplit(traced("energy")(*x, p))),
            "configuration_rate": lambda x, _: [equations.algorithm("configuration_rate")(*x)],
            "frame": kinematics,
            "inverse_dynamics_derivatives": derivatives("inverse_dynamics"),
            "forward_dynamics_derivatives": derivatives("forward_dynamics"),
        }

    def _traced(self, name: str) -> casadi.Function:
        return self.equations.parametric(name, self.parameters)

    def _size(self, name: str) -> int:
        return self.equations.positions if name == "q" else self.equations.velocities
