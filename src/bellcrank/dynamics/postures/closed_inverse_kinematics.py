"""Inverse kinematics of a closed linkage: the motion of all joints that moves a frame along a path.

The unknown is the posture of all joints. With the constraints φ(q, t) = 0, of Jacobian J, and the prescribed
coordinates of the frame's pose x(q) = x_path(s(t)), of Jacobian F, it satisfies φ = 0 and x − x_path = 0, and its rates

    [J; F] v = [−φ_t; ẋ_path],    [J; F] a = [−γ; ẍ_path − Ḟ v]

in the least-squares sense, exactly where redundant rows agree. Postures follow by continuation from the previous one
(posture_search.py), so that the branch is kept. The mechanism has nv − rank J degrees of freedom, of which the path
prescribes rank [J; F] − rank J.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.dynamics.constraints.constraint_derivatives import SymbolicRows, differentiate_constraints
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.postures.loop_kinematics import DEAD, SINGULAR, LoopKinematics
from bellcrank.dynamics.postures.posture_search import ROUNDED, Constrained, Way, follow_postures
from bellcrank.dynamics.postures.start_equations import StartEquations, start_equations
from bellcrank.elements.symbols import Symbols
from bellcrank.errors import InputError, UnreachableError
from bellcrank.motion.generators.path import FramePath, wanted_rotation
from bellcrank.motion.kinematics.pose_equations import vector_text
from bellcrank.motion.kinematics.rotations import angles_to, between
from bellcrank.motion.limit_checks import limit_notes
from bellcrank.motion.motion import Motion
from bellcrank.numerics import pseudo_inverse, singular_values

if TYPE_CHECKING:
    import casadi

    from bellcrank.codegen.compile import Compiled

LEAP = 0.1  # rad or characteristic lengths: all joints move less in one step
TURN = 0.5  # rad: in such turns, at most, the frame takes its orientation from the start posture
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
        frame = self._jacobian()[-len(self.rows) :]
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
        jacobian = self._jacobian()
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
        path = self.path
        time, s, speed, growth = path.rows()
        x, first, second = path.curve(s)
        q = self._postures(time, x)
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

    def _postures(self, time: Array, x: Array) -> Array:
        """The posture (n, nq) at each time, where the frame has the positions x (n, 3)."""
        kinematics, end = self.kinematics, self.attitude if self.rotation is None else self.rotation
        turns = max(1, int(np.ceil(angles_to(self.attitude[None], end)[0] / TURN)))
        shares = np.arange(turns + 1) / turns
        places = np.concatenate([self.begin + shares[:, None] * (x[0] - self.begin), x[1:]])
        turned = [between(self.attitude, end, share).ravel() for share in shares] + [end.ravel()] * (len(x) - 1)
        at = np.concatenate([np.repeat(time[:1], turns), time[1:]])  # of each place but the first
        signals = kinematics.scene.signals_at(at)
        inputs = np.hstack([np.concatenate([signals[:1], signals]), places, np.array(turned)])
        way = Way(
            at,
            inputs[1:],
            np.zeros((len(at), 0)),
            begin=inputs[0],
            longest=LEAP,
            rounded=ROUNDED * max(1.0, float(np.abs(places).max()) / kinematics.length),
        )
        units = np.concatenate([rows_of(kinematics.scene).unit, self._sizes])
        one = Constrained(kinematics.scene.parameter_values[None], units[None], np.array([kinematics.length]))
        found = follow_postures(self._equations(), one, self.start[None], way)
        q, row = found.postures[0], int(found.rows[0])
        if row < len(q):
            towards = places[row] + found.share[0] * (places[row + 1] - places[row])
            raise self._unreachable(float(at[row]), self.pose(q[row])[0], towards)
        q = q[turns - 1 :]
        rotations = self.code(q, np.zeros(self.robot.nv), kinematics.scene.parameter_values)[1].reshape(-1, 3, 3)
        away = angles_to(rotations, end)
        if self.rotation is not None and away.max() > TURNED:
            row = int(away.argmax())
            raise self._unreachable(float(time[row]), self.pose(q[row])[0], x[row])
        return np.asarray(q)

    def _unreachable(self, t: float, reached: Array, towards: Array) -> UnreachableError:
        """That the frame reaches a position, but no further."""
        self._refuse_more_coordinates_than_freedoms()
        return UnreachableError(
            f"motion '{self.path.name}' cannot be followed at {t:.6g} s: frame '{self.path.frame}' reaches "
            f"{vector_text(reached)} m but no further towards {vector_text(towards)} m; the path leaves the "
            "workspace of the linkage, or the subspace in which the frame can move, or passes a singular posture"
        )

    def _refuse_more_coordinates_than_freedoms(self) -> None:
        """InputError where the prescribed coordinates, independent in the tree, exceed the degrees of freedom."""
        freedoms, _ = self.prescribed()
        frame = self._jacobian()[-len(self.rows) :]
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

    def _equations(self) -> StartEquations:
        """φ = 0 and x − x_path = 0 for the search of postures; the frame's position and rotation end its inputs."""
        scene = self.kinematics.scene
        key = f"path of linkage {self.path.frame} {self.rows} {scene.physics_key()} {rows_of(scene).signature}"
        height = len(rows_of(scene).kept) + len(self.rows)
        return replace(
            start_equations(scene),
            code=self.robot.compiled(key, self._closing),
            heights=height,
            rows=height,
            entry_rows=np.tile(np.arange(height), self.robot.nv).tolist(),
            entry_columns=np.repeat(np.arange(self.robot.nv), height).tolist(),
            cosine_count=0,
            alignment_owners=[],
            sines=[False] * height,
        )

    def _closing(self) -> casadi.Function:
        """(t, x, u, p) -> φ and x − x_path, no rates, [J; F] column by column."""
        import casadi

        scene = self.kinematics.scene
        s = Symbols(self.robot, scene.parameters, [*scene.frames, self.path.frame], scene.initial.clock)
        for source in scene.signal_sources:
            s.signal(source)
        wanted, frame = casadi.SX.sym("w", 12), s.frame(self.path.frame)
        c = differentiate_constraints(scene.constraints, SymbolicRows.unscaled(rows_of(scene).kept), s)
        away = casadi.reshape(wanted[3:], 3, 3).T @ frame.rotation.T
        turned = casadi.vertcat(away[2, 1] - away[1, 2], away[0, 2] - away[2, 0], away[1, 0] - away[0, 1])
        missed = casadi.vertcat(frame.position - wanted[:3], -0.5 * turned)[self.rows]
        twist = casadi.vertcat(frame.linear, frame.angular)
        residual = casadi.vertcat(c.position_residual, missed)
        jacobian = casadi.vertcat(c.jacobian, casadi.jacobian(twist, s.v)[self.rows, :])
        rest = casadi.SX.sym("z", start_equations(scene).size - self.robot.nq - self.robot.nv)
        inputs = [s.t, casadi.vertcat(s.q, s.v, rest), casadi.vertcat(s.u, wanted), s.p]
        outputs = [residual, casadi.SX(0, 1), casadi.vec(jacobian)]
        return casadi.Function("closing", inputs, [casadi.densify(x) for x in outputs])

    def _jacobian(self) -> Array:
        """[J; F] (rows, nv) at the start posture, in rad and characteristic lengths."""
        _, jacobian = self.kinematics.scaled_position_residual(0.0, self.start)
        flat = self.code(self.start, np.zeros(self.robot.nv), self.kinematics.scene.parameter_values)[2]
        frame = flat.reshape(self.robot.nv, 6).T[self.rows]
        return np.vstack([jacobian, frame / self._sizes[:, None] * self.kinematics.units])

    @property
    def _sizes(self) -> Array:
        """The unit of each of the frame's coordinates: the characteristic length, m, or 1 rad."""
        return np.where(np.array(self.rows) < 3, self.kinematics.length, 1.0)
