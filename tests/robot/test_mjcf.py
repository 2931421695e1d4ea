"""MJCF files mean what they mean to MuJoCo: masses, inertias, frames, gaps of closed loops and accelerations.

The figures are computed by MuJoCo where it is installed, for 100 states, and compared with the stored ones; elsewhere
the stored figures of a few states are compared with.
"""

import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest
from mujoco_figures import FEW, STORED, figures
from scipy.spatial.transform import Rotation

import bellcrank as bc
from bellcrank.robot.formats.mjcf_placement import roll_pitch_yaw
from bellcrank.robot.formats.robot_file import FileSphericalSpring, JointCoupling, JointRelation

FILES = Path(__file__).parent / "mjcf"
NAMES = ("biped", "shapes", "couplings")
STATES = 100


def figures_of(name):
    """MuJoCo's figures of a file."""
    stored = json.loads(STORED.read_text(encoding="utf-8"))[name]
    if importlib.util.find_spec("mujoco") is None:
        return stored
    found = figures(FILES / f"{name}.xml", STATES)
    few = {**found, "states": found["states"][:FEW]}
    assert all(np.allclose(a, b, rtol=1e-9, atol=1e-9) for a, b in zip(numbers(few), numbers(stored), strict=True))
    return found


def numbers(data):
    """All numbers of nested dicts and lists, in their order."""
    if isinstance(data, dict):
        return [number for each in data.values() for number in numbers(each)]
    return [number for each in data for number in numbers(each)] if isinstance(data, list) else [data]


@pytest.fixture(scope="module", params=NAMES)
def pair(request):
    """A robot, with exact numbers, and MuJoCo's figures of it."""
    path = FILES / f"{request.param}.xml"
    file = bc.load_robot(path).file
    robot = bc.load_robot(path, clean=False, gravity=file.gravity, rotor_inertia=file.rotor_inertia)
    return robot, figures_of(request.param)


def vector(robot, values, start, count):
    found = np.full(sum(getattr(joint, count) for joint in robot.joints), np.nan)
    for name, each in values.items():
        joint = robot.joint(name)
        first = getattr(joint, start)
        found[first : first + getattr(joint, count)] = each
    assert np.isfinite(found).all()
    return found


def state_of(robot, state):
    return vector(robot, state["position"], "q", "nq"), vector(robot, state["velocity"], "v", "nv")


def test_masses_and_inertias(pair):
    robot, expected = pair
    for name, body in expected["bodies"].items():
        inertial = robot.urdf.links[name].inertial
        assert inertial.mass == pytest.approx(body["mass"], rel=1e-12)
        assert inertial.xyz == pytest.approx(body["center"], abs=1e-12)
        xx, xy, xz, yy, yz, zz = inertial.inertia
        found = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert np.allclose(found, body["inertia"], rtol=0.0, atol=1e-9 * np.abs(body["inertia"]).max())


def test_accelerations_without_constraints(pair):
    robot, expected = pair
    springs = {spring.joint: spring for spring in robot.file.springs}
    for state in expected["states"]:
        q, v = state_of(robot, state)
        tau = np.zeros(robot.nv)
        for name, spring in springs.items():
            joint = robot.joint(name)
            if isinstance(spring, FileSphericalSpring):
                stretch = Rotation.from_quat(q[joint.q : joint.q + 4]).as_rotvec()
            else:
                stretch = q[joint.q] - spring.reference
            tau[joint.v : joint.v + joint.nv] = -spring.stiffness * stretch
        answer = vector(robot, state["acceleration"], "v", "nv")
        assert np.abs(robot.forward_dynamics(q, v, tau) - answer).max() < 1e-9 * np.abs(answer).max()


def test_sites_are_frames(pair):
    robot, expected = pair
    for state in expected["states"][:10]:
        for name, position in state["frames"].items():
            assert robot.frame_pose(name, state_of(robot, state)[0])[0] == pytest.approx(position, abs=1e-12)


def placed(robot, frame, q):
    position, rotation = robot.frame_pose(frame.frame, q)
    x, y, z = frame.rpy
    own = turn(2, z) @ turn(1, y) @ turn(0, x)
    return position + rotation @ np.array(frame.xyz), rotation @ own


def turn(axis, angle):
    """The matrix of a rotation about a coordinate axis."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    found = np.eye(3)
    found[i, i] = found[j, j] = np.cos(angle)
    found[j, i], found[i, j] = np.sin(angle), -np.sin(angle)
    return found


def gap(robot, loop, q):
    """What is left open of a constraint; of a weld the sine of half the angle too."""
    if isinstance(loop, JointRelation):
        return [sum(value * q[robot.joint(joint).q] for joint, value in loop.terms) - loop.constant]
    if isinstance(loop, JointCoupling):
        leader = 0.0 if loop.leader is None else q[robot.joint(loop.leader).q]
        return [q[robot.joint(loop.joint).q] - np.polynomial.Polynomial(loop.coefficients)(leader)]
    (a, turn_a), (b, turn_b) = (placed(robot, frame, q) for frame in (loop.a, loop.b))
    half = np.sqrt(max(0.0, (3.0 - np.trace(turn_a.T @ turn_b)) / 4.0))
    return [*(a - b), half] if loop.kind == "weld" else a - b


def test_gaps_of_constraints(pair):
    robot, expected = pair
    loops = {loop.name: loop for loop in robot.file.loops}
    for state in expected["states"]:
        q = state_of(robot, state)[0]
        assert list(state["gaps"]) == list(loops)
        for name, answer in state["gaps"].items():
            answer = [*answer[:3], np.linalg.norm(answer[3:])] if len(answer) == 6 else answer
            assert gap(robot, loops[name], q) == pytest.approx(answer, abs=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_the_file_says_so_itself(name):
    """The stored figures name their source, and each file has some."""
    stored = json.loads(STORED.read_text(encoding="utf-8"))
    assert "MuJoCo" in stored["source"]
    assert len(stored[name]["states"]) == FEW


def test_angles_of_urdf_are_exact_at_a_pitch_of_90_degrees():
    rng = np.random.default_rng(3)
    for offset in (0.0, 1e-16, 1e-9, 1e-4):
        for roll, yaw in rng.uniform(-3.0, 3.0, (20, 2)):
            rotation = turn(2, yaw) @ turn(1, np.pi / 2 - offset) @ turn(0, roll)
            x, y, z = roll_pitch_yaw(rotation)
            assert np.abs(turn(2, z) @ turn(1, y) @ turn(0, x) - rotation).max() < 1e-15


@pytest.mark.tier2
def test_a_biped_of_mjcf_starts_closed_near_its_keyframe_and_keeps_its_energy():
    path = FILES / "biped.xml"
    far = bc.simulate(FILES / "biped.xml", duration=0.001, overrides={"initial.largest_correction": 1}).notes
    assert any("keyframe 'home' does not satisfy the constraints" in note for note in far)
    with pytest.raises(bc.InputError, match=r"keyframe 'home' places joint 'left-crank' at -1\.52 rad"):
        bc.simulate(path, duration=0.001)
    allowed = {"initial.largest_correction": 0.2}
    run, robot = bc.simulate(path, duration=0.02, samples=5, overrides=allowed), bc.load_robot(path)
    assert run.success
    assert run.constraint_residual() < 1e-10
    assert run.energy_drift() < 1e-6  # the work of the dampers included
    home = robot.file.start
    for name in ("left-knee", "left-tarsus", "left-crank", "left-foot"):
        assert run.position[0, robot.joint(name).q] == pytest.approx(home[name], abs=0.2)
