"""Inverse dynamics of a scene: motor torques, multipliers and joint reactions along a motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.inverse.input_breakpoints import force_times
from bellcrank.dynamics.inverse.mechanism import Mechanism, mechanism_of
from bellcrank.dynamics.inverse.motion_notes import mechanism_notes, motion_notes
from bellcrank.errors import InputError
from bellcrank.files.access import Trust
from bellcrank.messages import unknown_name
from bellcrank.motion.motion import Motion
from bellcrank.notes import Note, in_use, ranked
from bellcrank.robot.robot import Robot
from bellcrank.scene.load import given_scene
from bellcrank.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class SceneInverseDynamics:
    """The torques that a motion of a scene requires. Made by `scene_inverse_dynamics`.

    With more motors than degrees of freedom (`redundancy` > 0) the torques have the least Σ τ²; all others differ from
    them by internal forces.

    Attributes:
        mechanism: The open chain or closed linkage.
        motion: The motion of all joints.
        independent: The joints that the motion follows from.
        torque: Torques (n, k) of the motors at the joints `actuated`, N m or N, rotors included.
        multipliers: Multipliers (n, rows) of the constraints, N or N m, named by `multiplier_names`; none for an open
            chain.
        notes: What of the scene is not included, and where scene and motion differ.

    Example:
        >>> import bellcrank as bc
        >>> result = bc.scene_inverse_dynamics("five_bar", "pick")
        >>> result.torque.shape == (len(result.time), len(result.actuated))
        True
        >>> result.constraint_residual() < 1e-12
        True
    """

    mechanism: Mechanism
    motion: Motion
    independent: tuple[str, ...]
    torque: Array
    multipliers: Array
    notes: tuple[Note, ...] = ()

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
        """The number of motors in excess of the degrees of freedom."""
        return len(self.mechanism.motors) - len(self.independent)

    @property
    def multiplier_names(self) -> tuple[tuple[str, str], ...]:
        """(constraint, label) of each multiplier, such as ("apex", "x [N]")."""
        return self.mechanism.multiplier_names

    def motor(self, name: str) -> Array:
        """The torque of one motor.

        Args:
            name: The name of a joint with a motor.

        Returns:
            The torque (n,), N m or N.

        Raises:
            InputError: No motor has this name.
        """
        if arguments.text("name", name, "the name of a joint with a motor") not in self.actuated:
            raise InputError(f"{self.mechanism.robot.name}: {unknown_name('motor', name, self.actuated)}")
        return self.torque[:, self.actuated.index(name)]

    @property
    def power(self) -> Array:
        """Power (n,) W of all motors."""
        return np.asarray((self.torque * self.velocity[:, [joint.v for joint in self.mechanism.motors]]).sum(axis=1))

    @cached_property
    def applied(self) -> Array:
        """The generalised force (n, nv) of all forces of the scene, N m or N.

        It is not part of the motors' torques, which are what the motion requires in addition.
        """
        return self.mechanism.equations.applied(force_times(self.time, self.time[-1]), self.position, self.velocity)

    @cached_property
    def reactions(self) -> Array:
        """The wrench through each joint of the tree, (n, len(all_joint_names), 6), as `Robot.joint_reactions`.

        It includes what constraints and the scene's forces at frames exert on the links.
        """
        return self.mechanism.reactions(*self._states)

    def constraint_residual(self) -> float:
        """The largest position residual of a constraint along the motion, m or rad."""
        return self.mechanism.residuals(*self._states)[0]

    def equation_residual(self) -> float:
        """The largest |S τ + Jᵀλ − Q| along the motion, relative to the largest |Q|; 0 where no force is required.

        In an open chain it is the force at joints without a motor, such as a free base.
        """
        return self.mechanism.residuals(*self._states)[1]

    @property
    def _states(self) -> tuple[Array, Array, Array, Array]:
        return force_times(self.time, self.time[-1]), self.position, self.velocity, self.acceleration


@arguments.named
def scene_inverse_dynamics(
    scene: Scene | Robot | str | Path,
    motion: Motion | str | Path,
    actuated: Sequence[str] | None = None,
    independent: Sequence[str] | None = None,
    overrides: Mapping[str, Any] | None = None,
    *,
    trust: Trust = (),
) -> SceneInverseDynamics:
    """Motor torques, constraint multipliers and joint reactions along a motion of an open chain or a closed linkage.

    All forces of the scene act, at the times of the motion: springs, dampers, wrenches, friction, and torques, which
    act in addition to the motors. Its control is not included, which `notes` say. In an open chain every joint with one
    degree of freedom has a motor. In a linkage the joints that are not independent follow from the constraints, on the
    branch of the scene's start. Source: Nakamura & Ghodoussi, IEEE Trans. Robotics Autom. 5 (1989), for linkages;
    recursive Newton-Euler, Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 5.

    Args:
        scene: A Scene, the path of its file, or the name of a bundled one.
        motion: A Motion, the name of a motion of the scene, or the path of a CSV file, for a linkage with columns of
            the independent joints.
        actuated: The joints of a linkage with motors; by default those of its prescribed motions, which are removed,
            else the scene's `actuated`, else those with actuators.
        independent: The joints of a linkage whose positions the motion prescribes; by default those that it moves,
            motors first.
        overrides: Changes of the scene by dotted path, as for `load_scene`.
        trust: Where `scene` is a file, folders whose files it may name, besides those near it.

    Returns:
        Torques, multipliers and the motion of all joints.

    Raises:
        InputError: The scene, the motion or an argument does not fit.
        UnreachableError: The linkage cannot follow the motion, or its motors cannot move it.

    Example:
        >>> import bellcrank as bc
        >>> result = bc.scene_inverse_dynamics("planar_2r", "elbow_up")
        >>> result.actuated
        ('shoulder', 'elbow')
        >>> result.torque.shape == (len(result.time), 2)
        True
    """
    scene = given_scene(scene, overrides, trust)
    if actuated is not None:
        actuated = arguments.several("actuated", actuated, str, "names of joints")
    if independent is not None:
        independent = arguments.several("independent", independent, str, "names of joints")
    mechanism = mechanism_of(scene, actuated=actuated)
    whole, joints = mechanism.along(motion, independent)
    states = (force_times(whole.time, whole.time[-1]), whole.position, whole.velocity, whole.acceleration)
    torque, multipliers = mechanism.torques(*states)
    said = in_use(scene.config.notes, None, bool(mechanism.robot.gravity.any()))
    notes = ranked((*said, *mechanism_notes(mechanism), *motion_notes(mechanism, whole)))
    return SceneInverseDynamics(mechanism, whole, joints, torque, multipliers, notes)
