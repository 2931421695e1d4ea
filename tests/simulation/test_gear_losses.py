"""Losses of rigid gears that depend on their load: closed forms, enumeration of all sides, impacts, linkages."""

import itertools
import math

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import bellcrank as bc
from tests.simulation.test_drives import GEAR, LOAD, MASS, REACH, G, J, N, column, scene
from tests.simulation.test_dry_friction import random_chain
from tests.simulation.test_pin_friction import tips

ROTOR = N * N * J
DRIVING, DRIVEN = 0.8, 0.6
LOSSY = GEAR | {"efficiency": DRIVING, "back_efficiency": DRIVEN}


def known(torque, load, direction, friction=0.0, inertia=LOAD, rotor=ROTOR):
    """The acceleration of one joint that moves in a direction: that of the side on which F and the motion agree."""
    along = N * (torque - direction * friction)
    for share, side in ((DRIVING, 1), (1 / DRIVEN, -1)):
        found = (share * along - load) / (inertia + share * rotor)
        if (along - rotor * found) * direction * side >= 0:
            return found
    raise AssertionError("one side fits")


@pytest.mark.parametrize("torque", [-0.3, 0.1, 0.4, 0.9])
@pytest.mark.parametrize("speed", [-2.0, 2.0])
def test_a_moving_joint_accelerates_as_the_closed_form_of_driving_or_driven_gear(tmp_path, torque, speed):
    load, friction = 20.0, 0.05
    drive = {"gear": LOSSY, "servo": {"torque": torque}, "rotor_friction": {"coulomb": friction}}
    forces = [{"kind": "joint_force", "joint": "axis", "value": -load}]
    path = scene(tmp_path, drive, forces=forces, initial={"velocity": {"axis": speed}}, outputs={"w": {"work": "all"}},
                 simulate={"duration": 0.01, "samples": 5})  # fmt: skip
    run = bc.simulate(path)
    expected = known(torque, load, math.copysign(1, speed), friction)
    assert run.acceleration[:, 0] == pytest.approx(expected, rel=1e-12)
    assert run.energy_drift() < 1e-13
    # F is the force on the joint without the rotor: the output has the rotor's inertia besides
    force = column(run, "gear output [N m]")[0] - ROTOR * expected
    assert force == pytest.approx(LOAD * expected + load, rel=1e-12)
    given = N * (torque - math.copysign(friction, speed)) - ROTOR * expected
    assert force == pytest.approx((DRIVING if given * speed > 0 else 1 / DRIVEN) * given, rel=1e-12)


@pytest.mark.parametrize(("share", "moves"), [(0.999, False), (1.001, True)])
@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("lifts", [True, False])
def test_a_geared_joint_sticks_up_to_its_breakaway_torque_in_both_directions_of_the_power(
    tmp_path, share, moves, way, lifts
):
    load, friction = MASS * REACH * G, 0.02
    # lifting: N T = load/η + f; lowering, with the load: N T = load η_b − f
    breakaway = load / N / DRIVING + friction if lifts else load / N * DRIVEN - friction
    torque = breakaway * share if lifts else breakaway / share
    drive = {"gear": LOSSY, "servo": {"torque": way * torque}, "rotor_friction": {"coulomb": friction}}
    run = bc.simulate(
        scene(tmp_path, drive, gravity=[0, 0, -way * G], simulate={"duration": 3600.0 if not moves else 5.0})
    )
    assert bool(np.abs(run.velocity).any()) is moves
    assert moves or run.stuck("axis rotor").tolist() == [[0.0, 3600.0]]
    if moves:
        assert run.position[1, 0] * way * (1 if lifts else -1) > 0
    else:
        assert column(run, "gear output [N m]") == pytest.approx(way * load, rel=1e-12)


def test_a_swing_behind_a_lossy_gear_follows_another_integrator_through_its_changes_of_side(tmp_path):
    drive = {"gear": LOSSY, "servo": {"torque": "0.3*sin(7*t)"}, "rotor_friction": {"coulomb": 0, "viscous": 2e-4}}
    path = scene(tmp_path, drive, gravity=[0, 0, -G], initial={"velocity": {"axis": 1.0}},
                 simulate={"duration": 2.0, "samples": 41})  # fmt: skip
    run = bc.simulate(path)

    def rate(t, x, direction):
        load = MASS * REACH * G * math.cos(x[0])
        return [x[1], known(0.3 * math.sin(7 * t) - 2e-4 * N * x[1], load, direction)]

    def rests(t, x, direction):
        return x[1] if t > begin + 1e-6 else direction

    rests.terminal = True
    begin, x, direction, found, sticks = 0.0, np.array([0.0, 1.0]), 1.0, [], []
    options = {"rtol": 1e-10, "atol": 1e-12, "max_step": 5e-3, "events": rests, "dense_output": True}
    while begin < 2.0:
        part = solve_ivp(rate, (begin, 2.0), x, "DOP853", args=(direction,), **options)
        rows = run.time[(run.time >= begin) & (run.time <= part.t[-1])]
        found += [(t, *part.sol(t)) for t in rows]
        begin, x = part.t[-1], np.array([part.y[0, -1], 0.0])
        ways = [d for d in (1.0, -1.0) if d * rate(begin, x, d)[1] > 0]
        if begin < 2.0 and not ways:  # it sticks until one of the directions would accelerate it
            later = np.linspace(begin, 2.0, 20001)
            goes = [[d * rate(t, x, d)[1] > 0 for d in (1.0, -1.0)] for t in later]
            first = next((k for k, each in enumerate(goes) if any(each)), None)
            end, ways = 2.0, [1.0]
            if first is not None:
                ways = [1.0 if goes[first][0] else -1.0]
                end = brentq(lambda t, x=x, d=ways[0]: rate(t, x, d)[1], later[first - 1], later[first], xtol=1e-14)
            sticks.append((begin, end))
            found += [(t, *x) for t in run.time[(run.time > begin) & (run.time < end)]]
            begin = end
        direction = ways[0] if ways else direction
    times, at, speeds = np.array(found).T
    mine = np.searchsorted(run.time, times)
    assert len({*mine.tolist()}) == 41
    assert run.position[mine, 0] == pytest.approx(at, abs=1e-7)
    assert run.velocity[mine, 0] == pytest.approx(speeds, abs=1e-6)
    assert run.stuck("axis rotor") == pytest.approx(np.array(sticks), abs=1e-7)
    assert len(sticks) > 2
    assert run.energy_drift() < 1e-10


def test_a_rigid_gear_moves_as_a_stiff_elastic_one_does(tmp_path):
    drive = {"gear": LOSSY, "servo": {"torque": "0.8*sin(7*t)"}, "rotor_friction": {"coulomb": 0.02}}
    rigid = bc.simulate(scene(tmp_path, drive, gravity=[0, 0, -G], simulate={"duration": 0.4}))
    stiff = drive | {"elastic": {"stiffness": 1e7, "damping": 300.0}}
    numbers = {"duration": 0.4, "rtol": 1e-8, "atol": 1e-9}
    elastic = bc.simulate(scene(tmp_path, stiff, gravity=[0, 0, -G], simulate=numbers))
    assert np.abs(rigid.position - elastic.position).max() < 2e-5  # the twist: 100 N m over 1e7 N m/rad


# ---- several joints, by enumeration


BASE = '<link name="l0"><inertial><mass value="2"/><inertia ixx="0.1" iyy="0.2" izz="0.15" ixy="0" ixz="0" iyz="0"/>'


def geared(folder, seed, stops=False, floating=False):
    """A random chain of turning joints with lossy rigid drives: the scene's file, and figures by degree of freedom."""
    rng = np.random.default_rng(seed)
    path, joints = random_chain(rng, folder)
    urdf = folder / "chain.urdf"
    urdf.write_text(urdf.read_text().replace("prismatic", "continuous"))
    data, figures = yaml.safe_load(path.read_text()), {}
    data |= {"joints": {}, "outputs": {"w": {"work": "all"}}, "actuators": {}}
    if floating:
        urdf.write_text(urdf.read_text().replace('<link name="l0"/>', f"{BASE}</inertial></link>"))
        data["floating_base"] = True
    for k in joints:
        driving, driven = (float(x) for x in rng.uniform(0.3, 1.0, 2))
        ratio, rotor, friction = float(rng.uniform(20, 150)), 10 ** rng.uniform(-6, -4), 10 ** rng.uniform(-3, -1)
        coulomb, viscous = (float(rng.random() < 0.7) * friction, float(rng.random() < 0.5) * 1e-5)
        size, rhythm, phase = rng.uniform(0, 0.4), rng.uniform(1, 20), rng.uniform(0, 6)
        data["actuators"][f"j{k}"] = {
            "model": "torque",
            "motor": {"maker": "a", "model": "b", "rotor_inertia": rotor},
            "gear": GEAR | {"ratio": ratio, "efficiency": driving, "back_efficiency": driven},
            "servo": {"torque": f"{size}*sin({rhythm}*t + {phase})"},
            "rotor_friction": {"coulomb": coulomb, "viscous": viscous} if coulomb or viscous else "none",
        }
        if stops:
            data["joints"][f"j{k}"] = {"stop": {"lower": -4.0, "upper": 4.0, "restitution": float(rng.uniform(0, 0.9))}}
        figures[k + 6 * floating] = (
            ratio,
            rotor,
            driving,
            driven,
            coulomb,
            viscous,
            lambda t, a=size, b=rhythm, c=phase: a * math.sin(b * t + c),
        )
    path.write_text(yaml.safe_dump(data))
    return path, figures


def enumerated(mass, bias, velocity, time, figures):
    """The accelerations that the laws of gears and friction allow, over all sides and modes, by dense solves.

    Each drive is one row: F = e (N T − d f − D a) while it moves in the direction d, or a = 0 with F in between.
    """
    count, joints = len(bias), list(figures)
    load = mass - np.diag([figures[k][0] ** 2 * figures[k][1] if k in figures else 0.0 for k in range(count)])
    options = [
        list(itertools.product([math.copysign(1, velocity[k])] if velocity[k] else (1, 0, -1), (1, -1))) for k in joints
    ]
    for modes in itertools.product(*options):
        if any(direction == 0 and side < 0 for direction, side in modes):
            continue
        matrix, right = np.zeros((count + len(joints),) * 2), np.zeros(count + len(joints))
        matrix[:count, :count], right[:count] = load, -bias
        for i, (k, (direction, side)) in enumerate(zip(joints, modes, strict=True)):
            ratio, rotor, driving, driven, coulomb, viscous, torque = figures[k]
            matrix[k, count + i] = -1.0
            given = ratio * (torque(time) - direction * coulomb - viscous * ratio * velocity[k])
            share = driving if side > 0 else 1 / driven
            if direction == 0:
                matrix[count + i, k] = 1.0
            else:
                matrix[count + i, count + i], matrix[count + i, k] = 1.0, share * ratio**2 * rotor
                right[count + i] = share * given
        found = np.linalg.solve(matrix, right)
        fits = True
        for i, (k, (direction, side)) in enumerate(zip(joints, modes, strict=True)):
            ratio, _, driving, driven, coulomb, _, torque = figures[k]
            force, size = found[count + i], 1e-9 * (1 + abs(found[count + i]))
            if direction == 0:
                rub, drive = ratio * coulomb, ratio * torque(time)
                up = force / driving if force > 0 else force * driven
                down = force * driven if force > 0 else force / driving
                fits &= down - rub - size <= drive <= up + rub + size
            else:
                fits &= force * direction * side >= -size and (velocity[k] != 0 or found[k] * direction >= -1e-9)
        if fits:
            yield found[:count]


def check_geared(folder, seed, floating=False):
    """At rows of a run the accelerations are those of the enumeration, and all work is in the ledger."""
    path, figures = geared(folder, seed, floating=floating)
    run = bc.simulate(path)
    robot, still = run.robot, np.zeros(run.robot.nv)
    assert run.success, run.reason
    for row in (0, 13, 26, 39):
        q, v, a = run.position[row], run.velocity[row], run.acceleration[row]
        bias = robot.inverse_dynamics(q, v, still)
        allowed = list(enumerated(robot.mass_matrix(q), bias, v, run.time[row], figures))
        assert min(np.abs(a - each).max() / (1 + np.abs(each).max()) for each in allowed) < 1e-9
    assert run.energy_drift() < 1e-6


def check_geared_stops(folder, seed):
    """With stops: within them, all work is in the ledger, and impacts never raise the energy. The number of impacts."""
    path, _ = geared(folder, seed, stops=True)
    run = bc.simulate(path)
    assert run.success, run.reason
    assert run.energy_drift() < 1e-6
    assert np.abs(run.position).max() <= 4.0 + 1e-9 or len(run.scene.stops_of_joints) < run.robot.nv
    lost = run.outputs["w"][:, -1]  # constraints and impacts
    scale = 1 + np.abs(run.kinetic_energy + run.potential_energy).max()
    assert np.diff(lost).max() <= 1e-6 * scale
    return sum(len(run.impacts(stop.joint.name)) for stop in run.scene.stops_of_joints)


@pytest.mark.parametrize("seed", range(6))
def test_a_random_chain_of_lossy_drives_moves_as_the_enumeration_of_its_sides_says(tmp_path, seed):
    check_geared(tmp_path, seed)


@pytest.mark.parametrize("seed", range(4))
def test_a_floating_chain_of_lossy_drives_moves_as_the_enumeration_of_its_sides_says(tmp_path, seed):
    check_geared(tmp_path, 1000 + seed, floating=True)


@pytest.mark.tier2
@pytest.mark.parametrize("first", range(100, 300, 50))
def test_random_chains_of_lossy_drives_move_as_the_enumeration_of_their_sides_says(tmp_path, first):
    for seed in range(first, first + 50):
        check_geared(tmp_path, seed)


@pytest.mark.tier2
def test_impacts_behind_lossy_gears_never_raise_the_energy(tmp_path):
    assert sum(check_geared_stops(tmp_path, seed) for seed in range(60)) > 100


def test_the_torque_of_a_sizing_gives_the_acceleration_of_its_motion(tmp_path):
    # the judge's losses are those of a run: at rows of the motion its motor torque accelerates as the motion does
    joints = {
        "shoulder": {"ratio": 80.0, "efficiency": 0.7, "back_efficiency": 0.5, "friction": 0.01},
        "elbow": {"ratio": 50.0, "efficiency": 0.85, "back_efficiency": 0.8, "friction": 0.004},
    }
    data = dict(bc.load_scene("planar_2r").data)
    motor = {"maker": "a", "model": "b", "rotor_inertia": 3e-5, "nominal_torque": 1.0, "nominal_speed": 500.0}
    data["actuators"] = {
        name: {
            "motor": motor | {"coulomb_friction": one["friction"], "viscous_friction": 1e-5},
            "gear": GEAR
            | {"ratio": one["ratio"], "efficiency": one["efficiency"], "back_efficiency": one["back_efficiency"]},
        }
        for name, one in joints.items()
    }
    (tmp_path / "arm.yaml").write_text(yaml.safe_dump(data))
    sizing = bc.size(tmp_path / "arm.yaml")
    history = next(iter(sizing.histories.values()))
    rows = [k for k in range(20, 981, 137) if all(abs(history.joint(n).velocity[k]) > 0.05 for n in joints)]
    assert len(rows) > 3
    for k in rows:
        at = {n: history.joint(n) for n in joints}
        drives = {}
        for n in joints:  # the torque of the shaft, and of the rotor's friction
            shaft, speed = float(at[n].shaft.torque[k]), float(at[n].shaft.speed[k])
            torque = shaft + math.copysign(joints[n]["friction"], speed) + 1e-5 * speed
            drives[n] = data["actuators"][n] | {"model": "torque", "servo": {"torque": torque}}
        start = {n: float(at[n].position[k]) for n in joints}
        start |= {"velocity": {n: float(at[n].velocity[k]) for n in joints}}
        path = tmp_path / "row.yaml"
        path.write_text(yaml.safe_dump(data | {"actuators": drives, "initial": start}))
        run = bc.simulate(path, duration=1e-6, times=[0.0, 1e-6])
        expected = [at[n].acceleration[k] for n in run.robot.joint_names]
        assert run.acceleration[0] == pytest.approx(expected, rel=1e-8, abs=1e-8)


def test_a_linkage_behind_a_lossy_gear_moves_as_the_dense_kkt_system_of_its_side_says(tmp_path):
    data = dict(bc.load_scene("four_bar").data)
    for key in ("forces", "events", "outputs"):
        data.pop(key)
    rotor, ratio = 2e-3, 30.0
    gear = GEAR | {"ratio": ratio, "efficiency": DRIVING, "back_efficiency": DRIVEN}
    motor = {"maker": "a", "model": "b", "rotor_inertia": rotor}
    data["actuators"] = {"crank": {"motor": motor, "gear": gear, "model": "torque", "rotor_friction": "none",
                                   "servo": {"torque": "2*sin(5*t)"}}}  # fmt: skip
    data |= {"gravity": [0, -9.81, 0], "outputs": {"w": {"work": "all"}, "apex": {"constraint": "apex"}}}
    data["initial"] = {"crank": "50 deg", "coupler": {"guess": "310 deg"}, "rocker": {"guess": "50 deg"}}
    data["simulate"] = {"duration": 3, "rtol": 1e-10, "atol": 1e-10, "samples": 61}
    (tmp_path / "loop.yaml").write_text(yaml.safe_dump(data))
    run = bc.simulate(tmp_path / "loop.yaml")
    assert run.success and run.energy_drift() < 1e-7
    crank, sides = run.robot.joint("crank").v, set()
    for row in range(len(run.time)):
        q, v, a = run.position[row], run.velocity[row], run.acceleration[row]
        (jacobian, drift), bias = tips(q), run.robot.inverse_dynamics(q, v, np.zeros(3))
        mass = run.robot.mass_matrix(q)
        allowed = []
        for side, share in ((1, DRIVING), (-1, 1 / DRIVEN)):
            own = mass.copy()
            own[crank, crank] += (share - 1) * ratio**2 * rotor
            force = -bias
            force[crank] += share * ratio * 2 * math.sin(5 * run.time[row])
            system = np.block([[own, jacobian.T], [jacobian, np.zeros((2, 2))]])
            found = np.linalg.solve(system, np.concatenate([force, -drift(v)]))[:3]
            load = ratio * 2 * math.sin(5 * run.time[row]) - ratio**2 * rotor * found[crank]
            if load * v[crank] * side >= 0:
                allowed.append((found, side))
        if abs(v[crank]) > 1e-9:
            sides |= {side for _, side in allowed}
            assert min(np.abs(a - found).max() / (1 + np.abs(found).max()) for found, _ in allowed) < 1e-9
    assert sides == {1, -1}


def test_a_rigid_gear_that_locks_itself_and_an_unknown_efficiency_are_told(tmp_path):
    drive = {"gear": GEAR | {"efficiency": 0.4, "back_efficiency": 0.0}, "servo": {"torque": 0.0}}
    with pytest.raises(
        bc.InputError, match=r"actuators\.axis\.model \(line \d+\): a gear that locks itself .* 'elastic'"
    ):
        bc.load_scene(scene(tmp_path, drive))
    unknown = {key: value for key, value in GEAR.items() if key != "efficiency"}
    run = bc.simulate(scene(tmp_path, {"gear": unknown, "servo": {"torque": 0.0}}))
    assert any("efficiency is not stated" in note for note in run.notes)
    brake = {"joints": {"axis": {"brake": {"torque": 1.0, "engaged": "t - 0.5"}}}}
    with pytest.raises(bc.InputError, match=r"write elastic$"):
        bc.load_scene(scene(tmp_path, {"gear": LOSSY, "servo": {"torque": 0.0}}, **brake))
