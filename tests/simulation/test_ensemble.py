"""Ensembles of scenes: every run against its lone run, with constraints, signals, events and reasons to end."""

import subprocess
import sys
import textwrap

import numpy as np
import pytest
from scene_ensemble import SceneEnsemble, assert_equal_rows

from bellcrank import _step
from bellcrank.codegen import llvm as machine
from bellcrank.scene.scene import load_scene
from bellcrank.simulation.integration.statistics import Status

STATUSES = tuple(Status)
PICK = {"control.motors": {"kind": "pd", "motion": "pick", "kp": 8, "kd": 0.3}}
TIGHT = {"rtol": 1e-10, "atol": 1e-10}


def varied(name, ranges, rows=26, seed=0, changes=None, **settings):
    """A scene with random values of some paths: {path: (least, largest, unit)}; `changes` are those of all."""
    common = {f"simulate.{key}": value for key, value in (TIGHT | settings).items()}
    random = np.random.default_rng(seed)
    overrides = [
        {path: f"{random.uniform(low, high):.17g} {unit}".strip() for path, (low, high, unit) in ranges.items()}
        for _ in range(rows)
    ]
    return SceneEnsemble(load_scene(name).with_overrides(common | (changes or {})), overrides)


ELBOW = {"initial.shoulder": (-120, -60, "deg"), "initial.elbow": (0, 90, "deg")}
MOTORS = {"initial.left_motor": (105, 115, "deg"), "initial.right_motor": (90, 100, "deg")}
# scene, what varies, settings, and the difference of end states to which errors of 1e-10 a step can grow
CASES = {
    "pendulum": ("pendulum", {"initial.swing": (-90, 60, "deg")}, {"duration": 5.0}, 1e-7),
    "spring_pendulum": ("spring_pendulum", {"initial.slide": (4, 6, "m")}, {"duration": 4.0}, 1e-7),
    "swing": ("planar_2r_swing", ELBOW, {"duration": 3.0}, 1e-7),
    "swing RK45": ("planar_2r_swing", ELBOW, {"duration": 2.0, "solver": "RK45"}, 1e-6),
    "swing RK4": ("planar_2r_swing", ELBOW, {"duration": 2.0, "solver": "RK4", "step": 0.001}, 1e-12),
    "tracking": ("planar_2r_tracking", {"parameters.mass_error": (-20, 20, "%")}, {"duration": 1.5}, 1e-7),
    "five_bar": ("five_bar", MOTORS, {"duration": 0.5}, 1e-6),
    "five_bar picks": ("five_bar", MOTORS, {"duration": 0.8, "changes": PICK}, 1e-6),
    "four_bar": ("four_bar", {"parameters.crank_length": (1.2, 1.3, "")}, {}, 1e-6),
    "four_bar RK45": ("four_bar", {"parameters.crank_length": (1.2, 1.3, "")}, {"solver": "RK45"}, 1e-5),
    "four_bar Baumgarte": (
        "four_bar", {"parameters.crank_length": (1.2, 1.3, "")},
        {"stabilisation": {"kind": "baumgarte", "alpha": 5, "beta": 5}, "duration": 5.0}, 1e-6,
    ),
    # constraints that lose rank at some postures, or everywhere
    "n_four_bar": ("n_four_bar_2", {"initial.velocity.crank_0": (-1.2, -0.8, "rad/s")}, {"duration": 4.0}, 1e-6),
    "bricard": ("bricard", {}, {"duration": 1.0}, 1e-7),
    "two_wheeler": ("two_wheeler", {"base.position.1": (-1, 1, "m")}, {"duration": 3.0}, 1e-7),
    "rolling_disk": ("rolling_disk", {"base.angular_velocity.2": (150, 250, "deg/s")}, {"duration": 2.0}, 1e-6),
}  # fmt: skip


@pytest.mark.tier2
@pytest.mark.parametrize("case", CASES)
def test_every_run_is_its_lone_run(case):
    name, ranges, settings, tolerance = CASES[case]
    ensemble = varied(name, ranges, **settings)
    found = ensemble.run()
    assert found.done.all() and not found.single.any()
    for row in range(len(ensemble.scenes)):
        run = ensemble.lone(row)
        assert STATUSES[found.status[row]] is run.status
        assert abs(found.end_time[row] - run.time[-1]) < tolerance
        np.testing.assert_allclose(found.end_state[row], run.state[-1], atol=tolerance)
        if case != "n_four_bar":  # where it lies flat, rounding decides on the number of steps
            assert abs(found.accepted[row] - run.statistics.steps) <= 2 + 0.06 * run.statistics.steps
    assert_equal_rows(ensemble.run(threads=2), found)
    assert_equal_rows(ensemble.run(slice(5, 8)), found, slice(5, 8))
    order = np.random.default_rng(1).permutation(len(ensemble.scenes))
    assert_equal_rows(ensemble.run(order), found, order)


@pytest.mark.parametrize("target", ["avx2", "baseline"])
def test_narrower_lanes_agree(target, monkeypatch):
    ensemble = varied("four_bar", {"parameters.crank_length": (1.2, 1.3, "")}, rows=11)
    wide = ensemble.run()
    monkeypatch.setenv("BELLCRANK_TARGET", target)
    found = ensemble.run()
    np.testing.assert_array_equal(found.status, wide.status)
    np.testing.assert_allclose(found.end_state, wide.end_state, atol=1e-7)
    assert_equal_rows(ensemble.run(slice(3, 6), threads=2), found, slice(3, 6))


def test_radau_runs_are_lone_runs_to_the_bit():
    ensemble = varied("spring_pendulum", {"initial.slide": (4, 6, "m")}, rows=9, duration=2.0, solver="Radau")
    found = ensemble.run(threads=2, observe=False)  # observing costs evaluations within steps
    assert found.single.all() and found.done.all()
    for row in range(9):
        run = ensemble.lone(row)
        assert STATUSES[found.status[row]] is run.status
        np.testing.assert_array_equal(found.end_state[row], run.state[-1])
        assert found.evaluations[row] == run.statistics.evaluations


def test_where_constraints_of_some_runs_lose_rank_the_neighbours_do_not_notice():
    """Slow cranks do not come to the posture in which the linkage lies flat before the end of the run."""
    ensemble = varied("n_four_bar_2", {"initial.velocity.crank_0": (-1.2, -0.001, "rad/s")}, rows=21, duration=0.8)
    found = ensemble.run()
    flat = found.end_state[:, 0] < -np.pi / 2
    assert 0 < flat.sum() < 21
    for row in range(21):
        assert_equal_rows(ensemble.run(slice(row, row + 1)), found, slice(row, row + 1))


def test_too_wide_lanes_are_not_claimed():
    assert _step.has_lanes(2) and not _step.has_lanes(3) and not _step.has_lanes(16)
    assert _step.has_lanes(machine.target().lanes)


@pytest.mark.tier2
def test_ctrl_c_keeps_the_runs_that_are_done():
    code = """
        import os, signal, threading
        import numpy as np
        import bellcrank as bc
        from bellcrank.dynamics.postures.consistent_start import consistent_start
        from bellcrank.dynamics.equations.system import system_of, system_parameters
        from bellcrank.simulation.integration.ensemble import EnsembleStarts, integrate_ensemble

        scene = bc.load_scene("planar_2r_swing")
        rows = 200_000
        start = np.tile(np.concatenate([*consistent_start(scene), np.zeros(int(system_of(scene).has_work))]), (rows, 1))
        starts = EnsembleStarts(
            parameters=np.tile(system_parameters(scene), (rows, 1)), start=start, duration=np.full(rows, 10.0)
        )
        called = []

        def progress(done):
            called.append(done)
            if done and len(called) > 2:
                os.kill(os.getpid(), signal.SIGINT)

        found = integrate_ensemble(scene, starts, threads=2, progress=progress)
        assert 0 < found.done.sum() < rows, found.done.sum()
        assert len(set(found.end_state[found.done, 0])) == 1
        assert np.isnan(found.end_state[~found.done]).all()
        print("interrupted")
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, check=False)
    assert done.stdout == "interrupted\n", done.stderr
