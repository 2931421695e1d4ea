"""Closed-chain inverse dynamics: a motion of a linkage's independent joints -> motor torques and joint reactions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.constraints.chain import Chain
from bellcrank.constraints.guided import guided_motion
from bellcrank.constraints.joint_wrenches import joint_wrenches
from bellcrank.errors import InputError, among
from bellcrank.motion.motion import Motion
from bellcrank.scene.scene import Scene, load_scene

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ClosedInverseDynamics:
    """What a motion of a closed linkage needs: torques (n, k) of the motors at `actuated` joints, N m or N, and the
    multipliers (n, rows) of its closures, named by `multiplier_names`.

    `motion` is the motion of all joints, `independent` the joints that it was given by. With more motors than freedoms
    (`redundancy` > 0) torques are those of least Σ τ²: any others differ by internal forces.
    """

    chain: Chain
    motion: Motion
    independent: tuple[str, ...]
    torque: Array
    multipliers: Array

    @property
    def time(self) -> Array:
        """Times (n,) s."""
        return self.motion.time

    @property
    def position(self) -> Array:
        """Position (n, nq), rad or m."""
        return self.motion.position

    @property
    def velocity(self) -> Array:
        """Velocity (n, nv)."""
        return self.motion.velocity

    @property
    def acceleration(self) -> Array:
        """Acceleration (n, nv)."""
        return self.motion.acceleration

    @property
    def actuated(self) -> tuple[str, ...]:
        """The joints with motors, in the order of the columns of `torque`."""
        return tuple(joint.name for joint in self.chain.actuated)

    @property
    def redundancy(self) -> int:
        """How many motors there are beyond the freedoms."""
        return len(self.chain.actuated) - len(self.independent)

    @property
    def multiplier_names(self) -> tuple[tuple[str, str], ...]:
        """(closure, what it is) of each multiplier."""
        return self.chain.multiplier_names

    def motor(self, name: str) -> Array:
        """One motor's torque (n,). Raises InputError with what there is."""
        if name not in self.actuated:
            raise InputError(f"{self.chain.robot.name}: {among('motor', name, self.actuated)}")
        return self.torque[:, self.actuated.index(name)]

    @property
    def power(self) -> Array:
        """Power (n,) W of all motors."""
        return np.asarray((self.torque * self.velocity[:, [joint.v for joint in self.chain.actuated]]).sum(axis=1))

    @cached_property
    def reactions(self) -> Array:
        """The wrench through each joint of the tree, (n, len(all_joint_names), 6), as `Robot.joint_reactions`, what
        closures put on the links taken into account. Raises InputError for scenes with forces at frames.
        """
        return reactions(self.chain, self.time, self.position, self.velocity, self.acceleration, self.multipliers)

    def constraint_residual(self) -> float:
        """The largest violation of a closure, m or rad."""
        return float(np.abs(self._terms[1]).max(initial=0.0))

    def equation_residual(self) -> float:
        """The largest |S τ + Jᵀλ − Q|, as a share of the largest |Q|: 0 where nothing is needed."""
        need, _, _, jacobian, _ = self._terms
        left = need - (jacobian.transpose(0, 2, 1) @ self.multipliers[:, :, None])[:, :, 0]
        left[:, [joint.v for joint in self.chain.actuated]] -= self.torque
        worst, scale = float(np.abs(left).max()), float(np.abs(need).max())
        return worst / scale if scale else (0.0 if worst == 0.0 else float("inf"))

    @cached_property
    def _terms(self) -> tuple[Array, Array, Array, Array, Array]:
        return self.chain.at(self.time, self.position, self.velocity, self.acceleration)


def closed_inverse_dynamics(
    scene: Scene | str | Path,
    motion: Motion | str | Path,
    actuated: Sequence[str] | None = None,
    independent: Sequence[str] | None = None,
    overrides: Mapping[str, Any] | None = None,
) -> ClosedInverseDynamics:
    """Motor torques, multipliers and reactions along a motion of a scene whose closures close loops.

    `motion` is a Motion, a motion of the card by name, or a CSV file with columns of the independent joints. Only
    `independent` joints of it count (default: what the motion moves, motors first), the others follow the closures on
    the branch of the scene's start. `actuated` are the joints with motors (default: those of `drive` closures, which
    are taken away, else the card's `actuated`, else its drives). Springs, dampers, wrenches and friction of the scene
    act; its control and torques do not.

    Raises InputError for what does not fit, UnreachableError where the linkage cannot follow.
    """
    if not isinstance(scene, Scene):
        scene = load_scene(scene)
    if overrides:
        scene = scene.with_overrides(overrides)
    chain = Chain(scene, actuated)
    whole, joints = guided_motion(chain, motion, independent)
    torque, multipliers = chain.torques(whole.time, whole.position, whole.velocity, whole.acceleration)
    return ClosedInverseDynamics(chain, whole, joints, torque, multipliers)


def reactions(chain: Chain, t: Array, q: Array, v: Array, a: Array, multipliers: Array) -> Array:
    """The wrench (n, joints, 6) through each joint of the tree (joint_wrenches.py). Raises InputError."""
    scene = chain.scene
    held = [force.name for force in scene.forces if force.frames]
    if held:
        raise InputError(
            f"{scene.source}: reactions at joints do not know what the force '{held[0]}' does at its frames; take it "
            "out of the scene"
        )
    code = chain.robot.compiled("joint wrenches " + scene.physics_key(), lambda: joint_wrenches(scene))
    flat = code(t[:, None], q, v, scene.signals_at(t), scene.parameter_values, a, multipliers)
    return np.asarray(flat).reshape(len(t), -1, 6)
