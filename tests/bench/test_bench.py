"""The bench of scenes: references, the hand-written C, Pareto fronts, ratios, failures, and the command."""

import importlib.util
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from bellcrank.cli import main
from bellcrank.errors import BellcrankError
from bellcrank_bench.c_baseline.baseline import NAME as C_BASELINE
from bellcrank_bench.c_baseline.baseline import CBaseline
from bellcrank_bench.measurements import bellcrank_runs, scene_benchmark
from bellcrank_bench.measurements.derivative_speed import ALGORITHMS
from bellcrank_bench.measurements.dynamics_speed import GENERATED
from bellcrank_bench.measurements.row import Row
from bellcrank_bench.measurements.work_precision import (
    BELLCRANK,
    PROJECTED,
    failures,
    measure,
    pareto,
    ratios,
    time_at,
)
from bellcrank_bench.peers import drake, exudyn, mujoco, scipy_pinocchio
from bellcrank_bench.peers.peer import Outcome, Run, substeps
from bellcrank_bench.problems.bricard import P3
from bellcrank_bench.problems.reference_motion import reference
from bellcrank_bench.problems.registry import BENCHMARKS, NOT_MEASURED, quick_benchmarks
from bellcrank_bench.tables import markdown
from bellcrank_bench.tables.text import scene_table
from bellcrank_bench.textbook.rolling_disk import ReducedRollingDisk

SCENES = list(BENCHMARKS)
RING = BENCHMARKS["bricard"]
IN_C = [name for name, each in BENCHMARKS.items() if each.c_baseline]
SAME_COORDINATES = [name for name in IN_C if name != "bricard"]
ENERGIES = [name for name, each in BENCHMARKS.items() if hasattr(each.equations, "energy")]
TREES = [name for name, each in BENCHMARKS.items() if not each.constrained]
CONSTRAINED = [name for name, each in BENCHMARKS.items() if each.constrained]
PEERS = {"MuJoCo": mujoco, "Drake": drake, "Exudyn": exudyn}
MODULES = {"MuJoCo": "mujoco", "Drake": "pydrake", "Exudyn": "exudyn"}


@pytest.mark.tier2
@pytest.mark.parametrize("scene", SCENES)
def test_reference_ends_where_the_published_values_say(scene):
    exact = reference(scene)
    known = exact.benchmark.known_end
    end = exact.benchmark.unreduced(exact.state[-1]).astype(float)
    np.testing.assert_allclose(end[: len(known)], known, atol=6e-8)
    assert exact.step_error < 2e-13
    assert exact.scipy_error < 1e-10


@pytest.mark.tier2
def test_four_bar_of_the_reference_locks_when_and_where_the_lecture_says():
    four_bar = BENCHMARKS["four_bar"].equations
    l1, l2, l3 = four_bar.length
    lock = 2.0 * math.asin((l2 + l3) / (2.0 * l1))  # isosceles: the ground link is as long as the crank

    def folded(angle, x):
        # time as a function of the angle, which grows throughout: the lock itself is singular in the cosine rule
        return [1.0 / x[1], four_bar.derivative(np.array([angle, x[1]]))[1] / x[1]]

    begun = reference("four_bar").state[50].astype(float)
    left = 1e-8
    end = solve_ivp(folded, (begun[0], lock - left), [6.0, begun[1]], "DOP853", rtol=1e-12, atol=1e-12)
    time, rate = end.y[:, -1]
    # there the rate falls as the root of what is left of the angle
    assert time + 2.0 * left / rate == pytest.approx(12.267788975800, abs=5e-8)
    assert math.degrees(lock) == pytest.approx(150.462301525, abs=1e-9)


@pytest.mark.tier2
def test_four_bar_stays_closed_and_its_rates_are_those_of_its_angles():
    exact = reference("four_bar")
    four_bar = exact.benchmark.equations
    angles = four_bar.angles(exact.state.astype(float))
    crank, coupler, rocker = angles[:, 0], angles[:, 0] + angles[:, 1], angles[:, 2]
    l1, l2, l3 = four_bar.length
    gap = l1 * np.exp(1j * crank) + l2 * np.exp(1j * coupler) - four_bar.ground - l3 * np.exp(1j * rocker)
    assert np.abs(gap).max() < 1e-13
    np.testing.assert_allclose(np.degrees(angles[0, :3]), [1.0, 358.98291621, 1.01708379], atol=1e-8)
    h, x = 1e-5, exact.state[60].astype(float)
    there, here = (four_bar.angles(x + s * h * four_bar.derivative(x)) for s in (1.0, -1.0))
    np.testing.assert_allclose((there - here)[:3] / (2 * h), four_bar.angles(x)[3:], rtol=1e-7)


def test_disk_goes_round_steadily_at_the_rate_of_the_closed_form():
    # lean α from vertical, radius b of the centre's path: Ω² = g tan α / ((1 + 2k) b + k r sin α), k = 1/4
    disk, lean, path, rate = ReducedRollingDisk(radius=0.3), math.radians(10.0), 1.0, 1.069229755556
    # round the positive vertical at `rate`, leaning inwards; v = r ω_y is the centre's speed along X'
    state = np.array([0.0, 0.0, -lean, 0.0, 0.0, 0.0, path * rate / disk.radius, rate * math.cos(lean)])
    rates = disk.derivative(state)
    assert rates[3] == pytest.approx(rate)
    np.testing.assert_allclose(rates[[2, 5, 6, 7]], 0.0, atol=1e-10)


def test_bricards_ring_is_closed_in_all_its_postures():
    ring = RING.equations
    turn = np.linspace(0.0, 2.0 * math.pi, 50)
    hinges = ring.hinges(turn[:, None])
    np.testing.assert_allclose(ring.corner_of(hinges), ring.corner(turn[:, None]), atol=1e-14)
    place, frame = np.zeros((50, 3)), np.broadcast_to(np.eye(3), (50, 3, 3))
    for axis, rod, angle in zip("yzxyz", ring.rods, hinges.T, strict=True):
        frame = frame @ Rotation.from_euler(axis, angle[:, None]).as_matrix()
        place = place + frame @ rod
    np.testing.assert_allclose(place, np.tile([0.0, 0.0, 1.0], (50, 1)), atol=1e-14)
    np.testing.assert_allclose(frame[:, :, 0], np.tile([1.0, 0.0, 0.0], (50, 1)), atol=1e-14)  # the sixth hinge


@pytest.mark.tier2
def test_bricards_corner_is_where_a_null_space_reduction_of_its_tree_says():
    exact = reference("bricard")
    known = np.array([[t, *place] for t, place in P3.items()])
    np.testing.assert_allclose(exact.at(known[:, 0]).astype(float), known[:, 1:], atol=2e-10)


@pytest.mark.tier2
@pytest.mark.parametrize("scene", ENERGIES)
def test_reference_keeps_the_energy(scene):
    exact = reference(scene)
    state = exact.state.astype(float)
    if exact.benchmark.constrained:
        total = exact.benchmark.equations.energy(state)
    else:
        total = np.sum(exact.benchmark.equations.energy(*np.split(state, 2, axis=1)), axis=0)
    assert np.abs(total - total[0]).max() < 1e-12 * np.abs(total).max()


def test_reference_between_outputs_agrees_with_scipys_dense_output():
    exact = reference("spring_pendulum")
    time = np.array([0.031, 3.3333, 19.97])
    motion = solve_ivp(
        lambda _, x: exact.benchmark.equations.derivative(x), (0.0, 20.0), exact.benchmark.start,
        method="DOP853", rtol=1e-13, atol=1e-14, dense_output=True,
    )  # fmt: skip
    np.testing.assert_allclose(exact.at(time).astype(float), motion.sol(time)[:2].T, atol=1e-10)
    assert exact.error(motion.sol(time)[:2].T, time) < 1e-10


def test_error_of_missing_or_undefined_outputs_is_infinite():
    exact = reference("spring_pendulum")
    good = exact.state[:, :2].astype(float)
    assert exact.error(good) < 1e-14
    assert exact.error(good[:50]) == math.inf
    assert exact.error(np.where(np.arange(101)[:, None] == 7, np.nan, good)) == math.inf


COARSE = [("RK45", 1e-3), ("RK45", 1e-6), ("DOP853", 1e-3), ("DOP853", 1e-6), ("DOP853", 1e-9), ("Radau", 1e-6)]


@pytest.mark.tier2
@pytest.mark.parametrize(
    ("scene", "method", "tolerance"),
    [(scene, *each) for scene in TREES for each in COARSE]
    + [("rolling_disk", "RK45", 1e-6), ("rolling_disk", "DOP853", 1e-6), ("rolling_disk", "DOP853", 1e-9)],
)
def test_c_by_hand_takes_scipys_steps(scene, method, tolerance):
    chosen = BENCHMARKS[scene]
    made = CBaseline(chosen).run(method, tolerance)
    rates = chosen.equations.derivative
    theirs = solve_ivp(
        lambda _, x: rates(x),
        (0.0, chosen.duration),
        chosen.start,
        method,
        chosen.times,
        rtol=tolerance,
        atol=tolerance,
    )
    assert made.evaluations == pytest.approx(theirs.nfev, rel=0.2)
    error = reference(scene).error(chosen.positions(theirs.y.T))
    assert reference(scene).error(made.position) == pytest.approx(error, rel=0.5)


@pytest.mark.tier2
def test_multipliers_in_c_by_hand_give_the_motion_of_the_reduced_equations():
    hand = CBaseline(BENCHMARKS["four_bar"])
    assert reference("four_bar").error(hand.run("DOP853", 1e-12).position) < 1e-10


@pytest.mark.tier2
def test_bricards_ring_in_c_by_hand_and_in_bellcrank_ends_where_the_reference_does():
    groups = bellcrank_runs.groups(RING, CBaseline(RING), full=False)
    group = next(g for g in groups if g[0].method == "DOP853" and g[0].setting == "1e-12")
    rows = measure(group, reference("bricard"), repeats=1)
    assert [row.tool for row in rows] == [BELLCRANK, BELLCRANK, C_BASELINE]
    assert max(row.error for row in rows) < 2e-10


@pytest.mark.tier2
def test_a_cart_that_goes_round_steadily_keeps_to_its_circle():
    chosen = BENCHMARKS["two_wheeler"]
    group = next(g for g in bellcrank_runs.groups(chosen, None, full=False) if g[0].setting == "1e-10")
    [row] = measure(group, reference("two_wheeler"), repeats=1)
    assert row.error < 1e-8


@pytest.mark.tier2
@pytest.mark.parametrize("scene", [*TREES, "four_bar"])
def test_c_by_hand_rk4_converges_with_order_four_between_its_steps_too(scene):
    hand, interval = CBaseline(BENCHMARKS[scene]), BENCHMARKS[scene].times[1]
    coarse, fine = (reference(scene).error(hand.run("RK4", step=interval / n).position) for n in (20.3, 40.6))
    assert math.log2(coarse / fine) == pytest.approx(4.0, abs=0.3)


def test_projection_carries_the_four_bars_through_their_singular_positions():
    chosen = BENCHMARKS["n_four_bar_2"]
    group = next(g for g in bellcrank_runs.groups(chosen, None, full=False) if g[0].setting == "1e-10")
    [row] = measure(group, reference(chosen.scene), repeats=1)
    assert row.method.endswith(PROJECTED)
    assert row.error < 2e-6


def test_c_by_hand_says_when_it_cannot_step():
    with pytest.raises(BellcrankError, match="status"):
        CBaseline(BENCHMARKS["planar_2r_swing"]).run("DOP853", math.nan)


def test_pinocchio_and_the_analytic_equations_give_scipy_the_same_steps():
    chosen = BENCHMARKS["spring_pendulum"]
    runs = scipy_pinocchio.runs(chosen, {"solve_ivp": {"DOP853": [1e-6]}, "RK4": [0.02]})
    solved, stepped = (run.once() for run in runs)
    hand = CBaseline(chosen)
    assert solved.evaluations == pytest.approx(hand.run("DOP853", 1e-6).evaluations, rel=0.02)
    assert np.abs(stepped.position - hand.run("RK4", step=0.02).position).max() < 1e-11


@pytest.mark.tier2
@pytest.mark.parametrize("scene", SAME_COORDINATES)
def test_bellcrank_takes_the_steps_of_the_hand_written_c(scene):
    chosen = BENCHMARKS[scene]
    for group in bellcrank_runs.groups(chosen, CBaseline(chosen), full=False):
        if group[0].setting in ("1e-06", "1e-08"):
            ours, *projected, theirs = measure(group, reference(scene), repeats=1)
            assert ours.steps + ours.rejected == pytest.approx(theirs.steps + theirs.rejected, rel=0.3)
            assert len(projected) == chosen.constrained
            if scene != "rolling_disk":  # there bellcrank has other coordinates
                assert ours.error == pytest.approx(theirs.error, rel=0.5)
            assert all(row.error <= 1.1 * ours.error for row in projected)
            assert ours.whole > ours.seconds


# ---- fronts and ratios

positive = st.floats(1e-12, 1.0)


def row(tool, method="DOP853", **found):
    return Row(subject="scene", tool=tool, method=method, **found)


many_rows = st.lists(
    st.builds(lambda s, e: row("tool", seconds=s, error=e), positive, positive), min_size=1, max_size=20
)


@given(many_rows)
def test_no_row_beats_one_of_the_pareto_front_and_every_other_row_is_beaten(rows):
    front = pareto(rows)
    for kept in front:
        assert not any(r.seconds < kept.seconds and r.error < kept.error for r in rows)
    for row in rows:
        assert any(kept.seconds <= row.seconds and kept.error <= row.error for kept in front)


def power_law(tool, factor, order=5.0, method="DOP853", errors=(1e-3, 1e-5, 1e-8, 1e-11)):
    return [
        row(tool, method, seconds=factor * e ** (-1 / order), error=e, whole=2 * factor * e ** (-1 / order))
        for e in errors
    ]


def test_times_between_rows_follow_the_power_law_of_the_method():
    rows = power_law("tool", 3.0)
    assert time_at(rows, 1e-6) == pytest.approx(3.0 * 1e-6 ** (-1 / 5))
    assert time_at(rows, 1e-6, whole=True) == pytest.approx(6.0 * 1e-6 ** (-1 / 5))
    assert time_at(rows, 1e-11) == pytest.approx(rows[-1].seconds)


def test_times_beyond_the_rows_are_the_fastest_or_infinite():
    rows = power_law("tool", 3.0)
    assert time_at(rows, 1e-1) == rows[0].seconds
    assert time_at(rows, 1e-12) == math.inf
    assert time_at([], 1e-6) == math.inf


def test_ratios_name_c_of_the_same_method_and_the_best_peer():
    rows = power_law(BELLCRANK, 1.2) + power_law(C_BASELINE, 1.0) + power_law("slow", 60.0) + power_law("quick", 24.0)
    found = {(r.slower, r.faster): r.value for r in ratios("scene", rows, [1e-6])}
    assert found == {
        (f"{BELLCRANK} DOP853, kernel", f"{C_BASELINE} DOP853"): pytest.approx(1.2),
        ("quick (best peer)", f"{BELLCRANK}, kernel"): pytest.approx(20.0),
        ("slow", f"{BELLCRANK}, kernel"): pytest.approx(50.0),
        ("quick (best peer)", f"{BELLCRANK}, simulate()"): pytest.approx(10.0),
        ("slow", f"{BELLCRANK}, simulate()"): pytest.approx(25.0),
    }


def test_projected_rows_are_compared_with_the_same_method_in_c():
    method = "DOP853" + PROJECTED
    rows = power_law(BELLCRANK, 1.2) + power_law(BELLCRANK, 1.5, method=method) + power_law(C_BASELINE, 1.0)
    found = {r.slower: r.value for r in ratios("scene", rows, [1e-6]) if r.faster == f"{C_BASELINE} DOP853"}
    assert found == {
        f"{BELLCRANK} DOP853, kernel": pytest.approx(1.2),
        f"{BELLCRANK} {method}, kernel": pytest.approx(1.5),
    }


def test_an_error_that_is_not_reached_gives_no_ratio():
    rows = power_law(BELLCRANK, 1.2) + power_law("slow", 60.0, errors=(1e-3, 1e-5))
    found = [r.value for r in ratios("scene", rows, [1e-10])]
    assert found == [math.inf, math.inf]


def test_runs_that_fail_are_rows_and_are_counted():
    exact = reference("spring_pendulum")
    good = exact.state[:, :2].astype(float)

    def raises():
        raise ValueError("no step\nat all")

    runs = [
        Run(tool="peer", method=method, setting="", note="", once=once)
        for method, once in (
            ("good", lambda: Outcome(seconds=1.0, position=good)),
            ("raises", raises),
            ("diverges", lambda: Outcome(seconds=1.0, position=good * np.nan)),
        )
    ]
    rows = measure(runs, exact, repeats=2)
    assert [row.reached for row in rows] == [True, False, False]
    assert rows[1].failure == "ValueError: no step"
    assert "diverged" in rows[2].failure
    assert failures(rows) == {"peer": (2, 3)}
    assert pareto(rows) == [rows[0]]
    assert rows[0].repeats >= 2


# ---- peers


@pytest.mark.tier2
@pytest.mark.parametrize("scene", TREES)
@pytest.mark.parametrize("tool", PEERS)
def test_peers_integrate_the_same_scene_or_are_named_as_missing(scene, tool, monkeypatch):
    finest = {
        "MuJoCo": {"RK4": [0.005]},
        "Drake": {"adaptive": {"runge_kutta5": [1e-10]}, "fixed": {"runge_kutta5": [0.01]}},
        "Exudyn": {"RK67": [0.023], "DOPRI5": [1e-9]},
    }[tool]
    peer = PEERS[tool].PEER
    if importlib.util.find_spec(MODULES[tool]) is None:
        monkeypatch.setattr(scene_benchmark, "OPTIONAL", (peer,))
        report = scene_benchmark.measure_scene(scene, peers=True, repeats=1, progress=lambda groups: groups[:1])
        assert report.missing == [f"{tool}: not installed: pip install 'bellcrank[peers]'"]
    else:
        rows = [each for run in peer.runs(BENCHMARKS[scene], finest) for each in measure([run], reference(scene), 1)]
        assert rows and [each.failure for each in rows] == [""] * len(rows)
        assert max(each.error for each in rows) < 1e-6


LIMITS = {
    ("four_bar", "MuJoCo"): 2e-5, ("four_bar", "Drake"): 5e-2, ("four_bar", "Exudyn"): 2e-6,
    ("rolling_disk", "MuJoCo"): 0.5, ("rolling_disk", "Drake"): 0.5, ("rolling_disk", "Exudyn"): 2e-2,
    ("n_four_bar_2", "Exudyn"): 1e-1,
    ("bricard", "MuJoCo"): 5e-5, ("bricard", "Drake"): 0.5, ("bricard", "Exudyn"): 1e-3,
}  # fmt: skip


@pytest.mark.parametrize(("scene", "tool"), LIMITS)
def test_peers_integrate_the_closed_scenes_as_well_as_they_can(scene, tool):
    disk = scene == "rolling_disk"
    settings = {
        "MuJoCo": {
            "integrator": ["RK4"], "step": [0.01], "rate": [1.0], "impedance": [0.999999],
            "shape": ["ellipsoid" if disk else "site"],
        },
        "Drake": {"step": [0.12 if scene == "four_bar" else 0.01], "stiffness": [1e4]},
        "Exudyn": {"GeneralizedAlpha": [0.004 if disk else 0.012]},
    }[tool]  # fmt: skip
    peer = PEERS[tool].PEER
    if importlib.util.find_spec(MODULES[tool]) is None:
        with pytest.raises(ImportError):
            list(peer.runs(BENCHMARKS[scene], settings))
    else:
        [run] = peer.runs(BENCHMARKS[scene], settings)
        [found] = measure([run], reference(scene), repeats=1)
        assert found.failure == ""
        assert found.error < LIMITS[scene, tool]


@pytest.mark.tier2
def test_scipy_on_pinocchios_constrained_dynamics_takes_the_steps_of_c():
    chosen = BENCHMARKS["four_bar"]
    [run] = scipy_pinocchio.runs(chosen, {"solve_ivp": {"DOP853": [1e-8]}})
    solved, hand = run.once(), CBaseline(chosen).run("DOP853", 1e-8)
    assert reference("four_bar").error(solved.position) == pytest.approx(
        reference("four_bar").error(hand.position), rel=0.05
    )
    assert list(scipy_pinocchio.runs(BENCHMARKS["rolling_disk"], {"solve_ivp": {"DOP853": [1e-8]}})) == []


@pytest.mark.tier2
def test_scipy_on_pinocchios_constrained_dynamics_solves_bricards_redundant_ring():
    [run] = scipy_pinocchio.runs(RING, {"solve_ivp": {"DOP853": [1e-8]}})
    assert reference("bricard").error(run.once().position) < 1e-5


@pytest.mark.tier2
def test_a_missing_peer_is_a_line_of_the_report(monkeypatch):
    def missing(benchmark, settings):
        raise ImportError(benchmark.scene)

    optional = tuple(replace(peer, runs=missing) for peer in scene_benchmark.OPTIONAL)
    monkeypatch.setattr(scene_benchmark, "OPTIONAL", optional)
    report = scene_benchmark.measure_scene("spring_pendulum", peers=True, repeats=1, progress=lambda groups: groups[:2])
    assert len(report.missing) == 3
    assert "Exudyn: not installed: pip install 'bellcrank[peers]'" in scene_table(report)


def test_published_settings_are_positive_numbers_of_every_tool():
    published = scene_benchmark.read_yaml(scene_benchmark.SETTINGS)
    assert set(published) == {"unconstrained", *CONSTRAINED}
    settings = published["unconstrained"]
    assert set(settings) == {"SciPy", *PEERS}
    assert all(set(published[name]) <= {"SciPy", *PEERS} for name in CONSTRAINED)

    def numbers(tree):
        return [n for value in (tree.values() if isinstance(tree, dict) else tree) for n in (
            numbers(value) if isinstance(value, (dict, list)) else [value])]  # fmt: skip

    assert all(isinstance(n, float) and 0 < n <= 0.1 for n in numbers(dict(settings)))


def test_substeps_divide_the_interval_between_outputs():
    assert substeps(BENCHMARKS["planar_2r_swing"], 0.033) == (3, pytest.approx(0.1 / 3))
    assert substeps(BENCHMARKS["spring_pendulum"], 5.0) == (1, pytest.approx(0.2))


# ---- the command


@pytest.mark.tier2
def test_published_times_of_others_stand_below_the_ratios():
    report = scene_benchmark.measure_scene("pendulum", repeats=1, progress=lambda groups: groups[6:12], budget=0.01)
    whole = time_at([row for row in report.rows if row.tool == BELLCRANK], 1e-6, whole=True)
    assert scene_table(report).splitlines()[-1].split() == [
        "Exudyn", "37.0", "ms", "(i7):", f"{0.037 / whole:.0f}", "times", "as", "long",
    ]  # fmt: skip
    assert report.data()["published"][0]["tool"] == "OpenSim 3.2"


def test_bench_of_all_scenes_goes_through_the_quick_ones_and_names_the_others(monkeypatch, capsys):
    gone = []

    def measure_scene(name, peers, repeats, progress, budget):
        gone.append((name, peers, budget))
        raise BellcrankError("no more")

    monkeypatch.setattr(scene_benchmark, "measure_scene", measure_scene)
    for arguments in ([], ["n_four_bar_40"]):
        assert main(["bench", *arguments]) == 2
    assert gone == [(quick_benchmarks()[0], False, 0.1), ("n_four_bar_40", False, 1.0)]
    told = capsys.readouterr().out
    assert "slow ones (n_four_bar_40)" in told
    assert all(f"{name}: not measured: " in told for name in NOT_MEASURED)


@pytest.mark.tier2
def test_bench_writes_rows_ratios_and_a_plot(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(bellcrank_runs, "TOLERANCES", {False: (1e-5, 1e-8, 1e-11)})
    monkeypatch.setattr(bellcrank_runs, "SUBSTEPS", {False: (10, 40)})
    monkeypatch.setattr(scene_benchmark, "SETTINGS", tmp_path / "few.yaml")
    (tmp_path / "few.yaml").write_text("unconstrained: {SciPy: {solve_ivp: {DOP853: [1.0e-4, 1.0e-8]}, RK4: [0.05]}}\n")
    assert (
        main(
            [
                "bench",
                "spring_pendulum",
                "--repeats",
                "1",
                "--out",
                str(tmp_path),
                "--markdown",
                str(tmp_path / "tables.md"),
            ]
        )
        == 0
    )
    text = capsys.readouterr().out
    assert "bellcrank DOP853, kernel    / C baseline DOP853" in text
    assert "0 of 11 runs failed" in text
    [scene] = json.loads((tmp_path / "bench.json").read_text())["scenes"]
    assert {row["tool"] for row in scene["rows"]} >= {BELLCRANK, C_BASELINE, "SciPy + pin.aba", "Pinocchio in Python"}
    assert all(row["error"] < 1.0 for row in scene["rows"])
    table = (tmp_path / "tables.md").read_text().splitlines()
    assert table[0] == "|  | spring pendulum, 20 s, error 1e-6 | spring pendulum, 20 s, error 1e-10 |"
    assert table[2].startswith("| bellcrank's stepping / C baseline | ")
    assert table[3].startswith("| SciPy + Pinocchio / bellcrank | ") and table[3].endswith(" | never |")
    assert (tmp_path / "work_precision_spring_pendulum.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["four_baa"], "unknown scene 'four_baa'"),
        (["planar_2r_swing", "--dynamics", "ur5"], "separate benchmarks"),
        (["planar_2r_swing", "--repeats", "0"], "--repeats"),
        (["--hard", "--markdown", "tables.md"], "--markdown is for scenes and --dynamics"),
        (["--derivatives"], "--derivatives goes with --dynamics"),
        (["--dynamics", "--derivatives", "--markdown", "tables.md"], "--markdown is not for it"),
    ],
)
def test_bench_refuses_in_one_sentence(arguments, told, capsys):
    assert main(["bench", *arguments]) == 2
    assert told in capsys.readouterr().err


@pytest.mark.tier2  # compiles Pinocchio's C++ for half a minute
def test_derivatives_agree_with_pinocchios_cpp(tmp_path, capsys):
    assert main(["bench", "--dynamics", "planar_2r", "--derivatives", "--out", str(tmp_path)]) == 0
    rows = json.loads((tmp_path / "derivatives.json").read_text())["rows"]
    assert [row["algorithm"] for row in rows] == [f"{name}, derivatives" for name in ALGORITHMS for _ in range(3)]
    assert all(row["ns"] > 0.0 and row["error"] < 1e-10 for row in rows)
    assert "one sample per call" in capsys.readouterr().out


@pytest.mark.tier2
def test_rows_that_failed_are_null_in_json_and_marked_on_screen():
    report = scene_benchmark.measure_scene("spring_pendulum", repeats=1, progress=lambda groups: groups[:2])
    report.rows[0] = replace(report.rows[0], seconds=math.inf, error=math.inf, failure="it diverged")
    assert "FAILED: it diverged" in scene_table(report)
    data = report.data()
    assert data["rows"][0]["seconds"] is None
    assert data["failed"][BELLCRANK] == {"failed": 1, "of": 2}


# ---- the README's tables


@pytest.mark.tier2
def test_markdown_tables_of_scenes_have_ratios_at_equal_error():
    report = scene_benchmark.measure_scene("rolling_disk", repeats=1, progress=lambda groups: groups[:0])
    own = power_law(BELLCRANK, 2.0, method="DOP853" + PROJECTED) + power_law(BELLCRANK, 0.1)
    rows = (
        own + power_law(C_BASELINE, 1.0) + power_law("MuJoCo", 500.0, errors=(1e-1, 1e-3)) + power_law("Exudyn", 30.0)
    )
    table = markdown.scene_tables([replace(report, rows=rows)]).splitlines()
    assert table == [
        "|  | rolling disk, 10 s, error 1e-6 |",
        "|---|---|",
        "| bellcrank's stepping / C baseline | 2.00 (C in fewest coordinates) |",
        "| MuJoCo / bellcrank | never |",
        "| Exudyn / bellcrank | 15 |",
    ]


def test_markdown_table_of_dynamics_has_a_column_per_tool():
    def timed(tool, nanoseconds):
        return Row(subject="ur5", tool=tool, method="inverse_dynamics", seconds=nanoseconds * 1e-9, error=0.0)

    rows = [timed("libpinocchio, C++", 930.0), timed("bellcrank, avx2", 27.54), timed(GENERATED, 171.0)]
    assert markdown.dynamics_table(rows).splitlines() == [
        "| ns per sample | Pinocchio C++ | casadi's C, -O3 | bellcrank, AVX2 |",
        "|---|---|---|---|",
        "| UR5, inverse dynamics | 930 | 171 | 27.5 (34×) |",
    ]


@pytest.mark.tier2
def test_pages_are_measured_next_to_machine_code_with_the_same_results(tmp_path, capsys):
    assert main(["bench", "--pages", "--samples", "10000", "--repeats", "1", "--out", str(tmp_path)]) == 0
    rows = json.loads((tmp_path / "pages.json").read_text())["rows"]
    assert {row["subject"] for row in rows} == {"ur5", "panda", "four_bar"}
    assert all(row["ratio"] > 0.0 and row["error"] < 1e-11 for row in rows)
    assert "Chromium" in capsys.readouterr().out


def test_a_machine_without_a_browser_says_so_in_a_line(monkeypatch, capsys):
    monkeypatch.setattr("shutil.which", lambda name: None)
    assert main(["bench", "--pages"]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith("pages are not measured: ") and "chromium" in line
