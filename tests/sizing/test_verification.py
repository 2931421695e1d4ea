"""Chosen drives simulated along their motions: what is measured, limits on it, and one answer of all commands."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

import bellcrank as bc
from bellcrank.cli import main

DRIVE = {
    "model": "dc",
    "elastic": {"damping": 5, "backlash": 0},
    "servo": {"motion": "lift_and_return", "gains": "auto", "sample_time": 1e-3, "delay": 1e-4},
}


@pytest.fixture(scope="module")
def chosen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a selection, without a drive in the loop."""
    return bc.select("geared_pendulum").write_config(tmp_path_factory.mktemp("chosen") / "axis.yaml")


def with_drive(chosen: Path) -> Path:
    """The same file with a drive."""
    data = yaml.safe_load(chosen.read_text())
    data["actuators"]["shoulder"] |= DRIVE
    path = chosen.with_name("drive.yaml")
    path.write_text(yaml.safe_dump(data))
    return path


def judged(path: Path) -> tuple[list[dict], list[float]]:
    """The verdicts on the drives of a file, and the known uses of their criteria."""
    drives = bc.judge(path).as_dict()["drives"]
    criteria = [each for one in drives for each in one["criteria"] if each["use"] is not None]
    return drives, [each.pop("use") for each in criteria]


def test_all_commands_that_judge_give_one_answer_with_and_without_a_drive_in_the_loop(chosen: Path) -> None:
    driven, motion = with_drive(chosen), "lift_and_return"
    (with_it, uses), (without, expected) = judged(driven), judged(chosen)
    assert with_it == without and uses == pytest.approx(expected, rel=1e-14)
    for find in (
        lambda path: bc.time_optimal(path, motion).motion.duration,
        lambda path: bc.speed_factor(path, motion).factor,
        lambda path: bc.size(path).joint("shoulder").peak_torque,
    ):
        assert find(driven) == pytest.approx(find(chosen), rel=1e-14)


@pytest.mark.tier2
def test_the_selection_is_the_same_with_and_without_a_drive_in_the_loop(chosen: Path) -> None:
    (with_it,), (without,) = bc.select(with_drive(chosen)).axes, bc.select(chosen).axes
    assert (with_it.chosen.motor.id, with_it.chosen.gear.id) == (without.chosen.motor.id, without.chosen.gear.id)


def test_a_selection_is_followed_with_a_servo_that_is_taken_for_it(chosen: Path) -> None:
    selection = bc.select("geared_pendulum")
    found, of_file = bc.verify_selection(selection), bc.verify_selection(chosen)
    assert found.axes == of_file.axes
    assert found.kept and "the file describes no drive of shoulder" in found.warnings[0]
    assert any("the gear is rigid, its stiffness, its backlash" in text for text in found.warnings)


@pytest.mark.tier2
@pytest.mark.parametrize("options", [[], ["--maker", "maxon", "--maker", "Harmonic Drive", "--safety-factor", "1.5"]])
def test_light_wrists_behind_gears_with_losses_are_followed_to_the_end(options: list[str], tmp_path: Path) -> None:
    """The load of a wrist's gear is a small difference of large forces, whose rounding must not turn its side."""
    chosen = tmp_path / "ur5.yaml"
    main(["select", "ur5", *options, "--no-plots", "--out", str(tmp_path / "out"), "--write-config", str(chosen)])
    found = bc.verify_selection(chosen)
    assert found.kept and not [text for text in found.warnings if "ended early" in text or "not known" in text]
    assert all(axis.tracking_error < 1e-4 for axis in found.axes)


def test_what_is_measured_is_what_the_run_has(chosen: Path) -> None:
    path = with_drive(chosen)
    found = bc.verify_selection(path, settle=0.25, limits={"tracking_error": 1e-6, "settling_time": 10.0})
    scene = bc.load_scene(path, {"initial": {"motion": "lift_and_return"}})
    run = bc.simulate(scene, duration=4.25, samples=8501)
    columns = [label.removeprefix("drive_shoulder ") for label in scene.outputs["drive_shoulder"].labels]
    values = dict(zip(columns, run.outputs["drive_shoulder"].T, strict=True))
    (axis,) = found.axes
    assert axis.tracking_error == pytest.approx(np.abs(values["tracking error [rad]"]).max(), rel=1e-9)
    assert axis.current == pytest.approx(np.abs(values["current [A]"]).max(), rel=1e-9)
    assert axis.voltage == pytest.approx(np.abs(values["voltage [V]"]).max(), rel=1e-9)
    assert axis.stuck == pytest.approx(np.diff(run.stuck("shoulder rotor"), axis=1).sum(), rel=1e-9)
    assert found.tool_errors["lift_and_return"] == pytest.approx(0.5 * axis.tracking_error, rel=1e-4)
    assert not found.kept and "tracking error" in found.exceeded[0] and len(found.exceeded) == 1
    assert found.drives[0].stable


def test_unknown_limits_motions_and_frames_and_commands_are_refused(chosen: Path) -> None:
    path = with_drive(chosen)
    for given, words in (
        ({"limits": {"error": 1.0}}, "unknown limit 'error'"),
        ({"motions": "fly"}, "unknown motion 'fly'"),
        ({"frame": "hand"}, "unknown frame 'hand'"),
        ({"overrides": {"actuators.shoulder.servo": {"voltage": 1}}}, "follows no motion"),
    ):
        with pytest.raises(bc.InputError, match=words):
            bc.verify_selection(path, **given)  # type: ignore[arg-type]
    with pytest.raises(bc.InputError, match="there is no motion to follow"):
        bc.verify_selection("pendulum")


def test_judge_simulates_on_request_and_its_exit_code_says_whether_limits_are_kept(
    chosen: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path, out = str(with_drive(chosen)), tmp_path / "judge.json"
    for limit, code in (("0.01", 0), ("1e-6", 1)):
        given = [
            "judge",
            path,
            "--simulate",
            "--limit",
            f"tracking_error={limit}",
            "--accept-unknown",
            "--out",
            str(out),
        ]
        assert main(given) == code
        assert ("EXCEEDED" in capsys.readouterr().out) is (code == 1)
    told = json.loads((tmp_path / "judge_simulated.json").read_text())
    assert told["kept"] is False and told["axes"][0]["joint"] == "shoulder"
    assert main(["judge", path, "--limit", "tracking_error=1"]) == 2
    assert "add --simulate" in capsys.readouterr().err


def test_a_selection_passes_over_drives_that_do_not_follow(chosen: Path, tmp_path: Path) -> None:
    first = bc.select("geared_pendulum", makers=["maxon"])
    error = max(axis.tracking_error for axis in bc.verify_selection(first).axes)
    loose = bc.select("geared_pendulum", makers=["maxon"], simulated_limits={"tracking_error": 2.0 * error})
    assert loose.axis("shoulder").chosen.id == first.axis("shoulder").chosen.id and loose.follows and loose.inside
    tight = bc.select("geared_pendulum", makers=["maxon"], simulated_limits={"tracking_error": 0.95 * error})
    assert tight.follows and tight.axis("shoulder").chosen.id != first.axis("shoulder").chosen.id
    assert tight.verification is not None and tight.verification.axes[0].tracking_error <= 0.95 * error
    passed = [text for text in tight.warnings if text.startswith("passed over in simulation: shoulder: ")]
    assert any(first.axis("shoulder").chosen.id in text and "tracking error" in text for text in passed)
    document = json.loads(tight.to_json(tmp_path / "selection.json").read_text())
    assert document["simulated"]["verification"]["kept"] is True


def test_a_selection_that_no_drive_follows_well_enough_is_not_inside(tmp_path, capsys) -> None:
    selection = bc.select("geared_pendulum", makers=["maxon"], candidates=2, simulated_limits={"tracking_error": 1e-12})
    assert not selection.inside and not selection.verified and "in simulation: " in str(selection)
    assert any("no combination that was tried" in text for text in selection.warnings)
    options = [
        "--limit",
        "tracking_error=1e-12",
        "--top",
        "2",
        "--maker",
        "maxon",
        "--no-plots",
        "--out",
        str(tmp_path / "out"),
    ]
    assert main(["select", "geared_pendulum", *options]) == 1
    assert "tracking error" in capsys.readouterr().out
    with pytest.raises(bc.InputError, match="unknown limit 'error'"):
        bc.select("geared_pendulum", makers=["maxon"], simulated_limits={"error": 1.0})


@pytest.mark.tier2
def test_a_delta_robot_follows_the_path_of_its_tool_from_the_posture_in_which_it_begins(tmp_path: Path) -> None:
    """Its drives have no friction and follow with feed-forward: errors are those of the loops alone, some 0.1 mrad."""
    motor = {"maker": "a", "model": "b", "torque_constant": 0.1, "torque_constant_basis": "dc", "resistance": 0.8,
             "inductance": 1e-3, "rotor_inertia": 1e-4, "nominal_voltage": 480.0}  # fmt: skip
    gear = {"maker": "a", "model": "g", "kind": "planetary", "ratio": 10, "efficiency": 1, "inertia": 0,
            "inertia_side": "input"}  # fmt: skip
    servo = {"motion": "pick", "gains": "auto", "sample_time": 1e-3}
    drive = {"motor": motor, "gear": gear, "model": "torque", "rotor_friction": "none", "servo": servo}
    scene = bc.load_scene("delta")
    changes = {"actuators": {f"motor_{k}": drive for k in (1, 2, 3)}, "control": []}
    found = bc.verify_selection(scene.with_overrides(changes), frame="tool")
    assert all(axis.tracking_error < 5e-4 for axis in found.axes)
    assert found.tool_errors["pick"] < 2e-3
    assert all(each.stable and each.phase_margin >= np.radians(30) for each in found.drives)


def test_controllers_of_a_file_give_way_to_the_servos_that_a_verification_adds(tmp_path: Path) -> None:
    motor = {"maker": "a", "model": "b", "torque_constant": 0.05, "torque_constant_basis": "dc", "resistance": 0.8,
             "rotor_inertia": 1e-5, "nominal_voltage": 48.0}  # fmt: skip
    changes = {"actuators": {name: {"motor": motor} for name in ("left_motor", "right_motor")}}
    found = bc.verify_selection(bc.load_scene("five_bar").with_overrides(changes))
    assert all(axis.tracking_error < 0.01 for axis in found.axes)
    assert "control motors of the file is left out" in " ".join(found.notes)
