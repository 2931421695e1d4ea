"""The benchmark bicycle: rolling disks, a free base and a steady speed, against published linear equations."""

import numpy as np
import pytest

import bellcrank as bc
from tests.support.benchmark_bicycle import REAR_RADIUS, published_eigenvalues, write_bicycle

FRAME_AND_WHEEL = ("frame", "rear_wheel")
SPEEDS = [0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0]


def distance(found, expected):
    """The largest distance of an expected eigenvalue to the nearest found one, relative to it where it exceeds 1/s."""
    return max(np.abs(found - x).min() / max(1.0, abs(x)) for x in expected)


@pytest.mark.tier2
@pytest.mark.parametrize("speed", SPEEDS)
def test_eigenvalues_are_the_published_ones(speed, tmp_path):
    linear = bc.linearise(write_bicycle(tmp_path, speed))
    assert linear.kind == ("relative equilibrium" if speed else "equilibrium")
    assert distance(linear.eigenvalues, published_eigenvalues(speed)) < 1e-12
    # what remains is the forward speed, which may be any, and at rest also where the bicycle stands
    others = len(linear.eigenvalues) - 4
    assert others == (1 if speed else 6)
    assert np.sort(np.abs(linear.eigenvalues))[:others].max() < 1e-12


@pytest.mark.tier2
def test_it_is_stable_between_weave_and_capsize_speeds_only(tmp_path):
    """Weave speed 4.292 m/s and capsize speed 6.024 m/s: Meijaard et al. 2007, section 6."""
    stable = {speed: bc.linearise(write_bicycle(tmp_path, speed)).stable for speed in (4.29, 4.30, 6.02, 6.03)}
    assert stable == {4.29: False, 4.30: True, 6.02: True, 6.03: False}


def test_a_start_that_does_not_quite_roll_is_moved_to_the_steady_motion(tmp_path):
    """The steering angle and the yaw rate do not fit the lean at this speed."""
    rolling = {"steer": 0.02, "rear_axle": 0, "front_axle": 0, "velocity": {"rear_axle": 5.0 / REAR_RADIUS}}
    base = {"position": {"guess": [0, 0, REAR_RADIUS]}, "rpy": {"guess": [0.05, 0.0, 0.3]}}
    scene = bc.load_scene(write_bicycle(tmp_path, 5.0), {"initial": rolling, "base": base})
    linear = bc.linearise(scene)
    assert bc.linearise(scene, at="start").kind == "not steady"
    assert linear.kind == "relative equilibrium" and linear.residual < 1e-12


@pytest.mark.tier2
@pytest.mark.parametrize("speed", [1.0, 5.0, 9.0])
def test_the_free_base_may_be_the_rear_wheel(speed, tmp_path):
    """The axes of v then turn with the wheel, and the motion is along a turn of the base in its own axes combined with
    a shift of the rear axle. The start is anywhere on the way: turned by 0.7 rad, heading to 0.4 rad.
    """
    path = write_bicycle(tmp_path, speed)
    urdf = tmp_path / "bicycle.urdf"
    before, after = (f'<parent link="{a}"/><child link="{b}"/>' for a, b in (FRAME_AND_WHEEL, FRAME_AND_WHEEL[::-1]))
    urdf.write_text(urdf.read_text().replace(before, after))
    rate, heading = speed / REAR_RADIUS, np.array([-np.sin(0.4), np.cos(0.4)])
    spin = [*(rate * heading).tolist(), 0.0]
    scene = bc.load_scene(path, {
        "base": {"position": [0, 0, REAR_RADIUS], "rpy": [0, 0.7, 0.4], "angular_velocity": spin},
        "initial": {"steer": 0, "rear_axle": -0.7, "front_axle": 0, "velocity": {"steer": 0, "rear_axle": -rate}},
    })  # fmt: skip
    linear = bc.linearise(scene, at="start")
    assert linear.kind == "relative equilibrium" and len(linear.eigenvalues) == 5
    assert distance(linear.eigenvalues, published_eigenvalues(speed)) < 1e-12
    assert "rotation about y of root_joint in its own axes" in linear.symmetries


def test_steer_torque_is_an_input_and_the_lean_follows(tmp_path):
    """G(s) from steer torque to (lean, steer) of the published equations: (M s² + v C1 s + g K0 + v² K2)⁻¹ (0, 1)."""
    from tests.support.benchmark_bicycle import DAMPING, GRAVITY, GRAVITY_STIFFNESS, MASS, SPEED_STIFFNESS

    speed, s = 5.0, 2.0 + 3.0j
    linear = bc.linearise(write_bicycle(tmp_path, speed), inputs=["steer"])
    names = [name for name, _ in linear.states]
    rows = [names.index("root_joint rotation x"), names.index("steer")]
    found = np.linalg.solve(s * np.eye(len(names)) - linear.A, linear.B[:, 0])[rows]
    stiffness = GRAVITY * GRAVITY_STIFFNESS + speed**2 * SPEED_STIFFNESS
    # here y is to the left and the axis upwards: steer and lean to the right are as in the paper, up to the axes' signs
    expected = np.linalg.solve(MASS * s * s + speed * DAMPING * s + stiffness, np.array([0.0, 1.0]))
    assert np.abs(found) == pytest.approx(np.abs(expected), rel=1e-10)
