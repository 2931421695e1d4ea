"""A robot: checked data of a URDF, and its dynamics as machine code made when first asked for."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.codegen import cache as disk
from bellcrank.codegen.compile import Compiled, compiled
from bellcrank.derived import Portable, cached_property
from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess
from bellcrank.messages import unknown_name
from bellcrank.robot.equations import Equations
from bellcrank.robot.friction import Friction, checked_friction, friction_coefficients
from bellcrank.robot.inertias import inertia_diagonal
from bellcrank.robot.payload import Payload
from bellcrank.robot.tree import FrameTable, Tree

if TYPE_CHECKING:
    import casadi

    from bellcrank.robot.urdf_file import Urdf

Array = NDArray[np.float64]
FRICTION_WIDTH = 1e-3  # rad/s or m/s: Coulomb friction is at 71 % of its value at this speed


@dataclass(frozen=True)
class RobotJoint:
    """An independent joint: its kind, and where its coordinates lie in position (q) and velocity (v)."""

    name: str
    kind: str  # "revolute", "prismatic", "planar" or "floating"
    q: int
    nq: int
    v: int
    nv: int


class Robot(Portable):
    """A URDF robot and its dynamics.

    Position is (nq,) or (n, nq), velocity, acceleration and torque (nv,) or (n, nv): rad, m and N m, N,
    one number a joint; a free base comes first, with position (world, m) and quaternion x y z w, and
    velocity linear then angular in the base's own frame. Made by `load_robot`.
    """

    def __init__(
        self,
        source: Path,
        text: str,
        data: dict[str, Any],
        *,
        gravity: tuple[float, ...],
        floating_base: bool,
        friction: Friction,
        friction_width: float,
        payloads: tuple[Payload, ...],
        rotor_inertia: Mapping[str, float],
        frames: FrameTable,
        clean: bool,
    ) -> None:
        self.source, self._text, self._data = source, text, data
        self.mesh_source = source  # the URDF that names of mesh files are relative to
        self.mesh_access = FileAccess.of(source.resolve())  # which of them are read
        self.name: str = data["name"]
        self.gravity = _frozen(gravity)
        self.findings: tuple[str, ...] = tuple(data["findings"])  # errors that `bellcrank check` finds in the elements
        self.inertia_warnings: tuple[str, ...] = tuple(data["inertia_warnings"])  # links that move and have no mass
        self.singular_joints: Mapping[str, str] = data["singular_joints"]  # nothing has inertia about their axes: why
        self.floating_base, self.payloads, self._clean = floating_base, payloads, clean
        self.user_frames = frames  # those that the URDF does not have: name to (link, xyz m, rpy rad)
        self._friction = checked_friction(friction)
        self.friction_width = friction_width
        self._tree = Tree(**data["tree"])
        followers = {m[0] for m in self._tree.mimics}
        joints, q, v = [], 0, 0
        for k, j in enumerate(self._tree.joints):
            if k + 1 in followers:
                continue
            joints.append(RobotJoint(j["name"], j["what"], q, j["nq"], v, j["nv"]))
            q, v = q + j["nq"], v + j["nv"]
        self.joints: tuple[RobotJoint, ...] = tuple(joints)
        self.nq, self.nv = q, v
        self.joint_names: tuple[str, ...] = tuple(j.name for j in joints if j.nv == 1)
        self.all_joint_names: tuple[str, ...] = tuple(j["name"] for j in self._tree.joints)
        self.massive_links: tuple[str, ...] = tuple(self._tree.frames[k]["name"] for k in self._tree.massive_frames())
        self.frame_names: tuple[str, ...] = tuple(f["name"] for f in self._tree.frames[1:])
        self.lower, self.upper = _frozen(_limits(data["lower"], -1)), _frozen(_limits(data["upper"], 1))
        self.effort_limit = _frozen(_limits(data["effort"], 1))
        self.velocity_limit = _frozen(_limits(data["velocity"], 1))
        viscous, coulomb = friction_coefficients(self, self._friction, data["friction"])
        self.viscous, self.coulomb = _frozen(viscous), _frozen(coulomb)
        rotor = np.zeros(self.nv)
        inertias = arguments.names_to_numbers(
            "rotor_inertia", rotor_inertia, "joints", "kg m²", least=0.0, most=arguments.LARGEST
        )
        for name, value in inertias.items():
            joint = self.one_degree_joint(name, "rotor_inertia")
            rotor[joint.v] = value
            self._tree.joints[self.all_joint_names.index(name)]["armature"] = [value]
        self.rotor_inertia = _frozen(rotor)
        self._key = disk.digest(
            json.dumps(asdict(self._tree), sort_keys=True), repr(tuple(self.gravity)), repr(viscous.tolist()),
            repr(coulomb.tolist()), repr(friction_width),
        )  # fmt: skip

    def __repr__(self) -> str:
        return f"Robot('{self.name}', {len(self.joints)} joints, nq={self.nq}, nv={self.nv}, {self.source.name})"

    # ---- data

    @cached_property
    def urdf(self) -> Urdf:
        """The URDF's own data, limits, friction and transmissions included."""
        from bellcrank.robot.urdf_file import Urdf

        return Urdf.from_text(self._text, self.source)

    @cached_property
    def model(self) -> Any:
        """The cleaned pinocchio.Model, with payloads, gravity and rotor inertia (as armature) in it.

        Mimicking joints are Pinocchio's mimic joints; where a leader comes after its follower, which Pinocchio's
        reader does not take, every joint is one of its own and nq, nv are larger than the robot's.
        """
        from bellcrank.robot.tree import pinocchio_model

        def build(mimic: bool) -> Any:
            frames, clean = self.user_frames, self._clean
            return pinocchio_model(self.urdf, self.floating_base, self.payloads, frames, clean, mimic)[0]

        try:
            model = build(bool(self._tree.mimics))
        except InputError:
            model = build(False)
        model.gravity.linear = np.array(self.gravity)
        for j in self.joints:
            if j.nv == 1 and self.rotor_inertia[j.v]:
                model.armature[model.idx_vs[model.getJointId(j.name)]] = self.rotor_inertia[j.v]
        return model

    @property
    def cleaning(self) -> tuple[int, float]:
        """How many numbers cleaning made exact at load, and the largest change."""
        return self._tree.cleaned_entries, self._tree.cleaned_largest

    @property
    def key(self) -> str:
        """A digest of everything that the robot's equations depend on."""
        return self._key

    @cached_property
    def neutral(self) -> Array:
        """The posture (nq,) with every joint at 0 and the base at the origin, upright."""
        q = np.zeros(self.nq)
        for j in self.joints:
            if j.kind == "floating":
                q[j.q + 6] = 1.0
            elif j.kind == "planar":
                q[j.q + 2] = 1.0
        return _frozen(q)

    def joint(self, name: str) -> RobotJoint:
        """The independent joint of that name. Raises InputError with what there is."""
        arguments.text("name", name, "the name of a joint")
        for j in self.joints:
            if j.name == name:
                return j
        for follower, leader, *_ in self._tree.mimics:
            if self.all_joint_names[follower - 1] == name:
                raise InputError(
                    f"{self.name}: joint '{name}' mimics '{self.all_joint_names[leader - 1]}' and has no coordinate "
                    "of its own; set that joint instead"
                )
        raise InputError(f"{self.name}: " + unknown_name("joint", name, [j.name for j in self.joints]))

    def one_degree_joint(self, name: str, what: str) -> RobotJoint:
        """The revolute or prismatic joint of that name; InputError, with `what` asked, for any other."""
        joint = self.joint(name)
        if joint.nv != 1:
            raise InputError(f"{what}: joint '{name}' is {joint.kind}; only revolute and prismatic joints take it")
        return joint

    def joint_axis(self, name: str) -> Array:
        """The joint's unit axis (3,) in its own frame."""
        arguments.text("name", name, "the name of a joint")
        if name not in self.all_joint_names:
            raise InputError(f"{self.name}: " + unknown_name("joint", name, self.all_joint_names))
        return np.array(self._tree.joints[self.all_joint_names.index(name)]["axis"])

    def mimics(self) -> tuple[tuple[str, str, float, float], ...]:
        """(follower, leader, multiplier, offset) of each mimicking joint: q_follower = multiplier q_leader + offset."""
        names = self.all_joint_names
        return tuple((names[f - 1], names[g - 1], m, o) for f, g, m, o in self._tree.mimics)

    def moved_by(
        self, joints: Iterable[str], set_masses: Mapping[int, float] | None = None
    ) -> tuple[tuple[str, ...], float]:
        """The links that move when these joints do, and the mass of all that moves, payloads included (kg).

        `set_masses` are masses, kg, that frames of the tree, by number, have instead of their own.
        """
        names = set(arguments.several("joints", joints, str, "names of joints"))
        for unknown in names.difference(self.all_joint_names):
            raise InputError(f"{self.name}: " + unknown_name("joint", unknown, self.all_joint_names))
        if set_masses is not None:
            set_masses = self._masses(set_masses)
        numbers = [k for k, name in enumerate(self.all_joint_names, 1) if name in names]
        frames, mass = self._tree.moved_with(numbers, set_masses)
        return tuple(name for name in frames if name in self.urdf.links), mass

    def _masses(self, given: object) -> dict[int, float]:
        """Masses, kg, by the number of a frame of the tree. Raises InputError."""
        if not isinstance(given, Mapping):
            arguments.refuse("set_masses", "a mapping of numbers of frames to masses (kg)", given)
        most = len(self._tree.frames) - 1
        return {
            arguments.whole("set_masses", frame, least=0, most=most): arguments.number(
                "set_masses", mass, "kg", least=0.0
            )
            for frame, mass in given.items()
        }

    def carrier(self, link: str) -> str | None:
        """The joint that the link moves with, or None for a link of the world. Raises InputError for an unknown one."""
        arguments.text("link", link, "the name of a link")
        if link not in self.urdf.links:
            raise InputError(f"{self.name}: " + unknown_name("link", link, self.urdf.links))
        number = next(f["parent_joint"] for f in self._tree.frames if f["is_body"] and f["name"] == link)
        return self.all_joint_names[number - 1] if number else None

    def posture(self, values: Mapping[str, float] | Sequence[float] | Array | None = None) -> Array:
        """A position (nq,): the neutral one with these joints set, or the given array, checked."""
        q = self.neutral.copy()
        if values is None:
            return q
        if isinstance(values, Mapping):
            for name, value in arguments.names_to_numbers("posture", values, "joints", "rad or m").items():
                q[self.one_degree_joint(name, "posture").q] = value
            return q
        return arguments.vector("posture", values, self.nq, "rad or m", where=self.name).copy()

    # ---- dynamics

    def inverse_dynamics(self, q: Any, v: Any, a: Any) -> Array:
        """Joint torques tau = M(q) a + C(q, v) v + g(q) + friction(v), rotor inertia in M.

        q (nq,), v, a (nv,), or batches (n, …); returns (nv,) or (n, nv), N m or N. Source: recursive
        Newton-Euler, Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 5, by Pinocchio.
        """
        torque: Array = self.dynamics("inverse_dynamics")(*self._states(_QVA, q, v, a))
        if not _finite(torque) and not np.isfinite(torque).all():
            raise InputError(f"{self.name}: the motion is too fast for numbers: a torque overflows; check its units")
        return torque

    def forward_dynamics(self, q: Any, v: Any, tau: Any) -> Array:
        """Accelerations under torques `tau` (N m or N) and the robot's friction and gravity.

        q (nq,), v, tau (nv,), or batches (n, …); returns (nv,) or (n, nv), rad/s² or m/s². Source:
        articulated-body algorithm, Featherstone (2008), ch. 7, by Pinocchio.
        """
        acceleration: Array = self.dynamics("forward_dynamics")(*self._states(_QVTAU, q, v, tau))
        if not _finite(acceleration) and not np.isfinite(acceleration).all():
            bad = np.argwhere(~np.isfinite(np.atleast_2d(acceleration)))[0]
            joint = next(j.name for j in reversed(self.joints) if j.v <= bad[1])
            raise InputError(
                f"{self.name}: the forward dynamics of sample {bad[0]} has no finite answer at joint '{joint}': "
                "nothing there has inertia about the joint's axis; give the links beyond it mass "
                "(`bellcrank check` names them)"
            )
        return acceleration

    def mass_matrix(self, q: Any) -> Array:
        """The mass matrix M(q), rotor inertia included: (nv, nv), or (n, nv, nv) for a batch.

        Source: composite-rigid-body algorithm, Featherstone (2008), ch. 6, by Pinocchio. Its expression grows with nv²;
        of more than LARGEST_WHOLE joints column k is what inverse dynamics gives for the acceleration e_k at rest
        without gravity, ch. 6.1 there.
        """
        (q,) = self._states(_QVA, q)
        if self.nv > LARGEST_WHOLE:
            whole = np.stack([self._mass_by_columns(row) for row in q]) if q.ndim == 2 else self._mass_by_columns(q)
            return self._told("a mass matrix", whole)
        flat = self._told("a mass matrix", self._simple("mass_matrix")(q, _NONE))
        return flat.reshape(*flat.shape[:-1], self.nv, self.nv)

    def _mass_by_columns(self, q: Array) -> Array:
        code = self._code("inertial_torque", self.equations.inertial_torque)
        columns = code(np.tile(q, (self.nv, 1)), np.eye(self.nv))
        return np.asarray(0.5 * (columns + columns.T))  # symmetric but for rounding

    def inertia_diagonal(self, q: Any) -> Array:
        """The diagonal M_kk (k,) or (n, k) of the mass matrix for the joints of one degree of freedom, rotors included.

        Of more than LARGEST_WHOLE joints it takes work and memory that grow with their number only
        (robot/inertias.py), unless joints mimic others.
        """
        (q,) = self._states(_QVA, q)
        if self.nv <= LARGEST_WHOLE or self._tree.mimics:
            columns = [joint.v for joint in self.joints if joint.nv == 1]
            rows = max(1, BLOCK_NUMBERS // max(1, self.nv) ** 2)
            states = np.atleast_2d(q)
            blocks = [self.mass_matrix(states[first : first + rows]) for first in range(0, len(states), rows)]
            diagonal = [np.diagonal(block, axis1=-2, axis2=-1)[:, columns] for block in blocks]
            found = np.concatenate([np.zeros((0, len(columns))), *diagonal])
            return found if q.ndim == 2 else np.asarray(found[0])
        code = self._code("inertia_diagonal", lambda: inertia_diagonal(self._tree))
        return self._told("an inertia", code(q))

    def gravity_torque(self, q: Any) -> Array:
        """The torques (nv,) or (n, nv) that hold the robot at rest at q, N m or N."""
        code = self._code("gravity_torque", self.equations.gravity_torque)
        return self._told("a torque", code(*self._states(_QVA, q)))

    def friction_torque(self, v: Any) -> Array:
        """Joint friction (nv,) or (n, nv): viscous v + coulomb v / sqrt(v² + width²), N m or N."""
        v = self._states(("v",), v)[0]
        return np.asarray(self.viscous * v + self.coulomb * (v / np.hypot(v, self.friction_width)))

    def energy(self, q: Any, v: Any) -> tuple[Array, Array]:
        """Kinetic and potential energy, J, of one state or a batch (potential zero at the world's origin)."""
        both = self._told("an energy", self._simple("energy")(*self._states(_QVA, q, v), _NONE))
        return both[..., 0], both[..., 1]

    def configuration_rate(self, q: Any, v: Any) -> Array:
        """dq/dt = E(q) v, shaped as q: R v for a free base's position, half q ⊗ ω for its quaternion."""
        return self._told("a rate", self._simple("configuration_rate")(*self._states(_QVA, q, v)))

    def joint_reactions(self, q: Any, v: Any, a: Any) -> Array:
        """The wrench that each joint passes on: (len(all_joint_names), 6), or (n, …, 6) for a batch.

        Force (N) then moment (N m) that the parent link exerts on the child link, in the joint's own
        (child) frame, about its origin. Rotor inertia and friction act across the joint, not through it.
        """
        flat = self._told("a wrench", self._simple("reactions")(*self._states(_QVA, q, v, a), _NONE))
        return flat.reshape(*flat.shape[:-1], len(self._tree.joints), 6)

    def link_torques(self, q: Any, v: Any, a: Any) -> Array:
        """How much of the torque each link's mass and inertia cause: (links, nv) or (n, links, nv).

        Torque is linear in masses and inertias, so the shares sum to inverse dynamics without friction
        and rotor inertia. Links and payloads in the order of `massive_links`.
        """
        q, v, a = self._states(_QVA, q, v, a)
        if not self.massive_links:
            rows = {len(x) for x in (q, v, a) if x.ndim == 2}
            return np.zeros((*rows, 0, self.nv))
        flat = self._told("a torque", self._code("link_torques", self.equations.link_torques)(q, v, a))
        return flat.reshape(*flat.shape[:-1], len(self.massive_links), self.nv)

    def link_gravity_torques(self, q: Any) -> Array:
        """Each link's share of the gravity torque: (links, nv) or (n, links, nv), as `link_torques` at rest."""
        (q,) = self._states(_QVA, q)
        if not self.massive_links:
            return np.zeros((*q.shape[:-1], 0, self.nv))
        flat = self._told("a torque", self._code("link_gravity_torques", self.equations.link_gravity_torques)(q))
        return flat.reshape(*flat.shape[:-1], len(self.massive_links), self.nv)

    def frame_pose(self, name: str, q: Any) -> tuple[Array, Array]:
        """Position (3,) or (n, 3) in m and rotation (3, 3) or (n, 3, 3) of a frame in the world."""
        rows = self._told("a pose", self._frame(name)(*self._states(_QVA, q), np.zeros(self.nv), _NONE))
        return rows[..., :3], rows[..., 3:12].reshape(*rows.shape[:-1], 3, 3)

    def frame_velocity(self, name: str, q: Any, v: Any) -> tuple[Array, Array]:
        """Linear (m/s) and angular (rad/s) velocity of a frame's origin, world axes: (3,) or (n, 3) each."""
        rows = self._told("a velocity", self._frame(name)(*self._states(_QVA, q, v), _NONE))
        return rows[..., 12:15], rows[..., 15:18]

    # ---- machine code

    @cached_property
    def _codes(self) -> dict[str, Compiled]:
        return {}

    @cached_property
    def equations(self) -> Equations:
        """The robot's equations as casadi expressions, before anything is compiled."""
        return Equations(self._tree, self.gravity, self.viscous, self.coulomb, self.friction_width)

    def dynamics(self, algorithm: str) -> Compiled:
        """The machine code of "inverse_dynamics" or "forward_dynamics", for callers that drive it themselves."""
        if type(algorithm) is not str or algorithm not in self._codes:
            arguments.one_of("algorithm", algorithm, ("inverse_dynamics", "forward_dynamics"))
        return self._code(algorithm, lambda: self.equations.dynamics(algorithm))

    def compiled(
        self, key: str, build: Callable[[], casadi.Function], seldom: bool = False, inputs: Sequence[int] = ()
    ) -> Compiled:
        """The machine code of a function that `build` makes; `key` says all it depends on besides the robot.

        One that is called `seldom` is compiled faster where it is long, and runs slower. `inputs`: the sizes of its
        first inputs.
        """
        arguments.text("key", key)
        arguments.function("build", build, "a function that makes a casadi.Function")
        sizes = [
            arguments.whole("inputs", size, least=0) for size in arguments.several("inputs", inputs, object, "sizes")
        ]
        return compiled(ascii(key)[1:-1], (self._key,), build, arguments.flag("seldom", seldom), sizes)

    def trace_frames(self, names: Iterable[str]) -> casadi.Function:
        """(q, v, p of length 0) -> per frame position 3, rotation 9 (row major), linear and angular velocity, world."""
        listed = arguments.several("names", names, str, "names of frames")
        return self.equations.frames([self._frame_index(name) for name in listed])

    def _code(self, key: str, build: Callable[[], casadi.Function]) -> Compiled:
        if key not in self._codes:
            self._codes[key] = self.compiled(key, build)
        return self._codes[key]

    def _simple(self, name: str) -> Compiled:
        return self._code(name, lambda: self.equations.algorithm(name))

    def _frame(self, name: str) -> Compiled:
        index = self._frame_index(name)
        return self._code(f"frame {index}", lambda: self.equations.frames([index]))

    def _frame_index(self, name: str) -> int:
        arguments.text("name", name, "the name of a frame")
        found = [k for k, f in enumerate(self._tree.frames) if f["name"] == name]
        if not found:
            raise InputError(f"{self.name}: " + unknown_name("frame", name, self.frame_names))
        return min(found, key=lambda k: bool(self._tree.frames[k]["is_joint"]))

    # ---- variants

    def with_payloads(self, payloads: Iterable[Payload]) -> Robot:
        """The same robot carrying these payloads too."""
        loads = arguments.several("payloads", payloads, Payload, "Payloads")
        rotor = {j.name: float(self.rotor_inertia[j.v]) for j in self.joints if j.nv == 1 and self.rotor_inertia[j.v]}
        from bellcrank.robot.load import load_robot

        robot = load_robot(
            self.source, tuple(self.gravity), self.floating_base, self._friction, payloads=(*self.payloads, *loads),
            rotor_inertia=rotor, frames=self.user_frames, clean=self._clean, friction_width=self.friction_width,
        )  # fmt: skip
        robot.mesh_source, robot.mesh_access = self.mesh_source, self.mesh_access
        return robot

    # ---- checks

    def _states(self, names: tuple[str, ...], *states: Any) -> tuple[Array, ...]:
        """Finite arrays of doubles, (n,) or (rows, n) each: q of nq numbers, any other of nv. Raises InputError."""
        out, rows = [], -1
        for name, given in zip(names, states, strict=False):
            x = given if type(given) is np.ndarray and given.dtype is _DOUBLE else self._converted(name, given)
            size = self.nq if name == "q" else self.nv
            if x.ndim not in (1, 2) or x.shape[-1] != size or (x.ndim == 2 and rows not in (-1, len(x))):
                self._refuse_shape(name, x, size, rows)
            if x.ndim == 2:
                rows = len(x)
            if not _finite(x):
                self._refuse_infinite(name, x)
            out.append(x)
        return tuple(out)

    def _converted(self, name: str, given: Any) -> Array:
        size = self.nq if name == "q" else self.nv
        return arguments.as_array(name, given, f"an array of shape ({size},) or (n, {size})", self.name)

    def _refuse_shape(self, name: str, x: Array, size: int, rows: int) -> None:
        n = rows if rows >= 0 else "n"
        arguments.refuse(name, f"an array of shape ({size},) or ({n}, {size})", x, self.name)

    def _refuse_infinite(self, name: str, x: Array) -> None:
        """Name the first number that is not finite, where there is one: the sum of finite ones may be infinite."""
        bad = np.argwhere(~np.isfinite(np.atleast_2d(x)))
        if len(bad):
            row, column = bad[0]
            raise InputError(
                f"{self.name}: argument '{name}': expected finite numbers, found {np.atleast_2d(x)[row, column]} "
                f"(sample {row}, entry {column})"
            )

    def _told(self, what: str, answer: Array) -> Array:
        """An answer, which is finite unless numbers overflowed on the way to it (InputError)."""
        if not _finite(answer) and not np.isfinite(answer).all():
            raise InputError(
                f"{self.name}: {what} overflows: the state is too far or too fast for numbers; check its units"
            )
        return answer


_NONE: Array = np.zeros(0)
LARGEST_WHOLE = 60  # joints up to which the mass matrix is one expression
BLOCK_NUMBERS = 4_000_000  # of mass matrices in memory at a time
_DOUBLE = np.dtype(np.float64)
_QVA, _QVTAU = ("q", "v", "a"), ("q", "v", "tau")


def _finite(x: Array) -> bool:
    """Whether a sum over all numbers is finite, which it is of finite ones only: a quick test before a slow one."""
    return math.isfinite(sum(x.tolist()) if x.ndim == 1 else np.vdot(x, x))


def _frozen(x: Any) -> Array:
    array = np.array(x, dtype=np.float64)
    array.setflags(write=False)
    return array


def _limits(values: list[float | None], sign: int) -> Array:
    return np.array([sign * np.inf if x is None else x for x in values], dtype=np.float64)
