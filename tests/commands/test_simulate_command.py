"""`bellcrank simulate`: what it writes, how it ends, and what it refuses in one sentence."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.cli import main

ARM = """
name: Swinging arm
urdf: planar_2r
gravity: [0, -9.81, 0]
frames: {hand: {link: link_2, xyz: [1.1, 0, 0]}}
initial: {shoulder: 20 deg, elbow: 30 deg}
forces:
  - {kind: damper, joint: elbow, coefficient: 0.5}
simulate: {duration: 1, samples: 51}
"""


@pytest.fixture
def arm(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.yaml").write_text(ARM)
    (tmp_path / "taken").write_text("")
    return tmp_path


@pytest.mark.tier2
def test_it_prints_the_summary_and_writes_run_table_and_pictures(arm, capsys):
    assert main(["simulate", "arm.yaml", "--frame", "hand"]) == 0
    out, err = capsys.readouterr()
    run = bc.load_run("arm_run/run.npz")
    assert out.startswith(run.table()) and "energy drift" in out and err == ""
    assert sorted(p.name for p in Path("arm_run").iterdir()) == ["path_hand.png", "run.csv", "run.npz", "run.png"]
    assert len(Path("arm_run/run.csv").read_text().splitlines()) == 52
    assert all(p.read_bytes().startswith(b"\x89PNG") for p in Path("arm_run").glob("*.png"))


@pytest.mark.parametrize("command", ["simulate", "size", "select", "sweep"])
def test_an_empty_output_folder_is_refused(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    try:
        code = main([command, "planar_2r", "--out", ""])
    except SystemExit as stopped:
        code = stopped.code
    assert code == 2 and "argument --out: expected a path, found ''" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_it_has_help_and_stands_in_the_list_of_commands(capsys):
    for arguments in (["simulate", "--help"], ["--help"]):
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        assert ended.value.code == 0 and "simulate" in capsys.readouterr().out


def test_options_change_how_it_is_integrated(arm, capsys):
    options = ["--duration", "200 ms", "--solver", "RK4", "--step", "1 ms", "--samples", "11", "--no-plots"]
    assert main(["simulate", "arm.yaml", *options, "--out", "here"]) == 0
    run = bc.load_run("here/run.npz")
    assert (run.settings.solver, run.settings.step, len(run), run.time[-1]) == ("RK4", 0.001, 11, 0.2)
    assert run.statistics.steps == 200 and "step 0.001 s" in capsys.readouterr().out
    assert not list(Path("here").glob("*.png"))


def test_set_changes_the_scene_and_the_file_remembers_it(arm):
    changes = ["--set", "initial.shoulder=-90 deg", "--set", "forces.1.coefficient=2", "--set", "simulate.rtol=1e-7"]
    assert main(["simulate", "arm.yaml", *changes, "--no-plots"]) == 0
    run = bc.load_run("arm_run/run.npz")
    assert run.position[0, 0] == pytest.approx(-np.pi / 2, abs=1e-15)
    assert np.array_equal(run.joint("elbow").torque, -2.0 * run.joint("elbow").velocity)
    assert run.settings.rtol == 1e-7 and run.scene.data["forces"][0]["coefficient"] == 2


def test_options_win_over_set_and_set_over_the_file(arm):
    given = ["--set", "simulate.duration=0.5", "--duration", "0.25", "--set", "simulate.samples=6"]
    assert main(["simulate", "arm.yaml", *given, "--no-plots"]) == 0
    run = bc.load_run("arm_run/run.npz")
    assert (run.time[-1], len(run)) == (0.25, 6)


def test_the_error_estimate_is_of_the_size_of_the_true_error(arm, capsys):
    assert main(["simulate", "arm.yaml", "--rtol", "1e-6", "--atol", "1e-6", "--error-estimate", "--no-plots"]) == 0
    told = float(re.search(r"about (\S+) \(rad or m\) in positions", capsys.readouterr().out)[1])
    rough = bc.load_run("arm_run/run.npz")
    true = np.abs(rough.position - bc.simulate("arm.yaml", rtol=1e-12, atol=1e-12).position).max()
    assert 0.3 * true < told < 3.0 * true


def test_a_run_that_ends_early_keeps_its_files_and_exits_1_with_advice(arm, capsys):
    assert main(["simulate", "arm.yaml", "--set", "simulate.max_evaluations=200", "--no-plots"]) == 1
    out = capsys.readouterr().out
    assert "evaluations_spent" in out and "max_evaluations" in out and "wrote run.npz" in out
    run = bc.load_run("arm_run/run.npz")
    assert not run.success and 0.0 < run.time[-1] < 1.0
    assert run.energy_drift() < 1e-6


MASSLESS = """<robot name="vane"><link name="hub"/>
  <link name="blade"><inertial><origin xyz="0 0 0.1"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
  <joint name="turn" type="revolute"><parent link="hub"/><child link="blade"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="9"/></joint></robot>"""


def test_a_massless_floating_base_is_refused_with_exit_2(arm, capsys):
    Path("vane.urdf").write_text(MASSLESS)
    Path("vane.yaml").write_text(
        "urdf: vane.urdf\nfloating_base: true\nforces: [{kind: torque, joint: turn, value: 0.1}]\n"
    )
    assert main(["simulate", "vane.yaml", "--duration", "0.1", "--no-plots"]) == 2
    assert "has no inertia: the mass matrix is singular" in capsys.readouterr().err


def test_a_robot_without_a_joint_that_moves_is_refused_and_set_free_by_a_floating_base(arm, capsys):
    Path("stone.urdf").write_text(
        '<robot name="stone"><link name="rock"><inertial><mass value="2"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link></robot>'
    )
    assert main(["simulate", "stone.urdf"]) == 2
    assert "stone has no movable joint" in capsys.readouterr().err
    Path("falling.yaml").write_text("urdf: stone.urdf\nfloating_base: true\n")
    run = bc.simulate("falling.yaml", duration=1.0)
    assert np.allclose(run.state[-1, :3], [0.0, 0.0, -9.81 / 2], atol=1e-12)


def test_a_run_whose_energy_is_out_of_balance_exits_1(arm, capsys):
    assert main(["simulate", "arm.yaml", "--solver", "RK4", "--step", "0.25", "--no-plots"]) == 1
    assert "the energy balance is violated" in capsys.readouterr().out


def test_notes_are_of_the_duration_that_was_simulated(arm, capsys):
    Path("torque.csv").write_text("time [s],elbow torque [N m]\n0,0\n0.2,1\n")
    table = "forces=[{kind: torque, joint: elbow, file: torque.csv}]"
    assert main(["simulate", "arm.yaml", "--set", table, "--duration", "0.2", "--no-plots"]) == 0
    assert "  note " not in capsys.readouterr().out
    assert main(["simulate", "arm.yaml", "--set", table, "--duration", "0.3", "--no-plots"]) == 0
    assert "force 'torque': its table ends at 0.2 s and the run at 0.3 s" in capsys.readouterr().out


def test_the_list_of_robots_says_what_each_card_is_and_what_it_is_for(capsys):
    assert main(["robots"]) == 0
    head, *lines = capsys.readouterr().out.splitlines()
    assert head == "robot configurations and scenes:"
    configs = {line.split()[0]: line for line in lines[: lines.index("URDFs (bundled, and from example-robot-data):")]}
    assert re.fullmatch(r"  planar_2r +size, simulate +Planar 2R arm", configs["planar_2r"])
    assert re.fullmatch(r"  talos_free_fall +simulate +Talos in free fall", configs["talos_free_fall"])
    assert re.fullmatch(r"  xarm7 +size +xArm 7 stacking", configs["xarm7"])


def test_an_event_that_stops_the_run_is_a_good_end(arm, capsys):
    event = "events=[{name: level, when: {joint: shoulder, position: 0}, stop: true}]"
    assert main(["simulate", "arm.yaml", "--set", event, "--no-plots"]) == 0
    assert re.search(r"event 'level' ended the run\n.*\n.*\n  events +level at 0\.\d+ s", capsys.readouterr().out)


def test_the_folder_is_named_after_the_scene(arm):
    Path("deep").mkdir()
    Path("deep/other.yaml").write_text(ARM)
    assert main(["simulate", "deep/other.yaml", "--no-plots", "--duration", "0.1"]) == 0
    assert Path("other_run/run.npz").exists()


def test_a_second_run_replaces_the_files_of_the_first(arm):
    assert main(["simulate", "arm.yaml", "--no-plots"]) == 0
    before = Path("arm_run/run.npz").read_bytes()
    assert main(["simulate", "arm.yaml", "--no-plots", "--set", "initial.elbow=1"]) == 0
    assert Path("arm_run/run.npz").read_bytes() != before
    assert bc.load_run("arm_run/run.npz").position[0, 1] == 1.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["no_such_scene"], "no_such_scene"),
        (["nowhere.yaml"], "nowhere.yaml"),
        (["taken"], "taken"),
        (["arm.yaml", "--duration", "long"], "--duration"),
        (["arm.yaml", "--duration", "3 kg"], "kg"),
        (["arm.yaml", "--duration=-1"], "duration"),
        (["arm.yaml", "--duration", "nan"], "duration"),
        (["arm.yaml", "--solver", "DOP835"], "DOP853"),
        (["arm.yaml", "--rtol", "0"], "rtol"),
        (["arm.yaml", "--rtol", "1e-20"], "rtol"),
        (["arm.yaml", "--atol", "tiny"], "--atol"),
        (["arm.yaml", "--step", "0"], "step"),
        (["arm.yaml", "--solver", "RK4"], "step"),
        (["arm.yaml", "--samples", "1"], "samples"),
        (["arm.yaml", "--samples", "ten"], "--samples"),
        (["arm.yaml", "--samples", "10000000000000"], "--samples: expected at most 125000000 rows"),
        (["arm.yaml", "--set", "initial.shoulder"], "PATH=VALUE"),
        (["arm.yaml", "--set", "initial.shulder=1"], "shulder"),
        (["arm.yaml", "--set", "gravitation=1"], "gravitation"),
        (["arm.yaml", "--set", "initial.shoulder=fast"], "shoulder"),
        (["arm.yaml", "--set", "forces.2.coefficient=1"], "forces"),
        (["arm.yaml", "--set", "forces.1.coefficient=-1"], "coefficient"),
        (["arm.yaml", "--frame", "foot"], "foot"),
        (["arm.yaml", "--out", "taken"], "taken"),
        (["arm.yaml", "--out", "taken/below"], "taken"),
    ],
)
def test_bad_input_is_one_sentence_exit_2_and_no_file(arm, capsys, arguments, words):
    before = sorted(arm.rglob("*"))
    assert main(["simulate", *arguments]) == 2
    out, err = capsys.readouterr()
    assert err.startswith("bellcrank: ") and err.count("\n") == 1 and words in err, err
    assert out == "" and sorted(arm.rglob("*")) == before


def test_the_progress_is_reported_in_simulated_time(arm, monkeypatch):
    from bellcrank.commands import simulate as command

    seen = []

    class Bar:
        def __init__(self, total, **options):
            assert options["delay"] == 1.0
            self.total, self.n = total, 0.0

        def __enter__(self):
            return self

        def __exit__(self, *_):
            return False

        def update(self, step):
            self.n += step
            seen.append(self.n)

    monkeypatch.setattr("tqdm.tqdm", Bar)
    with command.simulation_progress(2.0) as progress:
        for t in (0.5, 1.5, 2.5):
            progress(t)
    assert seen == [0.5, 1.5, 2.0]


@pytest.mark.tier2
def test_ctrl_c_keeps_what_was_computed_and_exits_130(arm):
    assert main(["simulate", "arm.yaml", "--duration", "0.01", "--no-plots", "--out", "compiled"]) == 0
    command = [sys.executable, "-m", "bellcrank", "simulate", "arm.yaml", "--no-plots", "--duration", "1e6"]
    command += ["--samples", "2001", "--set", "simulate.max_step=1e-4"]
    marker = arm / "begun"
    script = (
        "import runpy, sys, pathlib\n"
        "import bellcrank.simulation.integration.integration as m\n"
        "whole = m.Integration.run\n"
        f"m.Integration.run = lambda *a, **k: (pathlib.Path({str(marker)!r}).touch(), whole(*a, **k))[1]\n"
        f"sys.argv = {command[2:]!r}\n"
        "runpy.run_module('bellcrank', run_name='__main__')\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ}
    )
    while not marker.exists():
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130 and "Traceback" not in err, err
    assert "interrupted" in out
    run = bc.load_run("arm_run/run.npz")
    assert run.status == "interrupted" and 1.0 < run.time[-1] < 1e6 and len(run) >= 1
    assert Path("arm_run/run.csv").exists()
    with np.load("arm_run/run.npz") as stored:
        assert json.loads(stored["about"].tobytes())["status"] == "interrupted"


def test_ctrl_c_before_the_first_step_leaves_no_files(arm, monkeypatch, capsys):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("bellcrank.scene.scene.load_scene", interrupt)
    assert main(["simulate", "arm.yaml"]) == 130
    assert "interrupted" in capsys.readouterr().err and not Path("arm_run").exists()


def test_sensitivities_are_written_with_units(tmp_path):
    assert main(["simulate", "four_bar", "--sensitivity", "crank_length", "--no-plots", "--out", str(tmp_path)]) == 0
    head = (tmp_path / "sensitivities.csv").read_text().splitlines()[0].split(",")
    assert head[:2] == ["time [s]", "d(crank position)/d(crank_length) [rad per m]"]
    with np.load(tmp_path / "sensitivities.npz") as arrays:
        assert arrays["names"].tolist() == ["crank_length"] and arrays["units"].tolist() == ["m"]
        assert arrays["position"].shape == (1, len(arrays["time"]), 3)
        assert arrays["event_time_derivatives"][0] == pytest.approx([340.5272541522], rel=1e-8)
