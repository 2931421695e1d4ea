"""Inverse dynamics of an open chain, with a motor at every joint with one degree of freedom."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.constraints.reactions import joint_reactions
from bellcrank.dynamics.inverse.tree_inverse_dynamics import TreeInverseDynamics
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.motion.motion import Motion, require_joints
from bellcrank.motion.sampled.csv_file import read_motion
from bellcrank.robot.robot import BLOCK_NUMBERS, LARGEST_WHOLE, Robot, RobotJoint

if TYPE_CHECKING:
    from bellcrank.codegen.compile import Compiled
    from bellcrank.scene.scene import Scene


class OpenChain:
    """A robot alone, or a scene whose only constraints are prescribed motions, as a `Mechanism`.

    What holds a joint with several degrees of freedom (a free base) is not considered. Raises InputError where
    `actuated` leaves out a joint, which nothing would hold.
    """

    closed = False
    multiplier_names: tuple[tuple[str, str], ...] = ()

    def __init__(self, robot: Robot, scene: Scene | None = None, actuated: Sequence[str] | None = None) -> None:
        self.robot, self.scene = robot, scene
        self.motors: tuple[RobotJoint, ...] = tuple(joint for joint in robot.joints if joint.nv == 1)
        self.equations = TreeInverseDynamics(robot, scene)
        self._columns = [joint.v for joint in self.motors]
        if actuated is not None:
            for name in actuated:
                robot.one_degree_joint(name, f"{robot.name}: actuated")
            left = [joint.name for joint in self.motors if joint.name not in actuated]
            if left:
                raise InputError(
                    f"{robot.name}: actuated leaves out {', '.join(left)}: every joint of an open chain needs a motor "
                    "to follow a motion; remove actuated"
                )

    def along(
        self, motion: Motion | str | Path, independent: Sequence[str] | None = None
    ) -> tuple[Motion, tuple[str, ...]]:
        """The motion: a Motion, a motion of the scene by name, or a CSV file. Raises BellcrankError."""
        every = tuple(joint.name for joint in self.motors)
        if independent is not None and set(independent) != set(every):
            raise InputError(
                f"{self.robot.name}: independent: all joints of an open chain are independent ({', '.join(every)}); "
                "remove this argument"
            )
        motions = {} if self.scene is None else self.scene.config.motions
        if isinstance(motion, Motion):
            whole = motion
        elif not isinstance(motion, (str, Path)):
            arguments.refuse("motion", "a Motion, the name of a motion, or the path of a CSV file", motion)
        elif str(motion) in motions and self.scene is not None:
            whole = self.scene.motion(str(motion))
        elif arguments.path("motion", motion, "a motion's name or the path of a CSV file").suffix or "/" in str(motion):
            whole = read_motion(self.robot, Path(motion), Path(motion).stem)
        else:
            source = self.robot.source if self.scene is None else self.scene.source
            raise InputError(f"{source}: {unknown_name('motion', str(motion), motions)}, nor a file of that name")
        require_joints(whole, self.robot)
        return whole, every

    def torques(self, t: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """The motors' torques (n, k), and no multipliers (n, 0)."""
        return self.equations.needed(t, q, v, a)[:, self._columns], np.zeros((len(t), 0))

    def torque_map(self, t: Array, q: Array) -> Callable[[Array], Array]:
        """The function that gives the motors' torques (n, k) for joint forces (n, nv)."""
        return lambda forces: forces[:, self._columns]

    def friction(self, t: Array, q: Array, v: Array) -> Array:
        """The part (n, k) of the motors' torques that overcomes friction."""
        return self.equations.friction(t, q, v)[:, self._columns]

    def link_torques(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """The part (n, links, k) of the motors' torques that each link's mass and inertia cause."""
        return self.equations.link_torques(q, v, a)[:, :, self._columns]

    def inertia(self, t: Array, q: Array) -> Array:
        """M_ii (n, k), kg m² or kg, rotors included."""
        if self.robot.nv > LARGEST_WHOLE and not self.equations.sets_tree:
            return self.robot.inertia_diagonal(q)
        rows = max(1, BLOCK_NUMBERS // self.robot.nv**2)
        blocks = (self.equations.mass_matrix(q[first : first + rows]) for first in range(0, len(q), rows))
        diagonal = [np.diagonal(block, axis1=-2, axis2=-1)[:, self._columns] for block in blocks]
        return np.concatenate([np.zeros((0, len(self._columns))), *diagonal])

    def gravity_torque(self, q: Array) -> Array:
        """The torques (n, nv) that hold the robot at rest against gravity, without the forces of the scene."""
        t, at_rest = np.zeros(len(q)), np.zeros((len(q), self.robot.nv))
        return self.equations.needed(t, q, at_rest, at_rest) + self.equations.applied(t, q, at_rest)

    def link_gravity_torques(self, q: Array) -> Array:
        """The part (n, links, nv) of these torques that each link causes."""
        at_rest = np.zeros((len(q), self.robot.nv))
        return self.equations.link_torques(q, at_rest, at_rest)

    def reactions(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """The wrench (n, joints, 6) through each joint of the tree, forces at frames included."""
        plain = self.equations.scene is None or not (
            any(force.frames for force in self.equations.forces) or self.equations.sets_tree
        )
        if plain:
            return np.asarray(self.robot.joint_reactions(q, v, a))
        flat = self._reactions(t[:, None], q, v, self._signals(t), self.equations.parameters, a, np.zeros((len(t), 0)))
        return np.asarray(flat).reshape(len(t), -1, 6)

    def _signals(self, t: Array) -> Array:
        assert self.equations.scene is not None
        return self.equations.scene.signals_at(t)

    @cached_property
    def _reactions(self) -> Compiled:
        scene = self.equations.scene
        assert scene is not None
        return self.robot.compiled("joint wrenches " + scene.physics_key(), lambda: joint_reactions(scene))

    def residuals(self, t: Array, q: Array, v: Array, a: Array) -> tuple[float, float]:
        """0, as there are no constraints, and the largest force at a joint without a motor, relative to the largest of
        all.

        Such a joint is a free base.
        """
        need = np.abs(self.equations.needed(t, q, v, a))
        left = np.delete(need, self._columns, axis=1)
        return 0.0, float(left.max(initial=0.0) / (need.max(initial=0.0) or 1.0))
