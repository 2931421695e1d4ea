"""The limits of a motion: of joints, of their motors and gears, and of a tool."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot

Limit = Literal["urdf", "none"] | Mapping[str, float]
TOOL_UNITS = {
    "tool_speed": "m/s",
    "tool_acceleration": "m/s²",
    "tool_angular_speed": "rad/s",
    "tool_angular_acceleration": "rad/s²",
}
Key = Literal["speed", "acceleration", "jerk", "torque"]
UNITS = {
    "speed": "rad/s or m/s",
    "acceleration": "rad/s² or m/s²",
    "jerk": "rad/s³ or m/s³",
    "torque": "N m or N",
}


@dataclass(frozen=True, kw_only=True)
class MotionLimits:
    """What a motion may reach.

    A mapping limits the joints that it names, and no others; "urdf" takes the limits of the URDF.

    Args:
        speed: Largest speed of joints, rad/s or m/s.
        acceleration: Largest acceleration of joints, rad/s² or m/s².
        jerk: Largest jerk of joints, rad/s³ or m/s³.
        torque: Largest torque or force of joints, without what the rotor of an actuator takes, N m or N.
        actuators: Whether the limits of the actuators count: torque over speed, largest speed, and the gear's.
        tool: The frame of which `tool_speed` and the others are limits; "" for none.
        tool_speed: Largest speed of the frame's origin, m/s.
        tool_acceleration: Largest acceleration of the frame's origin, m/s².
        tool_angular_speed: Largest angular speed of the frame, rad/s.
        tool_angular_acceleration: Largest angular acceleration of the frame, rad/s².

    Raises:
        InputError: A limit is not a positive number, or there is a frame without a limit, or the reverse.

    Example:
        >>> import bellcrank as bc
        >>> bc.MotionLimits(speed={"elbow": 2.0}, torque="none").speed
        {'elbow': 2.0}
    """

    speed: Limit = "urdf"
    acceleration: Limit = "none"
    jerk: Limit = "none"
    torque: Limit = "urdf"
    actuators: bool = True
    tool: str = ""
    tool_speed: float | None = None
    tool_acceleration: float | None = None
    tool_angular_speed: float | None = None
    tool_angular_acceleration: float | None = None

    def __post_init__(self) -> None:
        for key, unit in UNITS.items():
            given = getattr(self, key)
            if isinstance(given, str):
                options = ("none",) if key in ("acceleration", "jerk") else ("urdf", "none")
                arguments.one_of(key, given, options, where="limits")
                continue
            checked = arguments.mapping(key, given, "'urdf', 'none' or a mapping of joints to limits", where="limits")
            numbers = {
                name: arguments.number(f"{key} of '{name}'", value, unit, above=0.0, most=arguments.LARGEST)
                for name, value in checked.items()
            }
            object.__setattr__(self, key, numbers)
        arguments.flag("actuators", self.actuators, where="limits")
        arguments.text("tool", self.tool, "the name of a frame", empty=True, where="limits")
        for key, unit in TOOL_UNITS.items():
            if (value := getattr(self, key)) is not None:
                checked_value = arguments.number(key, value, unit, above=0.0, most=arguments.LARGEST, where="limits")
                object.__setattr__(self, key, checked_value)
        if (self.tool == "") != all(getattr(self, key) is None for key in TOOL_UNITS):
            arguments.refuse("tool", "a frame together with a limit of it, such as tool_speed", self.tool, "limits")

    def of_joints(self, key: Key, robot: Robot) -> Array:
        """The limits of all joints of a robot.

        Args:
            key: "speed", "acceleration", "jerk" or "torque".
            robot: The robot.

        Returns:
            Limits (nv,), infinite where there is none.

        Raises:
            InputError: An argument is wrong, or the robot has no joint of a name.

        Example:
            >>> import bellcrank as bc
            >>> bc.MotionLimits(speed={"elbow": 2.0}).of_joints("speed", bc.load_robot("planar_2r"))
            array([inf,  2.])
        """
        arguments.one_of("key", key, tuple(UNITS))
        arguments.robot(robot)
        given = getattr(self, key)
        limits = np.full(robot.nv, np.inf)
        if given == "urdf":
            found = np.asarray(robot.velocity_limit if key == "speed" else robot.effort_limit, dtype=np.float64)
            return np.where(found > 0.0, found, np.inf)
        if given != "none":
            for name, value in given.items():
                limits[robot.one_degree_joint(name, f"limits: {key}").v] = value
        return limits
