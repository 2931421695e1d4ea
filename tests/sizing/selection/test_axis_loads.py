"""Loads of axes along cycles, and their change with the masses of actuators, against inverse dynamics."""

from dataclasses import replace

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.actuators.mount import Mount
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.inverse.mechanism import OpenChain
from bellcrank.dynamics.inverse.mechanism import mechanism_of as mechanism_of_robot
from bellcrank.sizing.selection import axis_loads_of
from bellcrank.sizing.selection.axis_loads import AddedMass
from bellcrank.sizing.selection.axis_loads_of import axis_loads
from bellcrank.sizing.sizing_subject import sizing_subject
from tests.support.actuator_bodies import body, payload_at_joint
from tests.support.crane import FILES

pytestmark = pytest.mark.tier2


def mechanism_of(name, payloads=()):
    subject = sizing_subject(name, None, payloads)
    return subject.mechanism, subject.motions


def added_to(axes):
    """A different body for each axis; each inertia is one that a rigid body can have."""
    return {
        axis.name: AddedMass(mass=0.4 + 0.3 * k, axial_inertia=0.004 + 0.001 * k, transverse_inertia=0.003 + 0.002 * k)
        for k, axis in enumerate(axes)
    }


def assert_same_cycles(found, expected, tolerance=1e-9):
    assert len(found) == len(expected)
    for one, other in zip(found, expected, strict=True):
        for key in ("torque", "static_torque", "axial_force", "tilting_moment", "inertia", "speed", "acceleration"):
            a, b = getattr(one, key), getattr(other, key)
            assert a.shape == b.shape, key
            assert np.abs(a - b).max() <= tolerance * max(1.0, np.abs(b).max()), key


@pytest.fixture
def same_samples(monkeypatch):
    """All loads after the first are sampled at the states of the first."""
    plans = []
    plan = axis_loads_of.planned_cycles

    def planned(*args):
        if not plans:
            plans.append(plan(*args))
        return plans[0]

    monkeypatch.setattr(axis_loads_of, "planned_cycles", planned)


def compare(mechanism, loaded, motions, bodies, mounts=None):
    """The cycles with added bodies from a sum and from the inverse dynamics of the loaded mechanism."""
    loads = axis_loads(mechanism, motions, mounts=mounts)
    payloads, added = bodies(loads.axes)
    expected = axis_loads(loaded(payloads), motions).cycles
    found = loads.with_masses(added)
    assert_same_cycles(found, expected)
    return loads, found


def at_joints(robot):
    def bodies(axes):
        added = added_to(axes)
        return [
            payload_at_joint(robot, name, one.mass, one.axial_inertia, one.transverse_inertia)
            for name, one in added.items()
        ], added

    return bodies


@pytest.mark.parametrize(("name", "moves"), [("planar_2r", 1), ("ur5", 4), ("panda", 6)])
def test_added_masses_give_the_loads_of_a_robot_with_these_bodies(name, moves, same_samples):
    mechanism, motions = mechanism_of(name)
    loads, found = compare(
        mechanism, lambda payloads: mechanism_of(name, payloads)[0], motions[:1], at_joints(mechanism.robot)
    )
    for axis in loads.axes:
        payload = payload_at_joint(mechanism.robot, axis.name, 1.0, 1.0, 1.0)
        assert axis.mount == payload.frame and axis.mount_point == pytest.approx(payload.cg)
        expected = payload_at_joint(mechanism.robot, axis.name, 1.0, 1.0, 0.5).inertia  # 0.5 + 0.5 z zᵀ
        direction = np.array(axis.mount_direction)
        assert np.outer(direction, direction)[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]] / 2 == pytest.approx(
            np.array(expected) - 0.5 * np.array([1, 0, 1, 0, 0, 1]), abs=1e-12
        )
    changed = np.abs(found[0].torque - loads.cycles[0].torque).max(axis=0) > 1e-3
    assert changed.sum() >= moves
    assert (loads.influence[np.triu_indices(len(loads.axes), 1)]).all()
    assert not loads.influence[np.tril_indices(len(loads.axes))].any()


def test_a_body_on_the_ground_changes_nothing():
    mechanism, motions = mechanism_of("geared_pendulum")
    loads = axis_loads(mechanism, motions)
    assert not loads.influence.any()
    heavy = loads.with_masses({"shoulder": AddedMass(mass=5.0, axial_inertia=0.1, transverse_inertia=0.1)})
    assert_same_cycles(heavy, loads.cycles, 0.0)


def moving(robot, name, seed):
    """A smooth motion of all coordinates, a free base's rotation included."""
    random = np.random.default_rng(seed)
    time = np.linspace(0.0, 1.5, 301)
    count = [joint for joint in robot.joints if joint.nv == 1]
    q, v, a = np.tile(robot.neutral, (len(time), 1)), np.zeros((len(time), robot.nv)), np.zeros((len(time), robot.nv))
    for joint in count:
        size, rate, phase = random.uniform(0.2, 0.5), random.uniform(2.0, 5.0), random.uniform(0.0, 6.0)
        q[:, joint.q] = size * np.sin(rate * time + phase)
        v[:, joint.v] = size * rate * np.cos(rate * time + phase)
        a[:, joint.v] = -size * rate**2 * np.sin(rate * time + phase)
    if robot.floating_base:  # it turns about its own x axis at a constant rate and moves along it
        angle = 0.8 * time
        q[:, 3], q[:, 6] = np.sin(angle / 2), np.cos(angle / 2)
        q[:, 0], v[:, 0], a[:, 0], v[:, 3] = 0.3 * time**2, 0.6 * time, 0.6, 0.8
    return bc.Motion(robot.joints, time, q, v, a, name)


def test_a_scene_whose_parameters_place_joints_and_a_prismatic_joint(tmp_path, same_samples):
    text = FILES["scene.yaml"].replace("1000 mm", "1.3")  # the parameter moves the elbow along the upper arm
    assert text != FILES["scene.yaml"]
    for file, content in {**FILES, "scene.yaml": text}.items():
        (tmp_path / file).write_text(content)
    scene = bc.load_scene(tmp_path / "scene.yaml")

    def loaded(payloads=()):
        return OpenChain(scene.robot.with_payloads(payloads) if payloads else scene.robot, scene)

    def bodies(axes):
        """The elbow's body is where the parameter places the joint: at 1.3 m in place of the URDF's 1 m."""
        payloads, added = at_joints(scene.robot)(axes)
        [elbow] = [payload for payload in payloads if payload.frame == "upper"]
        assert elbow.cg == (1.0, 0.0, 0.0)
        return [replace(one, cg=(1.3, 0.0, 0.0)) if one is elbow else one for one in payloads], added

    compare(loaded(), loaded, [moving(scene.robot, "wave", 3)], bodies)


def test_a_floating_base(tmp_path, same_samples):
    for file, text in FILES.items():
        (tmp_path / file).write_text(text)
    robot = bc.load_scene(tmp_path / "flying.yaml").config.robot()
    motion = moving(robot, "flight", 5)
    loads, found = compare(
        mechanism_of_robot(robot),
        lambda payloads: mechanism_of_robot(robot.with_payloads(payloads)),
        [motion],
        at_joints(robot),
    )
    assert loads.influence.any(axis=0).tolist() == [False, True, True]  # the base carries the first without a motor
    assert np.abs(found[0].torque - loads.cycles[0].torque).max() > 0.1


@pytest.mark.parametrize(
    ("name", "actuated"),
    [("five_bar", ["left_elbow", "right_elbow"]), ("five_bar", ["left_motor", "right_elbow"]), ("four_bar", None)],
)
def test_linkages(name, actuated, same_samples):
    scene = bc.load_scene(name)
    linkage = Linkage(scene, actuated=actuated)
    motion = linkage.motion(next(iter(scene.config.motions)))
    others = {} if actuated else {"crank": Mount(link="coupler", axis=(1.0, 2.0, 2.0))}
    place = (1 / 3, 2 / 3, 2 / 3)

    def bodies(axes):
        if actuated:
            return at_joints(linkage.robot)(axes)
        added = added_to(axes)
        [(_, one)] = added.items()
        return [body("coupler", one.mass, one.axial_inertia, one.transverse_inertia, place)], added

    def loaded(payloads):
        return Linkage(scene, linkage.robot.with_payloads(payloads), actuated)

    loads, found = compare(linkage, loaded, [motion], bodies, others)
    assert np.abs(found[0].torque - loads.cycles[0].torque).max() > 1e-3


BODY = '<inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
FLOATING = """<robot name="carried">
  <link name="ground"/>
  <link name="crank">BODY</link>
  <link name="rocker">BODY</link>
  <link name="slider">BODY</link>
  <link name="plate"><inertial><origin xyz="0.5 0.1 0.2"/><mass value="2"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.2"/></inertial></link>
  <joint name="crank" type="continuous"><parent link="ground"/><child link="crank"/><axis xyz="0 0 1"/></joint>
  <joint name="rail" type="prismatic"><parent link="ground"/><child link="slider"/><origin xyz="1 0 0"/>
    <axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="100" velocity="10"/></joint>
  <joint name="rocker" type="continuous"><parent link="slider"/><child link="rocker"/><axis xyz="0 0 1"/></joint>
  <joint name="loose" type="floating"><parent link="ground"/><child link="plate"/></joint>
</robot>"""
CARRIED = """urdf: carried.urdf
gravity: [3, 1, -9]
frames:
  crank_tip: {link: crank, xyz: [0, 0.3, 0]}
  rocker_tip: {link: rocker, xyz: [0, 0.3, 0]}
  plate_end: {link: plate, xyz: [1, 0, 0]}
constraints:
  - {name: left, kind: hinge, frame_a: crank_tip, frame_b: plate}
  - {name: right, kind: point, frame_a: rocker_tip, frame_b: plate_end}
actuated: [crank, rail]
motions:
  swing: {kind: waypoints, times: [0, 1], positions: [{crank: 0, rail: 0}, {crank: 0.6, rail: -0.15}], samples: 41}
initial: {crank: 0, rocker: {guess: 0}, rail: 0, loose: {position: [0, 0.3, 0]}}
"""


def test_a_linkage_with_a_floating_link_and_a_prismatic_joint(tmp_path, same_samples):
    (tmp_path / "carried.urdf").write_text(FLOATING.replace("BODY", BODY))
    (tmp_path / "carried.yaml").write_text(CARRIED)
    scene = bc.load_scene(tmp_path / "carried.yaml")
    linkage = Linkage(scene)
    mounts = {"crank": Mount(link="plate", axis=(2.0, 1.0, 2.0)), "rail": Mount(link="rocker_tip")}

    def bodies(axes):
        added = added_to(axes)
        places = {"crank": ("plate", (2 / 3, 1 / 3, 2 / 3)), "rail": ("rocker_tip", (0.0, 0.0, 1.0))}
        return [
            body(places[name][0], one.mass, one.axial_inertia, one.transverse_inertia, places[name][1])
            for name, one in added.items()
        ], added

    loads, found = compare(
        linkage, lambda payloads: Linkage(scene, linkage.robot.with_payloads(payloads)), [linkage.motion("swing")],
        bodies, mounts,
    )  # fmt: skip
    assert [axis.kind for axis in loads.axes] == ["rotary", "linear"]
    assert loads.influence.all()
    assert np.abs(found[0].torque - loads.cycles[0].torque).max(axis=0).min() > 0.01
    assert np.abs(found[0].tilting_moment - loads.cycles[0].tilting_moment).max(axis=0).min() > 0.1


PLANAR = """<robot name="hover">
  <link name="ground"/>
  <link name="puck"><inertial><origin xyz="0.1 0 0.1"/><mass value="2"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.2"/></inertial></link>
  <link name="arm"><inertial><origin xyz="0.2 0.1 0"/><mass value="1"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.2"/></inertial></link>
  <link name="finger"><inertial><origin xyz="0.1 0 0.3"/><mass value="1"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.2"/></inertial></link>
  <joint name="glide" type="planar"><parent link="ground"/><child link="puck"/><origin rpy="0.3 0.2 0.1"/>
    <axis xyz="0 0 1"/></joint>
  <joint name="lift" type="revolute"><parent link="puck"/><child link="arm"/><origin xyz="0.1 0.2 0.3" rpy="1 2 3"/>
    <axis xyz="0 0.6 0.8"/><limit lower="-3" upper="3" effort="10" velocity="10"/></joint>
  <joint name="grip" type="revolute"><parent link="arm"/><child link="finger"/><origin xyz="0.4 0 0"/>
    <axis xyz="-1 0 0"/><limit lower="-3" upper="3" effort="10" velocity="10"/>
    <mimic joint="lift" multiplier="-1.5"/></joint>
  <joint name="turn" type="revolute"><parent link="finger"/><child link="tip"/><origin xyz="0.2 0 0.1"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="10" velocity="10"/></joint>
  <link name="tip"><inertial><mass value="0.5"/>
    <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.002"/></inertial></link>
</robot>"""


def test_a_planar_joint_and_a_joint_that_mimics(tmp_path, same_samples):
    (tmp_path / "hover.urdf").write_text(PLANAR)
    robot = bc.load_robot(tmp_path / "hover.urdf")
    time = np.linspace(0.0, 1.0, 101)
    q, v, a = (np.zeros((101, size)) for size in (robot.nq, robot.nv, robot.nv))
    turn, at = 1.1 * time + 0.4 * time**2, robot.joint("glide")  # straight in the world, turning ever faster
    q[:, at.q], q[:, at.q + 2], q[:, at.q + 3] = 0.5 * time**2, np.cos(turn), np.sin(turn)
    rate = 1.1 + 0.8 * time
    v[:, at.v], v[:, at.v + 1], v[:, at.v + 2] = time * np.cos(turn), -time * np.sin(turn), rate
    a[:, at.v] = np.cos(turn) - time * rate * np.sin(turn)
    a[:, at.v + 1] = -np.sin(turn) - time * rate * np.cos(turn)
    a[:, at.v + 2] = 0.8
    for name, size in (("lift", 0.8), ("turn", -1.3)):
        joint = robot.joint(name)
        q[:, joint.q], v[:, joint.v], a[:, joint.v] = size * time**3, 3 * size * time**2, 6 * size * time
    motion = bc.Motion(robot.joints, time, q, v, a, "hover")
    loads, found = compare(
        mechanism_of_robot(robot), lambda payloads: mechanism_of_robot(robot.with_payloads(payloads)), [motion],
        at_joints(robot),
    )  # fmt: skip
    assert np.abs(found[0].torque - loads.cycles[0].torque).max(axis=0)[0] > 0.1
