"""Tools that find the fastest motion along a path: toppra and copp-py, with torques from Pinocchio sample by sample.

Each solves the first-order problem on the same grid, with a constant path acceleration in each cell. toppra limits the
torques at the beginning of each cell ("collocation") or at both ends ("interpolation"); copp-py at both ends.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.robot.robot import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class PathProblem:
    """A robot without friction, the natural cubic spline through waypoints over s from 0 to 1, and torque limits.

    Attributes:
        robot: The robot.
        waypoints: Positions (m, nq), rad or m, at evenly spaced s.
        torque: Largest torques (nv,), N m or N.
        cells: Number of equal cells of the grid.
    """

    robot: Robot
    waypoints: Array
    torque: Array
    cells: int

    @property
    def parameters(self) -> Array:
        """The path parameters (m,) of the waypoints."""
        return np.linspace(0.0, 1.0, len(self.waypoints))

    @property
    def grid(self) -> Array:
        """The ends of the cells (cells + 1,)."""
        return np.linspace(0.0, 1.0, self.cells + 1)

    def duration(self, speed: Array) -> float:
        """The time of a motion, s, from its path speeds (cells + 1,) at the ends of cells."""
        return float(np.sum(2.0 / self.cells / (speed[1:] + speed[:-1])))


def pinocchio_torques(robot: Robot) -> Callable[[Array, Array, Array], Array]:
    """Pinocchio's inverse dynamics of one sample."""
    import pinocchio as pin

    model, data = robot.model, robot.model.createData()
    return lambda q, v, a: np.asarray(pin.rnea(model, data, q, v, a))


def toppra_run(problem: PathProblem, scheme: str = "Collocation") -> Callable[[], Array]:
    """A call of toppra with its solver seidel, in Cython: path speeds (cells + 1,)."""
    import toppra

    logging.getLogger("toppra").setLevel(logging.ERROR)
    torques, bounds = pinocchio_torques(problem.robot), np.stack([-problem.torque, problem.torque], axis=1)
    path = toppra.SplineInterpolator(problem.parameters, problem.waypoints, bc_type="natural")
    grid = problem.grid

    def run() -> Array:
        limited = toppra.constraint.JointTorqueConstraint(torques, bounds, np.zeros(len(bounds)))
        limited.set_discretization_type(getattr(toppra.constraint.DiscretizationType, scheme))
        solver = toppra.algorithm.TOPPRA([limited], path, gridpoints=grid, solver_wrapper="seidel")
        return np.asarray(solver.compute_parameterization(0.0, 0.0)[1])

    return run


def copp_run(problem: PathProblem) -> Callable[[], Array]:
    """A call of copp-py's reachability analysis in Rust: path speeds (cells + 1,)."""
    import copp_py
    from scipy.interpolate import CubicSpline

    torques = pinocchio_torques(problem.robot)
    spline = CubicSpline(problem.parameters, problem.waypoints, bc_type="natural")
    grid, most = problem.grid, problem.torque
    analysis: Any = copp_py.solver.topp2_ra

    def run() -> Array:
        robot = copp_py.Robot(len(most), capacity=len(grid), inverse_dynamics=torques)
        robot.append_s(grid)
        robot.set_q(spline(grid), spline(grid, 1), spline(grid, 2), 0)
        robot.add_torque_limits(most, -most, start_idx_s=0)
        found = analysis.solve(analysis.Problem(robot.constraints, (0, len(grid) - 1), (0.0, 0.0)))
        return np.asarray(np.sqrt(found))

    return run


AT_BEGINNING, AT_BOTH_ENDS = "limits at beginnings of cells", "limits at both ends of cells"
RUNS: dict[tuple[str, str], Callable[[PathProblem], Callable[[], Array]]] = {
    ("toppra", AT_BEGINNING): toppra_run,
    ("toppra", AT_BOTH_ENDS): partial(toppra_run, scheme="Interpolation"),
    ("copp-py", AT_BOTH_ENDS): copp_run,
}
