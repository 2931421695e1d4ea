"""Inverse kinematics of a closed linkage: the motion of all joints that moves a frame along a path.

The unknown is the posture of all joints. With the constraints φ(q, t) = 0, of Jacobian J, and the prescribed
coordinates of the frame's pose x(q) = x_path(s(t)), of Jacobian F, Newton's method solves

    [J; F] δ = [−φ; x_path − x],    [J; F] v = [−φ_t; ẋ_path],    [J; F] a = [−γ; ẍ_path − Ḟ v]

in the least-squares sense, exactly where redundant rows agree, starting from the previous posture, so that the branch
is kept. The mechanism has nv − rank J degrees of freedom, of which the path prescribes rank [J; F] − rank J.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.postures.consistent_start import displaced
from bellcrank.dynamics.postures.loop_kinematics import CLOSED, DEAD, FINEST, LEAP, ROUNDED, SINGULAR, LoopKinematics
from bellcrank.elements.symbols import Symbols
from bellcrank.errors import InputError, UnreachableError
from bellcrank.motion.generators.path import FramePath, wanted_rotation
from bellcrank.motion.kinematics.pose_equations import vector_text
from bellcrank.motion.kinematics.rotations import angles_to, between
from bellcrank.motion.limit_notes import limit_notes
from bellcrank.motion.motion import Motion
from bellcrank.numerics import least_squares, pseudo_inverse, singular_values

if TYPE_CHECKING:
    import casadi

    from bellcrank.codegen.compile import Compiled

Array = NDArray[np.float64]
IDLE = 1e-6  # m or rad per rad: slower, a frame's coordinate is at rest in an idle rotation
TURNED = 1e-9  # rad: at a larger angle from the prescribed orientation, the posture is another solution


class ClosedInverseKinematics:
    """A path of a frame of a closed linkage, from the posture `start` (nq,).

    The rates (nv,) of its `idle` rotations are not prescribed where they leave the frame's coordinates at rest.
    """

    def __init__(self, kinematics: LoopKinematics, path: FramePath, start: Array, idle: Sequence[Array] = ()) -> None:
        self.kinematics, self.path, self.robot = kinematics, path, kinematics.robot
        self.rows = ["xyz".index(axis) for axis in path.coordinates]
        self.code: Compiled = self.robot.compiled(
            f"frame of linkage {path.frame} {kinematics.scene.physics_key()}", lambda: self._build()
        )
        self.start = start
        self.begin, self.attitude = self.pose(start)
        self.rotation = wanted_rotation(path, self.attitude)
        if self.rotation is not None:
            self.rows += [3, 4, 5]
        frame = self._system(0.0, start, self.begin, self.attitude)[1][-len(self.rows) :]
        still = [np.abs(frame @ (rates / kinematics.units)).max() < IDLE for rates in idle]
        self.idle = sum(still)

    def _build(self) -> casadi.Function:
        """(q, v, p) -> position 3, rotation 9 (row major), Jacobian 6 nv (column by column), its rate times v 6."""
        import casadi

        s = Symbols(self.robot, self.kinematics.scene.parameters, [self.path.frame])
        frame = s.frame(self.path.frame)
        twist = casadi.vertcat(frame.linear, frame.angular)
        rate = casadi.jtimes(twist, s.q, s.algorithm("configuration_rate")(s.q, s.v))
        outputs = [frame.position, casadi.vec(frame.rotation.T), casadi.vec(casadi.jacobian(twist, s.v)), rate]
        return casadi.Function("frame", [s.q, s.v, s.p], [casadi.densify(x) for x in outputs])

    def pose(self, q: Array) -> tuple[Array, Array]:
        """Position (3,) m and rotation (3, 3) of the frame."""
        position, rotation, _, _ = self.code(q, np.zeros(self.robot.nv), self.kinematics.scene.parameter_values)
        return position, rotation.reshape(3, 3)

    # ---- what the path prescribes

    def prescribed(self) -> tuple[int, int]:
        """The number of degrees of freedom of the mechanism at the start posture without idle rotations, and how many
        the path prescribes.
        """
        _, jacobian = self._system(0.0, self.start, self.begin, self.attitude)
        constraints = len(jacobian) - len(self.rows)
        size = max(float(np.abs(jacobian).max(initial=0.0)), 1e-300)
        rank = self._rank(jacobian[:constraints], SINGULAR * size)
        return self.robot.nv - rank - self.idle, self._rank(jacobian, SINGULAR * size) - rank

    def _rank(self, matrix: Array, least: float) -> int:
        what = f"motion '{self.path.name}': the constraints and the frame at the start are"
        return int(np.count_nonzero(singular_values(matrix, what) > least)) if matrix.size else 0

    def too_few_coordinates(self) -> str:
        """The message for a path that leaves degrees of freedom open."""
        freedoms, prescribed = self.prescribed()
        what = ", ".join(self.path.coordinates) + ("" if self.rotation is None else " and the orientation")
        more = [f"{axis} (coordinates)" for axis in "xyz" if axis not in self.path.coordinates]
        more += ["an orientation (orientation: hold)"] if self.rotation is None else []
        return (
            f"motion '{self.path.name}': the mechanism has {freedoms} degree{'s' * (freedoms != 1)} of freedom and "
            f"this "
            f"motion prescribes {prescribed} ({what} of frame '{self.path.frame}'); prescribe {freedoms - prescribed} "
            f"more" + (f", such as {' or '.join(more)}" if more else ", or give the motion of joints")
        )

    # ---- the motion

    def motion(self) -> Motion:
        """The motion of all joints along the path. Raises UnreachableError with the time and the frame's position."""
        path, robot = self.path, self.robot
        time, s, speed, growth = path.rows()
        x, first, second = path.curve(s)
        end = self.attitude if self.rotation is None else self.rotation
        q = np.empty((len(s), robot.nq))
        here, place, attitude = self.start, self.begin, self.attitude
        for k in range(len(s)):
            goal = x[k]
            here = self._reach(here, (place, attitude), (goal, end), float(time[k]), 0)
            q[k], place, attitude = here, goal, end
        return self._rates(time, q, first * speed[:, None], second * (speed**2)[:, None] + first * growth[:, None])

    def _rates(self, time: Array, q: Array, velocity: Array, acceleration: Array) -> Motion:
        """The motion of postures (n, nq) whose frame has these velocities and accelerations (n, 3)."""
        robot, kinematics = self.robot, self.kinematics
        n, at_rest = len(time), np.zeros((len(time), robot.nv))
        no_rotation = np.zeros((n, 3))
        _, residual, jacobian, _ = kinematics.terms(time, q, at_rest)
        position, _, flat, _ = self.code(q, at_rest, kinematics.scene.parameter_values)
        frame = flat.reshape(n, robot.nv, 6).transpose(0, 2, 1)[:, self.rows]
        units = np.concatenate([rows_of(kinematics.scene).unit, self._sizes])
        whole = np.concatenate([jacobian, frame], axis=1) / units[:, None] * kinematics.units
        what = f"motion '{self.path.name}': the constraints and the frame along it are"
        sizes = singular_values(whole, what)
        least = robot.nv - self.idle - 1
        worst = int(np.argmin(sizes[:, least] / sizes[:, 0]))
        if sizes[worst, least] < DEAD * sizes[worst, 0]:
            raise UnreachableError(
                f"motion '{self.path.name}' passes a singular posture of the linkage at {time[worst]:.6g} s, with "
                f"frame "
                f"'{self.path.frame}' at {vector_text(position[worst])} m: there its path does not determine the "
                "velocities of all joints; move the path"
            )
        inverse = kinematics.units[:, None] * pseudo_inverse(whole, what, rcond=SINGULAR if self.idle else None) / units
        wanted = np.concatenate([velocity, no_rotation], axis=1)[:, self.rows]
        v = (inverse @ np.concatenate([-residual, wanted], axis=1)[:, :, None])[:, :, 0]
        drift = kinematics.terms(time, q, v).drift
        bend = self.code(q, v, kinematics.scene.parameter_values)[3][:, self.rows]
        wanted = np.concatenate([acceleration, no_rotation], axis=1)[:, self.rows] - bend
        a = (inverse @ np.concatenate([-drift, wanted], axis=1)[:, :, None])[:, :, 0]
        notes = limit_notes(robot, self.path.name, time, q)
        return Motion(robot.joints, time, q, v, a, self.path.name, notes)

    # ---- postures

    def _reach(self, q: Array, here: tuple[Array, Array], there: tuple[Array, Array], t: float, depth: int) -> Array:
        """The posture whose frame has the pose `there`, on the branch of q, whose frame has the pose `here`."""
        found = self._newton(q, *there, t)
        if found is not None:
            return found
        if depth == FINEST:
            self._refuse_more_coordinates_than_freedoms()
            position = self.pose(q)[0]
            raise UnreachableError(
                f"motion '{self.path.name}' cannot be followed at {t:.6g} s: frame '{self.path.frame}' reaches "
                f"{vector_text(position)} m but no further towards {vector_text(there[0])} m; the path leaves the "
                "workspace of the linkage, or the subspace in which the frame can move, or passes a singular posture"
            )
        middle = 0.5 * (here[0] + there[0]), between(here[1], there[1], 0.5)
        q = self._reach(q, here, middle, t, depth + 1)
        return self._reach(q, middle, there, t, depth + 1)

    def _refuse_more_coordinates_than_freedoms(self) -> None:
        """InputError where the prescribed coordinates, independent in the tree, exceed the degrees of freedom."""
        freedoms, _ = self.prescribed()
        frame = self._system(0.0, self.start, self.begin, self.attitude)[1][-len(self.rows) :]
        asked = self._rank(frame, SINGULAR * max(float(np.abs(frame).max(initial=0.0)), 1e-300))
        if asked > freedoms:
            fewer = (
                f"prescribe {freedoms} (coordinates: […])" if self.rotation is None else "leave the orientation free"
            )
            raise InputError(
                f"motion '{self.path.name}' prescribes {asked} coordinates of frame '{self.path.frame}', but the "
                f"mechanism has {freedoms} degree{'s' * (freedoms != 1)} of freedom: the constraints do not let the "
                f"frame "
                f"follow this path; {fewer}, or move joints instead"
            )

    def _newton(self, q: Array, position: Array, rotation: Array, t: float) -> Array | None:
        """The posture whose frame has a pose near that of q; None where Newton's method does not find it nearby."""
        strayed: Array = np.zeros(self.robot.nv)
        before, rounded = np.inf, ROUNDED * max(1.0, float(np.abs(position).max()) / self.kinematics.length)
        for k in range(14):
            missing, jacobian = self._system(t, q, position, rotation)
            size = float(np.abs(missing).max())
            if size <= CLOSED or (size <= rounded and size >= before):
                turned = self.rotation is not None and angles_to(self.pose(q)[1][None], rotation)[0] > TURNED
                return None if turned else q
            before = size
            if not (np.isfinite(missing).all() and np.isfinite(jacobian).all()):
                return None
            step = least_squares(jacobian, missing, f"motion '{self.path.name}': the constraints are", rcond=SINGULAR)
            strayed = strayed + step if k else strayed  # the first step is the displacement itself
            if not (np.abs(step).max() <= LEAP and np.abs(strayed).max() <= LEAP):
                return None
            q = displaced(self.kinematics.scene, q, self.kinematics.units * step)
        return None

    def _system(self, t: float, q: Array, position: Array, rotation: Array) -> tuple[Array, Array]:
        """The right-hand side [−φ; x_path − x] (rows,) and [J; F] (rows, nv), in rad and characteristic lengths."""
        residual, jacobian = self.kinematics.scaled_position_residual(t, q)
        at, turn, flat, _ = self.code(q, np.zeros(self.robot.nv), self.kinematics.scene.parameter_values)
        away = rotation @ turn.reshape(3, 3).T
        turned = 0.5 * np.array([away[2, 1] - away[1, 2], away[0, 2] - away[2, 0], away[1, 0] - away[0, 1]])
        missing = np.concatenate([position - at, turned])[self.rows]
        frame = flat.reshape(self.robot.nv, 6).T[self.rows]
        sizes = self._sizes
        return np.concatenate([-residual, missing / sizes]), np.vstack(
            [jacobian, frame / sizes[:, None] * self.kinematics.units]
        )

    @property
    def _sizes(self) -> Array:
        """The unit of each of the frame's coordinates: the characteristic length, m, or 1 rad."""
        return np.where(np.array(self.rows) < 3, self.kinematics.length, 1.0)
