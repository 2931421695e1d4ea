"""Samples of designs and what is estimated from them, on a measure that is a closed form of the parameters."""

import numpy as np
import pytest
from scipy import stats

import bellcrank as bc

# A pendulum that is simulated for a moment: the measures are expressions of parameters alone.
PARAMETERS = {name: {"value": value} for name, value in {"a": 1.3, "b": 0.7, "c": 2.1}.items()}
OUTPUTS = {
    "linear": {"expression": "3*a - 2*b + 0.5*c"},
    "mixed": {"expression": "a + 2*b*c"},
    "a_itself": {"expression": "a"},
}
MOMENT = {"parameters": PARAMETERS, "outputs": OUTPUTS, "simulate.duration": 1e-3, "simulate.samples": 2}


@pytest.fixture(scope="module")
def scene():
    return bc.load_scene("pendulum", MOMENT)


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ("normal(2.5, 0.4)", stats.norm(2.5, 0.4)),
        ("uniform(-1.5, 3)", stats.uniform(-1.5, 4.5)),
        ("truncnormal(2, 0.5, 1.4, 3.5)", stats.truncnorm(-1.2, 3.0, 2.0, 0.5)),
        ("triangular(1, 1.5, 4)", stats.triang(0.5 / 3, 1.0, 3.0)),
        ("loguniform(0.2, 7)", stats.loguniform(0.2, 7.0)),
    ],
)
@pytest.mark.parametrize("method", ["sobol", "latin", "random"])
def test_designs_follow_the_distribution_that_is_written(scene, written, expected, method):
    """Sobol points and Latin hypercubes have one point in each of n strips of equal probability."""
    found = bc.sweep(scene, {"a": written}, sample=256, method=method, seed=7)
    a = found.column("end.a_itself")
    assert np.array_equal(a, found.values[:, 0])
    ranks = np.sort(expected.cdf(a)) * 256
    if method == "random":
        assert stats.kstest(a, expected.cdf).pvalue > 1e-3
    else:
        assert np.all(np.abs(ranks - np.arange(256) - 0.5) <= 0.5 + 1e-6)
    mean, variance = expected.stats("mv")
    assert abs(a.mean() - mean) < (4 if method == "random" else 0.4) * np.sqrt(variance / 256)


def test_a_seed_gives_the_same_designs_and_another_one_others(scene):
    drawn = [bc.sweep(scene, {"a": "normal(1, 0.1)"}, sample=64, seed=seed).values for seed in (5, 5, 6)]
    assert np.array_equal(drawn[0], drawn[1]) and not np.any(drawn[0] == drawn[2])


def test_each_point_of_a_grid_gets_the_whole_sample(scene):
    found = bc.sweep(scene, {"b": [0.5, 0.9, 1.4], "a": "uniform(1, 2)"}, sample=16, seed=2)
    assert found.shape == (3, 16)
    grid = found.grid("end.linear")
    a = found.values[:16, 1]
    assert grid == pytest.approx(3 * a - 2 * np.array([[0.5], [0.9], [1.4]]) + 0.5 * 2.1, rel=1e-14)


@pytest.mark.parametrize("method", ["sobol", "latin", "random"])
def test_intervals_of_a_linear_measure_hold_its_closed_form(scene, method):
    """a, b and c are normal: so is the measure, with mean 3·1.3 - 2·0.7 + 0.5·2.1 and the variances' weighted sum."""
    vary = {"a": "normal(1.3, 0.2)", "b": "normal(0.7, 0.1)", "c": "normal(2.1, 0.6)"}
    found = bc.sweep(scene, vary, sample=1024, method=method, seed=12)
    truth = stats.norm(3 * 1.3 - 2 * 0.7 + 0.5 * 2.1, np.sqrt(9 * 0.2**2 + 4 * 0.1**2 + 0.25 * 0.6**2))
    values = found.column("end.linear")
    estimated = found.statistics.distribution("end.linear", [0.05, 0.5, 0.9])
    assert estimated.mean.value == pytest.approx(values.mean(), rel=1e-12) and estimated.count == 1024
    assert estimated.deviation.value == pytest.approx(values.std(), rel=1e-3)
    pairs = [(estimated.mean, truth.mean()), (estimated.deviation, truth.std())]
    pairs += [(estimated.quantiles[level], truth.ppf(level)) for level in (0.05, 0.5, 0.9)]
    for estimate, exact in pairs:
        low, high = estimate.interval
        # of this many intervals of 95 % some do not hold the truth, but twice their width does
        assert low < estimate.value < high and abs(estimate.value - exact) < high - low < 0.4 * truth.std()
    chance = found.statistics.exceedance("end.linear > 4.2")
    assert chance.probability == (values > 4.2).mean() and chance.exceeded == (values > 4.2).sum()
    assert abs(chance.probability - truth.sf(4.2)) < np.ptp(chance.interval) < 0.07
    below = found.statistics.exceedance("end.linear < 3 ")
    assert below.exceeded == (values < 3.0).sum() and abs(below.probability - truth.cdf(3.0)) < np.ptp(below.interval)


@pytest.mark.parametrize(("method", "gain"), [("sobol", 8.0), ("latin", 64 / 63)])
def test_no_design_beyond_a_limit_is_not_taken_for_a_certainty(scene, method, gain):
    """No replicate of 16 has one: P < 1 - 0.025^(1/16) that one has, which bounds the probability of a design by odds.

    The gain bounds the variance over a replicate: 2^(t + d - 1) for Sobol points in d = 3 dimensions with t = 1
    (Pan & Owen 2023), n / (n - 1) for Latin hypercubes (Owen 2013, 10.4).
    """
    vary = {"a": "normal(1.3, 0.2)", "b": "normal(0.7, 0.1)", "c": "normal(2.1, 0.6)"}
    found = bc.sweep(scene, vary, sample=1024, method=method, seed=12)
    high = 1 - 0.025 ** (1 / 16)
    odds = gain * high / ((1 - high) * 64)
    none = found.statistics.exceedance("end.linear > 100")
    assert none.probability == 0.0 and none.interval == pytest.approx((0.0, min(odds / (1 + odds), high)), rel=1e-9)
    all_ = found.statistics.exceedance("end.linear > -100")
    assert all_.probability == 1.0 and all_.interval == pytest.approx((1 - none.interval[1], 1.0), rel=1e-9)


def test_sobol_indices_of_a_linear_measure_are_its_shares_of_variance(scene):
    vary = {"a": "uniform(1, 1.6)", "b": "normal(0.7, 0.15)", "c": "normal(2.1, 0.6)"}
    found = bc.sobol_indices(scene, vary, n=64, seed=3).indices("end.linear")
    parts = np.array([9 * 0.6**2 / 12, 4 * 0.15**2, 0.25 * 0.6**2])
    assert found.parameters == ("a", "b", "c") and found.left_out == 0
    for estimates in (found.first, found.total):
        for estimate, share in zip(estimates, parts / parts.sum(), strict=True):
            assert estimate.value == pytest.approx(share, abs=0.02)
            assert estimate.interval[0] - 0.01 < share < estimate.interval[1] + 0.01 and estimate.half_width < 0.05


def test_total_indices_hold_the_interaction(scene):
    """Var(a + 2 b c) = s_a² + 4 (m_b² s_c² + m_c² s_b² + s_b² s_c²) of independent a, b, c."""
    vary = {"a": "normal(1, 0.5)", "b": "normal(0.7, 0.2)", "c": "normal(1.1, 0.3)"}
    found = bc.sobol_indices(scene, vary, n=64, seed=8).indices("end.mixed")
    both = 4 * 0.2**2 * 0.3**2
    parts = np.array([0.5**2, 4 * 1.1**2 * 0.2**2, 4 * 0.7**2 * 0.3**2])
    whole = parts.sum() + both
    for estimate, part in zip(found.first, parts, strict=True):
        assert estimate.value == pytest.approx(part / whole, abs=0.03)
    for estimate, part in zip(found.total, parts + np.array([0, both, both]), strict=True):
        assert estimate.value == pytest.approx(part / whole, abs=0.03)


def test_designs_without_the_measure_are_counted_and_widen_the_bounds():
    """A pendulum of random length of time passes its lowest point, or does not."""
    stop = {"events": [{"name": "low", "when": {"joint": "swing", "position": 0.0}}], "outputs": {}}
    scene = bc.load_scene("pendulum", {**stop, "simulate.samples": 2})
    vary = {"simulate.duration": "uniform(0.2 s, 1 s)"}
    found = bc.sweep(scene, vary, sample=64, method="random", seed=1)
    quarter = 0.591960486894059362  # s: a quarter of the period of IFToMM benchmark A01
    times = found.column("low.time")
    late = found.values[:, 0] > quarter
    assert np.array_equal(np.isfinite(times), late) and 10 < late.sum() < 54
    assert times[late] == pytest.approx(quarter, rel=1e-9)
    chance = found.statistics.exceedance("low.time > 0.5 s")
    assert (chance.probability, chance.count, sum(chance.missing.values())) == (1.0, late.sum(), 64 - late.sum())
    assert chance.bounds[0] < late.mean() < chance.bounds[1] == 1.0


def test_an_interrupted_sweep_goes_on_to_the_same_numbers(tmp_path, scene):
    vary = {"a": "normal(1, 0.1)", "initial.swing": "uniform(-60 deg, 60 deg)"}
    given = {"sample": 2048, "seed": 3, "overrides": {"simulate.duration": 0.05}, "threads": 1}
    whole = bc.sweep(scene, vary, **given)

    def stop(done, of):
        if done > 0:
            raise KeyboardInterrupt

    first = bc.sweep(scene, vary, **given, folder=tmp_path / "study", checkpoint_every=1e-6, progress=stop)
    assert 0 < len(first) < 2048 and not first.complete
    counts = []
    again = bc.sweep(scene, vary, **given, folder=tmp_path / "study", progress=lambda done, of: counts.append(done))
    assert again.complete and min(counts) >= len(first)
    for name in whole.units:
        assert np.array_equal(again.column(name), whole.column(name), equal_nan=True)
