"""Numerical continuation of a posture along a path: a Taylor predictor of second order and Newton's method.

The step is kept so small that the branch cannot change, and the sign of the equations' determinant must stay the same;
then all rows are solved at once, starting from polynomials between the steps. Derivatives with respect to the path's
length come from F_z z' = x', F_z z'' = x'' − F_zz[z', z'] with derivatives of F from its expression graph.
Source: E. L. Allgower, K. Georg, Introduction to Numerical Continuation Methods, ch. 2.

The search for postures on constraints (dynamics/postures/posture_search.py) does not serve here: of the postures of a
redundant robot it would return one near the previous row's, not the one nearest to the start, and it does not follow
the determinant's sign.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bellcrank.arrays import Array
from bellcrank.motion.kinematics.pose_equations import FrameTask
from bellcrank.motion.kinematics.rotations import angles_to, between
from bellcrank.motion.sampled.quintic_splines import quintic
from bellcrank.numerics import least_squares, singular_values
from bellcrank.robot.model.joints import lengths_in_position

STEP_BOUND = 0.3  # rad or m: the posture moves less than this from one step to the next
FIRST_CORRECTION = 0.03  # rad or m: the first Newton step after the predictor is shorter than this
CLOSE_ENOUGH = 1e-7  # m and rad: a pose missed by less counts as reached

# Points along a path: s (n,) in m → position (n, 3) in m, and its first and second derivative along s.
Curve = Callable[[Array], tuple[Array, Array, Array]]


class ContinuationError(Exception):
    """The continuation failed; `where` is the last length (m) that it reached, `z` the unknowns there."""

    def __init__(self, where: float, z: Array) -> None:
        super().__init__(where)
        self.where, self.z = where, z


class Solver:
    """Newton's method and its continuation on a task's compiled equations."""

    def __init__(self, task: FrameTask) -> None:
        self.task = task
        self.joints = len(task.active)
        self.value, self.curvature = task.compiled()
        self.constants = task.constants

    def system(self, z: Array, constants: Array | None = None) -> tuple[Array, Array]:
        """Value (…, k) and Jacobian (…, k, k)."""
        value, slope = self.value(np.atleast_2d(z), self.constants if constants is None else constants)
        slope = slope.reshape(len(slope), self.task.unknowns, self.task.unknowns)
        if z.ndim == 1:
            value, slope = value[0], slope[0]
        return np.asarray(value), np.asarray(slope)

    def frame_jacobian(self, slope: Array) -> Array:
        """The pose equations' Jacobian (…, m, joints), a block of the system's."""
        return slope[..., self.task.unknowns - self.task.equations :, : self.joints]

    def condition(self, z: Array) -> Array:
        """Smallest over largest singular value of the frame's Jacobian, (n,).

        Where the Jacobian mixes lengths and angles, lengths are divided by its longest lever arm, at the start or in
        these postures.
        """
        task = self.task
        jacobian = self.frame_jacobian(self.system(z)[1])
        lengths = lengths_in_position(task.robot)[list(task.active)]
        rows = np.arange(task.equations) < task.position_basis.shape[1]
        if lengths.any() or not rows.all():
            start = np.zeros(task.unknowns)
            start[: self.joints] = task.start[list(task.active)]
            both = np.concatenate([self.frame_jacobian(self.system(start)[1])[None], jacobian])
            lever = float(np.abs(both[:, rows][:, :, ~lengths]).max(initial=0.0)) or 1.0
            jacobian = jacobian / np.where(rows, lever, 1.0)[:, None] * np.where(lengths, lever, 1.0)
        sizes = singular_values(jacobian, f"the Jacobian of frame '{task.frame}' of '{task.robot.name}' is")
        return np.asarray(sizes[:, -1] / np.maximum(sizes[:, 0], 1e-300))

    def newton(
        self, z: Array, target: Array, bound: float, constants: Array | None = None
    ) -> tuple[Array, Array] | None:
        """Solution and Jacobian there; None unless the first step is shorter than the bound and each step shorter than
        half the one before.
        """
        last = bound
        for _ in range(12):
            value, slope = self.system(z, constants)
            try:
                step = np.linalg.solve(slope, target - value)
            except np.linalg.LinAlgError:
                return None
            size = float(np.max(np.abs(step[: self.joints])))
            if not np.all(np.isfinite(step)) or size > last:
                return None
            z = z + step
            if size <= 1e-9:
                return z, slope
            last = 0.5 * size
        return None

    def to_start(self, point: Array) -> Array:
        """Unknowns at the curve's first point, reached continuously from the start posture."""
        task = self.task
        z = np.zeros(task.unknowns)
        z[: self.joints] = task.start[list(task.active)]
        begin, attitude = task.robot.frame_pose(task.frame, task.start)
        done, step = 0.0, 0.25
        while done < 1.0:
            goal = min(1.0, done + step)
            constants = self.constants
            if task.rotation is not None:
                turned = between(attitude, task.rotation, goal)
                constants = np.concatenate([task.start, turned.ravel()])
            target = task.target((begin + goal * (point - begin))[None])[0]
            found = self.newton(z, target, STEP_BOUND, constants)
            if found is not None:
                z, done, step = found[0], goal, min(2.0 * step, 1.0)
            elif step < 1e-4:
                return self.jump_to_start(point)
            else:
                step *= 0.5
        return z

    def jump_to_start(self, point: Array) -> Array:
        """Unknowns at the curve's first point by minimisation from the start posture, for a start posture that is
        singular or from which the way to the curve leaves the reach.
        """
        task = self.task
        target = task.target(point[None])[0]
        rng = np.random.default_rng(7)
        for attempt in range(8):
            q = task.start[list(task.active)] + (0.1 * attempt) * rng.standard_normal(self.joints)
            q, missing = self.nearest(q, target)
            if missing > CLOSE_ENOUGH:
                continue
            z = np.zeros(task.unknowns)
            z[: self.joints] = q
            if task.redundant:
                jacobian = self.frame_jacobian(self.system(z)[1])
                pull = task.start[list(task.active)] - q
                what = f"the Jacobian of frame '{task.frame}' of '{task.robot.name}' is"
                z[self.joints :] = least_squares(jacobian.T, pull, what)
            found = self.newton(z, target, 1.0)
            if found is not None and self.turned_away(found[0]) < 1e-6:
                return found[0]
        z = np.zeros(task.unknowns)
        z[: self.joints] = task.start[list(task.active)]
        raise ContinuationError(0.0, z)

    def nearest(self, q: Array, target: Array) -> tuple[Array, float]:
        """The joint positions (m,) near `q` that come closest to a target, and the distance left (m and rad)."""
        from scipy.optimize import minimize

        wanted = target[self.task.unknowns - self.task.equations :]

        def misfit(joints: Array) -> tuple[float, Array]:
            z = np.zeros(self.task.unknowns)
            z[: self.joints] = joints
            value, slope = self.system(z)
            miss = value[self.task.unknowns - self.task.equations :] - wanted
            return 0.5 * float(miss @ miss), self.frame_jacobian(slope).T @ miss

        with np.errstate(over="ignore", invalid="ignore"):  # a miss whose square overflows is infinite
            best = minimize(misfit, q, jac=True, method="BFGS", options={"gtol": 1e-13, "maxiter": 500})
        miss = float(np.sqrt(2.0 * max(best.fun, 0.0)))
        return np.asarray(best.x, dtype=np.float64), miss if np.isfinite(miss) else np.inf

    def turned_away(self, z: Array) -> float:
        """Angle (rad) between the frame's orientation and the wanted one; zero where none is wanted."""
        if self.task.rotation is None:
            return 0.0
        rotation = self.task.robot.frame_pose(self.task.frame, self.task.posture(z[None]))[1]
        return float(np.max(angles_to(rotation, self.task.rotation)))

    def rates(self, z: Array, slope: Array, first: Array, second: Array) -> tuple[Array, Array]:
        """z' and z'' (n, k) with respect to length, from the targets' derivatives (n, k)."""
        z1 = np.linalg.solve(slope, first[..., None])[..., 0]
        bend = self.curvature(z, z1, self.constants)
        return np.asarray(z1), np.asarray(np.linalg.solve(slope, (second - bend)[..., None])[..., 0])

    def along(self, curve: Curve, begin: float, end: float, z: Array) -> tuple[Array, Array, Array, Array]:
        """Knots of the continuation: lengths (m,), z, z' and z'' (m, k)."""
        lengths: list[float] = []
        rows: list[tuple[Array, Array, Array]] = []
        s, step = begin, (end - begin) / 32.0
        sign = 0.0
        while True:
            _, x1, x2 = curve(np.array([s]))
            slope = self.system(z)[1]
            mark = float(np.linalg.slogdet(slope)[0])
            if mark == 0.0 or (sign and mark != sign):
                raise ContinuationError(lengths[-1] if lengths else s, z)
            sign = mark
            try:
                z1, z2 = self.rates(z[None], slope[None], self.task.target(x1), self.task.target(x2))
            except np.linalg.LinAlgError:
                raise ContinuationError(s, z) from None
            lengths.append(s)
            rows.append((z, z1[0], z2[0]))
            if s >= end:
                parts = zip(*rows, strict=True)
                return np.array(lengths), *(np.array(part) for part in parts)  # type: ignore[return-value]
            s, z, step = self._advance(curve, s, min(end, s + step) - s, end, rows[-1], sign)

    def _advance(
        self, curve: Curve, s: float, step: float, end: float, row: tuple[Array, Array, Array], sign: float
    ) -> tuple[float, Array, float]:
        """The next knot: its length and unknowns, and the step to try after it."""
        z, z1, z2 = row
        least = 1e-7 * max(end, 1e-3)
        while True:
            change = step * z1 + 0.5 * step * step * z2
            found = None
            if np.max(np.abs(change[: self.joints])) < STEP_BOUND:
                goal = end if step >= end - s else s + step
                target = self.task.target(curve(np.array([goal]))[0])[0]
                found = self.newton(z + change, target, FIRST_CORRECTION)
            if found is not None and float(np.linalg.slogdet(found[1])[0]) == sign:
                return goal, found[0], 1.5 * step
            step *= 0.5
            if step < least:
                raise ContinuationError(s, z)

    def everywhere(
        self, curve: Curve, lengths: Array, knots: tuple[Array, Array, Array, Array]
    ) -> tuple[Array, Array, Array]:
        """z, z', z'' (n, k) at all lengths: Newton's method in one batch from the Hermite polynomials between knots."""
        x, x1, x2 = curve(lengths)
        target = self.task.target(x)
        z = np.repeat(knots[1], len(lengths), axis=0) if len(knots[0]) == 1 else quintic(*knots, lengths)[0]
        first_change = 0.0
        for round_ in range(4):
            value, slope = self.system(z)
            try:
                step = np.linalg.solve(slope, (target - value)[..., None])[..., 0]
            except np.linalg.LinAlgError:
                row = int(np.argmin(np.abs(np.linalg.det(slope))))
                raise ContinuationError(float(lengths[row]), z[row]) from None
            z = z + step
            size = np.max(np.abs(step[:, : self.joints]), axis=1)
            first_change = max(first_change, float(np.max(size)))
            if first_change > 0.5 * STEP_BOUND or not np.all(np.isfinite(step)):
                row = int(np.argmax(size))
                raise ContinuationError(float(lengths[row]), z[row])
            if round_ > 0 and float(np.max(size)) < 1e-12:
                break
        if float(np.max(size)) > 1e-8:
            row = int(np.argmax(size))
            raise ContinuationError(float(lengths[row]), z[row])
        slope = self.system(z)[1]
        signs = np.linalg.slogdet(slope)[0]
        if np.any(signs != signs[0]):
            row = int(np.argmax(signs != signs[0]))
            raise ContinuationError(float(lengths[row]), z[row])
        z1, z2 = self.rates(z, slope, self.task.target(x1), self.task.target(x2))
        return z, z1, z2
