"""How a scene starts: `initial` for the joints, `base` for a free base.

initial: {shoulder: -90 deg, elbow: {guess: 45 deg}, velocity: {shoulder: 0.2}}; joints that are not named start at 0
and at rest. `motion: NAME` starts on a motion of the configuration, at time 0, joints that are named besides keep what they are
given. `run: FILE.npz` starts where a saved run was (saved_state.py), likewise. The keys `velocity`, `motion` and `run`
stand for a joint of that name where their value is a position, `time` and `clock` wherever there is such a joint. A
`guess` is a plain value as long as nothing closes a loop. A floating or planar joint has a mapping, in the words of
`base` (free_joint_start.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.config.fields import Fields, parse_number
from bellcrank.elements.element import joint_named, joint_unit
from bellcrank.messages import format_value, unknown_name
from bellcrank.scene.free_joint_start import FreeJointStart, read_free_joint_start
from bellcrank.scene.saved_state import SavedState, SceneReader, read_clock, read_run_start

if TYPE_CHECKING:
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import Robot

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Axes = list[tuple[slice, Array]]


@dataclass(frozen=True, kw_only=True)
class Initial:
    """Positions (rad or m) and velocities of joints by name, those of them that are `guesses`, and the starts of joints
    with several degrees of freedom, a free base among them. `clock` is what t, tables and motions read at time 0, s.
    """

    position: Mapping[str, float] = field(default_factory=dict)
    velocity: Mapping[str, float] = field(default_factory=dict)
    guesses: tuple[str, ...] = ()
    motion: str | None = None
    free: Mapping[str, FreeJointStart] = field(default_factory=dict)
    saved: SavedState | None = None
    clock: float = 0.0

    def posture(self, robot: Robot, motion: Motion | None = None) -> Array:
        """The position (nq,) that is given; `motion` is the one that the field `motion` names."""
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
        """The velocity (nv,) that is given, a free joint's in the axes that its body has at the position q (nq,)."""
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
        for name, start in self.free.items():
            start.move(robot.joint(name), q, v)
        return v

    def held(self, robot: Robot) -> tuple[Mask, Mask]:
        """Which degrees of freedom (nv) keep their position, and which their velocity, on the way to closures: those
        that were written as plain values, of free joints along the axes of `axes`.
        """
        q, v = np.zeros(robot.nv, dtype=bool), np.zeros(robot.nv, dtype=bool)
        for name in self.position:
            q[robot.joint(name).v] = name not in self.guesses
        for name in self.velocity:
            v[robot.joint(name).v] = True
        for name, start in self.free.items():
            start.hold(robot.joint(name), q, v)
        return q, v

    def axes(self, robot: Robot, q: Array) -> tuple[Axes, Axes]:
        """(degrees of freedom, rotation body to parent) of what free joints hold in their parents' axes: positions, and
        velocities.
        """
        pairs = [(start, robot.joint(name)) for name, start in self.free.items()]
        return (
            [entry for start, joint in pairs for entry in start.position_axes(joint, q)],
            [entry for start, joint in pairs for entry in start.velocity_axes(joint, q)],
        )


def read_initial(read: Fields, robot: Robot, motions: Mapping[str, Any], read_scene: SceneReader) -> Initial:
    """The keys `initial` and `base` of a scene; InputError naming file and key.

    `read_scene` reads the scene inside a saved run.
    """
    start = read.mapping("initial", {})
    position, guesses, free = dict[str, float](), list[str](), dict[str, FreeJointStart]()
    motion: str | None = None
    saved: SavedState | None = None
    velocity: Mapping[str, float] = {}
    times = {"time", "clock"}.difference(robot.all_joint_names)
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
        raise start.error("run", "expected 'run' or 'motion', found both: each says where all joints start")
    if saved is None and "time" in start and "time" in times:
        raise start.error("time", "'time' says at which time of a saved run to start; name it as run: FILE.npz")
    clock = read_clock(start, saved) if "clock" in times else 0.0
    return Initial(
        position=position,
        velocity=velocity,
        guesses=tuple(guesses),
        motion=motion,
        free=free | _read_base(read, robot),
        saved=saved,
        clock=clock,
    )


def _read_rates(rates: Fields, robot: Robot) -> dict[str, float]:
    """The mapping `initial.velocity`."""
    for name in rates:
        if any(joint.name == name and joint.nv > 1 for joint in robot.joints):
            raise rates.error(
                name,
                "this joint has several degrees of freedom; write initial: "
                f"{{{name}: {{linear_velocity: …, angular_velocity: …}}}}, or base: {{…}} for a free base",
            )
    return {name: rates.number(name, joint_unit(joint_named(rates, name, name, robot), "velocity")) for name in rates}


def _read_free(start: Fields, key: str, robot: Robot) -> FreeJointStart | None:
    """The start of a floating or planar joint under a key of `initial`; None where no such joint has that name."""
    joint = next((j for j in robot.joints if j.name == key and j.nv > 1), None)
    if joint is None:
        return None
    if robot.floating_base and joint is robot.joints[0]:
        raise start.error(key, "this is the robot's free base; its start stands under the scene's key 'base'")
    if not isinstance(start.raw(key), Mapping):
        pose = "position: [x, y], angle: …" if joint.kind == "planar" else "position: [x, y, z], rpy: […]"
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
        raise read.error("base", "the robot's base is fixed; write floating_base: true to set it free")
    return {robot.joints[0].name: read_free_joint_start(base, robot.joints[0], "world")}


def _is_position(text: str) -> bool:
    try:
        parse_number(text, "rad or m")
    except ValueError:
        return False
    return True
