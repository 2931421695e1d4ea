"""The textbook's equations, and the command that compares with them."""

import dataclasses

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.errors import InputError
from bellcrank.validation.textbook import PlanarTwoLink
from bellcrank.validation.verify import verify, verify_planar_2r

# A. Ghosal, lecture 18, scene 1, recomputed independently: tau1 min, max, tau2 min, max in N m at phi = 2 pi k / 1000
TABLE = {-1: (71.86823535828, 168.2846498082, 62.9079893977, 71.60635945914),
         1: (210.4184480206, 242.2724868525, 0.8249586697778, 33.25421705658)}  # fmt: skip


@pytest.mark.parametrize("elbow", [-1, 1])
def test_compiled_torques_of_the_lecture_circle_give_the_table(elbow):
    robot = bc.load_robot("planar_2r", gravity=(0, -9.81, 0), friction="none")
    q, v, a = PlanarTwoLink().circle(2 * np.pi * np.arange(1001) / 1000, 2 * np.pi / 10, elbow)
    tau = robot.inverse_dynamics(q, v, a)
    found = (tau[:, 0].min(), tau[:, 0].max(), tau[:, 1].min(), tau[:, 1].max())
    np.testing.assert_allclose(found, TABLE[elbow], rtol=1e-11)


def test_the_textbook_equations_conserve_energy_by_themselves():
    arm = PlanarTwoLink()
    state = np.array([-np.pi / 2, np.pi / 4, 0.0, 0.0])

    def rate(x):
        return np.concatenate([x[2:], arm.forward_dynamics(x[:2], x[2:], np.zeros(2))])

    before, h = sum(arm.energy(state[:2], state[2:])), 1e-3
    for _ in range(2000):
        k1 = rate(state)
        k2 = rate(state + h / 2 * k1)
        k3 = rate(state + h / 2 * k2)
        k4 = rate(state + h * k3)
        state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    assert sum(arm.energy(state[:2], state[2:])) == pytest.approx(before, abs=1e-7)


def test_verify_finds_every_quantity_in_agreement():
    found = verify("planar_2r")
    assert {d.quantity for d in found} >= {"inverse dynamics", "forward dynamics", "mass matrix", "kinetic energy"}
    assert all(d.agrees for d in found) and max(d.relative for d in found) < 1e-12


def test_verify_notices_a_wrong_robot(monkeypatch):
    heavier = dataclasses.replace(PlanarTwoLink(), m2=12.456 * (1 + 1e-9))
    monkeypatch.setattr("bellcrank.validation.verify.PlanarTwoLink", lambda g: heavier)
    robot = bc.load_robot("planar_2r", gravity=(0, -9.81, 0), friction="none")
    assert not all(d.agrees for d in verify_planar_2r(robot))


def test_verify_command_prints_the_differences(capsys):
    assert main(["verify", "planar_2r"]) == 0
    assert "mass matrix" in capsys.readouterr().out


def test_verify_refuses_a_robot_without_analytic_equations(capsys):
    assert main(["verify", "panda"]) == 2
    assert "no scene 'panda'" in capsys.readouterr().err
    with pytest.raises(InputError, match="planar 2R arm"):
        verify_planar_2r(bc.load_robot("ur5"))
