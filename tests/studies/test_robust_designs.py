"""Robust designs: the worst case and mean and deviation within tolerances, against closed forms and single runs."""

import itertools
import json

import numpy as np
import pytest
import yaml

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.errors import InputError
from bellcrank.studies.optimisation.request import Request, plan_search

LENGTHS = {"crank_length": (1.2, 1.24), "rocker_length": (1.2, 1.24)}
TOLERANCES = {"crank_length": "uniform(-1 mm, 1 mm)", "ground_length": "uniform(-0.5 mm, 0.5 mm)"}
GROUND, COUPLER = 1.241, 1.2
SMALL = {"samples": 32, "starts": 2, "threads": 1}


def lock_angle(ground, crank, rocker):
    """The crank's angle where coupler and rocker are in line: the law of cosines in their triangle."""
    return np.arccos((ground**2 + crank**2 - (COUPLER + rocker) ** 2) / (2.0 * ground * crank))


def locked(crank, rocker, ground):
    """The lock of a run; None where it does not come to it."""
    lengths = {"crank_length": crank, "rocker_length": rocker, "ground_length": ground}
    return next(iter(bc.simulate("four_bar", overrides=lengths, samples=2).events), None)


def corners(*deviations):
    return [(0.0,) * len(deviations), *itertools.product(*((-d, d) for d in deviations))]


@pytest.mark.parametrize(
    ("name", "relation", "worse", "late"), [("maximise", "<=", min, max), ("minimise", ">=", max, min)]
)
def test_the_worst_case_is_that_of_the_closed_form_and_of_runs_at_the_ends_of_the_tolerances(
    name, relation, worse, late
):
    asked = {name: "lock.crank", "limits": f"lock.time {relation} 13 s", **SMALL}
    best = bc.optimise("four_bar", LENGTHS, tolerances=TOLERANCES, **asked)
    crank, rocker = best.values["crank_length"], best.values["rocker_length"]
    angles = [lock_angle(GROUND + g, crank + c, rocker) for c, g in corners(1e-3, 5e-4)]
    assert best.converged and best.objective == pytest.approx(worse(angles), abs=1e-7)
    times = [locked(crank + c, rocker, GROUND + g).time for c, g in corners(1e-3, 5e-4)]
    assert late(times) == pytest.approx(13.0, abs=1e-6)  # the limit is kept by all of them, and just so by the worst
    plain = bc.optimise("four_bar", LENGTHS, **asked)
    assert worse(best.objective, plain.objective) == best.objective != plain.objective
    said = " ".join(map(str, best.notes))
    assert "without deviations: lock.crank" in said and "at 256 other deviations: worst of lock.crank" in said
    assert best.as_dict()["robust"]["without_deviations"]["lock.crank"] == pytest.approx(angles[0], abs=1e-7)


def test_mean_and_deviation_are_those_of_the_closed_form_at_the_same_deviations():
    normal = {"crank_length": "normal(0, 0.3 mm)", "rocker_length": "normal(0, 0.2 mm)"}
    best = bc.optimise("four_bar", LENGTHS, minimise="lock.crank", robust="mean + 3 sd", tolerances=normal, **SMALL)
    crank, rocker = best.values["crank_length"], best.values["rocker_length"]
    drawn = best.problem.robustness.deviations
    angles = lock_angle(GROUND, crank + drawn[:, 0], rocker + drawn[:, 1])
    assert best.objective == pytest.approx(angles.mean() + 3.0 * angles.std(ddof=1), abs=1e-7)
    step = 1e-6  # to first order, the standard deviation is that of a sum of independent deviations
    ends = [lock_angle(GROUND, crank + side, rocker) for side in (-step, step)]
    slopes = [np.diff(ends)[0] / (2 * step)]
    ends = [lock_angle(GROUND, crank, rocker + side) for side in (-step, step)]
    slopes.append(np.diff(ends)[0] / (2 * step))
    expected = lock_angle(GROUND, crank, rocker) + 3.0 * np.hypot(slopes[0] * 3e-4, slopes[1] * 2e-4)
    assert best.as_dict()["robust"]["at_other_deviations"]["lock.crank"] == pytest.approx(expected, rel=2e-3)
    assert best.converged


@pytest.mark.tier2
def test_no_random_design_has_a_better_worst_case_of_the_torque_of_an_arm():
    spread = {"spring_stiffness": "uniform(-20, 20)", "spring_preload": "uniform(-10, 10)"}
    best = bc.optimise("balanced_arm", tolerances=spread, threads=2)
    assert best.converged
    x = best.values
    torques = [
        bc.size(bc.load_scene("balanced_arm").with_overrides(
            x | {"spring_stiffness": x["spring_stiffness"] + s, "spring_preload": x["spring_preload"] + p}
        )).joint("shoulder").peak_torque
        for s, p in corners(20.0, 10.0)
    ]  # fmt: skip
    assert best.objective == pytest.approx(max(torques), rel=1e-8)
    assert sum(abs(torque - best.objective) < 1e-6 * best.objective for torque in torques) >= 2  # corners tie
    others = best.problem.run(np.random.default_rng(3).uniform(size=(500, 3)))[:, 0]
    assert np.nanmin(others) > best.objective * (1.0 - 1e-9)


def test_the_front_between_worst_cases_is_that_of_all_sizes():
    sizes = {"crank_length": {"sizes": [1.22, 1.23, 1.235]}, "rocker_length": {"sizes": [1.2, 1.22]}}
    front = bc.pareto_front(
        "four_bar", sizes, minimise="lock.time", maximise="lock.crank", tolerances=TOLERANCES, threads=1
    )
    found = []
    for crank, rocker in itertools.product(*(one["sizes"] for one in sizes.values())):
        runs = [locked(crank + c, rocker, GROUND + g) for c, g in corners(1e-3, 5e-4)]
        if None in runs:  # infeasible: one of them does not lock in time
            continue
        angles = [lock_angle(GROUND + g, crank + c, rocker) for c, g in corners(1e-3, 5e-4)]
        found.append((max(run.time for run in runs), min(angles)))
    expected = [it for it in found if not any(o != it and o[0] <= it[0] and o[1] >= it[1] for o in found)]
    assert len(expected) > 1
    assert sorted((one.measures["lock.time"], one.measures["lock.crank"]) for one in front.designs) == [
        pytest.approx(each, rel=1e-7) for each in sorted(expected)
    ]


def test_a_scene_and_the_command_say_how_designs_are_judged(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    data = dict(bc.load_scene("four_bar").data)
    data["optimise"] = {"vary": {"crank_length": [1.2, 1.24]}, "minimise": "lock.time", "samples": 8, "starts": 1,
                        "tolerances": {"crank_length": "uniform(-1 mm, 1 mm)"}, "robust": "mean + 2 sd"}  # fmt: skip
    (tmp_path / "bar.yaml").write_text(yaml.safe_dump(data))
    assert main(["optimise", "bar.yaml", "--no-plots", "--out", "a"]) == 0
    assert "mean + 2 sd of lock.time" in capsys.readouterr().out
    assert json.loads((tmp_path / "a/optimum.json").read_text())["robust"]["rule"] == "mean + 2 sd"
    assert main(["optimise", "bar.yaml", "--tolerance", "coupler_length=uniform(-1 mm, 1 mm)", "--robust", "worst",
                 "--no-plots", "--out", "b"]) == 0  # fmt: skip
    shown = capsys.readouterr().out
    assert "--tolerance replaces what the scene says" in shown and "worst of lock.time" in shown
    head = (tmp_path / "b/designs.csv").read_text().splitlines()[0]
    assert "worst of lock.time [s]" in head


def test_a_design_with_a_deviation_that_cannot_be_assembled_is_infeasible():
    # with a crank of 1.241 m the crank passes; lengths below about 1.0 m do not close
    wide = {"crank_length": "uniform(-0.3, 0.3)"}
    problem, _, _ = plan_search(
        bc.load_scene("four_bar"), Request({"crank_length": (1.0, 1.24)}, minimise="lock.time", tolerances=wide)
    )
    assert np.isnan(problem.run(np.array([[0.0]]))).all()
    assert problem.reasons[0].startswith("at a deviation within the tolerances: ")


@pytest.mark.parametrize(
    ("named", "message"),
    [
        ({"robust": "worst"}, "robust 'worst' needs tolerances, of which there are none"),
        ({"tolerances": {"crank_length": 0.1}}, "tolerances: 'crank_length': expected a distribution"),
        ({"tolerances": {"crank_length": "uniform(-1 kg, 1 kg)"}}, "'uniform(-1 kg, 1 kg)': expected a length in m"),
        (
            {"tolerances": {"crank_length": "normal(0, 1 mm)"}},
            "has no largest deviation; for the worst case use uniform",
        ),
        ({"tolerances": {"crank": "uniform(-1, 1)"}}, "'crank' is neither varied nor a number of the scene"),
        ({"tolerances": TOLERANCES, "robust": "mean"}, "expected 'worst' or 'mean + K sd', such as 'mean + 3 sd'"),
        ({"tolerances": TOLERANCES, "robust": "mean + 1e3 sd"}, "expected 'worst' or 'mean + K sd'"),
        ({"tolerances": TOLERANCES, "limits": "lock.crank = 155 deg"}, "cannot be kept at each deviation"),
    ],
)
def test_bad_tolerances_are_one_sentence(named, message):
    asked = {"variables": {"crank_length": (1.2, 1.24)}, "minimise": "lock.time", "samples": 4, "threads": 1} | named
    with pytest.raises(InputError) as error:
        bc.optimise("four_bar", **asked)
    assert message in str(error.value) and "\n" not in str(error.value)
