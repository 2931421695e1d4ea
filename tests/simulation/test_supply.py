"""The supply of drives and the temperatures of motors as states, against another integrator and balances of energy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp

import bellcrank as bc
from tests.simulation.test_drives import KT, LOAD, MOTOR, J, L, N, R, column, scene

BUS = {"voltage": 48.0, "bus_capacitance": 2e-3, "bus_max_voltage": 56.0, "brake_resistance": 5.0}
OWN = {"resistance": 0.5}
HEAT = {"resistance_winding_housing": 2.0, "resistance_housing_ambient": 6.0, "time_constant_winding": 10.0,
        "time_constant_motor": 400.0}  # fmt: skip
HOT = MOTOR | HEAT
LOOPS = {"position": {"kp": 30}, "speed": {"kp": 0.1, "ti": 0.05}, "current": {"kp": 1, "ki": 400}}
VOLTS = "48*sin(12*t)"


def supply(run: bc.results.Trajectory, name: str) -> np.ndarray:
    """A column of the output of the supply."""
    labels = [label.removeprefix("supply ") for label in run.scene.outputs["supply"].labels]
    return run.outputs["supply"][:, labels.index(name)]


def supplied(folder: Path, conditions: dict[str, Any] = BUS, volts: str = VOLTS, **more: Any) -> Path:
    """The arm with a dc drive on a bus of its own, which turns to and fro."""
    drive = {"model": "dc", "servo": {"voltage": volts}}
    return scene(folder, drive, conditions=conditions, supply=OWN, **more)


def test_a_bus_sags_and_rises_as_another_integrator_has_it(tmp_path: Path) -> None:
    run = bc.simulate(supplied(tmp_path, simulate={"duration": 1.0, "rtol": 1e-10, "atol": 1e-10}))
    inertia, most, rest = J + LOAD / N**2, BUS["bus_max_voltage"], BUS["voltage"]

    def rate(t: float, x: np.ndarray) -> list[float]:
        speed, current, bus = x
        volts = float(np.clip(48.0 * np.sin(12.0 * t), -bus, bus))
        share = min(1.0, max(0.0, (bus - most) / (0.01 * most)))
        source = max(0.0, rest - bus) / OWN["resistance"]
        change = source - volts * current / bus - share * bus / BUS["brake_resistance"]
        return [KT * current / inertia, (volts - R * current - KT * speed) / L, change / BUS["bus_capacitance"]]

    known = solve_ivp(rate, (0, 1), [0, 0, rest], "Radau", run.time, rtol=1e-10, atol=1e-10, max_step=2e-4).y
    bus = supply(run, "bus voltage [V]")
    assert N * run.velocity[:, 0] == pytest.approx(known[0], abs=1e-5 * np.abs(known[0]).max())
    assert bus == pytest.approx(known[2], abs=1e-5 * rest)
    assert bus.min() < 0.97 * rest and bus.max() > most  # it sags, and what the arm feeds back is burnt


def test_the_energy_of_the_bus_is_balanced(tmp_path: Path) -> None:
    """Capacitor, source, resistor and windings; what the windings take is copper loss, work and magnetic energy."""
    run = bc.simulate(supplied(tmp_path, simulate={"duration": 1.0, "rtol": 1e-10, "atol": 1e-10, "samples": 20001}))
    names = [label for states in run.scene.auxiliary_states for label in states.labels]
    value = {name: run.auxiliary[:, names.index(name)] for name in names}
    stored = 0.5 * BUS["bus_capacitance"] * (value["bus voltage [V]"] ** 2 - BUS["voltage"] ** 2)
    taken = value["energy of the source [J]"] - value["energy of the resistor [J]"] - stored
    copper = R * value["current [A]"] ** 2
    lost = np.concatenate([[0.0], np.cumsum(0.5 * (copper[1:] + copper[:-1]) * np.diff(run.time))])
    assert taken == pytest.approx(run.work + lost + 0.5 * L * value["current [A]"] ** 2, abs=1e-5 * np.abs(lost).max())
    assert value["energy of the resistor [J]"][-1] > 0.1


def test_without_a_resistor_the_bus_keeps_what_is_fed_back_and_a_note_says_how_high_it_goes(
    tmp_path: Path,
) -> None:
    bare = {key: BUS[key] for key in ("voltage", "bus_capacitance", "bus_max_voltage")}
    run = bc.simulate(supplied(tmp_path, bare, simulate={"duration": 1.0}))
    assert supply(run, "bus voltage [V]").max() > BUS["bus_max_voltage"] * 1.05
    assert any("bus" in note and "bus_max_voltage" in note for note in run.notes)
    assert "bus" in run.table()


def test_a_stiff_source_and_a_large_capacitor_are_the_bus_of_constant_voltage(tmp_path: Path) -> None:
    firm = bc.simulate(supplied(tmp_path, BUS | {"bus_capacitance": 1e6}))
    (tmp_path / "b").mkdir()
    drive = {"model": "dc", "servo": {"voltage": VOLTS}}
    plain = bc.simulate(scene(tmp_path / "b", drive, conditions=BUS))
    assert firm.velocity == pytest.approx(plain.velocity, abs=1e-6 * np.abs(plain.velocity).max())


def test_winding_and_housing_warm_up_as_the_two_body_model_says(tmp_path: Path) -> None:
    drive = {"model": "dc", "motor": HOT, "servo": {"voltage": 2.0}, "temperatures": {"winding": 60, "housing": 40}}
    held = {"constraints": [], "joints": {"axis": {"brake": {"torque": 500, "engaged": 1}}}}
    run = bc.simulate(scene(tmp_path, drive, simulate={"duration": 3000.0, "rtol": 1e-9, "atol": 1e-9}, **held))

    def rate(t: float, x: np.ndarray) -> list[float]:
        winding, housing, current = x
        resistance = R * (1 + 0.0039 * (winding - 25))
        inside, outside = (winding - housing) / 2.0, (housing - 25) / 6.0
        return [(resistance * current**2 - inside) * 2.0 / 10.0, (inside - outside) * 6.0 / 400.0,
                (2.0 - resistance * current) / L]  # fmt: skip

    known = solve_ivp(rate, (0, 3000), [60, 40, 0], "Radau", run.time, rtol=1e-10, atol=1e-10).y
    winding = column(run, "winding temperature [°C]")
    assert winding == pytest.approx(known[0], abs=1e-5)
    assert column(run, "housing temperature [°C]") == pytest.approx(known[1], abs=1e-5)
    resistance = R * (1 + 0.0039 * (winding[-1] - 25))
    assert winding[-1] == pytest.approx(25 + 8.0 * 4.0 / resistance, abs=0.1)  # T_a + (R_wh + R_ha) U²/R


PHASES = HOT | {"torque_constant_basis": "phase_rms", "pole_pairs": 4}


def test_a_dq_drive_draws_what_it_delivers_and_loses(tmp_path: Path) -> None:
    """At rest in the end: 3/2 (u_q i_q + u_d i_d) = T ω + 3/2 R i², with R at the winding's temperature."""
    servo = {"target": 0.0, "position": {"kp": 20}, "speed": {"kp": 0.2, "ti": 0.05}, "current": {"kp": 1, "ki": 400}}
    drive = {"model": "dq", "motor": PHASES, "temperatures": {"winding": 100}, "servo": servo}
    load = [{"kind": "joint_force", "joint": "axis", "value": -20.0}]
    run = bc.simulate(
        scene(tmp_path, drive, conditions=BUS, supply=OWN, forces=load, simulate={"duration": 6.0, "rtol": 1e-9})
    )
    power, torque = supply(run, "power of drives [W]")[-1], column(run, "motor torque [N m]")[-1]
    speed, current = column(run, "rotor velocity [rad/s]")[-1], column(run, "current [A]")[-1]
    warm = 0.5 * R * (1 + 0.0039 * (column(run, "winding temperature [°C]")[-1] - 25))
    assert power == pytest.approx(torque * speed + 1.5 * warm * current**2, rel=1e-5) and current > 1.0
    assert supply(run, "power of source [W]")[-1] == pytest.approx(power, rel=1e-4)


@pytest.mark.parametrize(
    ("actuator", "more", "message"),
    [
        ({"model": "torque", "servo": {"torque": 0}}, {"supply": OWN, "conditions": BUS}, "currents are unknown"),
        ({}, {"supply": OWN, "conditions": {"voltage": 48}}, "requires conditions.bus_capacitance"),
        ({}, {"supply": OWN, "conditions": BUS | {"bus_max_voltage": 40}}, "bus_max_voltage above conditions.voltage"),
        ({}, {"supply": {}, "conditions": BUS}, "resistance"),
        ({"voltage": 40}, {"supply": OWN, "conditions": BUS}, "one bus supplies all drives"),
        ({"motor": MOTOR, "temperatures": {}}, {}, "temperatures require motor.resistance_winding_housing"),
        ({"model": "torque", "servo": {"torque": 0}, "temperatures": {}}, {}, "currents of model"),
    ],
)
def test_a_supply_or_a_temperature_that_is_not_known_is_refused(
    tmp_path: Path, actuator: dict[str, Any], more: dict[str, Any], message: str
) -> None:
    drive = {"model": "dc", "motor": HOT, "servo": {"voltage": 0}} | actuator
    with pytest.raises(bc.InputError, match=message):
        bc.load_scene(scene(tmp_path, drive, **more))


def test_a_supply_without_drives_is_refused(tmp_path: Path) -> None:
    path = scene(tmp_path, {"model": "dc", "servo": {"voltage": 0}})
    data = yaml.safe_load(path.read_text()) | {"supply": OWN}
    data.pop("actuators")
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(bc.InputError, match="requires drives"):
        bc.load_scene(path)


def test_a_verified_selection_says_how_high_its_bus_goes_and_keeps_a_limit_on_it(tmp_path: Path) -> None:
    servo = {
        "motion": "swing",
        "position": {"kp": 30},
        "speed": {"kp": 0.1, "ti": 0.05},
        "current": {"kp": 1, "ki": 400},
    }
    motions = {"swing": {"kind": "waypoints", "times": [0, 0.5, 1], "positions": [{}, {"axis": 2.0}, {}]}}
    drive = {"model": "dc", "motor": HOT, "servo": servo}
    path = scene(tmp_path, drive, conditions=BUS, supply=OWN, motions=motions, simulate={"rtol": 1e-6, "atol": 1e-6})
    found = bc.verify_selection(path, limits={"bus_voltage": 50.0})
    assert found.bus_voltages["swing"] > 50.0 and any("bus voltage" in text for text in found.exceeded)
    assert "largest voltage of the bus" in found.table()
    assert bc.verify_selection(path, limits={"bus_voltage": 80.0}).kept
    bare = scene(tmp_path, drive, conditions=BUS, motions=motions)
    assert any(
        "bus voltage is unknown" in text for text in bc.verify_selection(bare, limits={"bus_voltage": 80}).exceeded
    )


def test_margins_are_those_of_the_bus_at_rest_and_of_the_winding_at_its_first_temperature(tmp_path: Path) -> None:
    servo = LOOPS | {"target": 0.0}
    warm = {"model": "dc", "motor": HOT, "servo": servo, "temperatures": {"winding": 110}}
    on_bus = bc.linearise(scene(tmp_path, warm, conditions=BUS, supply=OWN)).drives[0]
    plain = {"model": "dc", "servo": servo, "winding_temperature": 110}
    other = bc.linearise(scene(tmp_path, plain, conditions=BUS)).drives[0]
    assert on_bus.phase_margin == pytest.approx(other.phase_margin, rel=1e-9)
    assert on_bus.bandwidth == pytest.approx(other.bandwidth, rel=1e-9)


def test_a_run_on_a_bus_goes_on_from_a_saved_one(tmp_path: Path) -> None:
    whole = bc.simulate(supplied(tmp_path, simulate={"duration": 0.4, "rtol": 1e-10, "atol": 1e-10}))
    bc.simulate(supplied(tmp_path, simulate={"duration": 0.2, "rtol": 1e-10, "atol": 1e-10})).save(
        tmp_path / "half.npz"
    )
    rest = bc.simulate(supplied(tmp_path, initial={"run": "half.npz"}, simulate={"duration": 0.2, "rtol": 1e-10}))
    assert supply(rest, "bus voltage [V]")[-1] == pytest.approx(supply(whole, "bus voltage [V]")[-1], abs=1e-5)


def test_a_sizing_says_that_the_supply_acts_in_simulations_only(tmp_path: Path) -> None:
    motions = {"swing": {"kind": "waypoints", "times": [0, 0.5], "positions": [{}, {"axis": 1.0}]}}
    path = supplied(tmp_path, motions=motions)
    for given in (path, bc.load_scene(path)):
        assert "supply acts in simulations only" in " ".join(bc.size(given).warnings)
