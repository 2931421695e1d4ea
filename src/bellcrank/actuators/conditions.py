"""Conditions under which motors and gears are judged: the supply, the surroundings and the safety wanted."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """What a selection assumes beside the loads.

    Attributes:
        voltage: Bus voltage, V; None: each motor's own nominal voltage.
        voltage_reserve: Share of the voltage that is kept for control.
        ambient: Ambient temperature, °C.
        altitude: Altitude of the site above sea level, m.
        safety_factor: On loads' torques before they are compared with limits.
        life: Hours that gears must live (L10); None: life is reported and not judged.
        brake: Whether each motor must have a brake that holds the worst static torque.
        bus_capacitance: F; None: unknown.
        bus_max_voltage: Voltage at which the brake resistor switches on, V; None: unknown.
        brake_resistor_power: Continuous power of the brake resistor, W; None: there is none.
        supply_power: Largest power of the supply, W; None: unknown.
        assumed: Values assumed for every row that lacks them, such as {"gear.efficiency": 0.7}.
    """

    voltage: float | None = None
    voltage_reserve: float = 0.1
    ambient: float = 25.0
    altitude: float = 0.0
    safety_factor: float = 1.0
    life: float | None = None
    brake: bool = False
    bus_capacitance: float | None = None
    bus_max_voltage: float | None = None
    brake_resistor_power: float | None = None
    supply_power: float | None = None
    assumed: tuple[tuple[str, float], ...] = ()
