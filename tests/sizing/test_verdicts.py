"""Missing masses: what `check`, `size`, reports and pages say of links and motors that move without mass."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.errors import InputError
from bellcrank.files.bundled_data import folder
from bellcrank.replays.replay import film_of
from bellcrank.reports.run_report import run_document
from bellcrank.reports.sizing_report import sizing_document
from bellcrank.robot.catalog import find_urdf
from bellcrank.robot.checks.check import check_urdf
from bellcrank.sizing.tables import verdict

LIMIT = '<limit lower="-3" upper="3" effort="100" velocity="5"/>'
MASS = (
    '<inertial><origin xyz="0.3 0 0"/><mass value="2"/>'
    '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial>'
)
UNIVERSAL = {"upper": "", "fore": MASS}  # as of a universal joint: a cross piece without mass, and mass beyond


def urdf(upper: str = "", fore: str = "", more: str = "") -> str:
    """An arm of two links, of which each may have no mass."""
    links = f'<link name="base"/><link name="upper">{upper}</link><link name="fore">{fore}</link>'
    joints = "".join(
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x} 0 0"/><axis xyz="0 1 0"/>{LIMIT}</joint>'
        for name, parent, child, x in (("shoulder", "base", "upper", 0), ("elbow", "upper", "fore", 0.5))
    )
    return f'<robot name="arm">{links}{joints}{more}</robot>'


def arm(folder: Path, *parts: str, config: str = "", **masses: str) -> Path:
    """A robot configuration of the arm in a folder."""
    (folder / "arm.urdf").write_text(urdf(**masses, more="".join(parts)), encoding="utf-8")
    path = folder / "arm.yaml"
    path.write_text(
        "name: arm\nurdf: arm.urdf\nmotions:\n  swing: {kind: waypoints, times: [0, 1], positions: [{}, {shoulder: 1, "
        "elbow: 0.5}]}\n" + config,
        encoding="utf-8",
    )
    return path


def size_command(config: Path, *arguments: str) -> int:
    return main(["size", str(config), "--no-plots", "--out", str(config.parent / "out"), *arguments])


def test_motors_that_move_no_mass_cannot_be_sized_and_the_exit_code_is_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = arm(tmp_path)
    assert size_command(config) == 1
    text = capsys.readouterr().out
    answer = text[text.index("cannot be sized:") :]
    assert "joint 'shoulder' moves no mass: links 'upper', 'fore'" in answer and "All inside" not in text
    assert "joint 'elbow' moves no mass: link 'fore'" in answer and "--allow-massless fore" in answer
    document = json.loads((tmp_path / "out" / "sizing.json").read_text())
    assert document["inside"] is False and len(document["cannot_be_sized"]) == 2
    sizing = bc.size(config)
    assert not sizing.inside and len(sizing.unsizable) == 2 and "cannot be sized" in repr(sizing)


def test_a_motor_that_moves_mass_is_sized_beside_one_that_does_not(tmp_path: Path) -> None:
    sizing = bc.size(arm(tmp_path, upper=MASS))
    assert [text.split("'")[1] for text in sizing.unsizable] == ["elbow"]
    assert sizing.joint("shoulder").peak_torque > 1.0


@pytest.mark.tier2
@pytest.mark.parametrize(("allowed", "left"), [(["fore"], ["shoulder"]), (["upper"], []), (["fore", "upper"], [])])
def test_what_is_allowed_is_sized_and_the_result_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], allowed: list[str], left: list[str]
) -> None:
    config = arm(tmp_path)
    sizing = bc.size(config, allow_massless=allowed)
    assert [text.split("'")[1] for text in sizing.unsizable] == left
    assert set(sizing.allowed_massless) == {"shoulder", "elbow"} - set(left)
    options = [word for link in allowed for word in ("--allow-massless", link)]
    assert size_command(config, *options) == (1 if left else 0)
    text = capsys.readouterr().out
    assert f"Joints that move no mass, as allowed: {', '.join(sizing.allowed_massless)}." in text
    assert all(any(f"joint '{name}' moves no mass" in t for t in sizing.warnings) for name in sizing.allowed_massless)
    document = json.loads((tmp_path / "out" / "sizing.json").read_text())
    assert document["joints_allowed_without_mass"] == list(sizing.allowed_massless)


@pytest.mark.tier2
@pytest.mark.parametrize(
    ("link", "message"),
    [
        ("forearm", "unknown link 'forearm'"),
        ("base", "link 'base' of arm does not move"),
        ("upper", "link 'upper' of arm moves 2 kg"),
    ],
)
def test_what_need_not_be_allowed_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], link: str, message: str
) -> None:
    config = arm(tmp_path, upper=MASS)
    assert size_command(config, "--allow-massless", link) == 2
    assert message in capsys.readouterr().err
    with pytest.raises(InputError, match=message):
        bc.size(config, allow_massless=[link])


def test_a_payload_is_mass(tmp_path: Path) -> None:
    load = bc.Payload(1.0, "fore", (0.4, 0.0, 0.0), (0.01, 0.0, 0.01, 0.0, 0.0, 0.01))
    sizing = bc.size(arm(tmp_path), payloads=[load])
    assert sizing.inside and not sizing.unsizable and not sizing.urdf_errors
    # the fore carries a mass now; the upper, between two joints, still has none of its own
    assert [text.split("'")[1] for text in sizing.warnings if "no mass" in text] == ["upper"]
    # 1 kg, 0.9 m out when the arm is stretched: the motion begins there, at rest
    assert sizing.histories["swing"].joint("shoulder").torque[0] == pytest.approx(-0.9 * 9.81, rel=1e-12)


def test_a_rotor_is_no_mass_that_the_motor_moves(tmp_path: Path) -> None:
    actuator = "{ratio: 50, rated_torque: 1, peak_torque: 3, rated_speed: 300, max_speed: 500, rotor_inertia: 1e-4}"
    sizing = bc.size(arm(tmp_path, config=f"actuators: {{shoulder: {actuator}, elbow: {actuator}}}"))
    assert len(sizing.unsizable) == 2


@pytest.mark.tier2
def test_a_follower_with_mass_is_what_its_leader_moves(tmp_path: Path) -> None:
    follower = (
        f'<link name="finger">{MASS}</link><joint name="second" type="revolute"><parent link="upper"/><child '
        f'link="finger"/><axis xyz="0 1 0"/>{LIMIT}<mimic joint="elbow" multiplier="%s"/></joint>'
    )
    assert bc.size(arm(tmp_path, follower % "-1")).unsizable == ()
    (still,) = bc.size(arm(tmp_path, follower % "0")).unsizable
    assert "joint 'elbow' moves no mass: link 'fore' without" in still


@pytest.mark.tier2
def test_a_moving_link_without_mass_is_warned_of_by_check_size_report_page_and_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = arm(tmp_path, **UNIVERSAL, config="initial: {shoulder: 0.3}\nsimulate: {duration: 0.1}\n")
    words = "link 'upper': moves with a joint and has no mass (no <inertial>)"
    assert main(["check", str(tmp_path / "arm.urdf")]) == 0
    assert f"warning  {words}" in capsys.readouterr().out and size_command(config) == 0
    assert f"warning: {words}" in capsys.readouterr().out
    sizing = bc.size(config)
    film = film_of(sizing)
    assert any(text.startswith(words) for text in sizing_document(sizing, film).warnings)
    assert [value[: len(words)] for name, value in film.facts if name == "warning"] == [words]
    assert not any(words in note for note in film.notes)
    assert sizing.inputs is not None
    swing = film_of(sizing.inputs[1][0], bc.load_robot(tmp_path / "arm.urdf"))
    assert any(name == "warning" and value.startswith(words) for name, value in swing.facts)
    run = bc.simulate(config)
    document = run_document(run)
    assert document.status == "OK" and any(text.startswith(words) for text in document.warnings)
    assert any(name == "warning" and value.startswith(words) for name, value in film_of(run).facts)


def test_frames_fixed_to_links_are_no_moving_links() -> None:
    for name in ("ur5", "panda", "planar_2r"):
        assert not [found for found in check_urdf(find_urdf(name)) if "no mass" in found.message]
        assert bc.load_robot(name).inertia_warnings == ()


@pytest.mark.tier2
def test_errors_of_check_stand_in_the_verdict(tmp_path: Path) -> None:
    impossible = MASS.replace('izz="0.02"', 'izz="0.2"')
    sizing = bc.size(arm(tmp_path, upper=MASS, fore=impossible))
    assert sizing.inside and "the inertia violates the triangle inequality" in sizing.urdf_errors[0]
    assert "`bellcrank check` lists" in verdict(sizing) and sizing.urdf_errors[0] in verdict(sizing)
    point = re.sub(r'xyz="0.3 0 0"', 'xyz="0 0 0"', re.sub(r'(i..)="0.02"', r'\1="0"', MASS))
    on_axis = bc.size(arm(tmp_path, upper=MASS, fore=point))
    assert on_axis.unsizable == () and "joint 'elbow': the inertia that it moves vanishes" in (on_axis.urdf_errors[0])


def five_bar(place: Path, without: tuple[str, ...]) -> Path:
    """The bundled five-bar robot with some links that have no <inertial>."""
    text = (folder("urdf") / "five_bar.urdf").read_text(encoding="utf-8")
    for name in without:
        text, count = re.subn(rf'(<link name="{name}">.*?)<inertial>.*?</inertial>', r"\1", text, flags=re.DOTALL)
        assert count == 1, name
    (place / "five_bar.urdf").write_text(text, encoding="utf-8")
    config = (folder("robots") / "five_bar.yaml").read_text(encoding="utf-8")
    (place / "five_bar.yaml").write_text(config.replace("urdf: five_bar", "urdf: five_bar.urdf"), encoding="utf-8")
    return place / "five_bar.yaml"


@pytest.mark.tier2
def test_a_motor_of_a_linkage_moves_what_its_loops_move(tmp_path: Path) -> None:
    moving = ("left_arm", "left_forearm", "tool", "right_arm", "right_forearm")
    # the crank has no mass, and what follows it has
    sizing = bc.size(five_bar(tmp_path, ("left_arm",)))
    assert sizing.unsizable == () and any("link 'left_arm'" in text for text in sizing.warnings)
    # nothing between the left motor and the tool's pin has: the right forearm, which the loop carries, has
    sizing = bc.size(five_bar(tmp_path, ("left_arm", "left_forearm", "tool")))
    assert sizing.unsizable == () and sizing.urdf_errors == () and sizing.joint("left_motor").peak_torque > 0.0
    sizing = bc.size(five_bar(tmp_path, moving))
    assert [text.split("'")[1] for text in sizing.unsizable] == ["left_motor", "right_motor"]
    allowed = bc.size(five_bar(tmp_path, moving), allow_massless=["left_arm", "right_arm"])
    assert allowed.inside and allowed.allowed_massless == ("left_motor", "right_motor")
    # what is left is the damping of the motor's own joint, 0.002 N m s/rad
    motor = allowed.joint("left_motor")
    assert motor.peak_torque == pytest.approx(0.002 * motor.peak_speed, rel=1e-9)
