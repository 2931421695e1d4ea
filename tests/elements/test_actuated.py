"""Controllers act at joints with motors alone: those under `actuated`, or with actuators."""

import numpy as np
import pytest
import yaml

import bellcrank as bc

FURUTA = """<robot name="furuta"><link name="base"/>
<link name="arm"><inertial><origin xyz="0.1 0 0"/><mass value="0.3"/>
  <inertia ixx="1e-4" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="rod"><inertial><origin xyz="0 0 -0.15"/><mass value="0.2"/>
  <inertia ixx="1e-3" iyy="1e-3" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="arm_joint" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint>
<joint name="rod_joint" type="continuous"><parent link="arm"/><child link="rod"/><origin xyz="0.2 0 0"/>
  <axis xyz="1 0 0"/></joint></robot>
"""


def scene(folder, control, **more):
    """The pendulum with a motor at its arm, and controllers."""
    (folder / "furuta.urdf").write_text(FURUTA)
    data = {"urdf": "furuta.urdf", "friction": "none", "actuated": ["arm_joint"], "control": control,
            "initial": {"rod_joint": 1.0}, "simulate": {"duration": 0.5}} | more  # fmt: skip
    path = folder / "furuta.yaml"
    path.write_text(yaml.safe_dump({key: value for key, value in data.items() if value is not None}))
    return bc.load_scene(path)


@pytest.mark.parametrize("joints", [{}, {"joints": "all"}, {"joint": "arm_joint"}])
def test_gravity_compensation_leaves_a_joint_without_a_motor_alone(tmp_path, joints) -> None:
    free = bc.simulate(scene(tmp_path, [{"kind": "gravity_compensation", **joints}]))
    weight = free.robot.gravity_torque(free.position[:1])[0]
    assert abs(weight[1]) > 0.1, "the rod has weight that nothing may hold"
    assert [joint.name for joint in free.scene.control[0].joints] == ["arm_joint"]
    begun = free.robot.forward_dynamics(free.position[:1], np.zeros((1, 2)), np.array([[weight[0], 0.0]]))[0]
    assert abs(begun[1]) > 10.0
    assert free.velocity[1] / free.time[1] == pytest.approx(begun, rel=1e-3, abs=1e-3)  # it falls


def test_pd_of_a_motion_acts_at_joints_with_motors_alone(tmp_path) -> None:
    motion = {"kind": "waypoints", "times": [0, 1], "positions": [{}, {"arm_joint": 0.5}]}
    pd = {"name": "servo", "kind": "pd", "motion": "go", "kp": 5.0, "kd": 0.5}
    (control,) = scene(tmp_path, [pd], motions={"go": motion}).control
    assert [joint.name for joint in control.joints] == ["arm_joint"]


@pytest.mark.parametrize(
    ("control", "key"),
    [
        ({"kind": "gravity_compensation", "joints": ["arm_joint", "rod_joint"]}, "joints"),
        ({"kind": "gravity_compensation", "joint": "rod_joint"}, "joint"),
        ({"kind": "pd", "target": {"rod_joint": 0.0}, "kp": 1.0}, "target"),
        ({"kind": "pd", "target": {"arm_joint": 0.0, "rod_joint": 0.0}, "joints": "all", "kp": 1.0}, "target"),
    ],
)
def test_a_joint_without_a_motor_is_refused_by_name_with_the_remedy(tmp_path, control, key) -> None:
    with pytest.raises(bc.InputError, match=rf"control\[1\]\.{key}.*'rod_joint' has no motor.*'actuated'"):
        scene(tmp_path, [control])


def test_a_target_of_a_joint_that_is_not_among_the_joints_is_refused(tmp_path) -> None:
    control = {"kind": "pd", "target": {"arm_joint": 0.0, "rod_joint": 0.0}, "joints": ["arm_joint"], "kp": 1.0}
    with pytest.raises(bc.InputError, match=r"target.*'rod_joint' is not one of 'joints'"):
        scene(tmp_path, [control], actuated=["arm_joint", "rod_joint"])


def test_computed_torque_needs_a_motor_at_each_joint(tmp_path) -> None:
    motion = {"kind": "waypoints", "times": [0, 1], "positions": [{}, {"arm_joint": 0.5}]}
    control = {"kind": "computed_torque", "motion": "go", "kp": 5.0, "kd": 0.5}
    with pytest.raises(bc.InputError, match=r"a motor at each joint.*rod_joint.*use pd"):
        scene(tmp_path, [control], motions={"go": motion})
    everywhere = scene(tmp_path, [control], motions={"go": motion}, actuated=["arm_joint", "rod_joint"])
    assert len(everywhere.control[0].joints) == 2


def test_without_motors_in_the_file_all_joints_count_and_a_note_says_so(tmp_path) -> None:
    held = bc.simulate(scene(tmp_path, [{"kind": "gravity_compensation"}], actuated=None))
    assert np.abs(held.velocity).max() < 1e-9
    assert any("acts at all joints: none is named under 'actuated'" in note for note in held.notes)
    named = bc.simulate(scene(tmp_path, [{"kind": "gravity_compensation", "joint": "arm_joint"}], actuated=None))
    assert not any("acts at all joints" in note for note in named.notes)


def test_forces_act_at_joints_without_motors(tmp_path) -> None:
    spring = {"kind": "joint_spring", "joint": "rod_joint", "stiffness": 10.0}
    assert scene(tmp_path, [], forces=[spring]).forces
