"""The equations that put a frame on a pose, and their exact derivatives as machine code.

The unknowns z are the joint positions q that move the frame. Where there are as many as equations f(q) = x, these are
solved. Where there are more, z = (q, λ), and the posture nearest to the start is computed, the stationary point of
½ |q − q_start|² on f(q) = x:  q − q_start + J(q)ᵀ λ = 0,  f(q) − x = 0. This is D. E. Whitney's criterion for positions
instead of rates, so that the posture depends on the pose alone and a closed path ends where it began.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import InputError, UnreachableError
from bellcrank.numerics import svd

if TYPE_CHECKING:
    from bellcrank.codegen.compile import Compiled
    from bellcrank.robot.robot import Robot

FLAT = 1e-5  # of its motion: a frame that leaves a plane by less than this moves in that plane


@dataclass(frozen=True)
class FrameTask:
    """Equations for a frame of a robot: `value(z) = target`, with z (k,) and target (k,) or batches (n, k).

    `active` are the columns of q that move the frame; `position_basis` (3, r) and `rotation_basis` (3, s)
    span the directions (world) in which the frame can move, among the `coordinates` that are prescribed, and
    turn; `rotation` (3, 3) is the orientation wanted or None.
    """

    robot: Robot
    frame: str
    start: Array
    rotation: Array | None
    active: tuple[int, ...]
    position_basis: Array
    rotation_basis: Array
    coordinates: tuple[str, ...] = ("x", "y", "z")

    @property
    def equations(self) -> int:
        """Number of pose equations."""
        return int(self.position_basis.shape[1] + self.rotation_basis.shape[1])

    @property
    def redundant(self) -> bool:
        """More joints than equations."""
        return len(self.active) > self.equations

    @property
    def unknowns(self) -> int:
        """Number of unknowns z."""
        return len(self.active) + (self.equations if self.redundant else 0)

    def target(self, points: Array) -> Array:
        """Right-hand sides (n, k) for positions (n, 3) in m; derivatives of the positions give theirs."""
        rows = np.zeros((len(points), self.unknowns))
        first = len(self.active) if self.redundant else 0
        rows[:, first : first + self.position_basis.shape[1]] = points @ self.position_basis
        return rows

    def posture(self, z: Array) -> Array:
        """Positions (n, nq) or (nq,) of all joints."""
        q = np.broadcast_to(self.start, (*z.shape[:-1], len(self.start))).copy()
        q[..., list(self.active)] = z[..., : len(self.active)]
        return q

    def compiled(self) -> tuple[Compiled, Compiled]:
        """(z, w) → value (k,) and Jacobian (k·k, row by row); and (z, direction, w) → second derivative (k,)."""
        said = repr((self.frame, self.active, self.rotation is not None, self.redundant))
        numbers = self.position_basis.tobytes() + self.rotation_basis.tobytes()
        key = said + hashlib.sha256(numbers + repr(self.rotation_basis.shape).encode()).hexdigest()
        return (
            self.robot.compiled("frame task " + key, lambda: self._build(False)),
            self.robot.compiled("frame task curvature " + key, lambda: self._build(True)),
        )

    @property
    def constants(self) -> Array:
        """The compiled functions' input w: the start posture (nq,) and, with an orientation, its matrix (9,)."""
        wanted = [] if self.rotation is None else [self.rotation.ravel()]
        return np.concatenate([self.start, *wanted])

    def _build(self, curvature: bool) -> Any:
        import casadi

        n, count = len(self.active), len(self.start)
        z = casadi.SX.sym("z", self.unknowns)
        w = casadi.SX.sym("w", len(self.constants))
        q = casadi.SX(w[:count])
        for i, column in enumerate(self.active):
            q[column] = z[i]
        pose = self.robot.trace_frames([self.frame])(q, casadi.SX.zeros(self.robot.nv, 1), casadi.SX.zeros(0, 1))
        pose = casadi.vec(pose)
        value = casadi.DM(self.position_basis.T) @ pose[:3]
        if self.rotation is not None:
            error = casadi.SX.zeros(3, 1)
            for i in range(3):
                is_axis = casadi.vertcat(*[pose[3 + 3 * row + i] for row in range(3)])
                wanted = casadi.vertcat(*[w[count + 3 * row + i] for row in range(3)])
                error += 0.5 * casadi.cross(wanted, is_axis)
            value = casadi.vertcat(value, casadi.DM(self.rotation_basis.T) @ error)
        if self.redundant:
            jacobian = casadi.jacobian(value, z[:n])
            pull = z[:n] - casadi.vertcat(*[w[column] for column in self.active]) + jacobian.T @ z[n:]
            value = casadi.vertcat(pull, value)
        if not curvature:
            slope = casadi.jacobian(value, z)
            return casadi.Function("frame_task", [z, w], [value, casadi.vec(casadi.densify(slope).T)])
        direction = casadi.SX.sym("d", self.unknowns)
        twice = casadi.jtimes(casadi.jtimes(value, z, direction), z, direction)
        return casadi.Function("curvature", [z, direction, w], [twice])


def frame_task(
    robot: Robot,
    frame: str,
    start: Array,
    rotation: Array | None,
    title: str,
    coordinates: Sequence[str] = ("x", "y", "z"),
) -> FrameTask:
    """The task of putting `frame` on positions, or `coordinates` of them (and, with `rotation` (3, 3), that
    orientation), from `start` (nq,).

    Directions in which the frame cannot move at all (z of a planar arm) are left out. A floating or planar
    base and the joints that do not move the frame stay where `start` has them. Raises InputError where the
    pose asks for more numbers than there are joints.
    """
    single = [joint for joint in robot.joints if joint.nq == 1]
    linear, angular = _jacobians(robot, frame, start, [joint.v for joint in single])
    moved = np.any(np.abs(linear) > 1e-9, axis=(0, 1)) | (
        np.any(np.abs(angular) > 1e-9, axis=(0, 1)) & (rotation is not None)
    )
    active = tuple(joint.q for joint, moves in zip(single, moved, strict=True) if moves)
    linear[:, [k for k, axis in enumerate("xyz") if axis not in coordinates]] = 0.0
    position_basis = _span(linear)
    rotation_basis = np.zeros((3, 0)) if rotation is None else _span(angular)
    task = FrameTask(robot, frame, start, rotation, active, position_basis, rotation_basis, tuple(coordinates))
    if task.equations == 0:
        raise InputError(f"{title}: no joint of '{robot.name}' moves frame '{frame}'; choose a frame on a moving link")
    if task.equations > len(active):
        what = "position" if rotation is None else "position and orientation"
        count = "1 joint" if len(active) == 1 else f"{len(active)} joints"
        raise InputError(
            f"{title}: the {what} of frame '{frame}' has {task.equations} coordinates, but '{robot.name}' "
            f"moves it by {count} only; "
            f"{'choose another frame' if rotation is None else 'leave the orientation free'}"
        )
    return task


def check_plane(task: FrameTask, points: Array, times: Array, title: str) -> None:
    """Raise UnreachableError where points (n, 3) leave the line or plane in which the frame can move."""
    if task.position_basis.shape[1] == len(task.coordinates):
        return
    origin = task.robot.frame_pose(task.frame, task.start)[0]
    asked = (points - origin) * [axis in task.coordinates for axis in "xyz"]
    away = asked - asked @ task.position_basis @ task.position_basis.T
    distance = np.linalg.norm(away, axis=1)
    row = int(np.argmax(distance))
    if distance[row] > FLAT * (1.0 + float(np.max(np.abs(points - origin)))):
        kind = {1: "on a line", 2: "in a plane"}[task.position_basis.shape[1]]
        raise UnreachableError(
            f"{title}: frame '{task.frame}' of '{task.robot.name}' can only move {kind} through "
            f"{vector_text(origin)} m; at {times[row]:.6g} s the path, at {vector_text(points[row])} m, is "
            f"{distance[row]:.4g} m away from it"
        )


def _jacobians(robot: Robot, frame: str, start: Array, columns: list[int]) -> tuple[Array, Array]:
    """Linear and angular Jacobians (postures, 3, joints) at seeded random postures within the joints' ranges."""
    rng = np.random.default_rng(20240229)
    count, unit = 12, np.eye(robot.nv)[columns]
    postures = np.tile(start, (count, 1))
    for joint in robot.joints:
        if joint.nq != 1:
            continue
        lower, upper = float(robot.lower[joint.q]), float(robot.upper[joint.q])
        reach = 1.0 if joint.kind == "prismatic" else np.pi
        lower, upper = max(lower, -reach), min(upper, reach)
        postures[:, joint.q] = rng.uniform(min(lower, upper), max(lower, upper), count)
    if not columns:
        return np.zeros((count, 3, 0)), np.zeros((count, 3, 0))
    q = np.repeat(postures, len(columns), axis=0)
    linear, angular = robot.frame_velocity(frame, q, np.tile(unit, (count, 1)))
    shape = (count, len(columns), 3)
    return linear.reshape(shape).transpose(0, 2, 1), angular.reshape(shape).transpose(0, 2, 1)


def _span(jacobians: Array) -> Array:
    """Orthonormal basis (3, r) of the directions that the columns (n, 3, m) span: axes of the world where possible."""
    rows = jacobians.transpose(1, 0, 2).reshape(3, -1)
    largest = float(np.max(np.abs(rows), initial=0.0))
    if largest == 0.0:
        return np.zeros((3, 0))
    directions, sizes, _ = svd(rows, "the Jacobian of the frame is")
    rank = int(np.sum(sizes > FLAT * sizes[0]))
    alive = np.flatnonzero(np.max(np.abs(rows), axis=1) > FLAT * largest)
    if len(alive) == rank:
        return np.ascontiguousarray(np.eye(3)[:, alive])
    return np.ascontiguousarray(directions[:, :rank])


def vector_text(values: Array) -> str:
    """A vector as text for a message: (1.2, 0.3, 0)."""
    return "(" + ", ".join(f"{value:.6g}" for value in np.where(np.abs(values) < 1e-12, 0.0, values)) + ")"
