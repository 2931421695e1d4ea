"""`bellcrank catalogue`: lists, filters, one product with its picture, and checks of files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from PIL import Image

import bellcrank as bc
from bellcrank.actuators.catalogue.catalogue import SHIPPED
from bellcrank.cli import main
from bellcrank.commands.catalogue import parse_range
from bellcrank.commands.catalogue_tables import text_table

WHOLE = bc.load_catalogue(contradicting=True)
OWN = """id,maker,model,kind,nominal_voltage [V],resistance [Ω],stall_current [A],nominal_torque [N m],mass [kg],source
good,Acme,B40,motor,24,0.6,40,0.1,0.2,data sheet
{bad}"""
BAD = "bad,Acme,B41,motor,24,0.6,13,0.1,0.2,data sheet\n"


@pytest.fixture
def own(tmp_path: Path) -> Path:
    folder = tmp_path / "own"
    folder.mkdir()
    (folder / "motors.csv").write_text(OWN.format(bad=""), encoding="utf-8")
    return folder


def test_the_list_has_every_product_and_counts_them(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    assert main(["catalogue"]) == 0
    text = capsys.readouterr().out
    for product in WHOLE.products:
        assert product.id in text
    assert f"{len(WHOLE.motors)}" in text and "datasheet" in text and "lk_mg10015 *" in text
    assert "* contradicts itself" in text and "voltage limit" in text and f"of {len(WHOLE.gears)}" in text


@pytest.mark.parametrize("width", [60, 80, 120])
def test_the_list_fits_the_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    assert main(["catalogue", "--maker", "Yaskawa"]) == 0
    text = capsys.readouterr().out
    table = text.split("quality    ")[0]
    assert max(map(len, table.splitlines())) <= width
    assert ("(not shown for lack of width: " in text) == (width < 100)


def test_filters(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    arguments = [
        "--maker",
        "maxon",
        "--kind",
        "motor",
        "--voltage",
        "24",
        "--torque",
        "100 mN m..0.2",
        "--speed",
        "3000 rpm..",
    ]
    assert main(["catalogue", *arguments, "--mass", "..1", "--ratio", "..50", "--out", str(tmp_path)]) == 0
    assert "no product" in capsys.readouterr().out  # motors state no ratio, and gears no nominal voltage
    assert main(["catalogue", *arguments, "--out", str(tmp_path)]) == 0
    got = json.loads((tmp_path / "catalogue.json").read_text(encoding="utf-8"))
    expected = [
        motor.id
        for motor in WHOLE.motors
        if motor.maker == "maxon" and motor.kind == "motor" and motor.nominal_voltage == 24.0
        and motor.continuous_torque is not None and 0.1 <= motor.continuous_torque <= 0.2
        and (motor.nominal_speed or motor.max_speed or motor.no_load_speed or 0.0) >= 314.159
    ]  # fmt: skip
    assert expected and [motor["id"] for motor in got["motors"]] == expected
    again = bc.load_catalogue(tmp_path, shipped=False, contradicting=True)
    assert [motor.id for motor in again.motors] == expected
    assert got["motors"][0]["peak_time"] is None and got["completeness"][0]["criterion"]


def test_screws_and_racks_are_listed_with_forces(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "140")
    (tmp_path / "gears.csv").write_text(
        "id,maker,model,kind,lead [mm],pinion_radius [mm],rated_force [N],repeated_peak_force [N]\n"
        "s,M,M,screw,5,,2000,4000\nr,M,M,rack,,22.5,,1000\n",
        encoding="utf-8",
    )
    assert main(["catalogue", "--own", "--catalogue", str(tmp_path)]) == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["s", "screw", "5", "mm", "lead", "2000", "N", "4000", "N", "-", "-", "M", "user"] in rows
    assert ["r", "rack", "22.5", "mm", "radius", "-", "1000", "N", "-", "-", "M", "user"] in rows


def test_a_kind_and_a_voltage_list_nothing_else(tmp_path: Path) -> None:
    for arguments, motors, gears in (
        (["--kind", "screw"], set(), {"screw"}),
        (["--kind", "servo"], {"servo"}, set()),
        (["--kind", "servo", "--kind", "strain_wave"], {"servo"}, {"strain_wave"}),
    ):
        assert main(["catalogue", *arguments, "--out", str(tmp_path)]) == 0
        got = json.loads((tmp_path / "catalogue.json").read_text(encoding="utf-8"))
        assert ({one["kind"] for one in got["motors"]}, {one["kind"] for one in got["gears"]}) == (motors, gears)
    assert main(["catalogue", "--voltage", "24", "--out", str(tmp_path)]) == 0
    got = json.loads((tmp_path / "catalogue.json").read_text(encoding="utf-8"))
    assert not got["gears"] and {one["nominal_voltage"] for one in got["motors"]} == {24.0}


def test_own_products_are_added_or_alone(capsys: pytest.CaptureFixture[str], own: Path) -> None:
    assert main(["catalogue", "--catalogue", str(own), "--maker", "acme"]) == 0
    assert "good" in capsys.readouterr().out
    assert main(["catalogue", "--own", "--catalogue", str(own)]) == 0
    text = capsys.readouterr().out
    assert "good" in text and "maxon" not in text and "1 of 1" not in text.split("criterion")[0]


def test_completeness_counts_rows_that_state_what_a_criterion_needs(tmp_path: Path) -> None:
    """By hand: a motor with and one without a speed limit, a gear with and one without an input speed."""
    from bellcrank.commands.catalogue_tables import completeness

    motors = (
        bc.Motor(id="a", maker="M", model="M", max_speed=500.0, brake_torque=1.0, tilting_moment=3.0),
        bc.Motor(id="b", maker="M", model="M"),
        bc.Motor(id="c", maker="M", model="M", kind="actuator", max_speed=5.0),
    )
    gears = (
        bc.Gear(id="g", maker="M", model="M", kind="spur", ratio=5.0, max_speed=400.0),
        bc.Gear(id="h", maker="M", model="M", kind="spur", ratio=7.0),
    )
    found = {one.criterion: one for one in completeness(bc.Catalogue(motors, gears))}
    # pairs: a and b with g, h and none; c with none
    assert (found["motor speed"].motors, found["motor speed"].pairs) == (2, pytest.approx(4 / 7))
    assert (found["holding brake"].motors, found["holding brake"].pairs) == (1, pytest.approx(3 / 7))
    # the output bearing is that of the motor or of the gear: c states neither
    assert (found["tilting moment"].motors, found["tilting moment"].gears) == (1, 0)
    assert (found["gear largest input speed"].motors, found["gear largest input speed"].gears) == (None, 1)
    assert all(one.pairs is None for one in completeness(bc.Catalogue()))


def test_show_prints_a_product_and_draws_it(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["catalogue", "show", "maxon_ec45flat_70w_24v", "hd_csf_17_50_2uh"]) == 0
    text = capsys.readouterr().out
    for part in ("5600 rpm", "181 g cm²", "unknown: pole pairs", "flippingbook", "checked 2026", "0 contradicted"):
        assert part in text
    assert "16 N m" in text and "7000 h" in text and "wrote maxon_ec45flat_70w_24v.png" in text
    with Image.open(tmp_path / "maxon_ec45flat_70w_24v.png") as image:
        assert image.format == "PNG" and image.width > 600
        assert len(image.convert("RGB").getcolors(1 << 20) or ()) > 20
    assert {path.name for path in tmp_path.iterdir()} == {"maxon_ec45flat_70w_24v.png"}


def test_show_says_what_contradicts_itself(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["catalogue", "show", "lk_mg10015", "--no-plots"]) == 0
    text = capsys.readouterr().out
    assert "2 contradicted" in text and "efficiency at the nominal point" in text and "wrote" not in text


@pytest.mark.tier2
def test_the_picture_of_every_motor_is_drawn_with_its_limits() -> None:
    """The lines of the picture against the figures of the row: the voltage line ends at (U (1 - 0.1) - R I_0) / k."""
    from bellcrank.actuators.conditions import Conditions
    from bellcrank.actuators.motor_plot import RPM, motor_figure

    motor = WHOLE.motor("maxon_re25_118743_12v")
    lines = {line.get_label().split(":")[0]: line for line in motor_figure(motor, Conditions()).axes[0].lines}
    speed, torque = lines["voltage"].get_data()
    end = (12.0 * 0.9 - 2.18 * 0.0263) / 0.0234 * RPM
    assert float(next(v for v, t in zip(speed, torque, strict=True) if t <= 0.0)) == pytest.approx(end, rel=5e-3)
    assert max(lines["continuous (S1)"].get_ydata()) == pytest.approx(0.0286, rel=1e-9)
    for one in WHOLE.motors[::7]:
        figure = motor_figure(one, Conditions(voltage=24.0))
        axis = figure.axes[0]
        assert one.id in axis.get_title(loc="left").replace("\n", " ") and axis.get_ylim()[1] > 0.0
        assert axis.lines or "no limit is stated" in {text.get_text() for text in axis.texts}


@pytest.mark.tier2
@pytest.mark.parametrize("size", [5e-324, 1e-160, 1e100])
def test_extreme_figures_are_drawn_without_a_fault(size: float, tmp_path: Path) -> None:
    from bellcrank.actuators.conditions import Conditions
    from bellcrank.actuators.motor_plot import write_motor_plot

    names = ("nominal_voltage", "torque_constant", "resistance", "no_load_current", "nominal_torque", "nominal_speed")
    names += ("peak_torque", "max_speed", "resistance_winding_housing", "resistance_housing_ambient")
    for chosen in (names, names[:4], names[4:8], names[1:]):
        motor = bc.Motor(id="m", maker="$x_^", model="m", torque_constant_basis="dc", **dict.fromkeys(chosen, size))
        assert write_motor_plot(motor, tmp_path / "m.png", Conditions(voltage=24.0)).stat().st_size > 1000


def test_check_finds_what_contradicts_itself(capsys: pytest.CaptureFixture[str], own: Path) -> None:
    assert main(["catalogue", "check", str(own)]) == 0
    text = capsys.readouterr().out
    assert "1 product, 2 checks" in text and "none contradicts itself" in text and "without a source" not in text
    (own / "motors.csv").write_text(OWN.format(bad=BAD), encoding="utf-8")
    for path in (own, own / "motors.csv"):
        assert main(["catalogue", "check", str(path)]) == 1
        text = capsys.readouterr().out
        assert f"{own / 'motors.csv'}, line 3: bad: stall current" in text and "1 contradicts itself" in text
    assert main(["catalogue", "check"]) == 1
    text = capsys.readouterr().out
    assert "actuators.csv, line" in text and "lk_mg10015" in text


def test_check_refuses_an_id_of_the_shipped_catalogue(capsys: pytest.CaptureFixture[str], own: Path) -> None:
    text = OWN.format(bad=BAD.replace("bad", "maxon_ec45flat_70w_24v", 1))
    (own / "motors.csv").write_text(text, encoding="utf-8")
    assert main(["catalogue", "check", str(own)]) == 2
    assert "is also at" in capsys.readouterr().err
    assert main(["catalogue", "check", str(own), "--own"]) == 1
    assert main(["catalogue", "check", str(SHIPPED / "motors.csv")]) == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["show"], "expected the id of a product"),
        (["show", "maxon_ec45flat_70w_25v"], "did you mean 'maxon_ec45flat_70w_24v'"),
        (["list", "maxon"], "to show a product: bellcrank catalogue show ID"),
        (["show", "hd_csf_17_50_2uh", "lk_mg10015", "--out", "a.png"], "names one picture, and 2 products"),
        (["show", "lk_mg10015", "--out", "a.bmp"], "unknown picture format '.bmp'"),
        (["--maker", "maxxon"], "did you mean 'maxon'"),
        (["--voltage", "-3"], "--voltage '-3': expected a number of more than 0"),
        (["--torque", "5"], "--torque '5': expected MIN..MAX"),
        (["--torque", "5..1"], "the first number is larger"),
        (["--torque", "5 A..7"], "units known here"),
        (["--catalogue", "nowhere"], "nowhere: there is no such file"),
        (["check", "--torque", "1..2"], "--torque: 'check' does not take it; it is for list"),
        (["list", "--no-plots"], "--no-plots: 'list' does not take it; it is for show"),
        (["check", "nowhere.csv"], "nowhere.csv: there is no such file"),
    ],
)
def test_bad_arguments_are_refused_in_one_line(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert main(["catalogue", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith("bellcrank: ") and message in error and len(error.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_ranges_have_units() -> None:
    assert parse_range("--torque", "100 mN m..0.2", "N m") == (pytest.approx(0.1), 0.2)
    assert parse_range("--speed", "..3000 rpm", "rad/s") == (0.0, pytest.approx(314.159, rel=1e-5))


def test_numbers_of_a_text_table_stand_to_the_right() -> None:
    assert text_table(("a", "n\nkg"), [["x", "1"], ["yy", "-"]]).splitlines() == [
        "a    n",
        "    kg",
        "------",
        "x    1",
        "yy   -",
    ]


def test_the_id_of_a_product_shows_it_and_a_slip_in_an_action_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["catalogue", "apex_af042_50", "--no-plots"]) == 0
    shown = capsys.readouterr().out
    assert main(["catalogue", "show", "apex_af042_50", "--no-plots"]) == 0
    assert capsys.readouterr().out == shown
    assert main(["catalogue", "shwo"]) == 2
    assert "unknown action 'shwo'; did you mean 'show'?" in capsys.readouterr().err
    assert main(["catalogue", "apex_af042_5"]) == 2
    assert "unknown product 'apex_af042_5'; did you mean 'apex_af042_50'?" in capsys.readouterr().err
