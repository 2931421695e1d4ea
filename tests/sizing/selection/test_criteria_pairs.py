"""Which motors go with which gears."""

from __future__ import annotations

from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.sizing.selection.pairs import Pairs


def motor(name: str, **more: object) -> Motor:
    return Motor(id=name, maker="M", model=name, **more)  # type: ignore[arg-type]


def gear(name: str, kind: str = "planetary", **more: object) -> Gear:
    return Gear(id=name, maker="G", model=name, kind=kind, ratio=10.0, **more)  # type: ignore[arg-type]


def names(pairs: Pairs) -> dict[tuple[str, str], bool]:
    """Whether the fit is known, by ids."""
    rows = [pairs.rows(k) for k in range(len(pairs))]
    return {(m.id, g.id): bool(fit) for (m, g), fit in zip(rows, pairs.fits, strict=True)}


def test_rotary_axes_take_gears_and_none_and_whole_actuators_alone() -> None:
    motors = [motor("bare"), motor("whole", kind="actuator")]
    found = names(Pairs.possible(motors, [gear("g"), gear("s", "screw"), gear("r", "rack")]))
    assert found == {("bare", "direct"): True, ("bare", "g"): False, ("whole", "direct"): True}


def test_linear_axes_take_screws_and_racks_only() -> None:
    motors = [motor("bare"), motor("whole", kind="actuator")]
    found = names(Pairs.possible(motors, [gear("g"), gear("s", "screw"), gear("r", "rack")], "linear"))
    assert found == {("bare", "s"): False, ("bare", "r"): False}


def test_flange_and_shaft_fit_where_both_sides_state_them() -> None:
    motors = [
        motor("a", flange="NEMA 23", shaft_diameter=0.008),
        motor("b", flange="NEMA 34", shaft_diameter=0.008),
        motor("c", flange="nema 23", shaft_diameter=0.014),
        motor("d"),
    ]
    gears = [gear("both", input_flange="NEMA 17; NEMA 23", input_shaft_diameter=0.011), gear("silent")]
    found = names(Pairs.possible(motors, gears))
    assert found[("a", "both")] is True
    assert ("b", "both") not in found, "another flange"
    assert ("c", "both") not in found, "too thick a shaft"
    assert found[("d", "both")] is False, "not checked"
    assert found[("a", "silent")] is False


def test_a_gear_that_is_built_in_goes_with_its_motors_only() -> None:
    built_in = Gear(
        id="g", maker="Yaskawa", model="1/5", kind="planetary", ratio=5.0, input_flange="Yaskawa SGMAH 30 W"
    )
    motors = [motor("other"), motor("its", flange="Yaskawa SGMAH 30 W")]
    assert [key for key in names(Pairs.possible(motors, [built_in])) if key[1] == "g"] == [("its", "g")]


def test_nothing_to_choose_from_gives_no_pairs() -> None:
    assert len(Pairs.possible([], [])) == 0
    assert len(Pairs.possible([motor("bare")], [], "linear")) == 0
