"""The shipped delta robots over their picks: the frame's path, the rods' forces, and statics of the platform.

The motion of each, which inverse kinematics finds, and its sizing are computed once.
"""

import csv

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage

pytestmark = pytest.mark.tier2

ROBOTS = {  # with the prescribed coordinates, the weight that hangs on the rods, N, and the platform's pins by rod
    "delta": ("xyz", (0.8 + 0.5) * 9.81, {f"rod_{k}{side}": f"ball_{k}{side}" for k in (1, 2, 3) for side in "ab"}),
    "planar_delta": (
        "xy",
        (0.65 + 0.5) * 9.81,
        {"left_rod": "pin_left", "middle_rod": "pin_middle", "right_rod": "pin_right"},
    ),
}


@pytest.fixture(scope="module", params=ROBOTS)
def name(request):
    return request.param


@pytest.fixture(scope="module")
def motion(name):
    return Linkage(bc.load_scene(name)).motion("pick")


@pytest.fixture(scope="module")
def sizing(name):
    return bc.size(name)


def test_the_tool_follows_its_lines_and_comes_back(name, motion):
    robot = bc.load_scene(name).robot
    axes = ["xyz".index(axis) for axis in ROBOTS[name][0]]
    up = axes[-1]
    tool = np.array([robot.frame_pose("tool", q)[0] for q in motion.position])
    corners = [tool[np.argmin(np.abs(motion.time - t))][axes] for t in (0.0, 0.08, 0.28, 0.36, 0.48, 0.68, 0.76)]
    assert motion.time[-1] == pytest.approx(0.8)
    np.testing.assert_allclose(corners[0], corners[-1], atol=1e-10)
    np.testing.assert_allclose(corners[1], corners[5], atol=1e-10)
    assert tool[:, up].max() - tool[:, up].min() == pytest.approx(0.05, abs=1e-10)
    across = (motion.time > 0.08) & (motion.time < 0.28)
    np.testing.assert_allclose(tool[across, up], tool[across, up][0], atol=1e-10)
    pose = [robot.frame_pose("platform", q)[1] for q in motion.position]
    np.testing.assert_allclose(pose, np.tile(np.eye(3), (len(pose), 1, 1)), atol=1e-10)  # the rods keep it level


def test_the_rods_carry_the_platform_s_weight_and_accelerate_it(name, motion, sizing):
    history = sizing.histories["pick"]
    _, weight, pins = ROBOTS[name]
    mass, up = weight / 9.81, "xyz".index(ROBOTS[name][0][-1])
    scene = bc.load_scene(name)
    robot = scene.robot
    names = [owner for owner, _ in history.multiplier_names]
    assert len(names) == history.multipliers.shape[1] and np.array_equal(motion.time, history.time)
    joint = next(joint for joint in robot.joints if joint.name == "platform_pose")
    for k in range(0, len(motion.time), 50):
        force = np.zeros(3)
        for rod, pin in pins.items():
            entry = next(c for c in scene.data["constraints"] if c["name"] == rod)
            far = robot.frame_pose(entry["frame_a"], motion.position[k])[0]
            near = robot.frame_pose(pin, motion.position[k])[0]
            assert np.linalg.norm(near - far) == pytest.approx(entry["length"], abs=1e-10)
            force += history.multipliers[k, names.index(rod)] * (near - far) / entry["length"]
        needed = np.zeros(3)
        needed[: len(ROBOTS[name][0])] = mass * motion.acceleration[k, joint.v : joint.v + len(ROBOTS[name][0])]
        needed[up] += weight
        np.testing.assert_allclose(force, needed, rtol=0, atol=1e-9 * max(weight, np.abs(needed).max()))


def test_the_command_writes_the_forces_in_the_rods_and_reads_its_history_again(name, sizing, tmp_path, capsys):
    assert main(["size", name, "--out", str(tmp_path / "sizing")]) == 0
    assert "All inside" in capsys.readouterr().out
    with (tmp_path / "sizing" / "constraint_forces_pick.csv").open(encoding="utf-8") as file:
        header = next(csv.reader(file))
        table = np.loadtxt(file, delimiter=",")
    assert header == ["time [s]", *(f"{entry['name']} push [N]" for entry in bc.load_scene(name).data["constraints"])]
    history = sizing.histories["pick"]
    assert np.array_equal(table, np.column_stack([history.time, history.multipliers]))
    again = bc.size(name, tmp_path / "sizing" / "history_pick.csv")
    for joint, line in zip(again.joints, sizing.joints, strict=True):
        assert joint.peak_torque == pytest.approx(line.peak_torque, rel=1e-7)  # peaks lie between rows
