"""The controllers of a scene. They add actuator torques, whose power is part of the work W.

Each entry of the list `control` has a `kind`, an optional `name`, and the keys of its kind. A gain is one number, or
{joint: number}. `limit` clamps the torque of the controller at each joint to ±limit: a number (N m or N), or "effort"
for the URDF's limits. The limit applies to one controller; two controllers at a joint may add up to the sum of their
limits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Final, Self

from bellcrank.config.fields import Fields
from bellcrank.elements.controller import ControlContext, Controller
from bellcrank.elements.controller_fields import (  # fmt: skip
    Gain,
    all_joints,
    read_gain,
    read_joints,
    read_limit,
    read_mass_error,
    read_motion_name,
)
from bellcrank.elements.element import GeneralisedForce, joint_named, joint_unit, named_entries
from bellcrank.elements.formula_controllers import FormulaTorque, StateFeedback
from bellcrank.elements.sampled_controllers import StateSpace
from bellcrank.elements.signals import SignalSource, motion_source

if TYPE_CHECKING:
    from bellcrank.elements.symbols import Symbols


@dataclass(frozen=True)
class PD(Controller):
    """τ = kp (target − θ) + kd (target rate − θ̇) at each joint.

    It acts at `joint`, or at `joints` (a list, or "all" with motors); by default at the joints of `target`, or at all
    with motors.
    `target` is a constant posture {joint: rad or m}; `motion` is a motion of the configuration, whose velocity is
    used too. kp is in N m/rad or N/m, kd in N m s/rad or N s/m.
    """

    kp: Gain
    kd: Gain
    target: Mapping[str, float] | None
    motion: SignalSource | None
    kind: ClassVar[str] = "pd"

    @classmethod
    def read(cls, name: str, read: Fields, context: ControlContext) -> Self:
        """Read it from its entry. Raises InputError naming file and key."""
        driven = context.driven
        read.known("joint", "joints", "target", "motion", "kp", "kd", "limit")
        if ("target" in read) == ("motion" in read):
            found = "both" if "target" in read else "neither"
            raise read.error("target", f"expected a 'target' {{joint: value}} or the name of a 'motion', found {found}")
        target, source = None, None
        if "target" in read:
            places = read.mapping("target")
            of = {key: joint_named(places, key, key, driven.robot) for key in places}
            target = {key: places.number(key, joint_unit(j, "position")) for key, j in of.items()}
            joints = read_joints(read, driven, tuple(of.values()), "target")
            for joint in joints:
                if joint.name not in target:
                    raise read.error("target", f"expected a value for joint '{joint.name}', found none")
            driven.checked(read, "target", tuple(of.values()))
            for unused in target.keys() - {joint.name for joint in joints}:
                raise read.error("target", f"joint '{unused}' is not one of 'joints'; add it there, or remove it here")
        else:
            joints = read_joints(read, driven, driven.joints)
            motion = read_motion_name(read, context.motions)
            source = motion_source(motion, partial(context.motion_of, motion), joints, 1)
        kp, kd = read_gain(read, "kp", joints, "stiffness"), read_gain(read, "kd", joints, "damping", 0.0)
        return cls(name, read, joints, read_limit(read, joints, driven.robot), kp, kd, target, source)

    def quantities(self) -> dict[str, str]:
        """Gains, targets and the limit."""
        return super().quantities() | {"kp": "stiffness", "kd": "damping", "target": "position"}

    @property
    def source(self) -> SignalSource | None:
        """The motion."""
        return self.motion

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        wanted = None if self.motion is None else symbols.signal(self.motion)
        torques = []
        for k, joint in enumerate(self.joints):
            angle, rate, _ = symbols.joint(joint)
            aim = self.of_joint(symbols, "target", joint) if wanted is None else wanted[k, 0]
            aim_rate = 0.0 if wanted is None else wanted[k, 1]
            kp, kd = self.of_joint(symbols, "kp", joint), self.of_joint(symbols, "kd", joint)
            torques.append(kp * (aim - angle) + kd * (aim_rate - rate))
        return self.clamped(symbols, torques)


@dataclass(frozen=True)
class ComputedTorque(Controller):
    """τ = inverse dynamics of (θ, θ̇, a) with a = θ̈_d + kd (θ̇_d − θ̇) + kp (θ_d − θ) along a motion.

    With an exact model the error e obeys ë + kd ė + kp e = 0: kd = 2 √kp is critically damped. kp 1/s², kd 1/s.
    `mass_error` scales mass and inertia of the links in the controller's model by 1 + mass_error. The model includes
    the robot's friction and rotor inertia, but not the scene's forces. Source: J. Craig, Introduction to Robotics
    (2005), ch. 10.
    """

    motion: SignalSource
    kp: Gain
    kd: Gain
    mass_error: float
    kind: ClassVar[str] = "computed_torque"

    @classmethod
    def read(cls, name: str, read: Fields, context: ControlContext) -> Self:
        """Read it from its entry. Raises InputError naming file and key."""
        driven = context.driven
        read.known("motion", "kp", "kd", "limit", "mass_error")
        robot, joints = driven.robot, all_joints(driven.robot)
        other = next((joint for joint in robot.joints if joint.nv != 1), None)
        if other is not None:
            raise read.error(
                "kind",
                f"computed_torque requires joints with one degree of freedom, '{other.name}' is {other.kind}; use pd",
            )
        free = [joint.name for joint in joints if joint not in driven.joints]
        if free:
            raise read.error(
                "kind",
                f"computed_torque requires a motor at each joint, and 'actuated' and 'actuators' name none at "
                f"{', '.join(free)}; use pd, or add the joint to 'actuated'",
            )
        motion = read_motion_name(read, context.motions)
        kp, kd = read_gain(read, "kp", joints, "1/s^2"), read_gain(read, "kd", joints, "1/s")
        source = motion_source(motion, partial(context.motion_of, motion), joints, 2)
        error = read_mass_error(read)
        return cls(name, read, joints, read_limit(read, joints, robot), source, kp, kd, error)

    def quantities(self) -> dict[str, str]:
        """Gains, the mass error and the limit."""
        return super().quantities() | {"kp": "1/s^2", "kd": "1/s", "mass_error": ""}

    @property
    def source(self) -> SignalSource | None:
        """The motion."""
        return self.motion

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        import casadi

        wanted = symbols.signal(self.motion)
        demand = casadi.SX.zeros(symbols.robot.nv, 1)
        for k, joint in enumerate(self.joints):
            angle, rate, index = symbols.joint(joint)
            kp, kd = self.of_joint(symbols, "kp", joint), self.of_joint(symbols, "kd", joint)
            demand[index] = wanted[k, 2] + kd * (wanted[k, 1] - rate) + kp * (wanted[k, 0] - angle)
        scale = 1.0 + self.value(symbols, "mass_error")
        torque = symbols.inverse_dynamics(symbols.q, symbols.v, demand, scale)
        torque += symbols.robot.equations.friction(symbols.v)
        return self.clamped(symbols, [torque[joint.v] for joint in self.joints])


@dataclass(frozen=True)
class GravityCompensation(Controller):
    """τ = the gravity torque at θ, with the masses of the links scaled by 1 + mass_error.

    It acts at `joints` (a list, or "all" with motors, the default), and not on a free base, which has none.
    """

    mass_error: float
    kind: ClassVar[str] = "gravity_compensation"

    @classmethod
    def read(cls, name: str, read: Fields, context: ControlContext) -> Self:
        """Read it from its entry. Raises InputError naming file and key."""
        driven = context.driven
        joints = read_joints(read, driven, driven.joints)
        return cls(name, read, joints, read_limit(read, joints, driven.robot), read_mass_error(read))

    def quantities(self) -> dict[str, str]:
        """The mass error and the limit."""
        return super().quantities() | {"mass_error": ""}

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        import casadi

        rest = casadi.SX(symbols.robot.nv, 1)
        torque = symbols.inverse_dynamics(symbols.q, rest, rest) * (1.0 + self.value(symbols, "mass_error"))
        return self.clamped(symbols, [torque[joint.v] for joint in self.joints])


KINDS: Final[
    dict[str, type[PD | ComputedTorque | GravityCompensation | FormulaTorque | StateFeedback | StateSpace]]
] = {cls.kind: cls for cls in (PD, ComputedTorque, GravityCompensation, FormulaTorque, StateFeedback, StateSpace)}


def read_control(read: Fields, context: ControlContext) -> tuple[Controller, ...]:
    """Read the list `control`. Raises InputError naming the key."""
    controllers: list[Controller] = []
    for name, entry in named_entries(read, "control"):
        kind = KINDS[entry.choice("kind", tuple(KINDS))]
        controllers.append(kind.read(name, entry, context))
        entry.done()
    return tuple(controllers)
