"""Figures of many products as arrays: unknown is NaN, indices select and add axes, curves interpolate."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bellcrank.actuators.motor import Motor
from bellcrank.actuators.product_arrays import Curves, MotorArrays


def test_every_figure_is_an_array_with_nan_for_what_is_unknown() -> None:
    rows = [
        Motor(id="a", maker="", model="", mass=0.5, peak_curve=[(0, 2), (10, 1)]),
        Motor(id="b", maker="", model="", brake_torque=3),
    ]
    arrays = MotorArrays.of(rows)
    np.testing.assert_array_equal(arrays.mass, [0.5, np.nan])
    np.testing.assert_array_equal(arrays.brake_torque, [np.nan, 3.0])
    np.testing.assert_array_equal(arrays.peak_curve.known, [True, False])
    for field in fields(MotorArrays):
        if not field.name.endswith("curve"):
            assert getattr(arrays, field.name).shape == (2,) and getattr(arrays, field.name).dtype == np.float64
    pairs = arrays[np.array([1, 0, 0])]
    np.testing.assert_array_equal(pairs.mass, [np.nan, 0.5, 0.5])
    np.testing.assert_array_equal(pairs.peak_curve.known, [False, True, True])
    assert arrays[:, None].mass.shape == (2, 1) and arrays[:, None].peak_curve.at(np.zeros(5)).shape == (2, 5)
    assert MotorArrays.of([]).mass.shape == (0,) and MotorArrays.of([]).peak_curve.known.shape == (0,)


def test_a_curve_interpolates_between_its_points_and_goes_on_as_asked() -> None:
    curves = Curves.of([((0.0, 3.0), (10.0, 2.0), (20.0, 0.0)), None, ((0.0, 1.0), (5.0, 1.0))])
    x = np.array([0.0, 5.0, 10.0, 15.0, 20.0, 21.0, np.nan])
    expected = [[3.0, 2.5, 2.0, 1.0, 0.0, 0.0, np.nan], [np.nan] * 7, [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, np.nan]]
    np.testing.assert_array_equal(curves[:, None].at(x), expected)
    expected[2] = [1.0, 1.0, -1.0, -1.0, -1.0, -1.0, np.nan]
    expected[0][5] = -1.0
    np.testing.assert_array_equal(curves[:, None].at(x, beyond=-1.0), expected)
    np.testing.assert_array_equal(curves.last_x, [20.0, np.nan, 5.0])
    assert np.isnan(Curves.of([None, None]).last_x).all()
    assert Curves.of([((2.0, 5.0), (3.0, 6.0))]).at(np.array([1.0])) == 5.0  # before the first point


@pytest.mark.tier2
@given(
    st.lists(st.floats(0.01, 50.0), min_size=1, max_size=6),
    st.lists(st.floats(0.0, 10.0), min_size=7, max_size=7),
    st.lists(st.floats(0.0, 400.0), min_size=1, max_size=5),
)
def test_interpolation_is_numpys(steps: list[float], ordinates: list[float], at: list[float]) -> None:
    x = np.concatenate([[0.0], np.cumsum(steps)])
    y = np.array(ordinates[: len(x)])
    found = Curves.of([tuple(zip(x.tolist(), y.tolist(), strict=True))])[:, None].at(np.array(at))
    assert found[0] == pytest.approx(np.interp(at, x, y), rel=1e-12, abs=1e-12)
