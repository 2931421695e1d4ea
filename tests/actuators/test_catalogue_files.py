"""Catalogue files: what is read, what is refused and how, and files that are read back the same."""

from __future__ import annotations

import math
import random
import string
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import bellcrank as bc
from bellcrank.actuators.catalogue import catalogue_files, catalogue_tables
from bellcrank.actuators.catalogue.catalogue import SHIPPED
from bellcrank.actuators.catalogue.catalogue_columns import CURVE_FIELDS, GEAR_COLUMNS, MOTOR_COLUMNS, Column
from bellcrank.actuators.catalogue.product_checks import Range
from bellcrank.config.units import UNITS

MOTORS = "id,maker,model,kind,nominal_voltage [V],nominal_torque [mN m],mass [g],notes"
GEARS = "id,maker,model,kind,ratio,efficiency [%],inertia [g cm^2],inertia_side"


def read(tmp_path: Path, *lines: str, name: str = "own.csv") -> bc.Catalogue:
    (tmp_path / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    return bc.load_catalogue(tmp_path, shipped=False, contradicting=True)


def test_units_of_the_header_are_converted_and_empty_cells_are_unknown(tmp_path: Path) -> None:
    motor = read(tmp_path, MOTORS, "a,Maker,Model,motor,24,85,110,", "b,Maker,Model,servo,,,,a note").motors[0]
    assert (motor.nominal_voltage, motor.nominal_torque, motor.mass, motor.notes) == (24.0, 0.085, 0.11, "")
    other = bc.load_catalogue(tmp_path, shipped=False).motors[1]
    assert (other.kind, other.nominal_voltage, other.mass, other.quality) == ("servo", None, None, "user")


def test_spreadsheets_of_windows_are_read(tmp_path: Path) -> None:
    """A byte-order mark, Windows line ends, blank lines, commas at the end and an apostrophe before a formula."""
    text = MOTORS + ',,\r\n\r\na,Maker,\'=2+3,motor, 24 ,85,110,"a, b",,\r\n,,,,,,,,,\r\n'
    (tmp_path / "own.csv").write_bytes(b"\xef\xbb\xbf" + text.encode())
    (motor,) = bc.load_catalogue(tmp_path, shipped=False).motors
    assert (motor.model, motor.nominal_voltage, motor.notes) == ("=2+3", 24.0, "a, b")


def test_every_unit_has_an_alternative_that_gives_the_same_number(tmp_path: Path) -> None:
    lines = [
        "id,maker,model,kind,resistance [mΩ],inductance [µH],torque_constant [mN m/A],speed_constant [rpm/V],"
        "max_winding_temperature [degC],resistance_winding_housing [°C/W],peak_torque [oz in],"
        "time_constant_motor [min]",
        "a,M,M,motor,573,301,40.4,236,125,6.64,100,2",
    ]
    (motor,) = read(tmp_path, *lines).motors
    assert motor.resistance == pytest.approx(0.573) and motor.inductance == pytest.approx(301e-6)
    assert motor.torque_constant == pytest.approx(0.0404)
    assert motor.speed_constant == pytest.approx(236 * math.pi / 30)
    assert (motor.max_winding_temperature, motor.resistance_winding_housing) == (125.0, 6.64)
    assert motor.peak_torque == pytest.approx(0.706155, rel=1e-6)  # 100 ozf in
    assert motor.time_constant_motor == 120.0


def test_screws_and_racks_give_a_lead_or_a_radius(tmp_path: Path) -> None:
    screw, rack = read(
        tmp_path,
        "id,maker,model,kind,lead [mm],pinion_radius [mm],rated_force [kN],axial_stiffness [N/µm],axial_backlash [mm]",
        "s,M,M,screw,5,,2,100,0.02",
        "r,M,M,rack,,20,1,,",
    ).gears
    assert screw.ratio == pytest.approx(2.0 * math.pi / 0.005) and rack.ratio == pytest.approx(50.0)
    assert (screw.rated_torque, rack.rated_torque) == (2000.0, 1000.0)
    assert (screw.stiffness, screw.backlash) == (pytest.approx(1e8), pytest.approx(2e-5))


def test_inertias_are_referred_to_the_input_of_a_gear_and_the_output_of_an_actuator(tmp_path: Path) -> None:
    at_input, at_output = read(tmp_path, GEARS, "a,M,M,spur,10,90,4,input", "b,M,M,spur,10,90,400,output").gears
    assert at_input.inertia == pytest.approx(4e-7) and at_output.inertia == pytest.approx(4e-7)
    assert at_output.inertia_side == "output"
    header = "id,maker,model,kind,ratio,rotor_inertia_before_gear [g cm^2]"
    (actuator,) = read(tmp_path / "..", header, "c,M,M,actuator,10,4", name="actuators.csv").motors
    assert actuator.rotor_inertia == pytest.approx(4e-5)


def test_curves_belong_to_products_of_all_files(tmp_path: Path) -> None:
    read(tmp_path, MOTORS, "a,M,M,motor,24,85,110,")
    read(tmp_path, GEARS, "g,M,M,spur,10,90,4,input", name="own_gears.csv")
    catalogue = read(
        tmp_path,
        "id,curve,speed [rpm],torque [mN m],load,efficiency [%]",
        "a,peak_curve,0,300,,",
        "a,peak_curve,3000,100,,",
        "g,efficiency_curve,,,0.1,40",
        "g,efficiency_curve,,,1,85",
        name="curves.csv",
    )
    speed = 3000 * math.pi / 30
    assert catalogue.motor("a").peak_curve == ((0.0, 0.3), (pytest.approx(speed), 0.1))
    assert catalogue.gear("g").efficiency_curve == ((0.1, 0.4), (1.0, 0.85))


REFUSED = {  # lines of a file -> parts of the message
    "unknown column": ([MOTORS.replace("mass", "weight"), ""], ["line 1", "unknown column 'weight'"]),
    "nearly a column": ([MOTORS.replace("mass", "mas"), ""], ["unknown column 'mas'; did you mean 'mass'"]),
    "column of gears": ([MOTORS.replace("mass [g]", "average_torque [N m]"), ""], ["unknown column 'average_torque'"]),
    "no unit": ([MOTORS.replace(" [V]", "")], ["line 1: column 'nominal_voltage' has no unit", "[V]"]),
    "wrong unit": ([MOTORS.replace("[g]", "[st]")], ["column 'mass' is in 'st', expected [kg], [g]"]),
    "unit of a text": ([MOTORS.replace("model", "model [m]")], ["column 'model' holds texts and has no unit"]),
    "twice": ([MOTORS + ",mass [kg]"], ["column 'mass' occurs twice"]),
    "no name": ([MOTORS.replace("maker", "")], ["column 2 has no name"]),
    "missing": (["id,maker,kind", "a,b,motor"], ["column 'model' is missing"]),
    "empty": ([""], ["the file is empty"]),
    "semicolons": ([MOTORS.replace(",", ";"), "a;b;c;motor;24;85;110;"], ["separated by semicolons", "commas"]),
    "tabs": ([MOTORS.replace(",", "\t")], ["separated by tabs"]),
    "short": ([MOTORS, "a,b"], ["line 2 has 2 cells, the header has 8 columns"]),
    "long": ([MOTORS, "a,M,M,motor,1,1,1,x,y"], ["line 2 has 9 cells", "quotation marks"]),
    "text": ([MOTORS, "a,M,M,motor,24 V,,,"], ["line 2, column 'nominal_voltage [V]'", "expected a number", "'24 V'"]),
    "decimal comma": ([MOTORS, 'a,M,M,motor,"1,5",,,'], ["'1,5'", "write '.' for the decimal comma"]),
    "not finite": ([MOTORS, "a,M,M,motor,nan,,,"], ["line 2", "expected a finite number, found 'nan'"]),
    "infinite": ([MOTORS, "a,M,M,motor,1e999,,,"], ["expected a finite number"]),
    "negative": ([MOTORS, "a,M,M,motor,24,85,-3,"], ["column 'mass [g]': expected more than 0", "found '-3'"]),
    "zero": ([MOTORS, "a,M,M,motor,0,,,"], ["more than 0; leave the cell empty where the value is unknown"]),
    "huge": ([MOTORS, "a,M,M,motor,1e200,,,"], ["expected at most 1e+100"]),
    "Arabic digits": ([MOTORS, "a,M,M,motor,٢٤,,,"], ["expected a number"]),
    "no id": ([MOTORS, ",M,M,motor,,,,"], ["line 2, column 'id': the cell is empty"]),
    "bad id": ([MOTORS, "a b,M,M,motor,,,,"], ["column 'id': expected a letter or digit", "found 'a b'"]),
    "direct": ([MOTORS, "direct,M,M,motor,,,,"], ["not 'direct'"]),
    "id twice": ([MOTORS, "a,M,M,motor,,,,", "a,M,M,motor,,,,"], ["line 3", "id 'a' is also at", "line 2"]),
    "no kind": ([MOTORS, "a,M,M,,,,,"], ["line 2, column 'kind': unknown kind ''"]),
    "bad kind": ([MOTORS, "a,M,M,servos,,,,"], ["unknown kind 'servos'; did you mean 'servo'"]),
    "gear among motors": ([MOTORS, "a,M,M,motor,,,,", "b,M,M,spur,,,,"], ["line 3", "'spur' is a gear", "motors"]),
    "line break": ([MOTORS, 'a,M,M,motor,,,,"two', 'lines"'], ["line 2, column 'notes'", "line break"]),
    "control character": ([MOTORS, "a,M,M,motor,,,,\x1b[31m"], ["control character"]),
    "long text": ([MOTORS, "a,M,M,motor,,,," + "x" * 4001], ["a text of 4001 letters, expected at most 4000"]),
    "open quotation mark": ([MOTORS, 'a,"M,M,motor'], ["line 2: not valid CSV"]),
    "long cell": ([MOTORS, "a,M,M,motor,,,," + "x" * 200_000], ["line 2: not valid CSV: field larger"]),
    "ratio of a motor": (
        ["id,maker,model,kind,ratio", "a,M,M,motor,5"],
        ["column 'ratio': a product of kind 'motor' has no such value (it is for actuator)"],
    ),
    "share": ([GEARS, "a,M,M,spur,10,120,,"], ["expected at most 1 (100 %), found '120'"]),
    "side": ([GEARS, "a,M,M,spur,10,90,4,"], ["column 'inertia [g cm^2]': the side is not said", "inertia_side"]),
    "wrong side": ([GEARS, "a,M,M,spur,10,90,4,left"], ["unknown inertia_side 'left'"]),
    "no ratio": ([GEARS, "a,M,M,spur,,90,4,output"], ["needs a ratio"]),
    "torque of a screw": (
        ["id,maker,model,kind,lead [mm],rated_torque [N m]", "a,M,M,screw,5,3"],
        ["'screw' has no such value", "use the column 'rated_force [N]'"],
    ),
    "two leads": (
        ["id,maker,model,kind,lead [mm],ratio", "a,M,M,screw,5,3"],
        ["column 'ratio'", "use the column 'lead [m]'"],
    ),
    "two inertias": (
        ["id,maker,model,kind,ratio,rotor_inertia [kg m^2],rotor_inertia_before_gear [kg m^2]", "a,M,M,actuator,5,1,1"],
        ["'rotor_inertia [kg m^2]' gives this value too"],
    ),
    "inertia before no gear": (
        ["id,maker,model,kind,ratio,rotor_inertia_before_gear [kg m^2]", "a,M,M,actuator,,1"],
        ["needs the column 'ratio'"],
    ),
    "date": (["id,maker,model,kind,checked", "a,M,M,motor,22.11.2026"], ["expected a date such as 2026-11-22"]),
    "no day": (["id,maker,model,kind,checked", "a,M,M,motor,2026-02-30"], ["expected a date"]),
    "quality": (["id,maker,model,kind,quality", "a,M,M,motor,sheet"], ["unknown quality 'sheet'"]),
    "price": (["id,maker,model,kind,price", "a,M,M,motor,12"], ["a price without a currency"]),
    "poles": (["id,maker,model,kind,pole_pairs", "a,M,M,motor,3.5"], ["expected a whole number, found '3.5'"]),
    "cold": (
        ["id,maker,model,kind,max_winding_temperature [°C]", "a,M,M,motor,-300"],
        ["expected more than -273.15"],
    ),
    "tiny lead": (["id,maker,model,kind,lead [mm]", "a,M,M,screw,1e-320"], ["too large or too small"]),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_as_expected_is_refused_in_one_sentence(tmp_path: Path, name: str) -> None:
    lines, parts = REFUSED[name]
    with pytest.raises(bc.InputError) as error:
        read(tmp_path, *lines)
    message = str(error.value)
    assert message.startswith(str(tmp_path / "own.csv")) and len(message.splitlines()) == 1
    for part in parts:
        assert part in message, message


CURVES = "id,curve,speed [rpm],torque [N m],load,efficiency"
REFUSED_CURVES = {
    "product": (["b,peak_curve,0,1,,"], ["line 2, column 'id': unknown product 'b'"]),
    "curve": (["a,peak_curves,0,1,,"], ["unknown curve 'peak_curves'; did you mean 'peak_curve'"]),
    "of a gear": (["a,efficiency_curve,,,1,0.5"], ["'a' is a motor and has no such curve"]),
    "no torque": (["a,peak_curve,0,,,"], ["column 'torque [N m]': the value is missing"]),
    "no curve": (["a,,0,1,,"], ["column 'curve': the cell is empty"]),
    "other values": (["a,peak_curve,0,1,1,"], ["a point of 'peak_curve' has no load"]),
    "one point": (["a,peak_curve,0,1,,"], ["line 2", "at least two points"]),
    "falls": (["a,peak_curve,0,1,,", "a,peak_curve,0,1,,"], ["line 2", "rise from point to point"]),
    "no standstill": (["a,peak_curve,5,1,,", "a,peak_curve,6,1,,"], ["line 2", "a first point at speed 0"]),
}


@pytest.mark.parametrize("name", REFUSED_CURVES)
def test_curves_that_are_not_as_expected_are_refused(tmp_path: Path, name: str) -> None:
    lines, parts = REFUSED_CURVES[name]
    read(tmp_path, MOTORS, "a,M,M,motor,,,,")
    with pytest.raises(bc.InputError) as error:
        read(tmp_path, CURVES, *lines, name="points.csv")
    for part in (str(tmp_path / "points.csv"), *parts):
        assert part in str(error.value), error.value


def test_an_id_of_the_shipped_catalogue_is_refused_with_both_places(tmp_path: Path) -> None:
    (tmp_path / "own.csv").write_text(f"{MOTORS}\nmaxon_ec45flat_70w_24v,M,M,motor,,,,\n", encoding="utf-8")
    with pytest.raises(bc.InputError) as error:
        bc.load_catalogue(tmp_path)
    assert f"{tmp_path / 'own.csv'}, line 2" in str(error.value) and str(SHIPPED / "motors.csv") in str(error.value)


def test_folders_and_files_that_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(bc.InputError, match="no catalogue in this folder"):
        bc.load_catalogue(tmp_path)
    with pytest.raises(bc.InputError, match="there is no such file"):
        bc.load_catalogue(tmp_path / "nothing")
    (tmp_path / "latin.csv").write_bytes(MOTORS.encode() + b"\na,M,M\xe9,motor,,,,\n")
    with pytest.raises(bc.InputError, match="not valid UTF-8 at byte"):
        bc.load_catalogue(tmp_path)
    (tmp_path / "latin.csv").write_text(MOTORS + "\n" + "a,M,M,motor,,,,\n" * 20, encoding="utf-8")
    monkeypatch.setattr(catalogue_tables, "MOST_ROWS", 10)
    with pytest.raises(bc.InputError, match="line 12: more than 10 rows"):
        bc.load_catalogue(tmp_path)
    monkeypatch.setattr(catalogue_tables, "MOST_BYTES", 100)
    with pytest.raises(bc.InputError, match="is too large"):
        bc.load_catalogue(tmp_path)
    monkeypatch.setattr(catalogue_files, "MOST_FILES", 0)
    with pytest.raises(bc.InputError, match="1 CSV files, expected at most 0"):
        bc.load_catalogue(tmp_path, shipped=False)


# ---- written and read back

TEXT = st.text(st.characters(codec="utf-8", categories=["L", "N", "P", "S", "Zs"]), max_size=30)
PLAIN = TEXT.map(str.strip).filter(lambda text: text.isprintable() and not text.startswith("'"))


def numbers(column: Column) -> st.SearchStrategy[float]:
    allowed: Range = column.range
    low = allowed.above if allowed.above is not None else allowed.least or 0.0
    high = min(allowed.most, 1e6)
    if column.whole:
        return st.integers(1, 20).map(float)
    if "temperature" in column.name:
        return st.floats(150.0, 200.0) if column.name.startswith("max") else st.floats(-50.0, 100.0)
    return st.floats(max(low, 1e-6), high)


def products(kind: type[Any], columns: dict[str, Column], kinds: list[str]) -> st.SearchStrategy[list[Any]]:
    @st.composite
    def one(draw: st.DrawFn) -> Any:
        values: dict[str, Any] = {"id": draw(st.from_regex(r"\A[A-Za-z0-9][A-Za-z0-9._-]{0,10}\Z"))}
        values["kind"] = draw(st.sampled_from(kinds))
        by_field = {column.field: column for column in columns.values() if column.name == column.field}
        for field in fields(kind):
            if field.name in values or field.name in CURVE_FIELDS or field.name in ("price", "currency", "checked"):
                continue
            column = by_field[field.name]
            linear = values["kind"] in ("screw", "rack") and field.name == "ratio"
            if column.kinds and values["kind"] not in column.kinds and not linear:
                continue
            if column.unit is not None:
                values[field.name] = draw(st.none() | numbers(column))
            elif column.choices:
                values[field.name] = draw(st.sampled_from(column.choices))
            elif field.name in ("maker", "model"):
                values[field.name] = draw(PLAIN.filter(bool))
            elif "None" in str(field.type):
                values[field.name] = draw(st.none() | PLAIN.filter(bool))
            else:
                values[field.name] = draw(PLAIN)
        if values.get("inertia_side") == "output" and values.get("ratio") is None:
            values["inertia"] = None
        curve = st.none() | st.just(((0.0, 2.0), (10.0, 1.5), (20.0, 0.25)))
        names = ["efficiency_curve"] if kind is bc.Gear else ["continuous_curve", "peak_curve"]
        if kind is bc.Gear:
            curve = st.none() | st.just(((0.1, 0.2), (1.0, 0.9)))
        return kind(**values, **{name: draw(curve) for name in names})

    return st.lists(one(), max_size=4)


@pytest.mark.tier2
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much])
@given(
    products(bc.Motor, MOTOR_COLUMNS, list(MOTOR_COLUMNS["kind"].choices)),
    products(bc.Gear, GEAR_COLUMNS, list(GEAR_COLUMNS["kind"].choices)),
)
def test_a_catalogue_written_and_read_back_is_the_same(
    tmp_path_factory: pytest.TempPathFactory, motors: list[bc.Motor], gears: list[bc.Gear]
) -> None:
    rows = list({one.id.casefold(): one for one in [*motors, *gears]}.values())
    motors, gears = (
        [one for one in rows if isinstance(one, bc.Motor)],
        [one for one in rows if isinstance(one, bc.Gear)],
    )
    folder = tmp_path_factory.mktemp("catalogue")
    paths = bc.write_catalogue(motors, gears, folder)
    assert bool(paths) == bool(rows)
    if not rows:
        return
    again = bc.load_catalogue(folder, shipped=False, contradicting=True)
    assert list(again.motors) == motors
    for written, got in zip(gears, again.gears, strict=True):
        same = replace(got, ratio=written.ratio, inertia=written.inertia)
        assert same == written
        for name in ("ratio", "inertia"):  # a lead, a radius and an inertia at the output are converted twice
            value = getattr(written, name)
            assert getattr(got, name) == (value if value is None else pytest.approx(value, rel=1e-14))


def test_an_inertia_whose_side_is_not_said_is_written_as_that_at_the_input(tmp_path: Path) -> None:
    """As `Gear` says: its inertia is that at the input."""
    gear = bc.Gear(id="g", maker="M", model="M", kind="spur", ratio=5.0, inertia=1e-6)
    bc.write_catalogue([], [gear], tmp_path)
    assert bc.load_catalogue(tmp_path, shipped=False).gears == (replace(gear, inertia_side="input"),)


def test_every_field_has_a_column_and_every_unit_is_known() -> None:
    for kind, columns in ((bc.Motor, MOTOR_COLUMNS), (bc.Gear, GEAR_COLUMNS)):
        filled = {column.field for column in columns.values()}
        assert filled == {field.name for field in fields(kind) if field.name not in CURVE_FIELDS}
        for column in columns.values():
            numeric = "float" in str(next(one.type for one in fields(kind) if one.name == column.field))
            assert numeric == (column.unit is not None), column.name
            assert column.unit is None or column.unit in UNITS, column.name


# ---- hostile files


def test_damaged_files_are_refused_in_one_sentence_or_read(tmp_path: Path) -> None:
    """Shipped files with letters changed, lines cut, columns doubled and cells replaced, at random from a seed."""
    rng = random.Random(7)
    texts = [path.read_text(encoding="utf-8") for path in sorted(SHIPPED.glob("*.csv"))]
    outcomes = {"read": 0, "refused": 0}
    for number in range(300):
        text = rng.choice(texts)
        lines = text.splitlines()[: rng.choice([2, 3, 5, 8])]
        for _ in range(rng.randint(0, 3)):
            k = rng.randrange(len(lines))
            cells = lines[k].split(",")
            cells[rng.randrange(len(cells))] = rng.choice(
                ["", "nan", "-1", "1e308", '"', "'=1", "\x00", "€", "x" * 300, "1,5", "motor", "id", "[", "0x10", "\r"]
            )
            lines[k] = ",".join(cells)
        joined = "\n".join(lines)
        if rng.random() < 0.3:
            at = rng.randrange(len(joined) + 1)
            joined = joined[:at] + "".join(rng.choices(string.printable, k=3)) + joined[at + rng.randint(0, 5) :]
        file = tmp_path / f"{number}.csv"
        file.write_bytes(joined.encode("utf-8", "surrogatepass") + (b"\xff" if rng.random() < 0.05 else b""))
        try:
            bc.load_catalogue(file, shipped="curves" in joined[:40])
            outcomes["read"] += 1
        except bc.InputError as error:
            message = str(error)
            assert len(message.splitlines()) == 1 and message.isprintable() and len(message) < 2000
            outcomes["refused"] += 1
    assert outcomes["read"] > 10 and outcomes["refused"] > 100, outcomes
