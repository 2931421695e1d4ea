"""Sizing against the lecture's closed forms and against brute force."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq
from two_link import CONTINUOUS, TwoLink, circle_states

from bellcrank.actuators.actuator import Actuator
from bellcrank.errors import InputError
from bellcrank.motion.generators.waypoints import dwell, waypoints
from bellcrank.motion.motion import Motion, join
from bellcrank.robot.load import load_robot
from bellcrank.robot.model.payload import Payload
from bellcrank.sizing.size import size
from bellcrank.sizing.sizing_files import json_text
from bellcrank.sizing.tables import table, verdict

GRAVITY = (0.0, -9.81, 0.0)  # of the lecture, along -y
DRIVE = Actuator(
    ratio=100.0,
    efficiency=0.8,
    rotor_inertia=1e-4,
    gear_inertia=2e-5,
    rated_torque=3.0,
    peak_torque=6.0,
    rated_speed=50.0,
    max_speed=100.0,
    safety_factor=1.2,
    motor_efficiency=0.9,
)


def lecture_circle(robot: Any, branch: int, samples: int = 1001, name: str = "circle") -> Motion:
    phi = np.linspace(0.0, 2 * np.pi, samples)
    return Motion(robot.joints, phi / (2 * np.pi) * 10.0, *circle_states(phi, branch), name=name)


def dense(branch: int, count: int = 400_001) -> Any:
    return circle_states(np.linspace(0.0, 2 * np.pi, count), branch)


@pytest.mark.parametrize("branch", [-1, 1])
def test_peaks_are_the_lectures_continuous_extremes(branch: int) -> None:
    robot: Any = TwoLink()
    sizing = size(robot, lecture_circle(robot, branch))
    found = [
        value
        for name in ("shoulder", "elbow")
        for value in (sizing.joint(name).min_torque, sizing.joint(name).max_torque)
    ]
    np.testing.assert_allclose(found, CONTINUOUS[branch], rtol=1e-8)


def test_peaks_come_with_the_posture_and_time_they_occur_at() -> None:
    robot: Any = TwoLink()
    motion = lecture_circle(robot, -1)
    sizing = size(robot, motion)
    for joint in sizing.joints:
        for name in ("max_torque", "min_torque"):
            peak = joint.peaks[name]
            q, v, a = motion.at(peak.time)
            assert robot.inverse_dynamics(q, v, a)[0, robot.joint_names.index(joint.name)] == pytest.approx(
                peak.value, rel=1e-9
            )
            np.testing.assert_allclose(peak.position, q)


@pytest.mark.tier2
@pytest.mark.parametrize("branch", [-1, 1])
def test_every_figure_at_the_joint_agrees_with_brute_force(branch: int) -> None:
    robot: Any = TwoLink(viscous=0.7, coulomb=0.0)
    sizing = size(robot, lecture_circle(robot, branch))
    q, v, a = dense(branch)
    tau = robot.inverse_dynamics(q, v, a)
    wrench = robot.joint_reactions(q, v, a)
    for k, joint in enumerate(sizing.joints):
        power = tau[:, k] * v[:, k]
        mean = lambda x: np.trapezoid(x) / (len(x) - 1)  # noqa: E731
        expected = {
            "peak_torque": np.abs(tau[:, k]).max(),
            "rms_torque": np.sqrt(mean(tau[:, k] ** 2)),
            "peak_speed": np.abs(v[:, k]).max(),
            "mean_speed": mean(np.abs(v[:, k])),
            "peak_motoring_power": power.max(),
            "peak_regenerating_power": -power.min(),
            "peak_power": np.abs(power).max(),
            "motoring_energy": 10 * mean(np.maximum(power, 0)),
            "regenerated_energy": 10 * mean(np.maximum(-power, 0)),
            "largest_inertia": robot.mass_matrix(q[::40])[:, k, k].max(),
            "peak_bearing_force": np.linalg.norm(wrench[:, k, :3], axis=1).max(),
        }
        for name, value in expected.items():
            assert getattr(joint, name) == pytest.approx(
                value, rel=2e-5 if "energy" in name or "mean" in name else 1e-7
            ), name
        assert joint.peak_tilting_moment == pytest.approx(0.0, abs=1e-12)
        row = np.abs(tau[:, k]).argmax()
        assert joint.friction_share == pytest.approx(abs(0.7 * v[row, k] / tau[row, k]), rel=1e-3)
    total = (tau * v).sum(axis=1)
    assert sizing.peak_supply_power == pytest.approx(total.max(), rel=1e-7)
    assert sizing.peak_regeneration == pytest.approx(-total.min(), rel=1e-7)


def test_the_work_of_a_closed_motion_without_friction_is_nothing() -> None:
    robot: Any = TwoLink()
    sizing = size(robot, lecture_circle(robot, 1))
    given = sum(joint.motoring_energy for joint in sizing.joints)
    back = sum(joint.regenerated_energy for joint in sizing.joints)
    assert given == pytest.approx(back, rel=1e-5)


def test_shaft_figures_agree_with_brute_force() -> None:
    robot = load_robot("planar_2r", GRAVITY, rotor_inertia={"shoulder": DRIVE.reflected_inertia})
    sizing = size(robot, lecture_circle(robot, 1), {"shoulder": DRIVE})
    q, v, a = dense(1, 100_001)
    load = TwoLink().inverse_dynamics(q, v, a)
    shaft = np.where(load[:, 0] * v[:, 0] >= 0, load[:, 0] / 80.0, load[:, 0] * 0.8 / 100.0) + 1.2e-4 * 100 * a[:, 0]
    found = sizing.joint("shoulder").shaft
    assert found is not None and sizing.joint("elbow").shaft is None
    assert found.peak_torque.value == pytest.approx(np.abs(shaft).max(), rel=1e-8)
    assert found.rms_torque == pytest.approx(np.sqrt(np.trapezoid(shaft**2) / 100_000), rel=2e-5)
    assert found.peak_speed.value == pytest.approx(100 * np.abs(v[:, 0]).max(), rel=1e-8)
    assert found.inertia_ratio == pytest.approx(TwoLink().mass_matrix(q[::10])[:, 0, 0].max() / 1.2, rel=1e-7)
    assert found.margins["peak torque"] == pytest.approx(1 - 1.2 * np.abs(shaft).max() / 6.0, rel=1e-7)
    assert found.tightest == min(found.margins, key=lambda name: found.margins[name])
    power = shaft * 100 * v[:, 0]
    both = np.where(power > 0, power / 0.9, power * 0.9) + load[:, 1] * v[:, 1]
    assert sizing.peak_supply_power == pytest.approx(both.max(), rel=1e-6)
    assert sizing.peak_regeneration == pytest.approx(-both.min(), rel=1e-6)


def test_a_mass_tolerance_gives_the_worst_of_all_scaled_masses() -> None:
    robot: Any = TwoLink()
    sizing = size(robot, lecture_circle(robot, -1), mass_tolerance=0.1)
    shares = robot.link_torques(*dense(-1, 20_001))
    corners = [
        scale[0] * shares[:, 0] + scale[1] * shares[:, 1] for scale in ((0.9, 0.9), (0.9, 1.1), (1.1, 0.9), (1.1, 1.1))
    ]
    for k, joint in enumerate(sizing.joints):
        assert joint.max_torque == pytest.approx(max(tau[:, k].max() for tau in corners), rel=1e-7)
        assert joint.min_torque == pytest.approx(min(tau[:, k].min() for tau in corners), rel=1e-7)
        assert joint.rms_torque >= max(np.sqrt(np.trapezoid(tau[:, k] ** 2) / 20_000) for tau in corners) * (1 - 1e-6)


def test_peaks_at_a_jump_of_acceleration_take_the_worse_side() -> None:
    robot: Any = TwoLink()
    time = np.array([0.0, 1.0, 1.0, 2.0])
    a = np.array([[1.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [-1.0, 0.0]])
    v = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    q = np.array([[1.0, 0.0], [1.5, 0.0], [1.5, 0.0], [2.0, 0.0]])
    sizing = size(robot, Motion(robot.joints, time, q, v, a))
    t = np.linspace(0, 1, 200_001)
    zero = np.zeros_like(t)
    states = [(1 + t**2 / 2, t, 1.0), (1.5 + t - t**2 / 2, 1 - t, -1.0)]
    tau = [robot.inverse_dynamics(*(np.stack([x + zero, zero], axis=1) for x in state)) for state in states]
    power = [x[:, 0] * state[1] for x, state in zip(tau, states, strict=True)]
    shoulder = sizing.joint("shoulder")
    assert shoulder.max_torque == pytest.approx(max(x[:, 0].max() for x in tau), rel=1e-9)
    assert shoulder.min_torque == pytest.approx(min(x[:, 0].min() for x in tau), rel=1e-9)
    assert shoulder.rms_torque == pytest.approx(np.sqrt(sum(np.trapezoid(x[:, 0] ** 2, t) for x in tau) / 2), rel=1e-7)
    assert shoulder.peak_motoring_power == pytest.approx(max(x.max() for x in power), rel=1e-9)


@pytest.mark.tier2
def test_coulomb_friction_is_counted_in_full_just_beside_a_reversal() -> None:
    robot: Any = TwoLink(coulomb=5.0)
    time = np.linspace(0.0, 2.0, 21)
    q = np.stack([0.3 * np.cos(np.pi * time), 0 * time], axis=1)
    v = np.stack([-0.3 * np.pi * np.sin(np.pi * time), 0 * time], axis=1)
    a = np.stack([-0.3 * np.pi**2 * np.cos(np.pi * time), 0 * time], axis=1)
    sizing = size(robot, Motion(robot.joints, time, q, v, a))
    t = np.linspace(0.0, 2.0, 2_000_001)
    th, w, al = 0.3 * np.cos(np.pi * t), -0.3 * np.pi * np.sin(np.pi * t), -0.3 * np.pi**2 * np.cos(np.pi * t)
    tau = robot.inverse_dynamics(*(np.stack([x, 0 * t], axis=1) for x in (th, w, al)))[:, 0]
    assert sizing.joint("shoulder").max_torque == pytest.approx(tau.max(), rel=1e-5)
    assert sizing.joint("shoulder").min_torque == pytest.approx(tau.min(), rel=1e-5)


def test_several_motions_give_the_worst_of_each_and_dwells_lower_the_mean() -> None:
    robot: Any = TwoLink()
    up, down = lecture_circle(robot, -1, name="up"), lecture_circle(robot, 1, name="down")
    both, one, two = size(robot, [up, down]), size(robot, up), size(robot, down)
    for joint in both.joints:
        pair = one.joint(joint.name), two.joint(joint.name)
        assert joint.max_torque == max(line.max_torque for line in pair)
        assert joint.rms_torque == max(line.rms_torque for line in pair)
    assert both.joint("shoulder").peaks["peak_torque"].motion == "down"
    assert both.joint("elbow").peaks["peak_torque"].motion == "up"
    rest = dwell(robot, up.position[-1], 10.0)
    cycle = size(robot, join(up, rest))
    assert cycle.joint("elbow").mean_speed == pytest.approx(one.joint("elbow").mean_speed / 2, rel=1e-9)
    assert cycle.joint("elbow").peak_torque == pytest.approx(one.joint("elbow").peak_torque)
    held = robot.gravity_torque(up.position[-1])[0, 1]
    assert cycle.joint("elbow").rms_torque == pytest.approx(
        np.sqrt((one.joint("elbow").rms_torque ** 2 + held**2) / 2), rel=1e-9
    )


def test_margins_are_signed_and_absent_without_a_limit() -> None:
    robot: Any = TwoLink()
    robot.effort_limit = np.array([200.0, np.inf])
    robot.lower = np.array([-np.inf, 0.5])
    robot.upper = np.array([np.inf, 1.3])
    sizing = size(robot, lecture_circle(robot, 1))
    shoulder, elbow = sizing.joint("shoulder"), sizing.joint("elbow")
    assert shoulder.effort_margin == pytest.approx(1 - 242.272603138 / 200.0)
    assert shoulder.velocity_margin is None and elbow.effort_margin is None and shoulder.position_margin is None
    assert elbow.velocity_margin is not None and elbow.velocity_margin > 0
    assert elbow.position_margin is not None and elbow.position_margin < 0
    assert not sizing.inside and any("needs 242.3 N m" in text for text in sizing.exceeded)


def test_motions_of_one_name_are_told_apart() -> None:
    robot: Any = TwoLink()
    sizing = size(robot, [lecture_circle(robot, -1), lecture_circle(robot, 1)])
    assert sizing.motions == ("circle", "circle (2)")


def test_warnings_of_motions_are_carried() -> None:
    robot: Any = TwoLink()
    assert any("moving" in warning for warning in size(robot, lecture_circle(robot, -1)).warnings)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"motions": []}, "there is no motion"),
        ({"actuators": {"sholder": DRIVE}}, "did you mean 'shoulder'"),
        ({"mass_tolerance": "10%"}, "'mass_tolerance': .* found '10%'"),
        ({"mass_tolerance": None}, "argument 'mass_tolerance': expected"),
        ({"mass_tolerance": True}, "argument 'mass_tolerance': expected"),
        ({"motions": "elbow_up"}, "argument 'motions': expected a list of Motions, found 'elbow_up'"),
        ({"motions": 3}, "argument 'motions': expected a list of Motions"),
        ({"motions": ["elbow_up"]}, "found 'elbow_up'; it is entry 1"),
        ({"actuators": [DRIVE]}, "argument 'actuators': expected a mapping .* found a list"),
        ({"actuators": {"shoulder": {"ratio": 100}}}, "actuators..shoulder..': expected an Actuator, found a mapping"),
        ({"mass_tolerance": 1.5}, "argument 'mass_tolerance': expected"),
        ({"mass_tolerance": float("nan")}, "argument 'mass_tolerance': expected"),
    ],
)
def test_bad_arguments_are_named(arguments: dict[str, Any], message: str) -> None:
    robot: Any = TwoLink()
    with pytest.raises(InputError, match=message):
        size(robot, **({"motions": lecture_circle(robot, -1, 11)} | arguments))


def test_a_rotor_inertia_given_twice_with_two_values_is_refused() -> None:
    robot = load_robot("planar_2r", GRAVITY, rotor_inertia={"shoulder": 0.5})
    with pytest.raises(InputError, match=r"'shoulder' is given twice.*0\.5 kg m².*1\.2 kg m².*without rotor_inertia"):
        size(robot, lecture_circle(robot, -1, 11), actuators={"shoulder": DRIVE})
    equal = {"shoulder": DRIVE.reflected_inertia, "elbow": 0.7}  # and without an actuator at the elbow
    same, none = load_robot("planar_2r", GRAVITY, rotor_inertia=equal), load_robot("planar_2r", GRAVITY)
    peaks = [
        size(one, lecture_circle(one, -1, 101), actuators={"shoulder": DRIVE}).joint("shoulder").shaft
        for one in (same, none)
    ]
    assert peaks[0] and peaks[1] and peaks[0].peak_torque.value == pytest.approx(peaks[1].peak_torque.value, rel=1e-12)


def test_a_sizing_says_what_was_sized() -> None:
    robot = load_robot("planar_2r", GRAVITY, payloads=[Payload(2.5, "tip")])
    sizing = size(robot, lecture_circle(robot, -1, 101), actuators={"elbow": DRIVE}, mass_tolerance=0.125)
    assert sizing.gravity == (0.0, -9.81, 0.0) and sizing.payloads == ((2.5, "tip"),)
    assert sizing.joints_without_actuator == ("shoulder",)
    text = table(sizing)
    for piece in (
        "gravity (0, -9.81, 0) m/s²",
        "payload 2.5 kg @ tip",
        "±12.5 %: each link as a whole",
        "without an actuator: shoulder",
    ):
        assert piece in text.split("\n")[1]
    document = json.loads(json_text(sizing))
    assert document["gravity"] == [0.0, -9.81, 0.0] and document["payloads"] == [{"mass": 2.5, "frame": "tip"}]
    assert document["mass_tolerance_percent"] == 12.5 and document["joints_without_actuator"] == ["shoulder"]
    assert sizing.warnings[0] in document["warnings"]


def test_the_verdict_names_joints_without_a_drive_where_others_have_one() -> None:
    robot = load_robot("planar_2r", GRAVITY)
    motion = lecture_circle(robot, -1, 101)
    strong = replace(DRIVE, rated_torque=300.0, peak_torque=600.0)
    text = {
        count: verdict(size(robot, motion, actuators=dict.fromkeys(("elbow", "shoulder")[:count], strong)))
        for count in range(3)
    }
    assert all("All inside" in each for each in text.values())
    assert text[1].endswith("Joints without an actuator, compared with the URDF's limits only: shoulder.")
    assert "without an actuator" not in text[0] + text[2]


def test_speeds_that_look_like_rpm_are_pointed_out() -> None:
    robot = load_robot("planar_2r", GRAVITY)
    fast = replace(DRIVE, rated_speed=1000.0, max_speed=3000.0)
    found = [text for text in size(robot, lecture_circle(robot, -1, 11), {"elbow": fast}).warnings if "rpm" in text]
    assert found == ["actuator of joint 'elbow': max_speed 3000 rad/s is 28648 rpm: was rpm meant? write '3000 rpm'"]
    assert DRIVE.doubts == ()


@pytest.mark.tier2
@pytest.mark.parametrize("seed", range(4))
def test_rms_and_peak_torques_are_those_of_plain_pinocchio_integrated_between_all_switches_of_the_gear(seed) -> None:
    """Gauss-Legendre panels between knots, each split where the speed or the load of a joint changes its sign."""
    rng = np.random.default_rng(seed)
    drives = {"shoulder": DRIVE, "elbow": replace(DRIVE, ratio=80.0, efficiency=0.65)}
    inertia = {name: one.reflected_inertia for name, one in drives.items()}
    robot = load_robot("planar_2r", GRAVITY, rotor_inertia=inertia, friction={"elbow": (0.4, 0.0)})  # viscous, Coulomb
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.4, 1.2, 5))])
    motion = waypoints(robot, times, rng.uniform(-1.5, 1.5, (6, 2)), samples=301)
    model = pin.buildModelFromUrdf(str(robot.source))
    model.gravity.linear = np.array(GRAVITY)
    data = model.createData()
    order = [model.joints[model.getJointId(name)].idx_v for name in robot.joint_names]

    def loads(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        states = [np.empty_like(x) for x in motion.at(t)]
        for given, placed in zip(motion.at(t), states, strict=True):
            placed[:, order] = given
        torque = np.array([pin.rnea(model, data, *row) for row in zip(*states, strict=True)])[:, order]
        _, v, a = motion.at(t)
        return torque + np.array([0.0, 0.4]) * v, v, a

    panels = np.unique(np.concatenate([np.linspace(*pair, 41) for pair in itertools.pairwise(times)]))
    torque, v, _ = loads(panels)
    cuts = []
    for k in range(2):
        for what, row in ((0, torque[:, k]), (1, v[:, k])):
            for i in np.flatnonzero(row[:-1] * row[1:] < 0.0):
                ends = float(panels[i]), float(panels[i + 1])
                cuts.append(brentq(lambda t, w=what, k=k: loads(np.array([t]))[w][0, k], *ends, xtol=1e-14))
    edges = np.unique(np.concatenate([panels, cuts]))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    half = np.diff(edges) / 2.0
    t = ((edges[1:] + edges[:-1])[:, None] / 2.0 + half[:, None] * nodes).ravel()
    torque, v, a = loads(t)
    sizing = size(robot, motion, drives)
    assert len(cuts) > 8
    for k, joint in enumerate(sizing.joints):
        one = drives[joint.name]
        share = np.where(torque[:, k] * v[:, k] >= 0.0, 1.0 / one.efficiency, one.efficiency)
        shaft = torque[:, k] * share / one.ratio + one.reflected_inertia / one.ratio * a[:, k]
        for found, row in ((joint.rms_torque, torque[:, k]), (joint.shaft.rms_torque, shaft)):
            mean = (half[:, None] * weights).ravel() @ row**2 / motion.duration
            assert found == pytest.approx(np.sqrt(mean), rel=1e-9)
        at = t[np.abs(torque[:, k]).argmax()] + np.linspace(-1e-2, 1e-2, 20_001)
        near = loads(np.clip(at, 0.0, motion.duration))[0][:, k]
        assert joint.peak_torque == pytest.approx(np.abs(near).max(), rel=1e-8)
