"""How a scene starts: `initial` for the joints, `base` for a free base.

initial: {shoulder: -90 deg, elbow: {guess: 45 deg}, velocity: {shoulder: 0.2}}; joints that are not named start at 0
and at rest. `motion: NAME` starts on a motion of the card, at time 0, joints that are named besides keep what they are
given. The keys `velocity` and `motion` stand for a joint of that name where their value is a position. A `guess` is a
plain value as long as nothing closes a loop.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.card.fields import Fields, parse_number
from bellcrank.errors import among
from bellcrank.scene.part import joint_named, joint_unit

if TYPE_CHECKING:
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import Robot

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class BaseStart:
    """A free base: position (3) m and quaternion x y z w (4, unit) in the world, and its velocity.

    linear_velocity (3) m/s of the base's origin and angular_velocity (3) rad/s in the axes of `expressed_in`, "world"
    or "body".
    """

    position: tuple[float, ...] = (0.0, 0.0, 0.0)
    quaternion_xyzw: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0)
    linear_velocity: tuple[float, ...] = (0.0, 0.0, 0.0)
    angular_velocity: tuple[float, ...] = (0.0, 0.0, 0.0)
    expressed_in: str = "world"
    given: tuple[str, ...] = ()  # the keys that were written


@dataclass(frozen=True)
class Initial:
    """Positions (rad or m) and velocities of joints by name, those of them that are `guesses`, and a free base."""

    position: Mapping[str, float] = field(default_factory=dict)
    velocity: Mapping[str, float] = field(default_factory=dict)
    guesses: tuple[str, ...] = ()
    motion: str | None = None
    base: BaseStart | None = None

    def state(self, robot: Robot, motion: Motion | None = None) -> tuple[Array, Array]:
        """Position (nq,) and velocity (nv,) at the start, a free base's velocity in its own frame.

        `motion` is the one that `motion` names.
        """
        q, v = robot.neutral.copy(), np.zeros(robot.nv)
        if motion is not None:
            start, rate, _ = motion.at(np.clip(0.0, motion.time[0], motion.time[-1]))
            for j in robot.joints:
                if j.nv == 1:
                    q[j.q], v[j.v] = start[j.q], rate[j.v]
        for name, value in self.position.items():
            q[robot.joint(name).q] = value
        for name, value in self.velocity.items():
            v[robot.joint(name).v] = value
        if self.base is not None:
            linear, angular = np.array(self.base.linear_velocity), np.array(self.base.angular_velocity)
            if self.base.expressed_in == "world":
                turn = _matrix(self.base.quaternion_xyzw)
                linear, angular = turn.T @ linear, turn.T @ angular
            q[:3], q[3:7] = self.base.position, self.base.quaternion_xyzw
            v[:3], v[3:6] = linear, angular
        return q, v

    def held(self, robot: Robot) -> tuple[Mask, Mask]:
        """Which degrees of freedom (nv) keep their position, and which their velocity, on the way to closures.

        Those that were written as plain values; a free base's by the keys that were written.
        """
        q, v = np.zeros(robot.nv, dtype=bool), np.zeros(robot.nv, dtype=bool)
        for name in self.position:
            q[robot.joint(name).v] = name not in self.guesses
        for name in self.velocity:
            v[robot.joint(name).v] = True
        if self.base is not None:
            given = self.base.given
            q[:3], q[3:6] = "position" in given, "rpy" in given or "quaternion_xyzw" in given
            v[:3], v[3:6] = "linear_velocity" in given, "angular_velocity" in given
        return q, v


def read_initial(read: Fields, robot: Robot, motions: Mapping[str, Any]) -> Initial:
    """The keys `initial` and `base` of a scene; InputError naming file and key."""
    start = read.mapping("initial", {})
    position, guesses = {}, []
    motion: str | None = None
    velocity: Mapping[str, float] = {}
    for key in start:
        given = start.raw(key)
        if key == "velocity" and isinstance(given, Mapping):
            rates = start.mapping(key)
            velocity = {
                name: rates.number(name, joint_unit(joint_named(rates, name, name, robot), "velocity"))
                for name in rates
            }
        elif key == "motion" and isinstance(given, str) and not _is_position(given):
            motion = given
            if motion not in motions:
                raise start.error(key, among("motion", motion, motions))
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
    return Initial(position, velocity, tuple(guesses), motion, _read_base(read, robot))


def _read_base(read: Fields, robot: Robot) -> BaseStart | None:
    if "base" not in read:
        read.known("base")
        return None
    base = read.mapping("base")
    if not robot.floating_base:
        raise read.error("base", "the robot's base is fixed; write floating_base: true to set it free")
    if "rpy" in base and "quaternion_xyzw" in base:
        raise base.error("rpy", "expected 'rpy' or 'quaternion_xyzw', found both")
    none = (0.0, 0.0, 0.0)
    quaternion = np.array(base.vector("quaternion_xyzw", 4, "", (0.0, 0.0, 0.0, 1.0)))
    length = float(np.linalg.norm(quaternion))
    if not 0.999 <= length <= 1.001:
        raise base.error("quaternion_xyzw", f"expected a quaternion x y z w of length 1, found length {length:.6g}")
    quaternion /= length
    if "rpy" in base:
        quaternion = _quaternion(base.vector("rpy", 3, "rad"))
    base.known("rpy")
    start = BaseStart(
        base.vector("position", 3, "m", none),
        tuple(quaternion.tolist()),
        base.vector("linear_velocity", 3, "m/s", none),
        base.vector("angular_velocity", 3, "rad/s", none),
        base.choice("expressed_in", ("world", "body"), "world"),
        tuple(base.keys()),
    )
    base.done()
    return start


def _is_position(text: str) -> bool:
    try:
        parse_number(text, "rad or m")
    except ValueError:
        return False
    return True


def _quaternion(rpy: tuple[float, ...]) -> Array:
    """The quaternion x y z w of roll, pitch, yaw (rad) about the fixed x, y, z axes in that order."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(np.array(rpy) / 2.0), np.sin(np.array(rpy) / 2.0)
    return np.array(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ]
    )


def _matrix(quaternion: tuple[float, ...]) -> Array:
    """The rotation matrix (3, 3) of a unit quaternion x y z w."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
