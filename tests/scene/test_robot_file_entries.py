"""Closed loops that come with a robot file: Gepetto's YAML beside a URDF, loop tags, merging with a scene."""

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.errors import InputError

INERTIAL = (
    '<inertial><origin xyz="0.1 0 0"/><mass value="1"/>'
    '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>'
)
TREE = "".join(f'<link name="{name}">{INERTIAL}</link>' for name in ("ground", "crank", "coupler", "rocker")) + "".join(
    f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/>'
    '<axis xyz="0 1 0"/></joint>'
    for name, parent, child, xyz in (
        ("a", "ground", "crank", "0 0 0"), ("b", "crank", "coupler", "0.2 0 0"), ("c", "ground", "rocker", "0.5 0 0"),
    )
) + "".join(
    f'<link name="{name}"/><joint name="{name}_fixed" type="fixed"><parent link="{link}"/><child link="{name}"/>'
    f'<origin xyz="{xyz}"/></joint>'
    for name, link, xyz in (("tip_A", "coupler", "0.35 0 0.1"), ("tip_B", "rocker", "0.05 0 0.1"))
)  # fmt: skip
ISAAC = (
    '<loop_joint name="tip" type="spherical">'
    '<link1 link="coupler" xyz="0.35 0 0.1" rpy="0 0 0"/>'
    '<link2 link="rocker" xyz="0.05 0 0.1" rpy="0 0 0"/></loop_joint>'
)
DRAKE = (
    '<loop_joint name="tip">'
    '<link1 link="coupler" xyz="0.35 0 0.1"/><link2 link="rocker" xyz="0.05 0 0.1"/><axis xyz="0 1 0"/></loop_joint>'
)
PLUS = (
    '<loop name="tip" type="continuous"><predecessor link="coupler"><origin xyz="0.35 0 0.1"/></predecessor>'
    '<successor link="rocker"><origin xyz="0.05 0 0.1"/></successor><axis xyz="0 1 0"/></loop>'
)
GEPETTO = "closed_loop: [[tip_A, tip_B]]\ntype: [3d]\nname_mot: [a]\n"


def robot(tmp_path, loops: str = ""):
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="four_bar">{TREE}{loops}</robot>')
    return path


def end_of(path) -> np.ndarray:
    return bc.simulate(path, duration=0.2, rtol=1e-10).state[-1][:6]


@pytest.mark.parametrize("loops", [DRAKE, PLUS])
def test_each_way_to_write_a_loop_closes_it_alike(tmp_path, loops) -> None:
    """The planar linkage moves alike, whether its loop is a point in a YAML beside it, or a hinge in the file."""
    path = robot(tmp_path)
    yaml = tmp_path / "robot.yaml"
    yaml.write_text(GEPETTO)
    expected = end_of(path)
    yaml.unlink()
    assert np.abs(end_of(robot(tmp_path, loops)) - expected).max() < 1e-7
    assert np.abs(end_of(robot(tmp_path, ISAAC)) - expected).max() < 1e-7


def test_motors_and_loops_of_gepetto_come_with_the_urdf(tmp_path) -> None:
    path = robot(tmp_path)
    (tmp_path / "robot.yaml").write_text(GEPETTO + "name_spring: [b]\n")
    scene = bc.load_scene(path)
    assert [constraint.name for constraint in scene.constraints] == ["loop_1"]
    assert scene.config.actuated == ("a",)
    assert "robot.yaml: the key 'name_spring' is not used." in scene.config.notes
    assert bc.load_scene(path).config.actuated == ("a",)
    assert bc.load_robot(path).file.motors[0].joint == "a"


def test_a_scene_that_names_the_same_file_closes_its_loops_once(tmp_path) -> None:
    robot(tmp_path)
    (tmp_path / "robot.yaml").write_text(GEPETTO)
    scene = tmp_path / "scene.yaml"
    scene.write_text("urdf: robot.urdf\nconstraints: [{kind: gepetto, file: robot.yaml}]\n")
    assert [constraint.name for constraint in bc.load_scene(scene).constraints] == ["gepetto_1"]


def test_an_entry_of_the_scene_takes_precedence(tmp_path) -> None:
    robot(tmp_path, ISAAC)
    scene = tmp_path / "scene.yaml"
    scene.write_text(
        "urdf: robot.urdf\nconstraints: [{name: tip, kind: distance, frame_a: tip_A, frame_b: tip_B, length: 0.1}]\n"
    )
    assert [constraint.kind for constraint in bc.load_scene(scene).constraints] == ["distance"]


def test_another_robot_by_override_brings_its_own_loops(tmp_path) -> None:
    robot(tmp_path, ISAAC)
    (tmp_path / "open.urdf").write_text(f'<robot name="open">{TREE}</robot>')
    scene = tmp_path / "scene.yaml"
    scene.write_text("urdf: robot.urdf\n")
    loaded = bc.load_scene(scene)
    assert len(loaded.constraints) == 1
    assert loaded.with_overrides({"urdf": "open.urdf"}).constraints == ()
    assert len(loaded.with_overrides({"simulate.rtol": 1e-6}).constraints) == 1


def test_a_coupling_of_urdf_plus_holds_a_ratio(tmp_path) -> None:
    coupling = (
        '<coupling name="gear"><predecessor link="coupler"/><successor link="rocker"/><ratio value="2"/></coupling>'
    )
    run = bc.simulate(robot(tmp_path, coupling), duration=0.3)
    a, b, c = (run.position[:, run.robot.joint(name).q] for name in "abc")
    assert np.abs(2.0 * (a + b) - c).max() < 1e-9
    assert np.abs(c).max() > 0.1


@pytest.mark.parametrize(
    ("loops", "message"),
    [
        (ISAAC.replace("rocker", "rokker"), "unknown link 'rokker'; did you mean 'rocker'"),
        (ISAAC.replace("0.35", "nan"), "finite number"),
        (ISAAC.replace("spherical", "screw"), "unknown type of loop 'screw'"),
        (ISAAC.replace("spherical", "revolute"), "has no axis"),
        (ISAAC.replace("rocker", "coupler"), "to itself"),
        (ISAAC + ISAAC, "two loops have the name 'tip'"),
        (PLUS.replace("successor", "follower"), "has no <successor"),
        (PLUS.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 0 0"/>'), "length zero"),
        (
            '<coupling name="g"><predecessor link="crank"/><successor link="crank"/><ratio value="2"/></coupling>',
            "no joint",
        ),
    ],
)
def test_wrong_loops_are_refused_in_one_sentence(tmp_path, loops, message) -> None:
    path = robot(tmp_path, loops)
    with pytest.raises(InputError, match=message) as error:
        bc.load_scene(path)
    assert str(path) in str(error.value)
    assert any(found.severity == "error" for found in bc.check_urdf(path))
