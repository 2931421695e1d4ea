"""Constraints of scenes against independent solutions: Pinocchio's Jacobians, closed forms, plain trees."""

import json
import math
import re

import casadi
import numpy as np
import pinocchio as pin
import pytest
from crane import FILES
from scipy.integrate import solve_ivp

from bellcrank import load_run, load_scene, simulate
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.dynamics.inverse.scene_inverse_dynamics import scene_inverse_dynamics
from bellcrank.dynamics.postures.consistent_start import consistent_posture, consistent_velocity
from bellcrank.elements.constraints import read_gepetto
from bellcrank.errors import InputError
from bellcrank.files import bundled_data
from bellcrank.scene.settings import Settings, Stabilisation, stabilisation

LOCK_TIME, LOCK_ANGLE = 12.267788975800, math.radians(150.462301525)  # A. Ghosal's four-bar from 1 degree
LOCK_FORCE, LOCK_ENERGY = 1547.64, 4.7680791696  # N, J


def chain_urdf(count=7, mass=1.5):
    """A chain of links 0.4 m long, each joint's axis turned from the one before."""
    links, joints, parent = ['<link name="base"/>'], [], "base"
    for k in range(count):
        axis = ("0 0 1", "0 1 0", "1 0 0")[k % 3]
        links.append(
            f'<link name="l{k}"><inertial><origin xyz="0.2 0.02 0.01"/><mass value="{mass}"/>'
            '<inertia ixx="0.01" ixy="0.001" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link>'
        )
        joints.append(
            f'<joint name="j{k}" type="continuous"><parent link="{parent}"/><child link="l{k}"/>'
            f'<origin xyz="{0.4 if k else 0} 0 0"/><axis xyz="{axis}"/></joint>'
        )
        parent = f"l{k}"
    return f'<?xml version="1.0"?><robot name="chain">{"".join(links)}{"".join(joints)}</robot>'


BODY = """<?xml version="1.0"?><robot name="body"><link name="body"><inertial><mass value="2"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.25"/></inertial></link></robot>"""
POSTURE = np.array([0.3, 0.5, -0.4, 0.7, 0.6, -0.3, 0.4])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    where = tmp_path_factory.mktemp("closures")
    for name, text in (FILES | {"chain.urdf": chain_urdf(), "body.urdf": BODY}).items():
        (where / name).write_text(text)
    return where


def linkage(changes=()):
    """The bundled four-bar without parameters and outputs, which name its constraint."""
    return load_scene("four_bar", {"parameters": {}, "outputs": {}} | dict(changes))


@pytest.fixture(scope="module")
def four_bar():
    return linkage()


def closed_chain(folder, kind, **keys):
    """The chain with its end held at a frame of the base, in a posture that closes."""
    bare = load_scene(folder / "chain.urdf")
    data = bare.robot.model.createData()
    pin.framesForwardKinematics(bare.robot.model, data, POSTURE)
    end = data.oMf[bare.robot.model.getFrameId("l6")]
    anchor = {"link": "base", "xyz": end.translation.tolist(), "rpy": pin.rpy.matrixToRpy(end.rotation).tolist()}
    constraint = {"name": "hold", "kind": kind, "frame_a": "l6", "frame_b": "anchor", **keys}
    start = {f"j{k}": float(x) for k, x in enumerate(POSTURE)}
    return load_scene(
        folder / "chain.urdf", {"frames": {"anchor": anchor}, "constraints": [constraint], "initial": start}
    )


# ---- kinds of constraint


@pytest.mark.tier2
@pytest.mark.parametrize("kind", ["point", "hinge", "weld"])
def test_accelerations_and_forces_of_a_loop_are_those_of_pinocchios_jacobians(folder, kind):
    scene = closed_chain(folder, kind, **({"axis": [0, 0, 1]} if kind == "hinge" else {}))
    model = scene.robot.model
    data, frame = model.createData(), model.getFrameId("l6")
    held = np.zeros(7, dtype=bool)
    q = consistent_posture(scene, POSTURE, held)
    v = consistent_velocity(scene, q, np.random.default_rng(3).normal(size=7), held)
    pin.computeJointJacobians(model, data, q)
    jacobian = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    pin.forwardKinematics(model, data, q, v, np.zeros(7))
    drift = pin.getFrameClassicalAcceleration(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED).vector
    pin.framesForwardKinematics(model, data, q)
    turn = data.oMf[frame].rotation
    # rows as the kinds state them: force in world axes; moments about k x n1, k x n2, or in the axes of frame b
    ways = {"point": np.zeros((0, 3)), "weld": turn.T}
    if kind == "hinge":
        k, n = turn[:, 2], [turn @ np.array(n) for n in ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0))]
        ways["hinge"] = np.array([np.cross(k, n[0]), np.cross(k, n[1])])
    rows = np.vstack([jacobian[:3], ways[kind] @ jacobian[3:]])
    gamma = np.concatenate([drift[:3], ways[kind] @ drift[3:]])
    mass, bias = pin.crba(model, data, q), pin.nonLinearEffects(model, data, q, v)
    mass = np.triu(mass) + np.triu(mass, 1).T
    m = len(rows)
    kkt = np.block([[mass, -rows.T], [rows, np.zeros((m, m))]])
    solved = np.linalg.solve(kkt, np.concatenate([-bias, -gamma]))
    x = np.concatenate([q, v])
    multipliers = system_of(scene).constraint(np.zeros(1), x, np.zeros(0), system_parameters(scene))[0]
    acceleration = system_of(scene).observation(np.zeros(1), x, np.zeros(0), system_parameters(scene))[0]
    np.testing.assert_allclose(acceleration, solved[:7], rtol=0, atol=1e-8 * np.abs(solved[:7]).max())
    np.testing.assert_allclose(multipliers, solved[7:], atol=1e-7 * np.abs(solved[7:]).max())


def test_a_body_that_hangs_at_a_point_is_pulled_up_by_its_weight(folder):
    constraint = {"name": "hook", "kind": "point", "frame_a": "body", "frame_b": "world", "point": [0, 0, 1]}
    run = simulate(load_scene(folder / "body.urdf", {"floating_base": True, "constraints": [constraint]}), 0.1)
    np.testing.assert_allclose(run.constraint("hook").multipliers, np.tile([0, 0, 2 * 9.81], (len(run), 1)), atol=1e-9)
    assert run.constraint("hook").labels == ("x [N]", "y [N]", "z [N]")
    assert np.abs(run.position[:, 2] - 1.0).max() < 1e-14


def test_a_rod_makes_a_pendulum_whose_pull_is_weight_and_centripetal_force(folder):
    constraint = {"name": "rod", "kind": "distance", "frame_a": "body", "frame_b": "world", "length": 0.8}
    start = {"position": [0.8 * math.sin(1.0), 0, -0.8 * math.cos(1.0)]}
    scene = load_scene(folder / "body.urdf", {"floating_base": True, "constraints": [constraint], "base": start})
    times = np.linspace(0, 3, 31)
    run = simulate(scene, 3.0, times=times, rtol=1e-12, atol=1e-12)
    exact = solve_ivp(
        lambda t, y: [y[1], -9.81 / 0.8 * math.sin(y[0])], (0, 3), [1.0, 0.0], "DOP853", times, rtol=1e-13, atol=1e-13
    ).y
    np.testing.assert_allclose(run.position[:, 0], 0.8 * np.sin(exact[0]), atol=1e-9)
    pull = 2 * (9.81 * np.cos(exact[0]) + 0.8 * exact[1] ** 2)
    np.testing.assert_allclose(run.multipliers[:, 0], -pull, atol=1e-7)


def test_a_hinge_closed_four_bar_moves_as_the_point_closed_one(four_bar):
    times = np.linspace(0, 10, 11)
    point = simulate(four_bar, 10, times=times)
    hinge = simulate(four_bar, 10, times=times, overrides={"constraints.apex.kind": "hinge"})
    np.testing.assert_allclose(hinge.position, point.position, atol=1e-8)
    np.testing.assert_allclose(hinge.multipliers, point.multipliers, rtol=1e-6)  # moments of a planar loop are dropped


@pytest.mark.tier2
def test_a_spatial_loop_of_a_hinge_and_a_ball_is_redundant_and_moves_in_its_plane(tmp_path, four_bar):
    text = (bundled_data.folder("urdf") / "four_bar.urdf").read_text()
    ball = "".join(
        f'<link name="ball_{k}"/><joint name="lean_{k}" type="continuous"><parent link="{p}"/><child link="ball_{k}"/>'
        f'<origin xyz="{x} 0 0"/><axis xyz="{axis}"/></joint>'
        for k, p, x, axis in ((1, "ground", 1.241, "1 0 0"), (2, "ball_1", 0, "0 1 0"))
    )
    rocker = '<parent link="ground"/><child link="rocker_link"/>\n    <origin xyz="1.241 0 0"/>'
    assert rocker in text
    text = text.replace(rocker, '<parent link="ball_2"/><child link="rocker_link"/>').replace(
        "</robot>", ball + "</robot>"
    )
    (tmp_path / "spatial.urdf").write_text(text)
    scene = linkage(
        {
            "urdf": str(tmp_path / "spatial.urdf"),
            "constraints.apex.kind": "hinge",
            "gravity": [0, 0, -9.81],
            "events": [],
        },
    )
    times = np.linspace(0, 10, 11)
    run, plane = simulate(scene, 10, times=times), simulate(four_bar, 10, times=times)
    for name in ("crank", "coupler", "rocker"):
        np.testing.assert_allclose(run.joint(name).position, plane.joint(name).position, atol=1e-6)
    rank = run.constraint_rank()
    assert rank.rank == 4 and len(rank.singular_values) == 5
    assert "not unique" in run.table() and "rank 4 of 5" in run.table()
    assert run.equation_residual() < 1e-9


@pytest.mark.tier2
def test_a_coupling_is_what_mimic_means_at_the_fingers_of_a_panda(tmp_path):
    from bellcrank.robot import catalog

    source = catalog.find_urdf("panda")
    text = source.read_text()
    plain = re.sub(r"<mimic[^>]*/>", "", text)
    assert plain != text
    (tmp_path / "panda.urdf").write_text(plain)
    start = {"panda_joint2": 0.4, "panda_joint4": -1.5, "panda_joint6": 1.2, "panda_finger_joint1": 0.02}
    push = [{"kind": "torque", "joint": "panda_finger_joint1", "value": 0.3}]
    own = simulate(load_scene(source, {"initial": start, "forces": push}), 0.3)
    gear = {"kind": "coupling", "joint_a": "panda_finger_joint1", "joint_b": "panda_finger_joint2", "ratio": 1}
    scene = load_scene(tmp_path / "panda.urdf", {"initial": start, "forces": push, "constraints": [gear]})
    run = simulate(scene, 0.3)
    for name in own.robot.joint_names:
        np.testing.assert_allclose(run.joint(name).position, own.joint(name).position, atol=1e-8)
    fingers = [run.joint(f"panda_finger_joint{k}").position for k in (1, 2)]
    np.testing.assert_allclose(fingers[1], fingers[0], atol=1e-14)


def test_the_multiplier_of_a_drive_is_the_torque_of_inverse_dynamics_and_its_power_is_work(folder):
    motion = {"kind": "waypoints", "times": [0, 1, 2], "positions": [
        {"shoulder": 0.1, "elbow": 0.5, "slide": 0.1}, {"shoulder": 0.6, "elbow": 1.0, "slide": 0.3},
        {"shoulder": 0.2, "elbow": 0.4, "slide": 0.2}]}  # fmt: skip
    drives = [
        {"name": name, "kind": "prescribed_motion", "joint": name, "motion": "go"}
        for name in ("shoulder", "elbow", "slide")
    ]
    guess = {name: {"guess": 0.2} for name in ("shoulder", "elbow", "slide")}
    scene = load_scene(
        folder / "crane.urdf",
        {"gravity": [0, 0, -9.81], "motions": {"go": motion}, "constraints": drives, "initial": guess},
    )
    run = simulate(scene, 2.0, samples=201)
    there = [scene.motion("go").at(t) for t in run.time]
    q, v, a = (np.array([x[k] for x in there]) for k in range(3))
    np.testing.assert_allclose(run.position, q, atol=1e-12)
    expected = scene.robot.inverse_dynamics(q, v, a)
    inner = slice(5, -5)  # at rest before and after: accelerations jump at the ends
    np.testing.assert_allclose(run.multipliers[inner], expected[inner], atol=1e-6 * np.abs(expected).max())
    assert np.ptp(run.work) > 1.0
    assert run.energy_drift() < 1e-7
    assert [label for _, label in system_of(scene).multiplier_names] == ["[N m]", "[N m]", "[N]"]


def test_formulas_and_python_functions_close_loops_as_the_kinds_do(four_bar):
    times = np.linspace(0, 8, 9)
    usual = simulate(four_bar, 8, times=times)
    rows = [
        {
            "name": c,
            "kind": "expression",
            "unit": "m",
            "expression": f"frame('coupler_tip').{c} - frame('rocker_tip').{c}",
        }
        for c in "xy"
    ]
    bare = four_bar.with_overrides({"constraints": rows, "events": []})
    formula = simulate(bare, 8, times=times)
    np.testing.assert_allclose(formula.position, usual.position, atol=1e-9)
    np.testing.assert_allclose(formula.multipliers, usual.multipliers, rtol=1e-7)
    assert formula.constraint("x").labels == ("force [N]",)

    def apex(s):
        return (s.frame("coupler_tip").position - s.frame("rocker_tip").position)[:2]

    own = four_bar.with_overrides({"constraints": [], "events": []}).with_constraint(apex, "apex", "m")
    run = simulate(own, 8, times=times, overrides={"simulate.rtol": 1e-11})
    np.testing.assert_allclose(run.position, usual.position, atol=1e-8)
    with pytest.raises(InputError, match="constraint 'apex' is a Python function, which no file can hold"):
        run.save("run.npz")


def test_a_formula_of_velocities_is_non_holonomic_and_keeps_what_a_coupling_keeps(folder):
    start = {"shoulder": 0.3, "elbow": 0.2, "slide": 0.1, "velocity": {"elbow": 0.4}}
    rolling = {
        "name": "belt",
        "kind": "expression",
        "unit": "rad/s",
        "expression": "shoulder.velocity - 2 * elbow.velocity",
    }
    gear = {"name": "belt", "kind": "coupling", "joint_a": "elbow", "joint_b": "shoulder", "ratio": 2, "offset": -0.1}
    runs = [
        simulate(load_scene(folder / "crane.urdf", {"constraints": [c], "initial": start}), 1.0)
        for c in (rolling, gear)
    ]
    np.testing.assert_allclose(runs[0].position, runs[1].position, atol=1e-7)
    np.testing.assert_allclose(runs[0].multipliers, runs[1].multipliers, atol=1e-4)
    assert runs[0].velocity_residual() < 1e-12


# ---- stabilisation


def test_without_stabilisation_the_constraint_drifts_and_gains_or_projection_keep_it(four_bar):
    runs = {
        name: simulate(four_bar, 10.0, rtol=1e-6, atol=1e-6, stabilisation=how)
        for name, how in {
            "none": "none", "projection": "projection", "gains": {"kind": "baumgarte", "alpha": 20, "beta": 20},
            "auto": {"kind": "baumgarte", "gains": "auto"},
        }.items()
    }  # fmt: skip
    apart = {name: run.constraint_residual() for name, run in runs.items()}
    assert apart["projection"] < 1e-12 and runs["projection"].velocity_residual() < 1e-12
    assert apart["none"] > 1e-8
    assert apart["gains"] < apart["none"]
    auto = runs["auto"].settings.stabilisation
    assert auto.auto and auto.alpha == auto.beta > 0.0


def test_stabilisation_is_read_from_the_scene_and_from_the_call():
    read = {
        "projection": Stabilisation("projection"), "none": Stabilisation("none"),
        ("baumgarte", 3, 4): Stabilisation("baumgarte", 3.0, 4.0),
    }  # fmt: skip
    for given, expected in read.items():
        value = given if isinstance(given, str) else dict(zip(("kind", "alpha", "beta"), given, strict=True))
        assert linkage({"simulate.stabilisation": value}).settings.stabilisation == expected
        assert stabilisation(value) == Settings(stabilisation=value).stabilisation == expected
    assert stabilisation({"kind": "baumgarte", "gains": "auto"}).auto


# ---- events, latch and reports


def test_the_four_bar_locks_when_where_and_with_the_forces_of_the_reference(four_bar):
    run = simulate(four_bar, rtol=1e-11, atol=1e-11)
    lock = run.events[-1]
    assert lock.name == "lock" and lock.stopped and lock.latch is None and lock.energy_lost == 0.0
    assert abs(lock.time - LOCK_TIME) < 1e-7
    assert abs(lock.position[0] - LOCK_ANGLE) < 1e-8
    assert abs(np.linalg.norm(lock.multipliers) - LOCK_FORCE) < 1e-6 * LOCK_FORCE + 0.005
    assert run.constraint("apex").labels == ("x [N]", "y [N]")


def test_a_latch_takes_all_the_kinetic_energy_out_of_the_four_bar(four_bar, tmp_path):
    run = simulate(four_bar, rtol=1e-11, atol=1e-11, overrides={"events.lock.latch": True})
    lock = run.events[-1]
    assert abs(lock.energy_lost - LOCK_ENERGY) < 1e-6
    assert abs(lock.energy_lost - run.kinetic_energy[-1]) < 1e-9
    assert np.abs(lock.latch.velocity).max() < 1e-12 and lock.latch.unit == "N m s"
    assert "energy lost 4.76807917 J" in run.table()
    again = load_run(run.save(tmp_path / "run.npz"))
    assert again.events[-1].energy_lost == lock.energy_lost and again.events[-1].impulse == lock.impulse
    assert np.array_equal(again.events[-1].multipliers, lock.multipliers)


def test_a_latch_at_a_joint_is_the_plastic_impact_of_the_other_joints(folder):
    stop = {"name": "end", "when": {"joint": "elbow", "position": 0.6}, "latch": True}
    start = {"elbow": 0.2, "velocity": {"elbow": 1.0, "shoulder": 0.5}}
    run = simulate(load_scene(folder / "crane.urdf", {"initial": start, "events": [stop], "gravity": [0, 0, 0]}), 2.0)
    end = run.events[-1]
    mass = np.array(pin.crba(run.robot.model, run.robot.model.createData(), end.position))
    mass = np.triu(mass) + np.triu(mass, 1).T
    free = [0, 2]
    after = np.zeros(3)  # the momenta of the joints that stay free are kept
    after[free] = np.linalg.solve(mass[np.ix_(free, free)], (mass @ end.velocity)[free])
    np.testing.assert_allclose(end.latch.velocity, after, atol=1e-9)
    assert end.impulse == pytest.approx((mass @ (after - end.velocity))[1], rel=1e-9)
    lost = 0.5 * end.velocity @ mass @ end.velocity - 0.5 * after @ mass @ after
    assert end.energy_lost == pytest.approx(lost, rel=1e-9) and end.stopped


def test_closeness_to_singular_is_the_ratio_of_singular_values_and_can_end_a_run(four_bar):
    event = [{"name": "near", "when": {"singular_constraints": 0.05}, "direction": "up", "stop": True}]
    run = simulate(four_bar, overrides={"events": event})
    near = run.events[-1]
    jacobian, mass = system_of(run.scene).constraint_metric(
        np.array([near.time]), np.concatenate([near.position, near.velocity]), np.zeros(0), run.parameters
    )
    values = np.linalg.svd(np.linalg.solve(np.linalg.cholesky(mass), jacobian.T), compute_uv=False)
    assert values[1] / values[0] == pytest.approx(0.05, rel=1e-6)


def test_a_disk_that_is_lifted_ends_the_run_where_its_normal_force_vanishes():
    lift = {"forces": [{"kind": "spring", "frame_a": "disk", "frame_b": "world", "point": [0, 0, 0.6],
                        "free_length": 0.5, "stiffness": 22}],
            "base": {"rpy": [0, 0, 0], "angular_velocity": [0, 40, 0], "expressed_in": "body"},
            "outputs": {}}  # fmt: skip
    run = simulate("rolling_disk", 5.0, overrides=lift)
    lost = run.events[-1]
    assert lost.name == "floor contact lost" and lost.stopped and run.time[-1] < 5.0
    assert abs(lost.multipliers[0]) < 1e-8 < run.constraint("floor").multipliers[0, 0]
    railed = simulate("rolling_disk", 5.0, overrides=lift | {"constraints.floor.two_sided": True})
    assert railed.constraint("floor").multipliers[:, 0].min() < 0.0 and not railed.events
    with pytest.raises(InputError, match="'floor' is not in contact at the start: its plane would have to pull by"):
        simulate("rolling_disk", 1.0, overrides=lift | {"gravity": [0, 0, 9.81]})


def test_a_constraint_written_twice_shares_its_force_and_the_summary_says_so(four_bar, tmp_path):
    once = simulate(four_bar, 5.0)
    twin = {"name": "twin", "kind": "point", "frame_a": "coupler_tip", "frame_b": "rocker_tip"}
    both = simulate(four_bar, 5.0, overrides={"constraints": [*four_bar.data["constraints"], twin], "events": []})
    np.testing.assert_allclose(both.position, once.position, atol=1e-8)
    np.testing.assert_allclose(both.constraint("twin").multipliers, once.constraint("apex").multipliers / 2, rtol=1e-5)
    assert "rank 2 of 4 rows" in both.table() and "unique are none" in both.table()
    assert "not unique" not in once.table()
    header = once.to_csv(tmp_path / "run.csv").read_text().splitlines()[0]
    assert "apex x [N],apex y [N],apex residual [m or rad]" in header
    titles = [axis.get_title(loc="left") for axis in both.plot().axes]
    assert "multiplier" in titles and {"constraint position residual", "constraint velocity residual"} <= set(titles)
    stored = np.load(once.save(tmp_path / "run.npz"))
    assert np.array_equal(stored["multipliers"], once.multipliers)


def test_output_of_a_constraint_and_its_parameter(folder):
    rod = {"name": "rod", "kind": "distance", "frame_a": "tip", "frame_b": "base", "length": 1.6}
    scene = load_scene(
        folder / "crane.urdf",
        {"constraints": [rod], "outputs": {"push": {"constraint": "rod"}}, "initial": {"elbow": {"guess": 1.0}},
         "parameters": {"reach": {"value": 1.6, "sets": ["constraint.rod.length"]}}},
    )  # fmt: skip
    run, longer = simulate(scene, 0.5), simulate(scene, 0.5, overrides={"reach": 1.7})
    np.testing.assert_allclose(run.output("push"), run.multipliers[:, 0], atol=1e-10)
    assert run.scene.outputs["push"].labels == ("push push [N]",)
    again = {"constraints": [rod], "outputs": {"rod": {"constraint": "rod"}}, "initial": {"elbow": {"guess": 1.0}}}
    same = simulate(folder / "crane.urdf", 0.1, overrides=again)
    header = same.to_csv(folder / "crane.csv").read_text().splitlines()[0].split(",")
    assert len(set(header)) == len(header) and {"rod push [N]", "rod: rod push [N]"} <= set(header)
    for each, length in ((run, 1.6), (longer, 1.7)):
        assert np.abs(np.linalg.norm(each.frame("tip").position, axis=1) - length).max() < 1e-12


# ---- loops of other tools' files


MJCF = """<mujoco><worldbody><body name="ground">
<body name="crank_link"><joint name="crank" axis="0 0 1"/><inertial pos="1.2 0 0" mass="20" diaginertia="1 1 1"/>
<body name="coupler_link" pos="1.241 0 0"><joint name="coupler" axis="0 0 1"/>
<inertial pos="0.6 0 0" mass="8" diaginertia="1 1 1"/></body></body>
<body name="rocker_link" pos="1.241 0 0"><joint name="rocker" axis="0 0 1"/>
<inertial pos="0.6 0 0" mass="8" diaginertia="1 1 1"/></body></body></worldbody>
<equality><connect name="apex" body1="coupler_link" body2="rocker_link" anchor="1.2 0 0"/></equality></mujoco>"""
SDF = """<sdf version="1.6"><model name="four_bar"><link name="ground"/><link name="crank_link"/>
<link name="coupler_link"><pose>1.241 0 0 0 0 0</pose></link>
<link name="rocker_link"><pose>1.241 0 0 0 0 0</pose></link>
<joint name="crank" type="revolute"><parent>ground</parent><child>crank_link</child>
<axis><xyz>0 0 1</xyz></axis></joint>
<joint name="coupler" type="revolute"><parent>crank_link</parent><child>coupler_link</child>
<axis><xyz>0 0 1</xyz></axis></joint>
<joint name="rocker" type="revolute"><parent>ground</parent><child>rocker_link</child>
<axis><xyz>0 0 1</xyz></axis></joint>
<joint name="apex" type="revolute"><pose>1.2 0 0 0 0 0</pose><parent>rocker_link</parent><child>coupler_link</child>
<axis><xyz>0 0 1</xyz></axis></joint></model></sdf>"""
GEPETTO = "closed_loop: [[coupler_tip, rocker_tip]]\ntype: ['3d']\nname_mot: [crank]\n"
FOREIGN = {"mjcf": ("loops.xml", MJCF), "sdf": ("loops.sdf", SDF), "gepetto": ("loops.yaml", GEPETTO)}


@pytest.fixture
def beside(tmp_path, four_bar):
    """The four-bar's files in one folder, its constraint from a file of another tool."""

    def write(kind, text=None):
        name, usual = FOREIGN[kind]
        (tmp_path / name).write_text(text or usual)
        data = four_bar.data | {"constraints": [{"kind": kind, "file": name}], "urdf": "four_bar"}
        kept = {k: v for k, v in data.items() if k not in ("name", "actuated")}
        (tmp_path / "scene.yaml").write_text(json.dumps(kept))
        return tmp_path / "scene.yaml"

    return write


@pytest.mark.tier2
@pytest.mark.parametrize("kind", FOREIGN)
def test_loops_beside_a_urdf_close_the_four_bar(beside, kind, four_bar, tmp_path):
    scene = load_scene(beside(kind))
    run, own = simulate(scene), simulate(four_bar)
    assert abs(run.events[-1].time - own.events[-1].time) < 1e-8
    assert [c.name for c in scene.constraints] == [f"{kind}_1"]
    again = load_run(run.save(tmp_path / "run.npz"))
    assert np.array_equal(again.multipliers, run.multipliers)


def test_gepettos_yaml_says_which_joints_have_motors(tmp_path):
    (tmp_path / "robot.yaml").write_text("closed_loop: [[a, b], [c, d]]\ntype: [6D, 3d]\nname_mot: [m1, m2]\n")
    found = read_gepetto(tmp_path / "robot.yaml")
    assert found.loops == (("a", "b", "6d"), ("c", "d", "3d")) and found.motors == ("m1", "m2")


def test_motors_of_gepettos_yaml_are_those_that_are_sized_unless_the_scene_names_others(beside):
    scene = beside("gepetto")
    assert load_scene(scene).config.actuated == ("crank",)
    unfold = {"kind": "waypoints", "times": [0, 1], "positions": [{"crank": 0.1}, {"crank": 0.2}]}
    data = json.loads(scene.read_text()) | {"motions": {"unfold": unfold}}
    for given, motor in (({}, "crank"), ({"actuated": ["rocker"]}, "rocker")):
        scene.write_text(json.dumps(data | given))
        assert scene_inverse_dynamics(scene, "unfold").actuated == (motor,)
    with pytest.raises(InputError, match="name_mot: unknown joint 'crnk'; did you mean 'crank'"):
        load_scene(beside("gepetto", GEPETTO.replace("[crank]", "[crnk]")))


def test_a_coupling_of_joints_in_mjcf_is_read_with_its_sign(beside):
    equality = '<equality><joint joint1="rocker" joint2="crank" polycoef="0.5 2 0 0 0"/></equality>'
    scene = load_scene(beside("mjcf", re.sub("<equality>.*</equality>", equality, MJCF)), {"events": []})
    (gear,) = scene.constraints
    assert (gear.joint_a.name, gear.joint_b.name, gear.ratio, gear.offset) == ("crank", "rocker", 2.0, 0.5)


@pytest.mark.parametrize(
    ("kind", "old", "new", "message"),
    [
        ("gepetto", "3d", "4d", "unknown type '4d'"),
        ("gepetto", "rocker_tip", "rocker_top", "unknown frame 'rocker_top'; did you mean 'rocker_tip'"),
        ("gepetto", "['3d']", "[3d, 6d]", "expected one of 3d and 6d for each of the 1 loops"),
        ("gepetto", "name_mot", "joint_name: [x]\nname_mot", "expected a type for each of the 1 joints"),
        ("gepetto", "[[coupler_tip, rocker_tip]]", "[coupler_tip]", "expected a list of pairs of frames"),
        (
            "mjcf",
            'pos="1.241 0 0"><joint name="rocker"',
            'pos="1 0 0"><joint name="rocker"',
            "differs from four_bar.urdf",
        ),
        ("mjcf", "<mujoco>", "<mujoco", "not well-formed"),
        ("mjcf", "<mujoco>", "<sdf><mujoco>", "expected a file with the root element <mujoco>, found <sdf>"),
        ("mjcf", "<mujoco>", "<!DOCTYPE m [<!ENTITY a 'b'>]><mujoco>", "declares an XML entity"),
        ("mjcf", "<mujoco>", "<?xml version='1.0' encoding='rot13'?><mujoco>", "is not text in the encoding rot13"),
        ("sdf", "<sdf ", "<?xml version='1.0' encoding='utf-32'?><sdf ", "is not text in the encoding utf-32"),
        ("mjcf", 'joint name="rocker"', 'joint name="swing"', "unknown joint 'swing'"),
        (
            "mjcf",
            "</equality>",
            "<tendon/></equality>",
            "the constraint <tendon> under <equality> is not modelled",
        ),
        ("sdf", 'name="apex" type="revolute"', 'name="apex" type="screw"', "joint 'apex' has no <screw_thread_pitch>"),
        ("sdf", "<pose>1.2 ", "<pose>one ", "line 10: joint 'apex', <pose>: expected numbers"),
        (
            "sdf",
            '<joint name="apex" type="revolute"><pose>1.2 0 0 0 0 0</pose><parent>rocker_link</parent><child>coupler_',
            '<link name="tip_link"/><joint name="apex" type="revolute"><parent>rocker_link</parent><child>tip_',
            "no closed loops found",
        ),
    ],
)
def test_a_broken_file_of_loops_is_named(beside, kind, old, new, message):
    text = FOREIGN[kind][1]
    assert old in text
    with pytest.raises(InputError, match=re.escape(message)):
        load_scene(beside(kind, text.replace(old, new)))


# ---- entries that are wrong

APEX = {"name": "apex", "kind": "point", "frame_a": "coupler_tip", "frame_b": "rocker_tip"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"constraints": [APEX | {"kind": "pin"}]}, "constraints[1].kind: unknown kind 'pin'"),
        ({"constraints": [APEX | {"frame_a": "coupler_top"}]}, "unknown frame 'coupler_top'; did you mean"),
        ({"constraints": [APEX | {"frame_b": "coupler_tip"}]}, "expected two different frames, found 'coupler"),
        ({"constraints": [APEX | {"point": [0, 0, 0]}]}, "'point' is only used with 'frame_b: world'"),
        ({"constraints": [APEX | {"radius": 1}]}, "unknown key 'radius'"),
        ({"constraints": [APEX, APEX]}, "the name 'apex' is taken by entry 1"),
        ({"constraints": [APEX | {"kind": "hinge", "axis": [0, 0, 0]}]}, "expected a direction"),
        ({"constraints": [APEX | {"kind": "distance", "length": -1}]}, "expected more than 0 m"),
        ({"constraints": [APEX | {"kind": "distance"}]}, "the key 'length' is missing"),
        (
            {"constraints": [{"kind": "coupling", "joint_a": "crank", "joint_b": "crank", "ratio": 1}]},
            "expected two different joints, found 'crank' twice",
        ),
        ({"constraints": [{"kind": "coupling", "joint_a": "crank", "joint_b": "rocket", "ratio": 1}]}, "'rocket'"),
        ({"constraints": [{"kind": "prescribed_motion", "joint": "crank", "motion": "go"}]}, "unknown motion 'go'"),
        ({"constraints": [{"kind": "rolling_disk", "frame": "ground", "radius": "5 kg"}]}, "expected a length in m"),
        ({"constraints": [{"kind": "expression", "expression": "crank.position +"}]}, "is not an expression"),
        ({"constraints": [{"kind": "expression", "expression": "crank.acceleration"}]}, "velocities, not of acc"),
        ({"constraints": [{"kind": "expression", "expression": "crack.position"}]}, "unknown joint 'crack'"),
        ({"constraints": [{"kind": "gepetto", "file": "none.yaml"}]}, "none.yaml"),
        ({"constraints": APEX}, "expected a list of mappings"),
        ({"simulate.stabilisation": "baumgarte"}, "baumgarte requires gains"),
        ({"simulate.stabilisation": {"kind": "baumgarte"}}, "the key 'alpha' is missing"),
        ({"simulate.stabilisation": {"kind": "baumgarte", "gains": "auto", "alpha": 1}}, "found both"),
        ({"simulate.stabilisation": {"kind": "baumgarte", "alpha": -1, "beta": 1}}, "expected 0 1/s or more"),
        ({"simulate.stabilisation": "projektion"}, "did you mean 'projection'"),
        ({"simulate.stabilisation": {"kind": "none", "alpha": 1}}, "unknown key 'alpha'"),
        ({"events.lock.when": {"aligned": {"joint_a": "crank", "joint_b": "crank"}}}, "two different joints, found"),
        ({"events.lock.when": {"aligned": {"joint_a": "crank", "joint_b": "coupler"}}}, "expected one constraint betw"),
        ({"events.lock.when": {"aligned": {"joint_a": "coupler", "joint_b": "rocker", "constraint": "x"}}}, "loop 'x'"),
        ({"events.lock.when": {"contact_lost": "apex"}}, "unknown rolling disk 'apex'"),
        ({"events.lock.when": {"singular_constraints": 2}}, "expected at most 1"),
        ({"events.lock.when": {"singular_constraints": 0.1}, "constraints": []}, "the scene has no constraints"),
        ({"events.lock.when": {"singular_constraints": 0.1, "joint": "crank"}}, "expected one condition"),
        ({"events.lock.when": {"joint": "crank", "velocity": 1}, "events.lock.latch": True}, "found a velocity"),
        ({"events.lock.latch": True, "events.lock.stop": False}, "an event that latches ends the simulation"),
        ({"outputs.force": {"constraint": "base"}}, "unknown constraint 'base'"),
        ({"outputs.force": {"constraint": "apex", "what": "contact_point"}}, "'contact_point' requires a rolling disk"),
        ({"outputs.force": {"force": "apex"}}, "unknown force or controller 'apex'"),
        ({"parameters.x": {"value": 1, "sets": ["constraint.apex.length"]}}, "constraint 'apex': unknown field 'len"),
    ],
)  # fmt: skip
def test_a_wrong_constraint_event_or_setting_is_named(changes, message):
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        linkage(changes)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("constraints", "message"),
    [
        ([{"kind": "expression", "expression": "crank.velocity ** 2 - 1"}], "must be linear in velocities"),
        ([APEX, {"kind": "expression", "expression": "frame('coupler_tip').z - 1"}], "cannot hold"),
        ([APEX, {"kind": "expression", "expression": "crank.position - 2"}], "cannot be satisfied with crank held"),
    ],
)
def test_constraints_that_cannot_hold_end_in_one_sentence(constraints, message):
    with pytest.raises(InputError, match=re.escape(message)):
        simulate(linkage({"constraints": constraints, "events": []}), 1.0)


def test_functions_that_are_no_constraints_are_refused(four_bar):
    for function, message in (
        (lambda s: "crank", "must return a column of casadi.SX"),
        (lambda s: s.v[0] ** 2, "must be linear in velocities"),
        (lambda s: casadi.SX.sym("x"), "which is not a symbol of the scene"),
    ):
        with pytest.raises(InputError, match=re.escape(message)):
            four_bar.with_constraint(function)
    with pytest.raises(InputError, match="the name 'apex' is taken"):
        four_bar.with_constraint(lambda s: s.q[0], "apex")


@pytest.mark.tier2
def test_two_wheels_on_one_axle_share_their_side_force_and_nothing_else(tmp_path):
    wheel = (
        '<link name="{0}"><inertial><mass value="1"/>'
        '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/>'
        '</inertial></link><joint name="spin_{0}" type="continuous"><parent link="axle"/><child link="{0}"/>'
        '<origin xyz="0 {1} 0"/><axis xyz="0 1 0"/></joint>'
    )
    axle = (
        '<link name="axle"><inertial><origin xyz="0.02 0 0"/><mass value="5"/>'
        '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.1"/></inertial></link>'
    )
    urdf = f'<robot name="cart">{axle}{wheel.format("left", 0.4)}{wheel.format("right", -0.4)}</robot>'
    (tmp_path / "cart.urdf").write_text(urdf)
    wheels = [{"name": name, "kind": "rolling_disk", "frame": name, "radius": 0.2} for name in ("left", "right")]
    base = {"position": [0, 0, 0.2], "linear_velocity": [1, 0, 0], "expressed_in": "body"}
    scene = load_scene(tmp_path / "cart.urdf", {"floating_base": True, "constraints": wheels, "base": base})
    run = simulate(scene, 1.0)
    rank = run.constraint_rank()
    assert rank.rank == 5
    names = [f"{owner} {label}" for owner, label in system_of(scene).multiplier_names]
    shared = {name for name, unique in zip(names, rank.unique, strict=True) if not unique}
    assert shared == {"left friction sideways [N]", "right friction sideways [N]"}
    weight = run.constraint("left").multipliers[0, 0] + run.constraint("right").multipliers[0, 0]
    assert weight == pytest.approx(7 * 9.81, rel=0.3)
    assert run.energy_drift() < 1e-7 and run.velocity_residual() < 1e-12


def test_lengths_and_angles_that_constraints_are_apart_stand_apart_with_their_units(four_bar):
    assert set(simulate(four_bar, 0.1).constraint_residuals) == {"m", "m/s"}
    ring = simulate(load_scene("bricard"), 0.5, overrides={"simulate.stabilisation": {"kind": "none"}})
    found = ring.constraint_residuals
    assert set(found) == {"m", "rad", "m/s", "rad/s"}
    (constraint,) = (ring.constraint(constraint.name) for constraint in ring.scene.constraints)
    assert np.array_equal(np.maximum(found["m"], found["rad"]), constraint.residual)
    assert np.array_equal(np.maximum(found["m/s"], found["rad/s"]), constraint.velocity_residual)
    assert found["m"].max() > 0.0 and found["rad"].max() > 0.0


def test_the_rank_of_no_constraints_is_zero():
    found = simulate("pendulum", duration=0.1, samples=3).constraint_rank()
    assert found.rank == 0 and found.singular_values.shape == found.unique.shape == (0,)
