"""What `bellcrank check` finds, and that it finds nothing where nothing is wrong."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from urdf_records import urdf_of_file, urdf_of_text

from bellcrank.commands.check import add_arguments, run
from bellcrank.errors import InputError
from bellcrank.files.bundled_data import folder
from bellcrank.robot.catalog import find_urdf
from bellcrank.robot.checks.check import Finding, check_urdf, format_findings
from bellcrank.robot.checks.element_checks import principal_moments
from bellcrank.robot.dynamics.articulated_inertia import _pivots as eliminated
from bellcrank.robot.dynamics.articulated_inertia import articulated_inertias
from bellcrank.robot.model.pinocchio_model import plain_model

LIMIT = '<limit lower="-1" upper="1" effort="10" velocity="2"/>'


def body(
    mass: float = 1.0,
    ixx: float = 1.0,
    iyy: float = 1.0,
    izz: float = 1.0,
    xyz: str = "0 0 0",
    ixy: float = 0,
) -> str:
    return (
        f'<inertial><origin xyz="{xyz}"/><mass value="{mass}"/>'
        f'<inertia ixx="{ixx}" ixy="{ixy}" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/></inertial>'
    )


def arm(*bodies: str, inside: str = LIMIT, kind: str = "revolute", axis: str = "0 0 1", origin: str = "") -> str:
    """A chain of moving bodies; `inside`, `kind`, `axis` and `origin` are those of every joint."""
    links = ['<link name="base"/>'] + [f'<link name="l{k}">{inertial}</link>' for k, inertial in enumerate(bodies)]
    joints = [
        f'<joint name="j{k}" type="{kind}"><parent link="{f"l{k - 1}" if k else "base"}"/><child '
        f'link="l{k}"/>'
        f'{origin}<axis xyz="{axis}"/>{inside}</joint>'
        for k in range(len(bodies))
    ]
    return '<robot name="r">' + "".join(links + joints) + "</robot>"


def findings(text: str, tmp_path: Path) -> list[Finding]:
    path = tmp_path / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    return check_urdf(path)


POINT = {"ixx": 0.0, "iyy": 0.0, "izz": 0.0}

CASES = {
    "not positive": (arm(body(ixy=2.0)), "error", "link 'l0'", "the inertia is not positive"),
    "negative moment": (arm(body(ixx=-0.1)), "error", "link 'l0'", "the inertia is not positive"),
    "triangle": (arm(body(izz=2.5)), "error", "link 'l0'", "violates the triangle inequality"),
    "triangle by rounding": (arm(body(izz=2.001)), "warning", "link 'l0'", "this may be rounding"),
    "inertia without mass": (arm(body(mass=0.0)), "warning", "link 'l0'", "has no mass but an inertia"),
    "inertia in g cm²": (
        arm(body(ixx=100, iyy=100, izz=100)),
        "warning",
        "link 'l0'",
        "a radius of gyration of 10 m",
    ),
    "massless": (arm(""), "error", "joint 'j0'", "vanishes"),
    "point mass on the axis": (arm(body(xyz="0 0 0.3", **POINT)), "error", "joint 'j0'", "vanishes"),
    "two joints on one axis": (arm("", body()), "error", "joint 'j0'", "vanishes"),
    "sliding nothing": (
        arm("", kind="prismatic"),
        "error",
        "joint 'j0'",
        "the mass that it moves vanishes",
    ),
    "zero axis": (arm(body(), axis="0 0 0"), "error", "file", "of length zero"),
    "long axis": (arm(body(), axis="0 0 2"), "warning", "joint 'j0'", "the axis has length 2, not 1"),
    "tilted planar joint": (arm(body(), axis="1 0 0", kind="planar"), "error", "joint 'j0'", "only 0 0 1"),
    "no limits": (
        arm(body(), inside=""),
        "warning",
        "joint 'j0'",
        "has no lower and no upper and no effort and no velocity",
    ),
    "no effort": (
        arm(body(), inside="", kind="continuous"),
        "warning",
        "joint 'j0'",
        "has no effort and no velocity limit",
    ),
    "zero effort": (
        arm(body(), inside=LIMIT.replace('"10"', '"0"')),
        "warning",
        "joint 'j0'",
        "the effort limit is 0",
    ),
    "degrees": (
        arm(body(), inside=LIMIT.replace('"1"', '"170"')),
        "warning",
        "joint 'j0'",
        "look like degrees",
    ),
    "cannot move": (
        arm(body(), inside=LIMIT.replace('"-1"', '"1"')),
        "warning",
        "joint 'j0'",
        "it cannot move",
    ),
    "two roots": (
        arm(body()).replace("<joint", '<link name="other"/><joint', 1),
        "error",
        "file",
        "2 root links",
    ),
    "loop": (
        arm(body(), body()).replace('parent link="base"', 'parent link="l1"'),
        "error",
        "file",
        "form a loop",
    ),
    "mesh": (
        arm(body()).replace(
            '<link name="base"/>',
            '<link name="base"><visual><geometry><mesh filename="package://p/m.stl"/></geometry></visual></link>',
        ),
        "warning",
        "link 'base'",
        "the mesh package://p/m.stl was not found",
    ),
    "mimic": (
        arm(body(), body(), origin='<origin xyz="1 0 0"/>').replace(
            f"{LIMIT}</joint></robot>", '<mimic joint="j0" multiplier="2"/></joint></robot>'
        ),
        "note",
        "joint 'j1'",
        "mimics joint 'j0': position = 2 × its position",
    ),
    "mimic that stands": (
        arm(body(), body()).replace(f"{LIMIT}</joint></robot>", '<mimic joint="j0" multiplier="0"/></joint></robot>'),
        "warning",
        "joint 'j1'",
        "multiplier 0",
    ),
    "mimic of no effect": (
        arm(body(), inside='<mimic joint="j0"/>', kind="fixed"),
        "warning",
        "joint 'j0'",
        "is fixed, so its <mimic> has no effect",
    ),
    "1.57": (
        arm(body(), origin='<origin rpy="1.57 0 0"/>'),
        "warning",
        "joint 'j0'",
        "the roll 1.57 is -0.000796 rad off 90°",
    ),
    "3.1416": (arm(body(), origin='<origin rpy="0 -3.1416 0"/>'), "warning", "joint 'j0'", "rad off -180°"),
    "almost zero": (
        arm(body(), origin='<origin rpy="0 0 1e-7"/>'),
        "warning",
        "joint 'j0'",
        "the yaw 1e-07 is +1e-07 rad off 0°",
    ),
    "friction": (
        arm(body(), inside=LIMIT + '<dynamics friction="2.5"/>'),
        "warning",
        "joint 'j0'",
        "takes 25 % of the effort limit 10",
    ),
    "damping": (
        arm(body(), inside=LIMIT + '<dynamics damping="2"/>'),
        "warning",
        "joint 'j0'",
        "takes 40 % of the effort limit 10 at 2 rad/s",
    ),
    "transmission": (
        arm(body()).replace("</robot>", '<transmission name="t"><joint name="jj"/></transmission></robot>'),
        "warning",
        "transmission 't'",
        "drives a joint 'jj' that does not exist",
    ),
    "a massless link with something heavy on it": (
        arm("", body(), origin='<origin xyz="1 0 0"/>'),
        "warning",
        "link 'l0'",
        "moves with a joint and has no mass (no <inertial>)",
    ),
    "links without any mass": (arm("", ""), "warning", "links 'l0', 'l1'", "move with a joint and have no mass"),
    "an inertial of mass 0": (
        arm(body(mass=0.0, **POINT), body(), origin='<origin xyz="1 0 0"/>'),
        "warning",
        "link 'l0'",
        "has no mass (an <inertial> of mass 0)",
    ),
    "a shape that stands nowhere": (
        arm('<visual><origin xyz="0 0 0" rpy="inf 0 nan"/><geometry><sphere radius="1"/></geometry></visual>' + body()),
        "warning",
        "link 'l0'",
        "the shape is not drawn",
    ),
    "truncated": (arm(body())[:-20], "error", "file", "is it truncated?"),
    "empty": ("", "error", "file", "the file is empty"),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.filterwarnings("error")
def test_each_fault_is_found(name: str, tmp_path: Path) -> None:
    text, severity, where, message = CASES[name]
    found = findings(text, tmp_path)
    assert any(f.severity == severity and f.where == where and message in f.message for f in found), found


SOUND = {
    "an arm": arm(body(), body(), origin='<origin xyz="1 0 0"/>'),
    "a point mass off the axis": arm(body(xyz="0.2 0 0", **POINT)),
    "a massless frame fixed to a link": arm(body()).replace(
        "</robot>",
        '<link name="tool"/><joint name="t" type="fixed"><parent link="l0"/><child link="tool"/></joint></robot>',
    ),
    "a link whose mass is in a part fixed to it": arm("").replace(
        "</robot>",
        f'<link name="part">{body()}</link><joint name="t" type="fixed"><parent link="l0"/><child link="part"/></joint>'
        "</robot>",
    ),
    "a thin plate, where the triangle is an equality": arm(body(izz=2.0)),
    "right angles in few digits that are cleaned": arm(body(), origin='<origin rpy="1.57079632679 0 3.14159265359"/>'),
    "friction of a fifth": arm(body(), inside=LIMIT + '<dynamics friction="1" damping="0.5"/>'),
    "round-off of a point mass": arm(body(xyz="0.2 0 0", ixx=-1e-20, iyy=1e-20, izz=1e-18)),
}


@pytest.mark.parametrize("name", SOUND)
def test_what_is_sound_is_left_alone(name: str, tmp_path: Path) -> None:
    assert findings(SOUND[name], tmp_path) == []


def test_the_bundled_robots_have_nothing_to_find() -> None:
    for path in folder("urdf").glob("*.urdf"):
        if path.stem in ("planar_2r", "geared_pendulum"):
            assert check_urdf(path) == []


def test_known_faults_of_example_robots() -> None:
    vanishing = [f.where for f in check_urdf(find_urdf("romeo")) if "vanishes" in f.message]
    assert vanishing == ["joint 'LHand'", "joint 'RHand'"]
    assert any("inertia is not positive" in f.message for f in check_urdf(find_urdf("tiago")))
    assert sum("effort limit" in f.message for f in check_urdf(find_urdf("allegro_left"))) == 16
    assert all(f.severity != "error" for f in check_urdf(find_urdf("ur5")))


def test_many_faults_of_one_file_are_told_together(tmp_path: Path) -> None:
    text = arm(body(mass=-1.0), body(izz=5.0), axis="0 0 0")
    found = findings(text, tmp_path)
    assert [f.severity for f in found] == ["error"] * 4  # the mass, both axes, the triangle
    assert format_findings(found).endswith("4 errors")
    assert format_findings([]) == "  nothing found"


def test_meshes_are_looked_for_beside_and_above(tmp_path: Path) -> None:
    package = tmp_path / "arm_description"
    (package / "urdf").mkdir(parents=True)
    (package / "meshes").mkdir()
    (package / "meshes" / "m.stl").write_bytes(b"solid")
    path = package / "urdf" / "arm.urdf"
    for mesh in (
        "package://arm_description/meshes/m.stl",
        "../meshes/m.stl",
        f"file://{package}/meshes/m.stl",
    ):
        shape = f'<link name="base"><visual><geometry><mesh filename="{mesh}"/></geometry></visual></link>'
        path.write_text(arm(body()).replace('<link name="base"/>', shape), encoding="utf-8")
        assert check_urdf(path) == [], mesh


@pytest.mark.parametrize("name", ["planar_2r", "ur5", "panda", "talos", "double_pendulum_continuous"])
def test_the_pivots_are_the_articulated_inertias(name: str) -> None:
    """1/D is how a joint answers its own unit torque with all beyond it limp: against Pinocchio's own M⁻¹."""
    model = plain_model(urdf_of_file(find_urdf(name)))
    data = model.createData()
    random = np.random.default_rng(1)
    for _ in range(5):
        q = random.uniform(-1, 1, model.nq)
        mass_matrix = np.triu(pin.crba(model, data, q))
        mass_matrix += np.triu(mass_matrix, 1).T
        pivots = eliminated(mass_matrix)
        roots = [
            j.idx_v for j, parent in zip(list(model.joints)[1:], list(model.parents)[1:], strict=True) if parent == 0
        ]
        pin.computeMinverse(model, data, q)
        np.testing.assert_allclose(pivots[roots], 1.0 / np.diag(data.Minv)[roots], rtol=1e-9)
        for k in range(model.nv):
            np.testing.assert_allclose(pivots[k], 1.0 / np.linalg.inv(mass_matrix[k:, k:])[0, 0], rtol=1e-6)


def test_a_follower_lends_its_inertia_to_its_leader() -> None:
    """Two wheels on a frame, the second turning m times as fast: the leader feels I1 + m² I2."""
    text = arm(body(), "").replace('parent link="l0"', 'parent link="base"')
    text = text.replace('<link name="l1">', f'<link name="l1">{body(izz=1.5)}')
    text = text.replace(f"{LIMIT}</joint></robot>", '<mimic joint="j0" multiplier="-3"/></joint></robot>')
    inertias = articulated_inertias(urdf_of_text(text))
    assert list(inertias) == ["j0"]
    assert inertias["j0"][0] == pytest.approx(1.0 + 9.0 * 1.5, rel=1e-12)


@given(st.lists(st.floats(-1.0, 1.0), min_size=9, max_size=9), st.floats(0.01, 10.0))
@settings(deadline=None)
def test_the_inertia_of_real_points_is_never_refused(coordinates: list[float], mass: float) -> None:
    """Three points of equal mass: positive, and obeying the triangle inequality, by construction."""
    points = np.asarray(coordinates).reshape(3, 3)
    points = points - points.mean(axis=0)
    tensor = mass * sum(np.dot(p, p) * np.eye(3) - np.outer(p, p) for p in points)
    low, middle, high = principal_moments(
        (tensor[0, 0], tensor[0, 1], tensor[0, 2], tensor[1, 1], tensor[1, 2], tensor[2, 2])
    )
    slack = 1e-12 * max(high, 1e-12)
    assert low >= -slack and low + middle >= high - slack


def command(*files: str) -> int:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return run(parser.parse_args(list(files)))


def test_the_command_says_yes_no_and_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command("planar_2r") == 0
    assert "nothing found" in capsys.readouterr().out
    bad = tmp_path / "bad.urdf"
    bad.write_text(arm(body(izz=5.0)), encoding="utf-8")
    assert command("planar_2r", str(bad)) == 1
    assert "error    link 'l0': the inertia violates" in capsys.readouterr().out
    no_robot = tmp_path / "sdf.urdf"
    no_robot.write_text("<sdf/>", encoding="utf-8")
    assert command(str(no_robot)) == 1
    capsys.readouterr()
    bad.write_text("<robot>", encoding="utf-8")
    with pytest.raises(InputError, match="truncated"):
        command("planar_2r", str(bad))
    with pytest.raises(InputError, match="no such file"):
        command(str(tmp_path / "none.urdf"))
    assert capsys.readouterr().out == ""


@given(st.integers(0, 3000), st.integers(0, 30), st.text('0123456789.-eE<>/"= naxyz', max_size=10))
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_an_edited_file_gives_findings_and_no_exception(
    tmp_path: Path, start: int, length: int, replacement: str
) -> None:
    text = (folder("urdf") / "planar_2r.urdf").read_text(encoding="utf-8")
    start %= len(text)
    for finding in findings(text[:start] + replacement + text[start + length :], tmp_path):
        assert finding.severity in ("error", "warning", "note")
        assert "\n" not in finding.message
