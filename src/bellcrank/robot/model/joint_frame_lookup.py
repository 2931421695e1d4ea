"""A robot's data: its joints, limits, friction, links and frames, looked up by name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.cached_values import Portable, cached_property
from bellcrank.codegen import cache as disk
from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess
from bellcrank.messages import unknown_name
from bellcrank.robot.model.friction import friction_coefficients
from bellcrank.robot.model.joints import (
    JointMimic,
    RobotJoint,
    joint_named,
    require_one_degree,
    require_uniform,
    unit_vectors,
)
from bellcrank.robot.model.tree import Tree

if TYPE_CHECKING:
    from bellcrank.robot.formats.robot_file import RobotFile
    from bellcrank.robot.formats.urdf_file import Urdf
    from bellcrank.robot.model.payload import LoadOptions
    from bellcrank.robot.model.robot_cache import RobotData


class RobotDescription(Portable):
    """What a URDF and the arguments of `load_robot` say about a robot; `Robot` adds its dynamics."""

    def __init__(self, file: RobotFile, data: RobotData, options: LoadOptions) -> None:
        self.file, self._data, self.options = file, data, options
        self.source = self.mesh_source = file.source  # names of mesh files are relative to the latter
        self.mesh_access = FileAccess.of(file.source.resolve())  # which of them are read
        self.name = data.name
        self.findings = data.findings  # errors that `bellcrank check` finds in the elements
        self.inertia_warnings = data.inertia_warnings  # links that move and have no mass
        self.singular_joints = data.singular_joints  # joints about whose axes nothing has inertia: why
        self.floating_base, self.payloads = options.floating_base, options.payloads
        self.user_frames = options.frames  # frames that the URDF does not have: name to (link, xyz m, rpy rad)
        self.gravity, self.friction_width = _read_only(options.gravity), options.friction_width

        self.joints = _independent_joints(data.tree)
        self.nq, self.nv = sum(joint.nq for joint in self.joints), sum(joint.nv for joint in self.joints)
        self.joint_names = tuple(joint.name for joint in self.joints if joint.nv == 1)
        self.all_joint_names = tuple(joint.name for joint in data.tree.joints)
        self.frame_names = tuple(frame.name for frame in data.tree.frames[1:])
        self.massive_links = tuple(data.tree.frames[k].name for k in data.tree.massive_frames())

        self.lower, self.upper = _read_only(data.limits.lower), _read_only(data.limits.upper)
        self.effort_limit, self.velocity_limit = _read_only(data.limits.effort), _read_only(data.limits.velocity)
        self._tree = data.tree
        viscous, coulomb = friction_coefficients(self.name, self.joints, self.mimics(), options.friction, data.friction)
        self.replaced_friction: dict[str, tuple[float, float]] = {}  # viscous, Coulomb of joints with other friction
        for joint in self.joints:
            if joint.name in options.without_friction:
                self.replaced_friction[joint.name] = float(viscous[joint.v]), float(coulomb[joint.v])
                viscous[joint.v : joint.v + joint.nv] = coulomb[joint.v : joint.v + joint.nv] = 0.0
        self.viscous, self.coulomb = _read_only(viscous), _read_only(coulomb)
        rotors = self._checked_rotors(options.rotor_inertia)
        rotor_inertia = np.zeros(self.nv)
        for name, inertia in rotors.items():
            joint = self.joint(name)
            rotor_inertia[joint.v : joint.v + joint.nv] = inertia
        self.rotor_inertia = _read_only(rotor_inertia)
        self._tree = data.tree.with_armature(rotors)
        self._key = disk.digest(
            self._tree.to_json(), repr(tuple(self.gravity)), repr(viscous.tolist()), repr(coulomb.tolist()),
            repr(self.friction_width),
        )  # fmt: skip

    def __repr__(self) -> str:
        return f"Robot('{self.name}', {len(self.joints)} joints, nq={self.nq}, nv={self.nv}, {self.source.name})"

    @property
    def urdf(self) -> Urdf:
        """The URDF's own data, limits, friction and transmissions included."""
        return self.file.tree

    @cached_property
    def model(self) -> Any:
        """The robot as a pinocchio.Model, with payloads, gravity and rotor inertia (as armature).

        Mimicking joints are Pinocchio's mimic joints. Where a leader comes after its follower, which Pinocchio does not
        accept, every joint is one of its own, and the model's nq and nv are larger than the robot's.
        """
        from bellcrank.robot.model.pinocchio_model import pinocchio_model

        model = pinocchio_model(self.urdf, self.options, mimic=True)[0]
        model.gravity.linear = np.array(self.gravity)
        for joint in self.joints:
            if self.rotor_inertia[joint.v]:
                first = model.idx_vs[model.getJointId(joint.name)]
                model.armature[first : first + joint.nv] = self.rotor_inertia[joint.v]
        return model

    @property
    def cleaning(self) -> tuple[int, float]:
        """How many numbers cleaning made exact at load, and the largest change."""
        return self._tree.cleaned_entries, self._tree.cleaned_largest

    @property
    def key(self) -> str:
        """A digest of everything that the robot's equations depend on."""
        return self._key

    # ---- joints

    @cached_property
    def neutral(self) -> Array:
        """The posture (nq,) with every joint at 0 and a free base at the origin, unrotated."""
        q = np.zeros(self.nq)
        for joint, part in zip([j for j in self.joints if j.nq > 1], unit_vectors(self.joints), strict=True):
            q[part] = (1.0, 0.0) if joint.kind == "planar" else (0.0, 0.0, 0.0, 1.0)
        return _read_only(q)

    def joint(self, name: str) -> RobotJoint:
        """The independent joint of that name.

        Args:
            name: Name of a joint that does not mimic another one.

        Returns:
            Its kind and its place in position and velocity.

        Raises:
            InputError: There is no such joint, or it mimics another one.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_robot("planar_2r").joint("elbow")
            RobotJoint(name='elbow', kind='revolute', q=1, nq=1, v=1, nv=1)
        """
        return joint_named(self.name, self.joints, self.mimics(), name)

    def one_degree_joint(self, name: str, what: str) -> RobotJoint:
        """The joint of that name, which has one degree of freedom: revolute, prismatic or a screw.

        Args:
            name: Name of an independent joint.
            what: What requires the joint, with which the message begins.

        Returns:
            Its kind and its place in position and velocity.

        Raises:
            InputError: There is no such joint, or it has several degrees of freedom.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_robot("planar_2r").one_degree_joint("elbow", "brake").v
            1
        """
        return require_one_degree(self.joint(name), what)

    def joint_axis(self, name: str) -> Array:
        """The axis of a joint in its own frame.

        Args:
            name: Name of any joint of the tree, a mimicking one included.

        Returns:
            A unit vector (3,); zero for a joint of several degrees of freedom.

        Raises:
            InputError: There is no such joint.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_robot("planar_2r").joint_axis("elbow")
            array([0., 0., 1.])
        """
        arguments.text("name", name, "the name of a joint")
        if name not in self.all_joint_names:
            raise InputError(unknown_name("joint", name, self.all_joint_names), self.name)
        return np.array(self._tree.joints[self.all_joint_names.index(name)].axis)

    def mimics(self) -> tuple[JointMimic, ...]:
        """The joints that mimic others: q_follower = multiplier q_leader + offset.

        Returns:
            (follower, leader, multiplier, offset) of each; the leaders are independent joints, the offset is in rad
            or m.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_robot("planar_2r").mimics()
            ()
        """
        names = self.all_joint_names
        return tuple(
            JointMimic(names[m.follower - 1], names[m.leader - 1], m.multiplier, m.offset) for m in self._tree.mimics
        )

    def posture(self, values: Mapping[str, float] | Sequence[float] | Array | None = None) -> Array:
        """A position: the neutral one with some joints set, or a given array, checked.

        Args:
            values: Positions (rad or m) by the names of joints with one degree of freedom; or all nq coordinates; or
                None for the neutral position.

        Returns:
            A new array (nq,).

        Raises:
            InputError: A joint is unknown or has several degrees of freedom, or a number is missing or not finite.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_robot("planar_2r").posture({"elbow": 0.5})
            array([0. , 0.5])
        """
        q = self.neutral.copy()
        if values is None:
            return q
        if isinstance(values, Mapping):
            for name, value in arguments.names_to_numbers("posture", values, "joints", "rad or m").items():
                q[self.one_degree_joint(name, "posture").q] = value
            return q
        return arguments.vector("posture", values, self.nq, "rad or m", where=self.name).copy()

    # ---- links and frames

    def frame_index(self, name: str) -> int:
        """The number of a frame in the tree.

        Args:
            name: Name of a link, a joint or an added frame; a link comes before a joint of the same name.

        Returns:
            Its place in `equations.tree.frames`.

        Raises:
            InputError: There is no such frame.

        Example:
            >>> import bellcrank as bc
            >>> robot = bc.load_robot("planar_2r")
            >>> robot.equations.tree.frames[robot.frame_index("tip")].name
            'tip'
        """
        arguments.text("name", name, "the name of a frame")
        found = self._tree.frame_index(name)
        if found is None:
            raise InputError(f"{self.name}: " + unknown_name("frame", name, self.frame_names))
        return found

    def supporting_joints(self, frame: str) -> tuple[str, ...]:
        """The joints between a frame and the world, which move it.

        Args:
            frame: Name of a link, a joint or an added frame.

        Returns:
            Names of the joints, the one next to the frame first; mimicking joints are included.

        Raises:
            InputError: There is no such frame.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_robot("planar_2r").supporting_joints("tip")
            ('elbow', 'shoulder')
        """
        numbers = self._tree.supporting_joints(self.frame_index(arguments.text("frame", frame, "the name of a frame")))
        return tuple(self.all_joint_names[number - 1] for number in numbers)

    def carrier(self, link: str) -> str | None:
        """The joint that a link moves with.

        Args:
            link: Name of a link of the URDF.

        Returns:
            Name of the joint; None for a link that is fixed to the world.

        Raises:
            InputError: There is no such link.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_robot("planar_2r").carrier("tip")
            'elbow'
        """
        arguments.text("link", link, "the name of a link")
        if link not in self.urdf.links:
            raise InputError(f"{self.name}: " + unknown_name("link", link, self.urdf.links))
        number = next(frame.parent_joint for frame in self._tree.frames if frame.is_body and frame.name == link)
        return self.all_joint_names[number - 1] if number else None

    def moved_by(
        self, joints: Iterable[str], set_masses: Mapping[int, float] | None = None
    ) -> tuple[tuple[str, ...], float]:
        """The links that move when some joints move, and how heavy they are.

        Args:
            joints: Names of joints.
            set_masses: Masses (kg) that frames, by their number in the tree, have instead of their own.

        Returns:
            The names of the links, and the mass (kg) of all that moves, payloads included.

        Raises:
            InputError: There is no such joint or frame, or a mass is negative.

        Example:
            >>> import bellcrank as bc
            >>> links, mass = bc.load_robot("planar_2r").moved_by(["elbow"])
            >>> links
            ('link_2', 'tip')
        """
        names = set(arguments.several("joints", joints, str, "names of joints"))
        for unknown in names.difference(self.all_joint_names):
            raise InputError(f"{self.name}: " + unknown_name("joint", unknown, self.all_joint_names))
        if set_masses is not None:
            set_masses = self._checked_masses(set_masses)
        numbers = [k for k, name in enumerate(self.all_joint_names, 1) if name in names]
        frames, mass = self._tree.moved_with(numbers, set_masses)
        return tuple(name for name in frames if name in self.urdf.links), mass

    # ---- checks

    def _checked_rotors(self, given: Mapping[str, float]) -> dict[str, float]:
        """Rotor inertias (kg m² or kg) by the name of a joint of one degree of freedom, or spherical one. Raises
        InputError.
        """
        most, what = arguments.LARGEST, "rotor_inertia"
        rotors = arguments.names_to_numbers(what, given, "joints", "kg m²", least=0.0, most=most)
        return {require_uniform(self.joint(name), what).name: value for name, value in rotors.items()}

    def _checked_masses(self, given: object) -> dict[int, float]:
        """Masses (kg) by the number of a frame of the tree. Raises InputError."""
        if not isinstance(given, Mapping):
            arguments.refuse("set_masses", "a mapping of numbers of frames to masses (kg)", given)
        most = len(self._tree.frames) - 1
        return {
            arguments.whole("set_masses", frame, least=0, most=most): arguments.number(
                "set_masses", mass, "kg", least=0.0
            )
            for frame, mass in given.items()
        }


def _independent_joints(tree: Tree) -> tuple[RobotJoint, ...]:
    """The joints that mimic no other, with their places in q and v."""
    followers, joints, q, v = tree.followers(), [], 0, 0
    for number, joint in enumerate(tree.joints, 1):
        if number not in followers:
            joints.append(RobotJoint(joint.name, joint.kind, q, joint.nq, v, joint.nv))
            q, v = q + joint.nq, v + joint.nv
    return tuple(joints)


def _read_only(x: Any) -> Array:
    array = np.array(x, dtype=np.float64)
    array.setflags(write=False)
    return array
