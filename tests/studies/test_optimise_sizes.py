"""Standard sizes: the best combination is that of brute force, with and without continuous variables; bad input."""

import csv
import json
from itertools import product

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.errors import InputError
from bellcrank.studies.optimisation import size_search

PRELOADS, STIFFNESSES = [150.0, 200.0, 250.0, 300.0], [20.0, 80.0, 140.0]
SPRING = {
    "spring_preload": {"lower": 150, "upper": "300 N m", "step": "50 N m"},
    "spring_stiffness": {"sizes": STIFFNESSES},
}
COARSE = {"samples": 16, "starts": 1, "threads": 1}
SMALL = {"size": True, "threads": 1, "samples": 32, "starts": 2}


def sized(**values: float) -> bc.results.Sizing:
    return bc.size("balanced_arm", overrides=values)


def test_the_best_of_all_combinations_of_sizes_is_that_of_single_sizings() -> None:
    best = bc.optimise("balanced_arm", SPRING, minimise="shoulder.peak_torque", **SMALL)
    torques = {
        (preload, stiffness): sized(spring_preload=preload, spring_stiffness=stiffness).joint("shoulder").peak_torque
        for preload, stiffness in product(PRELOADS, STIFFNESSES)
    }
    least = min(torques, key=torques.__getitem__)
    assert tuple(best.values.values()) == least and best.objective == pytest.approx(torques[least], rel=1e-9)
    assert best.combinations == size_search.Combinations(12, 12, 0.0, True) and best.converged
    assert best.status == "the best of all 12 combinations of sizes" and best.residual == 0.0
    assert "gap to the best: 0 N m" in best.table() and "12 of 12" in best.table()


@pytest.mark.tier2
def test_the_best_of_10_000_combinations_is_that_of_a_sweep_with_a_limit(monkeypatch) -> None:
    axes = {"spring_preload": np.linspace(0.0, 400.0, 100), "spring_stiffness": np.linspace(0.0, 400.0, 20),
            "upper_arm": np.array([0.93, 0.97, 1.0, 1.04, 1.1])}  # fmt: skip
    sweep = bc.sweep("balanced_arm", axes, size=True, threads=1)
    torque = np.where(sweep.column("shoulder.rms_torque") >= 40.0, sweep.column("shoulder.peak_torque"), np.nan)
    row = int(np.nanargmin(torque))
    sizes = {name: {"sizes": values} for name, values in axes.items()}
    asked = {"minimise": "shoulder.peak_torque", "limits": "shoulder.rms_torque >= 40 N m", **SMALL}
    best = bc.optimise("balanced_arm", sizes, **asked)
    assert best.combinations == size_search.Combinations(10_000, 10_000, 0.0, True)
    assert list(best.values.values()) == sweep.values[row].tolist() and best.objective == torque[row]
    monkeypatch.setattr(size_search, "MOST_RUN", 100)
    bounded = bc.optimise("balanced_arm", sizes, **asked)
    assert bounded.values == best.values and bounded.objective == pytest.approx(best.objective, rel=1e-12)
    assert bounded.combinations.complete and not bounded.combinations.proved and bounded.combinations.tried < 500
    assert bounded.status == "the best combination of sizes found" and "no proof" in str(bounded.notes)


@pytest.mark.tier2
def test_sizes_beside_continuous_variables_are_those_of_a_search_for_each_combination() -> None:
    arms = [0.92, 1.0, 1.08]
    vary = {"spring_preload": {"sizes": PRELOADS}, "spring_stiffness": (0, 400), "upper_arm": {"sizes": arms}}
    limits = "shoulder.rms_torque >= 45 N m"
    best = bc.optimise("balanced_arm", vary, minimise="shoulder.peak_torque", limits=limits, **SMALL)
    found = {}
    for preload, arm in product(PRELOADS, arms):
        one = bc.optimise("balanced_arm", {"spring_stiffness": (0, 400)}, minimise="shoulder.peak_torque",
                          limits=limits, overrides={"spring_preload": preload, "upper_arm": arm}, **SMALL)  # fmt: skip
        if one.converged:
            found[preload, arm] = one
    least = min(found, key=lambda key: found[key].objective)
    assert len(found) > 3 and (best.values["spring_preload"], best.values["upper_arm"]) == least
    assert best.objective == pytest.approx(found[least].objective, rel=1e-6)
    assert best.converged and best.residual < 1e-6 and best.combinations.complete and not best.combinations.proved
    assert not any(name.startswith(("spring_preload", "upper_arm")) for name in best.multipliers)


def test_a_size_beside_a_continuous_length_is_the_one_that_locks_soonest() -> None:
    vary = {"crank_length": {"sizes": ["1215 mm", "1225 mm", "1235 mm"]}, "rocker_length": (1.2, 1.24)}
    best = bc.optimise("four_bar", vary, minimise="lock.time", limits="lock.crank <= 155 deg", samples=16, starts=1)
    assert best.values["crank_length"] in (1.215, 1.225, 1.235) and best.combinations.complete
    singles = [
        bc.optimise("four_bar", {"rocker_length": (1.2, 1.24)}, minimise="lock.time", limits="lock.crank <= 155 deg",
                    overrides={"crank_length": length}, samples=16, starts=1)
        for length in (1.215, 1.225, 1.235)
    ]  # fmt: skip
    least = min(single.objective for single in singles if single.converged)
    assert best.objective == pytest.approx(least, rel=1e-6) and best.residual < 1e-6


def test_a_search_that_ends_early_says_how_much_better_the_rest_may_be(monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(size_search, "MOST_RUN", 2)
    vary = {"crank_length": {"sizes": [1.2, 1.21, 1.22, 1.23, 1.24]},
            "rocker_length": {"sizes": [1.2, 1.213, 1.227, 1.24]}}  # fmt: skip
    asked = {"minimise": "lock.time", "limits": ["lock.crank >= 155.3 deg", "start.rocker <= 90 deg"], **COARSE}
    whole = bc.optimise("four_bar", vary, **asked)
    monkeypatch.setattr(size_search, "MOST_BOXES", 1)
    part = bc.optimise("four_bar", vary, **asked)
    assert whole.converged and whole.combinations.gap == 0.0 and not part.converged
    assert 0.0 < part.combinations.gap < 1.0 and f"gap to the best: {part.combinations.gap:.3g} s" in part.table()
    table = list(csv.DictReader(whole.to_csv(tmp_path / "d.csv").read_text().splitlines()))
    off = [float(row["crank_length [m]"]) not in vary["crank_length"]["sizes"] for row in table[1:]]
    said = ["between sizes" in row["reason"] for row in table[1:]]
    assert any(said) and all(row for sized, row in zip(off, said, strict=True) if sized)
    assert part.objective - whole.objective <= part.combinations.gap + 1e-9
    assert any("did not try or exclude" in note for note in part.notes) and "residual is" not in str(part.notes)
    monkeypatch.undo()
    every = bc.optimise("four_bar", vary, **asked)
    assert every.combinations.proved and every.values == whole.values


def test_ctrl_c_keeps_the_best_size_and_says_that_the_gap_is_not_known() -> None:
    def stop(done: float, _: float | None) -> None:
        if done >= 20:
            raise KeyboardInterrupt

    vary = {"crank_length": {"sizes": [1.21, 1.22, 1.23, 1.24]}, "rocker_length": (1.2, 1.24)}
    best = bc.optimise("four_bar", vary, minimise="lock.time", samples=64, progress=stop, threads=1)
    assert not best.complete and not best.converged and best.values["crank_length"] in (1.21, 1.22, 1.23, 1.24)
    assert "gap to the best: not known" in best.table() and best.as_dict()["combinations"]["gap"] is None


@pytest.mark.parametrize("sizes", ["1.21,1.23,1240 mm", "1.2 m:1240 mm step 20 mm"])
def test_the_command_takes_sizes_and_writes_one_of_them(sizes, tmp_path, capsys) -> None:
    line = ["optimise", "four_bar", "--vary", f"crank_length={sizes}", "--minimise", "lock.time", "--no-plots",
            "--out", str(tmp_path / "o"), "--write-config", str(tmp_path / "best.yaml")]  # fmt: skip
    assert main(line) == 0
    assert "the best of all 3 combinations of sizes" in capsys.readouterr().out
    assert json.loads((tmp_path / "o/optimum.json").read_text())["combinations"]["proved"] is True
    assert bc.load_scene(tmp_path / "best.yaml").parameters["crank_length"].value == 1.24


def test_a_scene_says_sizes_and_a_number_that_takes_whole_ones_keeps_them() -> None:
    entry = {"vary": {"spring_preload": {"sizes": [100, 200]}}, "minimise": "shoulder.peak_torque", "size": True}
    best = bc.optimise("balanced_arm", overrides={"optimise": entry})
    assert best.values == {"spring_preload": 200.0} and best.combinations.proved


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"sizes": [1.2]}, "expected two sizes or more that differ, found a list of 1"),
        ({"sizes": [1.2, 1.2]}, "expected two sizes or more that differ"),
        ({"sizes": 1.2}, "expected standard sizes as {sizes: [0.3, 0.31]}"),
        ({"size": [1.2, 1.3]}, "expected standard sizes"),
        ({"lower": 1.2, "upper": 1.24}, "expected standard sizes"),
        ({"lower": 1.24, "upper": 1.2, "step": 0.01}, "below the upper, found 1.24 and 1.2 m"),
        ({"lower": 1.2, "upper": 1.24, "step": "15 mm"}, "expected a step of which a whole number"),
        ({"lower": 1.2, "upper": 1.24, "step": 0}, "expected a step of which a whole number"),
        ({"lower": 1.2, "upper": 1.24, "step": "1 kg"}, "'1 kg'"),
        ([1.2, 1.22, 1.24], "expected two bounds, or standard sizes"),
    ],
)
def test_bad_sizes_are_one_sentence(given, message) -> None:
    with pytest.raises(InputError) as caught:
        bc.optimise("four_bar", {"crank_length": given}, minimise="lock.time", samples=8)
    assert message in str(caught.value) and "crank_length" in str(caught.value) and "\n" not in str(caught.value)


def test_a_start_between_sizes_and_a_wrong_entry_are_refused() -> None:
    vary = {"crank_length": {"sizes": [1.22, 1.24]}}
    with pytest.raises(InputError, match=r"start: 'crank_length' is 1.23 m, which is none of its sizes"):
        bc.optimise("four_bar", vary, minimise="lock.time", start={"crank_length": 1.23})
    with pytest.raises(InputError, match=r"optimise.*expected standard sizes"):
        bc.load_scene("balanced_arm", {"optimise": {"vary": {"upper_arm": {"sizes": 3}}}})
