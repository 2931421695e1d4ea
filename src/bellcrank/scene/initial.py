"""The start of a scene: `initial` for the joints, and `base` for a free base.

initial: {shoulder: -90 deg, elbow: {guess: 45 deg}, velocity: {shoulder: 0.2}}. Joints without an entry start at 0 and
at rest. `motion: NAME` starts on a motion of the configuration, at time 0, and `run: FILE.npz` in the state of a saved
run (saved_state.py); entries of joints take precedence over both. A `guess` is the initial value of the search for a
start that satisfies the constraints; without constraints it is the start. `hold: motors`, or a list of joints, holds
the positions of joints without an entry too, at 0 or those of the motion or run. A floating, planar or spherical joint
has a mapping with keys of `base` (free_joint_start.py).

If the robot has a joint named `velocity`, `motion`, `run` or `hold`, a position under this key belongs to the joint; if
it has a joint named `time` or `clock`, this key always belongs to the joint.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.config.fields import Fields, parse_number
from bellcrank.elements.element import joint_named, joint_unit
from bellcrank.messages import format_value, unknown_name
from bellcrank.scene.free_joint_start import FreeJointStart, read_free_joint_start
from bellcrank.scene.saved_state import SavedState, SceneReader, read_clock, read_run_start

if TYPE_CHECKING:
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import Robot

Axes = list[tuple[slice, Array]]

LARGEST_CORRECTION = 0.1  # rad, or of the characteristic length, by default


@dataclass(frozen=True, kw_only=True)
class Initial:
    """The start that a scene prescribes.

    Attributes:
        position: Positions of joints by name, rad or m.
        velocity: Velocities of joints by name, rad/s or m/s.
        guesses: The joints whose position is only the initial value of the search for a consistent start.
        hold: Joints whose position is held although `position` has no value for them.
        motion: The name of a motion on which the other joints start, or None.
        free: The starts of joints with several degrees of freedom, including a free base, by name.
        saved: The state of a saved run in which the other joints start, or None.
        clock: The value of t for expressions, tables and motions at the start, s.
        largest_correction: By how much constraints may move a joint from where a saved run, a motion or a keyframe
            places it: rad, or in units of the mechanism's characteristic length.
    """

    position: Mapping[str, float] = field(default_factory=dict)
    velocity: Mapping[str, float] = field(default_factory=dict)
    guesses: tuple[str, ...] = ()
    hold: tuple[str, ...] = ()
    motion: str | None = None
    free: Mapping[str, FreeJointStart] = field(default_factory=dict)
    saved: SavedState | None = None
    clock: float = 0.0
    largest_correction: float = LARGEST_CORRECTION

    def posture(self, robot: Robot, motion: Motion | None = None) -> Array:
        """The given position (nq,); `motion` is the motion named by the field `motion`."""
        q = robot.neutral.copy()
        if self.saved is not None:
            self.saved.write_position(robot, q)
        if motion is not None:
            start = motion.at(np.clip(self.clock, motion.time[0], motion.time[-1]))[0]
            for j in robot.joints:
                if j.nv == 1:
                    q[j.q] = start[j.q]
        for name, value in self.position.items():
            q[robot.joint(name).q] = value
        for name, free in self.free.items():
            free.place(robot.joint(name), q)
        return q

    def rates(self, robot: Robot, q: Array, motion: Motion | None = None) -> Array:
        """The given velocity (…, nv), with the axes of free joints' bodies at the position q (…, nq)."""
        v = np.zeros(robot.nv)
        if self.saved is not None:
            self.saved.write_velocity(robot, v)
        if motion is not None:
            rate = motion.at(np.clip(self.clock, motion.time[0], motion.time[-1]))[1]
            for j in robot.joints:
                if j.nv == 1:
                    v[j.v] = rate[j.v]
        for name, value in self.velocity.items():
            v[robot.joint(name).v] = value
        v = np.broadcast_to(v, (*q.shape[:-1], robot.nv)).copy()
        for name, start in self.free.items():
            start.move(robot.joint(name), q, v)
        return v

    def held(self, robot: Robot) -> tuple[Mask, Mask]:
        """The degrees of freedom (nv) whose position, and whose velocity, the search for a consistent start keeps.

        They are those given as values, not as guesses, and those of `hold`; for free joints they refer to the axes
        returned by `axes`.
        """
        q, v = np.zeros(robot.nv, dtype=bool), np.zeros(robot.nv, dtype=bool)
        for name in (*self.hold, *self.position):
            q[robot.joint(name).v] = name not in self.guesses
        for name in self.velocity:
            v[robot.joint(name).v] = True
        for name, start in self.free.items():
            start.hold(robot.joint(name), q, v)
        return q, v

    def axes(self, robot: Robot, q: Array) -> tuple[Axes, Axes]:
        """(degrees of freedom, rotation body to parent) of free joints' vectors that are given in their parents' axes.

        Returns those of positions, and those of velocities.
        """
        pairs = [(start, robot.joint(name)) for name, start in self.free.items()]
        return (
            [entry for start, joint in pairs for entry in start.position_axes(joint, q)],
            [entry for start, joint in pairs for entry in start.velocity_axes(joint, q)],
        )


def read_initial(
    read: Fields, robot: Robot, motions: Mapping[str, Any], motors: Sequence[str], read_scene: SceneReader
) -> Initial:
    """Read the keys `initial` and `base` of a scene. Raises InputError naming file and key.

    `motors` are the joints with motors; `read_scene` reads the scene inside a saved run.
    """
    start = read.mapping("initial", {})
    position, guesses, free = dict[str, float](), list[str](), dict[str, FreeJointStart]()
    hold: tuple[str, ...] = ()
    motion: str | None = None
    saved: SavedState | None = None
    velocity: Mapping[str, float] = {}
    times = {"time", "clock", "largest_correction"}.difference(robot.all_joint_names)
    for key in start:
        given = start.raw(key)
        if key == "velocity" and isinstance(given, Mapping):
            velocity = _read_rates(start.mapping(key), robot)
        elif key == "motion" and isinstance(given, str) and not _is_position(given):
            motion = given
            if motion not in motions:
                raise start.error(key, unknown_name("motion", motion, motions))
        elif key == "run" and isinstance(given, str) and not _is_position(given):
            saved = read_run_start(start, robot, read_scene, "time" in times)
        elif key == "hold" and not _is_number(given):
            hold = _read_hold(start, robot, motors)
        elif key in times:
            continue
        elif (of_free := _read_free(start, key, robot)) is not None:
            free[key] = of_free
        else:
            joint = joint_named(start, key, key, robot)
            unit = joint_unit(joint, "position")
            if isinstance(given, Mapping):
                guess = start.mapping(key)
                position[key] = guess.number("guess", unit)
                guess.done()
                guesses.append(key)
            else:
                position[key] = start.number(key, unit)
    if saved is not None and motion is not None:
        raise start.error("run", "expected 'run' or 'motion', found both; each defines the start of all joints")
    if saved is None and "time" in start and "time" in times:
        raise start.error("time", "'time' is a time of a saved run; name the run as run: FILE.npz")
    clock = read_clock(start, saved) if "clock" in times else 0.0
    correction = LARGEST_CORRECTION
    if "largest_correction" in times:
        correction = start.number("largest_correction", "rad", LARGEST_CORRECTION, nonnegative=True)
    return Initial(
        position=position,
        velocity=velocity,
        guesses=tuple(guesses),
        hold=hold,
        motion=motion,
        free=free | _read_base(read, robot),
        saved=saved,
        clock=clock,
        largest_correction=correction,
    )


def _read_hold(start: Fields, robot: Robot, motors: Sequence[str]) -> tuple[str, ...]:
    given = start.raw("hold")
    if given == "motors":
        if not motors:
            raise start.error("hold", "no joint has a motor; name the joints with motors under the key 'actuated'")
        names = list(motors)
    elif isinstance(given, list) and all(isinstance(name, str) for name in given):
        names = given
    else:
        raise start.error("hold", f"expected motors or a list of joints, found {format_value(given)}")
    return tuple(joint_named(start, "hold", name, robot).name for name in names)


def _is_number(given: object) -> bool:
    """Whether a value is a position or a guess of one."""
    return isinstance(given, Mapping | float | int) or (isinstance(given, str) and _is_position(given))


def _read_rates(rates: Fields, robot: Robot) -> dict[str, float]:
    """Read the mapping `initial.velocity`. Raises InputError naming file and key."""
    for name in rates:
        if any(joint.name == name and joint.nv > 1 for joint in robot.joints):
            raise rates.error(
                name,
                "this joint has several degrees of freedom; write initial: "
                f"{{{name}: {{linear_velocity: …, angular_velocity: …}}}}, or base: {{…}} for a free base",
            )
    return {name: rates.number(name, joint_unit(joint_named(rates, name, name, robot), "velocity")) for name in rates}


def _read_free(start: Fields, key: str, robot: Robot) -> FreeJointStart | None:
    """Read the start of a joint with several degrees of freedom under a key of `initial`; None for any other key."""
    joint = next((j for j in robot.joints if j.name == key and j.nv > 1), None)
    if joint is None:
        return None
    if robot.floating_base and joint is robot.joints[0]:
        raise start.error(key, "this is the robot's free base; write its start under the scene's key 'base'")
    if not isinstance(start.raw(key), Mapping):
        pose = {"planar": "position: [x, y], angle: …", "spherical": "rpy: […]"}.get(
            joint.kind, "position: [x, y, z], rpy: […]"
        )
        raise start.error(
            key, f"joint '{key}' is {joint.kind}; expected a mapping {{{pose}}}, found {format_value(start.raw(key))}"
        )
    return read_free_joint_start(start.mapping(key), joint)


def _read_base(read: Fields, robot: Robot) -> dict[str, FreeJointStart]:
    if "base" not in read:
        read.known("base")
        return {}
    base = read.mapping("base")
    if not robot.floating_base:
        raise read.error("base", "the robot's base is fixed; write floating_base: true for a free base")
    return {robot.joints[0].name: read_free_joint_start(base, robot.joints[0], "world")}


def _is_position(text: str) -> bool:
    try:
        parse_number(text, "rad or m")
    except ValueError:
        return False
    return True
