"""What a robot file says and is not modelled is among the notes of every result made of it, and decides verdicts."""

import inspect
import json
import pickle

import pytest

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.notes import Note
from tests.support.public_names import NAMES, public

LEG = """<mujoco model="leg">{option}
  <worldbody>
    <body name="thigh" pos="0 0 1" {thigh}>
      <joint name="hip" type="hinge" axis="0 1 0" range="-90 90" {hip}/>
      <geom type="capsule" size="0.03" fromto="0 0 0 0 0 -0.3" mass="1" contype="{contype}" conaffinity="0"/>
      <body name="shank" pos="0 0 -0.3">
        <joint name="knee" type="hinge" axis="0 1 0" range="-120 120"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.3" mass="0.5" contype="0" conaffinity="0"/>
        <site name="foot" pos="0 0 -0.3"/>
      </body>
    </body>
    <site name="anchor"/>
  </worldbody>{rest}
</mujoco>
"""
PLAIN = {"option": "", "thigh": "", "hip": "", "contype": "0", "rest": ""}
SERVO = '<actuator><position name="servo" joint="knee" kp="30"/></actuator>'
TENDON = '<tendon><spatial name="cord" {}><site site="anchor"/><site site="foot"/></spatial></tendon>'
# what the file has, what the note says, how it matters to a motion that is computed, and to one that is given
OMISSIONS = {
    "contacts": ({"contype": "1"}, "contacts are not modelled", "changes", "changes"),
    "servo": ({"rest": SERVO}, "are motors without it (servo)", "reached", "information"),
    "tendon spring": ({"rest": TENDON.format('stiffness="9"')}, "1 tendons are not modelled", "reached", "reached"),
    "slack tendon": ({"rest": TENDON.format("")}, "1 tendons are not modelled", "changes", "changes"),
    "gravity compensation": ({"thigh": 'gravcomp="1"'}, "gravcomp is not used", "reached", "reached"),
    "fluid": ({"option": '<option density="1.2"/>'}, "forces of a fluid", "reached", "reached"),
    "cubic spring": ({"hip": 'stiffness="1 0 3"'}, "only the first, linear", "reached", "reached"),
    "loop": ({"rest": '<equality><flexvert flex="f"/></equality>'}, "<flexvert> under", "reached", "reached"),
    "unknown section": ({"rest": '<muscles2 name="m"/>'}, "<muscles2> is not known", "changes", "changes"),
}
MOTION = {"kind": "waypoints", "times": [0, 0.5, 1], "positions": [{"hip": 0}, {"hip": 0.5, "knee": -0.5}, {"hip": 0}]}
RATINGS = {"ratio": 20, "rated_torque": 20.0, "peak_torque": 60.0, "rated_speed": 300.0, "max_speed": 500.0,
           "rotor_inertia": 1e-5}  # fmt: skip


FIRST_TIER = ("contacts", "servo", "tendon spring")
KINDS = [kind if kind in FIRST_TIER else pytest.param(kind, marks=pytest.mark.tier2) for kind in OMISSIONS]


def written(folder, kind, **more):
    (folder / "leg.xml").write_text(LEG.format(**PLAIN | OMISSIONS[kind][0]))
    data = {"urdf": "leg.xml", "motions": {"step": MOTION}, "actuators": {"hip": RATINGS, "knee": RATINGS},
            "simulate": {"duration": 0.2, "samples": 21}, **more}  # fmt: skip
    path = folder / "leg.yaml"
    path.write_text(json.dumps(data))
    return path


def computed(path):
    """Every kind of result in which the motion is computed."""
    scene = bc.load_scene(path)
    yield scene
    yield bc.simulate(scene)
    yield bc.sweep(scene, {"initial.hip": [0.1, 0.2]})
    yield bc.linearise(scene)


def given(path):
    """Every kind of result in which the motion, or its path, is given."""
    yield bc.size(path)
    yield bc.judge(path)
    yield bc.scene_inverse_dynamics(path, "step")
    yield bc.time_optimal(path, "step", grid=40)
    yield bc.speed_factor(path, "step")
    yield bc.sweep(path, {"link.shank.mass": [0.5, 0.6]}, size=True)


def note_of(result, text):
    found = [note for note in result.notes if text in note]
    assert len(found) == 1, (type(result).__name__, result.notes)
    assert (isinstance(found[0], Note) and found[0].where == "leg.xml") or found[0].matter == "information"
    return found[0]


@pytest.mark.parametrize("kind", KINDS)
def test_an_omission_of_a_file_is_a_note_of_every_result_and_reached_where_it_acts(kind, tmp_path):
    path, (_, text, matter, matter_given) = written(tmp_path, kind), OMISSIONS[kind]
    for result in computed(path):
        assert note_of(result, text).matter == matter, type(result).__name__
    for result in given(path):
        assert note_of(result, text).matter == matter_given, type(result).__name__
    assert text in bc.load_robot(tmp_path / "leg.xml").notes[-1] or kind != "servo"


@pytest.mark.parametrize("kind", KINDS)
def test_verdicts_are_not_known_where_an_omitted_force_loop_or_servo_acts(kind, tmp_path, monkeypatch, capsys):
    path, (_, text, matter, matter_given) = written(tmp_path, kind), OMISSIONS[kind]
    monkeypatch.chdir(tmp_path)
    run, sizing, verdicts = bc.simulate(path), bc.size(path), bc.judge(path)
    acts, given_acts = matter == "reached", matter_given == "reached"
    assert any(text in reason for reason in run.warnings) is acts
    assert ("\n  not known  " in run.table()) is acts
    assert sizing.inside is not given_acts and verdicts.inside is not given_acts
    assert ("Not known: what the robot's file says" in str(sizing)) is given_acts
    page = bc.report(run, tmp_path / "report.html").read_text()
    assert ("Not known" in page) is acts and text.replace("<", "&lt;").replace(">", "&gt;") in page
    swept = bc.sweep(path, {"link.shank.mass": [0.5, 0.6]}, size=True)
    assert (swept.designs[0].status == "unknown") is given_acts
    for command, expected in (
        (["simulate", "leg.yaml", "--no-plots"], acts),
        (["sweep", "leg.yaml", "--vary", "initial.hip=0.1,0.2", "--no-plots"], acts),
        (["replay", "leg.yaml", "--simulate", "--no-plots", "--out", "r.html"], acts),
        (["size", "leg.yaml", "--accept-unknown", "--no-plots"], given_acts),
        (["fastest", "leg.yaml", "--grid", "40", "--no-plots"], given_acts),
    ):
        code, out = main(command), " ".join(capsys.readouterr().out.split())
        assert code == int(expected), (command, out)
        assert text in out, command


def test_a_servo_that_the_scene_replaces_does_not_act(tmp_path):
    control = [{"kind": "torque", "name": "none", "joint": "knee", "value": "0"}]
    run = bc.simulate(written(tmp_path, "servo", control=control))
    assert note_of(run, "motors without it").matter == "information" and not run.warnings


def test_gravity_compensation_does_not_act_without_gravity(tmp_path):
    run = bc.simulate(written(tmp_path, "gravity compensation", gravity=[0, 0, 0]))
    assert note_of(run, "gravcomp").matter == "information" and not run.warnings


def test_sentences_under_notes_are_information_and_a_mapping_says_how_it_matters(tmp_path):
    path = written(tmp_path, "contacts", notes=["the shank is of steel", {"text": "no wind", "matter": "changes"}])
    notes = {str(note): note.matter for note in bc.simulate(path).notes}
    assert notes["the shank is of steel"] == "information" and notes["no wind"] == "changes"
    for wrong, message in (
        (3, "expected a list of sentences"), ([3], "expected sentences, found 3"),
        ([{"text": "x", "matter": "grave"}], "unknown matter|expected"), ([{"text": "x", "joint": "hip"}], "joints"),
    ):  # fmt: skip
        with pytest.raises(bc.InputError, match=message):
            bc.load_scene(written(tmp_path, "contacts", notes=wrong))


@pytest.mark.parametrize("kind", ["servo", "contacts"])
def test_a_saved_run_keeps_how_its_notes_matter(kind, tmp_path):
    run = bc.simulate(written(tmp_path, kind))
    loaded = bc.load_run(run.save(tmp_path / "run.npz"))
    for other in (loaded, pickle.loads(pickle.dumps(run))):
        assert [(str(n), n.matter, n.where, n.time) for n in other.notes] == [
            (str(n), n.matter, n.where, n.time) for n in run.notes
        ]


def test_the_notes_that_matter_most_come_first(tmp_path):
    rest = {"rest": SERVO + "<sensor><touch name='t' site='foot'/></sensor>", "contype": "1"}
    (tmp_path / "leg.xml").write_text(LEG.format(**PLAIN | rest))
    matters = [note.matter for note in bc.simulate(tmp_path / "leg.xml", duration=0.1).notes]
    assert matters == sorted(matters, key=["reached", "changes", "information"].index) and len({*matters}) == 3


def test_notes_stand_in_the_json_of_results_with_how_they_matter(tmp_path):
    path = written(tmp_path, "fluid")
    swept = bc.sweep(path, {"initial.hip": [0.1, 0.2]})
    sampled = bc.sweep(path, {"initial.hip": "uniform(0.1, 0.2)"}, sample=8, method="random").statistics
    for result in (bc.size(path), swept, sampled, bc.mobility(path), bc.time_optimal(path, "step", grid=40)):
        document = json.loads(result.to_json(tmp_path / "result.json").read_text())
        [note] = [note for note in document["notes"] if "fluid" in note["text"]]
        assert note["matter"] == "reached" and note["file"] == "leg.xml"
    assert any("fluid" in note["text"] for note in bc.linearise(bc.load_scene(path)).as_dict()["notes"])


# Public classes that carry no notes on a file, and why.
NO_RESULTS = {
    "Actuator": "input", "Catalogue": "input", "Conditions": "input", "CoupledTransmission": "input",
    "JointPath": "input", "MotionLimits": "input", "Mount": "input", "Payload": "input", "Settings": "input",
    "BellcrankError": "error", "CompileError": "error", "InputError": "error", "NotSavedError": "error",
    "UnreachableError": "error",
    "PreparedRun": "the runs have them",
    "PreparedSimulation": "the runs have them", "SceneDerivatives": "its scene has the notes",
    "EventSensitivity": "part of a Trajectory", "JointSensitivity": "part of a Sizing",
    "Result": "the base of those that have them", "Slopes": "part of a Trajectory",
    "LimitCost": "part of a FastestMotion", "Mode": "part of a Linearisation",
}  # fmt: skip


def test_every_public_result_class_carries_notes():
    """A new class carries `notes`, or says in the table above why it does not."""
    classes = {name: one for name in NAMES if inspect.isclass(one := public(name))}
    without = {
        name
        for name, one in classes.items()
        if not hasattr(one, "notes") and "notes" not in getattr(one, "__dataclass_fields__", {})
    }
    assert without == {*NO_RESULTS}
