"""Conditions: what they may hold, and what they assume for rows that lack it."""

from __future__ import annotations

from typing import Any

import pytest

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import DIRECT, Gear
from bellcrank.actuators.motor import Motor
from bellcrank.errors import InputError


@pytest.mark.parametrize(
    ("field", "value", "text"),
    [
        ("voltage", 0.0, "conditions: argument 'voltage': expected a finite number of more than 0"),
        ("voltage_reserve", 1.0, "argument 'voltage_reserve': expected a finite number of at least 0 and at most 0.9"),
        ("altitude", 4500.0, "argument 'altitude': expected a finite number of at least -500 and at most 4000"),
        ("ambient", -200.0, "argument 'ambient': expected a finite number of at least -100 and at most 300"),
        ("ambient", float("nan"), "argument 'ambient'"),
        ("safety_factor", 0.9, "argument 'safety_factor': expected a finite number of at least 1"),
        ("brake", 1, "argument 'brake': expected True or False, found 1"),
        ("life", 0, "argument 'life': expected a finite number of more than 0"),
        ("assume", {"gear.efficency": 0.7}, "unknown field 'gear.efficency'; did you mean 'gear.efficiency'?"),
        ("assume", {"efficiency": 0.7}, "unknown field 'efficiency'"),
        ("assume", {"gear.kind": 1.0}, "unknown field 'gear.kind'"),
        ("assume", {"gear.efficiency": 1.7}, "argument 'efficiency': expected a finite number of more than 0 and at"),
        ("assume", {"gear.efficiency": "a lot"}, "argument 'assume['gear.efficiency']': expected a finite number"),
        ("assume", 0.7, "argument 'assume': expected a mapping of fields of motors and gears to numbers"),
        ("assume", (0.7,), "argument 'assume': expected a mapping of fields of motors and gears to numbers"),
    ],
)
def test_impossible_conditions_are_refused(field: str, value: Any, text: str) -> None:
    with pytest.raises(InputError) as error:
        Conditions(**{field: value})
    assert text in str(error.value)


def test_assumed_values_fill_only_what_is_missing() -> None:
    conditions = Conditions(assume={"motor.mass": 2, "gear.efficiency": 0.7})
    assert conditions.assume == (("gear.efficiency", 0.7), ("motor.mass", 2.0))
    assert Conditions(assume=conditions.assume) == conditions
    gear = Gear(id="g", maker="", model="", kind="spur", ratio=5.0)
    motor = Motor(id="m", maker="", model="", mass=0.3)
    assert conditions.completed(gear).efficiency == 0.7
    assert conditions.filled(gear) == (("efficiency", 0.7),)
    assert conditions.completed(motor) is motor and conditions.filled(motor) == ()
    assert conditions.completed(Motor(id="m", maker="", model="")).mass == 2.0
    stated = Gear(id="g", maker="", model="", kind="spur", ratio=5.0, efficiency=0.9)
    assert conditions.completed(stated).efficiency == 0.9
    assert conditions.completed(DIRECT) is DIRECT


@pytest.mark.parametrize(("altitude", "factor"), [(-100.0, 1.0), (1000.0, 1.0), (1500.0, 0.95), (4000.0, 0.7)])
def test_the_permitted_rise_falls_by_one_percent_in_a_hundred_metres(altitude: float, factor: float) -> None:
    assert Conditions(altitude=altitude).altitude_factor == pytest.approx(factor)
