"""Stops of joints: impacts, rest and infinitely many rebounds, against closed forms and dense solutions."""

import math
import re

import numpy as np
import pytest
import yaml

import bellcrank as bc

G = 9.81
BLOCK = """<robot name="block"><link name="ground"/><link name="block"><inertial><mass value="2"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="slide" type="prismatic"><parent link="ground"/><child link="block"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="5" effort="1000" velocity="1000"/></joint></robot>"""
TIGHT = {"rtol": 1e-12, "atol": 1e-12}


@pytest.fixture
def block(tmp_path):
    """Makes scenes of a block of 2 kg on a vertical rail from −3 to 5 m."""

    def made(stop=None, **keys):
        (tmp_path / "block.urdf").write_text(BLOCK)
        joints = {} if stop is None else {"joints": {"slide": {"stop": stop}}}
        outputs = {} if stop is not None and "stiffness" in stop else {"f": {"force": "stop_slide"}}
        scene = {"urdf": "block.urdf", "outputs": outputs, **joints, **keys}
        (tmp_path / "scene.yaml").write_text(yaml.safe_dump(scene))
        return bc.load_scene(tmp_path / "scene.yaml")

    return made


@pytest.mark.parametrize("e", [0.5, 0.8, 0.9])
def test_a_bouncing_ball_passes_infinitely_many_impacts_and_rests(block, e):
    """From h = 1 m: impacts at √(2h/g) (1 + 2 Σ e^k), at rest from √(2h/g) (1 + e)/(1 − e) on."""
    scene = block({"lower": 0, "restitution": e}, initial={"slide": 1}, simulate={"duration": 10, **TIGHT})
    run = bc.simulate(scene)
    first = math.sqrt(2 / G)
    hits = run.impacts("slide")
    known = first * (1 + 2 * np.cumsum(np.append(0.0, e ** np.arange(1, len(hits)))))
    assert hits[:, 0] == pytest.approx(known, abs=1e-9)
    speeds = math.sqrt(2 * G) * e ** np.arange(len(hits) - 1)
    assert hits[:-1, 1] == pytest.approx(2 * (1 + e) * speeds, rel=1e-8, abs=1e-9)
    ((begin, end),) = run.at_stop("slide")
    assert begin == pytest.approx(first * (1 + e) / (1 - e), abs=1e-9) and end == 10.0
    rest = run.time > begin
    assert (run.position[rest] == 0.0).all() and (run.velocity[rest] == 0.0).all()
    assert run.output("f").ravel()[rest] == pytest.approx(2 * G)
    assert run.position.min() >= 0.0 and run.energy_drift() < 1e-12 and not run.warnings
    assert f"({len(hits)} in all" in run.table()


def test_an_elastic_impact_keeps_the_energy_and_a_plastic_one_loses_it(block):
    elastic = bc.simulate(block({"lower": 0, "restitution": 1}, initial={"slide": 1}), duration=10.0, **TIGHT)
    energy = elastic.kinetic_energy + elastic.potential_energy
    assert energy == pytest.approx(energy[0], rel=1e-10) and len(elastic.impacts("slide")) == 11
    plastic = bc.simulate(block({"lower": 0}, initial={"slide": 1}), duration=2.0, **TIGHT)
    ((time, impulse),) = plastic.impacts("slide")
    assert time == pytest.approx(math.sqrt(2 / G), abs=1e-12) and impulse == pytest.approx(2 * math.sqrt(2 * G))
    assert plastic.work[-1] == pytest.approx(-2 * G) and (plastic.position[plastic.time > time] == 0.0).all()


def test_stops_of_the_robot_file_hold_every_joint_that_has_a_range(block):
    """Thrown upwards: the upper stop at 5 m, then the lower one at −3 m, plastic both."""
    scene = block(joint_stops="from_file", initial={"velocity": {"slide": 12}}, simulate={"duration": 4, **TIGHT})
    run = bc.simulate(scene)
    hits = run.impacts("slide")
    up = (12 - math.sqrt(144 - 2 * G * 5)) / G
    assert hits[:, 0] == pytest.approx([up, up + math.sqrt(2 * 8 / G)], abs=1e-11)
    assert hits[:, 1] == pytest.approx([-2 * math.sqrt(144 - 10 * G), 2 * math.sqrt(16 * G)])
    assert run.position[-1, 0] == -3.0 and not any("range" in note for note in run.notes)


def test_a_held_joint_leaves_its_stop_where_the_force_turns(block):
    """The load 3 t pulls upwards against the weight: at 2 g / 3 s."""
    load = [{"kind": "torque", "joint": "slide", "value": "3*t"}]
    scene = block({"lower": 0}, initial={"slide": 0}, forces=load, simulate={"duration": 8, **TIGHT})
    run = bc.simulate(scene)
    assert run.at_stop("slide") == pytest.approx(np.array([[0.0, 2 * G / 3]]), abs=1e-9)
    after = run.time - 2 * G / 3
    known = np.where(after > 0, 0.25 * after**3, 0.0)
    moving = run.impacts("slide")[0, 0] if len(run.impacts("slide")) else math.inf
    rows = run.time < moving
    assert run.position[rows, 0] == pytest.approx(known[rows], abs=1e-8)


def test_an_elastic_stop_pushes_and_never_pulls(block):
    """m x'' = −m g + max(0, −k x − d x'): against a stiff spring alone, whose contact lasts half a period."""
    scene = block({"lower": 0, "stiffness": 2e4}, gravity=[0, 0, 0], initial={"slide": 0.5, "velocity": {"slide": -1}})
    run = bc.simulate(scene, duration=2.0, **TIGHT)
    leaves = 0.5 + math.pi / 100  # √(k / m) = 100 rad/s
    assert run.position[-1, 0] == pytest.approx(2.0 - leaves, abs=1e-9) and run.velocity[-1, 0] == pytest.approx(1.0)
    damped = block(
        {"lower": 0, "stiffness": 2e4, "damping": 150}, gravity=[0, 0, 0],
        initial={"slide": 0.5, "velocity": {"slide": -1}},
    )  # fmt: skip
    assert 0.1 < bc.simulate(damped, duration=2.0).velocity[-1, 0] < 0.95


def test_friction_and_a_stop_of_one_joint_hold_it_together(block):
    """Sliding down against friction into the stop: friction ends the motion on the way up again."""
    scene = block({"lower": 0, "restitution": 0.5}, initial={"slide": 1}, simulate={"duration": 3, **TIGHT})
    joints = {"slide": {"stop": {"lower": 0, "restitution": 0.5}, "dry_friction": {"coulomb": 5}}}
    run = bc.simulate(scene.with_overrides({"joints": joints}))
    down = G - 2.5
    (time, impulse), *_ = run.impacts("slide")
    assert time == pytest.approx(math.sqrt(2 / down), abs=1e-11)
    assert impulse == pytest.approx(2 * 1.5 * math.sqrt(2 * down))
    assert run.position[-1, 0] == pytest.approx(0.0, abs=1e-12) and run.velocity[-1, 0] == 0.0
    assert np.diff(run.kinetic_energy + run.potential_energy).max() < 1e-10


def arm(folder, rng):
    """A random arm of 2 to 4 joints under gravity with stops around its start, some with friction and brakes."""
    count = int(rng.integers(2, 5))
    parts = ['<robot name="arm"><link name="l0"/>']
    for k in range(count):
        axis, at = rng.normal(size=3), rng.normal(size=3) * 0.2
        axis /= np.linalg.norm(axis)
        parts.append(
            f'<link name="l{k + 1}"><inertial><origin xyz="{at[0]} {at[1]} {at[2]}"/>'
            f'<mass value="{rng.uniform(0.5, 3)}"/>'
            '<inertia ixx="0.05" iyy="0.04" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="j{k}" type="continuous"><parent link="l{k}"/><child link="l{k + 1}"/>'
            f'<origin xyz="0.3 0 0.1"/><axis xyz="{axis[0]} {axis[1]} {axis[2]}"/></joint>'
        )
    (folder / "arm.urdf").write_text("".join([*parts, "</robot>"]))
    joints = {}
    for k in range(count):
        own = {}
        if k == 0 or rng.random() < 0.8:
            own["stop"] = {"lower": float(-rng.uniform(0.1, 1)), "upper": float(rng.uniform(0.1, 1))}
            own["stop"]["restitution"] = float(rng.choice([0.0, 0.3, 0.7]))
        if rng.random() < 0.4:
            own["dry_friction"] = {"coulomb": float(10 ** rng.uniform(-1, 0.5))}
        if rng.random() < 0.3:
            engaged = f"sin({rng.uniform(2, 20)}*t + {rng.uniform(0, 6)})"
            own["brake"] = {"torque": float(10 ** rng.uniform(-1, 1.5)), "engaged": engaged}
        if own:
            joints[f"j{k}"] = own
    speed = {f"j{k}": float(rng.normal()) for k in range(count)}
    scene = {
        "urdf": "arm.urdf", "joints": joints, "initial": {"velocity": speed},
        "outputs": {f"s{name}": {"force": f"stop_{name}"} for name, own in joints.items() if "stop" in own},
        "simulate": {"duration": 2, "rtol": 1e-10, "atol": 1e-10, "samples": 101},
    }  # fmt: skip
    (folder / "arm.yaml").write_text(yaml.safe_dump(scene))
    return folder / "arm.yaml"


def check_arm(folder, seed):
    """Within its stops, energy never rises, stops push only, and the first impact is that of a dense solution."""
    path = arm(folder, np.random.default_rng(seed))
    scene = bc.load_scene(path)
    run = bc.simulate(scene)
    assert run.success, run.reason
    energy = run.kinetic_energy + run.potential_energy
    assert np.diff(energy).max() <= 1e-7 * (1 + np.abs(energy).max()) and run.energy_drift() < 1e-7
    hits = []
    for stop in scene.stops_of_joints:
        q, v = run.position[:, stop.joint.q], run.velocity[:, stop.joint.v]
        assert q.min() >= stop.lower - 1e-9 and q.max() <= stop.upper + 1e-9
        force = run.output(f"s{stop.joint.name}").ravel()
        assert (force[q < 0] >= -1e-9).all() and (force[q > 0] <= 1e-9).all()
        for begin, end in run.at_stop(stop.joint.name):
            rows = (run.time > begin) & (run.time < end)
            assert (v[rows] == 0.0).all() and np.isin(q[rows], [stop.lower, stop.upper]).all()
        assert (force[(q != stop.lower) & (q != stop.upper)] == 0.0).all()
        hits += [(*hit, stop) for hit in run.impacts(stop.joint.name).tolist()]
    if not hits:
        return 0
    time, impulse, stop = min(hits, key=lambda hit: hit[0])
    if sum(hit[0] == time for hit in hits) > 1 or time < 1e-6:
        return len(hits)
    before = bc.simulate(scene, duration=time - 1e-9, times=[0.0, time - 1e-9])
    held = [
        k for k in scene.stops_of_joints if len(run.at_stop(k.joint.name)) and run.at_stop(k.joint.name)[0, 0] < time
    ]
    if not held:
        inverse, j = np.linalg.inv(scene.robot.mass_matrix(before.position[-1])), stop.joint.v
        velocity = before.velocity[-1, j] + 1e-9 * before.acceleration[-1, j]
        known = -(1 + stop.restitution) * velocity / inverse[j, j]
        assert impulse == pytest.approx(known, rel=1e-7)
    return len(hits)


@pytest.mark.parametrize("seed", range(4))
def test_a_random_arm_stays_within_its_stops_and_loses_energy(tmp_path, seed):
    assert check_arm(tmp_path, seed) > 0


@pytest.mark.tier2
@pytest.mark.parametrize("first", range(100, 300, 50))
def test_random_arms_stay_within_their_stops_and_lose_energy(tmp_path, first):
    assert sum(check_arm(tmp_path, seed) for seed in range(first, first + 50)) > 100


def test_a_linkage_strikes_a_stop_with_the_impulse_of_the_dense_kkt_system(tmp_path):
    """The four-bar under gravity, its rocker's stop: M Δv = Jᵀ Λ + S p with J v⁺ = 0 and v⁺ = −e v⁻ at the stop."""
    scene = dict(bc.load_scene("four_bar").data)
    for key in ("forces", "events", "outputs"):
        scene.pop(key)
    scene |= {"gravity": [0, -9.81, 0], "joints": {"rocker": {"stop": {"lower": 0.3, "upper": 3, "restitution": 0.4}}}}
    scene |= {"initial": {"crank": "50 deg", "coupler": {"guess": "310 deg"}, "rocker": {"guess": "50 deg"}}}
    scene["simulate"] = {"duration": 3, "rtol": 1e-12, "atol": 1e-12}
    path = tmp_path / "loop.yaml"
    path.write_text(yaml.safe_dump(scene))
    run = bc.simulate(path)
    time, impulse = run.impacts("rocker")[0]
    before = bc.simulate(path, duration=time * (1 - 1e-13), times=[0.0, time * (1 - 1e-13)])
    robot, q, v = run.robot, before.position[-1], before.velocity[-1]
    columns = []
    for unit in np.eye(3):
        tips = [robot.frame_velocity(name, q, unit)[0] for name in ("coupler_tip", "rocker_tip")]
        columns.append((tips[0] - tips[1])[:2])
    jacobian, j = np.array(columns).T, robot.joint("rocker").v
    rows = np.vstack([jacobian, np.eye(3)[j]])
    system = np.block([[robot.mass_matrix(q), -rows.T], [rows, np.zeros((3, 3))]])
    wanted = np.concatenate([robot.mass_matrix(q) @ v, [0.0, 0.0, -0.4 * v[j]]])
    known = np.linalg.solve(system, wanted)
    assert impulse == pytest.approx(known[-1], rel=1e-10)
    assert run.constraint_residual() < 1e-9 and run.velocity_residual() < 1e-9 and run.energy_drift() < 1e-9
    assert run.position[:, robot.joint("rocker").q].min() >= 0.3 - 1e-12


def test_a_saved_run_keeps_its_impacts(block, tmp_path):
    run = bc.simulate(block({"lower": 0, "restitution": 0.5}, initial={"slide": 1}), duration=5.0)
    again = bc.load_run(run.save(tmp_path / "run.npz"))
    assert np.array_equal(again.impacts("slide"), run.impacts("slide"))
    assert np.array_equal(again.at_stop("slide"), run.at_stop("slide"))


@pytest.mark.parametrize("solver", ["RK45", "RK4", "Radau"])
def test_other_methods_pass_the_impacts_too(block, solver):
    scene = block({"lower": 0, "restitution": 0.5}, initial={"slide": 1})
    step = {"step": 0.01} if solver == "RK4" else {"rtol": 1e-10, "atol": 1e-10}
    run = bc.simulate(scene, duration=3.0, solver=solver, **step)
    assert run.at_stop("slide")[0, 0] == pytest.approx(3 * math.sqrt(2 / G), abs=1e-8)


def test_ends_of_stops_are_parameters(block):
    keys = {"parameters": {"floor": {"value": 0, "sets": ["forces.stop_slide.lower"]}}, "initial": {"slide": 1}}
    swept = bc.sweep(block({"restitution": 0}, **keys), {"floor": [0.0, 0.25]}, threads=1)
    assert swept.column("end.slide").tolist() == [0.0, 0.25]


def test_designs_beyond_their_stop_are_rows_with_their_reason_and_the_others_run_as_alone(block):
    parameters = {
        "floor": {"value": 0, "sets": ["forces.stop_slide.lower"]},
        "back": {"value": 0.5, "sets": ["forces.stop_slide.restitution"]},
    }
    scene = block({"restitution": 0.5}, parameters=parameters, initial={"slide": 1})
    swept = bc.sweep(scene, {"floor": [0.0, 1.5, 0.25], "back": [0.5, 1.25, 0.75]}, threads=2)
    for row, (floor, back) in enumerate(swept.values.tolist()):
        if floor > 1.0 or back > 1.0:
            expected = "beyond its lower stop at 1.5" if back <= 1.0 else "restitution 1.25 of its stop is above 1"
            assert swept.status[row] == "infeasible" and expected in swept.reasons[row]
            with pytest.raises(bc.InputError, match=re.escape(swept.reasons[row])):
                bc.simulate(scene, overrides={"floor": floor, "back": back})
        else:
            run = bc.simulate(scene, overrides={"floor": floor, "back": back})
            assert swept.column("end.slide")[row] == pytest.approx(run.position[-1, 0], abs=1e-12)
            assert swept.column("end.slide.velocity")[row] == pytest.approx(run.velocity[-1, 0], abs=1e-12)


WRONG = {
    "restitution above 1": ({"restitution": 1.5}, "expected 0 to 1, found 1.5"),
    "wrong order": ({"lower": 2, "upper": 1}, "expected lower < upper, found 2 and 1 m"),
    "both kinds": ({"restitution": 0.5, "stiffness": 100}, "has no restitution; give one of the two"),
    "damping alone": ({"damping": 5}, "stiffness"),
    "unknown key": ({"bounce": 1}, "bounce"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_stops_are_refused_in_one_sentence(block, case):
    stop, said = WRONG[case]
    with pytest.raises(bc.InputError, match=r"scene.yaml: joints\.slide\.stop") as found:
        block(stop)
    assert said in str(found.value) and "\n" not in str(found.value)


def test_a_start_beyond_a_stop_and_a_joint_without_a_range_are_refused(block, tmp_path):
    with pytest.raises(bc.InputError, match="joint 'slide' starts at -1 m, beyond its lower stop at 0 m"):
        bc.simulate(block({"lower": 0}, initial={"slide": -1}))
    (tmp_path / "scene.yaml").write_text("urdf: pendulum\njoints: {swing: {stop: {}}}\n")
    with pytest.raises(bc.InputError, match="joint 'swing' has no range in the robot file"):
        bc.load_scene(tmp_path / "scene.yaml")


def test_a_joint_that_mimics_another_has_no_stop(tmp_path):
    urdf = (
        '<robot name="r"><link name="a"/><link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" '
        'ixy="0" ixz="0" iyz="0"/></inertial></link><link name="c"/><joint name="one" type="continuous">'
        '<parent link="a"/><child link="b"/></joint><joint name="two" type="continuous">'
        '<parent link="b"/><child link="c"/><mimic joint="one"/></joint></robot>'
    )
    (tmp_path / "r.urdf").write_text(urdf)
    for entry in ("stop: {lower: 0}", "dry_friction: {coulomb: 1}"):
        (tmp_path / "scene.yaml").write_text(f"urdf: r.urdf\njoints: {{two: {{{entry}}}}}\n")
        with pytest.raises(bc.InputError, match="'two'"):
            bc.load_scene(tmp_path / "scene.yaml")


@pytest.mark.parametrize("function", [bc.linearise, bc.scene_casadi, bc.scene_derivatives])
def test_what_needs_smooth_equations_refuses_stops(block, function):
    with pytest.raises(bc.InputError, match="stop"):
        function(block({"lower": 0}, initial={"slide": 1}))


def test_unknown_joints_of_impacts_are_refused(block):
    run = bc.simulate(block({"lower": 0}, initial={"slide": 1}), duration=0.1)
    for function in (run.impacts, run.at_stop):
        with pytest.raises(bc.InputError, match="joint with a rigid stop 'elbow'"):
            function("elbow")


def test_a_joint_whose_motion_is_prescribed_has_no_stop(block):
    keys = {
        "outputs": {},
        "motions": {"up": {"kind": "waypoints", "times": [0, 1], "positions": [{}, {"slide": 1}]}},
        "constraints": [{"name": "drive", "kind": "prescribed_motion", "joint": "slide", "motion": "up"}],
    }
    with pytest.raises(bc.InputError, match="joint 'slide' follows a prescribed motion, which no stop ends"):
        block({"lower": 0}, **keys)
    assert block(joint_stops="from_file", **keys).stops_of_joints == ()


def test_a_restitution_above_1_by_a_parameter_is_refused(block):
    keys = {"parameters": {"e": {"value": 0.5, "sets": ["forces.stop_slide.restitution"]}}, "initial": {"slide": 1}}
    scene = block({"lower": 0, "restitution": 0.5}, **keys)
    with pytest.raises(bc.InputError, match=r"restitution 1\.2 of its stop is above 1"):
        bc.simulate(scene.with_overrides({"e": 1.2}))


def test_sizing_is_the_same_with_stops_and_says_that_they_exert_no_force(tmp_path):
    scene = {
        "urdf": "planar_2r", "gravity": [0, -9.81, 0],
        "motions": {"turn": {"kind": "waypoints", "times": [0, 1], "positions": [{}, {"elbow": 1}]}},
    }  # fmt: skip
    found = []
    for keys in ({}, {"joint_stops": "from_file"}):
        path = tmp_path / f"arm{len(keys)}.yaml"
        path.write_text(yaml.safe_dump({**scene, **keys}))
        found.append(bc.size(path))
    plain, stopped = (sizing.joint("elbow") for sizing in found)
    assert stopped.peak_torque == plain.peak_torque and stopped.holding_torque == plain.holding_torque
    assert not found[1].forces and any("rigid stops (shoulder, elbow) exert no force" in w for w in found[1].warnings)


def test_the_ledger_of_work_says_where_the_energy_went(tmp_path):
    """With a damper, dry friction and a stop the parts sum to the work, and an impact takes what it must."""
    changes = {
        "joints": {"swing": {"dry_friction": {"coulomb": 0.5}, "stop": {"lower": -0.5, "restitution": 0.6}}},
        "initial.swing": 1.0, "simulate.duration": 4.0, "simulate.rtol": 1e-11, "simulate.atol": 1e-11,
        "forces": [{"kind": "damper", "joint": "swing", "coefficient": 0.3}],
        "outputs": {"ledger": {"work": "all"}, "damped": {"work": "damper"}},
    }  # fmt: skip
    run = bc.simulate("pendulum", overrides=changes)
    damper, friction, own, impacts = run.outputs["ledger"].T
    assert not own.any()
    assert np.abs(damper + friction + impacts - run.work).max() < 1e-12
    assert (run.outputs["damped"] == damper).all()
    assert run.energy_drift() < 1e-9
    (_, impulse), *others = run.impacts("swing").tolist()
    inertia = float(run.robot.mass_matrix(run.position[0])[0, 0])
    speed = impulse / (inertia * 1.6)
    assert not others and impacts[-1] == pytest.approx(-0.5 * inertia * speed**2 * (1 - 0.36), rel=1e-8)
    early = run.time <= 0.3
    lost = 0.5 * np.abs(np.diff(run.position[early, 0])).sum()  # Coulomb friction times the way
    assert friction[early][-1] == pytest.approx(-lost, rel=1e-9)


def test_impacts_of_several_joints_at_one_instant_are_a_note(tmp_path):
    parts = ['<robot name="two"><link name="base"/>']
    for name in ("a", "b"):
        parts.append(
            f'<link name="{name}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
            f'</inertial></link><joint name="j{name}" type="prismatic"><parent link="base"/><child link="{name}"/>'
            '<axis xyz="0 0 1"/><limit lower="0" upper="9" velocity="9" effort="9"/></joint>'
        )
    (tmp_path / "two.urdf").write_text("".join([*parts, "</robot>"]))
    data = {"urdf": "two.urdf", "joint_stops": "from_file", "initial": {"ja": 1.0, "jb": 1.0}}
    (tmp_path / "two.yaml").write_text(yaml.safe_dump(data))
    run = bc.simulate(tmp_path / "two.yaml", duration=1.0)
    assert any("strike their stops at once" in note for note in run.notes)
    data["initial"]["jb"] = 0.5
    (tmp_path / "two.yaml").write_text(yaml.safe_dump(data))
    assert not any("at once" in note for note in bc.simulate(tmp_path / "two.yaml", duration=1.0).notes)


def test_a_latch_catches_a_joint_and_the_run_goes_on(tmp_path):
    """The impulse is that of a stop without restitution, and the joint rests for ever after."""
    stop = {"lower": -9.0, "upper": 1.0}
    caught = bc.simulate("pendulum", overrides={"joints": {"swing": {"stop": {**stop, "latch": True}}}, "initial": {
        "swing": 0.0, "velocity": {"swing": 4.0}}, "simulate.duration": 3.0})  # fmt: skip
    plain = bc.simulate("pendulum", overrides={"joints": {"swing": {"stop": {**stop, "restitution": 0.0}}}, "initial": {
        "swing": 0.0, "velocity": {"swing": 4.0}}, "simulate.duration": 3.0})  # fmt: skip
    assert (caught.impacts("swing") == plain.impacts("swing")[:1]).all()
    (begun, end), *others = caught.at_stop("swing").tolist()
    assert not others and end == 3.0 and begun == caught.impacts("swing")[0, 0]
    after = caught.time > begun
    assert (caught.position[after, 0] == 1.0).all() and (caught.velocity[after, 0] == 0.0).all()
    assert caught.energy_drift() < 1e-9 and plain.position[-1, 0] < 1.0


def test_a_latched_joint_of_an_arm_stays_while_others_strike_their_stops(tmp_path):
    latch = {"lower": -9.0, "upper": 0.4, "latch": True}
    joints = {"shoulder": {"stop": latch}, "elbow": {"stop": {"lower": -1.0, "upper": 1.0, "restitution": 0.8}}}
    changes = {"joints": joints, "initial": {"velocity": {"shoulder": 3.0, "elbow": -2.0}}, "simulate.duration": 3.0}
    run = bc.simulate("planar_2r_swing", overrides=changes | {"events": [], "control": [], "outputs": {}})
    begun = run.at_stop("shoulder")[0, 0]
    after = run.time > begun
    assert (run.position[after, 0] == 0.4).all() and (run.velocity[after, 0] == 0.0).all()
    assert len(run.impacts("elbow")) > 3 and run.energy_drift() < 1e-7
    first, *later = run.impacts("shoulder")[:, 1].tolist()
    assert first < 0.0 < max(later)  # it is pushed back when it is caught, and pulled by impacts of the elbow


def test_a_latch_with_restitution_or_stiffness_is_refused(block):
    for stop in ({"lower": 0, "latch": True, "restitution": 0.5}, {"lower": 0, "latch": True, "stiffness": 1}):
        with pytest.raises(bc.InputError, match=r"joints.slide.stop"):
            block(stop)


def test_a_stop_ends_a_run_after_its_first_impact_where_the_scene_asks_for_it(block, tmp_path):
    first = math.sqrt(2 / G)
    scene = block(
        {"lower": 0, "restitution": 0.5, "stop": True}, initial={"slide": 1}, simulate={"duration": 9, **TIGHT}
    )
    run = bc.simulate(scene)
    assert run.success and run.status == "contact" and "joint 'slide' met its stop" in run.message
    assert run.time[-1] == pytest.approx(first, abs=1e-12) and len(run.impacts("slide")) == 1
    assert run.velocity[-1] == pytest.approx(0.5 * math.sqrt(2 * G))  # after the impact
    run.save(tmp_path / "run.npz")
    assert bc.load_run(tmp_path / "run.npz").reason == run.reason
    swept = bc.sweep(scene, vary={"initial.slide": [0.25, 1.0, 4.0]})
    assert swept.column("end.time") == pytest.approx(first * np.array([0.5, 1.0, 2.0]))
    assert bc.simulate(block({"lower": 0, "stop": True}, initial={"slide": 0}), duration=1.0).status == "finished"


def test_a_brake_ends_a_run_once_the_joint_is_at_rest_where_the_scene_asks_for_it(block):
    scene = block(joints={"slide": {"brake": {"torque": 50, "engaged": "t - 0.2", "stop": True}}}, outputs={})
    run = bc.simulate(scene, duration=5.0, **TIGHT)
    # it falls 0.2 s with g, and is braked with 50/2 - g
    assert run.status == "contact" and "brake of joint 'slide'" in run.message
    assert run.time[-1] == pytest.approx(0.2 + 0.2 * G / (25 - G), abs=1e-9) and run.velocity[-1] == 0.0


@pytest.mark.parametrize("e", [0.0, 0.3, 0.7, 1.0])
@pytest.mark.parametrize("direction", ["any", "down", "up"])
def test_an_event_at_the_place_of_a_stop_happens_at_each_impact(block, e, direction):
    event = {"name": "hit", "when": {"joint": "slide", "position": 0.0}, "direction": direction}
    scene = block({"lower": 0, "restitution": e}, initial={"slide": 1}, events=[event])
    run = bc.simulate(scene, duration=6.0)
    hits = np.array([event.time for event in run.events])
    expected = run.impacts("slide")[:, 0] if direction != "up" else np.zeros(0)
    assert hits == pytest.approx(expected, abs=1e-12)
    last = bc.simulate(scene.with_overrides({"events.hit.stop": True}), duration=6.0)
    assert last.time[-1] == pytest.approx(6.0 if direction == "up" else math.sqrt(2 / G), abs=1e-9)


def test_a_joint_that_leaves_its_stop_is_not_driven_into_it_by_an_impact_at_another_one(tmp_path):
    """Two blocks of 1 kg in a row: the first meets its stop at 1 m/s while the second leaves its own, on the first, at
    0.1 m/s. The impact turns the first round with 0.5 m/s, and the second is carried along.
    """
    bodies = "".join(
        f'<link name="b{k}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
        "</inertial></link>"
        for k in range(2)
    )
    joints = "".join(
        f'<joint name="j{k}" type="prismatic"><parent link="{parent}"/><child link="b{k}"/><axis xyz="1 0 0"/>'
        '<limit lower="-10" upper="10" effort="1" velocity="9"/></joint>'
        for k, parent in enumerate(("base", "b0"))
    )
    (tmp_path / "row.urdf").write_text(f'<robot name="row"><link name="base"/>{bodies}{joints}</robot>')
    stop = {"lower": 0.0, "restitution": 0.5}
    scene = {"urdf": "row.urdf", "gravity": [0, 0, 0], "joints": {"j0": {"stop": stop}, "j1": {"stop": stop}},
             "initial": {"velocity": {"j0": -1.0, "j1": 0.1}}, "simulate": {"duration": 1.0}}  # fmt: skip
    (tmp_path / "row.yaml").write_text(yaml.safe_dump(scene))
    run = bc.simulate(tmp_path / "row.yaml")
    assert run.velocity[-1] == pytest.approx([0.5, 0.0], abs=1e-12) and run.position.min() >= 0.0
    assert run.impacts("j0")[0, 1] == pytest.approx(2.9) and run.impacts("j1")[0, 1] == pytest.approx(1.4)
