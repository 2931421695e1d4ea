"""The two-body model over intervals: against a published sheet, scipy's integrator, and properties of the equations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from thermal_reference import ALPHA, euler_sheet, integrated, model

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.product_arrays import MotorArrays
from bellcrank.actuators.thermal import HeatCycle, Kernel, ThermalModel, temperatures
from bellcrank.actuators.thermal_cycle import periodic_temperatures, time_to_limit
from bellcrank.errors import InputError

# Motor Thermal Calculator, A. M. Johnson, Carnegie Mellon University (CC BY 4.0): 24 N m behind a gear of 80, for 30 s
# of 60 s, from an ambient of 25 °C; it prints 183.180 °C, and more than 130 °C from 10.75 s, 155 °C from 18.25 s on.
CMU = Motor(
    id="cmu", maker="", model="", torque_constant=0.0261, torque_constant_basis="dc", resistance=0.836,
    resistance_winding_housing=0.74, resistance_housing_ambient=8.96, time_constant_winding=4.12,
    time_constant_motor=968.0, max_winding_temperature=155.0,
)  # fmt: skip
CURRENT = 24.0 / 80.0 / 0.0261  # A; the sheet prints 11.494
LOSS = CURRENT**2 * 0.836


def cycle(durations: Any, copper: Any, friction: Any = 0.0) -> HeatCycle:
    copper = np.atleast_2d(np.asarray(copper, dtype=float))
    return HeatCycle(
        duration=np.asarray(durations, dtype=float), copper_loss=copper, friction_loss=np.zeros_like(copper) + friction
    )


def cmu() -> ThermalModel:
    return ThermalModel.of(MotorArrays.of([CMU]), Conditions())


def test_the_published_sheet_by_its_own_steps() -> None:
    thermal = cmu()
    assert thermal.winding_capacity[0] == pytest.approx(5.568, abs=5e-4)
    assert thermal.housing_capacity[0] == pytest.approx(108.036, abs=5e-4)
    assert pytest.approx(11.494, abs=5e-4) == CURRENT
    sheet = euler_sheet(thermal, LOSS, 30.0, 60.0, 0.25)
    assert sheet[:, 1].max() == pytest.approx(183.180, abs=5e-4)
    assert [sheet[sheet[:, 1] > limit][0, 0] for limit in (130.0, 155.0)] == [10.75, 18.25]


def test_the_published_sheet_by_the_exact_solution() -> None:
    thermal, heat = cmu(), cycle([30.0, 30.0], [LOSS, 0.0])
    _, winding, _ = temperatures(thermal, heat)
    assert winding[0].max() == pytest.approx(183.166, abs=5e-4)
    time, winding, _ = temperatures(thermal, heat.divided(120))  # every 0.25 s, as the sheet has it
    assert time[:3].tolist() == [0.0, 0.25, 0.5]
    assert [time[winding[0] > limit][0] for limit in (130.0, 155.0)] == pytest.approx([10.75, 18.25], abs=1e-9)
    exact = time_to_limit(thermal, heat, np.array([130.0]))[0], time_to_limit(thermal, heat, np.array([155.0]))[0]
    assert 10.5 < exact[0] < 10.75 and 18.0 < exact[1] < 18.25
    reached = [integrated(thermal, cycle([t], [LOSS]))[-1, 0] for t in exact]
    assert reached == pytest.approx([130.0, 155.0], abs=1e-7)
    repeated = periodic_temperatures(thermal, heat)
    assert repeated.runaway[0] and np.isinf(repeated.winding_peak[0]) and repeated.spectral_radius[0] > 1.09


@st.composite
def thermal_models(draw: Any) -> ThermalModel:
    capacities = 10.0 ** draw(st.floats(-1.0, 2.0)), 10.0 ** draw(st.floats(0.0, 4.0))
    resistances = 10.0 ** draw(st.floats(-1.0, 1.0)), 10.0 ** draw(st.floats(-1.0, 1.5))
    return model(capacities, resistances, ambient=draw(st.floats(-20.0, 60.0)))  # type: ignore[no-any-return]


@st.composite
def cycles(draw: Any, thermal: ThermalModel, most: float = 0.9) -> HeatCycle:
    """Losses around those at which the motor would run away if they lasted, times `most`."""
    count = draw(st.integers(1, 6))
    runaway = 1.0 / (ALPHA * float(thermal.winding_resistance[0] + thermal.housing_resistance[0]))
    scale = float(thermal.winding_resistance[0] * thermal.winding_capacity[0])
    durations = [scale * 10.0 ** draw(st.floats(-3.0, 1.0)) for _ in range(count)]
    copper = [runaway * most * draw(st.floats(0.0, 1.0)) for _ in range(count)]
    return cycle(durations, copper, [draw(st.floats(0.0, 5.0)) for _ in range(count)])


@pytest.mark.tier2
@settings(max_examples=12, deadline=None)
@given(st.data())
def test_it_agrees_with_an_integrator_at_tight_tolerance(data: st.DataObject) -> None:
    thermal = data.draw(thermal_models())
    heat = data.draw(cycles(thermal))
    start = [data.draw(st.floats(-10.0, 150.0)), data.draw(st.floats(-10.0, 100.0))]
    time, winding, housing = temperatures(thermal, heat, (np.array(start[:1]), np.array(start[1:])))
    expected = integrated(thermal, heat, start)
    assert time == pytest.approx(np.concatenate([[0.0], np.cumsum(heat.duration)]))
    assert np.column_stack([winding[0], housing[0]]) == pytest.approx(expected, abs=1e-6)


@given(st.data())
def test_the_kernel_is_the_integral_of_the_matrix_exponential(data: st.DataObject) -> None:
    """exp(A t) = I + K A, and K from the exponential of a block matrix (Van Loan 1978)."""
    thermal = data.draw(thermal_models())
    copper = data.draw(st.floats(0.0, 3.0)) / (
        ALPHA * float(thermal.winding_resistance[0] + thermal.housing_resistance[0])
    )
    time = float(thermal.winding_resistance[0] * thermal.winding_capacity[0]) * 10.0 ** data.draw(st.floats(-6.0, 1.0))
    rates = thermal.rates(np.array([copper]), np.zeros(1))
    kernel = Kernel.of(rates, time)
    found = np.array([[kernel.ww, kernel.wh], [kernel.hw, kernel.hh]])[:, :, 0]
    a = np.array(
        [
            [ALPHA * rates.copper[0] - rates.winding[0], rates.winding[0]],
            [rates.exchange[0], -rates.exchange[0] - rates.housing[0]],
        ]
    )
    blocks = np.zeros((4, 4))
    blocks[:2, :2], blocks[:2, 2:] = a, np.eye(2)
    expected = expm(blocks * time)[:2, 2:]
    assert found / time == pytest.approx(expected / time, rel=1e-9, abs=1e-12)


def test_a_singular_matrix_and_a_vanishing_time_are_no_exceptions() -> None:
    """At a copper loss of 1/(α (R_wh + R_ha)) one eigenvalue is 0: in the end the rise is a straight line."""
    thermal = model((5.0, 100.0), (1.0, 4.0))
    critical = 1.0 / (ALPHA * 5.0)
    heat = cycle([50.0, 1e4, 1e4], [[critical] * 3])
    _, winding, housing = temperatures(thermal, heat)
    expected = integrated(thermal, heat)
    assert np.column_stack([winding[0], housing[0]]) == pytest.approx(expected, rel=1e-8)
    assert winding[0, 3] - winding[0, 2] == pytest.approx(winding[0, 2] - winding[0, 1], rel=1e-3)
    still = temperatures(thermal, cycle([0.0, 1e-12, 1.0], [[critical] * 3]))[1][0]
    assert still[1] == 25.0 and still[2] == pytest.approx(25.0 + 1e-12 * critical / 5.0)


def test_stiff_models_keep_their_accuracy() -> None:
    """A winding that is 10^7 times as quick as the housing."""
    thermal = model((0.01, 1e5), (0.1, 10.0))
    heat = cycle([1e3, 1e-4, 1e3], [[20.0, 0.0, 5.0]])
    assert np.column_stack([x[0] for x in temperatures(thermal, heat)[1:]]) == pytest.approx(
        integrated(thermal, heat), abs=1e-6
    )


@given(st.data())
def test_the_steady_state_under_constant_losses(data: st.DataObject) -> None:
    thermal = data.draw(thermal_models())
    runaway = 1.0 / (ALPHA * float(thermal.winding_resistance[0] + thermal.housing_resistance[0]))
    copper, friction = runaway * data.draw(st.floats(0.0, 0.9)), data.draw(st.floats(0.0, 10.0))
    winding, housing = thermal.steady_temperatures(np.array([copper]), np.array([friction]))
    heat = copper * (1.0 + ALPHA * (winding[0] - 25.0))
    ambient = float(thermal.ambient[0])
    assert housing[0] == pytest.approx(ambient + float(thermal.housing_resistance[0]) * (heat + friction), rel=1e-9)
    assert winding[0] == pytest.approx(housing[0] + float(thermal.winding_resistance[0]) * heat, rel=1e-9)
    periodic = periodic_temperatures(thermal, cycle([1.0], [copper], friction))
    assert periodic.winding_peak[0] == pytest.approx(winding[0], abs=1e-6)
    assert periodic.housing_peak[0] == pytest.approx(housing[0], abs=1e-6)
    over = thermal.steady_temperatures(np.array([1.0001 * runaway]), np.array([friction]))
    assert np.isinf(over[0]).all() and np.isinf(over[1]).all()


def test_altitude_raises_both_resistances_and_keeps_the_capacities() -> None:
    high = ThermalModel.of(MotorArrays.of([CMU]), Conditions(altitude=2000.0, ambient=30.0))
    assert high.winding_resistance[0] == pytest.approx(0.74 / 0.9)
    assert high.housing_resistance[0] == pytest.approx(8.96 / 0.9)
    assert high.winding_capacity[0] == cmu().winding_capacity[0] and high.ambient[0] == 30.0


def test_only_a_share_of_the_friction_loss_heats_the_housing_where_the_nominal_point_says_so() -> None:
    """The nominal point of maxon's EC-4pole 30 (305013) held for ever: the largest winding temperature, 155 °C."""
    one = Motor(
        id="ec4", maker="", model="", torque_constant=0.0136, torque_constant_basis="dc", resistance=0.102,
        no_load_current=0.728, nominal_torque=0.0946, nominal_speed=1686.0, max_winding_temperature=155.0,
        resistance_winding_housing=0.209, resistance_housing_ambient=7.4, time_constant_winding=2.11,
        time_constant_motor=1180.0,
    )  # fmt: skip
    thermal = ThermalModel.of(MotorArrays.of([one]), Conditions())
    friction = 0.0136 * 0.728
    copper = 0.102 * ((0.0946 + friction) / 0.0136) ** 2
    steady = thermal.steady_temperatures(np.array([copper]), np.array([friction * 1686.0]))
    assert steady[0] == pytest.approx([155.0])
    heat = cycle([1.0, 2.0], [[copper] * 2], friction * 1686.0)
    assert periodic_temperatures(thermal, heat).winding_peak == pytest.approx([155.0])


def test_what_is_unknown_stays_unknown() -> None:
    rows = [CMU, Motor(id="m", maker="", model=""), Motor(**{**CMU.__dict__, "time_constant_motor": None})]
    thermal = ThermalModel.of(MotorArrays.of(rows), Conditions())
    heat = cycle([30.0, 30.0], [[10.0, 0.0]] * 3)
    _, winding, housing = temperatures(thermal, heat)
    assert np.isfinite(winding[0]).all() and np.isnan(winding[1, 1:]).all() and np.isnan(housing[1, 1:]).all()
    found = periodic_temperatures(thermal, heat)
    assert np.isnan(found.winding_peak).tolist() == [False, True, True]
    assert np.isnan(found.growth).tolist() == [False, True, True] and not found.runaway.any()
    assert np.isnan(time_to_limit(thermal, heat, np.full(3, 130.0))).tolist() == [False, True, True]
    steady = thermal.steady_temperatures(np.full(3, 10.0), np.zeros(3))[0]
    assert np.isnan(steady).tolist() == [False, True, False]  # it needs no time constants
    nan = periodic_temperatures(cmu(), cycle([30.0, 30.0], [[np.nan, 0.0]]))
    assert np.isnan(nan.winding_peak).all() and not nan.runaway.any()


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"duration": [1.0, -1.0]}, "a heat cycle: argument 'duration': expected durations of 0 or more"),
        ({"duration": [0.0, 0.0]}, "expected durations of 0 or more that are not all 0"),
        ({"duration": []}, "expected durations of 0 or more that are not all 0"),
        ({"duration": [1.0, np.nan]}, "argument 'duration': expected a list of finite numbers"),
        ({"copper_loss": [[1.0, -2.0]]}, "argument 'copper_loss': expected losses of 0 or more (W), found -2"),
        ({"copper_loss": [[1.0]]}, "argument 'copper_loss': expected an array of shape (n, 2)"),
        ({"friction_loss": [[1.0, 1.0]] * 2}, "argument 'friction_loss': expected 1 rows"),
    ],
)
def test_impossible_heat_cycles_are_refused(change: dict[str, Any], text: str) -> None:
    given_ = {"duration": [1.0, 2.0], "copper_loss": [[1.0, 2.0]], "friction_loss": [[0.0, 0.0]], **change}
    with pytest.raises(InputError) as error:
        HeatCycle(**{name: np.array(value) for name, value in given_.items()})
    assert text in str(error.value)


def test_a_cycle_divides_and_repeats() -> None:
    heat = cycle([1.0, 3.0], [4.0, 2.0])
    assert heat.divided(2).duration.tolist() == [0.5, 0.5, 1.5, 1.5] and heat.period == 4.0
    assert heat.divided(2).copper_loss.tolist() == [[4.0, 4.0, 2.0, 2.0]]
    assert heat.repeated(2).duration.tolist() == [1.0, 3.0, 1.0, 3.0]
    thermal = cmu()
    whole, parts = temperatures(thermal, heat)[1], temperatures(thermal, heat.divided(5))[1]
    assert whole[0] == pytest.approx(parts[0, ::5], abs=1e-10)
