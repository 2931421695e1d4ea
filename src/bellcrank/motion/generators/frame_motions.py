"""Motions that draw a frame of the robot along a circle or a straight line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bellcrank import arguments
from bellcrank.motion.generators.path import (
    AXES,
    Circle,
    Line,
    Orientation,
    PathOptions,
    Posture,
    Vector,
)
from bellcrank.motion.kinematics.path_inverse_kinematics import follow_path, start_posture
from bellcrank.motion.motion import Motion

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot


@arguments.named
def circle(
    robot: Robot,
    frame: str,
    center: Vector,
    radius: float,
    duration: float | None = None,
    start: Posture | None = None,
    samples: int = 1001,
    profile: str = "constant",
    normal: Vector = (0.0, 0.0, 1.0),
    turns: float = 1.0,
    orientation: Orientation | None = None,
    speed: float | None = None,
    acceleration: float | None = None,
    jerk: float | None = None,
    coordinates: Sequence[str] = AXES,
    name: str = "circle",
) -> Motion:
    """Move a frame along a circle.

    The circle starts at center + radius e1, where e1 is the world's x direction made perpendicular to the normal (y
    where the normal is along x), and runs counter-clockwise about the normal. The joints follow the branch of the start
    posture; where there are more joints than the path prescribes coordinates, the posture is the nearest to `start`.

    Args:
        robot: The robot.
        frame: Name of the frame that moves.
        center: Center (3,) in the world, m.
        radius: Radius, m.
        duration: Time of the whole motion, s; left out, it is the shortest within the limits.
        start: Start posture: joint positions by name, or (nq,), rad or m.
        samples: Least number of rows; the profile "constant" gives rows at equal angles.
        profile: Timing along the path: "constant", "trapezoid", "quintic" or "s_curve".
        normal: Normal (3,) of the circle's plane, in the world.
        turns: Number of turns; negative: clockwise.
        orientation: Orientation of the frame: None (free), "hold" (as in the start posture), roll, pitch and yaw (3,)
            in rad, or a rotation matrix (3, 3), frame to world.
        speed: Limit of the speed along the path, m/s.
        acceleration: Limit of the acceleration along the path, m/s².
        jerk: Limit of the jerk along the path, m/s³.
        coordinates: Coordinates of the frame's position (world) that the path prescribes; the others are free.
        name: Name of the motion.

    Returns:
        The motion; its velocities and accelerations are exact derivatives along the path.

    Raises:
        InputError: An argument is wrong, or the frame cannot follow so many coordinates.
        UnreachableError: The path leaves the robot's reach or meets a singular posture; the message says when
            and where.

    Example:
        >>> import bellcrank as bc
        >>> arm = bc.load_robot("planar_2r")
        >>> motion = bc.circle(arm, "tip", (1.2, 0.0, 0.0), 0.3, duration=2.0, start={"elbow": 1.0})
        >>> motion.duration, motion.position.shape
        (2.0, (1001, 2))
    """
    arguments.robot(robot)
    options = PathOptions(
        name=name,
        frame=frame,
        profile=profile,
        duration=duration,
        speed=speed,
        acceleration=acceleration,
        jerk=jerk,
        orientation=orientation,
        samples=samples,
        coordinates=coordinates,
    )
    path = Circle(center, radius, normal, turns).path(options)
    return follow_path(robot, path, start_posture(robot, start))


@arguments.named
def line(
    robot: Robot,
    frame: str,
    end: Vector,
    duration: float | None = None,
    start: Posture | None = None,
    samples: int = 1001,
    profile: str = "quintic",
    begin: Vector | None = None,
    orientation: Orientation | None = None,
    speed: float | None = None,
    acceleration: float | None = None,
    jerk: float | None = None,
    coordinates: Sequence[str] = AXES,
    name: str = "line",
) -> Motion:
    """Move a frame along a straight line.

    Args:
        robot: The robot.
        frame: Name of the frame that moves.
        end: End (3,) of the line in the world, m.
        duration: Time of the whole motion, s; left out, it is the shortest within the limits.
        start: Start posture, as in `circle`.
        samples: Least number of rows.
        profile: Timing along the path, as in `circle`.
        begin: Begin (3,) of the line in the world, m; left out, the frame's position in the start posture.
        orientation: Orientation of the frame, as in `circle`.
        speed: Limit of the speed along the path, m/s.
        acceleration: Limit of the acceleration along the path, m/s².
        jerk: Limit of the jerk along the path, m/s³.
        coordinates: Coordinates of the frame's position (world) that the path prescribes; the others are free.
        name: Name of the motion.

    Returns:
        The motion; its velocities and accelerations are exact derivatives along the path.

    Raises:
        InputError: An argument is wrong, or the frame cannot follow so many coordinates.
        UnreachableError: The path leaves the robot's reach or meets a singular posture; the message says when
            and where.

    Example:
        >>> import bellcrank as bc
        >>> arm = bc.load_robot("planar_2r")
        >>> motion = bc.line(arm, "tip", (1.0, 1.2, 0.0), duration=1.0, start={"elbow": 1.0})
        >>> arm.frame_pose("tip", motion.position[-1])[0].round(9)
        array([1. , 1.2, 0. ])
    """
    arguments.robot(robot)
    posture = start_posture(robot, start)
    options = PathOptions(
        name=name,
        frame=frame,
        profile=profile,
        duration=duration,
        speed=speed,
        acceleration=acceleration,
        jerk=jerk,
        orientation=orientation,
        samples=samples,
        coordinates=coordinates,
    )
    here = robot.frame_pose(arguments.text("frame", frame, "the name of a frame"), posture)[0]
    return follow_path(robot, Line(end, begin).path(options, here), posture)
