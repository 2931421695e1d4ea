"""A robot's functions as casadi Functions with named inputs and outputs, for optimisers and other tools of casadi."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bellcrank.robot.derivative_equations import DerivativeEquations
from bellcrank.robot.equations import Equations

if TYPE_CHECKING:
    import casadi

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
