"""Whether a motor suits its bus and its load: nominal voltage, ratio of inertias, and one bus for all axes."""

from __future__ import annotations

import itertools
import math

import pytest

import bellcrank as bc
from bellcrank.sizing import verdict_tables

POINT_MASS = 2.0 * 0.5**2  # kg m², geared_pendulum: 2 kg on a rod of 0.5 m, about its joint
RATIO = 50.0


def motor(name: str = "m", **figures) -> bc.Motor:
    """A motor that is strong enough for the pendulum, at 48 V."""
    stated = {
        "nominal_voltage": 48.0, "torque_constant": 0.1, "torque_constant_basis": "dc", "resistance": 0.3,
        "no_load_current": 0.2, "rotor_inertia": 1e-4, "nominal_torque": 1.5, "nominal_speed": 300.0,
        "peak_torque": 6.0, "max_speed": 900.0, "mass": 1.0,
    }  # fmt: skip
    return bc.Motor(id=name, maker="M", model=name, **(stated | figures))


GEAR = bc.Gear(
    id="g", maker="G", model="g", kind="planetary", ratio=RATIO, efficiency=0.8, inertia=1e-5, average_torque=60.0,
    repeated_peak_torque=90.0, average_speed=600.0, max_speed=900.0, mass=0.5,
)  # fmt: skip


def criterion(name: str, one: bc.Motor, gear: bc.Gear = GEAR, **conditions):
    """What the judge says of the pendulum's drive by one criterion."""
    actuator = bc.Actuator.of(one, gear)
    found = bc.judge("geared_pendulum", actuators={"shoulder": actuator}, conditions=conditions)
    return {each.name: each for each in found.of("shoulder").criteria}[name]


@pytest.mark.parametrize(
    ("nominal", "bus", "verdict"),
    [(6.0, 48.0, "exceeded"), (24.0, 400.0, "exceeded"), (200.0, 48.0, "exceeded"), (48.0, 48.0, "inside"),
     (24.0, 48.0, "inside"), (96.0, 48.0, "inside"), (23.9, 48.0, "exceeded"), (96.1, 48.0, "exceeded"),
     (None, 48.0, "unknown"), (6.0, None, "note")],
)  # fmt: skip
def test_a_winding_for_another_bus_is_refused_in_both_directions(nominal, bus, verdict) -> None:
    found = criterion("nominal voltage", motor(nominal_voltage=nominal), **({"voltage": bus} if bus else {}))
    assert found.verdict == verdict
    if found.use is not None:
        assert found.use == pytest.approx(abs(math.log2(bus / nominal)), abs=1e-12)


def test_the_ratio_of_bus_and_nominal_voltage_is_a_condition() -> None:
    for allowed, verdict in ((2.0, "exceeded"), (3.0, "inside"), (2.5, "exceeded")):
        found = criterion("nominal voltage", motor(nominal_voltage=18.0), voltage=48.0, voltage_ratio=allowed)
        assert found.verdict == verdict
        assert found.use == pytest.approx(math.log(48.0 / 18.0) / math.log(allowed))


def test_the_ratio_of_inertias_is_that_of_load_and_gear_over_the_rotors() -> None:
    at_shaft = POINT_MASS / RATIO**2 + GEAR.inertia
    for allowed, times, verdict in ((10.0, 9.99, "inside"), (10.0, 10.01, "exceeded"), (3.0, 2.99, "inside")):
        found = criterion("inertia ratio", motor(rotor_inertia=at_shaft / times), inertia_ratio=allowed)
        assert found.verdict == verdict
        assert found.use == pytest.approx(times / allowed, rel=1e-9)
    assert criterion("inertia ratio", motor(rotor_inertia=None)).verdict == "unknown"


def test_a_belt_axis_needs_the_rotor_that_its_maker_prints() -> None:
    # https://www.machinemfg.com/servo-motor-sizing: a load of 18 kg cm² at the shaft (50 kg at a radius of 60 mm behind
    # 10:1) and a ratio of at most 3 needs a rotor of 6 kg cm². Behind its gear here, the pendulum is the same load.
    gear = bc.Gear(id="belt", maker="", model="", kind="spur", ratio=math.sqrt(POINT_MASS / 18e-4), efficiency=1.0,
                   inertia=0.0)  # fmt: skip
    for rotor, verdict in ((6.0e-4, "inside"), (5.9e-4, "exceeded"), (6.1e-4, "inside")):
        assert criterion("inertia ratio", motor(rotor_inertia=rotor), gear, inertia_ratio=3.0).verdict == verdict


@pytest.mark.parametrize(
    ("kind", "commutation", "asked", "verdict"),
    [
        ("motor", "brushed", {}, "note"),
        ("motor", "brushed", {"commutation": "brushed"}, "inside"),
        ("motor", "brushed", {"commutation": "brushless"}, "exceeded"),
        ("motor", None, {"commutation": "brushless"}, "unknown"),
        ("motor", None, {"construction": "housed"}, "inside"),
        ("frameless", None, {"construction": "housed"}, "exceeded"),
        ("frameless", None, {"construction": "housed", "commutation": "brushless"}, "exceeded"),
        ("frameless", "brushless", {"construction": "frameless", "commutation": "brushless"}, "inside"),
    ],
)
def test_a_motor_of_another_type_than_asked_for_is_refused(kind, commutation, asked, verdict) -> None:
    found = criterion("motor type", motor(kind=kind, commutation=commutation), **asked)
    assert found.verdict == verdict
    assert commutation is None or commutation in found.text


def test_a_torque_constant_per_phase_current_tells_a_brushless_motor() -> None:
    sinusoidal = motor(commutation=None, torque_constant_basis="phase_rms")
    assert criterion("motor type", sinusoidal, commutation="brushless").verdict == "inside"
    assert criterion("motor type", sinusoidal, commutation="brushed").verdict == "exceeded"


def test_only_motors_of_the_type_that_is_asked_for_are_chosen() -> None:
    for commutation in ("brushed", "brushless"):
        selection = bc.select("geared_pendulum", conditions={"commutation": commutation, "construction": "housed"})
        for axis in selection.axes:
            assert axis.chosen is not None and axis.chosen.motor.commutation == commutation
            assert axis.chosen.motor.kind != "frameless"


def test_a_use_close_to_its_limit_is_said_to_leave_little_reserve() -> None:
    at_shaft = POINT_MASS / RATIO**2 + GEAR.inertia
    for share, told in ((0.94, False), (0.96, True)):
        actuators = {"shoulder": bc.Actuator.of(motor(rotor_inertia=at_shaft / (10.0 * share)), GEAR)}
        found = bc.judge("geared_pendulum", actuators=actuators)
        assert found.of("shoulder").binding.name == "inertia ratio"
        assert ("Less than 5% is left in reserve" in verdict_tables.verdict(found)) is told


def test_ratings_are_not_judged_by_voltage_or_inertia() -> None:
    found = bc.judge("geared_pendulum", conditions={"voltage": 48.0, "inertia_ratio": 0.01})
    by_name = {one.name: one.verdict for one in found.of("shoulder").criteria}
    assert by_name["nominal voltage"] == by_name["inertia ratio"] == "note"


def voltages(selection: bc.results.Selection) -> list[float]:
    return [axis.chosen.motor.nominal_voltage for axis in selection.axes]


def mass(selection: bc.results.Selection) -> float:
    return sum(axis.chosen.mass for axis in selection.axes)


def windings(volts: dict[str, float]) -> bc.Catalogue:
    """Two sizes of motors, each with windings of its own; the lightest of each size has another voltage."""
    motors = [
        motor(f"{size}{k}", nominal_voltage=one, nominal_torque=torque, peak_torque=5.0 * torque,
              rotor_inertia=2e-4 * torque, resistance=0.2 * (one / 48.0) ** 2, torque_constant=0.1 * one / 48.0,
              no_load_current=0.2 * 48.0 / one, mass=torque + 0.01 * k)
        for size, torque, every in (("small", 0.6, volts["small"]), ("large", 4.0, volts["large"]))
        for k, one in enumerate(every)
    ]  # fmt: skip
    gears = [
        bc.Gear(id=f"g{ratio:g}", maker="G", model="g", kind="planetary", ratio=ratio, efficiency=0.8, inertia=1e-5,
                average_torque=400.0, repeated_peak_torque=700.0, average_speed=600.0, max_speed=900.0, mass=0.5)
        for ratio in (80.0, 160.0)
    ]  # fmt: skip
    return bc.Catalogue(tuple(motors), tuple(gears))


@pytest.mark.tier2
@pytest.mark.parametrize(
    "volts",
    [{"small": (6.0, 24.0, 96.0), "large": (300.0, 150.0, 48.0)}, {"small": (12.0, 310.0), "large": (96.0, 24.0)},
     {"small": (48.0,), "large": (48.0, 24.0)}],
)  # fmt: skip
def test_the_motors_chosen_without_a_bus_are_the_lightest_that_suit_one_bus(volts) -> None:
    catalogue = windings(volts)
    chosen = bc.select("planar_2r", catalogue=catalogue)
    every = sorted({one.nominal_voltage for one in catalogue.motors})
    best = math.inf
    for low, high in itertools.combinations_with_replacement(every, 2):
        if high <= 4.0 * low:
            some = tuple(one for one in catalogue.motors if low <= one.nominal_voltage <= high)
            alone = bc.select("planar_2r", catalogue=bc.Catalogue(some, catalogue.gears))
            if all(axis.chosen is not None for axis in alone.axes):
                best = min(best, mass(alone))
    assert mass(chosen) == pytest.approx(best, rel=1e-12)
    assert max(voltages(chosen)) <= 4.0 * min(voltages(chosen))
    (bus,) = (one for one in chosen.system if one.name == "common bus")
    assert bus.verdict == "inside"
    assert bus.use == pytest.approx(math.log(max(voltages(chosen)) / min(voltages(chosen))) / (2.0 * math.log(2.0)))
    assert chosen.proof.startswith("optimal")


def test_motors_that_are_given_for_different_buses_exceed_one_bus() -> None:
    catalogue = windings({"small": (6.0,), "large": (300.0,)})
    chosen = bc.select("planar_2r", catalogue=catalogue, keep={"elbow": "small0+g80", "shoulder": "large0+g160"})
    (bus,) = (one for one in chosen.system if one.name == "common bus")
    assert bus.verdict == "exceeded" and not chosen.inside
    given = bc.select("planar_2r", catalogue=catalogue, keep={"elbow": "small0+g80", "shoulder": "large0+g160"},
                      conditions={"voltage": 48.0})  # fmt: skip
    assert [one.verdict for one in given.system if one.name == "common bus"] == ["note"]
