"""A linkage whose loops are closed, as sizing sees it: a robot whose joint torques are those of its motors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.constraints.chain import Chain
from bellcrank.constraints.guided import guided_motion
from bellcrank.constraints.inverse import reactions
from bellcrank.errors import InputError
from bellcrank.robot.robot import Robot, RobotJoint
from bellcrank.sizing.holding import Holding
from bellcrank.sizing.peaks import grid_along, maxima

if TYPE_CHECKING:
    from bellcrank.card.card import Card
    from bellcrank.motion.motion import Motion
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]


class Linkage(Robot):
    """A robot under a scene's closures. Where a tree's joint torque, shares of links and mass matrix are asked for, it
    gives those that its motors feel, P τ and P M Pᵀ (constraints/chain.py), and zeros at joints without a motor.

    Arrays are batches (n, …). The scene's forces, control and parameters are passed over. Raises InputError where the
    closures move with time.
    """

    def __init__(self, scene: Scene, robot: Robot | None = None, actuated: Sequence[str] | None = None) -> None:
        robot = scene.robot if robot is None else robot
        self.__dict__.update(vars(robot))  # the same robot, seen otherwise
        bare = replace(scene, robot=robot, forces=(), control=(), parameters={}, events=(), outputs={})
        self.chain = Chain(bare, actuated)
        if self.chain.scene.signal_sources:
            raise InputError(f"{scene.source}: sizing takes closures that do not move with time")
        self.motors: tuple[RobotJoint, ...] = self.chain.actuated
        self._columns = [joint.v for joint in self.motors]

    def motion(self, motion: Motion | str | Path) -> Motion:
        """A motion with all joints following the independent ones of it. Raises BellcrankError."""
        return guided_motion(self.chain, motion)[0]

    def _terms(self, q: Any, v: Any, a: Any) -> tuple[Array, Array]:
        """Joint forces Q (n, nv) and P (n, k, nv)."""
        q, v, a = (np.asarray(x, dtype=np.float64) for x in (q, v, a))
        need, _, _, jacobian, _ = self.chain.at(np.zeros(len(q)), q, v, a)
        return need, self.chain.shares(jacobian)

    def _felt(self, shares: Array, forces: Array) -> Array:
        """P f, with zeros at joints without a motor, for forces (n, …, nv)."""
        felt = np.zeros_like(forces)
        felt[..., self._columns] = np.einsum("nkv,n...v->n...k", shares, forces)
        return felt

    def inverse_dynamics(self, q: Any, v: Any, a: Any) -> Array:
        """Motor torques (n, nv), N m or N, friction of all joints in them."""
        need, shares = self._terms(q, v, a)
        return self._felt(shares, need)

    def gravity_torque(self, q: Any) -> Array:
        """The motor torques (n, nv) that hold the linkage at rest."""
        still = np.zeros((len(q), self.nv))
        return self.inverse_dynamics(q, still, still)

    def mass_matrix(self, q: Any) -> Array:
        """P M Pᵀ (n, nv, nv): the inertia that each motor feels."""
        still = np.zeros((len(q), self.nv))
        _, shares = self._terms(q, still, still)
        mass = np.zeros((len(q), self.nv, self.nv))
        felt = shares @ Robot.mass_matrix(self, q) @ shares.transpose(0, 2, 1)
        mass[np.ix_(range(len(q)), self._columns, self._columns)] = felt
        return mass

    def link_torques(self, q: Any, v: Any, a: Any) -> Array:
        """How much of the motors' torques each link causes: (n, links, nv)."""
        return self._felt(self._terms(q, v, a)[1], super().link_torques(q, v, a))

    def link_gravity_torques(self, q: Any) -> Array:
        """The same at rest."""
        still = np.zeros((len(q), self.nv))
        return self.link_torques(q, still, still)

    def joint_reactions(self, q: Any, v: Any, a: Any) -> Array:
        """The wrench (n, joints, 6) through each joint of the tree, closures taken into account."""
        t = np.zeros(len(q))
        _, multipliers = self.chain.torques(t, q, v, a)
        return reactions(self.chain, t, q, v, a, multipliers)


def linkage_of(card: Card, robot: Robot) -> Linkage | None:
    """The linkage of a card whose file closes loops, for its robot with payloads; None for a tree. InputError."""
    from bellcrank.card.yaml_file import read_yaml
    from bellcrank.scene.scene import load_scene

    if card.source == card.urdf or not read_yaml(card.source).get("closures"):
        return None
    return Linkage(load_scene(card.source), robot)


def motors_of(robot: Robot) -> tuple[RobotJoint, ...]:
    """The joints to size: of a linkage those with motors, of a tree all with one degree of freedom."""
    return robot.motors if isinstance(robot, Linkage) else tuple(joint for joint in robot.joints if joint.nv == 1)


def static_torques(robot: Linkage, motions: Sequence[Motion], mass_tolerance: float) -> Holding:
    """The largest torque that holds each motor's joint at rest at a posture of the motions, as `holding_torques`: a
    linkage's joints have no ranges of their own.
    """

    def still(q: Array, v: Array, a: Array) -> dict[str, Array]:
        torque = np.abs(robot.gravity_torque(q))
        if mass_tolerance:
            torque = torque + mass_tolerance * np.abs(robot.link_gravity_torques(q)).sum(axis=1)
        return {"holding": torque[:, [joint.v for joint in robot.motors]]}

    found = [(motion, maxima(motion, grid_along(motion), still)[1]["holding"]) for motion in motions]
    torque = np.array([largest for _, (largest, _) in found])
    place = torque.argmax(axis=0)
    postures = np.array([found[m][0].at(float(found[m][1][1][k]))[0] for k, m in enumerate(place)])
    note = "holding torques are the largest at the postures of the motions: the closures tie the joints together"
    return Holding(tuple(joint.name for joint in robot.motors), torque.max(axis=0), postures, (note,))
