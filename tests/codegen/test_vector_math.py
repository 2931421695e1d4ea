"""The SIMD sine and cosine against extended precision."""

import casadi
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bellcrank.codegen.compile import compiled


@pytest.fixture(params=["native", "avx2", "baseline"])
def target(request, monkeypatch):
    monkeypatch.setenv("BELLCRANK_TARGET", request.param)
    return request.param


def sine_and_cosine():
    x = casadi.SX.sym("x", 1)
    return casadi.Function("sincos", [x], [casadi.sin(x), casadi.cos(x)])


def ulps(value, exact):
    """The distance from the exact value in units of the last place of the double nearest to it."""
    unit = np.spacing(np.abs(exact.astype(np.float64)))
    return np.abs((value.astype(np.longdouble) - exact) / unit).astype(float)


def awkward_angles(seed):
    """Random angles up to 1e5, and the doubles nearest to multiples of pi/2, where reduction cancels most."""
    random = np.random.default_rng(seed)
    multiples = np.round(random.uniform(-63661, 63661, 50_000)) * (np.pi / 2)
    near = np.nextafter(multiples, multiples * 2)
    spread = random.uniform(-1e5, 1e5, 100_000)
    small = random.choice([-1.0, 1.0], 50_000) * 10.0 ** random.uniform(-300, 1, 50_000)
    return np.concatenate([multiples, near, spread, small])


def test_sine_and_cosine_within_two_ulp_up_to_1e5_in_simd_and_scalar_code(target):
    function = compiled("sincos", ("test",), sine_and_cosine)
    x = awkward_angles(7)
    sine, cosine = function(x[:, None])
    # the C library's long double functions: 64-bit significand, so exact on the scale of a double's ulp
    assert ulps(sine[:, 0], np.sin(x.astype(np.longdouble))).max() <= 2.0
    assert ulps(cosine[:, 0], np.cos(x.astype(np.longdouble))).max() <= 2.0
    for single in x[:: len(x) // 500]:
        sine, cosine = function(np.array([single]))
        assert ulps(sine, np.sin(np.longdouble(single))).max() <= 2.0
        assert ulps(cosine, np.cos(np.longdouble(single))).max() <= 2.0


def test_beyond_1e5_the_exact_fallback_serves_every_lane(target):
    function = compiled("sincos", ("test",), sine_and_cosine)
    random = np.random.default_rng(3)
    x = np.where(random.random(400) < 0.1, 10.0 ** random.uniform(5, 300, 400), random.uniform(-10, 10, 400))
    sine, cosine = function(x[:, None])
    np.testing.assert_allclose(sine[:, 0], np.sin(x), rtol=5e-16, atol=0)
    np.testing.assert_allclose(cosine[:, 0], np.cos(x), rtol=5e-16, atol=0)


def test_not_a_number_stays_in_its_own_lane(target):
    function = compiled("sincos", ("test",), sine_and_cosine)
    x = np.linspace(0, 1, 24)
    x[5], x[17] = np.nan, np.inf
    sine, _ = function(x[:, None])
    assert np.array_equal(np.isnan(sine[:, 0]), ~np.isfinite(x))


@given(st.lists(st.floats(-1e5, 1e5), min_size=1, max_size=40))
def test_sine_and_cosine_lie_on_the_unit_circle(angles):
    function = compiled("sincos", ("test",), sine_and_cosine)
    sine, cosine = function(np.array(angles)[:, None])
    np.testing.assert_allclose(sine**2 + cosine**2, 1.0, rtol=1e-15)


def test_sine_of_a_sine_is_evaluated_in_waves():
    x = casadi.SX.sym("x", 2)
    nested = casadi.Function("nested", [x], [casadi.sin(x[0] + casadi.cos(3 * x[1])) * casadi.cos(casadi.sin(x[0]))])
    function = compiled("nested", ("test",), lambda: nested)
    values = np.random.default_rng(5).normal(size=(50, 2))
    expected = np.sin(values[:, 0] + np.cos(3 * values[:, 1])) * np.cos(np.sin(values[:, 0]))
    np.testing.assert_allclose(function(values)[:, 0], expected, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 7, 9])
def test_angles_of_one_sample_that_share_vectors_keep_their_places(target, count):
    """Sines, then cosines, of sums (computed angles) and of inputs, some by the exact fallback."""
    x = casadi.SX.sym("x", count)
    angles = casadi.vertcat(x, 2 * x[0] + 1)
    function = casadi.Function("many", [x], [casadi.sin(angles), casadi.cos(angles[::-1])])
    code = compiled("many", ("test", str(count)), lambda: function)
    random = np.random.default_rng(count)
    for big in (None, 0, count - 1):
        values = random.uniform(-5, 5, count)
        if big is not None:
            values[big] = 3e7 + random.uniform()
        every = np.append(values, 2 * values[0] + 1)
        sine, cosine = code(values)
        np.testing.assert_allclose(sine, np.sin(every), rtol=4.5e-16, atol=0)
        np.testing.assert_allclose(cosine, np.cos(every[::-1]), rtol=4.5e-16, atol=0)


UNARY = {
    "exp": np.exp, "log": np.log, "sqrt": np.sqrt, "sin": np.sin, "cos": np.cos, "tan": np.tan, "asin": np.arcsin,
    "acos": np.arccos, "atan": np.arctan, "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh, "floor": np.floor,
    "ceil": np.ceil, "fabs": np.abs, "sign": np.sign, "log1p": np.log1p, "expm1": np.expm1,
}  # fmt: skip
EXTREMES = [
    np.nan,
    np.inf,
    -np.inf,
    1e308,
    -1e308,
    5e-324,
    -5e-324,
    1e-310,
    0.0,
    -0.0,
    1e5,
    1e22,
    1.0,
    -1.0,
    0.3,
    800.0,
]


def test_every_function_of_nan_infinite_huge_and_subnormal_numbers_is_numpys(target):
    def build():
        x = casadi.SX.sym("x", 1)
        ones = [getattr(casadi, name)(x) for name in UNARY]
        return casadi.Function("unary", [x], [casadi.vertcat(*ones, x * x, 1 / x, 2 * x, -x, x**3.5)])

    function = compiled("unary extremes", ("test",), build)
    x = np.array(EXTREMES)
    with np.errstate(all="ignore"):
        columns = [f(x) for f in UNARY.values()]
        expected = np.column_stack([*columns, x * x, 1 / x, 2 * x, -x, x**3.5])
    np.testing.assert_allclose(function(x[:, None]), expected, rtol=4e-15, atol=0)
    np.testing.assert_allclose([function(one) for one in x[:, None]], expected, rtol=4e-15, atol=0)


def test_the_smaller_and_the_larger_of_a_number_and_nan_are_nan(target):
    def build():
        x = casadi.SX.sym("x", 2)
        return casadi.Function("extremes", [x], [casadi.fmin(x[0], x[1]), casadi.fmax(x[0], x[1])])

    function = compiled("smaller and larger", ("test",), build)
    pairs = np.array([(a, b) for a in EXTREMES for b in EXTREMES])
    least, most = function(pairs)
    np.testing.assert_array_equal(least[:, 0], np.minimum(*pairs.T))
    np.testing.assert_array_equal(most[:, 0], np.maximum(*pairs.T))
    singles = np.array([function(pair) for pair in pairs])[:, :, 0]
    np.testing.assert_array_equal(singles, np.column_stack([least, most]))
