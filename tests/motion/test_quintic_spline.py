"""Quintic splines against SciPy's, and against what defines them."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import make_interp_spline

from bellcrank.errors import InputError
from bellcrank.motion.sampled.quintic_splines import QuinticSpline


@settings(deadline=None, max_examples=60)
@given(st.integers(2, 40), st.booleans(), st.integers(0, 10**6))
def test_a_spline_is_that_of_scipy_with_all_derivatives_and_beyond_its_ends(count, rest, seed) -> None:
    rng = np.random.default_rng(seed)
    count = count if rest else max(count, 6)
    times, points = np.cumsum(rng.uniform(0.05, 1.0, count)), rng.normal(size=(count, 3))
    spline = QuinticSpline.through(times, points, rest)
    ends = [(1, np.zeros(3)), (2, np.zeros(3))]
    theirs = make_interp_spline(times, points, k=5, **({"bc_type": (ends, ends)} if rest else {}))
    at = np.concatenate([times, rng.uniform(times[0] - 0.1, times[-1] + 0.1, 200)])
    for order in range(7):
        expected = theirs(at, order)
        np.testing.assert_allclose(
            spline(at, order), expected, rtol=0, atol=1e-11 * np.abs(expected).max(initial=1e-300)
        )


def test_a_spline_passes_its_points_rests_at_its_ends_and_survives_a_copy() -> None:
    times, points = np.array([0.0, 0.3, 1.0, 1.2]), np.array([[0.0], [1.0], [-2.0], [0.5]])
    spline = pickle.loads(pickle.dumps(QuinticSpline.through(times, points, True)))
    np.testing.assert_allclose(spline(times), points, atol=1e-14)
    np.testing.assert_allclose([spline(times[[0, -1]], order) for order in (1, 2)], 0.0, atol=1e-12)
    polynomial = QuinticSpline.through(np.arange(9.0), np.polyval([1, -2, 0, 3, 0, 1], np.arange(9.0))[:, None], False)
    at = np.linspace(0.0, 8.0, 50)
    np.testing.assert_allclose(polynomial(at)[:, 0], np.polyval([1, -2, 0, 3, 0, 1], at), rtol=1e-11, atol=1e-9)


def test_times_too_close_for_numbers_are_refused() -> None:
    with pytest.raises(InputError, match="lie as close as 1e-223 s"):
        QuinticSpline.through(np.array([0.0, 1e-223, 1.0]), np.array([[0.0], [1.0], [0.0]]), True)
