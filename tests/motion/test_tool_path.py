"""Paths of a frame along lines and arcs with blends: limits by independent differentiation, corners, refusals."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import bellcrank as bc
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.motion.generators.tool_path import arc

Array = NDArray[np.float64]
BEGIN = (1.2, 0.3, 0.0)
POINTS: list[Any] = [
    (1.2, 0.8, 0.0), (0.8, 0.8, 0.0), {"via": (0.6, 1.0, 0.0), "to": (0.8, 1.2, 0.0)}, (1.1, 1.2, 0.0),
]  # fmt: skip
LIMITS: dict[str, Any] = {"speed": 0.5, "acceleration": 4.0, "jerk": 60.0}


@pytest.fixture
def arm() -> bc.Robot:
    return bc.load_robot("planar_2r")


def along(arm: bc.Robot, points: list[Any] = POINTS, **given: Any) -> bc.Motion:
    return bc.tool_path(arm, "tip", points, **{"begin": BEGIN, "start": {"elbow": 1.0}, **LIMITS, **given})


@pytest.mark.tier2
@pytest.mark.parametrize("blend", [0.0, 0.02, 0.1])
def test_speed_acceleration_and_jerk_of_the_frame_are_kept_and_reached(arm: bc.Robot, blend: float) -> None:
    motion = along(arm, blend=blend, samples=2001)
    time = np.linspace(0.0, motion.duration, 40001)
    q, v, _ = motion.at(time)
    position = np.array([arm.frame_pose("tip", row)[0] for row in q[::20]])
    speed = np.asarray(arm.frame_velocity("tip", q, v)[0])
    step = time[1]
    by_difference = np.diff(position, axis=0) / (20.0 * step)
    assert by_difference == pytest.approx((speed[20::20] + speed[:-20:20]) / 2.0, abs=1e-4)
    acceleration = np.diff(speed, axis=0) / step
    jerk = np.diff(acceleration, axis=0) / step
    for values, limit in ((speed, 0.5), (acceleration, 4.0), (jerk, 60.0)):
        largest = np.linalg.norm(values, axis=1).max()
        assert largest <= limit * (1.0 + 2e-5)  # twice differenced at steps of 0.1 ms
        assert largest == pytest.approx(limit, rel=1e-3)


def test_a_blend_that_is_nearly_nothing_is_refused(tmp_path):
    points = [[1.5, 0.9, 0], [1.2, 1.2, 0], [0.9, 1.4, 0]]
    entry = {"kind": "tool_path", "frame": "tip", "start": {"shoulder": 0.3, "elbow": 0.5}, "points": points,
             "blend": 1e-223, "speed": 0.2, "acceleration": 1.0, "jerk": 10}  # fmt: skip
    (tmp_path / "arm.yaml").write_text(json.dumps({"urdf": "planar_2r", "motions": {"m": entry}}))
    with pytest.raises(bc.InputError, match=r"blend of 1e-223 m at point \d is shorter than 1e-09 of the segment"):
        bc.size(tmp_path / "arm.yaml")


def test_blends_pass_the_corner_at_the_distance_of_the_closed_form_and_need_no_stop(arm: bc.Robot) -> None:
    r = 0.1
    motion = along(arm, POINTS[:2], blend=r, samples=4001)
    position = np.array([arm.frame_pose("tip", q)[0] for q in motion.position])
    missed = np.linalg.norm(position - np.array(POINTS[0]), axis=1).min()
    assert missed == pytest.approx(5.0 / 32.0 * r * np.sqrt(2.0), rel=1e-4)  # a right angle
    speed = np.linalg.norm(np.asarray(arm.frame_velocity("tip", motion.position, motion.velocity)[0]), axis=1)
    assert speed[10:-10].min() > 0.0
    assert speed[np.abs(motion.time - motion.duration / 2.0) < 0.2].min() > 0.1


def test_without_a_blend_the_frame_stops_at_the_point_and_reaches_it(arm: bc.Robot) -> None:
    motion = along(arm, [POINTS[0], {"to": POINTS[1], "blend": 0.1}, POINTS[2]])
    position = np.array([arm.frame_pose("tip", q)[0] for q in motion.position])
    missed = np.linalg.norm(position - np.array(POINTS[0]), axis=1)
    row = int(np.argmin(missed))
    assert missed[row] < 1e-9
    assert np.abs(motion.velocity[row]).max() < 1e-12
    assert np.linalg.norm(position - np.array(POINTS[1]), axis=1).min() > 1e-4


@pytest.mark.tier2
def test_arcs_pass_through_their_three_points_in_order() -> None:
    rng = np.random.default_rng(11)
    for _ in range(50):
        begin, via, end = rng.uniform(-1.0, 1.0, (3, 3))
        segment, radius = arc(begin, via, end, "test")
        s = np.linspace(0.0, segment.length, 20001)
        x, first, second = segment.curve(s)
        assert x[[0, -1]] == pytest.approx(np.stack([begin, end]), abs=1e-9 * max(1.0, radius))
        assert np.linalg.norm(x - via, axis=1).min() < segment.length / 2e4
        assert np.linalg.norm(first, axis=1) == pytest.approx(1.0)
        assert np.linalg.norm(second, axis=1) == pytest.approx(1.0 / radius)


def test_a_closed_delta_robot_follows_a_path_with_a_blend_and_a_stop() -> None:
    pick = {
        "kind": "tool_path", "frame": "tool", "begin": [-0.2, -0.05, -0.85], "acceleration": 40, "jerk": 4000,
        "points": [[-0.2, -0.05, -0.75], [0.2, 0.05, -0.75], {"to": [0.2, 0.05, -0.85], "blend": 0},
                   [0.1, 0.05, -0.85]],
        "blend": 0.04, "samples": 101,
    }  # fmt: skip
    scene = bc.load_scene("delta", overrides={"motions": {"pick": pick}})
    motion = Linkage(scene).motion("pick")
    position = np.array([scene.robot.frame_pose("tool", q)[0] for q in motion.position])
    missed = {k: np.linalg.norm(position - np.array(p), axis=1).min()
              for k, p in enumerate([[-0.2, -0.05, -0.75], [0.2, 0.05, -0.75], [0.2, 0.05, -0.85]])}  # fmt: skip
    assert 0.001 < missed[0] < 5.0 / 16.0 * 0.04
    assert missed[2] < 1e-9
    v = np.asarray(scene.robot.frame_velocity("tool", motion.position, motion.velocity)[0])
    step = np.diff(motion.time)
    wide = step > 1e-9
    assert np.linalg.norm(np.diff(v, axis=0)[wide] / step[wide, None], axis=1).max() == pytest.approx(40.0, rel=1e-2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"points": []}, "points"),
        ({"points": [BEGIN]}, "point 1 is where the path is already"),
        ({"points": [(1.2, 0.8, 0.0), (1.2, 0.8, 0.0)]}, "point 2 is where the path is already"),
        ({"points": [{"via": (1.2, 0.5, 0.0), "to": (1.2, 0.8, 0.0)}]}, "lie on a line"),
        ({"points": [{"too": (1.2, 0.8, 0.0)}]}, "did you mean 'to'"),
        ({"points": [(1.2, np.nan, 0.0)]}, "points"),
        ({"blend": 0.3}, r"blend of 0.3 m at point 1 is longer than half of the segment before it.*at most 0.25 m"),
        ({"blend": -0.1}, "blend"),
        ({"acceleration": 0.0}, "acceleration"),
        ({"jerk": None}, "needs a limit of jerk"),
        ({"profile": "trapezoid"}, "cannot keep a limit of jerk"),
        ({"profile": "quintic"}, "profile"),
        ({"begin": (5.0, 0.0, 0.0)}, "reach"),
    ],
)
def test_wrong_arguments_are_refused(arm: bc.Robot, change: dict[str, Any], message: str) -> None:
    with pytest.raises(bc.BellcrankError, match=message):
        along(arm, **{"blend": 0.05, "points": POINTS, **change})


def test_the_entry_of_a_configuration_is_the_function(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(
        "name: m\nurdf: planar_2r\nmotions:\n  seam:\n    kind: tool_path\n    frame: tip\n    start: {elbow: 1}\n"
        "    begin: [1200 mm, 0.3, 0]\n    points: [[1.2, 0.8, 0], {to: [0.8, 0.8, 0], blend: 0},"
        " {via: [0.6, 1, 0], to: [0.8, 1.2, 0]}]\n    blend: 20 mm\n    speed: 0.5\n    acceleration: 4\n    jerk: 60\n"
    )
    config = bc.load_scene(tmp_path / "m.yaml").config
    robot = config.robot()
    found = config.motion(robot, "seam")
    same = along(robot, [POINTS[0], {"to": POINTS[1], "blend": 0.0}, POINTS[2]], blend=0.02)
    assert found.duration == pytest.approx(same.duration, rel=1e-12)
    assert found.position == pytest.approx(same.position, abs=1e-12)
    for wrong in ("[[1, 0]]", "[{via: [1, 0, 0]}]", "[{to: [1, 0, 0], bend: 1}]", "[{to: [1 kg, 0, 0]}]", "7"):
        (tmp_path / "w.yaml").write_text(
            f"name: w\nurdf: planar_2r\nmotions:\n  w: {{kind: tool_path, frame: tip, points: {wrong}, "
            "acceleration: 1, jerk: 1}\n"
        )
        with pytest.raises(bc.InputError, match="points"):
            bc.load_scene(tmp_path / "w.yaml")
