"""The thin disk that rolls: its steady motions are relative equilibria, with eigenvalues from the equations of its
angles.

With θ the angle of the disk's axis to the vertical, φ̇ the rate of precession, ω₃ the angular velocity about the
axis, and A = m r²/4, C = m r²/2 (J. I. Neimark & N. A. Fufaev, Dynamics of Nonholonomic Systems, 1972, ch. 2; O. M.
O'Reilly, The dynamics of rolling disks and sliding disks, Nonlinear Dynamics 10, 1996):

    (A + m r²) θ̈ = A φ̇² sin θ cos θ − (C + m r²) ω₃ φ̇ sin θ − m g r cos θ,
    A d(φ̇ sin θ)/dt = (C ω₃ − A φ̇ cos θ) θ̇,
    (C + m r²) ω̇₃ = m r² φ̇ θ̇ sin θ.

Steady motions have θ̇ = 0. About one of them (θ + ε, φ̇ + u, ω₃ + w), u = (C ω₃ − 2 A φ̇ cos θ)/(A sin θ) ε and
w = m r² φ̇ sin θ/(C + m r²) ε, and (A + m r²) ε̈ = k ε with

    k = A φ̇² cos 2θ − (C + m r²) ω₃ φ̇ cos θ + m g r sin θ − m r² φ̇² sin² θ
        + (2 A φ̇ cos θ − (C + m r²) ω₃) (C ω₃ − 2 A φ̇ cos θ)/A.

For the upright disk (θ = 90°) that rolls straight (φ̇ = 0) it is stable for ω₃² > g/(3 r), for one that spins on the
spot (ω₃ = 0) for φ̇² > 4 g/(5 r).
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import bellcrank as bc

G, R, M = 9.81, 0.1, 0.5
A, C, MRR = M * R * R / 4.0, M * R * R / 2.0, M * R * R


def angles(linear):
    """cos θ, φ̇ and ω₃ of an operating point."""
    turn = Rotation.from_quat(linear.position[3:7])
    axis, spin = turn.apply([0.0, 1.0, 0.0]), turn.apply(linear.velocity[3:6])
    about = float(spin @ axis)
    return axis[2], (spin[2] - about * axis[2]) / (1.0 - axis[2] ** 2), about


def expected(linear):
    """±√(k/(A + m r²)), and the residual of the first equation at the operating point, N m."""
    c, rate, spin = angles(linear)
    s = np.sqrt(1.0 - c * c)
    stiffness = A * rate**2 * (c * c - s * s) - (C + MRR) * spin * rate * c + M * G * R * s - MRR * (rate * s) ** 2
    stiffness += (2.0 * A * rate * c - (C + MRR) * spin) * (C * spin - 2.0 * A * rate * c) / A
    root = np.sqrt(complex(stiffness / (A + MRR)))
    return root, A * rate**2 * s * c - (C + MRR) * spin * rate * s - M * G * R * c


def disk(rpy, spin):
    base = {"rpy": rpy, "angular_velocity": spin, "expressed_in": "body"}
    return bc.load_scene("rolling_disk", {"base": base})


def check(linear):
    assert linear.kind == "relative equilibrium"
    root, residual = expected(linear)
    assert abs(residual) < 1e-12
    found = linear.eigenvalues
    assert len(found) == 4 and np.sort(np.abs(found))[:2].max() < 1e-9 * abs(root)
    for value in (root, -root):
        assert np.abs(found - value).min() < 1e-11 * max(1.0, abs(root))


@pytest.mark.parametrize("share", [0.5, 0.999999, 1.000001, 2.0])
def test_upright_rolling_is_stable_exactly_above_its_threshold(share):
    """Ω² > g/(3 r)."""
    linear = bc.linearise(disk([0, 0, 0.3], [0.0, float(np.sqrt(share * G / (3.0 * R))), 0.0]))
    assert linear.stable is (share > 1.0)
    if abs(share - 1.0) > 1e-3:  # near the threshold λ is the root of a difference
        check(linear)


@pytest.mark.parametrize("share", [0.5, 0.999999, 1.000001, 2.0])
def test_spinning_on_the_spot_is_stable_exactly_above_its_threshold(share):
    """φ̇² > 4 g/(5 r)."""
    linear = bc.linearise(disk([0, 0, 0.3], [0.0, 0.0, float(np.sqrt(share * 4.0 * G / (5.0 * R)))]))
    assert linear.stable is (share > 1.0)
    if abs(share - 1.0) > 1e-3:
        check(linear)


@pytest.mark.parametrize("lean", [5.0, 20.0, 40.0, 60.0])
@pytest.mark.parametrize("rate", [3.0, 8.0, 15.0])
def test_steady_circles(lean, rate):
    """The disk leans by `lean` and precesses at about `rate` rad/s; ω₃ follows from the first equation."""
    theta = np.pi / 2.0 + np.radians(lean)
    s, c = np.sin(theta), np.cos(theta)
    spin = (A * rate**2 * s * c - M * G * R * c) / ((C + MRR) * rate * s)
    # rolled by −lean about x, the axis y points downwards by the lean; precession about the vertical has a part along z
    guess = disk([f"{-lean} deg", 0, 0], [0.0, float(spin), float(rate * s)])
    linear = bc.linearise(guess)
    assert np.degrees(np.arccos(angles(linear)[0])) == pytest.approx(90.0 + lean, abs=0.5)
    check(linear)


def test_the_disk_in_six_coordinates_has_the_same_eigenvalues():
    """Coordinates of Ghosal's lecture instead of a free base: other symmetries (shifts of joints), the same modes."""
    speed = 9.0
    free = bc.linearise(disk([0, 0, 0.7], [0.0, speed, 0.0]))
    start = {"x": 0, "y": 0, "z": {"guess": 0.1}, "heading": 0.7, "tilt": 0, "spin": 0}
    six = bc.linearise(
        bc.load_scene("rolling_disk_six", {"initial": start | {"velocity": {"heading": 0, "tilt": 0, "spin": speed}}})
    )
    assert six.kind == free.kind == "relative equilibrium"
    # a turn of the heading is no symmetry of these coordinates by itself: one more 0
    assert np.sort(np.abs(six.eigenvalues))[1:] == pytest.approx(np.sort(np.abs(free.eigenvalues)), abs=1e-10)
    assert six.symmetries == ("shift of x", "shift of y", "shift of spin")


def test_a_frozen_matrix_of_a_turning_body_has_other_eigenvalues():
    """Why relative equilibria are needed: A at one moment, in the body's axes, is stable where the motion is not."""
    scene = disk([0, 0, 0], [0.0, 5.0, 0.0])
    linear = bc.linearise(scene, keep_symmetries=True)
    frozen = bc.scene_derivatives(scene)
    whole = np.block(
        [[np.zeros((6, 6)), np.eye(6)], [frozen.of_acceleration.position, frozen.of_acceleration.velocity]]
    )
    growth = np.linalg.eigvals(whole).real.max()
    assert linear.stable is False
    assert not np.isclose(growth, linear.eigenvalues.real.max(), rtol=1e-2)
