"""Scene files: what is read, what is refused, and how overrides change them."""

import json
import math
import re
import subprocess
import sys

import numpy as np
import pytest
import yaml
from crane import FILES, SCENE, TABLE
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import bellcrank as bc
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.elements.controllers import PD, GravityCompensation
from bellcrank.elements.forces import Damper, JointSpring, Spring, Torque, Wrench
from bellcrank.errors import InputError
from bellcrank.scene.overrides import parse_assignment
from bellcrank.scene.robot_config import names, read_config
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.scene.settings import Settings
from bellcrank.simulation.trajectory.scene_notes import scene_notes

# (what is broken, file, old text, new text, a piece of the sentence)
BROKEN = [
    ("unknown key", "scene.yaml", "initial:", "intial:", "intial.*did you mean 'initial'"),
    ("key twice", "scene.yaml", "name: Crane", "name: Crane\nname: Crane", "duplicate key"),
    ("not YAML", "scene.yaml", "gravity: [0, 0, -9.81]", "gravity: [0, 0", "scene.yaml.*YAML"),
    ("gravity of two numbers", "scene.yaml", "gravity: [0, 0, -9.81]", "gravity: [0, -9.81]", "gravity.*3 numbers"),
    ("unknown kind of force", "scene.yaml", "kind: damper", "kind: dampner", r"forces\[3\].kind.*'damper'"),
    ("force without a kind", "scene.yaml", "kind: damper, ", "", r"forces\[3\].*'kind' is missing"),
    ("forces not a list", "scene.yaml", "forces:\n", "forces:\n  all:\n", "forces .*expected a list of mappings"),
    ("force on an unknown joint", "scene.yaml", "kind: damper, joint: elbow", "kind: damper, joint: elbo",
     r"forces\[3\].joint.*did you mean 'elbow'"),
    ("a word for a stiffness", "scene.yaml", "stiffness: 500 N/m", "stiffness: stiff", r"forces\[1\].stiffness.*stiff"),
    ("stiffness of a revolute joint at a prismatic one", "scene.yaml", "500 N/m", "500 N m/rad",
     r"forces\[1\].stiffness.*N/m"),
    ("an angle for a prismatic joint's rest", "scene.yaml", "rest: 20 cm", "rest: 20 deg", "rest.*length in m"),
    ("stiffness missing", "scene.yaml", "stiffness: 500 N/m, ", "",
     r"forces\[1\].*'stiffness' is missing.*also known here: .*preload"),
    ("negative damping", "scene.yaml", "damping: 3}", "damping: -3}", "damping.*0.*or more"),
    ("unknown key of a force", "scene.yaml", "coefficient: 0.4", "coeficient: 0.4", "coefficient"),
    ("infinite coefficient", "scene.yaml", "coefficient: 0.4", "coefficient: .inf", "coefficient.*finite"),
    ("friction without width", "scene.yaml", "width: 0.01", "width: 0", "width"),
    ("spring to an unknown frame", "scene.yaml", "frame_a: hook", "frame_a: hok", r"forces\[2\].frame_a.*'hook'"),
    ("a point for a frame", "scene.yaml", "frame_b: world", "frame_b: base", "point.*world"),
    ("a spring to itself", "scene.yaml", "frame_b: world, point: [1, 0, 2]", "frame_b: hook",
     "frame_b.*expected two different frames"),
    ("point of two numbers", "scene.yaml", "point: [1, 0, 2]", "point: [1, 0]", "point.*3 numbers"),
    ("a torque of value and file", "scene.yaml", "file: torque.csv", "value: 1, file: torque.csv", "value.*both"),
    ("a torque of neither", "scene.yaml", "file: torque.csv, interpolation: linear", "", "value.*neither"),
    ("unknown interpolation", "scene.yaml", "interpolation: linear", "interpolation: straight", "straight.*linear"),
    ("missing torque file", "scene.yaml", "file: torque.csv", "file: forces.csv", "file.*forces.csv"),
    ("a column that names no joint", "torque.csv", "elbow torque [N m]", "torque [N m]",
     r"rename it to 'elbow torque \[N m\]'"),
    ("missing column", "torque.csv", "elbow torque", "wrist torque", "elbow torque.*'wrist torque'"),
    ("torque in kg", "torque.csv", "elbow torque [N m]", "elbow torque [kg]", "kg.*N m"),
    ("torque without unit", "torque.csv", "elbow torque [N m]", "elbow torque", "no unit"),
    ("time that does not increase", "torque.csv", "0.5,", "0.0,", "time must increase.*line 3"),
    ("NaN in a torque", "torque.csv", "2.0", "nan", "line 3.*nan.*finite"),
    ("torque table of one row", "torque.csv", "\n0.5,2.0,7\n1.0,-1.0,7", "", "2 rows"),
    ("ragged torque table", "torque.csv", "0.5,2.0,7", "0.5,2.0", "line 3 has 2 columns"),
    ("a wrench of nothing", "scene.yaml", "force: [1, 2, 3], torque: [0, 0.1, 0], ", "", r"forces\[6\].*'force' or"),
    ("a wrench in other axes", "scene.yaml", "expressed_in: world", "expressed_in: body", "expressed_in.*body"),
    ("two forces of one name", "scene.yaml", "name: wind", "name: push", r"forces\[6\].name.*taken"),
    ("unknown kind of control", "scene.yaml", "kind: pd", "kind: pid", r"control\[2\].kind.*pid"),
    ("unknown motion", "scene.yaml", "motion: swing", "motion: swig", r"control\[2\].motion.*'swing'"),
    ("target and motion", "scene.yaml", "motion: swing,", "motion: swing, target: {elbow: 1},", "target.*both"),
    ("a gain is missing", "scene.yaml", "kp: {shoulder: 50, elbow: 20}", "kp: {shoulder: 50}", "elbow.*missing"),
    ("a gain too many", "scene.yaml", "elbow: 20}", "elbow: 20, slide: 3}", "kp.slide"),
    ("negative gain", "scene.yaml", "kd: 2,", "kd: -2,", "kd.*0.*or more"),
    ("limit of nothing", "scene.yaml", "limit: effort", "limit: 0", "limit.*more than 0"),
    ("an unknown limit", "scene.yaml", "limit: effort", "limit: torque", "limit.*torque"),
    ("mass error of all the mass", "scene.yaml", "mass_error: 5 %", "mass_error: -100 %", "mass_error.*-1"),
    ("start of an unknown joint", "scene.yaml", "initial: {shoulder", "initial: {sholder", "sholder.*'shoulder'"),
    ("start of a joint in the wrong unit", "scene.yaml", "slide: 100 mm", "slide: 5 deg", "initial.slide.*length"),
    ("a guess with more to it", "scene.yaml", "{guess: 0.5}", "{guess: 0.5, hold: 1}", "initial.elbow.hold"),
    ("velocity of an unknown joint", "scene.yaml", "velocity: {elbow", "velocity: {elbw", "velocity.elbw.*'elbow'"),
    ("velocity in degrees", "scene.yaml", "3 deg/s", "3 deg", "velocity.elbow.*rad/s"),
    ("a start on an unknown motion", "scene.yaml", "initial: {", "initial: {motion: swung, ", "motion.*'swing'"),
    ("a base that is fixed", "scene.yaml", "initial:", "base: {position: [0, 0, 1]}\ninitial:", "base.*floating_base"),
    ("parameter of an unknown link", "scene.yaml", "link.rod.mass", "link.rad.mass", "load.sets.*'rod'"),
    ("parameter of an unknown joint", "scene.yaml", "joint.elbow.origin", "joint.elbo.origin", "reach.sets.*'elbow'"),
    ("parameter of nothing that can be set", "scene.yaml", "link.rod.mass", "link.rod.colour", "load.sets.*cannot set"),
    ("parameter of an unknown force", "scene.yaml", "force.cable.st", "force.cabel.st", "pull.sets.*'cable'"),
    ("parameter of an unknown field", "scene.yaml", "cable.stiffness", "cable.stifness", "pull.sets.*'stiffness'"),
    ("parameter in the wrong unit", "scene.yaml", "value: 500 g", "value: 500 mm", "load.value.*kg"),
    ("parameter with a negative mass", "scene.yaml", "value: 500 g", "value: -1", "load.value.*0 kg"),
    ("targets of two units", "scene.yaml", "[link.rod.mass]", "[link.rod.mass, link.rod.cg.x]", "one unit.*kg, m"),
    ("a target set twice", "scene.yaml", "[force.cable.stiffness]", "[force.cable.stiffness, link.rod.mass]",
     "'link.rod.mass'.*'load'|one unit"),
    ("two parameters of one target", "scene.yaml", "  load:", "  other: {value: 1, sets: [link.rod.mass]}\n  load:",
     "load.sets.*'other'"),
    ("a parameter named t", "scene.yaml", "  load:", "  t:", "parameters.t"),
    ("targets that are no list", "scene.yaml", "[link.rod.mass]", "link.rod.mass", "load.sets.*list"),
    ("event without a name", "scene.yaml", "name: out, ", "", r"events\[1\].*'name' is missing"),
    ("event of two values", "scene.yaml", "position: 0.4", "position: 0.4, velocity: 1", r"events\[1\].when.*both"),
    ("event of an unknown joint", "scene.yaml", "joint: slide, position", "joint: slid, position", "joint.*'slide'"),
    ("event in no direction", "scene.yaml", "direction: up", "direction: left", "direction.*left"),
    ("event with a word to stop", "scene.yaml", "stop: true", "stop: often", "stop.*true or false"),
    ("two events of one name", "scene.yaml", "name: level", "name: out", r"events\[2\].name.*taken"),
    ("formula with an unknown frame", "scene.yaml", "frame('hook').z", "frame('hok').z", "when.expression.*hok"),
    ("formula with an unknown function", "scene.yaml", "sin(t)", "sine(t)", "expression.*sine.*'sin'"),
    ("formula that calls Python", "scene.yaml", "sin(t)", "open('x')", "expression.*open"),
    ("formula with an unknown joint", "scene.yaml", "2 * slide.velocity", "2 * slid.velocity", "coriolis.*'slide'"),
    ("formula with an unknown quantity", "scene.yaml", "slide.velocity", "slide.speed", "coriolis.expression.*speed"),
    ("formula that ends early", "scene.yaml", "slide.velocity * elbow.velocity", "slide.velocity *",
     "not an expression"),
    ("output of an unknown frame", "scene.yaml", "{frame: tip, what", "{frame: top, what", "outputs.tip.frame.*'tip'"),
    ("output of an unknown kind", "scene.yaml", "what: velocity", "what: speed", "outputs.tip.what.*speed"),
    ("output of nothing", "scene.yaml", "{energy: total}", "{enrgy: total}", "outputs.energy.*energy"),
    ("output of an unknown force", "scene.yaml", "{force: cable}", "{force: cabel}", "tension.force.*'cable'"),
    ("momentum of a fixed base", "scene.yaml", "{energy: total}", "{momentum: linear}", "momentum.*floating_base"),
    ("unknown solver", "scene.yaml", "solver: DOP853", "solver: ode45", "simulate.solver.*ode45.*RK45"),
    ("tolerance of zero", "scene.yaml", "rtol: 1.0e-8", "rtol: 0", "simulate.rtol.*more than 0"),
    ("tolerance of the whole value", "scene.yaml", "rtol: 1.0e-8", "rtol: 1.0e+308", "simulate.rtol.*at most 1"),
    ("tolerance below doubles", "scene.yaml", "rtol: 1.0e-8", "rtol: 1.0e-15", "simulate.rtol.*1e-13"),
    ("duration that runs backwards", "scene.yaml", "duration: 2", "duration: -2", "simulate.duration.*more than 0"),
    ("RK4 without a step", "scene.yaml", "solver: DOP853", "solver: RK4", "simulate.*step"),
    ("half a sample", "scene.yaml", "samples: 201", "samples: 1.5", "simulate.samples.*whole number"),
    ("unknown setting", "scene.yaml", "atol: 1.0e-8", "abstol: 1.0e-8", "simulate.abstol.*'atol'"),
    ("base of two turns", "flying.yaml", "rpy:", "quaternion_xyzw: [0, 0, 0, 1], rpy:", "both"),
    ("a quaternion that is none", "flying.yaml", "rpy: [0, 10 deg, 0]", "quaternion_xyzw: [0, 0, 0, 2]", "length 2"),
    ("base of an unknown key", "flying.yaml", "linear_velocity", "velocity", "base.velocity.*linear_velocity"),
    ("computed torque of a free base", "flying.yaml", "kind: pd, target: {elbow: 0.3, slide: 0.1}",
     "kind: computed_torque, motion: x", "computed_torque.*floating"),
    ("control of a free base", "flying.yaml", "{elbow: 0.3, slide: 0.1}", "{root_joint: 0.3}", "floating"),
    ("a kind of momentum", "flying.yaml", "momentum: angular", "momentum: spin", "momentum.*spin"),
]  # fmt: skip


@pytest.fixture
def crane(tmp_path):
    """The folder of the crane's files."""
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("crane")
    for name, text in FILES.items():
        (folder / name).write_text(text)
    return load_scene(folder / "scene.yaml")


def sentence(call):
    with pytest.raises(InputError) as caught:
        call()
    text = str(caught.value)
    assert "\n" not in text and len(text) < 700, text
    return text


LOOP = """urdf: planar_2r
motions:
  turn: {kind: waypoints, times: [0, 1], positions: [{shoulder: 0, elbow: 0.2}, {shoulder: 1, elbow: 0.5}]}
actuators:
  shoulder: {ratio: 50, rated_torque: 1, peak_torque: 2, rated_speed: 300, max_speed: 400}
constraints:
  - {kind: prescribed_motion, name: motor, joint: shoulder, motion: turn}
  - {kind: expression, name: bend, expression: elbow.position - 0.2 - lean * t, unit: rad}
  - {kind: distance, name: rod, frame_a: tip, frame_b: world, point: [0.5, 0.5, 0], length: 0.9}
parameters:
  lean: {value: 0.1}
  length: {value: 0.9, sets: [constraint.rod.length]}
events:
  - {name: close, when: {singular_constraints: 1e-3}}
outputs:
  push: {constraint: motor}
"""
# (a word of LOOP, the name that it had in version 0.4, what the message says of it)
FORMER = [
    ("constraints:", "closures:", r"closures \(line 6\): unknown key 'closures' .*expected: .*\bconstraints\b"),
    ("actuators:", "drives:", r"drives \(line 4\): unknown key 'drives' .*expected: .*\bactuators\b"),
    ("kind: prescribed_motion", "kind: drive",
     r"constraints\[1\].kind \(line 7\): unknown kind 'drive' .*prescribed_motion"),
    ("kind: expression", "kind: formula",
     r"constraints\[2\].kind \(line 8\): unknown kind 'formula' .*\bexpression\b"),
    ("constraint.rod", "closure.rod",
     r"parameters.length.sets \(line 12\): .*cannot set 'closure.rod.length'.* constraint.NAME"),
    ("singular_constraints", "singular_closure",
     r"when.singular_closure \(line 14\): unknown key 'singular_closure'; did you mean 'singular_constraints'\?"),
    ("constraint: motor", "closure: motor",
     r"outputs.push \(line 16\): expected one of .*\bconstraint\b.*found closure"),
]  # fmt: skip


@pytest.mark.parametrize(("word", "former", "words"), FORMER, ids=[former for _, former, _ in FORMER])
def test_a_former_key_is_unknown_with_file_line_and_the_keys_that_are_known(tmp_path, word, former, words):
    path = tmp_path / "loop.yaml"
    path.write_text(LOOP)
    assert load_scene(path).constraints
    path.write_text(LOOP.replace(word, former, 1))
    assert re.match(rf"{re.escape(str(path))}: .*{words}", sentence(lambda: load_scene(path)))


@pytest.mark.parametrize(("path", "key"), [("closures.apex.kind", "constraints"), ("drives.crank.ratio", "actuators")])
def test_an_override_of_a_former_key_is_unknown(path, key):
    former = path.partition(".")[0]
    message = sentence(lambda: load_scene("four_bar", {path: "hinge"}))
    assert re.match(rf"override '{path}': unknown key or parameter '{former}' .*expected: .*\b{key}\b", message)


def test_a_misspelt_list_of_constraints_is_named_before_what_refers_to_them(tmp_path):
    (tmp_path / "loop.yaml").write_text(LOOP.replace("constraints:", "constraint:", 1))
    assert "did you mean 'constraints'?" in sentence(lambda: load_scene(tmp_path / "loop.yaml"))


@pytest.mark.parametrize(("file", "old", "new", "words"), [b[1:] for b in BROKEN], ids=[b[0] for b in BROKEN])
def test_a_broken_scene_is_one_sentence_that_names_file_and_key(crane, file, old, new, words):
    text = (crane / file).read_text()
    assert old in text
    (crane / file).write_text(text.replace(old, new, 1))
    scene_file = crane / ("flying.yaml" if file == "flying.yaml" else "scene.yaml")
    message = sentence(lambda: load_scene(scene_file))
    assert message.startswith(str(scene_file)) and re.search(words, message), message


def test_a_scene_says_what_the_file_says(scene):
    spring, cable, damper, _, push, wind = scene.forces
    assert isinstance(spring, JointSpring) and (spring.stiffness, spring.rest, spring.damping) == (500.0, 0.2, 3.0)
    assert isinstance(cable, Spring) and cable.point == (1.0, 0.0, 2.0) and cable.frames == ("hook",)
    assert isinstance(damper, Damper) and damper.name == "damper" and isinstance(wind, Wrench)
    assert isinstance(push, Torque) and push.source.size == 1
    weight, hold = scene.control
    assert isinstance(weight, GravityCompensation) and weight.mass_error == pytest.approx(0.05)
    assert isinstance(hold, PD) and hold.limit == {"shoulder": 80.0, "elbow": 40.0} and hold.source.size == 4
    q, v = consistent_start(scene)
    np.testing.assert_allclose(q, [math.radians(10), 0.5, 0.1], rtol=1e-15)
    np.testing.assert_allclose(v, [0.0, math.radians(3), 0.0], rtol=1e-15)
    assert scene.initial.guesses == ("elbow",)
    np.testing.assert_allclose(scene.parameter_values, [1.0, 0.5, 40.0])
    assert [e.direction for e in scene.events] == [1, 0] and [e.stop for e in scene.events] == [True, False]
    assert scene.outputs["tip"].labels == ("tip x [m/s]", "tip y [m/s]", "tip z [m/s]")
    assert scene.outputs["coriolis"].labels == ("coriolis [m/s^2]",) and scene.outputs["tension"].labels == (
        "tension [N]",
    )
    assert scene.settings == Settings(2.0, "DOP853", 1e-8, 1e-8, samples=201)
    assert scene.frames == ("hook", "tip") and len(scene.signals) == 2
    assert json.loads(json.dumps(scene.data))["initial"]["slide"] == "100 mm"


def test_one_file_serves_sizing_and_simulation(crane):
    config = read_config(crane / "scene.yaml")
    assert list(config.motions) == ["swing"] and config.name == load_scene(crane / "scene.yaml").name
    (crane / "scene.yaml").write_text((crane / "scene.yaml").read_text().replace("simulate:", "simulat:"))
    assert "did you mean 'simulate'" in sentence(lambda: read_config(crane / "scene.yaml"))


@pytest.mark.tier2
@pytest.mark.parametrize("name", sorted(names()))
def test_every_bundled_card_is_a_scene_with_a_finite_start(name):
    scene = load_scene(name)
    q, v = consistent_start(scene)
    assert np.isfinite(q).all() and np.isfinite(v).all()
    own = [note for note in scene_notes(scene) if note not in scene.config.notes]
    assert own == [] or "initial" not in scene.data  # the zero posture of some is outside
    assert all("not used" in note for note in scene.config.notes), "what the URDF says beside its tree"
    assert bc.load_scene(name).config.name == scene.name


def test_a_bare_urdf_is_a_scene_without_forces(crane):
    scene = load_scene(
        crane / "crane.urdf", {"initial.elbow": "30 deg", "gravity": [0, 0, 0], "simulate.solver": "Radau"}
    )
    assert (
        scene.forces == ()
        and consistent_start(scene)[0][1] == pytest.approx(math.pi / 6)
        and not scene.robot.gravity.any()
    )
    assert scene.settings.solver == "Radau" and load_scene("spring_pendulum").name == "Spring pendulum"
    assert sentence(lambda: load_scene("spring_pendulums")) == (
        "unknown scene or robot 'spring_pendulums', and no file of that name; did you mean 'spring_pendulum'? "
        "`bellcrank robots` lists them"
    )


def test_the_tracking_scene_starts_on_its_motion():
    scene = load_scene("planar_2r_tracking")
    motion = scene.motion("circle")
    np.testing.assert_array_equal(consistent_start(scene)[0], motion.position[0])
    np.testing.assert_array_equal(consistent_start(scene)[1], motion.velocity[0])
    assert consistent_start(scene.with_overrides({"initial.elbow": 0.1}))[0][1] == 0.1


def test_a_base_velocity_in_the_world_is_turned_into_the_body(crane):
    world = load_scene(crane / "flying.yaml")
    c, s = math.cos(math.radians(10)), math.sin(math.radians(10))
    q, v = consistent_start(world)
    np.testing.assert_allclose(q[:7], [0, 0, 2, 0, math.sin(math.radians(5)), 0, math.cos(math.radians(5))], atol=1e-16)
    np.testing.assert_allclose(v[:6], [c, 0, s, 0, 0, 0], atol=1e-16)
    body = consistent_start(world.with_overrides({"base.expressed_in": "body"}))[1]
    np.testing.assert_array_equal(body[:6], [1, 0, 0, 0, 0, 0])


@pytest.mark.tier2
def test_loading_a_scene_needs_neither_pinocchio_nor_casadi(crane):
    first = f"from bellcrank.scene.scene import load_scene; load_scene({str(crane / 'scene.yaml')!r})"
    subprocess.run([sys.executable, "-c", first], check=True)  # the robot's data go to the cache, if they are not there
    script = f"""
import sys
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.scene.scene import load_scene
scene = load_scene({str(crane / "scene.yaml")!r}, {{"load": 0.7}})
consistent_start(scene), scene.signals, scene.physics_key(), scene.parameter_values
print([m for m in ("casadi", "pinocchio", "llvmlite", "matplotlib") if m in sys.modules])"""
    assert subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_parameters_take_the_targets_that_overrides_have_too(scene):
    changed = {"parameters.pull": {"value": 40, "sets": ["forces.cable.stiffness"]}}
    assert scene.with_overrides(changed).parameters["pull"].sets == ("force.cable.stiffness",)


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"duration": 1}, "did you mean 'simulate.duration'"),
        ({"link.rodd.mass": 1}, "unknown link 'rodd'; did you mean 'rod'"),
        ({"joint.elbo.origin.x": 1}, "unknown joint 'elbo'; did you mean 'elbow'"),
        ([("duration", 1)], "expected a mapping"),
    ],
)
def test_overrides_that_lead_nowhere_say_what_does(scene, overrides, words):
    assert words in sentence(lambda: scene.with_overrides(overrides))


@pytest.mark.parametrize(("text", "remedy"), [("{guess: -90 deg}", "give a dict"), ("[1, 2]", "give a list")])
def test_an_override_that_is_yaml_in_a_text_is_told_what_to_write(text, remedy):
    with pytest.raises(InputError, match=f"a text is not read as YAML: in Python, {remedy}"):
        bc.load_scene("four_bar", {"initial.rocker": text})
    assert bc.load_scene("four_bar", {"initial.rocker": {"guess": "-90 deg"}}).initial.guesses == ("coupler", "rocker")
    with pytest.raises(InputError) as refused:  # a text that begins otherwise gets no such advice
        bc.load_scene("four_bar", {"initial.rocker": "upright"})
    assert "YAML" not in str(refused.value)


def test_a_start_that_fails_tells_each_gap_once():
    with pytest.raises(InputError) as refused:
        bc.simulate("four_bar", overrides={"crank_length": 4.0})
    told = str(refused.value)
    assert told.count(" m;") + told.count(" m or rad") == 1 and "residuals: apex 0.359 m;" in told


def test_what_is_no_scene_is_told_what_opens_it(scene):
    assert "bc.load_run" in sentence(lambda: load_scene("run.npz"))
    assert "read_motion" in sentence(lambda: load_scene("run.csv"))
    assert "load_scene" in sentence(lambda: load_scene(scene.robot))


@pytest.mark.parametrize(("target", "asks"), [("1", None), ("2.5", False), ("30", True), ("30 deg", None)])
def test_a_target_out_of_range_is_noted_and_far_out_taken_for_degrees(crane, target, asks):
    hold = {"kind": "pd", "joint": "elbow", "kp": 1, "target": {"elbow": target}}
    found = [
        note
        for note in scene_notes(load_scene(crane / "scene.yaml", {"control": [hold]}))
        if "outside the range" in note
    ]
    assert found == [] if asks is None else ("were degrees meant" in found[0]) is asks


# ---- what parameters may be is what the file may say

# (target, value that is refused, words, value that is not)
BOUNDS = [
    ("control.hold.limit", -5, "more than 0 N m", 1e-3),
    ("control.hold.limit", 0, "more than 0 N m", 5),
    ("control.hold.kp.elbow", -1, "0 N m/rad or more", 0),
    ("control.hold.kd", -1, "0 N m s/rad or more", 0),
    ("control.weight.mass_error", -1, "more than -1", -0.99),
    ("control.weight.mass_error", -3, "more than -1", 3),
    ("force.joint_spring.damping", -1, "0 N s/m or more", 0),
    ("force.cable.free_length", -0.1, "0 m or more", 0),
    ("force.cable.damping", -0.1, "0 N s/m or more", 0),
    ("force.damper.coefficient", -3, "0 N m s/rad or more", 0),
    ("force.friction.viscous", -1, "0 N m s/rad or more", 0),
    ("force.friction.coulomb", -1, "0 N m or more", 0),
    ("force.friction.width", 0, "more than 0 rad/s", 1e-3),
    ("link.rod.mass", -1, "0 kg or more", 0),
    ("link.rod.scale", -1, "0 or more", 0),
    ("link.rod.inertia.xx", -1e-9, "0 kg m^2 or more", 0.01),
    ("force.cable.stiffness", None, "", -40),
    ("force.joint_spring.preload", None, "", -40),
    ("joint.elbow.origin.x", None, "", -1),
    ("link.upper.inertia.xy", None, "", -0.01),
]


@pytest.mark.parametrize(("target", "refused", "words", "taken"), BOUNDS)
def test_a_parameter_keeps_the_bounds_of_what_it_sets(crane, target, refused, words, taken):
    text = SCENE.replace("limit: effort", "limit: 30").replace("  load: {value: 500 g, sets: [link.rod.mass]}\n", "")
    text = text.replace("  pull: {value: 40, sets: [force.cable.stiffness]}\n", "")
    text = text.replace(
        "  reach: {value: 1000 mm, sets: [joint.elbow.origin.x]}\n", f"  x: {{value: {taken}, sets: [{target}]}}\n"
    )
    (crane / "scene.yaml").write_text(text)
    scene = load_scene(crane / "scene.yaml")
    assert scene.parameter_values[0] == taken
    if refused is not None:
        message = sentence(lambda: scene.with_overrides({"x": refused}))
        assert message.startswith("override 'x'") and f"expected {words} for '{target}', found {refused}" in message
        (crane / "scene.yaml").write_text(text.replace(f"value: {taken}", f"value: {refused}"))
        assert words in sentence(lambda: load_scene(crane / "scene.yaml"))


def test_a_parameter_of_two_targets_keeps_the_bounds_of_both(scene):
    sets = ["link.rod.inertia.xy", "link.rod.inertia.xx"]
    for order in (sets, sets[::-1]):
        broken = {"parameters": {"i": {"value": -1e-3, "sets": order}}}
        assert "'link.rod.inertia.xx'" in sentence(lambda broken=broken: scene.with_overrides(broken))


def test_parameters_cannot_make_an_inertia_indefinite(scene):
    def with_inertia(**values):
        entries = {k: {"value": v, "sets": [f"link.upper.inertia.{k}"]} for k, v in values.items()}
        return scene.with_overrides({"parameters": entries})

    message = sentence(lambda: with_inertia(xy=100))
    assert "parameters.xy.value" in message and "'upper'" in message and "moment of inertia of -" in message
    assert with_inertia(xy=0.06).parameter_values[0] == 0.06  # 0.02 * 0.2 > 0.06²
    assert len(with_inertia(xy=100, xx=200, yy=200).parameter_values) == 3  # all of them count together


# ---- the world, and frames of that name


@pytest.mark.parametrize("free", [False, True])
def test_a_moving_frame_called_world_is_told_from_the_world(crane, free):
    urdf = (crane / "crane.urdf").read_text().replace('"base"', '"world"')
    (crane / "crane.urdf").write_text(urdf)
    spring = {"name": "s", "kind": "spring", "frame_a": "tip", "frame_b": "world", "stiffness": 10}

    def load(**changes):
        settings = {"floating_base": free, "frames": {"root": {"link": "world"}}, "forces": [spring | changes]}
        return load_scene(crane / "crane.urdf", settings)

    if free:
        message = sentence(load)
        assert "frame_b" in message and "point: [0, 0, 0]" in message and "frames: {NAME: {link: world}}" in message
    else:
        assert load().forces[0].frames == ("tip",)
    assert load(point=[0, 0, 0]).forces[0].frames == ("tip",) and load(frame_b="root").forces[0].frames == (
        "tip",
        "root",
    )


# ---- notes

BARE = {"forces": [], "parameters": {}, "outputs": {}}


def test_a_start_outside_the_limits_is_noted_and_not_refused(scene):
    notes = scene_notes(scene.with_overrides({"initial.elbow": "150 deg"}))
    assert "elbow" in notes[0] and "2.61799 rad" in notes[0] and len(notes) == len(scene_notes(scene)) + 1


def test_effort_limits_that_are_0_or_missing_are_noted(crane):
    urdf = (crane / "crane.urdf").read_text().replace('effort="80"', 'effort="0"').replace(' effort="40"', "")
    (crane / "crane.urdf").write_text(urdf)
    off, free = scene_notes(load_scene(crane / "scene.yaml", BARE))
    assert "'hold'" in off and "0 at joint shoulder" in off and "switches it off" in off
    assert "'hold'" in free and "no effort limit at joint elbow" in free


@pytest.mark.parametrize("interpolation", ["linear", "hold", "cubic"])
def test_tables_and_motions_that_do_not_cover_the_run_are_noted(crane, interpolation):
    (crane / "torque.csv").write_text(TABLE.replace("\n0,", "\n0.25,"))
    scene = load_scene(crane / "scene.yaml", {"forces.push.interpolation": interpolation})
    end, begin = scene_notes(scene)
    assert "force 'push': its table ends at 1 s and the run at 2 s" in end and "last value is held" in end
    assert "begins at 0.25 s" in begin and "first value is held" in begin
    longer = scene_notes(scene.with_overrides({"simulate.duration": 3}))
    assert len(longer) == 3 and "control 'hold': its motion ends at 2 s and the run at 3 s" in longer[2]
    assert scene_notes(scene.with_overrides({**BARE, "simulate.duration": 2})) == ()


def test_cubic_tables_refuse_coincident_rows_and_note_what_overshoots(crane):
    def table(gap):
        rows = ((0, 0), (0.5, 1), (0.5 + gap, -1), (1, 0), (2, 0))
        (crane / "torque.csv").write_text("time [s],elbow torque [N m]\n" + "".join(f"{t!r},{x!r}\n" for t, x in rows))
        return load_scene(crane / "scene.yaml", {"forces.push.interpolation": "cubic"})

    message = sentence(lambda: table(1e-10))
    assert "forces[5].interpolation" in message and "1e-09 s apart" in message and "linear" in message
    assert load_scene(crane / "scene.yaml").forces[4].source.signal.kinked
    (note,) = scene_notes(table(1e-6))
    assert "values of -1 to 1 N m" in note and "cubic spline reaches" in note
    assert scene_notes(table(0.25)) == ()


def test_an_event_that_is_no_number_at_the_start_is_noted(scene):
    events = [
        {"name": "late", "when": {"expression": "sqrt(slide.position - 0.2)"}},
        {"name": "z", "when": {"expression": "t - 1"}},
    ]
    (note,) = scene_notes(scene.with_overrides({**BARE, "events": events}))
    assert "event 'late'" in note and "not a number at the start" in note


# ---- solver settings


def test_settings_take_numpys_integers_and_nothing_that_is_no_integer():
    settings = Settings(samples=np.int64(5), max_evaluations=np.uint8(7))
    assert (settings.samples, settings.max_evaluations) == (5, 7) and type(settings.samples) is int
    for wrong in (5.0, np.float64(5), True, np.True_, "5", 1):
        assert "whole number of at least 2" in sentence(lambda wrong=wrong: Settings(samples=wrong))
    assert f"at most {2**62}" in sentence(lambda: Settings(max_evaluations=10**30))
    assert "'samples': expected a whole number of at least 2 and at most" in sentence(lambda: Settings(samples=10**13))


def test_more_rows_than_memory_holds_are_refused(scene):
    message = sentence(lambda: scene.with_overrides({"simulate.samples": 10**8}))
    assert "simulate.samples" in message and "4 GB" in message and str(4 * 10**9 // 8 // 6) in message


# ---- overrides


@pytest.mark.parametrize(
    ("path", "value", "found", "expected"),
    [
        ("initial.shoulder", "1.5 deg", lambda s: consistent_start(s)[0][0], math.radians(1.5)),
        ("initial.velocity.slide", 0.2, lambda s: consistent_start(s)[1][2], 0.2),
        ("simulate.rtol", "1e-6", lambda s: s.settings.rtol, 1e-6),
        ("forces.cable.stiffness", 20, lambda s: s.forces[1].stiffness, 20.0),
        ("forces.damper.coefficient", np.float64(2), lambda s: s.forces[2].coefficient, 2.0),
        ("forces.3.coefficient", np.int64(2), lambda s: s.forces[2].coefficient, 2.0),
        ("forces.wind.force.3", -1, lambda s: s.forces[5].force[2], -1.0),
        ("control.hold.kp.elbow", 30, lambda s: s.control[1].kp["elbow"], 30.0),
        ("parameters.load", 2.0, lambda s: s.parameter_values[1], 2.0),
        ("load", "2 kg", lambda s: s.parameter_values[1], 2.0),
        ("parameters.load.value", 2.0, lambda s: s.parameter_values[1], 2.0),
        ("gravity.3", 0, lambda s: s.robot.gravity[2], 0.0),
        ("events.out.stop", False, lambda s: s.events[0].stop, False),
        ("motions.swing.samples", 11, lambda s: len(s.motion("swing").time), 11),
    ],
)
def test_an_override_reaches_what_it_names(scene, path, value, found, expected):
    changed = scene.with_overrides({path: value})
    assert found(changed) == pytest.approx(expected, abs=1e-15) and found(scene) != pytest.approx(expected)


def test_joint_names_with_dots_are_found(crane):
    (crane / "crane.urdf").write_text((crane / "crane.urdf").read_text().replace('"elbow"', '"arm.elbow"'))
    (crane / "scene.yaml").write_text("urdf: crane.urdf\ninitial: {arm.elbow: 0.1}\n")
    scene = load_scene(crane / "scene.yaml", {"initial.arm.elbow": 0.2})
    assert consistent_start(scene)[0][1] == 0.2
    moving = load_scene(crane / "crane.urdf", {"initial.velocity.arm.elbow": 0.3, "friction.arm.elbow.viscous": 2})
    assert consistent_start(moving)[1][1] == 0.3 and moving.robot.viscous[1] == 2.0
    fresh = load_scene(crane / "crane.urdf", {"initial.arm.elbow": 0.3})
    assert consistent_start(fresh)[0][1] == 0.3


def test_overrides_of_the_start_or_a_parameter_keep_robot_and_equations(scene):
    for path in ("initial.shoulder", "load", "simulate.duration"):
        changed = scene.with_overrides({path: 0.7})
        assert changed.robot is scene.robot and changed.physics_key() == scene.physics_key(), path
    for path in ("forces.cable.stiffness", "control.hold.kd", "events.out.when.position"):
        assert scene.with_overrides({path: 0.3}).physics_key() != scene.physics_key(), path
    assert scene.with_overrides({"gravity.3": -1}).robot.key != scene.robot.key
    twice = scene.with_overrides({"initial.shoulder": 0.1}).with_overrides({"initial.slide": 0.2})
    assert twice.data["initial"]["shoulder"] == 0.1 and consistent_start(twice)[0][2] == 0.2


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("initial.shulder", 1, "override 'initial.shulder'.*did you mean 'shoulder'"),
        ("initial.shoulder", "fast", "override 'initial.shoulder'.*angle in rad.*fast"),
        ("simulate.rtol", -1, "override 'simulate.rtol'.*more than 0"),
        ("simulat.rtol", 1, "override 'simulat.rtol'.*did you mean 'simulate'"),
        ("lod", 1, "override 'lod'.*did you mean 'load'"),
        ("load.value", 1, "'load' is a parameter; write 'load' for its value, or 'parameters.load.value'"),
        ("forces.cabel.stiffness", 1, "override 'forces.cabel.stiffness'.*did you mean 'cable'"),
        ("forces.9.stiffness", 1, "override 'forces.9.stiffness'.*unknown entry '9'"),
        ("forces.wind.force.3", "x", "override 'forces.wind.force.3'.*a number in N"),
        ("name.first", "x", "override 'name.first'.*not a mapping or a list"),
        ("simulate", {"rtol": "x"}, "override 'simulate'.*rtol"),
        ("", 1, "override '':"),
        ("load", [1], "override 'load'.*list of 1"),
    ],
)
def test_a_wrong_override_is_named(scene, path, value, words):
    message = sentence(lambda: scene.with_overrides({path: value}))
    assert re.search(words, message), message


def test_assignments_of_the_command_line():
    assert parse_assignment("initial.crank=1.5 deg") == ("initial.crank", "1.5 deg")
    assert parse_assignment("simulate.samples=11") == ("simulate.samples", 11)
    assert parse_assignment("gravity=[0, 0, -1.6]") == ("gravity", [0, 0, -1.6])
    for text in ("simulate.rtol", "=3", "gravity=[0, 0", "a=!!python/name:os.system x"):
        sentence(lambda text=text: parse_assignment(text))


def paths_in(data, path=()):
    """Every dotted path of a scene's data."""
    if path:
        yield ".".join(path)
    for key, value in data.items() if isinstance(data, dict) else enumerate(data, 1) if isinstance(data, list) else ():
        yield from paths_in(value, (*path, str(key)))


_PATHS = sorted(paths_in(yaml.safe_load(SCENE)))
_KEYS = ["kind", "name", "joint", "shoulder", "value", "sets", "expression", "file", "x", "", "1"]
_SCALARS = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8),
    st.sampled_from([0.5, 1, "1 deg", "effort", "elbow", "t", "2*t", "RK45", "hook", "1e400", "-1", "NaN"]),
)  # fmt: skip
_VALUES = _SCALARS | st.recursive(
    _SCALARS, lambda v: st.lists(v, max_size=3) | st.dictionaries(st.sampled_from(_KEYS), v, max_size=3), max_leaves=6
)


@pytest.mark.tier2
@settings(max_examples=500, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    st.sampled_from(_PATHS)
    | st.tuples(st.sampled_from(_PATHS), st.sampled_from(_KEYS)).map(".".join)
    | st.text(max_size=9),
    _VALUES,
)
def test_any_override_gives_a_scene_or_an_input_error(scene, path, value):
    try:
        changed = scene.with_overrides({path: value})
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert isinstance(changed, Scene) and changed.physics_key()


@pytest.mark.tier2
@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.text(max_size=30))
def test_any_assignment_is_read_or_refused(text):
    try:
        path, _ = parse_assignment(text)
    except InputError:
        return
    assert path and "=" in text
