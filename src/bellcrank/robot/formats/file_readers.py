"""Reads a robot file of any format; its root element decides which reader reads it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final
from xml.parsers import expat

from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess
from bellcrank.robot.formats.robot_file import RobotFile
from bellcrank.robot.formats.urdf_robot import read_urdf_robot
from bellcrank.robot.formats.xml_tree import read_text

Reader = Callable[[str, Path, FileAccess], RobotFile]  # of the file's text, its path, and which files it may name


def read_robot_file(
    path: str | Path, access: FileAccess | None = None, xacro_args: Mapping[str, str] | None = None
) -> RobotFile:
    """Read a robot file; its root element decides which reader reads it.

    Args:
        path: Path of the file.
        access: Which files it may name, such as included ones; by default those in its surroundings.
        xacro_args: Values of the arguments (<xacro:arg>) of a xacro file, by name.

    Returns:
        The contents. A URDF is not checked here but by `Urdf.of`.

    Raises:
        InputError: The file cannot be read, or its reader refuses it; the message names file, line and element.

    Example:
        >>> import bellcrank as bc
        >>> from bellcrank.robot.formats.file_readers import read_robot_file
        >>> read_robot_file(bc.load_robot("planar_2r").source).loops
        ()
    """
    source = Path(path)
    text = read_text(source)
    allowed = access or FileAccess.of(source.resolve())
    if source.suffix == ".xacro":
        return read_urdf_robot(text, source, allowed, xacro_args)
    if xacro_args:
        raise InputError(f"{source}: xacro_args: only a xacro file, robot.urdf.xacro, has arguments; remove them")
    return READERS.get(root_tag(text), read_urdf_robot)(text, source, allowed)


def root_tag(text: str) -> str:
    """The tag of the root element of an XML text; "" where there is none."""
    found: list[str] = []

    class Found(Exception):
        pass

    def start(tag: str, attributes: dict[str, str]) -> None:
        found.append(tag)
        raise Found

    parser = expat.ParserCreate("utf-8")
    parser.StartElementHandler = start
    with suppress(Found, expat.ExpatError, UnicodeError):  # text that is not XML is refused by the reader
        parser.Parse(text.encode("utf-8"), True)
    return found[0] if found else ""


def _mjcf(text: str, source: Path, access: FileAccess) -> RobotFile:
    from bellcrank.robot.formats.mjcf import read_mjcf

    return read_mjcf(text, source, access)


def _sdf(text: str, source: Path, access: FileAccess) -> RobotFile:
    from bellcrank.robot.formats.sdf_robot import read_sdf

    return read_sdf(text, source, access)


# by the tag of the root element
READERS: Final[dict[str, Reader]] = {"robot": read_urdf_robot, "mujoco": _mjcf, "sdf": _sdf}
