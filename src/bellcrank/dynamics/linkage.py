"""A linkage whose loops are closed, with the torques that its motors must give, as sizing sees it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.derived import cached_property
from bellcrank.dynamics.constraint_rows import rows_of
from bellcrank.dynamics.loop_kinematics import Chain
from bellcrank.dynamics.dependent_motion import guided_motion
from bellcrank.dynamics.joint_wrenches import joint_wrenches
from bellcrank.motion.motion import Motion
from bellcrank.robot.robot import Robot, RobotJoint

if TYPE_CHECKING:
    from bellcrank.codegen.compile import Compiled
    from bellcrank.dynamics.tree_inverse_dynamics import InverseEquations
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]


class Linkage:
    """A scene whose constraints tie joints, as a Mechanism: what its motors feel is P Q and P M Pᵀ (closed_chain.py).

    `robot` stands for the scene's, with payloads; `actuated` are the joints with motors (chain.py says which without).
    Forces and parameters of the scene count, its control does not. Raises InputError for what has no such answer.
    """

    closed = True

    def __init__(self, scene: Scene, robot: Robot | None = None, actuated: Sequence[str] | None = None) -> None:
        if not hasattr(scene, "constraints"):
            arguments.refuse("scene", "a Scene, as bc.load_scene gives", scene)
        if robot is not None:
            arguments.instance("robot", robot, Robot, "a Robot")
        self.scene: Scene = scene if robot is None else replace(scene, robot=robot)
        if actuated is not None:
            actuated = arguments.several("actuated", actuated, str, "names of joints")
        self.chain = Chain(self.scene, actuated)
        self.robot: Robot = self.scene.robot
        self.motors: tuple[RobotJoint, ...] = self.chain.actuated
        self._columns = [joint.v for joint in self.motors]

    @property
    def equations(self) -> InverseEquations:
        """The joint forces of the tree under the scene's forces."""
        return self.chain.equations

    @property
    def multiplier_names(self) -> tuple[tuple[str, str], ...]:
        """(constraint, what it is) of each multiplier."""
        return self.chain.multiplier_names

    def motion(self, motion: Motion | str | Path) -> Motion:
        """A motion with all joints following the independent ones of it. Raises BellcrankError."""
        return self.along(motion)[0]

    def along(
        self, motion: Motion | str | Path, independent: Sequence[str] | None = None
    ) -> tuple[Motion, tuple[str, ...]]:
        """The motion of all joints, and the independent joints it was given by. Raises BellcrankError."""
        return guided_motion(self.chain, motion, independent)

    def torques(self, t: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """The motors' torques (n, k), rotors in them, and the closures' multipliers (n, rows)."""
        t, q, v, a = self._rows(t=t, q=q, v=v, a=a)
        return self.chain.torques(t, q, v, a)

    def friction(self, t: Array, q: Array, v: Array) -> Array:
        """How much of the motors' torques (n, k) overcomes friction, that of joints without a motor too."""
        t, q, v = self._rows(t=t, q=q, v=v)
        return np.asarray(np.einsum("nkv,nv->nk", self._shares(t, q), self.equations.friction(t, q, v)))

    def link_torques(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """How much of the motors' torques each link's mass and inertia cause, (n, links, k)."""
        t, q, v, a = self._rows(t=t, q=q, v=v, a=a)
        return np.asarray(np.einsum("nkv,nlv->nlk", self._shares(t, q), self.equations.link_torques(q, v, a)))

    def inertia(self, t: Array, q: Array) -> Array:
        """The diagonal of P M Pᵀ (n, k), rotors in it."""
        t, q = self._rows(t=t, q=q)
        shares = self._shares(t, q)
        return np.asarray(np.einsum("nkv,nvw,nkw->nk", shares, self.equations.mass_matrix(q), shares))

    def _rows(self, **states: Array) -> tuple[Array, ...]:
        """Times (n,) and states (n, …) of as many rows, finite. Raises InputError that names the argument."""
        n = len(arguments.array("t", states["t"], (None,), "s"))
        sizes = {"q": self.robot.nq, "v": self.robot.nv, "a": self.robot.nv}
        return tuple(arguments.array(name, x, (n,) if name == "t" else (n, sizes[name])) for name, x in states.items())

    def _shares(self, t: Array, q: Array) -> Array:
        return self.chain.shares(self.chain.closed(t, q, np.zeros((len(q), self.robot.nv)))[2], t)

    def reactions(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """The wrench (n, joints, 6) through each joint of the tree, what constraints and forces put on the links in it."""
        t, q, v, a = self._rows(t=t, q=q, v=v, a=a)
        scene, (_, multipliers) = self.chain.loaded, self.torques(t, q, v, a)
        flat = self._wrenches(t[:, None], q, v, scene.signals_at(t), scene.parameter_values, a, multipliers)
        return np.asarray(flat).reshape(len(t), -1, 6)

    @cached_property
    def _wrenches(self) -> Compiled:
        scene = self.chain.loaded
        key = f"joint wrenches {scene.physics_key()} {rows_of(scene).signature}"
        return self.robot.compiled(key, lambda: joint_wrenches(scene))

    def residuals(self, t: Array, q: Array, v: Array, a: Array) -> tuple[float, float]:
        """The largest violation of a constraint, m or rad, and the largest |S τ + Jᵀλ − Q|, a share of the largest |Q|."""
        t, q, v, a = self._rows(t=t, q=q, v=v, a=a)
        need, gap, _, jacobian, _ = self.chain.at(t, q, v, a)
        torque, multipliers = self.torques(t, q, v, a)
        left = need - (jacobian.transpose(0, 2, 1) @ multipliers[:, :, None])[:, :, 0]
        left[:, self._columns] -= torque
        worst, scale = float(np.abs(left).max()), float(np.abs(need).max())
        return float(np.abs(gap).max(initial=0.0)), worst / scale if scale else (0.0 if worst == 0.0 else float("inf"))
