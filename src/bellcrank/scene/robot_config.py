"""A robot configuration: the robot's URDF, its mounting, payloads, motions and actuators, in one YAML file.

Keys: name; urdf (a path relative to the file, or the name of a robot); gravity (m/s²); floating_base; friction ("urdf",
"none" or {joint: {viscous, coulomb}}); payloads [{mass, frame, cg, inertia}]; frames {name: {link, xyz, rpy}}; motions
(motion/entry_kinds.py); actuators {joint: {…}} (actuators/actuator_fields.py); conditions, under which actuators are
judged (actuators/actuator_fields.py); catalogue, a folder with tables of motors and gears that actuators name; and,
for a mechanism with closed loops, actuated, the list of joints with motors (by default those with actuators). For the
selection of motors: transmissions, the coupled transmissions (actuators/coupled_transmission.py; their actuators are
named by motor); mounts {joint or motor: {…}} (actuators/mount.py); and duty, the order of motions and pauses
(motion/motion_entry.py).

The file may also contain the keys of a scene (scene.py). Sizing uses constraints, the start, forces and parameters of
them, reports that controllers and the clock of the start are not used, and ignores the others.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from bellcrank import arguments
from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.actuator_fields import ROBOT_WIDE, actuators_from_fields, catalogue_folder, given_conditions
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.coupled_transmission import CoupledTransmission, transmissions_from_fields
from bellcrank.actuators.mount import Mount, mounts_from_fields
from bellcrank.config.fields import Fields
from bellcrank.config.yaml_file import read_yaml
from bellcrank.elements.drive_fields import separate_rotors
from bellcrank.elements.dry_friction import dry_joints
from bellcrank.errors import InputError
from bellcrank.files import bundled_data
from bellcrank.files.access import FileAccess, Trust
from bellcrank.messages import format_value, readable, unknown_name
from bellcrank.motion.entry_kinds import check_references, read_motion_entry
from bellcrank.motion.motion_entry import DutyStep, MotionEntry, duty_from_fields
from bellcrank.notes import MATTERS, OMISSIONS, Matter, Note, Omission
from bellcrank.robot import catalog
from bellcrank.robot.model.payload import Payload
from bellcrank.scene.robot_file_entries import CHOICES, robot_access, robot_path, with_robot_file, xacro_values
from bellcrank.scene.source_mapping import SourceMapping, source_mapping

if TYPE_CHECKING:
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.formats.robot_file import RobotFile
    from bellcrank.robot.robot import Robot

CONFIG_KEYS = (
    "name", "urdf", "gravity", "floating_base", "friction", "payloads", "frames", "motions", "actuators", "actuated",
    "conditions", "catalogue", "transmissions", "mounts", "duty", "rotor_inertia", "robot_file", "xacro_args", "notes",
)  # fmt: skip
SCENE_KEYS = (
    "constraints", "forces", "control", "initial", "base", "parameters", "events", "outputs", "simulate", "study",
    "joints", "joint_stops", "supply", "optimise",
)  # fmt: skip

Frame = tuple[str, tuple[float, ...], tuple[float, ...]]


@dataclass(frozen=True, kw_only=True)
class RobotConfig:
    """The contents of a robot configuration, checked as far as that is possible without reading the URDF.

    It is a part of a `Scene`, which `load_scene` reads.

    Attributes:
        name: The robot's name in reports.
        source: The path of the configuration, or of the URDF where it was made from one.
        urdf: The path of the URDF.
        gravity: Acceleration of gravity (3,) in the world, m/s².
        floating_base: Whether the base is free to move.
        friction: "urdf" (as the URDF gives it), "none", or {joint: (viscous in N m s/rad or N s/m, Coulomb in N m or
            N)}.
        payloads: Rigid bodies fixed to frames.
        frames: Additional frames by name: (link, xyz in m, rpy in rad).
        motions: The entries of the motions by name; `motion` computes one.
        actuators: The motor and gear of joints, by joint; of a coupled transmission by motor.
        conditions: Supply, surroundings and safety, under which the actuators are judged; an actuator of a motor and a
            gear has those of its axis.
        actuated: The joints with motors, for a mechanism with closed loops; empty: those with actuators.
        catalogue: The folder with motors and gears of the robot's own; None where there is none.
        transmissions: The coupled transmissions.
        mounts: Where actuators are mounted, by joint or motor, where that is not the joint's parent link.
        duty: The order of motions and pauses in a cycle; empty: each motion repeats by itself.
        rotor_inertia: Rotor inertia by joint, reflected to the joint, kg m² or kg; the actuators' figures replace it.
        notes: What every result lists among its notes, and how it matters.
        file: The contents of the robot file; None: it is read when the robot is loaded.
        access: The rule which files the configuration may name.
        overrides: The values that sizing or a selection changed in the file, by dotted path.
        without_friction: The joints whose friction here is replaced by dry friction of the scene (dry_friction.py).
        separate_rotors: The joints whose rotor turns by itself behind an elastic gear (elements/drives.py), so that its
            inertia is not the joint's.

    Example:
        >>> import bellcrank as bc
        >>> config = bc.load_scene("planar_2r").config
        >>> config.name, list(config.motions), list(config.actuators)
        ('Planar 2R arm', ['elbow_up', 'elbow_down'], ['shoulder', 'elbow'])
    """

    name: str
    source: Path
    urdf: Path
    gravity: tuple[float, ...] = (0.0, 0.0, -9.81)
    floating_base: bool = False
    friction: str | Mapping[str, tuple[float, float]] = "urdf"
    payloads: tuple[Payload, ...] = ()
    frames: Mapping[str, Frame] = field(default_factory=dict)
    motions: Mapping[str, MotionEntry] = field(default_factory=dict)
    actuators: Mapping[str, Actuator] = field(default_factory=dict)
    conditions: Conditions = field(default_factory=Conditions)
    actuated: tuple[str, ...] = ()
    catalogue: Path | None = None
    transmissions: tuple[CoupledTransmission, ...] = ()
    mounts: Mapping[str, Mount] = field(default_factory=dict)
    duty: tuple[DutyStep, ...] = ()
    rotor_inertia: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[Note, ...] = ()
    file: RobotFile | None = field(default=None, repr=False, compare=False)
    access: FileAccess | None = field(default=None, repr=False, compare=False)
    overrides: Mapping[str, Any] = field(default_factory=dict, repr=False, compare=False)
    without_friction: tuple[str, ...] = ()
    separate_rotors: tuple[str, ...] = ()

    @property
    def coupled_motors(self) -> tuple[str, ...]:
        """The motors of coupled transmissions. The reflected inertia of their rotors is not part of the robot."""
        return tuple(motor for one in self.transmissions for motor in one.motors)

    @property
    def joints_with_actuators(self) -> tuple[str, ...]:
        """The joints that actuators move, those of coupled transmissions included."""
        joints = {motor: one.joints for one in self.transmissions for motor in one.motors}
        return tuple(dict.fromkeys(joint for name in self.actuators for joint in joints.get(name, (name,))))

    def robot(self, extra_payloads: Iterable[Payload] = ()) -> Robot:
        """Load the robot with its gravity, friction, payloads, frames and the actuators' reflected inertias.

        Args:
            extra_payloads: Payloads to add to those of the configuration.

        Returns:
            The robot.

        Raises:
            InputError: The URDF cannot be read, or a frame, joint or payload does not fit it; the message names the
                file.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_scene("planar_2r").config.robot()
            Robot('planar_2r', 2 joints, nq=2, nv=2, planar_2r.urdf)
        """
        from bellcrank.robot.formats.file_readers import read_robot_file
        from bellcrank.robot.load import load_options, robot_of

        extra = arguments.several("extra_payloads", extra_payloads, Payload, "Payloads")
        try:
            options = load_options(
                gravity=self.gravity,
                floating_base=self.floating_base,
                friction=self.friction,
                without_friction=frozenset(self.without_friction),
                payloads=(*self.payloads, *extra),
                rotor_inertia=self._rotors(),
                frames=dict(self.frames),
            )
            access = self.access or FileAccess.of(self.urdf.resolve())
            robot = robot_of(self.file or read_robot_file(self.urdf, access), options, access)
        except InputError as error:
            # The message already names the URDF where the configuration was made from it.
            if self.source.resolve() == self.urdf.resolve() or str(error).startswith(str(self.urdf)):
                raise
            raise InputError(f"{self.source}: {error}") from None
        robot.inertia_warnings = (*robot.inertia_warnings, *self._unknown_inertias())
        return robot

    def _rotors(self) -> dict[str, float]:
        """Rotor inertia by joint: the actuators' figures, where they state any, instead of `rotor_inertia`."""
        stated = {joint: one.known_inertia for joint, one in self.actuators.items() if joint not in self.coupled_motors}
        given = dict(self.rotor_inertia)
        found = given | {joint: inertia for joint, inertia in stated.items() if inertia > 0.0 or joint not in given}
        return {joint: inertia for joint, inertia in found.items() if joint not in self.separate_rotors}

    def _unknown_inertias(self) -> Iterator[str]:
        """A sentence for each actuator of which an inertia is unknown, and so not part of the robot."""
        keys = {"rotor_inertia": "motor.rotor_inertia", "gear_inertia": "gear.inertia"}
        for joint, actuator in self.actuators.items():
            if (missing := actuator.unknown_inertias) and joint not in self.coupled_motors:
                names = " and ".join(name.replace("_", " ") for name in missing)
                yield (
                    f"actuator of joint '{joint}': its {names} {'is' if len(missing) == 1 else 'are'} not stated and "
                    f"not part of the robot's inertia; state it, or assume {', '.join(keys[name] for name in missing)}"
                )

    def motion(self, robot: Robot, name: str) -> Motion:
        """Compute one of the configuration's motions for a robot.

        Args:
            robot: The robot, as `robot` returns it.
            name: The name of a motion under the key `motions`.

        Returns:
            The motion of the robot's joints.

        Raises:
            InputError: There is no such motion, or its entry is wrong; the message names file, line and key.
            UnreachableError: The robot cannot reach a point of the motion.

        Example:
            >>> import bellcrank as bc
            >>> config = bc.load_scene("planar_2r").config
            >>> motion = config.motion(config.robot(), "elbow_up")
            >>> motion.position.shape
            (1001, 2)
        """
        arguments.robot(robot)
        if arguments.text("name", name, "the name of a motion") not in self.motions:
            raise InputError(f"{self.source}: {unknown_name('motion', name, self.motions)}")
        return self.motions[name].build(robot, self.motions)


def names() -> dict[str, Path]:
    """The paths of the bundled configurations, by name."""
    return {path.stem: path for path in sorted(bundled_data.folder("robots").glob("*.yaml"))}


def robot_file_data(source: Path, trust: Trust = ()) -> tuple[SourceMapping, FileAccess]:
    """The mapping of a scene of a robot file alone, and which files it may name. Raises InputError."""
    access = FileAccess.of(source.resolve(), trust)
    data: SourceMapping = source_mapping({"name": source.stem, "urdf": str(source.resolve())})
    return data, replace(access, trusted=(*access.trusted, source.resolve()))


def find_config(path_or_name: str | Path) -> tuple[Path, bool]:
    """Find the file of a path or name. Returns its path, and whether it is a URDF. Raises InputError."""
    path = arguments.path(
        "path_or_name",
        path_or_name,
        "the path of a scene, configuration or URDF, or the name of a robot, as bc.load_scene takes",
    )
    text = str(path_or_name)
    if path.suffix.lower() in (".yaml", ".yml"):
        return path, False
    if path.suffix.lower() in (".npz", ".csv"):
        raise InputError(
            f"{text}: expected a scene, a configuration or a URDF; to open a saved run (.npz) use bc.load_run, to "
            f"open a "
            "CSV use bc.read_motion or `bellcrank size --motion`"
        )
    configs = names()
    if not _is_file(path):
        if text in configs:
            return configs[text], False
        if path.name == text and path.suffix == "":
            known = {**configs, **catalog.names()}
            if text not in known:
                near = difflib.get_close_matches(text, known, n=1)
                hint = f"did you mean '{near[0]}'? " if near else ""
                raise InputError(
                    f"unknown scene or robot '{text}', and no file of that name; {hint}`bellcrank robots` lists them"
                )
    return catalog.find_urdf(path_or_name), True


def read_config(path: str | Path, access: FileAccess | None = None) -> RobotConfig:
    """Read a configuration's YAML file. Raises InputError, one sentence with file, line and key."""
    path = Path(path)
    access = FileAccess.of(path) if access is None else access
    merged, file = with_robot_file(source_mapping(read_yaml(path)), path, access)
    fields = Fields(merged, str(path), access=access)
    fields.only((*CONFIG_KEYS, *SCENE_KEYS))
    config = config_from_fields(fields, path)
    fields.known(*SCENE_KEYS)
    fields.done()
    return replace(config, file=file)


def _names(fields: Fields, key: str) -> tuple[str, ...]:
    """A list of names, empty where there is none. Raises InputError."""
    given = fields.raw(key, ())
    if not isinstance(given, (list, tuple)) or not all(isinstance(name, str) for name in given):
        raise fields.error(key, f"expected a list of names, found {format_value(given)}")
    return tuple(given)


def _notes(fields: Fields) -> tuple[Note, ...]:
    """Sentences, which are information, and mappings with how a note matters. Raises InputError."""
    given = fields.raw("notes", ())
    if not isinstance(given, (list, tuple)):
        raise fields.error("notes", "expected a list of sentences")
    found = []
    for k, entry in enumerate(given):
        if isinstance(entry, str):
            found.append(Note(entry))
            continue
        if not isinstance(entry, Mapping):
            raise fields.error("notes", f"expected sentences, found {format_value(entry)}")
        own = Fields(entry, fields.where, f"notes[{k + 1}]", fields.access)
        note = Note(
            own.text("text"),
            cast(Matter, own.choice("matter", MATTERS, "information")),
            cast(Omission, own.choice("omits", OMISSIONS, "")),
            _names(own, "joints"),
            own.text("file") if "file" in own else "",
        )
        own.done()
        found.append(note)
    return tuple(found)


def config_from_fields(fields: Fields, path: Path) -> RobotConfig:
    """Read the configuration from the keys of a file. The caller reads or refuses all other keys. Raises InputError."""
    name = fields.text("name", readable(path.stem))
    urdf = robot_path(fields)
    fields.choice("robot_file", CHOICES, "all")
    xacro_values(fields)
    rotors = fields.mapping("rotor_inertia", {})
    gravity = fields.vector("gravity", 3, "m/s^2", (0.0, 0.0, -9.81))
    floating = fields.flag("floating_base", False)
    friction = _friction(fields)
    payloads = tuple(_payload(entry) for entry in fields.mappings("payloads"))
    frames = _frames(fields.mapping("frames", {}))
    motions = fields.mapping("motions", {})
    entries = {key: read_motion_entry(key, motions.mapping(key)) for key in motions}
    check_references(entries)
    catalogue = catalogue_folder(fields)
    conditions = _conditions(fields.mapping(ROBOT_WIDE, {}))
    actuators = actuators_from_fields(fields, catalogue, conditions)
    actuated = fields.raw("actuated", ())
    if not isinstance(actuated, (list, tuple)) or not all(isinstance(joint, str) for joint in actuated):
        raise fields.error("actuated", "expected a list of joints, such as [crank]")
    transmissions = transmissions_from_fields(fields)
    for one in transmissions:
        for joint in one.joints:
            if joint in actuators:
                raise fields.mapping("actuators").error(
                    joint,
                    f"joint '{joint}' belongs to a coupled transmission; name its actuators by motor "
                    f"({', '.join(one.motors)})",
                )
    duty = duty_from_fields(fields)
    for step in duty:
        if step.motion is not None and step.motion not in entries:
            raise fields.error("duty", unknown_name("motion", step.motion, entries))
    return RobotConfig(
        name=name,
        source=path,
        urdf=urdf,
        gravity=gravity,
        floating_base=floating,
        friction=friction,
        payloads=payloads,
        frames=frames,
        motions=entries,
        actuators=actuators,
        conditions=conditions,
        actuated=tuple(actuated),
        catalogue=catalogue,
        transmissions=transmissions,
        mounts=mounts_from_fields(fields.mapping("mounts", {})),
        duty=duty,
        rotor_inertia={joint: rotors.number(joint, "kg m^2", nonnegative=True) for joint in rotors},
        notes=_notes(fields),
        access=robot_access(fields, urdf),
        without_friction=dry_joints(fields),
        separate_rotors=separate_rotors(fields),
    )


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _friction(fields: Fields) -> str | dict[str, tuple[float, float]]:
    value = fields.raw("friction", "urdf")
    if isinstance(value, str):
        return fields.choice("friction", ("urdf", "none"), "urdf")
    table = fields.mapping("friction")
    result = {}
    for joint in table:
        entry = table.mapping(joint)
        result[joint] = (
            entry.number("viscous", "N m s/rad", 0.0, nonnegative=True),
            entry.number("coulomb", "N m", 0.0, nonnegative=True),
        )
        entry.done()
    return result


def _payload(fields: Fields) -> Payload:
    cg, inertia = fields.vector("cg", 3, "m", (0.0,) * 3), fields.vector("inertia", 6, "kg m^2", (0.0,) * 6)
    mass, frame = fields.number("mass", "kg", positive=True), fields.text("frame")
    fields.done()
    try:
        return Payload(
            mass,
            frame,
            (cg[0], cg[1], cg[2]),
            (inertia[0], inertia[1], inertia[2], inertia[3], inertia[4], inertia[5]),
        )
    except InputError as error:
        raise fields.error("", str(error)) from None


def _conditions(fields: Fields) -> Conditions:
    """The conditions of the whole robot. Raises InputError."""
    given = given_conditions(fields)
    fields.done()
    return Conditions().updated(given, ROBOT_WIDE)


def _frames(fields: Fields) -> dict[str, Frame]:
    result = {}
    for name in fields:
        entry = fields.mapping(name)
        result[name] = (
            entry.text("link"),
            entry.vector("xyz", 3, "m", (0.0,) * 3),
            entry.vector("rpy", 3, "rad", (0.0,) * 3),
        )
        entry.done()
    return result
