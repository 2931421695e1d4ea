"""`bellcrank replay`, `bc.replay` and `show`: what they write, and what they refuse in one sentence."""

import argparse
import math
import sys
import types

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.commands import replay as command
from bellcrank.errors import BellcrankError, InputError
from bellcrank.replays import replay as module
from bellcrank.replays.page.page import page_html
from bellcrank.replays.replay import NotebookPage, film_of, replay, show

ARM = """
name: Swinging <arm>
urdf: planar_2r
gravity: [0, -9.81, 0]
initial: {shoulder: 20 deg, elbow: 30 deg}
simulate: {duration: 1, samples: 51}
"""
STOPPED = ARM + "  \nevents:\n  - {name: low, when: {joint: shoulder, position: 0}, stop: true}\n"


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.yaml").write_text(ARM)
    (tmp_path / "taken").write_text("")
    (tmp_path / "sized").mkdir()
    (tmp_path / "sized" / "sizing.json").write_text("{}")
    return tmp_path


def given(*words):
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return command.run(parser.parse_args(list(words)))


# ---- the command


def test_a_scene_is_simulated_and_its_page_written_beside(here, capsys):
    assert given("arm.yaml") == 0
    out = capsys.readouterr().out
    assert "Swinging <arm>: finished at 1 s" in out and "wrote arm.html (" in out
    text = (here / "arm.html").read_text(encoding="utf-8")
    assert text.lower().startswith("<!doctype html>") and "<title>Swinging &lt;arm&gt;" in text and "<arm>" not in text


def test_meshes_are_simplified_unless_all_of_their_faces_are_asked_for(here, capsys):
    steps = range(21)
    corners = "".join(f"v {x / 20} {y / 20} 0\n" for x in steps for y in steps)
    sheet = "".join(
        f"f {k} {k + 21} {k + 22} {k + 1}\n" for x in range(20) for y in range(20) for k in [21 * x + y + 1]
    )
    (here / "sheet.obj").write_text(corners + sheet)
    (here / "sheet.urdf").write_text(
        '<robot name="sheet"><link name="base"/><link name="sheet"><inertial><mass value="1"/><inertia ixx="1" iyy="1" '
        'izz="1" ixy="0" ixz="0" iyz="0"/></inertial><visual><geometry><mesh filename="sheet.obj"/></geometry></visual>'
        '</link><joint name="turn" type="continuous"><parent link="base"/><child link="sheet"/>'
        '<origin xyz="0 0 1"/><axis xyz="0 1 0"/></joint></robot>'
    )
    assert given("sheet.urdf", "--out", "few") == 0
    assert "meshes simplified from 800 to 2 faces" in " ".join(capsys.readouterr().out.split())
    assert given("sheet.urdf", "--full-meshes", "--out", "all") == 0
    assert "simplified" not in capsys.readouterr().out


def test_a_run_is_replayed_from_its_file_and_from_its_folder(here, capsys):
    bc.simulate("arm.yaml").save("arm_run/run.npz")
    assert given("arm_run") == given("arm_run/run.npz", "--out", "twice") == 0
    assert (here / "arm_run.html").read_bytes() == (here / "twice.html").read_bytes()
    assert given("arm_run/run.npz", "--no-plots", "--trace", "link_2", "--out", "pages/bare.html") == 0
    assert 0 < (here / "pages" / "bare.html").stat().st_size < (here / "twice.html").stat().st_size
    capsys.readouterr()


def test_a_card_with_drives_is_sized_unless_it_is_to_be_simulated(here, capsys):
    assert given("planar_2r", "--out", "sized.html") == 0
    assert "All inside" in capsys.readouterr().out
    assert given("planar_2r", "--simulate", "--out", "swung.html") == 0
    assert "finished at 10 s" in capsys.readouterr().out


def test_a_urdf_is_sized_over_a_motion_from_a_file(here, capsys):
    head = "time [s],shoulder position [deg],elbow position [deg]\n"
    (here / "few.csv").write_text(f"{head}0,9,0\n0.5,8,1\n1,7,2\n1.5,7,3\n")
    assert given("planar_2r", "--motion", "few.csv", "--out", "few.html") == 1
    assert "Not known: peaks that the rows of a motion do not determine" in capsys.readouterr().out
    rows = [f"{0.02 * k},{8 + math.cos(math.pi * k / 75):.9f},{0.04 * k:.9f}\n" for k in range(76)]
    (here / "go.csv").write_text(head + "".join(rows))
    assert given("planar_2r", "--motion", "go.csv", "--out", "go.html") == 0
    assert "go" in (here / "go.html").read_text(encoding="utf-8") and "finished" not in capsys.readouterr().out


def test_what_a_reader_should_know_of_a_run_is_told_on_screen_and_at_the_top_of_its_page(here, capsys):
    (here / "far.yaml").write_text(ARM + "forces: [{kind: torque, joint: elbow, value: 300}]\n")
    assert given("far.yaml") == 1
    assert "not known: joint 'elbow' leaves its range" in capsys.readouterr().out
    film = film_of(bc.simulate("far.yaml"))
    assert [name for name, _ in film.facts[:2]] == ["ended", "not known"]


def test_a_limit_that_is_exceeded_is_exit_1(here, capsys):
    config = ARM + "motions: {go: {kind: waypoints, times: [0, 0.1], positions: [{elbow: 0}, {elbow: 3}]}}\n"
    drive = "{ratio: 1, rated_torque: 1, peak_torque: 2, rated_speed: 1, max_speed: 2}"
    (here / "weak.yaml").write_text(config + f"actuators: {{elbow: {drive}}}\n")
    assert given("weak.yaml") == 1 and (here / "weak.html").is_file()
    capsys.readouterr()


@pytest.mark.tier2
@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["arm.yaml", "--out", "taken/page.html"], "--out taken/page.html: taken is a file; expected a folder"),
        (["arm.yaml", "--out", "."], "--out .: is a folder; expected a file such as replay.html"),
        (["gone.npz"], "gone.npz: there is no such file"),
        (["."], "there is no run.npz in this folder; `bellcrank simulate SCENE` writes one"),
        (["arm.yaml", "--trace", "tipp"], "trace: unknown frame 'tipp'; did you mean 'tip'"),
        (["sized"], "this folder holds the results of a sizing, not its motions; name the configuration or URDF"),
        (["sized/sizing.json"], "sized/sizing.json: results in JSON hold no motion; expected a saved run (.npz"),
        (["arm.yaml", "--png", "a.png", "--at", "2"], "a still at 2 s: expected a time from 0 s to 1 s"),
        (["four_baar"], "unknown scene or robot 'four_baar', and no file of that name"),
        (["arm.yaml", "--size"], "there is no motion to size over"),
        ([".", "--simulate"], "--simulate is for a scene or configuration, and . is a saved run"),
    ],
)
def test_what_cannot_be_shown_is_refused_in_one_sentence_and_leaves_nothing(here, words, sentence):
    before = sorted(path.name for path in here.iterdir())
    with pytest.raises(BellcrankError) as caught:
        given(*words)
    assert sentence in str(caught.value) and "\n" not in str(caught.value)
    assert sorted(path.name for path in here.iterdir()) == before


def test_a_damaged_run_is_refused(here):
    path = bc.simulate("arm.yaml").save("run.npz")
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(InputError, match="not a run, or damaged"):
        given("run.npz")


# ---- Python and notebooks


def test_replay_names_the_page_after_the_scene_and_takes_a_path_without_a_suffix(here):
    run = bc.simulate("arm.yaml")
    assert replay(run).name == "arm.html" and replay(run, here / "sub" / "page").name == "page.html"
    assert "<title>Mine" in replay(run, "x.html", title="Mine").read_text(encoding="utf-8")


def test_a_motion_is_replayed_with_its_robot_and_refused_without(here):
    robot = bc.load_robot("planar_2r", gravity=(0, -9.81, 0))
    motion = bc.waypoints(robot, [0.0, 1.0], [{"elbow": 0.0}, {"elbow": 1.0}])
    assert replay(motion, "m.html", robot=robot).is_file()
    with pytest.raises(InputError, match="a motion does not hold its robot; pass robot=ROBOT, too"):
        replay(motion, "n.html")
    with pytest.raises(InputError, match="holds a value that is not finite, in row 1"):
        bc.Motion(robot.joints, [0.0, 1.0], [[0, 0], [np.nan, 0]], np.zeros((2, 2)), np.zeros((2, 2)))


def test_what_is_no_run_is_refused(here):
    with pytest.raises(
        InputError,
        match="'source': expected a run, a motion, a fastest motion, a sizing, "
        "a selection, or the path of a run, found an empty mapping",
    ):
        replay({})
    with pytest.raises(InputError, match="'detail': unknown choice 'some'"):
        film_of(bc.simulate("arm.yaml"), detail="some")


def test_in_a_notebook_the_page_stands_inline_and_escaped(here, monkeypatch):
    run = bc.simulate("arm.yaml")
    shell = types.SimpleNamespace(kernel=object())
    monkeypatch.setitem(sys.modules, "IPython", types.SimpleNamespace(get_ipython=lambda: shell))
    shown = replay(run)
    assert isinstance(shown, NotebookPage) and not (here / "arm.html").exists()
    frame = shown._repr_html_()
    assert frame.lower().startswith('<iframe srcdoc="&lt;!doctype html&gt;') and frame.count("<") == 2
    assert shown.page == page_html(film_of(run, live=None)) and len(repr(shown)) < 40
    assert replay(run, "page.html").name == "page.html"  # with a path it is written there too


def test_show_opens_the_browser_on_a_file_and_says_where_it_lies_without_one(here, monkeypatch):
    opened = []
    monkeypatch.setattr(module.webbrowser, "open", lambda address: opened.append(address) or True)
    path = show(bc.simulate("arm.yaml"), plots=False)
    assert opened == [path.as_uri()] and path.is_file() and path.parent != here
    monkeypatch.setattr(module.webbrowser, "open", lambda address: False)
    with pytest.raises(BellcrankError, match=r"no web browser could be started; open .*arm.html yourself"):
        show(bc.simulate("arm.yaml"))


def test_a_report_opens_in_the_browser_where_it_is_asked_to(here, monkeypatch):
    opened = []
    monkeypatch.setattr(module.webbrowser, "open", lambda address: opened.append(address) or True)
    assert main(["report", "arm.yaml", "--out", "one.html"]) == 0 and not opened
    assert main(["report", "arm.yaml", "--out", "two.html", "--open"]) == 0
    assert opened == [(here / "two.html").as_uri()]


def test_an_export_that_fails_leaves_no_half_file(here, monkeypatch):
    run = bc.simulate("arm.yaml")

    def stop(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("os.replace", stop)
    with pytest.raises(KeyboardInterrupt):
        replay(run, "page.html")
    assert sorted(path.name for path in here.iterdir()) == ["arm.yaml", "sized", "taken"]
