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
CLOSED = 1e-13  # m or rad: Newton's method ends below it
ROUNDED = 1e-6  # m or rad: what held values may miss by, as rounded digits do; then all of them move
MOST_STEPS = 200


def consistent_start(scene: Scene, q: Array, v: Array, held_q: Mask, held_v: Mask) -> tuple[Array, Array]:
    """Position (nq,) and velocity (nv,) on the closures, nearest to the given ones.

    `held_q` and `held_v` (nv) are masks over the degrees of freedom whose positions and velocities stay. Raises
    InputError where no posture, or no velocity, with the held values closes, with the nearest reached.
    """
    q, gap = _posture(scene, q, ~held_q)
    if gap > CLOSED and gap <= ROUNDED:
        q, gap = _posture(scene, q, np.ones_like(held_q))
    if gap > 1e3 * CLOSED:
        name, label = _worst(scene, q)
        held = [j.name for j in scene.robot.joints if held_q[j.v : j.v + j.nv].all()]
        raise InputError(
            f"{scene.source}: initial: the closures do not close with {', '.join(held) or 'nothing'} held: "
            f"'{name}' stays {gap:.3g} (m or rad) apart ({label}); hold less, write a guess nearer to the branch that "
            "is meant ({guess: …}), or change lengths"
        )
    _refuse_flat_disks(scene, q)
    return q, _velocity(scene, q, v, ~held_v)


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
        step[free] = np.linalg.lstsq(jacobian[:, free], -gap, rcond=1e-10)[0]
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


def _velocity(scene: Scene, q: Array, v: Array, free: Mask) -> Array:
    speed, jacobian = _linearised(scene, q, v)[1:]
    change = np.zeros_like(v)
    change[free] = np.linalg.lstsq(jacobian[:, free], -speed, rcond=1e-10)[0]
    left = np.abs(speed + jacobian @ change)
    if left.max(initial=0.0) > 1e-9 * max(1.0, float(np.abs(v).max(initial=0.0))):
        name, label = scene.system.multiplier_names[int(np.argmax(left))]
        raise InputError(
            f"{scene.source}: initial: the velocities that are given break closure '{name}' ({label}) by "
            f"{left.max():.3g} (m/s or rad/s); give fewer of them, the rest follow"
        )
    return v + change


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
    gap, speed, flat = system.linearised(np.zeros(1), x, scene.signals_at(np.zeros(1))[0], scene.system_parameters)
    return gap, speed, flat.reshape(system.nv, len(speed)).T


def _position(scene: Scene, q: Array) -> tuple[Array, Array]:
    gap, _, jacobian = _linearised(scene, q, np.zeros(scene.robot.nv))
    return gap, jacobian[: len(gap)]


def _worst(scene: Scene, q: Array) -> tuple[str, str]:
    return scene.system.multiplier_names[int(np.argmax(np.abs(_position(scene, q)[0])))]
