"""Loading a robot from a robot file, or by the name of a bundled or example robot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from bellcrank import arguments
from bellcrank.files.access import FileAccess, Trust
from bellcrank.robot.catalog import find_urdf
from bellcrank.robot.formats.file_readers import read_robot_file
from bellcrank.robot.formats.robot_file import RobotFile
from bellcrank.robot.model.friction import FRICTION_WIDTH, Friction, checked_friction
from bellcrank.robot.model.payload import FrameTable, LoadOptions, Payload, checked_frames
from bellcrank.robot.model.robot_cache import robot_data
from bellcrank.robot.robot import Robot

XACRO = "a mapping of arguments to values"
ROTORS = "a mapping of joints to numbers (kg m²)"
STANDARD_GRAVITY = (0.0, 0.0, -9.81)  # m/s²


@arguments.named
def load_robot(
    path: str | Path,
    gravity: Sequence[float] | None = None,
    floating_base: bool = False,
    friction: Friction = "urdf",
    *,
    payloads: Iterable[Payload] = (),
    rotor_inertia: Mapping[str, float] | None = None,
    frames: FrameTable | None = None,
    clean: bool = True,
    friction_width: float = FRICTION_WIDTH,
    xacro_args: Mapping[str, str] | None = None,
    trust: Trust = (),
) -> Robot:
    """Load a robot from a robot file: URDF, xacro, MJCF or SDFormat.

    Closed loops, springs and motors of the file are in the attribute `file` of the robot; `load_scene` makes
    constraints and forces of them.

    Args:
        path: Path of a robot file, name of a bundled robot ("planar_2r", …), or a name of the package
            example-robot-data ("ur5", "talos", …).
        gravity: Acceleration of gravity (3,) in the world, m/s²; another direction stands for a robot on a wall or
            ceiling. By default that of the file, or 0, 0, −9.81.
        floating_base: Whether the base is free to move.
        friction: "urdf" (as the file gives it), "none", or {joint: (viscous in N m s/rad or N s/m, Coulomb in N m or
            N)}.
        payloads: Rigid bodies fixed to frames.
        rotor_inertia: Rotor inertia by joint, reflected to the joint, kg m² (kg for prismatic joints); it replaces
            that of the file.
        frames: Frames to add, by name: (link, xyz in m, rpy in rad).
        clean: Whether to make rotations that were written with few digits, such as 1.5708, exact.
        friction_width: Speed (rad/s or m/s) over which Coulomb friction is smoothed.
        xacro_args: Values of the arguments (<xacro:arg>) of a xacro file, by name.
        trust: Folders outside the URDF's surroundings from which mesh files may be read.

    Returns:
        The robot; what was read is kept on disk for the next time.

    Raises:
        InputError: The file or an argument is wrong; the message is one sentence that names it.

    Example:
        >>> import bellcrank as bc
        >>> bc.load_robot("planar_2r", friction="none")
        Robot('planar_2r', 2 joints, nq=2, nv=2, planar_2r.urdf)
    """
    arguments.path("path", path, "the path of a robot file, or the name of a robot")
    source = find_urdf(path)
    access = FileAccess.of(source.resolve(), trust)
    given = None if xacro_args is None else arguments.mapping("xacro_args", xacro_args, XACRO)
    file = read_robot_file(source, access, None if given is None else {str(k): xacro_text(v) for k, v in given.items()})
    rotors = {} if rotor_inertia is None else arguments.mapping("rotor_inertia", rotor_inertia, ROTORS)
    options = load_options(
        gravity=(file.gravity or STANDARD_GRAVITY) if gravity is None else gravity,
        floating_base=floating_base,
        friction=friction,
        payloads=payloads,
        rotor_inertia={**file.rotor_inertia, **rotors},
        frames=frames,
        clean=clean,
        friction_width=friction_width,
    )
    return robot_of(file, options, access)


def xacro_text(value: object) -> str:
    """The value of a xacro argument as xacro reads it, such as true for True."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def load_options(
    *,
    gravity: Sequence[float],
    floating_base: bool,
    friction: Friction,
    payloads: Iterable[Payload],
    rotor_inertia: Mapping[str, float],
    frames: FrameTable | None,
    clean: bool = True,
    friction_width: float = FRICTION_WIDTH,
    without_friction: frozenset[str] = frozenset(),
) -> LoadOptions:
    """The checked arguments of `load_robot`, which describes them. Raises InputError."""
    return LoadOptions(
        gravity=tuple(arguments.vector("gravity", gravity, 3, "m/s²", most=arguments.LARGEST).tolist()),
        floating_base=arguments.flag("floating_base", floating_base),
        clean=arguments.flag("clean", clean),
        friction_width=arguments.number(
            "friction_width", friction_width, "rad/s or m/s", above=0.0, most=arguments.LARGEST
        ),
        friction=checked_friction(friction),
        without_friction=without_friction,
        payloads=arguments.several("payloads", payloads, Payload, "Payloads"),
        frames={} if frames is None else checked_frames(frames),
        rotor_inertia=rotor_inertia,
    )


def default_options() -> LoadOptions:
    """The options of a robot that stands on a fixed base, with nothing added to its file."""
    return load_options(
        gravity=STANDARD_GRAVITY, floating_base=False, friction="urdf", payloads=(), rotor_inertia={}, frames=None
    )


def robot_of(file: RobotFile, options: LoadOptions, access: FileAccess) -> Robot:
    """The robot of a robot file, whose meshes are read where `access` allows. Raises InputError."""
    robot = Robot(file, robot_data(file, options), options)
    robot.mesh_access = access
    return robot
