"""Baumgarte's gains: what automatic_gains.py claims of drift, order and work, on the 4-bar and the rolling disk."""

import json
from dataclasses import replace

import numpy as np
import pytest

from bellcrank import InputError
from bellcrank.cli import main
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.scene.settings import Settings, Stabilisation
from bellcrank.simulation.integration.automatic_gains import PER_RATE, automatic_gains, drift_bound
from bellcrank.simulation.simulate import simulate
from bellcrank_bench.measurements import gain_map
from bellcrank_bench.measurements.gain_map import stabilised

SCENES = {"four_bar": 12.0, "rolling_disk": 10.0}
NONE, PROJECTION = Stabilisation("none"), Stabilisation("projection")


@pytest.fixture(scope="module", params=SCENES)
def scene(request: pytest.FixtureRequest) -> Scene:
    loaded = load_scene(request.param)
    return replace(loaded, settings=replace(loaded.settings, duration=SCENES[request.param]))


@pytest.fixture(scope="module")
def four_bar() -> Scene:
    return load_scene("four_bar")


def run(scene, stabilisation, solver="DOP853", tolerance=1e-9, **more):
    return simulate(
        stabilised(scene, stabilisation), solver=solver, rtol=tolerance, atol=tolerance, times="steps", **more
    )


def test_constraints_drift_without_stabilisation_and_not_with_projection():
    disk = load_scene("rolling_disk")
    drift = [run(disk, NONE, duration=t).constraint_residual() for t in (10.0, 40.0)]
    assert drift[0] > 3e-8  # m, at tolerances of 1e-9
    assert drift[1] > 4.0 * drift[0]  # errors of φ̇ add up in φ: faster than in proportion to time
    assert run(disk, PROJECTION, duration=40.0).constraint_residual() < 1e-12


@pytest.mark.parametrize("solver", ["RK45", "DOP853"])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
def test_automatic_gains_close_to_ten_tolerances_at_twice_the_evaluations_pilot_included(scene, solver, tolerance):
    settings = replace(scene.settings, solver=solver, rtol=tolerance, atol=tolerance)
    gains = automatic_gains(scene, settings)
    mine, plain = (run(scene, kind, solver, tolerance) for kind in (gains.stabilisation, NONE))
    assert mine.status.success
    assert mine.constraint_residual() <= 10.0 * tolerance
    assert mine.statistics.evaluations + gains.evaluations <= 2.0 * plain.statistics.evaluations


@pytest.mark.parametrize("solver", ["RK45", "DOP853"])
def test_a_redundant_ring_closes_to_the_tolerance_at_twice_the_evaluations_and_to_rounding_at_none(solver):
    ring = load_scene("bricard")
    gains = automatic_gains(ring, replace(ring.settings, solver=solver, rtol=1e-9, atol=1e-9))
    plain, mine, projected = (run(ring, kind, solver) for kind in (NONE, gains.stabilisation, PROJECTION))
    assert plain.constraint_residual() > 1e-9
    assert mine.constraint_residual() <= 2e-9  # 0.8 to 1.4 of the tolerance, as rounding has it
    assert mine.statistics.evaluations + gains.evaluations <= 2.0 * plain.statistics.evaluations
    assert projected.constraint_residual() < 1e-13
    assert projected.statistics.evaluations <= 1.02 * plain.statistics.evaluations


def test_constraints_keep_order_four_of_RK4_with_automatic_gains_and_fall_to_two_where_gains_follow_the_step(four_bar):
    gains = automatic_gains(four_bar).stabilisation
    times = np.linspace(0.0, 12.0, 21)
    tight = {"rtol": 1e-13, "atol": 1e-13, "times": times}
    reference = simulate(stabilised(four_bar, PROJECTION), solver="DOP853", **tight).position

    def orders(stabilisation_of):
        errors = []
        for n in (480, 960):
            scene = stabilised(four_bar, stabilisation_of(12.0 / n))
            found = simulate(scene, 12.0, "RK4", step=12.0 / n, times="steps")
            errors.append((found.constraint_residual(), np.abs(found.position[:: n // 20] - reference).max()))
        return np.log2(np.array(errors[0]) / np.array(errors[1]))

    assert orders(lambda h: gains) == pytest.approx([4.0, 4.0], abs=0.25)
    assert orders(lambda h: Stabilisation("baumgarte", 1.0 / h, 1.0 / h)) == pytest.approx([2.0, 2.0], abs=0.25)


@pytest.mark.tier2
def test_the_gains_at_which_work_doubles_are_those_of_the_motion_for_every_tolerance(scene):
    gains = automatic_gains(scene).alpha
    places = np.geomspace(gains, 200.0 * gains, 16)
    bends = []
    for tolerance in (1e-6, 1e-9, 1e-12):
        plain = run(scene, NONE, tolerance=tolerance).statistics.evaluations
        work = [run(scene, Stabilisation("baumgarte", a, a), tolerance=tolerance) for a in places]
        ratio = np.maximum.accumulate([w.statistics.evaluations / plain for w in work])
        bends.append(float(np.interp(2.0, ratio, places)))
        assert ratio[-1] > 5.0
    assert max(bends) < 2.0 * min(bends)  # while the step changes four- to fivefold


@pytest.mark.parametrize(("solver", "exponent"), [("RK45", 0.6), ("DOP853", 0.75)])
def test_work_above_the_bend_grows_as_the_order_of_the_error_estimate_says_or_faster_up_to_in_proportion(
    scene, solver, exponent
):
    alpha = automatic_gains(scene).alpha * np.array([16.0, 64.0])
    work = [run(scene, Stabilisation("baumgarte", a, a), solver).statistics.evaluations for a in alpha]
    assert exponent - 0.1 < np.log(work[1] / work[0]) / np.log(4.0) < 1.05


def test_drift_stays_below_the_bound_from_tolerance_step_and_gains(scene):
    for factor in (1.0, 10.0):
        alpha = factor * automatic_gains(scene).alpha
        found = run(scene, Stabilisation("baumgarte", alpha, alpha))
        step = found.time[-1] / found.statistics.steps
        assert found.constraint_residual() < drift_bound(alpha, alpha, 1e-9, step)


def test_larger_gains_leave_less_drift_until_the_rate_of_the_motion_and_more_beyond_for_RK4():
    disk = load_scene("rolling_disk")
    gains = automatic_gains(disk).alpha

    def drift(alpha):
        scene = stabilised(disk, Stabilisation("baumgarte", alpha, alpha))
        return simulate(scene, solver="RK4", step=0.0025, times="steps").constraint_residual()

    at = drift(gains)
    assert drift(0.1 * gains) > 10.0 * at
    assert drift(40.0 * gains) > 10.0 * at
    assert simulate(stabilised(disk, NONE), solver="RK4", step=0.0025, times="steps").constraint_residual() > 300.0 * at


def test_gains_double_where_the_motion_is_twice_as_fast():
    slow = load_scene("rolling_disk")  # its spin alone sets how fast: g must follow as its square
    fast = slow.with_overrides(
        {"gravity": [0.0, 0.0, -4 * 9.81], "base.angular_velocity": ["200 deg/s", "400 deg/s", 0.0]}
    )
    one = automatic_gains(slow, replace(slow.settings, duration=10.0))
    two = automatic_gains(fast, replace(fast.settings, duration=5.0))
    # not exactly: the pilot's absolute tolerance weighs less on velocities that are twice as large
    assert two.rate == pytest.approx(2.0 * one.rate, rel=0.25)
    assert two.alpha == pytest.approx(PER_RATE * two.rate)
    assert one.alpha == one.beta


@pytest.mark.parametrize("settings", [{"rtol": 1e-6, "atol": 1e-9}, {"solver": "RK45"}, {"rtol": 1e-3, "atol": 1e-3}])
def test_gains_hardly_depend_on_solver_and_tolerances(settings):
    disk = load_scene("rolling_disk")
    plain, other = (automatic_gains(disk, replace(Settings(duration=10.0), **s)) for s in ({}, settings))
    assert other.alpha == pytest.approx(plain.alpha, rel=0.3)


def test_gains_stay_stable_on_a_fixed_step_too_coarse_for_the_motion():
    disk = load_scene("rolling_disk")
    settings = replace(disk.settings, duration=10.0, solver="RK4", step=0.25)
    assert automatic_gains(disk, settings).alpha == 4.0


def test_radau_takes_automatic_gains_at_the_evaluations_of_none(scene):
    gains = automatic_gains(scene).stabilisation
    mine, plain = (run(scene, kind, "Radau", 1e-6) for kind in (gains, NONE))
    assert mine.statistics.evaluations <= 1.2 * plain.statistics.evaluations
    assert mine.constraint_residual() <= 1e-5


def test_a_tree_has_no_gains_to_choose():
    with pytest.raises(InputError, match="this scene has no constraints, so there is nothing to stabilise"):
        automatic_gains(load_scene("planar_2r_swing"))


@pytest.mark.tier2
def test_the_maps_are_printed_and_written(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(gain_map, "CASES", gain_map.CASES[:1])
    monkeypatch.setattr(gain_map, "FACTORS", (0.1, 1.0, 1000.0))
    assert main(["bench", "--gains", "--out", str(tmp_path)]) == 0
    table = capsys.readouterr().out
    assert "DOP853, 1e-09           projection" in table and "with pilot" in table
    (found,) = json.loads((tmp_path / "gains.json").read_text())["scenes"]
    assert found["scene"] == "four_bar" and len(found["grid"]) == 3 * 9
    wild = [p for p in found["grid"] if p["solver"] == "RK4" and p["alpha"] * found["step"] > 5.0]
    assert wild and all(p["residual"] is None for p in wild)  # beyond the border of stability
    for kind in ("map", "slices"):
        assert (tmp_path / f"gain_{kind}_four_bar.png").read_bytes().startswith(b"\x89PNG")
