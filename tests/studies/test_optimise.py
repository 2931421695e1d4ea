"""The best design of a scene: optima against closed forms, gradients against differences, bad input in one sentence."""

import json
from functools import cache

import numpy as np
import pytest
from tutorial_designs import arm_rivals, lock_rivals

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.errors import BellcrankError, InputError
from bellcrank.studies.optimisation.gradients import Gradients
from bellcrank.studies.optimisation.request import Request, plan_search
from bellcrank.studies.results.exceedance import parse_limit

LENGTHS = {"crank_length": (1.2, 1.24), "rocker_length": (1.2, 1.24)}
SMALL = {"samples": 32, "starts": 2, "threads": 1}


@cache
def balanced() -> bc.results.Optimum:
    return bc.optimise("balanced_arm", **SMALL)


def lock_angle(ground: float, crank: float, outstretched: float) -> float:
    """The crank's angle where coupler and rocker are in line: the law of cosines in their triangle."""
    return float(np.arccos((ground**2 + crank**2 - outstretched**2) / (2.0 * ground * crank)))


def test_the_lock_angle_of_a_four_bar_is_that_of_the_law_of_cosines_with_its_multipliers() -> None:
    best = bc.optimise("four_bar", LENGTHS, minimise="lock.crank", limits="lock.time <= 15 s", **SMALL)
    assert best.converged and best.gradients == {"lock.crank": "exact", "lock.time": "exact"}
    crank, rocker = best.values["crank_length"], best.values["rocker_length"]
    assert best.objective == pytest.approx(lock_angle(1.241, crank, 1.2 + rocker), abs=1e-7)
    step = 1e-6  # the least angle over designs that lock in time, at limits that differ a little
    nearby = [
        bc.optimise("four_bar", LENGTHS, minimise="lock.crank", limits=f"lock.time <= {15.0 + side} s", **SMALL)
        for side in (-1e4 * step, 1e4 * step)
    ]
    slope = (nearby[1].objective - nearby[0].objective) / (2e4 * step)
    active = {name: value for name, value in best.multipliers.items() if name.startswith("lock.time")}
    if active:
        assert next(iter(active.values())) == pytest.approx(slope, rel=1e-3)
    else:
        assert slope == 0.0


def test_a_limit_with_an_equal_sign_is_kept_and_its_multiplier_is_the_slope_of_the_optimum() -> None:
    found = [
        bc.optimise("four_bar", LENGTHS, minimise="lock.time", limits=f"lock.crank = {angle} deg", **SMALL)
        for angle in (154.9, 155.0, 155.1)
    ]
    assert all(best.converged for best in found)
    best = found[1]
    assert np.rad2deg(best.measures["lock.crank"]) == pytest.approx(155.0, abs=1e-6)
    assert best.active_limits == (str(parse_limit("lock.crank = 155 deg", {"lock.crank": "rad"}, kept=True)),)
    slope = (found[2].objective - found[0].objective) / np.deg2rad(0.2)
    assert best.multipliers[best.active_limits[0]] == pytest.approx(slope, rel=1e-3)


@pytest.mark.tier2
def test_a_peak_that_changes_places_ends_where_two_maxima_are_equal() -> None:
    best = balanced()
    assert best.converged and best.residual < 1e-9 and best.gradients == {"shoulder.peak_torque": "exact"}
    sizing = bc.size(best.scene)
    shoulder = sizing.joint("shoulder")
    assert best.objective == pytest.approx(shoulder.peak_torque, rel=1e-9)
    assert shoulder.max_torque == pytest.approx(-shoulder.min_torque, rel=1e-6)
    assert best.at_bounds == {"upper_arm": "lower"}
    shorter = bc.optimise("balanced_arm", {"spring_preload": (0, 400), "spring_stiffness": (0, 400)},
                          overrides={"upper_arm": 0.901}, **SMALL)  # fmt: skip
    slope = (shorter.objective - best.objective) / 0.001
    assert best.multipliers["upper_arm lower"] == pytest.approx(slope, rel=1e-3)


@pytest.mark.tier2
@pytest.mark.parametrize("rivals", [lock_rivals, arm_rivals])
def test_no_random_design_beats_an_optimum_of_the_tutorial(rivals) -> None:
    found = rivals(500, 7)
    assert found.best.converged and found.best.residual < 1e-6
    assert np.isfinite(found.objective).sum() > 50 and found.beaten == 0


@pytest.mark.parametrize(
    ("scene", "size", "vary", "measures"),
    [
        ("four_bar", False, LENGTHS, ("lock.time", "lock.crank", "lock.coupler.velocity")),
        ("balanced_arm", True, None, ("shoulder.peak_torque", "elbow.rms_torque")),
    ],
)
def test_exact_gradients_are_those_of_differences(scene, size, vary, measures) -> None:
    limits = [f"{name} <= 1e6" for name in measures[1:]]
    asked = Request(vary, minimise=measures[0], limits=limits, size=size)
    problem, _, _ = plan_search(bc.load_scene(scene), asked)
    point = np.full(len(problem.variables), 0.4)
    if scene == "four_bar":
        point = np.array([0.98, 0.02])  # far from the outstretched crank, where the lock's angle has a square root
    values = problem.run(point[None])[0]
    exact, differences = Gradients(problem), Gradients(problem)
    assert exact.exact == set(measures)
    differences.exact = frozenset()
    pairs = zip(exact.at([point], [values])[0], differences.at([point], [values])[0], strict=True)
    for mine, theirs in pairs:
        top = max(mine, key=lambda row: row.value)
        assert top.value == pytest.approx(theirs[0].value, rel=1e-12)
        scale = np.abs(theirs[0].gradient).max()
        # A speed near a dead point magnifies the tolerance of the runs, 1e-10, about 1e5 times.
        assert np.abs(top.gradient - theirs[0].gradient).max() < (1e-5 if scene == "four_bar" else 1e-7) * scale


def test_the_answer_does_not_depend_on_threads_and_the_seed_decides_it() -> None:
    first, second = (
        bc.optimise("four_bar", LENGTHS, minimise="lock.time", samples=16, starts=2, seed=3, threads=threads)
        for threads in (1, 3)
    )
    assert first.as_dict() == second.as_dict()


@pytest.mark.tier2
def test_the_answer_on_dask_workers_is_that_of_threads() -> None:
    asked = {"minimise": "cycle_time", "fastest": True, "samples": 8, "starts": 2}
    first, second = (
        bc.optimise("planar_2r", {"link.link_2.mass": (2.0, 5.0)}, **asked, **where)
        for where in ({"threads": 1}, {"workers": 2})
    )
    assert first.as_dict() == second.as_dict() and first.converged


def test_differences_reach_the_optimum_where_there_is_no_gradient() -> None:
    best = bc.optimise("four_bar", {"crank_length": (1.2, 1.24)}, maximise="largest.apex_force.x", samples=16, starts=1)
    assert best.gradients == {"largest.apex_force.x": "differences"}
    assert best.keeps_limits and np.isfinite(best.objective)


def test_ctrl_c_keeps_the_best_design_so_far() -> None:
    def stop(done: float, _: float | None) -> None:
        if done >= 20:
            raise KeyboardInterrupt

    best = bc.optimise("four_bar", LENGTHS, minimise="lock.time", samples=64, progress=stop, threads=1)
    assert not best.complete and not best.converged and np.isfinite(best.objective)
    assert "interrupted" in str(best.notes) and best.status == "the best design so far"
    assert best.history[-1][1] == best.objective and len(best.plot().axes) == 3


def test_limits_that_no_design_keeps_are_named() -> None:
    best = bc.optimise("four_bar", LENGTHS, minimise="lock.time", limits="lock.crank <= 120 deg", **SMALL)
    assert not best.keeps_limits and not best.converged
    assert any("is broken" in note for note in best.notes)
    assert best.as_dict()["keeps_limits"] is False and not best.multipliers and not best.active_limits
    assert "no design that keeps the limits was found" in best.table()
    assert "broken" in best.table() and "nearest" in best.table()


def test_a_limit_that_no_design_keeps_is_in_the_exit_code_and_in_the_files(tmp_path, capsys) -> None:
    line = ["optimise", "four_bar", "--vary", "crank_length=1.2:1.24", "--minimise", "lock.time", "--samples", "4",
            "--limit", "lock.crank <= 20 deg", "--no-plots", "--out", str(tmp_path / "o"),
            "--write-config", str(tmp_path / "best.yaml")]  # fmt: skip
    assert main(line) == 1
    assert "no design that keeps the limits was found" in capsys.readouterr().out
    written = json.loads((tmp_path / "o/optimum.json").read_text())
    assert written["keeps_limits"] is False and written["status"] == "no design that keeps the limits was found"
    assert "no design that keeps the limits was found" in (tmp_path / "best.yaml").read_text().splitlines()[0]


def test_the_scene_of_its_own_is_no_result_where_it_is_outside_the_bounds() -> None:
    own = bc.load_scene("four_bar").parameters["crank_length"].value
    best = bc.optimise("four_bar", {"crank_length": (1.2, 1.22)}, minimise="lock.time", samples=8, starts=1)
    assert best.before[0] < best.objective and best.values["crank_length"] <= 1.22 < own
    assert best.converged


def test_more_variables_than_a_grid_has_room_for_are_planned() -> None:
    places = [f"joint.{joint}.origin.{axis}" for joint in ("coupler", "rocker") for axis in ("y", "z", "roll", "pitch")]
    bodies = [f"link.{link}_link.cg.{axis}" for link in ("crank", "coupler", "rocker") for axis in "xyz"]
    masses = [f"link.{link}_link.mass" for link in ("crank", "coupler", "rocker")]
    bounds = dict.fromkeys([*places, *bodies], (-0.01, 0.01)) | dict.fromkeys(masses, (1.0, 2.0))
    problem, _, _ = plan_search(bc.load_scene("four_bar"), Request(bounds, minimise="lock.time"))
    assert len(problem.variables) == 20 and problem.numbers(np.full((1, 20), 0.5))[0, -1] == 1.5


def test_a_limit_far_from_all_designs_is_kept_without_overflow() -> None:
    limits = ["lock.crank <= 1e308", "lock.crank >= -1e300"]
    with np.errstate(over="raise", invalid="raise"):
        best = bc.optimise("four_bar", {"crank_length": (1.2, 1.24)}, minimise="lock.time", limits=limits, samples=8)
    assert best.converged and best.values == {"crank_length": 1.24}


def test_files_hold_the_result_and_the_best_design_is_a_scene(tmp_path) -> None:
    best = bc.optimise("four_bar", LENGTHS, minimise="lock.time", samples=16, starts=1)
    written = json.loads(best.to_json(tmp_path / "o.json").read_text())
    assert written["status"] == "a local optimum" and written["table"][0]["name"] == "crank_length"
    assert len(best.to_csv(tmp_path / "d.csv").read_text().splitlines()) == 1 + written["designs"]
    again = bc.load_scene(best.write_config(tmp_path / "best.yaml"))
    run = bc.simulate(again)
    assert run.events[0].time == pytest.approx(best.objective, rel=1e-8)
    with pytest.raises(InputError, match="expected the name of a YAML file"):
        best.write_config(tmp_path / "best.txt")


def test_the_command_writes_what_the_function_finds(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    line = ["optimise", "four_bar", "--vary", "crank_length=1200 mm:1240 mm", "--minimise", "lock.time",
            "--samples", "16", "--starts", "1", "--no-plots", "--out", "o", "--write-config", "best.yaml"]  # fmt: skip
    assert main(line) == 0
    assert "a local optimum" in capsys.readouterr().out
    assert json.loads((tmp_path / "o/optimum.json").read_text())["at_bounds"] == {"crank_length": "upper"}
    assert bc.load_scene(tmp_path / "best.yaml").parameters["crank_length"].value == 1.24


@pytest.mark.parametrize(
    ("named", "message"),
    [
        ({"minimise": "start.crank"}, "no variable changes the objective 'start.crank'"),
        ({"minimise": "lock.tim"}, "unknown measure 'lock.tim'; did you mean 'lock.time'"),
        ({"minimise": None}, "expected a measure to minimise or one to maximise, found neither"),
        ({"maximise": "lock.time"}, "expected a measure to minimise or one to maximise, found both"),
        ({"variables": {"crank_length": (1.24, 1.2)}}, "below the upper, found 1.24 and 1.2 m"),
        ({"variables": {"crank_length": 1.24}}, "'crank_length': expected two bounds"),
        ({"variables": {}}, "nothing is varied"),
        ({"variables": {"crank_length": ("1 kg", "2 kg")}}, "found '1 kg'"),
        ({"variables": {"crank": (1, 2)}}, "unknown key or parameter 'crank'"),
        ({"limits": ["lock.crank <= 3 kg"]}, "found '3 kg'"),
        ({"limits": ["lock.crank"]}, "expected MEASURE <= VALUE"),
        ({"limits": ["lock.cranc <= 3"]}, "unknown measure 'lock.cranc'"),
        ({"start": {"crank_length": 1.3}}, "'crank_length' is 1.3 m, outside its bounds 1.2 to 1.24 m"),
        ({"start": {"rocker": 1.3}}, "unknown variable 'rocker'"),
        (
            {"start": {"crank_length": 1.24}, "limits": ["lock.time <= 1 s"]},
            "it breaks the limit lock.time <= 1 s: lock.time is 12.1086 s",
        ),
        (
            {"variables": {"crank_length": (1.0, 1.24)}, "start": {"crank_length": "1001 mm"}},
            "start: the design cannot be run",
        ),
    ],
)
def test_bad_input_is_one_sentence(named, message) -> None:
    given = {"variables": {"crank_length": (1.2, 1.24)}, "minimise": "lock.time", "samples": 8} | named
    with pytest.raises(InputError) as caught:
        bc.optimise("four_bar", **given)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_designs_that_cannot_be_run_are_said_to_be_so() -> None:
    with pytest.raises(BellcrankError, match="none of 8 designs within the bounds can be run; 8 of them: no event"):
        bc.optimise("four_bar", {"crank_length": (1.0, 1.1)}, minimise="lock.time", samples=8)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"vary": {"upper_arm": [1]}}, "expected two bounds"),
        ({"minimise": "margin", "maximise": "margin"}, "found both"),
        ({"minimize": "margin"}, "unknown key 'minimize'; did you mean 'minimise'"),
        ({"limits": "margin > 0"}, "expected a list"),
        ({"samples": 0}, "of 1 or more"),
    ],
)
def test_a_wrong_entry_of_a_scene_names_its_key(entry, message) -> None:
    with pytest.raises(InputError, match="optimise") as caught:
        bc.load_scene("balanced_arm", {"optimise": entry})
    assert message in str(caught.value)
