"""Motions in CSV: exact there and back, missing rates supplied, and one sentence for whatever does not
fit.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import bellcrank
from bellcrank.errors import BellcrankError, InputError
from bellcrank.motion.generators.frame_motions import circle
from bellcrank.motion.generators.waypoints import dwell, waypoints
from bellcrank.motion.sampled.csv_file import read_motion, write_motion


@pytest.fixture(scope="module")
def arm():
    return bellcrank.load_robot("planar_2r", gravity=(0, -9.81, 0))


def same(left, right):
    return all(
        np.array_equal(getattr(left, key), getattr(right, key))
        for key in ("time", "position", "velocity", "acceleration")
    )


def table(file, columns, rows):
    lines = [",".join(columns)] + [",".join(repr(float(x)) for x in row) for row in rows]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


POSITIONS = ["time [s]", "shoulder position [rad]", "elbow position [rad]"]


def test_there_and_back_exactly(arm, tmp_path):
    motion = circle(arm, "tip", (1.2, 1.2, 0), 0.2, 10, start={"elbow": -1.0}, profile="trapezoid", samples=101)
    motion = dwell(arm, motion.position[0], 1.0) + motion
    file = write_motion(motion, tmp_path / "deep" / "motion.csv")
    header = file.read_text(encoding="utf-8").splitlines()[0]
    assert header == (
        "time [s],shoulder position [rad],elbow position [rad],shoulder velocity [rad/s],elbow velocity "
        "[rad/s],"
        "shoulder acceleration [rad/s^2],elbow acceleration [rad/s^2]"
    )
    back = read_motion(arm, file)
    assert same(motion, back) and back.name == "motion" and len(back.pieces) == len(motion.pieces) == 4
    assert back.notes == ()


def test_a_free_base_there_and_back(tmp_path):
    robot = bellcrank.load_robot("planar_2r", floating_base=True)
    start, end = robot.posture({"elbow": -1.0}), robot.posture({"elbow": 0.5})
    end[:7] = [0.3, -0.2, 0.1, 0.0, 0.6, 0.0, 0.8]
    motion = waypoints(robot, [0.0, 2.0], [start, end], samples=51)
    file = write_motion(motion, tmp_path / "base.csv")
    with pytest.raises(InputError, match=r"base of the robot 'planar_2r' is fixed; write floating_base: true"):
        read_motion(bellcrank.load_robot("planar_2r"), file)
    assert "root_joint position qw [1]" in file.read_text(encoding="utf-8")
    assert same(motion, read_motion(robot, file))


def test_columns_in_any_order_and_other_units(arm, tmp_path):
    motion = circle(arm, "tip", (1.2, 1.2, 0), 0.2, 10, start={"elbow": -1.0}, samples=101)
    degrees = np.rad2deg(motion.position)
    rows = np.column_stack([degrees[:, 1], 1000 * motion.time, degrees[:, 0]])
    file = table(tmp_path / "m.csv", ["elbow position [deg]", "time [ms]", "shoulder position [deg]"], rows)
    back = read_motion(arm, file, name="mine")
    assert back.name == "mine" and back.position == pytest.approx(motion.position, abs=1e-14)


def test_missing_rates_come_from_splines(arm, tmp_path):
    motion = circle(arm, "tip", (1.2, 1.2, 0), 0.2, 10, start={"elbow": -1.0})
    data = np.column_stack([motion.time, motion.position])
    bare = read_motion(arm, table(tmp_path / "q.csv", POSITIONS, data))
    assert bare.velocity == pytest.approx(motion.velocity, abs=1e-10)
    assert bare.acceleration == pytest.approx(motion.acceleration, abs=1e-7)
    speeds = [*POSITIONS, "shoulder velocity [rad/s]", "elbow velocity [rad/s]"]
    half = read_motion(arm, table(tmp_path / "qv.csv", speeds, np.column_stack([data, motion.velocity])))
    assert np.array_equal(half.velocity, motion.velocity)
    assert half.acceleration == pytest.approx(motion.acceleration, abs=1e-9)
    assert len(half.notes) == 1 and "starts moving" in half.warnings[1]


@pytest.mark.parametrize("rows", [2, 3, 5, 6])
def test_a_few_rows_take_the_polynomial(arm, tmp_path, rows):
    t = np.linspace(0.0, 1.0, rows)
    data = np.column_stack([t, 1 + 2 * t, t if rows == 2 else t * t])
    motion = read_motion(arm, table(tmp_path / "q.csv", POSITIONS, data))
    assert motion.velocity[:, 0] == pytest.approx(2.0) and motion.acceleration[:, 0] == pytest.approx(0.0, abs=1e-10)
    if rows > 2:
        assert motion.acceleration[:, 1] == pytest.approx(2.0)


def test_spline_pieces_meet_at_a_time_that_stands_twice(arm, tmp_path):
    t = np.array([0, 0.25, 0.5, 0.75, 1, 1, 1.25, 1.5, 1.75, 2])
    q = np.where(np.arange(10) < 5, t * t, 2 * t - 1)
    motion = read_motion(arm, table(tmp_path / "q.csv", POSITIONS, np.column_stack([t, q, 0 * t])))
    assert motion.acceleration[:, 0] == pytest.approx([2] * 5 + [0] * 5, abs=1e-10)
    assert not any("jumps" in warning for warning in motion.warnings)


def test_warns_where_velocity_and_position_disagree(arm, tmp_path):
    motion = circle(arm, "tip", (1.2, 1.2, 0), 0.2, 10, start={"elbow": -1.0}, samples=101)
    columns = [*POSITIONS, "shoulder velocity [rad/s]", "elbow velocity [rad/s]"]
    rows = np.column_stack([motion.time, motion.position, motion.velocity * [1.0, 1.1]])
    found = read_motion(arm, table(tmp_path / "m.csv", columns, rows)).warnings
    assert any("the velocity of joint 'elbow' does not agree with its position" in warning for warning in found)


def test_spaces_blank_lines_and_byte_order_mark(arm, tmp_path):
    file = tmp_path / "m.csv"
    text = "\ufefftime [s], shoulder position [rad] ,elbow position[rad]\n\n0, 0 ,0\n 1,1,1\n\n"
    file.write_text(text, encoding="utf-8")
    assert read_motion(arm, file).position == pytest.approx(np.array([[0.0, 0.0], [1.0, 1.0]]))


HEADER = "time [s],shoulder position [rad],elbow position [rad]\n"
BROKEN = [
    ("", "the file is empty"),
    ("\n\n", "the file is empty"),
    (HEADER, "at least 2 rows of numbers, got 0"),
    (HEADER + "0,0,0\n", "at least 2 rows of numbers, got 1"),
    (HEADER + "0,0,0\n1,0\n", "line 3 has 2 columns, the header has 3"),
    (HEADER + "0,0,0\n1,x,0\n", r"line 3, column 'shoulder position \[rad\]': 'x' is not a finite number"),
    (HEADER + "0,0,0\n1,nan,0\n", "'nan' is not a finite number"),
    (HEADER + "0,0,0\n1,inf,0\n", "'inf' is not a finite number"),
    (HEADER + "0,0,0\n2,0,0\n1,0,0\n", r"time must not decrease, but row 3 \(1 s\) follows 2 s"),
    (HEADER + "0,0,0\n1,0,0\n1,0,0\n1,0,0\n2,0,0\n", "occurs more than twice"),
    (HEADER + "0,0,0\n0,0,0\n1,0,0\n", "the first or the last time occurs twice"),
    (HEADER + "0,0,0\n1,0,0\n1,0.5,0\n2,0.5,0\n", "joint 'shoulder' jumps by 0.5"),
    ("time [s],shoulder position [rad]\n0,0\n1,0\n", r"column 'elbow position \[rad\]' is missing"),
    ("shoulder position [rad],elbow position [rad]\n0,0\n1,0\n", r"column 'time \[s\]' is missing"),
    (HEADER.replace(" [s]", "") + "0,0,0\n1,0,0\n", "has no unit; write 'time \\[s\\]'"),
    (HEADER.replace("[s]", "[h]") + "0,0,0\n1,0,0\n", "is in 'h', expected s or ms"),
    ("time [s],shoulder position [m],elbow position [rad]\n0,0,0\n1,0,0\n", "is in 'm', expected rad or mrad or deg"),
    (HEADER.replace("shou", "sho") + "0,0,0\n1,0,0\n", "did you mean 'shoulder position'"),
    ("time [s],time [s],elbow position [rad]\n0,0,0\n1,0,0\n", "column 'time' occurs twice"),
    ("time [s];shoulder position [rad]\n0;0\n1;0\n", "separated by ';'"),
    (HEADER[:-1] + ",elbow velocity [rad/s]\n0,0,0,0\n1,0,0,0\n", r"velocity \[rad/s\]' is missing though"),
    (
        HEADER[:-1] + ",shoulder acceleration [rad/s^2],elbow acceleration [rad/s^2]\n0,0,0,0,0\n1,0,0,0,0\n",
        "acceleration columns but no velocity columns",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("text", "words"), BROKEN)
def test_refuses_in_one_sentence_with_the_file(arm, tmp_path, text, words):
    file = tmp_path / "broken.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=words) as caught:
        read_motion(arm, file)
    assert str(file) in str(caught.value) and "\n" not in str(caught.value)


def test_refuses_what_is_no_text_file(arm, tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        read_motion(arm, tmp_path / "none.csv")
    with pytest.raises(InputError, match="is a folder"):
        read_motion(arm, tmp_path)
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(InputError, match="not valid UTF-8"):
        read_motion(arm, tmp_path / "b.csv")


def test_a_failed_write_leaves_nothing(arm, tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(InputError, match="cannot write"):
        write_motion(dwell(arm, [0, 0], 1.0), tmp_path / "file" / "m.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


GOOD = HEADER + "".join(f"{k / 10},{k},{-k}\n" for k in range(8))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.data())
def test_a_mutilated_file_never_ends_in_anything_else(arm, tmp_path, data):
    cut = data.draw(st.integers(0, len(GOOD)))
    middle = data.draw(st.text(max_size=12) | st.sampled_from(["nan", "1e999", '"', ",", "\n", "\0", "-"]))
    skip = data.draw(st.integers(0, 9))
    file = tmp_path / "m.csv"
    file.write_bytes((GOOD[:cut] + middle + GOOD[cut + skip :]).encode("utf-8", "replace"))
    try:
        motion = read_motion(arm, file)
    except BellcrankError as error:
        assert "\n" not in str(error)
        return
    for array in (motion.time, motion.position, motion.velocity, motion.acceleration):
        assert np.all(np.isfinite(array))


def test_derived_accelerations_are_pointed_out(arm, tmp_path):
    time = np.linspace(0.0, 1.0, 21)
    s = time**3 * (10 - 15 * time + 6 * time**2)
    ds = 30 * time**2 * (1 - time) ** 2
    full = read_motion(arm, table(tmp_path / "p.csv", POSITIONS, np.column_stack([time, s, s])))
    assert (
        full.notes[0] == "motion 'p': accelerations come from differentiating the positions; noise in them is amplified"
    )
    rates = [*POSITIONS, "shoulder velocity [rad/s]", "elbow velocity [rad/s]"]
    half = read_motion(arm, table(tmp_path / "v.csv", rates, np.column_stack([time, s, s, ds, ds])))
    assert any("differentiating the velocities" in note for note in half.notes)


def test_degrees_in_a_column_of_radians_are_suspected(arm, tmp_path):
    time = np.linspace(0.0, 1.0, 21)
    s = 45.0 * time**3 * (10 - 15 * time + 6 * time**2)
    wrong = read_motion(arm, table(tmp_path / "m.csv", POSITIONS, np.column_stack([time, s, 0 * s])))
    found = [note for note in wrong.notes if "degrees" in note]
    assert found == [
        "motion 'm': joint 'shoulder' reaches 45 rad (2578°); were degrees meant? give the column the unit [deg]"
    ]
    columns = [POSITIONS[0], "shoulder position [deg]", POSITIONS[2]]
    right = read_motion(arm, table(tmp_path / "m.csv", columns, np.column_stack([time, s, 0 * s])))
    assert not any("degrees" in note for note in right.notes)
