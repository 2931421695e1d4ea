"""The same scene and the same values give the same digits, whatever was run before and whether a cache is used."""

import os
import subprocess
import sys

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.dynamics.constraints import constraint_rows
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.equations import system
from bellcrank.dynamics.equations.system import system_of
from bellcrank.errors import InputError
from bellcrank.scene.scene import load_scene
from bellcrank.simulation.trajectory.scene_notes import scene_notes

pytestmark = pytest.mark.tier2

URDF = """<robot name="four"><link name="ground"/>
{links}
<joint name="a" type="continuous"><parent link="ground"/><child link="a"/><axis xyz="0 0 1"/></joint>
<joint name="b" type="continuous"><parent link="a"/><child link="b"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint>
<joint name="c" type="continuous"><parent link="ground"/><child link="c"/>
  <origin xyz="1.2 0 0"/><axis xyz="0 0 1"/></joint>
<joint name="end" type="continuous"><parent link="c"/><child link="end"/>
  <origin xyz="0.5 0 0"/><axis xyz="0 0 1"/></joint>
</robot>"""
LINK = (
    '<link name="{name}"><inertial><origin xyz="0.5 0 0"/><mass value="{mass}"/>'
    '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>'
)
SCENE = """
name: four
urdf: four.urdf
gravity: [0, -9.81, 0]
frames: {bt: {link: b, xyz: [1.1, 0, 0]}, ct: {link: c, xyz: [1, 0, 0]}}
constraints:
  - {name: apex, kind: KIND, frame_a: bt, frame_b: ct}
  - {name: gear, kind: coupling, joint_a: c, joint_b: end, ratio: -2, offset: 0.1}
forces: [{kind: joint_spring, joint: a, stiffness: 5}]
initial: {a: 60 deg, b: {guess: -50 deg}, c: {guess: 70 deg}, end: {guess: 0}}
simulate: {duration: 0.4, samples: 5}
"""
# what a parameter may set, with values of which one or another changes what binds, or what moves without mass
PARAMETERS = {
    "tilt": ("[joint.c.origin.roll]", (0.0, 0.3, 1e-7)),
    "raised": ("[joint.c.origin.z]", (0.0, 0.2)),
    "turned": ("[joint.c.origin.roll, joint.b.origin.roll]", (0.0, 0.1)),
    "ground": ("[joint.c.origin.x]", (1.2, 1.3, 0.9)),
    "mass": ("[link.end.mass]", (1.0, 0.0)),
    "scale": ("[link.end.scale]", (1.0, 0.0, 1e-3)),
    "all_scales": ("[link.a.scale, link.b.scale, link.c.scale, link.end.scale]", (1.0, 0.0)),
    "ratio": ("[constraint.gear.ratio]", (-2.0, 0.0)),
    "offset": ("[constraint.gear.offset]", (0.1, 0.0)),
    "length": ("[constraint.apex.length]", (0.3, 0.5)),
    "stiffness": ("[force.joint_spring.stiffness]", (5.0, 0.0)),
    "tip": ("[frame.bt.origin.x, frame.ct.origin.x]", (1.1, 1.0)),
}


@pytest.fixture
def folder(tmp_path):
    links = "".join(
        LINK.format(name=name, mass=mass) for name, mass in zip(("a", "b", "c", "end"), (2, 1, 1.5, 0.2), strict=True)
    )
    (tmp_path / "four.urdf").write_text(URDF.format(links=links))
    return tmp_path


def scene_of(folder, names, kind="point"):
    """A scene with these parameters, at the first of their values."""
    lines = "\n".join(f"  {name}: {{value: {PARAMETERS[name][1][0]}, sets: {PARAMETERS[name][0]}}}" for name in names)
    path = folder / f"{'_'.join(names)}_{kind}.yaml"
    text = SCENE.replace("KIND", "distance, length: 0.3" if kind == "distance" else kind)
    path.write_text(text + (f"parameters:\n{lines}\n" if names else ""))
    return path


def answer(path, values):
    """All that a run says, to the last digit; a refusal as its text."""
    try:
        run = bc.simulate(path, overrides=values)
    except InputError as error:
        return str(error)
    return [
        run.state.tobytes(),
        run.multipliers.tobytes(),
        run.constraint_residual(),
        str(run.status),
        scene_notes(run.scene),
    ]


def forget():
    """What a new process would not know."""
    for known in (system._systems, constraint_rows._samplers, constraint_rows._known):
        known.clear()


def test_a_tilted_axis_is_refused_after_the_plane_was_simulated_and_the_plane_runs_after_the_tilt(folder):
    path = scene_of(folder, ["tilt"])
    for values in ((0.0, 0.3), (0.3, 0.0)):
        forget()
        answers = {value: answer(path, {"tilt": value}) for value in values}
        assert "is in row z [N] of 'apex'" in answers[0.3]
        assert answers[0.0][3] == "finished" and answers[0.0][2] < 1e-13
    result = bc.sweep(path, {"tilt": [0.0, 0.1, 0.2, 0.3, 0.4]})
    assert [design.status for design in result.designs] == ["finished"] + 4 * ["infeasible"]


def test_rows_left_out_as_rounding_are_named_with_their_gap(folder):
    path = scene_of(folder, ["tilt"])
    scene = load_scene(path, {"tilt": 1e-7})
    (note,) = [note for note in scene_notes(scene) if "apex" in note]
    assert "row z [N]" in note and "left out" in note
    assert len(system_of(scene).multiplier_names) == 3 and not rows_of(load_scene(path)).left_out


def test_a_mass_driven_to_nothing_is_refused_whatever_ran_before_and_runs_again_after(folder):
    path = scene_of(folder, ["all_scales"])
    for values in ((1.0, 0.0, 1.0), (0.0, 1.0, 0.0)):
        forget()
        for value in values:
            found = answer(path, {"all_scales": value})
            if value:
                assert found[3] == "finished"
            else:
                assert "has no inertia: the mass matrix is singular" in found


@pytest.mark.parametrize("kind", ["point", "distance", "hinge"])
def test_random_scenes_in_any_order_with_one_cache_and_each_without_give_the_same_digits(folder, kind, monkeypatch):
    """Parameters of every shape, alone and together, in one process, with its memory lost, and with the cache off."""
    random = np.random.default_rng({"point": 1, "distance": 2, "hinge": 3}[kind])
    names = [name for name in PARAMETERS if name != "length" or kind == "distance"]
    cases = []
    for _ in range(3):
        chosen = random.choice(names, size=int(random.integers(1, 4)), replace=False).tolist()
        if {"tilt", "turned"} <= set(chosen):  # both set one roll
            chosen.remove("turned")
        if {"scale", "all_scales"} <= set(chosen):
            chosen.remove("scale")
        path = scene_of(folder, chosen, kind)
        for _ in range(3):
            cases.append((path, {name: float(random.choice(PARAMETERS[name][1])) for name in chosen}))
    first = [answer(*case) for case in cases]
    assert sum(not isinstance(found, str) for found in first) >= 3
    for lost in (False, True, True):
        for k in random.permutation(len(cases)):
            if lost:
                forget()
            assert answer(*cases[k]) == first[k], cases[k]
    monkeypatch.setenv("BELLCRANK_CACHE", "off")
    for k in random.permutation(len(cases))[:3]:
        forget()
        assert answer(*cases[k]) == first[k], cases[k]


def test_another_process_with_the_same_cache_gives_the_same_digits(folder):
    path = scene_of(folder, ["raised", "scale"])
    code = f"""import sys, hashlib; import bellcrank as bc
try:
    run = bc.simulate({str(path)!r}, overrides={{"raised": float(sys.argv[1]), "scale": float(sys.argv[2])}})
    print(hashlib.sha256(run.state.tobytes() + run.multipliers.tobytes()).hexdigest(), "casadi" in sys.modules)
except bc.errors.InputError as error:
    print(error)
"""

    def run(*values, cache=None):
        environment = os.environ | ({"BELLCRANK_CACHE": cache} if cache else {})
        done = subprocess.run([sys.executable, "-c", code, *values], capture_output=True, text=True, env=environment)
        assert done.returncode == 0, done.stderr
        return done.stdout

    raised, flat = run("0.2", "1"), run("0", "1")
    assert "row z [N] has a residual of 0.2 at every position of the joints" in raised
    assert flat.endswith("True\n") and run("0", "1") == flat.replace("True", "False")  # nothing is traced again
    assert run("0", "0.5", cache="off").split()[0] == run("0", "0.5").split()[0]
