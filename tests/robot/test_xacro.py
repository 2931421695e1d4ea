"""xacro: expanded by the package xacro, without what a file of a stranger must not do."""

import pytest

import bellcrank as bc
from bellcrank.errors import InputError

PARTS = (
    '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="body" params="name mass">'
    '<link name="${name}"><inertial><origin xyz="0 0 ${-l/2}"/><mass value="${mass}"/>'
    '<inertia ixx="${mass*l**2/12}" ixy="0" ixz="0" '
    'iyy="${mass*l**2/12}" iyz="0" izz="0.001"/></inertial></link></xacro:macro></robot>'
)
ARM = (
    '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="l" value="VALUE"/>'
    '<xacro:include filename="parts.xacro"/><link name="base"/><xacro:body name="one" mass="2"/>'
    '<joint name="a" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 1 0"/>'
    '<limit lower="${-pi/2}" upper="${radians(90)}" effort="10" velocity="3"/></joint></robot>'
)


def written(tmp_path, value: str = "0.4", parts: str = PARTS):
    (tmp_path / "parts.xacro").write_text(parts)
    path = tmp_path / "arm.urdf.xacro"
    path.write_text(ARM.replace("VALUE", value.replace('"', "&quot;")))
    return path


def test_a_xacro_file_is_expanded(tmp_path) -> None:
    robot = bc.load_robot(written(tmp_path))
    assert robot.upper.tolist() == pytest.approx([1.5707963267948966])
    inertial = robot.urdf.links["one"].inertial
    assert inertial is not None
    assert inertial.mass == 2.0
    assert inertial.inertia[0] == pytest.approx(2.0 * 0.4**2 / 12.0)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("${[x for x in (1, 2)][0]}", "ListComp is not supported"),
        ("${().__class__}", "'__class__' is not supported"),
        ("${python.vars(1)}", "'vars' is not supported"),
        ("${(lambda: 1)()}", "Lambda is not supported"),
        ("${10**10**10}", "as exponent"),
        ("${[0]*10**9}", "cannot be repeated"),
        ("$(env HOME)", "the environment"),
        ("$(eval 1+1)", "not supported"),
        ('${xacro.load_yaml("/etc/passwd")}', "not allowed"),
        ("${unknown}", "name 'unknown' is not defined"),
        ("${1 +}", "not an expression"),
    ],
)
def test_what_a_file_must_not_do_is_refused(tmp_path, value, message) -> None:
    path = written(tmp_path, value)
    with pytest.raises(InputError, match=message) as error:
        bc.load_robot(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("filename", "message"),
    [("arm.urdf.xacro", "includes itself"), ("/etc/passwd", "not allowed"), ("missing.xacro", "there is no such file")],
)
def test_included_files(tmp_path, filename, message) -> None:
    path = written(tmp_path)
    path.write_text(path.read_text().replace("parts.xacro", filename))
    with pytest.raises(InputError, match=message):
        bc.load_robot(path)


def test_macros_without_an_end(tmp_path) -> None:
    with pytest.raises(InputError, match=r"without an end|arm\.urdf\.xacro"):
        bc.load_robot(written(tmp_path, parts=PARTS.replace("<inertial>", '<xacro:body name="x" mass="1"/><inertial>')))
