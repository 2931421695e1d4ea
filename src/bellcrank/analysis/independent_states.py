"""Independent coordinates of a constrained scene near an operating point.

Displacements that satisfy the holonomic rows are δ = T δ_I, changes of velocity that satisfy all rows are
v = N v_I + W δ_I: the dependent velocities also depend on the position, W being the solution of J W = −∂w/∂δ T.
Positions are reduced by holonomic rows only, velocities by all of them: a rolling wheel has more positions than
velocities. A linear field on all (δ, v) that keeps the constraints is then S A [T 0; W N], S being the independent
rows.

Which coordinates are independent follows from QR factorisations with pivoting. Sources: D. L. Peterson, G. Gede & M.
Hubbard, Symbolic linearization of equations of motion of constrained multibody systems, Multibody System Dynamics 33
(2015); Golub & Van Loan, Matrix Computations, 4th ed., 5.4.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import qr

from bellcrank.analysis.operating_point import OperatingPoint, state_units
from bellcrank.arrays import Array
from bellcrank.dynamics.equations.kkt_solver import SINGULAR
from bellcrank.robot.model.joints import lengths_in_velocity

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene

PREFERRED = 0.1  # factor by which the columns of joints of one degree of freedom are less likely to be dependent


@dataclass(frozen=True, eq=False, kw_only=True)
class IndependentStates:
    """The independent states of an operating point.

    Attributes:
        positions: The independent displacements among δ (nv,).
        velocities: The independent velocities among v (nv,).
        embedding: [T 0; W N] (2 nv, n): all displacements and velocities of the independent ones.
    """

    positions: tuple[int, ...]
    velocities: tuple[int, ...]
    embedding: Array

    @property
    def rows(self) -> list[int]:
        """The independent ones among all (δ, v)."""
        nv = len(self.embedding) // 2
        return [*self.positions, *(nv + k for k in self.velocities)]


def independent_states(point: OperatingPoint) -> IndependentStates:
    """Choose the independent states at an operating point."""
    at, scene = point.equations, point.symmetries.scene
    nv, h, unit = len(point.velocity), len(at.position_residual), state_units(scene)
    likely = np.ones(nv)
    for joint in scene.robot.joints:
        if joint.nv == 1:
            likely[joint.v] = PREFERRED
    scaled = at.jacobian * unit
    holonomic = _dependent(scaled[:h] * likely)
    rest = [k for k in range(nv) if k not in holonomic]
    basis = np.linalg.svd(scaled[:, holonomic], full_matrices=True)[0][:, len(holonomic) :]
    both = [*holonomic, *(rest[k] for k in _dependent(basis.T @ scaled[:, rest] * likely[rest], scaled))]
    positions = tuple(rest)
    velocities = tuple(k for k in rest if k not in both)
    t = _completed(scaled[:h], holonomic, positions, unit)
    n = _completed(scaled, both, velocities, unit)
    w = np.zeros((nv, len(positions)))
    if both:
        w[both] = np.linalg.lstsq(scaled[:, both], -at.velocity_by_position @ t, rcond=None)[0] * unit[both, None]
    embedding = np.block([[t, np.zeros((nv, len(velocities)))], [w, n]])
    return IndependentStates(positions=positions, velocities=velocities, embedding=embedding)


def _dependent(matrix: Array, whole: Array | None = None) -> list[int]:
    """As many columns of a matrix as its rank, chosen by pivoting; small is what is small in `whole`."""
    if not matrix.size:
        return []
    _, r, order = qr(matrix, mode="economic", pivoting=True)
    size = np.abs(np.diagonal(r))
    largest = np.linalg.norm(matrix if whole is None else whole, 2)
    return [int(k) for k in order[: np.count_nonzero(size > SINGULAR * largest * PREFERRED)]]


def _completed(matrix: Array, dependent: list[int], independent: tuple[int, ...], unit: Array) -> Array:
    """The null space (nv, k) of a matrix that is the identity on the independent columns."""
    found = np.zeros((len(unit), len(independent)))
    found[list(independent), range(len(independent))] = 1.0
    if dependent:
        right = -matrix[:, list(independent)] / unit[list(independent)]
        found[dependent] = np.linalg.lstsq(matrix[:, dependent], right, rcond=None)[0] * unit[dependent, None]
    return found


def coordinate_names(robot: Robot) -> tuple[tuple[str, str], ...]:
    """(name, unit) of each degree of freedom (nv), those of a free joint in the axes of its own body."""
    names: list[tuple[str, str]] = []
    for joint in robot.joints:
        if joint.nv == 1:
            names.append((joint.name, "m" if lengths_in_velocity(robot)[joint.v] else "rad"))
            continue
        if joint.kind == "planar":
            names += [(f"{joint.name} x", "m"), (f"{joint.name} y", "m"), (f"{joint.name} angle", "rad")]
            continue
        if joint.kind == "floating":
            names += [(f"{joint.name} {axis}", "m") for axis in "xyz"]
        names += [(f"{joint.name} rotation {axis}", "rad") for axis in "xyz"]
    return tuple(names)


def state_names(scene: Scene, states: IndependentStates) -> tuple[tuple[str, str], ...]:
    """(name, unit) of each independent state: displacements, then velocities."""
    names = coordinate_names(scene.robot)
    rates = [(f"{names[k][0]} rate", f"{names[k][1]}/s") for k in states.velocities]
    return (*(names[k] for k in states.positions), *rates)
