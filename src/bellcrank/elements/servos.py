"""The servo of a drive: a cascade of controllers of position (P), speed (PI) and current (PI), as in industrial drives.

With the rotor's angle φ and speed ω, the ratio N, and a reference q_r with its derivatives,

    ω_r = N (k_p (q_r − position) + f_v q̇_r)          position: kp (1/s); `feedforward.speed` f_v
    T_r = kp (ω_r − ω) + s + f_T T_m,   ṡ = kp/ti (ω_r − ω)          speed: kp (N m s/rad), ti (s)
    U   = kp (T_r/k_t − i) + w,         ẇ = ki (T_r/k_t − i)          current: kp (V/A), ki (V/(A s)); models dc and dq

where `position` is that of the rotor, φ/N, or of the joint (`encoder: load`), and T_m the torque that the robot's
inverse dynamics asks along the motion (`feedforward.torque`). At a limit of torque or voltage the integrators are led
back by the difference that the limit cuts off (back-calculation: K. J. Åström and T. Hägglund, Advanced PID Control
(2006), sec. 3.5). Sources: D. Schröder, Elektrische Antriebe – Regelung von Antriebssystemen (2015), ch. 8.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from bellcrank.elements.controller import all_joints
from bellcrank.elements.element import ANY, NONNEGATIVE, POSITIVE, Bound, HeldSource, Settable, held_source
from bellcrank.elements.sampled_controllers import ROUNDING, Instants, samples_of
from bellcrank.elements.signals import SignalSource

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.drives import Drive
    from bellcrank.elements.symbols import Symbols

LOOPS: Final[Mapping[str, Mapping[str, tuple[str, Bound]]]] = {
    "position": {"kp": ("1/s", NONNEGATIVE)},
    "speed": {"kp": ("N m s/rad", POSITIVE), "ti": ("s", POSITIVE)},
    "current": {"kp": ("V/A", NONNEGATIVE), "ki": ("V/A/s", NONNEGATIVE)},
}
BEGINNINGS: Final[Mapping[str, list[str]]] = {
    "position": ["speed reference at the start [rad/s]"],
    "speed": ["speed integrator at the start [N m]", "encoder before the start [rad]", "torque at the start [N m]"],
    "current": ["current integrator at the start [V]", "voltage at the start [V]"],
}
CONTINUOUS: Final = ["q current integrator [V]", "d current integrator [V]"]
OF_TWO_AXES: Final = ["q current integrator at the start [V]", "d current integrator at the start [V]",
                      "q voltage at the start [V]", "d voltage at the start [V]"]  # fmt: skip
WEAKENING: Final = (
    0.95  # of the largest voltage: where a field is weakened, the rest is left to the current controllers
)
LEAST_SHARE: Final = 0.1  # of the largest voltage, that is left for what the rotation induces at any current
LEAST_SPEED: Final = 1e-9  # rad/s, below which the induced voltage is not looked at


@dataclass(frozen=True)
class Servo:
    """What commands a drive so that its joint follows a motion.

    Attributes:
        motion: The reference of all joints of one degree of freedom, with two derivatives; None: `target` is constant.
        place: Which of them is this joint.
        target: rad or m.
        encoder: Where the position is measured, "motor" or "load".
    """

    motion: SignalSource | None
    place: int
    target: float
    encoder: str

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames in its formulas."""
        return ()

    @property
    def settable(self) -> dict[str, Settable]:
        """The target, where there is no motion."""
        return {} if self.motion is not None else {"servo.target": Settable("", ANY)}

    def number(self, name: str) -> float:
        """The number of a field."""
        return float(getattr(self, name))

    def wanted(self, drive: Drive, symbols: Symbols) -> tuple[casadi.SX, casadi.SX, casadi.SX]:
        """The joint's reference, its velocity and its acceleration."""
        more = symbols.zero if symbols.additions is None else symbols.additions.reference[drive.name]
        if self.motion is None:
            return more + drive.value(symbols, "servo.target"), symbols.zero, symbols.zero
        found = symbols.signal(self.motion)
        return found[self.place, 0] + more, found[self.place, 1], found[self.place, 2]

    @property
    def states(self) -> list[str]:
        """Its states among those of the drive, with units."""
        return []

    @property
    def constant(self) -> list[bool]:
        """Whether each of these states is constant."""
        return []

    def start(self, drive: Drive, symbols: Symbols, torque: casadi.SX) -> list[casadi.SX]:
        """Its states at the start, where the drive exerts a torque (N m) at the rotor."""
        return []

    def rates(self, drive: Drive, symbols: Symbols) -> list[casadi.SX]:
        """The rates of its states."""
        return []

    def held(self, name: str) -> HeldSource | None:
        """What its samples hold, at the start of a run."""
        return None

    @property
    def instants(self) -> tuple[Instants, ...]:
        """When it is sampled."""
        return ()

    def update(self, instant: int, drive: Drive, symbols: Symbols) -> casadi.SX:
        """What it holds after one of its instants."""
        raise NotImplementedError

    def command(self, drive: Drive, symbols: Symbols) -> list[casadi.SX]:
        """The torque (N m), or the voltage (V) of model dc, those of q and d of dq, before limits."""
        raise NotImplementedError

    def error_at(self, drive: Drive, symbols: Symbols) -> casadi.SX:
        """What is 0 where the servo holds a posture."""
        raise NotImplementedError


@dataclass(frozen=True)
class Cascade(Servo):
    """A cascade.

    Attributes:
        position: kp.
        speed: kp, and ti where it integrates.
        current: kp and ki, of model dc.
        feedforward: Shares of speed and torque.
        samples: The sample times of the loops that are sampled, s.
        delay: Of the output of the innermost sampled loop, s.
        resolution: Of the encoder, rad at the rotor; 0: it is exact.
        clock: That of the start of the simulation, s.
        holds: What the sampled loops held at the end of the run that is continued.
        axes: Of the current: 2 of model dq, else 1.
        gains: "given", "auto" where they are to be found (simulation/integration/automatic_gains.py), or "found".
    """

    position: Mapping[str, float]
    speed: Mapping[str, float]
    current: Mapping[str, float]
    feedforward: Mapping[str, float]
    samples: Mapping[str, float]
    delay: float
    resolution: float
    clock: float
    holds: tuple[float, ...]
    gains: str
    axes: int

    @property
    def settable(self) -> dict[str, Settable]:
        """The gains that are given."""
        own = super().settable
        if self.gains != "given":
            return own
        gains = {f"servo.{loop}.{key}": Settable(*LOOPS[loop][key]) for loop in LOOPS for key in getattr(self, loop)}
        return gains | own

    def number(self, name: str) -> float:
        """The number of a gain, such as "speed.kp"."""
        loop, _, key = name.partition(".")
        return float(getattr(self, loop)[key] if key else getattr(self, loop))

    def described(self) -> str:
        """Its gains in words."""
        parts = []
        for loop, gains in LOOPS.items():
            own = getattr(self, loop)
            if own:
                parts.append(f"{loop} {', '.join(f'{key} {own[key]:.5g} {gains[key][0]}' for key in own)}")
        return "; ".join(parts)

    @property
    def states(self) -> list[str]:
        """The integrators of its continuous loops, and what the sampled ones begin with, with units.

        The latter are constant: what a sampled loop holds is the difference from it.
        """
        found: list[str] = []
        for loop in LOOPS:
            if loop in self.samples:
                found += self._beginnings(loop)
            elif loop == "speed" and "ti" in self.speed:
                found.append("speed integrator [N m]")
            elif loop == "current" and self.current:
                found += ["current integrator [V]"] if self.axes == 1 else CONTINUOUS
        return found

    def _beginnings(self, loop: str) -> list[str]:
        return OF_TWO_AXES if loop == "current" and self.axes == 2 else BEGINNINGS[loop]

    def _width(self, loop: str) -> int:
        """How many outputs a loop has."""
        return self.axes if loop == "current" else 1

    def _integrators(self, loop: str) -> int:
        return self._width(loop) if self._integrates(loop) else 0

    def _states(self, drive: Drive, symbols: Symbols) -> dict[str, list[casadi.SX]]:
        """These states by loop."""
        import casadi

        own = drive.auxiliary
        found: dict[str, list[casadi.SX]] = {}
        if own is None:
            return found
        values = casadi.vertsplit(symbols.auxiliary(own))[own.size - len(self.states) :]
        for loop in LOOPS:
            count = len(self._beginnings(loop)) if loop in self.samples else self._integrators(loop)
            found[loop], values = values[:count], values[count:]
        return found

    def _integrates(self, loop: str) -> bool:
        return (loop == "speed" and "ti" in self.speed) or (loop == "current" and bool(self.current))

    def _integrator(self, drive: Drive, symbols: Symbols, loop: str) -> casadi.SX:
        """The integrator of a loop, 0 where it has none."""
        if not self._integrates(loop):
            return symbols.zero
        return (self._held if loop in self.samples else self._states)(drive, symbols)[loop][0]

    @property
    def constant(self) -> list[bool]:
        """Whether each of these states is constant."""
        return [
            loop in self.samples
            for loop in LOOPS
            for _ in range(len(self._beginnings(loop)) if loop in self.samples else self._integrators(loop))
        ]

    # ---- samples

    @property
    def _innermost(self) -> str:
        """The sampled loop whose output waits for the delay."""
        return [loop for loop in LOOPS if loop in self.samples][-1]

    @property
    def _waiting(self) -> int:
        return math.floor(self.delay / self.samples[self._innermost] + ROUNDING)

    @property
    def _rest(self) -> float:
        """The part of the delay that is not a multiple of the sample time, s."""
        period = self.samples[self._innermost]
        rest = self.delay - self._waiting * period
        return rest if rest > ROUNDING * period else 0.0

    def _sizes(self) -> dict[str, int]:
        """How many values each sampled loop holds: its integrator, what it measured, and its output.

        The output of the innermost one follows a queue of those that wait, newest first.
        """
        return {
            loop: len(self._beginnings(loop))
            + (self._waiting + 1 if loop == self._innermost else 0) * self._width(loop)
            for loop in LOOPS
            if loop in self.samples
        }

    def held(self, name: str) -> HeldSource | None:
        """What its sampled loops hold, at the start."""
        if not self.samples:
            return None
        size = sum(self._sizes().values())
        return held_source(samples_of(name), self.holds if len(self.holds) == size else [0.0] * size)

    def _held(self, drive: Drive, symbols: Symbols) -> dict[str, list[casadi.SX]]:
        """These values by loop: integrator, position of the encoder, outputs."""
        import casadi

        assert drive.samples is not None
        values, found = casadi.vertsplit(symbols.signal(drive.samples)), {}
        begun = self._states(drive, symbols)
        for loop, size in self._sizes().items():
            found[loop] = [
                value + start
                for value, start in zip(values[:size], _spread(begun[loop], size, self._width(loop)), strict=True)
            ]
            values = values[size:]
        return found

    @property
    def instants(self) -> tuple[Instants, ...]:
        """When each loop is sampled, from the outermost, and when a delayed output is applied."""
        found = [(period, 0.0) for loop in LOOPS if (period := self.samples.get(loop)) is not None]
        if self.samples and self._rest > 0.0:
            found.append((self.samples[self._innermost], self._rest))
        return tuple(
            Instants(math.ceil((self.clock - offset) / period - ROUNDING) * period + offset - self.clock, period)
            for period, offset in found
        )

    def update(self, instant: int, drive: Drive, symbols: Symbols) -> casadi.SX:
        """What it holds after one of its instants."""
        import casadi

        held = {loop: list(values) for loop, values in self._held(drive, symbols).items()}
        loops = list(held)
        if instant < len(loops):
            loop, values = loops[instant], held[loops[instant]]
            output = {"position": self._sample_position, "speed": self._sample_speed, "current": self._sample_current}
            values[:] = output[loop](drive, symbols, values)
        applied = self._innermost if self.samples else ""
        if applied and (instant == len(loops) or (instant == loops.index(applied) and not self._rest > 0.0)):
            values, width = held[applied], self._width(applied)
            values[-width:] = values[-2 * width : -width]  # the oldest of those that wait
        begun = self._states(drive, symbols)
        return casadi.vertcat(
            *[
                value - start
                for loop, values in held.items()
                for value, start in zip(values, _spread(begun[loop], len(values), self._width(loop)), strict=True)
            ]
        )

    def _queued(
        self, loop: str, values: list[casadi.SX], first: list[casadi.SX], outputs: list[casadi.SX]
    ) -> list[casadi.SX]:
        """The values of a loop with new outputs: applied at once, or last in the queue of those that wait."""
        if loop != self._innermost:
            return [*first, *outputs]
        width = len(outputs)
        return [*first, *outputs, *values[len(first) : -2 * width], *values[-width:]]

    def _sample_position(self, drive: Drive, symbols: Symbols, values: list[casadi.SX]) -> list[casadi.SX]:
        return self._queued("position", values, [], [self._speed_asked(drive, symbols)])

    def _sample_speed(self, drive: Drive, symbols: Symbols, values: list[casadi.SX]) -> list[casadi.SX]:
        measured = self._angle(drive, symbols, drive.rotor(symbols)[0])
        error = self.speed_reference(drive, symbols) - self._measured_speed(drive, symbols, values)
        asked, torque = self._torques(drive, symbols, error)
        integrator = values[0]
        if "ti" in self.speed:
            kp, ti = (drive.value(symbols, f"servo.speed.{key}") for key in ("kp", "ti"))
            integrator += self.samples["speed"] / ti * (kp * error + torque - asked)
        return self._queued("speed", values, [integrator, measured], [torque])

    def _sample_current(self, drive: Drive, symbols: Symbols, values: list[casadi.SX]) -> list[casadi.SX]:
        integrators = values[: self.axes]
        errors = self._current_errors(drive, symbols)
        commands = self._voltages(drive, symbols, errors, integrators)
        voltages = drive.within_voltage(symbols, commands)
        period = self.samples["current"]
        rates = self._current_rates(drive, symbols, errors, commands, voltages, 1.0 / period)
        return self._queued(
            "current", values, [w + period * rate for w, rate in zip(integrators, rates, strict=True)], voltages
        )

    def _current_rates(
        self, drive: Drive, symbols: Symbols, errors: list[casadi.SX], commands: list[casadi.SX],
        voltages: list[casadi.SX], fastest: float = math.inf,
    ) -> list[casadi.SX]:  # fmt: skip
        """The rates of the integrators, led back as fast as the current follows the voltage, or as samples are."""
        import casadi

        ki = drive.value(symbols, "servo.current.ki")
        back = drive.value(symbols, "circuit.resistance") / drive.value(symbols, "circuit.inductance")
        if math.isfinite(fastest):
            back = casadi.fmin(back, fastest)
        return [
            ki * error + back * (voltage - command)
            for error, command, voltage in zip(errors, commands, voltages, strict=True)
        ]

    def _voltages(
        self, drive: Drive, symbols: Symbols, errors: list[casadi.SX], integrators: list[casadi.SX]
    ) -> list[casadi.SX]:
        """What the current controllers ask: of two axes with the voltages that the rotation induces."""
        kp = drive.value(symbols, "servo.current.kp")
        induced = drive.induced_voltages(symbols) if self.axes == 2 else [symbols.zero]
        return [kp * e + w + u for e, w, u in zip(errors, integrators, induced, strict=True)]

    def _measured_speed(self, drive: Drive, symbols: Symbols, values: list[casadi.SX]) -> casadi.SX:
        """ω, or the difference of the encoder's positions over a sample time."""
        angle, speed = drive.rotor(symbols)
        if not self.resolution:
            return speed
        return (self._angle(drive, symbols, angle) - values[1]) / self.samples["speed"]

    def _angle(self, drive: Drive, symbols: Symbols, angle: casadi.SX) -> casadi.SX:
        """The rotor's angle as the encoder reads it."""
        import casadi

        if not self.resolution or symbols.additions is not None:  # steps have no slope
            return angle
        return casadi.floor(angle / self.resolution) * self.resolution

    # ---- loops

    def _speed_asked(self, drive: Drive, symbols: Symbols) -> casadi.SX:
        """ω_r of the position controller."""
        ratio = drive.gear["ratio"]
        place, rate, _ = self.wanted(drive, symbols)
        if self.encoder == "motor":
            measured = self._angle(drive, symbols, drive.rotor(symbols)[0]) / ratio
        else:
            measured = self._angle(drive, symbols, ratio * symbols.joint(drive.joint).position) / ratio
        error = drive.value(symbols, "servo.position.kp") * (place - measured)
        return ratio * (error + self.feedforward["speed"] * rate)

    def speed_reference(self, drive: Drive, symbols: Symbols) -> casadi.SX:
        """ω_r, held between samples."""
        if "position" in self.samples:
            return self._held(drive, symbols)["position"][-1]
        return self._speed_asked(drive, symbols)

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
        own = drive.value(symbols, "gear.inertia") * ratio * a[drive.joint.v] if drive.has_own_rotor else 0.0
        return self.feedforward["torque"] * (load / ratio + own)

    def _torques(self, drive: Drive, symbols: Symbols, error: casadi.SX) -> tuple[casadi.SX, casadi.SX]:
        """The torque that the speed controller asks for an error of speed, and what the limits leave of it."""
        import casadi

        asked = drive.value(symbols, "servo.speed.kp") * error + self._torque_ahead(drive, symbols)
        asked += self._integrator(drive, symbols, "speed")
        if drive.model == "torque":
            return asked, drive.within_limits(symbols, asked)
        most = drive.circuit.get("peak_torque")
        return asked, asked if most is None else casadi.fmax(casadi.fmin(asked, most), -most)

    def _speed_error(self, drive: Drive, symbols: Symbols) -> casadi.SX:
        return self.speed_reference(drive, symbols) - drive.rotor(symbols)[1]

    def error_at(self, drive: Drive, symbols: Symbols) -> casadi.SX:
        """ω_r − ω of the loops as if they were sampled at this moment."""
        return self._speed_asked(drive, symbols) - drive.rotor(symbols)[1]

    def torque_reference(self, drive: Drive, symbols: Symbols) -> casadi.SX:
        """T_r, held between samples."""
        factor = 1.0 if symbols.additions is None else symbols.additions.factor[drive.name]
        if "speed" in self.samples:
            return factor * self._held(drive, symbols)["speed"][-1]
        return factor * self._torques(drive, symbols, self._speed_error(drive, symbols))[1]

    def _current_errors(self, drive: Drive, symbols: Symbols) -> list[casadi.SX]:
        wanted = self.torque_reference(drive, symbols) / drive.value(symbols, "circuit.torque_constant")
        if self.axes == 1:
            return [wanted - drive.current(symbols)]
        return [
            each - now
            for each, now in zip(self._two_currents(drive, symbols, wanted), drive.currents(symbols), strict=True)
        ]

    def _two_currents(self, drive: Drive, symbols: Symbols, wanted: casadi.SX) -> list[casadi.SX]:
        """The currents i_q and i_d of a wanted i_q: with i_d < 0 where the voltage does not suffice, within the limits.

        (ω L i_q)² + (ω (L i_d + ψ))² = (U − R |i_q|)² at the electrical speed ω, U being a share of the largest one.
        """
        import casadi

        circuit, inductance, flux = drive.circuit, drive.value(symbols, "circuit.inductance"), drive.flux(symbols)
        most, bus = circuit.get("peak_current"), drive.largest_voltage(symbols)
        if most is not None:
            wanted = casadi.fmax(casadi.fmin(wanted, most), -most)
        if bus is None:
            return [wanted, symbols.zero]
        speed = casadi.fmax(casadi.fabs(drive.electrical_speed(symbols)), LEAST_SPEED)
        drop = drive.value(symbols, "circuit.resistance") * casadi.fabs(wanted)
        circle = (casadi.fmax(WEAKENING * bus - drop, LEAST_SHARE * bus) / speed) ** 2  # of the flux linkage
        least = 1e-12 * flux * flux
        along = casadi.fmin(
            0.0, (casadi.sqrt(casadi.fmax(circle - (inductance * wanted) ** 2, least)) - flux) / inductance
        )
        if most is not None:
            along = casadi.fmax(along, -most)
            room = casadi.sqrt(casadi.fmax(most * most - along * along, 1e-12 * most * most))
            wanted = casadi.fmax(casadi.fmin(wanted, room), -room)
        left = casadi.sqrt(casadi.fmax(circle - (inductance * along + flux) ** 2, least)) / inductance
        return [casadi.fmax(casadi.fmin(wanted, left), -left), along]

    def command(self, drive: Drive, symbols: Symbols) -> list[casadi.SX]:
        """The torque (N m), or the voltage (V) of model dc, those of q and d of dq, before limits where not sampled."""
        if drive.model == "torque":
            if "speed" in self.samples or symbols.additions is not None:
                return [self.torque_reference(drive, symbols)]
            return [self._torques(drive, symbols, self._speed_error(drive, symbols))[0]]
        if "current" in self.samples:
            return self._held(drive, symbols)["current"][-self.axes :]
        integrators = self._states(drive, symbols)["current"]
        return self._voltages(drive, symbols, self._current_errors(drive, symbols), integrators)

    def rates(self, drive: Drive, symbols: Symbols) -> list[casadi.SX]:
        """The rates of its states."""
        rates: dict[str, list[casadi.SX]] = {}
        if "ti" in self.speed and "speed" not in self.samples:
            error = self._speed_error(drive, symbols)
            asked, torque = self._torques(drive, symbols, error)
            kp, ti = (drive.value(symbols, f"servo.speed.{key}") for key in ("kp", "ti"))
            rates["speed"] = [(kp * error + torque - asked) / ti]
        if self.current and "current" not in self.samples:
            errors, commands = self._current_errors(drive, symbols), self.command(drive, symbols)
            voltages = drive.within_voltage(symbols, commands)
            rates["current"] = self._current_rates(drive, symbols, errors, commands, voltages)
        for loop in self.samples:
            rates[loop] = [symbols.zero] * len(self._beginnings(loop))
        return [rate for loop in LOOPS for rate in rates.get(loop, [])]

    # ---- start

    def start(self, drive: Drive, symbols: Symbols, torque: casadi.SX) -> list[casadi.SX]:
        """Its states at the start, where the drive exerts a torque (N m) at the rotor."""
        import casadi

        ratio = drive.gear["ratio"]
        place, rate, _ = self.wanted(drive, symbols)
        position, velocity, _ = symbols.joint(drive.joint)
        wound = symbols.zero
        if drive.has_own_rotor:
            wound = 0.5 * drive.gear["backlash"] * casadi.sign(torque)
        if drive.is_elastic:
            wound = ratio * torque / drive.value(symbols, "gear.stiffness") + wound
        measured = position + wound if self.encoder == "motor" else position
        gain, turning = drive.value(symbols, "servo.position.kp"), ratio * velocity
        reference = ratio * (gain * (place - measured) + self.feedforward["speed"] * rate)
        # the integrator holds the load, and what an encoder at the motor sees of the twist
        unseen = ratio * gain * (position - measured)
        speed = torque - self._torque_ahead(drive, symbols) - drive.value(symbols, "servo.speed.kp") * unseen
        found: list[casadi.SX] = []
        if "position" in self.samples:
            found.append(reference)
        if "speed" in self.samples:
            angle = self._angle(drive, symbols, ratio * (position + wound) - turning * self.samples["speed"])
            found += [speed, angle, torque]
        elif "ti" in self.speed:
            found.append(speed)
        if self.current:
            resistance = drive.resistance(symbols, drive.heat.get("winding"))
            current = torque / drive.value(symbols, "circuit.torque_constant")
            if self.axes == 1:
                voltages = [resistance * current + drive.value(symbols, "circuit.voltage_constant") * turning]
                integrators = voltages
            else:  # what is induced is added to what the controllers ask
                integrators = [resistance * current, symbols.zero]
                spin = turning * drive.circuit["pole_pairs"]
                across = spin * drive.value(symbols, "circuit.inductance") * current
                voltages = [resistance * current + spin * drive.flux(symbols), -across]
            found += [*integrators, *voltages] if "current" in self.samples else integrators
        return found


def _spread(starts: list[casadi.SX], size: int, width: int) -> list[casadi.SX]:
    """What each value of a loop begins with: its outputs, waiting ones included, as the last `width` ones."""
    first, outputs = starts[:-width], starts[-width:]
    return [*first, *outputs * ((size - len(first)) // width)]
