"""Extremes of observed quantities along runs, in lanes and of single runs, against many samples of lone runs."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bellcrank.dynamics.equations.system import system_of
from bellcrank.scene.scene import load_scene
from bellcrank.simulation.integration import ensemble
from tests.support.scene_ensemble import SceneEnsemble, assert_equal_rows

SCENES = {
    "spring_pendulum": [{"initial.swing": f"{angle} deg"} for angle in (45, 30, 52.5, 61)],
    "four_bar": [{"parameters.crank_length": length} for length in (1.241, 1.25, 1.22, 1.28)],
    "rolling_disk": [{"base.angular_velocity": [f"{spin} deg/s", "200 deg/s", 0.0]} for spin in (100, 120, 90, 70)],
    "planar_2r_swing": [{"initial.elbow": f"{angle} deg"} for angle in (45, 30, 52, 61)],
}


@cache
def scene_ensemble(name: str, solver: str = "DOP853", tolerance: float = 1e-9) -> SceneEnsemble:
    scene = load_scene(name)
    duration = 3.0 if name == "planar_2r_swing" else scene.settings.duration  # it is chaotic
    settings = {"simulate.solver": solver, "simulate.rtol": tolerance, "simulate.atol": tolerance}
    return SceneEnsemble(scene.with_overrides(settings | {"simulate.duration": duration}), SCENES[name])


def observed(ensemble_: SceneEnsemble, row: int, times: object) -> np.ndarray:
    """The quantities (k, m) at times of a lone run."""
    run, system = ensemble_.lone(row, times), system_of(ensemble_.scene)
    parameters = np.tile(run.parameters, (len(run.time), 1))
    values = system.observe(run.time[:, None], run.state, run.scene.signals_at(run.time), parameters)
    return np.atleast_2d(values)


def energy_columns(ensemble_: SceneEnsemble) -> list[int]:
    """Which outputs are energies."""
    outputs = ensemble_.scene.outputs.items()
    return [k for k, name in enumerate(name for name, o in outputs for _ in o.quantity.suffixes()) if name == "energy"]


def extremes(samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least and largest of samples (k, m) at equal distances, by parabolas through three of them."""
    middle, slope = samples[1:-1], samples[2:] - samples[:-2]
    bend = samples[2:] + samples[:-2] - 2 * middle
    with np.errstate(divide="ignore", invalid="ignore"):
        top = np.where(np.abs(slope) < 2 * np.abs(bend), middle - slope**2 / (8 * bend), middle)
    values = np.vstack([samples, top])
    return values.min(axis=0), values.max(axis=0)


@pytest.mark.tier2
@pytest.mark.parametrize("lanes", [True, False])
@pytest.mark.parametrize("name", SCENES)
def test_extremes_of_outputs_are_those_of_100001_samples_within_the_tolerance(name, lanes, monkeypatch):
    if not lanes:
        monkeypatch.setattr(ensemble, "_lane_kernels", lambda *_: None)
    runs = scene_ensemble(name)
    found, layout = runs.run(), system_of(runs.scene).observed_layout
    within = layout.outputs
    assert within > 0 and (found.single == (not lanes)).all()
    for row in range(len(runs.scenes)):
        everything = observed(runs, row, np.linspace(0.0, float(found.end_time[row]), 100_001))
        samples, energies = everything[:, :within], everything[:, layout.energies]
        size = np.abs(samples).max(axis=0)
        size[energy_columns(runs)] = np.abs(energies).max()  # kinetic and potential energy may cancel
        tolerance = 5e-9 * (1 + size)  # the run's is 1e-9 in each of some hundred steps
        least, largest = extremes(samples)
        np.testing.assert_array_less(np.abs(found.least[row, :within] - least), tolerance)
        np.testing.assert_array_less(np.abs(found.largest[row, :within] - largest), tolerance)


@pytest.mark.parametrize("name", ["spring_pendulum", "rolling_disk"])
@pytest.mark.parametrize("solver", ["RK45", "Radau", "DOP853"])
def test_extremes_at_loose_tolerances_are_those_of_samples_within_it(name, solver):
    runs = scene_ensemble(name, solver, 1e-5)
    found, within = runs.run(), system_of(runs.scene).observed_layout.outputs
    assert (found.single == (solver == "Radau")).all()
    samples = observed(runs, 0, np.linspace(0.0, float(found.end_time[0]), 20_001))[:, :within]
    tolerance = 30 * 1e-5 * (1 + np.abs(samples).max(axis=0))
    np.testing.assert_array_less(np.abs(found.least[0, :within] - samples.min(axis=0)), tolerance)
    np.testing.assert_array_less(np.abs(found.largest[0, :within] - samples.max(axis=0)), tolerance)


@pytest.mark.parametrize("name", SCENES)
def test_quantities_of_the_whole_run_are_looked_at_at_the_ends_of_its_steps(name):
    runs = scene_ensemble(name)
    found, layout = runs.run(), system_of(runs.scene).observed_layout
    for row in range(len(runs.scenes)):
        ends = observed(runs, row, "steps")[:, layout.energies]
        if found.stopped_by[row] >= 0:
            event = system_of(runs.scene).observe(
                found.end_time[row : row + 1], found.end_state[row], np.empty(0), runs.parameters[row]
            )
            ends = np.vstack([ends, event[layout.energies]])
        tolerance = 1e-6 * (1 + np.abs(ends).max(axis=0))  # steps end at times that differ by some 1e-7 s
        np.testing.assert_array_less(np.abs(found.least[row, layout.energies] - ends.min(axis=0)), tolerance)
        np.testing.assert_array_less(np.abs(found.largest[row, layout.energies] - ends.max(axis=0)), tolerance)


def test_a_quantity_that_is_no_number_somewhere_has_no_extremes_and_others_have():
    outputs = {
        "root": {"expression": "sqrt(shoulder.position+1.2)"},
        "angle": {"expression": "shoulder.position"},
        "corner": {"expression": "abs(shoulder.position+1.5)"},
    }
    scene = load_scene("planar_2r_swing").with_overrides({"outputs": outputs, "simulate.duration": 3.0})
    runs = SceneEnsemble(scene, [{"initial.elbow": f"{angle} deg"} for angle in (45, 30, 52, 61)])
    found = runs.run()
    assert np.isnan(found.least[:, 0]).all() and np.isnan(found.largest[:, 0]).all()
    assert np.isfinite(found.least[:, 1:3]).all() and np.isfinite(found.largest[:, 1:3]).all()
    crossed = (found.least[:, 1] < -1.5) & (found.largest[:, 1] > -1.5)
    assert crossed.any()
    assert (found.least[crossed, 2] >= 0).all() and (found.least[crossed, 2] < 1e-8).all()  # the kink's tip


def test_extremes_do_not_depend_on_neighbours_order_or_threads():
    for name in SCENES:
        runs = scene_ensemble(name)
        whole = runs.run()
        for rows in (slice(0, 1), slice(1, 4), [3, 1, 0, 2]):
            assert_equal_rows(runs.run(rows), whole, rows)
        assert_equal_rows(runs.run(threads=2), whole)


def test_an_extremum_within_a_long_step_is_that_of_the_closed_form():
    """A pendulum that swings freely from rest reaches its depth between the ends of steps: E = V there."""
    scene = load_scene("spring_pendulum")
    changes = {"outputs": {"extension": {"expression": "slide.position"}}, "initial.swing": "0 deg"}
    changes |= {"initial.velocity.swing": 0.0, "initial.velocity.slide": 0.3}
    runs = SceneEnsemble(replace(scene.with_overrides(changes)), [{}])
    found = runs.run()
    stiffness, rest, mass, gravity = 15.0, 5.0, 2.0, 9.81
    middle, speed = rest + mass * gravity / stiffness, np.sqrt(stiffness / mass)
    amplitude = np.hypot(middle - 5.0, 0.3 / speed)
    assert found.largest[0, 0] == pytest.approx(middle + amplitude, rel=1e-9)
    assert found.least[0, 0] == pytest.approx(middle - amplitude, rel=1e-9)


@pytest.mark.parametrize("tolerance", [1e-10, 1e-6, 1e-4])
def test_no_extremum_is_missed_near_the_ends_of_steps(tolerance):
    """Random swings: where a quantity turns just before a step's end, its curvature there is not underestimated."""
    random = np.random.default_rng(11)
    settings = {"simulate.rtol": tolerance, "simulate.atol": tolerance, "simulate.duration": 6.0}
    starts = [*random.uniform([0.05, -1.0], [1.2, 1.0], (40, 2)).tolist(), [np.deg2rad(21.10236453), 0.2]]
    runs = SceneEnsemble(
        load_scene("spring_pendulum").with_overrides(settings),
        [{"initial.swing": angle, "initial.velocity.swing": rate} for angle, rate in starts],
    )
    found, within = runs.run(), system_of(runs.scene).observed_layout.outputs
    for row in range(len(starts)):
        samples = observed(runs, row, np.linspace(0.0, 6.0, 8001))[:, :within]
        allowed = 20 * tolerance * (1 + np.abs(samples).max(axis=0))
        np.testing.assert_array_less(found.least[row, :within] - samples.min(axis=0), allowed)
        np.testing.assert_array_less(samples.max(axis=0) - found.largest[row, :within], allowed)
