"""SDFormat: placements against a URDF of the same mechanism, the spanning tree, and refusals."""

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.errors import InputError
from bellcrank.robot.formats.file_readers import read_robot_file
from bellcrank.robot.formats.robot_file import FrameLoop

INERTIAL = (
    "<inertial><pose>0.1 0 0 0 0 0</pose><mass>2</mass><inertia><ixx>0.01</ixx><iyy>0.02</iyy><izz>0.03</izz></inertia>"
    "</inertial>"
)
JOINT = '<joint name="{}" type="{}">{}<parent>{}</parent><child>{}</child><axis><xyz{}>0 1 0</xyz></axis></joint>'


def sdf(body: str, version: str = "1.9") -> str:
    return f'<sdf version="{version}"><model name="m">{body}</model></sdf>'


def link(name: str, pose: str = "") -> str:
    return f'<link name="{name}">{pose}{INERTIAL}</link>'


def joint(name: str, parent: str, child: str, kind: str = "revolute", pose: str = "", axis: str = "") -> str:
    return JOINT.format(name, kind, pose, parent, child, axis)


def written(tmp_path, text: str, name: str = "robot.sdf"):
    path = tmp_path / name
    path.write_text(text)
    return path


CHAIN = sdf(
    link("base")
    + link("upper", '<pose relative_to="j1">0 0 0.1 0.2 0.3 0.4</pose>')
    + link("lower", '<pose relative_to="f">0 0.2 0 0 0 0</pose>')
    + '<frame name="f" attached_to="upper"><pose>0.3 0 0 0.1 0 0</pose></frame>'
    + joint("fix", "world", "base", "fixed")
    + joint("j1", "base", "upper", pose='<pose relative_to="base">0 0 0.5 0 0 0.7</pose>')
    + joint("j2", "upper", "lower", axis=' expressed_in="base"')
)


def test_placements_of_relative_frames(tmp_path) -> None:
    """Each link's pose at zero is the product that SDFormat's rules give, computed here by hand."""
    robot = bc.load_robot(written(tmp_path, CHAIN))

    def pose(x, y, z, roll, pitch, yaw):
        import pinocchio as pin

        return pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, yaw), np.array([x, y, z], dtype=float)).homogeneous

    upper = pose(0, 0, 0.5, 0, 0, 0.7) @ pose(0, 0, 0.1, 0.2, 0.3, 0.4)
    expected = {"upper": upper, "lower": upper @ pose(0.3, 0, 0, 0.1, 0, 0) @ pose(0, 0.2, 0, 0, 0, 0)}
    for name, matrix in expected.items():
        position, rotation = robot.frame_pose(name, [0.0, 0.0])
        assert np.abs(position - matrix[:3, 3]).max() < 1e-12
        assert np.abs(rotation - matrix[:3, :3]).max() < 1e-12
    # j2 turns about the y axis of the base, through the origin of the lower link
    q = np.array([0.0, 0.4])
    position, rotation = robot.frame_pose("lower", q)
    turn = pose(0, 0, 0, 0, 0.4, 0)[:3, :3]
    assert np.abs(position - expected["lower"][:3, 3]).max() < 1e-12
    assert np.abs(rotation - turn @ expected["lower"][:3, :3]).max() < 1e-12


FOUR_BAR = (
    link("ground")
    + link("crank")
    + link("coupler", '<pose relative_to="crank">0.2 0 0 0 0 0</pose>')
    + link("rocker", '<pose relative_to="coupler">0.3 0 0 0 0.5 0</pose>')
    + joint("fix", "world", "ground", "fixed")
    + joint("a", "ground", "crank")
    + joint("b", "crank", "coupler")
    + joint("c", "coupler", "rocker")
    + joint("d", "ground", "rocker", pose="<pose>0.25 0 0 0 0 0</pose>")
)


def test_a_joint_whose_child_has_a_parent_is_a_loop_and_the_scene_closes_it(tmp_path) -> None:
    path = written(tmp_path, sdf(FOUR_BAR))
    loops = read_robot_file(path).loops
    assert [loop.name for loop in loops] == ["d"]
    assert isinstance(loops[0], FrameLoop)
    assert loops[0].kind == "hinge"
    run = bc.simulate(path, duration=0.2)
    assert run.success
    a, b = run.scene.constraints[0].frames
    gap = run.robot.frame_pose(a, run.position)[0] - run.robot.frame_pose(b, run.position)[0]
    assert np.abs(gap).max() < 1e-9


def test_a_run_of_a_robot_file_is_loaded_from_itself_alone(tmp_path) -> None:
    run = bc.simulate(written(tmp_path, sdf(FOUR_BAR)), duration=0.1)
    saved = run.save(tmp_path / "run.npz")
    (tmp_path / "robot.sdf").unlink()
    again = bc.load_run(saved)
    assert (again.state == run.state).all()
    assert [constraint.name for constraint in again.scene.constraints] == ["d"]


def test_the_tree_alone(tmp_path) -> None:
    written(tmp_path, sdf(FOUR_BAR))
    scene = tmp_path / "scene.yaml"
    scene.write_text("urdf: robot.sdf\nrobot_file: tree\n")
    assert bc.load_scene(scene).constraints == ()


def test_a_joint_met_from_its_child_keeps_its_coordinate(tmp_path) -> None:
    """A chain written from the tip to the world moves as the same chain written from the world to the tip."""
    forward = joint("fix", "world", "one", "fixed") + joint("j", "one", "two", pose="<pose>0 0 0.1 0 0 0</pose>")
    backward = joint("fix", "world", "one", "fixed") + joint(
        "k", "two", "one", pose='<pose relative_to="two">0 0 0.1 0 0 0</pose>'
    )
    links = link("one") + link("two", "<pose>0.3 0 0 0 0 0.2</pose>")
    one = bc.load_robot(written(tmp_path, sdf(links + forward), "one.sdf"))
    two = bc.load_robot(written(tmp_path, sdf(links + backward), "two.sdf"))
    for q in (0.0, 0.7, -1.3):
        (p, r), (s, t) = one.frame_pose("two", [q]), two.frame_pose("two", [-q])
        assert np.abs(p - s).max() < 1e-12
        assert np.abs(r - t).max() < 1e-12


def test_nested_and_included_models(tmp_path) -> None:
    written(tmp_path, sdf(link("hand", "<pose>0 0 0.1 0 0 0</pose>")), "hand.sdf")
    body = (
        link("arm")
        + joint("fix", "world", "arm", "fixed")
        + "<include><uri>hand.sdf</uri><name>tool</name><pose>1 0 0 0 0 0</pose></include>"
        + joint("wrist", "arm", "tool::hand")
    )
    robot = bc.load_robot(written(tmp_path, sdf(body)))
    assert robot.joint_names == ("wrist",)
    assert np.abs(robot.frame_pose("tool::hand", [0.0])[0] - [1.0, 0.0, 0.1]).max() < 1e-12


def test_what_is_not_modelled_is_listed(tmp_path) -> None:
    file = read_robot_file(written(tmp_path, sdf('<link name="a"/><plugin name="p" filename="f"/>')))
    assert any("plugin (1)" in note for note in file.notes)
    assert any("'a' has no <inertial>" in note for note in file.notes)
    found = bc.check_urdf(file.source)
    assert any("plugin (1)" in each.message for each in found if each.severity == "note")


CIRCLE = '<frame name="f" attached_to="g"/><frame name="g" attached_to="f"/>'


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (link("a", '<pose relative_to="b"/>') + link("b", '<pose relative_to="a"/>'), "circle"),
        (link("a") + CIRCLE + joint("j", "a", "f"), "circle"),
        (link("a", '<pose relative_to="c">0 0 0 0 0 0</pose>'), "unknown frame 'c'"),
        (link("a") + joint("j", "a", "missing"), "unknown frame 'missing'"),
        (link("a", "<pose>nan 0 0 0 0 0</pose>"), "expected numbers"),
        (link("a", "<pose>1e99 0 0 0 0 0</pose>"), "at most 1e\\+30"),
        (link("a", "<pose>1 2 3</pose>"), "expected 6 numbers, found 3"),
        (link("a") + link("a"), "is taken"),
        (link("a") + link("b") + joint("j", "a", "b", "gearbox"), "unknown joint type 'gearbox'"),
        ('<include><uri>robot.sdf</uri></include>', "includes itself"),
        ('<include><uri>../../../../etc/passwd</uri></include>', "not allowed|there is no file"),
        ("", "there is no <link>"),
    ],
)  # fmt: skip
def test_wrong_files_are_refused_in_one_sentence(tmp_path, body, message) -> None:
    path = written(tmp_path, sdf(body))
    with pytest.raises(InputError, match=message) as error:
        bc.load_robot(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)
