"""Gears: what a row may hold."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bellcrank.actuators.gear import DIRECT, Gear
from bellcrank.actuators.product_arrays import GearArrays
from bellcrank.errors import InputError


def gear(**figures: Any) -> Gear:
    return Gear(**{"id": "g1", "maker": "", "model": "", "kind": "spur", **figures})


@pytest.mark.parametrize(
    ("field", "value", "text"),
    [
        ("ratio", 0.0, "gear 'g1': argument 'ratio': expected a finite number of more than 0"),
        ("ratio", -50.0, "argument 'ratio': expected a finite number of more than 0"),
        ("efficiency", 0.0, "argument 'efficiency': expected a finite number of more than 0 and at most 1"),
        ("efficiency", 70.0, "argument 'efficiency': expected a finite number of more than 0 and at most 1"),
        ("back_efficiency", -0.1, "argument 'back_efficiency': expected a finite number of at least 0 and at most 1"),
        ("inertia", -1e-6, "argument 'inertia': expected a finite number of at least 0"),
        ("stages", 1.5, "argument 'stages': expected a whole number, found 1.5"),
        ("kind", "harmonic", "argument 'kind': unknown choice 'harmonic'"),
        ("inertia_side", "motor", "argument 'inertia_side': unknown choice 'motor'"),
        ("efficiency_curve", [(0.5, 0.7)], "argument 'efficiency_curve': expected at least two points"),
        ("efficiency_curve", [(0.0, 0.5), (1.0, 0.7)], "points of a load of more than 0 and an efficiency"),
        ("efficiency_curve", [(0.1, 0.5), (1.0, 1.7)], "points of a load of more than 0 and an efficiency"),
        ("id", " ", "a gear: argument 'id': expected a name of the row"),
    ],
)
def test_a_row_with_an_impossible_figure_is_refused(field: str, value: Any, text: str) -> None:
    with pytest.raises(InputError) as error:
        gear(**{field: value})
    assert text in str(error.value)


def test_screws_and_racks_are_linear() -> None:
    assert gear(kind="screw").linear and gear(kind="rack").linear
    assert not gear(kind="belt").linear and not DIRECT.linear


def test_the_driven_efficiency_is_that_of_driving_where_it_is_not_stated() -> None:
    assert gear(efficiency=0.7).driven_efficiency == 0.7
    assert gear(efficiency=0.7, back_efficiency=0.0).driven_efficiency == 0.0  # the load cannot drive it
    assert gear().driven_efficiency is None


def test_arrays_hold_what_rows_hold() -> None:
    arrays = GearArrays.of([DIRECT, gear(ratio=50, efficiency_curve=[(0.1, 0.4), (1.0, 0.7)]), gear(kind="rack")])
    np.testing.assert_array_equal(arrays.ratio, [1.0, 50.0, np.nan])
    np.testing.assert_array_equal(arrays.direct, [True, False, False])
    np.testing.assert_array_equal(arrays.linear, [False, False, True])
    np.testing.assert_array_equal(arrays.efficiency_curve.known, [False, True, False])
    assert arrays[[1, 1]].ratio.tolist() == [50.0, 50.0]
    assert arrays[None, :].ratio.shape == (1, 3)
    assert GearArrays.of([]).ratio.shape == (0,)
