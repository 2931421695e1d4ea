"""Sobol indices against closed forms and SciPy: within their stated errors, as often as they say."""

import math

import numpy as np
import pytest
from scipy import stats

from bellcrank.errors import InputError
from bellcrank.studies.designs.samples import SensitivitySample
from bellcrank.studies.results.sensitivity import block_indices, measure_indices
from bellcrank.studies.results.study_columns import StudyColumns

A, B = 7.0, 0.1  # T. Ishigami, T. Homma, ISUMA '90 (1990) 398-403


def ishigami(u):
    x = math.pi * (2.0 * u - 1.0)
    return np.sin(x[:, 0]) + A * np.sin(x[:, 1]) ** 2 + B * x[:, 2] ** 4 * np.sin(x[:, 0])


def ishigami_indices():
    """First-order and total indices: V1 = (1 + B pi^4/5)^2/2, V2 = A^2/8, V13 = B^2 pi^8 (1/18 - 1/50)."""
    parts = 0.5 * (1.0 + B * math.pi**4 / 5.0) ** 2, A**2 / 8.0, B**2 * math.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    whole = sum(parts)
    return [parts[0] / whole, parts[1] / whole, 0.0], [
        (parts[0] + parts[2]) / whole,
        parts[1] / whole,
        parts[2] / whole,
    ]


GRAVITY, ACCELERATION = 9.81, 4.0
MASS, LENGTH, ROTOR = (5.0, 0.2), (0.8, 0.02), (0.3, 0.05)  # mean and standard deviation, independent and normal


def pendulum_torque(u):
    """Peak torque of an arm that is lifted from the horizontal: m l g + (m l^2 + I) a, largest at its start."""
    mass, arm, rotor = (
        mean + sd * stats.norm.ppf(column) for (mean, sd), column in zip((MASS, LENGTH, ROTOR), u.T, strict=True)
    )
    return mass * arm * GRAVITY + (mass * arm**2 + rotor) * ACCELERATION


def pendulum_indices():
    """f = m h(l) + a I with h = g l + a l^2: V_m = s_m^2 E[h]^2, V_l = E[m]^2 V[h], V_ml = s_m^2 V[h], V_I = a^2 s_I^2.

    For l normal with mean L and deviation s: E[h] = g L + a (L^2 + s^2), V[h] = (g + 2 a L)^2 s^2 + 2 a^2 s^4.
    """
    (mean, sd), (arm, s) = MASS, LENGTH
    expected = GRAVITY * arm + ACCELERATION * (arm**2 + s**2)
    spread = (GRAVITY + 2.0 * ACCELERATION * arm) ** 2 * s**2 + 2.0 * ACCELERATION**2 * s**4
    parts = sd**2 * expected**2, mean**2 * spread, ACCELERATION**2 * ROTOR[1] ** 2, sd**2 * spread
    whole = sum(parts)
    return (
        [parts[0] / whole, parts[1] / whole, parts[2] / whole],
        [(parts[0] + parts[3]) / whole, (parts[1] + parts[3]) / whole, parts[2] / whole],
    )


def run(function, sample):
    values = function(sample.points(0, sample.count, sample.dimensions))
    return StudyColumns(statuses=("finished", "infeasible"), status=np.zeros(len(values), dtype=np.int8),
                   measures={"f": values})  # fmt: skip


@pytest.mark.tier2
@pytest.mark.parametrize(("function", "truth"), [(ishigami, ishigami_indices()), (pendulum_torque, pendulum_indices())])
def test_intervals_of_95_percent_cover_the_closed_form_in_90_to_99_percent_of_200_seeds(function, truth):
    covered = np.zeros((2, 3), dtype=int)
    for seed in range(200):
        found = measure_indices(run(function, SensitivitySample(3, 64, 16, seed)), "f", ["a", "b", "c"],
                                SensitivitySample(3, 64, 16, seed))  # fmt: skip
        for kind, estimates in enumerate((found.first, found.total)):
            covered[kind] += [
                e.interval[0] <= value <= e.interval[1] for e, value in zip(estimates, truth[kind], strict=True)
            ]
    assert covered.min() >= 180 and covered.max() <= 198, covered


@pytest.mark.parametrize(("function", "truth"), [(ishigami, ishigami_indices()), (pendulum_torque, pendulum_indices())])
def test_indices_of_many_designs_are_close_to_the_closed_form(function, truth):
    sample = SensitivitySample(3, 1024, 16, 7)
    found = measure_indices(run(function, sample), "f", ["a", "b", "c"], sample)
    for estimates, expected in ((found.first, truth[0]), (found.total, truth[1])):
        for estimate, value in zip(estimates, expected, strict=True):
            half = estimate.interval[1] - estimate.value
            assert half < 0.01 and abs(estimate.value - value) < 2.0 * half  # one of 1,000 is farther away
    assert found.blocks == 16 * 1024 and found.left_out == 0 and not found.missing


def test_the_estimates_of_one_replicate_are_those_of_scipy():
    sample = SensitivitySample(3, 256, 16, 3)
    values = ishigami(sample.points(0, 256 * 5, 3)).reshape(1, 256, 5)
    f = {"f_A": values[:, :, 0], "f_B": values[:, :, 1], "f_AB": np.moveaxis(values[:, :, 2:], 2, 0)}
    expected = stats.sobol_indices(func=f, n=256)
    first, total = block_indices(values, np.ones((1, 256), dtype=bool))
    for found, theirs in ((first, expected.first_order), (total, expected.total_order)):
        for estimate, value in zip(found, theirs, strict=True):
            # up to one half the same formulas; beyond it another one, whose error is smaller near 1
            assert abs(estimate.value - value) < (1e-12 if value <= 0.5 else 1e-2)


def test_an_index_near_1_has_an_error_near_0():
    """Of x1 + 0.05 x2 + 0.05 x1 x2, normal: parts 1, 0.05^2, 0.05^2; the errors are of the order of the small parts."""
    sample = SensitivitySample(2, 256, 16, 1)

    def function(u):
        x, y = stats.norm.ppf(u).T
        return x + 0.05 * y + 0.05 * x * y

    found = measure_indices(run(function, sample), "f", ["x", "y"], sample)
    whole = 1.0 + 2.0 * 0.05**2
    truth = [(1.0 / whole, (1.0 + 0.05**2) / whole), (0.05**2 / whole, 2.0 * 0.05**2 / whole)]
    for first, total, (own, every) in zip(found.first, found.total, truth, strict=True):
        assert abs(first.value - own) < 2.0 * first.half_width < 5e-3
        assert abs(total.value - every) < 2.0 * total.half_width < 5e-3


def test_a_block_mixes_one_column_of_b_into_a():
    sample = SensitivitySample(4, 8, 10, 5)
    block = sample.points(6 * 9, 6 * 10, 4)  # of the second replicate
    for k in range(4):
        expected = block[0].copy()
        expected[k] = block[1, k]
        np.testing.assert_array_equal(block[2 + k], expected)
    assert not np.intersect1d(block[0], block[1]).size


def test_points_do_not_depend_on_the_range_that_is_asked_for_and_follow_the_seed():
    sample = SensitivitySample(3, 16, 10, 1)
    every = sample.points(0, sample.count, 3)
    assert every.shape == (16 * 10 * 5, 3) and every.min() > 0.0 and every.max() < 1.0
    for first, last in ((0, 1), (17, 203), (79, 81), (700, 800), (5, 5)):
        np.testing.assert_array_equal(sample.points(first, last, 3), every[first:last])
    np.testing.assert_array_equal(SensitivitySample(3, 16, 10, 1).points(0, 800, 3), every)
    assert not np.array_equal(SensitivitySample(3, 16, 10, 2).points(0, 800, 3), every)
    drawn = every[sample.sampled()].reshape(10, 32, 3)
    assert np.allclose(drawn.mean(axis=1), 0.5, atol=0.1) and sample.layout().rows == 320


def test_blocks_with_a_failed_design_are_left_out_counted_and_said():
    sample = SensitivitySample(3, 256, 16, 2)
    columns = run(ishigami, sample)
    values, status = columns.measures["f"].copy(), columns.status.copy()
    values[[0, 3, 5 * 40 + 2]] = np.nan  # two designs of the first block, one of another
    status[[0, 3]] = 1
    given = StudyColumns(statuses=columns.statuses, status=status, measures={"f": values})
    found = measure_indices(given, "f", ["a", "b", "c"], sample)
    assert (found.blocks, found.left_out, found.missing) == (256 * 16 - 2, 2, {"finished": 1, "infeasible": 2})
    whole = measure_indices(columns, "f", ["a", "b", "c"], sample)
    assert found.first[0].value == pytest.approx(whole.first[0].value, abs=2e-3)


def test_a_measure_that_does_not_vary_beyond_rounding_errors_has_no_indices():
    sample = SensitivitySample(3, 64, 16, 2)
    noise = np.random.default_rng(0)
    for function in (lambda u: np.full(len(u), 3.0), lambda u: 3.0 + 1e-15 * noise.normal(size=len(u)),
                     lambda u: np.full(len(u), np.nan), lambda u: np.zeros(len(u))):  # fmt: skip
        found = measure_indices(run(function, sample), "f", ["a", "b", "c"], sample)
        assert not found.varies and all(math.isnan(e.value) for e in (*found.first, *found.total))
    large = measure_indices(run(lambda u: 1e200 * u[:, 0], sample), "f", ["a", "b", "c"], sample)
    small = measure_indices(run(lambda u: 1e-200 * u[:, 0], sample), "f", ["a", "b", "c"], sample)
    assert large.first[0].value == pytest.approx(1.0, abs=1e-2) == small.first[0].value


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((3, 100), "argument 'n': expected a power of two, such as 64 or 128, found 100"),
        ((3, 64, 9), "argument 'replicates': expected a whole number of at least 10"),
    ],
)
def test_samples_that_give_no_errors_are_refused(arguments, message):
    with pytest.raises(InputError, match="argument") as error:
        SensitivitySample(*arguments)
    assert message in str(error.value)
