"""Sizes together with motors of a catalogue: the best design is that of brute force; files, gaps and bad input."""

import csv
import json
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.actuators.catalogue.catalogue import Catalogue, load_catalogue
from bellcrank.cli import main
from bellcrank.errors import BellcrankError, InputError
from bellcrank.sizing.selection.axis_loads_of import axis_loads
from bellcrank.sizing.selection.axis_pairs import axis_pairs
from bellcrank.sizing.selection.joint_problem import judge_choice
from bellcrank.sizing.selection.judged_axes import JudgedAxes
from bellcrank.sizing.selection.pairs import total
from bellcrank.sizing.sizing_subject import changed_scene, sizing_subject
from bellcrank.studies.selection.designs_with_motors import rank_of

CONDITIONS = bc.Conditions(voltage=48.0, assume={"gear.efficiency": 0.7})
MOTORS = ("maxon_353297", "maxon_397172", "maxon_ec90flat_90w_48v", "maxon_ec90flat_48v_500267")
GEARS = ("hd_shg_25_100", "hd_shg_32_120", "hd_csf_17_100_2uh", "hd_csf_11_50_2up")


def catalogue(motors: int, gears: int) -> Catalogue:
    """Some motors and gears, of which every pair is possible, with a motor alone too."""
    every = load_catalogue()
    by_id = {one.id: one for one in (*every.motors, *every.gears)}
    return Catalogue(tuple(by_id[name] for name in MOTORS[:motors]), tuple(by_id[name] for name in GEARS[:gears]))


def best_by_brute_force(vary: dict[str, list[float]], products: Catalogue) -> tuple[tuple[int, ...], tuple, int]:
    """The rank, the values and the pairs of the best design and combination, and how many there are: all are judged."""
    scene, found, count = bc.load_scene("balanced_arm"), [], 0
    for values in product(*vary.values()):
        subject = sizing_subject(changed_scene(scene, dict(zip(vary, values, strict=True))), None)
        loads = axis_loads(subject.mechanism, subject.motions, None, (), None, {})
        conditions = [CONDITIONS] * len(loads.axes)
        completed = Catalogue(
            tuple(map(CONDITIONS.completed, products.motors)), tuple(map(CONDITIONS.completed, products.gears))
        )
        pairs = axis_pairs(loads.axes, [completed] * len(loads.axes), {})
        problem = JudgedAxes(loads, pairs, conditions, CONDITIONS, "mass", True)
        for choice in product(*(range(len(one.pairs)) for one in pairs)):
            count += 1
            keys = judge_choice(problem, choice)
            if all(key[0] == 0 for key in keys):
                names = tuple("+".join(it.id for it in one.pairs.rows(k)) for one, k in zip(pairs, choice, strict=True))
                found.append((total(keys, False), values, names))
    rank, values, names = min(found)
    return rank, (values, names), count


def same_pairs(selection: bc.results.Selection) -> tuple[str, ...]:
    return tuple(f"{one.chosen.motor.id}+{one.chosen.gear.id}" for one in selection.axes)


@pytest.mark.tier2
@pytest.mark.parametrize(
    ("vary", "motors", "gears", "count"),
    [
        ({"spring_preload": [150.0, 250.0], "upper_arm": [0.9, 1.0]}, 4, 2, 4 * 144),
        (
            {"spring_preload": [100.0, 150.0, 200.0, 250.0, 300.0], "upper_arm": [0.8, 0.9, 1.0, 1.1, 1.2]},
            4, 4, 10_000,
        ),
    ],
)  # fmt: skip
def test_sizes_and_motors_are_those_of_brute_force(vary, motors, gears, count) -> None:
    products = catalogue(motors, gears)
    result = bc.select_designs("balanced_arm", vary, catalogue=products, conditions=CONDITIONS, candidates=1)
    rank, (values, pairs), tried = best_by_brute_force(vary, products)
    assert tried == count and result.gap == 0.0 and result.complete
    assert tuple(result.values.values()) == values and same_pairs(result.selection) == pairs
    assert result.rows[result.best].rank[1:6] == rank[:5]  # the largest use is refined for what is chosen


def test_each_design_has_the_motors_that_select_chooses_and_the_best_is_ranked_first() -> None:
    products, masses = catalogue(2, 2), [1.0, 2.5]
    result = bc.select_designs(
        "balanced_arm", {"link.link_2.mass": masses}, catalogue=products, conditions=CONDITIONS, candidates=1
    )
    for row, mass in zip(result.rows, masses, strict=True):
        alone = bc.select("balanced_arm", overrides={"link.link_2.mass": mass}, catalogue=products,
                          conditions=CONDITIONS, candidates=1)  # fmt: skip
        assert row.pairs == tuple("" if one.chosen is None else one.chosen.id for one in alone.axes)
        assert row.mass == alone.mass and row.rank == rank_of(alone)
    assert result.best == min(range(2), key=lambda k: result.rows[k].rank) and result.gap == 0.0
    assert "2 of 2 designs were tried; gap to the best: 0" in result.table()


def test_in_a_range_the_lighter_motor_is_found_where_no_sample_bears_it_and_the_gap_is_that_of_a_fine_grid() -> None:
    products, scene = catalogue(4, 4), bc.load_scene("balanced_arm")
    result = bc.select_designs(
        scene, {"spring_preload": {"lower": 0.0, "upper": 700.0}}, catalogue=products, conditions=CONDITIONS,
        candidates=1, samples=1, overrides={"spring_preload": 300.0},
    )  # fmt: skip
    sampled, best = result.rows[: result.inside.sampled], result.rows[result.best]
    assert {row.mass and round(row.mass, 9) for row in sampled} == {5.02, None} and best.mass == 4.53
    assert 145.0 < best.values[0] < 247.1 and best.inside and result.gap == 0.0 and result.inside.searched > 0
    beyond = bc.select_designs(
        scene, {"spring_preload": {"lower": 248.5, "upper": 400.0}}, catalogue=products, conditions=CONDITIONS,
        candidates=1, samples=4,
    )  # fmt: skip
    assert round(beyond.rows[beyond.best].mass, 9) == 5.02 and beyond.inside.nearest == tuple(best.pairs)
    # The use of the lighter pair rises in proportion to the preload: continued from two values at which it passes.
    low, high = (
        bc.select(scene, catalogue=products, conditions=CONDITIONS, candidates=1,
                  overrides={"spring_preload": preload}).axes[0].chosen.largest_use
        for preload in (245.0, 247.0)
    )  # fmt: skip
    assert beyond.inside.nearest_use == pytest.approx(high + 0.75 * (high - low), abs=1e-6)
    assert "as far as samples and local searches show" in beyond.table() and "at best" in str(beyond.notes)


@pytest.mark.tier2
@pytest.mark.parametrize("objective", ["mass", "loss", "margin"])
def test_values_in_a_range_are_no_worse_than_the_best_of_a_fine_grid(objective) -> None:
    products, scene = catalogue(4, 4), bc.load_scene("balanced_arm")
    vary = {"spring_preload": {"lower": 0.0, "upper": 400.0}}
    result = bc.select_designs(
        scene, vary, catalogue=products, conditions=CONDITIONS, candidates=1, samples=4, objective=objective
    )
    grid = [
        bc.select(scene, catalogue=products, conditions=CONDITIONS, candidates=1, objective=objective,
                  overrides={"spring_preload": preload})
        for preload in np.linspace(0.0, 400.0, 161).tolist()
    ]  # fmt: skip
    best, found = min(map(rank_of, grid)), result.rows[result.best].rank
    assert found[:4] == best[:4]
    assert found[4] <= best[4] or found[4] == pytest.approx(best[4], rel=1e-5)  # of the objective, in units of 1e-9


def test_where_no_sample_has_motors_values_are_changed_until_some_pass() -> None:
    products = catalogue(4, 4)
    weak = Catalogue(tuple(one for one in products.motors if one.id != "maxon_353297"), products.gears)
    result = bc.select_designs(
        "balanced_arm", {"spring_preload": {"lower": 0.0, "upper": 126.0}}, catalogue=weak, conditions=CONDITIONS,
        candidates=1, samples=1, overrides={"spring_preload": 60.0},
    )  # fmt: skip
    assert not any(row.inside for row in result.rows[:2]) and result.selection.inside
    assert 120.0 < result.values["spring_preload"] <= 126.0 and result.gap == 0.0


def test_the_lightest_motors_are_found_at_a_corner_where_the_loads_are_least() -> None:
    result = bc.select_designs(
        "balanced_arm", {"link.link_2.mass": {"lower": 0.2, "upper": 20.0}}, catalogue=catalogue(4, 4),
        conditions=CONDITIONS, candidates=1, samples=1,
    )  # fmt: skip
    least = bc.select("balanced_arm", overrides={"link.link_2.mass": 0.2}, catalogue=catalogue(4, 4),
                      conditions=CONDITIONS, candidates=1)  # fmt: skip
    assert result.selection.mass == least.mass and result.gap == 0.0


def test_durations_of_waypoints_are_sizes_too() -> None:
    durations = [6.0, 12.0]
    result = bc.select_designs(
        "balanced_arm", {"motions.lift.duration": durations}, catalogue=catalogue(4, 2), conditions=CONDITIONS,
        candidates=1, overrides={"motions.lift.speed_factor": 2.0, "spring_preload": 200.0},
    )  # fmt: skip
    for row, duration in zip(result.rows, durations, strict=True):
        overrides = {"motions.lift.speed_factor": 6.0 / duration, "spring_preload": 200.0}
        alone = bc.select("balanced_arm", overrides=overrides, catalogue=catalogue(4, 2), conditions=CONDITIONS,
                          candidates=1)  # fmt: skip
        assert row.rank == rank_of(alone) and not row.reason


def test_a_local_search_that_is_stopped_keeps_the_best_and_its_gap_is_not_known() -> None:
    calls = []

    def stop(done: int, of: int) -> None:
        calls.append(done)
        if calls.count(4) == 3:  # within the first local search: the sample has 4 designs with its corners
            raise KeyboardInterrupt

    result = bc.select_designs(
        "balanced_arm", {"spring_preload": {"lower": 100.0, "upper": 400.0}}, catalogue=catalogue(4, 4),
        conditions=CONDITIONS, candidates=1, samples=1, progress=stop,
    )  # fmt: skip
    assert not result.complete and len(result.rows) == 4 and result.selection.inside and result.gap == float("inf")


def test_ranges_and_sizes_together_have_both_in_each_design() -> None:
    result = bc.select_designs(
        "balanced_arm", {"upper_arm": [0.9, 1.0], "spring_preload": {"lower": "150 N m", "upper": "250 N m"}},
        catalogue=catalogue(4, 2), conditions=CONDITIONS, candidates=1, samples=2,
    )  # fmt: skip
    assert {row.values[0] for row in result.rows} == {0.9, 1.0}
    assert all(150.0 <= row.values[1] <= 250.0 for row in result.rows)
    assert result.as_dict()["ranges"]["sampled"] == 4 + 4 and result.count == len(result.rows)


def test_files_hold_the_designs_and_the_best_is_a_configuration_with_its_sizes(tmp_path) -> None:
    result = bc.select_designs(
        "geared_pendulum", {"link.pendulum.mass": [3.0, 1.5]}, overrides={"gravity": [0, 0, -9.0]},
        catalogue=catalogue(4, 4), conditions=CONDITIONS,
    )  # fmt: skip
    rows = list(csv.reader(result.to_csv(tmp_path / "d.csv").read_text().splitlines()))
    assert rows[0][0] == "link.pendulum.mass [kg]" and [float(row[0]) for row in rows[1:]] == [3.0, 1.5]
    written = json.loads(result.to_json(tmp_path / "d.json").read_text())
    assert written["values"] == result.values and written["gap"] == 0.0 and len(written["designs"]) == 2
    scene = bc.load_scene(result.write_config(tmp_path / "best.yaml"))
    [mass] = [it.value for it in scene.parameters.values() if it.sets == ("link.pendulum.mass",)]
    assert mass == result.values["link.pendulum.mass"] and scene.robot.gravity[2] == -9.0
    assert scene.config.actuators["shoulder"].motor.id == result.selection.axes[0].chosen.motor.id


def test_a_changed_scene_that_its_file_does_not_say_is_not_written(tmp_path) -> None:
    scene = bc.load_scene("balanced_arm").with_overrides({"spring_preload": 180.0})
    result = bc.select_designs(scene, {"upper_arm": [1.0]}, catalogue=catalogue(4, 2), conditions=CONDITIONS)
    with pytest.raises(InputError, match="differs from its file"):
        result.write_config(tmp_path / "best.yaml")
    assert not (tmp_path / "best.yaml").exists()


def test_a_search_that_is_stopped_says_that_the_gap_is_not_known() -> None:
    def stop(done: int, of: int) -> None:
        assert of == 3
        raise KeyboardInterrupt

    result = bc.select_designs("geared_pendulum", {"link.pendulum.mass": [1, 2, 3]}, catalogue=catalogue(4, 4),
                               conditions=CONDITIONS, progress=stop)  # fmt: skip
    assert not result.complete and len(result.rows) == 1 and result.gap == float("inf")
    assert "gap to the best: not known" in result.table() and result.as_dict()["gap"] is None
    cut = replace(result, complete=True, rows=(replace(result.rows[0], proof="best found: 7 combinations"),))
    assert cut.gap == float("inf") and "neither tried nor excluded" in str(cut.notes)


def test_the_command_chooses_sizes_and_motors(tmp_path, capsys) -> None:
    line = ["select", "geared_pendulum", "--maker", "maxon", "--vary", "link.pendulum.mass=2,4", "--no-plots",
            "--assume", "gear.efficiency=0.7", "--out", str(tmp_path / "o"), "--write-config", str(tmp_path / "b.yaml"),
            "--accept-unknown"]  # fmt: skip
    assert main(line) == 0
    assert "2 of 2 designs were tried; gap to the best: 0" in capsys.readouterr().out
    assert {"designs.csv", "designs.json", "selection.csv"} <= {path.name for path in (tmp_path / "o").iterdir()}
    assert bc.load_scene(tmp_path / "b.yaml").parameters["link_pendulum_mass"].value == 2.0
    assert main([*line, "--samples", "8"]) == 2
    assert "no range is varied" in capsys.readouterr().err
    assert main([*line, "--limit", "tracking_error=0.01"]) == 2
    assert "--limit: not with --vary" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        ({}, "expected at least one parameter to vary"),
        ({"actuators.shoulder.ratio": [40, 50]}, "the actuators are chosen here, and their figures cannot be varied"),
        ({"conditions.voltage": [24, 48]}, "'voltage' is among the conditions that are given, which replace it"),
        ({"actuators.shoulder.voltage": [24, 48]}, "'voltage' is among the conditions that are given"),
        ({"link.pendulum.mas": [1]}, "link.pendulum.mas"),
        ({"link.pendulum.mass": "normal(2, 0.1)"}, "has a distribution"),
        ({"link.pendulum.mass": {"lower": 3, "upper": 2}}, "the lower below the upper, found 3.0 and 2.0"),
        ({"link.pendulum.mass": {"lower": 3}}, "expected values, or a range such as"),
        ({"link.pendulum.mass": {"lower": "1 kg", "upper": "x"}}, "link.pendulum.mass"),
        ({"link.pendulum.mass": [-1, -2]}, "motors can be chosen for none of 2 designs"),
    ],
)
def test_bad_input_is_one_sentence(vary, message) -> None:
    with pytest.raises(BellcrankError) as caught:
        bc.select_designs("geared_pendulum", vary, catalogue=catalogue(1, 1), conditions=CONDITIONS)
    assert message in str(caught.value) and "\n" not in str(caught.value)
