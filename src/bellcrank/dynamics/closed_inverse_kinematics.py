"""A frame of a closed linkage along a path: inverse kinematics on the closed mechanism.

Unknown is the posture of all joints. With the constraints φ(q, t) = 0, of Jacobian J, and the prescribed coordinates of
the frame's pose x(q) = x_path(s(t)), of Jacobian F, Newton's method solves

    [J; F] δ = [−φ; x_path − x],    [J; F] v = [−φ_t; ẋ_path],    [J; F] a = [−γ; ẍ_path − Ḟ v]

in the sense of least squares, exact where redundant rows agree, going on from the posture before, so that the branch is
kept. The mechanism has nv − rank J degrees of freedom, of which the path prescribes rank [J; F] − rank J.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bellcrank.dynamics.constraint_rows import rows_of
from bellcrank.dynamics.loop_kinematics import CLOSED, DEAD, FINEST, LEAP, ROUNDED, SINGULAR
from bellcrank.dynamics.consistent_start import moved
from bellcrank.errors import InputError, UnreachableError
from bellcrank.motion.frame_task import vector_text
from bellcrank.motion.limit_notes import limit_notes
from bellcrank.motion.motion import Motion
from bellcrank.motion.path import FramePath, wanted_rotation
from bellcrank.motion.rotations import angles_to, between
from bellcrank.numerics import least_squares, pseudo_inverse, singular_values

if TYPE_CHECKING:
    import casadi

    from bellcrank.codegen.compile import Compiled
    from bellcrank.dynamics.loop_kinematics import Array, Chain

TURNED = 1e-9  # rad: a larger angle from the orientation that is wanted is another one


class FrameFollower:
    """A path of a frame on the linkage of a chain, from a posture (nq,)."""

    def __init__(self, chain: Chain, path: FramePath, start: Array) -> None:
        self.chain, self.path, self.robot = chain, path, chain.robot
        self.rows = ["xyz".index(axis) for axis in path.coordinates]
        self.code: Compiled = self.robot.compiled(
            f"frame of linkage {path.frame} {chain.scene.physics_key()}", lambda: self._build()
        )
        self.start = start
        self.begin, self.attitude = self.pose(start)
        self.rotation = wanted_rotation(path, self.attitude)
        if self.rotation is not None:
            self.rows += [3, 4, 5]

    def _build(self) -> casadi.Function:
        """(q, v, p) -> position 3, rotation 9 (row major), Jacobian 6 nv (column by column), its rate times v 6."""
        import casadi

        from bellcrank.elements.symbols import Symbols

        s = Symbols(self.robot, self.chain.scene.parameters, [self.path.frame])
        frame = s.frame(self.path.frame)
        twist = casadi.vertcat(frame.linear, frame.angular)
        rate = casadi.jtimes(twist, s.q, s.algorithm("configuration_rate")(s.q, s.v))
        outputs = [frame.position, casadi.vec(frame.rotation.T), casadi.vec(casadi.jacobian(twist, s.v)), rate]
        return casadi.Function("frame", [s.q, s.v, s.p], [casadi.densify(x) for x in outputs])

    def pose(self, q: Array) -> tuple[Array, Array]:
        """Position (3,) m and rotation (3, 3) of the frame."""
        position, rotation, _, _ = self.code(q, np.zeros(self.robot.nv), self.chain.scene.parameter_values)
        return position, rotation.reshape(3, 3)

    # ---- what the path prescribes

    def prescribed(self) -> tuple[int, int]:
        """How many degrees of freedom the mechanism has at the start posture, and how many of them the path sets."""
        _, jacobian = self._system(0.0, self.start, self.begin, self.attitude)
        constraints = len(jacobian) - len(self.rows)
        size = max(float(np.abs(jacobian).max(initial=0.0)), 1e-300)
        rank = self._rank(jacobian[:constraints], SINGULAR * size)
        return self.robot.nv - rank, self._rank(jacobian, SINGULAR * size) - rank

    def _rank(self, matrix: Array, least: float) -> int:
        what = f"motion '{self.path.name}': the constraints and the frame at the start are"
        return int(np.count_nonzero(singular_values(matrix, what) > least)) if matrix.size else 0

    def refusal(self) -> str:
        """What to say where the path leaves freedoms open."""
        freedoms, prescribed = self.prescribed()
        what = ", ".join(self.path.coordinates) + ("" if self.rotation is None else " and the orientation")
        more = [f"{axis} (coordinates)" for axis in "xyz" if axis not in self.path.coordinates]
        more += ["an orientation (orientation: hold)"] if self.rotation is None else []
        return (
            f"motion '{self.path.name}': the mechanism has {freedoms} degree(s) of freedom and this motion prescribes "
            f"{prescribed} ({what} of frame '{self.path.frame}'); prescribe {freedoms - prescribed} more"
            + (f", such as {' or '.join(more)}" if more else ", or give the motion of joints")
        )

    # ---- the motion

    def motion(self) -> Motion:
        """All joints along the path; UnreachableError naming time, place and what is missing."""
        path, robot = self.path, self.robot
        time, s, speed, growth = path.timing.rows(path.samples)
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
        robot, chain = self.robot, self.chain
        n, still = len(time), np.zeros((len(time), robot.nv))
        turning = np.zeros((n, 3))
        _, _, speed, jacobian, _ = chain.at(time, q, still, still)
        position, _, flat, _ = self.code(q, still, chain.scene.parameter_values)
        frame = flat.reshape(n, robot.nv, 6).transpose(0, 2, 1)[:, self.rows]
        units = np.concatenate([rows_of(chain.scene).unit, self._sizes])
        whole = np.concatenate([jacobian, frame], axis=1) / units[:, None] * chain.columns
        what = f"motion '{self.path.name}': the constraints and the frame along it are"
        sizes = singular_values(whole, what)
        worst = int(np.argmin(sizes[:, -1] / sizes[:, 0]))
        if sizes[worst, -1] < DEAD * sizes[worst, 0]:
            raise UnreachableError(
                f"motion '{self.path.name}' meets a singular posture of the linkage at {time[worst]:.6g} s, with frame "
                f"'{self.path.frame}' at {vector_text(position[worst])} m: there its path does not determine the "
                "speeds of all joints; move the path"
            )
        inverse = chain.columns[:, None] * pseudo_inverse(whole, what) / units
        wanted = np.concatenate([velocity, turning], axis=1)[:, self.rows]
        v = (inverse @ np.concatenate([-speed, wanted], axis=1)[:, :, None])[:, :, 0]
        drift = chain.at(time, q, v, still)[4]
        bend = self.code(q, v, chain.scene.parameter_values)[3][:, self.rows]
        wanted = np.concatenate([acceleration, turning], axis=1)[:, self.rows] - bend
        a = (inverse @ np.concatenate([-drift, wanted], axis=1)[:, :, None])[:, :, 0]
        notes = limit_notes(robot, self.path.name, time, q)
        return Motion(robot.joints, time, q, v, a, self.path.name, notes)

    # ---- postures

    def _reach(self, q: Array, here: tuple[Array, Array], there: tuple[Array, Array], t: float, depth: int) -> Array:
        """The posture whose frame is `there` (position, rotation), on the branch of q, whose frame is `here`."""
        found = self._newton(q, *there, t)
        if found is not None:
            return found
        if depth == FINEST:
            self._refuse_more_coordinates_than_freedoms()
            position = self.pose(q)[0]
            raise UnreachableError(
                f"motion '{self.path.name}' cannot be followed at {t:.6g} s: the linkage moves frame "
                f"'{self.path.frame}' as far as {vector_text(position)} m and no further towards "
                f"{vector_text(there[0])} m; the path leaves the reach of the linkage, or the space in which the frame "
                "can move, or meets a singular posture"
            )
        middle = 0.5 * (here[0] + there[0]), between(here[1], there[1], 0.5)
        q = self._reach(q, here, middle, t, depth + 1)
        return self._reach(q, middle, there, t, depth + 1)

    def _refuse_more_coordinates_than_freedoms(self) -> None:
        """InputError where the frame's coordinates, free of each other in the tree, are more than the freedoms."""
        freedoms, _ = self.prescribed()
        frame = self._system(0.0, self.start, self.begin, self.attitude)[1][-len(self.rows) :]
        asked = self._rank(frame, SINGULAR * max(float(np.abs(frame).max(initial=0.0)), 1e-300))
        if asked > freedoms:
            fewer = (
                f"prescribe {freedoms} (coordinates: […])" if self.rotation is None else "leave the orientation free"
            )
            raise InputError(
                f"motion '{self.path.name}' moves frame '{self.path.frame}' along {asked} coordinates, and the "
                f"mechanism has {freedoms} degree(s) of freedom: the constraints keep the frame off this path; {fewer}, "
                "or move joints instead"
            )

    def _newton(self, q: Array, position: Array, rotation: Array, t: float) -> Array | None:
        """The posture at a pose near that of q; None where it is not near, or there is none."""
        strayed: Array = np.zeros(self.robot.nv)
        before, rounded = np.inf, ROUNDED * max(1.0, float(np.abs(position).max()) / self.chain.length)
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
            strayed = strayed + step if k else strayed  # the first step is the way itself
            if not (np.abs(step).max() <= LEAP and np.abs(strayed).max() <= LEAP):
                return None
            q = moved(self.chain.scene, q, self.chain.columns * step)
        return None

    def _system(self, t: float, q: Array, position: Array, rotation: Array) -> tuple[Array, Array]:
        """What is missing to constraints and pose (rows,), and [J; F] (rows, nv), in rad and lengths of the mechanism."""
        gap, jacobian = self.chain._gap(t, q)
        at, turn, flat, _ = self.code(q, np.zeros(self.robot.nv), self.chain.scene.parameter_values)
        turned = 0.5 * np.cross(turn.reshape(3, 3).T, rotation.T).sum(axis=0)
        missing = np.concatenate([position - at, turned])[self.rows]
        frame = flat.reshape(self.robot.nv, 6).T[self.rows]
        sizes = self._sizes
        return np.concatenate([-gap, missing / sizes]), np.vstack(
            [jacobian, frame / sizes[:, None] * self.chain.columns]
        )

    @property
    def _sizes(self) -> Array:
        """How large 1 is in each of the frame's coordinates: the mechanism's length, m, or 1 rad."""
        return np.where(np.array(self.rows) < 3, self.chain.length, 1.0)
