"""Rows of a motion's file that cannot be meant as they stand: too close for their digits, or with wrapped angles."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import bellcrank as bc

Array = NDArray[np.float64]
SPIN = """<robot name="spin"><link name="base"/>
<link name="rotor"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="spin" type="{kind}"><parent link="base"/><child link="rotor"/><axis xyz="0 0 1"/>
<limit {range} effort="50" velocity="30"/></joint></robot>"""
TIME = np.linspace(0.0, 2.0, 201)


def rotor(folder: Path, kind: str = "continuous", bounds: str = "") -> bc.Robot:
    path = folder / "spin.urdf"
    path.write_text(SPIN.format(kind=kind, range=bounds))
    return bc.load_robot(path, gravity=(0, 0, 0))


def written(folder: Path, columns: Sequence[tuple[str, Array]]) -> Path:
    path = folder / "move.csv"
    rows = zip(*(values.tolist() for _, values in columns), strict=True)
    header = ",".join(title for title, _ in columns)
    path.write_text("\n".join([header, *(",".join(map(repr, row)) for row in rows)]) + "\n")
    return path


def angle(begin: float, turned: float) -> Array:
    """An angle, °, that turns by so much from rest to rest over TIME."""
    u = TIME / TIME[-1]
    return begin + turned * u**3 * (10.0 - 15.0 * u + 6.0 * u * u)


def wrapped(degrees: Array) -> Array:
    return (degrees + 180.0) % 360.0 - 180.0


@pytest.mark.parametrize(("begin", "turned"), [(160.0, 40.0), (-170.0, -30.0), (10.0, 1000.0)])
@pytest.mark.parametrize("rates", [False, True])
def test_a_wrapped_angle_is_continued_and_a_note_names_joint_and_rows(
    tmp_path: Path, begin: float, turned: float, rates: bool
) -> None:
    robot, exact = rotor(tmp_path), angle(begin, turned)
    columns = [("time [s]", TIME), ("spin position [deg]", wrapped(exact))]
    if rates:
        u = TIME / TIME[-1]
        columns.append(("spin velocity [deg/s]", 30.0 * turned * (u * (1.0 - u)) ** 2 / TIME[-1]))
    motion = bc.read_motion(robot, written(tmp_path, columns))
    turns = np.round((exact[0] - wrapped(exact)[0]) / 360.0)
    np.testing.assert_allclose(np.degrees(motion.position[:, 0]), exact - 360.0 * turns, rtol=0, atol=1e-9)
    assert np.degrees(np.abs(motion.velocity).max()) == pytest.approx(30.0 / 16.0 * abs(turned) / 2.0, rel=1e-3)
    row = int(np.flatnonzero(np.abs(np.diff(wrapped(exact))) > 180.0)[0]) + 1
    [note] = [text for text in motion.notes if "jumps by a turn" in text]
    assert f"joint 'spin' jumps by a turn between rows {row} and {row + 1}" in note and "continued" in note
    again = bc.read_motion(robot, bc.write_motion(motion, tmp_path / "again.csv"))
    np.testing.assert_array_equal(again.position, motion.position)
    assert not any("jumps by a turn" in text for text in again.notes)


def test_a_joint_that_its_limits_do_not_let_pass_is_refused_with_the_remedy(tmp_path: Path) -> None:
    robot = rotor(tmp_path, "revolute", 'lower="-3.1416" upper="3.1416"')
    path = written(tmp_path, [("time [s]", TIME), ("spin position [deg]", wrapped(angle(160.0, 40.0)))])
    with pytest.raises(bc.InputError, match=r"move.csv: joint 'spin' jumps by a turn between rows .* write angles"):
        bc.read_motion(robot, path)
    wide = rotor(tmp_path, "revolute", 'lower="-6.3" upper="6.3"')
    assert np.degrees(bc.read_motion(wide, path).position[-1, 0]) == pytest.approx(200.0, abs=1e-9)


def test_turns_that_the_rest_of_the_file_is_as_fast_as_are_left_alone(tmp_path: Path) -> None:
    robot = rotor(tmp_path)
    coarse = np.arange(8.0)
    for degrees in (340.0 * coarse, np.array([0.0, 0.0, 360.0, 360.0]), np.array([0.0, 350.0])):
        path = written(tmp_path, [("time [s]", coarse[: len(degrees)]), ("spin position [deg]", degrees)])
        motion = bc.read_motion(robot, path)
        rows = np.searchsorted(motion.time, coarse[: len(degrees)])
        np.testing.assert_allclose(np.degrees(motion.position[rows, 0]), degrees, rtol=0, atol=1e-9)
        assert not any("jumps by a turn" in text for text in motion.notes)


@pytest.mark.parametrize("gap", [1e-12, 1.5e-8, 2e-7])
@pytest.mark.parametrize("columns", [2, 3, 4])
def test_rows_that_rounding_does_not_separate_are_merged_and_named(tmp_path: Path, gap: float, columns: int) -> None:
    robot, u = rotor(tmp_path), TIME / TIME[-1]
    at = np.insert(TIME, [51, 120], TIME[[50, 119]] + gap)
    u = at / TIME[-1]
    given = [
        ("time [s]", at),
        ("spin position [rad]", u**3 * (10.0 - 15.0 * u + 6.0 * u * u)),
        ("spin velocity [rad/s]", 30.0 * (u * (1.0 - u)) ** 2 / 2.0),
        ("spin acceleration [rad/s^2]", 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / 4.0),
    ]
    motion = bc.read_motion(robot, written(tmp_path, given[:columns]))
    [note] = [text for text in motion.notes if "merged" in text]
    assert "rows 51 to 52 at 0.5 s" in note and "121 to 122 at 1.19 s" in note
    assert len(motion) == len(TIME)
    dense = np.abs(motion.at(np.linspace(0.0, 2.0, 40_001))[2]).max()
    assert dense == pytest.approx(10.0 / np.sqrt(3.0) / 4.0, rel=1e-4)


def test_two_rows_on_either_side_of_a_jump_are_its_limits(tmp_path: Path) -> None:
    """A move of constant acceleration 2, then −2 rad/s², whose file has the second limit 1e-9 s after the first."""
    robot, h = rotor(tmp_path), 1e-9
    t = np.concatenate([np.linspace(0.0, 1.0, 51), np.linspace(1.0, 2.0, 51)])
    early = np.arange(len(t)) < 51
    q = np.where(early, t * t, 2.0 - (2.0 - t) ** 2)
    v, a = np.where(early, 2.0 * t, 2.0 * (2.0 - t)), np.where(early, 2.0, -2.0)
    t[51] += h
    titles = ("time [s]", "spin position [rad]", "spin velocity [rad/s]", "spin acceleration [rad/s^2]")
    motion = bc.read_motion(robot, written(tmp_path, list(zip(titles, (t, q, v, a), strict=True))))
    assert np.flatnonzero(np.diff(motion.time) == 0.0).tolist() == [50]
    assert motion.acceleration[[50, 51], 0].tolist() == [2.0, -2.0]
    assert bc.size(robot, motion).joint("spin").peak_torque == pytest.approx(2.0, rel=1e-9)
    assert any("rows 51 to 52" in text and "merged" in text for text in motion.notes)


def test_short_steps_that_the_digits_resolve_are_left_alone(tmp_path: Path) -> None:
    """Steps of an integrator that starts with 1e-5 s."""
    robot = rotor(tmp_path)
    t = np.concatenate([[0.0, 1e-5, 4e-5, 2e-4, 1e-3], np.linspace(0.02, 2.0, 100)])
    motion = bc.read_motion(robot, written(tmp_path, [("time [s]", t), ("spin position [rad]", 40.0 * np.sin(t))]))
    assert not any("merged" in text for text in motion.notes)
    np.testing.assert_array_equal(np.unique(motion.time), t)
