"""The record that all readers return, and the choice of the reader."""

import pytest

import bellcrank as bc
from bellcrank.robot.formats.file_readers import READERS, read_robot_file, root_tag
from bellcrank.robot.formats.xml_tree import parse_xml


@pytest.mark.parametrize(
    ("text", "tag"),
    [
        ("<?xml version='1.0'?><!-- <sdf> --><robot name='a'>", "robot"),
        ("<mujoco model='a'/>", "mujoco"),
        ("not xml", ""),
        ("", ""),
    ],
)
def test_root_tag(text: str, tag: str) -> None:
    assert root_tag(text) == tag


def test_a_urdf_is_read_as_it_is() -> None:
    robot = bc.load_robot("planar_2r")
    file = read_robot_file(robot.source)
    assert file == robot.file
    assert file.urdf == parse_xml(robot.source.read_text(encoding="utf-8"), robot.source)
    assert not file.loops
    assert not file.notes


def test_the_root_element_chooses_the_reader(tmp_path, monkeypatch) -> None:
    path = tmp_path / "a.urdf"
    path.write_text("<other/>")
    monkeypatch.setitem(READERS, "other", lambda text, source, access: (text, source, access.folder))
    assert read_robot_file(path) == ("<other/>", path, path.parent)
