"""Searches for linkages that do a task: Sobol points, then Levenberg-Marquardt of many at once.

Where crank angles are prescribed, the unknowns are the shape and the first angle. Otherwise they are the shape and
every angle; guesses of the angles grow with the length of the path and have two harmonics.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bellcrank.arrays import Array, Complex, Indices, Mask
from bellcrank.studies.designs.samples import Sample
from bellcrank.studies.synthesis.placement import Numbers, PointTask, Task

SAMPLES = 2**12  # Sobol points on each branch
KEPT = {True: (128, 24), False: (256, 64)}  # linkages, by prescribed angles, that are improved first, and to the end
STEPS = (25, 200)
BLOCK = 4096  # linkages of one array
LEAST_DAMPING, FIRST_DAMPING, LARGEST_DAMPING = 1e-13, 1e-2, 1e12  # the least keeps singular equations solvable
EXACT = 1e-26  # of the squared size of the targets
STILL = 1e-12  # a relative decrease below which a search has ended, if it comes again and again


@dataclass(eq=False)
class Candidates:
    """Linkages: shapes (n, 3), crank angles (n, points), branches (n,), and errors (n,): sums of squared residuals."""

    shape: Array
    crank: Array
    branch: Array
    error: Array

    def __len__(self) -> int:
        return len(self.shape)

    def take(self, rows: Indices) -> Candidates:
        """Some of them."""
        return Candidates(self.shape[rows], self.crank[rows], self.branch[rows], self.error[rows])

    def best(self, count: int) -> Candidates:
        """The best of them, in order; of linkages that are alike, one."""
        order = np.argsort(self.error, kind="stable")
        order = order[np.isfinite(self.error[order])]
        keys = np.round(np.c_[self.shape[order], self.branch[order], np.cos(self.crank[order, 0])], 4)
        _, first = np.unique(keys, axis=0, return_index=True)
        return self.take(order[np.sort(first)][:count])


def search(
    task: Task,
    timing: Array | None,
    seed: int,
    progress: Callable[[float], object] = lambda share: None,
) -> Candidates:
    """The best linkages for targets of about unit size; `timing` (n,) are crank angles, rad, whose first one is free.
    Where it is None, the targets are points, passed in order.
    """
    timed = timing is not None
    found = _guesses(task, timing, seed)
    for k, (count, steps) in enumerate(zip(KEPT[timed], STEPS, strict=True)):
        found = found.best(count * task.kind.effort)
        progress(0.2 + 0.3 * k)
        found = improve(found, task, timed, steps * task.kind.effort)
    progress(1.0)
    found.error[~_in_order(found)] = np.inf
    return found.best(len(found))


def _in_order(found: Candidates) -> Mask:
    """Whether the crank passes the points in their order, in one direction and within one turn."""
    steps = np.diff(found.crank, axis=1)
    one_way = (steps > 0.0).all(axis=1) | (steps < 0.0).all(axis=1)
    return np.asarray(one_way & (np.abs(found.crank[:, -1] - found.crank[:, 0]) < 2.0 * np.pi))


def _guesses(task: Task, timing: Array | None, seed: int) -> Candidates:
    """Linkages at Sobol points."""
    count, size = SAMPLES * task.kind.effort, len(task.kind.bounds[0])
    drawn = Sample(count, "sobol", seed).points(0, count, size + (1 if timing is not None else 6))
    shape = task.kind.shapes(drawn[:, :size])
    start = 2.0 * np.pi * drawn[:, size : size + 1]
    if timing is not None:
        cranks = [start + timing]
    else:
        assert isinstance(task, PointTask)
        guess = _angles(task.points, drawn[:, size + 1 :])
        cranks = [start + guess, start - guess]
    parts = []
    for crank in cranks:
        for branch in task.kind.branches:
            sides = np.full(count, branch)
            error = np.concatenate(
                [
                    _errors(task.fit(shape[part], crank[part], sides[part], slopes=False).residual)
                    for part in _blocks(count)
                ]
            )
            parts.append(Candidates(shape, crank, sides, error))
    return _joined(parts)


def _angles(points: Complex, drawn: Array) -> Array:
    """Crank angles (n, points) from 0 on that grow with the length of the path, with two harmonics; half of the guesses
    are of a closed path, the others of a part of a turn.
    """
    steps = np.abs(np.diff(points, append=points[:1]))
    along = np.concatenate([[0.0], np.cumsum(steps[:-1])])
    closed = drawn[:, :1] < 0.5
    span = np.where(closed, 1.0, 0.15 + 0.85 * (2.0 * drawn[:, :1] - 1.0))
    share = np.where(closed, along / steps.sum(), along / along[-1] * (1.0 - 0.5 / len(points))) * span
    first, second = 0.7 * drawn[:, 1:2], 0.15 * drawn[:, 2:3]
    turns = 2.0 * np.pi * share
    phases = 2.0 * np.pi * drawn[:, 3:5]
    waves = [size / k * np.sin(k * (turns + phases[:, k - 1 : k])) for k, size in ((1, first), (2, second))]
    grown = turns + waves[0] + waves[1]
    return np.asarray(grown - grown[:, :1])


def improve(found: Candidates, task: Task, timed: bool, steps: int) -> Candidates:
    """Levenberg-Marquardt of all linkages, with the bounds of the shape.

    The search for postures (dynamics/postures/posture_search.py) does not serve: lengths are unknown too, and a misfit
    is left.
    """
    lower, upper = task.kind.bounds
    (count, size), many = found.crank.shape, len(lower)
    damping, still = np.full(count, FIRST_DAMPING), np.zeros(count, dtype=int)
    shape, crank = found.shape.copy(), found.crank.copy()
    error, live = found.error.copy(), np.ones(count, dtype=bool)
    scale = float((np.abs(task.targets - task.targets.mean()) ** 2).sum())
    for _ in range(steps):
        rows = np.flatnonzero(live)
        if not len(rows):
            break
        normal, gradient = _normal_equations(shape[rows], crank[rows], found.branch[rows], task, timed)
        own = shape[rows]
        held = ((own <= lower) & (gradient[:, -many:] > 0.0)) | ((own >= upper) & (gradient[:, -many:] < 0.0))
        fixed = np.concatenate([np.zeros((len(rows), normal.shape[1] - many), dtype=bool), held], axis=1)
        gradient = np.where(fixed, 0.0, gradient)
        normal = np.where(fixed[:, :, None] | fixed[:, None, :], 0.0, normal)
        diagonal = np.einsum("nkk->nk", normal)
        shift = np.where(
            fixed, 1.0, damping[rows, None] * (diagonal + 1e-9 * diagonal.max(axis=1, keepdims=True)) + 1e-300
        )
        np.einsum("nkk->nk", normal)[...] += shift
        step = -np.linalg.solve(normal, gradient[:, :, None])[:, :, 0]
        new_shape = np.clip(own + step[:, -many:], lower, upper)
        new_crank = crank[rows] + (step[:, :1] if timed else step[:, :size])
        trial = _errors(task.fit(new_shape, new_crank, found.branch[rows], slopes=False).residual)
        good = trial < error[rows]
        gain = 1.0 - trial[good] / error[rows[good]]
        still[rows[good]] = np.where(gain < STILL, still[rows[good]] + 1, 0)
        shape[rows[good]], crank[rows[good]], error[rows[good]] = new_shape[good], new_crank[good], trial[good]
        damping[rows] = np.maximum(damping[rows] * np.where(good, 0.1, 4.0), LEAST_DAMPING)
        live[rows] = (damping[rows] < LARGEST_DAMPING) & (error[rows] > EXACT * scale) & (still[rows] < 3)
    return Candidates(shape, crank, found.branch, error)


def _normal_equations(shape: Array, crank: Array, branch: Array, task: Task, timed: bool) -> tuple[Array, Array]:
    """JᵀJ (n, k, k) and Jᵀr (n, k); the unknowns are the first angle, or all angles, and the shape."""
    found = task.fit(shape, crank, branch)
    slopes = found.slopes
    if not timed:
        count, size, _ = slopes.shape
        own = np.zeros((count, size, crank.shape[1]), dtype=complex)
        own[:, np.arange(size), np.arange(size) % crank.shape[1]] = slopes[:, :, 0]
        slopes = np.concatenate([own, slopes[:, :, 1:]], axis=2)
    slopes = found.outside(slopes)
    real = np.concatenate([slopes.real, slopes.imag], axis=1)
    residual = np.concatenate([found.residual.real, found.residual.imag], axis=1)
    transposed = real.transpose(0, 2, 1)
    return transposed @ real, (transposed @ residual[:, :, None])[:, :, 0]


def _errors(residual: Numbers) -> Array:
    with np.errstate(all="ignore"):
        found = (residual.real**2 + residual.imag**2).sum(axis=1)
    return np.where(np.isfinite(found), found, np.inf)


def _blocks(count: int) -> list[slice]:
    return [slice(first, first + BLOCK) for first in range(0, count, BLOCK)]


def _joined(parts: list[Candidates]) -> Candidates:
    return Candidates(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in ("shape", "crank", "branch", "error"))
    )
