"""Conditions under which motors and gears are judged: the supply, the surroundings and the safety wanted."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final, Literal, TypeVar, get_args

from bellcrank import arguments
from bellcrank.actuators.catalogue.product_checks import (
    NOT_NEGATIVE,
    TEMPERATURE,
    Range,
    check_numbers,
    check_texts,
)
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Commutation, Motor
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name

Row = TypeVar("Row", Motor, Gear)
T = TypeVar("T")
Construction = Literal["housed", "frameless"]
CHOICES: Final = {"commutation": get_args(Commutation), "construction": get_args(Construction)}
GIVEN: Final = "given"  # source of what an option or an argument states
BY_NAME: Final = ("assume", "momentary_loads")  # each entry of these has a source of its own
HIGHEST = 4000.0  # m: the correction for altitude of IEC 60034-1 ends there
SEA_LEVEL = 1000.0  # m: up to here it is 1
RANGES = {
    "voltage_ratio": Range(above=1.0),
    "voltage_reserve": Range(above=None, least=0.0, most=0.9),
    "ambient": Range(above=None, least=-100.0, most=300.0),
    "altitude": Range(above=None, least=-500.0, most=HIGHEST),
    "winding_temperature": TEMPERATURE,
    "safety_factor": Range(above=None, least=1.0),
    "brake_resistor_power": NOT_NEGATIVE,
}


def _knows_what_is_given(cls: type[T]) -> type[T]:
    """Let the constructor note in `sources` which arguments it got: one that is equal to its default is given too."""
    init = cls.__init__

    @functools.wraps(init)
    def noting(self: Any, **given: Any) -> None:
        init(self, **given)
        stated = given.get("sources")  # `dataclasses.replace` passes every field, and so the sources too
        if stated is not None:
            expected = "a mapping of names of fields to where they come from, such as {'voltage': 'given'}"
            stated = arguments.mapping("sources", stated, expected, where="conditions")
        names = [name for name in given if name != "sources"] if stated is None else _changed(self)
        every = dict.fromkeys(entries(self, names), GIVEN) | dict(stated or {})
        object.__setattr__(self, "sources", {name: every[name] for name in entries(self) if name in every})

    cls.__init__ = noting  # type: ignore[method-assign]
    return cls


@_knows_what_is_given
@dataclass(frozen=True, kw_only=True)
class Conditions:
    """What a selection assumes beside the loads.

    A robot configuration may state them for the whole robot (`conditions`) and for an axis (`actuators.NAME`); what
    `select` is given replaces both, field by field. Therefore `sources` says which fields are stated, and where.

    Attributes:
        voltage: Bus voltage, V; None: each motor's own nominal voltage.
        voltage_ratio: How many times the bus may have a motor's nominal voltage, and the other way round.
        voltage_reserve: Share of the voltage that is kept for control.
        winding_temperature: Winding temperature for which the voltage limit is computed, °C.
        ambient: Ambient temperature, °C.
        altitude: Altitude of the site above sea level, m, at most 4000.
        safety_factor: On loads' torques before they are compared with limits.
        inertia_ratio: Largest inertia of load and gear over that of the rotor, both at the shaft.
        commutation: "brushed" or "brushless" motors only; None: both.
        construction: "housed" motors only, or "frameless" ones (rotor and stator); None: both.
        momentary_loads: Torques (axis name, N m or N) that happen rarely, such as in an emergency stop, for the gears'
            momentary limit; a mapping is taken too and kept as pairs.
        life: Hours that gears must live (L10); None: life is reported and not judged.
        brake: Whether each motor must have a brake that holds the worst static torque.
        bus_capacitance: F; None: unknown.
        bus_max_voltage: Voltage at which the brake resistor switches on, V; None: unknown.
        brake_resistor_power: Continuous power of the brake resistor, W; None: there is none.
        brake_resistance: Of the brake resistor, Ω: at `bus_max_voltage` it takes at most U²/R; None: unknown.
        brake_resistor_peak_power: What the brake resistor may take in a pulse, W; None: unknown.
        supply_power: Largest power of the supply, W; None: unknown.
        assume: Values assumed for every row that lacks them, such as {"gear.efficiency": 0.7}; kept as pairs.
        sources: Where each field that is stated comes from, by name: "given" (an argument or option), "actuators.NAME"
            or "conditions" of a robot configuration; entries of `assume` and `momentary_loads` by names such as
            "assume.gear.efficiency". Fields that are not named have their defaults. Not compared.

    Raises:
        InputError: For a number outside its range, or an assumed value whose name or number is not one of a row.

    Example:
        >>> import bellcrank as bc
        >>> conditions = bc.Conditions(voltage=48.0, altitude=2000.0, assume={"gear.efficiency": 0.7})
        >>> conditions.altitude_factor
        0.9
        >>> list(conditions.sources)
        ['voltage', 'altitude', 'assume.gear.efficiency']
    """

    voltage: float | None = None
    voltage_ratio: float = 2.0
    voltage_reserve: float = 0.1
    winding_temperature: float = 25.0
    ambient: float = 25.0
    altitude: float = 0.0
    safety_factor: float = 1.0
    inertia_ratio: float = 10.0
    commutation: Commutation | None = None
    construction: Construction | None = None
    momentary_loads: tuple[tuple[str, float], ...] | Mapping[str, float] = ()
    life: float | None = None
    brake: bool = False
    bus_capacitance: float | None = None
    bus_max_voltage: float | None = None
    brake_resistor_power: float | None = None
    brake_resistance: float | None = None
    brake_resistor_peak_power: float | None = None
    supply_power: float | None = None
    assume: tuple[tuple[str, float], ...] | Mapping[str, float] = ()
    sources: Mapping[str, str] = field(default_factory=dict, compare=False, repr=False)

    def __post_init__(self) -> None:
        where = "conditions"
        check_numbers(self, where, RANGES)
        check_texts(self, where, CHOICES)
        object.__setattr__(self, "brake", arguments.flag("brake", self.brake, where=where))
        object.__setattr__(self, "assume", _assumed(self.assume))
        object.__setattr__(self, "momentary_loads", _momentary_loads(self.momentary_loads))

    @property
    def given(self) -> dict[str, Any]:
        """The fields that are stated, by name, as `updated` takes them."""
        return self.only(list(self.sources))

    def only(self, names: Iterable[str]) -> dict[str, Any]:
        """Some fields by name, as `updated` takes them.

        Args:
            names: Names as in `sources`.

        Returns:
            The values; entries of `assume` and `momentary_loads` in a mapping of their own.

        Raises:
            InputError: For an entry that is not there.

        Example:
            >>> import bellcrank as bc
            >>> bc.Conditions(life=2e4, assume={"motor.mass": 1.5}).only(["life", "assume.motor.mass"])
            {'life': 20000.0, 'assume': {'motor.mass': 1.5}}
        """
        found: dict[str, Any] = {}
        known = entries(self)
        for each in arguments.several("names", names, str, "names of fields"):
            if each not in known:
                raise InputError(f"conditions: argument 'names': {unknown_name('field', each, known)}")
            name, _, entry = each.partition(".")
            if entry:
                found.setdefault(name, {})[entry] = dict(getattr(self, name))[entry]
            else:
                found[name] = getattr(self, name)
        return found

    def updated(self, given: Conditions | Mapping[str, Any] | None, source: str = GIVEN) -> Conditions:
        """These conditions, with others where those are stated.

        Args:
            given: Fields by name; of Conditions those in its `sources`. Entries of `assume` and `momentary_loads`
                replace those of the same name, and the others stay. None changes nothing.
            source: Where they come from.

        Returns:
            The conditions, whose `sources` name `source` for each given field.

        Raises:
            InputError: For an unknown name or a wrong value.

        Example:
            >>> import bellcrank as bc
            >>> hot = bc.Conditions(ambient=40.0, safety_factor=1.5)
            >>> cool = hot.updated({"ambient": 25.0}, "actuators.elbow")
            >>> cool.ambient, cool.safety_factor, cool.sources["ambient"]
            (25.0, 1.5, 'actuators.elbow')
        """
        arguments.text("source", source, "where they come from", empty=True)
        if given is None:
            return self
        stated = Conditions(**(given.given if isinstance(given, Conditions) else _mapping(given)))
        values = stated.given
        for name in BY_NAME:
            if name in values:
                values[name] = dict(getattr(self, name)) | values[name]
        return replace(self, **values, sources={**self.sources, **dict.fromkeys(stated.sources, source)})

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
            >>> Conditions(assume={"gear.efficiency": 0.7}).completed(gear).efficiency
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
            >>> Conditions(assume={"gear.efficiency": 0.7}).filled(DIRECT)
            ()
        """
        arguments.instance("row", row, (Motor, Gear), "a Motor or a Gear")
        room = "motor" if isinstance(row, Motor) else "gear"
        if isinstance(row, Gear) and row.kind == "direct":
            return ()
        values = {name.removeprefix(f"{room}."): x for name, x in dict(self.assume).items() if name.startswith(room)}
        return tuple((name, value) for name, value in values.items() if getattr(row, name) is None)


def _mapping(given: Mapping[str, Any]) -> dict[str, Any]:
    """Given fields by name. Raises InputError."""
    known = [entry.name for entry in fields(Conditions) if entry.name != "sources"]
    stated = arguments.mapping("conditions", given, "Conditions, or a mapping of their fields, such as {'voltage': 48}")
    for name in stated:
        if name not in known:
            raise InputError(f"argument 'conditions': {unknown_name('field', str(name), known)}")
    return stated


def entries(conditions: Conditions, names: Iterable[str] | None = None) -> list[str]:
    """The names that `sources` may have, in the order of the fields; only those of some fields."""
    found: list[str] = []
    for entry in fields(conditions):
        if entry.name in BY_NAME and (names is None or entry.name in names):
            found += [f"{entry.name}.{name}" for name, _ in getattr(conditions, entry.name)]
        elif entry.name != "sources" and (names is None or entry.name in names):
            found.append(entry.name)
    return found


def _changed(conditions: Conditions) -> list[str]:
    """The fields that do not have their defaults."""
    return [entry.name for entry in fields(conditions) if getattr(conditions, entry.name) != entry.default]


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
            arguments.refuse("assume", expected, given, where)
    values = arguments.mapping("assume", given, expected, where=where)
    known = [f"{room}.{name}" for room, row in (("motor", Motor), ("gear", Gear)) for name in _numeric(row)]
    for name, value in values.items():
        if name not in known:
            raise InputError(f"{where}: argument 'assume': {unknown_name('field', name, known)}")
        room, field = name.split(".")
        values[name] = arguments.number(f"assume['{name}']", value, where=where)
        row = {"id": "assumed", "maker": "", "model": "", field: values[name]}
        Motor(**row) if room == "motor" else Gear(kind="spur", **row)  # refuses a value outside the field's range
    return tuple(sorted(values.items()))


def _numeric(row: type[Motor] | type[Gear]) -> list[str]:
    return [field.name for field in fields(row) if str(field.type) == "float | None"]
