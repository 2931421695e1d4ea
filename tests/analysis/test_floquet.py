"""Floquet multipliers against closed forms and against relative equilibria."""

import numpy as np
import pytest
from scipy.special import ellipk

import bellcrank as bc
from bellcrank.errors import InputError
from tests.analysis.test_rolling_disk import MRR, A, C, G, M, R, disk


def test_a_swinging_pendulum_has_two_multipliers_of_one():
    """T = 4 K(sin(a/2))/√(g/l); Φ is [[1, ·], [·, 1]]-like: trace 2 and determinant 1 (Liouville), defective."""
    amplitude = 1.2
    scene = bc.load_scene("pendulum", {"initial.swing": amplitude})
    found = bc.floquet(scene, float(4.0 * ellipk(np.sin(amplitude / 2.0) ** 2) / np.sqrt(G)))
    assert np.trace(found.monodromy) == pytest.approx(2.0, abs=1e-10)
    assert np.linalg.det(found.monodromy) == pytest.approx(1.0, abs=1e-10)
    # dT/da ≠ 0: a larger swing lags, which the off-diagonal entry says; from the derivative of K
    step = 1e-4
    longer, shorter = (4.0 * ellipk(np.sin((amplitude + s * step) / 2) ** 2) / np.sqrt(G) for s in (1, -1))
    lag = (longer - shorter) / (2 * step)
    acceleration = -G * np.sin(amplitude)
    assert found.monodromy[1, 0] == pytest.approx(-acceleration * lag, rel=1e-6)
    assert found.stable


def test_the_monodromy_from_another_moment_is_the_same_map_along_the_motion():
    """Φ(t) = X(t) Φ(0) X(t)⁻¹: trace and determinant stay, and the velocity of the orbit is kept: Φ ẋ = ẋ."""
    amplitude, at = 1.2, 0.37
    scene = bc.load_scene("pendulum", {"initial.swing": amplitude})
    period = float(4.0 * ellipk(np.sin(amplitude / 2.0) ** 2) / np.sqrt(G))
    found = bc.floquet(scene, period, at=at)
    assert np.trace(found.monodromy) == pytest.approx(2.0, abs=1e-10)
    assert np.linalg.det(found.monodromy) == pytest.approx(1.0, abs=1e-10)
    run = bc.simulate(scene, at, rtol=1e-12, atol=1e-12)
    along = np.array([run.velocity[-1, 0], -G * np.sin(run.position[-1, 0])])
    assert found.monodromy @ along == pytest.approx(along, rel=1e-8)
    assert np.abs(found.monodromy - bc.floquet(scene, period).monodromy).max() > 0.1


def steady_circle(lean, rate):
    """θ, φ̇ and ω₃ of a steady circle (test_rolling_disk.py)."""
    theta = np.pi / 2.0 + np.radians(lean)
    s, c = np.sin(theta), np.cos(theta)
    return theta, (A * rate**2 * s * c - M * G * R * c) / ((C + MRR) * rate * s)


@pytest.mark.tier2
@pytest.mark.parametrize(("lean", "rate"), [(20.0, 8.0), (40.0, 12.0)])
def test_a_steady_circle_without_reduction_has_the_multipliers_of_its_relative_equilibrium(lean, rate):
    """In six coordinates the circle is no relative equilibrium of the symmetries that are known there; exp(λ T) of the
    free base's eigenvalues are its multipliers.
    """
    theta, spin = steady_circle(lean, rate)
    free = bc.linearise(disk([f"{-lean} deg", 0, 0], [0.0, float(spin), float(rate * np.sin(theta))]))
    assert free.kind == "relative equilibrium"
    # ω = φ̇ ẑ + ψ̇ axis, so that ψ̇ = ω₃ − φ̇ cos θ; the tilt of the lecture's coordinates is −lean
    start = {"x": 0, "y": 0, "z": {"guess": float(R * np.sin(theta))}, "heading": 0, "tilt": f"{-lean} deg", "spin": 0}
    velocity = {"heading": rate, "tilt": 0, "spin": float(spin - rate * np.cos(theta))}
    scene = bc.load_scene("rolling_disk_six", {"initial": start | {"velocity": velocity}})
    assert bc.linearise(scene, at="start").kind == "not steady"
    period = 2.0 * np.pi / rate
    found = bc.floquet(scene, float(period))
    largest = free.eigenvalues[np.argmax(np.abs(free.eigenvalues))]
    for value in np.exp(np.array([largest, np.conj(largest)]) * period):
        assert np.abs(found.multipliers - value).min() < 1e-7
    assert found.stable == free.stable


def test_a_motion_that_does_not_return_is_refused():
    with pytest.raises(InputError, match=r"does not return after 1\.5 s: the velocities differ"):
        bc.floquet(bc.load_scene("pendulum", {"initial.swing": 1.2}), 1.5)
