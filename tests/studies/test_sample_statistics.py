"""Intervals of means, quantiles and probabilities cover closed forms as often as they say; missing designs count."""

import math

import numpy as np
import pytest
from scipy import stats
from scipy.stats import qmc

from bellcrank.errors import InputError
from bellcrank.studies.results.exceedance import exceedance, parse_limit
from bellcrank.studies.results.intervals import SampleLayout, clopper_pearson, proportion, quantile, ratio_interval
from bellcrank.studies.results.study_columns import StudyColumns
from bellcrank.studies.results.tolerance import histogram, measure_distribution

SIZE, REPLICATES, DIMENSIONS, SEEDS = 64, 16, 3, 200
ROWS = SIZE * REPLICATES
EVERY = np.ones(ROWS, dtype=bool)
# 200 intervals of 95 % confidence: between 90 and 99 % of them, 180 to 198, cover; see the note on rare events below.
LEAST, MOST = 180, 198


def points(method, seed):
    """Points (ROWS, DIMENSIONS) and how they depend on each other."""
    sources = [np.random.default_rng([seed, k]) for k in range(REPLICATES)]
    if method == "random":
        return sources[0].random((ROWS, DIMENSIONS)), SampleLayout.random(ROWS)
    if method == "latin":
        cubes = [qmc.LatinHypercube(DIMENSIONS, seed=source).random(SIZE) for source in sources]
        return np.concatenate(cubes), SampleLayout.latin_hypercube(ROWS, REPLICATES)
    nets = [qmc.Sobol(DIMENSIONS, seed=source).random(SIZE) for source in sources]
    return np.concatenate(nets) + 2.0**-31, SampleLayout.sobol(ROWS, REPLICATES, DIMENSIONS)


def normal_sums(method):
    """Sums of three independent normal numbers, which are normal with variance 3, for every seed."""
    for seed in range(SEEDS):
        u, layout = points(method, seed)
        yield stats.norm.ppf(u).sum(axis=1), layout


def columns(values, status=None, statuses=("finished", "infeasible")):
    values = np.asarray(values, dtype=float)
    status = np.zeros(len(values), dtype=np.int8) if status is None else np.asarray(status, dtype=np.int8)
    return StudyColumns(statuses=statuses, status=status, measures={"lock.time": values})


@pytest.mark.tier2
@pytest.mark.parametrize("method", ["random", "latin", "sobol"])
def test_intervals_of_95_percent_cover_the_closed_forms_of_a_normal_measure_in_90_to_99_percent_of_200_seeds(method):
    limit = parse_limit("lock.time > 2", {"lock.time": "s"})
    spread = math.sqrt(3.0)
    truth = {"mean": 0.0, "deviation": spread, "probability": stats.norm.sf(2.0 / spread), "median": 0.0}
    truth["high"] = stats.norm.ppf(0.9) * spread
    covered = dict.fromkeys(truth, 0)
    for values, layout in normal_sums(method):
        found = measure_distribution(columns(values), "lock.time", "s", layout, levels=(0.5, 0.9))
        chance = exceedance(columns(values), limit, layout)
        intervals = {
            "mean": found.mean.interval,
            "deviation": found.deviation.interval,
            "probability": chance.interval,
            "median": found.quantiles[0.5].interval,
            "high": found.quantiles[0.9].interval,
        }
        for name, (low, high) in intervals.items():
            covered[name] += low <= truth[name] <= high
    assert all(LEAST <= count <= MOST for count in covered.values()), covered


@pytest.mark.tier2
@pytest.mark.parametrize("method", ["random", "latin", "sobol"])
@pytest.mark.parametrize("chance", [1e-2, 1e-3, 1e-4])
def test_intervals_of_rare_events_cover_at_least_as_often_as_they_say(method, chance):
    """Few replicates with an event would make Student's interval far too narrow, and without one empty; these bounds
    hold for every distribution, so that they cover more often than 95 %."""
    limit = stats.norm.isf(chance) * math.sqrt(3.0)
    covered = 0
    for values, layout in normal_sums(method):
        low, high = proportion(values > limit, EVERY, layout)[1]
        covered += low <= chance <= high
    assert covered >= LEAST


def test_no_event_in_any_replicate_is_not_taken_for_a_certainty():
    none = np.zeros(ROWS, dtype=bool)
    for layout in (SampleLayout.latin_hypercube(ROWS, REPLICATES), SampleLayout.sobol(ROWS, REPLICATES, 2)):
        estimate, (low, high) = proportion(none, EVERY, layout)
        assert (estimate, low) == (0.0, 0.0) and 3.0 / ROWS < high < 0.02
        estimate, (low, high) = proportion(EVERY, EVERY, layout)
        assert (estimate, high) == (1.0, 1.0) and 0.98 < low < 1.0 - 3.0 / ROWS
    # a gain that bounds nothing leaves what the independent replicates alone say
    high = proportion(none, EVERY, SampleLayout.sobol(ROWS, REPLICATES, 400))[1][1]
    assert high == pytest.approx(1.0 - 0.025 ** (1.0 / REPLICATES))


def test_clopper_pearson_is_that_of_scipy_and_covers_the_ends():
    for hits, count in ((0, 20), (1, 20), (7, 20), (20, 20), (3, 1000)):
        expected = stats.binomtest(hits, count).proportion_ci(0.95, method="exact")
        assert clopper_pearson(hits, count) == pytest.approx(
            (expected.low, expected.high), rel=1e-10, abs=0.0
        )  # SciPy solves for it
    assert clopper_pearson(0, 0) == (0.0, 1.0)


def test_the_interval_of_a_mean_is_student_s():
    values = np.random.default_rng(0).normal(size=25)
    low, high = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    mean, half = ratio_interval(values, np.ones(25))
    assert (mean - half, mean + half) == pytest.approx((low, high), rel=1e-12)


def test_the_interval_of_a_median_is_that_of_the_binomial_ranks():
    """P(X(6) <= median <= X(15)) of 20: 1 - 2 P(Bin(20, 1/2) <= 5) = 0.9586 (David, Nagaraja 2003)."""
    values = np.arange(1.0, 21.0)
    estimate, interval = quantile(values, 0.5, SampleLayout.random(20))
    assert (estimate, interval) == (10.5, (6.0, 15.0))
    assert quantile(values, 0.99, SampleLayout.random(20))[1][1] == math.inf  # beyond the sample


def test_designs_without_the_measure_are_counted_and_bound_the_probability():
    values = np.array([12.0, 14.0, 15.0, 11.0, np.nan, np.nan, np.inf, 12.5] * 50)
    status = np.where(np.isnan(values), 1, np.where(np.isinf(values), 2, 0))
    given = columns(values, status, ("finished", "infeasible", "unknown"))
    found = exceedance(given, parse_limit("lock.time > 13 s", {"lock.time": "s"}), SampleLayout.random(400))
    assert (found.probability, found.exceeded, found.count) == (100 / 250, 100, 250)
    assert found.missing == {"infeasible": 100, "unknown": 50}
    assert found.interval == clopper_pearson(100, 250)
    assert found.bounds == (clopper_pearson(100, 400)[0], clopper_pearson(250, 400)[1])
    for text in ("150 designs without it (100 infeasible, 50 unknown)", "Clopper-Pearson, 400 independent designs"):
        assert text in str(found)
    spread = measure_distribution(given, "lock.time", "s", SampleLayout.random(400))
    assert spread.count == 250 and spread.missing == found.missing and spread.largest == 15.0
    assert spread.mean.value == pytest.approx(np.mean([12.0, 14.0, 15.0, 11.0, 12.5]))


def test_a_sample_without_the_measure_has_no_probability():
    given = columns([np.nan] * 20, [1] * 20)
    found = exceedance(given, parse_limit("lock.time > 13", {"lock.time": "s"}), SampleLayout.random(20))
    assert math.isnan(found.probability) and found.interval == (0.0, 1.0) == found.bounds
    spread = measure_distribution(given, "lock.time", "s", SampleLayout.random(20))
    assert spread.count == 0 and math.isnan(spread.mean.value) and math.isnan(spread.quantiles[0.5].value)


def test_a_large_mean_does_not_cost_the_digits_of_the_deviation():
    values = 1e9 + np.random.default_rng(1).normal(size=ROWS)
    found = measure_distribution(columns(values), "lock.time", "s", SampleLayout.random(ROWS))
    assert found.deviation.value == pytest.approx(np.std(values - 1e9, ddof=1), rel=1e-6)


@pytest.mark.parametrize(
    ("text", "relation", "value"),
    [("lock.time > 13 s", ">", 13.0), ("lock.time<1 min", "<", 60.0), ("lock.time >= 500 ms", ">=", 0.5)],
)
def test_a_limit_is_read_in_the_unit_of_its_measure(text, relation, value):
    limit = parse_limit(text, {"lock.time": "s"})
    assert (limit.measure, limit.relation, limit.value, limit.unit) == ("lock.time", relation, value, "s")


def test_a_limit_with_equality_is_exceeded_at_the_limit():
    units, values = {"a": "1"}, np.array([0.5, 1.0, 1.5, np.nan])
    found = [parse_limit(f"a {sign} 1", units).exceeded(values).tolist() for sign in (">", ">=", "<", "<=")]
    assert found == [[False, False, True, False], [False, True, True, False], [True, False, False, False],
                     [True, True, False, False]]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("lock.time = 13 s", "expected MEASURE > VALUE"),
        ("> 13 s", "expected MEASURE > VALUE"),
        ("lock.tine > 13 s", "unknown measure 'lock.tine'; did you mean 'lock.time'?"),
        ("lock.time > 13 kg", "expected a number in s (units known here: 's', 'ms', 'min'), found '13 kg'"),
        ("lock.time >", "expected a number in s"),
        ("lock.time > inf", "expected a number in s"),
    ],
)
def test_a_wrong_limit_is_refused_in_one_sentence(text, message):
    with pytest.raises(InputError, match="--limit") as error:
        parse_limit(text, {"lock.time": "s"})
    assert message in str(error.value)


def test_fewer_than_ten_replicates_give_no_interval():
    with pytest.raises(InputError, match="at least 10 replicates that are scrambled independently, found 9"):
        SampleLayout.sobol(9 * 64, 9, 3)


def test_a_histogram_holds_every_value_and_integrates_to_one():
    values = np.append(np.random.default_rng(2).normal(size=1000), [np.nan, np.inf])
    density, edges = histogram(values)
    assert float(density @ np.diff(edges)) == pytest.approx(1.0)
    known = values[np.isfinite(values)]
    assert (edges[0], edges[-1]) == (known.min(), known.max())
    density, edges = histogram(np.full(10, 3.0))
    assert len(density) == 1 and edges[0] < 3.0 < edges[1]


@pytest.mark.parametrize("count", [20, 64, 301])
@pytest.mark.parametrize("level", [0.1, 0.5, 0.93])
def test_intervals_of_quantiles_have_the_narrowest_ranks_whose_tails_are_below_2_5_percent(count, level):
    """How many of `count` values are below a quantile is binomial: the ranks follow from its tails alone."""
    values = np.arange(1.0, count + 1.0)  # the value is the rank
    _, (low, high) = quantile(values, level, SampleLayout.random(count))
    below = stats.binom(count, level)
    if math.isfinite(low):
        assert below.cdf(low - 1) <= 0.025 < below.cdf(low)
    else:
        assert below.cdf(0) > 0.025
    if math.isfinite(high):
        assert below.sf(high - 1) <= 0.025 < below.sf(high - 2)
    else:
        assert below.sf(count - 1) > 0.025


@pytest.mark.parametrize("level", [0.2, 0.5, 0.9])
def test_intervals_of_quantiles_of_replicates_are_those_of_woodruff(level):
    """The interval of the proportion below the quantile, about the level, as the next ranks outside it."""
    values = np.random.default_rng(4).permutation(np.arange(1.0, ROWS + 1.0))  # the value is the rank
    layout = SampleLayout.latin_hypercube(ROWS, REPLICATES)
    estimate, (low, high) = quantile(values, level, layout)
    share, (least, most) = proportion(values <= estimate, EVERY, layout)
    assert low <= (level - (most - share)) * ROWS < low + 1.0
    assert high - 2.0 < (level + (share - least)) * ROWS <= high - 1.0
