"""Distributions against SciPy's and closed forms, points of samples, and the designs of grids and samples."""

import math
import pickle

import numpy as np
import pytest
from scipy import stats

import bellcrank as bc
from bellcrank.studies.designs.axes import parse_axis, read_axis
from bellcrank.studies.designs.design_space import MOST_DESIGNS, DesignSpace
from bellcrank.studies.designs.distributions import FAMILIES, Distribution, read_distribution
from bellcrank.studies.designs.samples import METHODS, Sample

PROBABILITIES = np.concatenate([[1e-9, 1e-6], np.linspace(1e-3, 1.0 - 1e-3, 999), [1.0 - 1e-6, 1.0 - 1e-9]])
KNOWN = [
    ("normal(1.241, 0.001)", stats.norm(1.241, 0.001)),
    ("uniform(-1, 3)", stats.uniform(-1, 4)),
    ("truncnormal(1, 2, 0, 8)", stats.truncnorm(-0.5, 3.5, 1, 2)),
    ("truncnormal(0, 1, 6, 8)", stats.truncnorm(6, 8)),  # in the upper tail, by symmetry
    ("truncnormal(0, 1, -8, -6)", stats.truncnorm(-8, -6)),
    ("triangular(1, 1.5, 3)", stats.triang(0.25, 1, 2)),
    ("triangular(1, 1, 3)", stats.triang(0, 1, 2)),
    ("triangular(1, 3, 3)", stats.triang(1, 1, 2)),
    ("loguniform(1e-9, 1e-3)", stats.loguniform(1e-9, 1e-3)),
]


@pytest.fixture(scope="module")
def scene():
    return bc.load_scene("four_bar")


@pytest.mark.parametrize(("text", "known"), KNOWN, ids=[text for text, _ in KNOWN])
def test_quantiles_are_those_of_scipy(text, known):
    quantiles = read_distribution(text, None).quantiles(PROBABILITIES)
    scale = float(np.ptp(quantiles)) if "log" not in text else quantiles
    assert np.max(np.abs(quantiles - known.ppf(PROBABILITIES)) / scale) < 1e-12
    assert np.all(np.diff(quantiles) > 0.0)
    low, high = known.support()
    assert low <= quantiles[0] and quantiles[-1] <= high


def test_every_family_is_compared():
    assert {text.split("(")[0] for text, _ in KNOWN} == set(FAMILIES)


def test_units_are_those_of_the_parameter_or_of_the_text():
    given = read_distribution("normal(124.1 cm, 1 mm)", "m")
    assert given.numbers == pytest.approx((1.241, 0.001), rel=1e-15) and given.unit == "m"
    assert read_distribution("normal(0, 1 mm)", "m").numbers == (0.0, 0.001)  # 0 is 0 in any unit
    angle = read_distribution("uniform(1 deg, 0.05 rad)", None)
    assert angle.unit == "deg" and angle.numbers == pytest.approx((1.0, math.degrees(0.05)))
    assert str(read_distribution("normal(1.24 m, 1 mm)", "m")) == "normal(1.24, 0.001) m"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("normal(1, 2, 3)", "expected normal(mean, sd), found 3 numbers"),
        ("normal(1, -2)", "with sd > 0"),
        ("uniform(2, 1)", "with low < high"),
        ("triangular(1, 4, 3)", "low <= mode <= high"),
        ("loguniform(0, 1)", "0 < low < high"),
        ("truncnormal(0, 1, 60, 61)", "within 36 sd"),
        ("normla(1, 2)", "did you mean 'normal'"),
        ("normal(1, x)", "with numbers"),
        ("normal(1, 1e999)", "finite"),
        ("uniform(-1e308, 1e308)", "finite numbers and differences"),
        ("normal(1 m, 0.001)", "some of the numbers have a unit"),
        ("normal(1 m, 1 deg)", "units"),
        ("normal(1 m, 1 deg", "expected a distribution"),
    ],
)
@pytest.mark.parametrize("unit", ["m", None])
def test_what_is_no_distribution_is_refused(text, said, unit):
    with pytest.raises(bc.InputError) as refused:
        read_distribution(text, unit)
    assert said in str(refused.value)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("count", [1, 100, 1024])
def test_points_do_not_depend_on_the_range_that_is_asked_for(method, count):
    sample = Sample.of(count, method, seed=5)
    points = sample.points(0, count, 3)
    assert points.shape == (count, 3) and points.min() > 0.0 and points.max() < 1.0
    for first, last in [(0, 1), (1, 2), (7, 99), (63, 65), (99, 100), (500, 1024), (3, 3)]:
        if last <= count:
            assert np.array_equal(sample.points(first, last, 3), points[first:last])
    again = pickle.loads(pickle.dumps(sample))
    assert np.array_equal(again.points(0, count, 3), points)
    assert not np.array_equal(Sample.of(count, method, seed=6).points(0, count, 3), points)


def test_each_replicate_is_as_balanced_as_its_method_promises():
    """Of n = 2^m Sobol points, and of n of a Latin hypercube, each of n equal intervals of an axis has one."""
    for method in ("sobol", "latin"):
        sample = Sample.of(1024, method, seed=2)
        assert sample.replicates == 16
        parts = sample.points(0, 1024, 4).reshape(16, 64, 4)
        for part in parts:
            cells = np.sort((part * 64).astype(int), axis=0)
            assert np.array_equal(cells, np.tile(np.arange(64)[:, None], 4))
        assert len({part.tobytes() for part in parts}) == 16


def test_the_mean_of_a_smooth_function_converges_faster_than_by_independent_points():
    def error(method, seed):
        points = Sample.of(4096, method, seed).points(0, 4096, 2)
        return float(np.mean(np.exp(points[:, 0]) * points[:, 1])) - (math.e - 1.0) / 2.0

    spread = {method: np.sqrt(np.mean([error(method, seed) ** 2 for seed in range(20)])) for method in METHODS}
    exact = (math.e**2 - 1.0) / 6.0 - ((math.e - 1.0) / 2.0) ** 2  # variance of the function
    assert spread["random"] == pytest.approx(math.sqrt(exact / 4096), rel=0.6)
    assert spread["sobol"] < 0.1 * spread["random"] and spread["latin"] < 0.5 * spread["random"]


def test_counts_that_sobol_points_dislike_are_told():
    assert not Sample.of(4096).note and not Sample.of(1000, "latin").note
    assert "such as 512 or 1024" in Sample.of(1000).note


def test_a_sample_has_the_distribution_that_was_asked_for(scene):
    axes = (read_axis(scene, *parse_axis("crank_length=normal(1.241 m, 1 mm)")),)
    for method in METHODS:
        values = DesignSpace(axes, Sample.of(4096, method, 3)).values()[:, 0]
        assert stats.kstest(values, stats.norm(1.241, 0.001).cdf).pvalue > 1e-3
        assert abs(values.mean() - 1.241) < 4 * 0.001 / 64


def test_each_point_of_a_grid_gets_the_whole_sample(scene):
    axes = (
        read_axis(scene, "initial.crank", "uniform(1 deg, 2 deg)"),
        read_axis(scene, "simulate.solver", ["RK45", "DOP853"]),
        read_axis(scene, "crank_length", "1.21:1.24:3"),
    )
    space = DesignSpace(axes, Sample(5, "random", 1))
    values = space.values()
    assert space.shape == (2, 3, 5) and len(space) == 30
    assert np.array_equal(values[:, 1], np.repeat([0.0, 1.0], 15))
    assert np.array_equal(values[:, 2], np.tile(np.repeat([1.21, 1.225, 1.24], 5), 2))
    assert np.array_equal(values[:, 0], np.tile(values[:5, 0], 6)) and len(set(values[:5, 0])) == 5
    for first, last in [(0, 30), (3, 4), (4, 16), (29, 30)]:
        assert np.array_equal(space.values(first, last), values[first:last])
    assert axes[0].value(1.5) == "1.5 deg" and axes[1].value(1.0) == "DOP853" and axes[2].value(1.225) == 1.225


def test_an_axis_of_a_million_values_is_an_array(scene):
    path, values = parse_axis("crank_length=1.21:1.24:1000000")
    axis = read_axis(scene, path, values)
    space = DesignSpace((axis,))
    assert np.array_equal(space.values()[:, 0], np.linspace(1.21, 1.24, 1_000_000))
    assert np.array_equal(space.values(999_990, 999_995)[:, 0], np.linspace(1.21, 1.24, 1_000_000)[999_990:999_995])
    assert not axis.numbers.flags.writeable


@pytest.mark.parametrize(
    ("vary", "sample", "said"),
    [
        ({"crank_length": "normal(1.24, 0.001)"}, None, "say how many designs are drawn"),
        ({"crank_length": [1.24]}, 16, "a sample needs a parameter with a distribution"),
        ({"crank_length": "normal(1.24, 1)", "initial.crank": f"1:2:{MOST_DESIGNS // 100}"}, 101, "at most 10000000"),
    ],
)
def test_designs_that_do_not_fit_together_are_refused(scene, vary, sample, said):
    axes = tuple(read_axis(scene, path, values) for path, values in vary.items())
    with pytest.raises(bc.InputError, match=said):
        DesignSpace(axes, None if sample is None else Sample.of(sample))


def test_the_identity_of_designs_tells_apart_what_differs(scene):
    def identity(values, **sample):
        axis = read_axis(scene, "crank_length", values)
        return dict(DesignSpace((axis,), Sample.of(**sample) if sample else None).identity)

    assert identity([1.0, 1.1, 1.2]) == identity([1.0, 1.1, 1.2]) != identity([1.0, 1.15, 1.2])
    drawn = identity("normal(1.24, 0.001)", count=64, seed=1)
    assert drawn["sample"] == "64 points, method sobol, seed 1"
    assert drawn != identity("normal(1.24, 0.001)", count=64, seed=2)
    assert drawn != identity("normal(1.24, 0.002)", count=64, seed=1)


def test_a_distribution_is_valid_where_it_exists():
    with pytest.raises(bc.InputError, match="with sd > 0"):
        Distribution("normal", (1.0, 0.0))
