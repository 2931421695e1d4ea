"""Conditions under which motors and gears are judged: the supply, the surroundings and the safety wanted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

from bellcrank import arguments
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.row_checks import NOT_NEGATIVE, TEMPERATURE, Range, check_numbers
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name

Row = TypeVar("Row", Motor, Gear)
HIGHEST = 4000.0  # m: the correction for altitude of IEC 60034-1 ends there
SEA_LEVEL = 1000.0  # m: up to here it is 1
_RANGES = {
    "voltage_reserve": Range(above=None, least=0.0, most=0.9),
    "ambient": Range(above=None, least=-100.0, most=300.0),
    "altitude": Range(above=None, least=-500.0, most=HIGHEST),
    "winding_temperature": TEMPERATURE,
    "safety_factor": Range(above=None, least=1.0),
    "brake_resistor_power": NOT_NEGATIVE,
}


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """What a selection assumes beside the loads.

    Attributes:
        voltage: Bus voltage, V; None: each motor's own nominal voltage.
        voltage_reserve: Share of the voltage that is kept for control.
        winding_temperature: Winding temperature for which the voltage limit is computed, °C.
        ambient: Ambient temperature, °C.
        altitude: Altitude of the site above sea level, m, at most 4000.
        safety_factor: On loads' torques before they are compared with limits.
        momentary_loads: Torques (axis name, N m or N) that happen rarely, such as in an emergency stop, for the gears'
            momentary limit; a mapping is taken too and kept as pairs.
        life: Hours that gears must live (L10); None: life is reported and not judged.
        brake: Whether each motor must have a brake that holds the worst static torque.
        bus_capacitance: F; None: unknown.
        bus_max_voltage: Voltage at which the brake resistor switches on, V; None: unknown.
        brake_resistor_power: Continuous power of the brake resistor, W; None: there is none.
        supply_power: Largest power of the supply, W; None: unknown.
        assumed: Values assumed for every row that lacks them, such as {"gear.efficiency": 0.7}; kept as pairs.

    Raises:
        InputError: For a number outside its range, or an assumed value whose name or number is not one of a row.

    Example:
        >>> from bellcrank.actuators.conditions import Conditions
        >>> Conditions(voltage=48.0, altitude=2000.0, assumed={"gear.efficiency": 0.7}).altitude_factor
        0.9
    """

    voltage: float | None = None
    voltage_reserve: float = 0.1
    winding_temperature: float = 25.0
    ambient: float = 25.0
    altitude: float = 0.0
    safety_factor: float = 1.0
    momentary_loads: tuple[tuple[str, float], ...] | Mapping[str, float] = ()
    life: float | None = None
    brake: bool = False
    bus_capacitance: float | None = None
    bus_max_voltage: float | None = None
    brake_resistor_power: float | None = None
    supply_power: float | None = None
    assumed: tuple[tuple[str, float], ...] | Mapping[str, float] = ()

    def __post_init__(self) -> None:
        where = "conditions"
        check_numbers(self, where, _RANGES)
        object.__setattr__(self, "brake", arguments.flag("brake", self.brake, where=where))
        object.__setattr__(self, "assumed", _assumed(self.assumed))
        object.__setattr__(self, "momentary_loads", _momentary_loads(self.momentary_loads))

    @property
    def altitude_factor(self) -> float:
        """Permitted temperature rise over that up to 1000 m: 1 % less per 100 m above (IEC 60034-1)."""
        return 1.0 - 0.01 * max(self.altitude - SEA_LEVEL, 0.0) / 100.0

    def completed(self, row: Row) -> Row:
        """A motor or gear with the assumed values where it states none.

        Args:
            row: A motor or a gear.

        Returns:
            The row, unchanged where nothing was missing.

        Raises:
            InputError: For something else.

        Example:
            >>> from bellcrank.actuators.conditions import Conditions
            >>> from bellcrank.actuators.gear import Gear
            >>> gear = Gear(id="g", maker="", model="", kind="spur", ratio=5.0)
            >>> Conditions(assumed={"gear.efficiency": 0.7}).completed(gear).efficiency
            0.7
        """
        filled: dict[str, Any] = dict(self.filled(row))
        return replace(row, **filled) if filled else row

    def filled(self, row: Motor | Gear) -> tuple[tuple[str, float], ...]:
        """The assumed values (field, value) that a row takes, because it states none.

        Args:
            row: A motor or a gear.

        Returns:
            Pairs of the field and the value.

        Raises:
            InputError: For something else.

        Example:
            >>> from bellcrank.actuators.conditions import Conditions
            >>> from bellcrank.actuators.gear import DIRECT
            >>> Conditions(assumed={"gear.efficiency": 0.7}).filled(DIRECT)
            ()
        """
        arguments.instance("row", row, (Motor, Gear), "a Motor or a Gear")
        room = "motor" if isinstance(row, Motor) else "gear"
        if isinstance(row, Gear) and row.kind == "direct":
            return ()
        values = {name.removeprefix(f"{room}."): x for name, x in dict(self.assumed).items() if name.startswith(room)}
        return tuple((name, value) for name, value in values.items() if getattr(row, name) is None)


def _momentary_loads(given: Any) -> tuple[tuple[str, float], ...]:
    """Momentary loads as sorted pairs of axis and torque. Raises InputError."""
    where, expected = "conditions", "a mapping of names of axes to torques, such as {'elbow': 80.0}"
    if isinstance(given, tuple):
        try:
            given = dict(given)
        except (TypeError, ValueError):
            arguments.refuse("momentary_loads", expected, given, where)
    values = arguments.mapping("momentary_loads", given, expected, where=where)
    loads = {
        arguments.text("momentary_loads", name, "a name of an axis", where=where): arguments.number(
            f"momentary_loads['{name}']", value, least=0.0, where=where
        )
        for name, value in values.items()
    }
    return tuple(sorted(loads.items()))


def _assumed(given: Any) -> tuple[tuple[str, float], ...]:
    """Assumed values as sorted pairs, each checked by a row of its own. Raises InputError."""
    where = "conditions"
    expected = "a mapping of fields of motors and gears to numbers, such as {'gear.efficiency': 0.7}"
    if isinstance(given, tuple):
        try:
            given = dict(given)
        except (TypeError, ValueError):
            arguments.refuse("assumed", expected, given, where)
    values = arguments.mapping("assumed", given, expected, where=where)
    known = [f"{room}.{name}" for room, row in (("motor", Motor), ("gear", Gear)) for name in _numeric(row)]
    for name, value in values.items():
        if name not in known:
            raise InputError(f"{where}: argument 'assumed': {unknown_name('field', name, known)}")
        room, field = name.split(".")
        values[name] = arguments.number(f"assumed['{name}']", value, where=where)
        row = {"id": "assumed", "maker": "", "model": "", field: values[name]}
        Motor(**row) if room == "motor" else Gear(kind="spur", **row)  # refuses a value outside the field's range
    return tuple(sorted(values.items()))


def _numeric(row: type[Motor] | type[Gear]) -> list[str]:
    return [field.name for field in fields(row) if str(field.type) == "float | None"]
