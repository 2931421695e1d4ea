"""Robot configurations: what they say, and one sentence for what is wrong with one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from two_link import CONTINUOUS

import bellcrank as bc
from bellcrank.errors import BellcrankError, InputError, UnreachableError
from bellcrank.motion.sampled.csv_file import write_motion
from bellcrank.robot.model.payload import Payload
from bellcrank.scene.robot_config import names, read_config
from bellcrank.sizing.size import size

URDF = str(names()["planar_2r"].parent.parent / "urdf" / "planar_2r.urdf")
CIRCLE = {
    "kind": "circle",
    "frame": "tip",
    "center": [1.2, 1.2, 0],
    "radius": 0.2,
    "duration": 10,
    "start": {"elbow": -1.0},
}
DRIVE = {"ratio": 100, "rated_torque": 1, "peak_torque": 2, "rated_speed": 300, "max_speed": 400}


def card_with(folder: Path, **keys: Any) -> Path:
    path = folder / "card.yaml"
    path.write_text(yaml.safe_dump({"urdf": URDF, "gravity": [0, -9.81, 0]} | keys))
    return path


@pytest.mark.parametrize(("motion", "branch"), [("elbow_up", -1), ("elbow_down", 1)])
def test_the_bundled_circle_gives_the_lectures_extremes(motion: str, branch: int) -> None:
    config = bc.load_scene("planar_2r").config
    robot = config.robot()
    sizing = size(robot, config.motion(robot, motion), config.actuators)
    found = [
        value
        for name in ("shoulder", "elbow")
        for value in (sizing.joint(name).min_torque, sizing.joint(name).max_torque)
    ]
    np.testing.assert_allclose(found, CONTINUOUS[branch], rtol=1e-8)


@pytest.mark.tier2
@pytest.mark.parametrize("name", ["planar_2r", "geared_pendulum", "ur5", "panda", "xarm7"])
def test_bundled_cards_are_sized_and_stay_inside_their_limits(name: str) -> None:
    config = bc.load_scene(name).config
    robot = config.robot()
    motions = [config.motion(robot, motion) for motion in config.motions]
    sizing = size(robot, motions, config.actuators)
    assert sizing.inside, sizing.exceeded
    assert set(config.actuators) <= set(robot.joint_names)
    for joint in sizing.joints:
        for peak in joint.peaks.values():
            assert np.isfinite(peak.value) and np.isfinite(peak.time) and np.isfinite(peak.position).all()


def test_the_geared_pendulum_holds_9_81() -> None:
    config = bc.load_scene("geared_pendulum").config
    robot = config.robot()
    line = size(robot, config.motion(robot, "lift_and_return"), config.actuators).joint("shoulder")
    assert line.peak_torque == pytest.approx(9.81, rel=1e-9)
    assert line.shaft is not None and line.shaft.peak_torque.value == pytest.approx(0.24525, rel=1e-6)
    # All that is put in for lifting comes back: m g l = 9.81 J.
    assert line.motoring_energy == pytest.approx(9.81, rel=1e-6) and line.regenerated_energy == pytest.approx(
        9.81, rel=1e-6
    )


def test_payloads_frames_friction_and_rotors_reach_the_robot(tmp_path: Path) -> None:
    path = card_with(
        tmp_path,
        payloads=[{"mass": "500 g", "frame": "hook"}],
        frames={"hook": {"link": "link_2", "xyz": ["500 mm", 0, 0]}},
        friction={"elbow": {"viscous": 2.0, "coulomb": 1.0}},
        actuators={"elbow": DRIVE | {"rotor_inertia": 1e-4}},
    )
    config = read_config(path)
    robot, plain = config.robot([Payload(1.0, "tip")]), read_config(card_with(tmp_path)).robot()
    held = robot.gravity_torque(np.zeros(2)) - plain.gravity_torque(np.zeros(2))
    np.testing.assert_allclose(held, 9.81 * np.array([0.5 * 1.5 + 2.0, 0.5 * 0.5 + 1.0]), rtol=1e-12)
    np.testing.assert_allclose([robot.viscous[1], robot.coulomb[1], robot.rotor_inertia[1]], [2.0, 1.0, 1.0])


def test_every_kind_of_motion(tmp_path: Path) -> None:
    swing = {
        "kind": "waypoints",
        "times": [0, "500 ms", 1],
        "positions": [{"elbow": "30 deg"}, [0.2, 0.3], {"shoulder": 0.1}],
    }
    path = card_with(
        tmp_path,
        motions={
            "circle": CIRCLE,
            "swing": swing,
            "rest": {"kind": "dwell", "position": {"elbow": -1}, "duration": 2},
            "line": {
                "kind": "line",
                "frame": "tip",
                "begin": [1.2, 1.0, 0],
                "end": [1.0, 1.2, 0],
                "duration": 1,
                "start": {"elbow": 1},
            },
            "file": {"kind": "csv", "file": "swing.csv"},
            "all": {"kind": "join", "parts": ["swing", {"kind": "dwell", "duration": 0.5}]},
        },
    )
    config = read_config(path)
    robot = config.robot()
    write_motion(config.motion(robot, "swing"), tmp_path / "swing.csv")
    motions = {name: config.motion(robot, name) for name in config.motions}
    assert motions["swing"].position[0] == pytest.approx([0, np.pi / 6])
    assert motions["rest"].duration == 2 and motions["all"].duration == pytest.approx(1.5)
    np.testing.assert_allclose(motions["file"].position, motions["swing"].position)
    np.testing.assert_allclose(robot.frame_pose("tip", motions["line"].position[-1])[0], [1.0, 1.2, 0], atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"urdf": "gone.urdf"}, "urdf .line .*there is no file"),
        ({"urdf": "ur55"}, "did you mean 'ur5'"),
        ({"urdf": 3}, "expected a text"),
        ({"motons": {}}, "did you mean 'motions'"),
        ({"gravity": [0, 1]}, "a list of 3 numbers"),
        ({"gravity": [0, 0, "x"]}, "m/s"),
        ({"friction": "urfd"}, "did you mean 'urdf'"),
        ({"friction": {"elbow": {"viscous": -1}}}, "friction.elbow.viscous"),
        ({"floating_base": "maybe"}, "true or false"),
        ({"payloads": {}}, "a list of mappings"),
        ({"payloads": [{"mass": 1}]}, "'frame' is missing"),
        ({"payloads": [{"mass": -1, "frame": "tip"}]}, r"payloads\[1\].mass"),
        ({"frames": {"a": {"xyz": [0, 0, 0]}}}, "'link' is missing"),
        (
            {"payloads": [{"mass": 1, "frame": "tip", "inertia": [1, 0, 0, 0, 0, 0]}]},
            "no rigid body has the inertia",
        ),
        (
            {"actuators": {"elbow": {"ratio": 3, "rated_torqe": 1}}},
            "'rated_torque' is missing; did you mean .* by 'rated_torqe'",
        ),
        ({"actuators": {"elbow": {"ratio": 3}}}, "actuators.elbow.*'rated_torque' is missing"),
        ({"motions": {"m": {"kind": "spiral"}}}, "unknown kind 'spiral'"),
        ({"motions": {"m": {}}}, "'kind' is missing"),
        ({"motions": {"m": CIRCLE | {"radius": "3 kg"}}}, "motions.m.radius .*expected a length"),
        ({"motions": {"m": CIRCLE | {"radius": -1}}}, "more than 0 m"),
        ({"motions": {"m": CIRCLE | {"radus": 1}}}, "did you mean 'radius'"),
        ({"motions": {"m": CIRCLE | {"profile": "trapez"}}}, "did you mean 'trapezoid'"),
        ({"motions": {"m": CIRCLE | {"samples": 1}}}, "2 or more"),
        (
            {"motions": {"m": {"kind": "circle", "frame": "tip", "center": [1, 1, 0], "radius": 1}}},
            "'duration' is missing",
        ),
        ({"motions": {"m": CIRCLE | {"start": 3}}}, "joint: angle"),
        ({"motions": {"m": CIRCLE | {"start": {"elbow": "x"}}}}, "joint 'elbow': expected an angle"),
        (
            {"motions": {"m": {"kind": "waypoints", "times": [0, 1], "positions": [{}]}}},
            "one posture for each of the 2 times",
        ),
        (
            {"motions": {"m": {"kind": "waypoints", "times": [1, 0], "positions": [{}, {}]}}},
            "increasing times",
        ),
        ({"motions": {"m": {"kind": "join", "parts": ["n"]}}}, "unknown motion 'n'"),
        ({"motions": {"m": {"kind": "join", "parts": ["m"]}}}, "joined to itself"),
        ({"motions": {"m": {"kind": "dwell", "duration": 0}}}, "more than 0 s"),
        ({"motions": [1]}, "expected a mapping"),
    ],
)
def test_broken_cards_are_one_sentence(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    path = card_with(tmp_path, **change)
    with pytest.raises(InputError, match=message) as caught:
        read_config(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"motions": {"m": CIRCLE | {"frame": "tp"}}}, "did you mean 'tip'"),
        ({"motions": {"m": CIRCLE | {"start": {"elbw": 1}}}}, "did you mean 'elbow'"),
        ({"motions": {"m": CIRCLE | {"center": [2.5, 0, 0]}}}, "motions.m"),
        ({"motions": {"m": {"kind": "csv", "file": "none.csv"}}}, "none.csv"),
        ({"motions": {"m": {"kind": "dwell", "duration": 1}}}, "needs a 'position'"),
        ({"payloads": [{"mass": 1, "frame": "hand"}]}, "hand"),
        ({"actuators": {"elbw": DRIVE | {"rotor_inertia": 1e-5}}}, "elbw"),
        ({"frames": {"a": {"link": "nowhere"}}}, "nowhere"),
        ({"friction": {"wrist": {"viscous": 1}}}, "wrist"),
    ],
)
def test_what_only_the_robot_can_tell_names_the_card_too(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    path = card_with(tmp_path, **change)
    with pytest.raises((InputError, UnreachableError), match=message) as caught:
        config = read_config(path)
        config.motion(config.robot(), "m")
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_names_paths_and_urdfs_all_load(tmp_path: Path) -> None:
    assert bc.load_scene("ur5").config.motions and bc.load_scene(names()["ur5"]).config.motions
    bare = bc.load_scene(URDF).config
    assert not bare.motions and bare.robot().joint_names == ("shoulder", "elbow")
    assert bc.load_scene("talos").config.urdf.name == "talos_reduced.urdf"
    for wrong, message in (
        ("planar_2rr", "did you mean 'planar_2r'"),
        ("", "expected the path"),
        ("a\0b", "expected the path"),
        (tmp_path / "no.yaml", "no such file"),
        (tmp_path / "no.urdf", "no such file"),
    ):
        with pytest.raises(InputError, match=message):
            bc.load_scene(wrong)
    with pytest.raises(InputError, match="unknown motion 'elbow_upp'; did you mean 'elbow_up'"):
        bc.load_scene("planar_2r").config.motion(bc.load_scene("planar_2r").config.robot(), "elbow_upp")


leaves = (
    st.none()
    | st.booleans()
    | st.integers(-5, 5)
    | st.floats()
    | st.text(max_size=6)
    | st.sampled_from(["tip", "circle", "join"])
)
KEYS = [
    "urdf",
    "motions",
    "actuators",
    "payloads",
    "frames",
    "friction",
    "kind",
    "parts",
    "m",
    "elbow",
    "start",
    "times",
    "positions",
    "motor",
    "gear",
    "assume",
    "curve",
]
trees = st.recursive(
    leaves,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(KEYS), inner, max_size=4),
    max_leaves=12,
)


@pytest.mark.tier2
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.dictionaries(
        st.sampled_from(["gravity", "motions", "actuators", "payloads", "frames", "friction", "floating_base"]),
        trees,
        max_size=3,
    )
)
def test_no_card_raises_anything_but_our_own_errors(tmp_path: Path, keys: dict[str, Any]) -> None:
    try:
        read_config(card_with(tmp_path, **keys))
    except BellcrankError as error:
        assert "\n" not in str(error)
