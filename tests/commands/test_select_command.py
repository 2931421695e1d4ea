"""`bellcrank select`: exit codes, files, the written configuration, and messages for bad input."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from own_products import write_products

import bellcrank as bc
from bellcrank.actuators.actuator_fields import KEYS
from bellcrank.actuators.conditions import Conditions
from bellcrank.cli import main
from bellcrank.commands.select import conditions, parse_assumed, parse_kept, products
from bellcrank.errors import InputError


@pytest.fixture
def own(tmp_path: Path) -> str:
    return str(write_products(tmp_path / "own"))


@pytest.mark.tier2
def test_the_main_job_end_to_end(own: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, card = tmp_path / "out", tmp_path / "chosen.yaml"
    given = [
        "--catalogue",
        own,
        "--maker",
        "own",
        "--exclude",
        "huge",
        "--top",
        "6",
        "--voltage",
        "48",
        "--life",
        "5000",
    ]
    assert main(["select", "geared_pendulum", *given, "--out", str(out), "--write-config", str(card)]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "small" in text and "g50" in text
    assert "voltage 48 V (given) less 10%" in text and "life 5000 h (given)" in text
    assert "All inside" in text and f"wrote {card}" in text and str(out) in text
    document = json.loads((out / "selection.json").read_text())
    assert set(document["files"]) == {path.name for path in out.iterdir()}
    assert {"selection.csv", "selection.json", "motors.png", "utilisation.png"} <= set(document["files"])
    assert document["axes"][0]["chosen"] == "large+g50" and document["conditions"]["life"] == 5000.0
    assert main(["size", str(card), "--no-plots", "--out", str(tmp_path / "sized")]) == 0
    assert "inside" in capsys.readouterr().out
    # the written file over the selection: the same motors and gears, so that no row of the choice differs
    assert main(["select", "geared_pendulum", *given, "--out", str(out), "--page", "--over", str(card)]) == 0
    both = (out / "report.html").read_text()
    choice = both.partition("<h2>The choice</h2>")[2].partition("</table>")[0]
    assert "<title>geared_pendulum and chosen</title>" in both and "large" in choice and "<mark>" not in choice
    # written again without pictures: those of the first time are removed
    assert main(["select", "geared_pendulum", *given, "--out", str(out), "--no-plots"]) == 0
    assert {path.name for path in out.iterdir()} == {"selection.csv", "selection.json"}


@pytest.mark.tier2
def test_an_axis_that_nothing_can_drive_is_exit_1_with_advice(
    own: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    card = tmp_path / "chosen.yaml"
    given = ["--catalogue", own, "--maker", "Own", "--payload", "400@bucket", "--no-plots", "--write-config", str(card)]
    frames = tmp_path / "heavy.yaml"
    frames.write_text(
        "urdf: geared_pendulum\nframes: {bucket: {link: pendulum, xyz: [0, 0, -0.5]}}\n"
        "motions: {lift: {kind: waypoints, times: [0, 1], positions: [{shoulder: 0}, {shoulder: 90 deg}]}}\n"
    )
    assert main(["select", str(frames), *given, "--out", str(tmp_path / "out")]) == 1
    text = capsys.readouterr().out
    assert "NOTHING FITS: 1 axis" in text and "shoulder" in text and "%" in text
    assert f"{card} is not written" in text and not card.exists()
    assert json.loads((tmp_path / "out" / "selection.json").read_text())["inside"] is False


@pytest.mark.tier2
def test_a_pair_that_is_kept_and_fails_is_exit_1(own: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["--catalogue", own, "--maker", "Own", "--keep", "shoulder=small", "--no-plots", "--payload", "5@bob"]
    status = main(["select", "geared_pendulum", *given, "--safety-factor", "40", "--out", str(tmp_path / "out")])
    text = capsys.readouterr().out
    assert status == 1 and ("EXCEEDED" in text or "NOTHING FITS" in text) and "All inside" not in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["gone.yaml"], "no such file"),
        (["geared_pendulm"], "did you mean 'geared_pendulum'"),
        (["--keep", "sholder=small"], "did you mean 'shoulder'"),
        (["--keep", "shoulder=smal"], "did you mean 'small'"),
        (["--keep", "shoulder=small+g5"], "did you mean 'g50'"),
        (["--keep", "shoulder"], "expected JOINT=MOTOR or JOINT=MOTOR+GEAR"),
        (["--keep", "shoulder=small", "--keep", "shoulder=large"], "given twice"),
        (["--exclude", "smal"], "did you mean 'small'"),
        (["--maker", "Maxxon"], "did you mean 'maxon'"),
        (["--exclude", "Own"], "no motor is left"),
        (["--motion", "lift"], "unknown motion 'lift'"),
        (["--voltage", "0"], "--voltage '0': expected a number of more than 0"),
        (["--voltage", "48 A"], "--voltage '48 A'"),
        (["--voltage-reserve", "95%"], "--voltage-reserve '95%'"),
        (["--altitude", "9000"], "altitude"),
        (["--safety-factor", "0.5"], "--safety-factor '0.5'"),
        (["--assume", "gear.efficiency"], "expected FIELD=VALUE"),
        (["--assume", "gear.efficency=0.7"], "did you mean 'gear.efficiency'"),
        (["--assume", "gear.efficiency=7"], "at most 1"),
        (["--assume", "motor.resistance=2 V"], "expected a number in Ω"),
        (["--assume", "gear.efficiency=0.7", "--assume", "gear.efficiency=0.8"], "given twice"),
        (["--top", "0"], "--top '0'"),
        (["--payload", "2"], "expected MASS@FRAME"),
        (["--over", "geared_pendulum"], "--over: selections are compared in a page; add --page"),
        (["--page", "--over", "planar_2r"], "names motors and gears of a catalogue"),
        (["--write-config", "x.txt"], "expected the name of a YAML file"),
    ],
)
def test_bad_input_is_one_sentence_and_leaves_nothing_behind(
    own: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    out = tmp_path / "out"
    robot = [] if arguments[0].startswith(("gone", "geared")) else ["geared_pendulum"]
    maker = [] if {"--maker", "Own"} & set(arguments) else ["--maker", "own"]
    extra = ["--maker", "own"] if "Own" in arguments else []
    assert main(["select", *robot, *arguments, *maker, *extra, "--catalogue", own, "--out", str(out)]) == 2
    captured = capsys.readouterr()
    assert message in captured.err and captured.err.count("\n") == 1 and "Traceback" not in captured.err
    assert not out.exists()


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({}, "no"),
        ({"a.csv": "id,maker,model,kind,mass\nx,A,M,motor,1\n"}, "column 'mass'"),
        ({"a.csv": "id,maker,model,kind,mass [N]\nx,A,M,motor,1\n"}, "'N'"),
        ({"a.csv": "id,maker,model,kind,mass [kg]\nx,A,M,motor,-1\n"}, "more than 0"),
        ({"a.csv": "id,maker,model,kind\nx,A,M,motor\nx,A,M,motor\n"}, "is also at"),
    ],
)
def test_a_catalogue_that_is_not_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], files: dict[str, str], message: str
) -> None:
    folder = tmp_path / "own"
    folder.mkdir()
    for name, text in files.items():
        (folder / name).write_text(text)
    assert main(["select", "geared_pendulum", "--catalogue", str(folder), "--out", str(tmp_path / "out")]) == 2
    captured = capsys.readouterr()
    assert message in captured.err and str(folder) in captured.err and captured.err.count("\n") == 1


def test_options_are_read_with_their_units() -> None:
    import argparse

    from bellcrank.commands.select import add_arguments

    parser = argparse.ArgumentParser()
    add_arguments(parser)
    words = (
        "ur5 --voltage 48V --voltage-ratio 3 --voltage-reserve 5% --winding-temperature 80 --ambient 40 "
        "--altitude 2000 --safety-factor 1.2 --inertia-ratio 7 --life 20000 --brake "
        "--bus-capacitance 10mF --bus-max-voltage 60 --brake-resistor-power 200 --brake-resistance 5 "
        "--brake-resistor-peak-power 1kW --supply-power 1.5kW --commutation brushless --construction housed "
        "--momentary-load elbow=80Nm --assume gear.efficiency=0.7 "
        "--assume"
    )
    given = conditions(parser.parse_args([*words.split(), "motor.rotor_inertia=20 g cm^2"]))
    assert set(given) == set(KEYS)
    assert Conditions(**given) == Conditions(
        voltage=48.0, voltage_ratio=3.0, voltage_reserve=0.05, winding_temperature=80.0, ambient=40.0,
        altitude=2000.0, safety_factor=1.2, inertia_ratio=7.0,
        life=20000.0, brake=True, bus_capacitance=0.01, bus_max_voltage=60.0, brake_resistor_power=200.0,
        brake_resistance=5.0, brake_resistor_peak_power=1000.0, commutation="brushless", construction="housed",
        supply_power=1500.0, momentary_loads={"elbow": 80.0},
        assume={"gear.efficiency": 0.7, "motor.rotor_inertia": 2e-6},
    )  # fmt: skip
    assert conditions(parser.parse_args(["ur5"])) == {}
    assert conditions(parser.parse_args(["ur5", "--ambient", "25", "--no-brake"])) == {"ambient": 25.0, "brake": False}
    assert parse_kept(["a = m + g", "b=m"]) == {"a": "m + g", "b": "m"} and parse_assumed([]) == {}


def test_what_to_choose_from(own: str) -> None:
    every = products([own], [], [])
    assert {"small", "maxon_re25_118743_12v"} <= {one.id for one in every.motors}
    mine = products([own], ["large", "g100"], ["OWN"])
    assert {one.id for one in mine.motors} == {"small", "huge", "bare"} and {one.id for one in mine.gears} == {
        "g50",
        "g160",
    }
    assert all(one.maker != "maxon" for one in products([own], ["maxon"], []).products)
    with pytest.raises(InputError, match="gone"):
        products([f"{own}/gone"], [], [])


@pytest.mark.tier2
def test_the_written_configuration_holds_the_values_that_were_set(
    own: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written, folder = tmp_path / "chosen.yaml", tmp_path / "out"
    given = ["--catalogue", own, "--set", "gravity=[0, 0, -1.62]", "--write-config", str(written), "--no-plots"]
    assert main(["select", "geared_pendulum", *given, "--out", str(folder)]) == 0
    assert "differ from those of geared_pendulum.yaml: gravity = [0, 0, -1.62]" in " ".join(
        capsys.readouterr().out.split()
    )
    assert bc.load_scene(written).config.gravity == (0.0, 0.0, -1.62)


@pytest.mark.tier2
def test_without_feedback_the_written_configuration_has_no_masses_of_actuators(own: str, tmp_path: Path) -> None:
    given = ["select", "geared_pendulum", "--catalogue", own, "--maker", "own", "--no-plots"]
    for options, payloads in (([], 1), (["--no-feedback"], 0)):
        written = tmp_path / f"chosen_{payloads}.yaml"
        assert main([*given, *options, "--write-config", str(written), "--out", str(tmp_path / "out")]) == 0
        config = bc.load_scene(written).config
        assert len(config.payloads) - len(bc.load_scene("geared_pendulum").config.payloads) == payloads
        assert bool(config.mounts) is bool(payloads)
