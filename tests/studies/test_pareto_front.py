"""The front between objectives: no design dominates its points; each is a scene; bad input in one sentence."""

import csv
import json
from functools import cache

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.errors import InputError

LENGTHS = {"crank_length": (1.2, 1.24), "rocker_length": (1.2, 1.24)}
SIZES = {name: {"lower": 1.2, "upper": 1.24, "step": "8 mm"} for name in LENGTHS}
BRANCH = "start.rocker <= 90 deg"  # of the two ways in which the linkage can be assembled
SLOW = {"minimise": "lock.time", "maximise": "lock.crank"}


@cache
def lengths() -> bc.results.ParetoFront:
    return bc.pareto_front("four_bar", LENGTHS, **SLOW, limits=BRANCH, samples=32, starts=4, points=4, threads=1)


def dominated(points: np.ndarray, others: np.ndarray, more: float) -> np.ndarray:
    """Which points (n, k), to be made small, another one betters by `more` in one objective and in none is worse."""
    found = np.zeros(len(points), dtype=bool)
    for n, point in enumerate(points):
        found[n] = bool(((others <= point).all(axis=1) & (others < point - more).any(axis=1)).any())
    return found


def test_the_front_of_all_sizes_is_the_designs_of_a_sweep_that_none_dominates() -> None:
    limits = ["lock.crank <= 165 deg"]
    front = bc.pareto_front("four_bar", SIZES, **SLOW, limits=limits, threads=1)
    grid = np.linspace(1.2, 1.24, 6)
    sweep = bc.sweep("four_bar", dict.fromkeys(LENGTHS, grid), threads=1)
    values = np.stack([sweep.column("lock.time"), -sweep.column("lock.crank")], axis=1)
    kept = np.isfinite(values).all(axis=1) & (-values[:, 1] <= np.deg2rad(165.0))
    best = values[kept][~dominated(values[kept], values[kept], 0.0)]
    mine = front.values * [1.0, -1.0]
    assert len(front) > 2 and front.proved and front.converged
    np.testing.assert_allclose(mine, best[np.argsort(best[:, 0])], rtol=1e-9)


def test_no_design_that_was_run_dominates_one_of_the_front_and_ends_are_the_optima() -> None:
    front = lengths()
    assert front.complete and front.converged and not front.proved and len(front) >= 3
    problem, units = front.problem, [0, 2]
    every = np.concatenate(problem.values)
    kept = problem.within(np.concatenate(problem.points)) & (every[:, 1] <= np.pi / 2)
    values = every[kept][:, units] * [1.0, -1.0]
    mine = front.values * [1.0, -1.0]
    spread = problem.spreads[units]
    assert not dominated(mine / spread, values / spread, 1e-6).any() and (np.diff(mine[:, 0]) > 0.0).all()
    for end, objective in ((0, {"minimise": "lock.time"}), (-1, {"maximise": "lock.crank"})):
        best = bc.optimise("four_bar", LENGTHS, **objective, limits=BRANCH, samples=32, starts=4, threads=1)
        assert front.values[end, 0 if end == 0 else 1] == pytest.approx(best.objective, rel=1e-6)


def test_a_design_of_the_front_is_the_optimum_at_its_level_and_its_multiplier_is_the_slope_of_the_front() -> None:
    middle = next(one for one in lengths().designs[1:-1] if one.active_limits)
    _, level = middle.problem.limits
    step = 1e-4
    beside = [
        bc.optimise("four_bar", LENGTHS, minimise="lock.time", samples=32, starts=4, threads=1,
                    limits=[BRANCH, f"lock.crank >= {level.value + side} rad"])
        for side in (-step, 0.0, step)
    ]  # fmt: skip
    assert middle.objective == pytest.approx(beside[1].objective, rel=1e-6)
    slope = (beside[2].objective - beside[0].objective) / (2.0 * step)
    assert middle.multipliers[str(level)] == pytest.approx(slope, rel=1e-2)


@pytest.mark.tier2
def test_no_random_design_dominates_the_front_of_torques_of_an_arm() -> None:
    front = bc.pareto_front("balanced_arm", minimise=["shoulder.peak_torque", "shoulder.rms_torque"], points=7,
                            starts=4, threads=1)  # fmt: skip
    assert front.converged and len(front) >= 6
    problem = front.problem
    numbers = problem.numbers(np.random.default_rng(11).random((10_000, 3)))
    columns = problem.runner.run(numbers, threads=1)
    spread = problem.spreads[:2]
    random = np.stack([columns.measures[name] for name in front.objectives], axis=1) / spread
    assert not dominated(front.values / spread, random, 1e-6).any()
    assert not dominated(front.values / spread, front.values / spread, 1e-9).any()
    for values, scene in zip(front.values, [one.scene for one in front.designs], strict=True):
        shoulder = bc.size(scene).joint("shoulder")
        assert [shoulder.peak_torque, shoulder.rms_torque] == pytest.approx(values.tolist(), rel=1e-9)


@pytest.mark.tier2
def test_three_objectives_have_a_front_that_no_random_design_dominates() -> None:
    names = ["shoulder.peak_torque", "shoulder.rms_torque", "elbow.peak_torque"]
    front = bc.pareto_front("balanced_arm", minimise=names, points=3, starts=2, samples=32, threads=1)
    problem = front.problem
    numbers = problem.numbers(np.random.default_rng(5).random((2000, 3)))
    columns = problem.runner.run(numbers, threads=1)
    random = np.stack([columns.measures[name] for name in names], axis=1) / problem.spreads[:3]
    assert not dominated(front.values / problem.spreads[:3], random, 1e-6).any()
    assert len(front.plot().axes) == 2


def test_files_hold_the_front_and_each_design_is_a_scene(tmp_path) -> None:
    front = bc.pareto_front("four_bar", {"crank_length": {"sizes": [1.22, 1.23, 1.24]}}, **SLOW, threads=1)
    rows = list(csv.reader(front.to_csv(tmp_path / "f.csv").read_text().splitlines()))
    assert rows[0][:4] == ["design", "lock.time [s]", "lock.crank [rad]", "crank_length [m]"]
    written = json.loads(front.to_json(tmp_path / "f.json").read_text())
    assert [one["objectives"] for one in written["designs"]] == front.values.tolist() and written["proved"]
    assert [float(row[1]) for row in rows[1:]] == front.values[:, 0].tolist()
    for path, time in zip(front.write_configs(tmp_path / "front"), front.values[:, 0], strict=True):
        assert bc.simulate(bc.load_scene(path)).events[0].time == pytest.approx(time, rel=1e-8)
    assert len(front.plot(tmp_path / "f.png").axes) == 1 and (tmp_path / "f.png").stat().st_size > 1000


def test_the_command_writes_the_front_that_a_scene_asks_for(tmp_path, capsys) -> None:
    entry = "{vary: {crank_length: {sizes: [1.22, 1.24]}}, minimise: [lock.time], maximise: lock.crank, points: 3}"
    line = ["optimise", "four_bar", "--set", f"optimise={entry}", "--no-plots", "--out", str(tmp_path / "o")]
    assert main(line) == 0
    assert "all designs of the front" in capsys.readouterr().out
    assert {path.name for path in (tmp_path / "o").iterdir()} == {
        "front.csv", "front.json", "design_1.yaml", "design_2.yaml",
    }  # fmt: skip
    assert main([*line, "--write-config", str(tmp_path / "b.yaml")]) == 2
    assert "each design of a front is written into the folder" in capsys.readouterr().err
    single = ["optimise", "four_bar", "--vary", "crank_length=1.2:1.24", "--minimise", "lock.time", "--points", "3"]
    assert main([*single, "--out", str(tmp_path / "p")]) == 2
    assert "--points: belongs to a front" in capsys.readouterr().err


def test_the_answer_does_not_depend_on_threads() -> None:
    again = bc.pareto_front("four_bar", LENGTHS, **SLOW, limits=BRANCH, samples=32, starts=4, points=4, threads=3)
    assert again.as_dict() == lengths().as_dict()


def test_ctrl_c_keeps_the_designs_that_were_found() -> None:
    def stop(done: float, _: float | None) -> None:
        if done >= 60:
            raise KeyboardInterrupt

    front = bc.pareto_front("four_bar", LENGTHS, **SLOW, samples=32, starts=2, points=5, threads=1, progress=stop)
    assert not front.complete and not front.converged and len(front) >= 1
    assert any("interrupted" in note for note in front.notes)


@pytest.mark.parametrize(
    ("named", "message"),
    [
        ({"maximise": None}, "expected two measures or more to minimise or to maximise, found lock.time"),
        ({"minimise": ["lock.time", "lock.time"]}, "expected each objective once"),
        ({"maximise": "lock.time"}, "expected a measure to minimise or one to maximise, found both"),
        ({"maximise": "lock.cranc"}, "maximise: unknown measure 'lock.cranc'"),
        (
            {"minimise": ["lock.time", "start.rocker"], "points": 40},
            "points: expected at most 1000 designs, found 1600",
        ),
        ({"points": 1}, "points"),
        ({"limits": ["lock.crank <= 20 deg"]}, "no design that keeps the limits was found"),
    ],
)
def test_bad_input_is_one_sentence(named, message) -> None:
    given = {"variables": {"crank_length": (1.2, 1.24)}, "samples": 8, "starts": 1} | SLOW | named
    with pytest.raises(bc.BellcrankError) as caught:
        bc.pareto_front("four_bar", **given)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_several_objectives_of_optimise_and_a_wrong_entry_are_refused() -> None:
    with pytest.raises(InputError, match=r"found lock.time, lock.crank; bellcrank.pareto_front finds"):
        bc.optimise("four_bar", LENGTHS, **SLOW)
    with pytest.raises(InputError, match=r"optimise.*expected a measure such as lock.time, or a list of them, found 3"):
        bc.load_scene("balanced_arm", {"optimise": {"minimise": 3}})
