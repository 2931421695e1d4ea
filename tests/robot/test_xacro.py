"""xacro: expanded by the package xacro, without what a file of a stranger must not do."""

import resource

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


ARGUED = ARM.replace(
    '<xacro:property name="l" value="VALUE"/>',
    '<xacro:arg name="length" default="0.4"/><xacro:property name="l" value="$(arg length)"/>',
)


def argued(tmp_path):
    path = written(tmp_path)
    path.write_text(ARGUED)
    return path


def moment(robot) -> float:
    return robot.urdf.links["one"].inertial.inertia[0]


def test_arguments_of_a_xacro_file_are_given_by_argument_and_by_key(tmp_path) -> None:
    path = argued(tmp_path)
    assert moment(bc.load_robot(path)) == pytest.approx(2.0 * 0.4**2 / 12.0)
    assert moment(bc.load_robot(path, xacro_args={"length": 0.6})) == pytest.approx(2.0 * 0.6**2 / 12.0)
    (tmp_path / "arm.yaml").write_text("urdf: arm.urdf.xacro\nxacro_args: {length: 1.0}\n")
    assert moment(bc.load_scene(tmp_path / "arm.yaml").config.robot()) == pytest.approx(2.0 / 12.0)


@pytest.mark.tier2
def test_arguments_of_a_xacro_file_are_given_on_the_command_line(tmp_path, capsys) -> None:
    from bellcrank.cli import main

    path = argued(tmp_path)
    assert moment(bc.load_scene(path, {"xacro_args": {"length": 0.8}}).robot) == pytest.approx(2.0 * 0.8**2 / 12.0)
    command = ["simulate", str(path), "--duration", "0.1", "--no-plots", "--out", str(tmp_path / "run")]
    assert main([*command, "--set", "xacro_args={length: 0.5}"]) == 0
    run = bc.load_run(tmp_path / "run" / "run.npz")
    assert moment(run.scene.robot) == pytest.approx(2.0 * 0.5**2 / 12.0)
    assert main([*command, "--set", "xacro_args={lenght: 0.5}"]) == 2
    assert "unknown argument 'lenght'; did you mean 'length'?" in capsys.readouterr().err


def test_arguments_of_a_file_that_has_none_are_refused(tmp_path) -> None:
    with pytest.raises(InputError, match="xacro_args: only a xacro file"):
        bc.load_robot("planar_2r", xacro_args={"length": 1})
    with pytest.raises(InputError, match="xacro_args: unknown argument 'length'"):
        bc.load_robot(written(tmp_path), xacro_args={"length": 1})


def test_a_prefix_that_is_not_declared_is_refused(tmp_path) -> None:
    (tmp_path / "arm.xacro").write_text('<robot name="r"><link name="a"/><foo:bar x="1"/></robot>')
    with pytest.raises(bc.InputError, match=r"arm\.xacro: .*prefix.*declare it: xmlns"):
        bc.load_robot(tmp_path / "arm.xacro")


CALLS = "".join(
    f'<xacro:macro name="m{k}">{f"<xacro:m{k - 1}/>" * 10 if k else "<a/>"}</xacro:macro>' for k in range(10)
)
DOUBLED = "".join(f'<xacro:property name="n{k}" value="{f"${{n{k - 1}}}" * 2 if k else "a" * 40}"/>' for k in range(24))
GROWTH = {
    "10⁹ calls": CALLS + "<xacro:m9/>",
    "10⁹ letters": "<link name=\"${'x'.rjust(10**9)}\"/>",
    "names that double": DOUBLED + '<link name="${n23}"/>',
    "lists that double": "".join(
        f'<xacro:property name="l{k}" value="${{{f"l{k - 1} + l{k - 1}" if k else "[1, 2, 3]"}}}"/>' for k in range(40)
    )
    + '<link name="${len(l39)}"/>',
}


@pytest.mark.parametrize(
    "growth",
    [pytest.param(text, id=name, marks=[pytest.mark.tier2] * (k > 0)) for k, (name, text) in enumerate(GROWTH.items())],
)
def test_what_grows_without_bound_is_refused_within_the_budget(tmp_path, monkeypatch, growth) -> None:
    monkeypatch.setenv("BELLCRANK_LOADING_SECONDS", "1")
    monkeypatch.setenv("BELLCRANK_LOADING_MEMORY", "300")
    path = tmp_path / "arm.xacro"
    path.write_text(f'<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{growth}<link name="a"/></robot>')
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    words = r"arm\.xacro: xacro: (takes more than 1 s of CPU time or 300 MB of memory; expand it by itself|more than)"
    with pytest.raises(InputError, match=words):
        bc.load_robot(path)
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before < 2.5


def test_a_budget_that_is_no_number_is_refused(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("BELLCRANK_LOADING_SECONDS", "soon")
    with pytest.raises(InputError, match="BELLCRANK_LOADING_SECONDS: expected a number from 1 to 1e7, found 'soon'"):
        bc.load_robot(written(tmp_path))
