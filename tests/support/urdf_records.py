"""The checked records of a URDF, of its text or its file."""

from pathlib import Path

from bellcrank.robot.formats.file_readers import read_robot_file
from bellcrank.robot.formats.urdf_file import Urdf
from bellcrank.robot.formats.xml_tree import parse_xml


def urdf_of_text(text: str, source: str | Path = "robot.urdf") -> Urdf:
    return Urdf.of(parse_xml(text, source), source)


def urdf_of_file(path: str | Path) -> Urdf:
    return read_robot_file(path).tree
