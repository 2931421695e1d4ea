"""How far the sides of welds and hinges are turned against each other; half a turn has the same sine as none."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.system import system_of, system_parameters
from bellcrank.elements.loops import Hinge, Weld

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]


def turning(scene: Scene) -> tuple[str, ...]:
    """The constraints whose rows vanish at half a turn too, in the order of the scene."""
    return tuple(constraint.name for constraint in scene.constraints if isinstance(constraint, (Weld, Hinge)))


def angle_rows(scene: Scene) -> dict[str, list[int]]:
    """Which of the rows of φ that bind are sines of angles of these constraints."""
    names = system_of(scene).multiplier_names
    return {
        constraint: [k for k, (name, label) in enumerate(names) if name == constraint and label.endswith("[N m]")]
        for constraint in turning(scene)
    }


def cosines(scene: Scene, q: Array) -> dict[str, float]:
    """The cosine of the angle between the sides of each of these constraints at a position (nq,)."""
    names = turning(scene)
    if not names:
        return {}
    found = np.atleast_1d(system_of(scene).facing(*_at_rest(scene, q)))
    return dict(zip(names, found.tolist(), strict=True))


def alignment_cosines_along(scene: Scene, time: Array, state: Array, inputs: Array, parameters: Array) -> Array:
    """The same (n, constraints) at states (n, size) of a run, with its signals (n, nu) and parameters."""
    if not turning(scene):
        return np.ones((len(time), 0))
    return np.asarray(system_of(scene).facing(time[:, None], state, inputs, parameters)).reshape(len(time), -1)


def way(scene: Scene, q: Array) -> tuple[Array, Array]:
    """What vanishes where all these cosines are 1 and nowhere else, and its derivative (m, nv) by v."""
    found, flat = system_of(scene).way(*_at_rest(scene, q))
    return found, flat.reshape(scene.robot.nv, len(found)).T


def full_angle_residuals(scene: Scene, gap: Array, cosine: Array) -> Array:
    """|φ| (n, h) with whole angles in place of their sines, of φ (n, h) and the cosines (n, constraints)."""
    gaps = np.abs(gap)
    for k, rows in enumerate(angle_rows(scene).values()):
        if not rows:
            continue
        sine = np.linalg.norm(gap[:, rows], axis=1)
        angle = np.arctan2(sine, cosine[:, k])
        share = np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 1.0)
        gaps[:, rows] *= share[:, None]
        gaps[:, rows[0]] = np.where(sine > 0.0, gaps[:, rows[0]], angle)
    return gaps


def _at_rest(scene: Scene, q: Array) -> tuple[Array, Array, Array, Array]:
    x = np.zeros(system_of(scene).size)
    x[: len(q)] = q
    return np.zeros(1), x, scene.signals_at(np.zeros(1))[0], system_parameters(scene)
