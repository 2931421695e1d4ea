"""Sensitivity studies: from distributions and a runner to indices, distributions, tables and files."""

import csv
import json

import numpy as np
import pytest
from scipy import stats

import bellcrank as bc
from bellcrank.errors import InputError
from bellcrank.studies.designs.design_space import DesignSpace
from bellcrank.studies.designs.samples import Sample, SensitivitySample
from bellcrank.studies.execution.study import run_study
from bellcrank.studies.results.study_columns import StudyColumns
from bellcrank.studies.results.sweep_result import Sweep
from bellcrank.studies.sweep_plan import SampleRequest, plan_sweep

VARY = {"crank_length": "normal(1.24 m, 2 mm)", "rocker_length": "uniform(1.19 m, 1.21 m)"}
STATUSES = ("event", "infeasible")


class Formula:
    """A runner whose measures are formulas of the designs' values: lock.time is linear, lock.crank constant."""

    default_measures = ("lock.time", "lock.crank")
    noise = (0.0, 1e-9)

    def __init__(self, longest=np.inf):
        self.longest = longest
        self.units, self.identity = {"lock.time": "s", "lock.crank": "rad"}, {}

    def run(self, values, *, threads=1, progress=None):
        length, rocker = values.T
        there = length <= self.longest
        time = np.where(there, 12.0 + 100.0 * (length - 1.24) - 20.0 * (rocker - 1.2), np.nan)
        crank = np.where(there, 0.5, np.nan)
        reasons = {int(k): "too long" for k in np.flatnonzero(~there)}
        status = np.where(there, 0, 1).astype(np.int8)
        return StudyColumns(
            statuses=STATUSES, status=status, measures={"lock.time": time, "lock.crank": crank}, reasons=reasons
        )


def designs(n=128, seed=0, vary=VARY):
    """The designs of Sobol indices of the four-bar."""
    return plan_sweep(bc.load_scene("four_bar"), vary, SampleRequest(seed=seed, sobol=n)).space


def swept(space, runner, rows=None):
    """The sweep of all designs, or of some rows."""
    columns = run_study(space, runner).columns
    index = np.arange(space.count) if rows is None else rows
    return Sweep(
        scene=bc.load_scene("four_bar"),
        space=space,
        columns=columns.take(index),
        index=index,
        units=runner.units,
        candidates=runner.default_measures,
        noise=runner.noise,
    )


def study(runner, n=128, seed=0, vary=VARY):
    return swept(designs(n, seed, vary), runner).sensitivity


@pytest.fixture(scope="module")
def found():
    return study(Formula())


def test_indices_of_a_linear_measure_are_the_shares_of_the_variances(found):
    """V = (100 · 2 mm)^2 + 20^2 (20 mm)^2 / 12: linear, so first-order and total indices agree."""
    parts = np.array([(100.0 * 0.002) ** 2, 20.0**2 * 0.02**2 / 12.0])
    indices = found.indices("lock.time")
    assert indices.parameters == ("crank_length", "rocker_length")
    for estimates in (indices.first, indices.total):
        for estimate, truth in zip(estimates, parts / parts.sum(), strict=True):
            half = estimate.interval[1] - estimate.value
            assert abs(estimate.value - truth) < 2.0 * half < 0.05
    assert not found.indices("lock.crank").varies


def test_the_designs_a_and_b_give_distributions_and_probabilities(found):
    statistics = found.statistics
    assert statistics.layout.rows == 2 * 16 * 128 and statistics.default_measures == ("lock.time",)
    mean = statistics.distribution("lock.time").mean
    assert abs(mean.value - 12.0) < 2.0 * (mean.interval[1] - mean.value) < 0.01
    # of a normal and a uniform number: the normal tail averaged over the uniform one
    offset = np.linspace(-0.2, 0.2, 20001)
    truth = np.trapezoid(stats.norm.sf((0.3 - offset) / 0.2), offset) / 0.4
    chance = statistics.exceedance("lock.time > 12.3 s")
    assert abs(chance.probability - truth) < 2.0 * (chance.interval[1] - chance.probability) < 0.02
    assert "Student's t over 16 independent replicates of 256 designs" in str(chance)


def test_the_same_seed_gives_the_same_numbers_and_another_seed_others(found):
    again, other = study(Formula()), study(Formula(), seed=1)
    assert again.indices("lock.time") == found.indices("lock.time") != other.indices("lock.time")


def test_failed_designs_are_said(found):
    some = study(Formula(longest=1.243))
    indices = some.indices("lock.time")
    assert indices.left_out and indices.missing["infeasible"] > indices.left_out
    text = some.table()
    assert f"{indices.left_out} of 2048 blocks of designs" in text and "the indices are approximate" in text
    assert "left out" not in found.table()
    chance = some.statistics.exceedance("lock.time > 12.3")
    assert chance.bounds[0] < chance.interval[0] and chance.bounds[1] > chance.interval[1]
    assert "infeasible" in str(chance) and "without)" in some.statistics.table()


def test_tables_name_measures_parameters_and_errors(found):
    lines = found.table().splitlines()
    assert lines[0].split("  ")[0] == "measure" and len(lines) == 4
    assert lines[2].startswith("lock.time  crank_length") and "±" in lines[2]
    assert "does not vary" in found.table(["lock.crank"])
    assert found.statistics.table().splitlines()[2].startswith("lock.time  s     11.9999 ± 0.00024 ")


def test_files_hold_every_index(found, tmp_path):
    with found.to_csv(tmp_path / "indices.csv").open(encoding="utf-8") as file:
        rows = list(csv.reader(file))
    assert len(rows) == 1 + 2 * 2 and rows[3][2:] == [""] * 6  # lock.crank does not vary
    first = found.indices("lock.time").first[0]
    assert [float(cell) for cell in rows[1][2:5]] == [first.value, *first.interval]
    document = json.loads(found.to_json(tmp_path / "indices.json").read_text())
    assert document["indices"]["lock.time"]["first"]["crank_length"]["value"] == first.value
    assert document["indices"]["lock.crank"]["total"]["rocker_length"] == {"value": None, "low": None, "high": None}
    assert document["parameters"] == {"crank_length": "normal(1.24, 0.002) m", "rocker_length": "uniform(1.19, 1.21) m"}


def test_pictures_have_a_panel_for_each_measure(found, tmp_path):
    figure = found.plot(tmp_path / "indices.png", ["lock.time", "lock.crank"])
    assert [len(place.patches) for place in figure.axes] == [4, 0]  # bars; none of a measure that does not vary
    figure = found.statistics.plot(tmp_path / "times.png", limits=["lock.time > 12.3 s"])
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert any(label.startswith("P(> 12.3) = 0.0") for label in labels)
    assert (tmp_path / "indices.png").stat().st_size > 5000 < (tmp_path / "times.png").stat().st_size


def test_an_interrupted_study_keeps_the_scramblings_that_are_complete():
    space, runner = designs(16), Formula()
    each = 16 * 4
    done = np.concatenate([np.arange(3 * each), np.arange(4 * each + 1, 15 * each + 7)])  # 3 and 10 scramblings
    found = swept(space, runner, done).sensitivity
    assert found.sample.replicates == 13
    rows = np.concatenate([np.arange(3 * each), np.arange(5 * each, 15 * each)])
    expected = swept(space, runner).columns.measures["lock.time"][rows]
    np.testing.assert_array_equal(found.columns.measures["lock.time"], expected)
    with pytest.raises(InputError, match="9 of 16 scramblings are complete, and 10 are needed"):
        _ = swept(space, runner, np.arange(9 * each + 5)).sensitivity


@pytest.mark.parametrize("method", ["sobol", "latin", "random"])
def test_a_sample_gives_statistics_only_where_its_error_is_known(method):
    axes, runner = designs().axes, Formula()
    space = DesignSpace(axes, Sample.of(2048, method, 3))
    found = swept(space, runner).statistics
    mean = found.distribution("lock.time").mean
    assert abs(mean.value - 12.0) < 2.0 * mean.half_width < 0.1
    assert found.layout.independent == (method == "random")
    part = swept(space, runner, np.arange(1500)).statistics  # interrupted: 11 replicates of 128 designs are complete
    assert part.layout.rows == (1500 if method == "random" else 11 * 128)
    if method != "random":
        with pytest.raises(InputError, match="at least 10 replicates"):
            _ = swept(DesignSpace(axes, Sample(2048, method, 3)), runner).statistics
        with pytest.raises(InputError, match="at least 10 replicates"):
            _ = swept(space, runner, np.arange(700)).statistics
    with pytest.raises(InputError, match="Sobol indices cannot be computed from these designs"):
        _ = swept(space, runner).sensitivity


def test_designs_of_a_grid_have_no_probabilities():
    axes = plan_sweep(
        bc.load_scene("four_bar"), {"crank_length": [1.2, 1.3], "rocker_length": [1.2]}, SampleRequest()
    ).space.axes
    with pytest.raises(
        InputError, match="'crank_length' has values and no distribution, so that the designs are not a sample"
    ):
        _ = swept(DesignSpace(axes), Formula()).statistics


@pytest.mark.parametrize(
    ("vary", "options", "message"),
    [
        ({}, {}, "expected at least one parameter to vary, found none"),
        ({"crank_length": [1.2, 1.3]}, {}, "'crank_length' has values and no distribution"),
        (VARY, {"n": 100}, "argument 'n': expected a power of two, such as 64 or 128, found 100"),
        (VARY, {"seed": -1}, "argument 'seed'"),
        (VARY, {"n": "many"}, "argument 'n': expected a whole number of at least 2, found 'many'"),
    ],
)
def test_wrong_arguments_are_refused(vary, options, message):
    with pytest.raises(InputError) as error:
        bc.sobol_indices("four_bar", vary, **options)
    assert message in str(error.value)


def test_a_sample_and_sobol_indices_exclude_each_other():
    for options in ({"sample": 64}, {"method": "random"}):
        with pytest.raises(InputError, match="cannot be combined with sobol"):
            bc.sweep("four_bar", VARY, sobol=64, **options)


def test_wrong_names_are_refused(found):
    for call in (lambda: found.indices("lock.tine"), lambda: found.statistics.distribution("lock.tine")):
        with pytest.raises(InputError, match=r"unknown measure 'lock.tine'; did you mean 'lock.time'"):
            call()
    with pytest.raises(InputError, match="argument 'levels'"):
        found.statistics.distribution("lock.time", [1.5])
    assert SensitivitySample(2, 128).count == found.sample.count
