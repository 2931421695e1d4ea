"""Events of ensembles: every count, time and state against lone runs, whoever shares the lanes."""

from dataclasses import replace

import numpy as np
import pytest

from bellcrank.scene.scene import load_scene
from tests.support.scene_ensemble import SceneEnsemble, assert_equal_rows, assert_same_events

SWING = {"simulate.duration": 4.0, "simulate.rtol": 1e-10, "simulate.atol": 1e-10}


def swing(events, rows=40, **settings):
    """Planar arms that swing from random starts and look for `events` (name: (expression, stop))."""
    scene = load_scene("planar_2r_swing").with_overrides(
        SWING
        | {f"simulate.{key}": value for key, value in settings.items()}
        | {
            "events": [
                {"name": name, "when": {"expression": expression}, "stop": stop}
                for name, (expression, stop) in events.items()
            ]
        }
    )
    random = np.random.default_rng(3)
    starts = random.uniform([-2.2, 0.4], [-1.0, 1.2], (rows, 2)).tolist()
    return SceneEnsemble(scene, [{"initial.shoulder": a, "initial.elbow": b} for a, b in starts])


@pytest.fixture(scope="module")
def four_bars():
    random = np.random.default_rng(1)
    lengths = random.uniform(1.2, 1.3, 60).tolist()
    return SceneEnsemble(load_scene("four_bar"), [{"parameters.crank_length": length} for length in lengths])


@pytest.fixture(scope="module")
def several():
    return swing(
        {
            "vertical": ("shoulder.position+1.5", False),
            "folded": ("elbow.position", False),
            "turns": ("shoulder.velocity", False),
            "ticks": ("sin(9*t)-0.3", False),
            "far": ("shoulder.position+elbow.position-2", False),
        }
    )


def test_the_lock_of_every_four_bar_is_that_of_its_lone_run(four_bars):
    found = four_bars.run()
    assert (found.event_count == 1).all() and (found.stopped_by == 0).all() and not found.single.any()
    assert_same_events(found, four_bars, time=1e-10, state=1e-9)


def test_several_events_that_cross_many_times_are_counted_and_the_first_of_each_is_found(several):
    found = several.run()
    assert (found.event_count.sum(axis=0)[:4] > 100).all() and not found.single.any()
    assert (found.event_count[:, 4] == 0).all()
    assert_same_events(found, several, time=1e-8, state=1e-7)


@pytest.mark.parametrize("settings", [{"solver": "RK45", "rtol": 1e-8, "atol": 1e-8}, {"solver": "RK4", "step": 0.004}])
def test_events_of_other_methods_are_those_of_lone_runs(settings):
    arms = swing({"vertical": ("shoulder.position+1.5", False), "turns": ("shoulder.velocity", False)}, 16, **settings)
    found = arms.run()
    assert not found.single.any()
    assert_same_events(found, arms, time=1e-6, state=1e-5)


def test_the_first_of_several_events_ends_the_run_and_later_ones_in_its_step_do_not_count():
    arms = swing(
        {
            "vertical": ("shoulder.position+1.5", True),
            "ticks": ("sin(40*t)-0.3", False),
            "folded": ("elbow.position", True),
        }
    )
    found = arms.run()
    assert set(found.stopped_by.tolist()) == {0, 2}
    assert_same_events(found, arms, time=1e-9, state=1e-8)


def test_an_event_at_exactly_the_start_is_none_and_later_ones_are_found():
    arms = swing({"turns": ("shoulder.velocity", False), "rests": ("elbow.velocity*t", False)}, 16)
    assert (arms.start[:, 2:4] == 0.0).all()
    assert_same_events(arms.run(), arms, time=1e-8, state=1e-7)


def test_a_function_that_stays_at_zero_is_found_where_it_arrives():
    arms = swing({"level": ("max(shoulder.position+1.5, 0)-max(-1.8-shoulder.position, 0)", False)}, 16)
    found = arms.run()
    assert found.event_count.sum() > 0
    assert_same_events(found, arms, time=1e-7, state=1e-6)


def test_steps_in_which_a_function_is_undefined_are_counted():
    arms = swing({"root": ("sqrt(shoulder.position+1.6)-0.2", False)}, 16)
    found = arms.run()
    assert (found.undefined > 0).any()
    assert_same_events(found, arms, time=1e-8, state=1e-7)


@pytest.mark.tier2
def test_crossings_that_may_be_missed_are_counted_as_in_lone_runs():
    arms = swing({"fast": ("sin(90000*shoulder.position+200000*t)", False)}, 2, duration=0.2)
    found = arms.run()
    assert (found.unresolved > 0).all()
    for row in range(2):
        (told,) = arms.lone(row).statistics.unresolved
        assert found.unresolved[row, 0] == told.steps and not told.undefined


def test_rows_do_not_depend_on_neighbours_order_or_threads(four_bars, several):
    random = np.random.default_rng(5)
    for ensemble in (four_bars, several):
        whole = ensemble.run()
        order = random.permutation(len(ensemble.scenes))
        assert_equal_rows(ensemble.run(order), whole, order)
        assert_equal_rows(ensemble.run(threads=2), whole)
        for rows in (slice(0, 1), slice(3, 6), slice(5, 14)):
            assert_equal_rows(ensemble.run(rows), whole, rows)


def test_the_integrator_of_single_runs_fills_the_same_columns(several, monkeypatch):
    from bellcrank.simulation.integration import ensemble

    lanes = several.run()
    monkeypatch.setattr(ensemble, "_lane_kernels", lambda *_: None)
    single = several.run()
    assert single.single.all()
    for name in ("event_count", "stopped_by", "unresolved", "undefined", "status"):
        np.testing.assert_array_equal(getattr(lanes, name), getattr(single, name))
    np.testing.assert_allclose(lanes.event_time, single.event_time, rtol=0, atol=1e-8)
    radau = replace(several.scene, settings=replace(several.scene.settings, solver="Radau", rtol=1e-8, atol=1e-8))
    stiff = SceneEnsemble(radau, [{}])
    stiff.start, stiff.parameters, stiff.scenes = several.start, several.parameters, several.scenes
    found = stiff.run()
    assert found.single.all()
    np.testing.assert_allclose(found.event_time, single.event_time, rtol=0, atol=1e-4)
