"""A robot's functions as machine code that is compiled when first called, kinematics, and checks of arguments."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.codegen.compile import Compiled, compiled
from bellcrank.errors import InputError
from bellcrank.robot.dynamics.equations import Equations
from bellcrank.robot.model.joint_frame_lookup import RobotDescription

if TYPE_CHECKING:
    import casadi

    from bellcrank.robot.formats.robot_file import RobotFile
    from bellcrank.robot.model.payload import LoadOptions
    from bellcrank.robot.model.robot_cache import RobotData

_DOUBLE = np.dtype(np.float64)
QVA, QVTAU = ("q", "v", "a"), ("q", "v", "tau")
NO_PARAMETERS: Array = np.zeros(0)


@dataclass(frozen=True)
class StateCheck:
    """Checks for a robot of this name and these sizes of q and v."""

    robot: str
    nq: int
    nv: int

    def states(self, names: tuple[str, ...], *states: Any) -> tuple[Array, ...]:
        """Finite arrays of doubles, (n,) or (rows, n) each: q of nq numbers, any other of nv. Raises InputError."""
        out, rows = [], -1
        for name, given in zip(names, states, strict=False):
            x = given if type(given) is np.ndarray and given.dtype is _DOUBLE else self._converted(name, given)
            size = self.nq if name == "q" else self.nv
            if x.ndim not in (1, 2) or x.shape[-1] != size or (x.ndim == 2 and rows not in (-1, len(x))):
                n = rows if rows >= 0 else "n"
                arguments.refuse(name, f"an array of shape ({size},) or ({n}, {size})", x, self.robot)
            if x.ndim == 2:
                rows = len(x)
            if not all_finite(x):
                self._refuse_infinite(name, x)
            out.append(x)
        return tuple(out)

    def answer(self, what: str, answer: Array) -> Array:
        """An answer, which is finite unless numbers overflowed on the way to it (InputError, beginning with `what`)."""
        if not all_finite(answer) and not np.isfinite(answer).all():
            raise InputError(
                f"{self.robot}: {what} overflows: a position, velocity or acceleration is too large; check its units"
            )
        return answer

    def _converted(self, name: str, given: Any) -> Array:
        size = self.nq if name == "q" else self.nv
        return arguments.as_array(name, given, f"an array of shape ({size},) or (n, {size})", self.robot)

    def _refuse_infinite(self, name: str, x: Array) -> None:
        """Name the first number that is not finite, where there is one: the sum of finite ones may be infinite."""
        bad = np.argwhere(~np.isfinite(np.atleast_2d(x)))
        if len(bad):
            row, column = bad[0]
            raise InputError(
                f"{self.robot}: argument '{name}': expected finite numbers, found {np.atleast_2d(x)[row, column]} "
                f"(sample {row}, entry {column})"
            )


def all_finite(x: Array) -> bool:
    """Whether a sum over all numbers is finite, which it is of finite ones only: a quick test before a slow one.

    Not by `np.vdot`: BLAS divides it among threads, whose waiting takes 100 times as long where processors are busy.
    """
    return math.isfinite(sum(x.tolist()) if x.ndim == 1 else np.einsum("i->", x.ravel(order="K")))


class CompiledRobot(RobotDescription):
    """A robot with its equations, their machine code, and its kinematics; `Robot` adds its dynamics."""

    def __init__(self, file: RobotFile, data: RobotData, options: LoadOptions) -> None:
        super().__init__(file, data, options)
        self._check = StateCheck(self.name, self.nq, self.nv)

    # ---- machine code

    @cached_property
    def equations(self) -> Equations:
        """The robot's equations as casadi expressions, before anything is compiled."""
        return Equations(self._tree, self.gravity, self.viscous, self.coulomb, self.friction_width)

    def dynamics(self, algorithm: str) -> Compiled:
        """The machine code of an algorithm, for callers that need no checks of states and answers.

        Args:
            algorithm: "inverse_dynamics" or "forward_dynamics".

        Returns:
            A function of arrays (nq,), (nv,), (nv,), or batches of them.

        Raises:
            InputError: There is no such algorithm.

        Example:
            >>> import bellcrank as bc, numpy as np
            >>> code = bc.load_robot("planar_2r").dynamics("inverse_dynamics")
            >>> code(np.zeros(2), np.zeros(2), np.zeros(2)).shape
            (2,)
        """
        if type(algorithm) is not str or algorithm not in self._codes:
            arguments.one_of("algorithm", algorithm, ("inverse_dynamics", "forward_dynamics"))
        return self._code(algorithm, lambda: self.equations.dynamics(algorithm))

    def compiled(
        self, key: str, build: Callable[[], casadi.Function], seldom: bool = False, inputs: Sequence[int] = ()
    ) -> Compiled:
        """The machine code of a function of one's own, kept on disk.

        Args:
            key: Says all that the function depends on besides the robot: the same key gives the same machine code.
            build: Makes the casadi.Function where it is not on disk yet.
            seldom: A function that is called seldom is compiled faster where it is long, and runs slower.
            inputs: Sizes of its first inputs.

        Returns:
            A function of arrays, or batches of them.

        Raises:
            InputError: An argument is not what is expected.
            CompileError: The function cannot be compiled.

        Example:
            >>> import bellcrank as bc, casadi, numpy as np
            >>> def build():
            ...     x = casadi.SX.sym("x", 2)
            ...     return casadi.Function("square", [x], [x * x])
            >>> bc.load_robot("planar_2r").compiled("square", build)(np.array([1.0, 3.0]))
            array([1., 9.])
        """
        arguments.text("key", key)
        arguments.function("build", build, "a function that makes a casadi.Function")
        sizes = [
            arguments.whole("inputs", size, least=0) for size in arguments.several("inputs", inputs, object, "sizes")
        ]
        return compiled(ascii(key)[1:-1], (self._key,), build, arguments.flag("seldom", seldom), sizes)

    def trace_frames(self, names: Iterable[str]) -> casadi.Function:
        """The kinematics of frames as a casadi function.

        Args:
            names: Names of frames.

        Returns:
            (q, v, p of length 0) -> per frame position (3), rotation (9, row by row), linear and angular velocity, in
            the world.

        Raises:
            InputError: There is no such frame.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_robot("planar_2r").trace_frames(["tip"]).size1_out(0)
            18
        """
        listed = arguments.several("names", names, str, "names of frames")
        return self.equations.frames([self.frame_index(name) for name in listed])

    # ---- kinematics

    def configuration_rate(self, q: Any, v: Any) -> Array:
        """The rate of the position, dq/dt = E(q) v: R v for a free base's position, ½ q ⊗ ω for its quaternion.

        Args:
            q: Position (nq,) or (n, nq).
            v: Velocity (nv,) or (n, nv).

        Returns:
            dq/dt (nq,) or (n, nq).

        Raises:
            InputError: A shape is wrong, a number is not finite, or a rate overflows.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_robot("planar_2r").configuration_rate([0.0, 0.0], [1.0, 2.0])
            array([1., 2.])
        """
        states = self._check.states(QVA, q, v)
        return self._check.answer("a rate", self._algorithm("configuration_rate")(*states))

    def frame_pose(self, name: str, q: Any) -> tuple[Array, Array]:
        """Position and rotation of a frame in the world.

        Args:
            name: Name of a link, a joint or an added frame.
            q: Position (nq,) or (n, nq).

        Returns:
            Position (3,) or (n, 3), m, and rotation matrix (3, 3) or (n, 3, 3), frame to world.

        Raises:
            InputError: There is no such frame, a shape is wrong, a number is not finite, or a length overflows.

        Example:
            >>> import bellcrank as bc
            >>> position, rotation = bc.load_robot("planar_2r").frame_pose("tip", [0.0, 0.0])
            >>> position
            array([2., 0., 0.])
        """
        states = self._check.states(QVA, q)
        rows = self._check.answer("a pose", self._frame(name)(*states, np.zeros(self.nv), NO_PARAMETERS))
        return rows[..., :3], rows[..., 3:12].reshape(*rows.shape[:-1], 3, 3)

    def frame_velocity(self, name: str, q: Any, v: Any) -> tuple[Array, Array]:
        """Linear and angular velocity of a frame, at its origin, in the world's axes.

        Args:
            name: Name of a link, a joint or an added frame.
            q: Position (nq,) or (n, nq).
            v: Velocity (nv,) or (n, nv).

        Returns:
            Linear (m/s) and angular (rad/s) velocity, (3,) or (n, 3) each.

        Raises:
            InputError: There is no such frame, a shape is wrong, a number is not finite, or a velocity overflows.

        Example:
            >>> import bellcrank as bc
            >>> linear, angular = bc.load_robot("planar_2r").frame_velocity("tip", [0.0, 0.0], [1.0, 0.0])
            >>> linear, angular
            (array([0., 2., 0.]), array([0., 0., 1.]))
        """
        states = self._check.states(QVA, q, v)
        rows = self._check.answer("a velocity", self._frame(name)(*states, NO_PARAMETERS))
        return rows[..., 12:15], rows[..., 15:18]

    def frame_acceleration(self, name: str, q: Any, v: Any, a: Any) -> tuple[Array, Array]:
        """Linear acceleration of a frame's origin and angular acceleration of a frame, world axes: J a + J̇ v.

        Args:
            name: Name of a link, a joint or an added frame.
            q: Position (nq,) or (n, nq).
            v: Velocity (nv,) or (n, nv).
            a: Acceleration (nv,) or (n, nv).

        Returns:
            Linear (m/s²) and angular (rad/s²) acceleration, (3,) or (n, 3) each; without gravity.

        Raises:
            InputError: There is no such frame, a shape is wrong, a number is not finite, or an acceleration overflows.

        Example:
            >>> import bellcrank as bc
            >>> arm = bc.load_robot("planar_2r")
            >>> arm.frame_acceleration("tip", [0.0, 0.0], [1.0, 0.0], [0.5, 0.0])[0]
            array([-2.,  1.,  0.])
        """
        states = self._check.states(QVA, q, v, a)
        index = self.frame_index(name)
        code = self._code(f"frame acceleration {index}", lambda: self.equations.frame_acceleration(index))
        rows = self._check.answer("an acceleration", code(*states))
        return rows[..., :3], rows[..., 3:]

    # ---- internals

    @cached_property
    def _codes(self) -> dict[str, Compiled]:
        return {}

    def _code(self, key: str, build: Callable[[], casadi.Function]) -> Compiled:
        if key not in self._codes:
            self._codes[key] = self.compiled(key, build)
        return self._codes[key]

    def _algorithm(self, name: str) -> Compiled:
        return self._code(name, lambda: self.equations.algorithm(name))

    def _frame(self, name: str) -> Compiled:
        index = self.frame_index(name)
        return self._code(f"frame {index}", lambda: self.equations.frames([index]))
