"""The supply of drives: a bus with a capacitor, a source that takes nothing back, and a brake resistor.

With the bus voltage U, the source's voltage U₀ and resistance R_s, the power P_k of the windings of each drive, and the
brake resistor R_b, which is switched on by the share d of the time,

    C dU/dt = max(0, (U₀ − U)/R_s) − Σ P_k / U − d U/R_b,    d = (U − U_max) / (0.01 U_max) within 0 and 1.

C, U₀, U_max and R_b are those of `conditions` (bus_capacitance, voltage, bus_max_voltage, brake_resistance). Drives
that brake raise the voltage, and those that take power lower it: it is the largest voltage of their motors. Source: D.
Schröder, Elektrische Antriebe – Regelung von Antriebssystemen (2015), ch. 12.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.conditions import Conditions
from bellcrank.config.fields import Fields
from bellcrank.elements.drives import BUS, Drive
from bellcrank.elements.element import POSITIVE, AuxiliaryStates, Force, GeneralisedForce, Settable, number

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols
    from bellcrank.robot.robot import Robot

KEY = "supply"
BAND = 0.01  # of U_max: over which the brake resistor goes from off to on, as a fast chopper on average
LEAST = 1e-3  # of U₀, in place of a bus without voltage


@dataclass(frozen=True)
class Supply(Force):
    """The supply of a scene's drives; `largest` (V) and `brake` (ohm) are None without a brake resistor."""

    voltage: float
    capacitance: float
    resistance: float
    largest: float | None
    brake: float | None
    drives: tuple[Drive, ...]
    kind: ClassVar[str] = KEY

    @property
    def settable(self) -> dict[str, Settable]:
        """Capacitance and resistances."""
        found = {"capacitance": Settable("F", POSITIVE), "resistance": Settable("Ω", POSITIVE)}
        return found if self.brake is None else {**found, "brake": Settable("Ω", POSITIVE)}

    @property
    def auxiliary(self) -> AuxiliaryStates:
        """The voltage, and the energies of source and resistor."""
        return BUS

    def _powers(self, symbols: Symbols) -> tuple[casadi.SX, casadi.SX, casadi.SX]:
        """Bus voltage, V, and the powers of the source and of the brake resistor, W."""
        import casadi

        bus = symbols.auxiliary(BUS)[0]
        source = bus * casadi.fmax(0.0, self.voltage - bus) / self.value(symbols, "resistance")
        if self.brake is None or self.largest is None:
            return bus, source, symbols.zero
        share = casadi.fmin(1.0, casadi.fmax(0.0, (bus - self.largest) / (BAND * self.largest)))
        return bus, source, share * bus * bus / self.value(symbols, "brake")

    def _drawn(self, symbols: Symbols) -> casadi.SX:
        """The power of all drives, W."""
        return sum((drive.electrical_power(symbols) for drive in self.drives), symbols.zero)

    def auxiliary_rate(self, symbols: Symbols) -> casadi.SX:
        """The rates of its states."""
        import casadi

        bus, source, braked = self._powers(symbols)
        current = (source - self._drawn(symbols) - braked) / casadi.fmax(bus, LEAST * self.voltage)
        return casadi.vertcat(current / self.value(symbols, "capacitance"), source, braked)

    def auxiliary_start(self, symbols: Symbols) -> casadi.SX:
        """The bus at the voltage of the source."""
        import casadi

        return casadi.SX([self.voltage, 0.0, 0.0])

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """None: the drives exert the forces."""
        import casadi

        return GeneralisedForce(casadi.SX.zeros(symbols.robot.nv, 1), symbols.zero, symbols.zero, False)

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """The columns of an output."""
        return ("bus voltage [V]", "power of drives [W]", "power of source [W]", "power of resistor [W]")

    def measure(self, symbols: Symbols) -> casadi.SX:
        """Voltage and powers."""
        import casadi

        bus, source, braked = self._powers(symbols)
        return casadi.vertcat(bus, self._drawn(symbols), source, braked)


def read_supply(
    read: Fields,
    conditions: Conditions,
    drives: Sequence[Drive],
    actuators: Mapping[str, Actuator],
    names: Sequence[str],
) -> Supply | None:
    """Read the key `supply`; None without it. `names` are those of the scene's forces. Raises InputError."""
    if KEY not in read:
        return None
    entry = read.mapping(KEY)
    entry.only(("resistance",))
    resistance = number(entry, "resistance", "Ω", bound=POSITIVE)
    entry.done()
    if KEY in names:
        raise read.error(KEY, "the name 'supply' is taken by a force; give the force another name")
    if not drives:
        raise read.error(KEY, "a supply requires drives: entries of actuators with 'model: dc' or 'model: dq'")
    for drive in drives:
        if drive.model == "torque":
            raise read.error(
                KEY, f"the drive of '{drive.joint.name}' is of 'model: torque', whose currents are unknown"
            )
    missing = [key for key in ("voltage", "bus_capacitance") if getattr(conditions, key) is None]
    if missing:
        raise read.error(KEY, f"a supply requires conditions.{' and conditions.'.join(missing)}")
    if any(actuators[drive.joint.name].conditions.voltage != conditions.voltage for drive in drives):
        raise read.error(KEY, "one bus supplies all drives; state the voltage in 'conditions' alone")
    brakes = conditions.brake_resistance is not None or bool(conditions.brake_resistor_power)
    for key in ("brake_resistance", "bus_max_voltage"):
        if brakes and getattr(conditions, key) is None:
            raise read.error(KEY, f"a brake resistor requires conditions.{key}")
    assert conditions.voltage is not None and conditions.bus_capacitance is not None
    if brakes and conditions.bus_max_voltage is not None and not conditions.bus_max_voltage > conditions.voltage:
        raise read.error(KEY, "expected conditions.bus_max_voltage above conditions.voltage")
    return Supply(
        KEY, entry, conditions.voltage, conditions.bus_capacitance, resistance, conditions.bus_max_voltage,
        conditions.brake_resistance, tuple(replace(drive, supplied=True) for drive in drives),
    )  # fmt: skip
