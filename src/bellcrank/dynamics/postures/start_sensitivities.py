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

from bellcrank.arrays import Array, Mask
from bellcrank.dynamics.equations.design_parameters import design_parameters
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.dynamics.postures.consistent_start import consistent_postures, consistent_start, consistent_velocities
from bellcrank.errors import InputError
from bellcrank.numerics import svd

if TYPE_CHECKING:
    from bellcrank.dynamics.equations.directional_equations import DirectionalEquations
    from bellcrank.scene.initial import Initial
    from bellcrank.scene.scene import Scene

FIRM = 1e-9  # of the largest singular value: directions below it are not determined
CONSISTENT = 1e-7  # of the right-hand side: a larger remainder means that the constraints cannot stay satisfied
STEP = 1e-2  # of the value, or of 1 where it is smaller: the first step of the differences


@dataclass(frozen=True)
class StartVariable:
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
    scene: Scene, variables: Sequence[StartVariable], equations: DirectionalEquations, changes: Array
) -> StartSensitivities:
    """The derivatives of a scene's consistent start.

    `changes` (variables, places) are the changes dp of the parameters that `equations` contain. Raises InputError where
    the constraints cannot stay satisfied when a variable changes.
    """
    robot, count = scene.robot, len(variables)
    given = np.zeros((2, count, robot.nv))  # of positions and velocities that the scene gives
    for k, variable in enumerate(variables):
        if variable.joint:
            given[int(variable.velocity), k, robot.joint(variable.joint).v] = 1.0
    if not scene.constraints:
        return StartSensitivities(_unconstrained(scene, given), np.zeros(count, dtype=bool))
    found, known = _Implicit(scene, variables, equations, changes).derivatives(*given)
    for k in np.flatnonzero(~known).tolist():
        found[k] = _difference(scene, variables[k])
    return StartSensitivities(found, ~known)


def _unconstrained(scene: Scene, given: Array) -> Array:
    """The derivatives where nothing but the given values decides on the start."""
    robot = scene.robot
    q = np.zeros((given.shape[1], robot.nq))
    for joint in robot.joints:
        if joint.nv == 1:
            q[:, joint.q] = given[0, :, joint.v]
    return np.hstack([q, given[1]])


class _Implicit:
    """Implicit differentiation of the start by some variables."""

    def __init__(
        self, scene: Scene, variables: Sequence[StartVariable], equations: DirectionalEquations, changes: Array
    ) -> None:
        system, robot = system_of(scene), scene.robot
        self._scene, self._variables, self._robot, self._changes = scene, variables, robot, changes
        self._residual = equations.residual
        self._q, self._v = consistent_start(scene)
        x = np.zeros(system.size)
        x[: robot.nq + robot.nv] = np.concatenate([self._q, self._v])
        self._point = np.zeros(1), x, scene.signals_at(np.zeros(1))[0], system_parameters(scene)
        phi, _, self._jacobian = system.linearised_constraints(*self._point)
        self._heights = len(phi)

    def derivatives(self, given_q: Array, given_v: Array) -> tuple[Array, Mask]:
        """(dq, dv) (variables, nq + nv), and for which variables the constraints and what is given determine it."""
        robot, count = self._robot, len(self._variables)
        held_q, held_v = self._scene.initial.held(robot)
        places, rates = self._scene.initial.axes(robot, self._q)
        moved = self._change(np.zeros((count, robot.nq)))[0]
        step, known = self._solved(self._jacobian[: self._heights], _axes(places, robot.nv), held_q, given_q, moved)
        dq = robot.configuration_rate(np.broadcast_to(self._q, (count, robot.nq)), step)
        turned = self._change(dq)[1]
        rate, settled = self._solved(self._jacobian, _axes(rates, robot.nv), held_v, given_v, turned)
        if self._v.any():
            settled &= self._determined
        for part, _ in rates:  # the axes of a given velocity turn
            settled &= ~(step[:, part].any(axis=1) & self._v[part].any())
        return np.hstack([dq, rate]), known & settled

    def _change(self, dq: Array) -> list[Array]:
        """The changes of φ and of (φ̇, ψ) along displacements (variables, nq) and the changes of parameters."""
        dx = np.hstack([dq, np.zeros((len(dq), self._robot.nv))])
        return self._residual.rows(*self._point, dx, self._changes)

    def _solved(self, jacobian: Array, axes: Array, held: Mask, given: Array, change: Array) -> tuple[Array, Mask]:
        """Displacements (variables, nv) with the held part of `given` that make up for changes of the residual.

        Also for which variables there is one such displacement, or nothing that needs one.
        """
        kept = np.where(held, given, 0.0)
        right = -(change + kept @ (jacobian @ axes.T).T)
        matrix = jacobian @ axes.T[:, ~held]
        known: Mask = np.asarray(~right.any(axis=1) & ~given[:, ~held].any(axis=1))  # a guess moves the nearest start
        self._determined = True
        if matrix.shape[1]:
            what = f"{self._scene.source}: the derivative of the constraints is"
            left, values, vectors = svd(matrix, what, full=False)
            self._determined = len(values) == matrix.shape[1] and bool(values[-1] > FIRM * values[0])
            if self._determined:
                kept[:, ~held] = ((right @ left) / values) @ vectors
        if self._determined:
            self._check(right - kept[:, ~held] @ matrix.T, right)
            known[:] = True
        return kept @ axes, known

    def _check(self, remainder: Array, right: Array) -> None:
        """Raise InputError where the constraints cannot stay satisfied."""
        size = np.maximum(1.0, np.abs(right).max(axis=1, initial=0.0))
        for k in np.flatnonzero(np.abs(remainder).max(axis=1, initial=0.0) > CONSISTENT * size).tolist():
            raise InputError(
                f"{self._scene.source}: the start has no derivative by '{self._variables[k].name}': the constraints "
                "cannot stay satisfied with the held values when it changes; hold fewer joints in 'initial'"
            )


def _axes(turned: Sequence[tuple[slice, Array]], size: int) -> Array:
    """The rotation (nv, nv) from velocities to the axes in which values of free joints are held."""
    axes = np.eye(size)
    for part, rotation in turned:
        axes[part, part] = rotation
    return axes


def _difference(scene: Scene, variable: StartVariable) -> Array:
    """The derivative of the start by central differences, extrapolated to order 6."""
    first = STEP * max(abs(variable.value), 1.0) if variable.place is None else STEP * (abs(variable.value) or 1.0)
    table = []
    for step in (first, first / 2.0, first / 4.0):
        ahead, behind = (_start_at(scene, variable, variable.value + sign * step) for sign in (1.0, -1.0))
        table.append((ahead - behind) / (2.0 * step))
    finer = [(4.0 * table[1] - table[0]) / 3.0, (4.0 * table[2] - table[1]) / 3.0]
    return np.asarray((16.0 * finer[1] - finer[0]) / 15.0)


def _start_at(scene: Scene, variable: StartVariable, value: float) -> Array:
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


def _with_value(initial: Initial, variable: StartVariable, value: float) -> Initial:
    if variable.velocity:
        return replace(initial, velocity={**initial.velocity, variable.joint: value})
    return replace(initial, position={**initial.position, variable.joint: value})
