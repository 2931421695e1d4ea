"""Formulas of NumPy arrays called with arrays of expressions: the expressions have the values of the formulas."""

import casadi
import numpy as np
import pytest

import bellcrank as bc
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.continuous_torque import continuous_torque
from bellcrank.actuators.product_arrays import MotorArrays
from bellcrank.actuators.short_time_limits import peak_curve_use
from bellcrank.codegen.expression_array import ExpressionArray, expressions

X, Y = np.array([[-1.5, 0.0, 2.5], [4.0, np.nan, -0.5]]), np.array([0.5, 2.0, -3.0])
FORMULAS = {
    "arithmetic": lambda x: (2.0 * x - Y) / (x**2 + 1.0) + -x,
    "functions": lambda x: np.sqrt(np.abs(x)) + np.sign(x) + np.maximum(x, Y) - np.minimum(1.0, x),
    "unknown operands are left out": lambda x: np.fmax(x, Y) + np.fmin(Y, x),
    "unknown by a condition": lambda x: np.where(np.isnan(np.where(x > 1.0, np.nan, x)), 7.0, x),
    "conditions": lambda x: np.where((x >= 0.0) & ~(x == 2.5) | (x < -1.0), x, 10.0 * x),
    "comparison with unknown": lambda x: np.where(x > np.nan, 1.0, np.where(np.isnan(x), 2.0, 3.0)),
    "products of matrices": lambda x: x @ np.array([[1.0, 0.0], [2.0, -1.0], [0.0, 3.0]]),
    "largest of rows": lambda x: np.max(x, axis=1),
    "shapes": lambda x: np.stack(np.broadcast_arrays(x[0], Y), axis=-1).T[:, None],
}


def values(found, symbols, x):
    """The values of an array of expressions at numbers (n,) of its symbols."""
    function = casadi.Function("f", [symbols], [casadi.vertcat(*expressions(found))])
    return np.array(function(x)).reshape(found.shape)


@pytest.mark.parametrize("formula", FORMULAS.values(), ids=FORMULAS)
def test_expressions_have_the_values_of_a_formula_unknown_ones_included(formula):
    symbols = casadi.SX.sym("x", 6)
    found = formula(ExpressionArray.of(symbols, (2, 3)) + np.where(np.isnan(X), np.nan, 0.0))
    known = np.nan_to_num(X)
    np.testing.assert_allclose(values(found, symbols, known.ravel()), formula(X), rtol=1e-15)


def test_what_python_has_to_decide_is_refused_and_what_is_fixed_is_an_array():
    x = ExpressionArray.of(casadi.SX.sym("x", 2), (2,))
    for question in (bool, float, np.asarray, np.nonzero, np.cumsum, np.linalg.norm):
        with pytest.raises(TypeError):
            question(x > 0.0 if question in (bool, np.nonzero) else x)
    assert np.isnan(x).tolist() == [False, False]
    assert np.isnan(x * np.array([1.0, np.nan])).tolist() == [False, True]


@pytest.mark.parametrize("conditions", [Conditions(), Conditions(ambient=60.0, altitude=2000.0, voltage=24.0)])
def test_continuous_torque_and_peak_curve_of_every_motor_of_the_catalogue(conditions):
    motors = MotorArrays.of(bc.load_catalogue().motors)
    count = len(motors.max_speed)
    speed, torque = (casadi.SX.sym(name) for name in ("speed", "torque"))
    once = [np.broadcast_to(ExpressionArray.of(each, ()).elements, count) for each in (speed, torque)]
    traced = [ExpressionArray(each, np.zeros(count).astype(object)) for each in once]
    found = [continuous_torque(motors, traced[0], conditions).torque]
    found.append(peak_curve_use(motors, conditions, traced[1], traced[0]))
    function = casadi.Function("f", [speed, torque], [casadi.vertcat(*expressions(each)) for each in found])
    for s, t in ((0.0, 0.0), (3.0, 0.2), (200.0, -1.0), (-420.0, 5.0), (900.0, 0.01)):
        expected = continuous_torque(motors, s, conditions).torque, peak_curve_use(motors, conditions, t, s)
        for one, values_of in zip(function(s, t), expected, strict=True):
            np.testing.assert_allclose(np.array(one).ravel(), values_of, rtol=1e-12, atol=1e-14)
