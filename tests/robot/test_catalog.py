"""Robots by name, by path, and where the bundled files lie."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from bellcrank.errors import InputError
from bellcrank.files.bundled_data import folder
from bellcrank.robot.catalog import SHORT_NAMES, find_urdf, names
from bellcrank.robot.formats.file_readers import read_robot_file


def test_a_path_a_bundled_name_and_an_example_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bundled = folder("urdf") / "planar_2r.urdf"
    assert find_urdf(bundled) == bundled
    assert find_urdf(str(bundled)) == bundled
    assert find_urdf("planar_2r") == bundled
    assert find_urdf("ur5").name == "ur5_robot.urdf"
    assert find_urdf("talos").name == "talos_reduced.urdf"
    monkeypatch.chdir(tmp_path)
    Path("ur5").write_text("mine", encoding="utf-8")
    assert find_urdf("ur5") == Path("ur5")  # an existing file wins


def test_every_short_name_is_there_and_holds_a_robot() -> None:
    known = names()
    assert list(known)[:2] == ["geared_pendulum", "planar_2r"] or "planar_2r" in list(known)[:12]
    assert set(SHORT_NAMES) <= set(known)
    for name in SHORT_NAMES:
        assert len(read_robot_file(known[name]).tree.joints) >= 1, name
    for name in ("a1", "baxter", "icub", "kinova", "pr2", "romeo", "so100", "tiago", "xarm7", "z1"):
        assert known[name].is_file()
    assert len(set(known.values())) >= 60


def test_stems_that_stand_twice_are_told_apart() -> None:
    known = names()
    assert known["anymal_b"] != known["anymal_c"]
    assert {known["anymal_b"].parts[-3], known["anymal_c"].parts[-3]} == {
        "anymal_b_simple_description",
        "anymal_c_simple_description",
    }


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("ur55", "unknown robot 'ur55'; did you mean 'ur5'"),
        ("cassie.xml", "cassie.xml: no such file; give the path of a robot file"),
        ("", "unknown robot ''"),
        ("nowhere/arm.urdf", "nowhere/arm.urdf: no such file"),
        ("arm.urdf", "arm.urdf: no such file"),
        ("..", "is a folder"),
        ("../planar_2r", "no such file"),
        ("x" * 5000, "unknown robot"),
        ("a\0b", "null character"),
    ],
)
def test_an_unknown_robot_is_one_sentence(given: str, expected: str) -> None:
    with pytest.raises(InputError) as caught:
        find_urdf(given)
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_data_folder_is_refused() -> None:
    with pytest.raises(InputError, match="unknown data folder 'meshes'"):
        folder("meshes")


def test_finding_and_reading_a_robot_imports_nothing_heavy() -> None:
    program = (
        "import sys; from bellcrank.robot.catalog import find_urdf;"
        "from bellcrank.robot.formats.file_readers import read_robot_file;"
        "read_robot_file(find_urdf('ur5')).tree;"
        "print([m for m in ('pinocchio', 'casadi', 'yourdfpy', 'scipy', 'matplotlib', 'trimesh') if m in "
        "sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
