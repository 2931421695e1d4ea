"""A start that fits the closures: held values stay, guesses move the least way onto them, velocities likewise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.errors import InputError

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Axes = list[tuple[slice, Array]]  # (degrees of freedom, rotation body to parent)
CLOSED = 1e-13  # m or rad: Newton's method ends below it
ROUNDED = 1e-6  # m or rad: what held values may miss by, as rounded digits do; then all of them move
MOST_STEPS = 200


def consistent_posture(scene: Scene, q: Array, held: Mask) -> Array:
    """The position (nq,) on the closures, nearest to the given one.

    `held` (nv) is a mask over the degrees of freedom whose positions stay, a free joint's along its parent's axes.
    Raises InputError where no posture with the held values closes, with the nearest reached.
    """
    q, gap = _posture(scene, q, ~held)
    if gap > CLOSED and gap <= ROUNDED:
        q, gap = _posture(scene, q, np.ones_like(held))
    if gap > 1e3 * CLOSED:
        name, label = _worst(scene, q)
        names = [j.name for j in scene.robot.joints if held[j.v : j.v + j.nv].any()]
        raise InputError(
            f"{scene.source}: initial: the closures do not close with {', '.join(names) or 'nothing'} held: "
            f"'{name}' stays {gap:.3g} (m or rad) apart ({label}); hold less, write a guess nearer to the branch that "
            "is meant ({guess: …}), or change lengths"
        )
    _refuse_flat_disks(scene, q)
    return q


def consistent_velocity(scene: Scene, q: Array, v: Array, held: Mask) -> Array:
    """The velocity (nv,) on the closures at the position q (nq,), nearest to the given one.

    `held` (nv) is a mask over the degrees of freedom whose velocities stay, a free joint's along the axes that its
    velocity is given in. Raises InputError where no velocity with the held values keeps the closures.
    """
    speed, jacobian = _linearised(scene, q, v)[1:]
    axes = scene.initial.axes(scene.robot, q)[1]
    change = np.zeros_like(v)
    change[~held] = np.linalg.lstsq(_along(jacobian, axes)[:, ~held], -speed, rcond=1e-10)[0]
    change = _in_body(change, axes)
    left = np.abs(speed + jacobian @ change)
    if left.max(initial=0.0) > 1e-9 * max(1.0, float(np.abs(v).max(initial=0.0))):
        name, label = scene.system.multiplier_names[int(np.argmax(left))]
        raise InputError(
            f"{scene.source}: initial: the velocities that are given break closure '{name}' ({label}) by "
            f"{left.max():.3g} (m/s or rad/s); give fewer of them, the rest follow"
        )
    return v + change


def _refuse_flat_disks(scene: Scene, q: Array) -> None:
    """InputError where a rolling disk has no lowest point."""
    from bellcrank.scene.closure_conditions import LiesFlat

    system = scene.system
    x = np.zeros(system.size)
    x[: system.nq] = q
    flat = [k for k, event in enumerate(scene.events) if isinstance(event.when, LiesFlat)]
    if not flat:
        return
    values = system.events(np.zeros(1), x, scene.signals_at(np.zeros(1))[0], scene.system_parameters)
    for k in flat:
        if not values[k] > 0.0:
            raise InputError(
                f"{scene.source}: initial: event '{scene.events[k].name}' is there at the start: a disk that lies flat "
                "has no lowest point to roll on; tilt it less"
            )


def _posture(scene: Scene, q: Array, free: Mask) -> tuple[Array, float]:
    """Damped Gauss-Newton steps of least length; the posture and the largest |φ| there."""
    gap, jacobian = _position(scene, q)
    for _ in range(MOST_STEPS):
        size = float(np.abs(gap).max(initial=0.0))
        if size <= CLOSED or not free.any():
            break
        step = np.zeros(scene.robot.nv)
        axes = scene.initial.axes(scene.robot, q)[0]
        step[free] = np.linalg.lstsq(_along(jacobian, axes)[:, free], -gap, rcond=1e-10)[0]
        step = _in_body(step, axes)
        step *= min(1.0, 0.5 / max(float(np.abs(step).max()), 1e-300))  # half a radian: further is another branch
        for _ in range(30):
            there = moved(scene, q, step)
            new_gap, new_jacobian = _position(scene, there)
            if np.linalg.norm(new_gap) < np.linalg.norm(gap):
                break
            step *= 0.5
        else:
            break
        q, gap, jacobian = there, new_gap, new_jacobian
    return q, float(np.abs(gap).max(initial=0.0))


def _along(jacobian: Array, axes: Axes) -> Array:
    """The Jacobian (rows, nv) of velocities whose parts named by `axes` are in the parents' axes."""
    turned = jacobian.copy()
    for part, rotation in axes:
        turned[:, part] = jacobian[:, part] @ rotation.T
    return turned


def _in_body(step: Array, axes: Axes) -> Array:
    """A velocity or small step (nv,), those parts turned back into the bodies' axes."""
    turned = step.copy()
    for part, rotation in axes:
        turned[part] = rotation.T @ step[part]
    return turned


def moved(scene: Scene, q: Array, step: Array) -> Array:
    """The posture (nq,) a small step (nv,) away: q + E(q) step, rotations unit again."""
    there = q + scene.robot.configuration_rate(q, step)
    for j in scene.robot.joints:
        part = {"floating": slice(j.q + 3, j.q + 7), "planar": slice(j.q + 2, j.q + 4)}.get(j.kind)
        if part is not None:
            there[part] /= np.linalg.norm(there[part])
    return np.asarray(there, dtype=np.float64)


def _linearised(scene: Scene, q: Array, v: Array) -> tuple[Array, Array, Array]:
    """φ (h), (φ̇, ψ) (rows) and J (rows, nv) at time 0."""
    system = scene.system
    x = np.zeros(system.size)
    x[: system.nq], x[system.nq : system.nq + system.nv] = q, v
    return system.linearised_closures(np.zeros(1), x, scene.signals_at(np.zeros(1))[0], scene.system_parameters)


def _position(scene: Scene, q: Array) -> tuple[Array, Array]:
    gap, _, jacobian = _linearised(scene, q, np.zeros(scene.robot.nv))
    return gap, jacobian[: len(gap)]


def _worst(scene: Scene, q: Array) -> tuple[str, str]:
    return scene.system.multiplier_names[int(np.argmax(np.abs(_position(scene, q)[0])))]
