"""Closed-chain inverse dynamics, and sizing of linkages, against springs, drives, power balances and closed forms."""

import json

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.dynamics.equations.system import system_of
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.inverse.scene_inverse_dynamics import scene_inverse_dynamics
from bellcrank.motion.motion import Motion

FOUR_BAR = """
name: Four-bar
urdf: four_bar
gravity: {gravity}
frames:
  coupler_tip: {{link: coupler_link, xyz: [1.2, 0, 0]}}
  rocker_tip: {{link: rocker_link, xyz: [1.2, 0, 0]}}
constraints:
  - {{name: apex, kind: point, frame_a: coupler_tip, frame_b: rocker_tip}}
initial: {{crank: 20 deg, coupler: {{guess: 340 deg}}, rocker: {{guess: 20 deg}}}}
actuated: [crank]
motions:
  unfold: {{kind: waypoints, times: [0, 4], positions: [{{crank: 20 deg}}, {{crank: 140 deg}}], samples: 201}}
  rocking: {{kind: waypoints, times: [0, 4], positions: [{{rocker: 20 deg}}, {{rocker: 60 deg}}], samples: 51}}
  circle: {{kind: circle, frame: coupler_tip, center: [1.2, 1.2, 0], radius: 0.1, duration: 4, samples: 41,
            start: {{crank: 90 deg, coupler: -90 deg}}}}
  too_far: {{kind: waypoints, times: [0, 4], positions: [{{crank: 20 deg}}, {{crank: 160 deg}}], samples: 51}}
"""
SPRING = [{"name": "spring", "kind": "joint_spring", "joint": "crank", "preload": 1.96, "stiffness": 0.1}]

# Two cranks of 0.2 m on bearings 0.16 m apart, two forearms of 0.3 m that meet at the tip, in a vertical plane.
CRANK, FOREARM, HALF = 0.2, 0.3, 0.08


def five_bar_urdf(crank_mass, forearm_mass, tip_mass):
    """A five-bar linkage as a tree: left crank and forearm (with a tool at its tip), right crank and forearm."""

    def inertial(mass, length):
        inertia = mass * length**2 / 12.0
        return (
            f'<inertial><origin xyz="{length / 2} 0 0"/><mass value="{mass}"/>'
            f'<inertia ixx="{inertia}" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/></inertial>'
        )

    text = '<robot name="five_bar"><link name="ground"/>'
    for side, x in (("left", -HALF), ("right", HALF)):
        text += f'<link name="{side}_crank">{inertial(crank_mass, CRANK)}</link>'
        text += f'<link name="{side}_forearm">{inertial(forearm_mass, FOREARM)}</link>'
        for joint, parent, child, at in (
            ("shoulder", "ground", f"{side}_crank", x),
            ("elbow", f"{side}_crank", f"{side}_forearm", CRANK),
        ):
            text += (
                f'<joint name="{side}_{joint}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
                f'<origin xyz="{at} 0 0"/><axis xyz="0 0 1"/></joint>'
            )
    tool = f'<inertial><mass value="{tip_mass}"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    text += f'<link name="tool">{tool}</link><joint name="flange" type="fixed"><parent link="left_forearm"/>'
    return text + f'<child link="tool"/><origin xyz="{FOREARM} 0 0"/></joint></robot>'


FIVE_BAR = """
name: Five-bar
urdf: five_bar.urdf
gravity: [0, -9.81, 0]
frames:
  right_tip: {link: right_forearm, xyz: [0.3, 0, 0]}
constraints:
  - {name: tip, kind: point, frame_a: tool, frame_b: right_tip}
initial: {left_shoulder: 130 deg, right_shoulder: 50 deg, left_elbow: {guess: -80 deg}, right_elbow: {guess: 80 deg}}
actuated: [left_shoulder, right_shoulder]
motions:
  circle: {kind: circle, frame: tool, center: [0.02, 0.33, 0], radius: 0.05, duration: 2, profile: quintic,
           samples: 201, start: {left_shoulder: 130 deg, left_elbow: -80 deg}}
  swing: {kind: waypoints, times: [0, 1], positions: [{left_shoulder: 130 deg, right_shoulder: 50 deg},
          {left_shoulder: 150 deg, right_shoulder: 60 deg}], samples: 101}
"""


def four_bar(folder, gravity="[0, -9.81, 0]"):
    path = folder / "linkage.yaml"
    path.write_text(FOUR_BAR.format(gravity=gravity))
    return bc.load_scene(path)


def five_bar(folder, crank_mass=0.4, forearm_mass=0.3, tip_mass=2.0):
    (folder / "five_bar.urdf").write_text(five_bar_urdf(crank_mass, forearm_mass, tip_mass))
    (folder / "five_bar.yaml").write_text(FIVE_BAR)
    return bc.load_scene(folder / "five_bar.yaml")


def motion_of(run):
    return Motion(run.robot.joints, run.time, run.position, run.velocity, run.acceleration, "run")


@pytest.mark.tier2
def test_the_motor_that_repeats_the_free_unfolding_is_the_spring(tmp_path):
    scene = four_bar(tmp_path, "[0, 0, 0]")
    sprung = scene.with_overrides({"forces": SPRING, "initial.crank": "1 deg"})
    run = bc.simulate(sprung, duration=12.0, rtol=1e-12, atol=1e-12, samples=201)
    found = scene_inverse_dynamics(scene.with_overrides({"initial.crank": "1 deg"}), motion_of(run))
    assert found.independent == ("crank",) and found.redundancy == 0
    np.testing.assert_allclose(found.motor("crank"), 1.96 - 0.1 * run.position[:, 0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.position, run.position, rtol=0, atol=1e-10)
    np.testing.assert_allclose(found.acceleration, run.acceleration, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.multipliers, run.multipliers, rtol=1e-8, atol=1e-9)
    # with the spring in place the motor has nothing to do
    idle = scene_inverse_dynamics(sprung, motion_of(run))
    assert np.abs(idle.torque).max() < 1e-8 and np.array_equal(idle.position, found.position)


@pytest.mark.tier2
def test_a_drive_constraint_s_multiplier_is_the_motor_s_torque(tmp_path):
    scene = four_bar(tmp_path)
    found = scene_inverse_dynamics(scene, "unfold")
    constraints = [
        *scene.data["constraints"],
        {"name": "motor", "kind": "prescribed_motion", "joint": "crank", "motion": "unfold"},
    ]
    driven = scene.with_overrides(
        {"constraints": constraints, "simulate": {"duration": 4.0, "rtol": 1e-11, "atol": 1e-11}}
    )
    run = bc.simulate(driven, times=found.time[5:-5])
    place = system_of(run.scene).multiplier_names.index(("motor", "[N m]"))
    np.testing.assert_allclose(run.multipliers[:, place], found.torque[5:-5, 0], rtol=0, atol=1e-5)
    np.testing.assert_allclose(run.position, found.position[5:-5], rtol=0, atol=1e-8)
    # and such a scene says by itself where the motor is, its drive taken away
    again = scene_inverse_dynamics(driven, "unfold")
    assert again.actuated == ("crank",) and np.array_equal(again.torque, found.torque)


def test_motor_power_is_the_rate_of_the_linkage_s_energy(tmp_path):
    scene = four_bar(tmp_path)
    found = scene_inverse_dynamics(scene, "unfold")
    kinetic, potential = scene.robot.energy(found.position, found.velocity)
    from scipy.interpolate import make_interp_spline

    work = make_interp_spline(found.time, found.power, k=5).antiderivative()(found.time)
    energy = kinetic + potential
    np.testing.assert_allclose(energy - energy[0], work, rtol=0, atol=1e-6 * np.abs(work).max())
    assert found.constraint_residual() < 1e-12 and found.equation_residual() < 1e-13
    rate = np.gradient(found.position, found.time, axis=0, edge_order=2)
    np.testing.assert_allclose(rate, found.velocity, atol=1e-3)


def test_passive_hinges_pass_no_moment_about_their_axes_and_bearings_carry_the_weight(tmp_path):
    scene = four_bar(tmp_path)
    found = scene_inverse_dynamics(scene, "unfold")
    names = list(scene.robot.all_joint_names)
    wrench = found.reactions
    np.testing.assert_allclose(wrench[:, names.index("crank"), 5], found.motor("crank"), rtol=0, atol=1e-9)
    for passive in ("coupler", "rocker"):
        np.testing.assert_allclose(wrench[:, names.index(passive), 5], 0.0, atol=1e-9)
    # both bearings on the ground together: the change of momentum, and the weight of 36.65 kg
    total = np.zeros((len(found.time), 3))
    for bearing in ("crank", "rocker"):
        turn = scene.robot.frame_pose(bearing, found.position)[1]
        total += np.einsum("nij,nj->ni", turn, wrench[:, names.index(bearing), :3])
    np.testing.assert_allclose(total[[0, -1], 1], 36.65 * 9.81, rtol=0.05)
    at_rest = bc.waypoints(scene.robot, [0.0, 1e4], [{"crank": 1.0}, {"crank": 1.0001}], samples=5)
    slow = scene_inverse_dynamics(scene, at_rest)
    held = np.zeros(3)
    for bearing in ("crank", "rocker"):
        turn = scene.robot.frame_pose(bearing, slow.position[2])[1]
        held += turn @ slow.reactions[2, names.index(bearing), :3]
    np.testing.assert_allclose(held, [0.0, 36.65 * 9.81, 0.0], atol=1e-6)


def test_any_joint_may_lead_and_any_may_carry_the_motor_with_the_same_power(tmp_path):
    scene = four_bar(tmp_path)
    by_rocker = scene_inverse_dynamics(scene, "rocking")
    assert by_rocker.independent == ("rocker",) and by_rocker.actuated == ("crank",)
    motion = by_rocker.motion
    other = scene_inverse_dynamics(scene, motion, actuated=["rocker"])
    np.testing.assert_allclose(other.power, by_rocker.power, atol=1e-8)
    both = scene_inverse_dynamics(scene, motion, actuated=["crank", "rocker"])
    assert both.redundancy == 1
    np.testing.assert_allclose(both.power, by_rocker.power, atol=1e-8)
    effort = (both.torque**2).sum(axis=1)
    for single in (by_rocker, other):  # the least squares of all that do
        assert np.all(effort <= (single.torque**2).sum(axis=1) + 1e-9)


@pytest.mark.tier2
def test_a_five_bar_s_motors_carry_a_tool_on_a_circle_by_the_principle_of_virtual_work(tmp_path):
    found = scene_inverse_dynamics(five_bar(tmp_path, 1e-9, 1e-9, 2.0), "circle")
    assert found.independent == ("left_shoulder", "right_shoulder")  # the motors, by inverse kinematics
    robot = found.mechanism.robot
    tip = robot.frame_pose("tool", found.position)[0][:, :2]
    np.testing.assert_allclose(np.linalg.norm(tip - [0.02, 0.33], axis=1), 0.05, atol=1e-9)
    np.testing.assert_allclose(robot.frame_pose("right_tip", found.position)[0][:, :2], tip, atol=1e-12)
    left, right = (found.position[:, robot.joint(name).q] for name in found.actuated)
    elbows = [
        np.stack([x + CRANK * np.cos(angle), CRANK * np.sin(angle)], axis=1)
        for x, angle in ((-HALF, left), (HALF, right))
    ]
    turns = [CRANK * np.stack([-np.sin(angle), np.cos(angle)], axis=1) for angle in (left, right)]
    arms = [tip - elbow for elbow in elbows]
    for arm in arms:
        np.testing.assert_allclose(np.linalg.norm(arm, axis=1), FOREARM, atol=1e-12)
    # arm·ẋ = arm·(turn θ̇) for either side, so ẋ = A⁻¹ B θ̇ and τ = (A⁻¹ B)ᵀ m (ẍ − g)
    a = np.stack(arms, axis=1)
    b = np.stack([np.diag([(arms[k][n] * turns[k][n]).sum() for k in (0, 1)]) for n in range(len(tip))])
    jacobian = np.linalg.solve(a, b)
    u = found.time / 2.0  # s = S (10 u³ − 15 u⁴ + 6 u⁵)
    length = 2.0 * np.pi * 0.05
    phase = length / 0.05 * (10.0 * u**3 - 15.0 * u**4 + 6.0 * u**5)
    speed = length * (30.0 * u**2 - 60.0 * u**3 + 30.0 * u**4) / 2.0
    growth = length * (60.0 * u - 180.0 * u**2 + 120.0 * u**3) / 4.0
    along = np.stack([-np.sin(phase), np.cos(phase)], axis=1)
    inward = -np.stack([np.cos(phase), np.sin(phase)], axis=1)
    force = 2.0 * (along * growth[:, None] + inward * (speed**2 / 0.05)[:, None] + [0.0, 9.81])
    expected = np.einsum("nij,ni->nj", jacobian, force)
    np.testing.assert_allclose(found.torque, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


def test_motors_at_all_joints_of_a_five_bar_share_by_least_squares(tmp_path):
    scene = five_bar(tmp_path)
    two = scene_inverse_dynamics(scene, "swing")
    assert two.independent == ("left_shoulder", "right_shoulder")
    names = [joint.name for joint in scene.robot.joints]
    four = scene_inverse_dynamics(scene, "swing", actuated=names)
    assert four.redundancy == 2
    np.testing.assert_allclose(four.power, two.power, atol=1e-9)
    assert np.all((four.torque**2).sum(axis=1) <= (two.torque**2).sum(axis=1))
    # least: orthogonal to every torque that moves nothing, Jᵀ μ
    jacobian = four.mechanism.kinematics.jacobian(four.time, four.position)
    order = [joint.v for joint in four.mechanism.motors]
    np.testing.assert_allclose(np.einsum("nmv,nv->nm", jacobian[:, :, order], four.torque), 0.0, atol=1e-9)


def test_what_a_linkage_cannot_follow_is_said_in_one_sentence(tmp_path):
    scene = four_bar(tmp_path)
    with pytest.raises(bc.UnreachableError, match=r"'too_far' cannot be followed at .* up to crank 2\.6260"):
        scene_inverse_dynamics(scene, "too_far")
    wild = bc.waypoints(scene.robot, [0.0, 1.0], [{}, {"crank": 1e9}], samples=3, name="wild")
    with pytest.raises(bc.UnreachableError, match=r"joint 'crank' moves by 5e\+08 rad, .* to the next; .* more rows"):
        scene_inverse_dynamics(scene, wild)
    with pytest.raises(
        bc.InputError,
        match=r"prescribes 2 coordinates of frame 'coupler_tip', but the mechanism has 1 degree of freedom",
    ):
        scene_inverse_dynamics(scene, "circle")
    with pytest.raises(bc.InputError, match="unknown joint 'crnk'"):
        scene_inverse_dynamics(scene, "unfold", actuated=["crnk"])
    with pytest.raises(bc.InputError, match="did you mean 'unfold'"):
        scene_inverse_dynamics(scene, "unfolds")
    with pytest.raises(bc.InputError, match="no joint of the linkage has a motor"):
        scene_inverse_dynamics(scene, "unfold", overrides={"actuated": []})
    with pytest.raises(bc.InputError, match="actuated leaves out elbow"):
        scene_inverse_dynamics("planar_2r", "elbow_up", actuated=["shoulder"])
    with pytest.raises(bc.InputError, match="rolls"):
        scene_inverse_dynamics("rolling_disk", "any", actuated=["root_joint"])
    other = five_bar(tmp_path)
    with pytest.raises(bc.InputError, match=r"has 2 degrees of freedom and this motion prescribes 1 \(left_shoulder\)"):
        scene_inverse_dynamics(other, "swing", independent=["left_shoulder"])
    with pytest.raises(bc.UnreachableError, match="actuate more joints"):
        scene_inverse_dynamics(other, "swing", actuated=["left_shoulder"])


def test_at_full_stretch_the_crank_is_at_a_dead_point(tmp_path):
    scene = four_bar(tmp_path)
    lock = 2.0 * np.arcsin(2.4 / (2.0 * 1.241))
    to_lock = bc.waypoints(scene.robot, [0.0, 4.0], [{"crank": np.radians(20.0)}, {"crank": lock}])
    with pytest.raises(bc.UnreachableError, match="dead point"):
        scene_inverse_dynamics(scene, to_lock)


# ---- sizing


@pytest.mark.tier2
def test_size_of_a_linkage_is_its_motor_along_its_motions(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    scene = four_bar(tmp_path)
    found = scene_inverse_dynamics(scene, "unfold")
    assert main(["size", "linkage.yaml", "--motion", "unfold", "--out", "sized"]) == 0
    out = capsys.readouterr().out
    report = json.loads((tmp_path / "sized" / "sizing.json").read_text(encoding="utf-8"))
    assert [joint["name"] for joint in report["joints"]] == ["crank"] and "holding torques are the largest" in out
    crank = report["joints"][0]
    assert crank["peaks"]["max_torque"]["value"] == pytest.approx(found.torque.max(), rel=1e-4)
    assert crank["peaks"]["min_torque"]["value"] == pytest.approx(found.torque.min(), rel=1e-4)
    assert crank["peaks"]["max_torque"]["value"] >= found.torque.max()
    potential = scene.robot.energy(found.position, np.zeros_like(found.velocity))[1]
    slope = np.gradient(potential, found.position[:, 0], edge_order=2)[5:-5]
    assert crank["holding"]["torque"] == pytest.approx(np.abs(slope).max(), rel=0.01)
    kinetic = scene.robot.energy(found.position, found.velocity)[0][100]
    inertia = 2.0 * kinetic / found.velocity[100, 0] ** 2
    assert Linkage(scene).inertia(found.time, found.position)[100] == pytest.approx([inertia], rel=1e-9)
    assert crank["peaks"]["largest_inertia"]["value"] >= inertia * (1.0 - 1e-9)
    names = {path.name for path in (tmp_path / "sized").iterdir()}
    assert {"history_unfold.csv", "over_time_unfold.png", "torque_speed.png"} <= names


@pytest.mark.tier2
def test_a_history_or_a_table_of_the_crank_alone_is_a_motion_of_the_linkage(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = four_bar(tmp_path)
    assert main(["size", "linkage.yaml", "--motion", "unfold", "--out", "sized", "--no-plots"]) == 0
    first = scene_inverse_dynamics(scene, "unfold")
    again = scene_inverse_dynamics(scene, "sized/history_unfold.csv")
    np.testing.assert_allclose(again.torque, first.torque, rtol=0, atol=1e-9)
    rows = np.column_stack([first.time, first.position[:, 0], first.velocity[:, 0], first.acceleration[:, 0]])
    header = "time [s],crank position [rad],crank velocity [rad/s],crank acceleration [rad/s^2]"
    np.savetxt(tmp_path / "crank.csv", rows, delimiter=",", header=header, comments="", fmt="%.17g")
    alone = scene_inverse_dynamics(scene, "crank.csv")
    np.testing.assert_allclose(alone.torque, first.torque, rtol=0, atol=1e-9)
    assert main(["size", "linkage.yaml", "--motion", "crank.csv", "--no-plots"]) == 0


@pytest.mark.tier2
def test_heavier_links_and_payloads_make_the_worst_case_of_a_linkage(tmp_path):
    scene = four_bar(tmp_path)
    linkage = Linkage(scene)
    motion = linkage.motion("unfold")
    nominal, worst = bc.size(linkage, motion), bc.size(linkage, motion, mass_tolerance=0.1)
    q, v, a = motion.position, motion.velocity, motion.acceleration
    shares = linkage.link_torques(motion.time, q, v, a)
    torque = linkage.torques(motion.time, q, v, a)[0]
    np.testing.assert_allclose(shares.sum(axis=1), torque, atol=1e-9)
    bound = np.abs(torque) + 0.1 * np.abs(shares).sum(axis=1)
    assert worst.joint("crank").peak_torque == pytest.approx(bound.max(), rel=1e-4)
    assert worst.joint("crank").peak_torque > nominal.joint("crank").peak_torque
    loaded = Linkage(scene, scene.config.robot([bc.Payload(5.0, "coupler_tip")]))
    still = np.zeros_like(v)
    gravity = (loaded.torques(motion.time, q, still, still)[0] - linkage.torques(motion.time, q, still, still)[0])[:, 0]
    height = scene.robot.frame_pose("coupler_tip", q)[0][:, 1]
    lift = np.gradient(5.0 * 9.81 * height, q[:, 0], edge_order=2)
    np.testing.assert_allclose(gravity[5:-5], lift[5:-5], atol=0.05)
