"""Joint types of a Gepetto YAML that a scene names, and that stands beside the URDF."""

import pytest

import bellcrank as bc


@pytest.mark.parametrize("choice", ["all", "tree"])
def test_a_type_of_no_joint_is_told_once_however_the_yaml_is_named(tmp_path, choice):
    parts = [f'<link name="{name}"/>' for name in "ab"]
    joint = (
        '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><limit effort="1" velocity="1"/></joint>'
    )
    (tmp_path / "robot.urdf").write_text(f'<robot name="r">{"".join(parts)}{joint}</robot>')
    loops = "closed_loop: [[a, b]]\ntype: [3d]\njoint_name: [j, jj]\njoint_type: [SPHERICAL, SPHERICAL]\n"
    (tmp_path / "robot.yaml").write_text(loops)
    entry = "constraints: [{kind: gepetto, name: loop, file: robot.yaml}]"
    (tmp_path / "scene.yaml").write_text(f"name: s\nurdf: robot.urdf\nrobot_file: {choice}\n{entry}\n")
    scene = bc.load_scene(tmp_path / "scene.yaml")
    assert [j.kind for j in scene.robot.joints] == ["spherical"]
    assert len([note for note in scene.config.notes if "no joint is named 'jj'" in note]) == 1
