"""Forces as arrows: what constraints, contacts, motors and wrenches do to bodies in the world; and springs as lines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.derived import cached_property
from bellcrank.dynamics.system import system_of
from bellcrank.elements import frame_forces
from bellcrank.elements.constraint import Constraint
from bellcrank.elements.element import Part
from bellcrank.elements.joint_forces import JointSpring
from bellcrank.elements.joint_relations import Drive
from bellcrank.elements.loops import WORLD, Distance, Hinge, Loop, Point, Weld, perpendicular
from bellcrank.elements.rolling import RollingDisk
from bellcrank.elements.signals import values_at
from bellcrank.replays.film.film import Arrow, Rod, Spring
from bellcrank.replays.film.frames import Placed
from bellcrank.replays.geometry.rotations import multiplied, quaternions, turned

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot, RobotJoint
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PlacedScene:
    """A scene at the frames of a film: its parameters' values, `state` (n, …) that begins with q, and where the robot's
    frames are.
    """

    scene: Scene
    parameters: Array
    state: Array
    placed: Placed

    def number(self, part: Part, field: str) -> float:
        """A number of a force or constraint, as the parameters have it."""
        target = f"{part.owner}.{part.name}.{field}"
        for k, parameter in enumerate(self.scene.parameters.values()):
            if target in parameter.sets:
                return float(self.parameters[k])
        return part.number(field)

    def vector(self, part: Part, field: str) -> Array:
        """A vector (3,) of a force or constraint."""
        return np.array([self.number(part, f"{field}.{c}") for c in "xyz"])

    def side(self, loop: Loop, first: bool) -> tuple[Array, Array]:
        """Points and quaternions of one side of a loop."""
        name, at = (loop.frame_a, loop.at_a) if first else (loop.frame_b, loop.at_b)
        if name == WORLD and not first:
            points = np.tile(self.vector(loop, "point"), (len(self.state), 1))
            turns = np.tile([0.0, 0.0, 0.0, 1.0], (len(self.state), 1))
        else:
            points, turns = self.placed(name)
        return (points, turns) if at is None else (points + turned(turns, np.array(at[:3])), turns)


@dataclass(frozen=True, eq=False)
class Moments(PlacedScene):
    """The scene of a run at the frames of a film: times (n,) s, and states (n, size)."""

    run: Trajectory
    time: Array

    @cached_property
    def _arguments(self) -> tuple[Array, ...]:
        return self.time[:, None], self.state, values_at(self.run.signals, self.time), self.run.parameters

    @cached_property
    def multipliers(self) -> Array:
        """Multipliers (n, rows) of the constraints."""
        return np.asarray(system_of(self.run.scene).constraint(*self._arguments)[0])

    @cached_property
    def actuator_torque(self) -> Array:
        """Torques of motors and controllers (n, nv), N m or N."""
        return np.asarray(system_of(self.run.scene).observation(*self._arguments)[2])

    def of(self, constraint: Constraint) -> Array:
        """A constraint's multipliers (n, k), one a label, 0 for a row that does not bind."""
        labels = constraint.labels(self.run.robot)
        full = np.zeros((len(self.time), len(labels)))
        for row, (owner, label) in enumerate(system_of(self.run.scene).multiplier_names):
            if owner == constraint.name and label in labels:
                full[:, labels.index(label)] = self.multipliers[:, row]
        return full


def shown_frames(scene: Scene) -> tuple[str, ...]:
    """The frames that arrows, springs and rods of a scene need."""
    parts: tuple[Part, ...] = (*scene.constraints, *scene.forces)
    return tuple(dict.fromkeys(name for part in parts for name in part.frames))


def child_link(robot: Robot, joint: str) -> str:
    """The link that a joint moves; its frame is the joint's own."""
    return robot.urdf.joints[joint].child


def run_arrows(moments: Moments) -> Iterator[Arrow]:
    """The forces and torques of a run: multipliers on the body of each constraint's first frame, forces of contact,
    torques of motors about their axes, and wrenches.
    """
    scene = moments.run.scene
    for constraint in scene.constraints:
        if isinstance(constraint, Drive):
            yield motor_arrow(
                scene.robot, constraint.joint, moments.of(constraint)[:, 0], moments.placed, constraint.name
            )
        elif isinstance(constraint, RollingDisk):
            yield Arrow(
                f"{constraint.name} on {_link(moments, constraint.frame)}",
                "N",
                contact_points(moments, constraint),
                _contact_force(moments, constraint),
            )
        elif isinstance(constraint, Loop):
            yield from _loop_arrows(moments, constraint)
    for joint in scene.robot.joints:
        if joint.nv == 1 and np.any(moments.run.actuator_torque[:, joint.v]):
            yield motor_arrow(scene.robot, joint, moments.actuator_torque[:, joint.v], moments.placed)
    for force in scene.forces:
        if isinstance(force, frame_forces.Wrench):
            points, turns = moments.placed(force.frame)
            for field, unit in (("force", "N"), ("torque", "N m")):
                value = np.tile(moments.vector(force, field), (len(points), 1))
                if np.any(value):
                    value = value if force.expressed_in == WORLD else turned(turns, value)
                    yield Arrow(f"{force.name} {field}", unit, points, value, field == "torque")


def motor_arrow(robot: Robot, joint: RobotJoint, torque: Array, placed: Placed, name: str | None = None) -> Arrow:
    """A motor's torque (n,) N m about its joint's axis, on the link that it moves; on a prismatic joint a force, N."""
    points, turns = placed(child_link(robot, joint.name))
    vectors = torque[:, None] * turned(turns, np.asarray(robot.joint_axis(joint.name)))
    linear = joint.kind == "prismatic"
    return Arrow(name or f"{joint.name} motor", "N" if linear else "N m", points, vectors, not linear)


def springs_of(moments: PlacedScene) -> Iterator[Spring]:
    """The springs between frames, and those along prismatic joints: from where the joint is at 0 to where it is."""
    for force in moments.scene.forces:
        if isinstance(force, frame_forces.Spring):
            a = moments.placed(force.frame_a)[0]
            fixed = force.frame_b == WORLD
            b = np.tile(moments.vector(force, "point"), (len(a), 1)) if fixed else moments.placed(force.frame_b)[0]
            yield Spring(force.name, np.stack([a, b], axis=1))
        elif isinstance(force, JointSpring) and force.joint.kind == "prismatic":
            robot, joint = moments.scene.robot, force.joint
            points, turns = moments.placed(child_link(robot, joint.name))
            way = moments.state[:, joint.q, None] * turned(turns, np.asarray(robot.joint_axis(joint.name)))
            yield Spring(force.name, np.stack([points - way, points], axis=1))


def rods_of(moments: PlacedScene) -> Iterator[Rod]:
    """The rods of constraints that keep two points at a distance."""
    for constraint in moments.scene.constraints:
        if isinstance(constraint, Distance):
            ends = [moments.side(constraint, first)[0] for first in (True, False)]
            yield Rod(constraint.name, np.stack(ends, axis=1))


def contact_points(moments: PlacedScene, disk: RollingDisk) -> Array:
    """Where a disk touches its plane (n, 3) m: p = c − r (n − (n·a) a)/s, as elements/rolling.py has it."""
    centre, turns = moments.placed(disk.frame)
    n, a, steepness = _disk_directions(disk, turns)
    up = (n - (a @ n)[:, None] * a) / steepness
    return np.asarray(centre - moments.number(disk, "radius") * up)


def _contact_force(moments: Moments, disk: RollingDisk) -> Array:
    """What the plane does to the disk (n, 3) N: along its normal n, forwards f = a × n / s, and sideways n × f."""
    n, a, steepness = _disk_directions(disk, moments.placed(disk.frame)[1])
    forward = np.cross(a, n) / steepness
    normal, along, sideways = np.moveaxis(moments.of(disk)[:, :, None], 1, 0)
    return np.asarray(normal * n + along * forward + sideways * np.cross(n, forward))


def _disk_directions(disk: RollingDisk, turns: Array) -> tuple[Array, Array, Array]:
    """The plane's normal (3,), the disk's axis (n, 3), and s = |a × n| (n, 1)."""
    n = np.array(disk.normal)
    a = turned(turns, np.array(disk.axis))
    return n, a, np.linalg.norm(np.cross(a, n), axis=1, keepdims=True)


def _loop_arrows(moments: Moments, loop: Loop) -> Iterator[Arrow]:
    """Forces on the body of the loop's first frame, and the moments of a hinge or a weld."""
    value, (a, turn_a), (b, turn_b) = moments.of(loop), moments.side(loop, True), moments.side(loop, False)
    body = _link(moments, loop.frame_a)
    if isinstance(loop, Distance):
        way = (a - b) / np.maximum(np.linalg.norm(a - b, axis=1, keepdims=True), 1e-12)
        yield Arrow(f"{loop.name} on {body}", "N", a, value * way)
        return
    if isinstance(loop, (Point, Hinge, Weld)):
        yield Arrow(f"{loop.name} on {body}", "N", a, value[:, :3])
    moment: Any = None
    if isinstance(loop, Hinge):
        axis = turned(_placed_turn(loop.at_a, turn_a), np.array(loop.axis))
        across = [turned(_placed_turn(loop.at_b, turn_b), np.array(n)) for n in perpendicular(loop.axis)]
        moment = sum(value[:, 3 + k, None] * np.cross(axis, n) for k, n in enumerate(across))
    elif isinstance(loop, Weld):
        moment = turned(_placed_turn(loop.at_b, turn_b), value[:, 3:])
    if moment is not None:
        yield Arrow(f"{loop.name} moment on {body}", "N m", a, np.asarray(moment), True)


def _link(moments: Moments, frame: str) -> str:
    """The link on which a frame is, which is what a force at the frame acts on."""
    robot, named = moments.run.robot, moments.run.scene.config.frames
    return named[frame][0] if frame in named else child_link(robot, frame) if frame in robot.urdf.joints else frame


def _placed_turn(at: tuple[float, ...] | None, turns: Array) -> Array:
    """Quaternions of a side that is turned in its frame by the rotation in `at` (origin 3, rotation 9)."""
    if at is None:
        return turns
    return multiplied(turns, quaternions(np.array(at[3:]).reshape(3, 3)))
