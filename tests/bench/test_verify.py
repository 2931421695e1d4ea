"""The textbook's equations, and the command that compares with them."""

import dataclasses

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.errors import InputError
from bellcrank_bench.textbook.four_bar import FourBarWithMultipliers
from bellcrank_bench.textbook.planar_2r import PlanarTwoLink
from bellcrank_bench.textbook.rolling_disk import SixCoordinateDisk
from bellcrank_bench.textbook.spring_pendulum import SpringPendulum
from bellcrank_bench.verification import VERIFIABLE
from bellcrank_bench.verification.verify import verify, verify_planar_2r

# A. Ghosal, lecture 18, scene 1, recomputed independently: tau1 min, max, tau2 min, max in N m at phi = 2 pi k / 1000
TABLE = {-1: (71.86823535828, 168.2846498082, 62.9079893977, 71.60635945914),
         1: (210.4184480206, 242.2724868525, 0.8249586697778, 33.25421705658)}  # fmt: skip
QUANTITIES = {
    "planar_2r": {"inverse dynamics", "forward dynamics", "mass matrix", "kinetic energy", "potential energy"},
    "planar_2r_swing": {"accelerations", "kinetic energy", "potential energy", "tip", "energy", "positions"},
    "spring_pendulum": {"accelerations", "kinetic energy", "coriolis", "centrifugal", "tangential", "velocities"},
    "four_bar": {"accelerations", "multipliers", "kinetic energy", "positions", "velocities"},
    "rolling_disk": {"accelerations", "normal force", "friction", "potential energy", "positions", "velocities"},
}


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


@pytest.mark.tier2
@pytest.mark.parametrize("name", VERIFIABLE)
def test_verify_finds_every_quantity_in_agreement(name):
    found = verify(name)
    assert {d.quantity for d in found} >= QUANTITIES[name]
    assert all(d.agrees for d in found) and max(d.relative for d in found) < (1e-9 if name == "rolling_disk" else 1e-10)
    assert max(d.samples for d in found if d.states == "random") == 1000


def test_verify_notices_a_wrong_robot(monkeypatch):
    heavier = dataclasses.replace(PlanarTwoLink(), m2=12.456 * (1 + 1e-9))
    monkeypatch.setattr("bellcrank_bench.verification.verify.PlanarTwoLink", lambda **_: heavier)
    robot = bc.load_robot("planar_2r", gravity=(0, -9.81, 0), friction="none")
    assert not all(d.agrees for d in verify_planar_2r(robot))
    wrong = {d.states for d in verify("planar_2r_swing") if not d.agrees}
    assert {"random", "run", "its end"} <= wrong


def test_verify_notices_a_wrong_spring_at_states_and_along_the_run(monkeypatch):
    stiffer = dataclasses.replace(SpringPendulum(), stiffness=15.0 * (1 + 1e-7))
    monkeypatch.setattr("bellcrank_bench.verification.verify.SpringPendulum", lambda: stiffer)
    wrong = {(d.quantity, d.states) for d in verify("spring_pendulum") if not d.agrees}
    assert {("accelerations", "random"), ("potential energy", "random"), ("positions", "its end")} <= wrong
    assert not any(quantity in ("kinetic energy", "coriolis", "centrifugal") for quantity, _ in wrong)


def test_verify_notices_a_wrong_rocker_in_accelerations_and_multipliers(monkeypatch):
    heavier = dataclasses.replace(FourBarWithMultipliers(), mass=(20.15, 8.25, 8.25 * (1 + 1e-8)))
    monkeypatch.setattr("bellcrank_bench.verification.constrained.FourBarWithMultipliers", lambda: heavier)
    wrong = {(d.quantity, d.states) for d in verify("four_bar") if not d.agrees}
    assert {("accelerations", "random"), ("multipliers", "random"), ("positions", "its end")} <= wrong


@pytest.mark.tier2
def test_verify_notices_a_disk_of_another_inertia(monkeypatch):
    thicker = dataclasses.replace(SixCoordinateDisk(), k=0.25 * (1 + 1e-7))
    monkeypatch.setattr("bellcrank_bench.verification.constrained.SixCoordinateDisk", lambda: thicker)
    wrong = {d.quantity for d in verify("rolling_disk") if not d.agrees}
    assert {"accelerations", "friction", "kinetic energy", "positions"} <= wrong


@pytest.mark.tier2
def test_verify_command_prints_the_differences_of_the_scenes_named_or_of_all(capsys):
    assert main(["verify", "spring_pendulum"]) == 0
    out = capsys.readouterr().out
    assert "coriolis" in out and "DIFFERS" not in out and "planar" not in out
    assert main(["verify"]) == 0
    out = capsys.readouterr().out
    assert all(f"{name}: compiled Pinocchio" in out for name in VERIFIABLE) and "mass matrix" in out


def test_verify_command_answers_no_where_a_quantity_differs(monkeypatch, capsys):
    monkeypatch.setattr("bellcrank_bench.verification.verify.PlanarTwoLink", lambda **_: PlanarTwoLink(g=9.8))
    assert main(["verify", "planar_2r", "spring_pendulum"]) == 1
    assert "DIFFERS" in capsys.readouterr().out


def test_verify_refuses_what_it_has_no_analytic_equations_for(capsys):
    assert main(["verify", "panda"]) == 2
    assert "unknown scene 'panda'" in capsys.readouterr().err
    with pytest.raises(InputError, match="planar 2R arm"):
        verify_planar_2r(bc.load_robot("ur5"))
