"""Rigid gears with backlash: flanks that meet with a restitution, against phases and impacts written by hand."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp

import bellcrank as bc
from tests.simulation.test_drives import GEAR, LOAD, MASS, REACH, G, J, N, column, scene
from tests.simulation.test_dry_friction import random_chain
from tests.simulation.test_pin_friction import tips

GAP = 0.01
HALF = 0.5 * GAP
ROTOR, RATIO = 2e-3, 30.0  # of the linkage


def by_hand(torque: Any, gravity: float, restitution: float, times: np.ndarray) -> np.ndarray:
    """q, q̇, δ and δ̇ (n, 4) of the arm of test_drives.py behind a rigid gear with backlash, phase by phase.

    Free: LOAD q̈ = −m g r cos q and J φ̈ = T. On a flank: (LOAD + N² J) q̈ = N T − m g r cos q, until the force of the
    flank, N T − N² J q̈ times its side, is 0. An impact with impulse P at the joint: q̇⁺ = q̇ + P/LOAD and
    φ̇⁺ = φ̇ − P/(N J), with δ̇⁺ = −e δ̇.
    """
    weight, rotor = MASS * REACH * gravity, N * N * J

    def free(t: float, x: np.ndarray) -> list[float]:
        joint = -weight * math.cos(x[0]) / LOAD
        return [x[1], joint, x[3], torque(t) / (J * N) - joint]

    def together(t: float, x: np.ndarray) -> list[float]:
        return [x[1], (N * torque(t) - weight * math.cos(x[0])) / (LOAD + rotor), 0.0, 0.0]

    def push(side: float) -> Any:
        def force(t: float, x: np.ndarray) -> float:
            return side * (N * torque(t) - rotor * together(t, x)[1])

        force.terminal, force.direction = True, -1.0
        return force

    def reached(side: float) -> Any:
        def room(t: float, x: np.ndarray) -> float:
            return HALF - side * x[2]

        room.terminal, room.direction = True, -1.0
        return room

    # the start holds the load: on the flank that pushes
    side = float(np.sign(weight))
    t, x, rows = 0.0, np.array([0.0, 0.0, side * HALF, 0.0]), []
    for after in times:
        while t < after:
            events = [push(side)] if side else [reached(1.0), reached(-1.0)]
            step = solve_ivp(together if side else free, (t, after), x, "DOP853", rtol=1e-12, atol=1e-14, events=events,
                             max_step=2e-3)  # fmt: skip
            t, x = step.t[-1], step.y[:, -1].copy()
            if step.status != 1:
                break
            if side:
                side = 0.0
                continue
            flank = 1.0 if len(step.t_events[0]) else -1.0
            impulse = (1.0 + restitution) * x[3] / (1.0 / LOAD + 1.0 / rotor)
            x[1], x[2] = x[1] + impulse / LOAD, flank * HALF
            x[3] = -restitution * x[3]
            side = flank if restitution == 0.0 else 0.0
        rows.append(x)
    return np.array(rows)


@pytest.mark.parametrize(("restitution", "gravity"), [(0.0, 0.0), (0.0, G), (0.6, 0.0)])
def test_flanks_open_close_and_strike_as_phases_by_hand(tmp_path: Path, restitution: float, gravity: float) -> None:
    drive = {
        "elastic": {"stiffness": "rigid", "backlash": GAP, "restitution": restitution},
        "servo": {"torque": "0.5*sin(12*t)"},
    }
    path = scene(tmp_path, drive, gravity=[0, 0, -gravity], simulate={"duration": 1.5})
    run = bc.simulate(path)
    if restitution:  # the first rebounds, which go on without end in finite time
        hits = run.impacts("axis gear")[:, 0]
        run = bc.simulate(path, times=np.linspace(0.0, 0.5 * (hits[4] + hits[5]), 51))
    mine = np.column_stack([run.position, run.velocity, run.auxiliary])
    expected = by_hand(lambda t: 0.5 * math.sin(12 * t), gravity, restitution, run.time)
    assert len(run.impacts("axis gear")) >= 2
    assert np.abs(mine - expected).max() < 1e-8 * np.abs(expected).max()
    assert np.abs(run.auxiliary[:, 0]).max() <= HALF * (1.0 + 1e-12)
    twist, force = column(run, "twist [rad]"), column(run, "gear output [N m]")
    assert not force[np.abs(twist) < HALF].any() and (force * twist).min() >= 0.0
    assert run.energy_drift() < 1e-9


@pytest.mark.parametrize(("share", "moves"), [(0.999, False), (1.001, True)])
def test_an_arm_behind_backlash_holds_for_an_hour_below_the_breakaway_torque_of_its_rotor(
    tmp_path: Path, share: float, moves: bool
) -> None:
    friction, load = 0.2, MASS * REACH * G / N
    drive = {"elastic": {"stiffness": "rigid", "backlash": GAP}, "servo": {"torque": load - share * friction},
             "rotor_friction": {"coulomb": friction, "viscous": 0}}  # fmt: skip
    duration = 20.0 if moves else 3600.0
    run = bc.simulate(scene(tmp_path, drive, gravity=[0, 0, -G], simulate={"duration": duration}))
    assert bool(np.abs(run.velocity).any()) is moves
    assert run.at_stop("axis gear").tolist() == [[0.0, duration]]
    if not moves:
        assert run.stuck("axis rotor").tolist() == [[0.0, duration]]
        assert column(run, "gear output [N m]") == pytest.approx(MASS * REACH * G, rel=1e-12)


# ---- several joints, by enumeration


def rattling(folder: Path, seed: int) -> tuple[Path, dict[int, dict[str, Any]]]:
    """A random chain behind rigid gears with backlash: the scene's file, and the figures of its drives by joint."""
    rng = np.random.default_rng(seed)
    path, joints = random_chain(rng, folder)
    urdf = folder / "chain.urdf"
    urdf.write_text(urdf.read_text().replace("prismatic", "continuous"))
    data, found = yaml.safe_load(path.read_text()), {}
    data |= {"joints": {}, "outputs": {"w": {"work": "all"}}, "actuators": {}}
    for k in joints:
        one = found[k] = {
            "ratio": float(rng.uniform(20, 120)),
            "rotor": float(10 ** rng.uniform(-5, -4)),
            "friction": float(rng.random() < 0.6) * float(10 ** rng.uniform(-3, -1.5)),
            "gap": float(10 ** rng.uniform(-3, -1)),
            "sine": [float(x) for x in (rng.uniform(0, 0.3), rng.uniform(2, 20), rng.uniform(0, 6))],
        }
        size, rhythm, phase = one["sine"]
        data["actuators"][f"j{k}"] = {
            "model": "torque",
            "motor": {"maker": "a", "model": "b", "rotor_inertia": one["rotor"]},
            "gear": GEAR | {"ratio": one["ratio"]},
            "elastic": {"stiffness": "rigid", "backlash": one["gap"], "restitution": float(rng.uniform(0, 0.8))},
            "servo": {"torque": f"{size}*sin({rhythm}*t + {phase})"},
            "rotor_friction": {"coulomb": one["friction"], "viscous": 0} if one["friction"] else "none",
        }
    path.write_text(yaml.safe_dump(data))
    return path, found


def allowed_accelerations(
    mass: np.ndarray, bias: np.ndarray, v: np.ndarray, time: float, twists: dict[int, tuple[float, float]],
    drives: dict[int, dict[str, Any]],
) -> Iterator[np.ndarray]:  # fmt: skip
    """q̈ by the laws of flanks and friction, over all modes, by dense solves for q̈, ω̇, forces of flanks and friction.

    M q̈ + b = F, J ω̇ = T + f − F/N. At a flank without speed F pushes and ω̇/N = q̈, or F is 0 and it opens; a rotor
    at rest stays so with |f| at most its friction, else f is against its motion.
    """
    n, m = len(bias), len(drives)
    options = []
    for k, one in drives.items():
        twist, rate = twists[k]
        side = float(np.sign(twist)) if abs(twist) >= 0.5 * one["gap"] * (1 - 1e-12) and rate == 0.0 else 0.0
        speed = v[k] + rate
        ways = [math.copysign(1.0, speed)] if abs(speed) > 1e-13 else [1.0, -1.0, 0.0]
        if not one["friction"]:
            ways = [1.0]
        options.append(list(itertools.product({0.0, side}, ways)))
    for modes in itertools.product(*options):
        size = n + 3 * m  # q̈, ω̇, F, f
        matrix, right = np.zeros((size, size)), np.zeros(size)
        matrix[:n, :n], right[:n] = mass, -bias
        for i, ((k, one), (side, way)) in enumerate(zip(drives.items(), modes, strict=True)):
            rotor, force, rub = n + i, n + m + i, n + 2 * m + i
            size_of, rhythm, phase = one["sine"]
            matrix[k, force] = -1.0
            matrix[rotor, [rotor, force, rub]] = one["rotor"], 1.0 / one["ratio"], -1.0
            right[rotor] = size_of * math.sin(rhythm * time + phase)
            if side:
                matrix[force, [rotor, k]] = 1.0 / one["ratio"], -1.0
            else:
                matrix[force, force] = 1.0
            if way:
                matrix[rub, rub], right[rub] = 1.0, -way * one["friction"]
            else:
                matrix[rub, rotor] = 1.0
        found, fits = np.linalg.solve(matrix, right), True
        for i, ((k, one), (side, way)) in enumerate(zip(drives.items(), modes, strict=True)):
            spin, force, rub = found[n + i], found[n + m + i], found[n + 2 * m + i]
            opens, (twist, rate) = spin / one["ratio"] - found[k], twists[k]
            slack = 1e-9 * (1 + abs(spin / one["ratio"]) + abs(found[k]))
            if side:
                fits &= force * side >= -1e-9
            elif abs(twist) >= 0.5 * one["gap"] * (1 - 1e-12) and rate == 0.0:
                fits &= opens * np.sign(twist) <= slack
            if not way:
                fits &= abs(rub) <= one["friction"] * (1 + 1e-9)
            elif one["friction"] and abs(v[k] + rate) <= 1e-13:
                fits &= spin * way >= -slack * one["ratio"]
        if fits:
            yield found[:n]


def check_rattling(folder: Path, seed: int) -> int:
    """The laws hold at rows of a run, no impact raises the energy and all work is in the ledger. Number of impacts."""
    path, drives = rattling(folder, seed)
    run = bc.simulate(path)
    robot, still = run.robot, np.zeros(run.robot.nv)
    assert run.success, run.reason
    twists = {k: run.auxiliary[:, 2 * i : 2 * i + 2] for i, k in enumerate(drives)}
    for k, one in drives.items():
        assert np.abs(twists[k][:, 0]).max() <= 0.5 * one["gap"] + 1e-9
    for row in (0, 13, 26, 39):
        q, v, a = run.position[row], run.velocity[row], run.acceleration[row]
        bias, mass = robot.inverse_dynamics(q, v, still), robot.mass_matrix(q)
        at = {k: (float(twists[k][row, 0]), float(twists[k][row, 1])) for k in drives}
        known = list(allowed_accelerations(mass, bias, v, run.time[row], at, drives))
        assert min(np.abs(a - each).max() / (1 + np.abs(each).max()) for each in known) < 1e-9
    assert run.energy_drift() < 1e-6
    lost = run.outputs["w"][:, -1]  # constraints and impacts
    assert np.diff(lost).max() <= 1e-6 * (1 + np.abs(run.kinetic_energy + run.potential_energy).max())
    return sum(len(run.impacts(f"j{k} gear")) for k in drives)


@pytest.mark.parametrize("seed", range(4))
def test_a_random_chain_with_backlash_moves_as_the_enumeration_of_its_modes_says(tmp_path: Path, seed: int) -> None:
    check_rattling(tmp_path, seed)


@pytest.mark.tier2
def test_random_chains_with_backlash_move_as_the_enumeration_of_their_modes_says(tmp_path: Path) -> None:
    assert sum(check_rattling(tmp_path, seed) for seed in range(100, 180)) > 500


def linkage(folder: Path, restitution: float, duration: float) -> Path:
    """The four-bar with a rigid gear with backlash at its crank."""
    data = dict(bc.load_scene("four_bar").data)
    for key in ("forces", "events", "outputs"):
        data.pop(key)
    data["actuators"] = {"crank": {
        "motor": {"maker": "a", "model": "b", "rotor_inertia": ROTOR}, "gear": GEAR | {"ratio": RATIO},
        "model": "torque",
        "elastic": {"stiffness": "rigid", "backlash": 0.02, "restitution": restitution},
        "servo": {"torque": "0.3*sin(9*t)"}, "rotor_friction": {"coulomb": 0.05, "viscous": 0}}}  # fmt: skip
    data |= {"gravity": [0, -9.81, 0]}
    data["initial"] = {"crank": "50 deg", "coupler": {"guess": "310 deg"}, "rocker": {"guess": "50 deg"}}
    data["simulate"] = {"duration": duration, "rtol": 1e-12, "atol": 1e-12, "samples": 61}
    path = folder / "loop.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


def test_a_rotor_slides_on_through_the_dead_centre_of_a_linkage(tmp_path: Path) -> None:
    # where the crank turns back the constraints alone say how, and the flank takes the rotor along
    run = bc.simulate(linkage(tmp_path, 0.0, 3.0))
    # the linkage passes the flat posture, where its equations are singular: 8e-8 there, also without gear and friction
    assert run.success and run.energy_drift() < 2e-7


def test_a_flank_in_a_linkage_is_struck_with_the_impulse_of_the_dense_kkt_system(tmp_path: Path) -> None:
    """The crank of the four-bar: M Δv = Jᵀ Λ − s P, J v⁺ = 0, and δ̇⁺ = −e δ̇ of the twist."""
    restitution = 0.3
    path = linkage(tmp_path, restitution, 0.5)
    run = bc.simulate(path)
    assert run.success and run.energy_drift() < 1e-9 and run.constraint_residual() < 1e-9
    crank = run.robot.joint("crank").v
    for time, impulse in run.impacts("crank gear")[:3]:
        before = bc.simulate(path, duration=time * (1 - 1e-13), times=[0.0, time * (1 - 1e-13)])
        q, v, rate = before.position[-1], before.velocity[-1], before.auxiliary[-1, 1]
        jacobian, _ = tips(q)
        unit = np.eye(3)[crank]
        compliance = 1.0 / (RATIO**2 * ROTOR)
        # M v⁺ − Jᵀ Λ + s P = M v, J v⁺ = 0, and δ̇⁺ = δ̇ + P/(N² J) − (s v⁺ − s v) = −e δ̇
        system = np.block([[run.robot.mass_matrix(q), -jacobian.T, unit[:, None]], [jacobian, np.zeros((2, 3))],
                           [unit[None], np.zeros((1, 2)), np.array([[-compliance]])]])  # fmt: skip
        wanted = np.concatenate([run.robot.mass_matrix(q) @ v, [0.0, 0.0], [v[crank] + (1 + restitution) * rate]])
        assert impulse == pytest.approx(np.linalg.solve(system, wanted)[-1], rel=1e-8)
    assert len(run.impacts("crank gear")) >= 3


def test_a_sampled_servo_with_an_encoder_at_the_motor_leaves_the_joint_within_the_gap(tmp_path: Path) -> None:
    servo = {"target": 0.4, "position": {"kp": 10}, "speed": {"kp": 0.05, "ti": 0.05}, "sample_time": 1e-3}
    drive = {"elastic": {"stiffness": "rigid", "backlash": GAP}, "servo": servo,
             "rotor_friction": {"coulomb": 0.01, "viscous": 1e-4}}  # fmt: skip
    dry = {"axis": {"dry_friction": {"coulomb": 0.5}}}
    run = bc.simulate(scene(tmp_path, drive, joints=dry, simulate={"duration": 5.0, "rtol": 1e-9, "atol": 1e-9}))
    assert abs(run.position[-1, 0] - 0.4) < HALF + 2e-3
    assert run.energy_drift() < 1e-6


@pytest.mark.parametrize(
    ("elastic", "message"),
    [
        ({"backlash": 0}, r"elastic\.backlash .*a rigid gear without backlash has no 'elastic'"),
        ({"backlash": 0.01, "damping": 3}, r"elastic.*damping"),
        ({"backlash": 0.01, "restitution": 1.5}, r"elastic\.restitution .*expected 0 to 1, found 1\.5"),
        ({"backlash": -0.01}, r"elastic\.backlash"),
    ],
)
def test_wrong_figures_of_a_rigid_gear_are_refused_in_one_sentence(
    tmp_path: Path, elastic: dict[str, float], message: str
) -> None:
    drive = {"elastic": {"stiffness": "rigid"} | elastic, "servo": {"torque": 0.0}}
    with pytest.raises(bc.InputError, match=message) as found:
        bc.load_scene(scene(tmp_path, drive))
    assert "\n" not in str(found.value)


def test_rigid_backlash_has_no_automatic_gains_and_says_what_is_not_simulated(tmp_path: Path) -> None:
    rigid = {"elastic": {"stiffness": "rigid", "backlash": GAP}}
    with pytest.raises(bc.InputError, match="rigid gear with backlash, which has no linear equations"):
        bc.simulate(scene(tmp_path, rigid | {"servo": {"target": 0.1, "gains": "auto", "sample_time": 1e-3}}))
    lossy = GEAR | {"efficiency": 0.8}
    run = bc.simulate(scene(tmp_path, rigid | {"gear": lossy, "servo": {"torque": 0.1}}))
    assert any("losses of the gear by load are not simulated behind rigid backlash" in note for note in run.notes)
