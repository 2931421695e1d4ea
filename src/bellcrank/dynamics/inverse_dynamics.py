"""Inverse dynamics of a scene: a motion of its independent joints -> motor torques and joint reactions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.derived import cached_property
from bellcrank.dynamics.linkage import Linkage
from bellcrank.dynamics.mechanism import Mechanism, force_times, mechanism_of
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.motion.motion import Motion
from bellcrank.scene.scene import Scene, load_scene

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SceneInverseDynamics:
    """What a motion of a scene needs: torques (n, k) of the motors at `actuated` joints, N m or N, rotors in them, and
    the multipliers (n, rows) of constraints, named by `multiplier_names` (none for an open chain).

    `motion` is the motion of all joints, `independent` the joints that it was given by, `notes` what did not count.
    With more motors than freedoms (`redundancy` > 0) torques are those of least Σ τ²: any others differ by internal
    forces.
    """

    mechanism: Mechanism
    motion: Motion
    independent: tuple[str, ...]
    torque: Array
    multipliers: Array
    notes: tuple[str, ...] = ()

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
        return tuple(joint.name for joint in self.mechanism.motors)

    @property
    def redundancy(self) -> int:
        """How many motors there are beyond the freedoms."""
        return len(self.mechanism.motors) - len(self.independent)

    @property
    def multiplier_names(self) -> tuple[tuple[str, str], ...]:
        """(constraint, what it is) of each multiplier."""
        return self.mechanism.multiplier_names

    def motor(self, name: str) -> Array:
        """One motor's torque (n,). Raises InputError with what there is."""
        if arguments.text("name", name, "the name of a joint with a motor") not in self.actuated:
            raise InputError(f"{self.mechanism.robot.name}: {unknown_name('motor', name, self.actuated)}")
        return self.torque[:, self.actuated.index(name)]

    @property
    def power(self) -> Array:
        """Power (n,) W of all motors."""
        return np.asarray((self.torque * self.velocity[:, [joint.v for joint in self.mechanism.motors]]).sum(axis=1))

    @cached_property
    def applied(self) -> Array:
        """The generalised force (n, nv) of all forces of the scene, N m or N: it is not in the motors' torques, which
        are what the motion needs besides.
        """
        return self.mechanism.equations.applied(force_times(self.time, self.time[-1]), self.position, self.velocity)

    @cached_property
    def reactions(self) -> Array:
        """The wrench through each joint of the tree, (n, len(all_joint_names), 6), as `Robot.joint_reactions`, what
        constraints and the scene's forces at frames put on the links in it.
        """
        return self.mechanism.reactions(*self._states)

    def constraint_residual(self) -> float:
        """The largest violation of a constraint, m or rad."""
        return self.mechanism.residuals(*self._states)[0]

    def equation_residual(self) -> float:
        """The largest |S τ + Jᵀλ − Q|, as a share of the largest |Q|: 0 where nothing is needed. In an open chain it is
        what acts on joints without a motor, such as a free base.
        """
        return self.mechanism.residuals(*self._states)[1]

    @property
    def _states(self) -> tuple[Array, Array, Array, Array]:
        return force_times(self.time, self.time[-1]), self.position, self.velocity, self.acceleration


def scene_inverse_dynamics(
    scene: Scene | str | Path,
    motion: Motion | str | Path,
    actuated: Sequence[str] | None = None,
    independent: Sequence[str] | None = None,
    overrides: Mapping[str, Any] | None = None,
) -> SceneInverseDynamics:
    """Motor torques, multipliers and reactions along a motion of a scene, an open chain or a closed linkage.

    `motion` is a Motion, a motion of the scene by name, or a CSV file, for a linkage with columns of the independent
    joints. Of a linkage only `independent` joints of it count (default: what the motion moves, motors first), the
    others follow the constraints on the branch of the scene's start; `actuated` are its joints with motors (default: those
    of `drive` constraints, which are taken away, else the scene's `actuated`, else its drives). In an open chain every
    joint of one degree of freedom has a motor. All forces of the scene act, at the times of the motion: springs,
    dampers, wrenches, friction, and torques, which act beside the motors. Its control does not, which `notes` say.

    Raises InputError for what does not fit, UnreachableError where a linkage cannot follow.
    """
    from bellcrank.dynamics.motion_notes import mechanism_notes, motion_notes

    if not isinstance(scene, Scene):
        scene = load_scene(arguments.subject("scene", scene, "a scene"))
    if actuated is not None:
        actuated = arguments.several("actuated", actuated, str, "names of joints")
    if independent is not None:
        independent = arguments.several("independent", independent, str, "names of joints")
    if overrides is not None:
        scene = scene.with_overrides(overrides)
    mechanism = mechanism_of(scene, actuated=actuated)
    whole, joints = mechanism.along(motion, independent)
    states = (force_times(whole.time, whole.time[-1]), whole.position, whole.velocity, whole.acceleration)
    torque, multipliers = mechanism.torques(*states)
    notes = (*mechanism_notes(mechanism), *motion_notes(mechanism, whole))
    return SceneInverseDynamics(mechanism, whole, joints, torque, multipliers, notes)


closed_inverse_dynamics = scene_inverse_dynamics  # what it was called while it took closed linkages only

__all__ = ["Linkage", "SceneInverseDynamics", "closed_inverse_dynamics", "scene_inverse_dynamics"]
