"""The servo of a drive: a cascade of controllers of position (P), speed (PI) and current (PI), as in industrial drives.

With the rotor's angle φ and speed ω, the ratio N, and a reference q_r with its derivatives,

    ω_r = N (k_p (q_r − position) + f_v q̇_r)          position: kp (1/s); `feedforward.speed` f_v
    T_r = kp (ω_r − ω) + s + f_T T_m,   ṡ = kp/ti (ω_r − ω)          speed: kp (N m s/rad), ti (s)
    U   = kp (T_r/k_t − i) + w,         ẇ = ki (T_r/k_t − i)          current: kp (V/A), ki (V/(A s)); model dc

where `position` is that of the rotor, φ/N, or of the joint (`encoder: load`), and T_m the torque that the robot's
inverse dynamics asks along the motion (`feedforward.torque`). At a limit of torque or voltage the integrators are led
back by the difference that the limit cuts off (back-calculation: K. J. Åström and T. Hägglund, Advanced PID Control
(2006), sec. 3.5). Sources: D. Schröder, Elektrische Antriebe – Regelung von Antriebssystemen (2015), ch. 8.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final

from bellcrank.config.fields import Fields
from bellcrank.elements.controller import ControlContext
from bellcrank.elements.controller_fields import all_joints, read_motion_name
from bellcrank.elements.element import ANY, NONNEGATIVE, POSITIVE, Bound, Settable, joint_unit, number
from bellcrank.elements.expression import Expression
from bellcrank.elements.signals import SignalSource, motion_source

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.drives import Drive
    from bellcrank.elements.symbols import Symbols
    from bellcrank.robot.robot import RobotJoint

ENCODERS: Final = ("motor", "load")
LOOPS: Final[Mapping[str, Mapping[str, tuple[str, Bound]]]] = {
    "position": {"kp": ("1/s", NONNEGATIVE)},
    "speed": {"kp": ("N m s/rad", POSITIVE), "ti": ("s", POSITIVE)},
    "current": {"kp": ("V/A", NONNEGATIVE), "ki": ("V/A/s", NONNEGATIVE)},
}
COMMANDS: Final = {"torque": ("torque", "N m"), "dc": ("voltage", "V")}  # by model


@dataclass(frozen=True)
class Servo:
    """A cascade.

    Attributes:
        motion: The reference of all joints of one degree of freedom, with two derivatives; None: `target` is constant.
        place: Which of them is this joint.
        target: rad or m.
        position: kp.
        speed: kp, and ti where it integrates.
        current: kp and ki, of model dc.
        feedforward: Shares of speed and torque.
        encoder: Where the position is measured, "motor" or "load".
    """

    motion: SignalSource | None
    place: int
    target: float
    position: Mapping[str, float]
    speed: Mapping[str, float]
    current: Mapping[str, float]
    feedforward: Mapping[str, float]
    encoder: str

    @property
    def settable(self) -> dict[str, Settable]:
        """The gains."""
        return {f"servo.{loop}.{key}": Settable(*LOOPS[loop][key]) for loop in LOOPS for key in getattr(self, loop)} | (
            {} if self.motion is not None else {"servo.target": Settable("", ANY)}
        )

    def number(self, name: str) -> float:
        """The number of a gain, such as "speed.kp"."""
        loop, _, key = name.partition(".")
        return float(getattr(self, loop)[key] if key else getattr(self, loop))

    @property
    def states(self) -> list[str]:
        """Its integrators, with units."""
        return [
            *(["speed integrator [N m]"] if "ti" in self.speed else []),
            *(["current integrator [V]"] if self.current else []),
        ]

    def _own(self, drive: Drive, symbols: Symbols) -> list[casadi.SX]:
        """The integrators."""
        import casadi

        states = drive.auxiliary
        if states is None or not self.states:
            return []
        return casadi.vertsplit(symbols.auxiliary(states))[-len(self.states) :]

    def wanted(self, drive: Drive, symbols: Symbols) -> tuple[casadi.SX, casadi.SX, casadi.SX]:
        """The joint's reference, its velocity and its acceleration."""
        if self.motion is None:
            return symbols.zero + drive.value(symbols, "servo.target"), symbols.zero, symbols.zero
        found = symbols.signal(self.motion)
        return found[self.place, 0], found[self.place, 1], found[self.place, 2]

    def _speed_error(self, drive: Drive, symbols: Symbols) -> casadi.SX:
        """ω_r − ω."""
        ratio = drive.gear["ratio"]
        place, rate, _ = self.wanted(drive, symbols)
        angle, speed = drive.rotor(symbols)
        measured = angle / ratio if self.encoder == "motor" else symbols.joint(drive.joint).position
        error = drive.value(symbols, "servo.position.kp") * (place - measured)
        return ratio * (error + self.feedforward["speed"] * rate) - speed

    def _torque_ahead(self, drive: Drive, symbols: Symbols) -> casadi.SX:
        """The torque that the motion requires at the rotor, rotor included."""
        import casadi

        if self.motion is None or not self.feedforward["torque"]:
            return symbols.zero
        robot, wanted = symbols.robot, symbols.signal(self.motion)
        q, v, a = casadi.SX(robot.nq, 1), casadi.SX(robot.nv, 1), casadi.SX(robot.nv, 1)
        for k, joint in enumerate(all_joints(robot)):
            q[joint.q], v[joint.v], a[joint.v] = wanted[k, 0], wanted[k, 1], wanted[k, 2]
        load = symbols.inverse_dynamics(q, v, a)[drive.joint.v]
        ratio = drive.gear["ratio"]
        own = drive.value(symbols, "gear.inertia") * ratio * a[drive.joint.v] if drive.is_elastic else 0.0
        return self.feedforward["torque"] * (load / ratio + own)

    def _torques(self, drive: Drive, symbols: Symbols) -> tuple[casadi.SX, casadi.SX]:
        """The torque that the speed controller asks, and what the limits leave of it."""
        import casadi

        error = self._speed_error(drive, symbols)
        asked = drive.value(symbols, "servo.speed.kp") * error + self._torque_ahead(drive, symbols)
        if "ti" in self.speed:
            asked += self._own(drive, symbols)[0]
        if drive.model == "torque":
            return asked, drive.within_limits(symbols, asked)
        most = drive.circuit.get("peak_torque")
        return asked, asked if most is None else casadi.fmax(casadi.fmin(asked, most), -most)

    def _current_error(self, drive: Drive, symbols: Symbols) -> casadi.SX:
        _, torque = self._torques(drive, symbols)
        return torque / drive.value(symbols, "circuit.torque_constant") - drive.current(symbols)

    def command(self, drive: Drive, symbols: Symbols) -> casadi.SX:
        """The torque (N m), or the voltage (V) of model dc, before its limits."""
        if drive.model == "torque":
            return self._torques(drive, symbols)[0]
        proportional = drive.value(symbols, "servo.current.kp") * self._current_error(drive, symbols)
        return proportional + self._own(drive, symbols)[-1]

    def rates(self, drive: Drive, symbols: Symbols) -> list[casadi.SX]:
        """The rates of the integrators."""
        found = []
        if "ti" in self.speed:
            asked, torque = self._torques(drive, symbols)
            kp, ti = (drive.value(symbols, f"servo.speed.{key}") for key in ("kp", "ti"))
            found.append((kp * self._speed_error(drive, symbols) + torque - asked) / ti)
        if self.current:
            ki = drive.value(symbols, "servo.current.ki")
            command = self.command(drive, symbols)
            excess = drive.within_voltage(command) - command
            # led back as fast as the winding's current follows the voltage
            back = drive.value(symbols, "circuit.resistance") / drive.value(symbols, "circuit.inductance")
            found.append(ki * self._current_error(drive, symbols) + back * excess)
        return found

    def start(self, drive: Drive, symbols: Symbols, torque: casadi.SX) -> list[casadi.SX]:
        """The integrators at the start, where the drive exerts a torque (N m) at the rotor."""
        found: list[casadi.SX] = []
        if "ti" in self.speed:
            found.append(torque - self._torque_ahead(drive, symbols) - self._start_error(drive, symbols, torque))
        if self.current:
            _, velocity, _ = symbols.joint(drive.joint)
            resistance, constant = (drive.value(symbols, f"circuit.{k}") for k in ("resistance", "voltage_constant"))
            current = torque / drive.value(symbols, "circuit.torque_constant")
            found.append(resistance * current + constant * drive.gear["ratio"] * velocity)
        return found

    def _start_error(self, drive: Drive, symbols: Symbols, torque: casadi.SX) -> casadi.SX:
        """The proportional part of the speed controller at the start."""
        ratio = drive.gear["ratio"]
        place, rate, _ = self.wanted(drive, symbols)
        position, velocity, _ = symbols.joint(drive.joint)
        wound = ratio * torque / drive.value(symbols, "gear.stiffness") if drive.is_elastic else 0.0
        measured = position + wound if self.encoder == "motor" else position
        error = drive.value(symbols, "servo.position.kp") * (place - measured) + self.feedforward["speed"] * rate
        return drive.value(symbols, "servo.speed.kp") * ratio * (error - velocity)


def read_servo(
    entry: Fields, joint: RobotJoint, model: str, context: ControlContext
) -> tuple[Servo | None, Expression | None]:
    """Read `servo`: a cascade, or a formula of torque or voltage. Raises InputError naming file and key."""
    read = entry.mapping("servo")
    name, unit = COMMANDS[model]
    read.known("torque", "voltage")
    if "torque" in read or "voltage" in read:
        read.only((name,))
        return None, context.formulas.read(read, name, unit)
    read.only(("motion", "target", "position", "speed", "current", "feedforward", "encoder"))
    if ("target" in read) == ("motion" in read):
        found = "both" if "target" in read else "neither"
        raise read.error("target", f"expected a constant 'target' or the name of a 'motion', found {found}")
    joints = all_joints(context.driven.robot)
    source, target = None, 0.0
    if "motion" in read:
        motion = read_motion_name(read, context.motions)
        source = motion_source(motion, partial(context.motion_of, motion), joints, 2)
    else:
        target = read.number("target", joint_unit(joint, "position"))
    position, speed = _gains(read, "position"), _gains(read, "speed", optional=("ti",))
    current = {} if model != "dc" else _gains(read, "current")
    if model != "dc" and "current" in read:
        raise read.error("current", "model: torque has no current; write model: dc, or remove 'current'")
    ahead = read.mapping("feedforward", {})
    ahead.only(("speed", "torque"))
    shares = {key: number(ahead, key, "", 1.0 if key == "speed" else 0.0, NONNEGATIVE) for key in ("speed", "torque")}
    if shares["torque"] and (source is None or any(j.nv != 1 for j in context.driven.robot.joints)):
        raise ahead.error("torque", "feed-forward of torque requires a 'motion' of a robot without free or ball joints")
    ahead.done()
    encoder = read.choice("encoder", ENCODERS, "motor")
    read.done()
    place = [each.name for each in joints].index(joint.name)
    return Servo(source, place, target, position, speed, current, shares, encoder), None


def _gains(read: Fields, loop: str, optional: tuple[str, ...] = ()) -> dict[str, float]:
    own = read.mapping(loop)
    own.only(tuple(LOOPS[loop]))
    found = {
        key: number(own, key, unit, bound=bound)
        for key, (unit, bound) in LOOPS[loop].items()
        if key in own or key not in optional
    }
    own.done()
    return found
