"""Tolerance studies of simulated designs against closed forms, in Python and from the command line."""

import json
import math
import re

import numpy as np
import pytest
from scipy import optimize, stats

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.errors import InputError

GROUND, COUPLER, ROCKER = 1.241, 1.2, 1.2
CRANK, SPREAD = 1.235, 0.002


def lock_angle(crank, coupler=COUPLER):
    """The crank's angle where coupler and rocker line up: the law of cosines with the side a + b (test_sweep.py)."""
    return np.arccos((GROUND**2 + crank**2 - (coupler + ROCKER) ** 2) / (2.0 * GROUND * crank))


def exceeds(limit):
    """P(lock.crank > limit): the angle falls with the length of the crank, which is normal."""
    length = optimize.brentq(lambda crank: lock_angle(crank) - limit, CRANK - 5.0 * SPREAD, CRANK + 5.0 * SPREAD)
    assert lock_angle(length - 1e-4) > lock_angle(length + 1e-4)
    return stats.norm.cdf((length - CRANK) / SPREAD)


@pytest.mark.parametrize("method", ["sobol", "latin", "random"])
def test_the_probability_of_a_lock_angle_is_that_of_the_closed_form(method):
    vary = {"crank_length": f"normal({CRANK} m, {SPREAD} m)"}
    result = bc.sweep("four_bar", vary, sample=1024, method=method, seed=3)
    for limit in (2.62, 2.645, 2.66):
        found = result.statistics.exceedance(f"lock.crank > {limit} rad")
        low, high = found.interval
        assert low <= exceeds(limit) <= high and high - low < 0.07 and not found.missing
    mean = result.statistics.distribution("lock.crank").mean
    lengths = CRANK + SPREAD * np.linspace(-8.0, 8.0, 4001)
    truth = np.average(lock_angle(lengths), weights=stats.norm.pdf((lengths - CRANK) / SPREAD))
    assert mean.interval[0] <= truth <= mean.interval[1]


def test_sobol_indices_of_the_lock_angle_are_those_of_its_closed_form():
    """The variance parts of the closed form follow by Gauss-Hermite quadrature over both lengths."""
    deviations = (SPREAD, 0.001)
    found = bc.sobol_indices(
        "four_bar", {"crank_length": f"normal({CRANK}, {SPREAD})", "coupler_length": f"normal({COUPLER}, 0.001)"}, n=32
    ).indices("lock.crank")
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    weights = weights / weights.sum()
    table = lock_angle(CRANK + deviations[0] * nodes[:, None], COUPLER + deviations[1] * nodes)
    mean = weights @ table @ weights
    whole = weights @ (table - mean) ** 2 @ weights
    parts = [weights @ (table @ weights - mean) ** 2, weights @ (weights @ table - mean) ** 2]
    for k, estimates in enumerate((found.first, found.total)):
        for estimate, part, other in zip(estimates, parts, parts[::-1], strict=True):
            truth = part / whole if k == 0 else 1.0 - other / whole
            assert abs(estimate.value - truth) < 2.0 * estimate.half_width < 0.1


@pytest.mark.tier2
def test_the_command_prints_and_writes_probabilities_indices_and_the_page(tmp_path, capsys):
    vary = ["--vary", f"crank_length=normal({CRANK} m, 2 mm)", "--vary", "coupler_length=normal(1.2 m, 1 mm)"]
    out = ["--out", str(tmp_path / "study")]
    assert main(["sweep", "four_bar", *vary, "--sobol", "8", "--limit", "lock.time > 14 s", "--report", *out]) == 0
    printed = capsys.readouterr().out
    assert "Sobol indices with 95 % intervals" in printed and re.search(r"^lock.time +crank_length", printed, re.M)
    assert "P(lock.time > 14 s) = 0." in printed and "16 independent replicates of 16 designs" in printed
    names = {path.name for path in (tmp_path / "study").iterdir()}
    assert {"sweep.csv", "indices.csv", "indices.json", "indices.png", "limits.png", "sweep.html"} <= names
    document = json.loads((tmp_path / "study" / "indices.json").read_text())
    assert document["sample"] == {"n": 8, "replicates": 16, "seed": 0} and document["designs"] == 16 * 8 * 4
    assert "lock.time &gt; 14 s: probability" in (tmp_path / "study" / "sweep.html").read_text()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--limit", "lock.tine > 3 s"], "unknown measure 'lock.tine'; did you mean 'lock.time'?"),
        (["--limit", "lock.time"], "expected MEASURE > VALUE or MEASURE < VALUE"),
        (["--sobol", "10"], "expected a power of two, such as 8 or 16, found 10"),
        (["--sobol", "8", "--sample", "64"], "cannot be combined with sobol"),
    ],
)
def test_wrong_options_are_refused_before_anything_is_run(options, message, tmp_path, capsys):
    vary = ["--vary", f"crank_length=normal({CRANK} m, 2 mm)"]
    sample = [] if "--sobol" in options else ["--sample", "1024"]
    assert main(["sweep", "four_bar", *vary, *sample, *options, "--out", str(tmp_path / "study")]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.glob("study/*.csv"))


def test_limits_of_a_sample_whose_error_is_unknown_are_refused_with_a_remedy(tmp_path, capsys):
    vary = ["--vary", f"crank_length=normal({CRANK} m, 2 mm)", "--sample", "64", "--no-plots"]
    assert main(["sweep", "four_bar", *vary, "--limit", "lock.time > 14 s", "--out", str(tmp_path / "study")]) == 2
    assert "draw more, or draw independent designs (method random)" in capsys.readouterr().err
    assert (tmp_path / "study" / "sweep.csv").exists()


@pytest.mark.tier2
def test_a_report_of_a_sweep_takes_measures_and_limits_and_other_reports_do_not(tmp_path):
    result = bc.sweep("four_bar", {"crank_length": f"normal({CRANK}, {SPREAD})"}, sample=32, method="random")
    page = bc.report(result, tmp_path / "page.html", measures=["lock.time"], limits=["lock.time > 14 s"])
    assert page.exists() and math.isfinite(page.stat().st_size)
    run = bc.simulate("pendulum", duration=0.1)
    with pytest.raises(InputError, match="they are for a sweep"):
        bc.report(run, tmp_path / "run.html", limits=["end.time > 1"])


@pytest.mark.tier2
def test_statistics_of_sizings_are_those_of_the_closed_form():
    """The peak torque of a pendulum that is held level is m g l (test_sizing_sweep.py): with independent m and l the
    variance has the parts s_m² l², m² s_l² and s_m² s_l², and with l fixed the torque is normal."""
    mass, length = (2.0, 0.1), (-0.5, 0.1 / math.sqrt(12.0))  # mean and standard deviation
    vary = {"link.pendulum.mass": "normal(2 kg, 0.1 kg)", "link.pendulum.cg.z": "uniform(-0.55 m, -0.45 m)"}
    found = bc.sweep("geared_pendulum", vary, size=True, sobol=128, seed=2).sensitivity.indices("shoulder.peak_torque")
    parts = mass[1] ** 2 * length[0] ** 2, mass[0] ** 2 * length[1] ** 2
    both = mass[1] ** 2 * length[1] ** 2
    whole = sum(parts) + both
    for first, total, part in zip(found.first, found.total, parts, strict=True):
        assert abs(first.value - part / whole) < 2.0 * first.half_width < 0.05
        assert abs(total.value - (part + both) / whole) < 2.0 * total.half_width < 0.05
    single = {"link.pendulum.mass": vary["link.pendulum.mass"]}
    sample = bc.sweep("geared_pendulum", single, size=True, sample=1024, method="random", seed=2)
    torque = 9.81 * 0.5 * 2.1  # at one standard deviation above the mean; the configuration's l is 0.5 m
    low, high = sample.statistics.exceedance(f"shoulder.peak_torque > {torque} N m").interval
    assert low < stats.norm.sf(1.0) < high < low + 0.06
