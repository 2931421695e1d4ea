"""A spring that turns a spherical joint towards a reference orientation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final, Self

import numpy as np

from bellcrank.config.fields import Fields
from bellcrank.elements.element import NONNEGATIVE, Force, GeneralisedForce, Settable, number
from bellcrank.elements.formulas import FormulaReader
from bellcrank.errors import InputError
from bellcrank.motion.kinematics.quaternions import from_matrices
from bellcrank.motion.kinematics.rotations import from_rpy
from bellcrank.numerics import length
from bellcrank.robot.robot import Robot, RobotJoint

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols

UNITS: Final = {"stiffness": "N m/rad", "damping": "N m s/rad"}
NO_ROTATION: Final = 1e-100  # keeps the direction of the rotation defined where there is none


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
            raise read.error("joint", str(error).removeprefix(f"{robot.name}: ")) from None
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
