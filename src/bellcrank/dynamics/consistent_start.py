"""A start that satisfies the constraints: given values are held, guesses and velocities are projected onto them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.cached_values import computed_once
from bellcrank.dynamics.aligned_constraints import sine_rows
from bellcrank.dynamics.constraint_alignment import alignment_cosines, alignment_residual
from bellcrank.dynamics.constraint_rows import rows_of, velocity_units
from bellcrank.dynamics.system import system_of, system_parameters
from bellcrank.errors import InputError
from bellcrank.numerics import LARGEST, least_squares, length
from bellcrank.scene.constraint_conditions import LiesFlat

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Axes = list[tuple[slice, Array]]  # (degrees of freedom, rotation body to parent)
Residual = Callable[["Scene", Array], tuple[Array, Array]]  # (scene, q) -> residual, and its derivative by v
CLOSED = 1e-13  # rad, or of the characteristic length: Newton's method ends below it
ROUNDED = 1e-6  # the same: the residual that rounded digits of held values may leave; then all values move
MOST_STEPS = 200
ASIDE = (
    0.05  # rad, or of the characteristic length: a step away from half a turn, where both ways back are equally long
)


@computed_once
def consistent_start(scene: Scene) -> tuple[Array, Array]:
    """The position and velocity of a scene's start, which satisfy its constraints at time 0.

    Values that the scene gives are held; values that it marks as guesses, and those it leaves out, are the nearest that
    satisfy the constraints, lengths in units of the characteristic length.

    Args:
        scene: The scene, as `bellcrank.load_scene` reads it.

    Returns:
        The position q (nq,), rad or m, and the velocity v (nv,), rad/s or m/s; that of a free base in its own frame.

    Raises:
        InputError: No posture, or no velocity, with the held values satisfies the constraints.

    Example:
        >>> import bellcrank as bc
        >>> from bellcrank.dynamics.consistent_start import consistent_start
        >>> q, v = consistent_start(bc.load_scene("four_bar"))
        >>> q.shape, v.shape
        ((3,), (3,))
    """
    name = scene.initial.motion
    motion = None if name is None else scene.motion(name)
    q = scene.initial.posture(scene.robot, motion)
    if not scene.constraints:
        return q, scene.initial.rates(scene.robot, q, motion)
    held_q, held_v = scene.initial.held(scene.robot)
    q = consistent_posture(scene, q, held_q)
    return q, consistent_velocity(scene, q, scene.initial.rates(scene.robot, q, motion), held_v)


def consistent_posture(scene: Scene, q: Array, held: Mask) -> Array:
    """The position (nq,) that satisfies the constraints and is nearest to q (nq,).

    `held` (nv) marks the degrees of freedom whose positions are held, those of a free joint along its parent's axes.
    Raises InputError with the smallest residual found where no posture with the held values satisfies the constraints.
    """
    residual, _, jacobian = _linearised(scene, q, np.zeros(scene.robot.nv))
    _refuse_undefined(scene, residual, jacobian)
    q, largest = _closed_posture(scene, q, ~held)
    if largest > CLOSED and largest <= ROUNDED:
        q, largest = _closed_posture(scene, q, np.ones_like(held))
    if largest > 1e3 * CLOSED:
        name, label, worst = _worst_row(scene, q)
        names = [j.name for j in scene.robot.joints if held[j.v : j.v + j.nv].any()]
        raise InputError(
            f"{scene.source}: initial: the constraints cannot be satisfied with {', '.join(names) or 'nothing'} held: "
            f"'{name}' keeps a residual of {worst:.3g} m or rad ({label}); hold fewer joints, write a guess nearer to "
            "the intended branch ({guess: …}), or change lengths"
        )
    _refuse_turned_around(scene, q)
    _refuse_flat_disks(scene, q)
    return q


def consistent_velocity(scene: Scene, q: Array, v: Array, held: Mask) -> Array:
    """The velocity (nv,) that satisfies the constraints at the position q (nq,) and is nearest to v (nv,).

    `held` (nv) marks the degrees of freedom whose velocities are held, those of a free joint along the axes that its
    velocity is given in. Raises InputError where no velocity with the held values satisfies the constraints.
    """
    _, residual, jacobian = _linearised(scene, q, v)
    _refuse_undefined(scene, residual, jacobian)
    columns, unit = velocity_units(scene), rows_of(scene).unit
    axes = scene.initial.axes(scene.robot, q)[1]
    change = np.zeros_like(v)
    scaled = _in_parent_axes(jacobian / unit[:, None] * columns, axes)
    what = f"{scene.source}: initial: the constraints at the start are"
    change[~held] = least_squares(scaled[:, ~held], -residual / unit, what, rcond=1e-10)
    change = columns * _in_body_axes(change, axes)
    left = np.abs(residual + jacobian @ change)
    if (left / unit).max(initial=0.0) > 1e-9 * max(1.0, float(np.abs(v / columns).max(initial=0.0))):
        worst = int(np.argmax(left / unit))
        name, label = system_of(scene).multiplier_names[worst]
        raise InputError(
            f"{scene.source}: initial: the given velocities violate constraint '{name}' ({label}) by "
            f"{left[worst]:.3g} m/s or rad/s; give fewer velocities, the others follow from the constraints"
        )
    return v + change


def displaced(scene: Scene, q: Array, step: Array) -> Array:
    """The posture (nq,) after a small displacement `step` (nv,): q + E(q) step, with rotations normalised."""
    there = q + scene.robot.configuration_rate(q, step)
    for j in scene.robot.joints:
        part = {"floating": slice(j.q + 3, j.q + 7), "planar": slice(j.q + 2, j.q + 4)}.get(j.kind)
        if part is not None:
            there[part] /= np.linalg.norm(there[part])
    return np.asarray(there, dtype=np.float64)


# ---- checks


def _refuse_undefined(scene: Scene, values: Array, jacobian: Array) -> None:
    """InputError where a constraint's rows (m,), or their J (m, nv), are undefined or beyond LARGEST at the start."""
    for k, (value, row) in enumerate(zip(values, jacobian, strict=False)):
        found = np.append(row, value)
        wrong = found[~(np.abs(found) <= LARGEST)]
        if len(wrong):
            name, label = system_of(scene).multiplier_names[k]
            raise InputError(
                f"{scene.source}: initial: constraint '{name}' or its derivative is undefined or larger than "
                f"{LARGEST:g} at the start: row {label} has {wrong[-1]:.4g}; start where it is defined, or write it "
                "another way"
            )


def _refuse_turned_around(scene: Scene, q: Array) -> None:
    """InputError where a weld or a hinge is satisfied with its sides half a turn apart."""
    for name, cosine in alignment_cosines(scene, q).items():
        if not cosine > 0.0:
            raise InputError(
                f"{scene.source}: initial: constraint '{name}' can be satisfied only with its sides rotated by "
                f"{np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))):.4g} deg relative to each other; write a guess "
                "nearer to the intended branch ({guess: …}), or rotate one of its frames"
            )


def _refuse_flat_disks(scene: Scene, q: Array) -> None:
    """InputError where a rolling disk has no lowest point."""
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
                f"{scene.source}: initial: event '{scene.events[k].name}' occurs at the start: a disk that lies flat "
                "has no lowest point to roll on; tilt it less"
            )


# ---- Newton's method


def _closed_posture(scene: Scene, q: Array, free: Mask) -> tuple[Array, float]:
    """The nearest posture with the smallest residual, welds and hinges the right way round, and that residual.

    Where the position residual, which also vanishes at half a turn, leads to half a turn, or from beyond a quarter turn
    to no solution, the search starts again from the posture that minimises a residual that does not vanish there.
    """
    there, largest = _gauss_newton(scene, q, free, _position_residual)
    astray = there if largest <= ROUNDED else q
    if all(cosine > 0.0 for cosine in alignment_cosines(scene, astray).values()):
        return there, largest
    aside = q
    if min(alignment_cosines(scene, q).values()) < -1.0 + ASIDE**2:
        step = np.where(free, ASIDE * np.cos(1.0 + 2.0 * np.arange(scene.robot.nv) ** 2), 0.0)
        aside = displaced(scene, q, velocity_units(scene) * _in_body_axes(step, scene.initial.axes(scene.robot, q)[0]))
    aligned = _gauss_newton(scene, aside, free, _aligned_residual)[0]
    return _gauss_newton(scene, aligned, free, _position_residual)


def _gauss_newton(scene: Scene, q: Array, free: Mask, residual_at: Residual) -> tuple[Array, float]:
    """Damped Gauss-Newton steps of minimum norm: the posture and its largest residual, in characteristic lengths or
    rad.
    """
    columns = velocity_units(scene)
    residual, jacobian = residual_at(scene, q)
    for _ in range(MOST_STEPS):
        size = float(np.abs(residual).max(initial=0.0))
        if size <= CLOSED or not free.any():
            break
        step = np.zeros(scene.robot.nv)
        axes = scene.initial.axes(scene.robot, q)[0]
        if not (np.isfinite(residual).all() and np.isfinite(jacobian).all()):
            break
        what = f"{scene.source}: initial: the constraints near the start are"
        step[free] = least_squares(_in_parent_axes(jacobian, axes)[:, free], -residual, what, rcond=1e-10)
        step = _in_body_axes(step, axes)
        step *= min(1.0, 0.5 / max(float(np.abs(step).max()), 1e-300))  # half a radian: more may reach another branch
        for _ in range(30):
            there = displaced(scene, q, columns * step)
            new_residual, new_jacobian = residual_at(scene, there)
            if length(new_residual) < length(residual):
                break
            step *= 0.5
        else:
            break
        q, residual, jacobian = there, new_residual, new_jacobian
    size = float(np.abs(residual).max(initial=0.0))
    return q, size if np.isfinite(size) else np.inf


def _in_parent_axes(jacobian: Array, axes: Axes) -> Array:
    """The Jacobian (rows, nv) by velocities whose parts named by `axes` are in the parents' axes."""
    rotated = jacobian.copy()
    for part, rotation in axes:
        rotated[:, part] = jacobian[:, part] @ rotation.T
    return rotated


def _in_body_axes(step: Array, axes: Axes) -> Array:
    """A velocity or small displacement (nv,) whose parts named by `axes` are rotated back into the bodies' axes."""
    rotated = step.copy()
    for part, rotation in axes:
        rotated[part] = rotation.T @ step[part]
    return rotated


def _linearised(scene: Scene, q: Array, v: Array) -> tuple[Array, Array, Array]:
    """φ (h), (φ̇, ψ) (rows) and J (rows, nv) at time 0."""
    system = system_of(scene)
    x = np.zeros(system.size)
    x[: system.nq], x[system.nq : system.nq + system.nv] = q, v
    return system.linearised_constraints(np.zeros(1), x, scene.signals_at(np.zeros(1))[0], system_parameters(scene))


def _position_residual(scene: Scene, q: Array) -> tuple[Array, Array]:
    """φ (h) and J (h, nv) at time 0, in rad and characteristic lengths."""
    residual, _, jacobian = _linearised(scene, q, np.zeros(scene.robot.nv))
    unit = rows_of(scene).unit[: len(residual)]
    return residual / unit, jacobian[: len(residual)] / unit[:, None] * velocity_units(scene)


def _aligned_residual(scene: Scene, q: Array) -> tuple[Array, Array]:
    """The same with the alignment residual of welds and hinges in place of their sines."""
    residual, jacobian = _position_residual(scene, q)
    sines = sine_rows(scene, system_of(scene).multiplier_names)
    others = np.setdiff1d(np.arange(len(residual)), [row for rows in sines.values() for row in rows])
    alignment, slope = alignment_residual(scene, q)
    aligned = slope * velocity_units(scene)
    return np.concatenate([residual[others], alignment]), np.vstack([jacobian[others], aligned])


def _worst_row(scene: Scene, q: Array) -> tuple[str, str, float]:
    """The constraint and row with the largest residual, and that residual, m or rad."""
    residual = np.abs(_position_residual(scene, q)[0])
    worst = int(np.argmax(residual))
    return *system_of(scene).multiplier_names[worst], float(residual[worst] * rows_of(scene).unit[worst])
