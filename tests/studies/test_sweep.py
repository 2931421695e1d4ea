"""`sweep`: designs of the deployable four-bar against the closed form of its lock, in threads, without compiling."""

import csv
import json
import math

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.codegen import llvm as machine
from bellcrank.dynamics.equations.system import system_of
from bellcrank.studies.designs.axes import parse_axis, read_axis
from bellcrank.studies.execution.design_runner import StudyInterrupted
from bellcrank.studies.sweep import sweep

GROUND, COUPLER, ROCKER = 1.241, 1.2, 1.2
SCENE = """
name: Deployable four-bar
urdf: four_bar
gravity: [0, 0, 0]
frames:
  coupler_tip: {link: coupler_link, xyz: [1.2, 0, 0]}
  rocker_tip: {link: rocker_link, xyz: [1.2, 0, 0]}
constraints:
  - {name: apex, kind: point, frame_a: coupler_tip, frame_b: rocker_tip}
forces:
  - {name: spring, kind: joint_spring, joint: crank, preload: 1.96, stiffness: 0.1}
parameters:
  crank_length: {value: 1.241, sets: [joint.coupler.origin.x]}
  preload: {value: 1.96, sets: [force.spring.preload]}
events:
  - {name: lock, when: {expression: sin(crank.position + coupler.position - rocker.position)}, stop: true}
outputs:
  crank_speed: {joint: crank, what: velocity}
initial: {crank: 1 deg, coupler: {guess: 359 deg}, rocker: {guess: 1 deg}}
simulate: {duration: 25, solver: DOP853, rtol: 1.0e-10, atol: 1.0e-10, samples: 101}
"""


def lock_cosine(crank):
    """cos of the crank's angle where coupler and rocker line up; no such angle where it leaves [-1, 1]."""
    return (GROUND**2 + crank**2 - (COUPLER + ROCKER) ** 2) / (2.0 * GROUND * crank)


@pytest.fixture(scope="module")
def four_bar(tmp_path_factory):
    path = tmp_path_factory.mktemp("sweep") / "linkage.yaml"
    path.write_text(SCENE)
    return bc.load_scene(path)


def test_the_lock_angle_of_every_crank_length_is_that_of_the_closed_form(four_bar):
    lengths = np.linspace(1.21, 1.24, 31)
    result = sweep(four_bar, {"crank_length": lengths})
    assert result.complete and {design.status for design in result.designs} == {"event"}
    np.testing.assert_allclose(result.column("lock.crank"), np.arccos(lock_cosine(lengths)), rtol=0, atol=1e-11)
    np.testing.assert_allclose(result.values[:, 0], lengths, rtol=0, atol=0)
    assert result.column("energy_drift").max() < 1e-8 and result.column("constraint_residual").max() < 1e-12
    # the apex lies on the line from the crank's tip to the rocker's bearing: the linkage has become a triangle
    line_up = result.column("lock.crank") + result.column("lock.coupler") - result.column("lock.rocker")
    np.testing.assert_allclose(np.cos(line_up), -1.0, atol=1e-12)


def test_lock_times_are_the_lecture_s_reference_for_either_start(four_bar):
    result = sweep(four_bar, {"initial.crank": ["1 deg", "0.5 deg"]})
    np.testing.assert_allclose(result.column("lock.time"), [12.267788975800, 12.285590752040], rtol=0, atol=1e-7)
    np.testing.assert_allclose(result.column("lock.crank"), np.radians(150.462301525), rtol=0, atol=1e-10)
    np.testing.assert_allclose(result.column("end.apex.force.x")[0], 1500.133, rtol=1e-6)
    assert result.axes[0].numbers.tolist() == [1.0, 0.5] and result.axes[0].unit == "deg"


def test_a_design_that_cannot_lock_or_close_is_a_row_with_its_reason(four_bar):
    lengths = np.array([1.0, 1.1, 1.158, 1.16, 2.0, 3.6, 3.7, 4.0])
    result = sweep(four_bar, {"crank_length": lengths})
    cosine = lock_cosine(lengths)
    for design, value in zip(result.designs, cosine, strict=True):
        if value < -1.0:  # shorter: coupler and rocker are never stretched, the crank goes round
            assert design.status == "finished" and design.reason == "no event 'lock' within 25 s"
            assert design.measures["end.crank"] > math.pi
        elif value > 1.0:  # longer: they do not reach at all
            assert design.status == "infeasible" and design.reason.startswith(
                "initial: the constraints cannot be satisfied"
            )
            assert "'apex'" in design.reason and "end.time" not in design.measures
        else:
            assert design.status == "event" and design.reason == ""
    assert np.array_equal(np.isfinite(result.column("lock.crank")), np.abs(cosine) <= 1.0)


def test_designs_share_one_system_and_nothing_is_compiled_for_them(four_bar, monkeypatch):
    sweep(four_bar, {"crank_length": [1.241]})

    def refuse(*arguments):
        raise AssertionError("machine code was made for a design")

    monkeypatch.setattr(machine, "object_code", refuse)
    result = sweep(four_bar, {"crank_length": np.linspace(1.2, 1.3, 7), "preload": [1.9, 2.0]}, threads=2)
    assert result.complete and {design.status for design in result.designs} == {"event"}
    assert system_of(four_bar.with_overrides({"crank_length": 1.3, "preload": 2.0})) is system_of(four_bar)


def test_threads_change_no_bit_of_any_row_and_each_row_is_the_run_of_its_design(four_bar):
    vary = {"crank_length": [1.22, 1.241, 1.3], "preload": [1.8, 1.96]}
    one, many = sweep(four_bar, vary, threads=1), sweep(four_bar, vary, threads=4)
    assert [d.measures for d in one.designs] == [d.measures for d in many.designs]
    assert one.shape == (3, 2) and [d.index for d in many.designs] == list(range(6))
    run = bc.simulate(four_bar.with_overrides({"crank_length": 1.3, "preload": 1.8}))
    # the error estimates of runs at 1e-10 are above 1e-9 s
    np.testing.assert_allclose(one.grid("lock.time")[2, 0], run.events[0].time, rtol=0, atol=1e-8)
    # extremes are those of the whole run, which 100,001 rows hold to h²/8 of the second derivative
    run = bc.simulate(run.scene, samples=100_001)
    np.testing.assert_allclose(one.grid("largest.crank_speed")[2, 0], run.output("crank_speed").max(), atol=1e-7)
    # a weaker spring locks later, at the same angle
    assert np.all(np.diff(one.grid("lock.time"), axis=1) < 0.0)
    np.testing.assert_allclose(np.diff(one.grid("lock.crank"), axis=1), 0.0, atol=1e-11)


def test_solvers_and_tolerances_can_be_varied_and_agree(four_bar):
    result = sweep(four_bar, {"simulate.solver": ["DOP853", "RK45"], "simulate.rtol": [1e-8, 1e-10]})
    assert not result.axes[0].numeric and result.axes[0].values == ["DOP853", "RK45"]
    np.testing.assert_allclose(result.column("lock.time"), 12.2677889758, rtol=0, atol=1e-4)


def test_ctrl_c_keeps_the_rows_that_are_done(four_bar):
    def interrupt(done, count):
        assert count == 400
        if done >= 5:
            raise KeyboardInterrupt

    result = sweep(four_bar, {"crank_length": np.linspace(1.2, 1.3, 400)}, threads=2, progress=interrupt)
    assert not result.complete and 5 <= len(result.designs) < 400
    assert np.isfinite(result.column("lock.time")).all()
    assert np.count_nonzero(np.isfinite(result.grid("lock.time"))) == len(result.designs)


@pytest.mark.parametrize(
    ("vary", "text"),
    [
        ({}, "expected at least one parameter to vary"),
        ({"crank_length": []}, "expected at least one value"),
        ({"crank_length": ["1 deg"]}, "units known here"),
        ({"crank_lenght": [1.0]}, "crank_lenght"),
        ({"initial.crankk": [1.0]}, "did you mean 'crank'"),
        ({"forces.spring.stiffness": [0.1, 0.2]}, "it changes the equations"),
    ],
)
def test_paths_that_cannot_be_varied_are_refused_at_once(four_bar, vary, text):
    with pytest.raises(bc.InputError, match=text):
        sweep(four_bar, vary)


def test_threads_must_be_at_least_one(four_bar):
    with pytest.raises(bc.InputError, match="threads"):
        sweep(four_bar, {"crank_length": [1.241]}, threads=0)


def test_an_axis_is_written_as_a_range_or_a_list_with_or_without_units():
    pendulum = bc.load_scene("pendulum")
    path, values = parse_axis("a=1:2:3")
    assert path == "a" and values.numbers.tolist() == [1.0, 1.5, 2.0] and not values.unit
    assert read_axis(pendulum, *parse_axis("initial.swing=1:2:2 ")).values == [1.0, 2.0]
    assert read_axis(pendulum, *parse_axis("initial.swing=1:3 deg:2")).values == ["1.0 deg", "3.0 deg"]
    assert parse_axis("simulate.solver=RK45,DOP853")[1] == ("RK45", "DOP853")
    for wrong in ("a", "a=", "=1:2:3", "a=1:2", "a=1:2:0", "a=1:x:3", "a=1 deg:2 rad:3", "a=1,,2", "a=[1"):
        with pytest.raises(bc.InputError, match="--vary"):
            parse_axis(wrong)


def test_the_files_hold_every_number_and_the_pictures_are_drawn(four_bar, tmp_path):
    result = sweep(four_bar, {"crank_length": [1.1, 1.241, 3.9], "preload": [1.96, 2.0]})
    rows = list(csv.DictReader(result.to_csv(tmp_path / "s.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["status"] for row in rows] == ["finished"] * 2 + ["event"] * 2 + ["infeasible"] * 2
    assert float(rows[2]["lock.time [s]"]) == result.column("lock.time")[2] and rows[0]["lock.time [s]"] == ""
    assert [float(row["crank_length [m]"]) for row in rows] == [1.1, 1.1, 1.241, 1.241, 3.9, 3.9]
    document = json.loads(result.to_json(tmp_path / "s.json").read_text(encoding="utf-8"))
    assert document["complete"] and document["units"]["lock.crank"] == "rad"
    assert document["designs"][3]["measures"]["lock.crank"] == result.column("lock.crank")[3]
    figure = result.plot(tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    drawn = figure.axes[0].collections[0].get_array()
    assert np.ma.count_masked(drawn) == 4 and drawn.compressed()[0] == result.column("lock.time")[2]
    line = sweep(four_bar, {"crank_length": [1.1, 1.241]}).plot(measures=["lock.time"])
    assert [int(np.isfinite(curve.get_ydata()).sum()) for curve in line.axes[0].lines] == [1, 1]
    with pytest.raises(bc.InputError, match="measure"):
        result.plot(measures=["lock.tim"])


@pytest.mark.tier2
def test_the_command_writes_table_and_picture(four_bar, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    scene = str(four_bar.source)
    arguments = ["sweep", scene, "--vary", "crank_length=1.21:1.24:4", "--measure", "lock.time", "--threads", "2"]
    assert main([*arguments, "--out", "here"]) == 0
    out = capsys.readouterr().out
    assert "lock.time [s]" in out and "4 designs, 4 finished" in out
    assert sorted(path.name for path in (tmp_path / "here").iterdir()) == ["sweep.csv", "sweep.json", "sweep.png"]
    assert main(["sweep", scene, "--vary", "crank_length=4,5"]) == 1
    assert "the constraints cannot be satisfied" in capsys.readouterr().out
    assert main([*arguments[:4], "--set", "simulate.duration=1"]) == 1
    assert "no event 'lock' within 1 s" in capsys.readouterr().out
    assert main([*arguments[:4], "--measure", "lock.tim"]) == 2
    assert "did you mean 'lock.time'" in capsys.readouterr().err
    assert main([*arguments[:4], "--vary", "crank_length=1,2"]) == 2


def test_the_work_of_writing_tables_grows_with_the_number_of_designs_and_not_with_its_square(tmp_path, monkeypatch):
    """Whether an axis is numeric was found anew for each design: an interrupted sweep of 100,000 took hours to end."""
    from bellcrank.studies.designs import axes

    result = bc.sweep("pendulum", {"simulate.duration": [0.01 * k for k in range(1, 21)]})
    calls = []
    split = axes._split
    monkeypatch.setattr(axes, "_split", lambda value: calls.append(value) or split(value))
    result.to_json(tmp_path / "s.json"), result.to_csv(tmp_path / "s.csv")
    assert len(calls) <= len(result.designs)


def test_a_sample_has_the_lock_angles_of_its_crank_lengths(four_bar):
    vary = {"crank_length": "normal(1.22 m, 3 mm)", "preload": [1.9, 2.0]}
    result = sweep(four_bar, vary, sample=48, method="latin", seed=3)
    lengths = result.values[:, 0]
    assert result.shape == (2, 48) and set(result.status) == {"event"}
    np.testing.assert_allclose(result.column("lock.crank"), np.arccos(lock_cosine(lengths)), rtol=0, atol=1e-9)
    assert np.array_equal(result.values, sweep(four_bar, vary, sample=48, method="latin", seed=3).values)
    assert not np.array_equal(lengths, sweep(four_bar, vary, sample=48, seed=4).values[:, 0])
    times = result.grid("lock.time")
    assert times.shape == (2, 48) and np.all(times[0] > times[1])  # a weaker spring locks later


STUDY = """
study:
  vary:
    crank_length: normal(1.22 m, 3 mm)
    preload: [1.9, 2.0]
  sample: 8
  seed: 5
"""


@pytest.mark.tier2
def test_a_scene_says_what_it_varies(four_bar, tmp_path, capsys):
    path = tmp_path / "studied.yaml"
    path.write_text(SCENE + STUDY)
    written = bc.sweep(path)
    assert written.shape == (2, 8) and written.space.sample.identity == "8 points, method sobol, seed 5"
    told = sweep(four_bar, {"crank_length": "normal(1.22 m, 3 mm)", "preload": [1.9, 2.0]}, sample=8, seed=5)
    assert np.array_equal(written.values, told.values)
    assert np.array_equal(written.column("lock.time"), told.column("lock.time"))
    assert bc.sweep(path, sample=4, method="random").space.sample.identity == "4 points, method random, seed 5"
    assert main(["sweep", str(path), "--sample", "4", "--out", str(tmp_path / "out")]) == 0
    out = capsys.readouterr().out
    assert "8 designs, 8 finished" in out and "sample: 4 points, method sobol, seed 5" in out
    other = ["sweep", str(path), "--vary", "preload=1.9", "--out", str(tmp_path / "out")]
    assert main(other) == 0
    assert "note: --vary replaces what the scene varies under 'study'" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("study", "said"),
    [
        ("vary: {crank_length: 'normla(1, 2)'}", "study.vary.crank_length (line 21): unknown distribution 'normla'"),
        ("vary: {crank_length: normal(1, 2)}", "put 'normal(1'… in quotes"),
        ("vary: {crank_length: 1:2:3}", "a range in quotes"),  # YAML reads it as a number to base 60
        ("vary: {crank_length: 1.2}", "a range in quotes"),
        ("vary: {crank_lenght: [1.2]}", "crank_lenght"),
        ("sample: 0", "study.sample"),
        ("sample: 100000000", "at most 10000000"),
        ("method: sobl", "did you mean 'sobol'"),
        ("variation: 1", "unknown key 'variation'"),
        ("vary: {crank_length: 'normal(1.2, 0.01)'}", "say how many designs are drawn"),
    ],
)
def test_what_is_wrong_in_a_study_is_told_with_its_place(study, said, tmp_path):
    path = tmp_path / "studied.yaml"
    path.write_text(f"{SCENE}study: {{{study}}}\n")
    with pytest.raises(bc.InputError) as refused:
        bc.sweep(path)
    assert said in str(refused.value)


def test_what_a_sample_needs_is_asked_for(four_bar):
    for arguments, said in [
        ({"vary": {"crank_length": [1.2]}, "sample": 8}, "needs a parameter with a distribution"),
        ({"vary": {"crank_length": [1.2]}, "seed": 8}, "seed: belongs to a sample"),
        ({"vary": {"crank_length": "uniform(1, 2)"}, "sample": 8, "method": "sobl"}, "did you mean 'sobol'"),
        ({}, "nothing is varied"),
    ]:
        with pytest.raises(bc.InputError, match=said):
            sweep(four_bar, **arguments)


def test_a_run_of_designs_that_is_interrupted_keeps_those_that_are_done(four_bar, monkeypatch):
    """The executor gets the rows of a range of which only some are done."""
    from bellcrank.studies import sweep_plan

    class Interrupted(sweep_plan.SimulationRunner):
        def run(self, values, *, threads=1, progress=None):
            columns = super().run(values[::2], threads=threads)
            raise StudyInterrupted(np.arange(0, len(values), 2), columns)

    monkeypatch.setattr(sweep_plan, "SimulationRunner", Interrupted)
    result = sweep(four_bar, {"crank_length": np.linspace(1.21, 1.24, 9)})
    assert result.index.tolist() == [0, 2, 4, 6, 8] and not result.complete
    np.testing.assert_allclose(
        result.column("lock.crank"), np.arccos(lock_cosine(np.linspace(1.21, 1.24, 9)[::2])), rtol=0, atol=1e-9
    )


@pytest.mark.parametrize(
    ("scene", "paths", "target"),
    [
        ("four_bar", ("crank_length", "parameters.crank_length"), "crank_length"),
        ("four_bar", ("parameters.crank_length.value", "crank_length"), "crank_length"),
        ("four_bar", ("initial.coupler", "initial.coupler.guess"), "initial.coupler"),
        ("four_bar", ("initial.crank", " initial.crank"), "initial.crank"),
        ("spring_pendulum", ("initial.velocity.slide", "initial.velocity"), "initial.velocity"),
    ],
)
@pytest.mark.parametrize("size", [False, True])
def test_two_axes_of_one_quantity_are_refused(scene, paths, target, size):
    with pytest.raises(bc.InputError, match=f"both set '{target}'; keep one of them"):
        bc.sweep(scene, {path: [1.0, 1.1] for path in paths}, size=size)
