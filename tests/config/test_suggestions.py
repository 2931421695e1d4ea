"""What a user probably meant: percent, decimal commas, pounds and inches, words of other programs, wrong keywords."""

import math
from pathlib import Path

import pytest

import bellcrank as bc
from bellcrank.arguments import named
from bellcrank.config.fields import parse_number
from bellcrank.config.units import decimal_comma

PENDULUM = (Path(__file__).parents[2] / "robots" / "geared_pendulum.yaml").read_text()


def sized(folder, old, new):
    """The pendulum sized with a changed line."""
    assert old in PENDULUM
    (folder / "pendulum.yaml").write_text(PENDULUM.replace(old, new))
    return bc.size(folder / "pendulum.yaml")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("efficiency: 0.8,", "efficiency: 75,", "expected at most 1, found 75; did you mean 75 %?"),
        ("efficiency: 0.8,", "efficiency: 0,8,", "a comma in a number separates entries here; write 0.8"),
        ("rated_torque: 0.32", "rated_torque: 0,32 N m", "write 0.32 N m"),
        ("rated_torque: 0.32", "rated_torque: '0,32 N m'", r"found '0,32 N m'; write 0\.32 N m"),
        ("rated_speed: 3000 rpm", "rated_speed: 3,000 rpm", r"write 3\.000 rpm, or 3000 rpm"),
        ("kind: waypoints", "kind: spline", "unknown kind 'spline'; did you mean 'waypoints'?"),
        ("kind: dwell", "kind: pause", "unknown kind 'pause'; did you mean 'dwell'?"),
    ],
)
def test_a_likely_slip_is_refused_with_what_was_meant(tmp_path, old, new, said):
    with pytest.raises(bc.InputError, match=said.replace("?", r"\?")):
        sized(tmp_path, old, new)


@pytest.mark.parametrize("text", ["1,2,3", "1,000.5", "a,5", "1, 5", "1.5"])
def test_what_is_no_decimal_comma_is_none(text):
    assert decimal_comma(text) == ""


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("2 lb", "kg", 0.90718474), ("3 oz", "kg", 0.085048569375), ("4 in", "m", 0.1016), ("1 ft", "m", 0.3048),
        ("1 lbf", "N", 4.4482216152605), ("1 lbf ft", "N m", 1.3558179483314), ("1 lbf in", "N m", 0.1129848290276),
        ("1 kgf cm", "N m", 0.0980665), ("1 lb in^2", "kg m^2", 2.9263965e-4), ("1 oz in^2", "kg m^2", 1.82899783e-5),
    ],
)  # fmt: skip
def test_customary_units_have_the_factors_of_nist(text, unit, value):
    """NIST Special Publication 811 (2008), appendix B.8; the units of force by 9.80665 m/s²."""
    assert math.isclose(parse_number(text, unit), value, rel_tol=2e-8)


def test_a_rotor_inertia_in_other_units_is_doubted(tmp_path):
    line = next(part for part in PENDULUM.splitlines() if "rotor_inertia" in part)
    value = line.split("rotor_inertia:")[1].split(",")[0].strip()
    for inertia, doubted in ((f"{float(value) * 1e4:g}", True), (value, False)):
        found = sized(tmp_path, f"rotor_inertia: {value}", f"rotor_inertia: {inertia}").warnings
        assert any("was kg cm² meant? write '0.05 kg cm^2'" in text for text in found) == doubted


@pytest.mark.parametrize(
    ("function", "keyword", "near"),
    [
        (bc.size, "paylods", "payloads"), (bc.simulate, "rtoll", "rtol"), (bc.load_scene, "overide", "overrides"),
        (bc.select, "motion", "motions"), (bc.waypoints, "time", "times"), (bc.sweep, "wokers", "workers"),
    ],
)  # fmt: skip
def test_a_wrong_keyword_is_an_error_of_bellcrank_with_the_nearest_one(function, keyword, near):
    with pytest.raises(
        bc.InputError, match=f"{function.__name__}: unknown argument '{keyword}'; did you mean '{near}'"
    ):
        function("planar_2r", **{keyword: 1})


def test_a_type_error_inside_a_function_stays_one():
    @named
    def broken():
        raise TypeError("other() got an unexpected keyword argument 'x'")

    with pytest.raises(TypeError, match="other"):
        broken()
