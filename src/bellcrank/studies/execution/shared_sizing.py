"""What the designs of a study of sizings share: mechanism, motions, compiled torques, and why some are sized singly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.cached_values import Portable, cached_property
from bellcrank.dynamics.constraints.constraint_derivatives import aligned_constraints
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.inverse.input_breakpoints import with_force_rows
from bellcrank.dynamics.inverse.mechanism import Mechanism, coulomb_widths
from bellcrank.dynamics.inverse.motor_torques import MotorTorques
from bellcrank.elements.dry_friction import DryFriction
from bellcrank.elements.expression import has_time
from bellcrank.elements.frame_joints import path_frames
from bellcrank.elements.joint_constraints import PrescribedMotion
from bellcrank.elements.joint_forces import Damper, Friction
from bellcrank.elements.joint_stops import JointStop
from bellcrank.elements.supply import Supply
from bellcrank.motion.entry_kinds import WaypointsEntry
from bellcrank.motion.motion import Motion
from bellcrank.robot.model.traced_tree import MASS, SCALE
from bellcrank.scene.scene import Scene
from bellcrank.sizing.holding_gravity import HoldingSearch
from bellcrank.sizing.loads.design_peaks import DesignMotion
from bellcrank.sizing.loads.joint_loads import JointLoads
from bellcrank.sizing.loads.load_checks import massless_motors
from bellcrank.sizing.loads.motion_grid import grid_along
from bellcrank.sizing.loads.series_maxima import maxima, on_grid
from bellcrank.sizing.sensitivities import independent_joints
from bellcrank.sizing.sizing_subject import sizing_subject
from bellcrank.studies.designs.sizing_changes import Change

if TYPE_CHECKING:
    from bellcrank.robot.robot import RobotJoint

SHARE = 0.3  # by which each parameter differs in the designs that the grid of a motion is made for
REGULAR = 1e-3  # of the largest singular value of the dependent joints' Jacobian, at least, along a motion
INERTIA_RATINGS = ("ratio", "rotor_inertia", "gear_inertia")


class SharedSizing(Portable):
    """What designs of a scene share.

    Args:
        scene: The scene, with a parameter for every number of the tree that designs vary.
        changes: What the values of a design change, in order.
        motion_names: Names of the motions; None: all.
    """

    def __init__(self, scene: Scene, changes: Sequence[Change], motion_names: Sequence[str] | None) -> None:
        self._scene, self.changes, self.motion_names = scene, tuple(changes), motion_names

    # ---- mechanism and motions

    @cached_property
    def _subject(self) -> tuple[Mechanism, list[Motion], JointLoads]:
        subject = sizing_subject(self._scene, self.motion_names)
        mechanism = subject.mechanism
        motions = [with_force_rows(mechanism, motion) for motion in subject.motions]
        return mechanism, motions, JointLoads(mechanism, subject.actuators, 0.0)

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism."""
        return self._subject[0]

    @property
    def motions(self) -> list[Motion]:
        """The motions of all joints that designs without other lengths follow."""
        return self._subject[1]

    @property
    def loads(self) -> JointLoads:
        """The motors and their actuators."""
        return self._subject[2]

    @cached_property
    def scene(self) -> Scene:
        """The scene with the robot of the mechanism."""
        return replace(self._scene, robot=self.mechanism.robot)

    @cached_property
    def with_actuator(self) -> list[int]:
        """The motors with an actuator."""
        return [k for k, name in enumerate(self.loads.joint_names) if name in self.loads.actuators]

    @cached_property
    def known(self) -> list[int]:
        """The motors whose shaft torque is known."""
        return [k for k, name in enumerate(self.loads.joint_names) if self.loads.knows_shaft(name)]

    @cached_property
    def speeds(self) -> list[dict[str, Array]]:
        """Along each motion, of the motors' joints (k,): peak and mean |speed|, the highest position, and the lowest
        times −1, as `bellcrank.size` gives them.
        """
        q, v = ([getattr(joint, name) for joint in self.mechanism.motors] for name in ("q", "v"))

        def quantities(_: Array, position: Array, speed: Array, __: Array) -> dict[str, Array]:
            return {"peak": np.abs(speed[:, v]), "highest": position[:, q], "lowest": -position[:, q]}

        found = []
        for motion in self.motions:
            grid = grid_along(motion)
            values = on_grid(motion, grid, quantities)
            largest = maxima(motion, grid, values, quantities)
            mean = np.einsum("n,nk->k", grid.weight, values["peak"]) / motion.duration
            found.append({name: each.value for name, each in largest.items()} | {"mean": mean})
        return found

    # ---- torques

    @cached_property
    def independent(self) -> tuple[RobotJoint, ...]:
        """Of a closed linkage the joints that determine the others, motors first."""
        return independent_joints(self.mechanism, self.motions[0].name)

    @cached_property
    def torques(self) -> MotorTorques:
        """The torques of the motors, of samples with parameters of their own."""
        return MotorTorques(self.scene, self.mechanism.motors, self.independent)

    @cached_property
    def representative(self) -> list[Array]:
        """The parameters of the scene, masses that are varied above 0; and the same with one of them changed."""
        base, names = self.scene.parameter_values, list(self.scene.parameters)
        varied = {names.index(change.path): change for change in self.changes if change.kind == "parameter"}
        for k, change in varied.items():
            if base[k] == 0.0 and {what for _, what in change.places} & {MASS, SCALE}:
                base[k] = 1.0
        found = [base]
        for k, change in varied.items():
            if not (change.moves and self.mechanism.closed):  # the motion would violate the constraints
                more = base.copy()
                more[k] = (1.0 + SHARE) * base[k] if base[k] else 0.1 * SHARE
                found.append(more)
        return found

    @cached_property
    def design_motions(self) -> list[DesignMotion]:
        """The motions along which designs are sized."""
        return [DesignMotion(self.mechanism, motion, self.torques, self.representative) for motion in self.motions]

    def entry(self, motion: str) -> WaypointsEntry | None:
        """The entry of a motion of which designs have waypoints of their own; None for other motions."""
        if not any(change.kind == "waypoint" and change.owner == motion for change in self.changes):
            return None
        entry = self.scene.config.motions[motion]
        assert isinstance(entry, WaypointsEntry)
        return entry

    @property
    def changed_linkage(self) -> Linkage | None:
        """The linkage whose designs differ in lengths, so that the joints of each move in their own way."""
        moved = any(change.moves for change in self.changes)
        return self.mechanism if moved and isinstance(self.mechanism, Linkage) else None

    @cached_property
    def holding(self) -> HoldingSearch | None:
        """The search for holding torques; None where they are not measures."""
        if not self.reports_holding:
            return None
        robot, torques = self.mechanism.robot, self.torques
        columns = [joint.v for joint in self.mechanism.motors]

        def gravity(q: Array, p: Array) -> Array:
            rest, found = np.zeros((len(q), robot.nv)), np.zeros((len(q), robot.nv))
            found[:, columns] = torques(np.zeros(len(q)), q, rest, rest, p)
            return found

        return HoldingSearch(robot, gravity, self.representative)

    @property
    def reports_holding(self) -> bool:
        """Whether holding torques are measures: of an open chain under gravity alone."""
        resisting = Damper | Friction | DryFriction | JointStop | Supply
        acting = [force for force in self.mechanism.equations.forces if not isinstance(force, resisting)]
        return not self.mechanism.closed and not acting and HoldingSearch.covers(self.mechanism.robot)

    # ---- what a batch does not cover

    @cached_property
    def unsizable(self) -> str:
        """Why a motor cannot be sized in any design whose masses are above 0; empty where all can be."""
        values = dict(zip(self.scene.parameters, self.representative[0].tolist(), strict=True))
        parameters = {name: replace(one, value=values[name]) for name, one in self.scene.parameters.items()}
        massive = sizing_subject(replace(self.scene, parameters=parameters), self.motions[:1]).mechanism
        return "; ".join(massless_motors(massive, self.motions).refused.values())

    @cached_property
    def single_reason(self) -> str:
        """Why designs are sized one by one; empty where they are sized together."""
        others = [change.path for change in self.changes if change.kind == "override"]
        if others:
            return f"'{others[0]}' is no parameter of the equations, rating of an actuator, duration or waypoint"
        if self.scene.config.transmissions:
            return "the robot has coupled transmissions"
        if self.scene.config.duty:
            return "its motors are judged along a duty program"
        if any(not one.rows[0].by_ratings for one in self.loads.actuators.values()):
            return "a motor and gear of a catalogue are judged by all of their criteria"
        timed = any(change.kind in ("duration", "waypoint") for change in self.changes)
        if timed and (coulomb_widths(self.mechanism) or self._timed):
            return "Coulomb friction, or what depends on time, does not scale with the times of a motion"
        own = [change.path for change in self.changes if change.kind == "waypoint"]
        if own and self.mechanism.closed:
            return f"'{own[0]}' changes how the joints of a linkage move"
        if own and any((joint.nq, joint.nv) != (1, 1) for joint in self.mechanism.robot.joints):
            return f"'{own[0]}' changes a motion, and a joint has several degrees of freedom"
        return self._reason_of_linkage(self.mechanism) if isinstance(self.mechanism, Linkage) else ""

    @property
    def _timed(self) -> bool:
        """Whether a force or constraint depends on time."""
        parts = (*self.mechanism.equations.forces, *self.scene.constraints)
        return any(part.source is not None or has_time(part) for part in parts)

    def _reason_of_linkage(self, mechanism: Linkage) -> str:
        if not self.torques.solvable:
            return "the constraints of the linkage are redundant, or many"
        redundant = len(mechanism.motors) > len(self.independent)
        if redundant and any(change.path.rpartition(".")[2] in INERTIA_RATINGS for change in self.changes):
            return "motors share the load of the linkage, so that the inertia of one changes the torques of the others"
        lead = [joint.v for joint in self.independent]
        rest = [v for v in range(mechanism.robot.nv) if v not in lead]
        for motion in self.motions:
            jacobian = mechanism.kinematics.scaled(mechanism.kinematics.jacobian(motion.time, motion.position))
            values = np.linalg.svd(jacobian[:, :, rest], compute_uv=False)
            if not (values[:, -1] > REGULAR * values[:, 0]).all():
                return f"motion '{motion.name}' comes near a dead point of the linkage"
        return self._reason_of_lengths(mechanism)

    def _reason_of_lengths(self, mechanism: Linkage) -> str:
        """Why the motions of designs with other lengths are not made together."""
        moved = [change.path for change in self.changes if change.moves]
        if not moved:
            return ""
        what = f"'{moved[0]}' changes how the joints of the linkage depend on each other, and"
        if mechanism.robot.nq != mechanism.robot.nv or any(joint.nv != 1 for joint in mechanism.robot.joints):
            return f"{what} a joint has several degrees of freedom"
        if set(self.independent) != set(mechanism.motors):
            return f"{what} the motors are not the joints that determine the others"
        if coulomb_widths(mechanism):
            return f"{what} Coulomb friction changes with the speeds of the others"
        if any(isinstance(one, PrescribedMotion) for one in self.scene.constraints) or self._follows_paths():
            return f"{what} a motion is not that of the motors' joints"
        if aligned_constraints(mechanism.kinematics.scene):
            return f"{what} a weld or hinge has to be kept from turning over"
        return ""

    def _follows_paths(self) -> bool:
        """Whether a motion prescribes other joints than the motors', or is made from the path of a frame."""
        names = list(self.scene.config.motions) if self.motion_names is None else list(self.motion_names)
        return any(
            name not in self.scene.config.motions
            or set(self.mechanism.along(name)[1]) != {joint.name for joint in self.mechanism.motors}
            or any(path_frames(self.scene.config.motions[name], self.scene.config.motions))
            for name in names
        )
