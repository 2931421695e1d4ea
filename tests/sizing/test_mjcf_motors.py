"""Motors of MJCF files: what `check` asks of them, and their gears in a sizing."""

import pytest

import bellcrank as bc

ARM = """<mujoco model="arm"><compiler angle="radian"/><worldbody>
<body name="upper"><joint name="shoulder" axis="0 1 0" range="-1 1"/>
<inertial pos="0.2 0 0" mass="2" diaginertia="0.01 0.02 0.02"/>
<body name="lower" pos="0.4 0 0" euler="0 0 1.5705"><joint name="elbow" axis="0 1 0"/>
<inertial pos="0.1 0 0" mass="0.5" diaginertia="0.001 0.002 0.002"/></body></body></worldbody>
<actuator><motor name="drive" joint="shoulder" gear="-25" ctrlrange="-2 2"/><motor name="direct" joint="elbow"
ctrlrange="-9 9"/></actuator></mujoco>"""


def written(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    return path


def test_check_gives_no_advice_about_a_urdf_that_nobody_wrote(tmp_path):
    messages = [f"{one.where}: {one.message}" for one in bc.check_urdf(written(tmp_path))]
    assert not [text for text in messages if "velocity limit" in text or "right angle" in text or "effort" in text]
    (tmp_path / "arm.xml").write_text(ARM.replace('ctrlrange="-2 2"', ""))
    messages = [f"{one.where}: {one.message}" for one in bc.check_urdf(tmp_path / "arm.xml")]
    assert "joint 'shoulder': has no effort limit; no margin can be computed" in messages


def test_a_sizing_says_what_the_motors_behind_the_gears_of_the_file_deliver(tmp_path):
    robot = bc.load_robot(written(tmp_path))
    motion = bc.waypoints(robot, times=[0, 1], positions=[{"shoulder": -0.3}, {"shoulder": 0.4}], samples=21)
    sizing = bc.size(tmp_path / "arm.xml", motion)
    (note,) = [text for text in sizing.warnings if "gears" in text]
    assert "direct" not in note
    shoulder = sizing.joint("shoulder")
    assert f"drive {shoulder.peak_torque / 25:.4g} N m and {shoulder.peak_speed * 25:.4g} rad/s (gear -25)" in note
    assert "joint" in note and shoulder.effort_limit == pytest.approx(50.0)
    moved = bc.size(tmp_path / "arm.xml", motion, {"shoulder": bc.Actuator(30.0, 1.0, 2.0, 300.0, 400.0)})
    assert not [text for text in moved.warnings if "gears" in text]
