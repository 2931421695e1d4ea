"""The angle between the sides of welds and hinges, whose sine alone cannot tell half a turn from none."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.dynamics.constraints.constraint_derivatives import aligned_constraints, sine_rows
from bellcrank.dynamics.equations.system import system_of, system_parameters

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene


def alignment_cosines(scene: Scene, q: Array) -> dict[str, float]:
    """The cosine of the angle between the sides of each of these constraints at a position (nq,)."""
    names = aligned_constraints(scene)
    if not names:
        return {}
    found = np.atleast_1d(system_of(scene).alignment_cosines(*_at_rest(scene, q)))
    return dict(zip(names, found.tolist(), strict=True))


def alignment_cosines_along(scene: Scene, time: Array, state: Array, inputs: Array, parameters: Array) -> Array:
    """These cosines (n, constraints) at times (n,) s and states (n, size) of a run, with its signals (n, nu)."""
    if not aligned_constraints(scene):
        return np.ones((len(time), 0))
    found = system_of(scene).alignment_cosines(time[:, None], state, inputs, parameters)
    return np.asarray(found).reshape(len(time), -1)


def full_angle_residuals(scene: Scene, residual: Array, cosine: Array) -> Array:
    """|φ| (n, h) with angles in place of their sines, from φ (n, h) and the cosines (n, constraints)."""
    absolute = np.abs(residual)
    for k, rows in enumerate(sine_rows(scene, system_of(scene).multiplier_names).values()):
        if not rows:
            continue
        sine = np.linalg.norm(residual[:, rows], axis=1)
        angle = np.arctan2(sine, cosine[:, k])
        ratio = np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 1.0)
        absolute[:, rows] *= ratio[:, None]
        absolute[:, rows[0]] = np.where(sine > 0.0, absolute[:, rows[0]], angle)
    return absolute


def _at_rest(scene: Scene, q: Array) -> tuple[Array, Array, Array, Array]:
    x = np.zeros(system_of(scene).size)
    x[: len(q)] = q
    return np.zeros(1), x, scene.signals_at(np.zeros(1))[0], system_parameters(scene)
