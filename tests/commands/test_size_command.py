"""`bellcrank size`: exit codes, files, reports and pictures."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from two_link import TwoLink, circle_states

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.commands.options import parse_payload
from bellcrank.commands.size import parse_share
from bellcrank.errors import InputError
from bellcrank.messages import file_name
from bellcrank.motion.motion import Motion
from bellcrank.motion.sampled.csv_file import read_motion, write_motion
from bellcrank.scene.robot_config import RobotConfig
from bellcrank.sizing.plots import sizing_figures
from bellcrank.sizing.size import size
from bellcrank.sizing.sizing_files import earlier_files, json_text
from bellcrank.sizing.tables import table
from tests.support.written import csv_text


def refuse(constant: str) -> None:
    raise AssertionError(f"{constant} in JSON")


@pytest.mark.tier2
def test_the_main_job_end_to_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["size", "planar_2r", "--out", str(tmp_path / "out")]) == 0
    text = capsys.readouterr().out
    names = {
        "sizing.csv",
        "sizing.json",
        "over_time_elbow_up.png",
        "over_time_elbow_down.png",
        "history_elbow_up.csv",
        "history_elbow_down.csv",
        "torque_speed.png",
        "motor_torque_speed.png",
    }
    assert {path.name for path in (tmp_path / "out").iterdir()} == names and all(name in text for name in names)
    assert "242.3" in text and "N m" in text and "rad/s" in text and "starts moving" in text
    document = json.loads((tmp_path / "out" / "sizing.json").read_text(), parse_constant=refuse)
    shoulder = document["joints"][0]
    assert shoulder["name"] == "shoulder" and shoulder["peaks"]["max_torque"]["value"] == pytest.approx(
        242.272603138, rel=1e-8
    )
    with (tmp_path / "out" / "sizing.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert float(rows[0]["peak torque [torque unit]"]) == shoulder["peaks"]["peak_torque"]["value"]
    for name in names:
        if name.endswith(".png"):
            with Image.open(tmp_path / "out" / name) as image:
                assert image.format == "PNG" and image.width > 600
                assert len(image.convert("RGB").getcolors(1 << 20) or ()) > 20  # something is drawn


@pytest.mark.tier2
def test_a_limit_that_is_exceeded_is_exit_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        main(
            [
                "size",
                "planar_2r",
                "--motion",
                "elbow_down",
                "--payload",
                "30@tip",
                "--no-plots",
                "--out",
                str(tmp_path),
            ]
        )
        == 1
    )
    assert "EXCEEDED" in capsys.readouterr().out
    assert json.loads((tmp_path / "sizing.json").read_text())["inside"] is False


@pytest.mark.tier2
def test_a_payload_and_a_tolerance_raise_the_peak(tmp_path: Path) -> None:
    peaks = []
    for extra in ([], ["--payload", "2@tip"], ["--payload", "2@tip", "--mass-tolerance", "10%"]):
        main(["size", "planar_2r", "--motion", "elbow_up", "--no-plots", "--out", str(tmp_path), *extra])
        peaks.append(json.loads((tmp_path / "sizing.json").read_text())["joints"][0]["peaks"]["peak_torque"]["value"])
    assert peaks[0] < peaks[1] and peaks[2] == pytest.approx(1.1 * peaks[1], rel=1e-3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["planar_2rr"], "did you mean 'planar_2r'"),
        (["gone.yaml"], "no such file"),
        (["lift.csv"], "a motion goes to --motion: bellcrank size ROBOT --motion lift.csv"),
        (["gone.urdf"], "no such file"),
        (["planar_2r", "--motion", "elbow_upp"], "did you mean 'elbow_up'"),
        (["planar_2r", "--motion", "gone.csv"], "gone.csv"),
        (["planar_2r", "--payload", "2"], "expected MASS@FRAME"),
        (["planar_2r", "--payload", "x@tip"], "found 'x'"),
        (["planar_2r", "--payload=-2@tip"], "'mass': expected a finite number of more than 0"),
        (["planar_2r", "--payload", "2@tp"], "did you mean 'tip'"),
        (["planar_2r", "--mass-tolerance", "ten"], "expected a number"),
        (["planar_2r", "--mass-tolerance", "150%"], "less than 100%"),
        (["talos"], "there is no motion to size over"),
    ],
)
def test_bad_input_is_one_sentence_and_leaves_nothing_behind(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    out = tmp_path / "out"
    assert main(["size", *arguments, "--out", str(out)]) == 2
    captured = capsys.readouterr()
    assert message in captured.err and captured.err.count("\n") == 1 and "Traceback" not in captured.err
    assert not out.exists() and captured.out == ""


def test_a_motion_from_a_file(tmp_path: Path) -> None:
    config = bc.load_scene("geared_pendulum").config
    robot = config.robot()
    write_motion(config.motion(robot, "lift_and_return"), tmp_path / "lift.csv")
    assert (
        main(
            [
                "size",
                "geared_pendulum",
                "--motion",
                str(tmp_path / "lift.csv"),
                "--no-plots",
                "--out",
                str(tmp_path),
            ]
        )
        == 0
    )
    document = json.loads((tmp_path / "sizing.json").read_text())
    assert document["motions"] == ["lift"] and document["joints"][0]["peaks"]["peak_torque"]["value"] == pytest.approx(
        9.81, rel=1e-6
    )


def test_reports_say_when_no_limit_is_given_and_never_hold_nan() -> None:
    robot: Any = TwoLink()
    robot.effort_limit, robot.velocity_limit = np.array([0.0, np.inf]), np.array([np.inf, np.inf])
    phi = np.linspace(0, 2 * np.pi, 101)
    sizing = size(robot, Motion(robot.joints, phi, *circle_states(phi, 1, 2 * np.pi)))
    text = table(sizing)
    assert "no limit given" in text and "limit is 0" in text and "nan" not in text
    document = json.loads(json_text(sizing), parse_constant=refuse)
    assert document["joints"][0]["effort"] == {"limit": 0.0, "margin": None} and not document["inside"]
    assert "nan" not in csv_text(sizing) and "inf" not in csv_text(sizing)


@pytest.mark.parametrize(
    ("text", "mass", "frame"),
    [("2.5@tool0", 2.5, "tool0"), ("500 g@a@b", 0.5, "a@b"), ("1e0kg@ x ", 1.0, "x")],
)
def test_payloads_on_the_command_line(text: str, mass: float, frame: str) -> None:
    payload = parse_payload(text)
    assert payload.mass == pytest.approx(mass) and payload.frame == frame


def test_shares_on_the_command_line() -> None:
    assert parse_share("10%") == pytest.approx(0.1) and parse_share("0.05") == 0.05
    with pytest.raises(InputError):
        parse_share("-1%")


def test_file_names_are_safe() -> None:
    assert file_name("../a b/c") == "a_b_c" and file_name("///") == "motion" and len(file_name("x" * 500)) <= 80


def test_histories_hold_the_torques_and_can_be_read_as_motions(tmp_path: Path) -> None:
    assert main(["size", "geared_pendulum", "--out", str(tmp_path / "out"), "--no-plots"]) == 0
    config = bc.load_scene("geared_pendulum").config
    robot = config.robot()
    for name in config.motions:
        path = tmp_path / "out" / f"history_{name}.csv"
        motion = read_motion(robot, path)
        header, *rows = path.read_text().splitlines()
        column = header.split(",").index("shoulder torque [N m]")
        written = np.array([float(row.split(",")[column]) for row in rows])
        # 2 kg at 0.5 m by hand; the actuator's rotor is not part of the joint's torque
        by_hand = 2.0 * 0.5**2 * motion.acceleration[:, 0] + 2.0 * 9.81 * 0.5 * np.sin(motion.position[:, 0])
        np.testing.assert_allclose(written, by_hand, atol=1e-11)


@pytest.mark.tier2
def test_files_of_an_earlier_sizing_do_not_stay_beside_those_of_a_new_one(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["size", "planar_2r", "--out", str(out)]) == 0
    first = {path.name for path in out.iterdir()}
    assert set(json.loads((out / "sizing.json").read_text())["files"]) == first
    (out / "history_mine.csv").write_text("mine")
    (out / "torque_speed.txt").write_text("mine")
    assert main(["size", "planar_2r", "--motion", "elbow_up", "--out", str(out)]) == 0
    now = {path.name for path in out.iterdir()}
    gone = {"over_time_elbow_down.png", "history_elbow_down.csv"}
    assert now == (first - gone) | {"history_mine.csv", "torque_speed.txt"}
    assert set(json.loads((out / "sizing.json").read_text())["files"]) == first - gone


def test_only_files_of_a_sizing_in_the_folder_itself_are_ever_removed(tmp_path: Path) -> None:
    out = tmp_path / "out"
    (out / "history_folder.csv").mkdir(parents=True)
    outside = [tmp_path / "history_a.csv", tmp_path / "torque_speed.png"]
    inside = [out / "notes.txt", out / "arm.urdf", out / ".hidden"]
    for path in [*outside, *inside]:
        path.write_text("mine")
    listed = ["../history_a.csv", str(outside[1]), "..", "", ".", 3, None, "history_folder.csv", "history_/../x.csv"]
    (out / "sizing.json").write_text(json.dumps({"files": listed + [path.name for path in inside]}))
    assert earlier_files(out) == ["history_folder.csv"]
    assert main(["size", "planar_2r", "--no-plots", "--out", str(out)]) == 0
    assert all(path.read_text() == "mine" for path in [*outside, *inside]) and (out / "history_folder.csv").is_dir()


@pytest.mark.parametrize("text", ["", "[]", "{", '{"files": 3}', '{"files": {"a": 1}}', "\x00"])
def test_a_sizing_json_that_lists_nothing_is_passed_over(tmp_path: Path, text: str) -> None:
    (tmp_path / "sizing.json").write_text(text)
    assert earlier_files(tmp_path) == [] and earlier_files(tmp_path / "none") == []


@pytest.mark.tier2
def test_pictures_with_a_mass_tolerance_are_said_to_be_nominal_and_hold_all_their_text(tmp_path: Path) -> None:
    seen = []
    for tolerance in (0.0, 0.1):
        figures = sizing_figures(size("geared_pendulum", mass_tolerance=tolerance))
        assert set(figures) == {"over_time_lift_and_return.png", "torque_speed.png", "motor_torque_speed.png"}
        for figure in figures.values():
            figure.canvas.draw()
            renderer = figure.canvas.get_renderer()
            texts = [figure._suptitle, *figure.legends, *[axis.title for axis in figure.axes]]
            for text in texts:
                box = text.get_window_extent(renderer)
                assert box.x0 >= 0 and box.x1 <= figure.bbox.x1 and box.y0 >= 0 and box.y1 <= figure.bbox.y1
        seen.append([figure._suptitle.get_text() for figure in figures.values()])
        labels = [text.get_text() for text in figures["torque_speed.png"].legends[0].get_texts()]
        assert "start" in labels
    assert all("nominal masses" not in text for text in seen[0]) and all("nominal masses" in text for text in seen[1])


def test_errors_of_the_urdf_are_printed_and_stand_in_the_verdict(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    original = RobotConfig.robot

    def with_finding(config: RobotConfig, payloads: Any = ()) -> Any:
        robot = original(config, payloads)
        robot.findings = ("link 'tip' is heavier than lead",)
        return robot

    monkeypatch.setattr(RobotConfig, "robot", with_finding)
    assert main(["size", "planar_2r", "--no-plots", "--motion", "elbow_up", "--out", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert "error: link 'tip' is heavier than lead\n" in text
    assert "`bellcrank check` lists" in text.partition("All inside")[2] and text.count("heavier than lead") == 2
    assert "link 'tip' is heavier than lead" in json.loads((tmp_path / "sizing.json").read_text())["warnings"]


def test_set_changes_a_value_before_sizing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two kilograms on the rod of 0.5 m need 9.81 N m (the configuration's comment), three times the gravity thrice
    that; the changed value stands among the notes."""
    changed = ["--set", "gravity=[0, 0, -29.43]"]
    main(["size", "geared_pendulum", *changed, "--out", str(tmp_path / "out"), "--no-plots"])
    assert "geared_pendulum.yaml: gravity = [0, 0, -29.43]" in capsys.readouterr().out
    document = json.loads((tmp_path / "out" / "sizing.json").read_text())
    assert document["joints"][0]["peaks"]["max_torque"]["value"] == pytest.approx(3.0 * 9.81, rel=1e-9)
    same = size("geared_pendulum", overrides={"gravity": [0.0, 0.0, -29.43]})
    assert same.joint("shoulder").max_torque == document["joints"][0]["peaks"]["max_torque"]["value"]
    assert "gravity" in same.warnings[0]


def test_set_of_size_speaks_as_simulate_does(capsys: pytest.CaptureFixture[str]) -> None:
    for change, message in (
        ("actuatorz=3", "unknown key or parameter 'actuatorz'; did you mean 'actuators'?"),
        ("gravity", "expected PATH=VALUE"),
        ("link.bobb.mass=3", "unknown link 'bobb'; did you mean 'bob'?"),
    ):
        said = []
        for command in ("size", "select", "simulate"):
            assert main([command, "geared_pendulum", "--set", change]) == 2
            said.append(capsys.readouterr().err)
        assert message in said[0] and len(set(said)) == 1


def test_overrides_of_size_need_a_file() -> None:
    robot = bc.load_scene("geared_pendulum").robot
    with pytest.raises(InputError, match="argument 'overrides': it changes values of a scene"):
        size(robot, overrides={"name": "other"})
    with pytest.raises(InputError, match="overrides"):
        size("geared_pendulum", overrides=3)  # type: ignore[arg-type]
