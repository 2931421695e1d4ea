"""Runs of many rows, steps or events: little memory beside their states, and what is left out is told."""

import csv
import io
import subprocess
import sys
import textwrap

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.commands import simulate as command
from bellcrank.files.csv_files import ROWS
from bellcrank.simulation.files.run_csv import columns
from bellcrank.simulation.trajectory import plot_panels, state_history
from bellcrank.simulation.trajectory.run_warnings import run_warnings

MEGABYTE = 2**20
CLOSED = {"duration": 1.0, "samples": 2500}
COUNTED = """
urdf: planar_2r
gravity: [0, -9.81, 0]
initial: {{shoulder: 20 deg}}
events:
  - {{name: often, when: {{expression: "sin(2*pi*1000*t + 0.1)"}}}}
  - {{name: seldom, when: {{expression: "t - {late}"}}}}
simulate: {{duration: {duration}, solver: RK4, step: 1.0e-3, samples: 11}}
"""


def peak_above_the_run(script: str, rows: int) -> float:
    """MB by which `script` raises the peak of a process above what it holds once the run `run` is there."""
    text = """
        import tempfile
        import bellcrank as bc

        def memory(name):
            return int(next(line.split()[1] for line in open("/proc/self/status") if line.startswith(name))) / 1024

        target = tempfile.TemporaryDirectory()
        path = target.name + "/run.csv"
        run = bc.simulate("planar_2r_swing", samples=3000)
        {script}  # loads whatever is loaded but once
        run = bc.simulate("planar_2r_swing", samples={rows})
        before = max(memory("VmRSS"), 0)
        peak = memory("VmHWM")
        {script}
        after = memory("VmHWM")
        print(len(run), after - before if after > peak else 0.0)
    """
    text = textwrap.dedent(text).replace("{script}", script).replace("{rows}", str(rows))
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    made, extra = done.stdout.split()[-2:]
    assert int(made) == rows
    return float(extra)


@pytest.mark.parametrize("scene", ["four_bar", "planar_2r_tracking", "two_wheeler"])
def test_a_csv_written_in_blocks_has_every_byte_of_one_written_whole(scene, tmp_path, monkeypatch):
    run = bc.simulate(scene, **CLOSED)
    labels, table = columns(run)
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow([f"{name} [{unit}]" for name, unit in labels])
    text.writelines(",".join(map(repr, row)) + "\n" for row in table.tolist())
    monkeypatch.setattr(state_history, "BLOCK_NUMBERS", 1)
    again, heard = bc.simulate(scene, **CLOSED), []
    assert len(list(again.parts())) == 3 and sum(map(len, again.parts())) == len(run) > 2 * ROWS
    assert (
        again.to_csv(tmp_path / "run.csv", lambda done, _: heard.append(done)).read_bytes() == text.getvalue().encode()
    )
    assert heard == [1024, 2048, len(run)]


@pytest.mark.parametrize("scene", ["four_bar", "planar_2r_tracking", "rolling_disk"])
def test_the_certificate_of_a_run_is_the_same_block_by_block(scene, monkeypatch):
    def certificate(run):
        drifts = run.energy_drift(), run.equation_residual(), run.constraint_residual(), run.velocity_residual()
        return drifts, run_warnings(run), run.table().splitlines()[-3:]

    whole = certificate(bc.simulate(scene, **CLOSED))
    monkeypatch.setattr(state_history, "BLOCK_NUMBERS", 1)
    assert certificate(bc.simulate(scene, **CLOSED)) == whole and whole[0][0] > 0.0


def test_rows_of_a_run_are_a_run_with_their_own_quantities():
    run = bc.simulate("planar_2r_swing", samples=2048)
    part = run.part(slice(1024, 1032))
    assert len(part) == 8 and np.array_equal(part.time, run.time[1024:1032])
    assert np.array_equal(part.acceleration, run.acceleration[1024:1032])  # computed before the run's are known
    assert np.array_equal(run.part(slice(5, 9)).torque, run.torque[5:9])  # and after


@pytest.mark.tier2
def test_writing_a_csv_needs_no_more_memory_for_more_rows():
    assert peak_above_the_run("run.to_csv(path)", 120_000) < 60.0  # 30 MB of text alone, and 140 MB made of it at once


@pytest.mark.tier2
def test_the_summary_and_the_picture_of_a_long_run_need_little_memory():
    assert peak_above_the_run("run.table(), run.plot()", 300_000) < 90.0  # of all rows at once 190 MB


def test_a_picture_of_a_long_run_keeps_every_peak(monkeypatch):
    run = bc.simulate("four_bar", duration=2.0, samples=3000)
    whole = {panel.title: panel for panel in plot_panels.run_panels(run)}
    monkeypatch.setattr(plot_panels, "LONG", 1000)
    monkeypatch.setattr(plot_panels, "DRAWN", 1000)
    monkeypatch.setattr(state_history, "BLOCK_NUMBERS", 1)
    panels = plot_panels.run_panels(bc.simulate("four_bar", duration=2.0, samples=3000))
    assert [panel.title for panel in panels] == list(whole)
    table = dict(plot_panels.linear_panels(run)[0].lines)
    for panel in panels:
        assert panel.extremes and panel.time[0] == 0.0 and panel.time[-1] == run.time[-1] and len(panel.time) <= 1100
    for name, values in panels[0].lines:
        assert values.min() == table[name].min() and values.max() == table[name].max()


@pytest.mark.tier2
def test_of_many_steps_some_are_kept_the_longest_is_known_and_the_result_says_so(tmp_path):
    few = bc.simulate("planar_2r_swing", solver="RK4", step=1e-3, duration=77.7777)
    assert len(few.steps) == few.statistics.steps + 1 == 77_779 and "are kept" not in few.table()
    run = bc.simulate("planar_2r_swing", solver="RK4", step=1e-4, duration=77.77775)
    steps = run.statistics.steps
    assert steps == 777_778 and 50_000 < len(run.steps) <= 100_002
    assert run.steps[0] == 0.0 and run.steps[-1] == run.time[-1] == 77.77775
    assert run.steps[:-1] == pytest.approx(8e-4 * np.arange(len(run.steps) - 1), rel=1e-15, abs=1e-13)
    assert run.statistics.longest_step == pytest.approx(1e-4, rel=1e-9)
    assert f"{steps} steps" in run.table() and f"the times of {len(run.steps) - 1} steps are kept" in run.table()
    path = run.save(tmp_path / "run")
    assert path.stat().st_size < 2 * MEGABYTE
    again = bc.load_run(path)
    assert np.array_equal(again.steps, run.steps) and again.statistics == run.statistics


@pytest.mark.tier2
def test_of_many_events_the_first_and_last_of_each_are_kept_and_all_are_counted(tmp_path):
    path = tmp_path / "counted.yaml"
    path.write_text(COUNTED.format(duration=60, late=55.00025))
    run = bc.simulate(path)
    kept = [event.name for event in run.events]
    omitted = run.statistics.omitted_events
    assert kept.count("often") + omitted["often"] == 2000 * 60 and list(omitted) == ["often"]
    times = np.array([event.time for event in run.events])
    assert np.all(np.diff(times) >= 0.0) and len(kept) == 100_002
    assert run.events[-2].name == "seldom" and run.events[-2].time == pytest.approx(55.00025)
    last = (2000 * 60 - 0.1 / np.pi) / 2000.0
    assert run.events[-1].time == pytest.approx(last, abs=1e-9)
    assert "120001 events in all (100002 are kept)" in run.table()


def test_of_few_events_none_is_left_out(tmp_path):
    path = tmp_path / "counted.yaml"
    path.write_text(COUNTED.format(duration=0.5, late=0.25))
    run = bc.simulate(path)
    assert len(run.events) == 1001 and run.statistics.omitted_events == {}
    assert "1001 events in all; the last" in run.table()


def test_the_command_writes_a_csv_of_many_rows_only_where_it_is_asked_for(tmp_path, monkeypatch, capsys):
    from bellcrank.cli import main

    monkeypatch.setattr(command, "CSV_ROWS", 100)
    asked = ["simulate", "planar_2r_swing", "--no-plots", "--out", str(tmp_path)]
    assert main([*asked, "--samples", "100"]) == 0 and (tmp_path / "run.csv").exists()
    assert "was not written" not in capsys.readouterr().out
    earlier = (tmp_path / "run.csv").read_bytes()
    assert main([*asked, "--samples", "101"]) == 0
    told = capsys.readouterr().out
    assert (
        "run.csv was not written: the run has 101 rows" in told
        and "--csv" in told
        and "belongs to an earlier run" in told
    )
    assert (tmp_path / "run.csv").read_bytes() == earlier and len(bc.load_run(tmp_path / "run.npz")) == 101
    assert main([*asked, "--samples", "101", "--csv"]) == 0
    assert len((tmp_path / "run.csv").read_text().splitlines()) == 102


def test_a_motion_written_in_blocks_reads_as_it_was(tmp_path):
    joints = bc.load_robot("planar_2r").joints
    time = np.linspace(0.0, 1.0, 2 * ROWS + 7)
    q = np.column_stack([np.sin(3.0 * time), time**3])
    v = np.column_stack([3.0 * np.cos(3.0 * time), 3.0 * time**2])
    a = np.column_stack([-9.0 * np.sin(3.0 * time), 6.0 * time])
    motion = bc.Motion(joints, time, q, v, a, "wave")
    path = bc.write_motion(motion, tmp_path / "wave.csv", torque=q)
    lines = path.read_text().splitlines()
    assert len(lines) == len(time) + 1
    table = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    assert np.array_equal(table, np.column_stack([time, q, v, a, q]))
