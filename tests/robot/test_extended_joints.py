"""Spherical, universal and screw joints: the model, its algorithms against Pinocchio's, and what files may say."""

import numpy as np
import pinocchio as pin
import pytest
from extended_robots import BOLT, MIXED, TOP, joint, link
from urdf_records import urdf_of_text

import bellcrank as bc
from bellcrank.errors import InputError
from bellcrank.robot.dynamics.equations import inertia_diagonal
from bellcrank.robot.model.pinocchio_model import plain_model


@pytest.fixture
def loaded(tmp_path):
    def load(text, **options):
        path = tmp_path / "robot.urdf"
        path.write_text(text)
        return bc.load_robot(path, **options)

    return load


def states(model, count, seed=5):
    rng = np.random.default_rng(seed)
    q = np.array([pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq)) for _ in range(count)])
    return q, rng.normal(size=(count, model.nv)), rng.normal(size=(count, model.nv))


def test_the_model_has_pinocchios_joints_and_the_rotors_as_armature(loaded):
    model = loaded(MIXED, rotor_inertia={"ball": 0.01, "cardan_2": 0.02, "screw": 0.03}).model
    assert [joint.shortname() for joint in model.joints][1:] == [
        "JointModelSpherical", "JointModelRX", "JointModelRY", "JointModelHelicalUnaligned",
    ]  # fmt: skip
    assert list(model.armature) == [0.01, 0.01, 0.01, 0.0, 0.02, 0.03]


def test_universal_joint_is_that_of_pinocchio(loaded):
    axes = '<axis xyz="0.6 0 0.8"/><axis2 xyz="0.8 0 -0.6"/>'
    text = f'<robot name="u"><link name="world"/>{link("arm")}{joint("u", "universal", "world", "arm", axes)}</robot>'
    robot = loaded(text, gravity=(1.0, 2.0, -9.0))
    model = pin.Model()
    model.gravity.linear = np.array([1.0, 2.0, -9.0])
    universal = pin.JointModelUniversal(np.array([0.6, 0.0, 0.8]), np.array([0.8, 0.0, -0.6]))
    model.addJoint(0, universal, pin.SE3.Identity(), "u")
    model.inertias[1] = robot.model.inertias[2]
    data = model.createData()
    for q, v, a in zip(*np.random.default_rng(1).normal(size=(3, 20, 2)), strict=True):
        assert robot.inverse_dynamics(q, v, a) == pytest.approx(pin.rnea(model, data, q, v, a), rel=1e-12, abs=1e-12)
        assert robot.forward_dynamics(q, v, a) == pytest.approx(pin.aba(model, data, q, v, a), rel=1e-12, abs=1e-12)


def test_limits_and_pitch_of_a_screw_are_in_the_model():
    model = plain_model(urdf_of_text(MIXED))
    assert list(model.lowerPositionLimit[-1:]) == [-1.0]
    assert list(model.upperEffortLimit[-1:]) == [3.0]
    assert model.joints[4].extract().pitch == pytest.approx(0.1 / (2.0 * np.pi), rel=1e-15)


def test_joints_and_coordinates(loaded):
    robot = loaded(MIXED)
    assert [(j.name, j.kind, j.nq, j.nv) for j in robot.joints] == [
        ("ball", "spherical", 4, 3), ("cardan_1", "revolute", 1, 1), ("cardan_2", "revolute", 1, 1),
        ("screw", "screw", 1, 1),
    ]  # fmt: skip
    assert list(robot.neutral) == [0, 0, 0, 1, 0, 0, 0]
    assert robot.joint_names == ("cardan_1", "cardan_2", "screw")
    assert list(robot.lower[-1:]) == [-1.0]
    assert list(robot.effort_limit[-1:]) == [3.0]
    assert robot.inertia_warnings == ()
    assert robot.singular_joints == {}
    with pytest.raises(InputError, match="joint 'ball' is spherical; a joint with one degree of freedom"):
        robot.one_degree_joint("ball", "brake")


def test_friction_of_a_ball_is_along_its_angular_velocity(loaded):
    ball = joint("ball", "spherical", "world", "body", '<dynamics damping="0.3" friction="0.7"/>')
    robot = loaded(TOP.replace(joint("ball", "spherical", "world", "body"), ball), friction_width=1e-6)
    v = np.array([[1.0, -2.0, 2.0], [0.0, 0.0, 0.0]])
    expected = 0.3 * v + 0.7 * v / 3.0
    assert robot.friction_torque(v) == pytest.approx(expected, rel=1e-10)
    q = robot.neutral
    with_friction, without = (
        r.inverse_dynamics(q, v[0], np.zeros(3)) for r in (robot, loaded(TOP.replace(ball, ""), friction="none"))
    )
    assert with_friction - without == pytest.approx(expected[0], rel=1e-10)
    assert loaded(TOP, friction={"ball": (0.1, 0.2)}).viscous.tolist() == [0.1, 0.1, 0.1]


def test_diagonal_of_the_mass_matrix_of_a_screw(loaded):
    text = MIXED.replace('type="spherical"', 'type="fixed"')
    tip = link("tip", "0.1 0.2 0.3", 0.5) + joint("last", "continuous", "nut", "tip", '<axis xyz="0 1 0"/>')
    robot = loaded(text.replace("</robot>", tip + "</robot>"), rotor_inertia={"screw": 0.02})
    diagonal = inertia_diagonal(robot.equations.tree)
    for q in np.random.default_rng(3).normal(size=(5, robot.nq)):
        assert np.array(diagonal(q)).ravel() == pytest.approx(np.diag(robot.mass_matrix(q)), rel=1e-12)


def test_check_finds_nothing_wrong_with_the_joints(tmp_path):
    path = tmp_path / "mixed.urdf"
    path.write_text(MIXED)
    found = bc.check_urdf(path)
    assert {f.where for f in found} == {"joint 'cardan_1'", "joint 'cardan_2'"}  # which have no limits
    assert all("limit" in f.message for f in found)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ((' pitch="0.1"', ""), "joint 'screw' .line 7.: a screw has no pitch; write pitch="),
        (('pitch="0.1"', 'pitch="0"'), "the pitch is 0; write a revolute joint instead"),
        (('pitch="0.1"', 'pitch="much"'), "'much' is not a number"),
        (('<axis xyz="1 0 0"/>', '<axis xyz="1 0 0"/><axis2 xyz="1 1 0"/>'), "are not normal to each other"),
        (('<axis xyz="1 0 0"/>', '<axis xyz="1 0 0"/><axis2 xyz="0 0 0"/>'), "the axis has length zero"),
        (('<link name="world"/>', f'<link name="world"/>{link("cardan_cross")}'), "there is a link 'cardan_cross'"),
        (('type="spherical"', 'type="sperical"'), "did you mean 'spherical'"),
    ],
)
def test_wrong_joints_are_refused_in_one_sentence(change, message):
    assert MIXED.count(change[0]) == 1
    with pytest.raises(InputError, match=message):
        urdf_of_text(MIXED.replace(*change))


def test_a_mimic_beside_a_ball(loaded):
    follower = link("tip") + joint(
        "last", "continuous", "nut", "tip", '<axis xyz="0 1 0"/><mimic joint="screw" multiplier="-2" offset="0.1"/>'
    )
    robot = loaded(MIXED.replace("</robot>", follower + "</robot>"))
    assert robot.model.nv == robot.nv == 6
    every = plain_model(robot.urdf)  # in which every joint is one of its own
    every.gravity.linear = robot.gravity
    data = every.createData()
    q, v, a = states(loaded(MIXED).model, 1)
    full = [np.append(q[0], -2.0 * q[0, -1] + 0.1), np.append(v[0], -2.0 * v[0, -1]), np.append(a[0], -2.0 * a[0, -1])]
    torque = pin.rnea(every, data, *full)
    gathered = torque[:6].copy()
    gathered[5] -= 2.0 * torque[6]
    assert robot.inverse_dynamics(q[0], v[0], a[0]) == pytest.approx(gathered, rel=1e-12)
    own = pin.rnea(robot.model, robot.model.createData(), q[0], v[0], a[0])
    assert robot.inverse_dynamics(q[0], v[0], a[0]) == pytest.approx(own, rel=1e-12)


def test_a_left_handed_screw_moves_down(loaded):
    for pitch in (0.4, -0.4):
        robot = loaded(BOLT.replace('pitch="0.4"', f'pitch="{pitch}"'))
        position = robot.frame_pose("nut", [2.0 * np.pi])[0]
        assert position == pytest.approx([0.0, 0.0, pitch], abs=1e-15)


def test_a_motion_of_a_ball_is_read_from_its_quaternions_and_free_motion_needs_no_torque(tmp_path):
    path = tmp_path / "mixed.urdf"
    path.write_text(MIXED)
    run = bc.simulate(path, 0.2, rtol=1e-10, atol=1e-12)
    motion = bc.read_motion(run.robot, run.to_csv(tmp_path / "ball.csv"))
    need = run.robot.inverse_dynamics(motion.position, motion.velocity, motion.acceleration)
    gravity = np.abs(run.robot.gravity_torque(motion.position)).max()
    assert np.ptp(motion.position[:, :3]) > 0.03 and np.abs(need).max() < 1e-9 * gravity
    with pytest.raises(InputError, match="a spherical joint takes a `spherical_spring`, a torque as a `wrench`"):
        bc.load_scene(path, {"forces": [{"kind": "torque", "joint": "ball", "value": 1}]})
