"""Simulations of many designs in columns against `simulate` of each design alone."""

import pickle

import numpy as np
import pytest
from lone_designs import check, runner, statuses
from lone_measures import run_measures, start_measures

import bellcrank as bc
from bellcrank.simulation.integration import ensemble
from bellcrank.studies.execution.design_runner import StudyInterrupted
from bellcrank.studies.results.study_columns import StudyColumns


def test_four_bars_that_lock_that_do_not_and_that_cannot_be_built():
    found, values = runner("four_bar", crank_length=[1.0, 1.158, 1.16, 1.22, 1.241, 2.0, 4.0])
    columns = check(found, values, 1e-12)
    assert statuses(columns) == ["finished"] * 2 + ["event"] * 4 + ["infeasible"]
    assert set(columns.reasons) == {0, 1, 6}


def test_solvers_and_ways_to_stabilise_are_variants_of_the_scene():
    found, values = runner(
        bc.load_scene("four_bar", {"simulate.duration": 3.0}),
        simulate__solver=["DOP853", "RK45", "Radau", "DOP853"],
        simulate__stabilisation=["projection", "none", "projection", "none"],
        simulate__rtol=[1e-9, 1e-7, 1e-7, 1e-8],
    )
    check(found, values, 1e-11)


def test_names_and_units_are_those_of_a_run_in_its_order():
    found, _ = runner("four_bar", crank_length=[1.241])
    scene = found.scene
    named = {name: unit for name, unit, _ in (*start_measures(scene), *run_measures(bc.simulate(scene)))}
    assert list(found.units.items()) == list(named.items())


def test_a_row_depends_on_its_own_values_alone():
    found, values = runner("four_bar", crank_length=np.linspace(1.1, 1.3, 11))
    whole = found.run(values)
    parts = StudyColumns.joined([found.run(values[:1]), found.run(values[1:4]), found.run(values[4:])])
    np.testing.assert_array_equal(parts.status, whole.status)
    assert parts.reasons == whole.reasons
    for name, column in whole.measures.items():
        np.testing.assert_array_equal(parts.measures[name], column)


def test_a_runner_can_be_pickled_and_is_the_same_then():
    found, values = runner("four_bar", crank_length=[1.2, 1.241])
    again = pickle.loads(pickle.dumps(found))
    assert again.identity == found.identity and again.units == found.units
    np.testing.assert_array_equal(again.run(values).measures["lock.time"], found.run(values).measures["lock.time"])


def test_identities_tell_scenes_and_settings_apart():
    scene = bc.load_scene("four_bar")
    first = runner(scene, crank_length=[1.2])[0].identity
    for other, key in (
        (runner(scene.with_overrides({"simulate.rtol": 1e-8}), crank_length=[1.2]), "solver settings"),
        (runner(scene.with_overrides({"coupler_length": 1.3}), crank_length=[1.2]), "scene"),
    ):
        assert other[0].identity[key] != first[key]


def test_ctrl_c_hands_over_the_designs_that_are_done(monkeypatch):
    found, values = runner("four_bar", crank_length=[4.0, 1.1, 1.2, 1.22, 1.24])
    whole = found.run(values)

    engine = ensemble.integrate_in_lanes

    def interrupted(problem):
        result = engine(problem)
        result["done"][[0, 3]] = False
        return result

    monkeypatch.setattr(ensemble, "integrate_in_lanes", interrupted)
    with pytest.raises(StudyInterrupted) as stopped:
        found.run(values)
    rows, columns = stopped.value.rows, stopped.value.columns
    assert rows.tolist() == [0, 2, 3]
    np.testing.assert_array_equal(columns.status, whole.status[rows])
    assert columns.reasons == {0: whole.reasons[0]}
    for name, column in columns.measures.items():
        np.testing.assert_array_equal(column, whole.measures[name][rows])
