"""Compiled dynamics against Pinocchio's own, and against each other."""

import numpy as np
import pinocchio as pin
import pytest
from example_robots import SOUND
from hypothesis import given, settings
from hypothesis import strategies as st

import bellcrank as bc
from bellcrank.codegen.compile import compiled
from bellcrank.errors import InputError
from bellcrank_bench.measurements.dynamics_speed import random_states


def test_at_least_thirty_example_robots_are_compared():
    assert len(SOUND) >= 50


@pytest.mark.tier2
@pytest.mark.parametrize("name", ["ur5", "panda", "z1"])
def test_forward_dynamics_undoes_inverse_dynamics_with_friction_and_rotor_inertia(name):
    plain = bc.load_robot(name)
    friction = {joint: (0.5, 0.3) for joint in plain.joint_names}
    robot = bc.load_robot(name, friction=friction, rotor_inertia={joint: 0.2 for joint in plain.joint_names})
    q, v, a = random_states(robot, 300)
    back = robot.forward_dynamics(q, v, robot.inverse_dynamics(q, v, a))
    np.testing.assert_allclose(back, a, rtol=1e-9, atol=1e-9)


def test_friction_and_rotor_inertia_add_their_own_terms():
    bare = bc.load_robot("ur5", friction="none")
    friction = {"elbow_joint": (2.0, 5.0)}
    robot = bc.load_robot("ur5", friction=friction, rotor_inertia={"elbow_joint": 0.7})
    q, v, a = random_states(robot, 50)
    extra = robot.inverse_dynamics(q, v, a) - bare.inverse_dynamics(q, v, a)
    k = robot.joint("elbow_joint").v
    expected = np.zeros_like(extra)
    expected[:, k] = 2.0 * v[:, k] + 5.0 * v[:, k] / np.hypot(v[:, k], robot.friction_width) + 0.7 * a[:, k]
    np.testing.assert_allclose(extra, expected, atol=1e-11)
    np.testing.assert_allclose(robot.friction_torque(v) + 0.7 * a * (np.arange(6) == k), expected, atol=1e-12)


@pytest.mark.tier2
def test_mass_matrix_is_the_derivative_of_torque_by_acceleration():
    robot = bc.load_robot("panda", rotor_inertia={"panda_joint2": 0.3})
    q, v, a = random_states(robot, 20)
    mass = robot.mass_matrix(q)
    for k in range(robot.nv):
        step = np.eye(robot.nv)[k]
        column = robot.inverse_dynamics(q, v, a + step) - robot.inverse_dynamics(q, v, a)
        np.testing.assert_allclose(mass[:, :, k], column, atol=1e-11)
    assert np.linalg.eigvalsh(mass).min() > 0


@pytest.mark.tier2
@pytest.mark.parametrize("name", ["panda", "tiago"])
def test_power_of_gravity_torques_is_the_rate_of_potential_energy(name):
    robot = bc.load_robot(name, friction="none")
    q, v, _ = random_states(robot, 20)
    h = 1e-6
    rate = (robot.energy(q + h * robot.configuration_rate(q, v), v)[1]
            - robot.energy(q - h * robot.configuration_rate(q, v), v)[1]) / (2 * h)  # fmt: skip
    np.testing.assert_allclose(np.einsum("ni,ni->n", robot.gravity_torque(q), v), rate, rtol=1e-7, atol=1e-6)


@pytest.mark.tier2
def test_kinetic_energy_is_half_v_m_v():
    robot = bc.load_robot("talos", friction="none", floating_base=True)
    q, v, _ = random_states(robot, 20)
    quadratic = 0.5 * np.einsum("ni,nij,nj->n", v, robot.mass_matrix(q), v)
    np.testing.assert_allclose(robot.energy(q, v)[0], quadratic, rtol=1e-12)


def test_frame_velocity_is_the_rate_of_frame_position_for_a_free_base():
    robot = bc.load_robot("solo12", floating_base=True)
    q, v, _ = random_states(robot, 20)
    frame, h = robot.frame_names[-1], 1e-7
    rate = robot.configuration_rate(q, v)
    ahead, behind = robot.frame_pose(frame, q + h * rate), robot.frame_pose(frame, q - h * rate)
    linear, angular = robot.frame_velocity(frame, q, v)
    np.testing.assert_allclose((ahead[0] - behind[0]) / (2 * h), linear, atol=1e-6)
    spin = np.einsum("nij,nkj->nik", (ahead[1] - behind[1]) / (2 * h), robot.frame_pose(frame, q)[1])
    np.testing.assert_allclose(np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], -1), angular, atol=1e-6)


def test_link_shares_sum_to_the_frictionless_torque():
    robot = bc.load_robot("ur5", rotor_inertia={"elbow_joint": 0.5})
    bare = bc.load_robot("ur5", friction="none")
    q, v, a = random_states(robot, 30)
    shares = robot.link_torques(q, v, a)
    assert shares.shape == (30, len(robot.massive_links), 6)
    np.testing.assert_allclose(shares.sum(axis=1), bare.inverse_dynamics(q, v, a), atol=1e-11)
    rest = np.zeros_like(v)
    np.testing.assert_allclose(robot.link_gravity_torques(q), robot.link_torques(q, rest, rest), atol=1e-12)
    np.testing.assert_allclose(robot.link_torques(q[3], v[3], a[3]), shares[3], atol=1e-12)


def test_reaction_about_the_axis_is_the_joint_torque():
    robot = bc.load_robot("panda", friction="none")
    q, v, a = random_states(robot, 30)
    wrench, tau = robot.joint_reactions(q, v, a), robot.inverse_dynamics(q, v, a)
    for k, name in enumerate(robot.all_joint_names[:7]):
        np.testing.assert_allclose(wrench[:, k, 3:] @ robot.joint_axis(name), tau[:, k], atol=1e-11)


@pytest.mark.tier2
def test_a_ceiling_mounted_arm_feels_gravity_upside_down():
    floor = bc.load_robot("ur5", friction="none")
    ceiling = bc.load_robot("ur5", friction="none", gravity=(0, 0, 9.81))
    wall = bc.load_robot("ur5", friction="none", gravity=(9.81, 0, 0))
    q = random_states(floor, 20)[0]
    np.testing.assert_allclose(ceiling.gravity_torque(q), -floor.gravity_torque(q), atol=1e-12)
    assert np.abs(wall.gravity_torque(q)[:, 0]).max() > 1.0  # the first axis now lies across gravity
    assert np.abs(floor.gravity_torque(q)[:, 0]).max() < 1e-9


def test_a_payload_adds_its_weight_at_its_frame_by_virtual_work():
    robot = bc.load_robot("ur5", friction="none")
    loaded = robot.with_payloads([bc.Payload(3.0, "tool0", cg=(0.02, -0.01, 0.08))])
    q = random_states(robot, 10)[0]
    extra = loaded.gravity_torque(q) - robot.gravity_torque(q)
    h = 1e-6
    for k in range(robot.nv):
        heights = []
        for sign in (1, -1):
            position, rotation = robot.frame_pose("tool0", q + sign * h * np.eye(6)[k])
            heights.append((position + rotation @ np.array([0.02, -0.01, 0.08]))[:, 2])
        np.testing.assert_allclose(extra[:, k], 3.0 * 9.81 * (heights[0] - heights[1]) / (2 * h), atol=1e-7)


def test_mimic_followers_have_no_coordinate_and_move_with_their_leader():
    robot = bc.load_robot("panda")
    follower, leader, multiplier, _ = robot.mimics()[0]
    assert follower not in robot.joint_names and leader in robot.joint_names and robot.nv == 8
    q = robot.posture({leader: 0.03})
    left, right = (robot.frame_pose(f, q)[0] for f in ("panda_leftfinger", "panda_rightfinger"))
    hand = robot.frame_pose("panda_hand", q)[0]
    assert multiplier == 1.0
    assert np.linalg.norm(left - right) == pytest.approx(0.06, abs=1e-12)
    assert np.linalg.norm(left - hand) == pytest.approx(np.linalg.norm(right - hand), abs=1e-12)
    with pytest.raises(InputError, match=f"'{follower}' mimics '{leader}'"):
        robot.posture({follower: 0.01})


def test_continuous_joints_have_one_number_and_no_limits():
    robot = bc.load_robot("double_pendulum_continuous")
    assert (robot.nq, robot.nv) == (2, 2)
    assert np.isinf(robot.lower).all() and np.isinf(robot.upper).all()
    q = np.array([[0.4, -0.3]])
    turned = q + 2 * np.pi * np.array([[3, -5]])
    np.testing.assert_allclose(robot.gravity_torque(turned), robot.gravity_torque(q), atol=1e-13)


def test_cleaning_makes_quarter_turns_exact_and_changes_nothing_else():
    cleaned, raw = bc.load_robot("ur5"), bc.load_robot("ur5", clean=False)
    entries, largest = cleaned.cleaning
    assert entries > 0 and largest < 1e-11 and raw.cleaning == (0, 0.0)
    for placement in cleaned.model.jointPlacements:
        np.testing.assert_allclose(placement.rotation @ placement.rotation.T, np.eye(3), atol=1e-15)
    q, v, a = random_states(cleaned, 100)
    difference = cleaned.inverse_dynamics(q, v, a) - raw.inverse_dynamics(q, v, a)
    assert 0 < np.abs(difference).max() < 1e-8
    fewer = cleaned.dynamics("inverse_dynamics").graph.operations
    assert fewer < raw.dynamics("inverse_dynamics").graph.operations


@pytest.mark.tier2
@settings(max_examples=200)
@given(st.floats(-7, 7), st.floats(-7, 7), st.floats(-7, 7), st.floats(-3e-11, 3e-11))
def test_cleaning_keeps_every_rotation_a_rotation(roll, pitch, yaw, residue):
    from bellcrank.robot.model.pinocchio_model import Cleaning

    rotation = pin.rpy.rpyToMatrix(roll + residue, np.round(pitch) * np.pi / 2 + residue, yaw)
    clean = Cleaning().rotation(rotation)
    assert np.abs(clean @ clean.T - np.eye(3)).max() <= 2e-15
    assert np.abs(clean - rotation).max() <= 4e-11


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"gravity": (0, 1)}, "argument 'gravity': expected 3 numbers"),
        ({"gravity": (0, 0, float("nan"))}, "'gravity': expected 3 finite numbers"),
        ({"friction": "dry"}, "friction.*urdf, none"),
        ({"friction": {"elbow": (1, 1)}}, "unknown joint 'elbow'.*did you mean 'elbow_joint'"),
        ({"friction": {"elbow_joint": (-1, 1)}}, "two numbers of at least 0"),
        ({"friction": {"elbow_joint": 3}}, r"expected 2 numbers \(viscous, coulomb\)"),
        ({"rotor_inertia": {"elbow_joint": -0.1}}, "rotor_inertia.*at least 0"),
        ({"friction_width": 0.0}, "'friction_width': .* more than 0"),
        ({"payloads": [bc.Payload(1.0, "tool")]}, "unknown frame 'tool'.*did you mean 'tool0'"),
        ({"frames": {"tool0": ("wrist_3_link", (0, 0, 0), (0, 0, 0))}}, "choose another name"),
    ],
)
def test_bad_arguments_are_named(arguments, message):
    with pytest.raises(InputError, match=message):
        bc.load_robot("ur5", **arguments)


@pytest.mark.parametrize(
    ("mass", "inertia", "message"),
    [
        (0.0, (0,) * 6, "'mass': .* more than 0"),
        (float("nan"), (0,) * 6, "finite"),
        (1.0, (1, 0, 1, 0, 0, 3), "no rigid body has the inertia"),
        (1.0, (1, 2, 1, 0, 0, 1), "no rigid body has the inertia"),
    ],
)
def test_impossible_payloads_are_refused(mass, inertia, message):
    with pytest.raises(InputError, match=message):
        bc.Payload(mass, "tool0", inertia=inertia)


def test_states_of_the_wrong_shape_or_value_are_refused():
    robot = bc.load_robot("ur5")
    with pytest.raises(InputError, match=r"argument \'q\': .* found an array of shape \(5,\)"):
        robot.inverse_dynamics(np.zeros(5), np.zeros(6), np.zeros(6))
    with pytest.raises(InputError, match="argument 'v': expected finite numbers, found nan"):
        robot.inverse_dynamics(np.zeros(6), np.full(6, np.nan), np.zeros(6))
    with pytest.raises(
        InputError,
        match=r"argument \'v\': expected an array of shape \(6,\) or \(3, 6\), found an array of shape \(4, 6\)",
    ):
        robot.inverse_dynamics(np.zeros((3, 6)), np.zeros((4, 6)), np.zeros(6))
    assert robot.inverse_dynamics(np.zeros((0, 6)), np.zeros((0, 6)), np.zeros((0, 6))).shape == (0, 6)


@given(rows=st.integers(1, 40), seed=st.integers(0, 2**16))
@settings(max_examples=40)
def test_a_batch_is_its_samples_whatever_its_length(rows, seed):
    robot = bc.load_robot("planar_2r", friction="none")
    q, v, a = random_states(robot, rows, seed)
    batch = robot.inverse_dynamics(q, v, a)
    singles = np.array([robot.inverse_dynamics(*state) for state in zip(q, v, a, strict=True)])
    np.testing.assert_allclose(batch, singles, rtol=1e-13, atol=1e-12)


def test_parameters_stay_symbols_and_equal_the_constants_they_replace():
    robot = bc.load_robot("planar_2r", friction="none")
    targets = ["joint.elbow.origin.x", "link.link_2.mass", "link.link_1.inertia.zz", "link.link_2.cg.x"]
    function = compiled("parametric", ("test",), lambda: robot.equations.parametric("inverse_dynamics", targets))
    q, v, a = random_states(robot, 50)
    same = function(q, v, a, np.array([1.0, 12.456, 1.042, 0.583]))
    np.testing.assert_allclose(same, robot.inverse_dynamics(q, v, a), atol=1e-11)

    from bellcrank_bench.textbook.planar_2r import PlanarTwoLink

    p = np.array([1.3, 5.0, 2.0, 0.4])
    robot = bc.load_robot("planar_2r", friction="none", gravity=(0, -9.81, 0))
    function = compiled("parametric", ("y",), lambda: robot.equations.parametric("inverse_dynamics", targets))
    arm = PlanarTwoLink(l1=1.3, m2=5.0, i1=2.0, r2=0.4)
    np.testing.assert_allclose(function(q, v, a, p), arm.inverse_dynamics(q, v, a), atol=1e-11)


def test_a_symbolic_turn_of_a_fixed_joint_reaches_what_hangs_on_it():
    robot = bc.load_robot("ur5", friction="none")
    function = compiled(
        "tool turn",
        ("test",),
        lambda: robot.equations.parametric("inverse_dynamics", ["joint.shoulder_lift_joint.origin.roll"]),
    )
    q, v, a = random_states(robot, 20)
    index = robot.model.getJointId("shoulder_lift_joint")
    model = robot.model.copy()
    old = pin.rpy.matrixToRpy(model.jointPlacements[index].rotation)
    model.jointPlacements[index] = pin.SE3(
        pin.rpy.rpyToMatrix(0.3, old[1], old[2]), model.jointPlacements[index].translation
    )
    data = model.createData()
    expected = np.array([pin.rnea(model, data, *state) for state in zip(q, v, a, strict=True)])
    np.testing.assert_allclose(function(q, v, a, np.array([0.3])), expected, atol=1e-9)


@pytest.mark.parametrize("target", ["joint.elbow.origin.w", "link.nowhere.mass", "mass", "link.link_1.colour"])
def test_unknown_parameter_targets_are_refused(target):
    robot = bc.load_robot("planar_2r")
    with pytest.raises(InputError, match=r"nowhere|cannot set"):
        robot.equations.parametric("inverse_dynamics", [target])


JOINT = """<robot name="r"><link name="a"/><link name="b"><inertial><origin xyz="0.1 0.2 0.3"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="%s" type="revolute">
<parent link="a"/><child link="b"/><origin xyz="0.1 0 0.2" rpy="%s"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="10" velocity="3"/></joint></robot>"""


@pytest.mark.parametrize("rpy", ["0 2.0 0", "0 3.14159265358979 0", "0.3 1.5707963267948966 0.7", "1 -2.5 3"])
@pytest.mark.parametrize("angle", range(3))
def test_an_angle_set_to_its_own_value_turns_nothing(tmp_path, rpy, angle):
    path = tmp_path / "one.urdf"
    path.write_text(JOINT % ("j", rpy))
    robot = bc.load_robot(path, gravity=(4, 5, -9))
    target = f"joint.j.origin.{('roll', 'pitch', 'yaw')[angle]}"
    function = robot.equations.parametric("inverse_dynamics", [target])
    value = float(rpy.split()[angle])
    torque = float(function([0.4], [0.3], [0.2], [value]))
    assert torque == pytest.approx(robot.inverse_dynamics([0.4], [0.3], [0.2])[0], abs=1e-12)


def test_a_joint_named_as_the_free_base_is_refused(tmp_path):
    path = tmp_path / "one.urdf"
    path.write_text(JOINT % ("root_joint", "0 0 0"))
    assert bc.load_robot(path).nv == 1
    with pytest.raises(InputError, match=r"a joint has the name 'root_joint'.*rename it"):
        bc.load_robot(path, floating_base=True)


def test_shares_of_links_fixed_to_each_other_are_apart():
    robot = bc.load_robot("ur5", payloads=[bc.Payload(2.0, "tool0")])
    assert "payload 1" in robot.massive_links and "wrist_3_link" in robot.massive_links
    q, v, a = random_states(robot, 5)
    at = robot.massive_links.index("payload 1")
    bare = bc.load_robot("ur5", friction="none")
    alone = bc.load_robot("ur5", friction="none", payloads=[bc.Payload(2.0, "tool0")])
    expected = alone.inverse_dynamics(q, v, a) - bare.inverse_dynamics(q, v, a)
    np.testing.assert_allclose(robot.link_torques(q, v, a)[:, at], expected, atol=1e-11)


def test_a_leader_has_the_limits_of_its_followers(tmp_path):
    text = JOINT % ("lead", "0 0 0")
    link = '<link name="c"/><joint name="follow" type="revolute"><parent link="b"/><child link="c"/><axis xyz="0 1 0"/>'
    text = text.replace("</robot>", link + '<limit lower="-0.5" upper="0.6" effort="1" velocity="0.3"/>'
                        '<mimic joint="lead" multiplier="-3" offset="0.1"/></joint></robot>')  # fmt: skip
    path = tmp_path / "mimic.urdf"
    path.write_text(text)
    robot = bc.load_robot(path)
    np.testing.assert_allclose([robot.lower[0], robot.upper[0]], [-0.5 / 3, 0.2], rtol=1e-14)
    assert robot.velocity_limit[0] == pytest.approx(0.1)


def test_a_robot_remembers_what_is_wrong_with_its_file(tmp_path):
    path = tmp_path / "one.urdf"
    path.write_text((JOINT % ("j", "0 0 0")).replace('izz="0.25"', 'izz="0.5"'))
    assert any("triangle" in finding or "inertia" in finding for finding in bc.load_robot(path).findings)
    assert bc.load_robot("ur5").findings == ()


@pytest.mark.parametrize("name", ["ur5", "planar_2r"])
def test_the_call_for_one_sample_gives_the_bits_of_the_checked_call(name):
    """Vectors of doubles take one C++ call; lists and views take the call that converts them."""
    robot, random = bc.load_robot(name), np.random.default_rng(3)
    for _ in range(20):
        q, v, a = random.normal(size=(3, robot.nv))
        for function, inputs in (
            (robot.inverse_dynamics, (q, v, a)),
            (robot.forward_dynamics, (q, v, a)),
            (robot.gravity_torque, (q,)),
            (robot.mass_matrix, (q,)),
            (robot.energy, (q, v)),
        ):
            quick, checked = function(*inputs), function(*[list(x) for x in inputs])
            strided = function(*[np.repeat(x, 2)[::2] for x in inputs])
            assert np.array_equal(quick, checked) and np.array_equal(quick, strided)


def test_a_range_that_would_not_fit_into_memory_is_refused():
    with pytest.raises(bc.InputError, match=r"found a range; it has 1000000000 numbers, of at most"):
        bc.load_robot("planar_2r").inverse_dynamics(range(10**9), [0, 0], [0, 0])
