"""A Sizing in Python: how it prints, what it writes and draws, its histories, and what `bc.size` takes."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.errors import InputError
from bellcrank.replays.replay import film_of
from bellcrank.sizing.loads.joint_histories import MotionHistory
from bellcrank.sizing.plots import sizing_figures
from bellcrank.sizing.result import Sizing
from bellcrank.sizing.tables import table, verdict

SLIDER = """
<robot name="slider"><link name="base"/><link name="arm"><inertial><origin xyz="0.2 0 0"/><mass value="3"/>
<inertia ixx="0.05" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link><link name="rod"><inertial>
<mass value="2"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="50" velocity="5"/></joint>
<joint name="slide" type="prismatic"><parent link="arm"/><child link="rod"/><origin xyz="0.3 0 0"/><axis xyz="1 0 0"/>
<limit lower="-0.3" upper="0.3" effort="80" velocity="2"/></joint></robot>
"""
CONFIG = """
name: Slider
urdf: slider.urdf
payloads: [{mass: 0.5, frame: rod, cg: [0.1, 0, 0]}]
friction: {turn: {viscous: 0.3, coulomb: 0.6}, slide: {viscous: 4}}
motions:
  reach: {kind: waypoints, times: [0, 0.5, 1.1], positions: [{}, {turn: 0.8, slide: 0.2}, {turn: 0.2}], samples: 2001}
  hold: {kind: dwell, position: {turn: 0.4}, duration: 0.5}
actuators:
  turn: {ratio: 60, efficiency: 0.75, rotor_inertia: 2e-5, gear_inertia: 1e-5, rated_torque: 0.4, peak_torque: 1.2,
    rated_speed: 3000 rpm, max_speed: 5000 rpm, safety_factor: 1.2}
"""


@pytest.fixture(scope="module")
def config_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("slider")
    (folder / "slider.urdf").write_text(SLIDER, encoding="utf-8")
    (folder / "slider.yaml").write_text(CONFIG, encoding="utf-8")
    return folder / "slider.yaml"


@pytest.fixture(scope="module")
def sizing(config_file: Path) -> Sizing:
    return bc.size(config_file)


# ---- what bc.size takes


@pytest.mark.tier2
def test_a_configuration_sizes_as_its_robot_and_motions_do(config_file: Path, sizing: Sizing) -> None:
    scene = bc.load_scene(config_file)
    by_hand = bc.size(scene.robot, [scene.motion(name) for name in scene.motions], scene.actuators)
    assert sizing.joints == by_hand.joints and sizing.motions == ("reach", "hold") and sizing.robot == "Slider"
    for same in (scene, str(config_file)):
        assert bc.size(same) == sizing
    weightless = bc.size(bc.load_scene(config_file).with_overrides({"gravity": [0, 0, 0]}), "hold")
    assert weightless.gravity == (0.0, 0.0, 0.0) and weightless.joint("turn").peak_torque == pytest.approx(
        0.0, abs=1e-12
    )
    assert bc.size("planar_2r").joint("shoulder").max_torque == pytest.approx(242.272603138, rel=1e-8)


@pytest.mark.tier2
def test_motions_are_chosen_by_name_file_or_object(config_file: Path, sizing: Sizing, tmp_path: Path) -> None:
    one = bc.size(config_file, "hold")
    assert one.motions == ("hold",) and one.joint("slide").cycles == (sizing.joint("slide").cycles[1],)
    assert sizing.inputs is not None
    reach = sizing.inputs.motions[0]
    path = bc.write_motion(reach, tmp_path / "again.csv")
    both = bc.size(config_file, [reach, path])
    assert both.motions == ("reach", "again")
    assert both.joint("turn").cycles[0].rms_torque == pytest.approx(both.joint("turn").cycles[1].rms_torque, rel=1e-12)


@pytest.mark.tier2
def test_payloads_drives_and_tolerance_are_those_asked_for(config_file: Path, sizing: Sizing) -> None:
    heavier = bc.size(config_file, payloads=[bc.Payload(1.0, "rod")])
    assert heavier.payloads == ((0.5, "rod"), (1.0, "rod"))
    assert heavier.joint("turn").holding_torque == pytest.approx(sizing.joint("turn").holding_torque + 9.81 * 0.6)
    assert bc.size(config_file, actuators={}).joints_without_actuator == ("turn", "slide")
    assert bc.size(config_file, mass_tolerance=0.1).joint("turn").peak_torque > sizing.joint("turn").peak_torque
    robot = bc.load_scene(config_file).config.robot()
    carrying = bc.size(robot, bc.dwell(robot, {}, 1.0), payloads=[bc.Payload(2.0, "rod", (0.1, 0.0, 0.0))])
    plain = bc.size(robot, bc.dwell(robot, {}, 1.0))
    gained = carrying.joint("turn").peak_torque - plain.joint("turn").peak_torque
    assert gained == pytest.approx(2.0 * 9.81 * 0.4, rel=1e-9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"motions": "reahc"}, "did you mean 'reach'"),
        ({"motions": [3]}, "expected Motions, names of motions or paths of CSV files, found 3"),
        ({"motions": []}, "there is no motion"),
        ({"payloads": 3}, "expected a list of Payloads"),
        ({"payloads": ["1@rod"]}, "expected a list of Payloads, found '1@rod'"),
        ({"actuators": []}, "expected a mapping of joint names to Actuators"),
        ({"allow_massless": [1]}, "expected a list of names of links"),
    ],
)
def test_what_does_not_fit_is_named(config_file: Path, arguments: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        bc.size(config_file, **arguments)  # type: ignore[arg-type]


# ---- how it prints


def test_a_sizing_prints_its_table_and_its_repr_is_one_line(sizing: Sizing) -> None:
    text = str(sizing)
    assert text.startswith(table(sizing)) and text.endswith(verdict(sizing))
    assert "\n" not in repr(sizing) and repr(sizing).startswith("Sizing('Slider'")
    page = sizing._repr_html_()
    for part in ("<table", "turn", f"{sizing.joint('turn').peak_torque:.4g}", " N m", "At the motor shafts"):
        assert part in page
    hostile = replace(sizing, robot="<b>", motions=("<i>",), warnings=("<u>",))
    assert not any(tag in hostile._repr_html_() for tag in ("<i>", "<u>"))


def test_csv_and_json_give_the_figures_back(sizing: Sizing, tmp_path: Path) -> None:
    with sizing.to_csv(tmp_path / "a" / "sizing.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    document = json.loads(sizing.to_json(tmp_path / "sizing.json").read_text(encoding="utf-8"))
    for joint, row, entry in zip(sizing.joints, rows, document["joints"], strict=True):
        assert row["joint"] == entry["name"] == joint.name
        assert float(row["peak torque [torque unit]"]) == joint.peak_torque
        assert float(row["RMS torque [torque unit]"]) == entry["rms_torque"] == joint.rms_torque
        assert abs(entry["peaks"]["peak_torque"]["value"]) == joint.peak_torque
        assert entry["cycles"] == [vars(cycle) for cycle in joint.cycles]
        assert row["torque unit"] == entry["torque_unit"] == joint.torque_unit
    shaft = sizing.joint("turn").shaft
    assert shaft is not None and document["joints"][0]["shaft"]["margins"] == dict(shaft.margins)
    assert document["inside"] is sizing.inside and document["cannot_be_sized"] == []
    with pytest.raises(InputError):
        sizing.to_csv(tmp_path / "sizing.json" / "x.csv")


# ---- histories


def test_histories_are_inverse_dynamics_without_the_rotor(config_file: Path, sizing: Sizing) -> None:
    assert sizing.inputs is not None and list(sizing.histories) == ["reach", "hold"]
    robot, motions, _ = bc.load_scene(config_file).config.robot(), sizing.inputs.motions, None
    for motion in motions:
        history = sizing.histories[motion.name]
        assert isinstance(history, MotionHistory) and np.array_equal(history.time, motion.time)
        torque = robot.inverse_dynamics(motion.position, motion.velocity, motion.acceleration)
        torque[:, 0] -= 60.0**2 * 3e-5 * motion.acceleration[:, 0]
        for joint in robot.joints:
            line = history.joint(joint.name)
            assert np.array_equal(line.position, motion.position[:, joint.q])
            assert np.array_equal(line.velocity, motion.velocity[:, joint.v])
            assert np.array_equal(line.acceleration, motion.acceleration[:, joint.v])
            np.testing.assert_allclose(line.torque, torque[:, joint.v], rtol=0, atol=1e-12)
            np.testing.assert_allclose(line.power, line.torque * line.velocity, rtol=0, atol=0)
    assert sizing.histories["reach"].joint("slide").shaft is None
    with pytest.raises(InputError, match="did you mean 'turn'"):
        sizing.histories["reach"].joint("turns")


def test_the_shaft_is_what_the_power_balance_over_the_gear_says(sizing: Sizing) -> None:
    """T = τ/(N η) while the load takes power, τ η/N while it gives power back, plus J N q̈; by plain arithmetic."""
    line = sizing.histories["reach"].joint("turn")
    shaft = line.shaft
    assert shaft is not None
    backwards = 0
    for tau, speed, acceleration, torque, turned, power in zip(
        line.torque, line.velocity, line.acceleration, shaft.torque, shaft.speed, shaft.power, strict=True
    ):
        gear = tau / (60.0 * 0.75), tau * 0.75 / 60.0
        backwards += tau * speed < 0.0
        inertia = 3e-5 * 60.0 * acceleration
        if abs(speed) < 1e-9:  # of the side before or after
            assert min(abs(torque - inertia - one) for one in gear) < 1e-12
        else:
            assert torque == pytest.approx(gear[int(tau * speed < 0.0)] + inertia, rel=1e-12, abs=1e-15)
        assert turned == pytest.approx(60.0 * speed, rel=1e-12) and power == pytest.approx(torque * turned, abs=1e-12)
    assert 200 < backwards < 1800  # both directions of power are in it
    sized = sizing.joint("turn").shaft
    assert sized is not None and np.abs(shaft.torque).max() == pytest.approx(sized.peak_torque.value, rel=2e-3)
    # trapezia miss at most half a step of the jumps of gear losses and friction at a reversal
    rms = math.sqrt(float(np.trapezoid(shaft.torque**2, line_time(sizing))) / 1.1)
    assert rms == pytest.approx(sizing.joint("turn").cycles[0].rms_shaft_torque, rel=1e-3)


def line_time(sizing: Sizing) -> np.ndarray:
    return sizing.histories["reach"].time


@pytest.mark.tier2
def test_histories_in_files_have_the_shaft_and_can_be_read_as_motions(config_file: Path, tmp_path: Path) -> None:
    from bellcrank.cli import main

    status = main(["size", str(config_file), "--no-plots", "--out", str(tmp_path)])
    sizing = bc.size(config_file)
    assert sizing.inside and status == 0
    with (tmp_path / "history_reach.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    history = sizing.histories["reach"]
    shaft = history.joint("turn").shaft
    assert shaft is not None
    columns = {
        "turn shaft torque [N m]": shaft.torque,
        "turn shaft speed [rad/s]": shaft.speed,
        "turn shaft power [W]": shaft.power,
        "turn torque [N m]": history.joint("turn").torque,
        "slide torque [N]": history.joint("slide").torque,
    }
    for title, values in columns.items():
        np.testing.assert_array_equal([float(row[title]) for row in rows], values)
    assert not any(title.startswith("slide shaft") for title in rows[0])
    again = bc.size(config_file, tmp_path / "history_reach.csv")
    assert again.joint("turn").peak_torque == pytest.approx(sizing.joint("turn").peak_torque, rel=1e-9)
    assert again.joint("turn").cycles[0].rms_shaft_torque == pytest.approx(
        sizing.joint("turn").cycles[0].rms_shaft_torque, rel=1e-9
    )


# ---- pictures


def test_torque_speed_pictures_show_the_rms_at_mean_speed(sizing: Sizing) -> None:
    assert sizing.inputs is not None
    figures = sizing_figures(sizing)

    def diamonds(axis: object) -> list[tuple[float, float]]:
        lines = [line for line in axis.lines if line.get_marker() == "D" and len(line.get_xdata())]  # type: ignore[attr-defined]
        return [(float(line.get_xdata()[0]), float(line.get_ydata()[0])) for line in lines]

    for axis, joint in zip(figures["torque_speed.png"].axes, sizing.joints, strict=True):
        assert diamonds(axis) == [(cycle.mean_speed, cycle.rms_torque) for cycle in joint.cycles]
    (axis,) = [axis for axis in figures["motor_torque_speed.png"].axes if axis.get_visible()]
    rpm = 60.0 * 30.0 / math.pi
    expected = [(rpm * c.mean_speed, 1.2 * (c.rms_shaft_torque or 0.0)) for c in sizing.joint("turn").cycles]
    np.testing.assert_allclose(diamonds(axis), expected, rtol=1e-12)
    legend = [text.get_text() for text in figures["torque_speed.png"].legends[0].get_texts()]
    assert legend.count("RMS at mean speed") == 1


def test_planes_of_the_page_show_the_rms_at_mean_speed(sizing: Sizing) -> None:
    motor, slide = film_of(sizing).xy_plots
    found = {name: points for plane in (motor, slide) for name, points in plane.limits if len(points) == 1}
    assert list(found) == ["RMS at mean speed, reach", "RMS at mean speed, hold"]
    for plane, joint in ((motor, sizing.joint("turn")), (slide, sizing.joint("slide"))):
        points = [points[0] for _, points in plane.limits if len(points) == 1]
        for point, cycle in zip(points, joint.cycles, strict=True):
            if joint.shaft is None:
                assert tuple(point) == (cycle.mean_speed, cycle.rms_torque)
            else:
                assert point[0] == pytest.approx(60.0 * 30.0 / math.pi * cycle.mean_speed, rel=1e-12)
                assert point[1] == pytest.approx(1.2 * (cycle.rms_shaft_torque or 0.0), rel=1e-12)


@pytest.mark.tier2
def test_no_axis_of_a_sizing_mixes_units(sizing: Sizing) -> None:
    assert sizing.inputs is not None
    figure = sizing_figures(sizing)["over_time_reach.png"]
    labels = [axis.get_ylabel() for axis in figure.axes]
    assert not any("|" in label for label in labels) and len(labels) == 8
    for axis in figure.axes:
        (line,) = axis.lines  # one joint of each kind
        assert line.get_label() == ("slide" if axis.get_ylabel().split("[")[1][0] in "mN" and "N m" not in
                                    axis.get_ylabel() else "turn")  # fmt: skip


def test_plot_writes_the_picture_that_is_asked_for(sizing: Sizing, tmp_path: Path) -> None:
    assert "motor shafts" in sizing.plot(tmp_path / "m.png")._suptitle.get_text()  # type: ignore[attr-defined]
    assert (tmp_path / "m.png").read_bytes().startswith(b"\x89PNG")
    sizing.plot(tmp_path / "j.svg", "joints")
    assert "<svg" in (tmp_path / "j.svg").read_text(encoding="utf-8")
    assert "hold" in sizing.plot(what="time", motion="hold")._suptitle.get_text()  # type: ignore[attr-defined]
    for arguments, message in (
        ({"what": "motor"}, "did you mean 'motors'"),
        ({"what": "time", "motion": "hodl"}, "did you mean 'hold'"),
        ({"what": "joints", "motion": "hold"}, "'motion' is for the picture 'time'"),
        ({"path": tmp_path / "x.docx"}, "unknown picture format 'docx'"),
    ):
        with pytest.raises(InputError, match=message):
            sizing.plot(**arguments)  # type: ignore[arg-type]
