"""Drives in the loop: the Manutec r3's axis as published; motors and servos against closed forms and loops by hand."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import bellcrank as bc

HERE = Path(__file__).parent
MASS, REACH, OWN, G = 4.0, 0.3, 0.02, 9.81
N, J, C, D = 50.0, 2e-4, 20_000.0, 30.0
KT, R, L = 0.1, 0.8, 1e-3
LOAD = OWN + MASS * REACH**2
ARM = f"""<robot name="arm"><link name="base"/><link name="load"><inertial>
<origin xyz="{REACH} 0 0"/><mass value="{MASS}"/>
<inertia ixx="{OWN}" iyy="{OWN}" izz="{OWN}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="axis" type="continuous"><parent link="base"/><child link="load"/><axis xyz="0 -1 0"/></joint></robot>"""
MOTOR = {"maker": "a", "model": "b", "torque_constant": KT, "torque_constant_basis": "dc", "resistance": R,
         "inductance": L, "rotor_inertia": J, "nominal_voltage": 48.0, "peak_current": 12.0}  # fmt: skip
GEAR = {"maker": "a", "model": "g", "kind": "planetary", "ratio": N, "efficiency": 1, "inertia": 0,
        "inertia_side": "input"}  # fmt: skip
NONE = {"coulomb": 0, "viscous": 0}


def scene(folder: Path, actuator: dict[str, Any], **more: Any) -> Path:
    """A pendulum arm with a drive; without gravity unless `more` says otherwise."""
    (folder / "arm.urdf").write_text(ARM)
    drive = {"motor": MOTOR, "gear": GEAR, "model": "torque", "rotor_friction": NONE} | actuator
    simulate = {"duration": 0.5, "rtol": 1e-12, "atol": 1e-12, "samples": 51} | more.pop("simulate", {})
    data = {"urdf": "arm.urdf", "gravity": [0, 0, 0], "actuators": {"axis": drive}, "simulate": simulate} | more
    path = folder / "arm.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


def column(run: bc.results.Trajectory, name: str) -> np.ndarray:
    """A column of the output of the drive."""
    labels = run.scene.outputs["drive_axis"].labels
    return run.outputs["drive_axis"][:, [label.removeprefix("drive_axis ") for label in labels].index(name)]


# ---- the Manutec r3


def test_the_manutec_axis_follows_modelicas_published_trajectory() -> None:
    text = (HERE / "one_axis_reference.csv").read_text().splitlines()
    rows = np.array([line.split(",") for line in text[3:]], dtype=float)
    time, published, mode = rows[:, 0], rows[:, 1:8], rows[:, 8]
    run = bc.simulate("manutec_axis", times=time)
    angle, speed, current, integrator, voltage = run.auxiliary.T
    ratio, asked = 210.0, 0.5 * 1.1616
    found = [
        integrator / asked, ratio * run.position[:, 0] - angle, ratio * run.velocity[:, 0] - speed,
        run.position[:, 0], run.velocity[:, 0], -voltage / 5.0, current,
    ]  # fmt: skip
    for mine, theirs in zip(found, published.T, strict=True):
        assert np.abs(mine - theirs).max() < 5e-4 * np.ptp(theirs)
    # ends of the intervals in which friction holds the rotor; and where it turns round
    switches = np.concatenate([run.stuck("axis rotor").ravel()[1:], [0.9979175989821066]])
    expected = [0.0006523299834101522, 0.9979175989821066, 1.09345449622227, 1.098922957132426, 1.127850138192571,
                1.3536239494719329]  # fmt: skip
    turned = bc.simulate("manutec_axis", times=np.linspace(0.9978, 0.998, 2001))
    sign = np.sign(turned.auxiliary[:, 1])
    assert abs(turned.time[np.argmin(sign)] - expected[1]) < 2e-4
    assert np.abs(np.sort(switches) - expected).max() < 2e-4
    assert {*mode.astype(int)} == {-1, 0, 1}
    assert run.energy_drift() < 1e-9


# ---- motors


def test_a_dc_motor_starts_as_its_closed_form(tmp_path: Path) -> None:
    # J ω' = k i - b ω, L i' = U - R i - k ω from rest: x(t) = x∞ + expm(A t) (x0 - x∞), by its two eigenvalues
    friction, volts = 1e-3, 6.0
    drive = {"model": "dc", "servo": {"voltage": volts}, "rotor_friction": {"coulomb": 0, "viscous": friction}}
    run = bc.simulate(scene(tmp_path, drive, simulate={"duration": 0.2}))
    inertia = J + LOAD / N**2
    a = np.array([[-friction / inertia, KT / inertia], [-KT / L, -R / L]])
    steady = np.linalg.solve(a, [0.0, -volts / L])
    values, vectors = np.linalg.eig(a)
    modal = np.linalg.solve(vectors, -steady)
    exact = (steady[:, None] + vectors @ (modal[:, None] * np.exp(np.outer(values, run.time)))).real
    assert np.abs(N * run.velocity[:, 0] - exact[0]).max() < 1e-9 * np.abs(exact[0]).max()
    assert np.abs(run.auxiliary[:, 0] - exact[1]).max() < 1e-9 * np.abs(exact[1]).max()


def test_a_rigid_drive_moves_the_joint_as_its_torque_times_the_ratio_does(tmp_path: Path) -> None:
    given = bc.simulate(scene(tmp_path, {"servo": {"torque": "0.4*sin(9*t)"}}, gravity=[0, 0, -G]))
    plain = {"urdf": "arm.urdf", "gravity": [0, 0, -G], "simulate": {"duration": 0.5, "rtol": 1e-12, "atol": 1e-12,
             "samples": 51}, "actuators": {"axis": {"motor": MOTOR, "gear": GEAR}},
             "control": [{"kind": "torque", "joint": "axis", "value": f"{N}*0.4*sin(9*t)"}]}  # fmt: skip
    (tmp_path / "plain.yaml").write_text(yaml.safe_dump(plain))
    assert np.abs(given.state[:, :2] - bc.simulate(tmp_path / "plain.yaml").state[:, :2]).max() < 1e-12


def test_the_torque_of_a_drive_stays_within_the_region_of_the_judge(tmp_path: Path) -> None:
    run = bc.simulate(scene(tmp_path, {"servo": {"torque": 5.0}}, simulate={"duration": 2.0, "samples": 401}))
    torque, speed = column(run, "motor torque [N m]"), column(run, "rotor velocity [rad/s]")
    usable = 48.0 * 0.9  # the judge's voltage, less its reserve
    assert torque[0] == pytest.approx(12.0 * KT, rel=1e-12)
    line = (usable - KT * speed) * KT / R
    assert np.abs(torque - np.minimum(12.0 * KT, line)).max() < 1e-9
    assert (line < 12.0 * KT).any()
    assert speed[-1] == pytest.approx(usable / KT, rel=2e-2)
    assert column(run, "command over limit [1]").min() > 1.0


PHASES = {"maker": "a", "model": "s", "torque_constant": 0.3, "torque_constant_basis": "phase_rms", "resistance": 1.2,
          "inductance": 6e-3, "pole_pairs": 4, "rotor_inertia": J, "nominal_voltage": 48.0,
          "peak_current": 10.0}  # fmt: skip


@pytest.mark.parametrize("load", [0.0, 0.8, -0.8])
@pytest.mark.parametrize("speed", [20.0, 120.0, 260.0])
def test_a_synchronous_motor_comes_to_the_voltage_circles_steady_state(
    tmp_path: Path, speed: float, load: float
) -> None:
    # ω L i_q and ω (L i_d + ψ) within the circle: by hand, phase figures and amplitudes
    r, el, pairs = 0.6, 3e-3, 4
    torque_constant = 0.3 / math.sqrt(2.0)
    flux = torque_constant / (1.5 * pairs)
    servo = {"motion": "turn", "position": {"kp": 20}, "speed": {"kp": 0.05, "ti": 0.05},
             "current": {"kp": 6.0, "ki": 1200.0}}  # fmt: skip
    motion = {"turn": {"kind": "csv", "file": "turn.csv"}}
    time = np.linspace(0.0, 2.0, 401)
    ramp = np.minimum(time, 1.0)
    places = speed / N * (np.where(time < 1.0, 0.5 * ramp**2, 0.5 + (time - 1.0)))
    (tmp_path / "turn.csv").write_text(
        "time [s],axis position [rad],axis velocity [rad/s]\n"
        + "".join(
            f"{t!r},{q!r},{speed / N * r!r}\n"
            for t, q, r in zip(time.tolist(), places.tolist(), ramp.tolist(), strict=True)
        )
    )
    path = scene(
        tmp_path, {"motor": PHASES, "model": "dq", "servo": servo}, motions=motion,
        forces=[{"kind": "joint_force", "joint": "axis", "value": -load * N}], simulate={"duration": 2.0, "rtol": 1e-9},
    )  # fmt: skip
    run = bc.simulate(path)
    across, along = run.auxiliary[-1, :2]
    assert N * run.velocity[-1, 0] == pytest.approx(speed, rel=1e-6)
    assert across == pytest.approx(load / torque_constant, rel=1e-6, abs=1e-6)
    spin, most = pairs * speed, 48.0 / math.sqrt(3.0)
    room = ((0.95 * most - r * abs(across)) / spin) ** 2 - (el * across) ** 2
    weakened = min(0.0, (math.sqrt(room) - flux) / el)
    assert along == pytest.approx(weakened, rel=1e-6, abs=1e-6)
    u_q = r * across + spin * (el * along + flux)
    u_d = r * along - spin * el * across
    assert column(run, "voltage [V]")[-1] == pytest.approx(math.hypot(u_d, u_q), rel=1e-6)
    assert math.hypot(u_d, u_q) <= most * (1 + 1e-9)


# ---- gears


def test_an_undamped_axis_of_two_masses_has_its_textbook_resonance(tmp_path: Path) -> None:
    path = scene(tmp_path, {"elastic": {"stiffness": C, "damping": 0}, "servo": {"torque": 0}})
    drive = bc.linearise(path).drives[0]
    lower = math.sqrt(C / LOAD)
    assert drive.antiresonances == pytest.approx([lower], rel=1e-9)
    assert drive.resonances == pytest.approx([lower * math.sqrt(1.0 + LOAD / (J * N**2))], rel=1e-9)


def test_energy_of_rotor_and_gear_is_kept(tmp_path: Path) -> None:
    path = scene(tmp_path, {"elastic": {"stiffness": C, "damping": 0}, "servo": {"torque": "0.3*cos(20*t)"}},
                 gravity=[0, 0, -G])  # fmt: skip
    run = bc.simulate(path)
    assert run.energy_drift() < 1e-11
    assert np.ptp(run.work) > 0.1


@pytest.mark.parametrize("lifted", [True, False])
def test_a_gear_loses_its_share_in_both_directions_of_the_power(tmp_path: Path, lifted: bool) -> None:
    # a force of the scene turns the load at constant speed against, or with, the motor's torque
    driving, driven, load = 0.8, 0.6, 20.0
    gear = GEAR | {"efficiency": driving, "back_efficiency": driven}
    sign = 1.0 if lifted else -1.0
    servo = {"torque": load / N / driving if lifted else load / N * driven}
    path = scene(
        tmp_path, {"gear": gear, "elastic": {"stiffness": C, "damping": D}, "servo": servo},
        forces=[{"kind": "joint_force", "joint": "axis", "value": -load}],
        initial={"velocity": {"axis": sign * 2.0}}, simulate={"duration": 0.3},
    )  # fmt: skip
    run = bc.simulate(path)
    assert np.abs(run.velocity[:, 0] - sign * 2.0).max() < 1e-9


def test_a_self_locking_screw_holds_an_hour_without_creep_and_gives_way_beyond(tmp_path: Path) -> None:
    gear = GEAR | {"efficiency": 0.4, "back_efficiency": 0.0}
    drive = {"gear": gear, "elastic": {"stiffness": C, "damping": D}, "servo": {"torque": 0.0}}
    held = bc.simulate(scene(tmp_path, drive, gravity=[0, 0, -G], simulate={"duration": 3600.0}))
    assert held.stuck("axis rotor").tolist() == [[0.0, 3600.0]]
    assert np.abs(held.velocity).max() < 1e-12
    assert np.abs(held.auxiliary[:, 1]).max() == 0.0
    coasting = drive | {"gear": GEAR | {"efficiency": 0.4, "back_efficiency": 0.1}}
    gone = bc.simulate(scene(tmp_path, coasting, gravity=[0, 0, -G], simulate={"duration": 0.2}))
    assert gone.position[-1, 0] < -0.01


@pytest.mark.parametrize(("share", "moves"), [(0.999, False), (1.001, True)])
def test_the_rotors_friction_holds_the_joint_up_to_its_breakaway_torque(
    tmp_path: Path, share: float, moves: bool
) -> None:
    friction, load = 0.3, MASS * REACH * G
    held = load / N - share * friction  # what is left for friction to hold
    drive = {"elastic": {"stiffness": C, "damping": D}, "servo": {"torque": held},
             "rotor_friction": {"coulomb": friction}}  # fmt: skip
    run = bc.simulate(scene(tmp_path, drive, gravity=[0, 0, -G], simulate={"duration": 20.0}))
    assert bool(np.abs(run.auxiliary[:, 1]).any()) is moves
    assert bool(abs(run.position[-1, 0]) > 1e-3) is moves


def test_a_gear_with_backlash_pushes_only_beyond_its_gap_as_another_integrator_has_it(tmp_path: Path) -> None:
    gap, half = 0.01, 0.005
    drive = {"elastic": {"stiffness": C, "damping": D, "backlash": gap}, "servo": {"torque": "0.3*sin(6*t)"}}
    run = bc.simulate(scene(tmp_path, drive, simulate={"duration": 1.0}))

    def rate(t: float, x: np.ndarray) -> list[float]:
        twist, speed = x[2] / N - x[0], x[3] / N - x[1]
        force = max(0.0, C * (twist - half) + D * speed) if twist > half else 0.0
        force -= max(0.0, C * (-twist - half) - D * speed) if twist < -half else 0.0
        return [x[1], force / LOAD, x[3], (0.3 * math.sin(6 * t) - force / N) / J]

    edges = [lambda t, x, s=s: s * (x[2] / N - x[0]) - half for s in (1.0, -1.0)]
    x, rows = np.zeros(4), [np.zeros(4)]
    for before, after in zip(run.time[:-1], run.time[1:], strict=True):  # restarted at each row, with small steps
        x = solve_ivp(rate, (before, after), x, "RK45", rtol=1e-11, atol=1e-13, max_step=1e-4, events=edges).y[:, -1]
        rows.append(x)
    mine = np.column_stack([run.position, run.velocity, run.auxiliary])
    assert np.abs(mine - np.array(rows)).max() < 1e-6 * np.abs(mine).max()
    twist, force = column(run, "twist [rad]"), column(run, "gear output [N m]")
    assert not force[np.abs(twist) < half].any() and (force * twist).min() >= 0.0
    assert run.energy_drift() < 1e-10


# ---- servos


def test_a_sampled_cascade_steps_as_one_written_by_hand(tmp_path: Path) -> None:
    late, fine, delay, step = 4e-3, 1e-3, 3e-4, 2.5e-4
    grain, target, kv, kp, ti, ki = 2 * math.pi / 4096, 0.8, 12.0, 0.06, 0.04, 300.0
    servo = {"target": target, "position": {"kp": kv}, "speed": {"kp": kp, "ti": ti}, "current": {"kp": 1.0, "ki": ki},
             "sample_time": {"position": late, "speed": fine, "current": step}, "delay": delay,
             "resolution": grain}  # fmt: skip
    drive = {"model": "dc", "elastic": {"stiffness": C, "damping": D}, "servo": servo,
             "rotor_friction": {"coulomb": 0, "viscous": 1e-4}}  # fmt: skip
    run = bc.simulate(scene(tmp_path, drive, gravity=[0, 0, -G], simulate={"duration": 0.1, "samples": 11}))

    def rate(_: float, x: np.ndarray, volts: float) -> list[float]:
        q, v, angle, speed, current = x
        force = C * (angle / N - q) + D * (speed / N - v)
        return [v, (force - MASS * REACH * G * math.cos(q)) / LOAD, speed,
                (KT * current - force / N - 1e-4 * speed) / J, (volts - R * current - KT * speed) / L]  # fmt: skip

    def read(angle: float) -> float:
        return math.floor(angle / grain) * grain

    torque = MASS * REACH * G / N
    x = np.array([0.0, 0.0, N * MASS * REACH * G / C, 0.0, torque / KT])
    before, wanted, volts = read(x[2]), 0.0, R * torque / KT
    integral, current_integral, queue = torque + kp * kv * x[2], volts, volts  # the encoder does not see the twist
    rows, late_by = [x], delay - step
    for k in range(round(0.1 / step)):
        if k % round(late / step) == 0:
            wanted = N * kv * (target - read(x[2]) / N)
        if k % round(fine / step) == 0:
            error = wanted - (read(x[2]) - before) / fine
            before = read(x[2])
            asked = kp * error + integral
            torque = min(max(asked, -12 * KT), 12 * KT)
            integral += fine / ti * (kp * error + torque - asked)
        error = torque / KT - x[4]
        command = error + current_integral
        next_volts = min(max(command, -48.0), 48.0)
        current_integral += step * (ki * error + R / L * (next_volts - command))
        for span, value in ((late_by, volts), (step - late_by, queue)):
            x = solve_ivp(rate, (0.0, span), x, "DOP853", args=(value,), rtol=1e-12, atol=1e-13).y[:, -1]
        volts, queue = queue, next_volts
        if (k + 1) % round(0.01 / step) == 0:
            rows.append(x)
    mine = np.column_stack([run.position, run.velocity, run.auxiliary[:, :3]])
    assert np.abs(mine - np.array(rows)).max() < 1e-8
    assert np.abs(np.array(rows)[:, 4]).max() > 11.0  # the limit of the current is met


def test_a_slow_sampled_current_loop_is_led_back_without_swinging(tmp_path: Path) -> None:
    # the sample time is more than two time constants of the winding, and the voltage is at its limit for a long time
    servo = {"target": 30.0, "position": {"kp": 5}, "speed": {"kp": 0.02, "ti": 0.1}, "current": {"kp": 0.3, "ki": 60},
             "sample_time": 3e-3}  # fmt: skip
    path = scene(tmp_path, {"model": "dc", "servo": servo}, simulate={"duration": 6.0, "samples": 3001})
    run = bc.simulate(path)
    assert column(run, "command over limit [1]").max() == 1.0
    held = np.abs(run.signals[-1].coefficients[:, 0, -3:])  # what the loops hold stays near the bus voltage
    assert held.max() < 100.0
    assert abs(run.position[-1, 0] - 30.0) < 1e-5


def test_a_continuous_cascade_is_led_back_from_its_limit(tmp_path: Path) -> None:
    kv, kp, ti = 20.0, 0.05, 0.05
    servo = {"target": 1.0, "position": {"kp": kv}, "speed": {"kp": kp, "ti": ti}, "encoder": "load"}
    motor = {key: value for key, value in MOTOR.items() if key not in ("nominal_voltage", "resistance")}
    run = bc.simulate(scene(tmp_path, {"motor": motor, "servo": servo}, simulate={"duration": 1.0}))

    def rate(_: float, x: np.ndarray) -> list[float]:
        error = N * kv * (1.0 - x[0]) - N * x[1]
        asked = kp * error + x[2]
        torque = min(max(asked, -12 * KT), 12 * KT)
        return [x[1], N * torque / (LOAD + J * N**2), (kp * error + torque - asked) / ti]

    exact = solve_ivp(
        rate, (0.0, 1.0), [0.0, 0.0, 0.0], "LSODA", t_eval=run.time, rtol=1e-12, atol=1e-12, max_step=1e-3
    ).y
    assert np.abs(run.position[:, 0] - exact[0]).max() < 1e-7


def test_margins_of_a_sampled_loop_are_those_at_which_its_runs_begin_to_grow(tmp_path: Path) -> None:
    def path(factor: float) -> Path:
        servo = {"target": 1e-4, "position": {"kp": 12}, "speed": {"kp": 0.06 * factor, "ti": 0.04},
                 "sample_time": 1e-3, "delay": 5e-4}  # fmt: skip
        return scene(tmp_path, {"elastic": {"stiffness": C, "damping": D}, "servo": servo},
                     simulate={"duration": 4.0, "samples": 4001})  # fmt: skip

    margin = bc.linearise(path(1.0)).drives[0].gain_margin
    assert margin is not None and 1.5 < margin < 20.0
    for factor, grows in ((0.97, False), (1.03, True)):  # it grows to a limit cycle at the largest torque
        run = bc.simulate(path(factor * margin))
        speed = np.abs(run.velocity[:, 0])
        assert (
            bool(speed[-500:].max() > 0.1 * speed[:500].max()) is grows
        )  # it ends in a limit cycle at the largest torque


def two_links(folder: Path, closed: bool) -> Path:
    """Two links under gravity of which the second turns −2 times as far: by a constraint, or as a mimicking joint."""
    links = "".join(
        f'<link name="{name}"><inertial><origin xyz="0.2 0 0"/><mass value="{mass}"/><inertia ixx="0.01" iyy="0.02" '
        'izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        for name, mass in (("upper", 3.0), ("lower", 2.0))
    )
    mimic = "" if closed else '<mimic joint="axis" multiplier="-2"/>'
    (folder / "two.urdf").write_text(
        f'<robot name="two"><link name="base"/>{links}<joint name="axis" type="continuous"><parent link="base"/>'
        '<child link="upper"/><axis xyz="0 -1 0"/></joint><joint name="second" type="continuous"><parent link="upper"/>'
        f'<child link="lower"/><origin xyz="0.4 0 0"/><axis xyz="0 -1 0"/>{mimic}</joint></robot>'
    )
    motor = {key: value for key, value in MOTOR.items() if key != "peak_current"}
    servo = {"target": 0.4, "position": {"kp": 12}, "speed": {"kp": 0.06, "ti": 0.04}, "sample_time": 1e-3}
    drive = {"motor": motor | {"nominal_voltage": 4000.0}, "gear": GEAR, "model": "torque", "rotor_friction": NONE,
             "elastic": {"stiffness": C, "damping": D}, "servo": servo}  # fmt: skip
    data: dict[str, Any] = {
        "urdf": "two.urdf",
        "gravity": [0, 0, -G],
        "actuators": {"axis": drive},
        "initial": {"axis": 0.4},
    }
    if closed:
        data["constraints"] = [
            {"name": "belt", "kind": "expression", "expression": "second.position + 2*axis.position"}
        ]
        data["initial"]["second"] = {"guess": -0.8}
    path = folder / f"two_{closed}.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


def test_a_drive_in_a_closed_linkage_has_the_modes_and_margins_of_the_same_open_chain(tmp_path: Path) -> None:
    closed, opened = (bc.linearise(two_links(tmp_path, each)) for each in (True, False))
    assert [name for name, _ in closed.states] == [name for name, _ in opened.states]
    assert np.sort_complex(closed.eigenvalues) == pytest.approx(np.sort_complex(opened.eigenvalues), rel=1e-8)
    (one,), (other,) = closed.drives, opened.drives
    for key in ("resonances", "antiresonances", "gain_margin", "phase_margin", "bandwidth"):
        assert getattr(one, key) == pytest.approx(getattr(other, key), rel=1e-6)


def five_bar(factor: float = 1.0) -> bc.Scene:
    """The five-bar robot with two servo drives, without gravity, 0.1 mrad from their targets."""
    motor = MOTOR | {"torque_constant": 0.05, "rotor_inertia": 1e-5}
    actuators = {}
    for name, target, gain in (("left_motor", 110, factor), ("right_motor", 95, 1.0)):
        servo = {"target": math.radians(target) + 1e-4, "position": {"kp": 20}, "sample_time": 2e-3,
                 "speed": {"kp": 0.01 * gain, "ti": 0.05}}  # fmt: skip
        actuators[name] = {"motor": motor, "gear": GEAR | {"ratio": 10}, "model": "torque", "rotor_friction": NONE,
                           "servo": servo}  # fmt: skip
    return bc.load_scene("five_bar").with_overrides({"actuators": actuators, "control": [], "gravity": [0, 0, 0]})


def test_margins_of_a_drive_in_a_linkage_are_those_at_which_its_runs_begin_to_grow() -> None:
    margin = bc.linearise(five_bar()).drives[0].gain_margin
    assert margin is not None and 1.5 < margin < 20.0
    for factor, grows in ((0.97, False), (1.03, True)):
        speed = np.abs(bc.simulate(five_bar(factor * margin), duration=2.0, samples=2001).velocity[:, 0])
        assert bool(speed[-500:].max() > 0.5 * speed[:500].max()) is grows


def test_gains_are_found_for_the_drives_of_a_linkage_that_then_follows_its_motion() -> None:
    scene = bc.load_scene("five_bar")
    servo = {"motion": "pick", "gains": "auto", "sample_time": 5e-4, "feedforward": {"speed": 1}}
    motor = MOTOR | {"torque_constant": 0.05, "rotor_inertia": 1e-5, "peak_current": 60.0}
    drive = {"motor": motor, "gear": GEAR | {"ratio": 10}, "model": "torque", "rotor_friction": NONE, "servo": servo}
    changes = {"actuators": {"left_motor": drive, "right_motor": drive}, "control": [], "initial": {"motion": "pick"}}
    found = bc.verify_selection(scene.with_overrides(changes))
    for each in found.drives:
        assert each.stable and each.gain_margin >= 2.0 and each.phase_margin >= math.radians(30)
    assert all(axis.tracking_error < 0.05 for axis in found.axes)


def test_a_linkage_whose_constraint_moves_has_no_linear_equations_of_its_drives(tmp_path: Path) -> None:
    path = two_links(tmp_path, True)
    data = yaml.safe_load(path.read_text())
    data["constraints"][0]["expression"] += " - 0.1*t"
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(bc.InputError, match="require constraints of positions that do not move"):
        bc.linearise(path)


def test_margins_of_a_continuous_loop_are_those_of_its_frequency_response(tmp_path: Path) -> None:
    kv, kp, ti = 12.0, 0.06, 0.04
    servo = {"target": 0.0, "position": {"kp": kv}, "speed": {"kp": kp, "ti": ti}}
    drive = bc.linearise(scene(tmp_path, {"elastic": {"stiffness": C, "damping": D}, "servo": servo})).drives[0]
    w = np.geomspace(1.0, 1e4, 2_000_001)
    s = 1j * w
    spring = C + D * s  # rotor angle over torque: the load behind the gear
    plant = 1.0 / (J * s**2 + spring / N**2 * LOAD * s**2 / (LOAD * s**2 + spring))
    loop = kp * (1.0 + 1.0 / (ti * s)) * (kv + s) * plant
    crossing = np.flatnonzero(np.diff(np.sign(np.abs(loop) - 1.0)))
    phase = min(abs(math.pi + float(np.angle(loop[k]))) for k in crossing)
    assert drive.phase_margin == pytest.approx(phase, rel=1e-4)
    closed = kv * (C + D * s) / (LOAD * s**2 + C + D * s) * kp * (1.0 + 1.0 / (ti * s)) * plant / (1.0 + loop)
    beyond = np.flatnonzero(np.abs(closed) < 1.0 / math.sqrt(2.0))[0]
    assert drive.bandwidth == pytest.approx(w[beyond], rel=1e-4)


@pytest.mark.parametrize("model", ["torque", "dc", "dq"])
@pytest.mark.parametrize("elastic", [True, False])
def test_gains_that_are_found_have_the_margins_that_are_promised(tmp_path: Path, model: str, elastic: bool) -> None:
    servo = {"target": 0.01, "gains": "auto", "sample_time": 5e-4, "delay": 2e-4}
    drive = {"model": model, "servo": servo, "motor": PHASES if model == "dq" else MOTOR}
    drive |= {"elastic": {"stiffness": C, "damping": D}} if elastic else {}
    path = scene(tmp_path, drive, gravity=[0, 0, -G], simulate={"duration": 1.0})
    found = bc.linearise(path).drives[0]
    assert found.stable and found.gain_margin is not None and found.phase_margin is not None
    assert found.gain_margin >= 2.0 and found.phase_margin >= math.radians(30.0)
    run = bc.simulate(path)
    assert abs(run.position[-1, 0] - 0.01) < 1e-3 if elastic else abs(run.position[-1, 0] - 0.01) < 1e-6
    again = bc.load_run(run.save(tmp_path / "run.npz"))
    assert (again.acceleration == run.acceleration).all()


def state_space_of(cascade: dict[str, Any], period: float, **more: Any) -> dict[str, Any]:
    """The servo of a cascade of position and speed as a state space, whose state is the integrator."""
    kp, speed, ti = cascade["position"]["kp"], cascade["speed"]["kp"], cascade["speed"]["ti"]
    row = speed * np.array([N * kp, N, -1.0])
    matrices = {"A": [[1.0]], "B": [(period / ti * row).tolist()], "C": [[1.0]], "D": [row.tolist()]}
    inputs = ["error", "reference_velocity", "rotor_velocity"]
    kept = {key: value for key, value in cascade.items() if key in ("motion", "target", "encoder")}
    return kept | {"state_space": {"inputs": inputs, "sample_time": period, **matrices, **more}}


@pytest.mark.parametrize("encoder", ["motor", "load"])
def test_a_servo_in_state_space_follows_as_the_cascade_that_it_describes(tmp_path: Path, encoder: str) -> None:
    motion = {"swing": {"kind": "waypoints", "times": [0, 0.3], "positions": [{"axis": 0}, {"axis": 0.6}]}}
    cascade = {"motion": "swing", "position": {"kp": 30}, "speed": {"kp": 0.04, "ti": 0.05}, "encoder": encoder}
    elastic = {"elastic": {"stiffness": C, "damping": D}}
    runs = []
    for servo in (cascade | {"sample_time": 1e-3, "delay": 5e-4}, state_space_of(cascade, 1e-3, delay=5e-4)):
        runs.append(bc.simulate(scene(tmp_path, elastic | {"servo": servo}, motions=motion)))
    assert np.abs(runs[0].position - runs[1].position).max() < 1e-12
    assert column(runs[0], "motor torque [N m]") == pytest.approx(column(runs[1], "motor torque [N m]"), abs=1e-11)
    assert np.abs(column(runs[1], "tracking error [rad]")).max() > 1e-4


def test_a_servo_in_state_space_has_the_margins_of_the_cascade_that_it_describes(tmp_path: Path) -> None:
    cascade = {"target": 0.2, "position": {"kp": 30}, "speed": {"kp": 0.04, "ti": 0.05}}
    found = []
    for servo in (cascade | {"sample_time": 1e-3}, state_space_of(cascade, 1e-3)):
        (drive,) = bc.linearise(scene(tmp_path, {"servo": servo})).drives
        found.append((drive.gain_margin, drive.phase_margin, drive.bandwidth))
    assert found[0] == pytest.approx(found[1], rel=1e-6)


def test_a_servo_in_state_space_commands_the_voltage_and_goes_on_from_a_saved_run(tmp_path: Path) -> None:
    # i and φ measured: U = 20 (q_r − q) − 0.1 ω − 0.5 i, against the exact solution over each sample
    period, gains = 2e-3, [20.0, -0.1, -0.5]
    servo = {"target": 0.3, "state_space": {"inputs": ["error", "rotor_velocity", "current"], "D": [gains],
             "sample_time": period}}  # fmt: skip
    path = scene(tmp_path, {"model": "dc", "servo": servo}, simulate={"duration": 0.4, "samples": 201})
    run = bc.simulate(path)
    inertia = J + LOAD / N**2
    a = np.array([[0, 1 / N, 0, 0], [0, 0, KT / inertia, 0], [0, -KT / L, -R / L, 1 / L], [0, 0, 0, 0]])
    step = expm(a * period)
    x, exact = np.zeros(4), []
    for _ in range(201):
        x[3] = gains[0] * (0.3 - x[0]) + gains[1] * x[1] + gains[2] * x[2]
        exact.append(x.copy())
        x = step @ x
    assert np.abs(run.position[:, 0] - np.array(exact)[:, 0]).max() < 1e-9
    assert np.abs(run.auxiliary[:, 0] - np.array(exact)[:, 2]).max() < 1e-8
    bc.simulate(path, duration=0.2013).save(tmp_path / "half.npz")
    rest = bc.simulate(path, overrides={"initial": {"run": "half.npz"}, "simulate.duration": 0.4 - 0.2013})
    assert rest.position[-1] == pytest.approx(run.position[-1], abs=1e-10)


def test_feed_forward_of_torque_follows_a_motion_exactly_without_friction(tmp_path: Path) -> None:
    motion = {"swing": {"kind": "waypoints", "times": [0, 0.5], "positions": [{"axis": 0}, {"axis": 1.2}]}}
    servo = {"motion": "swing", "position": {"kp": 5}, "speed": {"kp": 0.02, "ti": 0.1}, "feedforward": {"torque": 1}}
    motor = {key: value for key, value in MOTOR.items() if key not in ("nominal_voltage", "peak_current")}
    run = bc.simulate(scene(tmp_path, {"motor": motor, "servo": servo}, gravity=[0, 0, -G], motions=motion))
    assert np.abs(column(run, "tracking error [rad]")).max() < 1e-9


def test_a_rotor_that_sticks_and_a_joint_that_meets_its_stop_are_told_apart(tmp_path: Path) -> None:
    drive = {"elastic": {"stiffness": C, "damping": D}, "rotor_friction": {"coulomb": 0.1}, "servo": {"torque": 0.5}}
    stop = {"lower": -1.0, "upper": 0.2, "restitution": 0.0}
    free = bc.simulate(scene(tmp_path, drive, simulate={"duration": 0.1}))
    run = bc.simulate(scene(tmp_path, drive, joints={"axis": {"stop": stop}}, simulate={"duration": 2.0}))
    early = bc.simulate(tmp_path / "arm.yaml", duration=0.1, samples=51)
    assert np.abs(early.state[:, :4] - free.state[:, :4]).max() < 1e-9 * np.abs(free.state).max()
    assert run.position[-1, 0] == 0.2 and run.velocity[-1, 0] == 0.0
    # pressed against the stop the rotor rests where friction and the gear bear the motor's torque
    assert run.stuck("axis rotor")[-1, 1] == 2.0
    twist = column(run, "twist [rad]")[-1]
    assert twist * (1 + 1e-9) >= 0.4 * N / C and twist <= 0.6 * N / C


# ---- what else takes a scene with a drive


def test_sizes_are_the_same_with_and_without_a_drive_in_the_loop(tmp_path: Path) -> None:
    motion = {"swing": {"kind": "waypoints", "times": [0, 0.5], "positions": [{"axis": 0}, {"axis": 1.2}]}}
    servo = {"motion": "swing", "position": {"kp": 5}, "speed": {"kp": 0.02}}
    path = scene(tmp_path, {"elastic": {"stiffness": C, "damping": D}, "servo": servo}, gravity=[0, 0, -G],
                 motions=motion)  # fmt: skip
    data = yaml.safe_load(path.read_text())
    for key in ("model", "elastic", "servo", "rotor_friction"):
        del data["actuators"]["axis"][key]
    (tmp_path / "plain.yaml").write_text(yaml.safe_dump(data))
    plain = str(bc.size(tmp_path / "plain.yaml")).replace("Plain", "Arm").replace("plain", "arm").splitlines()
    assert [line for line in str(bc.size(path)).splitlines() if "act in simulations only" not in line] == plain
    for given in (path, bc.load_scene(path)):
        assert "act in simulations only" in " ".join(bc.size(given).warnings)


def test_a_run_goes_on_from_a_saved_one_with_the_states_of_its_drive(tmp_path: Path) -> None:
    motion = {"swing": {"kind": "waypoints", "times": [0, 0.5], "positions": [{"axis": 0}, {"axis": 1.2}]}}
    servo = {"motion": "swing", "position": {"kp": 5}, "speed": {"kp": 0.02, "ti": 0.1}, "sample_time": 2e-3,
             "delay": 3e-3}  # fmt: skip
    drive = {"elastic": {"stiffness": C, "damping": D}, "servo": servo, "rotor_friction": {"coulomb": 0.05}}
    path = scene(tmp_path, drive, gravity=[0, 0, -G], motions=motion, simulate={"samples": 5})
    whole = bc.simulate(path)
    bc.simulate(path, duration=0.25).save(tmp_path / "half.npz")
    rest = bc.simulate(path, overrides={"initial": {"run": "half.npz"}, "simulate.duration": 0.25})
    assert np.abs(rest.state[-1, :4] - whole.state[-1, :4]).max() < 1e-9 * np.abs(whole.state[-1, :4]).max()
    assert rest.inputs[-1] == pytest.approx(whole.inputs[-1], abs=1e-8)


def test_a_sweep_over_gains_of_a_servo_gives_the_runs_of_its_designs(tmp_path: Path) -> None:
    motion = {"swing": {"kind": "waypoints", "times": [0, 0.5], "positions": [{"axis": 0}, {"axis": 1.2}]}}
    servo = {"motion": "swing", "position": {"kp": 5}, "speed": {"kp": 0.02, "ti": 0.1}}
    path = scene(tmp_path, {"elastic": {"stiffness": C, "damping": D}, "servo": servo}, motions=motion,
                 parameters={"kv": {"value": 5, "sets": ["control.drive_axis.servo.position.kp"]}})  # fmt: skip
    found = bc.sweep(path, {"kv": [4.0, 8.0]})
    for value, row in zip((4.0, 8.0), found.column("largest.drive_axis.tracking_error"), strict=True):
        run = bc.simulate(path, overrides={"kv": value}, samples=5001)
        assert row == pytest.approx(column(run, "tracking error [rad]").max(), rel=1e-5)


def test_the_table_and_the_json_of_modes_name_each_drive(tmp_path: Path) -> None:
    linear = bc.linearise("manutec_axis")
    assert "drive of axis: resonances 24.785 Hz; antiresonances 21.411 Hz" in str(linear.table())
    linear.to_json(tmp_path / "modes.json")
    drive = json.loads((tmp_path / "modes.json").read_text())["drives"][0]
    assert drive["stable"] is True and drive["joint"] == "axis"


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "an unknown model": ({"model": "ac", "servo": {"torque": 0}}, "expected"),
    "a servo without a model": ({"model": None, "servo": {"torque": 0}}, "which needs 'model'"),
    "no servo": ({}, "'servo' is missing"),
    "dc without resistance": (
        {"model": "dc", "motor": {k: v for k, v in MOTOR.items() if k != "resistance"}, "servo": {"voltage": 1}},
        "requires 'motor.resistance'",
    ),
    "friction that is not stated": ({"rotor_friction": None, "servo": {"torque": 0}}, "requires the motor's friction"),
    "static friction below that of sliding": (
        {"rotor_friction": {"coulomb": 2, "static": 1, "speed": 1}, "servo": {"torque": 0}}, "at least 'coulomb'",
    ),
    "an elastic gear without damping": (
        {"elastic": {"stiffness": 1}, "servo": {"torque": 0}}, "'damping' is missing",
    ),
    "an elastic gear without stiffness": ({"elastic": {"damping": 1}, "servo": {"torque": 0}}, "'stiffness'"),
    "a voltage for a torque": ({"servo": {"voltage": 1}}, "voltage"),
    "target and motion": (
        {"servo": {"target": 0, "motion": "m", "position": {"kp": 1}, "speed": {"kp": 1}}}, "found both",
    ),
    "a current loop without a current": (
        {"servo": {"target": 0, "position": {"kp": 1}, "speed": {"kp": 1}, "current": {"kp": 1, "ki": 1}}},
        "has no current",
    ),
    "samples that would never end": (
        {"servo": {"target": 0, "position": {"kp": 1}, "speed": {"kp": 1}, "sample_time": 1e-12}},
        "expected 0, or 1e-07",
    ),
    "a state space without inputs": ({"servo": {"target": 0, "state_space": {"D": [[1]]}}}, "expected a list of"),
    "a state space that measures a current that is not there": (
        {"servo": {"target": 0, "state_space": {"inputs": ["current"], "D": [[1]], "sample_time": 1e-3}}},
        "model: torque has no 'current'",
    ),
    "a state space and gains": (
        {"servo": {"target": 0, "speed": {"kp": 1}, "state_space": {"inputs": ["error"], "D": [[1]]}}}, "speed",
    ),
    "matrices of the wrong size": (
        {"servo": {"target": 0, "state_space": {"inputs": ["error"], "D": [[1, 2]], "sample_time": 1e-3}}},
        "expected",
    ),
    "a ratio whose square is 0": ({"gear": GEAR | {"ratio": 1e-300}, "servo": {"torque": 0}}, "expected a ratio"),
    "a delay without samples": (
        {"servo": {"target": 0, "position": {"kp": 1}, "speed": {"kp": 1}, "delay": 1e-3}}, "give 'sample_time'",
    ),
    "automatic gains without samples": ({"servo": {"target": 0, "gains": "auto"}}, "requires a 'sample_time'"),
    "automatic gains and gains": (
        {"servo": {"target": 0, "gains": "auto", "sample_time": 1e-3, "speed": {"kp": 1}}}, "remove one of the two",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_drive_that_cannot_be_is_refused_in_a_sentence(tmp_path: Path, case: str) -> None:
    changes, words = REFUSED[case]
    path = scene(tmp_path, changes)
    data = yaml.safe_load(path.read_text())
    entry = data["actuators"]["axis"]
    data["actuators"]["axis"] = {key: value for key, value in entry.items() if value is not None}
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(bc.InputError, match=words) as error:
        bc.load_scene(path)
    assert "arm.yaml: actuators.axis" in str(error.value)


def test_what_needs_smooth_equations_refuses_a_drive_in_words(tmp_path: Path) -> None:
    opened = bc.load_scene(scene(tmp_path, {"servo": {"torque": 0}}))
    with pytest.raises(bc.InputError, match="states besides position and velocity"):
        bc.scene_casadi(opened)
    fast = bc.load_scene("manutec_axis")
    with pytest.raises(bc.InputError, match="states of drives"):
        bc.simulate(fast, duration=0.1, sensitivities=["initial.axis"])


# ---- hysteresis

HYSTERESIS = {"torque": 2.5, "stiffness": 8_000.0}


def test_the_twist_of_a_gear_with_hysteresis_follows_dahls_loop_between_its_reversals(tmp_path: Path) -> None:
    # h = s h0 + (h_a - s h0) exp(-k |δ - δ_a| / h0) from a state a on, while the twist goes in the direction s
    drive = {"elastic": {"stiffness": C, "damping": D, "hysteresis": HYSTERESIS}, "servo": {"torque": "0.4*sin(9*t)"}}
    run = bc.simulate(scene(tmp_path, drive, simulate={"duration": 1.5, "samples": 3001}))
    angle, speed, held = run.auxiliary[:, :3].T
    twist, rate = angle / N - run.position[:, 0], speed / N - run.velocity[:, 0]
    most, slope = HYSTERESIS["torque"], HYSTERESIS["stiffness"]
    turns = np.flatnonzero(np.diff(np.sign(rate)) != 0)
    checked = 0
    for first, last in zip(turns[:-1] + 1, turns[1:], strict=True):
        if last - first < 3:
            continue
        way = np.sign(rate[first])
        known = way * most + (held[first] - way * most) * np.exp(
            -slope * np.abs(twist[first:last] - twist[first]) / most
        )
        assert np.abs(held[first:last] - known).max() < 1e-7 * most
        checked += 1
    assert checked > 3
    assert np.abs(held).max() > 0.5 * most
    assert run.energy_drift() < 1e-9
    force = C * twist + D * rate + held
    assert column(run, "gear output [N m]") == pytest.approx(force, abs=1e-9)


def test_hysteresis_is_a_spring_for_margins_and_refuses_backlash_in_one_sentence(tmp_path: Path) -> None:
    drive = {"elastic": {"stiffness": C, "damping": 0, "hysteresis": HYSTERESIS}, "servo": {"torque": 0}}
    linear = bc.linearise(bc.load_scene(scene(tmp_path, drive)))
    assert any("hysteresis of gears as a spring" in note for note in linear.notes)
    (found,) = linear.drives
    lower = math.sqrt((C + HYSTERESIS["stiffness"]) / LOAD)
    assert found.antiresonances == pytest.approx([lower], rel=1e-9)
    loose = {"stiffness": C, "damping": 0, "backlash": 0.01, "hysteresis": HYSTERESIS}
    with pytest.raises(bc.InputError, match=r"elastic\.hysteresis .*a gear with backlash has no hysteresis"):
        bc.load_scene(scene(tmp_path, drive | {"elastic": loose}))
