"""The forces of a scene: the kinds that its file may name, with bushings and springs of spherical joints.

Each entry of the list `forces` has a `kind`, an optional `name`, and the keys of its kind (joint_forces.py,
frame_forces.py and here), in SI units unless other units are written. The work W of a simulation is that
of the forces without a potential.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final, Self

import numpy as np

from bellcrank.config.fields import Fields
from bellcrank.elements.element import NONNEGATIVE, Force, GeneralisedForce, Settable, named_entries, number, read_frame
from bellcrank.elements.formulas import FormulaReader
from bellcrank.elements.frame_forces import Spring, Wrench
from bellcrank.elements.joint_forces import Damper, Friction, JointForce, JointLoad, JointSpring, Torque
from bellcrank.errors import InputError
from bellcrank.motion.kinematics.rotations import from_matrices, from_rpy
from bellcrank.numerics import length
from bellcrank.robot.robot import Robot, RobotJoint

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols


FIELDS = {
    "torque_stiffness": "N m/rad", "torque_damping": "N m s/rad", "force_stiffness": "N/m", "force_damping": "N s/m"
}  # fmt: skip
ZEROS = (0.0, 0.0, 0.0)
UNITS: Final = {"stiffness": "N m/rad", "damping": "N m s/rad"}
NO_ROTATION: Final = 1e-100  # keeps the direction of the rotation defined where there is none


@dataclass(frozen=True)
class Bushing(Force):
    """Springs and dampers that hold frame_b at frame_a, along and about three axes.

    R turns b to a, with the angles roll, pitch and yaw q: R = Rz(q₃) Ry(q₂) Rx(q₁). The torque on b is t with
    t · ω = τ · q̇ for every angular velocity ω of b in a, and τ = −torque_stiffness q − torque_damping q̇. With the
    vector x from the origin of a to that of b, in the axes halfway between a and b (R½² = R), the force on b is
    f = −force_stiffness x − force_damping ẋ, at the point halfway between the origins; a bears the opposite. ẋ is the
    rate of x in axes that turn with half the angular velocity of b in a, which is that of the halfway axes where the
    axis of the turn is fixed. Angles are singular at a pitch of ±90° and at a turn of 180°. All of its power is part of
    the work W. Source: Drake, LinearBushingRollPitchYaw.
    """

    frame_a: str
    frame_b: str
    torque_stiffness: tuple[float, ...]
    torque_damping: tuple[float, ...]
    force_stiffness: tuple[float, ...]
    force_damping: tuple[float, ...]
    kind: ClassVar[str] = "bushing"

    @classmethod
    def read(cls, name: str, read: Fields, formulas: FormulaReader) -> Self:
        """Read it from its entry. Raises InputError naming file and key."""
        read.known("frame_a", "frame_b", *FIELDS)
        a, b = (read_frame(read, formulas.robot, key) for key in ("frame_a", "frame_b"))
        if a == b:
            raise read.error("frame_b", f"expected two different frames, found '{a}' twice")
        numbers = [read.vector(key, 3, unit, ZEROS) for key, unit in FIELDS.items()]
        for key, values in zip(FIELDS, numbers, strict=True):
            if min(values) < 0.0:
                raise read.error(key, f"expected numbers of 0 or more, found {min(values):g}")
        return cls(name, read, a, b, *numbers)

    @property
    def settable(self) -> dict[str, Settable]:
        """Every number can be set."""
        return {f"{key}.{c}": Settable(unit, NONNEGATIVE) for key, unit in FIELDS.items() for c in "xyz"}

    @property
    def frames(self) -> tuple[str, ...]:
        """The two frames."""
        return (self.frame_a, self.frame_b)

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        import casadi

        force, power = casadi.SX.zeros(symbols.v.shape[0], 1), symbols.zero
        for frame, wrench in self.wrenches(symbols):
            at = symbols.frame(frame)
            velocity = casadi.vertcat(at.linear, at.angular)
            force += casadi.jtimes(velocity, symbols.v, wrench, True)
            power += casadi.dot(wrench, velocity)
        return GeneralisedForce(force, symbols.zero, power, False)

    def wrenches(self, symbols: Symbols) -> tuple[tuple[str, casadi.SX], ...]:
        """Force and moment on both bodies, at the origins of the frames."""
        import casadi

        way, force, torque = self._loads(symbols)
        arm = casadi.cross(way, force) / 2.0
        on_b, on_a = casadi.vertcat(force, torque - arm), casadi.vertcat(-force, -torque - arm)
        return ((self.frame_a, on_a), (self.frame_b, on_b))

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """Components of force and torque on b in world axes."""
        return (*(f"{c} [N]" for c in "xyz"), *(f"r{c} [N m]" for c in "xyz"))

    def measure(self, symbols: Symbols) -> casadi.SX:
        """Force (3), N, and torque (3), N m, on frame_b, in world axes."""
        import casadi

        return casadi.vertcat(*self._loads(symbols)[1:])

    def _loads(self, symbols: Symbols) -> tuple[casadi.SX, casadi.SX, casadi.SX]:
        """The vector from a to b, and force and torque on b, in world axes."""
        import casadi

        a, b = symbols.frame(self.frame_a), symbols.frame(self.frame_b)
        way = b.position - a.position
        turn = a.rotation.T @ b.rotation
        spin = a.rotation.T @ (b.angular - a.angular)  # of b in a, in the axes of a
        slide = a.rotation.T @ (b.linear - a.linear - casadi.cross(a.angular, way))  # the rate of `way` in a
        q = _roll_pitch_yaw(turn)
        axes = _axes(q)
        rates = casadi.solve(axes, spin)
        stiff, damp = (self.vector(symbols, f"torque_{what}") for what in ("stiffness", "damping"))
        torque = a.rotation @ casadi.solve(axes.T, -stiff * q - damp * rates)
        half, from_a = _halfway(turn), a.rotation.T @ way
        x, speed = half.T @ from_a, half.T @ (slide - casadi.cross(spin, from_a) / 2.0)
        stiff, damp = (self.vector(symbols, f"force_{what}") for what in ("stiffness", "damping"))
        return way, a.rotation @ half @ (-stiff * x - damp * speed), torque


def _roll_pitch_yaw(turn: casadi.SX) -> casadi.SX:
    """The angles of Rz(yaw) Ry(pitch) Rx(roll)."""
    import casadi

    pitch = casadi.atan2(-turn[2, 0], casadi.sqrt(turn[0, 0] ** 2 + turn[1, 0] ** 2))
    return casadi.vertcat(casadi.atan2(turn[2, 1], turn[2, 2]), pitch, casadi.atan2(turn[1, 0], turn[0, 0]))


def _axes(q: casadi.SX) -> casadi.SX:
    """The axes (3, 3) about which roll, pitch and yaw turn: ω = axes q̇."""
    import casadi

    cy, sy, cp, sp = casadi.cos(q[2]), casadi.sin(q[2]), casadi.cos(q[1]), casadi.sin(q[1])
    return casadi.horzcat(casadi.vertcat(cy * cp, sy * cp, -sp), casadi.vertcat(-sy, cy, 0), casadi.SX([0, 0, 1]))


def _halfway(turn: casadi.SX) -> casadi.SX:
    """The rotation (3, 3) of half the angle: the quaternion (1 + w, v) has half the angle of (w, v)."""
    import casadi

    w = casadi.sqrt(1.0 + turn[0, 0] + turn[1, 1] + turn[2, 2]) / 2.0
    twice = casadi.vertcat(turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1])
    v = twice / (4.0 * w)
    norm = casadi.sqrt((1.0 + w) ** 2 + casadi.dot(v, v))
    c, u = (1.0 + w) / norm, v / norm
    return (c * c - casadi.dot(u, u)) * casadi.SX.eye(3) + 2.0 * (u @ u.T + c * casadi.skew(u))


@dataclass(frozen=True)
class SphericalSpring(Force):
    """τ = −stiffness θ e − damping ω, with V = ½ stiffness θ², in the axes of the child link.

    θ e is the rotation vector from the reference to the joint's orientation, θ from 0 to π (at π its axis e jumps), and
    ω the angular velocity of the child relative to the parent. This is the spring of a ball joint of MuJoCo (its
    computation of passive forces). stiffness is in N m/rad, damping in N m s/rad (0 by default).
    """

    joint: RobotJoint
    stiffness: float
    damping: float
    rest: tuple[float, ...]  # unit quaternion x y z w
    kind: ClassVar[str] = "spherical_spring"

    @classmethod
    def read(cls, name: str, read: Fields, formulas: FormulaReader) -> Self:
        """Read it from its entry. Raises InputError naming file and key."""
        robot = formulas.robot
        read.known("joint", *UNITS, "rpy", "quaternion_xyzw")
        try:
            joint = robot.joint(read.text("joint"))
        except InputError as error:
            raise read.error("joint", error.reason) from None
        if joint.kind != "spherical":
            raise read.error(
                "joint",
                f"joint '{joint.name}' is {joint.kind}; expected a spherical joint (joint_spring is for others)",
            )
        stiffness, damping = (number(read, key, unit, 0.0, NONNEGATIVE) for key, unit in UNITS.items())
        return cls(name, read, joint, stiffness, damping, _rest(read))

    @property
    def settable(self) -> dict[str, Settable]:
        """Stiffness and damping can be set."""
        return {key: Settable(unit, NONNEGATIVE) for key, unit in UNITS.items()}

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        import casadi

        joint, (stiffness, damping) = self.joint, (self.value(symbols, key) for key in UNITS)
        place, rate = slice(joint.v, joint.v + 3), symbols.v[joint.v : joint.v + 3]
        vector, scalar = _relative(self.rest, symbols.q[joint.q : joint.q + 4])
        size = casadi.sqrt(casadi.sumsqr(vector) + NO_ROTATION**2)
        angle = 2.0 * casadi.atan2(size, casadi.fabs(scalar))
        turned = casadi.if_else(scalar < 0.0, -1.0, 1.0) * (angle / size) * vector
        force = casadi.SX.zeros(symbols.robot.nv, 1)
        force[place] = -stiffness * turned - damping * rate
        return GeneralisedForce(force, 0.5 * stiffness * angle * angle, -damping * casadi.sumsqr(rate), False)

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """The torque on the child link, in its axes."""
        return tuple(f"r{c} [N m]" for c in "xyz")

    def measure(self, symbols: Symbols) -> casadi.SX:
        """The torque on the child link (3), N m, in its axes."""
        return self.generalised_force(symbols).force[self.joint.v : self.joint.v + 3]


def _relative(rest: tuple[float, ...], q: casadi.SX) -> tuple[casadi.SX, casadi.SX]:
    """Vector (3) and scalar part of the quaternion rest⁻¹ ⊗ q, both x y z w."""
    import casadi

    u, w = casadi.DM(rest[:3]), rest[3]
    v, s = q[:3], q[3]
    return w * v - s * u - casadi.cross(u, v), w * s + casadi.dot(u, v)


def _rest(read: Fields) -> tuple[float, ...]:
    """The reference orientation, as a unit quaternion x y z w; none without the keys `rpy` and `quaternion_xyzw`."""
    if "rpy" in read and "quaternion_xyzw" in read:
        raise read.error("rpy", "expected 'rpy' or 'quaternion_xyzw', found both")
    if "quaternion_xyzw" not in read:
        angles = np.array(read.vector("rpy", 3, "rad", (0.0, 0.0, 0.0)))
        return tuple(from_matrices(from_rpy(angles)).tolist())
    given = np.array(read.vector("quaternion_xyzw", 4))
    size = length(given)
    if not 0.999 <= size <= 1.001:
        raise read.error("quaternion_xyzw", f"expected a quaternion x y z w of length 1, found length {size:.6g}")
    return tuple((given / size).tolist())


KINDS: Final[dict[str, type[JointForce | SphericalSpring | Spring | Wrench | Bushing]]] = {
    cls.kind: cls
    for cls in (JointSpring, SphericalSpring, Spring, Damper, Friction, Torque, JointLoad, Wrench, Bushing)
}


def read_forces(read: Fields, formulas: FormulaReader) -> tuple[Force, ...]:
    """Read the list `forces` of a scene. Raises InputError naming file and key."""
    forces: list[Force] = []
    for name, entry in named_entries(read, "forces"):
        kind = KINDS[entry.choice("kind", tuple(KINDS))]
        forces.append(kind.read(name, entry, formulas))
        entry.done()
    return tuple(forces)
