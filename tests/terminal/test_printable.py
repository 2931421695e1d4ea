"""Names from files on terminals and in CSV files: shown, not obeyed."""

import csv
import io
import sys

import pytest

import bellcrank as bc
from bellcrank import InputError
from bellcrank.cli import main
from bellcrank.files.csv_files import guarded, unguarded
from bellcrank.messages import printable
from bellcrank.terminal.streams import printable_streams

ARM = """<robot name="r{evil}"><link name="base"/><link name="arm"><inertial><origin xyz="0 0 -0.5"/><mass value="1"/>
<inertia ixx="0.1" iyy="0.1" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="{joint}" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-9" upper="9" effort="10" velocity="10"/></joint></robot>"""


def scene(folder, joint, name="Arm", evil=""):
    (folder / "arm.urdf").write_text(ARM.format(joint=joint, evil=evil), encoding="utf-8")
    (folder / "arm.yaml").write_text(
        f'name: "{name}"\nurdf: arm.urdf\ninitial: {{"{joint}": 0.5}}\n'
        f'outputs: {{"{joint} out": {{expression: t, unit: s}}}}\nsimulate: {{duration: 0.2, samples: 5}}\n',
        encoding="utf-8",
    )
    return folder / "arm.yaml"


def controls(text):
    return [c for c in text if c != "\n" and (not c.isprintable() and c not in "\t\u00a0")]


@pytest.mark.parametrize("evil", ["\\e[31mred", "\\e]0;title\\a", "\\u202Edrawkcab", "\\x9b2J", "a\\rb", "\\u2028"])
def test_escape_codes_in_names_are_shown_on_the_terminal(tmp_path, monkeypatch, capsys, evil):
    monkeypatch.chdir(tmp_path)
    path = scene(tmp_path, "swing", name=f"Arm {evil}")
    assert main(["simulate", str(path), "--out", "out", "--no-plots"]) == 0
    told = capsys.readouterr()
    assert controls(told.out) == controls(told.err) == [] and "Arm" in told.out
    shown = {"\\e": "\\x1b", "\\a": "\\x07", "\\u202E": "\\u202e"}
    for written, escaped in shown.items():
        if written in evil:
            assert escaped in told.out


def test_escape_codes_in_errors_are_shown_wherever_they_are_printed(tmp_path, capsys):
    path = scene(tmp_path, "swing")
    path.write_text(path.read_text() + '"ke\\ey\\e[2J": 1\n')
    with pytest.raises(InputError) as caught:
        bc.load_scene(path)
    assert "\x1b" not in str(caught.value) and "\\x1b" in str(caught.value)
    assert main(["simulate", str(path)]) == 2
    assert main(["check", "\x1b[31m.urdf"]) == 2
    assert controls(capsys.readouterr().err) == []


def test_text_stays_and_bars_of_progress_keep_their_codes(capsys):
    text = "µ ² 名前 é\u0301 \U0001f600 a\tb\nc"
    assert printable(text) == text
    assert printable("\x00\x1b\x7f\x85\u202e\u2066") == "\\x00\\x1b\\x7f\\x85\\u202e\\u2066"
    with printable_streams():
        sys.stderr.write("\r 50%|█████     | \x1b[31m")
        sys.stderr.write("\n\x1b[A")
        print("\x1b[A", "x")
    told = capsys.readouterr()
    assert told.err == "\r 50%|█████     | \\x1b[31m\n\x1b[A" and told.out == "\\x1b[A x\n"


FORMULAS = ["=cmd|' /C calc'!A0", "@SUM(1)", "+1", "-1", "＝1", "'=1", "''+x", "\tx", "'"]


def test_cells_that_would_be_formulas_come_back_as_they_were():
    for text in [*FORMULAS, "x", "'x", "", "a=b", "time [s]"]:
        (cell,) = guarded([text])
        assert unguarded(str(cell)) == text
        assert not str(cell).startswith(("=", "+", "-", "@", "\t", "＝"))
    assert guarded([-1.5, 3, None]) == [-1.5, 3, None]


@pytest.mark.tier2
@pytest.mark.parametrize("joint", ["=1+1", "@SUM(1)", "+joint", "-joint", "'=1"])
def test_csv_files_hold_names_as_text_and_are_read_back(tmp_path, joint):
    path = scene(tmp_path, joint)
    run = bc.simulate(path)
    file = run.to_csv(tmp_path / "run.csv")
    rows = list(csv.reader(io.StringIO(file.read_text(encoding="utf-8"))))
    assert all(not title.startswith(("=", "+", "-", "@")) for title in rows[0])
    assert any(value.startswith("-") for row in rows[1:] for value in row)  # numbers stay numbers
    motion = bc.read_motion(run.robot, file)
    assert motion.joints[0].name == joint and (motion.position == run.position).all()
    sizing = bc.size(run.robot, motion)
    cells = list(csv.reader(io.StringIO(sizing.to_csv(tmp_path / "sizing.csv").read_text(encoding="utf-8"))))[1]
    assert unguarded(cells[0]) == joint != cells[0]
    assert not any(cell.startswith(("=", "@", "+")) for cell in cells)
    again = bc.read_motion(run.robot, bc.write_motion(motion, tmp_path / "again.csv"))
    assert (again.velocity == motion.velocity).all()
    table = {"forces": [{"kind": "torque", "joint": joint, "file": "run.csv"}]}
    assert bc.simulate(path, overrides=table).success


def test_a_sweep_writes_texts_of_an_axis_as_text(tmp_path):
    path = scene(tmp_path, "swing")
    sweep = bc.sweep(path, {"simulate.solver": ["RK45", "DOP853"]})
    assert (sweep.to_csv(tmp_path / "sweep.csv")).read_text().splitlines()[1].startswith("RK45,finished,")


def test_a_message_has_at_most_1200_letters_and_keeps_its_beginning_and_its_end(tmp_path):
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    link = f'<link name="{{0}}">{inertial}</link>'
    joint = '<joint name="{0}" type="continuous"><parent link="{1}"/><child link="{2}"/><axis xyz="0 0 1"/></joint>'
    names = [f"j{k}_{'x' * 150}" for k in range(100)]
    chain = [link.format(f"l{k + 1}") + joint.format(name, f"l{k}", f"l{k + 1}") for k, name in enumerate(names)]
    (tmp_path / "long.urdf").write_text(f'<robot name="long"><link name="l0"/>{"".join(chain)}</robot>')
    (tmp_path / "long.yaml").write_text("urdf: long.urdf\ninitial: {gone: 1}\n")
    with pytest.raises(InputError) as refused:
        bc.load_scene(tmp_path / "long.yaml")
    message = str(refused.value)
    assert len(message) == 1200 and "unknown joint 'gone'" in message and message.endswith("(100 in all))")
