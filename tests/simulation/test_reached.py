"""What a run reaches that is not modelled is said with time and size: floors, and friction that would hold a joint."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import bellcrank as bc
from bellcrank.replays.replay import film_of
from bellcrank.robot.formats.robot_file import ContactShape
from bellcrank.simulation.trajectory.reached import support

G = 9.81
BALL = (
    '<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1" {floor}/>'
    '<body name="ball" pos="0 0 {height}"><freejoint/><geom name="skin" {shape}/></body></worldbody></mujoco>'
)


def dropped(tmp_path, shape, floor="", height=1.0, **more):
    (tmp_path / "ball.xml").write_text(BALL.format(shape=shape, floor=floor, height=height))
    return bc.simulate(tmp_path / "ball.xml", duration=1.0, **more)


@pytest.mark.parametrize(
    ("shape", "reach"),
    [
        ('type="sphere" size="0.1"', 0.1),
        ('type="capsule" size="0.1 0.2"', 0.3),
        ('type="cylinder" size="0.1 0.2" euler="90 0 0"', 0.1),
        ('type="box" size="0.1 0.2 0.3" euler="45 0 0"', (0.2 + 0.3) / math.sqrt(2.0)),
        ('type="ellipsoid" size="0.1 0.2 0.3"', 0.3),
        ('type="sphere" size="0.1" pos="0 0 0.15"', -0.05),
    ],
)
def test_a_body_that_falls_through_the_floor_is_said_with_time_and_depth(shape, reach, tmp_path):
    """Its lowest point starts at 1 m − reach and meets the floor at √(2 (1 − reach)/g)."""
    run = dropped(tmp_path, shape, samples=2001)
    # of an eccentric ball the centre of gravity is not the frame, and it falls without turning
    [note] = [note for note in run.not_known if "goes through" in note]
    touch = math.sqrt(2.0 * (1.0 - reach) / G)
    assert note.matter == "reached" and 0.0 <= note.time - touch < 1e-3
    depth = float(note.split("by up to ")[1].split(" m")[0])
    assert depth == pytest.approx(0.5 * G - (1.0 - reach), rel=1e-3)
    assert "link 'ball' goes through 'floor'" in note and "'skin'" in note


def test_a_tilted_floor_is_met_along_its_normal(tmp_path):
    """A plane through the origin tilted by 30° is met by a ball above it at (h cos 30° − r)/cos 30° of fall."""
    run = dropped(tmp_path, 'type="sphere" size="0.1"', 'euler="30 0 0"', samples=2001)
    [note] = [note for note in run.not_known if "goes through" in note]
    fall = 1.0 - 0.1 / math.cos(math.radians(30.0))
    assert 0.0 <= note.time - math.sqrt(2.0 * fall / G) < 1e-3


@pytest.mark.parametrize("bits", ['contype="2" conaffinity="2"', 'contype="0" conaffinity="0"'])
def test_shapes_that_do_not_collide_with_the_floor_pass_it(bits, tmp_path):
    assert not [note for note in dropped(tmp_path, f'type="sphere" size="0.1" {bits}').notes if "through" in note]


def test_a_body_that_stays_above_the_floor_is_known(tmp_path):
    run = dropped(tmp_path, 'type="sphere" size="0.1"', height=8.0)
    assert run.warnings == () and any("contacts are not modelled" in note for note in run.notes)


KINDS = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3}


@given(st.sampled_from(sorted(KINDS)), st.lists(st.floats(0.01, 2.0), min_size=3, max_size=3), st.integers(0, 10**6))
def test_the_lowest_point_of_a_shape_is_that_of_points_on_its_surface(kind, sizes, seed):
    """The support function against points that are spread over the surface: below it, and reaching it."""
    rng, size = np.random.default_rng(seed), sizes[: KINDS[kind]]
    around = rng.normal(size=(4000, 3))
    around /= np.linalg.norm(around, axis=1)[:, None]
    direction = Rotation.random(random_state=seed).as_matrix()[0]
    top = size[-1] * np.sign(around[:, 2])[:, None] * [0.0, 0.0, 1.0]
    rim = np.c_[around[:, :2] / np.linalg.norm(around[:, :2], axis=1)[:, None], np.zeros(4000)]
    points = {
        "sphere": around * size[0],
        "capsule": around * size[0] + top,
        "cylinder": size[0] * rim + top,
        "box": np.sign(around) * (size if kind == "box" else 1.0),
        "ellipsoid": around * (size if kind == "ellipsoid" else 1.0),
    }[kind]
    shape = ContactShape("s", "l", kind, tuple(size), (), ())
    found, reach = float(support(shape, direction[None])[0]), float((points @ direction).max())
    assert reach <= found * (1.0 + 1e-12) and reach == pytest.approx(found, rel=0.01)


SLIDER = """<robot name="slider"><link name="rail"/><link name="cart"><inertial><mass value="2"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="slide" type="prismatic"><parent link="rail"/><child link="cart"/><axis xyz="0 0 1"/>
<limit lower="-9" upper="9" effort="99" velocity="9"/><dynamics friction="{}"/></joint></robot>"""


def slider(tmp_path, coulomb, duration=10.0, forces="[]"):
    """A cart of 2 kg on a vertical rail with friction against its weight of 19.62 N."""
    (tmp_path / "slider.urdf").write_text(SLIDER.format(coulomb))
    text = f"urdf: slider.urdf\nsimulate: {{duration: {duration}}}\nforces: {forces}\n"
    (tmp_path / "slider.yaml").write_text(text)
    return bc.simulate(tmp_path / "slider.yaml")


def test_a_joint_that_friction_would_hold_creeps_and_that_is_said_with_its_size(tmp_path):
    """m g = c v/√(v² + w²): v = w r/√(1 − r²) with r = m g/c."""
    run, share = slider(tmp_path, 25.0), 2.0 * G / 25.0
    speed = run.robot.friction_width * share / math.sqrt(1.0 - share**2)
    [note] = run.not_known
    way = float(note.split("creeps by ")[1].split(" m")[0])
    assert way == pytest.approx(10.0 * speed, rel=0.01) and note.time == pytest.approx(0.0, abs=0.1)
    assert note.omits == "friction" and note.joints == ("slide",)


def test_a_joint_that_slides_hardly_creeps_or_has_a_width_of_its_own_is_known(tmp_path):
    assert slider(tmp_path, 15.0, duration=1.0).not_known == ()  # the weight is larger
    assert slider(tmp_path, 2500.0, duration=0.1).not_known == ()  # it creeps by 0.8 µm
    own = "[{name: rub, kind: friction, joint: slide, coulomb: 25, width: 0.01}]"  # the model of the scene
    assert slider(tmp_path, 0.0, forces=own).not_known == ()


def test_what_is_reached_is_marked_in_the_replay_and_stands_in_reports_sweeps_and_saved_runs(tmp_path):
    run = dropped(tmp_path, 'type="sphere" size="0.1"')
    [note] = [note for note in run.not_known if "goes through" in note]
    assert [event.time for event in film_of(run).events if "goes through" in event.text] == [note.time]
    again = bc.load_run(run.save(tmp_path / "run.npz"))
    assert [vars(each) for each in again.notes] == [vars(each) for each in run.notes] and again.notes == run.notes
    assert "goes through &#x27;floor&#x27;" in bc.report(run, tmp_path / "r.html").read_text()
    scene = bc.load_scene(tmp_path / "ball.xml", {"simulate.duration": 0.5})
    swept = bc.sweep(scene, {"simulate.duration": [0.1, 0.5]})
    [told] = swept.not_known
    assert "link 'ball' goes through a floor in 1 of 2 designs" in told and "in design 1;" in told
