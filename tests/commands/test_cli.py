"""The command line: bad input is one sentence and exit 2, and leaves nothing half-written."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bellcrank.cli import main

URDF = """<?xml version="1.0"?>
<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.5 0 0"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.2"/></inertial></link>
  <link name="fore"><inertial><origin xyz="0.5 0 0"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="tip"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="80" velocity="3"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="1 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="40" velocity="3"/></joint>
  <joint name="end" type="fixed"><parent link="fore"/><child link="tip"/><origin xyz="1 0 0"/></joint>
</robot>
"""
CSV = """time [s],shoulder position [rad],elbow position [rad]
0,0.0,0.5
0.5,0.1,0.6
1.0,0.3,0.9
1.5,0.4,1.0
"""
CARD = """name: Arm
urdf: arm.urdf
motions:
  swing: {kind: waypoints, times: [0, 1, 2], positions: [{elbow: 0.5}, {elbow: 1.0}, {elbow: 0.5}]}
  ring: {kind: circle, frame: tip, center: [1.2, 0, 0.4], radius: 0.2, duration: 4, normal: [0, 1, 0],
         start: {elbow: 1.2}}
actuators:
  elbow: {ratio: 100, efficiency: 0.8, rotor_inertia: 1.0e-5, gear_inertia: 0, rated_torque: 0.5, peak_torque: 1.5,
          rated_speed: 300, max_speed: 400, safety_factor: 1.2}
"""

# (what is broken, which file, old text, new text, a piece of the sentence)
BROKEN = [
    ("truncated XML", "arm.urdf", URDF[-400:], "", "arm.urdf"),
    ("empty URDF", "arm.urdf", URDF, "", "empty"),
    ("no robot element", "arm.urdf", URDF, "<html/>", "robot"),
    ("NaN mass", "arm.urdf", 'mass value="2"', 'mass value="nan"', "mass"),
    ("infinite inertia", "arm.urdf", 'izz="0.2"', 'izz="inf"', "izz"),
    ("negative mass", "arm.urdf", 'mass value="2"', 'mass value="-2"', "mass"),
    ("mass is a word", "arm.urdf", 'mass value="2"', 'mass value="two"', "two"),
    ("link named twice", "arm.urdf", '<link name="tip"/>', '<link name="tip"/><link name="tip"/>', "tip"),
    ("joint named twice", "arm.urdf", 'joint name="elbow"', 'joint name="shoulder"', "shoulder"),
    ("unknown child link", "arm.urdf", 'child link="tip"', 'child link="top"', "top"),
    ("unknown parent link", "arm.urdf", 'parent link="fore"', 'parent link="four"', "four"),
    ("two roots", "arm.urdf", '<link name="base"/>', '<link name="base"/><link name="other"/>', "root"),
    ("a loop", "arm.urdf", 'parent link="base"', 'parent link="tip"', "loop|root"),
    ("two parents", "arm.urdf", 'child link="tip"', 'child link="upper"', "upper"),
    ("unknown joint type", "arm.urdf", 'name="elbow" type="revolute"', 'name="elbow" type="screw"', "screw"),
    ("zero axis", "arm.urdf", '<axis xyz="0 1 0"/>\n    <limit lower="-3" upper="3" effort="80"',
     '<axis xyz="0 0 0"/>\n    <limit lower="-3" upper="3" effort="80"', "axis"),
    ("axis of two numbers", "arm.urdf", '<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="40"',
     '<axis xyz="0 1"/><limit lower="-3" upper="3" effort="40"', "axis|xyz"),
    ("mimic of nobody", "arm.urdf", 'effort="40" velocity="3"/>',
     'effort="40" velocity="3"/><mimic joint="wrist"/>', "wrist"),
    ("mimic of itself", "arm.urdf", 'effort="40" velocity="3"/>',
     'effort="40" velocity="3"/><mimic joint="elbow"/>', "elbow"),
    ("xacro left in", "arm.urdf", '<link name="tip"/>', '<link name="tip"/><xacro:include filename="x"/>', "xacro"),
    ("empty CSV", "motion.csv", CSV, "", "empty"),
    ("CSV without rows", "motion.csv", CSV[CSV.index("\n0,"):], "\n", "row"),
    ("missing column", "motion.csv", ",elbow position [rad]", "", "elbow|column"),
    ("unknown column", "motion.csv", "elbow position", "wrist position", "wrist"),
    ("wrong unit", "motion.csv", "elbow position [rad]", "elbow position [kg]", "kg"),
    ("no unit", "motion.csv", "time [s]", "time", "unit|\\[s\\]"),
    ("time runs backwards", "motion.csv", "1.0,0.3", "0.2,0.3", "time"),
    ("a word for a number", "motion.csv", "0.3,0.9", "0.3,far", "far"),
    ("not a number", "motion.csv", "0.3,0.9", "0.3,nan", "nan|finite"),
    ("a row too short", "motion.csv", "0.3,0.9", "0.3", "row|line"),
    ("bad YAML", "arm.yaml", "name: Arm", "name: [Arm", "arm.yaml"),
    ("empty configuration", "arm.yaml", CARD, "", "empty"),
    ("a list for a configuration", "arm.yaml", CARD, "- 1\n- 2\n", "mapping"),
    ("unknown key", "arm.yaml", "urdf: arm.urdf", "urdf: arm.urdf\ngravitation: [0, 0, -9.81]", "gravitation"),
    ("key twice", "arm.yaml", "name: Arm", "name: Arm\nname: Arm", "twice|duplicate"),
    ("missing URDF", "arm.yaml", "urdf: arm.urdf", "urdf: leg.urdf", "leg.urdf"),
    ("unknown frame", "arm.yaml", "frame: tip", "frame: top", "top"),
    ("unreachable circle", "arm.yaml", "center: [1.2, 0, 0.4]", "center: [2.2, 0, 0.4]", "reach"),
    ("circle off the arm's plane", "arm.yaml", "center: [1.2, 0, 0.4]", "center: [1.2, 0.3, 0.4]", "reach|0\\.3"),
    ("radius below zero", "arm.yaml", "radius: 0.2", "radius: -0.2", "radius"),
    ("unknown motion kind", "arm.yaml", "kind: circle", "kind: spiral", "spiral"),
    ("unknown joint in start", "arm.yaml", "start: {elbow", "start: {elbo", "elbo"),
    ("wrong unit of radius", "arm.yaml", "radius: 0.2", "radius: 0.2 kg", "kg"),
    ("times not increasing", "arm.yaml", "times: [0, 1, 2]", "times: [0, 1, 1]", "times|increas"),
    ("drive of an unknown joint", "arm.yaml", "actuators:\n  elbow:", "actuators:\n  wrist:", "wrist"),
    ("efficiency above one", "arm.yaml", "efficiency: 0.8", "efficiency: 80", "efficiency"),
    ("NaN in a drive", "arm.yaml", "ratio: 100", "ratio: .nan", "ratio"),
    ("drive lacks a number", "arm.yaml", "ratio: 100, ", "", "ratio"),
]  # fmt: skip


@pytest.fixture
def arm(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in (("arm.urdf", URDF), ("motion.csv", CSV), ("arm.yaml", CARD)):
        (tmp_path / name).write_text(text)
    return tmp_path


def size_of(file):
    return ["size", "arm.yaml"] if file == "arm.yaml" else ["size", "arm.urdf", "--motion", "motion.csv"]


@pytest.mark.tier2
def test_the_unbroken_files_are_sized(arm):
    assert main(["size", "arm.yaml", "--out", "a", "--no-plots"]) == 0
    assert main(["size", "arm.urdf", "--motion", "motion.csv", "--out", "b", "--no-plots"]) == 1  # few rows


@pytest.mark.parametrize(("file", "old", "new", "words"), [b[1:] for b in BROKEN], ids=[b[0] for b in BROKEN])
def test_bad_input_is_one_sentence_exit_2_and_no_file(arm, capsys, file, old, new, words):
    text = (arm / file).read_text()
    assert old in text
    (arm / file).write_text(text.replace(old, new))
    before = sorted(arm.rglob("*"))
    assert main(size_of(file)) == 2
    out, err = capsys.readouterr()
    assert err.startswith("bellcrank: ") and err.count("\n") == 1 and "Traceback" not in err, err
    assert re.search(words, err), err
    assert sorted(arm.rglob("*")) == before, out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["size", "no_such_robot"], "no_such_robot"),
        (["size", "ur5/nowhere.urdf"], "nowhere.urdf"),
        (["size", "arm.yaml", "--motion", "jump"], "jump"),
        (["size", "arm.yaml", "--motion", "jump.csv"], "jump.csv"),
        (["size", "arm.yaml", "--payload", "tip"], "MASS@FRAME"),
        (["size", "arm.yaml", "--payload=-1@tip"], "more than 0"),
        (["size", "arm.yaml", "--payload", "1@hand"], "hand"),
        (["size", "arm.yaml", "--mass-tolerance", "150%"], "150%"),
        (["size", "arm.yaml", "--out", "arm.urdf/below"], "arm.urdf"),
        (["size", "arm.urdf"], "motion"),
        (["check", "nowhere.urdf"], "nowhere.urdf"),
        (["verify", "ur5"], "ur5"),
        (["bench", "--dynamics", "ur5", "--samples", "3"], "--samples"),
    ],
)
def test_bad_arguments_are_one_sentence_and_exit_2(arm, capsys, arguments, words):
    before = sorted(arm.rglob("*"))
    assert main(arguments) == 2
    err = capsys.readouterr().err
    assert err.startswith("bellcrank: ") and err.count("\n") == 1 and words in err, err
    assert sorted(arm.rglob("*")) == before


@pytest.mark.tier2
def test_bench_times_and_agrees_with_pinocchio(arm, capsys):
    assert main(["bench", "--dynamics", "planar_2r", "--samples", "256", "--out", "figures"]) == 0
    out = capsys.readouterr().out
    assert "libpinocchio" in out and "from the cache" in out
    assert Path("figures/bench.json").exists()


def test_help_and_import_load_nothing_heavy():
    script = (
        "import sys, bellcrank, bellcrank.cli\nprint([m for m in ('numpy', 'pinocchio', 'casadi') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout == "[]\n"


@pytest.mark.tier2
def test_ctrl_c_stops_cleanly_and_leaves_no_half_written_file(arm):
    command = [sys.executable, "-m", "bellcrank", "bench", "--dynamics", "talos", "--out", "figures"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"})
    time.sleep(3.0)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130 and "interrupted" in err and "Traceback" not in err
    assert not Path("figures").exists()


def test_a_fault_of_ours_is_not_the_answer_no(monkeypatch, capsys):
    def fail(name):
        raise ZeroDivisionError("ours")

    monkeypatch.setattr("bellcrank_bench.verification.verify.verify", fail)
    assert main(["verify", "planar_2r"]) == 70
    assert "fault of bellcrank" in capsys.readouterr().err


@pytest.mark.tier2
@pytest.mark.parametrize(("coding", "target", "status"), [("utf-8", "/dev/full", 2), ("ascii", os.devnull, 0)])
def test_a_full_disk_or_a_plain_terminal_under_the_table(arm, coding, target, status):
    with open(target, "w") as output:  # noqa: PTH123  a device
        done = subprocess.run(
            [sys.executable, "-m", "bellcrank", "size", "arm.yaml", "--no-plots"],
            stdout=output,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONIOENCODING": coding},
            check=False,
        )
    assert done.returncode == status and "Traceback" not in done.stderr, done.stderr
