"""A start that fits the closures: held values stay, guesses move the least way onto them, velocities likewise."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.derived import computed_once
from bellcrank.dynamics.constraint_rows import rows_of
from bellcrank.dynamics.constraint_alignment import angle_rows, cosines, way
from bellcrank.dynamics.system import system_of, system_parameters
from bellcrank.errors import InputError
from bellcrank.numerics import LARGEST, least_squares, length
from bellcrank.robot.joints import lengths_in_velocity

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Axes = list[tuple[slice, Array]]  # (degrees of freedom, rotation body to parent)
Position = Callable[["Scene", Array], tuple[Array, Array]]  # (scene, q) -> what must vanish, and its derivative by v
CLOSED = 1e-13  # rad, or of the mechanism's length: Newton's method ends below it
ROUNDED = 1e-6  # the same: what held values may miss by, as rounded digits do; then all of them move
MOST_STEPS = 200
ASIDE = 0.05  # rad, or of the mechanism's length: away from half a turn, where no way back is the shorter


@computed_once
def consistent_start(scene: Scene) -> tuple[Array, Array]:
    """Position (nq,) and velocity (nv,) at time 0 that fit the constraints, a free base's velocity in its own frame."""
    name = scene.initial.motion
    motion = None if name is None else scene.motion(name)
    q = scene.initial.posture(scene.robot, motion)
    if not scene.constraints:
        return q, scene.initial.rates(scene.robot, q, motion)
    held_q, held_v = scene.initial.held(scene.robot)
    q = consistent_posture(scene, q, held_q)
    return q, consistent_velocity(scene, q, scene.initial.rates(scene.robot, q, motion), held_v)


def consistent_posture(scene: Scene, q: Array, held: Mask) -> Array:
    """The position (nq,) on the constraints, nearest to the given one, lengths counted in the mechanism's own.

    `held` (nv) is a mask over the degrees of freedom whose positions stay, a free joint's along its parent's axes.
    Raises InputError where no posture with the held values closes, with the nearest reached.
    """
    _refuse_no_value(scene, *_linearised(scene, q, np.zeros(scene.robot.nv))[::2])
    q, gap = _closed(scene, q, ~held)
    if gap > CLOSED and gap <= ROUNDED:
        q, gap = _closed(scene, q, np.ones_like(held))
    if gap > 1e3 * CLOSED:
        name, label, apart = _worst(scene, q)
        names = [j.name for j in scene.robot.joints if held[j.v : j.v + j.nv].any()]
        raise InputError(
            f"{scene.source}: initial: the constraints do not close with {', '.join(names) or 'nothing'} held: "
            f"'{name}' stays {apart:.3g} (m or rad) apart ({label}); hold less, write a guess nearer to the branch "
            "that is meant ({guess: …}), or change lengths"
        )
    _refuse_turned(scene, q)
    _refuse_flat_disks(scene, q)
    return q


def consistent_velocity(scene: Scene, q: Array, v: Array, held: Mask) -> Array:
    """The velocity (nv,) on the constraints at the position q (nq,), nearest to the given one, lengths counted in the
    mechanism's own.

    `held` (nv) is a mask over the degrees of freedom whose velocities stay, a free joint's along the axes that its
    velocity is given in. Raises InputError where no velocity with the held values keeps the constraints.
    """
    speed, jacobian = _linearised(scene, q, v)[1:]
    _refuse_no_value(scene, speed, jacobian)
    columns, unit = _columns(scene), rows_of(scene).unit
    axes = scene.initial.axes(scene.robot, q)[1]
    change = np.zeros_like(v)
    scaled = _along(jacobian / unit[:, None] * columns, axes)
    change[~held] = least_squares(
        scaled[:, ~held], -speed / unit, f"{scene.source}: initial: the constraints at the start are", rcond=1e-10
    )
    change = columns * _in_body(change, axes)
    left = np.abs(speed + jacobian @ change)
    if (left / unit).max(initial=0.0) > 1e-9 * max(1.0, float(np.abs(v / columns).max(initial=0.0))):
        worst = int(np.argmax(left / unit))
        name, label = system_of(scene).multiplier_names[worst]
        raise InputError(
            f"{scene.source}: initial: the velocities that are given break constraint '{name}' ({label}) by "
            f"{left[worst]:.3g} (m/s or rad/s); give fewer of them, the rest follow"
        )
    return v + change


def _refuse_no_value(scene: Scene, values: Array, jacobian: Array) -> None:
    """InputError where a constraint's rows (m,), or their J (m, nv), are no numbers of at most LARGEST at the start."""
    for k, (value, row) in enumerate(zip(values, jacobian, strict=False)):
        found = np.append(row, value)
        wrong = found[~(np.abs(found) <= LARGEST)]
        if len(wrong):
            name, label = system_of(scene).multiplier_names[k]
            raise InputError(
                f"{scene.source}: initial: constraint '{name}' or its derivative is no number of at most {LARGEST:g} at "
                f"the start: its row {label} has {wrong[-1]:.4g}; start where it has values, or write it another way"
            )


def _refuse_turned(scene: Scene, q: Array) -> None:
    """InputError where a weld or a hinge is closed with its sides half a turn apart."""
    for name, cosine in cosines(scene, q).items():
        if not cosine > 0.0:
            raise InputError(
                f"{scene.source}: initial: constraint '{name}' closes only with its sides turned by "
                f"{np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))):.4g} deg against each other; write a guess nearer "
                "to the branch that is meant ({guess: …}), or turn one of its frames"
            )


def _refuse_flat_disks(scene: Scene, q: Array) -> None:
    """InputError where a rolling disk has no lowest point."""
    from bellcrank.scene.constraint_conditions import LiesFlat

    system = system_of(scene)
    x = np.zeros(system.size)
    x[: system.nq] = q
    flat = [k for k, event in enumerate(scene.events) if isinstance(event.when, LiesFlat)]
    if not flat:
        return
    values = system.events(np.zeros(1), x, scene.signals_at(np.zeros(1))[0], system_parameters(scene))
    for k in flat:
        if not values[k] > 0.0:
            raise InputError(
                f"{scene.source}: initial: event '{scene.events[k].name}' is there at the start: a disk that lies flat "
                "has no lowest point to roll on; tilt it less"
            )


def _closed(scene: Scene, q: Array, free: Mask) -> tuple[Array, float]:
    """The posture nearest to q that is closed, its welds and hinges the right way round where they can be, and its gap.

    Where the rows that vanish at half a turn too lead there, or nowhere from beyond a quarter, a residual that does not
    vanish there shows the way first.
    """
    there, gap = _posture(scene, q, free)
    astray = there if gap <= ROUNDED else q
    if all(cosine > 0.0 for cosine in cosines(scene, astray).values()):
        return there, gap
    aside = q
    if min(cosines(scene, q).values()) < -1.0 + ASIDE**2:
        step = np.where(free, ASIDE * np.cos(1.0 + 2.0 * np.arange(scene.robot.nv) ** 2), 0.0)
        aside = moved(scene, q, _columns(scene) * _in_body(step, scene.initial.axes(scene.robot, q)[0]))
    return _posture(scene, _posture(scene, aside, free, _guided)[0], free)


def _posture(scene: Scene, q: Array, free: Mask, position: Position | None = None) -> tuple[Array, float]:
    """Damped Gauss-Newton steps of least length; the posture and the largest |φ| there, lengths in the mechanism's."""
    position, columns = position or _position, _columns(scene)
    gap, jacobian = position(scene, q)
    for _ in range(MOST_STEPS):
        size = float(np.abs(gap).max(initial=0.0))
        if size <= CLOSED or not free.any():
            break
        step = np.zeros(scene.robot.nv)
        axes = scene.initial.axes(scene.robot, q)[0]
        if not (np.isfinite(gap).all() and np.isfinite(jacobian).all()):
            break
        what = f"{scene.source}: initial: the constraints near the start are"
        step[free] = least_squares(_along(jacobian, axes)[:, free], -gap, what, rcond=1e-10)
        step = _in_body(step, axes)
        step *= min(1.0, 0.5 / max(float(np.abs(step).max()), 1e-300))  # half a radian: further is another branch
        for _ in range(30):
            there = moved(scene, q, columns * step)
            new_gap, new_jacobian = position(scene, there)
            if length(new_gap) < length(gap):
                break
            step *= 0.5
        else:
            break
        q, gap, jacobian = there, new_gap, new_jacobian
    size = float(np.abs(gap).max(initial=0.0))
    return q, size if np.isfinite(size) else np.inf


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


def _columns(scene: Scene) -> Array:
    """How large 1 is in each degree of freedom (nv): the mechanism's length, m, or 1 rad."""
    return np.where(lengths_in_velocity(scene.robot), rows_of(scene).length, 1.0)


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
    system = system_of(scene)
    x = np.zeros(system.size)
    x[: system.nq], x[system.nq : system.nq + system.nv] = q, v
    return system.linearised_constraints(np.zeros(1), x, scene.signals_at(np.zeros(1))[0], system_parameters(scene))


def _position(scene: Scene, q: Array) -> tuple[Array, Array]:
    """φ (h) and J (h, nv) at time 0, in rad and lengths of the mechanism."""
    gap, _, jacobian = _linearised(scene, q, np.zeros(scene.robot.nv))
    unit = rows_of(scene).unit[: len(gap)]
    return gap / unit, jacobian[: len(gap)] / unit[:, None] * _columns(scene)


def _guided(scene: Scene, q: Array) -> tuple[Array, Array]:
    """The same with the whole turns of welds and hinges in place of their sines."""
    gap, jacobian = _position(scene, q)
    others = np.setdiff1d(np.arange(len(gap)), [row for rows in angle_rows(scene).values() for row in rows])
    turn, slope = way(scene, q)
    return np.concatenate([gap[others], turn]), np.vstack([jacobian[others], slope * _columns(scene)])


def _worst(scene: Scene, q: Array) -> tuple[str, str, float]:
    """The constraint and row that is furthest apart, and how far, m or rad."""
    gap = np.abs(_position(scene, q)[0])
    worst = int(np.argmax(gap))
    return *system_of(scene).multiplier_names[worst], float(gap[worst] * rows_of(scene).unit[worst])
