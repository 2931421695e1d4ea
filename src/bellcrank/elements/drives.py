"""Drives: the motor and gear of a joint in the loop, with the rotor, friction, the windings and the servo as states.

An entry of `actuators` with a `model` is a drive. Its figures are those of the motor and gear of the entry. With φ and
ω the rotor's angle and speed, N the ratio, q the joint's position and T the electrical torque,

    δ = φ/N − q,    F = c δ + d δ̇      with `elastic`: F acts on the joint, and J ω̇ = T − F/N − friction
    |δ| < b/2:      F = 0               with backlash b; beyond it c (|δ| − b/2) + d δ̇ sign δ pushes, and never pulls
    |δ| ≤ b/2                           with a rigid gear and backlash: F pushes at the ends, which are stops of δ
                                        (joint_stops.py); δ and δ̇ are states, J N (q̈ + δ̈) = T − F/N − friction
    F + h,  ḣ = k (δ̇ − |δ̇| h/h₀)        with hysteresis: a force h of at most h₀ that a reversal turns round
    φ = N q                             without it: N T acts on the joint, and the rotor's inertia is the joint's

`model: torque` is a motor whose torque is that of the command within the limits of the judge (short_time_limits.py):
peak torque and current, voltage and largest speed. `model: dc` is the DC equivalent of the motor, of any kind:

    L di/dt = U − R i − k_e ω,    T = k_t i,    |U| at most the bus voltage.

`model: dq` is a synchronous motor in rotor coordinates (amplitudes of phase quantities, star connection, no saliency),
with R and L half of the figures between terminals, n pole pairs, and the flux ψ = 2 k_t/(3 n) of its magnets:

    L di_d/dt = u_d − R i_d + n ω L i_q,    L di_q/dt = u_q − R i_q − n ω (L i_d + ψ),    T = k_t i_q,
    √(u_d² + u_q²) at most the bus voltage over √3.

Where the voltage does not suffice its servo weakens the field (servos.py). Source: D. Schröder, Elektrische Antriebe –
Regelung von Antriebssystemen (2015), ch. 16. With `temperatures` those of winding and housing are states, and R follows
the winding (thermal.py). With a `supply` the bus voltage is a state (supply.py).

The hysteresis is Dahl's model (P. R. Dahl, AIAA J. 14, 1976, 1675-1682): h goes to ±h₀ within a twist of about h₀/k.
The kinetic energy of a rotor is that of its spin, as with `rotor_inertia` (M. W. Spong, Modeling and control of elastic
joint robots, J. Dyn. Sys. Meas. Control 109, 1987).
Losses of a gear that depend on its load are friction at the rotor: with the load torque P = F/N, |P| (1/η − 1) where
the motor drives the load and |P| (1 − η_b) where the load drives the motor. With η_b = 0 the gear locks itself: the
second is then |P| (1/η − 1) too, as of a screw whose friction is the same both ways, and at least 1.01 |P|; it must
be elastic. The force F of a rigid gear follows from the accelerations (gear_losses.py).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Final

from bellcrank.actuators.copper import COPPER, REFERENCE
from bellcrank.elements.controller import Controller
from bellcrank.elements.element import (  # fmt: skip
    NONNEGATIVE,
    POSITIVE,
    AuxiliaryStates,
    GeneralisedForce,
    HeldSource,
    Settable,
    joint_unit,
)
from bellcrank.elements.expression import Expression, Term
from bellcrank.elements.joint_stops import GearContact
from bellcrank.elements.rotor_friction import RotorFriction
from bellcrank.elements.sampled_controllers import Instants
from bellcrank.elements.servos import Cascade, Servo
from bellcrank.elements.signals import SignalSource

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols
    from bellcrank.robot.robot import Robot, RobotJoint

MODELS: Final = ("torque", "dc", "dq")
LOSS: Final = ("coulomb", "static", "speed", "viscous")
TEMPERATURES: Final = ("winding temperature [°C]", "housing temperature [°C]")
BUS: Final = AuxiliaryStates("supply", ("bus voltage [V]", "energy of the source [J]", "energy of the resistor [J]"))
LOCKED: Final = 1.01  # of the load: what a self-locking gear holds at least, so that rounding does not set it free
Numbers = Mapping[str, float]


@dataclass(frozen=True)
class Drive(Controller):
    """The drive of one joint.

    Attributes:
        model: "torque", "dc" or "dq".
        gear: Its ratio; efficiency and back_efficiency, which a rigid gear may not state; where the rotor has states of
            its own also the inertia J at the rotor and the backlash b; with an elastic gear stiffness c and damping d,
            and hysteresis_torque h₀ with hysteresis_stiffness k where it has hysteresis; with a rigid gear that has
            backlash the restitution of its flanks.
        loss: The rotor's friction: coulomb, static, speed, viscous.
        law: How friction falls from static to Coulomb (dry_friction.py).
        circuit: Of `dc`: resistance R, inductance L, torque_constant k_t, voltage_constant k_e, and the bus voltage; of
            `dq` those of a phase with pole_pairs, the largest voltage of a phase and the peak_current, amplitudes;
            of `torque` the limits |a T + b ω| ≤ 1: a0, b0, a1, b1, …
        curve: Of `torque` the printed curve of short-time operation: speed, rad/s, and torque, N m.
        servo: The cascade of controllers; None: `command` gives torque or voltage.
        command: The torque, N m at the rotor, or the voltage of a dc model.
        heat: With states of temperature: capacities (J/K) and resistances (K/W) of winding and housing, the share of
            the friction that heats the housing, ambient, and the temperatures at the start, °C (thermal.py); R is then
            that at 25 °C.
        supplied: Whether its voltage is that of a bus with states of its own (supply.py), whose voltage at rest is
            that of `circuit`.
    """

    model: str
    gear: Numbers
    loss: Numbers
    law: str
    circuit: Numbers
    curve: tuple[tuple[float, float], ...]
    servo: Servo | None
    command: Expression | None
    heat: Numbers = field(default_factory=dict)
    supplied: bool = False
    kind: ClassVar[str] = "drive"

    @property
    def joint(self) -> RobotJoint:
        """Its joint."""
        return self.joints[0]

    @property
    def has_own_rotor(self) -> bool:
        """Whether the rotor has states of its own: its gear is elastic or has backlash."""
        return "inertia" in self.gear

    @property
    def is_elastic(self) -> bool:
        """Whether the gear is."""
        return "stiffness" in self.gear

    @property
    def has_rigid_backlash(self) -> bool:
        """Whether the gear is rigid and has a gap."""
        return self.has_own_rotor and not self.is_elastic

    @property
    def cascade(self) -> Cascade | None:
        """Its servo where that is a cascade."""
        return self.servo if isinstance(self.servo, Cascade) else None

    @property
    def settable(self) -> dict[str, Settable]:
        """All numbers but the limits of `torque`; of an elastic gear also its stiffness and damping."""
        joint, found = self.joint, dict[str, Settable]()
        units = {"resistance": "ohm", "inductance": "H", "torque_constant": "N m/A", "voltage_constant": "V s/rad"}
        if self.model != "torque":
            found |= {f"circuit.{key}": Settable(unit, POSITIVE) for key, unit in units.items() if key in self.circuit}
        if self.is_elastic:
            found["gear.stiffness"] = Settable(joint_unit(joint, "stiffness"), POSITIVE)
            found["gear.damping"] = Settable(joint_unit(joint, "damping"), NONNEGATIVE)
        if self.has_own_rotor:
            found["gear.inertia"] = Settable("kg m^2", POSITIVE)
        if self.friction is not None and self.loss["coulomb"]:
            found["loss.coulomb"] = Settable(
                "N m", POSITIVE if self.loss["static"] == self.loss["coulomb"] else NONNEGATIVE
            )
        found["loss.viscous"] = Settable("N m s/rad", NONNEGATIVE)
        return found | ({} if self.servo is None else self.servo.settable)

    def quantities(self) -> dict[str, str]:
        """None: `settable` names them all."""
        return {}

    def number(self, name: str) -> float:
        """The number of a field, such as "gear.stiffness" or "servo.speed.kp"."""
        group, _, rest = name.partition(".")
        if group == "servo":
            assert self.servo is not None
            return self.servo.number(rest)
        numbers: Numbers = getattr(self, group)
        return float(numbers[rest])

    @property
    def formulas(self) -> tuple[Expression, ...]:
        """The command, and the two sides of a backlash."""
        command = () if self.command is None else (self.command,)
        return (*command, *self._pushes) if self.is_elastic and self.has_backlash else command

    @property
    def has_hysteresis(self) -> bool:
        """Whether the torque of the gear depends on the way its twist came."""
        return "hysteresis_torque" in self.gear

    @property
    def loses_by_load(self) -> bool:
        """Whether losses of the gear depend on its load."""
        return any(self.gear.get(key, 1.0) != 1.0 for key in ("efficiency", "back_efficiency"))

    @property
    def has_backlash(self) -> bool:
        """Whether the gear has a gap."""
        return self.gear.get("backlash", 0.0) > 0.0

    def _depth(self, sign: float) -> Term:
        """How far the rotor has gone beyond the gap in a direction, at the joint."""
        own = self.auxiliary
        assert own is not None
        angle = Term("auxiliary", value=(own.name, own.labels, 0))
        twist = Term(
            "-",
            (
                Term("*", (Term("number", value=1.0 / self.gear["ratio"]), angle)),
                Term("joint", value=(self.joint.name, "position")),
            ),
        )
        half = Term("number", value=0.5 * self.gear["backlash"])
        return Term("-", (Term("*", (Term("number", value=sign), twist)), half))

    @property
    def _pushes(self) -> tuple[Expression, Expression]:
        """The forces of both sides of the gap, of which at most one is not 0."""
        own = self.auxiliary
        assert own is not None
        stiffness, damping = (
            Term("setting", value=(self.owner, self.name, f"gear.{key}", self.gear[key]))
            for key in ("stiffness", "damping")
        )
        speed = Term("*", (Term("number", value=1.0 / self.gear["ratio"]),
                           Term("auxiliary", value=(own.name, own.labels, 1))))  # fmt: skip
        rate = Term("-", (speed, Term("joint", value=(self.joint.name, "velocity"))))
        found = []
        for sign in (1.0, -1.0):
            depth = self._depth(sign)
            along = Term("*", (Term("*", (Term("number", value=sign), damping)), rate))
            push = Term("+", (Term("*", (stiffness, depth)), along))
            whole = Term("*", (Term("step", (depth,)), Term("max", (Term("number", value=0.0), push))))
            found.append(Expression("", whole, repr(whole)))
        return found[0], found[1]

    @property
    def contact(self) -> GearContact | None:
        """The flanks of a rigid gear with backlash; None for others."""
        if not self.has_rigid_backlash:
            return None
        half = 0.5 * self.gear["backlash"]
        name = f"gear_contact_{self.joint.name}"
        return GearContact(name, self.place, self.joint, -half, half, self.gear["restitution"], drive=self)

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames in the command, or in what the servo measures."""
        source = self.command if self.servo is None else self.servo
        return () if source is None else source.frames

    @property
    def source(self) -> SignalSource | None:
        """The motion that the servo follows."""
        return None if self.servo is None else self.servo.motion

    @property
    def friction(self) -> RotorFriction | None:
        """The dry friction of the rotor; None where there is none."""
        if self.loss["static"] == 0.0 and not self.loses_by_load:
            return None
        coulomb, static, speed, viscous = (self.loss[key] for key in LOSS)
        name = f"rotor_friction_{self.joint.name}"
        return RotorFriction(
            name, self.place, self.joint, coulomb, static, speed, viscous, self.law, static > coulomb, drive=self
        )

    # ---- states

    @property
    def samples(self) -> HeldSource | None:
        """What its sampled loops hold."""
        return None if self.servo is None else self.servo.held(self.name)

    @property
    def instants(self) -> tuple[Instants, ...]:
        """When its loops are sampled."""
        return () if self.servo is None else self.servo.instants

    def update(self, instant: int, symbols: Symbols) -> casadi.SX:
        """What its loops hold after one of these instants."""
        assert self.servo is not None
        return self.servo.update(instant, self, symbols)

    @property
    def auxiliary(self) -> AuxiliaryStates | None:
        """Rotor, current and the integrators of the servo."""
        labels = ["rotor position [rad]", "rotor velocity [rad/s]"] if self.is_elastic else []
        if self.has_rigid_backlash:
            labels = [
                f"twist [{joint_unit(self.joint, 'position')}]",
                f"twist rate [{joint_unit(self.joint, 'velocity')}]",
            ]
        labels += [f"hysteresis force [{joint_unit(self.joint, 'torque')}]"] if self.has_hysteresis else []
        labels += {"dc": ["current [A]"], "dq": ["q current [A]", "d current [A]"]}.get(self.model, [])
        labels += list(TEMPERATURES) if self.heat else []
        labels += [] if self.servo is None else self.servo.states
        return AuxiliaryStates(self.name, tuple(labels)) if labels else None

    @property
    def _mechanical(self) -> int:
        """How many of its states are those of rotor and gear."""
        return 2 * self.has_own_rotor + self.has_hysteresis

    def _states(self, symbols: Symbols) -> list[casadi.SX]:
        import casadi

        own = self.auxiliary
        return [] if own is None else casadi.vertsplit(symbols.auxiliary(own))

    def rotor(self, symbols: Symbols) -> tuple[casadi.SX, casadi.SX]:
        """The rotor's angle (rad) and speed (rad/s)."""
        if self.is_elastic:
            angle, speed, *_ = self._states(symbols)
            return angle, speed
        (position, velocity, _), ratio = symbols.joint(self.joint), self.gear["ratio"]
        if self.has_rigid_backlash:
            twist, rate, *_ = self._states(symbols)
            return ratio * (position + twist), ratio * (velocity + rate)
        return ratio * position, ratio * velocity

    def gear_force(self, symbols: Symbols) -> tuple[casadi.SX, casadi.SX, casadi.SX]:
        """The force of an elastic gear on the joint (N m or N), its potential energy (J) and its power loss (W)."""
        angle, speed = self.rotor(symbols)
        position, velocity, _ = symbols.joint(self.joint)
        ratio = self.gear["ratio"]
        twist, rate = angle / ratio - position, speed / ratio - velocity
        if self.has_backlash:
            return self._force_with_backlash(symbols, rate)
        stiffness, damping = self.value(symbols, "gear.stiffness"), self.value(symbols, "gear.damping")
        force, potential, lost = (
            stiffness * twist + damping * rate,
            0.5 * stiffness * twist * twist,
            damping * rate * rate,
        )
        if not self.has_hysteresis:
            return force, potential, lost
        held, slip = self._hysteresis(symbols)
        return force + held, potential + 0.5 * held * held / self.gear["hysteresis_stiffness"], lost + held * slip

    def _hysteresis(self, symbols: Symbols) -> tuple[casadi.SX, casadi.SX]:
        """The force h (N m or N), and the part of the twist's rate (rad/s or m/s) that is lost, |δ̇| h/h₀."""
        import casadi

        (_, speed), (_, velocity, _) = self.rotor(symbols), symbols.joint(self.joint)
        held = self._states(symbols)[2]
        return held, casadi.fabs(speed / self.gear["ratio"] - velocity) * held / self.gear["hysteresis_torque"]

    def _force_with_backlash(self, symbols: Symbols, rate: casadi.SX) -> tuple[casadi.SX, casadi.SX, casadi.SX]:
        sides, stiffness = symbols.sides(self), self.value(symbols, "gear.stiffness")
        force, potential, stored = symbols.zero, symbols.zero, symbols.zero
        for sign, push in zip((1.0, -1.0), self._pushes, strict=True):
            depth = self._depth(sign)
            beyond = Expression("", Term("step", (depth,))).value(symbols, None, sides)
            deep = Expression("", depth).value(symbols)
            force += sign * push.value(symbols, None, sides)
            potential += 0.5 * stiffness * beyond * deep * deep
            stored += stiffness * beyond * deep * sign * rate
        return force, potential, force * rate - stored

    @property
    def loss_shares(self) -> tuple[float, float]:
        """The losses of the gear by its load: while the motor drives the load, and while the load drives the motor."""
        driving, driven = 1.0 / self.gear["efficiency"] - 1.0, 1.0 - self.gear["back_efficiency"]
        return driving, max(driving, LOCKED) if driven == 1.0 else driven

    def load_loss(self, symbols: Symbols, direction: casadi.SX | float) -> casadi.SX:
        """The loss of an elastic gear (N m at the rotor, 0 or more) while the rotor turns in a direction, 1 or −1."""
        import casadi

        load = self.gear_force(symbols)[0] / self.gear["ratio"] * direction
        driving, driven = self.loss_shares
        return casadi.fmax(load, 0.0) * driving + casadi.fmax(-load, 0.0) * driven

    # ---- motor and servo

    def torque(self, symbols: Symbols) -> casadi.SX:
        """The electrical torque T, N m."""
        if self.model == "torque":
            torque = self.within_limits(symbols, self.commanded(symbols)[0])
        else:
            torque = self.value(symbols, "circuit.torque_constant") * self.current(symbols)
        return torque if symbols.additions is None else torque + symbols.additions.torque[self.name]

    def voltages(self, symbols: Symbols) -> list[casadi.SX]:
        """The voltage of a dc model, or of q and d, V."""
        return self.within_voltage(symbols, self.commanded(symbols))

    def currents(self, symbols: Symbols) -> list[casadi.SX]:
        """The current of a dc model, or of q and d, A."""
        first = self._mechanical
        return self._states(symbols)[first : first + (2 if self.model == "dq" else 1)]

    def current(self, symbols: Symbols) -> casadi.SX:
        """The current that gives the torque, A."""
        return self.currents(symbols)[0]

    def temperatures(self, symbols: Symbols) -> list[casadi.SX]:
        """Of winding and housing, °C."""
        first = self._mechanical + len(self.currents(symbols))
        return self._states(symbols)[first : first + 2]

    def resistance(self, symbols: Symbols, temperature: float | None = None) -> casadi.SX | float:
        """R at the temperature of the winding, or at another one (°C)."""
        cold = self.value(symbols, "circuit.resistance")
        if not self.heat:
            return cold
        warm = self.temperatures(symbols)[0] if temperature is None else temperature
        return cold * (1.0 + COPPER * (warm - REFERENCE))

    def electrical_power(self, symbols: Symbols) -> casadi.SX:
        """The power that the windings take from the bus, W; negative while they feed it."""
        pairs = zip(self.voltages(symbols), self.currents(symbols), strict=True)
        power = sum((u * i for u, i in pairs), symbols.zero)
        return 1.5 * power if self.model == "dq" else power

    def largest_voltage(self, symbols: Symbols) -> casadi.SX | None:
        """The largest voltage, V, of a phase for dq; None where no limit is known."""
        import casadi

        rest = self.circuit.get("voltage")
        if rest is None:
            return None
        if not self.supplied:
            return casadi.SX(rest)
        bus = symbols.auxiliary(BUS)[0]
        return bus / math.sqrt(3.0) if self.model == "dq" else bus

    def within_voltage(self, symbols: Symbols, voltages: list[casadi.SX]) -> list[casadi.SX]:
        """Voltages within the limit of the bus, V: those of q and d keep their ratio."""
        import casadi

        bus = self.largest_voltage(symbols)
        if bus is None:
            return voltages
        if len(voltages) == 1:
            return [casadi.fmax(casadi.fmin(voltages[0], bus), -bus)]
        share = bus / casadi.sqrt(casadi.fmax(voltages[0] ** 2 + voltages[1] ** 2, bus * bus))
        return [share * voltage for voltage in voltages]

    def electrical_speed(self, symbols: Symbols) -> casadi.SX:
        """n ω of a dq model, rad/s."""
        return self.circuit["pole_pairs"] * self.rotor(symbols)[1]

    def flux(self, symbols: Symbols) -> casadi.SX | float:
        """ψ of a dq model, V s."""
        return self.value(symbols, "circuit.torque_constant") / (1.5 * self.circuit["pole_pairs"])

    def induced_voltages(self, symbols: Symbols) -> list[casadi.SX]:
        """What the rotation induces in q and d, V."""
        (across, along), spin = self.currents(symbols), self.electrical_speed(symbols)
        inductance = self.value(symbols, "circuit.inductance")
        return [spin * (inductance * along + self.flux(symbols)), -spin * inductance * across]

    def within_limits(self, symbols: Symbols, torque: casadi.SX) -> casadi.SX:
        """A torque (N m) within the limits of the motor at the rotor's speed."""
        import casadi

        _, speed = self.rotor(symbols)
        for k in range(len(self.circuit) // 2):
            a, b = self.circuit[f"a{k}"], self.circuit[f"b{k}"]
            torque = casadi.fmax(casadi.fmin(torque, (1.0 - b * speed) / a), (-1.0 - b * speed) / a)
        if self.curve:
            most = self._on_curve(casadi.fabs(speed))
            torque = casadi.fmax(casadi.fmin(torque, most), -most)
        return torque

    def _on_curve(self, speed: casadi.SX) -> casadi.SX:
        """The torque (N m) of the printed curve at a speed of 0 or more; that of its last point beyond it."""
        import casadi

        speeds, torques = zip(*self.curve, strict=True)
        if len(speeds) == 1:
            return casadi.SX(torques[0])
        return casadi.SX(casadi.pw_lin(casadi.fmin(speed, speeds[-1]), list(speeds), list(torques)))

    def _command_over_limit(self, symbols: Symbols) -> casadi.SX:
        """The command over its limit: of torque the largest |a T + b ω|, else the voltage over that of the bus."""
        import casadi

        commands, (_, speed) = self.commanded(symbols), self.rotor(symbols)
        if self.model != "torque":
            bus = self.largest_voltage(symbols)
            assert bus is not None, "it is limited"
            return casadi.sqrt(sum(u * u for u in commands)) / bus
        command = commands[0]
        most = symbols.zero
        for k in range(len(self.circuit) // 2):
            most = casadi.fmax(most, casadi.fabs(self.circuit[f"a{k}"] * command + self.circuit[f"b{k}"] * speed))
        if self.curve:
            most = casadi.fmax(most, casadi.fabs(command) / self._on_curve(casadi.fabs(speed)))
        return most

    def commanded(self, symbols: Symbols) -> list[casadi.SX]:
        """The command: of `torque` in N m, of `dc` in V, of `dq` those of q and d, before limits."""
        if self.servo is None:
            assert self.command is not None
            return [self.command.value(symbols, None, symbols.sides(self))]
        return self.servo.command(self, symbols)

    # ---- equations

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        torque = self.torque(symbols)
        _, speed = self.rotor(symbols)
        friction = self._friction_torque(symbols)
        power = (torque + friction) * speed
        kinetic = 0.5 * self.value(symbols, "gear.inertia") * speed * speed if self.has_own_rotor else None
        if self.has_rigid_backlash:  # whose force follows from the equations of motion
            none = symbols.joint_force(self.joint.v, 0.0)
            return GeneralisedForce(none, symbols.zero, power, True, kinetic)
        if not self.is_elastic:
            force, lost = self.gear["ratio"] * (torque + friction), symbols.holding.get(self.name)
            if lost is not None:  # by the load of the gear, as soon as accelerations are known
                force, power = force + lost, power + lost * symbols.joint(self.joint).velocity
            return GeneralisedForce(symbols.joint_force(self.joint.v, force), symbols.zero, power, True)
        force, potential, lost = self.gear_force(symbols)
        return GeneralisedForce(symbols.joint_force(self.joint.v, force), potential, power - lost, True, kinetic)

    def _friction_torque(self, symbols: Symbols) -> casadi.SX:
        """The friction (N m) at the rotor that is not what keeps it at rest."""
        _, speed = self.rotor(symbols)
        friction, viscous = self.friction, -self.value(symbols, "loss.viscous") * speed
        return viscous if friction is None else viscous + friction.at_rotor(symbols)

    def auxiliary_rate(self, symbols: Symbols) -> casadi.SX:
        """The rates of its states; that of a twist rate still without the joint's acceleration (`GearContact.row`)."""
        import casadi

        _, speed = self.rotor(symbols)
        rates: list[casadi.SX] = []
        if self.has_rigid_backlash:
            torque = self.torque(symbols) + self._friction_torque(symbols)
            rates += [self._states(symbols)[1], torque / (self.value(symbols, "gear.inertia") * self.gear["ratio"])]
        if self.is_elastic:
            load = self.gear_force(symbols)[0] / self.gear["ratio"]
            rates += [
                speed,
                (self.torque(symbols) - load + self._friction_torque(symbols)) / self.value(symbols, "gear.inertia"),
            ]
        if self.has_hysteresis:
            rate = speed / self.gear["ratio"] - symbols.joint(self.joint).velocity
            rates.append(self.gear["hysteresis_stiffness"] * (rate - self._hysteresis(symbols)[1]))
        if self.model != "torque":
            resistance, inductance = self.resistance(symbols), self.value(symbols, "circuit.inductance")
            voltages, currents = self.voltages(symbols), self.currents(symbols)
            if self.model == "dc":
                induced = [self.value(symbols, "circuit.voltage_constant") * speed]
            else:
                induced = self.induced_voltages(symbols)
            rates += [
                (voltage - resistance * current - back) / inductance
                for voltage, current, back in zip(voltages, currents, induced, strict=True)
            ]
        if self.heat:
            rates += self._heating(symbols)
        if self.servo is not None:
            rates += self.servo.rates(self, symbols)
        return casadi.vertcat(*rates)

    def _heating(self, symbols: Symbols) -> list[casadi.SX]:
        """The rates of the temperatures of winding and housing, K/s."""
        import casadi

        heat, (winding, housing), (_, speed) = self.heat, self.temperatures(symbols), self.rotor(symbols)
        squares = sum((i * i for i in self.currents(symbols)), symbols.zero)
        copper = (1.5 if self.model == "dq" else 1.0) * self.resistance(symbols) * squares
        viscous, coulomb = self.value(symbols, "loss.viscous"), self.value(symbols, "loss.coulomb")
        rubbed = heat["friction_share"] * (viscous * speed * speed + coulomb * casadi.fabs(speed))
        inside = (winding - housing) / heat["winding_resistance"]
        outside = (housing - heat["ambient"]) / heat["housing_resistance"]
        return [(copper - inside) / heat["winding_capacity"], (inside - outside + rubbed) / heat["housing_capacity"]]

    def auxiliary_start(self, symbols: Symbols) -> casadi.SX:
        """Its states where it holds the joint's load at the start: the gear is wound up and the integrators are set."""
        import casadi

        position, velocity, row = symbols.joint(self.joint)
        load, ratio = symbols.load_at_start[row], self.gear["ratio"]
        speed, torque = ratio * velocity, load / ratio
        found: list[casadi.SX] = []
        if self.has_own_rotor:
            gap = 0.5 * self.gear["backlash"] * casadi.sign(load)
        if self.has_rigid_backlash:
            found += [gap, symbols.zero]
        elif self.is_elastic:
            found += [ratio * (position + load / self.value(symbols, "gear.stiffness") + gap), speed]
            found += [symbols.zero] if self.has_hysteresis else []
        if self.model != "torque":
            found.append(torque / self.value(symbols, "circuit.torque_constant"))
            found += [symbols.zero] if self.model == "dq" else []
        if self.heat:
            found += [casadi.SX(self.heat["winding"]), casadi.SX(self.heat["housing"])]
        if self.servo is not None:
            found += self.servo.start(self, symbols, casadi.SX(torque))
        return casadi.vertcat(*found)

    # ---- results

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """The columns of an output."""
        unit = joint_unit(self.joint, "torque")
        found = ["motor torque [N m]", "rotor velocity [rad/s]", f"gear output [{unit}]"]
        if self.has_own_rotor:
            found.append(f"twist [{joint_unit(self.joint, 'position')}]")
        if self.model != "torque":
            found += ["current [A]", "voltage [V]"]
            found += ["d current [A]"] if self.model == "dq" else []
            found += list(TEMPERATURES) if self.heat else []
        if self.is_limited:
            found.append("command over limit [1]")
        if self.servo is not None:
            found.append(f"tracking error [{joint_unit(self.joint, 'position')}]")
        return tuple(found)

    @property
    def is_limited(self) -> bool:
        """Whether a limit of its torque or voltage is known."""
        return bool(self.curve) or any(key in self.circuit for key in ("a0", "voltage"))

    def measure(self, symbols: Symbols) -> casadi.SX:
        """Torque of the motor, speed of the rotor, force on the joint, twist, current, voltage, and tracking error."""
        import casadi

        angle, speed = self.rotor(symbols)
        position = symbols.joint(self.joint).position
        found = [self.torque(symbols), speed, self.generalised_force(symbols).force[self.joint.v]]
        if self.contact is not None:
            found[2] -= symbols.holding.get(self.contact.name, 0.0)
            found.append(self._states(symbols)[0])
        elif self.is_elastic:
            found.append(angle / self.gear["ratio"] - position)
        elif self.friction is not None:
            found[2] += symbols.holding.get(self.friction.name, 0.0)
        if self.model == "dc":
            found += [*self.currents(symbols), *self.voltages(symbols)]
        elif self.model == "dq":
            for values in (self.currents(symbols), self.voltages(symbols)):
                found.append(casadi.sqrt(values[0] ** 2 + values[1] ** 2))
            found.append(self.currents(symbols)[1])
        if self.heat:
            found += self.temperatures(symbols)
        if self.is_limited:
            found.append(self._command_over_limit(symbols))
        if self.servo is not None:
            found.append(self.servo.wanted(self, symbols)[0] - position)
        return casadi.vertcat(*found)
