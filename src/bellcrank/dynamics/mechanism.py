"""What sizing and inverse dynamics ask of a mechanism with motors, whether or not constraints tie its joints."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.dynamics.motion_notes import SAME_TIME
from bellcrank.elements.joint_relations import Drive
from bellcrank.robot.robot import Robot

if TYPE_CHECKING:
    from bellcrank.dynamics.tree_inverse_dynamics import InverseEquations
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import RobotJoint
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]


class Mechanism(Protocol):
    """A robot with motors at some joints, under the forces and parameters of a scene.

    All functions take batches: times t (n,) s, q (n, nq), v and a (n, nv); k is the number of motors, in the order of
    `motors`. Torques are N m or N. `closed` says whether constraints tie the joints together.
    """

    @property
    def robot(self) -> Robot:
        """The robot, payloads in it."""

    @property
    def scene(self) -> Scene | None:
        """The scene whose forces act; None for a robot alone."""

    @property
    def closed(self) -> bool:
        """Whether constraints tie the joints together."""

    @property
    def motors(self) -> tuple[RobotJoint, ...]:
        """The joints with motors."""

    @property
    def equations(self) -> InverseEquations:
        """The joint forces of the tree under the scene's forces."""

    @property
    def multiplier_names(self) -> tuple[tuple[str, str], ...]:
        """(constraint, what it is) of each multiplier."""

    def along(
        self, motion: Motion | str | Path, independent: Sequence[str] | None = None
    ) -> tuple[Motion, tuple[str, ...]]:
        """The motion of all joints, and the independent joints that it was given by. Raises BellcrankError."""

    def torques(self, t: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """The motors' torques (n, k), rotors in them, and the closures' multipliers (n, rows)."""

    def friction(self, t: Array, q: Array, v: Array) -> Array:
        """How much of the motors' torques (n, k) overcomes friction, that of joints without a motor too."""

    def link_torques(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """How much of the motors' torques each link's mass and inertia cause, (n, links, k)."""

    def inertia(self, t: Array, q: Array) -> Array:
        """The inertia (n, k) that each motor feels when the others do not turn it: M_ii, rotors in it."""

    def reactions(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """The wrench (n, joints, 6) through each joint of the tree, as `Robot.joint_reactions`."""

    def residuals(self, t: Array, q: Array, v: Array, a: Array) -> tuple[float, float]:
        """The largest violation of a constraint, m or rad, and of the equations of motion, as a share of all."""


def mechanism_of(
    given: Robot | Scene | Mechanism,
    robot: Robot | None = None,
    actuated: Sequence[str] | None = None,
) -> Mechanism:
    """The mechanism of a robot alone or of a scene: a closed linkage where constraints other than drives tie joints.

    `robot` stands for the scene's, with payloads; `actuated` names the joints with motors. Raises InputError.
    """
    from bellcrank.dynamics.linkage import Linkage
    from bellcrank.dynamics.open_chain import OpenChain
    from bellcrank.scene.scene import Scene

    if isinstance(given, OpenChain | Linkage):
        return given
    if not isinstance(given, Scene):
        if not hasattr(given, "joints"):
            arguments.refuse("robot", "a robot, a scene or a linkage", given, remedy="bc.load_scene reads a scene")
        return OpenChain(cast(Robot, given))
    if any(not isinstance(constraint, Drive) for constraint in given.constraints):
        return Linkage(given, robot, actuated)
    return OpenChain(given.robot if robot is None else robot, given, actuated or given.config.actuated or None)


def force_times(time: Array, end: float | None = None) -> Array:
    """Times (n,) at which the forces of a motion's rows are meant: where a time stands twice, the first row is the
    limit from before, so that a table that jumps there is read before its jump, and the second after it. A table that
    jumps where the motion ends, at `end` s, is read before its jump.
    """
    twins = np.diff(time) == 0.0
    width = SAME_TIME * np.maximum(1.0, np.abs(time))
    sided = time - width * np.append(twins, False) + width * np.insert(twins, 0, False)
    return np.asarray(sided if end is None else np.minimum(sided, end - SAME_TIME * max(1.0, abs(end))))
