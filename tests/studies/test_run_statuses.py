"""Statuses and reasons of designs that do not go as planned, against those of their runs by `simulate`."""

import math

import numpy as np
import pytest
from lone_designs import check, check_statuses, lone, runner, statuses

import bellcrank as bc
from bellcrank.motion.motion import Motion
from bellcrank.motion.sampled.csv_file import write_motion
from bellcrank.simulation.integration import ensemble

ARM = "urdf: planar_2r\ngravity: [0, -9.81, 0]\n"


def scene_of(folder, text):
    (folder / "scene.yaml").write_text(ARM + text, encoding="utf-8")
    return bc.load_scene(folder / "scene.yaml")


def test_designs_whose_evaluations_are_spent():
    found, values = runner("pendulum", simulate__max_evaluations=[50, 100000])
    columns = check(found, values, 1e-6)  # the steps, sized by small error estimates, differ by their roundings
    assert statuses(columns) == ["evaluations_spent", "finished"]
    assert "raise max_evaluations" in columns.reasons[0]


def test_designs_whose_accelerations_become_infinite():
    found, values = runner(
        bc.load_scene("planar_2r_swing", {"simulate.rtol": 1.0, "simulate.atol": 1e300, "simulate.duration": 7.0}),
        initial__shoulder=[100.0, 0.0],
    )
    columns = found.run(values)
    status, reason, measures = lone(found, values[0])
    assert status == statuses(columns)[0] == "non_finite" and reason == columns.reasons[0]
    assert columns.measures["end.time"][0] == pytest.approx(measures["end.time"], abs=1.0)


def test_the_cause_of_every_run_that_is_no_longer_finite_is_named(tmp_path):
    scene = scene_of(
        tmp_path,
        "initial: {shoulder: 0.3, elbow: 0.4}\nsimulate: {duration: 0.2}\nconstraints: [{kind: expression, name: own, "
        "unit: rad, expression: sqrt(0.05 - t) * (shoulder.position - 0.3)}]\n",
    )
    found, values = runner(scene, simulate__duration=["0.02 s", "0.1 s", "0.2 s"], initial__elbow=[0.4, 0.4, 0.5])
    columns = check_statuses(found, values)
    assert statuses(columns) == ["finished", "non_finite", "non_finite"]
    assert all(text.startswith("constraint 'own' is not finite") for text in columns.reasons.values())
    np.testing.assert_allclose(columns.measures["end.time"][1:], 0.05, rtol=0, atol=1e-6)


def test_a_measure_that_is_not_a_number_makes_the_design_unknown(tmp_path):
    scene = scene_of(
        tmp_path,
        "initial: {shoulder: 1.5, elbow: 0}\nsimulate: {duration: 0.01}\n"
        "outputs: {root: {expression: sqrt(shoulder.position), unit: '1'}}\n",
    )
    found, values = runner(scene, initial__shoulder=[-1.5, 1.5])
    columns = check_statuses(found, values)
    assert statuses(columns) == ["unknown", "finished"]
    assert columns.reasons[0] == "'end.root' and 2 more not a finite number"
    assert columns.measures["end.root"][0] == math.inf and columns.measures["end.root"][1] < 1.3


def test_a_target_event_without_a_value_makes_the_design_unknown(tmp_path):
    scene = scene_of(
        tmp_path,
        "initial: {shoulder: 1.5, elbow: 0}\nsimulate: {duration: 0.01}\n"
        "events: [{name: aim, when: {expression: sqrt(shoulder.position) - 5}, stop: true}]\n",
    )
    found, values = runner(scene, initial__shoulder=[-1.5, 1.5])
    columns = check_statuses(found, values)
    assert statuses(columns) == ["unknown", "finished"]
    assert columns.reasons == {
        0: "no event 'aim' within 0.01 s; the function of event 'aim' not a finite number",
        1: "no event 'aim' within 0.01 s",
    }


@pytest.mark.tier2
def test_an_event_that_is_no_target_ends_a_run_with_a_reason():
    scene = bc.load_scene(
        "four_bar", {"events": [{"name": "near", "when": {"singular_constraints": 0.4}, "stop": True}]}
    )
    found, values = runner(scene, crank_length=[1.22, 1.241])
    columns = check(found, values, 1e-9)
    assert set(statuses(columns)) == {"event"}
    assert all(reason.startswith("event 'near' ended the run at ") for reason in columns.reasons.values())


def test_a_prescribed_motion_that_ends_moving_ends_the_run_there(tmp_path):
    arm = bc.load_robot("planar_2r", gravity=(0, -9.81, 0))
    t = np.linspace(0.0, 2.0, 21)
    unit = np.array([0.65, 0.0])
    motion = Motion(arm.joints, t, 0.5 * t[:, None] ** 2 * unit, t[:, None] * unit, np.tile(unit, (21, 1)), "spin")
    write_motion(motion, tmp_path / "spin.csv")
    scene = scene_of(
        tmp_path,
        "initial: {elbow: 0.4}\nmotions: {spin: {kind: csv, file: spin.csv}}\nsimulate: {duration: 3, samples: 31}\n"
        "constraints: [{kind: prescribed_motion, name: motor, joint: shoulder, motion: spin}]\n",
    )
    found, values = runner(scene, simulate__duration=["1 s", "2 s", "3 s"], initial__elbow=[0.4, 0.4, 0.5])
    columns = check(found, values, 1e-8)
    assert statuses(columns) == ["finished", "finished", "prescribed_motion_ended"]
    assert columns.measures["end.time"].tolist() == [1.0, 2.0, 2.0]
    assert "motion 'spin' of constraint 'motor' ends at 2 s" in columns.reasons[2]


def test_a_design_whose_hinge_turns_over_is_its_run_until_then(monkeypatch):
    scene = bc.load_scene("bricard", {"simulate.duration": 0.5, "simulate.samples": 7})
    cosines = slice(*found_cosines(scene))

    engine = ensemble.integrate_in_lanes

    def turned(problem):
        result = engine(problem)
        result["least"][1, cosines] = -0.5
        return result

    over = np.where(np.arange(7) < 4, 1.0, -1.0)[:, None]
    monkeypatch.setattr(ensemble, "integrate_in_lanes", turned)
    monkeypatch.setattr("bellcrank.simulation.integration.integration.alignment_cosines_along", lambda *_: over)
    found, values = runner(scene, simulate__rtol=[1e-8, 1e-9, 1e-10])
    columns = found.run(values)
    assert statuses(columns) == ["finished", "turned_over", "finished"]
    assert "constraint 'last_hinge'" in columns.reasons[1]
    assert columns.measures["end.time"].tolist() == [0.5, 0.25, 0.5]


def found_cosines(scene):
    from bellcrank.dynamics.equations.system import system_of

    places = system_of(scene).observed_layout.cosines
    return places.start, places.stop
