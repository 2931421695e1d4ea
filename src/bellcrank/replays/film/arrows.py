"""Forces and torques as arrows: of constraints, contacts, motors and wrenches; springs and rods as lines.

Lengths are linear up to the usual magnitude and logarithmic beyond: an impact lasts for a few steps, with forces a
hundred times larger than all others; on a linear scale nothing else would be visible.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.dynamics.equations.system import system_of
from bellcrank.elements import frame_forces
from bellcrank.elements.constraint import Constraint
from bellcrank.elements.element import Element
from bellcrank.elements.joint_constraints import PrescribedMotion
from bellcrank.elements.joint_forces import JointSpring
from bellcrank.elements.loop_constraints import (
    WORLD,
    Distance,
    Hinge,
    Loop,
    Planar,
    Point,
    Prismatic,
    Universal,
    Weld,
    perpendicular,
)
from bellcrank.elements.rolling_constraint import RollingDisk
from bellcrank.elements.signals import values_at
from bellcrank.motion.kinematics.rotations import from_matrices, multiply, rotate
from bellcrank.replays.film.film import Arrow, Film, FilmSpring, Rod
from bellcrank.replays.film.film_samples import FramePose

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot, RobotJoint
    from bellcrank.scene.scene import Scene
    from bellcrank.simulation.trajectory.trajectory import Trajectory


LONGEST = 0.45  # arrow, as a share of half the height of the view
USUAL = 95.0  # percentile of the magnitudes up to which the scale is linear
OUTSTANDING = 3.0  # ratio of peak to usual magnitude below which the scale is linear throughout
LINEAR = 0.7  # share of the longest arrow for the linear part, if there is a logarithmic one
ROUNDING = 1e-9  # of the peak: smaller magnitudes are rounding errors


@dataclass(frozen=True, kw_only=True)
class ArrowScale:
    """The scale of the arrows (by number) of one unit.

    An arrow of the `usual` magnitude is `length` (m) long; each factor of ten above it adds `decade` (m). `peak` is the
    largest magnitude.
    """

    unit: str
    arrows: tuple[int, ...]
    usual: float
    length: float
    decade: float
    peak: float

    def lengths(self, magnitudes: Array) -> Array:
        """The lengths (n,) m of arrows of magnitudes (n,), as the page draws them."""
        above = np.log10(np.maximum(magnitudes / self.usual, 1.0))
        return np.asarray(self.length * np.minimum(magnitudes / self.usual, 1.0) + self.decade * above)


def arrow_scales(film: Film) -> list[ArrowScale]:
    """The scales of a film's arrows, one for each unit."""
    camera = film.camera
    distance = float(np.linalg.norm(np.subtract(camera.position, camera.target)))
    return scales_up_to(film.arrows, LONGEST * distance * float(np.tan(np.deg2rad(20.0))))


def scales_up_to(arrows: Sequence[Arrow], longest: float) -> list[ArrowScale]:
    """The scales of arrows, one for each unit, of which the longest arrow has a length (m)."""
    scales = []
    for unit in dict.fromkeys(arrow.unit for arrow in arrows):
        numbers = tuple(k for k, arrow in enumerate(arrows) if arrow.unit == unit)
        sizes = np.concatenate([_magnitudes(arrows[k].vectors) for k in numbers])
        scales.append(_scale(unit, numbers, sizes, longest))
    return scales


def _magnitudes(vectors: Array) -> Array:
    with np.errstate(over="ignore", invalid="ignore"):
        sizes = np.linalg.norm(vectors, axis=1)
    return np.asarray(sizes[np.isfinite(sizes)])


def _scale(unit: str, arrows: tuple[int, ...], sizes: Array, longest: float) -> ArrowScale:
    usual, length, decade, peak = 1.0, longest, 0.0, float(sizes.max(initial=0.0))
    if peak > 0.0:
        usual = float(np.percentile(sizes[sizes > ROUNDING * peak], USUAL))
        if peak <= OUTSTANDING * usual:
            usual = peak
        else:
            length, decade = LINEAR * longest, (1.0 - LINEAR) * longest / float(np.log10(peak / usual))
    return ArrowScale(unit=unit, arrows=arrows, usual=usual, length=length, decade=decade, peak=peak)


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneFrames:
    """A scene at n times: parameter values, states (n, …) that begin with q, and the poses of the robot's frames."""

    scene: Scene
    parameters: Array
    state: Array
    frame_pose: FramePose

    def number(self, element: Element, field: str) -> float:
        """A number of a force or constraint, with the value of the parameter that sets it, if any."""
        target = f"{element.owner}.{element.name}.{field}"
        for k, parameter in enumerate(self.scene.parameters.values()):
            if target in parameter.sets:
                return float(self.parameters[k])
        return element.number(field)

    def vector(self, element: Element, field: str) -> Array:
        """A vector (3,) of a force or constraint."""
        return np.array([self.number(element, f"{field}.{c}") for c in "xyz"])

    def loop_side(self, loop: Loop, first: bool) -> tuple[Array, Array]:
        """Points (n, 3) and quaternions (n, 4) of the first or second frame of a loop constraint."""
        name, at = (loop.frame_a, loop.at_a) if first else (loop.frame_b, loop.at_b)
        if name == WORLD and not first:
            points = np.tile(self.vector(loop, "point"), (len(self.state), 1))
            quaternions = np.tile([0.0, 0.0, 0.0, 1.0], (len(self.state), 1))
        else:
            points, quaternions = self.frame_pose(name)
        return (points, quaternions) if at is None else (points + rotate(quaternions, np.array(at[:3])), quaternions)


@dataclass(frozen=True, eq=False, kw_only=True)
class RunFrames(SceneFrames):
    """The scene of a run at times (n,) s, with full states (n, size)."""

    run: Trajectory
    time: Array

    @cached_property
    def _arguments(self) -> tuple[Array, ...]:
        return self.time[:, None], self.state, values_at(self.run.signals, self.time), self.run.parameters

    @cached_property
    def multipliers(self) -> Array:
        """Multipliers (n, rows) of all constraints."""
        return np.asarray(system_of(self.run.scene).constraint(*self._arguments)[0])

    @cached_property
    def actuator_torque(self) -> Array:
        """Torques of motors and controllers (n, nv), N m or N."""
        return np.asarray(system_of(self.run.scene).observation(*self._arguments)[2])

    def multipliers_of(self, constraint: Constraint) -> Array:
        """Multipliers (n, k) of a constraint, one for each of its labels; 0 for a redundant row."""
        labels = constraint.labels(self.run.robot)
        full = np.zeros((len(self.time), len(labels)))
        for row, (owner, label) in enumerate(system_of(self.run.scene).multiplier_names):
            if owner == constraint.name and label in labels:
                full[:, labels.index(label)] = self.multipliers[:, row]
        return full


def element_frames(scene: Scene) -> tuple[str, ...]:
    """The frames whose poses the arrows, springs and rods of a scene need."""
    elements: tuple[Element, ...] = (*scene.constraints, *scene.forces)
    return tuple(dict.fromkeys(name for element in elements for name in element.frames))


def child_link(robot: Robot, joint: str) -> str:
    """The child link of a joint, whose frame is the joint's frame."""
    return robot.urdf.joints[joint].child


def run_arrows(frames: RunFrames) -> Iterator[Arrow]:
    """Arrows of a run's forces and torques.

    These are the forces of constraints on the body of their first frame, contact forces, torques of motors about their
    joints' axes, and wrenches.
    """
    scene = frames.run.scene
    for constraint in scene.constraints:
        if isinstance(constraint, PrescribedMotion):
            torque = frames.multipliers_of(constraint)[:, 0]
            yield motor_arrow(scene.robot, constraint.joint, torque, frames.frame_pose, constraint.name)
        elif isinstance(constraint, RollingDisk):
            yield Arrow(
                name=f"{constraint.name} on {_link(frames, constraint.frame)}",
                unit="N",
                points=contact_points(frames, constraint),
                vectors=_contact_force(frames, constraint),
            )
        elif isinstance(constraint, Loop):
            yield from _loop_arrows(frames, constraint)
    for joint in scene.robot.joints:
        if joint.nv == 1 and np.any(frames.run.actuator_torque[:, joint.v]):
            yield motor_arrow(scene.robot, joint, frames.actuator_torque[:, joint.v], frames.frame_pose)
    for force in scene.forces:
        if isinstance(force, frame_forces.Wrench):
            yield from _wrench_arrows(frames, force)


def motor_arrow(
    robot: Robot, joint: RobotJoint, torque: Array, frame_pose: FramePose, name: str | None = None
) -> Arrow:
    """A motor's torque (n,) N m about its joint's axis on the child link; for a prismatic joint a force (n,) N."""
    points, quaternions = frame_pose(child_link(robot, joint.name))
    vectors = torque[:, None] * rotate(quaternions, np.asarray(robot.joint_axis(joint.name)))
    linear = joint.kind == "prismatic"
    unit = "N" if linear else "N m"
    return Arrow(name=name or f"{joint.name} motor", unit=unit, points=points, vectors=vectors, is_torque=not linear)


def scene_springs(frames: SceneFrames) -> Iterator[FilmSpring]:
    """Springs between frames, and those of prismatic joints, from the joint's zero position to its position."""
    for force in frames.scene.forces:
        if isinstance(force, frame_forces.Spring):
            a = frames.frame_pose(force.frame_a)[0]
            fixed = force.frame_b == WORLD
            b = np.tile(frames.vector(force, "point"), (len(a), 1)) if fixed else frames.frame_pose(force.frame_b)[0]
            yield FilmSpring(force.name, np.stack([a, b], axis=1))
        elif isinstance(force, JointSpring) and force.joint.kind == "prismatic":
            robot, joint = frames.scene.robot, force.joint
            points, quaternions = frames.frame_pose(child_link(robot, joint.name))
            travel = frames.state[:, joint.q, None] * rotate(quaternions, np.asarray(robot.joint_axis(joint.name)))
            yield FilmSpring(force.name, np.stack([points - travel, points], axis=1))


def scene_rods(frames: SceneFrames) -> Iterator[Rod]:
    """The rods of constraints that keep two points at a distance."""
    for constraint in frames.scene.constraints:
        if isinstance(constraint, Distance):
            ends = [frames.loop_side(constraint, first)[0] for first in (True, False)]
            yield Rod(constraint.name, np.stack(ends, axis=1))


def contact_points(frames: SceneFrames, disk: RollingDisk) -> Array:
    """Contact points (n, 3) m of a disk with its plane: p = c − r (n − (n·a) a)/s, as in
    elements/rolling_constraint.py.
    """
    centre, quaternions = frames.frame_pose(disk.frame)
    n, a, steepness = _disk_directions(disk, quaternions)
    up = (n - (a @ n)[:, None] * a) / steepness
    return np.asarray(centre - frames.number(disk, "radius") * up)


def _contact_force(frames: RunFrames, disk: RollingDisk) -> Array:
    """The force of the plane on a disk (n, 3) N: along the normal n, along f = a × n / s, and along n × f."""
    n, a, steepness = _disk_directions(disk, frames.frame_pose(disk.frame)[1])
    forward = np.cross(a, n) / steepness
    normal, along, sideways = np.moveaxis(frames.multipliers_of(disk)[:, :, None], 1, 0)
    return np.asarray(normal * n + along * forward + sideways * np.cross(n, forward))


def _disk_directions(disk: RollingDisk, quaternions: Array) -> tuple[Array, Array, Array]:
    """The plane's normal (3,), the disk's axis (n, 3), and s = |a × n| (n, 1)."""
    n = np.array(disk.normal)
    a = rotate(quaternions, np.array(disk.axis))
    return n, a, np.linalg.norm(np.cross(a, n), axis=1, keepdims=True)


def _wrench_arrows(frames: RunFrames, force: frame_forces.Wrench) -> Iterator[Arrow]:
    points, quaternions = frames.frame_pose(force.frame)
    for field, unit in (("force", "N"), ("torque", "N m")):
        value = np.tile(frames.vector(force, field), (len(points), 1))
        if np.any(value):
            value = value if force.expressed_in == WORLD else rotate(quaternions, value)
            name = f"{force.name} {field}"
            yield Arrow(name=name, unit=unit, points=points, vectors=value, is_torque=field == "torque")


def _loop_arrows(frames: RunFrames, loop: Loop) -> Iterator[Arrow]:
    """Forces on the body of the loop's first frame, and the moments of a hinge or a weld."""
    value = frames.multipliers_of(loop)
    (a, quaternions_a), (b, quaternions_b) = frames.loop_side(loop, True), frames.loop_side(loop, False)
    body = _link(frames, loop.frame_a)
    if isinstance(loop, Distance):
        direction = (a - b) / np.maximum(np.linalg.norm(a - b, axis=1, keepdims=True), 1e-12)
        yield Arrow(name=f"{loop.name} on {body}", unit="N", points=a, vectors=value * direction)
        return
    own, other = _side_orientation(loop.at_a, quaternions_a), _side_orientation(loop.at_b, quaternions_b)
    force: Any = value[:, :3]
    moment: Any = None
    if isinstance(loop, Hinge):
        axis, across = rotate(own, np.array(loop.axis)), [rotate(other, np.array(n)) for n in perpendicular(loop.axis)]
        moment = sum(value[:, k - 2, None] * np.cross(axis, n) for k, n in enumerate(across))
        if isinstance(loop, Planar):
            force = value[:, :1] * rotate(other, np.array(loop.axis))
    elif isinstance(loop, Weld):
        moment = rotate(other, value[:, -3:])
        if isinstance(loop, Prismatic):
            across = [rotate(other, np.array(n)) for n in perpendicular(loop.axis)]
            force = sum(value[:, k, None] * n for k, n in enumerate(across))
    elif isinstance(loop, Universal):
        moment = value[:, 3:] * np.cross(rotate(own, np.array(loop.axis)), rotate(other, np.array(loop.axis_2)))
    if isinstance(loop, (Point, Hinge, Weld, Universal)):
        yield Arrow(name=f"{loop.name} on {body}", unit="N", points=a, vectors=np.asarray(force))
    if moment is not None:
        name = f"{loop.name} moment on {body}"
        yield Arrow(name=name, unit="N m", points=a, vectors=np.asarray(moment), is_torque=True)


def _link(frames: RunFrames, frame: str) -> str:
    """The link to which a frame is fixed."""
    robot, named = frames.run.robot, frames.run.scene.config.frames
    return named[frame][0] if frame in named else child_link(robot, frame) if frame in robot.urdf.joints else frame


def _side_orientation(at: tuple[float, ...] | None, quaternions: Array) -> Array:
    """Quaternions (n, 4) of a side of a loop, whose placement in its frame is `at` (origin 3, rotation 9)."""
    if at is None:
        return quaternions
    return multiply(quaternions, from_matrices(np.array(at[3:]).reshape(3, 3)))
