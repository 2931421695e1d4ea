"""Joint types of Gepetto's YAML files."""

import pytest

from bellcrank.errors import InputError
from bellcrank.robot.formats.gepetto_file import with_joint_types
from bellcrank.robot.formats.urdf_file import Urdf
from bellcrank.robot.formats.xml_tree import parse_xml, xml_text

TEXT = """<?xml version="1.0"?>
<robot name="r">
  <!-- a comment -->
  <link name="a"/>
  <link name="b"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="c"/> <link name="d &amp; e"/>
  <joint name="hip"
         type="revolute">
    <parent link="a"/><child link="b"/><axis xyz="0 0 1"/><limit effort="1" velocity="20"/>
  </joint>
  <joint name="knee" type="revolute"><origin xyz="1 2 3"/><parent link="b"/><child link="c"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="20"/></joint>
  <joint name="toe" type="revolute"><parent link="c"/><child link="d &amp; e"/><mimic joint="knee"/></joint>
</robot>
"""
ROBOT = parse_xml(TEXT, "robot.urdf")


def joints(types):
    robot, notes = with_joint_types(ROBOT, types, "robot.yaml")
    return Urdf.of(robot, "robot.urdf").joints, notes


def test_types_are_changed_and_everything_else_stays():
    found, notes = joints({"hip": "SPHERICAL", "toe": "fixed"})
    before = Urdf.of(ROBOT, "robot.urdf").joints
    assert notes == ()
    assert [joint.type for joint in found.values()] == ["spherical", "revolute", "fixed"]
    assert found["knee"] == before["knee"]
    assert (found["hip"].parent, found["hip"].child, found["hip"].effort) == ("a", "b", 1.0)
    assert found["toe"].child == "d & e"
    assert found["toe"].mimic is None


@pytest.mark.parametrize(
    ("kind", "axes"),
    [
        ("UJOINT_XY", ((1, 0, 0), (0, 1, 0))),
        ("UJOINT_YZ", ((0, 1, 0), (0, 0, 1))),
        ("UJOINT_ZX", ((0, 0, 1), (1, 0, 0))),
    ],
)
def test_universal_joints_turn_about_their_axes_in_this_order(kind, axes):
    found, _ = joints({"hip": kind})
    assert [(name, joint.axis) for name, joint in found.items()][:2] == [("hip_1", axes[0]), ("hip_2", axes[1])]
    assert (found["hip_1"].parent, found["hip_1"].child) == ("a", "hip_cross")
    assert (found["hip_2"].parent, found["hip_2"].child) == ("hip_cross", "b")
    assert found["hip_2"].xyz == (0.0, 0.0, 0.0)


def test_changing_twice_changes_nothing_more():
    types = {"hip": "UJOINT_YZ", "knee": "SPHERICAL"}
    robot = with_joint_types(ROBOT, types, "robot.yaml")[0]
    assert with_joint_types(robot, types, "robot.yaml")[0] == robot


def test_elements_keep_their_lines():
    wrong = parse_xml(TEXT.replace('xyz="1 2 3"', 'xyz="1 2"'), "robot.urdf")
    text = xml_text(with_joint_types(wrong, {"hip": "SPHERICAL"}, "robot.yaml")[0])
    with pytest.raises(InputError, match=r"joint 'knee', <origin> \(line 11\): xyz='1 2' has 2 numbers"):
        Urdf.of(parse_xml(text, "robot.urdf"), "robot.urdf")


def test_names_of_no_joint_are_told():
    found, notes = joints({"hpi": "SPHERICAL"})
    assert found == Urdf.of(ROBOT, "robot.urdf").joints
    assert notes == (
        "robot.yaml: joint_name: no joint is named 'hpi' (the nearest name is 'hip'); its new type is not used.",
    )


def test_an_unknown_type_is_refused():
    with pytest.raises(InputError, match=r"robot.yaml: joint_type of 'hip': unknown type 'SPERICAL'; did you mean"):
        joints({"hip": "SPERICAL"})
