"""Reading URDFs: what is refused and in which words, what is kept, and that Pinocchio gets the same robot."""

from __future__ import annotations

import math
import os
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from urdf_records import urdf_of_file, urdf_of_text

from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.bundled_data import folder
from bellcrank.robot.catalog import names
from bellcrank.robot.checks.check import differences_from_yourdfpy
from bellcrank.robot.formats.urdf_file import reading_of
from bellcrank.robot.formats.xml_tree import parse_xml, read_text
from bellcrank.robot.model.pinocchio_model import plain_model

PLANAR = (folder("urdf") / "planar_2r.urdf").read_text(encoding="utf-8")

INERTIA = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
BODY = f'<inertial><mass value="1"/>{INERTIA}</inertial>'
LINKS = f'<link name="a"/><link name="b">{BODY}</link><link name="c">{BODY}</link>'


def joint(name: str = "j", inside: str = "", parent: str = "a", child: str = "b", kind: str = "revolute") -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


SECOND = joint("k", parent="b", child="c")


def robot(inside: str) -> str:
    return f'<robot name="r">\n{inside}\n</robot>'


def tree(inside: str = "", kind: str = "revolute") -> str:
    """Two joints in a row; `inside` goes into the first one."""
    return robot(LINKS + joint(inside=inside, kind=kind) + SECOND)


BROKEN = {
    "empty": ("", "the file is empty"),
    "blank": (" \n\t ", "the file is empty"),
    "no XML": ("joints: [shoulder]", "is not XML"),
    "truncated": (PLANAR[:700], "is it truncated?"),
    "truncated in a comment": (PLANAR[:60], "the file ends too early (unclosed token); is it truncated?"),
    "tags crossed": (
        '<robot name="r"><link name="a"></robot></link>',
        "line 1: is not well-formed XML (mismatched tag)",
    ),
    "two root elements": ('<robot name="r"><link name="a"/></robot><robot/>', "is not well-formed XML"),
    "attribute twice": ('<robot name="r"><link name="a" name="b"/></robot>', "duplicate attribute"),
    "entity": (
        '<!DOCTYPE r [<!ENTITY e "x">]><robot name="r"><link name="&e;"/></robot>',
        "declares an XML entity",
    ),
    "nested deeply": ("<robot>" + "<a>" * 500 + "</a>" * 500 + "</robot>", "nested more than 200 deep"),
    "other root": ('<sdf version="1.7"><model/></sdf>', "the root element is <sdf>"),
    "no link": ('<robot name="r"></robot>', "has no <link>"),
    "xacro element": (
        '<robot name="r"><xacro:macro name="m"/><link name="a"/></robot>',
        "the xacro element <xacro:macro>",
    ),
    "xacro expression": (tree('<origin xyz="${length} 0 0"/>'), "'${length}' is a xacro expression"),
    "link without name": (robot('<link name="a"/><link/>'), "the <link> in line 2 has no name"),
    "joint without name": (
        robot(LINKS + SECOND.replace('name="k"', "")),
        "the <joint> in line 2 has no name",
    ),
    "line break in a name": (robot('<link name="a&#10;b"/>'), "the <link> in line 2 has control characters"),
    "line break in a reference": (
        tree().replace('parent link="a"', 'parent link="a&#10;b"'),
        r"unknown link 'a\nb'",
    ),
    "link twice": (
        robot(LINKS + '\n<link name="b"/>' + joint() + SECOND),
        "link 'b' is defined twice, in lines 2 and 3",
    ),
    "joint twice": (robot(LINKS + joint() + SECOND.replace('"k"', '"j"')), "joint 'j' is defined twice"),
    "unknown parent": (
        robot(LINKS + joint(parent="bb") + SECOND),
        "joint 'j', <parent>: unknown link 'bb'; did you mean 'b'",
    ),
    "unknown child": (robot(LINKS + joint(child="x") + SECOND), "joint 'j', <child>: unknown link 'x'"),
    "no parent": (tree().replace('<parent link="a"/>', ""), "joint 'j' (line 2): has no <parent link"),
    "no child": (tree().replace('<child link="b"/>', "<child/>"), "joint 'j' (line 2): has no <child link"),
    "own parent": (robot(LINKS + joint(child="a") + SECOND), "link 'a' is its own parent"),
    "two roots": (robot(LINKS + joint()), "there are 2 root links ('a', 'c')"),
    "two parents": (
        robot(LINKS + joint() + SECOND + joint("m", parent="a", child="c")),
        "link 'c' has two parents, by the joints 'k' and 'm'",
    ),
    "loop of all": (
        robot(LINKS + joint() + SECOND + joint("m", parent="c", child="a")),
        "there is no root link: the joints 'j', 'k', 'm' form a loop",
    ),
    "loop apart": (
        robot('<link name="w"/>' + LINKS + joint() + SECOND + joint("m", parent="c", child="a")),
        "form a loop apart from root 'w'",
    ),
    "no type": (tree().replace(' type="revolute"', "", 1), "joint 'j' (line 2): has no type"),
    "unknown type": (tree(kind="revolut"), "unknown joint type 'revolut'; did you mean 'revolute'"),
    "word for number": (
        tree('<origin xyz="0 zero 0"/>'),
        "joint 'j', <origin>, xyz (line 2): 'zero' is not a number",
    ),
    "comma": (tree('<origin xyz="0,0 0 0"/>'), "'0,0' is not a number"),
    "underscore": (tree('<limit effort="1_000" velocity="1"/>'), "'1_000' is not a number"),
    "empty number": (tree('<limit effort="" velocity="1"/>'), "'' is not a number"),
    "NaN origin": (
        tree('<origin rpy="nan 0 0"/>'),
        "joint 'j', <origin>, rpy (line 2): is 'nan'; a finite number",
    ),
    "infinite limit": (
        tree('<limit lower="-inf" upper="1" effort="1" velocity="1"/>'),
        "<limit>, lower (line 2): is '-inf'",
    ),
    "overflow": (tree('<origin xyz="1e999 0 0"/>'), "'1e999' is too large"),
    "two numbers": (tree('<origin xyz="0 0"/>'), "xyz='0 0' has 2 numbers; expected 3"),
    "zero axis": (tree('<axis xyz="0 0 0"/>'), "the axis is '0 0 0', of length zero"),
    "negative mass": (
        tree().replace('mass value="1"', 'mass value="-1"', 1),
        "link 'b', <mass> (line 2): the mass is -1 kg",
    ),
    "NaN mass": (
        tree().replace('mass value="1"', 'mass value="NaN"', 1),
        "link 'b', <mass>, value (line 2): is 'NaN'",
    ),
    "no mass": (tree().replace('<mass value="1"/>', "", 1), "link 'b' (line 2): <inertial> has no <mass"),
    "no inertia": (tree().replace(INERTIA, "", 1), "link 'b' (line 2): <inertial> has no <inertia"),
    "half an inertia": (tree().replace(' iyz="0"', "", 1), "link 'b', <inertia> (line 2): lacks iyz"),
    "NaN inertia": (tree().replace('izz="1"', 'izz="nan"', 1), "link 'b', <inertia>, izz (line 2): is 'nan'"),
    "negative effort": (tree('<limit effort="-5" velocity="1"/>'), "effort is -5; expected 0 or more"),
    "limits exchanged": (
        tree('<limit lower="1" upper="-1" effort="1" velocity="1"/>'),
        "lower 1 is above upper -1",
    ),
    "negative damping": (tree('<dynamics damping="-1"/>'), "damping is -1, which would add energy"),
    "mimic of nothing": (tree("<mimic/>"), "joint 'j', <mimic> (line 2): does not name the joint"),
    "mimic of unknown": (
        tree('<mimic joint="kk"/>'),
        "joint 'j', <mimic>: unknown joint 'kk'; did you mean 'k'",
    ),
    "mimic of itself": (tree('<mimic joint="j"/>'), "joint 'j', <mimic>: mimics itself"),
    "mimic in a circle": (
        robot(LINKS + joint(inside='<mimic joint="k"/>') + joint("k", '<mimic joint="j"/>', "b", "c")),
        "joint 'j', <mimic>: mimics itself through 'k'",
    ),
    "mimic of a fixed joint": (
        robot(LINKS + joint(inside='<mimic joint="k"/>') + joint("k", "", "b", "c", "fixed")),
        "joint 'k' is fixed; only a revolute, continuous or prismatic joint or a screw can be mimicked",
    ),
    "reduction in words": (
        robot(
            LINKS + joint() + SECOND + '<transmission name="t"><joint name="j"/><actuator name="m">'
            "<mechanicalReduction>hundred</mechanicalReduction></actuator></transmission>"
        ),
        "transmission 't', <mechanicalReduction> (line 2): 'hundred' is not a number",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_is_one_sentence_that_names_the_file_and_the_place(name: str, tmp_path: Path) -> None:
    text, expected = BROKEN[name]
    path = tmp_path / "broken.urdf"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        urdf_of_text(read_text(path), path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert expected in message
    assert "\n" not in message


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        urdf_of_file(tmp_path / "missing.urdf")
    with pytest.raises(InputError, match="is a folder"):
        urdf_of_file(tmp_path)
    with pytest.raises(InputError, match="cannot be read"):
        urdf_of_file("a\0b")
    with pytest.raises(InputError, match="cannot be read"):
        urdf_of_file("x" * 5000)
    path = tmp_path / "latin.urdf"
    path.write_bytes(PLANAR.replace("planar_2r", "plañar").encode("latin-1"))
    with pytest.raises(InputError, match="not text in the encoding utf-8"):
        urdf_of_file(path)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_declared_encodings_are_honoured(encoding: str, tmp_path: Path) -> None:
    declared = encoding.removesuffix("-sig")
    text = f'<?xml version="1.0" encoding="{declared}"?>' + tree().replace('"r"', '"Gelenkarm für Übung"')
    path = tmp_path / "robot.urdf"
    path.write_bytes(text.encode(encoding))
    assert urdf_of_file(path).name == "Gelenkarm für Übung"


def test_everything_in_the_file_arrives() -> None:
    urdf = urdf_of_text(
        robot(
            '<link name="a"/><link name="b"><inertial><origin xyz="1 2 3" rpy="0.1 0.2 0.3"/>'
            '<mass value="4"/>'
            '<inertia ixx="1" ixy="0.1" ixz="0.2" iyy="2" iyz="0.3" izz="2.5"/></inertial><visual><geometry>'
            '<mesh filename="b.stl"/></geometry></visual></link><link name="c"/><link name="d"/>'
            + joint(inside='<origin xyz=".5 -1e-2 +3" rpy="0 0 1.5"/><axis xyz="0 3 4"/>'
                    '<limit lower="-1" upper="2" effort="30" velocity="4"/>'
                    '<dynamics damping="0.5" friction="0.25"/>')
            + joint("k", '<mimic joint="j" multiplier="-2" offset="0.5"/>', "b", "c")
            + joint(
                "m",
                '<mimic joint="k" multiplier="3" offset="1"/><limit effort="1" velocity="1" upper="1"/>',
                "c",
                "d",
            )
            + '<transmission name="t"><joint name="j"/><actuator name="m">'
            "<mechanicalReduction>100</mechanicalReduction></actuator></transmission><gazebo><anything/></gazebo>"
        ),
        "robot.urdf",
    )  # fmt: skip
    assert urdf.root == "a" and list(urdf.links) == ["a", "b", "c", "d"] and list(urdf.joints) == ["j", "k", "m"]
    inertial = urdf.links["b"].inertial
    assert inertial is not None and urdf.links["a"].inertial is None
    assert (inertial.mass, inertial.xyz, inertial.rpy) == (4.0, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
    assert inertial.inertia == (1.0, 0.1, 0.2, 2.0, 0.3, 2.5)
    assert urdf.links["b"].meshes == ("b.stl",)
    first = urdf.joints["j"]
    assert first.xyz == (0.5, -0.01, 3.0) and first.axis == (0.0, 0.6, 0.8) and first.axis_length == 5.0
    assert (first.lower, first.upper, first.effort, first.velocity) == (-1.0, 2.0, 30.0, 4.0)
    assert (first.damping, first.friction, first.reduction, first.mimic) == (0.5, 0.25, 100.0, None)
    second, third = urdf.joints["k"], urdf.joints["m"]
    assert (second.lower, second.upper, second.effort, second.velocity) == (None,) * 4
    assert (second.damping, second.friction, second.reduction) == (None,) * 3
    assert (third.lower, third.upper) == (0.0, 1.0)  # the specification's default for one limit alone
    # q_m = 3 q_k + 1 with q_k = -2 q_j + 0.5
    assert third.mimic is not None
    assert (third.mimic.joint, third.mimic.multiplier, third.mimic.offset) == ("j", -6.0, 2.5)


def test_all_problems_of_a_file_are_collected() -> None:
    text = tree('<axis xyz="0 0 0"/>').replace('mass value="1"', 'mass value="-1"', 1)
    reading = reading_of(parse_xml(text, "robot.urdf"), "robot.urdf")
    assert reading.urdf is None
    assert [("mass is -1" in str(p), "length zero" in str(p)) for p in reading.problems] == [
        (True, False),
        (False, True),
    ]
    assert set(reading.links) == {"a", "c"} and set(reading.joints) == {"k"}


def test_continuous_joints_are_revolute_for_pinocchio_and_limits_that_are_not_given_are_infinite() -> None:
    urdf = urdf_of_text(
        robot(
            LINKS + '<link name="d&amp;&quot;"/>' + joint(inside='<axis xyz="0 0 2"/>', kind="continuous")
            + joint("k", '<limit lower="-1" upper="0.5" effort="0" velocity="3"/>', "b", "c", "prismatic")
            + joint("w", "", "c", "d&amp;&quot;", "fixed")
        ),
        "robot.urdf",
    )  # fmt: skip
    model = plain_model(urdf)
    assert (model.nq, model.nv) == (2, 2)
    assert model.lowerPositionLimit.tolist() == [-math.inf, -1.0]
    assert model.upperPositionLimit.tolist() == [math.inf, 0.5]
    assert model.effortLimit.tolist() == [math.inf, 0.0]
    assert model.velocityLimit.tolist() == [math.inf, 3.0]
    assert model.existFrame('d&"')


def example_files() -> list[Path]:
    return list(dict.fromkeys(names().values()))


BAD_EXAMPLES = {
    "ur3.urdf": "has no <link>",  # an empty shell in example-robot-data 6
    "alex_psyonic_hands.urdf": "unknown joint 'index_q1'; did you mean 'Left_index_q1'",
}


@pytest.mark.tier2
def test_two_readers_agree_on_every_example_robot() -> None:
    read = 0
    for path in example_files():
        if path.name in BAD_EXAMPLES:
            with pytest.raises(InputError, match=BAD_EXAMPLES[path.name]):
                urdf_of_file(path)
            continue
        assert differences_from_yourdfpy(urdf_of_file(path), read_text(path)) == [], path
        read += 1
    assert read >= 50


@pytest.mark.tier2
def test_pinocchio_gets_the_same_dynamics_as_from_the_file_itself() -> None:
    random = np.random.default_rng(7)
    compared = 0
    for path in example_files():
        if path.name in BAD_EXAMPLES:
            continue
        ours = plain_model(urdf_of_file(path))
        original = pin.buildModelFromUrdf(os.fspath(path))
        assert list(ours.names) == list(original.names)
        if ours.nv == 0:
            continue
        v, a = random.normal(size=(2, ours.nv))
        q, position = np.zeros(ours.nq), pin.neutral(original)
        for mine, theirs in zip(list(ours.joints)[1:], list(original.joints)[1:], strict=True):
            angle = random.uniform(-3, 3)
            if mine.nq == 1:
                q[mine.idx_q] = angle
                position[theirs.idx_q : theirs.idx_q + theirs.nq] = (
                    [angle] if theirs.nq == 1 else [math.cos(angle), math.sin(angle)]
                )
            else:
                q[mine.idx_q : mine.idx_q + mine.nq] = position[theirs.idx_q : theirs.idx_q + theirs.nq]
        expected = pin.rnea(original, original.createData(), position, v, a)
        found = pin.rnea(ours, ours.createData(), q, v, a)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * max(np.abs(expected).max(), 1e-12))
        compared += 1
    assert compared >= 45


def accept_or_refuse(text: str) -> None:
    try:
        urdf = urdf_of_text(text, "robot.urdf")
    except BellcrankError as error:
        assert "\n" not in str(error) and len(str(error)) > 20
    else:
        assert urdf.root in urdf.links
        assert len(urdf.joints) == len(urdf.links) - 1
        assert "nan" not in repr(urdf)


@given(st.integers(0, len(PLANAR)))
def test_truncation_anywhere_is_refused_or_leaves_a_whole_robot(length: int) -> None:
    accept_or_refuse(PLANAR[:length])


@given(st.integers(0, len(PLANAR) - 1), st.integers(0, 40), st.text(max_size=12))
@settings(max_examples=300, suppress_health_check=[HealthCheck.too_slow], deadline=None)
def test_edits_anywhere_raise_nothing_but_our_errors(start: int, length: int, replacement: str) -> None:
    accept_or_refuse(PLANAR[:start] + replacement + PLANAR[start + length :])


@given(st.data())
@settings(max_examples=200, deadline=None)
def test_shuffled_and_repeated_lines_raise_nothing_but_our_errors(data: st.DataObject) -> None:
    lines = PLANAR.splitlines()
    a, b = (data.draw(st.integers(0, len(lines) - 1)) for _ in range(2))
    action = data.draw(st.sampled_from(["swap", "repeat", "delete"]))
    if action == "swap":
        lines[a], lines[b] = lines[b], lines[a]
    elif action == "repeat":
        lines.insert(b, lines[a])
    else:
        del lines[a]
    accept_or_refuse("\n".join(lines))


@given(st.binary(max_size=200))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_any_bytes_raise_nothing_but_our_errors(tmp_path: Path, raw: bytes) -> None:
    path = tmp_path / "any.urdf"
    path.write_bytes(raw)
    with pytest.raises(BellcrankError):
        urdf_of_file(path)


@given(st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3), st.lists(st.floats(-4, 4), min_size=3, max_size=3))
def test_numbers_survive_the_way_to_pinocchio_bit_by_bit(xyz: list[float], rpy: list[float]) -> None:
    origin = f'<origin xyz="{" ".join(map(repr, xyz))}" rpy="{" ".join(map(repr, rpy))}"/>'
    urdf = urdf_of_text(tree(origin), "robot.urdf")
    assert list(urdf.joints["j"].xyz) == xyz and list(urdf.joints["j"].rpy) == rpy
    model = plain_model(urdf)
    np.testing.assert_array_equal(model.jointPlacements[1].translation, xyz)
    np.testing.assert_allclose(model.jointPlacements[1].rotation, pin.rpy.rpyToMatrix(*rpy), atol=1e-15)


@given(st.text(st.characters(exclude_categories=["Cs", "Cc"], include_characters="\n\t\"'&<>"), max_size=30))
def test_text_and_attributes_that_are_written_are_read_back(text: str) -> None:
    from bellcrank.robot.formats.xml_tree import escaped, quoted

    element = ElementTree.fromstring(f"<a b={quoted(text)}>{escaped(text)}</a>")
    assert element.attrib["b"] == text and (element.text or "") == text
