"""How the consistent start of a scene moves with its parameters and with the values that it gives.

Coordinates that the scene holds do not move with a parameter; the others follow from the derivative of the constraints,

    J Δ = −φ_p dp − J Δ_held,    J dv = −d(φ̇, ψ) at the given velocities,

wherever these determine them. Where they do not, the start is the nearest posture, or the smallest velocity, that the
search finds (consistent_start.py); its derivative is then computed by central differences of that search, with
Richardson's extrapolation to order 6.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.consistent_start import consistent_start
from bellcrank.dynamics.consistent_starts import consistent_postures, consistent_velocities
from bellcrank.dynamics.design_parameters import design_parameters
from bellcrank.dynamics.system import system_of, system_parameters
from bellcrank.errors import InputError
from bellcrank.numerics import svd

if TYPE_CHECKING:
    from bellcrank.dynamics.directional_equations import DirectionalEquations
    from bellcrank.scene.initial import Initial
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
FIRM = 1e-9  # of the largest singular value: directions below it are not determined
CONSISTENT = 1e-7  # of the right-hand side: a larger remainder means that the constraints cannot stay satisfied
STEP = 1e-2  # of the value, or of 1 where it is smaller: the first step of the differences


@dataclass(frozen=True)
class Variable:
    """What sensitivities are taken with respect to.

    Attributes:
        name: Such as "crank_length", "initial.crank" or "initial.velocity.crank".
        unit: Its unit.
        value: Its value.
        place: Its place among the scene's parameters; None for values of the start.
        joint: The joint of a value of the start, or "".
        velocity: Whether that is a velocity.
    """

    name: str
    unit: str
    value: float
    place: int | None = None
    joint: str = ""
    velocity: bool = False


@dataclass(frozen=True, eq=False)
class StartSensitivities:
    """The derivatives (variables, nq + nv) of the start, and which of them (variables,) are by differences."""

    values: Array
    by_differences: Mask


def start_sensitivities(
    scene: Scene, variables: Sequence[Variable], equations: DirectionalEquations, changes: Array
) -> StartSensitivities:
    """The derivatives of a scene's consistent start.

    `changes` (variables, places) are the changes dp of the parameters that `equations` contain. Raises InputError where
    the constraints cannot stay satisfied when a variable changes.
    """
    robot, count = scene.robot, len(variables)
    found, differences = np.zeros((count, robot.nq + robot.nv)), np.zeros(count, dtype=bool)
    for k, variable in enumerate(variables):
        given = np.zeros(robot.nv)
        if variable.joint:
            given[robot.joint(variable.joint).v] = 1.0
        if not scene.constraints:
            if variable.joint:
                joint = robot.joint(variable.joint)
                found[k, robot.nq + joint.v if variable.velocity else joint.q] = 1.0
            continue
        exact = _Implicit(scene, equations, variable, changes[k]).derivative(given)
        differences[k] = exact is None
        found[k] = _difference(scene, variable) if exact is None else exact
    return StartSensitivities(found, differences)


class _Implicit:
    """Implicit differentiation of the start by one variable."""

    def __init__(self, scene: Scene, equations: DirectionalEquations, variable: Variable, dp: Array) -> None:
        system, robot = system_of(scene), scene.robot
        self._scene, self._variable, self._robot, self._dp = scene, variable, robot, dp
        self._residual = equations.residual
        self._q, self._v = consistent_start(scene)
        self._x = np.zeros(system.size)
        self._x[: robot.nq + robot.nv] = np.concatenate([self._q, self._v])
        self._t, self._p = np.zeros(1), system_parameters(scene)
        self._u = scene.signals_at(np.zeros(1))[0]
        phi, _, self._jacobian = system.linearised_constraints(self._t, self._x, self._u, self._p)
        self._heights = len(phi)

    def derivative(self, given: Array) -> Array | None:
        """(dq, dv); None where the start is not determined by the constraints and what is given."""
        none = np.zeros(self._robot.nv)
        velocity = self._variable.velocity
        held_q, held_v = self._scene.initial.held(self._robot)
        places, rates = self._scene.initial.axes(self._robot, self._q)
        moved, _ = self._change(np.zeros_like(self._q), none)
        step = self._solved(
            self._jacobian[: self._heights], _axes(places, len(none)), held_q, none if velocity else given, moved
        )
        if step is None or any(
            np.abs(step[part]).max() > 0.0 and np.abs(self._v[part]).max() > 0.0 for part, _ in rates
        ):
            return None
        dq = self._robot.configuration_rate(self._q, step)
        _, turned = self._change(dq, none)
        if not (velocity or self._v.any() or turned.any()):
            return np.concatenate([dq, none])  # at rest, whatever the posture
        dv = self._solved(self._jacobian, _axes(rates, len(none)), held_v, given if velocity else none, turned)
        return None if dv is None else np.concatenate([dq, dv])

    def _change(self, dq: Array, dv: Array) -> tuple[Array, Array]:
        """The changes of φ and of (φ̇, ψ)."""
        dx = np.concatenate([dq, dv])
        position, velocity = self._residual(self._t, self._x, self._u, self._p, dx, self._dp)
        return position, velocity

    def _solved(self, jacobian: Array, axes: Array, held: Mask, given: Array, change: Array) -> Array | None:
        """The displacement (nv,) with the held part of `given` that makes up for a change of the residual."""
        kept = np.where(held, given, 0.0)
        right = -(change + jacobian @ (axes.T @ kept))
        matrix = jacobian @ axes.T[:, ~held]
        if not matrix.shape[1]:
            return axes.T @ kept if self._closes(right, right) else None
        left, values, vectors = svd(matrix, f"{self._scene.source}: the derivative of the constraints is")
        firm = values > FIRM * values.max(initial=0.0)
        if firm.sum() < matrix.shape[1]:
            return None
        solved = vectors[: len(values)].T @ ((left[:, : len(values)].T @ right) / values)
        self._closes(right - matrix @ solved, right)
        kept[~held] = solved
        return axes.T @ kept

    def _closes(self, remainder: Array, right: Array) -> bool:
        if np.abs(remainder).max(initial=0.0) > CONSISTENT * max(1.0, np.abs(right).max(initial=0.0)):
            raise InputError(
                f"{self._scene.source}: the start has no derivative by '{self._variable.name}': the constraints cannot "
                "stay satisfied with the held values when it changes; hold fewer joints in 'initial'"
            )
        return True


def _axes(turned: Sequence[tuple[slice, Array]], size: int) -> Array:
    """The rotation (nv, nv) from velocities to the axes in which values of free joints are held."""
    axes = np.eye(size)
    for part, rotation in turned:
        axes[part, part] = rotation
    return axes


def _difference(scene: Scene, variable: Variable) -> Array:
    """The derivative of the start by central differences, extrapolated to order 6."""
    first = STEP * max(abs(variable.value), 1.0) if variable.place is None else STEP * (abs(variable.value) or 1.0)
    table = []
    for step in (first, first / 2.0, first / 4.0):
        ahead, behind = (_start_at(scene, variable, variable.value + sign * step) for sign in (1.0, -1.0))
        table.append((ahead - behind) / (2.0 * step))
    finer = [(4.0 * table[1] - table[0]) / 3.0, (4.0 * table[2] - table[1]) / 3.0]
    return np.asarray((16.0 * finer[1] - finer[0]) / 15.0)


def _start_at(scene: Scene, variable: Variable, value: float) -> Array:
    """The consistent start (nq + nv) with another value of a variable. Raises InputError where there is none."""
    robot, own, initial = scene.robot, scene.own_parameters[None].copy(), scene.initial
    if variable.place is not None:
        own[0, variable.place] = value
    else:
        initial = _with_value(initial, variable, value)
    found = design_parameters(scene, own)
    motion = None if initial.motion is None else scene.motion(initial.motion)
    held_q, held_v = initial.held(robot)
    if found.alike[0]:
        q, verdicts = consistent_postures(scene, found.constrained, initial.posture(robot, motion)[None], held_q)
        if not verdicts.code[0]:
            v, verdicts = consistent_velocities(scene, found.constrained, q, initial.rates(robot, q, motion), held_v)
            if not verdicts.code[0]:
                return np.concatenate([q[0], v[0]])
    raise InputError(
        f"{scene.source}: the start has no derivative by '{variable.name}': there is no consistent start at "
        f"{value:.6g} {variable.unit}".rstrip()
    )


def _with_value(initial: Initial, variable: Variable, value: float) -> Initial:
    if variable.velocity:
        return replace(initial, velocity={**initial.velocity, variable.joint: value})
    return replace(initial, position={**initial.position, variable.joint: value})
